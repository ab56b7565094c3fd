//! Right light of a still, drawn or read back from the folder of an earlier run.

use std::path::{Path, PathBuf};

use rubor_assets::image_io::{Limits, ReadOptions, SampleKind, load_image_with};
use rubor_rig::evaluate::Shot;
use rubor_rig::head::Head;
use rubor_rig::map::Map;
use rubor_rig::random::mixed;
use rubor_rig::skin::volume::{self, Body, Filter, Flesh, Normals, Patch, View};
use serde::{Deserialize, Serialize};

use super::skin;
use crate::error::{Failure, Outcome};
use crate::output;

/// Diffuse light of a still, rows from the top.
pub(super) struct Truth {
    pub(super) light: Vec<[f32; 3]>,
    pub(super) error: Vec<[f32; 3]>,
    pub(super) patches: Vec<Option<Patch>>,
    pub(super) lost: f64,
}

/// What decides the light, so that a file with the same is not drawn again.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Made {
    /// Grows when the tracer changes its light.
    version: u32,
    size: [u32; 2],
    flesh: Flesh,
    options: volume::Options,
    /// Of pose, camera and lamps.
    scene: String,
    lost: f64,
}

const VERSION: u32 = 1;

/// Draws a still, or reads what a run before left in `folder`.
///
/// # Errors
/// A head without an inside; files that cannot be written.
pub(super) fn of(
    head: &Head,
    shot: &Shot,
    flesh: &Flesh,
    size: [u32; 2],
    [paths, seed]: [u64; 2],
    folder: Option<&Path>,
) -> Outcome<Truth> {
    let body = Body::new(head, &shot.face, Normals::Smooth).map_err(Failure::input)?;
    let view = View::new(&shot.camera, size);
    let lamps = skin::lamps(shot);
    let patches = volume::patches(&body, &lamps, &view);
    let scene = format!("{:016x}", hash(&format!("{view:?} {lamps:?}"), body.points_mm()));
    let options = volume::Options { paths: paths as u32, seed, filter: Filter::Middle };
    let mut made = Made { version: VERSION, size, flesh: *flesh, options, scene, lost: 0.0 };
    if let Some(known) = folder.and_then(|folder| read(folder, &made)) {
        let (light, error, lost) = known;
        return Ok(Truth { light, error, patches, lost });
    }
    let picture = volume::picture(flesh, &body, &lamps, &view, &options);
    made.lost = picture.lost;
    if let Some(folder) = folder {
        let [light, error, about] = files(folder);
        save(&light, size, &picture.diffuse)?;
        save(&error, size, &picture.diffuse_error)?;
        // Last, so that a stopped run leaves nothing that looks whole.
        output::write_json(&about, &made)?;
    }
    Ok(Truth { light: picture.diffuse, error: picture.diffuse_error, patches, lost: picture.lost })
}

fn files(folder: &Path) -> [PathBuf; 3] {
    ["truth.exr", "truth-error.exr", "truth.json"].map(|name| folder.join(name))
}

fn save(path: &Path, [width, height]: [u32; 2], light: &[[f32; 3]]) -> Outcome {
    let map = Map { width, height, channels: 3, values: light.as_flattened().to_vec() };
    output::save_map(path, &map, SampleKind::F32)
}

type Known = (Vec<[f32; 3]>, Vec<[f32; 3]>, f64);

/// Light and its errors, if the files are there and were made alike.
fn read(folder: &Path, wanted: &Made) -> Option<Known> {
    let [light, error, about] = files(folder);
    let found: Made = serde_json::from_slice(&std::fs::read(about).ok()?).ok()?;
    if found != (Made { lost: found.lost, ..wanted.clone() }) {
        return None;
    }
    let picture = |path: &Path| -> Option<Vec<[f32; 3]>> {
        let options = ReadOptions { limits: Limits::default(), ..ReadOptions::default() };
        let map = load_image_with(path, &options).ok()?.map;
        let is_whole = [map.width, map.height] == wanted.size && map.channels == 3;
        is_whole.then(|| map.values.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
    };
    Some((picture(&light)?, picture(&error)?, found.lost))
}

fn hash(words: &str, points: &[glam::Vec3]) -> u64 {
    let fold = |h: u64, v: u64| mixed(h ^ v);
    let words = words.bytes().fold(0, |h, b| fold(h, u64::from(b) + 1));
    points.iter().flat_map(|p| p.to_array()).fold(words, |h, v| fold(h, u64::from(v.to_bits())))
}
