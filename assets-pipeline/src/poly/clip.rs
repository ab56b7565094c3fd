//! Clipping of polygons where a scalar field changes sign (I. Sutherland and G. Hodgman 1974).

use std::collections::HashMap;

use super::{Corner, PolyMesh, Stencils};

/// A crossing closer to the end of its edge than this part of it moves that end onto the cut instead, so that no
/// slivers line the new border.
const SNAP: f32 = 0.2;

/// Returns the part with `keep >= 0` and the stencils of its points over the old ones. Old points keep their indices
/// (those that snap move); points of the cut follow.
pub(super) fn clip(mesh: &PolyMesh, keep: &[f32]) -> (PolyMesh, Stencils) {
    let mut keep = keep.to_vec();
    let mut snap: HashMap<u32, (u32, f32)> = HashMap::new(); // point -> neighbour, part of the way to it
    for face in mesh.faces() {
        for (k, a) in face.iter().enumerate() {
            let b = face[(k + 1) % face.len()];
            for (p, q) in [(a.point, b.point), (b.point, a.point)] {
                let (vp, vq) = (keep[p as usize], keep[q as usize]);
                if (vp < 0.0) != (vq < 0.0) && vp != 0.0 && vq != 0.0 {
                    let t = vp / (vp - vq);
                    if t < SNAP && snap.get(&p).is_none_or(|(_, old)| t < *old) {
                        snap.insert(p, (q, t));
                    }
                }
            }
        }
    }
    for p in snap.keys() {
        keep[*p as usize] = 0.0;
    }

    let mut stencils = Stencils::new();
    for p in 0..mesh.points.len() as u32 {
        match snap.get(&p) {
            Some((q, t)) => stencils.push([(p, 1.0 - t), (*q, *t)]),
            None => stencils.push([(p, 1.0)]),
        }
    }
    let mut out = PolyMesh { uvs: mesh.uvs.clone(), groups: mesh.groups.clone(), ..PolyMesh::default() };
    for face in mesh.faces() {
        // A snapped point slides along its edge; its texture coordinates slide with it in every face that has that edge,
        // and by the same part towards the neighbour's mean elsewhere. Within an island both are the same index.
        for (k, c) in face.iter().enumerate() {
            if let Some((q, t)) = snap.get(&c.point) {
                let next = face[(k + 1) % face.len()];
                let previous = face[(k + face.len() - 1) % face.len()];
                if let Some(n) = [next, previous].iter().find(|n| n.point == *q) {
                    let (own, other) = (mesh.uvs[c.uv as usize], mesh.uvs[n.uv as usize]);
                    out.uvs[c.uv as usize] = own.lerp(other, *t);
                }
            }
        }
    }
    let mut cut_point: HashMap<[u32; 2], u32> = HashMap::new();
    let mut cut_uv: HashMap<[u32; 2], u32> = HashMap::new();
    let mut polygon = Vec::new();
    for f in 0..mesh.face_count() {
        let face = mesh.face(f);
        polygon.clear();
        for (k, a) in face.iter().enumerate() {
            let b = face[(k + 1) % face.len()];
            let (va, vb) = (keep[a.point as usize], keep[b.point as usize]);
            if va >= 0.0 {
                polygon.push(*a);
            }
            if (va < 0.0) != (vb < 0.0) && va != 0.0 && vb != 0.0 {
                let (lo, hi) = if a.point < b.point { (*a, b) } else { (b, *a) };
                let (vlo, vhi) = (keep[lo.point as usize], keep[hi.point as usize]);
                let t = vlo / (vlo - vhi);
                let point = *cut_point.entry([lo.point, hi.point]).or_insert_with(|| {
                    stencils.push([(lo.point, 1.0 - t), (hi.point, t)]);
                    stencils.len() as u32 - 1
                });
                let uv = *cut_uv.entry([lo.uv, hi.uv]).or_insert_with(|| {
                    out.uvs.push(out.uvs[lo.uv as usize].lerp(out.uvs[hi.uv as usize], t));
                    out.uvs.len() as u32 - 1
                });
                polygon.push(Corner { point, uv });
            }
        }
        // A face that only touches the cut has no area inside.
        if polygon.len() >= 3 && polygon.iter().any(|c| keep.get(c.point as usize).is_some_and(|v| *v > 0.0))
        {
            out.push_face(polygon.iter().copied(), mesh.face_groups[f]);
        }
    }
    out.points = stencils.apply(&mesh.points);
    (out, stencils)
}
