//! What untextured parts are where no name says it: eyes, teeth, tongue and lashes by their shape and place in a face that
//! was found, and by the colour that their author gave them.
//!
//! Only what is clear is taken: a ball of an eye's size behind the lids, an arch or a lump behind the lips, a thin sheet
//! before a lid. Textured parts keep the look of their author and need no name.

use glam::Vec3;
use rubor_rig::authored::AuthoredMaterial;
use rubor_rig::head::{Head, Material};
use rubor_rig::landmarks::paired;

use super::{Component, components, split_part};
use crate::import::eye_projection::fit_sphere;
use crate::import::materials::recognise as by_name;
use crate::landmarks::{Fit, TRUSTED};
use crate::notes::{Note, Notes};

/// Points of the skin of a face lie within this distance of its landmarks, mm: the edge of a coarse mesh.
const FACE_REACH_MM: f32 = 12.0;

/// Names parts, or pieces of parts, of a head whose face was found. Parts that a name tells, that have a texture, that
/// are seen through or that `is_given` says are left alone.
pub fn recognise(head: &mut Head, fit: &Fit, is_given: impl Fn(&str) -> bool) -> Vec<Note> {
    let mut notes = Notes::default();
    if fit.confidence < TRUSTED {
        return notes.into_vec();
    }
    let mut part = 0;
    while part < head.mesh.parts.len() {
        let of = &head.mesh.parts[part];
        let is_unknown = matches!(of.material, Material::Skin | Material::Other)
            && by_name(&of.name).is_none_or(|m| m == Material::Skin)
            && !is_given(&of.name)
            && !is_textured(head, part)
            && !is_clear(head, part);
        let pieces = if is_unknown { pieces(head, part, fit, &mut notes) } else { Vec::new() };
        let count = pieces.len();
        if count > 0 {
            split_part(head, part, pieces);
        }
        part += count.max(1);
    }
    notes.into_vec()
}

fn material(head: &Head, part: usize) -> Option<&AuthoredMaterial> {
    let material = head.authored.of_parts.get(part).copied().flatten()?;
    Some(&head.authored.materials[material as usize])
}

fn is_textured(head: &Head, part: usize) -> bool {
    material(head, part).is_some_and(|m| m.base_color_texture.is_some())
}

/// Corneas and other shells are seen through.
fn is_clear(head: &Head, part: usize) -> bool {
    material(head, part).is_some_and(AuthoredMaterial::is_clear)
}

/// Linear base colour that the author gave, if it is not white or a grey that programs give by themselves.
fn color(head: &Head, part: usize) -> Option<Vec3> {
    let [r, g, b, _] = material(head, part)?.base_color;
    Some(Vec3::new(r, g, b)).filter(|c| c.max_element() - c.min_element() > 0.02)
}

fn pieces(head: &Head, part: usize, fit: &Fit, notes: &mut Notes) -> Vec<(String, Material, Vec<u32>)> {
    let of = head.mesh.parts[part].clone();
    let found: Vec<(Material, Component)> = components(head, part)
        .into_iter()
        .map(|c| (kind(head, &c, fit, color(head, part)).unwrap_or(of.material), c))
        .collect();
    if found.iter().all(|(kind, _)| *kind == of.material) {
        return Vec::new();
    }
    let mut pieces = Vec::new();
    let mut kinds: Vec<Material> = Vec::new();
    for (kind, _) in &found {
        if !kinds.contains(kind) {
            kinds.push(*kind);
        }
    }
    let is_whole = kinds.len() == 1;
    for kind in kinds {
        let triangles: Vec<u32> =
            found.iter().filter(|f| f.0 == kind).flat_map(|f| f.1.triangles.iter().copied()).collect();
        let word = match kind {
            Material::Eye => "eyes",
            Material::Teeth => "teeth",
            Material::Gums => "tongue",
            Material::Lash => "lashes",
            Material::Skin => "skin",
            _ => "",
        };
        let name = if is_whole || word.is_empty() { of.name.clone() } else { format!("{} {word}", of.name) };
        if kind != of.material {
            let message = format!(
                "told by shape and place to be {word} (`rubor import --parts NAME=MATERIAL` says otherwise)"
            );
            notes.add(&message, name.as_str());
        }
        pieces.push((name, kind, triangles));
    }
    pieces
}

fn kind(head: &Head, component: &Component, fit: &Fit, color: Option<Vec3>) -> Option<Material> {
    let mm = fit.unit_mm;
    let at = |name: &str| fit.landmarks.get(name).copied();
    let frame = fit.frame();
    // Places in the frame of the face, mm.
    let local = |p: Vec3| frame * p * mm;
    // The face itself: most of what is on its skin is near.
    let skin = [
        "pronasale",
        "menton",
        "glabella",
        "subnasale",
        "cheek-left",
        "cheek-right",
        "cheilion-left",
        "cheilion-right",
    ];
    let touches = |name: &&&str| {
        let place = at(name).map(local);
        place.is_some_and(|place| component.places(head).any(|p| local(p).distance(place) < FACE_REACH_MM))
    };
    if 2 * skin.iter().filter(touches).count() > skin.len() {
        return Some(Material::Skin);
    }
    let (low, high) = component
        .places(head)
        .map(local)
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
    let (extent, center) = (high - low, 0.5 * (low + high));
    for left in [true, false] {
        let eye = local(at(&paired("eye", left))?);
        let lid = local(at(&paired("lid-lower", left))?.midpoint(at(&paired("lid-upper", left))?));
        let points: Vec<Vec3> = component.places(head).map(local).collect();
        if points.len() >= 12 && (center - eye).truncate().length() < 12.0 {
            let (ball, radius) = fit_sphere(&points);
            let off =
                points.iter().map(|p| (p.distance(ball) - radius).powi(2)).sum::<f32>() / points.len() as f32;
            let round = off.sqrt() < 0.09 * radius && extent.min_element() > 1.1 * radius;
            if (8.0..20.0).contains(&radius) && round && ball.z < lid.z && lid.z - ball.z < 26.0 {
                return Some(Material::Eye);
            }
        }
        let is_sheet = extent.y < 16.0 && extent.x > 15.0 && extent.x < 55.0 && extent.z < 25.0;
        if is_sheet
            && (center - lid).truncate().length() < 12.0
            && high.z > lid.z + 1.0
            && is_open(head, component)
        {
            return Some(Material::Lash);
        }
    }
    let (left, right) = (local(at("cheilion-left")?), local(at("cheilion-right")?));
    let lips = local(at("stomion")?);
    let is_between = low.x > right.x - 12.0 && high.x < left.x + 12.0;
    let is_behind = high.z < lips.z - 1.0 && low.z > lips.z - 95.0 && (center.y - lips.y).abs() < 28.0;
    if !is_between || !is_behind {
        return None;
    }
    // An arch is empty in its middle; a tongue is not.
    let back = 0.35 * extent.x;
    let in_middle = component
        .places(head)
        .map(local)
        .filter(|p| (p.x - center.x).abs() < 0.2 * extent.x && p.z < high.z - back)
        .count();
    let is_arch = extent.x > 30.0 && extent.z > 12.0 && in_middle * 50 < component.points.len();
    let is_tooth = extent.max_element() < 28.0 && extent.x < 13.0;
    let is_red = color.map(|c| c.x > 1.6 * c.y.max(c.z));
    match is_red {
        Some(true) => Some(Material::Gums),
        _ if (is_arch && extent.y < 30.0) || is_tooth => Some(Material::Teeth),
        None if in_middle * 4 > component.points.len() && extent.x < 60.0 && extent.z > 25.0 => {
            Some(Material::Gums)
        }
        _ => None,
    }
}

/// Whether a mesh is a sheet with a border, not closed.
fn is_open(head: &Head, component: &Component) -> bool {
    let mut edges = std::collections::HashMap::new();
    for t in &component.triangles {
        let p = head.mesh.triangles[*t as usize].map(|v| head.mesh.vertices[v as usize].point);
        for k in 0..3 {
            let (a, b) = (p[k], p[(k + 1) % 3]);
            *edges.entry((a.min(b), a.max(b))).or_insert(0u32) += 1;
        }
    }
    edges.values().filter(|c| **c == 1).count() * 12 > edges.len()
}
