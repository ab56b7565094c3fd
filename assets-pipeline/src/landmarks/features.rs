//! What says exactly where the openings of a face are: seen eyes, the line where lips touch, the tip of the nose.
//!
//! All of them are read from one picture of the face from the front, in nearly canonical space. Lips that touch are next to
//! each other in the picture and far from each other along the surface; where a shape opens the jaw, they move apart.

use std::collections::{BinaryHeap, HashMap};

use glam::{Vec2, Vec3};
use rubor_rig::head::{Head, Material};

use super::raster::{Depth, Window};
use super::surface::{Similarity, Surface};
use crate::import::materials::recognise;

/// A place that a head shows: its name, where the canonical face has it, where the head has it (nearly canonical mm).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Feature {
    pub name: &'static str,
    pub left: bool,
    pub place: Vec3,
}

/// Side of a pixel, mm.
const PIXEL_MM: f32 = 0.8;
/// Fewest pixels of an opening.
const FEWEST: usize = 30;

/// What a part is, by its material or else by its name.
pub(crate) fn kind(head: &Head, part: usize) -> Material {
    let part = &head.mesh.parts[part];
    match part.material {
        Material::Other => recognise(&part.name).unwrap_or(Material::Other),
        known => known,
    }
}

/// A picture of the front of a face with what each pixel shows.
pub(super) struct Front<'a> {
    head: &'a Head,
    surface: &'a Surface,
    depth: Depth,
    /// Of each triangle of the head.
    kinds: Vec<Material>,
    canonical_from_head: Similarity,
}

impl<'a> Front<'a> {
    /// `surface` is that of the head in nearly canonical space.
    pub(super) fn new(head: &'a Head, surface: &'a Surface, canonical_from_head: Similarity) -> Self {
        let window = Window::covering(Vec2::new(-72.0, -130.0), Vec2::new(72.0, 45.0), PIXEL_MM);
        let depth = Depth::draw(window, surface.corners.iter().copied());
        let mut kinds = vec![Material::Other; head.mesh.triangles.len()];
        for (i, part) in head.mesh.parts.iter().enumerate() {
            let kind = kind(head, i);
            kinds[part.triangles.start as usize..part.triangles.end as usize].fill(kind);
        }
        Self { head, surface, depth, kinds, canonical_from_head }
    }

    fn triangle(&self, pixel: usize) -> Option<u32> {
        self.depth.triangle_at(pixel).map(|t| self.surface.source[t as usize])
    }

    /// Whether a pixel looks into an opening.
    fn is_gap(&self, pixel: usize, of_eye: bool) -> bool {
        let Some(triangle) = self.triangle(pixel) else { return of_eye };
        let kind = self.kinds[triangle as usize];
        if of_eye {
            kind == Material::Eye
        } else {
            matches!(kind, Material::Mucosa | Material::Teeth | Material::Gums)
        }
    }

    /// Corners and lids of an eye whose centre is expected somewhere.
    fn eye(&self, center: Vec2, left: bool) -> Vec<Feature> {
        let side = if left { 1.0 } else { -1.0 };
        let window = self.depth.window;
        let pixels: Vec<usize> = (0..self.depth.z.len())
            .filter(|i| {
                let p = window.center(i % window.width, i / window.width) - center;
                p.x.abs() < 24.0 && p.y.abs() < 17.0
            })
            .filter(|i| self.is_gap(*i, true))
            .collect();
        if pixels.len() < FEWEST {
            return Vec::new();
        }
        // Counted from the nose outwards.
        let out = |i: &usize| side * window.center(i % window.width, i / window.width).x;
        let up = |i: &usize| window.center(i % window.width, i / window.width).y;
        let (inner, outer) =
            pixels.iter().map(out).fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(v), b.max(v)));
        if outer - inner < 10.0 || pixels.iter().any(|i| self.triangle(*i).is_none()) {
            // Too narrow for an eye, or a hole without one: its corners are the border of the skin, seen through.
            if outer - inner < 10.0 {
                return Vec::new();
            }
        }
        let mean = |chosen: &dyn Fn(&usize) -> bool| {
            let ys: Vec<f32> = pixels.iter().filter(|i| chosen(i)).map(up).collect();
            ys.iter().sum::<f32>() / ys.len().max(1) as f32
        };
        let middle = 0.5 * (inner + outer);
        let column: Vec<f32> =
            pixels.iter().filter(|i| (out(i) - middle).abs() < 2.0 * PIXEL_MM).map(up).collect();
        let (low, high) = column.iter().fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
        let at_inner = Vec2::new(side * inner, mean(&|i| out(i) < inner + 2.0 * PIXEL_MM));
        let at_outer = Vec2::new(side * outer, mean(&|i| out(i) > outer - 2.0 * PIXEL_MM));
        let half = 0.5 * PIXEL_MM;
        [
            ("eye-inner", at_inner),
            ("eye-outer", at_outer),
            ("eye-top", Vec2::new(side * middle, high + half)),
            ("eye-bottom", Vec2::new(side * middle, low - half)),
        ]
        .into_iter()
        .filter_map(|(name, p)| Some(Feature { name, left, place: self.skin_at(p)? }))
        .collect()
    }

    /// The nearest place of skin about a place of the picture.
    fn skin_at(&self, p: Vec2) -> Option<Vec3> {
        let window = self.depth.window;
        let reach = (3.0 / PIXEL_MM) as isize;
        let at = window.at(p).round();
        let mut best: Option<(f32, usize)> = None;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (x, y) = (at.x as isize + dx, at.y as isize + dy);
                if x < 0 || y < 0 || x >= window.width as isize || y >= window.height as isize {
                    continue;
                }
                let i = y as usize * window.width + x as usize;
                let Some(t) = self.triangle(i) else { continue };
                let distance = (dx * dx + dy * dy) as f32;
                if matches!(self.kinds[t as usize], Material::Skin | Material::Other)
                    && best.is_none_or(|(d, _)| distance < d)
                {
                    best = Some((distance, i));
                }
            }
        }
        best.map(|(_, i)| p.extend(self.depth.z[i]))
    }

    /// Middle and corners of the mouth, whose middle is expected somewhere.
    fn mouth(&self, center: Vec2) -> Vec<Feature> {
        let window = self.depth.window;
        let opening = Opening::new(self.head, &self.canonical_from_head);
        let column = |x: usize| -> Option<f32> {
            let place = window.center(x, 0).x - center.x;
            let reach = if place.abs() < 20.0 { 15.0 } else { 11.0 };
            let from = window.at(Vec2::new(0.0, center.y - reach)).y.max(0.0) as usize;
            let to = (window.at(Vec2::new(0.0, center.y + reach)).y as usize).min(window.height - 2);
            let mut rows = Vec::new();
            for y in from..to {
                let (below, above) = (y * window.width + x, (y + 1) * window.width + x);
                let gap = self.is_gap(below, false);
                let is_seam = match (self.triangle(below), self.triangle(above)) {
                    (Some(a), Some(b)) if a != b => {
                        opening.parts(self.head, a, b, self.depth.place(below), self.depth.place(above))
                    }
                    _ => false,
                };
                if gap || is_seam {
                    rows.push(window.center(x, y).y + if gap { 0.0 } else { 0.5 * PIXEL_MM });
                }
            }
            if rows.is_empty() {
                return None;
            }
            // Of several lines, the one nearest to the expected height; of a gap, its middle.
            let middle = rows.len() / 2;
            rows.sort_by(f32::total_cmp);
            Some(rows[middle])
        };
        let middle = window.at(center).round().x.max(0.0) as usize;
        let most = (42.0 / PIXEL_MM) as usize;
        let walk = |step: isize| -> Vec<(usize, f32)> {
            let (mut found, mut missed) = (Vec::new(), 0);
            for k in 0..most as isize {
                let x = middle as isize + step * k;
                if x < 0 || x >= window.width as isize {
                    break;
                }
                match column(x as usize) {
                    // A line does not jump.
                    Some(y) if found.last().is_none_or(|(_, last): &(usize, f32)| (y - last).abs() < 4.0) => {
                        found.push((x as usize, y));
                        missed = 0;
                    }
                    _ => missed += 1,
                }
                if missed > 3 {
                    break;
                }
            }
            found
        };
        let (right, left) = (walk(-1), walk(1));
        let width = |side: &[(usize, f32)]| {
            side.last().map_or(0.0, |(x, _)| (*x as f32 - middle as f32).abs() * PIXEL_MM)
        };
        // A mouth is 30 to 80 mm wide, and not all on one side.
        let (w_left, w_right) = (width(&left), width(&right));
        if w_left < 13.0 || w_right < 13.0 || w_left > 41.0 || w_right > 41.0 {
            return Vec::new();
        }
        let mut features = Vec::new();
        for (side, left) in [(&left, true), (&right, false)] {
            if let Some((x, y)) = side.last() {
                let p = Vec2::new(window.center(*x, 0).x, *y);
                features.extend(self.skin_at(p).map(|place| Feature { name: "mouth-corner", left, place }));
            }
        }
        let heights: Vec<f32> = left.iter().take(4).chain(right.iter().take(4)).map(|f| f.1).collect();
        let y = heights.iter().sum::<f32>() / heights.len().max(1) as f32;
        let p = Vec2::new(center.x, y);
        features.extend(self.skin_at(p).map(|place| Feature { name: "mouth-middle", left: true, place }));
        features
    }

    /// The frontmost place about the expected tip of the nose.
    fn nose(&self, tip: Vec2) -> Option<Feature> {
        let window = self.depth.window;
        let near = (0..self.depth.z.len()).filter(|i| {
            let p = window.center(i % window.width, i / window.width) - tip;
            p.x.abs() < 9.0 && p.y.abs() < 11.0 && self.depth.covers(*i)
        });
        let front = near.clone().map(|i| self.depth.z[i]).fold(f32::MIN, f32::max);
        // The middle of what is within half a millimetre: tips are flat.
        let tips: Vec<Vec3> =
            near.filter(|i| self.depth.z[*i] > front - 0.5).map(|i| self.depth.place(i)).collect();
        if tips.is_empty() {
            return None;
        }
        Some(Feature { name: "nose-tip", left: true, place: tips.iter().sum::<Vec3>() / tips.len() as f32 })
    }

    /// All that the picture tells. `expected` maps canonical places to where a first fit has them.
    pub(super) fn features(&self, expected: impl Fn(Vec3) -> Vec3) -> Vec<Feature> {
        let mut found = Vec::new();
        for (left, side) in [(true, 1.0), (false, -1.0)] {
            found.extend(self.eye(expected(Vec3::new(side * 32.0, -2.5, 72.0)).truncate(), left));
        }
        found.extend(self.mouth(expected(Vec3::new(0.0, -71.0, 93.0)).truncate()));
        found.extend(self.nose(expected(Vec3::new(0.0, -33.0, 110.8)).truncate()));
        found
    }
}

/// Tells whether two triangles that touch in a picture are two lips.
struct Opening {
    /// Neighbours of each point, and the length of the edge in mm.
    neighbours: HashMap<u32, Vec<(u32, f32)>>,
    /// Displacement of each point where the jaw opens, mm; empty without such a shape.
    jaw: HashMap<u32, Vec3>,
    largest_mm: f32,
}

/// Lips are at least this far from each other along the surface, mm.
const AROUND_MM: f32 = 6.0;

impl Opening {
    fn new(head: &Head, canonical_from_head: &Similarity) -> Self {
        let mesh = &head.mesh;
        let mm = canonical_from_head.scale();
        let mut neighbours: HashMap<u32, Vec<(u32, f32)>> = HashMap::new();
        for t in &mesh.triangles {
            let points = t.map(|v| mesh.vertices[v as usize].point);
            for k in 0..3 {
                let (a, b) = (points[k], points[(k + 1) % 3]);
                let length = mesh.points[a as usize].distance(mesh.points[b as usize]) * mm;
                neighbours.entry(a).or_default().push((b, length));
                neighbours.entry(b).or_default().push((a, length));
            }
        }
        let shape = head.shapes.iter().find(|s| s.name.eq_ignore_ascii_case("jawOpen"));
        let jaw: HashMap<u32, Vec3> = shape
            .map(|s| s.points.iter().copied().zip(s.offsets.iter().map(|o| *o * mm)).collect())
            .unwrap_or_default();
        let largest_mm = jaw.values().map(|o| o.length()).fold(0.0, f32::max);
        Self { neighbours, jaw, largest_mm }
    }

    fn parts(&self, head: &Head, a: u32, b: u32, at_a: Vec3, at_b: Vec3) -> bool {
        let points = |t: u32| head.mesh.triangles[t as usize].map(|v| head.mesh.vertices[v as usize].point);
        let (pa, pb) = (points(a), points(b));
        if pa.iter().any(|p| pb.contains(p)) {
            return false;
        }
        if self.largest_mm > 5.0 {
            let mean = |p: [u32; 3]| p.iter().filter_map(|p| self.jaw.get(p)).sum::<Vec3>() / 3.0;
            if (mean(pa) - mean(pb)).length() < 0.15 * self.largest_mm {
                return false;
            }
        }
        // A step to what is much deeper is an outline, unless it is into the mouth.
        let around = AROUND_MM.max(3.0 * at_a.distance(at_b).min(8.0));
        !self.reaches(&pa, &pb, around)
    }

    /// Whether a walk along edges of at most this length joins two triangles (E. Dijkstra 1959).
    fn reaches(&self, from: &[u32; 3], to: &[u32; 3], within_mm: f32) -> bool {
        #[derive(PartialEq)]
        struct Reached(f32, u32);
        impl Eq for Reached {}
        impl PartialOrd for Reached {
            fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
                Some(self.cmp(other))
            }
        }
        impl Ord for Reached {
            fn cmp(&self, other: &Self) -> std::cmp::Ordering {
                other.0.total_cmp(&self.0)
            }
        }
        let mut heap: BinaryHeap<Reached> = from.iter().map(|p| Reached(0.0, *p)).collect();
        let mut known: HashMap<u32, f32> = from.iter().map(|p| (*p, 0.0)).collect();
        while let Some(Reached(distance, point)) = heap.pop() {
            if to.contains(&point) {
                return true;
            }
            if known.get(&point).is_some_and(|d| *d < distance) {
                continue;
            }
            for (next, length) in self.neighbours.get(&point).map_or(&[][..], Vec::as_slice) {
                let sum = distance + length;
                if sum <= within_mm && known.get(next).is_none_or(|d| sum < *d) {
                    known.insert(*next, sum);
                    heap.push(Reached(sum, *next));
                }
            }
        }
        false
    }
}
