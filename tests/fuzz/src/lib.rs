//! Fuzz targets of rubor's readers: what each reads, how its files are changed, where it begins.
//!
//! ```text
//! seed files --mutate (structure-aware)--> bytes --run--> reader: an error or a result, never a panic
//! ```
//!
//! The same targets run in two ways. `cargo run --release -- all --seconds 60` changes seeds blindly, on any toolchain,
//! and keeps inputs that give an error or a note which no input gave before. `sh run.sh TARGET` builds them with
//! libFuzzer, which follows coverage. `sh coverage.sh` says which lines of the readers the first way sees.
//!
//! Files are read as if they lay in `beside/`, whose pictures, materials and buffer they may name.

pub mod mutate;
pub mod seeds;

use std::path::{Path, PathBuf};

use mutate::{Random, Stock};
use rubor_assets::facial_appearance::FacialAppearance;
use rubor_assets::image_io::{ReadOptions, decode_image};
use rubor_assets::import::capture::{Recording, Retarget, json, live_link, load_into, to_sequence};
use rubor_assets::import::obj::GroupBy;
use rubor_assets::import::{gltf, makehuman, obj, obj_file, usd};
use rubor_assets::notes::Note;
use rubor_rig::expression::Rig;
use rubor_rig::timeline::Sequence;

/// A reader under test.
pub struct Target {
    /// Name of the binary and of the corpus.
    pub name: &'static str,
    /// Reads bytes: what the reader notes, or the message of the error.
    pub run: fn(&[u8]) -> Result<Vec<String>, String>,
    /// Changes a file within its structure.
    pub mutate: fn(&mut Vec<u8>, &Stock<'_>, &mut Random),
    /// Words of the format, as libFuzzer reads them.
    pub dictionary: &'static str,
    /// Valid files to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

type Outcome = Result<Vec<String>, String>;

fn said<T, E: std::fmt::Display>(result: Result<T, E>) -> Outcome {
    result.map(|_| Vec::new()).map_err(|e| e.to_string())
}

/// What each note says, without its places.
fn noted(notes: &[Note]) -> Vec<String> {
    notes.iter().map(|n| n.message.clone()).collect()
}

/// A file of this name in the folder of files that others may name.
pub(crate) fn beside(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/beside")).join(name)
}

macro_rules! target {
    ($name:literal, $seeds:ident, $run:ident, $mutate:ident) => {
        Target {
            name: $name,
            run: $run,
            mutate: mutate::$mutate,
            dictionary: include_str!(concat!("../dictionaries/", $name, ".dict")),
            seeds: seeds::$seeds,
        }
    };
}

/// Every reader.
pub const TARGETS: &[Target] = &[
    target!("gltf", gltf, read_gltf, glb),
    target!("own", own, read_own, glb),
    target!("obj", obj, read_obj, lines),
    target!("mtl", mtl, read_mtl, lines),
    target!("target", target, read_target, lines),
    target!("image", image, read_image, image),
    target!("rig", rig, read_rig, json),
    target!("sequence", sequence, read_sequence, json),
    target!("capture_csv", capture_csv, read_csv, lines),
    target!("capture_json", capture_json, read_capture, json),
    target!("retarget", retarget, read_retarget, json),
    target!("maya", maya, read_maya, lines),
    target!("usd", usd, read_usd, lines),
];

/// The target of a name.
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|t| t.name == name)
}

fn read_gltf(bytes: &[u8]) -> Outcome {
    let path = beside("a.glb");
    let findings = gltf::lint(bytes, &path).unwrap_or_default();
    let mut notes = noted(&gltf::from_bytes(bytes, &path).map_err(|e| e.to_string())?.notes);
    notes.extend(findings.into_iter().map(|f| f.message));
    Ok(notes)
}

fn read_own(bytes: &[u8]) -> Outcome {
    let read = gltf::from_bytes(bytes, &beside("a.glb")).map_err(|e| e.to_string())?;
    if let Some(rig) = &read.rig {
        Rig::from_json("rig", &rig.to_string()).map_err(|e| e.to_string())?;
    }
    if let Some(sequence) = &read.sequence {
        Sequence::from_json("sequence", &sequence.to_string()).map_err(|e| e.to_string())?;
    }
    let value = serde_json::from_slice::<serde_json::Value>(bytes).unwrap_or_default();
    let _ = serde_json::from_value::<FacialAppearance>(value);
    Ok(noted(&read.notes))
}

fn read_obj(bytes: &[u8]) -> Outcome {
    let path = beside("a.obj");
    let _ = obj::from_bytes(bytes, &path, GroupBy::Group);
    obj_file::from_bytes(bytes, &path).map(|read| noted(&read.notes)).map_err(|e| e.to_string())
}

fn read_mtl(bytes: &[u8]) -> Outcome {
    said(obj_file::materials_from_bytes(bytes, &beside("")))
}

fn read_target(bytes: &[u8]) -> Outcome {
    let name = if bytes.starts_with(b"\x1f\x8b") { "a.target.gz" } else { "a.target" };
    said(makehuman::target_from_bytes(bytes, Path::new(name), 100))
}

fn read_image(bytes: &[u8]) -> Outcome {
    said(decode_image(Path::new("a"), bytes, &ReadOptions::default()))
}

fn read_rig(bytes: &[u8]) -> Outcome {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let rig = Rig::from_json("rig.json", text).map_err(|e| e.to_string())?;
    let (bound, notes) =
        rubor_rig::bind::BoundRig::new(seeds::small_head(), &rig).map_err(|e| e.to_string())?;
    let mut weights = bound.neutral_weights();
    weights.shapes.iter_mut().zip([0.25, -0.5, 1.5]).for_each(|(w, v)| *w = v);
    for weight in [0.0, 0.5, 1.0] {
        weights.expressions.fill(weight);
        weights.states.fill(weight);
        let _ = bound.face(&weights);
    }
    Ok(notes.into_iter().map(|n| n.message).collect())
}

fn read_sequence(bytes: &[u8]) -> Outcome {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let mut sequence = Sequence::from_json("s.json", text).map_err(|e| e.to_string())?;
    let report = load_into(&mut sequence, &beside("")).map_err(|e| e.to_string())?;
    let rig = Rig::default_rig().map_err(|e| e.to_string())?;
    let (evaluator, _) = rubor_rig::evaluate::Evaluator::new(seeds::small_head(), &rig, &sequence)
        .map_err(|e| e.to_string())?;
    for frame in [0, 1, evaluator.frame_count() / 2, evaluator.frame_count() - 1] {
        let shot = evaluator.at(evaluator.frame_time_s(frame));
        assert!(shot.face.shapes.iter().all(|w| w.is_finite()), "weights stay finite");
        assert!(
            shot.face.head_rotation.is_finite() && shot.camera.position.is_finite(),
            "places stay finite"
        );
    }
    Ok(report.map(|r| r.notes).unwrap_or_default())
}

/// Notes of a recording and of the sequence that it gives.
fn performed(recording: &Recording, retarget: &Retarget, fps: Option<f64>) -> Outcome {
    let (_, report) = to_sequence(recording, retarget, fps).map_err(|e| e.to_string())?;
    Ok([&recording.notes[..], &report.notes].concat())
}

fn read_csv(bytes: &[u8]) -> Outcome {
    let recording = live_link::from_bytes(bytes, Path::new("a.csv"), None).map_err(|e| e.to_string())?;
    // What a rate that the user states makes of it.
    let _ = live_link::from_bytes(bytes, Path::new("a.csv"), Some(30.0));
    // The file that a user gets to edit is a valid one.
    let template = serde_json::to_string(&Retarget::template(&recording)).map_err(|e| e.to_string())?;
    let template = Retarget::from_json("template.json", &template).expect("a template is a retarget file");
    performed(&recording, &template, Some(24.0))
}

fn read_capture(bytes: &[u8]) -> Outcome {
    let recording = json::from_bytes(bytes, Path::new("a.json")).map_err(|e| e.to_string())?;
    performed(&recording, &Retarget::default(), None)
}

fn read_retarget(bytes: &[u8]) -> Outcome {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let retarget = Retarget::from_json("r.json", text).map_err(|e| e.to_string())?;
    let recording = live_link::from_bytes(&seeds::capture_csv()[0], Path::new("a.csv"), None)
        .map_err(|e| e.to_string())?;
    performed(&recording, &retarget, Some(30.0))
}

fn read_maya(bytes: &[u8]) -> Outcome {
    let read = rubor_maya::read::from_bytes(bytes, &beside("a.ma"), &rubor_maya::read::Options::default());
    // After the colon are names.
    let text = |note: String| note.split(": ").next().unwrap_or_default().to_owned();
    read.map(|read| read.notes.into_iter().map(text).collect()).map_err(|e| e.to_string())
}

fn read_usd(bytes: &[u8]) -> Outcome {
    let findings = rubor_assets::check::usd::check(bytes, &beside(""));
    let mut notes = noted(&usd::from_bytes(bytes, &beside("a.usda")).map_err(|e| e.to_string())?.notes);
    notes.extend(findings.into_iter().map(|f| f.message));
    Ok(notes)
}

/// A binary of libFuzzer for a target, with its structure-aware mutator.
#[macro_export]
macro_rules! libfuzzer_target {
    ($name:literal) => {
        libfuzzer_sys::fuzz_target!(|data: &[u8]| {
            let target = rubor_fuzz::target($name).expect("a target of that name");
            let _ = (target.run)(data);
        });
        libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
            let target = rubor_fuzz::target($name).expect("a target of that name");
            let mut random = rubor_fuzz::mutate::Random::new(u64::from(seed));
            // Half of the changes are libFuzzer's own, which knows dictionary and coverage.
            if random.below(2) == 0 {
                return libfuzzer_sys::fuzzer_mutate(data, size, max_size);
            }
            let mut bytes = data[..size].to_vec();
            (target.mutate)(&mut bytes, &rubor_fuzz::mutate::Stock::default(), &mut random);
            bytes.truncate(max_size);
            data[..bytes.len()].copy_from_slice(&bytes);
            bytes.len()
        });
    };
}
