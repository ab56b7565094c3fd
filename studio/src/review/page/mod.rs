//! The review page: `review.html`, one file that plays the frames beside it in any browser, without network.
//!
//! ```text
//! Plan, report, costs --PageData--> JSON --+
//! page.html, page.css, *.js (embedded) ----+--> review.html, which names frame.0001.png ... by their numbers
//! ```
//!
//! The data are within the page, as pages of files may not read other files; pictures they may show. A second run is
//! within the page too ([`crate::review::versus`]), or is a folder that the viewer chooses.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rubor_renderer::settings::{Leaf, leaves};
use rubor_rig::limits;
use rubor_rig::timeline::Track;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::inset::{self, Inset};
use super::marks::{self, Mark};
use crate::error::{Failure, Outcome};
use crate::job::Job;
use crate::output;
use crate::plan::Plan;
use crate::report::JobReport;

/// Name of the page in the folder of a run.
pub const PAGE_FILE: &str = "review.html";
/// Most frames of a page: more than an hour at 24 a second. The browser holds a row of numbers for each curve.
pub const MOST_FRAMES: usize = 100_000;

const HTML: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: [&str; 5] = [
    include_str!("model.js"),
    include_str!("view.js"),
    include_str!("time.js"),
    include_str!("notes.js"),
    include_str!("main.js"),
];
const DATA_START: &str = r#"<script id="data" type="application/json">"#;
const DATA_END: &str = "</script>";

/// What a page shows of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PageData {
    /// Changes with anything that decides pixels; notes are kept under it.
    pub id: String,
    /// Name of the folder.
    pub title: String,
    /// Where the pictures are, from the page: empty, or a name and `/`.
    pub folder: String,
    /// Frames per second.
    pub fps: f64,
    /// Width and height of the pictures.
    pub size: [u32; 2],
    /// Numbers of the frames that there are, from 1, ascending.
    pub frames: Vec<u32>,
    /// Weights at each of the frames, of the first head.
    pub curves: Vec<Curve>,
    /// Peaks and keys.
    pub marks: Vec<Mark>,
    /// The map in a corner of each frame.
    pub inset: Option<InsetPlace>,
    /// Names and values of the settings.
    pub settings: Vec<(String, String)>,
    /// What was measured of the run as a whole.
    pub facts: Vec<(String, String)>,
    /// What was measured of each frame.
    pub cost: Cost,
    /// Notes of the run.
    pub notes: Vec<String>,
    /// Other files in the folder.
    pub files: Vec<PathBuf>,
    /// A run to compare with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<Box<PageData>>,
}

/// A weight over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Curve {
    /// `expressions`, `states`, `blood`, `wrinkles`, `shapes`, `difference`.
    pub group: String,
    /// Its name.
    pub name: String,
    /// Its value where nothing happens.
    pub rest: f64,
    /// A value for each frame of the page, to four decimals; none where it is unknown.
    pub values: Vec<Option<f64>>,
    /// Frames on which its keys stand, from 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub keys: Vec<u32>,
}

/// A map in a corner of each frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct InsetPlace {
    /// Name of the map.
    pub name: String,
    /// What it shows, in words.
    pub about: String,
    /// Left, top, width and height, pixels.
    pub rect: [u32; 4],
}

/// Measured times for each frame of the page; none of those that an earlier run drew.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Cost {
    /// Seconds since the frame before was drawn.
    pub seconds: Vec<Option<f64>>,
    /// Milliseconds on the device for each pass.
    pub passes: BTreeMap<String, Vec<Option<f64>>>,
}

/// What a run measured of one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameCost {
    /// Seconds since the frame before was drawn.
    pub seconds: f64,
    /// Passes and their milliseconds on the device; a pass may be named several times.
    pub passes_ms: Vec<(&'static str, f64)>,
}

impl PageData {
    /// The page of some frames of a plan, from 0 and ascending, that are in `folder`.
    ///
    /// # Errors
    /// A number that JSON cannot represent.
    pub fn new(
        plan: &Plan<'_>,
        frames: &[u32],
        folder: &Path,
        inset: Option<(inset::Map, &Inset)>,
        costs: &BTreeMap<u32, FrameCost>,
        report: &JobReport,
    ) -> Outcome<Self> {
        let job = plan.job();
        let size = job.settings.output.size;
        Ok(Self {
            id: job.identity()?.to_string(),
            title: title(folder),
            folder: String::new(),
            fps: job.sequence.fps,
            size,
            frames: frames.iter().map(|frame| frame + 1).collect(),
            curves: curves(plan, frames),
            marks: marks::of(&job.sequence),
            inset: inset.map(|(map, inset)| inset_place(map, inset.place(size))),
            settings: settings(job),
            facts: facts(report),
            cost: cost(frames, costs),
            notes: report.notes.clone(),
            files: report.files.clone(),
            second: None,
        })
    }

    /// The text of the page.
    ///
    /// # Errors
    /// A number that JSON cannot represent.
    pub fn html(&self) -> Outcome<String> {
        // No text of the data can end the element that holds it.
        let data = serde_json::to_string(self).map_err(Failure::job)?.replace('<', "\\u003c");
        let script = format!("(() => {{\n\"use strict\";\n{}}})();\n", SCRIPT.join("\n"));
        let mut page = String::with_capacity(HTML.len() + STYLE.len() + script.len() + data.len());
        let mut rest = HTML;
        for (mark, text) in [("{{style}}", STYLE), ("{{data}}", &data), ("{{script}}", &script)] {
            let (before, after) = rest.split_once(mark).unwrap_or((rest, ""));
            page.push_str(before);
            page.push_str(text);
            rest = after;
        }
        Ok(page + rest)
    }

    /// Writes the page.
    ///
    /// # Errors
    /// The system reports an error.
    pub fn write(&self, path: &Path) -> Outcome {
        output::write(path, self.html()?.as_bytes())
    }

    /// Reads the data of a page.
    ///
    /// # Errors
    /// A file that cannot be read, or is no page of this version.
    pub fn read(path: &Path) -> Outcome<Self> {
        let wrong = |found: String| {
            let expected = "expected a page that this version of `rubor render` wrote";
            Failure::input(format!("{}: found {found}, {expected}", path.display()))
                .hint("draw the run again with --resume, which keeps its frames")
        };
        let bytes = limits::read(path).map_err(|e| Failure::read(path, e))?;
        let text = String::from_utf8(bytes).map_err(|_| wrong("no text".into()))?;
        let data = text.split_once(DATA_START).and_then(|(_, rest)| rest.split_once(DATA_END));
        let (data, _) = data.ok_or_else(|| wrong("no data".into()))?;
        serde_json::from_str(data).map_err(|e| wrong(format!("other data ({e})")))
    }
}

/// Name of a folder for people.
pub(crate) fn title(folder: &Path) -> String {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    whole.file_name().map_or_else(|| "run".into(), |name| name.to_string_lossy().into_owned())
}

/// To four decimals, which are finer than a pixel of a curve and short.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

fn curves(plan: &Plan<'_>, frames: &[u32]) -> Vec<Curve> {
    let (Some(evaluator), Some(head)) = (plan.evaluator(), plan.heads().first()) else { return Vec::new() };
    let (sequence, head) = (evaluator.sequence(), &head.head);
    let curve = |group: &str, name: &str, rest: f64| Curve {
        group: group.to_owned(),
        name: name.to_owned(),
        rest,
        values: Vec::with_capacity(frames.len()),
        keys: Vec::new(),
    };
    let with_keys = |group: &str, name: &str, tracks: &BTreeMap<String, Track<f32>>| Curve {
        keys: tracks.get(name).map_or_else(Vec::new, |track| marks::frames_of_keys(track, sequence)),
        ..curve(group, name, 0.0)
    };
    let rig = evaluator.rig();
    let mut expressions: Vec<_> =
        rig.expression_names().map(|name| with_keys("expressions", name, &sequence.expressions)).collect();
    let mut states: Vec<_> =
        rig.state_names().map(|name| with_keys("states", name, &sequence.states)).collect();
    let mut scale = curve("blood", "amount of blood", 1.0);
    let mut blood: Vec<_> = head.maps.distributions.iter().map(|d| curve("blood", &d.name, 0.0)).collect();
    let mut wrinkles: Vec<_> = head.maps.zones.iter().map(|z| curve("wrinkles", &z.name, 0.0)).collect();
    let mut shapes: Vec<_> =
        head.shapes.iter().map(|s| with_keys("shapes", &s.name, &sequence.shapes)).collect();
    for frame in frames {
        let time_s = evaluator.frame_time_s(*frame);
        let (weights, face) = (evaluator.weights_at(time_s), evaluator.face_at(time_s));
        let rows = [
            (&mut expressions, &weights.expressions),
            (&mut states, &weights.states),
            (&mut blood, &face.distributions),
            (&mut wrinkles, &face.zones),
            (&mut shapes, &face.shapes),
        ];
        for (curves, values) in rows {
            for (curve, value) in curves.iter_mut().zip(values) {
                curve.values.push(Some(rounded(f64::from(*value))));
            }
        }
        scale.values.push(Some(rounded(f64::from(face.hemoglobin_scale))));
    }
    blood.insert(0, scale);
    // Shapes that never move are most of them, and nobody looks at those.
    shapes.retain(|curve| curve.values.iter().any(|value| *value != Some(0.0)));
    [expressions, states, blood, wrinkles, shapes].concat()
}

fn inset_place(map: inset::Map, rect: [u32; 4]) -> InsetPlace {
    let (name, about) = match map {
        inset::Map::Hemoglobin => ("hemoglobin", "Blood of the face as it is now; darker is more."),
        inset::Map::Wrinkles => ("wrinkles", "Weight of the wrinkles as it is now; white is full."),
    };
    InsetPlace { name: name.into(), about: about.into(), rect }
}

/// Names and values; of what is chosen frame by frame, that it is.
fn settings(job: &Job) -> Vec<(String, String)> {
    fn text(value: &Value) -> String {
        match value {
            Value::String(text) => text.clone(),
            // Settings are f32: 1.8, not 1.7999999523162842.
            Value::Number(number) if number.is_f64() => {
                number.as_f64().map_or_else(String::new, |v| (v as f32).to_string())
            }
            Value::Array(list) if list.is_empty() => "none".into(),
            Value::Array(list) => list.iter().map(text).collect::<Vec<_>>().join(", "),
            other => other.to_string(),
        }
    }
    let all = serde_json::to_value(&job.settings).unwrap_or_default();
    let is_chosen = |leaf: &Leaf| job.auto.as_ref().is_some_and(|auto| auto.chooses(&leaf.flag()));
    let value = |leaf: &Leaf| if is_chosen(leaf) { "by need".to_owned() } else { text(leaf.value_in(&all)) };
    leaves().iter().map(|leaf| (leaf.name(), value(leaf))).collect()
}

fn facts(report: &JobReport) -> Vec<(String, String)> {
    let mut facts = vec![
        ("rubor".into(), env!("CARGO_PKG_VERSION").to_owned()),
        ("adapter".into(), format!("{} ({})", report.adapter.name, report.adapter.backend)),
        ("driver".into(), report.adapter.driver.clone()),
        ("frames drawn by the last run".into(), format!("{} of {}", report.frames_drawn, report.frames)),
        ("triangles".into(), report.triangles.to_string()),
        ("memory on the device".into(), format!("{:.1} MB", report.device_memory_bytes as f64 / 1e6)),
    ];
    if let Some(seconds) = report.seconds_per_frame {
        facts.push(("seconds a frame, median".into(), format!("{seconds:.3}")));
    }
    facts.extend(report.auto.iter().map(|run| (format!("frames {}", run.frames), run.chosen.clone())));
    let passes = report.gpu_milliseconds_per_pass.iter();
    facts.extend(passes.map(|(name, ms)| (format!("{name}, median"), format!("{ms:.3} ms"))));
    facts
}

fn cost(frames: &[u32], costs: &BTreeMap<u32, FrameCost>) -> Cost {
    let mut all = Cost::default();
    for (i, frame) in frames.iter().enumerate() {
        let cost = costs.get(frame);
        all.seconds.push(cost.map(|cost| rounded(cost.seconds)));
        for (name, ms) in cost.iter().flat_map(|cost| &cost.passes_ms) {
            let row = all.passes.entry((*name).to_owned()).or_insert_with(|| vec![None; frames.len()]);
            row[i] = Some(rounded(row[i].unwrap_or(0.0) + ms));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data() -> PageData {
        PageData {
            id: "0".into(),
            title: "</script><b>{{script}} \u{2028}".into(),
            fps: 24.0,
            size: [64, 48],
            frames: vec![1, 2, 5],
            curves: vec![Curve {
                group: "expressions".into(),
                name: "joy".into(),
                rest: 0.0,
                values: vec![Some(0.0), Some(0.5), None],
                keys: vec![1, 5],
            }],
            settings: vec![("quality.scatter".into(), "none".into())],
            files: vec!["video.mp4".into()],
            ..PageData::default()
        }
    }

    #[test]
    fn a_page_holds_its_data_and_no_name_can_end_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(PAGE_FILE);
        let data = PageData { second: Some(Box::new(data())), ..data() };
        data.write(&path).unwrap();
        assert_eq!(PageData::read(&path).unwrap(), data);
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.matches("</script>").count(), HTML.matches("</script>").count());
        for mark in ["{{style}}", "{{data}}"] {
            assert!(!text.contains(mark), "{mark}");
        }
        for part in [STYLE].into_iter().chain(SCRIPT) {
            assert!(text.contains(part) && !part.contains("</script"));
        }
        // The name of a language is no address that is asked.
        let text = text.replace("http://www.w3.org/2000/svg", "");
        for word in ["http:", "https:", "@import", "url("] {
            assert!(!text.contains(word), "a page needs no network: {word}");
        }
    }

    #[test]
    fn what_is_no_page_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.html");
        for (text, found) in
            [("<html>", "no data"), (&format!("{DATA_START}{{}}{DATA_END}")[..], "other data")]
        {
            std::fs::write(&path, text).unwrap();
            let message = PageData::read(&path).unwrap_err().to_string();
            assert!(message.contains(found) && message.contains("--resume"), "{message}");
        }
    }

    #[test]
    fn costs_stand_at_their_frames_and_passes_that_run_twice_are_summed() {
        let measured =
            FrameCost { seconds: 0.5, passes_ms: vec![("shade", 1.0), ("morph", 0.25), ("shade", 2.0)] };
        let cost = cost(&[0, 3, 4], &BTreeMap::from([(3, measured)]));
        assert_eq!(cost.seconds, [None, Some(0.5), None]);
        assert_eq!(cost.passes["shade"], [None, Some(3.0), None]);
        assert_eq!(cost.passes.len(), 2);
    }
}
