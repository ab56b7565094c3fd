//! Live Link Face recordings (Epic Games' app for ARKit face tracking): CSV.
//!
//! Header `Timecode,BlendShapeCount,EyeBlinkLeft,...,HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,...`. Columns are found by
//! name, in any order and letter case. Angles are radians.
//!
//! Signs of angles: the app converts ARKit's transforms to Unreal's axes, where a positive yaw turns to the
//! character's right and a positive pitch looks down. For the eyes that is measured: in recordings, yaw rises with
//! `eyeLookOutRight` and `eyeLookInLeft`, pitch with `eyeLookDown` (correlation above 0.98). The head is converted by
//! the same rule; its roll, for which the eyes tell nothing, follows from the axes: positive leans to the character's
//! left.

use std::path::Path;

use rubor_rig::names::canonical;

use super::timecode::{Rate, Stamp, parse};
use super::{Channel, HeadAngles, MOST_SAMPLES, Recording};
use crate::error::ImportError;

/// Weight of an eyeLook shape at one radian; 1 is reached at 35 degrees. Slope of `eyeLook*` over the eye angles in
/// three recordings: 1.56 to 1.67 for moves that fill the range.
pub const LOOK_PER_RADIAN: f32 = 1.64;

/// A day, for takes that pass midnight.
const DAY_S: f64 = 86_400.0;

enum Column {
    Time,
    Skipped,
    Value(usize),
}

/// Reads a recording. `timecode_rate` is the number of frames in a second of the timecodes where the file does not
/// show it (59.94 and 29.97 count as such).
///
/// # Errors
/// No `Timecode` column, no known column of weights, text where a number belongs, a row of another length, no sample.
pub fn from_bytes(bytes: &[u8], path: &Path, timecode_rate: Option<f64>) -> Result<Recording, ImportError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut lines = bytes.split(|b| *b == b'\n').enumerate().map(|(i, l)| (i + 1, l));
    let fail = |line: usize, at: &str, found: String, expected: &str| {
        let at = if at.is_empty() { format!("line {line}") } else { format!("line {line}, column {at}") };
        Err(ImportError::content(path, at, found, expected))
    };
    let header = lines.next().map_or("", |(_, l)| std::str::from_utf8(l).unwrap_or(""));
    let names: Vec<&str> = header.split(',').map(clean).collect();
    let mut recording = Recording { path: path.to_owned(), ..Recording::default() };
    let columns = columns(&names, &mut recording);
    if !columns.iter().any(|c| matches!(c, Column::Time)) {
        let found = format!("the columns {:?}", names.iter().take(4).collect::<Vec<_>>());
        return fail(1, "", found, "a column Timecode");
    }
    if !recording.channels.iter().any(|c| canonical(&c.name).is_some()) {
        return fail(1, "", "no known shape".into(), "columns such as EyeBlinkLeft");
    }

    let mut stamps: Vec<(usize, Stamp)> = Vec::new();
    let mut lost = 0;
    let mut unfinished = None;
    let mut row: Vec<f32> = vec![0.0; recording.channels.len()];
    for (number, line) in lines {
        let Ok(line) = std::str::from_utf8(line) else {
            return fail(number, "", "bytes that are not UTF-8".into(), "text");
        };
        let line = line.trim_end_matches('\r');
        if line.trim().is_empty() {
            continue;
        }
        if let Some((short, count)) = unfinished {
            return fail(short, "", format!("{count} values"), &format!("{} as in the header", names.len()));
        }
        let mut stamp = None;
        let mut count = 0;
        let mut empty = 0;
        for (i, field) in line.split(',').enumerate() {
            count += 1;
            let field = clean(field);
            match columns.get(i) {
                Some(Column::Time) => match parse(field) {
                    Some(s) => stamp = Some(s),
                    None => {
                        return fail(number, names[i], format!("{field:?}"), "a timecode HH:MM:SS:FF.fff");
                    }
                },
                Some(Column::Value(channel)) if field.is_empty() => {
                    row[*channel] = 0.0;
                    empty += 1;
                }
                Some(Column::Value(channel)) => match field.parse::<f32>() {
                    Ok(v) if v.is_finite() => row[*channel] = v,
                    _ => return fail(number, names[i], format!("{field:?}"), "a finite number"),
                },
                Some(Column::Skipped) | None => {}
            }
        }
        // A face that the tracker lost has a timecode and a count of 0 shapes, or only empty values.
        if (count <= 2 && names.len() > 2) || empty == row.len() {
            lost += 1;
            continue;
        }
        if count != names.len() || empty > 0 {
            // The last line of a recording that was stopped may be cut; any other is an error.
            unfinished = Some((number, count - empty));
            continue;
        }
        let Some(stamp) = stamp else { continue };
        stamps.push((number, stamp));
        if stamps.len() > MOST_SAMPLES {
            return fail(number, "", format!("more than {MOST_SAMPLES} samples"), "a shorter take");
        }
        recording.channels.iter_mut().zip(&row).for_each(|(c, v)| c.values.push(*v));
    }
    if stamps.is_empty() {
        return fail(2, "", "no sample".into(), "at least one row");
    }
    if let Some((line, _)) = unfinished {
        recording.notes.push(format!("line {line}: the last row is cut and was left out"));
    }
    if lost > 0 {
        recording.notes.push(format!("{lost} rows without a face were left out"));
    }
    set_times(&mut recording, &stamps, timecode_rate)?;
    split_angles(&mut recording);
    Ok(recording)
}

fn clean(field: &str) -> &str {
    field.trim().trim_matches('"').trim()
}

fn columns(names: &[&str], recording: &mut Recording) -> Vec<Column> {
    let mut seen: Vec<String> = Vec::new();
    let mut columns = Vec::new();
    for name in names {
        let lower = name.to_lowercase();
        columns.push(match lower.as_str() {
            "blendshapecount" | "" => Column::Skipped,
            _ if seen.contains(&lower) => {
                recording.notes.push(format!("column {name} stands there twice; the first one counts"));
                Column::Skipped
            }
            "timecode" | "timestamp" | "time" => Column::Time,
            _ => {
                recording.channels.push(Channel { name: (*name).to_owned(), values: Vec::new() });
                Column::Value(recording.channels.len() - 1)
            }
        });
        seen.push(lower);
    }
    let present: Vec<_> = recording.channels.iter().filter_map(|c| canonical(&c.name)).collect();
    let missing: Vec<&str> =
        rubor_rig::names::ARKIT.into_iter().filter(|known| !present.contains(known)).collect();
    if !missing.is_empty() && missing.len() < rubor_rig::names::ARKIT.len() {
        recording.notes.push(format!("no column for {}; they stay at rest", missing.join(", ")));
    }
    columns
}

/// Seconds from the first sample; samples that do not move on in time are left out.
fn set_times(
    recording: &mut Recording,
    stamps: &[(usize, Stamp)],
    timecode_rate: Option<f64>,
) -> Result<(), ImportError> {
    let all: Vec<Stamp> = stamps.iter().map(|s| s.1).collect();
    let rate = Rate::of(&all, timecode_rate);
    if let Some((line, Stamp::Frames { frame, .. })) = stamps
        .iter()
        .find(|(_, s)| matches!(s, Stamp::Frames { frame, .. } if *frame >= f64::from(rate.base)))
    {
        let at = format!("line {line}, column Timecode");
        let expected = format!("frames below {} (timecode rate)", rate.base);
        return Err(ImportError::content(&recording.path, at, format!("frame {frame}"), expected));
    }
    let start = rate.seconds(all[0]);
    let mut day = 0.0;
    let mut keep = Vec::with_capacity(all.len());
    for stamp in &all {
        let mut time = rate.seconds(*stamp) - start + day;
        let before = recording.times_s.last().copied();
        if before.is_some_and(|b| b - time > 0.5 * DAY_S) {
            day += DAY_S;
            time += DAY_S;
        }
        // Two samples of one time (or of the resolution of the timecode) are one.
        let later = before.is_none_or(|b| time > b + 1e-6);
        keep.push(later);
        if later {
            recording.times_s.push(time);
        }
    }
    let left_out = keep.iter().filter(|k| !**k).count();
    if left_out > 0 {
        recording.notes.push(format!("{left_out} rows that do not move on in time were left out"));
        for channel in &mut recording.channels {
            let mut kept = keep.iter();
            channel.values.retain(|_| kept.next().copied().unwrap_or(false));
        }
    }
    let longest = recording.times_s.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
    if longest > 0.25 {
        recording.notes.push(format!("a gap of {longest:.2} s was bridged by a straight line"));
    }
    Ok(())
}

/// Takes the angle columns out of the weights: the head's into [`HeadAngles`], the eyes' into look shapes where the
/// file has none.
fn split_angles(recording: &mut Recording) {
    let mut take = |name: &str| {
        let index = recording.channels.iter().position(|c| c.name.eq_ignore_ascii_case(name))?;
        Some(recording.channels.remove(index).values)
    };
    let mut head = |name: &str, sign: f32| take(name).map(|v| v.iter().map(|a| sign * a).collect::<Vec<_>>());
    let angles = [head("HeadYaw", -1.0), head("HeadPitch", 1.0), head("HeadRoll", -1.0)];
    let eyes = ["Left", "Right"].map(|side| {
        let _roll = take(&format!("{side}EyeRoll"));
        (side, take(&format!("{side}EyeYaw")), take(&format!("{side}EyePitch")))
    });
    if angles.iter().flatten().flatten().any(|a| *a != 0.0) {
        let zeros = || vec![0.0; recording.times_s.len()];
        let [yaw, pitch, roll] = angles.map(|a| a.unwrap_or_else(zeros));
        recording.head = Some(HeadAngles { yaw, pitch, roll });
    }
    let present: Vec<_> = recording.channels.iter().filter_map(|c| canonical(&c.name)).collect();
    for (side, yaw, pitch) in eyes {
        let to_left = if side == "Left" { ["Out", "In"] } else { ["In", "Out"] };
        for (angle, [negative, positive]) in [(yaw, to_left), (pitch, ["Up", "Down"])] {
            let Some(angle) = angle else { continue };
            for (direction, sign) in [(negative, -1.0), (positive, 1.0)] {
                let name = format!("eyeLook{direction}{side}");
                if !present.contains(&name.as_str()) {
                    let values = angle.iter().map(|a| (sign * a * LOOK_PER_RADIAN).max(0.0)).collect();
                    recording.channels.push(Channel { name, values });
                }
            }
        }
    }
}
