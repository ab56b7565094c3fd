//! Meshes of a scene: where their points come from, what deforms them, where they stand.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::ascii::scene::{Data, MeshData, NodeId, Plug, PolyCube, Scene, Transform};
use crate::error::Fault;

/// Deepest deformer stack that is followed: more is a cycle.
const DEEPEST: usize = 256;

/// The history of a mesh.
#[derive(Debug, Default)]
pub(super) struct History {
    /// Node that has the undeformed points.
    pub(super) base: Option<NodeId>,
    /// Blend shapes and the index of this geometry in them, the last one in the chain first.
    pub(super) blend_shapes: Vec<(NodeId, u32)>,
    /// Nodes on the way that are not read.
    pub(super) ignored: Vec<NodeId>,
}

/// Follows the geometry of a mesh up to its undeformed points.
pub(super) fn history(scene: &Scene, mesh: NodeId) -> History {
    let mut history = History::default();
    let mut at = mesh;
    let mut source = scene.source(mesh, "i");
    for _ in 0..DEEPEST {
        let Some(Plug { node, attribute }) = source else {
            history.base = Some(at);
            return history;
        };
        at = *node;
        let index = index_of(attribute);
        match (&scene.nodes[at].data, scene.nodes[at].kind.as_str()) {
            (Data::Mesh(data), _) => {
                if !data.points.is_empty() {
                    history.base = Some(at);
                    return history;
                }
                source = scene.source(at, "i");
            }
            (Data::PolyCube(_), _) => {
                history.base = Some(at);
                return history;
            }
            (Data::BlendShape(_), _) => {
                history.blend_shapes.push((at, index));
                source = scene.source(at, &format!("ip[{index}].ig"));
            }
            (_, "groupParts") => source = scene.source(at, "ig"),
            (_, kind) => {
                if kind != "tweak" {
                    history.ignored.push(at);
                }
                let deformer = format!("ip[{index}].ig");
                source = scene.source(at, &deformer).or_else(|| scene.source(at, "ig"));
                if source.is_none() {
                    // A construction node: the points are made by it.
                    history.base = Some(at);
                    return history;
                }
            }
        }
    }
    history
}

/// The index of `og[3]`, 0 for `og`.
fn index_of(attribute: &str) -> u32 {
    let inner = attribute.rsplit_once('[').and_then(|(_, rest)| rest.strip_suffix(']'));
    inner.and_then(|i| i.parse().ok()).unwrap_or(0)
}

/// Polygons in the space of the mesh, metres.
#[derive(Clone, Debug, Default)]
pub(super) struct Polygons {
    pub(super) points: Vec<[f32; 3]>,
    pub(super) uvs: Vec<[f32; 2]>,
    /// Corners of each face: point and texture coordinate (`u32::MAX`: none).
    pub(super) faces: Vec<Vec<[u32; 2]>>,
}

/// The polygons of a node that [`history`] ends at.
pub(super) fn polygons(scene: &Scene, base: NodeId) -> Result<Polygons, Fault> {
    let node = &scene.nodes[base];
    let wrong = |found: String, expected: &str| Err(Fault::new(node.line, found, expected));
    match &node.data {
        Data::Mesh(mesh) if !mesh.points.is_empty() => of_mesh(mesh, &scene.path(base), node.line),
        Data::Mesh(_) => wrong(format!("the mesh {} without points", scene.path(base)), "a mesh with points"),
        Data::PolyCube(cube) if cube.segments == [1; 3] => Ok(of_cube(cube)),
        _ => wrong(
            format!("geometry that the construction node {} ({}) makes", node.name, node.kind),
            "stored points: in Maya, delete the history of the mesh (Edit > Delete by Type > Non-Deformer History)",
        ),
    }
}

/// Points with their tweaks.
pub(super) fn points(scene: &Scene, base: NodeId) -> Option<Vec<[f32; 3]>> {
    match &scene.nodes[base].data {
        Data::Mesh(mesh) => Some(tweaked(mesh)),
        Data::PolyCube(cube) => Some(of_cube(cube).points),
        _ => None,
    }
}

fn tweaked(mesh: &MeshData) -> Vec<[f32; 3]> {
    let mut points = mesh.points.clone();
    for (index, tweak) in &mesh.tweaks {
        if let Some(point) = points.get_mut(*index as usize) {
            point.iter_mut().zip(tweak).for_each(|(p, t)| *p += t);
        }
    }
    points
}

fn of_mesh(mesh: &MeshData, path: &str, line: usize) -> Result<Polygons, Fault> {
    let points = tweaked(mesh);
    let current = mesh.current_uv_set.as_deref();
    let set = (mesh.uv_sets.iter().find(|(_, s)| Some(s.name.as_str()) == current))
        .or_else(|| mesh.uv_sets.iter().next())
        .map(|(index, _)| *index)
        .unwrap_or_default();
    let uvs = mesh.uv_sets.get(&set).map(|s| s.uvs.clone()).unwrap_or_default();
    let corner_uvs = mesh.corner_uvs.get(&set);
    if let Some(e) = mesh.edges.iter().position(|ends| ends.iter().any(|p| *p as usize >= points.len())) {
        let found = format!("{path}, edge {e}: point {}", mesh.edges[e][0].max(mesh.edges[e][1]));
        return Err(Fault::new(line, found, format!("a point below {}", points.len())));
    }
    let mut faces = Vec::with_capacity(mesh.face_ends.len());
    let mut start = 0;
    for (f, end) in mesh.face_ends.iter().enumerate() {
        let mut face = Vec::with_capacity((*end as usize).saturating_sub(start));
        for corner in start..*end as usize {
            let written = mesh.corners[corner];
            let (edge, side) =
                if written < 0 { (-(i64::from(written) + 1), 1) } else { (i64::from(written), 0) };
            let fail = |found: String, expected: String| {
                Fault::new(line, format!("{path}, face {f}: {found}"), expected)
            };
            let Some(ends) = mesh.edges.get(edge as usize) else {
                return Err(fail(format!("edge {edge}"), format!("an edge below {}", mesh.edges.len())));
            };
            let point = ends[side];
            let uv = corner_uvs.and_then(|c| c.get(corner)).copied().unwrap_or(u32::MAX);
            if uv != u32::MAX && uv as usize >= uvs.len() {
                let expected = format!("a texture coordinate below {}", uvs.len());
                return Err(fail(format!("texture coordinate {uv}"), expected));
            }
            face.push([point, uv]);
        }
        start = *end as usize;
        faces.push(face);
    }
    Ok(Polygons { points, uvs, faces })
}

/// Maya's cube of one segment a side: points in rows of x, from bottom front over the top to bottom back.
fn of_cube(cube: &PolyCube) -> Polygons {
    let [w, h, d] = cube.size_m.map(|s| (0.5 * s) as f32);
    let mut points = Vec::with_capacity(8);
    for [y, z] in [[-h, d], [h, d], [h, -d], [-h, -d]] {
        points.push([-w, y, z]);
        points.push([w, y, z]);
    }
    let quads = [[0, 1, 3, 2], [2, 3, 5, 4], [4, 5, 7, 6], [6, 7, 1, 0], [1, 7, 5, 3], [6, 0, 2, 4]];
    let faces = quads.iter().map(|q| q.iter().map(|p| [*p, u32::MAX]).collect()).collect();
    Polygons { points, uvs: Vec::new(), faces }
}

/// Local matrix of a transform, column vectors, centimetres: translation, pivots, orientation, rotation, scale in
/// Maya's order (documentation of the transform node).
pub(super) fn local_matrix(t: &Transform) -> DAffine3 {
    let move_by = |v: [f64; 3]| DAffine3::from_translation(DVec3::from(v));
    let back = |v: [f64; 3]| DAffine3::from_translation(-DVec3::from(v));
    let turn = |angles: [f64; 3], order: u8| DAffine3::from_quat(rotation(angles, order));
    move_by(t.translate_cm)
        * move_by(t.rotate_pivot_translate_cm)
        * move_by(t.rotate_pivot_cm)
        * turn(t.joint_orient, 0)
        * turn(t.rotate, t.order)
        * turn(t.rotate_axis, 0)
        * back(t.rotate_pivot_cm)
        * move_by(t.scale_pivot_translate_cm)
        * move_by(t.scale_pivot_cm)
        * DAffine3::from_mat3(DMat3::from_diagonal(DVec3::from(t.scale)))
        * back(t.scale_pivot_cm)
}

/// Rotation by Euler angles in radians; `order` as in [`Transform::order`].
pub(super) fn rotation(angles: [f64; 3], order: u8) -> DQuat {
    let axis = |i: usize| match i {
        0 => DQuat::from_rotation_x(angles[0]),
        1 => DQuat::from_rotation_y(angles[1]),
        _ => DQuat::from_rotation_z(angles[2]),
    };
    let [first, second, third] =
        [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]][usize::from(order.min(5))];
    axis(third) * axis(second) * axis(first)
}

/// World matrix of a node, with some transforms replaced.
pub(super) fn world_matrix(
    scene: &Scene,
    node: NodeId,
    replaced: &dyn Fn(NodeId) -> Option<DAffine3>,
) -> DAffine3 {
    let mut matrix = DAffine3::IDENTITY;
    let mut at = Some(node);
    while let Some(id) = at {
        if let Some(transform) = scene.transform(id) {
            matrix = replaced(id).unwrap_or_else(|| local_matrix(transform)) * matrix;
        }
        at = scene.nodes[id].parent;
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pivots_keep_their_place_and_orders_differ() {
        let t = Transform {
            translate_cm: [1.0, 2.0, 3.0],
            rotate: [0.3, -0.2, 0.9],
            scale: [2.0, 2.0, 2.0],
            rotate_pivot_cm: [5.0, 0.0, 0.0],
            scale_pivot_cm: [5.0, 0.0, 0.0],
            ..Transform::default()
        };
        let pivot = DVec3::new(5.0, 0.0, 0.0);
        let moved = local_matrix(&t).transform_point3(pivot);
        assert!((moved - (pivot + DVec3::new(1.0, 2.0, 3.0))).length() < 1e-12);
        // xyz: x acts first. A quarter turn about x, then about z, takes +Y over +Z to +Z.
        let quarter = std::f64::consts::FRAC_PI_2;
        let xyz = rotation([quarter, 0.0, quarter], 0) * DVec3::Y;
        assert!((xyz - DVec3::Z).length() < 1e-12, "{xyz}");
        let zyx = rotation([quarter, 0.0, quarter], 5) * DVec3::Y;
        assert!((zyx - DVec3::NEG_X).length() < 1e-12, "{zyx}");
        // zxy is the order of a sequence's head: yaw times pitch times roll.
        let ours = rotation([0.2, 0.5, -0.4], 2);
        let expected = DQuat::from_euler(glam::EulerRot::YXZ, 0.5, 0.2, -0.4);
        assert!(ours.dot(expected).abs() > 1.0 - 1e-12);
    }
}
