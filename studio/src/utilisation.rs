//! What is at work while frames are drawn: shares of the wall time.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What threads of a run do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    /// Shots of frames to come.
    Evaluate,
    /// Commands for the device.
    Record,
    /// Copies out of memory of the device.
    Read,
    /// Pictures to files in memory.
    Encode,
    /// Files.
    Write,
}

/// Notes when threads work.
pub(crate) struct Clock {
    started: Instant,
    spans: Mutex<Vec<Span>>,
}

/// Seconds from the start, first and last.
type Span = (Work, [f64; 2]);

/// Shares of the time in which frames are drawn and written, 0 to 1. They overlap, so that their sum may be above 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub struct Utilisation {
    /// That time, from the first command to the last file.
    pub seconds: f64,
    /// The device draws, by its timestamps; none on a device without.
    pub device: Option<f64>,
    /// A thread evaluates the performance.
    pub evaluate: f64,
    /// A thread records commands for the device.
    pub record: f64,
    /// A thread copies pictures and channels out of memory of the device.
    pub read: f64,
    /// A thread encodes pictures and channels.
    pub encode: f64,
    /// A thread writes files.
    pub write: f64,
    /// No thread does any of that: all wait for the device.
    pub idle: f64,
    /// Mean number of threads that do. Those of a software device are not counted.
    pub threads: f64,
    /// Threads that the machine runs at once.
    pub processors: usize,
}

impl Clock {
    pub(crate) fn start() -> Self {
        Self { started: Instant::now(), spans: Mutex::new(Vec::new()) }
    }

    /// Does work and notes when.
    pub(crate) fn time<T>(&self, work: Work, act: impl FnOnce() -> T) -> T {
        let from = self.started.elapsed().as_secs_f64();
        let result = act();
        let to = self.started.elapsed().as_secs_f64();
        self.spans.lock().unwrap_or_else(PoisonError::into_inner).push((work, [from, to]));
        result
    }

    /// What was at work until now; `device_ms` are the times of the frames on the device.
    pub(crate) fn utilisation(&self, device_ms: Option<f64>) -> Utilisation {
        let spans = self.spans.lock().unwrap_or_else(PoisonError::into_inner);
        of_spans(&spans, self.started.elapsed().as_secs_f64(), device_ms)
    }
}

fn of_spans(spans: &[Span], seconds: f64, device_ms: Option<f64>) -> Utilisation {
    let whole = seconds.max(f64::MIN_POSITIVE);
    let of = |is: &dyn Fn(Work) -> bool| {
        covered(spans.iter().filter(|(work, _)| is(*work)).map(|(_, span)| *span)) / whole
    };
    let share = |work: Work| of(&|other| other == work);
    Utilisation {
        seconds,
        // Frames of a device that draws two at once are counted twice.
        device: device_ms.map(|ms| (1e-3 * ms / whole).min(1.0)),
        evaluate: share(Work::Evaluate),
        record: share(Work::Record),
        read: share(Work::Read),
        encode: share(Work::Encode),
        write: share(Work::Write),
        idle: (1.0 - of(&|_| true)).max(0.0),
        threads: spans.iter().map(|(_, [from, to])| to - from).sum::<f64>() / whole,
        processors: std::thread::available_parallelism().map_or(1, usize::from),
    }
}

/// Length of the union of spans.
fn covered(spans: impl Iterator<Item = [f64; 2]>) -> f64 {
    let mut spans: Vec<[f64; 2]> = spans.collect();
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (mut sum, mut end) = (0.0, f64::NEG_INFINITY);
    for [from, to] in spans {
        sum += (to - from.max(end)).max(0.0);
        end = end.max(to);
    }
    sum
}

impl std::fmt::Display for Utilisation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let percent = |share: f64| (100.0 * share).round();
        write!(f, "{:.1} s: ", self.seconds)?;
        if let Some(device) = self.device {
            write!(f, "device {} %, ", percent(device))?;
        }
        let all = [
            ("evaluate", self.evaluate),
            ("record", self.record),
            ("read", self.read),
            ("encode", self.encode),
            ("write", self.write),
        ];
        for (what, share) in all {
            write!(f, "{what} {} %, ", percent(share))?;
        }
        write!(f, "idle {} %; {:.1} of {} threads", percent(self.idle), self.threads, self.processors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_of_the_union_of_spans() {
        let spans = [
            (Work::Encode, [1.0, 3.0]),
            (Work::Encode, [2.0, 4.0]),
            (Work::Encode, [2.5, 2.75]),
            (Work::Write, [3.5, 4.5]),
            (Work::Evaluate, [9.0, 10.0]),
        ];
        let found = of_spans(&spans, 10.0, Some(6500.0));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} is not {b}");
        near(found.encode, 0.3);
        near(found.write, 0.1);
        near(found.evaluate, 0.1);
        near(found.record + found.read, 0.0);
        near(found.idle, 1.0 - 0.35 - 0.1);
        near(found.threads, 0.625);
        near(found.device.unwrap(), 0.65);
        let line = found.to_string();
        assert!(line.starts_with("10.0 s: device 65 %, evaluate 10 %, record 0 %"), "{line}");
        assert_eq!(of_spans(&[], 0.0, None).device, None);
    }

    #[test]
    fn a_clock_notes_what_it_times() {
        let clock = Clock::start();
        let nap = std::time::Duration::from_millis(20);
        assert_eq!(
            clock.time(Work::Read, || {
                std::thread::sleep(nap);
                7
            }),
            7
        );
        std::thread::sleep(nap);
        let found = clock.utilisation(None);
        assert!(found.read > 0.05 && found.read < 0.95 && found.idle > 0.05, "{found:?}");
        assert!((found.read + found.idle - 1.0).abs() < 1e-9);
    }
}
