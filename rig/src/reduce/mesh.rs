//! Geometry with less: fewer shapes and parts.

use std::collections::BTreeSet;

use super::{Reduction, kept};
use crate::authored::Authored;
use crate::head::{BlendShape, Head, Mesh, OcclusionChange, Part, Vertex};

/// New numbers of what stays of a list.
struct Numbers(Vec<Option<u32>>);

impl Numbers {
    fn of(stays: &[bool]) -> Self {
        let mut next = 0;
        let number = |stays: &bool| {
            next += u32::from(*stays);
            stays.then(|| next - 1)
        };
        Self(stays.iter().map(number).collect())
    }

    fn get(&self, old: u32) -> Option<u32> {
        self.0.get(old as usize).copied().flatten()
    }

    /// The elements that stay; a list may be shorter than the numbers.
    fn filter<T: Clone>(&self, list: &[T]) -> Vec<T> {
        list.iter().zip(&self.0).filter(|(_, number)| number.is_some()).map(|(v, _)| v.clone()).collect()
    }
}

impl Reduction {
    pub(super) fn geometry(&self, head: &Head) -> (Mesh, Vec<BlendShape>, Authored) {
        let shapes: Vec<&BlendShape> =
            kept(head.shapes.len(), &self.shapes).map(|i| &head.shapes[i]).collect();
        let pictures = Authored { images: self.pictures(&head.authored), ..head.authored.clone() };
        if self.parts.range(..head.mesh.parts.len()).next().is_none() {
            return (head.mesh.clone(), shapes.into_iter().cloned().collect(), pictures);
        }
        let (mesh, vertices, points) = without_parts(&head.mesh, &self.parts);
        let shapes = shapes.into_iter().map(|s| on_points(s, &points)).collect();
        let authored = Authored {
            of_parts: kept(head.authored.of_parts.len(), &self.parts)
                .map(|i| head.authored.of_parts[i])
                .collect(),
            second_uvs: vertices.filter(&head.authored.second_uvs),
            colors_linear: vertices.filter(&head.authored.colors_linear),
            normals: vertices.filter(&head.authored.normals),
            ..pictures
        };
        (mesh, shapes, without_unused(authored))
    }
}

/// The mesh without parts, and new numbers of vertices and points. What no part ever used stays.
fn without_parts(mesh: &Mesh, gone: &BTreeSet<usize>) -> (Mesh, Numbers, Numbers) {
    let triangles_of =
        |part: &Part| &mesh.triangles[part.triangles.start as usize..part.triangles.end as usize];
    // Whether what stays and what goes use a vertex or a point.
    let mut vertices = vec![[false; 2]; mesh.vertices.len()];
    let mut points = vec![[false; 2]; mesh.points.len()];
    for (i, part) in mesh.parts.iter().enumerate() {
        for v in triangles_of(part).as_flattened() {
            let goes = usize::from(gone.contains(&i));
            vertices[*v as usize][goes] = true;
            points[mesh.vertices[*v as usize].point as usize][goes] = true;
        }
    }
    for (vertex, used) in mesh.vertices.iter().zip(&vertices) {
        // A vertex that nothing uses stays, and its point with it.
        points[vertex.point as usize][0] |= *used == [false, false];
    }
    let stays = |used: &[bool; 2]| used[0] || !used[1];
    let of = |used: &[[bool; 2]]| Numbers::of(&used.iter().map(stays).collect::<Vec<_>>());
    let (vertices, points) = (of(&vertices), of(&points));
    let mut reduced = Mesh {
        points: points.filter(&mesh.points),
        occlusion: points.filter(&mesh.occlusion),
        vertices: vertices
            .filter(&mesh.vertices)
            .into_iter()
            .filter_map(|v| Some(Vertex { point: points.get(v.point)?, ..v }))
            .collect(),
        ..Mesh::default()
    };
    for part in kept(mesh.parts.len(), gone).map(|i| &mesh.parts[i]) {
        let start = reduced.triangles.len() as u32;
        let corners = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| vertices.get(v));
            Some([a?, b?, c?])
        };
        reduced.triangles.extend(triangles_of(part).iter().filter_map(corners));
        reduced.parts.push(Part { triangles: start..reduced.triangles.len() as u32, ..part.clone() });
    }
    (reduced, vertices, points)
}

fn on_points(shape: &BlendShape, points: &Numbers) -> BlendShape {
    let moved = shape.points.iter().zip(&shape.offsets).filter_map(|(p, o)| Some((points.get(*p)?, *o)));
    let (at, offsets) = moved.unzip();
    let changes = shape.occlusion.iter();
    BlendShape {
        name: shape.name.clone(),
        points: at,
        offsets,
        occlusion: changes
            .filter_map(|c| Some(OcclusionChange { point: points.get(c.point)?, ..*c }))
            .collect(),
    }
}

/// Without the materials of no part and the pictures of no material.
fn without_unused(mut authored: Authored) -> Authored {
    let mut stays = vec![false; authored.materials.len()];
    authored.of_parts.iter().flatten().for_each(|m| stays[*m as usize] = true);
    let materials = Numbers::of(&stays);
    authored.materials = materials.filter(&authored.materials);
    authored.of_parts.iter_mut().for_each(|m| *m = m.and_then(|m| materials.get(m)));
    let mut stays = vec![false; authored.images.len()];
    let textures = authored.materials.iter().flat_map(|m| m.textures()).filter_map(|(_, texture)| texture);
    textures.for_each(|t| stays[t.image as usize] = true);
    let images = Numbers::of(&stays);
    authored.images = images.filter(&authored.images);
    for texture in authored.materials.iter_mut().flat_map(|m| m.textures_mut()).flatten() {
        texture.image = images.get(texture.image).unwrap_or(0);
    }
    authored
}
