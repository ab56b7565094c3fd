//! Curvature of points on the CPU, in f64, from the definition: least squares by a general inverse, rotations by
//! quaternions.

use glam::{DMat3, DQuat, DVec3, Vec3};
use rubor_rig::deform::point_normals;
use rubor_rig::head::Mesh;

/// Tensors of the points, 1/mm, after a number of means over neighbours.
pub(super) fn curvatures(mesh: &Mesh, points: &[Vec3], means: usize) -> Vec<DMat3> {
    let normals: Vec<DVec3> = point_normals(mesh, points).iter().map(|n| n.as_dvec3()).collect();
    // Neighbours once for each triangle, as the ring of triangles has them.
    let mut neighbours = vec![Vec::new(); points.len()];
    for triangle in &mesh.triangles {
        let corners = triangle.map(|v| mesh.vertices[v as usize].point as usize);
        for (k, p) in corners.into_iter().enumerate() {
            neighbours[p].extend([corners[(k + 1) % 3], corners[(k + 2) % 3]]);
        }
    }
    let mut tensors: Vec<DMat3> =
        (0..points.len()).map(|p| fitted(p, &neighbours[p], points, &normals)).collect();
    for _ in 0..means {
        let mean = |p: usize| {
            if neighbours[p].is_empty() {
                return tensors[p];
            }
            let turned = |q: &usize| {
                let rotation = DMat3::from_quat(DQuat::from_rotation_arc(normals[*q], normals[p]));
                rotation * tensors[*q] * rotation.transpose()
            };
            let sum = neighbours[p].iter().map(turned).fold(DMat3::ZERO, |a, b| a + b);
            (sum + 0.5 * neighbours[p].len() as f64 * tensors[p]) * (1.0 / (1.5 * neighbours[p].len() as f64))
        };
        tensors = (0..points.len()).map(mean).collect();
    }
    tensors
}

fn fitted(point: usize, neighbours: &[usize], points: &[Vec3], normals: &[DVec3]) -> DMat3 {
    let normal = normals[point];
    let (t, b) = normal.any_orthonormal_pair();
    let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
    let (mut left, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for other in neighbours {
        let way = 1e3 * (points[*other] - points[point]).as_dvec3();
        let turn = normals[*other] - normal;
        let weight = 1.0 / way.length_squared().max(1e-8);
        // S e = d, a row for each component.
        for (row, d) in [
            (DVec3::new(way.dot(t), way.dot(b), 0.0), turn.dot(t)),
            (DVec3::new(0.0, way.dot(t), way.dot(b)), turn.dot(b)),
        ] {
            left += weight * outer(row, row);
            right += weight * d * row;
        }
    }
    let edges = left.x_axis.x + left.z_axis.z;
    if left.determinant() <= 1e-4 * edges.powi(3) {
        return DMat3::ZERO;
    }
    let s = left.inverse() * right;
    s.x * outer(t, t) + s.y * (outer(t, b) + outer(b, t)) + s.z * outer(b, b)
}

/// Principal curvatures of a tensor, the larger first: the eigenvalues that are not that of the normal.
pub(super) fn principal(tensor: &DMat3) -> [f64; 2] {
    let trace = tensor.x_axis.x + tensor.y_axis.y + tensor.z_axis.z;
    let squares = tensor.to_cols_array().iter().map(|v| v * v).sum::<f64>();
    let spread = (0.5 * squares - 0.25 * trace * trace).max(0.0).sqrt();
    [0.5 * trace + spread, 0.5 * trace - spread]
}
