//! Deformation: points, normals and tangents of a head under blend shape weights.
//!
//! The reference for the GPU kernels. Normals and tangents are recomputed from the deformed
//! triangles rather than blended, so they are right for any weights.

use glam::{Vec2, Vec3, Vec4};

use crate::head::{BlendShape, Head, Mesh};

/// Deformed points, metres: rest plus the weighted offsets of every shape.
///
/// `weights` has one value per shape; missing ones count as zero.
pub fn deform_points(mesh: &Mesh, shapes: &[BlendShape], weights: &[f32]) -> Vec<Vec3> {
    let mut points = mesh.points.clone();
    for (shape, weight) in shapes.iter().zip(weights) {
        if *weight != 0.0 {
            for (p, offset) in shape.points.iter().zip(&shape.offsets) {
                points[*p as usize] += *weight * *offset;
            }
        }
    }
    points
}

/// Ambient visibility of each point, 0 to 1: that at rest plus the changes of every shape; 1 where the mesh has none.
pub fn blend_occlusion(mesh: &Mesh, shapes: &[BlendShape], weights: &[f32]) -> Vec<f32> {
    let rest = |i: usize| mesh.occlusion.get(i).copied().unwrap_or(1.0);
    let mut sum: Vec<f32> = (0..mesh.points.len()).map(rest).collect();
    for (shape, weight) in shapes.iter().zip(weights) {
        shape.occlusion.iter().for_each(|c| sum[c.point as usize] += c.at(*weight));
    }
    sum.into_iter().map(|v| v.clamp(0.0, 1.0)).collect()
}

/// Unit normal of each point: the sum of the normals of its triangles weighted by area.
///
/// Points whose triangles are all degenerate get +Z.
pub fn point_normals(mesh: &Mesh, points: &[Vec3]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; points.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize].point as usize);
        let area_normal = (points[b] - points[a]).cross(points[c] - points[a]);
        for p in [a, b, c] {
            sums[p] += area_normal;
        }
    }
    sums.into_iter().map(|n| n.try_normalize().unwrap_or(Vec3::Z)).collect()
}

/// Tangent of each vertex, orthogonal to its normal: xyz the direction of growing u, w the sign (+1 or -1) such that
/// `w * cross(normal, tangent)` points towards smaller v, up in the image (glTF's convention).
///
/// Triangles contribute by area in texture space; a vertex without any gets an arbitrary tangent and w = 1.
pub fn vertex_tangents(mesh: &Mesh, points: &[Vec3], normals: &[Vec3]) -> Vec<Vec4> {
    let mut tangents = vec![Vec3::ZERO; mesh.vertices.len()];
    let mut bitangents = vec![Vec3::ZERO; mesh.vertices.len()];
    for triangle in &mesh.triangles {
        let corners = triangle.map(|v| mesh.vertices[v as usize]);
        let (dp_du, dp_dv) =
            texture_derivatives(corners.map(|c| points[c.point as usize]), corners.map(|c| c.uv));
        for v in triangle {
            tangents[*v as usize] += dp_du;
            bitangents[*v as usize] -= dp_dv;
        }
    }
    let frame = |(i, v): (usize, &crate::head::Vertex)| {
        let n = normals[v.point as usize];
        let t = tangents[i];
        let t = (t - n * n.dot(t)).try_normalize().unwrap_or_else(|| n.any_orthonormal_vector());
        let sign = if n.cross(t).dot(bitangents[i]) < 0.0 { -1.0 } else { 1.0 };
        t.extend(sign)
    };
    mesh.vertices.iter().enumerate().map(frame).collect()
}

/// Cosine between the normals of author and geometry to which larger angles are reduced, so that a slope says them.
const LEAST_COSINE: f32 = 0.17;

/// How the normals that the author of a head made lean from those of its geometry at rest: slopes along tangent and bitangent
/// of each vertex. Empty where there are none. A deformed head has its geometry's normals with the same lean.
pub fn normal_bends(head: &Head) -> Vec<[f32; 2]> {
    if head.authored.normals.iter().all(|n| *n == Vec3::ZERO) {
        return Vec::new();
    }
    let mesh = &head.mesh;
    let normals = point_normals(mesh, &mesh.points);
    let tangents = vertex_tangents(mesh, &mesh.points, &normals);
    let bend = |(v, vertex): (usize, &crate::head::Vertex)| {
        let (n, t) = (normals[vertex.point as usize], tangents[v]);
        let authored = head.authored.normal(v as u32);
        let up = authored.dot(n).max(LEAST_COSINE);
        let across = t.w * n.cross(t.truncate());
        [authored.dot(t.truncate()) / up, authored.dot(across) / up]
    };
    mesh.vertices.iter().enumerate().map(bend).collect()
}

/// Normal and tangent of a vertex that lean by a slope of [`normal_bends`].
pub fn bent(normal: Vec3, tangent: Vec4, bend: [f32; 2]) -> (Vec3, Vec4) {
    if bend == [0.0; 2] {
        return (normal, tangent);
    }
    let along = tangent.truncate();
    let n = (normal + bend[0] * along + bend[1] * tangent.w * normal.cross(along)).normalize();
    let t = (along - n * n.dot(along)).try_normalize().unwrap_or_else(|| n.any_orthonormal_vector());
    (n, t.extend(tangent.w))
}

/// Derivatives of position with respect to u and v over a triangle, times twice its area in texture space
/// (so that degenerate triangles weigh nothing).
fn texture_derivatives(p: [Vec3; 3], uv: [Vec2; 3]) -> (Vec3, Vec3) {
    let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
    let (d1, d2) = (uv[1] - uv[0], uv[2] - uv[0]);
    let orientation = if d1.perp_dot(d2) < 0.0 { -1.0 } else { 1.0 };
    (orientation * (e1 * d2.y - e2 * d1.y), orientation * (e2 * d1.x - e1 * d2.x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::head::Vertex;

    /// A unit square in the XY plane facing +Z whose texture is upright (v down).
    fn square() -> Mesh {
        let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let points = vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
        let vertices = points
            .iter()
            .enumerate()
            .map(|(i, p)| Vertex { point: i as u32, uv: Vec2::new(p.x, 1.0 - p.y) })
            .collect();
        Mesh { points, vertices, triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() }
    }

    #[test]
    fn a_plane_has_the_frame_of_its_texture() {
        let mesh = square();
        let normals = point_normals(&mesh, &mesh.points);
        assert!(normals.iter().all(|n| n.abs_diff_eq(Vec3::Z, 1e-6)));
        let tangents = vertex_tangents(&mesh, &mesh.points, &normals);
        assert!(tangents.iter().all(|t| t.abs_diff_eq(Vec4::new(1.0, 0.0, 0.0, 1.0), 1e-6)), "{tangents:?}");
    }

    #[test]
    fn normals_of_the_author_lean_as_they_did_at_rest() {
        let mut head = Head { mesh: square(), ..Head::default() };
        assert!(normal_bends(&head).is_empty());
        let leaning = Vec3::new(0.6, 0.0, 0.8);
        head.authored.normals = vec![leaning, Vec3::ZERO, -Vec3::Z];
        let bends = normal_bends(&head);
        assert_eq!(bends[1..], [[0.0; 2]; 3], "what has none, and what has no direction to lean to");
        let frame = |turn: glam::Quat| {
            let points: Vec<Vec3> = head.mesh.points.iter().map(|p| turn * *p).collect();
            let normals = point_normals(&head.mesh, &points);
            bent(normals[0], vertex_tangents(&head.mesh, &points, &normals)[0], bends[0])
        };
        assert!(frame(glam::Quat::IDENTITY).0.abs_diff_eq(leaning, 1e-6));
        let turn = glam::Quat::from_rotation_y(0.7) * glam::Quat::from_rotation_x(-0.4);
        let (n, t) = frame(turn);
        assert!(n.abs_diff_eq(turn * leaning, 1e-6));
        assert!(t.truncate().abs_diff_eq(turn * Vec3::new(0.8, 0.0, -0.6), 1e-6) && t.w == 1.0);
    }

    #[test]
    fn normals_follow_the_deformation() {
        let mesh = square();
        let lift = BlendShape {
            name: "lift".into(),
            points: vec![1, 2],
            offsets: vec![Vec3::new(0.0, 0.0, 1.0); 2],
            ..BlendShape::default()
        };
        let points = deform_points(&mesh, &[lift], &[1.0]);
        let slope = Vec3::new(-1.0, 0.0, 1.0).normalize();
        assert!(point_normals(&mesh, &points).iter().all(|n| n.abs_diff_eq(slope, 1e-6)));
    }
}
