//! Whether two files of a set are one mesh: faces are compared, as the order of points alone cannot tell.

use std::collections::{HashMap, HashSet};

use crate::poly::PolyMesh;

/// How the points of a shape belong to those of the neutral mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Match {
    /// In the same order.
    Order,
    /// Faces correspond in order, points do not: shape point of each neutral point, `None` where no face has it.
    ByFaces(Vec<Option<u32>>),
    /// The shape has no faces to compare.
    NoFaces,
    /// Different meshes; the first face of the shape that the neutral mesh does not have.
    Different(usize),
}

/// Comparisons of faces before two meshes count as different: points that very many faces share are no head.
const MOST_COMPARISONS: usize = 50_000_000;

/// Compares two meshes with the same number of points.
pub(super) fn compare(neutral: &PolyMesh, shape: &PolyMesh) -> Match {
    if shape.face_count() == 0 {
        return Match::NoFaces;
    }
    let points = |mesh: &PolyMesh| -> Vec<u32> { mesh.corners.iter().map(|c| c.point).collect() };
    let (of_neutral, of_shape) = (points(neutral), points(shape));
    if of_neutral == of_shape && neutral.face_starts == shape.face_starts {
        return Match::Order;
    }
    // Files may list faces by material, begin them at another corner, or have cut them into triangles.
    let mut left = MOST_COMPARISONS;
    let unknown = first_outside(shape, neutral, &mut left);
    let Some(face) = unknown else { return Match::Order };
    if first_outside(neutral, shape, &mut left).is_none() {
        return Match::Order;
    }
    if neutral.face_starts != shape.face_starts {
        return Match::Different(face);
    }
    let mut shape_of: Vec<Option<u32>> = vec![None; neutral.points.len()];
    let mut neutral_of: HashMap<u32, u32> = HashMap::new();
    for (a, b) in of_neutral.into_iter().zip(of_shape) {
        if *shape_of[a as usize].get_or_insert(b) != b || *neutral_of.entry(b).or_insert(a) != a {
            return Match::Different(face);
        }
    }
    Match::ByFaces(shape_of)
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
    use glam::{Vec2, Vec3};

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
}
