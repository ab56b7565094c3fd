//! Ambient visibility of each point in the rest pose.
//!
//! `occlusion(p) = (1/pi) integral of V(p, w) cos(theta) dw`, estimated with cosine-weighted directions from a
//! Hammersley set turned by a hash of the point (so that neighbours do not share a pattern). Same head, same values.

use std::f32::consts::TAU;

use rayon::prelude::*;
use rubor_rig::deform::point_normals;
use rubor_rig::head::{Head, Material};

use super::bvh::Bvh;

/// Rays start this far off the surface, as part of the head's height: 0.1 mm on an adult head.
const START: f32 = 3e-4;

/// Fills `head.mesh.occlusion` with `rays` rays a point.
///
/// Only opaque parts occlude: not lashes, hair, wet shells and hidden ones. Those that overlap others get values all the
/// same. Eyes do not occlude themselves, so that the cornea's edge stays even.
pub fn bake(head: &mut Head, rays: u32) {
    let mesh = &head.mesh;
    let corners = |range: std::ops::Range<u32>| {
        mesh.triangles[range.start as usize..range.end as usize]
            .iter()
            .map(|t| t.map(|v| mesh.points[mesh.vertices[v as usize].point as usize]))
    };
    let opaque = |m: Material| m.is_opaque();
    let blockers = mesh.parts.iter().filter(|p| opaque(p.material));
    let bvh = Bvh::new(blockers.flat_map(|p| corners(p.triangles.clone())).collect());
    let normals = point_normals(mesh, &mesh.points);
    let near = START * head.height();
    let visibility = |i: usize| {
        let (origin, normal) = (mesh.points[i] + near * normals[i], normals[i]);
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let turn = (i as u32).wrapping_mul(0x9E37_79B9) as f32 / 2_f32.powi(32);
        let open = (0..rays).filter(|k| {
            let u = (*k as f32 + 0.5) / rays as f32;
            let phi = TAU * (radical_inverse(*k) + turn);
            let (r, z) = (u.sqrt(), (1.0 - u).sqrt());
            let direction = r * (phi.cos() * tangent + phi.sin() * bitangent) + z * normal;
            !bvh.hit(origin, direction, near, f32::INFINITY)
        });
        open.count() as f32 / rays.max(1) as f32
    };
    let occlusion: Vec<f32> = (0..mesh.points.len()).into_par_iter().map(visibility).collect();
    head.mesh.occlusion = smooth(head, &occlusion);
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
    use rubor_rig::head::{Mesh, Part, Vertex};

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
}
