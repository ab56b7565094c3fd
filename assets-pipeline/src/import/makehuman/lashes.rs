//! Texture coordinates of the lash strips: u along the lid, v from root to tip.

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use super::eyes::Eye;
use crate::poly::PolyMesh;

/// Gives every lash group (a regular grid of quads) coordinates of its own.
pub(super) fn assign_texture_coordinates(mesh: &mut PolyMesh, eyes: &[Eye]) {
    for (group, eye) in [
        ("helper-l-eyelashes-1", 0),
        ("helper-l-eyelashes-2", 0),
        ("helper-r-eyelashes-1", 1),
        ("helper-r-eyelashes-2", 1),
    ] {
        let Some(group) = mesh.groups.iter().position(|g| g == group) else { continue };
        let faces: Vec<usize> =
            (0..mesh.face_count()).filter(|f| mesh.face_groups[*f] == group as u32).collect();
        let grid = grid_coordinates(mesh, &faces, eyes[eye].center);
        let mut uv_of: HashMap<u32, u32> = HashMap::new();
        for f in faces {
            for k in mesh.face_starts[f]..mesh.face_starts[f + 1] {
                let point = mesh.corners[k as usize].point;
                let uv = *uv_of.entry(point).or_insert_with(|| {
                    mesh.uvs.push(grid.get(&point).copied().unwrap_or_default());
                    mesh.uvs.len() as u32 - 1
                });
                mesh.corners[k as usize].uv = uv;
            }
        }
    }
}

/// Walks the border of a grid of quads: its four corners are the points with one face; of the two long sides the one
/// nearer to the eye is the root. Inside, coordinates follow from the distance in edges to each side.
fn grid_coordinates(mesh: &PolyMesh, faces: &[usize], eye: Vec3) -> HashMap<u32, Vec2> {
    let mut face_count: HashMap<u32, u32> = HashMap::new();
    for c in faces.iter().flat_map(|f| mesh.face(*f)) {
        *face_count.entry(c.point).or_default() += 1;
    }
    let mut border = border_edges(mesh, faces);
    let mut corners: Vec<u32> = face_count.iter().filter(|(_, n)| **n == 1).map(|(p, _)| *p).collect();
    corners.sort_unstable();
    let mut sides = Vec::new();
    for start in &corners {
        let mut side = vec![*start];
        while let Some(p) = side.last().and_then(|p| border.remove(p)) {
            side.push(p);
            if corners.contains(&p) {
                break;
            }
        }
        sides.push(side);
    }
    sides.sort_by_key(|s| std::cmp::Reverse(s.len()));
    let [long_a, long_b, ..] = &sides[..] else { return HashMap::new() };
    let mean_distance = |side: &[u32]| {
        side.iter().map(|p| mesh.points[*p as usize].distance(eye)).sum::<f32>() / side.len() as f32
    };
    let (root, tip) =
        if mean_distance(long_a) < mean_distance(long_b) { (long_a, long_b) } else { (long_b, long_a) };
    let sides: Vec<&[u32]> = sides.iter().skip(2).map(Vec::as_slice).collect();
    let [short_a, short_b, ..] = sides[..] else { return HashMap::new() };
    let (to_root, to_tip) = (edge_distance(mesh, faces, root), edge_distance(mesh, faces, tip));
    let (to_a, to_b) = (edge_distance(mesh, faces, short_a), edge_distance(mesh, faces, short_b));
    let ratio =
        |p: &u32, from: &HashMap<u32, f32>, to: &HashMap<u32, f32>| from[p] / (from[p] + to[p]).max(1.0);
    face_count.keys().map(|p| (*p, Vec2::new(ratio(p, &to_a, &to_b), ratio(p, &to_root, &to_tip)))).collect()
}

/// Directed edges that only one face has, as start -> end.
fn border_edges(mesh: &PolyMesh, faces: &[usize]) -> HashMap<u32, u32> {
    let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
    let directed = |f: &usize| {
        let face = mesh.face(*f);
        (0..face.len()).map(|k| (face[k].point, face[(k + 1) % face.len()].point)).collect::<Vec<_>>()
    };
    for edge in faces.iter().flat_map(directed) {
        *edges.entry(edge).or_default() += 1;
    }
    edges.keys().filter(|(a, b)| !edges.contains_key(&(*b, *a))).copied().collect()
}

/// Number of edges from each point to the nearest of `start`.
fn edge_distance(mesh: &PolyMesh, faces: &[usize], start: &[u32]) -> HashMap<u32, f32> {
    let mut distance: HashMap<u32, f32> = start.iter().map(|p| (*p, 0.0)).collect();
    loop {
        let before = distance.len();
        let reached = distance.clone();
        for f in faces {
            let face = mesh.face(*f);
            for (k, c) in face.iter().enumerate() {
                let n = face[(k + 1) % face.len()].point;
                for (a, b) in [(c.point, n), (n, c.point)] {
                    if let Some(d) = reached.get(&a) {
                        let entry = distance.entry(b).or_insert(d + 1.0);
                        *entry = entry.min(d + 1.0);
                    }
                }
            }
        }
        if distance.len() == before {
            return distance;
        }
    }
}
