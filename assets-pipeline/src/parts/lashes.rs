//! Lash cards of any layout: u along the lid, v from root to tip; then single hairs in their place.
//!
//! A card is an island of the texture. Along its own texture coordinates it is long in one direction, the lid's, and
//! its root is the side nearer to the eye. Cards that lie on each other are layers of one fringe: one of them is kept.

use std::collections::{HashMap, HashSet};

use glam::{Vec2, Vec3};
use rubor_rig::head::{Head, Material};

use super::{Component, islands, set_coordinates, split_part};
use crate::notes::Notes;
use crate::synthesize;

/// Meshes of a part above which each is a hair, not a card.
const MOST_CARDS: usize = 40;
/// Share of the length of long cards that the sweep of short ones is added to.
const LONG_CARD: f32 = 0.006;

pub(super) fn assign(head: &mut Head, notes: &mut Notes) {
    let mut part = 0;
    while part < head.mesh.parts.len() {
        let pieces =
            if head.mesh.parts[part].material == Material::Lash { cards(head, part) } else { Vec::new() };
        let count = pieces.len();
        if count > 0 {
            let name = head.mesh.parts[part].name.clone();
            if pieces.iter().any(|p| p.1 == Material::Hidden) {
                notes.add("lash cards that lie on each other are drawn once", name.as_str());
            }
            notes.add("lash cards become single hairs", name);
            split_part(head, part, pieces);
        }
        part += count.max(1);
    }
    synthesize::grow_lashes_along(head);
}

/// New parts for the cards of a part.
fn cards(head: &mut Head, part: usize) -> Vec<(String, Material, Vec<u32>)> {
    let name = head.mesh.parts[part].name.clone();
    let found = islands(head, part);
    if found.len() > MOST_CARDS {
        return Vec::new();
    }
    let uv_grid: Option<Vec<HashMap<u32, Vec2>>> = found.iter().map(|c| card_coordinates(head, c)).collect();
    let Some(uvs) = uv_grid else { return Vec::new() };
    // Above or below the middle between the highest and the lowest card of the side.
    let centers: Vec<Vec3> = found.iter().map(|c| c.center(head)).collect();
    let mut pieces: Vec<(String, Material, Vec<u32>)> = Vec::new();
    let mut kept: Vec<usize> = Vec::new();
    for (i, card) in found.iter().enumerate() {
        let left = centers[i].x > 0.0;
        let side = centers.iter().filter(|c| (c.x > 0.0) == left).map(|c| c.y);
        let (low, high) = side.fold((f32::MAX, f32::MIN), |(a, b), y| (a.min(y), b.max(y)));
        let (from, to) = card.bounds(head);
        let upper = high - low < 0.15 * (to.x - from.x) || centers[i].y > 0.5 * (low + high);
        let is_layer = kept.iter().any(|k| overlap(head, card, &found[*k]) > 0.6);
        let ends =
            format!("{} {}", if left { "left" } else { "right" }, if upper { "upper" } else { "lower" });
        if is_layer {
            pieces.push((format!("{name} layer {ends} {i}"), Material::Hidden, card.triangles.clone()));
        } else {
            kept.push(i);
            pieces.push((format!("{name} {ends}"), Material::Lash, card.triangles.clone()));
        }
    }
    for (card, uv_of) in found.iter().zip(&uvs) {
        set_coordinates(head, &card.triangles, uv_of);
    }
    pieces
}

/// Share of the smaller box that two boxes have in common.
fn overlap(head: &Head, a: &Component, b: &Component) -> f32 {
    let ((a0, a1), (b0, b1)) = (a.bounds(head), b.bounds(head));
    let volume = |low: Vec3, high: Vec3| (high - low).max(Vec3::ZERO).element_product();
    let thick = Vec3::splat(1e-9);
    volume(a0.max(b0), a1.min(b1) + thick) / volume(a0, a1 + thick).min(volume(b0, b1 + thick)).max(1e-30)
}

/// Coordinates of a card by point; `None` where its own ones tell no grid.
fn card_coordinates(head: &Head, card: &Component) -> Option<HashMap<u32, Vec2>> {
    let mesh = &head.mesh;
    let mut uv_of: HashMap<u32, Vec2> = HashMap::new();
    for t in &card.triangles {
        for v in mesh.triangles[*t as usize] {
            let vertex = mesh.vertices[v as usize];
            uv_of.entry(vertex.point).or_insert(vertex.uv);
        }
    }
    let (low, high) =
        uv_of.values().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(a, b), uv| (a.min(*uv), b.max(*uv)));
    let extent = high - low;
    if extent.min_element() <= 1e-6 {
        return None;
    }
    // Lengths in space along both directions of the texture.
    let mut along = [0.0f32; 2];
    let mut seen: HashSet<(u32, u32)> = HashSet::new();
    let mut counts = [0.0f32; 2];
    for t in &card.triangles {
        let points = mesh.triangles[*t as usize].map(|v| mesh.vertices[v as usize].point);
        for k in 0..3 {
            let (a, b) = (points[k], points[(k + 1) % 3]);
            if !seen.insert((a.min(b), a.max(b))) {
                continue;
            }
            let d = (uv_of[&b] - uv_of[&a]) / extent;
            let length = mesh.points[a as usize].distance(mesh.points[b as usize]);
            let axis = usize::from(d.y.abs() > d.x.abs());
            let share = d[axis].abs();
            if share > 3.0 * d[1 - axis].abs() {
                along[axis] += length;
                counts[axis] += share;
            }
        }
    }
    let length = |axis: usize| along[axis] / counts[axis].max(1e-6);
    let lid = usize::from(length(1) > length(0));
    let across = 1 - lid;
    // The root lies closer to the axis of the eye's ball: behind and towards the middle of the card.
    let value = |uv: Vec2, axis: usize| (uv[axis] - low[axis]) / extent[axis];
    let mean = |of: &dyn Fn(f32) -> bool| {
        let places: Vec<Vec3> = uv_of
            .iter()
            .filter(|(_, uv)| of(value(**uv, across)))
            .map(|(p, _)| mesh.points[*p as usize])
            .collect();
        places.iter().sum::<Vec3>() / places.len().max(1) as f32
    };
    let (start, end) = (mean(&|v| v < 0.02), mean(&|v| v > 0.98));
    // Lashes stand forward of their roots.
    let flip = start.z > end.z;
    Some(
        uv_of
            .into_iter()
            .map(|(p, uv)| {
                let v = value(uv, across);
                (p, Vec2::new(value(uv, lid), if flip { 1.0 - v } else { v }))
            })
            .collect(),
    )
}

/// Whether a card is long enough to sweep by itself.
pub(crate) fn is_long(length: f32) -> bool {
    length > LONG_CARD
}
