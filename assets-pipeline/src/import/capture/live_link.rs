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

use std::collections::HashSet;
use std::path::Path;

use csv::{ByteRecord, ReaderBuilder};
use rubor_rig::limits;
use rubor_rig::names::canonical;

use super::timecode::{Rate, SECONDS, Stamp, Timeline, Unit, parse};
use super::{Channel, HeadAngles, LARGEST, MOST_SAMPLES, MOST_VALUES, Recording, list, text};
use crate::error::ImportError;

/// Weight of an eyeLook shape at one radian; 1 is reached at 35 degrees. Slope of `eyeLook*` over the eye angles in
/// three recordings: 1.56 to 1.67 for moves that fill the range.
pub const LOOK_PER_RADIAN: f32 = 1.64;

enum Column {
    Time,
    Skipped,
    Value(usize),
}

/// Reads a recording. `timecode_rate` is the number of frames in a second of the timecodes where the file does not
/// show it (59.94 and 29.97 count as such).
///
/// Commas, semicolons or tabs separate; decimal commas are read where they are told apart from separators.
///
/// # Errors
/// No `Timecode` column, no known column of weights, text where a number belongs, a row of another length, no sample.
pub fn from_bytes(bytes: &[u8], path: &Path, timecode_rate: Option<f64>) -> Result<Recording, ImportError> {
    limits::check_lines(bytes)
        .map_err(|(found, expected)| ImportError::content(path, "file", found, expected))?;
    let text = text(bytes, path)?;
    let fail = |line: usize, at: &str, found: String, expected: &str| {
        let at = if at.is_empty() { format!("line {line}") } else { format!("line {line}, column {at}") };
        Err(ImportError::content(path, at, found, expected))
    };
    let (separator, skipped_lines, body) = separator(&text);
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(separator)
        .from_reader(body.as_bytes());
    let mut record = ByteRecord::new();
    let mut next = |record: &mut ByteRecord| -> Result<Option<usize>, ImportError> {
        let read = reader
            .read_byte_record(record)
            .map_err(|e| ImportError::content(path, "the table", e.to_string(), "rows of a table"))?;
        let line = record.position().map_or(0, csv::Position::line) as usize + skipped_lines;
        Ok(read.then_some(line))
    };
    next(&mut record)?;
    let header: Vec<String> = record.iter().map(|f| clean(f).to_owned()).collect();
    let names: Vec<&str> = header.iter().map(String::as_str).collect();
    let mut recording = Recording { path: path.to_owned(), ..Recording::default() };
    let columns = columns(&names, &mut recording);
    let Some(time_column) = columns.iter().position(|c| matches!(c, Column::Time)) else {
        let found = format!("the columns {:?}", names.iter().take(4).collect::<Vec<_>>());
        return fail(1, "", found, "a column Timecode, between commas, semicolons or tabs");
    };
    if !recording.channels.iter().any(|c| canonical(&c.name).is_some()) {
        return fail(1, "", "no known shape".into(), "columns such as EyeBlinkLeft");
    }

    let mut stamps: Vec<(usize, Stamp)> = Vec::new();
    let mut lost = 0;
    let mut unfinished = None;
    let mut decimal_commas = false;
    let mut row: Vec<f32> = vec![0.0; recording.channels.len()];
    while let Some(line) = next(&mut record)? {
        if record.iter().all(|field| clean(field).is_empty()) && record.len() < names.len() {
            continue;
        }
        if let Some((short, count)) = unfinished {
            let mut expected = format!("{} as in the header", names.len());
            if count > names.len() {
                expected += "; for decimal commas, separate with semicolons or quote the numbers";
            }
            return fail(short, "", format!("{count} values"), &expected);
        }
        let mut fields = record.clone();
        if let Some(joined) = join_decimals(&record, &columns, names.len()) {
            decimal_commas = true;
            fields = joined;
        }
        let mut stamp = None;
        let mut empty = 0;
        for (i, field) in fields.iter().enumerate() {
            let field = clean(field);
            match columns.get(i) {
                Some(Column::Time) => match parse(&point(field, &mut decimal_commas)) {
                    Some(s) => stamp = Some(s),
                    None => {
                        let expected = "a timecode HH:MM:SS:FF.fff or a time";
                        return fail(line, names[i], format!("{field:?}"), expected);
                    }
                },
                Some(Column::Value(channel)) if field.is_empty() => {
                    row[*channel] = 0.0;
                    empty += 1;
                }
                Some(Column::Value(channel)) => match point(field, &mut decimal_commas).parse::<f32>() {
                    Ok(v) if v.abs() <= LARGEST => row[*channel] = v,
                    _ => {
                        let expected = "a finite number, at most a million";
                        return fail(line, names[i], format!("{field:?}"), expected);
                    }
                },
                Some(Column::Skipped) | None => {}
            }
        }
        let count = fields.len();
        // A face that the tracker lost has a timecode and a count of 0 shapes, or only empty values.
        if (count <= 2 && names.len() > 2) || empty == row.len() {
            lost += 1;
            continue;
        }
        if count != names.len() || empty > 0 {
            // The last line of a recording that was stopped may be cut; any other is an error.
            unfinished = Some((line, count - empty));
            continue;
        }
        let Some(stamp) = stamp else { continue };
        stamps.push((line, stamp));
        if stamps.len() > MOST_SAMPLES || stamps.len().saturating_mul(row.len()) > MOST_VALUES {
            let found = format!("more than {} samples of {} columns", stamps.len() - 1, row.len());
            let expected = format!("at most {MOST_SAMPLES} samples and {MOST_VALUES} values: a shorter take");
            return fail(line, "", found, &expected);
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
    if decimal_commas {
        recording.notes.push("numbers with decimal commas are read as such".into());
    }
    set_times(&mut recording, names[time_column], &stamps, timecode_rate)?;
    split_angles(&mut recording);
    Ok(recording)
}

fn clean(field: &[u8]) -> &str {
    // The text was UTF-8 before it was cut at separators, which are ASCII.
    std::str::from_utf8(field).unwrap_or_default().trim().trim_matches('"').trim()
}

/// The sign that separates columns (the most frequent of the header), the lines before the header, and the text from
/// there on. Spreadsheets may write the sign into a first line `sep=;`.
fn separator(text: &str) -> (u8, usize, &str) {
    let first = text.lines().next().unwrap_or_default();
    let said = first.trim_matches('"').to_lowercase();
    if let Some(sign) = said.strip_prefix("sep=").and_then(|s| s.bytes().next()).filter(u8::is_ascii) {
        let rest = text.split_once('\n').map_or("", |(_, rest)| rest);
        return (sign, 1, rest);
    }
    let count = |sign: u8| first.bytes().filter(|b| *b == sign).count();
    let mut best = b',';
    for sign in [b';', b'\t'] {
        if count(sign) > count(best) {
            best = sign;
        }
    }
    (best, 0, text)
}

/// A number with a decimal comma as one with a point.
fn point<'a>(field: &'a str, commas: &mut bool) -> std::borrow::Cow<'a, str> {
    if field.matches(',').count() != 1 || field.contains('.') {
        return field.into();
    }
    *commas = true;
    field.replace(',', ".").into()
}

/// A row whose decimal commas were cut as if they separated: each number is two fields, and perhaps the time is. None
/// where the number of fields or their contents show otherwise.
fn join_decimals(row: &ByteRecord, columns: &[Column], names: usize) -> Option<ByteRecord> {
    let values = columns.iter().filter(|c| matches!(c, Column::Value(_))).count();
    let split_time = match row.len().checked_sub(names + values)? {
        0 => false,
        1 => true,
        _ => return None,
    };
    let digits = |field: &str| !field.is_empty() && field.bytes().all(|b| b.is_ascii_digit());
    let mut fields = row.iter();
    let mut joined = ByteRecord::new();
    for column in columns {
        let whole = clean(fields.next()?);
        match column {
            Column::Time if !split_time => joined.push_field(whole.as_bytes()),
            Column::Skipped => joined.push_field(whole.as_bytes()),
            Column::Time | Column::Value(_) => {
                let (part, sign) = (clean(fields.next()?), matches!(column, Column::Value(_)));
                if !digits(part) || sign && !digits(whole.strip_prefix('-').unwrap_or(whole)) {
                    return None;
                }
                joined.push_field(format!("{whole}.{part}").as_bytes());
            }
        }
    }
    Some(joined)
}

/// `Timecode`, `timestamp`, `time`, and those with a unit behind (`timestamp_ms`).
fn is_time(name: &str) -> bool {
    let lower = name.to_lowercase();
    matches!(lower.as_str(), "timecode" | "timestamp" | "time")
        || lower.starts_with("time") && Unit::of_name(name).is_some()
}

fn columns(names: &[&str], recording: &mut Recording) -> Vec<Column> {
    let mut seen: HashSet<String> = HashSet::new();
    let mut columns = Vec::with_capacity(names.len());
    let mut time = false;
    let mut twice = Vec::new();
    for name in names {
        let lower = name.to_lowercase();
        columns.push(match lower.as_str() {
            "blendshapecount" | "" => Column::Skipped,
            _ if seen.contains(&lower) => {
                twice.push((*name).to_owned());
                Column::Skipped
            }
            _ if is_time(name) => {
                if std::mem::replace(&mut time, true) {
                    recording.notes.push(format!("column {name} is a second time and was left out"));
                    Column::Skipped
                } else {
                    Column::Time
                }
            }
            _ => {
                recording.channels.push(Channel { name: (*name).to_owned(), values: Vec::new() });
                Column::Value(recording.channels.len() - 1)
            }
        });
        seen.insert(lower);
    }
    if !twice.is_empty() {
        let note = format!("columns that stand there twice, the first one counts: {}", list(&twice));
        recording.notes.push(note);
    }
    let present: HashSet<_> = recording.channels.iter().filter_map(|c| canonical(&c.name)).collect();
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
    column: &str,
    stamps: &[(usize, Stamp)],
    timecode_rate: Option<f64>,
) -> Result<(), ImportError> {
    let all: Vec<Stamp> = stamps.iter().map(|s| s.1).collect();
    let (rate, shown) = Rate::of(&all, timecode_rate);
    if let Some((line, Stamp::Frames { frame, .. })) = stamps
        .iter()
        .find(|(_, s)| matches!(s, Stamp::Frames { frame, .. } if *frame >= f64::from(rate.base)))
    {
        let at = format!("line {line}, column {column}");
        let expected = format!("frames below {} (timecode rate)", rate.base);
        return Err(ImportError::content(&recording.path, at, format!("frame {frame}"), expected));
    }
    if !shown {
        let note =
            "the timecodes are too few to show the frames per second: 60, unless a timecode rate is given";
        recording.notes.push(note.into());
    }
    let numbers: Vec<f64> =
        all.iter().filter_map(|s| if let Stamp::Number(n) = s { Some(*n) } else { None }).collect();
    let of_day = numbers.is_empty();
    if !of_day && numbers.len() < all.len() {
        let odd = stamps.iter().find(|(_, s)| !matches!(s, Stamp::Number(_))).map_or(0, |(line, _)| *line);
        let at = format!("line {odd}, column {column}");
        let found = "a timecode among plain numbers";
        return Err(ImportError::content(&recording.path, at, found, "times of one kind"));
    }
    let (unit, note) = if of_day { (SECONDS, None) } else { Unit::of(column, &numbers) };
    recording.notes.extend(note.map(|n| format!("column {n}")));
    // The difference first: a nanosecond of the epoch is below the last bit of its seconds.
    let first = numbers.first().copied().unwrap_or_default();
    let seconds: Vec<f64> = match of_day {
        true => all.iter().map(|stamp| rate.seconds(*stamp)).collect(),
        false => numbers.iter().map(|n| (n - first) * unit.seconds).collect(),
    };
    let timeline = Timeline::new(&seconds, of_day);
    recording.channels.iter_mut().for_each(|channel| timeline.retain(&mut channel.values));
    recording.times_s = timeline.times_s;
    recording.notes.extend(timeline.notes);
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
    let present: HashSet<_> = recording.channels.iter().filter_map(|c| canonical(&c.name)).collect();
    for (side, yaw, pitch) in eyes {
        let to_left = if side == "Left" { ["Out", "In"] } else { ["In", "Out"] };
        for (angle, [negative, positive]) in [(yaw, to_left), (pitch, ["Up", "Down"])] {
            let Some(angle) = angle else { continue };
            for (direction, sign) in [(negative, -1.0), (positive, 1.0)] {
                let name = format!("eyeLook{direction}{side}");
                if !present.contains(name.as_str()) {
                    let values = angle.iter().map(|a| (sign * a * LOOK_PER_RADIAN).max(0.0)).collect();
                    recording.channels.push(Channel { name, values });
                }
            }
        }
    }
}
