//! Entries of a glTF document that the reader ignores.

use std::collections::HashSet;
use std::path::Path;

use glam::{Vec3, Vec4};
use gltf::Semantic;

use super::accessor::floats;
use super::channels::{Channel, Target, of_animation};
use super::document::Document;
use super::names::of_mesh;
use crate::check::{Finding, list};
use crate::error::ImportError;
use crate::facial_appearance::NAME;
use crate::notes::Notes;

/// Lengths of normals and sums of joint weights may be off by this: bytes and shorts round.
const ROUNDING: f32 = 0.01;

/// Names of targets, bounds, normals, tangents, weights of joints, animations.
///
/// # Errors
/// A document or an accessor that cannot be read at all.
pub fn lint(bytes: &[u8], path: &Path) -> Result<Vec<Finding>, ImportError> {
    let mut notes = Notes::default();
    let document = Document::load(bytes, path, &mut notes)?;
    let mut findings = Vec::new();
    // A copy in the extras counts; what import says of it comes with its notes below.
    let is_own = document.gltf.extension_value(NAME).is_some();
    if !is_own && super::recovered::extension(&document, &mut Notes::default()).is_none() {
        let message = format!("there is no {NAME}: maps, rig and landmarks are not in this file");
        findings.push(Finding::note("", message).fix("`rubor import` adds them"));
    }
    for mesh in document.gltf.meshes() {
        names(&document, &mesh, &mut findings);
        for primitive in mesh.primitives() {
            let at = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
            attributes(&document, &at, &primitive, &mut findings)?;
        }
    }
    animations(&document, &mut findings, &mut notes);
    if document.gltf.skins().len() > 0 {
        let message = "joints are read in their rest pose: their animation moves nothing here";
        findings.push(Finding::note("skins", message).fix("bake jaw and eye joints into morph targets"));
    }
    let mut notes = notes.into_vec();
    if !is_own && let Ok(imported) = super::from_bytes(bytes, path) {
        let new = |n: &crate::notes::Note| notes.iter().all(|known| known.message != n.message);
        let more: Vec<_> = imported.notes.into_iter().filter(new).collect();
        notes.extend(more);
    }
    findings.extend(notes.iter().map(Finding::from));
    Ok(findings)
}

fn names(document: &Document, mesh: &gltf::Mesh<'_>, findings: &mut Vec<Finding>) {
    let at = format!("mesh {}", mesh.index());
    let count = mesh.primitives().map(|p| p.morph_targets().count()).max().unwrap_or(0);
    if count == 0 {
        return;
    }
    if mesh.primitives().any(|p| p.morph_targets().count() != count) {
        let message = "its primitives have different numbers of morph targets";
        findings.push(Finding::error(at.clone(), message).fix("export all parts with the same targets"));
    }
    let (names, _) = of_mesh(document, mesh);
    let unnamed = names.iter().filter(|n| !n.given).count();
    if unnamed > 0 {
        let message =
            format!("{unnamed} of {count} morph targets have no name: nothing can drive them by name");
        findings.push(Finding::warning(at.clone(), message).fix("write them to mesh.extras.targetNames"));
    }
    let mut seen = HashSet::new();
    let twice: Vec<&str> = names.iter().map(|n| &n.text[..]).filter(|n| !seen.insert(*n)).collect();
    if !twice.is_empty() {
        findings.push(
            Finding::warning(at, format!("morph targets share a name: {}", list(&twice))).fix("rename them"),
        );
    }
}

fn attributes(
    document: &Document,
    at: &str,
    primitive: &gltf::Primitive<'_>,
    findings: &mut Vec<Finding>,
) -> Result<(), ImportError> {
    if let Some(accessor) = primitive.get(&Semantic::Positions) {
        let positions = floats::<3>(document, at, &accessor)?;
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for p in &positions {
            low = low.min(Vec3::from_array(*p));
            high = high.max(Vec3::from_array(*p));
        }
        let stated = |value: Option<serde_json::Value>| -> Option<Vec3> {
            let list = value?;
            let at = |i: usize| Some(list.get(i)?.as_f64()? as f32);
            Some(Vec3::new(at(0)?, at(1)?, at(2)?))
        };
        // Integer positions state integers.
        let is_float = accessor.data_type() == gltf::accessor::DataType::F32;
        let slack = 1e-5 * (high - low).max_element().max(f32::MIN_POSITIVE);
        if let (Some(min), Some(max), true) = (stated(accessor.min()), stated(accessor.max()), is_float)
            && !(min.abs_diff_eq(low, slack) && max.abs_diff_eq(high, slack))
        {
            let message = format!(
                "POSITION states {min} to {max}, its values are {low} to {high}: viewers frame and cull it wrongly"
            );
            findings.push(Finding::warning(at, message).fix("write min and max from the values"));
        }
    }
    if let Some(accessor) = primitive.get(&Semantic::Normals) {
        let normals = floats::<3>(document, at, &accessor)?;
        let off = normals.iter().filter(|n| (Vec3::from_array(**n).length() - 1.0).abs() > ROUNDING).count();
        if off > 0 {
            let message = format!("{off} normals are not of length 1");
            findings.push(Finding::warning(at, message).fix("normalise them; rubor makes its own"));
        }
    }
    if let Some(accessor) = primitive.get(&Semantic::Tangents) {
        let tangents = floats::<4>(document, at, &accessor)?;
        let off = tangents.iter().filter(|t| t[3].abs() != 1.0).count();
        if off > 0 {
            let message = format!("{off} tangents have a fourth number that is neither 1 nor -1");
            findings.push(Finding::warning(at, message).fix("write the sign of the bitangent there"));
        }
    }
    if let Some(accessor) = primitive.get(&Semantic::Weights(0)) {
        let weights = floats::<4>(document, at, &accessor)?;
        let second = match primitive.get(&Semantic::Weights(1)) {
            Some(accessor) => floats::<4>(document, at, &accessor)?,
            None => vec![[0.0; 4]; weights.len()],
        };
        let sum = |w: &[f32; 4]| Vec4::from_array(*w).element_sum();
        let off =
            weights.iter().zip(&second).filter(|(a, b)| (sum(a) + sum(b) - 1.0).abs() > ROUNDING).count();
        if off > 0 {
            let message = format!("weights of joints do not sum to one at {off} vertices");
            findings.push(Finding::warning(at, message).fix("normalise the skin weights before export"));
        }
    }
    Ok(())
}

fn animations(document: &Document, findings: &mut Vec<Finding>, notes: &mut Notes) {
    let count = document.raw["animations"].as_array().map_or(0, Vec::len);
    for animation in 0..count {
        for named in of_animation(document, animation, notes) {
            let width = match named.target {
                Target::Weights => {
                    let mesh = document.gltf.nodes().nth(named.node).and_then(|n| n.mesh());
                    mesh.map_or(0, |m| of_mesh(document, &m).0.len())
                }
                Target::Rotation => 4,
                Target::Translation | Target::Scale => 3,
            };
            let Some(channel) = Channel::read(document, &named, width, notes) else { continue };
            if named.target == Target::Weights {
                let outside = channel.values().filter(|v| !(-0.001..=1.001).contains(v)).count();
                if outside > 0 {
                    let message = format!("{outside} weights leave 0 to 1: they are used as they stand");
                    findings.push(Finding::note(named.at, message));
                }
            }
        }
    }
}
