//! Coarser surfaces of a head for where it is small in the picture.
//!
//! A level keeps some of the head's vertices, with their texture coordinates, shapes and occlusion, and has fewer triangles
//! between them. Maps, weights and names stay those of the head.

use std::ops::Range;

use glam::Vec3;

use crate::authored::Authored;
use crate::deform::point_normals;
use crate::head::{BlendShape, Head, Mesh, OcclusionChange, Part, SkinMaps, Vertex};

/// Fewer triangles over the vertices of a head.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Distance between its surface and the head's that no more than one point in a hundred exceeds, at rest and with any one
    /// shape at weight 1, metres.
    pub error_metres: f32,
    /// Indices into [`Mesh::vertices`] of the head, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Range of `triangles` of each part of the head, in their order, without gaps.
    pub parts: Vec<Range<u32>>,
    /// For each triangle of the head, the one of `triangles` that its middle is nearest to, in the same part.
    pub hosts: Vec<u32>,
}

/// New indices of what is kept of a list.
struct Kept {
    of_old: Vec<Option<u32>>,
    old: Vec<u32>,
}

impl Kept {
    fn new(count: usize, used: impl Iterator<Item = u32>) -> Self {
        let mut of_old = vec![None; count];
        for i in used {
            of_old[i as usize] = Some(0);
        }
        let mut old = Vec::new();
        for (i, slot) in of_old.iter_mut().enumerate() {
            if let Some(new) = slot {
                *new = old.len() as u32;
                old.push(i as u32);
            }
        }
        Self { of_old, old }
    }

    fn new_of(&self, old: u32) -> Option<u32> {
        self.of_old[old as usize]
    }

    /// What is kept of a list that may end early.
    fn of<T: Clone>(&self, list: &[T]) -> Vec<T> {
        self.old.iter().map_while(|i| list.get(*i as usize).cloned()).collect()
    }
}

impl Head {
    /// Geometry and materials of a level: all shapes with the points that are left, no maps and no pictures. Normals at rest are
    /// those of the whole head.
    ///
    /// # Panics
    /// The level is that of another head.
    pub fn at_level(&self, level: &Level) -> Head {
        let mesh = &self.mesh;
        let vertices = Kept::new(mesh.vertices.len(), level.triangles.iter().flatten().copied());
        let points =
            Kept::new(mesh.points.len(), vertices.old.iter().map(|v| mesh.vertices[*v as usize].point));
        let new_point = |p: u32| points.new_of(p).unwrap_or(0);
        let new_vertex = |v: u32| vertices.new_of(v).unwrap_or(0);
        let part = |(part, range): (&Part, &Range<u32>)| Part { triangles: range.clone(), ..part.clone() };
        let smooth = point_normals(mesh, &mesh.points);
        let normal = |v: &u32| match self.authored.normal(*v) {
            Vec3::ZERO => smooth[mesh.vertices[*v as usize].point as usize],
            authored => authored,
        };
        Head {
            name: self.name.clone(),
            mesh: Mesh {
                points: points.of(&mesh.points),
                occlusion: points.of(&mesh.occlusion),
                vertices: (vertices.of(&mesh.vertices).iter())
                    .map(|v| Vertex { point: new_point(v.point), uv: v.uv })
                    .collect(),
                triangles: level.triangles.iter().map(|t| t.map(new_vertex)).collect(),
                parts: mesh.parts.iter().zip(&level.parts).map(part).collect(),
            },
            shapes: self.shapes.iter().map(|shape| reduced(shape, &points)).collect(),
            maps: SkinMaps::default(),
            authored: Authored {
                images: Vec::new(),
                materials: self.authored.materials.clone(),
                of_parts: self.authored.of_parts.clone(),
                second_uvs: vertices.of(&self.authored.second_uvs),
                colors_linear: vertices.of(&self.authored.colors_linear),
                normals: vertices.old.iter().map(normal).collect(),
            },
            landmarks: self.landmarks.clone(),
            provenance: Vec::new(),
        }
    }
}

fn reduced(shape: &BlendShape, points: &Kept) -> BlendShape {
    let moved = shape.points.iter().zip(&shape.offsets);
    let (kept, offsets) = moved.filter_map(|(p, o)| Some((points.new_of(*p)?, *o))).unzip();
    let occlusion = (shape.occlusion.iter())
        .filter_map(|c| Some(OcclusionChange { point: points.new_of(c.point)?, ..*c }))
        .collect();
    BlendShape { name: shape.name.clone(), points: kept, offsets, occlusion }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::head::Material;

    /// Two squares side by side over six points; the shape moves the last four.
    fn head() -> Head {
        let points: Vec<Vec3> = (0..6).map(|i| Vec3::new((i / 2) as f32, (i % 2) as f32, 0.0)).collect();
        let vertices = (0..6).map(|i| Vertex { point: i, uv: Vec2::new(i as f32, 0.5) }).collect::<Vec<_>>();
        let part = |name: &str, triangles| Part { name: name.into(), material: Material::Skin, triangles };
        Head {
            mesh: Mesh {
                points,
                occlusion: (0..6).map(|i| i as f32 / 10.0).collect(),
                vertices,
                triangles: vec![[0, 2, 1], [2, 3, 1], [2, 4, 3], [4, 5, 3]],
                parts: vec![part("a", 0..2), part("b", 2..4)],
            },
            shapes: vec![BlendShape {
                name: "up".into(),
                points: vec![2, 3, 4, 5],
                offsets: (2..6).map(|i| Vec3::Y * i as f32).collect(),
                occlusion: vec![OcclusionChange { point: 4, at_half: 0.1, at_full: 0.2 }],
            }],
            ..Head::default()
        }
    }

    #[test]
    fn what_is_left_keeps_its_place_and_its_shapes() {
        let head = head();
        let level = Level {
            error_metres: 0.1,
            triangles: vec![[0, 2, 1], [2, 4, 5]],
            parts: vec![0..1, 1..2],
            hosts: vec![0, 0, 1, 1],
        };
        let reduced = head.at_level(&level);
        reduced.validate().unwrap();
        let old = [0, 1, 2, 4, 5];
        assert_eq!(reduced.mesh.points, old.map(|i| head.mesh.points[i]));
        assert_eq!(reduced.mesh.occlusion, old.map(|i| head.mesh.occlusion[i]));
        assert_eq!(reduced.mesh.triangles, [[0, 2, 1], [2, 3, 4]]);
        let uvs: Vec<f32> = reduced.mesh.vertices.iter().map(|v| v.uv.x).collect();
        assert_eq!(uvs, old.map(|i| i as f32));
        let shape = &reduced.shapes[0];
        assert_eq!((shape.points.as_slice(), shape.occlusion[0].point), (&[2u32, 3, 4][..], 3));
        assert_eq!(shape.offsets, [2.0, 4.0, 5.0].map(|y| Vec3::Y * y));
        assert!(reduced.authored.normals.iter().all(|n| n.distance(Vec3::Z) < 1e-6));
    }
}
