//! Marks of a performance: where expressions and states have their peaks, and where their other keys stand.
//!
//! Every easing goes from one key to the next without turning, so a track has its peaks at keys. A peak is a run of keys
//! of one value with lower ones, or none, on both sides.

use rubor_rig::timeline::{Sequence, Track};
use serde::{Deserialize, Serialize};

/// Lowest weight of a peak: under it nothing shows.
const LEAST_PEAK: f32 = 0.05;

/// A marked part of a sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Mark {
    /// Name of the expression or state with its weight, such as `joy 1.00`.
    pub name: String,
    /// Expression or state.
    pub subject: String,
    /// First frame, from 1.
    pub frame: u32,
    /// Frames that it lasts, at least 1.
    pub frames: u32,
    /// A peak; else a key.
    pub is_peak: bool,
}

/// The marks of a sequence, by their frames.
pub fn of(sequence: &Sequence) -> Vec<Mark> {
    let mut marks = Vec::new();
    for (name, track) in sequence.expressions.iter().chain(&sequence.states) {
        of_track(name, track, sequence, &mut marks);
    }
    marks.sort_by(|a, b| (a.frame, &a.name).cmp(&(b.frame, &b.name)));
    marks
}

/// The frames, from 1, on which keys of a track stand, each once.
pub fn frames_of_keys(track: &Track<f32>, sequence: &Sequence) -> Vec<u32> {
    let Track::Keys(keys) = track else { return Vec::new() };
    let mut frames: Vec<u32> = keys.iter().filter_map(|key| frame(key.t, sequence)).collect();
    frames.dedup();
    frames
}

/// The frame nearest to a time, from 1; none after the end.
fn frame(time_s: f64, sequence: &Sequence) -> Option<u32> {
    let frame = (time_s * sequence.fps).round();
    (frame < f64::from(sequence.frame_count())).then_some(frame as u32 + 1)
}

fn of_track(name: &str, track: &Track<f32>, sequence: &Sequence, marks: &mut Vec<Mark>) {
    let last = sequence.frame_count();
    let mut mark = |value: f32, frame: u32, until: u32, is_peak: bool| {
        marks.push(Mark {
            name: format!("{name} {value:.2}"),
            subject: name.to_owned(),
            frame,
            frames: (until + 1).saturating_sub(frame).max(1),
            is_peak,
        });
    };
    let keys = match track {
        Track::Constant(value) if *value > LEAST_PEAK => return mark(*value, 1, last, true),
        Track::Constant(_) => return,
        Track::Keys(keys) => keys,
    };
    let runs: Vec<_> = keys.chunk_by(|a, b| a.v == b.v).collect();
    for (i, run) in runs.iter().enumerate() {
        let value = run[0].v;
        let is_lower = |other: Option<&&[_]>| {
            other.is_none_or(|run: &&[rubor_rig::timeline::Key<f32>]| run[0].v < value)
        };
        let before = i.checked_sub(1).and_then(|k| runs.get(k));
        let is_peak = value > LEAST_PEAK && is_lower(before) && is_lower(runs.get(i + 1));
        if !is_peak {
            for key in *run {
                if let Some(frame) = frame(key.t, sequence) {
                    mark(value, frame, frame, false);
                }
            }
            continue;
        }
        // Before the first key and after the last one the value holds.
        let start = if i == 0 { Some(1) } else { frame(run[0].t, sequence) };
        let end = if i + 1 == runs.len() { None } else { frame(run[run.len() - 1].t, sequence) };
        if let Some(start) = start {
            mark(value, start, end.unwrap_or(last), true);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_last_as_long_as_their_value_and_other_keys_are_keys() {
        let text = r#"{ "fps": 10, "duration": 2, "expressions": {
            "joy": [{ "t": 0.2, "v": 0 }, { "t": 0.5, "v": 1 }, { "t": 0.9, "v": 1 }, { "t": 1.2, "v": 0.3 }, { "t": 1.4, "v": 0.3 }],
            "anger": [{ "t": 0, "v": 0.4 }, { "t": 9, "v": 0.8 }], "fear": 0.7, "disgust": 0 },
            "states": { "blush": [{ "t": 1, "v": 0 }, { "t": 1.5, "v": 0.5 }] } }"#;
        let sequence = Sequence::from_json("s.json", text).unwrap();
        let found: Vec<_> = of(&sequence)
            .into_iter()
            .map(|m| format!("{} {}+{}{}", m.name, m.frame, m.frames, if m.is_peak { " peak" } else { "" }))
            .collect();
        let expected = [
            "anger 0.40 1+1",
            "fear 0.70 1+20 peak",
            "joy 0.00 3+1",
            "joy 1.00 6+5 peak",
            "blush 0.00 11+1",
            "joy 0.30 13+1",
            "joy 0.30 15+1",
            "blush 0.50 16+5 peak",
        ];
        assert_eq!(found, expected);
        assert_eq!(frames_of_keys(&sequence.expressions["joy"], &sequence), [3, 6, 10, 13, 15]);
    }
}
