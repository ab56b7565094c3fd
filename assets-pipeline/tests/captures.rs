//! Recordings as other programs write them. Each row of the table in `docs/captures.md` is a recording here, and the
//! column of outcomes is what reading it gave: `RUBOR_BLESS=1` writes the table anew.

use std::path::Path;
use std::time::Instant;

use rubor_assets::import::capture::{Recording, Retarget, json, live_link, to_sequence};
use rubor_rig::names::ARKIT;
use rubor_rig::random::SplitMix64;
use rubor_rig::timeline::Sequence;

/// Weight of jawOpen in a sample: a line, so that every place of it is known by its value.
fn jaw(sample: usize) -> f32 {
    sample as f32 / 256.0
}

/// A table with all ARKit columns, in which only jawOpen moves.
fn table(time: &str, times: &[String]) -> String {
    let mut text = format!("{time},BlendShapeCount,{}\n", ARKIT.join(","));
    for (i, t) in times.iter().enumerate() {
        let weights =
            ARKIT.map(|name| if name == "jawOpen" { format!("{:.6}", jaw(i)) } else { "0.000000".into() });
        text += &format!("{t},52,{}\n", weights.join(","));
    }
    text
}

fn times(count: usize, time: impl Fn(usize) -> String) -> Vec<String> {
    (0..count).map(time).collect()
}

fn timecode(base: usize, frame: usize) -> String {
    format!("00:00:{:02}:{:02}.000", frame / base, frame % base)
}

fn frames(field: &str, times: &[String]) -> String {
    let frame = |(i, t): (usize, &String)| {
        let weights: Vec<String> =
            ARKIT.iter().map(|n| format!("{n:?}: {}", if *n == "jawOpen" { jaw(i) } else { 0.0 })).collect();
        format!("{{{field:?}: {t}, \"blendShapes\": {{{}}}}}", weights.join(", "))
    };
    format!("[{}]", times.iter().enumerate().map(frame).collect::<Vec<_>>().join(",\n"))
}

enum Input {
    Csv(Vec<u8>),
    Json(Vec<u8>),
    Retarget(String),
}

enum Expect {
    /// Rate, samples and length in seconds.
    Take(f64, usize, f64),
    /// A phrase of the error.
    Refused(&'static str),
}

struct Case {
    what: &'static str,
    becomes: &'static str,
    input: Input,
    /// Part of each note, in order.
    said: &'static [&'static str],
    expect: Expect,
}

fn csv(
    what: &'static str,
    becomes: &'static str,
    text: String,
    said: &'static [&'static str],
    expect: Expect,
) -> Case {
    Case { what, becomes, input: Input::Csv(text.into_bytes()), said, expect }
}

fn js(
    what: &'static str,
    becomes: &'static str,
    text: String,
    said: &'static [&'static str],
    expect: Expect,
) -> Case {
    Case { what, becomes, input: Input::Json(text.into_bytes()), said, expect }
}

/// Two seconds at 60 per second in a unit, from an epoch.
fn plain(column: &str, per_second: f64, start: f64) -> String {
    table(column, &times(120, |i| format!("{:.0}", start + (i as f64 * per_second / 60.0).round())))
}

fn seconds_of_times() -> Vec<Case> {
    let take = || Expect::Take(60.0, 120, 119.0 / 60.0);
    vec![
        csv(
            "plain seconds (`timestamp`, `time`)",
            "times",
            table("timestamp", &times(120, |i| format!("{:.6}", i as f64 / 60.0))),
            &[],
            take(),
        ),
        csv(
            "scientific notation (`1e-05`)",
            "numbers",
            table("timestamp", &times(120, |i| format!("{:e}", i as f64 / 60.0))),
            &[],
            take(),
        ),
        csv(
            "plain milliseconds",
            "times; the steps show the unit",
            plain("timestamp", 1e3, 0.0),
            &["column timestamp steps by 17 and is read as milliseconds"],
            take(),
        ),
        csv(
            "plain microseconds",
            "times; the steps show the unit",
            plain("timestamp", 1e6, 0.0),
            &["and is read as microseconds"],
            take(),
        ),
        csv(
            "plain nanoseconds",
            "times; the steps show the unit",
            plain("timestamp", 1e9, 0.0),
            &["and is read as nanoseconds"],
            take(),
        ),
        csv(
            "nanoseconds since 1970",
            "times from the first sample",
            plain("time", 1e9, 1.732e18),
            &["and is read as nanoseconds"],
            take(),
        ),
        csv(
            "columns that name their unit (`timestamp_us`, `Time (ms)`)",
            "times",
            plain("Time (ms)", 1e3, 1.732e12),
            &[],
            take(),
        ),
        js(
            "a named unit that makes no recording",
            "times; the steps show the unit",
            frames("timestampMs", &times(120, |i| format!("{:.6}", i as f64 / 60.0))),
            &["which as milliseconds is no recording: it is read as seconds"],
            take(),
        ),
        js(
            "nanoseconds in JSON",
            "times; the steps show the unit",
            frames("timestamp", &times(120, |i| format!("{:.0}", i as f64 * 1e9 / 60.0))),
            &["timestamp steps by 16666667 and is read as nanoseconds"],
            take(),
        ),
        csv(
            "steps of one: frame numbers, or a sample per second",
            "seconds",
            table("time", &times(5, |i| i.to_string())),
            &["is read as seconds; if they are frames or milliseconds, divide them"],
            Expect::Take(1.0, 5, 4.0),
        ),
        csv(
            "short takes at 30 (25, 24, ...) frames per second",
            "the rate at which the seconds turn over",
            table("Timecode", &times(45, |i| timecode(30, i + 1))),
            &[],
            Expect::Take(30.0, 45, 44.0 / 30.0),
        ),
        csv(
            "short takes in drop frame",
            "29.97 per second",
            table("Timecode", &times(45, |i| format!("00:00:{:02};{:02}", 5 + i / 30, i % 30))),
            &[],
            Expect::Take(30.0, 45, 44.0 * 1.001 / 30.0),
        ),
        csv(
            "takes within a second",
            "60 per second, unless a timecode rate is given",
            table("Timecode", &times(20, |i| timecode(30, i))),
            &["the timecodes are too few to show the frames per second: 60"],
            Expect::Take(60.0, 20, 19.0 / 60.0),
        ),
        csv(
            "takes over midnight",
            "times that go on",
            table(
                "Timecode",
                &times(120, |i| {
                    if i < 60 { format!("23:59:59:{i:02}") } else { format!("00:00:00:{:02}", i - 60) }
                }),
            ),
            &[],
            take(),
        ),
        csv(
            "a clock that is set back",
            "the recording goes on in step",
            table("Timecode", &times(180, |i| timecode(60, if i < 60 { 600 + i } else { 300 + i }))),
            &[
                "the clock was set back 1 times (first by 4.983 s at sample 60): the recording goes on in step",
            ],
            Expect::Take(60.0, 180, 179.0 / 60.0),
        ),
        js(
            "a clock that is set back, in JSON",
            "the recording goes on in step",
            frames(
                "timestamp",
                &times(180, |i| format!("{}", (if i < 60 { 600 + i } else { 300 + i }) as f64 / 60.0)),
            ),
            &["the clock was set back 1 times"],
            Expect::Take(60.0, 180, 179.0 / 60.0),
        ),
        csv(
            "samples that come up to three places late",
            "left out and counted",
            table(
                "timestamp",
                &times(120, |i| format!("{:.6}", if i == 40 { 36.5 } else { i as f64 } / 60.0)),
            ),
            &["1 samples that come too late were left out"],
            Expect::Take(60.0, 119, 119.0 / 60.0),
        ),
        csv(
            "repeated samples",
            "left out and counted",
            table("Timecode", &times(120, |i| timecode(60, i - usize::from(i > 70)))),
            &["1 samples that repeat the time before them were left out"],
            Expect::Take(60.0, 119, 118.0 / 60.0),
        ),
        js(
            "repeated samples in JSON",
            "left out and counted",
            frames("timestampMs", &times(120, |i| format!("{}", (i - i / 60) as f64 * 1000.0 / 60.0))),
            &["1 samples that repeat the time before them were left out"],
            Expect::Take(60.0, 119, 118.0 / 60.0),
        ),
        csv(
            "gaps",
            "a straight line",
            table("timestamp", &times(120, |i| format!("{:.6}", (i + 60 * (i / 60)) as f64 / 60.0))),
            &["a gap of 1.02 s was bridged by a straight line"],
            Expect::Take(60.0, 120, 179.0 / 60.0),
        ),
        csv(
            "samples hours apart",
            "error: at most 432000 frames",
            table(
                "timestamp",
                &times(120, |i| format!("{}", i as f64 / 60.0 + if i > 60 { 1e4 } else { 0.0 })),
            ),
            &[],
            Expect::Refused("samples up to 10000.0 s apart, expected at most 432000 frames"),
        ),
        csv(
            "samples years apart",
            "error: at most a day",
            table(
                "timestamp",
                &times(120, |i| format!("{}", i as f64 / 60.0 + if i > 60 { 1e9 } else { 0.0 })),
            ),
            &[],
            Expect::Refused("found 1000000001.9833333 s, expected at most a day"),
        ),
        csv(
            "timecodes among plain times",
            "error with the line",
            table("Timecode", &times(3, |i| if i == 1 { "00:00:01:00".into() } else { i.to_string() })),
            &[],
            Expect::Refused("line 3, column Timecode: found a timecode among plain numbers"),
        ),
        js(
            "frames with and without a time",
            "error with the frame",
            frames("t", &times(3, |i| i.to_string())).replacen("\"t\": 1, ", "", 1),
            &[],
            Expect::Refused("frame 1: found no time, expected \"t\" as before"),
        ),
    ]
}

const COMMAS: &[&str] = &["numbers with decimal commas are read as such"];

fn tables_and_values() -> Vec<Case> {
    let take = || Expect::Take(60.0, 150, 149.0 / 60.0);
    let good = table("Timecode", &times(150, |i| timecode(60, i)));
    let quoted = |text: &str| {
        let quote = |field: &str| {
            if field.contains('.') && !field.contains(':') {
                format!("\"{}\"", field.replace('.', ","))
            } else {
                field.into()
            }
        };
        let line = |line: &str| line.split(',').map(quote).collect::<Vec<String>>().join(",");
        text.lines().map(line).collect::<Vec<_>>().join("\r\n")
    };
    let wide = |text: &str| -> Vec<u8> {
        format!("\u{feff}{text}").encode_utf16().flat_map(u16::to_le_bytes).collect()
    };
    let split = good.lines().map(|line| match line.split_once(',') {
        Some((time, rest)) if time.contains(':') => format!("{time},{}", rest.replace('.', ",")),
        _ => line.to_owned(),
    });
    let split: Vec<String> = split.collect();
    let semicolons: Vec<String> = good
        .lines()
        .map(|line| match line.split_once(',') {
            Some((time, rest)) if time.contains(':') => {
                format!("{};{}", time.replace('.', ","), rest.replace(',', ";").replace('.', ","))
            }
            _ => line.replace(',', ";"),
        })
        .collect();
    let semicolons = semicolons.join("\r\n");
    let irregular = split.join("\n").replacen(",0,000000", ",0", 7);
    let mut cases = vec![
        csv("a byte order mark", "skipped", format!("\u{feff}{good}"), &[], take()),
        js(
            "a byte order mark in JSON",
            "skipped",
            format!("\u{feff}{}", frames("timestamp", &times(150, |i| format!("{}", i as f64 / 60.0)))),
            &[],
            take(),
        ),
        Case {
            what: "UTF-16 with its mark",
            becomes: "decoded",
            input: Input::Csv(wide(&good.replace(',', "\t"))),
            said: &[],
            expect: take(),
        },
        csv("tabs between columns", "separators", good.replace(',', "\t"), &[], take()),
        csv("semicolons between columns", "separators", good.replace(',', ";"), &[], take()),
        csv("semicolons and decimal commas", "numbers", semicolons.clone(), COMMAS, take()),
        csv("a first line `sep=;`", "the separator", format!("sep=;\r\n{semicolons}"), COMMAS, take()),
        csv("decimal commas in quotes", "numbers", quoted(&good), COMMAS, take()),
        csv(
            "decimal commas between commas, where each number has one",
            "numbers",
            split.join("\n"),
            COMMAS,
            take(),
        ),
        csv(
            "decimal commas between commas, where some numbers have none",
            "error that says what to do",
            irregular,
            &[],
            Expect::Refused(
                "expected 54 as in the header; for decimal commas, separate with semicolons or quote the numbers",
            ),
        ),
        csv(
            "rows without a face",
            "left out and counted",
            good.replacen(",52,0.000000", ",0", 1)
                .lines()
                .enumerate()
                .map(|(i, l)| if i == 1 { "00:00:00:00.000,0" } else { l })
                .collect::<Vec<_>>()
                .join("\n"),
            &["1 rows without a face were left out"],
            Expect::Take(60.0, 149, 148.0 / 60.0),
        ),
        csv(
            "a cut last row",
            "left out",
            good[..good.len() - 40].to_owned(),
            &["line 151: the last row is cut and was left out"],
            Expect::Take(60.0, 149, 148.0 / 60.0),
        ),
        csv(
            "a cut row before others",
            "error with the line",
            good.replacen(",0.000000", "", 1),
            &[],
            Expect::Refused("line 2: found 53 values, expected 54 as in the header"),
        ),
        csv(
            "two columns of one name",
            "the first",
            good.replacen("tongueOut", "JawOpen", 1),
            &["columns that stand there twice, the first one counts: JawOpen", "no column for tongueOut"],
            take(),
        ),
        csv(
            "two spellings of one shape",
            "the first",
            good.replacen("tongueOut", "jaw_open", 1),
            &[
                "no column for tongueOut",
                "further columns of one shape were left out: jaw_open (after jawOpen)",
            ],
            take(),
        ),
        csv(
            "text, NaN or more than a million where a weight belongs",
            "error with line and column",
            good.replacen(",52,0.000000", ",52,1e9", 1),
            &[],
            Expect::Refused(
                "line 2, column browDownLeft: found \"1e9\", expected a finite number, at most a million",
            ),
        ),
    ];
    for (what, becomes, text, error) in [
        (
            "a window of more than 500 ms in a retarget file",
            "error with line and column",
            r#"{"smoothing": {"windowMs": 501, "amplitude": 1, "amplitudeDegrees": 1}}"#,
            "expected more than 0 and at most 500",
        ),
        (
            "an amplitude of more than 10 in a retarget file",
            "error with line and column",
            r#"{"smoothing": {"windowMs": 40, "amplitude": 1e30, "amplitudeDegrees": 1}}"#,
            "expected more than 0 and at most 10",
        ),
        (
            "a gain, offset or limit of more than 1000 in a retarget file",
            "error with line and column",
            r#"{"shapes": {"jawOpen": {"shape": "jawOpen", "gain": 1e30}}}"#,
            "expected a shape with gain and offset from -1000 to 1000",
        ),
    ] {
        let input = Input::Retarget(text.into());
        cases.push(Case { what, becomes, input, said: &[], expect: Expect::Refused(error) });
    }
    cases
}

fn cases() -> Vec<Case> {
    [seconds_of_times(), tables_and_values()].into_iter().flatten().collect()
}

type Taken = Result<Option<(Recording, Sequence, Vec<String>)>, String>;

fn take(input: &Input) -> Taken {
    let recording = match input {
        Input::Csv(bytes) => live_link::from_bytes(bytes, Path::new("take.csv"), None),
        Input::Json(bytes) => json::from_bytes(bytes, Path::new("take.json")),
        Input::Retarget(text) => {
            return Retarget::from_json("actor.json", text).map(|_| None).map_err(|e| e.to_string());
        }
    };
    let recording = recording.map_err(|e| e.to_string())?;
    let untouched = Retarget { smoothing: None, tolerance: 0.0, ..Retarget::default() };
    let (sequence, report) = to_sequence(&recording, &untouched, None).map_err(|e| e.to_string())?;
    Ok(Some((recording, sequence, report.notes)))
}

#[test]
fn every_row_of_the_table_is_true() {
    let mut table = String::from("| of the file | outcome | becomes |\n| --- | --- | --- |\n");
    for Case { what, becomes, input, said, expect } in cases() {
        let taken = take(&input);
        let outcome = match &taken {
            Ok(Some((_, _, notes))) if !notes.is_empty() => "read, said",
            Ok(_) => "read",
            Err(_) => "refused",
        };
        table += &format!("| {what} | {outcome} | {becomes} |\n");
        match (taken, expect) {
            (Ok(Some((recording, sequence, notes))), Expect::Take(rate, samples, length)) => {
                assert_eq!(notes.len(), said.len(), "{what}: {notes:?}");
                for (note, said) in notes.iter().zip(said) {
                    assert!(note.contains(said), "{what}: {note:?} lacks {said:?}");
                }
                assert!((recording.rate() - rate).abs() < 1e-6, "{what}: {}", recording.rate());
                assert_eq!(recording.times_s.len(), samples, "{what}");
                let found = recording.length_s();
                assert!((found - length).abs() < 1.1e-3, "{what}: {found} s for {length} s");
                // A take without gaps has a frame for each sample, also where its times are rounded to milliseconds.
                if ((samples - 1) as f64 / rate - length).abs() < 1e-9 && (sequence.fps - rate).abs() < 1e-6 {
                    assert_eq!(sequence.frame_count() as usize, samples, "{what}");
                }
                // The middle and the end of the take are where they were recorded.
                let opened = recording.channels.iter().find(|c| c.name == "jawOpen").unwrap();
                for i in [samples / 2, samples - 1] {
                    let (time, value) = (recording.times_s[i], opened.values[i].min(1.0));
                    let played = sequence.shapes["jawOpen"].at(time);
                    // Half a millisecond of rounding, and the last frame holds.
                    assert!((played - value).abs() < 2.1 / 256.0, "{what}: {played} for {value}");
                }
                assert!(opened.values.windows(2).all(|w| w[0] < w[1]), "{what}");
                sequence.check().unwrap();
            }
            (Err(error), Expect::Refused(expected)) => {
                assert!(error.contains(expected), "{what}: {error:?} lacks {expected:?}");
            }
            (Err(error), Expect::Take(..)) => panic!("{what}: {error}"),
            (Ok(_), Expect::Refused(_)) => panic!("{what}: was read"),
            (Ok(None), Expect::Take(..)) => panic!("{what}: no take"),
        }
    }
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/captures.md");
    let docs = std::fs::read_to_string(&file).unwrap();
    let (start, end) = ("<!-- table of assets-pipeline/tests/captures.rs -->\n", "<!-- end -->");
    let from = docs.find(start).unwrap() + start.len();
    let to = from + docs[from..].find(end).unwrap();
    if std::env::var_os("RUBOR_BLESS").is_some() {
        std::fs::write(&file, format!("{}{table}{}", &docs[..from], &docs[to..])).unwrap();
    } else {
        assert_eq!(&docs[from..to], table, "RUBOR_BLESS=1 writes the table of docs/captures.md anew");
    }
}

/// Right values of the cases in the shared folder, which are not ours to keep here.
#[test]
fn cases_of_the_shared_folder() {
    let Some(shared) = std::env::var_os("RUBOR_SHARED") else {
        eprintln!("SKIPPED: RUBOR_SHARED is not set, the cases of captures were not read");
        return;
    };
    let folder = Path::new(&shared).join("cases/capture");
    for (name, rate, seconds) in [
        ("timestamp-s.csv", 60.0, 119.0 / 60.0),
        ("timestamp-ms.csv", 60.0, 119.0 / 60.0),
        ("timestamp-us.csv", 60.0, 119.0 / 60.0),
        ("timestamp-ns.csv", 60.0, 119.0 / 60.0),
        ("timestamp-sci.csv", 60.0, 59.0 / 60.0),
        ("landmark-link-30fps-short.csv", 30.0, 44.0 * 1.001 / 30.0),
        ("bom.json", 30.0, 59.0 / 30.0),
        ("decimal-comma.csv", 60.0, 119.0 / 60.0),
        ("semicolon.csv", 60.0, 119.0 / 60.0),
        ("clock-back.csv", 60.0, 179.0 / 60.0),
    ] {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        let input = if name.ends_with("csv") { Input::Csv(bytes) } else { Input::Json(bytes) };
        let (recording, ..) = take(&input).unwrap_or_else(|e| panic!("{name}: {e}")).unwrap();
        let length = recording.length_s();
        assert!((recording.rate() - rate).abs() < 1e-6, "{name}: {} a second", recording.rate());
        assert!((length - seconds).abs() < 1.1e-3, "{name}: {length} s, {:?}", recording.notes);
        // jawOpen = (1 - cos 2 pi t) / 2.
        let opened = recording.channels.iter().find(|c| c.name.eq_ignore_ascii_case("jawOpen")).unwrap();
        for (t, v) in recording.times_s.iter().zip(&opened.values) {
            let phase = if name.starts_with("landmark") || name.contains("sci") { continue } else { *t };
            let expected = 0.5 * (1.0 - (std::f64::consts::TAU * phase).cos());
            assert!((f64::from(*v) - expected).abs() < 4e-3, "{name}: {v} at {t}");
        }
    }
    let bytes = std::fs::read(folder.join("equal-time.json")).unwrap();
    let (_, _, notes) = take(&Input::Json(bytes)).unwrap().unwrap();
    assert!(notes.iter().any(|n| n.starts_with("1 samples that repeat the time")), "{notes:?}");
}

#[test]
fn a_hundred_thousand_columns_or_names_cost_no_square() {
    let started = Instant::now();
    let names: Vec<String> = (0..100_000).map(|i| format!("column{i}")).collect();
    let row = vec!["0"; names.len()].join(",");
    let text = format!("Timecode,jawOpen,{}\n0:0:0:0,0,{row}\n0:0:2:0,0,{row}\n", names.join(","));
    let recording = live_link::from_bytes(text.as_bytes(), Path::new("wide.csv"), None).unwrap();
    let shapes: Vec<String> = names.iter().map(|n| format!("\"x{n}\": \"jawOpen\"")).collect();
    let retarget =
        Retarget::from_json("r.json", &format!("{{\"shapes\": {{{}}}}}", shapes.join(","))).unwrap();
    let (_, report) = to_sequence(&recording, &retarget, Some(10.0)).unwrap();
    assert_eq!((report.unmapped.len(), report.unused.len()), (100_000, 100_000));

    let weights: Vec<String> = names.iter().map(|n| format!("\"{n}\": 0")).collect();
    let frame = |t: usize| format!("{{\"t\": {t}, \"blendShapes\": {{{}}}}}", weights.join(","));
    let text = format!("[{},{},{}]", frame(0), frame(1), frame(2));
    let recording = json::from_bytes(text.as_bytes(), Path::new("wide.json")).unwrap();
    assert_eq!(recording.channels.len(), 100_000);

    // A new name in each frame would be 10^10 values.
    let frames: Vec<String> =
        (0..20_000).map(|i| format!("{{\"t\": {i}, \"blendShapes\": {{\"n{i}\": 1}}}}")).collect();
    let error =
        json::from_bytes(format!("[{}]", frames.join(",")).as_bytes(), Path::new("new.json")).unwrap_err();
    assert!(error.to_string().contains("expected at most 67108864 values"), "{error}");
    // Minutes where each name looks at all others; a busy machine gets its time.
    assert!(started.elapsed().as_secs_f64() < 20.0, "{:?}", started.elapsed());
}

#[test]
fn messages_do_not_repeat_values_that_are_as_long_as_the_file() {
    let list = format!("[{}0]", "[1, 2, 3], ".repeat(10_000));
    let word = "a".repeat(100_000);
    for text in [
        format!(r#"{{"fps": {list}, "frames": []}}"#),
        format!(r#"[{{"t": {list}, "shapes": {{"jawOpen": 1}}}}]"#),
        format!(r#"[{{"t": 0, "shapes": {{"jawOpen": "{word}"}}}}]"#),
        format!(r#"[{{"t": 0, "shapes": [{{"categoryName": {list}}}]}}]"#),
        format!(r#"{{"names": [{list}], "weights": [[1]]}}"#),
    ] {
        let error =
            json::from_bytes(text.as_bytes(), Path::new("take.json")).expect_err("refused").to_string();
        assert!(error.len() < 300, "{} bytes: {}", error.len(), &error[..300]);
    }
}

/// Takes out the line at a place, or doubles it.
fn lines(bytes: &mut Vec<u8>, at: usize, out: bool) {
    let start = bytes[..at].iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let end = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |i| at + i + 1);
    let line = bytes[start..end].to_vec();
    let replaced = if out { start..end } else { start..start };
    bytes.splice(replaced, if out { Vec::new() } else { line }).for_each(drop);
}

/// Puts another digit in the place of the next one.
fn digit(bytes: &mut [u8], at: usize, digit: u8) {
    if let Some(found) = bytes[at..].iter_mut().find(|b| b.is_ascii_digit()) {
        *found = b'0' + digit;
    }
}

/// `RUBOR_MUTATIONS` sets the number of files.
#[test]
fn mutated_recordings_end_in_a_take_or_an_error_in_bounded_time() {
    let rounds = std::env::var("RUBOR_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(400);
    let hostile =
        ["50000000", "-1", "1e300", "nan", "1e-320", ";", ",", "\"", "00:00:59;29", "{", "]", "\t", "null"];
    let seeds: Vec<Input> = cases().into_iter().map(|c| c.input).collect();
    let mut noise = SplitMix64(14);
    let (mut read, mut refused, mut slowest) = (0, 0, 0.0_f64);
    for round in 0..rounds {
        let seed = &seeds[round % seeds.len()];
        let mut bytes = match seed {
            Input::Csv(bytes) | Input::Json(bytes) => bytes.clone(),
            Input::Retarget(text) => text.clone().into_bytes(),
        };
        for _ in 0..1 + noise.below(4) {
            // Half of them where the times and the names stand.
            let end = if noise.below(2) == 0 { bytes.len() } else { bytes.len().min(1500) };
            let at = noise.below(end);
            let to = (at + noise.below(300)).min(bytes.len());
            match noise.below(12) {
                0 => bytes[at] = noise.bits() as u8,
                1 => bytes.truncate(at.max(1)),
                2 => {
                    let token = hostile[noise.below(hostile.len())].bytes();
                    bytes.splice(at..(at + noise.below(9)).min(bytes.len()), token).for_each(drop);
                }
                3 => bytes.drain(at..to).for_each(drop),
                4 => {
                    let copy = bytes[at..to].to_vec();
                    bytes.splice(at..at, copy).for_each(drop);
                }
                // What keeps the form: another digit, a line less, a line twice.
                5 | 6 => lines(&mut bytes, at, noise.below(2) == 0),
                _ => digit(&mut bytes, at, noise.below(10) as u8),
            }
            if bytes.is_empty() {
                bytes.push(b' ');
            }
        }
        let input = match seed {
            Input::Csv(_) => Input::Csv(bytes),
            Input::Json(_) => Input::Json(bytes),
            Input::Retarget(_) => Input::Retarget(String::from_utf8_lossy(&bytes).into_owned()),
        };
        let started = Instant::now();
        match take(&input) {
            Ok(Some((recording, sequence, _))) => {
                assert!(recording.times_s.windows(2).all(|w| w[0] < w[1]));
                assert!(recording.channels.iter().all(|c| c.values.len() == recording.times_s.len()));
                sequence.check().unwrap();
                read += 1;
            }
            Ok(None) => read += 1,
            Err(_) => refused += 1,
        }
        slowest = slowest.max(started.elapsed().as_secs_f64());
        // A shared machine gets its time; most files take a millisecond.
        assert!(slowest < 10.0, "round {round}: {slowest} s");
    }
    eprintln!("{rounds} mutated recordings: {read} read, {refused} refused, the slowest in {slowest:.3} s");
    assert!(read > rounds / 20 && refused > rounds / 20, "{read} read, {refused} refused");
}
