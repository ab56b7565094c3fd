//! Face tracking as JSON, as written by scripts around MediaPipe's face landmarker and ARKit.
//!
//! There is no standard, so the shape of the data decides:
//! - frames: an array, or an object with `frames`, `data` or `results`. Each frame has a time (`timestampMs`,
//!   `timestamp`, `time`, `t`; otherwise `fps` of the object, or 30), weights (`blendShapes`, `faceBlendshapes`,
//!   `blendshapes`, `categories`, `shapes`) as an object of numbers, as a list of `{categoryName, score}`, or as such a
//!   list in the first element of a list, and perhaps a 4 x 4 matrix (`transform`, `facialTransformationMatrixes`);
//! - columns: an object with `facsNames`, `blendShapeNames` or `names`, `weightMat` or `weights` (a row a frame) and
//!   `exportFps` or `fps`.
//!
//! A flat matrix of 16 numbers is column by column, as both programs write it; rows of four are rows. Both have the
//! axes of a head here (+X the character's left, +Y up, +Z out of the face), and lengths are not used.

use std::collections::HashMap;
use std::path::Path;

use glam::{EulerRot, Mat3, Quat, Vec3};
use rubor_rig::limits;
use serde_json::{Map as Object, Value};

use super::timecode::{SECONDS, Timeline, Unit};
use super::{Channel, HeadAngles, LARGEST, MOST_SAMPLES, MOST_VALUES, Recording, text};
use crate::error::ImportError;

/// Frames per second where a file has neither times nor a rate.
const DEFAULT_FPS: f64 = 30.0;

const FRAMES: [&str; 3] = ["frames", "data", "results"];
const WEIGHTS: [&str; 6] =
    ["blendShapes", "faceBlendshapes", "face_blendshapes", "blendshapes", "categories", "shapes"];
const MATRICES: [&str; 4] =
    ["transform", "facialTransformationMatrixes", "facial_transformation_matrixes", "matrix"];
/// Names of a time; the unit that a name ends in counts, else the size of the steps decides.
const TIMES: [&str; 13] = [
    "timestampMs",
    "timestamp_ms",
    "timestampUs",
    "timestamp_us",
    "timestampNs",
    "timestamp_ns",
    "timestampSeconds",
    "timestamp",
    "timeMs",
    "time_ms",
    "time",
    "t",
    "timeCode",
];
const COLUMN_NAMES: [&str; 3] = ["facsNames", "blendShapeNames", "names"];
const COLUMN_ROWS: [&str; 2] = ["weightMat", "weights"];
const RATES: [&str; 3] = ["exportFps", "fps", "frameRate"];

/// Reads a recording.
///
/// # Errors
/// Syntax, none of the layouts above, text where a number belongs, no frame with a face.
pub fn from_bytes(bytes: &[u8], path: &Path) -> Result<Recording, ImportError> {
    limits::check_values(bytes, 1)
        .map_err(|(found, expected)| ImportError::content(path, "file", found, expected))?;
    let root: Value = serde_json::from_str(&text(bytes, path)?).map_err(|e| {
        let at = format!("line {}, column {}", e.line(), e.column());
        ImportError::content(path, at, e.to_string(), "JSON")
    })?;
    let mut reader = Reader {
        path,
        recording: Recording { path: path.to_owned(), ..Recording::default() },
        channels: HashMap::new(),
    };
    let fps = match first(&root, &RATES) {
        None => None,
        Some((name, value)) => match value.as_f64().filter(|f| *f > 0.0 && *f <= 10_000.0) {
            Some(fps) => Some(fps),
            None => return Err(reader.wrong(name, &shown(value), "frames per second")),
        },
    };
    match (first(&root, &COLUMN_NAMES), first(&root, &COLUMN_ROWS)) {
        (Some((_, Value::Array(names))), Some((field, Value::Array(rows)))) => {
            reader.columns(names, field, rows, fps.unwrap_or(DEFAULT_FPS))?;
        }
        _ => {
            let frames = root.as_array().or_else(|| first(&root, &FRAMES).and_then(|(_, v)| v.as_array()));
            let Some(frames) = frames else {
                let expected = "an array of frames, or an object with \"frames\" or with \"facsNames\" and \"weightMat\"";
                return Err(reader.wrong("the whole file", kind(&root), expected));
            };
            reader.frames(frames, fps)?;
        }
    }
    let recording = reader.recording;
    if recording.times_s.is_empty() {
        return Err(ImportError::content(path, "frames", "no frame with a face", "at least one"));
    }
    Ok(recording)
}

fn first<'a>(value: &'a Value, names: &[&'static str]) -> Option<(&'static str, &'a Value)> {
    names.iter().find_map(|n| value.get(n).map(|v| (*n, v)))
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a boolean",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

/// A value as messages show it: a list or an object may be as long as the file.
fn shown(value: &Value) -> String {
    const LONGEST: usize = 60;
    if value.is_array() || value.is_object() {
        return kind(value).to_owned();
    }
    let text = value.to_string();
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

struct Reader<'a> {
    path: &'a Path,
    recording: Recording,
    /// Place of each name in the channels.
    channels: HashMap<String, usize>,
}

impl Reader<'_> {
    fn wrong(&self, at: &str, found: &str, expected: &str) -> ImportError {
        ImportError::content(self.path, at, found, expected)
    }

    fn number(&self, value: &Value, at: impl Fn() -> String) -> Result<f32, ImportError> {
        let number = value.as_f64().map(|v| v as f32).filter(|v| v.abs() <= LARGEST);
        number.ok_or_else(|| self.wrong(&at(), &shown(value), "a finite number, at most a million"))
    }

    fn columns(&mut self, names: &[Value], field: &str, rows: &[Value], fps: f64) -> Result<(), ImportError> {
        let mut channels = Vec::new();
        for (i, name) in names.iter().enumerate() {
            let Some(name) = name.as_str() else {
                return Err(self.wrong(&format!("name {i}"), &shown(name), "a text"));
            };
            channels.push(Channel { name: name.to_owned(), values: Vec::with_capacity(rows.len()) });
        }
        if rows.len() > MOST_SAMPLES || rows.len().saturating_mul(channels.len()) > MOST_VALUES {
            let found = format!("{} frames of {} names", rows.len(), channels.len());
            let expected = format!("at most {MOST_SAMPLES} frames and {MOST_VALUES} values");
            return Err(self.wrong(field, &found, &expected));
        }
        for (i, row) in rows.iter().enumerate() {
            let at = format!("{field}, frame {i}");
            let Some(row) = row.as_array().filter(|r| r.len() == channels.len()) else {
                let found = row.as_array().map_or(kind(row).to_owned(), |r| format!("{} numbers", r.len()));
                return Err(self.wrong(&at, &found, &format!("{} numbers", channels.len())));
            };
            for (channel, value) in channels.iter_mut().zip(row) {
                let number = self.number(value, || format!("{at}, {}", channel.name))?;
                channel.values.push(number);
            }
            self.recording.times_s.push(i as f64 / fps);
        }
        self.recording.channels = channels;
        Ok(())
    }

    fn frames(&mut self, frames: &[Value], fps: Option<f64>) -> Result<(), ImportError> {
        if frames.len() > MOST_SAMPLES {
            let expected = format!("at most {MOST_SAMPLES}");
            return Err(self.wrong("frames", &frames.len().to_string(), &expected));
        }
        let mut stamps: Vec<f64> = Vec::new();
        let mut names: Vec<&str> = Vec::new();
        let mut angles: Vec<Option<[f32; 3]>> = Vec::new();
        let mut lost = 0;
        for (i, frame) in frames.iter().enumerate() {
            let weights = match first(frame, &WEIGHTS) {
                Some((_, weights)) => self.weights(weights, i)?,
                None => None,
            };
            let Some(weights) = weights else {
                lost += 1;
                continue;
            };
            let written = TIMES.iter().find_map(|n| frame.get(n).map(|v| (*n, v)));
            let (name, time) = match written {
                Some((name, value)) => match value.as_f64() {
                    Some(time) => (name, time),
                    None => {
                        let at = format!("frame {i}, {name}");
                        return Err(self.wrong(&at, &shown(value), "a number"));
                    }
                },
                None => ("", i as f64 / fps.unwrap_or(DEFAULT_FPS)),
            };
            if let Some(first) = names.first().filter(|first| **first != name) {
                let said = |name: &str| if name.is_empty() { "no time".into() } else { format!("{name:?}") };
                return Err(self.wrong(
                    &format!("frame {i}"),
                    &said(name),
                    &format!("{} as before", said(first)),
                ));
            }
            names.push(name);
            stamps.push(time);
            let sample = stamps.len() - 1;
            for (name, value) in weights {
                self.set(name, sample, value)?;
            }
            angles.push(first(frame, &MATRICES).and_then(|(_, matrix)| euler(matrix)));
        }
        let count = stamps.len();
        if self.recording.channels.len().saturating_mul(count) > MOST_VALUES {
            return Err(self.too_many(count));
        }
        for channel in &mut self.recording.channels {
            let last = channel.values.last().copied().unwrap_or_default();
            channel.values.resize(count, last);
        }
        if lost > 0 {
            self.recording.notes.push(format!("{lost} frames without a face were left out"));
        }
        let timeline = self.times(names.first().copied().unwrap_or_default(), &stamps);
        if let Some(first) = angles.iter().find_map(|a| *a) {
            // A frame without a matrix holds the rotation of the one before it.
            let mut held = first;
            let mut head = HeadAngles::default();
            for angle in angles {
                held = angle.unwrap_or(held);
                head.yaw.push(held[0]);
                head.pitch.push(held[1]);
                head.roll.push(held[2]);
            }
            [&mut head.yaw, &mut head.pitch, &mut head.roll].into_iter().for_each(|v| timeline.retain(v));
            self.recording.head = Some(head);
        }
        self.recording.times_s = timeline.times_s;
        Ok(())
    }

    fn too_many(&self, samples: usize) -> ImportError {
        let found = format!("{samples} frames of {} names", self.recording.channels.len());
        self.wrong("frames", &found, &format!("at most {MOST_VALUES} values"))
    }

    /// Name and weight of each shape of a frame; none without a face.
    fn weights(&self, value: &Value, frame: usize) -> Result<Option<Vec<(String, f32)>>, ImportError> {
        let list = match value {
            Value::Object(object) => match object.get("categories") {
                Some(Value::Array(list)) => list,
                _ => return self.named(object, frame).map(Some),
            },
            Value::Array(list) => match list.first() {
                None => return Ok(None),
                // One element a face: the first face is the one.
                Some(face) if face.is_array() || face.get("categories").is_some() => {
                    return self.weights(face, frame);
                }
                Some(_) => list,
            },
            Value::Null => return Ok(None),
            other => {
                let at = format!("frame {frame}, weights");
                return Err(self.wrong(&at, kind(other), "an object of numbers or a list of categories"));
            }
        };
        let mut weights = Vec::with_capacity(list.len());
        for (i, entry) in list.iter().enumerate() {
            let at = || format!("frame {frame}, category {i}");
            let name = first(entry, &["categoryName", "category_name", "name"]).and_then(|(_, v)| v.as_str());
            let value = first(entry, &["score", "value", "weight"]);
            let (Some(name), Some((_, value))) = (name, value) else {
                return Err(self.wrong(&at(), &shown(entry), "an object with categoryName and score"));
            };
            weights.push((name.to_owned(), self.number(value, at)?));
        }
        Ok(Some(weights))
    }

    fn named(&self, object: &Object<String, Value>, frame: usize) -> Result<Vec<(String, f32)>, ImportError> {
        let one = |(name, value): (&String, &Value)| {
            let number = self.number(value, || format!("frame {frame}, {name}"))?;
            Ok((name.clone(), number))
        };
        object.iter().map(one).collect()
    }

    /// Sets a weight; samples before it that lack the name hold its last value. A name that stands twice in a frame
    /// counts once.
    fn set(&mut self, name: String, sample: usize, value: f32) -> Result<(), ImportError> {
        let channels = &mut self.recording.channels;
        let index = *self.channels.entry(name).or_insert_with_key(|name| {
            channels.push(Channel { name: name.clone(), values: Vec::new() });
            channels.len() - 1
        });
        if channels.len().saturating_mul(sample + 1) > MOST_VALUES {
            return Err(self.too_many(sample + 1));
        }
        let values = &mut channels[index].values;
        let last = values.last().copied().unwrap_or_default();
        values.resize(sample, last);
        values.push(value);
        Ok(())
    }

    /// Times of the frames; frames that do not move on in time are left out.
    fn times(&mut self, name: &str, stamps: &[f64]) -> Timeline {
        let (unit, note) = if name.is_empty() { (SECONDS, None) } else { Unit::of(name, stamps) };
        let first = stamps.first().copied().unwrap_or_default();
        let seconds: Vec<f64> = stamps.iter().map(|t| (t - first) * unit.seconds).collect();
        let timeline = Timeline::new(&seconds, false);
        self.recording.channels.iter_mut().for_each(|channel| timeline.retain(&mut channel.values));
        self.recording.notes.extend(note);
        self.recording.notes.extend(timeline.notes.iter().cloned());
        timeline
    }
}

/// Yaw, pitch and roll, radians, of a 4 x 4 matrix; none for anything else.
fn euler(value: &Value) -> Option<[f32; 3]> {
    let list = value.as_array()?;
    // One matrix a face: `[{"data": [...]}]`, `[[...16 numbers]]`.
    let data = match list.first()? {
        Value::Object(object) => return euler(object.get("data")?),
        Value::Array(inner) if inner.len() == 16 || inner.first()?.is_array() => {
            return euler(&list[0]);
        }
        _ => list,
    };
    let numbers = |values: &[Value]| -> Option<Vec<f32>> {
        values.iter().map(|v| v.as_f64().map(|v| v as f32)).collect()
    };
    let (columns, rows) = match data.len() {
        16 => (numbers(data)?, None),
        4 => (Vec::new(), Some(data.iter().map(|r| numbers(r.as_array()?)).collect::<Option<Vec<_>>>()?)),
        _ => return None,
    };
    let matrix = match rows {
        None => Mat3::from_cols(
            Vec3::from_slice(&columns[0..3]),
            Vec3::from_slice(&columns[4..7]),
            Vec3::from_slice(&columns[8..11]),
        ),
        Some(rows) if rows.iter().all(|r| r.len() >= 3) => {
            let row = |i: usize| Vec3::from_slice(&rows[i][..3]);
            Mat3::from_cols(row(0), row(1), row(2)).transpose()
        }
        Some(_) => return None,
    };
    let axes = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(Vec3::normalize_or_zero);
    let rotation = Mat3::from_cols(axes[0], axes[1], axes[2]);
    // A determinant that is no number is no rotation either.
    let proper = (rotation.determinant() - 1.0).abs() < 0.1;
    if !proper {
        return None;
    }
    let (yaw, pitch, roll) = Quat::from_mat3(&rotation).to_euler(EulerRot::YXZ);
    Some([yaw, pitch, roll])
}
