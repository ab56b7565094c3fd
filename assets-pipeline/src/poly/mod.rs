//! Polygon meshes, which importers work on before they make a `Head`.
//!
//! ```text
//! OBJ, base mesh --> PolyMesh + Shape --subdivide, clip (as stencils)--> PolyMesh + Shape --build--> Head
//! ```
//!
//! Every change of topology is a matrix of [`Stencils`]: new value = weighted sum of old ones.
//! The same matrix moves positions and shape offsets, so shapes stay exact under subdivision and clipping.

mod build;
mod clip;
mod stencil;
mod subdivide;
mod triangulate;

use glam::{Vec2, Vec3};

pub use build::{HeadParts, build_head};
pub use stencil::Stencils;
pub use triangulate::{MOST_CORNERS, triangulate};

/// Corner of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    /// Index into [`PolyMesh::points`].
    pub point: u32,
    /// Index into [`PolyMesh::uvs`].
    pub uv: u32,
}

/// Polygons with separate indices for positions and texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct PolyMesh {
    /// Positions.
    pub points: Vec<Vec3>,
    /// Texture coordinates, glTF convention (v grows downwards).
    pub uvs: Vec<Vec2>,
    /// Start of each face in `corners`, and the end of the last one.
    pub face_starts: Vec<u32>,
    /// Corners of all faces, counter-clockwise seen from outside.
    pub corners: Vec<Corner>,
    /// Index into `groups` of each face.
    pub face_groups: Vec<u32>,
    /// Names of groups or materials.
    pub groups: Vec<String>,
}

/// Offsets of one shape for every point of a [`PolyMesh`].
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Name of the shape.
    pub name: String,
    /// One offset a point.
    pub offsets: Vec<Vec3>,
}

impl Default for PolyMesh {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            uvs: Vec::new(),
            face_starts: vec![0],
            corners: Vec::new(),
            face_groups: Vec::new(),
            groups: Vec::new(),
        }
    }
}

impl PolyMesh {
    /// Number of faces.
    pub fn face_count(&self) -> usize {
        self.face_groups.len()
    }

    /// Corners of a face.
    pub fn face(&self, f: usize) -> &[Corner] {
        &self.corners[self.face_starts[f] as usize..self.face_starts[f + 1] as usize]
    }

    /// Faces in order.
    pub fn faces(&self) -> impl Iterator<Item = &[Corner]> {
        (0..self.face_count()).map(|f| self.face(f))
    }

    /// Appends a face.
    pub fn push_face(&mut self, corners: impl IntoIterator<Item = Corner>, group: u32) {
        self.corners.extend(corners);
        self.face_starts.push(self.corners.len() as u32);
        self.face_groups.push(group);
    }

    /// Index of a group, added if new.
    pub fn group(&mut self, name: &str) -> u32 {
        match self.groups.iter().position(|g| g == name) {
            Some(i) => i as u32,
            None => {
                self.groups.push(name.to_owned());
                self.groups.len() as u32 - 1
            }
        }
    }

    /// Keeps the faces for which `keep` holds. Points and texture coordinates stay (unused ones are dropped when
    /// the head is built), so indices into them remain valid.
    pub fn retain_faces(&mut self, mut keep: impl FnMut(&Self, usize) -> bool) {
        let kept: Vec<usize> = (0..self.face_count()).filter(|f| keep(self, *f)).collect();
        let mut face_starts = vec![0];
        let mut corners = Vec::new();
        for f in &kept {
            corners.extend_from_slice(self.face(*f));
            face_starts.push(corners.len() as u32);
        }
        self.face_groups = kept.iter().map(|f| self.face_groups[*f]).collect();
        self.face_starts = face_starts;
        self.corners = corners;
    }

    /// Label of each texture coordinate: those joined by faces share one. Unused ones are alone.
    pub fn uv_islands(&self) -> Vec<u32> {
        let mut parent: Vec<u32> = (0..self.uvs.len() as u32).collect();
        fn root(parent: &mut [u32], mut i: u32) -> u32 {
            while parent[i as usize] != i {
                parent[i as usize] = parent[parent[i as usize] as usize];
                i = parent[i as usize];
            }
            i
        }
        for face in self.faces() {
            for pair in face.windows(2) {
                let (a, b) = (root(&mut parent, pair[0].uv), root(&mut parent, pair[1].uv));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        (0..parent.len() as u32).map(|i| root(&mut parent, i)).collect()
    }

    /// One Catmull-Clark step of the mesh and its shapes (E. Catmull and J. Clark 1978; boundary curves as uniform
    /// cubic B-splines, H. Biermann et al. 2000). The old points keep their indices.
    ///
    /// Texture coordinates are smoothed inside an island and linear along its border, so islands keep their outline
    /// and cannot come to overlap there.
    pub fn subdivide(&self, shapes: &[Shape]) -> (PolyMesh, Vec<Shape>) {
        let points_of: Vec<u32> = self.corners.iter().map(|c| c.point).collect();
        let uvs_of: Vec<u32> = self.corners.iter().map(|c| c.uv).collect();
        let points = subdivide::catmull_clark(
            self.points.len(),
            &self.face_starts,
            &points_of,
            subdivide::Border::Smooth,
        );
        let uvs =
            subdivide::catmull_clark(self.uvs.len(), &self.face_starts, &uvs_of, subdivide::Border::Linear);
        let face_groups = (0..self.face_count())
            .flat_map(|f| std::iter::repeat_n(self.face_groups[f], self.face(f).len()))
            .collect();
        let mesh = PolyMesh {
            points: points.stencils.apply(&self.points),
            uvs: uvs.stencils.apply(&self.uvs),
            face_starts: (0..=points.quads.len() as u32).map(|f| f * 4).collect(),
            corners: (points.quads.as_flattened().iter().zip(uvs.quads.as_flattened()))
                .map(|(point, uv)| Corner { point: *point, uv: *uv })
                .collect(),
            face_groups,
            groups: self.groups.clone(),
        };
        (mesh, move_shapes(shapes, &points.stencils))
    }

    /// Cuts away where `keep` is negative; `keep` has one value per point and is linear along edges.
    pub fn clip(&self, keep: &[f32], shapes: &[Shape]) -> (PolyMesh, Vec<Shape>) {
        let (mesh, stencils) = clip::clip(self, keep);
        let shapes = move_shapes(shapes, &stencils);
        (mesh, shapes)
    }
}

#[cfg(test)]
mod tests;

fn move_shapes(shapes: &[Shape], stencils: &Stencils) -> Vec<Shape> {
    let moved = |s: &Shape| Shape { name: s.name.clone(), offsets: stencils.apply(&s.offsets) };
    shapes.iter().map(moved).collect()
}
