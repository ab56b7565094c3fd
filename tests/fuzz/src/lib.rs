//! Fuzz targets of rubor's readers: what each reads, how its files are changed, where it begins.
//!
//! ```text
//! seed files --mutate (structure-aware)--> bytes --run--> reader: an error or a result, never a panic
//! ```
//!
//! The same targets run in two ways. `cargo run --release -- all --seconds 60` changes seeds blindly, on any toolchain,
//! and keeps inputs that give a message which no input gave before. `sh run.sh TARGET` builds them with libFuzzer, which
//! follows coverage.

pub mod mutate;
pub mod seeds;

use std::path::Path;

use mutate::Random;
use rubor_assets::facial_appearance::FacialAppearance;
use rubor_assets::image_io::{ReadOptions, decode_image};
use rubor_assets::import::capture::{Retarget, json, live_link, to_sequence};
use rubor_assets::import::obj::GroupBy;
use rubor_assets::import::{gltf, makehuman, obj, obj_file, usd};
use rubor_rig::expression::Rig;
use rubor_rig::timeline::Sequence;

/// A reader under test.
pub struct Target {
    /// Name of the binary and of the corpus.
    pub name: &'static str,
    /// Reads bytes; the message of the error, if there is one.
    pub run: fn(&[u8]) -> Result<(), String>,
    /// Changes a file within its structure.
    pub mutate: fn(&mut Vec<u8>, &mut Random),
    /// Valid files to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

fn said<T, E: std::fmt::Display>(result: Result<T, E>) -> Result<(), String> {
    result.map(|_| ()).map_err(|e| e.to_string())
}

/// Every reader.
pub const TARGETS: &[Target] = &[
    Target { name: "gltf", run: read_gltf, mutate: mutate::glb, seeds: seeds::gltf },
    Target { name: "own", run: read_own, mutate: mutate::glb, seeds: seeds::own },
    Target { name: "obj", run: read_obj, mutate: mutate::lines, seeds: seeds::obj },
    Target { name: "mtl", run: read_mtl, mutate: mutate::lines, seeds: seeds::mtl },
    Target { name: "target", run: read_target, mutate: mutate::lines, seeds: seeds::target },
    Target { name: "image", run: read_image, mutate: mutate::image, seeds: seeds::image },
    Target { name: "rig", run: read_rig, mutate: mutate::json, seeds: seeds::rig },
    Target { name: "sequence", run: read_sequence, mutate: mutate::json, seeds: seeds::sequence },
    Target { name: "capture_csv", run: read_csv, mutate: mutate::lines, seeds: seeds::capture_csv },
    Target { name: "capture_json", run: read_capture, mutate: mutate::json, seeds: seeds::capture_json },
    Target { name: "retarget", run: read_retarget, mutate: mutate::json, seeds: seeds::retarget },
    Target { name: "maya", run: read_maya, mutate: mutate::lines, seeds: seeds::maya },
    Target { name: "usd", run: read_usd, mutate: mutate::lines, seeds: seeds::usd },
];

/// The target of a name.
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|t| t.name == name)
}

fn read_gltf(bytes: &[u8]) -> Result<(), String> {
    let _ = gltf::lint(bytes, Path::new("a.glb"));
    said(gltf::from_bytes(bytes, Path::new("a.glb")))
}

fn read_own(bytes: &[u8]) -> Result<(), String> {
    let read = gltf::from_bytes(bytes, Path::new("a.glb")).map_err(|e| e.to_string())?;
    if let Some(rig) = &read.rig {
        Rig::from_json("rig", &rig.to_string()).map_err(|e| e.to_string())?;
    }
    if let Some(sequence) = &read.sequence {
        Sequence::from_json("sequence", &sequence.to_string()).map_err(|e| e.to_string())?;
    }
    let value = serde_json::from_slice::<serde_json::Value>(bytes).unwrap_or_default();
    let _ = serde_json::from_value::<FacialAppearance>(value);
    Ok(())
}

fn read_obj(bytes: &[u8]) -> Result<(), String> {
    let _ = obj::from_bytes(bytes, Path::new("a.obj"), GroupBy::Group);
    said(obj_file::from_bytes(bytes, Path::new("a.obj")))
}

fn read_mtl(bytes: &[u8]) -> Result<(), String> {
    said(obj_file::materials_from_bytes(bytes, Path::new("")))
}

fn read_target(bytes: &[u8]) -> Result<(), String> {
    let name = if bytes.starts_with(b"\x1f\x8b") { "a.target.gz" } else { "a.target" };
    said(makehuman::target_from_bytes(bytes, Path::new(name), 100))
}

fn read_image(bytes: &[u8]) -> Result<(), String> {
    said(decode_image(Path::new("a"), bytes, &ReadOptions::default()))
}

fn read_rig(bytes: &[u8]) -> Result<(), String> {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let rig = Rig::from_json("rig.json", text).map_err(|e| e.to_string())?;
    said(rubor_rig::bind::BoundRig::new(seeds::small_head(), &rig))
}

fn read_sequence(bytes: &[u8]) -> Result<(), String> {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let sequence = Sequence::from_json("s.json", text).map_err(|e| e.to_string())?;
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
    Ok(())
}

fn read_csv(bytes: &[u8]) -> Result<(), String> {
    let recording = live_link::from_bytes(bytes, Path::new("a.csv"), None).map_err(|e| e.to_string())?;
    said(to_sequence(&recording, &Retarget::default(), Some(24.0)))
}

fn read_capture(bytes: &[u8]) -> Result<(), String> {
    let recording = json::from_bytes(bytes, Path::new("a.json")).map_err(|e| e.to_string())?;
    said(to_sequence(&recording, &Retarget::default(), None))
}

fn read_retarget(bytes: &[u8]) -> Result<(), String> {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let retarget = Retarget::from_json("r.json", text).map_err(|e| e.to_string())?;
    let recording = live_link::from_bytes(&seeds::capture_csv()[0], Path::new("a.csv"), None)
        .map_err(|e| e.to_string())?;
    said(to_sequence(&recording, &retarget, Some(30.0)))
}

fn read_maya(bytes: &[u8]) -> Result<(), String> {
    said(rubor_maya::read::from_bytes(bytes, Path::new("a.ma"), &rubor_maya::read::Options::default()))
}

fn read_usd(bytes: &[u8]) -> Result<(), String> {
    let _ = rubor_assets::check::usd::check(bytes, Path::new(""));
    said(usd::from_bytes(bytes, Path::new("a.usda")))
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
            (target.mutate)(&mut bytes, &mut random);
            bytes.truncate(max_size);
            data[..bytes.len()].copy_from_slice(&bytes);
            bytes.len()
        });
    };
}
