//! Which place of one head's texture another head's texels mean, through space and landmarks.
//!
//! The receiver is bent onto the giver by a thin-plate spline in three dimensions (Bookstein 1989; kernel `|x|`)
//! through the landmarks that both have; each of its texels then takes the nearest skin of the giver. Texture layouts,
//! seams and topology do not matter.

use std::collections::HashMap;

use glam::{DVec3, IVec3, Vec2, Vec3};
use nalgebra::DMatrix;
use rayon::prelude::*;
use rubor_rig::head::{Head, Material};

use super::ConvertError;
use super::skin_texels::SkinTexels;
use super::transfer::{Warp, nearest_in_triangle};

/// Landmarks that a warp needs at least: they must span space.
const LEAST_LANDMARKS: usize = 4;
/// Cells of the search grid along the longest side of a head: some ten triangles each.
const CELLS: f32 = 48.0;

/// Where each texel of a map of the receiver lies in the texture of the giver. Texels without skin have the place of
/// the texture coordinate itself: nothing reads them.
///
/// # Errors
/// Fewer than 4 common landmarks, or common landmarks in one plane; a giver without skin.
pub fn surface_warp(receiver: &Head, giver: &Head, width: u32, height: u32) -> Result<Warp, ConvertError> {
    let bend = Bend::through(receiver, giver)?;
    let skin = Skin::new(giver)?;
    let texels = SkinTexels::new(receiver, width, height);
    let place = |i: u32| {
        let (x, y) = (i % width, i / width);
        match texels.position(x, y) {
            Some(p) => skin.nearest(bend.apply(p)),
            None => Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32),
        }
    };
    let places = (0..width * height).into_par_iter().map(place).collect();
    Ok(Warp::Table { width, height, places })
}

/// A thin-plate spline from the space of one head to that of another.
struct Bend {
    points: Vec<DVec3>,
    weights: Vec<DVec3>,
    /// Constant, x, y and z terms.
    affine: [DVec3; 4],
}

impl Bend {
    fn through(receiver: &Head, giver: &Head) -> Result<Self, ConvertError> {
        let pairs: Vec<(DVec3, DVec3)> = receiver
            .landmarks
            .iter()
            .filter_map(|(name, p)| Some((p.as_dvec3(), giver.landmarks.get(name)?.as_dvec3())))
            .collect();
        let n = pairs.len();
        let expected = || format!("at least {LEAST_LANDMARKS} that are not in one plane, or a file of pairs");
        if n < LEAST_LANDMARKS {
            return Err(ConvertError::argument("common landmarks", n.to_string(), expected()));
        }
        let mut system = DMatrix::<f64>::zeros(n + 4, n + 4);
        let mut right = DMatrix::<f64>::zeros(n + 4, 3);
        for (i, (from, to)) in pairs.iter().enumerate() {
            for (j, (other, _)) in pairs.iter().enumerate() {
                system[(i, j)] = from.distance(*other);
            }
            for (k, value) in [1.0, from.x, from.y, from.z].into_iter().enumerate() {
                system[(i, n + k)] = value;
                system[(n + k, i)] = value;
            }
            for c in 0..3 {
                right[(i, c)] = to[c];
            }
        }
        let solution = system.clone().lu().solve(&right).filter(|s| {
            // A nearly singular system answers with garbage instead of refusing. 1 nm of a head.
            s.iter().all(|v| v.is_finite()) && (&system * s - &right).amax() < 1e-9
        });
        let Some(solution) = solution else {
            return Err(ConvertError::argument("common landmarks", "some in one plane", expected()));
        };
        let row = |i: usize| DVec3::new(solution[(i, 0)], solution[(i, 1)], solution[(i, 2)]);
        Ok(Self {
            points: pairs.iter().map(|p| p.0).collect(),
            weights: (0..n).map(row).collect(),
            affine: [row(n), row(n + 1), row(n + 2), row(n + 3)],
        })
    }

    fn apply(&self, p: Vec3) -> Vec3 {
        let p = p.as_dvec3();
        let mut out = self.affine[0] + self.affine[1] * p.x + self.affine[2] * p.y + self.affine[3] * p.z;
        for (point, weight) in self.points.iter().zip(&self.weights) {
            out += *weight * p.distance(*point);
        }
        out.as_vec3()
    }
}

/// Skin triangles of a head in a grid.
struct Skin {
    triangles: Vec<[(Vec3, Vec2); 3]>,
    cells: HashMap<IVec3, Vec<u32>>,
    cell_metres: f32,
    low: IVec3,
    high: IVec3,
}

impl Skin {
    fn new(head: &Head) -> Result<Self, ConvertError> {
        let mesh = &head.mesh;
        let corner = |v: u32| {
            let vertex = mesh.vertices[v as usize];
            (mesh.points[vertex.point as usize], vertex.uv)
        };
        let triangles: Vec<_> = mesh
            .parts
            .iter()
            .filter(|p| p.material == Material::Skin)
            .flat_map(|p| &mesh.triangles[p.triangles.start as usize..p.triangles.end as usize])
            .map(|t| t.map(corner))
            .collect();
        let extent = head.bounds().map_or(0.0, |(low, high)| (high - low).max_element());
        if triangles.is_empty() || extent <= 0.0 {
            let found = format!("head {:?} without skin", head.name);
            return Err(ConvertError::argument("giver", found, "triangles of the material skin"));
        }
        let cell_metres = extent / CELLS;
        let mut skin =
            Self { triangles, cells: HashMap::new(), cell_metres, low: IVec3::MAX, high: IVec3::MIN };
        for (i, t) in skin.triangles.iter().enumerate() {
            let [a, b, c] = t.map(|c| c.0);
            let (low, high) = (skin.cell(a.min(b).min(c)), skin.cell(a.max(b).max(c)));
            for z in low.z..=high.z {
                for y in low.y..=high.y {
                    for x in low.x..=high.x {
                        skin.cells.entry(IVec3::new(x, y, z)).or_default().push(i as u32);
                    }
                }
            }
            (skin.low, skin.high) = (skin.low.min(low), skin.high.max(high));
        }
        Ok(skin)
    }

    fn cell(&self, p: Vec3) -> IVec3 {
        (p / self.cell_metres).floor().as_ivec3()
    }

    /// Texture coordinate of the nearest skin.
    fn nearest(&self, p: Vec3) -> Vec2 {
        let middle = self.cell(p);
        // Shells of cells about the point until no farther shell can hold anything nearer.
        let inside = middle.clamp(self.low, self.high);
        let first = (middle - inside).abs().max_element();
        let last = first + (self.high - self.low).max_element() + 1;
        let mut best = (f32::INFINITY, Vec2::ZERO);
        for shell in first..=last {
            if best.0 <= (shell - 1).max(0) as f32 * self.cell_metres {
                break;
            }
            for cell in shell_cells(shell).map(|c| middle + c) {
                for i in self.cells.get(&cell).into_iter().flatten() {
                    let [a, b, c] = self.triangles[*i as usize];
                    let w = nearest_in_triangle(p, a.0, b.0, c.0);
                    let d = (a.0 * w.x + b.0 * w.y + c.0 * w.z).distance(p);
                    if d < best.0 {
                        best = (d, a.1 * w.x + b.1 * w.y + c.1 * w.z);
                    }
                }
            }
        }
        best.1
    }
}

/// Offsets of the cells at a Chebyshev distance.
fn shell_cells(n: i32) -> impl Iterator<Item = IVec3> {
    (-n..=n).flat_map(move |z| {
        (-n..=n).flat_map(move |y| {
            let is_face = z.abs() == n || y.abs() == n;
            let step = if is_face || n == 0 { 1 } else { 2 * n };
            (-n..=n).step_by(step as usize).map(move |x| IVec3::new(x, y, z))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::skin_texels::tests::sheet;
    use super::*;

    fn marked(mut head: Head, place: impl Fn(Vec3) -> Vec3) -> Head {
        let marks = [(0.2, 0.2, 0.0), (0.8, 0.3, 0.0), (0.5, 0.9, 0.0), (0.4, 0.5, 0.2), (0.7, 0.7, -0.1)];
        for (i, (x, y, z)) in marks.into_iter().enumerate() {
            head.landmarks.insert(format!("mark-{i}"), place(Vec3::new(x, y, z)));
        }
        for p in &mut head.mesh.points {
            *p = place(*p);
        }
        head
    }

    #[test]
    fn texels_find_their_place_across_layouts_sizes_and_poses() {
        let receiver = marked(sheet(Vec2::ZERO, Vec2::new(0.5, 1.0)), |p| p);
        let turn = |p: Vec3| Vec3::new(3.0 - 2.0 * p.y, 2.0 * p.x, 2.0 * p.z + 1.0);
        let giver = marked(sheet(Vec2::new(0.5, 0.5), Vec2::ONE), turn);
        let warp = surface_warp(&receiver, &giver, 32, 32).unwrap();
        for (u, v) in [(0.1, 0.1), (0.3, 0.7), (0.45, 0.9)] {
            let texel = Vec2::new((u * 32.0f32).floor() + 0.5, (v * 32.0f32).floor() + 0.5) / 32.0;
            let expected = Vec2::splat(0.5) + 0.5 * Vec2::new(2.0 * texel.x, texel.y);
            let found = warp.apply(Vec2::new(u, v));
            assert!(found.distance(expected) < 1e-4, "{found} {expected}");
        }
    }

    #[test]
    fn a_point_far_away_still_finds_the_nearest_skin() {
        let skin = Skin::new(&sheet(Vec2::ZERO, Vec2::ONE)).unwrap();
        assert!(skin.nearest(Vec3::new(0.25, 0.75, 9.0)).distance(Vec2::new(0.25, 0.25)) < 1e-5);
        assert!(skin.nearest(Vec3::new(7.0, -4.0, 0.1)).distance(Vec2::ONE) < 1e-5);
        let shell: Vec<_> = shell_cells(2).collect();
        assert_eq!(shell.len(), 5 * 5 * 5 - 27);
        assert_eq!(shell_cells(0).count(), 1);
    }

    #[test]
    fn too_few_or_flat_landmarks_are_refused() {
        let plain = sheet(Vec2::ZERO, Vec2::ONE);
        let good = marked(plain.clone(), |p| p);
        let error = |a: &Head, b: &Head| surface_warp(a, b, 8, 8).unwrap_err().to_string();
        assert!(error(&plain, &good).contains("common landmarks: found 0"));
        let flat = marked(plain, |p| Vec3::new(p.x, p.y, 0.0));
        assert!(error(&flat, &flat).contains("plane"));
        let mut empty = good.clone();
        empty.mesh.parts[0].material = Material::Other;
        assert!(error(&good, &empty).contains("without skin"));
    }
}
