//! From polygons to a [`Head`].

use std::collections::HashMap;

use glam::Vec3;
use rubor_rig::head::{BlendShape, Head, Material, Mesh, Part, Vertex};

use super::{Corner, PolyMesh, Shape, triangulate};

/// Which group becomes which part: (group, name of the part, material), in the order of the parts.
/// Groups with the same part name are merged; groups not named here are dropped.
pub type HeadParts<'a> = &'a [(&'a str, &'a str, Material)];

/// Triangulates the groups of `parts` by [`triangulate`], drops unused points and offsets not longer than `threshold`. Returns the head and the new index of each old point (`u32::MAX` when dropped).
pub fn build_head(
    mesh: &PolyMesh,
    shapes: &[Shape],
    parts: HeadParts<'_>,
    threshold: f32,
) -> (Head, Vec<u32>) {
    let mut new_point = vec![u32::MAX; mesh.points.len()];
    let mut out = Mesh::default();
    for (i, (_, part_name, material)) in parts.iter().enumerate() {
        if parts[..i].iter().any(|p| p.1 == *part_name) {
            continue;
        }
        let start = out.triangles.len() as u32;
        let mut vertex_of: HashMap<(u32, u32), u32> = HashMap::new(); // parts share points, not vertices
        let members: Vec<bool> =
            mesh.groups.iter().map(|g| parts.iter().any(|p| p.0 == g && p.1 == *part_name)).collect();
        for f in (0..mesh.face_count()).filter(|f| members[mesh.face_groups[*f] as usize]) {
            let mut vertex = |c: Corner| {
                let point = &mut new_point[c.point as usize];
                if *point == u32::MAX {
                    *point = out.points.len() as u32;
                    out.points.push(mesh.points[c.point as usize]);
                }
                *vertex_of.entry((c.point, c.uv)).or_insert_with(|| {
                    out.vertices.push(Vertex { point: *point, uv: mesh.uvs[c.uv as usize] });
                    out.vertices.len() as u32 - 1
                })
            };
            let face = mesh.face(f);
            let corners: Vec<u32> = face.iter().map(|c| vertex(*c)).collect();
            let places: Vec<Vec3> = face.iter().map(|c| mesh.points[c.point as usize]).collect();
            out.triangles.extend(triangulate(&places).iter().map(|t| t.map(|k| corners[k as usize])));
        }
        let end = out.triangles.len() as u32;
        if end > start {
            out.parts.push(Part {
                name: (*part_name).to_owned(),
                material: *material,
                triangles: start..end,
            });
        }
    }
    let shapes = shapes.iter().map(|s| sparse(s, &new_point, threshold)).collect();
    (Head { mesh: out, shapes, ..Head::default() }, new_point)
}

fn sparse(shape: &Shape, new_point: &[u32], threshold: f32) -> BlendShape {
    let mut moved: Vec<(u32, Vec3)> = (shape.offsets.iter().zip(new_point))
        .filter(|(offset, point)| **point != u32::MAX && offset.length() > threshold)
        .map(|(offset, point)| (*point, *offset))
        .collect();
    moved.sort_unstable_by_key(|(p, _)| *p);
    let (points, offsets) = moved.into_iter().unzip();
    BlendShape { name: shape.name.clone(), points, offsets, ..BlendShape::default() }
}
