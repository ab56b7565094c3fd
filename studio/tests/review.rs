//! What a reviewer gets: the page of a run, the page of two runs, and what they say about bad input.

mod support;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use rubor::review::page::PageData;
use rubor::{Job, Plan};
use support::can_draw;

fn rubor(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rubor")).args(arguments).output().expect("the command starts")
}

fn done(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    said
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// A sequence of some frames at 8 a second.
fn sequence(folder: &Path, frames: u32) -> PathBuf {
    let path = folder.join(format!("s{frames}.json"));
    let duration = f64::from(frames) / 8.0;
    let text = format!(
        r#"{{ "fps": 8, "duration": {duration},
             "expressions": {{ "joy": [{{ "t": 0, "v": 0 }}, {{ "t": 0.25, "v": 1 }}, {{ "t": 0.5, "v": 0.5 }}] }},
             "states": {{ "blush": 0.7 }}, "environment": {{ "name": "studio" }} }}"#
    );
    std::fs::write(&path, text).expect("a sequence");
    path
}

const FAST: &[&str] =
    &["--size", "48x32", "--preset", "draft", "--shadow-size", "64", "--no-video", "--no-export"];

fn render(sequence: &Path, out: &Path, more: &[&str]) -> String {
    done(&rubor(&[&["render", "--sequence", text(sequence), "-o", text(out)][..], FAST, more].concat()))
}

#[test]
fn the_page_of_a_run_shows_its_frames_weights_marks_and_numbers() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("a <b> & \"c\"");
    render(&sequence(folder.path(), 4), &out, &["--inset", "hemoglobin"]);
    let data = PageData::read(&out.join("review.html")).expect("a page");
    assert_eq!((data.title.as_str(), data.fps, data.size), ("a <b> & \"c\"", 8.0, [48, 32]));
    assert_eq!(data.frames, [1, 2, 3, 4]);
    // The weights are those that the frames were drawn with.
    let job = Job::read(&out.join("job.json"), None).expect("a job");
    let heads = job.load_heads().expect("heads");
    let plan = Plan::new(&job, &heads).expect("a plan");
    let curve = |group: &str, name: &str| {
        let curve = data.curves.iter().find(|c| c.group == group && c.name == name);
        &curve.unwrap_or_else(|| panic!("{group} {name}")).values
    };
    assert_eq!(curve("expressions", "joy"), &[0.0, 0.5, 1.0, 0.75].map(Some));
    assert_eq!(curve("states", "blush"), &[0.7; 4].map(Some));
    for frame in 0..4 {
        let face = &plan.shots(frame)[0].face;
        let head = &heads[0].head;
        let same = |found: Option<f64>, expected: f32| {
            found.is_some_and(|found| (found - f64::from(expected)).abs() <= 0.51e-4)
        };
        for (zone, weight) in head.maps.zones.iter().zip(&face.zones) {
            assert!(same(curve("wrinkles", &zone.name)[frame as usize], *weight), "{}", zone.name);
        }
        for (distribution, weight) in head.maps.distributions.iter().zip(&face.distributions) {
            assert!(same(curve("blood", &distribution.name)[frame as usize], *weight), "{}", distribution.name);
        }
        assert!(same(curve("blood", "amount of blood")[frame as usize], face.hemoglobin_scale));
    }
    let peaks: Vec<_> = data.marks.iter().filter(|m| m.is_peak).map(|m| (&m.name[..], m.frame, m.frames)).collect();
    assert_eq!(peaks, [("blush 0.70", 1, 4), ("joy 1.00", 3, 1)]);
    let inset = data.inset.expect("an inset");
    assert_eq!(inset.name, "hemoglobin");
    let [x, y, w, h] = inset.rect;
    assert!(x + w < 48 && y + h < 32 && w.max(h) == 10, "{:?}", inset.rect);
    assert!(data.settings.iter().any(|(name, value)| name == "quality.shadowSize" && value == "64"));
    assert!(data.cost.seconds.iter().all(Option::is_some));
    let stats = std::fs::read_to_string(out.join("stats.json")).expect("stats.json");
    assert!(stats.contains("\"review.html\""), "the report names the page");
}

#[test]
fn parts_of_a_run_share_a_page_and_notes_stay_with_their_job() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let sequence = sequence(folder.path(), 4);
    let out = folder.path().join("out");
    let page = || PageData::read(&out.join("review.html")).expect("a page");
    render(&sequence, &out, &["--frames", "2"]);
    assert_eq!(page().frames, [2]);
    render(&sequence, &out, &["--frames", "4"]);
    let parts = page();
    assert_eq!(parts.frames, [2, 4]);
    assert_eq!(parts.cost.seconds[0], None, "what another run drew was not measured");
    assert!(parts.cost.seconds[1].is_some());
    render(&sequence, &out, &["--resume"]);
    let whole = page();
    assert_eq!(whole.frames, [1, 2, 3, 4]);
    assert_eq!(whole.id, parts.id, "notes of the parts are notes of the whole");
    // Another job has other notes, and its page replaces this one.
    render(&sequence, &out, &["--exposure", "1"]);
    assert_ne!(page().id, whole.id);
}

#[test]
fn two_runs_share_a_page_and_what_is_unlike_is_said() {
    if !can_draw() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    render(&sequence(folder.path(), 4), &at("one"), &[]);
    render(&sequence(folder.path(), 4), &at("two"), &["--exposure", "2.5"]);
    render(&sequence(folder.path(), 2), &at("short"), &["--size", "32x32"]);
    let compare = |a: &str, b: &str, more: &[&str]| {
        rubor(&[&["compare", text(&at(a)), text(&at(b)), "--page", text(&at("page"))][..], more].concat())
    };
    done(&compare("one", "two", &[]));
    let data = PageData::read(&at("page/review.html")).expect("a page");
    let second = data.second.expect("a second run");
    assert_eq!((&data.title[..], &second.title[..]), ("one", "two"));
    assert_eq!((&data.folder[..], &second.folder[..]), ("a/", "b/"));
    for (run, copy) in [("one", "a"), ("two", "b")] {
        for frame in 1..=4 {
            let name = format!("frame.{frame:04}.png");
            let read = |path: PathBuf| std::fs::read(path).expect("a frame");
            assert_eq!(read(at(run).join(&name)), read(at("page").join(copy).join(&name)));
        }
    }
    let flip = &data.curves[0];
    assert_eq!((&flip.group[..], &flip.name[..]), ("difference", "FLIP, mean"));
    assert!(flip.values.iter().all(|v| v.is_some_and(|v| v > 0.001)), "{:?}", flip.values);

    // Another size and length; the frames of the page before are gone.
    let said = done(&compare("one", "short", &["--json"]));
    for phrase in ["found 32x32 pixels, expected 48x32", "partners of 2 of the 4 frames"] {
        assert!(said.contains(phrase), "{said}");
    }
    assert!(!at("page/b/frame.0003.png").exists());
    assert!(at("page/b/frame.0002.png").exists());

    // A lost frame and a broken one do not hide the others.
    std::fs::remove_file(at("two/frame.0001.png")).expect("a frame");
    std::fs::write(at("two/frame.0002.png"), b"half").expect("a frame");
    let output = compare("one", "two", &["--json"]);
    let said = done(&output);
    for phrase in ["no picture of 1 of 4 frames; the first is 1", "frame.0001.png", "frame.0002.png"] {
        assert!(said.contains(phrase), "{said}");
    }
    let rows: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(rows.as_array().map(Vec::len), Some(2));
    assert_eq!(compare("one", "two", &["--most", "0.0001"]).status.code(), Some(1));

    // No page, no job: the frames alone are compared.
    std::fs::remove_file(at("one/review.html")).expect("a page");
    let said = done(&compare("one", "two", &[]));
    assert!(said.contains("weights and settings are unknown"), "{said}");
    assert_eq!(PageData::read(&at("page/review.html")).expect("a page").fps, 8.0);
    std::fs::remove_file(at("one/job.json")).expect("a job");
    assert!(done(&compare("one", "two", &[])).contains("24 frames a second are assumed"));

    for (wrong, phrase) in [("nowhere", "no such folder"), ("s2.json", "a file"), ("page", "found no frames")] {
        let output = compare("one", wrong, &[]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(phrase), "{said}");
    }
}
