//! Which place of one head's texture another head's texels mean, through space and landmarks.
//!
//! The receiver is bent onto the giver by a thin-plate spline in three dimensions (Bookstein 1989; kernel `|x|`)
//! through the landmarks that both have; each of its texels then takes the nearest skin of the giver. Texture layouts,
//! seams and topology do not matter.

use glam::{DVec3, Vec2, Vec3};
use nalgebra::DMatrix;
use rayon::prelude::*;
use rubor_rig::head::{Head, Material};

use super::ConvertError;
use super::nearest::Surface;
use super::skin_texels::SkinTexels;
use super::transfer::Warp;

/// Landmarks that a warp needs at least: they must span space.
const LEAST_LANDMARKS: usize = 4;

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

/// The skin of a head and its texture coordinates.
struct Skin {
    surface: Surface,
    uvs: Vec<[Vec2; 3]>,
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
        let uvs = triangles.iter().map(|t| t.map(|c| c.1)).collect();
        let surface = Surface::new(triangles.iter().map(|t| t.map(|c| c.0)).collect()).ok_or_else(|| {
            let found = format!("head {:?} without skin", head.name);
            ConvertError::argument("giver", found, "triangles of the material skin")
        })?;
        Ok(Self { surface, uvs })
    }

    /// Texture coordinate of the nearest skin.
    fn nearest(&self, p: Vec3) -> Vec2 {
        let place = self.surface.nearest(p);
        let [a, b, c] = self.uvs[place.triangle];
        a * place.weights.x + b * place.weights.y + c * place.weights.z
    }
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
