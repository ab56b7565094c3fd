//! Whether two files of a set are one mesh: faces are compared, as the order of points alone cannot tell.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use glam::Vec2;

use crate::poly::PolyMesh;

/// How the points of a shape belong to those of the neutral mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Match {
    /// In the same order.
    Order,
    /// In the same order by their faces; texture coordinates are others.
    OrderWithOtherUvs,
    /// Faces correspond in order, points do not: shape point of each neutral point, `None` where no face has it.
    ByFaces(Vec<Option<u32>>),
    /// Neither corresponds in order, texture coordinates do: the same.
    ByUvs(Vec<Option<u32>>),
    /// The shape has no faces to compare.
    NoFaces,
    /// Different meshes; the first face of the shape that the neutral mesh does not have.
    Different(usize),
}

/// Comparisons of faces before two meshes count as different: points that very many faces share are no head.
const MOST_COMPARISONS: usize = 50_000_000;

/// Parts of the texture's side that texture coordinates are told apart by: files have six digits.
const UV_STEPS: f32 = 1e5;

/// Compares two meshes with the same number of points.
///
/// A symmetric mesh can pass for itself under another numbering, so faces and texture coordinates that correspond count
/// for more than faces that exist.
pub(super) fn compare(neutral: &PolyMesh, shape: &PolyMesh) -> Match {
    if shape.face_count() == 0 {
        return Match::NoFaces;
    }
    let points = |mesh: &PolyMesh| -> Vec<u32> { mesh.corners.iter().map(|c| c.point).collect() };
    let (of_neutral, of_shape) = (points(neutral), points(shape));
    if of_neutral == of_shape && neutral.face_starts == shape.face_starts {
        return Match::Order;
    }
    if neutral.face_starts == shape.face_starts {
        let pairs = of_neutral.into_iter().zip(of_shape);
        if let Some(shape_of) = bijection(neutral.points.len(), pairs) {
            return Match::ByFaces(shape_of);
        }
    }
    let mut left = MOST_COMPARISONS;
    // Files may list faces by material, begin them at another corner, or have cut them into triangles.
    let mut one_mesh = |shape: &PolyMesh| {
        let outside = first_outside(shape, neutral, &mut left);
        outside.filter(|_| first_outside(neutral, shape, &mut left).is_some())
    };
    let by_uvs = by_uvs(neutral, shape);
    if let Some(shape_of) = &by_uvs {
        let mut renamed = shape.clone();
        let mut neutral_of = vec![u32::MAX; shape.points.len()];
        for (p, of) in shape_of.iter().enumerate() {
            of.iter().for_each(|q| neutral_of[*q as usize] = p as u32);
        }
        renamed.corners.iter_mut().for_each(|c| c.point = neutral_of[c.point as usize]);
        let known = renamed.corners.iter().all(|c| c.point != u32::MAX);
        if known && one_mesh(&renamed).is_none() {
            let in_order = shape_of.iter().enumerate().all(|(p, q)| q.is_none_or(|q| q as usize == p));
            return if in_order { Match::Order } else { Match::ByUvs(shape_of.clone()) };
        }
    }
    match one_mesh(shape) {
        Some(face) => Match::Different(face),
        None if uvs_differ(neutral, shape) => Match::OrderWithOtherUvs,
        None => Match::Order,
    }
}

/// Second of each first, if no first has two and no second belongs to two.
fn bijection(count: usize, pairs: impl Iterator<Item = (u32, u32)>) -> Option<Vec<Option<u32>>> {
    let mut second_of: Vec<Option<u32>> = vec![None; count];
    let mut first_of: HashMap<u32, u32> = HashMap::new();
    for (a, b) in pairs {
        if *second_of[a as usize].get_or_insert(b) != b || *first_of.entry(b).or_insert(a) != a {
            return None;
        }
    }
    Some(second_of)
}

/// Texture coordinates of each point that has corners.
fn uvs_of_points(mesh: &PolyMesh) -> BTreeMap<u32, BTreeSet<[i64; 2]>> {
    let mut uvs: BTreeMap<u32, BTreeSet<[i64; 2]>> = BTreeMap::new();
    for corner in &mesh.corners {
        let uv = mesh.uvs[corner.uv as usize].to_array().map(|c| (c * UV_STEPS).round() as i64);
        uvs.entry(corner.point).or_default().insert(uv);
    }
    uvs
}

/// Shape point of each neutral point by the texture coordinates of its corners; `None` where points share them all.
fn by_uvs(neutral: &PolyMesh, shape: &PolyMesh) -> Option<Vec<Option<u32>>> {
    let mut shape_of: HashMap<BTreeSet<[i64; 2]>, u32> = HashMap::new();
    for (point, uvs) in uvs_of_points(shape) {
        if shape_of.insert(uvs, point).is_some() {
            return None;
        }
    }
    let mut found = vec![None; neutral.points.len()];
    for (point, uvs) in uvs_of_points(neutral) {
        found[point as usize] = Some(shape_of.remove(&uvs)?);
    }
    Some(found)
}

/// Whether both have texture coordinates, and others at the same points.
fn uvs_differ(neutral: &PolyMesh, shape: &PolyMesh) -> bool {
    let has_uvs = |mesh: &PolyMesh| mesh.corners.iter().any(|c| mesh.uvs[c.uv as usize] != Vec2::ZERO);
    has_uvs(neutral) && has_uvs(shape) && uvs_of_points(neutral) != uvs_of_points(shape)
}

/// The first face of `a` whose points are not all of one face of `b`.
fn first_outside(a: &PolyMesh, b: &PolyMesh, left: &mut usize) -> Option<usize> {
    let mut faces_of: Vec<Vec<u32>> = vec![Vec::new(); b.points.len()];
    for (f, face) in b.faces().enumerate() {
        for corner in face {
            faces_of[corner.point as usize].push(f as u32);
        }
    }
    (0..a.face_count()).find(|f| {
        let points: HashSet<u32> = a.face(*f).iter().map(|c| c.point).collect();
        let fewest = points.iter().map(|p| &faces_of[*p as usize]).min_by_key(|faces| faces.len());
        let is_inside = fewest.is_some_and(|faces| {
            faces.iter().any(|g| {
                let face = b.face(*g as usize);
                *left = left.saturating_sub(face.len());
                *left > 0 && points.iter().all(|p| face.iter().any(|c| c.point == *p))
            })
        });
        !is_inside
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::poly::Corner;

    fn mesh(faces: &[&[u32]]) -> PolyMesh {
        let mut mesh = PolyMesh { points: vec![Vec3::ZERO; 6], uvs: vec![Vec2::ZERO], ..PolyMesh::default() };
        let group = mesh.group("g");
        for face in faces {
            mesh.push_face(face.iter().map(|p| Corner { point: *p, uv: 0 }), group);
        }
        mesh
    }

    #[test]
    fn order_of_faces_first_corners_and_triangles_do_not_matter() {
        let neutral = mesh(&[&[0, 1, 2, 3], &[3, 2, 4]]);
        for same in [
            mesh(&[&[0, 1, 2, 3], &[3, 2, 4]]),
            mesh(&[&[2, 4, 3], &[1, 2, 3, 0]]),
            mesh(&[&[0, 1, 2], &[0, 2, 3], &[3, 2, 4]]),
            mesh(&[&[3, 2, 1, 0], &[4, 2, 3]]),
        ] {
            assert_eq!(compare(&neutral, &same), Match::Order);
            assert_eq!(compare(&same, &neutral), Match::Order);
        }
    }

    #[test]
    fn another_order_of_points_is_matched_by_faces_or_told() {
        let neutral = mesh(&[&[0, 1, 2, 3], &[3, 2, 4]]);
        let renamed = mesh(&[&[5, 1, 0, 2], &[2, 0, 3]]);
        let expected = [Some(5), Some(1), Some(0), Some(2), Some(3), None];
        assert_eq!(compare(&neutral, &renamed), Match::ByFaces(expected.to_vec()));
        assert_eq!(compare(&neutral, &mesh(&[&[5, 1, 0, 2], &[2, 4, 3]])), Match::Different(0));
        assert_eq!(compare(&neutral, &mesh(&[&[0, 1, 2, 3], &[5, 2, 4]])), Match::Different(1));
        assert_eq!(compare(&neutral, &mesh(&[&[2, 0, 3], &[5, 1, 0, 2]])), Match::Different(1));
        assert_eq!(compare(&neutral, &mesh(&[])), Match::NoFaces);
    }

    #[test]
    fn a_symmetric_mesh_under_another_numbering_is_not_taken_for_itself() {
        // A strip of two quads that looks the same from its other end.
        let mut neutral = mesh(&[&[0, 1, 4, 3], &[1, 2, 5, 4]]);
        neutral.uvs = (0..6).map(|i| Vec2::new((i % 3) as f32 / 2.0, (i / 3) as f32)).collect();
        neutral.corners.iter_mut().for_each(|c| c.uv = c.point);
        let mut turned = mesh(&[&[4, 3, 0, 1], &[5, 4, 1, 2]]);
        turned.uvs.clone_from(&neutral.uvs);
        turned.corners.iter_mut().for_each(|c| c.uv = 5 - c.point);
        let expected: Vec<Option<u32>> = (0..6).rev().map(Some).collect();
        assert_eq!(compare(&neutral, &turned), Match::ByUvs(expected));
        // Other texture coordinates altogether say nothing about points.
        turned.uvs.iter_mut().for_each(|uv| *uv *= 0.5);
        assert_eq!(compare(&neutral, &turned), Match::OrderWithOtherUvs);
    }
}
