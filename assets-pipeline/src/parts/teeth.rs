//! Coordinates of teeth: u = millimetres / 100 along the arch to the left, v = 0.5 + millimetres / 100 over the biting edge of the
//! upper row, 0.5 - millimetres / 100 below that of the lower one (as the shader of teeth takes them).
//!
//! Where every tooth is a mesh of its own, each is laid into the middle of the place that a tooth of its number has, with its
//! whole length in the crown: seams and gums are then those of the geometry, not painted ones.

use std::collections::{HashMap, HashSet};

use glam::{Vec2, Vec3};
use rubor_rig::head::Head;

use super::{Component, components, set_coordinates};

/// Texture units in a metre.
const SCALE: f32 = 10.0;
/// From the middle line to the far side of each tooth, mm, as the shader has them (R. C. Wheeler's dental anatomy).
const UPPER: [f32; 8] = [0.0, 8.5, 15.0, 22.6, 29.7, 36.5, 46.5, 56.0];
const LOWER: [f32; 8] = [0.0, 5.2, 10.9, 17.7, 24.7, 31.8, 42.8, 53.5];
/// Height that modelled teeth keep below: the shader paints gums from 9 mm of a short crown on.
const CROWN_MM: f32 = 6.4;
/// Half the width of an arch that is plausible, metres; others are scaled.
const HALF_WIDTH: (f32, f32) = (0.018, 0.042);
/// Meshes in a row from which each is taken for a tooth.
const SINGLE_TEETH: usize = 6;

pub(super) fn assign(head: &mut Head, part: usize) {
    let components = components(head, part);
    let lower = lower_points(head, &components);
    let Some(arch) = Arch::of(components.iter().flat_map(|c| c.places(head))) else { return };
    for is_lower in [false, true] {
        let of_row = |c: &Component| {
            let count = c.points.iter().filter(|p| lower.contains(p)).count();
            (2 * count > c.points.len()) == is_lower
        };
        let row: Vec<&Component> = components.iter().filter(|c| of_row(c)).collect();
        let single = row.len() >= SINGLE_TEETH;
        // A mesh that holds both rows is shared out by its points.
        let mixed: Vec<Component> =
            if single { Vec::new() } else { halves(head, &components, &lower, is_lower) };
        let sign = if is_lower { -1.0 } else { 1.0 };
        if single {
            single_teeth(head, &row, &arch, sign);
        } else if !mixed.is_empty() {
            band(head, &mixed, &arch, sign);
        }
    }
}

/// Points that belong to the lower jaw: those that move as it opens, else the lower of two rows by height.
fn lower_points(head: &Head, components: &[Component]) -> HashSet<u32> {
    let all: HashSet<u32> = components.iter().flat_map(|c| c.points.iter().copied()).collect();
    if let Some(jaw) = head.shapes.iter().find(|s| s.name.eq_ignore_ascii_case("jawOpen")) {
        let moved = jaw.points.iter().zip(&jaw.offsets).filter(|(p, _)| all.contains(p));
        let largest = moved.clone().map(|(_, o)| o.length()).fold(0.0, f32::max);
        let still = all.len() - moved.clone().filter(|(_, o)| o.length() > 0.5 * largest).count();
        if largest > 0.0 && still > 0 {
            return moved.filter(|(_, o)| o.length() > 0.5 * largest).map(|(p, _)| *p).collect();
        }
    }
    // Two means of height; the rows are of one size, so the border lies halfway.
    let heights: Vec<f32> = components.iter().map(|c| c.center(head).y).collect();
    let (low, high) = heights.iter().fold((f32::MAX, f32::MIN), |(a, b), y| (a.min(*y), b.max(*y)));
    let border = 0.5 * (low + high);
    let extent = components.iter().map(|c| c.bounds(head)).map(|(a, b)| b.y - a.y).fold(0.0, f32::max);
    if high - low > 0.3 * extent && components.len() > 1 {
        let below = components.iter().zip(&heights).filter(|(_, y)| **y < border);
        return below.flat_map(|(c, _)| c.points.iter().copied()).collect();
    }
    HashSet::new()
}

/// The triangles of a row.
fn halves(head: &Head, components: &[Component], lower: &HashSet<u32>, is_lower: bool) -> Vec<Component> {
    let mut row = Vec::new();
    for c in components {
        let in_row = |t: &u32| {
            let corners = head.mesh.triangles[*t as usize];
            let count =
                corners.iter().filter(|v| lower.contains(&head.mesh.vertices[**v as usize].point)).count();
            (count >= 2) == is_lower
        };
        let triangles: Vec<u32> = c.triangles.iter().copied().filter(in_row).collect();
        let mut points: Vec<u32> = (triangles.iter())
            .flat_map(|t| head.mesh.triangles[*t as usize].map(|v| head.mesh.vertices[v as usize].point))
            .collect();
        points.sort_unstable();
        points.dedup();
        if !triangles.is_empty() {
            row.push(Component { triangles, points });
        }
    }
    row
}

fn single_teeth(head: &mut Head, row: &[&Component], arch: &Arch, sign: f32) {
    let widths = if sign > 0.0 { UPPER } else { LOWER };
    let mut teeth: Vec<(f32, &Component)> = row.iter().map(|c| (arch.length(c.center(head)), *c)).collect();
    teeth.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
    let mut counted = [0usize; 2];
    let mut placed = Vec::new();
    for (s, tooth) in teeth {
        let side = usize::from(s < 0.0);
        // A third molar is drawn as a second one.
        let number = counted[side].min(widths.len() - 2);
        counted[side] += 1;
        let lengths: Vec<f32> = tooth.places(head).map(|p| arch.length(p)).collect();
        let (low, high) = lengths.iter().fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
        let (near, far) = (widths[number], widths[number + 1]);
        // The outer fifths are left to painted seams.
        let (near, far) = (near + 0.2 * (far - near), far - 0.2 * (far - near));
        let heights: Vec<f32> = tooth.places(head).map(|p| sign * p.y).collect();
        let (edge, top) = heights.iter().fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
        let mut uv_of = HashMap::new();
        for (k, point) in tooth.points.iter().enumerate() {
            let t = (lengths[k] - low) / (high - low).max(1e-9);
            // Away from the middle on either side.
            let along_mm = if s < 0.0 { -(far + (near - far) * t) } else { near + (far - near) * t };
            let height_mm = CROWN_MM * (heights[k] - edge) / (top - edge).max(1e-9);
            uv_of.insert(*point, Vec2::new(0.01 * along_mm, 0.5 + sign * 0.01 * height_mm));
        }
        placed.push((tooth.triangles.clone(), uv_of));
    }
    for (triangles, uv_of) in placed {
        set_coordinates(head, &triangles, &uv_of);
    }
}

fn band(head: &mut Head, row: &[Component], arch: &Arch, sign: f32) {
    let points: Vec<u32> = row.iter().flat_map(|c| c.points.iter().copied()).collect();
    let places: Vec<Vec3> = points.iter().map(|p| head.mesh.points[*p as usize]).collect();
    let along: Vec<f32> = places.iter().map(|p| arch.length(*p)).collect();
    let mut uv_of = HashMap::new();
    for (k, point) in points.iter().enumerate() {
        // The biting edge rises towards the back: take the lowest point nearby.
        let edge = (places.iter().zip(&along))
            .filter(|(_, s)| (**s - along[k]).abs() < 0.007)
            .map(|(p, _)| sign * p.y * arch.scale)
            .fold(f32::INFINITY, f32::min);
        let height = sign * places[k].y * arch.scale - edge;
        uv_of.insert(*point, Vec2::new(SCALE * along[k], 0.5 + sign * SCALE * height));
    }
    let triangles: Vec<u32> = row.iter().flat_map(|c| c.triangles.iter().copied()).collect();
    set_coordinates(head, &triangles, &uv_of);
}

/// Half an ellipse seen from above that both rows stand on.
struct Arch {
    middle: f32,
    back: f32,
    half_width: f32,
    depth: f32,
    /// Metres of an adult from units of the head.
    scale: f32,
}

impl Arch {
    fn of(places: impl Iterator<Item = Vec3>) -> Option<Self> {
        let (low, high) = places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
        let half_width = 0.5 * (high.x - low.x);
        if half_width.is_nan() || half_width <= 0.0 || high.z <= low.z {
            return None;
        }
        let plausible = half_width.clamp(HALF_WIDTH.0, HALF_WIDTH.1);
        let scale = if plausible == half_width { 1.0 } else { 0.029 / half_width };
        let (middle, back, depth) = (0.5 * (low.x + high.x), low.z, high.z - low.z);
        Some(Self { middle, back, half_width, depth, scale })
    }

    /// Arc length from the middle to the place on the arch in the direction of a point, metres, positive on the left.
    fn length(&self, p: Vec3) -> f32 {
        let end = ((p.x - self.middle) / self.half_width).atan2((p.z - self.back) / self.depth);
        let steps = 24;
        let step = end / steps as f32;
        let sum: f32 = (0..steps)
            .map(|i| {
                let (sin, cos) = ((i as f32 + 0.5) * step).sin_cos();
                step * Vec2::new(self.half_width * cos, self.depth * sin).length()
            })
            .sum();
        sum * self.scale
    }
}
