//! A recording to a sequence.

use std::collections::{BTreeMap, HashMap, HashSet};

use rayon::prelude::*;
use rubor_rig::names::{Key, canonical};
use rubor_rig::timeline::{HeadMotion, Sequence, Track};

use super::filter::{median_in, reduce, resample, smooth};
use super::{MOST_SAMPLES, MOST_VALUES, Recording, Retarget, ShapeTarget, list};
use crate::error::ImportError;

/// Result of converting a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Samples of the recording.
    pub samples: usize,
    /// Samples per second of the recording.
    pub rate: f64,
    /// Channel and shape of each track.
    pub mapped: Vec<(String, String)>,
    /// Channels that no shape is known for; a retarget file can name one.
    pub unmapped: Vec<String>,
    /// Channels that a retarget file leaves out.
    pub left_out: Vec<String>,
    /// Entries of the retarget file whose channel the recording does not have.
    pub unused: Vec<String>,
    /// Values that were cut at the limit.
    pub limited: usize,
    /// Keys of all tracks.
    pub keys: usize,
    /// Notes on oddities of the file.
    pub notes: Vec<String>,
}

/// Curves at the frames of the sequence.
struct Curve {
    values: Vec<f32>,
    limited: usize,
}

/// Longest recording, seconds: a day.
const LONGEST_S: f64 = 86_400.0;

/// Largest error of the length of a recording whose times are rounded to milliseconds, seconds, with some room.
const ROUNDING_S: f64 = 1.1e-3;

/// Tracks of a recording at `fps` frames a second (none: the recording's own rate).
///
/// # Errors
/// A rate that is not positive, no neutral sample in the asked range, a recording without samples.
pub fn to_sequence(
    recording: &Recording,
    retarget: &Retarget,
    fps: Option<f64>,
) -> Result<(Sequence, Report), ImportError> {
    let wrong =
        |at: &str, found: String, expected: &str| ImportError::content(&recording.path, at, found, expected);
    let length = recording.length_s();
    if length > LONGEST_S {
        return Err(wrong(
            "length",
            format!("{length} s"),
            "at most a day: times in a smaller unit than is written?",
        ));
    }
    let rate = recording.rate();
    let fps = fps.unwrap_or(rate);
    if !(fps > 0.0 && fps <= 10_000.0) {
        return Err(wrong("fps", fps.to_string(), "more than 0 and at most 10000"));
    }
    let times = &recording.times_s;
    if times.is_empty() {
        return Err(wrong("samples", "none".into(), "at least one"));
    }
    if let Some(neutral) = retarget.neutral
        && median_in(times, &vec![0.0; times.len()], neutral.from, neutral.to).is_none()
    {
        let found = format!("no sample from {} to {} s", neutral.from, neutral.to);
        let expected = format!("a time within the {} s of the recording", recording.length_s());
        return Err(wrong("neutral", found, &expected));
    }
    // A take of n samples at the sequence's rate has n frames although its times may be rounded to milliseconds.
    let slack = (ROUNDING_S * fps).clamp(1e-3, 0.5);
    let count = (length * fps + slack).floor() as usize + 1;
    if count > MOST_SAMPLES {
        let gap = times.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let found = format!("{count} frames at {fps} a second, samples up to {gap:.1} s apart");
        return Err(wrong("length", found, &format!("at most {MOST_SAMPLES} frames")));
    }
    let mut report = Report {
        samples: times.len(),
        rate,
        notes: recording.notes.clone(),
        unused: unused(recording, retarget),
        ..Report::default()
    };

    // Which channels act on which shape.
    let mut routes: Vec<(usize, Vec<ShapeTarget>)> = Vec::new();
    let by_key = retarget.by_key();
    let mut by_name: HashMap<&str, &str> = HashMap::new();
    let mut doubled = Vec::new();
    for (index, channel) in recording.channels.iter().enumerate() {
        let exact = retarget.shapes.get(&channel.name).map(|t| &t.0[..]);
        let asked = exact.or_else(|| by_key.get(&Key::new(&channel.name)).copied());
        let known = canonical(&channel.name);
        if let (None, Some(shape)) = (asked, known)
            && let Some(first) = by_name.insert(shape, &channel.name)
        {
            // Two spellings of one shape are one weight, not two that add up.
            by_name.insert(shape, first);
            doubled.push(format!("{} (after {first})", channel.name));
            continue;
        }
        let targets = match (asked, known) {
            (Some([]), _) => {
                report.left_out.push(channel.name.clone());
                continue;
            }
            (Some(targets), _) => targets.to_vec(),
            (None, Some(shape)) => vec![ShapeTarget { shape: shape.to_owned(), gain: 1.0, offset: 0.0 }],
            (None, None) => {
                report.unmapped.push(channel.name.clone());
                continue;
            }
        };
        let shapes = targets.iter().map(|t| (channel.name.clone(), t.shape.clone()));
        report.mapped.extend(shapes);
        routes.push((index, targets));
    }

    if !doubled.is_empty() {
        report.notes.push(format!("further columns of one shape were left out: {}", list(&doubled)));
    }
    let moved: HashSet<&str> =
        routes.iter().flat_map(|(_, targets)| targets).map(|t| t.shape.as_str()).collect();
    let curves = routes.len().max(moved.len());
    if curves.saturating_mul(count) > MOST_VALUES {
        let found = format!("{count} frames of {curves} columns or shapes");
        return Err(wrong("length", found, &format!("at most {MOST_VALUES} values")));
    }

    let curves: Vec<Curve> = routes
        .par_iter()
        .map(|(index, _)| weight_curve(recording, *index, retarget, fps, count, rate))
        .collect();
    let mut shapes: BTreeMap<String, Vec<f32>> = BTreeMap::new();
    for ((_, targets), curve) in routes.iter().zip(&curves) {
        report.limited += curve.limited;
        for ShapeTarget { shape, gain, offset } in targets {
            let sum = shapes.entry(shape.clone()).or_insert_with(|| vec![0.0; count]);
            sum.iter_mut().zip(&curve.values).for_each(|(s, v)| *s += v * gain + offset);
        }
    }
    let tracks: Vec<(String, Track<f32>)> =
        shapes.into_par_iter().map(|(shape, v)| (shape, reduce(&v, fps, retarget.tolerance))).collect();

    let mut sequence = Sequence::still(fps, count as f64 / fps);
    sequence.description = match recording.path.file_name() {
        Some(name) => format!("Captured: {}", name.to_string_lossy()),
        None => String::new(),
    };
    // A shape that rests throughout needs no track.
    sequence.shapes = tracks.into_iter().filter(|(_, t)| *t != Track::Constant(0.0)).collect();
    sequence.head = head_motion(recording, retarget, fps, count, rate);
    let head = [&sequence.head.yaw_degrees, &sequence.head.pitch_degrees, &sequence.head.roll_degrees];
    report.keys = sequence.shapes.values().chain(head).map(key_count).sum();
    Ok((sequence, report))
}

fn key_count(track: &Track<f32>) -> usize {
    match track {
        Track::Constant(_) => 0,
        Track::Keys(keys) => keys.len(),
    }
}

fn unused(recording: &Recording, retarget: &Retarget) -> Vec<String> {
    let keys: HashSet<Key> = recording.channels.iter().map(|c| Key::new(&c.name)).collect();
    let names = retarget.shapes.keys();
    names.filter(|name| !keys.contains(&Key::new(name))).cloned().collect()
}

fn weight_curve(
    recording: &Recording,
    index: usize,
    retarget: &Retarget,
    fps: f64,
    count: usize,
    rate: f64,
) -> Curve {
    let times = &recording.times_s;
    let mut values = recording.channels[index].values.clone();
    if let Some(neutral) = retarget.neutral
        && let Some(rest) = median_in(times, &values, neutral.from, neutral.to)
    {
        // A weight that rests near 1 leaves no room to stretch.
        let room = (1.0 - rest).max(0.05);
        values.iter_mut().for_each(|v| *v = ((*v - rest) / room).max(0.0));
    }
    let mut limited = 0;
    if let Some(limit) = retarget.limit {
        for v in &mut values {
            limited += usize::from(*v > limit);
            *v = v.min(limit);
        }
    }
    if let Some(s) = retarget.smoothing {
        values = smooth(times, &values, 1e-3 * s.window_ms, s.amplitude);
    }
    Curve { values: resample(times, &values, fps, count, rate), limited }
}

fn head_motion(recording: &Recording, retarget: &Retarget, fps: f64, count: usize, rate: f64) -> HeadMotion {
    let Some(head) = &recording.head else { return HeadMotion::default() };
    let times = &recording.times_s;
    let track = |angles: &[f32], how: super::HeadAngle| {
        let mut degrees: Vec<f32> = unwrapped(angles).iter().map(|a| a.to_degrees()).collect();
        if let Some(neutral) = retarget.neutral
            && let Some(rest) = median_in(times, &degrees, neutral.from, neutral.to)
        {
            degrees.iter_mut().for_each(|d| *d -= rest);
        }
        if let Some(s) = retarget.smoothing {
            degrees = smooth(times, &degrees, 1e-3 * s.window_ms, s.amplitude_degrees);
        }
        let mut degrees = resample(times, &degrees, fps, count, rate);
        degrees.iter_mut().for_each(|d| *d = *d * how.gain + how.offset_degrees);
        reduce(&degrees, fps, 10.0 * retarget.tolerance)
    };
    HeadMotion {
        yaw_degrees: track(&head.yaw, retarget.head.yaw),
        pitch_degrees: track(&head.pitch, retarget.head.pitch),
        roll_degrees: track(&head.roll, retarget.head.roll),
        ..HeadMotion::default()
    }
}

/// Angles without jumps of a whole turn.
fn unwrapped(angles: &[f32]) -> Vec<f32> {
    use std::f32::consts::{PI, TAU};
    let mut turns = 0.0;
    let mut before: Option<f32> = None;
    angles
        .iter()
        .map(|a| {
            if let Some(b) = before {
                turns += if a - b > PI {
                    -TAU
                } else if a - b < -PI {
                    TAU
                } else {
                    0.0
                };
            }
            before = Some(*a);
            a + turns
        })
        .collect()
}
