//! Hairs as geometry: brows that lie on the skin, lashes in place of cards.
//!
//! ```text
//! curve on a chart (plan of the face, or u v of a lash card) --anchor--> triangles under each knot
//!   --> tapered ribbon whose blend shapes are those of the surface under it
//! ```
//!
//! A ribbon is a fraction of a pixel wide; its texture coordinate identifies it for a renderer: u = 2 id + side (id
//! from 1, side 0 to 1 across), v from root (0) to tip (1). Cards have u within 0 to 1.

use std::collections::HashMap;

use glam::{Vec2, Vec3};
use rubor_rig::deform::point_normals;
use rubor_rig::head::{BlendShape, Head, MM_PER_METRE, Material, Part, Vertex};

use super::Options;
use super::brows::brow_strokes;
use super::face_space::{FaceSpace, plan};
use super::noise::Stream;
use crate::parts::is_long;

/// Width of a ribbon at its root, mm. Terminal hair is 0.06 to 0.1 mm thick; brows and lashes look fuller than single
/// hairs, and these are fewer.
const WIDTH_MM: f32 = 0.13;
/// Name of the part that holds the brows.
pub(super) const BROWS: &str = "brows";
/// Strands of an upper and of a lower lash card.
const LASHES: [(&str, usize); 2] = [("upper", 92), ("lower", 44)];

/// A place on a triangle of the head.
#[derive(Clone, Copy)]
struct Anchor {
    points: [u32; 3],
    weights: Vec3,
}

impl Anchor {
    fn of(&self, values: &[Vec3]) -> Vec3 {
        (0..3).map(|k| self.weights[k] * values[self.points[k] as usize]).sum()
    }
}

/// Triangles laid flat.
#[derive(Default)]
struct Chart {
    triangles: Vec<([u32; 3], [Vec2; 3])>,
}

impl Chart {
    /// Length from root to tip in the middle of a card.
    fn length(&self, points: &[Vec3]) -> f32 {
        let at = |v: f32| Some(self.at(Vec2::new(0.5, v))?.of(points));
        let knots: Option<Vec<Vec3>> = (0..=8).map(|i| at(0.01 + 0.98 * i as f32 / 8.0)).collect();
        knots.map_or(0.0, |k| k.windows(2).map(|w| w[0].distance(w[1])).sum())
    }

    fn at(&self, p: Vec2) -> Option<Anchor> {
        self.triangles.iter().find_map(|(points, [a, b, c])| {
            let area = (*b - *a).perp_dot(*c - *a);
            let weights = Vec3::new(
                (*b - p).perp_dot(*c - p) / area,
                (*c - p).perp_dot(*a - p) / area,
                (*a - p).perp_dot(*b - p) / area,
            );
            (area.abs() > 1e-12 && weights.min_element() >= -1e-4)
                .then_some(Anchor { points: *points, weights })
        })
    }
}

/// A hair before it is given width.
struct Strand {
    /// From root to tip, with the displacement from the surface in metres.
    knots: Vec<(Anchor, Vec3)>,
}

/// Brows that were grown are drawn no more: the colour of the skin holds its own.
pub(crate) fn hide_brows(head: &mut Head) {
    let grown = head.mesh.parts.iter_mut().filter(|p| p.name == BROWS && p.material == Material::Hair);
    grown.for_each(|p| p.material = Material::Hidden);
}

/// Puts brows of hair on the skin in place of earlier ones. A head without landmarks gets none: their place would be a
/// guess.
pub(super) fn grow_brows(head: &mut Head, options: &Options) {
    remove_parts(head, |_, p| p.name == BROWS);
    if options.brows <= 0.0 || !head.landmarks.contains_key("brow-middle-left") {
        return;
    }
    let space = FaceSpace::fit(head);
    let mut chart = Chart::default();
    for part in head.mesh.parts.iter().filter(|p| p.material == Material::Skin) {
        for t in &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
            let points = t.map(|v| head.mesh.vertices[v as usize].point);
            let places = points.map(|p| space.warp(head.mesh.points[p as usize]));
            if places.iter().all(|c| c.z > 20.0 && (5.0..48.0).contains(&c.y)) {
                chart.triangles.push((points, places.map(plan)));
            }
        }
    }
    let normals = point_normals(&head.mesh, &head.mesh.points);
    let mut stream = Stream::new(options.seed_bits() ^ 0xb203);
    let strands = brow_strokes(options, 400.0)
        .into_iter()
        .filter_map(|knots| {
            let lift = stream.range(0.25, 1.0) / MM_PER_METRE;
            let anchored = knots.iter().enumerate().map(|(i, k)| {
                let t = i as f32 / (knots.len() - 1) as f32;
                let anchor = chart.at(*k)?;
                Some((anchor, (0.00006 + lift * (1.4 * t - 0.6 * t * t)) * anchor.of(&normals)))
            });
            Some(Strand { knots: anchored.collect::<Option<_>>()? })
        })
        .collect::<Vec<_>>();
    add_part(head, BROWS, Material::Hair, &strands);
}

/// Replaces lash cards (parts of material lash with u within 0 to 1) by single hairs in small tufts, the lower ones
/// short and sparse.
pub fn grow_lashes(head: &mut Head) {
    grow_swept_lashes(head, |_, _| 1.0);
}

/// As [`grow_lashes`], of cards of other programs: long ones have their sweep already.
pub(crate) fn grow_lashes_along(head: &mut Head) {
    grow_swept_lashes(head, |head, chart| if is_long(chart.length(&head.mesh.points)) { 0.15 } else { 1.0 });
}

fn grow_swept_lashes(head: &mut Head, sweep: impl Fn(&Head, &Chart) -> f32) {
    let mut grown = Vec::new();
    for (index, part) in head.mesh.parts.iter().enumerate() {
        let mut chart = Chart::default();
        for t in &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
            let corners = t.map(|v| head.mesh.vertices[v as usize]);
            chart.triangles.push((corners.map(|c| c.point), corners.map(|c| c.uv)));
        }
        let mut uvs = chart.triangles.iter().flat_map(|(_, uv)| uv);
        let lash = LASHES.iter().find(|l| part.name.ends_with(l.0));
        if let (Material::Lash, Some((name, count)), true) = (part.material, lash, uvs.all(|c| c.x <= 1.0)) {
            let sweep = sweep(head, &chart);
            let strands = lash_strands(&chart, *count, *name == "upper", sweep);
            // A card on which nothing grows stays a card.
            if !strands.is_empty() {
                grown.push((index, part.name.clone(), strands));
            }
        }
    }
    for (_, name, strands) in &grown {
        add_part(head, name, Material::Lash, strands);
    }
    remove_parts(head, |index, _| grown.iter().any(|g| g.0 == index));
}

fn lash_strands(chart: &Chart, count: usize, upper: bool, sweep: f32) -> Vec<Strand> {
    let mut stream = Stream::new(0x1a54 + u32::from(upper));
    let mut strands = Vec::new();
    for i in 0..count {
        let u = (i as f32 + stream.range(0.1, 0.9)) / count as f32;
        // Tufts of three or four lean together at their tips.
        let tuft = ((u * count as f32 / 3.5).floor() + 0.5) * 3.5 / count as f32;
        let length = if upper { stream.range(0.6, 1.0) } else { stream.range(0.4, 0.72) };
        let lean = 0.55 * (tuft - u) + 0.012 * stream.normal();
        // Shorter towards the inner corner, whichever end that is, and none at the very ends.
        let ends = (4.0 * u * (1.0 - u)).powf(0.35);
        // Cards stand straight out and are short; real lashes sweep up, or down, by a few millimetres.
        let curl =
            sweep * if upper { Vec3::new(0.0, 0.0042, 0.0012) } else { Vec3::new(0.0, -0.0010, 0.0006) };
        let knots = [0.0f32, 0.3, 0.62, 1.0].map(|t| {
            let at =
                Vec2::new((u + lean * t * t).clamp(0.002, 0.998), (length * ends * t).clamp(0.002, 0.998));
            chart.at(at).map(|a| (a, length * ends * (0.25 * t + 0.75 * t * t) * curl))
        });
        strands.extend(knots.into_iter().collect::<Option<_>>().map(|knots| Strand { knots }));
    }
    strands
}

/// Adds ribbons with the blend shapes of what they are anchored to.
fn add_part(head: &mut Head, name: &str, material: Material, strands: &[Strand]) {
    let normals = point_normals(&head.mesh, &head.mesh.points);
    let first_triangle = head.mesh.triangles.len() as u32;
    // Where each new point hangs.
    let mut anchors: Vec<Anchor> = Vec::new();
    let first_point = head.mesh.points.len() as u32;
    for (id, strand) in strands.iter().enumerate() {
        let places: Vec<Vec3> = strand.knots.iter().map(|(a, off)| a.of(&head.mesh.points) + *off).collect();
        let last = places.len() - 1;
        let first_vertex = head.mesh.vertices.len() as u32;
        for (i, (anchor, _)) in strand.knots.iter().enumerate() {
            let along = places[(i + 1).min(last)] - places[i.saturating_sub(1)];
            let across = along.cross(anchor.of(&normals)).normalize_or(Vec3::X);
            let t = i as f32 / last as f32;
            let half_width = 0.5 * WIDTH_MM / MM_PER_METRE * (1.0 - t * t);
            let sides: &[f32] = if i == last { &[0.5] } else { &[0.0, 1.0] };
            for side in sides {
                let point = first_point + anchors.len() as u32;
                anchors.push(*anchor);
                head.mesh.points.push(places[i] + (2.0 * side - 1.0) * half_width * across);
                if !head.mesh.occlusion.is_empty() {
                    head.mesh.occlusion.push(1.0);
                }
                let uv = Vec2::new(2.0 * (id + 1) as f32 + side, t);
                head.mesh.vertices.push(Vertex { point, uv });
            }
        }
        for i in 0..last as u32 {
            let a = first_vertex + 2 * i;
            head.mesh.triangles.push([a, a + 1, a + 2]);
            if i + 1 < last as u32 {
                head.mesh.triangles.push([a + 1, a + 3, a + 2]);
            }
        }
    }
    for shape in &mut head.shapes {
        let moved: HashMap<u32, Vec3> =
            shape.points.iter().copied().zip(shape.offsets.iter().copied()).collect();
        for (i, anchor) in anchors.iter().enumerate() {
            let offset: Vec3 = (0..3)
                .map(|k| anchor.weights[k] * moved.get(&anchor.points[k]).copied().unwrap_or_default())
                .sum();
            // 0.03 mm, a third of a hair.
            if offset.length() > 3e-5 {
                shape.points.push(first_point + i as u32);
                shape.offsets.push(offset);
            }
        }
    }
    let end = head.mesh.triangles.len() as u32;
    if end > first_triangle {
        head.mesh.parts.push(Part { name: name.into(), material, triangles: first_triangle..end });
    }
}

/// Removes parts with the points and vertices that only they use.
fn remove_parts(head: &mut Head, gone: impl Fn(usize, &Part) -> bool) {
    if !head.mesh.parts.iter().enumerate().any(|(i, p)| gone(i, p)) {
        return;
    }
    let mesh = std::mem::take(&mut head.mesh);
    let mut new_vertex = vec![u32::MAX; mesh.vertices.len()];
    let mut used = vec![false; mesh.points.len()];
    let kept: Vec<&Part> =
        mesh.parts.iter().enumerate().filter(|(i, p)| !gone(*i, p)).map(|(_, p)| p).collect();
    for part in &kept {
        for v in mesh.triangles[part.triangles.start as usize..part.triangles.end as usize].iter().flatten() {
            new_vertex[*v as usize] = 0;
            used[mesh.vertices[*v as usize].point as usize] = true;
        }
    }
    let mut new_point = vec![u32::MAX; mesh.points.len()];
    let out = &mut head.mesh;
    for (i, _) in used.iter().enumerate().filter(|(_, used)| **used) {
        new_point[i] = out.points.len() as u32;
        out.points.push(mesh.points[i]);
        out.occlusion.extend(mesh.occlusion.get(i));
    }
    for (i, vertex) in mesh.vertices.iter().enumerate() {
        if new_vertex[i] == 0 {
            new_vertex[i] = out.vertices.len() as u32;
            out.vertices.push(Vertex { point: new_point[vertex.point as usize], uv: vertex.uv });
        }
    }
    for part in kept {
        let start = out.triangles.len() as u32;
        let triangles = &mesh.triangles[part.triangles.start as usize..part.triangles.end as usize];
        out.triangles.extend(triangles.iter().map(|t| t.map(|v| new_vertex[v as usize])));
        out.parts.push(Part { triangles: start..out.triangles.len() as u32, ..part.clone() });
    }
    for BlendShape { points, offsets, occlusion, .. } in &mut head.shapes {
        occlusion.retain(|c| used[c.point as usize]);
        occlusion.iter_mut().for_each(|c| c.point = new_point[c.point as usize]);
        let kept = points.iter().zip(offsets.iter()).filter(|(p, _)| used[**p as usize]);
        (*points, *offsets) = kept.map(|(p, o)| (new_point[*p as usize], *o)).unzip();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rubor_rig::head::{Mesh, OcclusionChange};

    /// A square of two triangles in the plane z = 0 with texture coordinates as places, and a shape that lifts its top.
    fn square(material: Material) -> Head {
        let corners = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
        let mesh = Mesh {
            points: corners.iter().map(|c| c.extend(0.0)).collect(),
            occlusion: vec![1.0; 4],
            vertices: corners.iter().enumerate().map(|(i, c)| Vertex { point: i as u32, uv: *c }).collect(),
            triangles: vec![[0, 1, 3], [0, 3, 2]],
            parts: vec![Part { name: "lashes-left-upper".into(), material, triangles: 0..2 }],
        };
        let change = |point| OcclusionChange { point, at_half: 0.25, at_full: 0.5 };
        let lift = BlendShape {
            name: "jawOpen".into(),
            points: vec![2, 3],
            offsets: vec![Vec3::Z; 2],
            occlusion: vec![change(0), change(2), change(3)],
        };
        Head { mesh, shapes: vec![lift], ..Head::default() }
    }

    #[test]
    fn lashes_replace_cards_and_move_with_them() {
        let mut head = square(Material::Lash);
        grow_lashes(&mut head);
        head.validate().unwrap();
        assert_eq!(head.mesh.parts.len(), 1);
        assert!(head.mesh.triangles.len() > 300);
        assert!(head.mesh.vertices.iter().all(|v| v.uv.x >= 2.0 && (0.0..=1.0).contains(&v.uv.y)));
        // The card lies in z = 0 and the shape lifts by the height: so do all hairs.
        let shape = &head.shapes[0];
        for (p, offset) in shape.points.iter().zip(&shape.offsets) {
            let y = head.mesh.points[*p as usize].y;
            // Within the curl.
            assert!((offset.z - y).abs() < 5e-3, "{offset} at height {y}");
        }
        let grown = head.clone();
        grow_lashes(&mut head);
        assert_eq!(head.mesh, grown.mesh, "hairs are not cards");
    }

    #[test]
    fn other_parts_survive_removal() {
        let mut head = square(Material::Other);
        let before = head.clone();
        grow_lashes(&mut head);
        assert_eq!(head.mesh, before.mesh);
        head.mesh.parts.push(Part { name: "x".into(), material: Material::Other, triangles: 1..2 });
        head.mesh.parts[0].triangles = 0..1;
        remove_parts(&mut head, |_, p| p.name == "x");
        head.validate().unwrap();
        assert_eq!((head.mesh.points.len(), head.mesh.triangles.len()), (3, 1));
        assert_eq!(head.shapes[0].points, [2]);
        assert_eq!(head.shapes[0].occlusion.iter().map(|c| c.point).collect::<Vec<_>>(), [0, 2]);
    }
}
