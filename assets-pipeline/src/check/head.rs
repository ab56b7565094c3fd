//! A head by itself.

use std::collections::BTreeMap;

use rubor_rig::atlas::{Atlas, AtlasError, Islands, MOST_OVERLAP, Skin, shared_texels};
use rubor_rig::head::{Head, Material};
use rubor_rig::names::{ARKIT, Key, Resolver, canonical, is_known_shape, nearest, vocabulary};

use super::{Finding, list};
use crate::convert::size::{self, Guess};

/// Heights of heads with and without a neck and shoulders, metres.
const HEIGHTS_METRES: std::ops::RangeInclusive<f32> = 0.1..=0.8;
/// A shape that moves no point further than this shows nothing, metres.
const LEAST_OFFSET_METRES: f32 = 1e-5;
/// A shape that moves a point by more than this part of the head's height is in another unit.
const MOST_OFFSET: f32 = 0.6;

/// Geometry, names and shapes.
pub fn check(head: &Head) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Err(e) = head.validate() {
        findings.push(Finding::error("", e.to_string()));
        return findings;
    }
    findings.extend(size(head));
    parts(head, &mut findings);
    triangles(head, &mut findings);
    shapes(head, &mut findings);
    names(head, &mut findings);
    if head.mesh.occlusion.is_empty() && head.mesh.parts.iter().any(|p| p.material == Material::Skin) {
        let message = "there is no ambient visibility: nostrils, lips and the mouth glow in the light of a sky, and no light goes from one place to another";
        findings.push(Finding::warning("occlusion", message).fix("`rubor import` traces it"));
    }
    if head.landmarks.is_empty() {
        let message = "there are no landmarks: synthesised maps have no hair, brows and wrinkles, the camera guesses the face from its size";
        findings.push(Finding::note("landmarks", message));
    }
    findings
}

/// A warning where no head is as high as this one.
pub fn size(head: &Head) -> Option<Finding> {
    let height = head.height();
    if height <= 0.0 || HEIGHTS_METRES.contains(&height) {
        return None;
    }
    let message = format!(
        "the head is {height:.3} m high, where {} to {} m are likely: scattering would be far too sharp or soft",
        HEIGHTS_METRES.start(),
        HEIGHTS_METRES.end()
    );
    let fix = match size::guess(head, &[]) {
        Some(Guess { unit: Some(unit), .. }) => {
            format!("it looks like {unit}: `rubor import` makes metres of them")
        }
        Some(guess) => {
            format!("`rubor import` makes it {:.2} m, or `--height METRES`", height * guess.factor)
        }
        None if size::is_figure(head, &[]) => {
            "it looks like a whole figure: `rubor import --crop-head` keeps its head".into()
        }
        None => "`rubor import --height METRES` scales it".into(),
    };
    Some(Finding::warning("mesh", message).fix(fix))
}

fn parts(head: &Head, findings: &mut Vec<Finding>) {
    if !head.mesh.parts.iter().any(|p| p.material == Material::Skin) {
        let message = "no part is skin: blood, wrinkles and scattering show nowhere";
        findings.push(
            Finding::warning("parts", message)
                .fix("name the material of the face with a word such as skin, face or head"),
        );
    }
    let other = head.mesh.parts.iter().enumerate().filter(|(_, p)| p.material == Material::Other);
    let other: Vec<&str> =
        other.filter(|(i, _)| head.authored_material(*i).is_none()).map(|(_, p)| p.name.as_str()).collect();
    if !other.is_empty() {
        let message = format!("the material of {} is not known: drawn diffuse grey", list(&other));
        findings.push(
            Finding::note("parts", message)
                .fix("name materials with words such as skin, eye, teeth, gums, lash, hair"),
        );
    }
}

fn triangles(head: &Head, findings: &mut Vec<Finding>) {
    let mesh = &head.mesh;
    let point = |v: u32| mesh.points[mesh.vertices[v as usize].point as usize];
    let flat = (mesh.triangles.iter())
        .filter(|t| {
            let [a, b, c] = t.map(point);
            (b - a).cross(c - a) == glam::Vec3::ZERO
        })
        .count();
    if flat > 0 {
        findings.push(Finding::note("mesh", format!("{flat} triangles have no area: they are never seen")));
    }
    let skin = mesh.parts.iter().filter(|p| p.material == Material::Skin);
    let corners = skin.flat_map(|p| {
        mesh.triangles[p.triangles.start as usize..p.triangles.end as usize].as_flattened().iter()
    });
    let uvs: Vec<glam::Vec2> = corners.map(|v| mesh.vertices[*v as usize].uv).collect();
    if !uvs.is_empty() && uvs.iter().all(|uv| *uv == uvs[0]) {
        let message =
            "the skin has no texture coordinates: every map shows one texel, texture-space cannot scatter";
        findings.push(Finding::warning("mesh", message).fix("unwrap the mesh before import"));
        return;
    }
    findings.extend(layout(head));
    if uvs.iter().any(|uv| uv.min_element() < -1e-4 || uv.max_element() > 1.0001) {
        let message =
            "texture coordinates of the skin leave 0 to 1: maps repeat there, low-resolution ones do not";
        findings.push(Finding::warning("mesh", message).fix("keep the skin in one tile"));
    }
}

/// Texels on a side on which layouts are looked at.
const LAYOUT_SIDE: u32 = 512;
/// Share of texels that more than one place of the skin may use: rounding at borders of islands.
const SHARED_TEXELS: f64 = 0.002;

/// What is wrong with the layout of the skin in the texture.
pub fn layout(head: &Head) -> Vec<Finding> {
    let mesh = &head.mesh;
    let skin = mesh.parts.iter().filter(|p| p.material == Material::Skin);
    let triangles: Vec<[u32; 3]> =
        (skin.flat_map(|p| p.triangles.clone())).map(|t| mesh.triangles[t as usize]).collect();
    let skin = Skin { points: &mesh.points, vertices: &mesh.vertices, triangles: &triangles };
    let islands = match Islands::new(&skin) {
        Ok(islands) => islands,
        Err(AtlasError::NoSkin) => return Vec::new(),
        Err(e) => {
            let message = format!("its layout in the texture cannot be used by texture-space: {e}");
            return vec![Finding::warning("mesh", message).fix("unwrap the skin before import")];
        }
    };
    let mut findings = Vec::new();
    let shared = shared_texels(&skin, LAYOUT_SIDE);
    if shared > SHARED_TEXELS {
        let mirrored = match islands.mirrored() {
            0 => String::new(),
            n => format!(" ({n} of {} islands are mirrored)", islands.count),
        };
        let message = format!(
            "{:.1} % of the texels of the skin belong to several places{mirrored}: blood, wrinkles and pigment show in all of them",
            100.0 * shared
        );
        findings
            .push(Finding::warning("mesh", message).fix("give every place of the skin texels of its own"));
    }
    // The reach of light in skin; the margin does not matter here.
    if let Ok(atlas) = Atlas::new(&skin, LAYOUT_SIDE, 8.0)
        && atlas.overlap > 0.0
    {
        let message = format!(
            "{:.1} % of the skin lies under other skin of the same island of the texture: texture-space refuses heads from {:.0} % on and shows wrong light below",
            100.0 * atlas.overlap,
            100.0 * MOST_OVERLAP
        );
        findings.push(Finding::warning("mesh", message).fix("unfold the island, or cut it"));
    }
    findings
}

fn shapes(head: &Head, findings: &mut Vec<Finding>) {
    if head.shapes.is_empty() {
        findings.push(
            Finding::warning("shapes", "there are none: the face cannot move")
                .fix("export morph targets (glTF) or blendShape targets (Maya) with the mesh"),
        );
    }
    let limit = MOST_OFFSET * head.height();
    for shape in &head.shapes {
        let at = format!("shape {:?}", shape.name);
        let longest = shape.offsets.iter().map(|o| o.length()).fold(0.0, f32::max);
        if shape.points.is_empty() {
            let message = "it moves no points: its weight has no effect";
            findings
                .push(Finding::warning(at, message).fix("delete the shape, or sculpt and export it again"));
        } else if longest < LEAST_OFFSET_METRES {
            let message = format!("it moves points by {:.4} mm at most, which nobody sees", longest * 1000.0);
            findings.push(Finding::warning(at, message).fix("check the unit of its offsets"));
        } else if limit > 0.0 && longest > limit {
            let message = format!(
                "it moves a point by {longest:.3} m, {:.0} % of the head's height",
                100.0 * longest / head.height()
            );
            findings.push(
                Finding::warning(at, message)
                    .fix("check the unit of its offsets, or that it is relative to the neutral mesh"),
            );
        }
    }
}

fn names(head: &Head, findings: &mut Vec<Finding>) {
    let mut seen: BTreeMap<Key, &str> = BTreeMap::new();
    for shape in &head.shapes {
        let at = || format!("shape {:?}", shape.name);
        let key = Key::new(canonical(&shape.name).unwrap_or(&shape.name));
        if let Some(earlier) = seen.insert(key, &shape.name) {
            let message = format!("{earlier:?} is the same name: only the first of them is driven by it");
            findings.push(Finding::warning(at(), message).fix("rename one of them"));
        }
        if !is_known_shape(&shape.name)
            && let Some(near) = nearest(&shape.name, vocabulary())
            && head.shape_index(&near).is_none()
        {
            let message = "no expression and no capture knows this name";
            findings.push(Finding::note(at(), message).fix(format!("if it is {near:?}, rename it")));
        }
    }
    let resolver = Resolver::shapes(head);
    let missing: Vec<&str> = ARKIT.into_iter().filter(|n| resolver.resolve(n).is_empty()).collect();
    if !head.shapes.is_empty() && !missing.is_empty() {
        let message = format!("{} of the 52 ARKit shapes are missing: {}", missing.len(), list(&missing));
        findings.push(Finding::note("shapes", message));
    }
}
