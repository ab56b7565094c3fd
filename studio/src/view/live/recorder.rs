//! Weights that arrived over time become tracks of a sequence.
//!
//! A weight is kept at the times at which it changed; keys that a straight line between others says already are left out
//! (U. Ramer 1972; D. Douglas and T. Peucker 1973, with the distance along the value).

use std::collections::BTreeMap;
use std::time::Instant;

use rubor_rig::timeline::{Ease, Key};

use super::super::pose::{Group, Pose};
use super::super::tracks::{Keyed, path_of};

/// Largest change of a weight by what is left out.
const WEIGHT_ERROR: f32 = 0.004;
/// The same of an angle, degrees.
const DEGREES_ERROR: f32 = 0.1;
/// Samples of a track that are kept: an hour at 60 a second.
const MOST_SAMPLES: usize = 216_000;

/// A recording that runs.
#[derive(Clone, Debug)]
pub struct Recorder {
    start: Instant,
    /// Seconds of the sequence at which it started.
    offset_s: f64,
    /// By field and name.
    series: BTreeMap<(String, String), Vec<(f64, f32)>>,
}

impl Recorder {
    /// Starts at a time of the sequence.
    pub fn new(start: Instant, offset_s: f64) -> Self {
        Self { start, offset_s, series: BTreeMap::new() }
    }

    /// Seconds since the start.
    pub fn length_s(&self, now: Instant) -> f64 {
        now.saturating_duration_since(self.start).as_secs_f64()
    }

    /// Notes weights as they are at a moment.
    pub fn take(&mut self, at: Instant, live: &Pose) {
        // Times are written to a tenth of a millisecond; keys have to differ.
        const LEAST_S: f64 = 1e-3;
        let time_s = self.offset_s + self.length_s(at);
        let mut note = |field: &str, name: &str, value: f32| {
            let samples = self.series.entry((field.to_owned(), name.to_owned())).or_default();
            let count = samples.len();
            match samples.last_mut() {
                Some((t, v)) if time_s - *t < LEAST_S => *v = value,
                _ if count < MOST_SAMPLES => samples.push((time_s, value)),
                _ => {}
            }
        };
        for group in [Group::Expressions, Group::States, Group::Shapes] {
            let Some(field) = group.field() else { continue };
            live.of(group).iter().for_each(|(name, value)| note(field, name, *value));
        }
        if let Some(degrees) = live.head_degrees {
            for (field, value) in ["yawDegrees", "pitchDegrees", "rollDegrees"].iter().zip(degrees) {
                note("head", field, value);
            }
        }
    }

    /// The tracks and the time at which the last key stands, seconds. Tracks that stay 0 are left out.
    pub fn tracks(self) -> (Vec<Keyed>, f64) {
        let mut end = 0.0f64;
        let mut tracks = Vec::new();
        for ((field, name), samples) in self.series {
            if samples.iter().all(|(_, v)| *v == 0.0) {
                continue;
            }
            let kept = simplified(&samples, if field == "head" { DEGREES_ERROR } else { WEIGHT_ERROR });
            end = end.max(kept.last().map_or(0.0, |(t, _)| *t));
            let key = |(t, v): &(f64, f32)| Key { t: *t, v: *v, ease: Ease::Linear };
            tracks.push((path_of(&field, &name), kept.iter().map(key).collect()));
        }
        (tracks, end)
    }
}

/// The samples without those that straight lines between the others say within an error.
fn simplified(samples: &[(f64, f32)], error: f32) -> Vec<(f64, f32)> {
    let Some(last) = samples.len().checked_sub(1) else { return Vec::new() };
    let mut kept = vec![false; samples.len()];
    (kept[0], kept[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        let ((t0, v0), (t1, v1)) = (samples[from], samples[to]);
        let off = |i: usize| {
            let share = (samples[i].0 - t0) / (t1 - t0);
            (samples[i].1 - (v0 + (v1 - v0) * share as f32)).abs()
        };
        let furthest = (from + 1..to).max_by(|a, b| off(*a).total_cmp(&off(*b)));
        if let Some(i) = furthest.filter(|i| off(*i) > error) {
            kept[i] = true;
            open.extend([(from, i), (i, to)]);
        }
    }
    samples.iter().zip(kept).filter(|(_, kept)| *kept).map(|(s, _)| *s).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_recording_is_as_close_as_it_says_with_few_keys() {
        let start = Instant::now();
        let mut recorder = Recorder::new(start, 2.0);
        let value = |i: u32| (0.5 - 0.5 * (f64::from(i) * 0.05).cos()) as f32;
        for i in 0..600 {
            let mut live = Pose::default();
            live.shapes.insert("jawOpen".into(), value(i));
            live.shapes.insert("tongueOut".into(), 0.0);
            live.head_degrees = Some([f32::from(i as u16) * 0.01, 0.0, 0.0]);
            recorder.take(start + Duration::from_secs_f64(f64::from(i) / 60.0), &live);
        }
        let (tracks, end) = recorder.tracks();
        assert!((end - (2.0 + 599.0 / 60.0)).abs() < 1e-6, "{end}");
        let paths: Vec<_> =
            tracks.iter().map(|(path, _)| super::super::super::syntax::written(path)).collect();
        assert_eq!(paths, ["head.yawDegrees", "shapes.jawOpen"], "what stays 0 is left out");
        assert_eq!(tracks[0].1.len(), 2, "a straight line has two keys");
        let keys = &tracks[1].1;
        // A line of length h is off by h^2 / 8 of the second derivative: 118 keys where it is largest all the time.
        assert!(keys.len() < 150, "{}", keys.len());
        let track = rubor_rig::timeline::Track::Keys(keys.clone());
        for i in 0..600 {
            let at = track.at(2.0 + f64::from(i) / 60.0);
            assert!((at - value(i)).abs() <= WEIGHT_ERROR + 1e-5, "{i}: {at}");
        }
    }
}
