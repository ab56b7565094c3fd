//! Groups of neighbouring triangles: bounds of the parts of a deformed head that do not need its points.

use std::collections::HashMap;

use glam::{IVec3, Mat4, Vec3};
use rubor_rig::head::Head;

/// Side of the cells that group triangles, metres.
const CELL_METRES: f32 = 0.015;
/// How far shapes rotate normals, degrees: lids and lips rotate by more, but their clusters contain normals of all
/// directions.
const TURN_DEGREES: f32 = 25.0;

/// Opaque triangles of one cell that face about the same way.
#[derive(Clone, Debug)]
pub(crate) struct Cluster {
    /// Sphere around the points of the neutral head.
    center: Vec3,
    radius: f32,
    /// Middle of the normals, and the cosine of the largest angle from it to a normal, shapes included; -1 where they
    /// point in all directions.
    axis: Vec3,
    cosine: f32,
    /// Shapes that move it, and the distance at weight 1, metres.
    travel: Vec<(usize, f32)>,
}

/// A sphere in world space around a part of a head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sphere {
    pub(crate) center: Vec3,
    pub(crate) radius: f32,
}

/// A viewer of clusters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Viewer {
    pub(crate) position: Vec3,
    pub(crate) clip_from_world: Mat4,
    /// Size of the picture with its margin, relative to the picture.
    pub(crate) margin: f32,
    /// Whether surfaces that face away are included.
    pub(crate) sees_backs: bool,
}

/// Groups the opaque triangles of a head.
pub(crate) fn clusters(head: &Head) -> Vec<Cluster> {
    let mesh = &head.mesh;
    let mut groups: HashMap<(IVec3, usize), Vec<[usize; 3]>> = HashMap::new();
    for part in mesh.parts.iter().filter(|p| p.material.is_opaque()) {
        for t in &mesh.triangles[part.triangles.start as usize..part.triangles.end as usize] {
            let points = t.map(|v| mesh.vertices[v as usize].point as usize);
            let [a, b, c] = points.map(|p| mesh.points[p]);
            let normal = (b - a).cross(c - a);
            let size = normal.abs();
            let axis = if size.x >= size.y && size.x >= size.z {
                0
            } else if size.y >= size.z {
                1
            } else {
                2
            };
            let way = 2 * axis + usize::from(normal[axis] < 0.0);
            let cell = ((a + b + c) / (3.0 * CELL_METRES)).floor().as_ivec3();
            groups.entry((cell, way)).or_default().push(points);
        }
    }
    let mut result: Vec<_> = groups.into_iter().collect();
    result.sort_by_key(|((cell, way), _)| (cell.to_array(), *way));
    let mut clusters: Vec<Cluster> = result.iter().map(|(_, triangles)| cluster(head, triangles)).collect();
    // Which clusters a point belongs to, for the travel of shapes.
    let mut of_point = vec![Vec::new(); mesh.points.len()];
    for (i, (_, triangles)) in result.iter().enumerate() {
        for p in triangles.iter().flatten() {
            if of_point[*p].last() != Some(&i) {
                of_point[*p].push(i);
            }
        }
    }
    for (index, shape) in head.shapes.iter().enumerate() {
        for (p, offset) in shape.points.iter().zip(&shape.offsets) {
            for i in &of_point[*p as usize] {
                let travel = &mut clusters[*i].travel;
                match travel.last_mut() {
                    Some((last, metres)) if *last == index => *metres = metres.max(offset.length()),
                    _ => travel.push((index, offset.length())),
                }
            }
        }
    }
    clusters
}

fn cluster(head: &Head, triangles: &[[usize; 3]]) -> Cluster {
    let points = &head.mesh.points;
    let corners = triangles.iter().flatten().map(|p| points[*p]);
    let low = corners.clone().fold(Vec3::INFINITY, Vec3::min);
    let high = corners.clone().fold(Vec3::NEG_INFINITY, Vec3::max);
    let center = 0.5 * (low + high);
    let radius = corners.map(|p| p.distance(center)).fold(0.0, f32::max);
    let normals = triangles.iter().map(|t| {
        let [a, b, c] = t.map(|p| points[p]);
        (b - a).cross(c - a).normalize_or_zero()
    });
    let axis = normals.clone().sum::<Vec3>().normalize_or_zero();
    let widest = normals.map(|n| n.dot(axis).clamp(-1.0, 1.0).acos()).fold(0.0, f32::max);
    let cosine = (widest + TURN_DEGREES.to_radians()).min(std::f32::consts::PI).cos();
    Cluster { center, radius, axis, cosine, travel: Vec::new() }
}

/// Spheres around what a viewer can see of a head in a pose.
pub(crate) fn visible(
    clusters: &[Cluster],
    shape_weights: &[f32],
    world_from_head: Mat4,
    viewer: &Viewer,
) -> Vec<Sphere> {
    let rows = viewer.clip_from_world.transpose();
    // Planes of the picture's four sides (inside is positive) with unit normals, and that of the camera.
    let planes = [
        viewer.margin * rows.w_axis + rows.x_axis,
        viewer.margin * rows.w_axis - rows.x_axis,
        viewer.margin * rows.w_axis + rows.y_axis,
        viewer.margin * rows.w_axis - rows.y_axis,
        rows.w_axis,
    ]
    .map(|p| p / p.truncate().length().max(1e-12));
    clusters
        .iter()
        .filter_map(|c| {
            let travel: f32 = c
                .travel
                .iter()
                .map(|(shape, metres)| shape_weights.get(*shape).map_or(0.0, |w| w.abs() * metres))
                .sum();
            let center = world_from_head.transform_point3(c.center);
            let radius = c.radius + travel;
            if planes.iter().any(|p| p.dot(center.extend(1.0)) < -radius) {
                return None;
            }
            let way = viewer.position - center;
            let distance = way.length();
            if !viewer.sees_backs && c.cosine > 0.0 && distance > radius {
                // Seen from any point in the sphere, the viewer is within asin(radius / distance) of this direction.
                let spread = (radius / distance).asin() + c.cosine.acos();
                let away = world_from_head.transform_vector3(c.axis).dot(way / distance);
                if away < (std::f32::consts::FRAC_PI_2 + spread).min(std::f32::consts::PI).cos() {
                    return None;
                }
            }
            Some(Sphere { center, radius })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;
    use glam::camera::rh::{proj, view};
    use rubor_rig::head::{BlendShape, Material, Mesh, Part, Vertex};

    /// A ball of 8 cm radius; shape 0 pulls its top up by 2 cm.
    fn ball() -> Head {
        const N: u32 = 48;
        let mut mesh = Mesh::default();
        for y in 0..=N {
            for x in 0..N {
                let (theta, phi) =
                    (y as f32 / N as f32 * std::f32::consts::PI, x as f32 / N as f32 * std::f32::consts::TAU);
                mesh.points
                    .push(0.08 * Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos()));
                mesh.vertices.push(Vertex { point: y * N + x, uv: Vec2::ZERO });
            }
        }
        for y in 0..N {
            for x in 0..N {
                let at = |x: u32, y: u32| y * N + x % N;
                mesh.triangles.push([at(x, y), at(x, y + 1), at(x + 1, y)]);
                mesh.triangles.push([at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)]);
            }
        }
        let triangles = 0..mesh.triangles.len() as u32;
        mesh.parts.push(Part { name: "ball".into(), material: Material::Skin, triangles });
        let top: Vec<u32> =
            (0..mesh.points.len() as u32).filter(|p| mesh.points[*p as usize].y > 0.06).collect();
        let offsets = top.iter().map(|p| (mesh.points[*p as usize].y - 0.06) * Vec3::Y).collect();
        let shapes = vec![BlendShape { name: "top".into(), points: top, offsets, ..BlendShape::default() }];
        Head { mesh, shapes, ..Head::default() }
    }

    fn viewer(fov_degrees: f32, target: Vec3) -> Viewer {
        let position = Vec3::new(0.0, 0.0, 0.5);
        let projection = proj::directx::perspective_infinite_reverse(fov_degrees.to_radians(), 1.0, 0.01);
        Viewer {
            position,
            clip_from_world: projection * view::look_at_mat4(position, target, Vec3::Y),
            margin: 1.0,
            sees_backs: false,
        }
    }

    #[test]
    fn what_is_seen_is_in_a_sphere_and_what_is_not_seen_is_mostly_left_out() {
        let head = ball();
        let clusters = clusters(&head);
        for (fov, target) in [(40.0, Vec3::ZERO), (4.0, Vec3::ZERO), (4.0, Vec3::new(0.05, 0.05, 0.0))] {
            let viewer = viewer(fov, target);
            for weight in [0.0, 1.0, -0.5] {
                let spheres = visible(&clusters, &[weight], Mat4::IDENTITY, &viewer);
                assert!(spheres.len() < clusters.len(), "{} of {}", spheres.len(), clusters.len());
                let mut points = head.mesh.points.clone();
                for (p, offset) in head.shapes[0].points.iter().zip(&head.shapes[0].offsets) {
                    points[*p as usize] += weight * *offset;
                }
                let normals = rubor_rig::deform::point_normals(&head.mesh, &points);
                for (p, n) in points.iter().zip(normals) {
                    let clip = viewer.clip_from_world * p.extend(1.0);
                    let is_seen =
                        clip.x.abs() < clip.w && clip.y.abs() < clip.w && n.dot(viewer.position - *p) > 0.0;
                    let is_held = spheres.iter().any(|s| s.center.distance(*p) <= s.radius + 1e-6);
                    assert!(is_held || !is_seen, "{p} at {weight}");
                }
            }
        }
        let few = visible(&clusters, &[0.0], Mat4::IDENTITY, &viewer(4.0, Vec3::ZERO)).len();
        assert!(few > 0 && few < clusters.len() / 5, "{few} of {}", clusters.len());
        let all = Viewer { sees_backs: true, ..viewer(40.0, Vec3::ZERO) };
        assert_eq!(visible(&clusters, &[0.0], Mat4::IDENTITY, &all).len(), clusters.len());
    }
}
