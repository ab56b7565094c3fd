//! Ambient visibility of each point in the rest pose, and how blend shapes change it.
//!
//! `occlusion(p) = (1/pi) integral of V(p, w) cos(theta) dw`, estimated with cosine-weighted directions from a
//! Hammersley set turned by a hash of the point (so that neighbours do not share a pattern). Same head, same values.
//!
//! A shape changes it where jaw, lips and lids open or close a cavity: the difference of the whole head's visibility at
//! weights 0.5 and 1 to that at rest, with the same rays. The renderer adds differences by weight; `docs/occlusion.md`
//! has the error against rays in the deformed head, and that of occlusion from the screen.

use std::f32::consts::TAU;

use glam::Vec3;
use rayon::prelude::*;
use rubor_rig::bvh::Bvh;
use rubor_rig::deform::{deform_points, point_normals};
use rubor_rig::head::{Head, Material, Mesh, OcclusionChange};

/// Rays of a point where an import has no other number.
pub const RAYS: u32 = 128;
/// Rays start this far off the surface, as part of the head's height: 0.1 mm on an adult head.
const START: f32 = 3e-4;
/// Points farther than this from all that a shape moves keep their visibility, as part of the head's height: 13 mm.
const REACH: f32 = 0.04;
/// Displacements below this, as part of the head's height, open and close nothing: 0.3 mm.
const STILL: f32 = 9e-4;
/// Changes of visibility below this at both weights are not kept.
const LEAST_CHANGE: f32 = 0.02;

/// Shapes that change ambient visibility enough to be worth their bytes (`docs/occlusion.md`): jaw and lips that open the
/// mouth, lids that slide over the ball, brows that come down. With each the shape that it is made for, if any.
pub const SHAPES: [(&str, Option<&str>); 21] = [
    ("jawOpen", None),
    ("mouthClose", Some("jawOpen")),
    ("mouthFunnel", None),
    ("mouthUpperUpLeft", None),
    ("mouthUpperUpRight", None),
    ("mouthLowerDownLeft", None),
    ("mouthLowerDownRight", None),
    ("mouthRollUpper", None),
    ("mouthRollLower", None),
    ("eyeBlinkLeft", None),
    ("eyeBlinkRight", None),
    ("eyeSquintLeft", None),
    ("eyeSquintRight", None),
    ("cheekSquintLeft", None),
    ("cheekSquintRight", None),
    ("eyeWideLeft", None),
    ("eyeWideRight", None),
    ("eyeLookDownLeft", None),
    ("eyeLookDownRight", None),
    ("browDownLeft", None),
    ("browDownRight", None),
];

/// Directions about +Z whose density is that of the cosine: a Hammersley set.
pub struct Rays(Vec<Vec3>);

impl Rays {
    /// `count` directions.
    pub fn new(count: u32) -> Self {
        let direction = |k: u32| {
            let u = (k as f32 + 0.5) / count as f32;
            let (sin, cos) = (TAU * radical_inverse(k)).sin_cos();
            let (r, z) = (u.sqrt(), (1.0 - u).sqrt());
            Vec3::new(r * cos, r * sin, z)
        };
        Self((0..count).map(direction).collect())
    }

    /// The same about a normal, turned by `turn` (of 1).
    fn about(&self, normal: Vec3, turn: f32) -> impl Iterator<Item = Vec3> {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let (sin, cos) = (TAU * turn).sin_cos();
        let (x, y) = (cos * tangent + sin * bitangent, cos * bitangent - sin * tangent);
        self.0.iter().map(move |d| d.x * x + d.y * y + d.z * normal)
    }
}

/// The surfaces that hide the sky from the places of a mesh.
///
/// Only opaque parts: not lashes, hair, wet shells and hidden ones.
pub struct Blockers {
    bvh: Bvh,
    near: f32,
}

impl Blockers {
    /// The mesh with its points at `points`; `height` is that of the head, metres.
    pub fn new(mesh: &Mesh, points: &[Vec3], height: f32) -> Self {
        let triangles = blocking(mesh).map(|t| t.map(|p| points[p as usize])).collect();
        Self { bvh: Bvh::new(triangles), near: START * height }
    }

    /// The same surfaces in another pose of the mesh.
    fn posed(&self, mesh: &Mesh, points: &[Vec3]) -> Self {
        let triangles: Vec<[Vec3; 3]> = blocking(mesh).map(|t| t.map(|p| points[p as usize])).collect();
        Self { bvh: self.bvh.posed(&triangles), near: self.near }
    }

    /// Ambient visibility of a place with a normal, from rays turned by `turn` (of 1).
    pub fn visibility(&self, place: Vec3, normal: Vec3, rays: &Rays, turn: f32) -> f32 {
        let open = rays.about(normal, turn).filter(|direction| self.sees(place, normal, *direction));
        open.count() as f32 / rays.0.len().max(1) as f32
    }

    /// Whether a place with a normal sees the sky in a direction.
    pub fn sees(&self, place: Vec3, normal: Vec3, direction: Vec3) -> bool {
        self.blocker(place, normal, direction).is_none()
    }

    /// What hides the sky from a place with a normal in a direction.
    fn blocker(&self, place: Vec3, normal: Vec3, direction: Vec3) -> Option<u32> {
        self.bvh.any(place + self.near * normal, direction, self.near, f32::INFINITY)
    }
}

/// Points of the triangles of opaque parts.
fn blocking(mesh: &Mesh) -> impl Iterator<Item = [u32; 3]> {
    let parts = mesh.parts.iter().filter(|p| p.material.is_opaque());
    parts.flat_map(|p| {
        mesh.triangles[p.triangles.start as usize..p.triangles.end as usize]
            .iter()
            .map(|t| t.map(|v| mesh.vertices[v as usize].point))
    })
}

/// Fills `head.mesh.occlusion` with `rays` rays per point.
///
/// Parts that do not occlude and overlap others get values all the same. Eyes do not occlude themselves, so that the
/// cornea's edge stays even.
pub fn bake(head: &mut Head, rays: u32) {
    let everywhere = vec![true; head.mesh.points.len()];
    let raw = Traced::new(head, &head.mesh.points, &Rays::new(rays), &everywhere, None).visibility();
    head.mesh.occlusion = smooth(head, &raw);
}

/// Fills `occlusion` of the shapes `names` that the head has, with `rays` rays per point; a shape that is made for
/// another counts on top of that. Points of eyes are left out: the renderer finds their lids in the picture.
pub fn bake_shapes(head: &mut Head, rays: u32, names: &[(&str, Option<&str>)]) {
    let is_eye = points_of_eyes(head);
    let rays = &Rays::new(rays);
    let known: Vec<(usize, Option<usize>, Vec<bool>)> = names
        .iter()
        .filter_map(|(name, base)| {
            let index = head.shape_index(name)?;
            let mut wanted = near_motion(head, index);
            wanted.iter_mut().zip(&is_eye).for_each(|(wanted, eye)| *wanted &= !eye);
            Some((index, base.and_then(|b| head.shape_index(b)), wanted))
        })
        .collect();
    let mut of_any = vec![false; is_eye.len()];
    known.iter().for_each(|(.., wanted)| of_any.iter_mut().zip(wanted).for_each(|(any, one)| *any |= one));
    let rest = Traced::new(head, &head.mesh.points, rays, &of_any, None);
    for (index, base, wanted) in known {
        let at = |own: f32, other: f32, from: &Traced| {
            let mut weights = vec![0.0; head.shapes.len()];
            base.into_iter().for_each(|b| weights[b] = other);
            weights[index] = own;
            let points = deform_points(&head.mesh, &head.shapes, &weights);
            Traced::new(head, &points, rays, &wanted, Some(from))
        };
        // Smoothing is linear: that of differences is the difference.
        let change = |weight: f32| -> Vec<f32> {
            let base = base.map(|_| at(0.0, weight, &rest));
            let before = base.as_ref().unwrap_or(&rest);
            let after = at(weight, weight, before);
            let difference = |i: usize| if wanted[i] { after.open(i) - before.open(i) } else { 0.0 };
            smooth(head, &(0..wanted.len()).map(difference).collect::<Vec<f32>>())
        };
        let changes = change(0.5).into_iter().zip(change(1.0)).enumerate();
        let changes = changes.filter(|(i, _)| !is_eye[*i]).map(|(i, (at_half, at_full))| OcclusionChange {
            point: i as u32,
            at_half,
            at_full,
        });
        let kept: Vec<_> = changes.filter(|c| c.at_half.abs().max(c.at_full.abs()) >= LEAST_CHANGE).collect();
        head.shapes[index].occlusion = kept;
    }
}

fn points_of_eyes(head: &Head) -> Vec<bool> {
    let mut is_eye = vec![false; head.mesh.points.len()];
    for part in head.mesh.parts.iter().filter(|p| p.material == Material::Eye) {
        let triangles = &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize];
        for v in triangles.as_flattened() {
            is_eye[head.mesh.vertices[*v as usize].point as usize] = true;
        }
    }
    is_eye
}

/// Points within reach of the points that a shape moves, on a grid: those in the cell of a moved point or a
/// neighbouring cell.
fn near_motion(head: &Head, shape: usize) -> Vec<bool> {
    let height = head.height().max(f32::MIN_POSITIVE);
    let cell = |p: Vec3| (p / (REACH * height)).floor().as_ivec3();
    let shape = &head.shapes[shape];
    let mut cells = std::collections::HashSet::new();
    for (p, offset) in shape.points.iter().zip(&shape.offsets) {
        if offset.length() > STILL * height {
            let center = cell(head.mesh.points[*p as usize]);
            cells.extend((0..27).map(|i| center + glam::IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)));
        }
    }
    head.mesh.points.iter().map(|p| cells.contains(&cell(*p))).collect()
}

/// The sky is not hidden in a direction.
const OPEN: u32 = u32::MAX;

/// A pose of a head with what its points see.
struct Traced {
    blockers: Blockers,
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// What each ray of a point meets, by its place among the blocking triangles; empty for points that were not asked for.
    met: Vec<Box<[u32]>>,
}

impl Traced {
    /// Rays from the points that are asked for. Those of a pose from which this one differs in places, `from`, are taken over
    /// where nothing moved: a point that kept place and normal sends the same rays, and what did not move hides the same of
    /// them. The result is that of tracing all.
    fn new(head: &Head, points: &[Vec3], rays: &Rays, wanted: &[bool], from: Option<&Self>) -> Self {
        let mesh = &head.mesh;
        let normals = point_normals(mesh, points);
        let blockers = match from {
            Some(from) => from.blockers.posed(mesh, points),
            None => Blockers::new(mesh, points, head.height()),
        };
        let shared = from.map(|from| {
            let has_moved = |p: &u32| from.points[*p as usize] != points[*p as usize];
            let moved: Vec<bool> = blocking(mesh).map(|t| t.iter().any(has_moved)).collect();
            let subset = blockers.bvh.subset(|t| moved[t as usize]);
            (from, moved, subset)
        });
        let met_by = |i: usize| -> Box<[u32]> {
            if !wanted[i] {
                return Box::default();
            }
            let turn = (i as u32).wrapping_mul(0x9E37_79B9) as f32 / 2_f32.powi(32);
            let (place, normal) = (points[i], normals[i]);
            let of_all = |direction: Vec3| blockers.blocker(place, normal, direction).unwrap_or(OPEN);
            let directions = rays.about(normal, turn);
            match &shared {
                Some((from, moved, subset)) if from.knows(i, place, normal) => {
                    let origin = place + blockers.near * normal;
                    let of_moved = |direction: Vec3| {
                        blockers.bvh.any_of(subset, origin, direction, blockers.near, f32::INFINITY)
                    };
                    let again = |(direction, before): (Vec3, &u32)| match *before {
                        OPEN => of_moved(direction).unwrap_or(OPEN),
                        still if !moved[still as usize] => still,
                        _ => of_all(direction),
                    };
                    directions.zip(&from.met[i]).map(again).collect()
                }
                _ => directions.map(of_all).collect(),
            }
        };
        let met = (0..points.len()).into_par_iter().map(met_by).collect();
        Self { blockers, points: points.to_vec(), normals, met }
    }

    /// Whether a point was asked for, and had this place and normal.
    fn knows(&self, i: usize, place: Vec3, normal: Vec3) -> bool {
        !self.met[i].is_empty() && self.points[i] == place && self.normals[i] == normal
    }

    /// Ambient visibility of a point; 0 if it was not asked for.
    fn open(&self, i: usize) -> f32 {
        let met = &self.met[i];
        met.iter().filter(|m| **m == OPEN).count() as f32 / met.len().max(1) as f32
    }

    /// That of all points.
    fn visibility(&self) -> Vec<f32> {
        (0..self.met.len()).map(|i| self.open(i)).collect()
    }
}

/// Van der Corput sequence in base 2.
fn radical_inverse(k: u32) -> f32 {
    k.reverse_bits() as f32 / 2_f32.powi(32)
}

/// One pass of the mean with the neighbours: takes the noise of `rays` samples down without widening contact shadows
/// by more than an edge.
fn smooth(head: &Head, values: &[f32]) -> Vec<f32> {
    let mesh = &head.mesh;
    let mut sums: Vec<(f32, f32)> = values.iter().map(|v| (2.0 * v, 2.0)).collect();
    for t in &mesh.triangles {
        let points = t.map(|v| mesh.vertices[v as usize].point as usize);
        for k in 0..3 {
            let (p, q) = (points[k], points[(k + 1) % 3]);
            // Each inner edge is met from both sides, so weights are half.
            for (to, from) in [(p, q), (q, p)] {
                sums[to].0 += 0.5 * values[from];
                sums[to].1 += 0.5;
            }
        }
    }
    sums.into_iter().map(|(sum, weight)| sum / weight).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec2, Vec3};
    use rubor_rig::deform::blend_occlusion;
    use rubor_rig::head::{BlendShape, Mesh, Part, Vertex};

    /// Squares of one part each: origin, edges, material.
    fn squares(list: &[(Vec3, Vec3, Vec3, Material)]) -> Head {
        let mut mesh = Mesh::default();
        for (i, (origin, a, b, material)) in list.iter().enumerate() {
            let first = mesh.points.len() as u32;
            mesh.points.extend([*origin, *origin + *a, *origin + *a + *b, *origin + *b]);
            mesh.vertices.extend((first..first + 4).map(|point| Vertex { point, uv: Vec2::ZERO }));
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            let start = 2 * i as u32;
            mesh.parts.push(Part { name: String::new(), material: *material, triangles: start..start + 2 });
        }
        Head { mesh, ..Head::default() }
    }

    #[test]
    fn a_half_plane_hides_half_and_a_lash_nothing() {
        // A floor point at the foot of a very large wall sees half of the cosine-weighted hemisphere.
        let floor = (Vec3::new(-0.5, 0.0, 0.0), Vec3::Z, Vec3::X, Material::Skin);
        let wall = |m| (Vec3::new(-500.0, 0.0, -0.001), Vec3::X * 1000.0, Vec3::Y * 1000.0, m);
        let mut head = squares(&[floor, wall(Material::Skin)]);
        // `near` scales with the height of the wall: keep it small against the gap.
        head.mesh.points[6].y = 1.0;
        head.mesh.points[7].y = 1.0;
        let mut open = squares(&[floor, wall(Material::Lash)]);
        bake(&mut open, 64);
        assert_eq!(open.mesh.occlusion[..4], [1.0; 4]);
        bake(&mut head, 256);
        let at_wall = (head.mesh.occlusion[0] + head.mesh.occlusion[3]) / 2.0;
        assert!((0.45..0.85).contains(&at_wall), "{at_wall}");
        assert!(head.mesh.occlusion[1] > at_wall);
        let first = head.mesh.occlusion.clone();
        bake(&mut head, 256);
        assert_eq!(head.mesh.occlusion, first);
    }

    /// A floor of 8 x 8 squares under a lid that a shape slides away.
    fn under_a_lid() -> Head {
        const N: u32 = 9;
        let mut mesh = Mesh::default();
        for i in 0..N * N {
            let (x, y) = ((i % N) as f32 / 8.0 - 0.5, (i / N) as f32 / 8.0 - 0.5);
            mesh.points.push(Vec3::new(x, y, 0.0));
        }
        for i in (0..N * (N - 1)).filter(|i| i % N < N - 1) {
            mesh.triangles.extend([[i, i + 1, i + N], [i + 1, i + N + 1, i + N]]);
        }
        let floor = mesh.triangles.len() as u32;
        mesh.points
            .extend([(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)].map(|(x, y)| Vec3::new(x, y, 0.2)));
        // Far off: makes the head so high that all of the floor is within reach of the lid.
        mesh.points.push(Vec3::Y * 9.5);
        mesh.triangles.extend([[N * N, N * N + 1, N * N + 2], [N * N, N * N + 2, N * N + 3]]);
        mesh.vertices = (0..N * N + 5).map(|point| Vertex { point, uv: Vec2::ZERO }).collect();
        let part = |triangles| Part { name: String::new(), material: Material::Skin, triangles };
        mesh.parts = vec![part(0..floor), part(floor..floor + 2)];
        let slide = BlendShape {
            name: "slide".into(),
            points: (N * N..N * N + 4).collect(),
            offsets: vec![Vec3::X; 4],
            ..BlendShape::default()
        };
        Head { mesh, shapes: vec![slide], ..Head::default() }
    }

    #[test]
    fn a_pose_that_shares_rays_sees_what_one_that_traces_all_sees() {
        let head = under_a_lid();
        let (rays, everywhere) = (Rays::new(64), vec![true; head.mesh.points.len()]);
        let half: Vec<bool> = (0..head.mesh.points.len()).map(|i| i % 2 == 0).collect();
        let traced = |weight: f32, wanted: &[bool], from: Option<&Traced>| {
            let points = deform_points(&head.mesh, &head.shapes, &[weight]);
            Traced::new(&head, &points, &rays, wanted, from)
        };
        let rest = traced(0.0, &everywhere, None);
        let rest_of_half = traced(0.0, &half, None);
        let mut changed = 0;
        for weight in [0.0, 0.3, 1.0] {
            let truth = traced(weight, &everywhere, None).visibility();
            let shared = traced(weight, &everywhere, Some(&rest));
            assert_eq!(shared.visibility(), truth, "{weight}");
            // From a pose that knows some of the points, and back to rest.
            assert_eq!(traced(weight, &everywhere, Some(&rest_of_half)).visibility(), truth, "{weight}");
            assert_eq!(traced(0.0, &everywhere, Some(&shared)).visibility(), rest.visibility());
            changed += truth.iter().zip(rest.visibility()).filter(|(a, b)| **a != *b).count();
        }
        assert!(changed > 20, "{changed} changes make a poor test");
    }

    #[test]
    fn changes_at_rest_and_at_their_weights_are_those_of_the_posed_head() {
        let mut head = under_a_lid();
        bake(&mut head, 512);
        let rest = head.mesh.occlusion.clone();
        bake_shapes(&mut head, 512, &[("slide", None), ("other", None)]);
        assert_eq!(head.mesh.occlusion, rest);
        assert_eq!(blend_occlusion(&head.mesh, &head.shapes, &[0.0]), rest);
        let mut posed = head.clone();
        for weight in [0.5f32, 1.0] {
            posed.mesh.points = deform_points(&head.mesh, &head.shapes, &[weight]);
            let everywhere = vec![true; posed.mesh.points.len()];
            let traced = Traced::new(&head, &posed.mesh.points, &Rays::new(512), &everywhere, None);
            let truth = smooth(&head, &traced.visibility());
            let blended = blend_occlusion(&head.mesh, &head.shapes, &[weight]);
            let near = near_motion(&head, 0);
            assert!(near[..81].iter().all(|n| *n));
            let mut changed = 0;
            for i in (0..truth.len()).filter(|i| near[*i]) {
                assert!((truth[i] - blended[i]).abs() < LEAST_CHANGE, "{i}: {} {}", truth[i], blended[i]);
                changed += u32::from((truth[i] - rest[i]).abs() > 0.2);
            }
            assert!(changed > 8, "{changed} changes make a poor test");
        }
    }
}
