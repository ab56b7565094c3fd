//! Meshes of a scene: where their points come from, what deforms them, where they stand.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::ascii::scene::{Data, MeshData, NodeId, Plug, PolyCube, Scene, Transform};
use crate::error::Fault;
use crate::notes::Notes;

/// Deepest deformer stack that is followed: more is a cycle.
const DEEPEST: usize = 256;

/// Most paths to one mesh.
const MOST_PATHS: usize = 10_000;

/// One place of a mesh in the scene: it has several if it is instanced.
#[derive(Clone, Debug)]
pub(super) struct Instance {
    pub(super) mesh: NodeId,
    /// 0 for the mesh itself.
    pub(super) number: usize,
    /// Nodes above the mesh, the nearest first.
    pub(super) above: Vec<NodeId>,
}

impl Instance {
    /// `|group|head|headShape`.
    pub(super) fn path(&self, scene: &Scene) -> String {
        let mut path = String::new();
        for node in self.above.iter().rev().chain([&self.mesh]) {
            path.push('|');
            path.push_str(&scene.nodes[*node].name);
        }
        path
    }

    /// Name of the nearest transform.
    pub(super) fn name<'s>(&self, scene: &'s Scene) -> &'s str {
        &scene.nodes[self.above.first().copied().unwrap_or(self.mesh)].name
    }
}

/// The places of a mesh. The parser lets no node stand above itself, so this ends.
pub(super) fn instances(scene: &Scene, mesh: NodeId) -> Result<Vec<Instance>, Fault> {
    let mut found = Vec::new();
    let mut open = vec![(mesh, Vec::new())];
    while let Some((node, above)) = open.pop() {
        if found.len() + open.len() > MOST_PATHS || above.len() > 4 * DEEPEST {
            let found = format!("{} instances of {}", found.len() + open.len(), scene.nodes[mesh].name);
            return Err(Fault::new(scene.nodes[mesh].line, found, format!("at most {MOST_PATHS}")));
        }
        let this = &scene.nodes[node];
        if this.parent.is_none() && this.other_parents.is_empty() {
            found.push(Instance { mesh, number: found.len(), above });
            continue;
        }
        for parent in this.other_parents.iter().rev().chain(&this.parent) {
            let mut above: Vec<NodeId> = above.clone();
            above.push(*parent);
            open.push((*parent, above));
        }
    }
    Ok(found)
}

/// The history of a mesh.
#[derive(Debug, Default)]
pub(super) struct History {
    /// Node that has the undeformed points.
    pub(super) base: Option<NodeId>,
    /// Blend shapes and the index of this geometry in them, the last one in the chain first.
    pub(super) blend_shapes: Vec<(NodeId, u32)>,
    /// Meshes and tweak nodes that move points on the way, and the index of this geometry in them.
    pub(super) tweaks: Vec<(NodeId, u32)>,
    /// Nodes on the way that are not read.
    pub(super) ignored: Vec<NodeId>,
}

/// Follows the geometry of a mesh up to its undeformed points.
pub(super) fn history(scene: &Scene, mesh: NodeId) -> History {
    let mut history = History::default();
    let mut at = mesh;
    let mut source = scene.source(mesh, "i");
    for _ in 0..DEEPEST {
        // With a tweak node a mesh keeps its tweaks there.
        if scene.mesh(at).is_some_and(|m| !m.tweaks.is_empty()) && scene.source(at, "twl").is_none() {
            history.tweaks.push((at, 0));
        }
        let Some(Plug { node, attribute }) = source else {
            history.base = Some(at);
            return history;
        };
        at = *node;
        let index = index_of(attribute);
        let this = &scene.nodes[at];
        match (&this.data, this.kind.as_str()) {
            (Data::Mesh(data), _) => {
                if !data.points.is_empty() {
                    history.base = Some(at);
                    let own = !data.tweaks.is_empty() && scene.source(at, "twl").is_none();
                    history.tweaks.extend(own.then_some((at, 0)));
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
            (data, _) => {
                if matches!(data, Data::Tweak(_)) {
                    history.tweaks.push((at, index));
                } else if !(this.is_off() || this.envelope == 0.0 && scene.source(at, "en").is_none()) {
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

/// The polygons at the beginning of a history, points where the tweaks of that history move them.
pub(super) fn polygons(scene: &Scene, history: &History, notes: &mut Notes) -> Result<Polygons, Fault> {
    let Some(base) = history.base else { return Err(Fault::new(1, "a history in a circle", "a beginning")) };
    let node = &scene.nodes[base];
    let wrong = |found: String, expected: &str| Err(Fault::new(node.line, found, expected));
    let mut polygons = match &node.data {
        Data::Mesh(mesh) if !mesh.points.is_empty() => of_mesh(mesh, &scene.path(base), node.line)?,
        Data::Mesh(_) => {
            return wrong(format!("the mesh {} without points", scene.path(base)), "a mesh with points");
        }
        Data::PolyCube(cube) if cube.segments == [1; 3] => of_cube(cube),
        _ => {
            return wrong(
                format!("geometry that the construction node {} ({}) makes", node.name, node.kind),
                "stored points: in Maya, delete the history of the mesh (Edit > Delete by Type > Non-Deformer History)",
            );
        }
    };
    tweak(scene, history, &mut polygons.points, notes);
    Ok(polygons)
}

/// The points of a history, moved by its tweaks.
pub(super) fn points(scene: &Scene, history: &History, notes: &mut Notes) -> Option<Vec<[f32; 3]>> {
    let mut points = match &scene.nodes[history.base?].data {
        Data::Mesh(mesh) => mesh.points.clone(),
        Data::PolyCube(cube) => of_cube(cube).points,
        _ => return None,
    };
    tweak(scene, history, &mut points, notes);
    Some(points)
}

/// Moves points as meshes and tweak nodes of a history say. Moves add up, so their order does not matter.
fn tweak(scene: &Scene, history: &History, points: &mut [[f32; 3]], notes: &mut Notes) {
    for (id, geometry) in &history.tweaks {
        let node = &scene.nodes[*id];
        let (moves, envelope) = match &node.data {
            Data::Mesh(mesh) => (Some(&mesh.tweaks), 1.0),
            Data::Tweak(_) if node.is_off() => {
                notes.about("node states that switch a node off", format!("{} ({})", node.name, node.kind));
                continue;
            }
            Data::Tweak(tweak) if !tweak.relative => {
                notes.about("tweaks that are places and not moves were left out", node.name.clone());
                continue;
            }
            Data::Tweak(tweak) => (tweak.moves.get(geometry), node.envelope),
            _ => continue,
        };
        if envelope != 1.0 {
            notes.about("the envelope of a tweak scales its moves", format!("{} ({envelope})", node.name));
        }
        for (index, tweak) in moves.into_iter().flatten() {
            match points.get_mut(*index as usize) {
                Some(point) => {
                    point.iter_mut().zip(tweak).for_each(|(p, t)| *p += (f64::from(*t) * envelope) as f32);
                }
                None => notes.about("tweaks of points that the mesh does not have", node.name.clone()),
            }
        }
        let moving = |to: &str| ["pt[", "vt[", "vl[", "pl[", "en"].iter().any(|start| to.starts_with(start));
        if let Some((from, _)) = scene.inputs(*id).find(|(_, to)| moving(&to.attribute)) {
            let source = &scene.nodes[from.node];
            let name = format!("{} by {} ({})", node.name, source.name, source.kind);
            notes.about("driven tweaks are not followed, their stored values count", name);
        }
    }
}

fn of_mesh(mesh: &MeshData, path: &str, line: usize) -> Result<Polygons, Fault> {
    let points = mesh.points.clone();
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

/// Local matrix of a transform, column vectors, centimetres: offset of the parent, translation, pivots, orientation,
/// rotation, shear, scale in Maya's order (documentation of the transform node, which has row vectors).
pub(super) fn local_matrix(t: &Transform) -> DAffine3 {
    let move_by = |v: [f64; 3]| DAffine3::from_translation(DVec3::from(v));
    let back = |v: [f64; 3]| DAffine3::from_translation(-DVec3::from(v));
    let turn = |angles: [f64; 3], order: u8| DAffine3::from_quat(rotation(angles, order));
    let offset = t.offset_parent.map_or(DAffine3::IDENTITY, |m| DAffine3 {
        matrix3: DMat3::from_cols(
            DVec3::new(m[0], m[1], m[2]),
            DVec3::new(m[4], m[5], m[6]),
            DVec3::new(m[8], m[9], m[10]),
        ),
        translation: DVec3::new(m[12], m[13], m[14]),
    });
    let [xy, xz, yz] = t.shear;
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(xy, 1.0, 0.0), DVec3::new(xz, yz, 1.0));
    offset
        * move_by(t.translate_cm)
        * move_by(t.rotate_pivot_translate_cm)
        * move_by(t.rotate_pivot_cm)
        * turn(t.joint_orient, 0)
        * turn(t.rotate, t.order)
        * turn(t.rotate_axis, 0)
        * back(t.rotate_pivot_cm)
        * move_by(t.scale_pivot_translate_cm)
        * move_by(t.scale_pivot_cm)
        * DAffine3::from_mat3(shear)
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

/// World matrix of an instance, with some transforms replaced.
pub(super) fn world_matrix(
    scene: &Scene,
    instance: &Instance,
    replaced: &dyn Fn(NodeId) -> Option<DAffine3>,
) -> DAffine3 {
    let mut matrix = DAffine3::IDENTITY;
    for id in &instance.above {
        let Some(transform) = scene.transform(*id) else { continue };
        matrix = replaced(*id).unwrap_or_else(|| local_matrix(transform)) * matrix;
        if !transform.inherits {
            break;
        }
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
