//! Times of samples: SMPTE timecodes with fractions of a frame, clock times, plain numbers in the unit that their steps
//! show; and the times of a recording from them.
//!
//! Live Link Face writes `HH:MM:SS:FF.fff`, FF in frames of 60 per second (30 in older versions), with `;` before FF
//! where the device counts drop frames. Drop frame (SMPTE ST 12-1): numbers 0 and 1 (0 to 3 at 60) are left out at the
//! start of every minute but each tenth, so that the numbers follow the clock at 30000/1001 (60000/1001) frames per
//! second.

/// One written time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stamp {
    /// Seconds.
    Seconds(f64),
    /// A number whose unit is not written.
    Number(f64),
    /// Whole seconds of the day, frames and whether the numbers drop.
    Frames { seconds: u32, frame: f64, drop: bool },
}

/// Reads one time.
pub(super) fn parse(text: &str) -> Option<Stamp> {
    let text = text.trim();
    let parts: Vec<&str> = text.split([':', ';']).collect();
    let whole = |s: &str| s.parse::<u32>().ok().filter(|n| *n < 100_000);
    let fraction = |s: &str| {
        let plain = !s.is_empty() && s.bytes().all(|b| b.is_ascii_digit() || b == b'.');
        s.parse::<f64>().ok().filter(|n| plain && n.is_finite())
    };
    match parts[..] {
        [number] => {
            // Spreadsheets and pandas write small numbers as 1e-05.
            let plain = number.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b));
            number.parse().ok().filter(|n: &f64| plain && n.is_finite()).map(Stamp::Number)
        }
        [h, m, s] => {
            let (h, m, s) = (whole(h)?, whole(m).filter(|m| *m < 60)?, fraction(s).filter(|s| *s < 60.0)?);
            Some(Stamp::Seconds(f64::from(h) * 3600.0 + f64::from(m) * 60.0 + s))
        }
        [h, m, s, f] => {
            let (h, m, s) = (whole(h)?, whole(m).filter(|m| *m < 60)?, whole(s).filter(|s| *s < 60)?);
            let frame = fraction(f).filter(|f| *f < 1000.0)?;
            Some(Stamp::Frames { seconds: h * 3600 + m * 60 + s, frame, drop: text.contains(';') })
        }
        _ => None,
    }
}

/// How frames of a timecode count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rate {
    /// Frame numbers in a second.
    pub(super) base: u32,
    /// The clock runs at base * 1000 / 1001.
    pub(super) ntsc: bool,
    /// Numbers are left out.
    pub(super) drop: bool,
}

impl Rate {
    /// The rate that a take shows, and whether it does. Where the seconds turn over, the frame number falls by a second
    /// less one step. Takes without such a place show the smallest common base above their highest frame number, if
    /// they last two seconds; shorter ones have 60, what the app writes.
    pub(super) fn of(stamps: &[Stamp], asked: Option<f64>) -> (Self, bool) {
        const COMMON: [u32; 9] = [24, 25, 30, 48, 50, 60, 120, 240, 1000];
        let frames: Vec<(u32, f64)> = stamps
            .iter()
            .filter_map(|stamp| match stamp {
                Stamp::Frames { seconds, frame, .. } => Some((*seconds, *frame)),
                _ => None,
            })
            .collect();
        let drop = stamps.iter().any(|s| matches!(s, Stamp::Frames { drop: true, .. }));
        let highest = frames.iter().map(|(_, frame)| frame.floor()).fold(0.0, f64::max);
        let above = || COMMON.into_iter().filter(|b| f64::from(*b) > highest);
        let first = frames.iter().map(|(seconds, _)| *seconds).min().unwrap_or(0);
        let last = frames.iter().map(|(seconds, _)| *seconds).max().unwrap_or(0);
        let whole_second_seen = last - first >= 2;
        let turn = turnover(&frames);
        let nearest = turn.and_then(|base| {
            let away = |b: &u32| (f64::from(*b) - base).abs();
            above().min_by(|a, b| away(a).total_cmp(&away(b))).filter(|b| away(b) <= 0.06 * f64::from(*b))
        });
        let (base, shown) = match (asked, nearest) {
            (Some(rate), _) => (rate.round().clamp(1.0, 1000.0) as u32, true),
            (None, Some(base)) => (base, true),
            (None, None) if whole_second_seen || highest >= 60.0 => (above().next().unwrap_or(1000), true),
            (None, None) => (60, frames.len() < 2),
        };
        let ntsc = drop || asked.is_some_and(|rate| (rate - rate.round()).abs() > 1e-4);
        (Self { base, ntsc, drop: drop && base % 30 == 0 }, shown)
    }

    /// Seconds since midnight.
    pub(super) fn seconds(&self, stamp: Stamp) -> f64 {
        match stamp {
            Stamp::Seconds(s) | Stamp::Number(s) => s,
            Stamp::Frames { seconds, frame, .. } => {
                let minutes = seconds / 60;
                let left_out = if self.drop { self.base / 15 * (minutes - minutes / 10) } else { 0 };
                let frames = f64::from(seconds) * f64::from(self.base) + frame - f64::from(left_out);
                frames / f64::from(self.base) * if self.ntsc { 1.001 } else { 1.0 }
            }
        }
    }
}

/// Frames in a second as the places tell where the seconds turn over: the median of them. Full minutes are left out, as
/// numbers may drop there.
fn turnover(frames: &[(u32, f64)]) -> Option<f64> {
    let pairs = || frames.windows(2).map(|w| (w[0], w[1]));
    let mut steps: Vec<f64> =
        pairs().filter(|(a, b)| a.0 == b.0 && b.1 > a.1).map(|(a, b)| b.1 - a.1).collect();
    let step = median(&mut steps)?;
    let mut bases: Vec<f64> = pairs()
        .filter(|(a, b)| b.0 == a.0 + 1 && b.1 < a.1 && b.0 % 60 != 0)
        .map(|(a, b)| a.1 - b.1 + step)
        .collect();
    median(&mut bases)
}

fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Unit of plain numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    pub(super) name: &'static str,
    pub(super) seconds: f64,
}

pub(super) const SECONDS: Unit = Unit { name: "seconds", seconds: 1.0 };
const UNITS: [Unit; 4] = [
    SECONDS,
    Unit { name: "milliseconds", seconds: 1e-3 },
    Unit { name: "microseconds", seconds: 1e-6 },
    Unit { name: "nanoseconds", seconds: 1e-9 },
];
/// Samples of a face are not further apart than this: the largest unit in which a median step is not longer is taken.
const LONGEST_STEP_S: f64 = 1.0;

impl Unit {
    /// The unit that the name of a column or field ends in: `timestampMs`, `timestamp_us`, `time (ns)`.
    pub(super) fn of_name(name: &str) -> Option<Self> {
        let name = name.trim_end_matches([')', ']', ' ']);
        let lower = name.to_lowercase();
        let ends = |mark: &str| {
            let Some(stem) = lower.strip_suffix(mark) else { return false };
            let before = name[..stem.len()].chars().next_back();
            // `timestampMs`, and a word of its own; but not `items`.
            before.is_none_or(|c| !c.is_alphanumeric())
                || name[stem.len()..].starts_with(|c: char| c.is_uppercase())
                    && before.is_some_and(char::is_lowercase)
        };
        let [s, ms, us, ns] = UNITS;
        [
            (ms, ["ms", "msec", "millis", "milliseconds"]),
            (us, ["us", "usec", "micros", "microseconds"]),
            (ns, ["ns", "nsec", "nanos", "nanoseconds"]),
            (s, ["s", "sec", "secs", "seconds"]),
        ]
        .into_iter()
        .find(|(_, marks)| marks.iter().any(|mark| ends(mark)))
        .map(|(unit, _)| unit)
    }

    /// The unit of numbers, from the name of their column if that makes sense of their steps, else from the steps: the
    /// one in which a median step is a thousandth of a second to a second. The note tells what was not written or not
    /// believed.
    pub(super) fn of(name: &str, numbers: &[f64]) -> (Self, Option<String>) {
        let mut steps: Vec<f64> = numbers.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0).collect();
        let named = Self::of_name(name);
        let Some(step) = median(&mut steps) else { return (named.unwrap_or(SECONDS), None) };
        // Wider than for a guess: somebody wrote the name.
        let fits = |unit: &Self| (1e-4..=60.0 * LONGEST_STEP_S).contains(&(step * unit.seconds));
        if let Some(unit) = named.filter(fits) {
            return (unit, None);
        }
        let unit = UNITS.into_iter().find(|unit| step * unit.seconds <= LONGEST_STEP_S).unwrap_or(UNITS[3]);
        let note = match named {
            Some(named) if named != unit => Some(format!(
                "{name} steps by {step}, which as {} is no recording: it is read as {}",
                named.name, unit.name
            )),
            None if unit != SECONDS => Some(format!("{name} steps by {step} and is read as {}", unit.name)),
            None if step > 0.5 => Some(format!(
                "{name} steps by {step} and is read as seconds; if they are frames or milliseconds, divide them"
            )),
            _ => None,
        };
        (unit, note)
    }
}

/// Samples after a step back within which a clock that was not set back has caught up.
const REORDERED: usize = 3;
/// A longer step than this is told, if it is longer than the others.
const GAP_S: f64 = 0.25;
/// Two samples nearer in time than this are one.
const SAME_S: f64 = 1e-6;
const DAY_S: f64 = 86_400.0;

/// Times from 0 that always rise, and which samples have one.
#[derive(Debug, Default)]
pub(super) struct Timeline {
    pub(super) times_s: Vec<f64>,
    pub(super) keep: Vec<bool>,
    pub(super) notes: Vec<String>,
}

impl Timeline {
    /// `seconds` as written, from any start. Times of a day (`of_day`) may pass midnight. What repeats the time before
    /// it, or is late by up to three samples, is left out; a clock that was set back goes on one step after the sample
    /// before.
    pub(super) fn new(seconds: &[f64], of_day: bool) -> Self {
        let mut steps: Vec<f64> = seconds.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > SAME_S).collect();
        let step = median(&mut steps).unwrap_or(1.0 / 60.0);
        let mut this = Self { keep: Vec::with_capacity(seconds.len()), ..Self::default() };
        let Some(start) = seconds.first() else { return this };
        let mut shift = -start;
        let (mut same, mut late) = (0, 0);
        let mut set_back: Vec<(usize, f64)> = Vec::new();
        for (i, written) in seconds.iter().enumerate() {
            let mut time = written + shift;
            let before = this.times_s.last().copied();
            if let Some(before) = before
                && time < before - SAME_S
            {
                let after = |shift: f64| {
                    seconds[i + 1..].iter().take(REORDERED).any(|next| next + shift > before + SAME_S)
                };
                if of_day && before - time > 0.5 * DAY_S {
                    shift += DAY_S;
                } else if !after(shift) && i + 1 < seconds.len() {
                    set_back.push((i, before - time));
                    shift += before + step - time;
                }
                time = written + shift;
            }
            let keep = before.is_none_or(|before| time > before + SAME_S);
            match before {
                Some(before) if !keep && time < before - SAME_S => late += 1,
                Some(_) if !keep => same += 1,
                _ => {}
            }
            this.keep.push(keep);
            if keep {
                this.times_s.push(time);
            }
        }
        if same > 0 {
            this.notes.push(format!("{same} samples that repeat the time before them were left out"));
        }
        if late > 0 {
            this.notes.push(format!("{late} samples that come too late were left out"));
        }
        if let Some((sample, by)) = set_back.first() {
            this.notes.push(format!(
                "the clock was set back {} times (first by {by:.3} s at sample {sample}): the recording goes on in step",
                set_back.len()
            ));
        }
        let gap = this.times_s.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        if gap > GAP_S && gap > 1.5 * step {
            this.notes.push(format!("a gap of {gap:.2} s was bridged by a straight line"));
        }
        this
    }

    /// The values of the samples that are kept.
    pub(super) fn retain<T>(&self, values: &mut Vec<T>) {
        let mut kept = self.keep.iter();
        values.retain(|_| kept.next().copied().unwrap_or(false));
    }
}
