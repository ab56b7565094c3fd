use glam::{Vec2, Vec3};

use super::*;

/// A cube of edge 2 about the origin; each face has texture coordinates of its own.
fn cube() -> PolyMesh {
    let points = (0..8)
        .map(|i| Vec3::new([-1.0, 1.0][i & 1], [-1.0, 1.0][i >> 1 & 1], [-1.0, 1.0][i >> 2 & 1]))
        .collect();
    let mut mesh = PolyMesh { points, ..PolyMesh::default() };
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let group = mesh.group("cube");
    for face in faces {
        let first = mesh.uvs.len() as u32;
        mesh.uvs.extend([Vec2::new(0.0, 0.0), Vec2::new(1.0, 0.0), Vec2::new(1.0, 1.0), Vec2::new(0.0, 1.0)]);
        mesh.push_face((0..4).map(|k| Corner { point: face[k as usize], uv: first + k }), group);
    }
    mesh
}

/// A flat grid of n x n quads over the unit square.
fn grid(n: u32) -> PolyMesh {
    let mut mesh = PolyMesh::default();
    for y in 0..=n {
        for x in 0..=n {
            let uv = Vec2::new(x as f32, y as f32) / n as f32;
            mesh.points.push(uv.extend(0.0));
            mesh.uvs.push(uv);
        }
    }
    let group = mesh.group("grid");
    for y in 0..n {
        for x in 0..n {
            let at = |x: u32, y: u32| {
                let i = y * (n + 1) + x;
                Corner { point: i, uv: i }
            };
            mesh.push_face([at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)], group);
        }
    }
    mesh
}

fn area(mesh: &PolyMesh) -> f32 {
    let at = |c: &Corner| mesh.points[c.point as usize];
    let fan = |f: &[Corner]| -> f32 {
        (2..f.len()).map(|k| (at(&f[k - 1]) - at(&f[0])).cross(at(&f[k]) - at(&f[0])).length() / 2.0).sum()
    };
    mesh.faces().map(fan).sum()
}

#[test]
fn a_subdivided_cube_is_the_published_one() {
    let (once, _) = cube().subdivide(&[]);
    assert_eq!((once.points.len(), once.face_count()), (8 + 12 + 6, 24));
    // Valence 3: (Q + 2R + 0 S) / 3 with Q = 1/3, R = 2/3 of the corner: 5/9.
    assert!(once.points[7].abs_diff_eq(Vec3::splat(5.0 / 9.0), 1e-6), "{}", once.points[7]);
    // Edge points: mean of two ends and two face centres.
    assert!(once.points[8..20].iter().all(|p| (p.abs().element_sum() - 1.5).abs() < 1e-6));
    assert!(once.points[20..].iter().all(|p| (p.length() - 1.0).abs() < 1e-6));
    // Texture islands keep their outline.
    assert_eq!(once.uvs[..24], cube().uvs[..]);
}

#[test]
fn shapes_are_subdivided_like_the_mesh_they_make() {
    let mesh = cube();
    let offsets: Vec<Vec3> = (0..8).map(|i| Vec3::new(0.1 * i as f32, (i as f32).sin(), 0.3)).collect();
    let mut deformed = mesh.clone();
    deformed.points.iter_mut().zip(&offsets).for_each(|(p, o)| *p += *o);
    let (once, shapes) = mesh.subdivide(&[Shape { name: "s".into(), offsets }]);
    let (expected, _) = deformed.subdivide(&[]);
    for ((p, o), e) in once.points.iter().zip(&shapes[0].offsets).zip(&expected.points) {
        assert!((*p + *o).abs_diff_eq(*e, 1e-5));
    }
}

#[test]
fn a_flat_grid_stays_flat_and_inside_its_border() {
    let (once, _) = grid(4).subdivide(&[]);
    assert!(once.points.iter().all(|p| p.z == 0.0));
    // Inner texture coordinates of a regular grid do not move.
    assert_eq!(once.face_count(), 64);
    assert!(once.faces().all(|f| f.len() == 4));
    // Rounded corners cost a little area.
    assert!((0.98..1.0).contains(&area(&once)), "{}", area(&once));
}

#[test]
fn clipping_keeps_the_right_side_and_its_texture() {
    let mesh = grid(10);
    for cut in [0.31, 0.35, 0.39, 0.5, 0.999] {
        let keep: Vec<f32> = mesh.points.iter().map(|p| cut - p.x - 0.1 * p.y).collect();
        let shape = Shape { name: "x".into(), offsets: mesh.points.clone() };
        let (clipped, shapes) = mesh.clip(&keep, &[shape]);
        // The line x = cut - 0.1 y: a trapezium.
        let exact = cut - 0.05;
        assert!((area(&clipped) - exact).abs() < 1e-4, "{cut}: {}", area(&clipped));
        for corner in &clipped.corners {
            let p = clipped.points[corner.point as usize];
            assert!(cut - p.x - 0.1 * p.y > -1e-5, "{p} lies outside");
            assert!(
                clipped.uvs[corner.uv as usize].extend(0.0).abs_diff_eq(p, 1e-5),
                "texture left its point"
            );
            assert!(shapes[0].offsets[corner.point as usize].abs_diff_eq(p, 1e-5), "shape left its point");
        }
    }
}

#[test]
fn islands_are_found() {
    let labels = cube().uv_islands();
    assert_eq!(labels.iter().collect::<std::collections::BTreeSet<_>>().len(), 6);
    assert!(grid(3).uv_islands().iter().all(|l| *l == 0));
}
