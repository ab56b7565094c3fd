//! Catmull-Clark rules as stencils.

use std::collections::HashMap;

use super::Stencils;

/// Treatment of an edge that does not have exactly two faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Border {
    /// A uniform cubic B-spline.
    Smooth,
    /// The border keeps its corners and edges.
    Linear,
}

/// Result of one step.
pub(super) struct Subdivided {
    /// Old points first, then one per edge, then one per face.
    pub(super) stencils: Stencils,
    /// One quad a corner of the old faces, in their order.
    pub(super) quads: Vec<[u32; 4]>,
}

struct Edge {
    ends: [u32; 2],
    faces: Vec<u32>,
}

/// One step for faces given as index ranges into `corners`. An index that no face uses keeps its value.
pub(super) fn catmull_clark(
    count: usize,
    face_starts: &[u32],
    corners: &[u32],
    border: Border,
) -> Subdivided {
    let face_count = face_starts.len() - 1;
    let face = |f: usize| &corners[face_starts[f] as usize..face_starts[f + 1] as usize];
    let mut edge_of: HashMap<[u32; 2], u32> = HashMap::with_capacity(corners.len());
    let mut edges: Vec<Edge> = Vec::with_capacity(corners.len() / 2);
    let mut corner_edges = Vec::with_capacity(corners.len()); // edge from this corner to the next of its face
    for f in 0..face_count {
        let face = face(f);
        for (k, a) in face.iter().enumerate() {
            let b = face[(k + 1) % face.len()];
            let ends = [*a.min(&b), *a.max(&b)];
            let e = *edge_of.entry(ends).or_insert_with(|| {
                edges.push(Edge { ends, faces: Vec::with_capacity(2) });
                edges.len() as u32 - 1
            });
            edges[e as usize].faces.push(f as u32);
            corner_edges.push(e);
        }
    }
    let mut point_edges = vec![Vec::new(); count];
    for (e, edge) in edges.iter().enumerate() {
        for end in edge.ends {
            point_edges[end as usize].push(e as u32);
        }
    }
    let mut point_faces = vec![Vec::new(); count];
    for f in 0..face_count {
        for p in face(f) {
            point_faces[*p as usize].push(f as u32);
        }
    }

    let mut stencils = Stencils::new();
    let mut row = Row::default();
    for p in 0..count as u32 {
        let (p_edges, p_faces) = (&point_edges[p as usize], &point_faces[p as usize]);
        let rim: Vec<u32> = p_edges
            .iter()
            .filter(|e| edges[**e as usize].faces.len() != 2)
            .map(|e| other_end(&edges[*e as usize], p))
            .collect();
        if p_edges.is_empty() || (!rim.is_empty() && (border == Border::Linear || rim.len() != 2)) {
            row.add(p, 1.0);
        } else if let [a, b] = rim[..] {
            row.add(p, 0.75);
            row.add(a, 0.125);
            row.add(b, 0.125);
        } else {
            // (Q + 2 R + (n - 3) S) / n with Q the mean of face points, R of edge midpoints, S the old point.
            let n = p_edges.len() as f32;
            row.add(p, (n - 3.0) / n);
            for e in p_edges {
                row.add(p, 1.0 / (n * n));
                row.add(other_end(&edges[*e as usize], p), 1.0 / (n * n));
            }
            for f in p_faces {
                let face = face(*f as usize);
                let weight = 1.0 / (n * p_faces.len() as f32 * face.len() as f32);
                face.iter().for_each(|q| row.add(*q, weight));
            }
        }
        row.finish(&mut stencils);
    }
    for edge in &edges {
        let middle = if edge.faces.len() == 2 { 0.25 } else { 0.5 };
        edge.ends.iter().for_each(|p| row.add(*p, middle));
        if edge.faces.len() == 2 {
            for f in &edge.faces {
                let face = face(*f as usize);
                face.iter().for_each(|q| row.add(*q, 0.25 / face.len() as f32));
            }
        }
        row.finish(&mut stencils);
    }
    let mut quads = Vec::with_capacity(corners.len());
    let (first_edge, first_face) = (count as u32, (count + edges.len()) as u32);
    for (f, start) in face_starts[..face_count].iter().enumerate() {
        let (face, start) = (face(f), *start as usize);
        face.iter().for_each(|q| row.add(*q, 1.0 / face.len() as f32));
        row.finish(&mut stencils);
        for (k, p) in face.iter().enumerate() {
            let next = corner_edges[start + k];
            let previous = corner_edges[start + (k + face.len() - 1) % face.len()];
            quads.push([*p, first_edge + next, first_face + f as u32, first_edge + previous]);
        }
    }
    Subdivided { stencils, quads }
}

fn other_end(edge: &Edge, p: u32) -> u32 {
    if edge.ends[0] == p { edge.ends[1] } else { edge.ends[0] }
}

/// Collects the weights of one row; repeated indices are summed, in the order of first use.
#[derive(Default)]
struct Row(Vec<(u32, f32)>);

impl Row {
    fn add(&mut self, index: u32, weight: f32) {
        match self.0.iter_mut().find(|(i, _)| *i == index) {
            Some((_, w)) => *w += weight,
            None => self.0.push((index, weight)),
        }
    }

    fn finish(&mut self, stencils: &mut Stencils) {
        stencils.push(self.0.drain(..));
    }
}
