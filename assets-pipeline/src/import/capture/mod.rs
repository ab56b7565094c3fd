//! Recorded performances to sequences.
//!
//! ```text
//! Live Link Face .csv --live_link--+
//! MediaPipe, ARKit .json ---json---+--> Recording --calibrate, smooth, resample--> Retarget --> Sequence + Report
//! ```
//!
//! A recording keeps its own names and times. [`to_sequence`] takes away the neutral face, smooths jitter, samples at
//! the frames of the sequence, maps names through a [`Retarget`] file and drops keys that a straight line replaces.
//!
//! ```
//! use rubor_assets::import::capture::{Retarget, live_link, to_sequence};
//! let csv = b"Timecode,BlendShapeCount,JawOpen\n00:00:01:00.000,1,0\n00:00:01:30.000,1,0.5\n00:00:02:00.000,1,1\n";
//! let recording = live_link::from_bytes(csv, "take.csv".as_ref(), None)?;
//! let (sequence, report) = to_sequence(&recording, &Retarget::default(), Some(24.0))?;
//! assert_eq!(sequence.shapes["jawOpen"].at(0.5), 0.5);
//! assert_eq!(report.mapped, [("JawOpen".to_owned(), "jawOpen".to_owned())]);
//! # Ok::<(), rubor_assets::error::ImportError>(())
//! ```

mod convert;
mod filter;
pub mod json;
pub mod live_link;
mod retarget;
mod timecode;

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use rubor_rig::limits;
use rubor_rig::timeline::{Key, Sequence, Track};

pub use convert::{Report, to_sequence};
pub use retarget::{HeadAngle, HeadRetarget, Neutral, Retarget, ShapeTarget, Smoothing, Targets};

use crate::error::ImportError;

/// A recorded performance as its file has it, times from 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// File that it came from.
    pub path: PathBuf,
    /// Seconds since the first sample, strictly increasing; not always evenly spaced.
    pub times_s: Vec<f64>,
    /// Weights by name as written there, each with one value per sample.
    pub channels: Vec<Channel>,
    /// Rotation of the head where it was recorded.
    pub head: Option<HeadAngles>,
    /// Notes on oddities of the file.
    pub notes: Vec<String>,
}

/// One column of weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channel {
    /// As written in the file.
    pub name: String,
    /// Nominally 0 to 1; trackers go above.
    pub values: Vec<f32>,
}

/// Rotation of the head, radians, with the signs of [`rubor_rig::timeline::HeadMotion`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeadAngles {
    /// Positive turns the face to the character's left.
    pub yaw: Vec<f32>,
    /// Positive lowers the chin.
    pub pitch: Vec<f32>,
    /// Positive leans the head to the character's right.
    pub roll: Vec<f32>,
}

impl Recording {
    /// Seconds from the first to the last sample.
    pub fn length_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or_default()
    }

    /// Samples per second: the median step's inverse, snapped to a common camera rate within 2 %.
    pub fn rate(&self) -> f64 {
        const COMMON: [f64; 8] = [24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 100.0, 120.0];
        let mut steps: Vec<f64> = self.times_s.windows(2).map(|w| w[1] - w[0]).collect();
        if steps.is_empty() {
            return 60.0;
        }
        let middle = steps.len() / 2;
        let (_, median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
        let rate = (1.0 / *median).min(FASTEST);
        COMMON.into_iter().find(|c| (rate / c - 1.0).abs() < 0.02).unwrap_or(rate)
    }
}

/// Largest recording: an hour at 120 samples per second. A longer file is not a take of a face.
const MOST_SAMPLES: usize = 432_000;
/// Most values of a recording, samples times channels: an hour of 52 shapes at 120 samples per second is a third of it.
const MOST_VALUES: usize = 64 << 20;
/// Largest weight or angle of a recording.
const LARGEST: f32 = 1e6;
/// No tracker of faces is faster.
const FASTEST: f64 = 1000.0;

/// Reads a recording by the kind of its file: `.csv` as Live Link Face, `.json` as MediaPipe or ARKit.
///
/// # Errors
/// Unreadable file, another extension, content that breaks the format.
pub fn read(path: &Path) -> Result<Recording, ImportError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let bytes = limits::read(path).map_err(ImportError::read(path))?;
    match extension.as_str() {
        "csv" => live_link::from_bytes(&bytes, path, None),
        "json" => json::from_bytes(&bytes, path),
        _ => {
            let found = format!("the extension {extension:?}");
            Err(ImportError::content(
                path,
                "name",
                found,
                ".csv (Live Link Face) or .json (MediaPipe, ARKit)",
            ))
        }
    }
}

/// The text of a file: UTF-8, or UTF-16 with a byte order mark, as spreadsheets write it.
fn text<'a>(bytes: &'a [u8], path: &Path) -> Result<Cow<'a, str>, ImportError> {
    limits::check_text(bytes)
        .map_err(|(found, expected)| ImportError::content(path, "file", found, expected))?;
    let wide = |unit: fn([u8; 2]) -> u16| {
        let units =
            bytes[2..].chunks(2).map(|pair| unit([pair[0], pair.get(1).copied().unwrap_or_default()]));
        let text: Result<String, _> = char::decode_utf16(units).collect();
        text.map(Cow::Owned).map_err(|e| {
            let found = format!("a surrogate without its other half ({:x})", e.unpaired_surrogate());
            ImportError::content(path, "the text", found, "UTF-16 as its first two bytes say, or UTF-8")
        })
    };
    match bytes {
        [0xff, 0xfe, ..] => return wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return wide(u16::from_be_bytes),
        _ => {}
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    std::str::from_utf8(bytes).map(Cow::Borrowed).map_err(|e| {
        let line = bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count() + 1;
        ImportError::content(path, format!("line {line}"), "bytes that are not UTF-8", "text in UTF-8")
    })
}

/// The first names of a list, and how many more there are.
fn list(names: &[String]) -> String {
    const MOST_NAMES: usize = 5;
    let first = names[..names.len().min(MOST_NAMES)].join(", ");
    match names.len().saturating_sub(MOST_NAMES) {
        0 => first,
        more => format!("{first} and {more} more"),
    }
}

/// Loads the recording that the `capture` field of a sequence names and adds its tracks. `folder` is that of the
/// sequence file: paths are relative to it and cannot leave it. Tracks that the sequence has itself win.
///
/// Returns `None` when the sequence has no capture.
///
/// # Errors
/// As [`read`], [`Retarget::load`] and [`to_sequence`]; a path that is absolute or goes up.
pub fn load_into(sequence: &mut Sequence, folder: &Path) -> Result<Option<Report>, ImportError> {
    let Some(capture) = sequence.capture.take() else { return Ok(None) };
    let mut recording = read(&inside(folder, &capture.file)?)?;
    let retarget = match &capture.retarget {
        Some(file) => Retarget::load(&inside(folder, file)?)?,
        None => Retarget::default(),
    };
    if let Some([from, to]) = capture.trim {
        trim(&mut recording, from, to)?;
    }
    let (captured, report) = to_sequence(&recording, &retarget, Some(sequence.fps))?;
    for (name, track) in captured.shapes {
        sequence.shapes.entry(name).or_insert_with(|| shifted(track, capture.start));
    }
    let head = &mut sequence.head;
    for (own, track) in [
        (&mut head.yaw_degrees, captured.head.yaw_degrees),
        (&mut head.pitch_degrees, captured.head.pitch_degrees),
        (&mut head.roll_degrees, captured.head.roll_degrees),
    ] {
        if *own == Track::default() {
            *own = shifted(track, capture.start);
        }
    }
    Ok(Some(report))
}

/// Samples between two times, the first of them at 0.
fn trim(recording: &mut Recording, from_s: f64, to_s: f64) -> Result<(), ImportError> {
    let start = recording.times_s.partition_point(|t| *t < from_s);
    let end = recording.times_s.partition_point(|t| *t <= to_s);
    let Some(first) = recording.times_s.get(start).copied().filter(|_| start < end) else {
        let found = format!("[{from_s}, {to_s}]");
        let expected = format!("two times within the {} s of the recording", recording.length_s());
        return Err(ImportError::content(&recording.path, "trim", found, expected));
    };
    recording.times_s = recording.times_s[start..end].iter().map(|t| t - first).collect();
    let cut = |values: &mut Vec<f32>| {
        values.truncate(end);
        values.drain(..start);
    };
    recording.channels.iter_mut().for_each(|c| cut(&mut c.values));
    if let Some(head) = &mut recording.head {
        [&mut head.yaw, &mut head.pitch, &mut head.roll].into_iter().for_each(cut);
    }
    Ok(())
}

fn shifted(track: Track<f32>, start_s: f64) -> Track<f32> {
    match track {
        Track::Keys(keys) => Track::Keys(keys.into_iter().map(|k| Key { t: k.t + start_s, ..k }).collect()),
        constant => constant,
    }
}

/// The path of a file that stays in the folder.
fn inside(folder: &Path, file: &str) -> Result<PathBuf, ImportError> {
    let path = Path::new(file);
    let stays = path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if !stays || file.is_empty() {
        let expected = "a path relative to the sequence's folder that does not leave it";
        return Err(ImportError::content(folder, "capture", format!("{file:?}"), expected));
    }
    let path = folder.join(path);
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    // A link may lead out of the folder: compare its target. A missing file is refused when it is read.
    if let (Ok(real), Ok(real_folder)) = (path.canonicalize(), folder.canonicalize())
        && !real.starts_with(real_folder)
    {
        let found = format!("{file:?}, a link to {}", real.display());
        let expected = "a file in the folder of the sequence or below: links cannot leave it";
        return Err(ImportError::content(folder, "capture", found, expected));
    }
    Ok(path)
}

#[cfg(test)]
mod tests;
