//! Made-up parts: rows of teeth, lash cards, a head's worth of pieces in one mesh.

use super::*;
use rubor_rig::head::{BlendShape, Mesh, Vertex};

/// Appends a box, and a part for it.
fn cuboid(mesh: &mut Mesh, center: Vec3, half: Vec3) {
    let first = mesh.points.len() as u32;
    for i in 0..8 {
        let s = Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0;
        mesh.points.push(center + s * half);
        mesh.vertices.push(Vertex { point: first + i, uv: Vec2::new(3.0, 0.25) });
    }
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        mesh.triangles.push([a, b, c].map(|k: u32| first + k));
        mesh.triangles.push([a, c, d].map(|k| first + k));
    }
}

/// Two rows of 14 boxes on an arch; the lower row moves with the jaw.
fn teeth() -> Head {
    let mut head = Head::default();
    let mut jaw = BlendShape { name: "jawOpen".into(), ..BlendShape::default() };
    for upper in [true, false] {
        for k in 0..14 {
            let angle = (k as f32 - 6.5) * 0.21;
            let (sin, cos) = angle.sin_cos();
            let center = Vec3::new(0.028 * sin, if upper { 0.0 } else { -0.012 }, 0.03 * cos);
            let first = head.mesh.points.len() as u32;
            cuboid(&mut head.mesh, center, Vec3::new(0.0028, 0.008, 0.002));
            if !upper {
                jaw.points.extend(first..first + 8);
                jaw.offsets.extend([Vec3::new(0.0, -0.02, 0.0); 8]);
            }
        }
    }
    let triangles = 0..head.mesh.triangles.len() as u32;
    head.mesh.parts.push(Part { name: "M_Teeth".into(), material: Material::Teeth, triangles });
    head.shapes.push(jaw);
    head
}

#[test]
fn single_teeth_lie_within_the_teeth_that_are_painted() {
    let mut head = teeth();
    fit_coordinates(&mut head, false);
    head.validate().unwrap();
    for (i, v) in head.mesh.vertices.iter().enumerate() {
        let upper = i < 14 * 8;
        let height_mm = 100.0 * (v.uv.y - 0.5).abs();
        assert!(height_mm < 1e-3 || (v.uv.y > 0.5) == upper, "{v:?}");
        assert!(height_mm < 6.5, "no gums are painted on a tooth: {height_mm}");
        // The biting edge is where v says so.
        let place = head.mesh.points[v.point as usize];
        assert_eq!(height_mm < 3.0, (place.y > if upper { 0.0 } else { -0.012 }) != upper);
        assert_eq!(v.uv.x > 0.0, place.x > 0.0 || (place.x.abs() < 0.004 && v.uv.x > 0.0));
        // Not on a seam: the nearest border between teeth is over half a millimetre away.
        let along = 100.0 * v.uv.x.abs();
        let borders =
            if upper { [8.5, 15.0, 22.6, 29.7, 36.5, 46.5] } else { [5.2, 10.9, 17.7, 24.7, 31.8, 42.8] };
        assert!(borders.iter().all(|b| (along - b).abs() > 0.5), "{along} mm");
    }
}

#[test]
fn rows_without_a_jaw_are_told_by_their_height_and_bands_are_measured() {
    let mut head = teeth();
    head.shapes.clear();
    fit_coordinates(&mut head, false);
    assert!(head.mesh.vertices[2].uv.y > 0.5 && head.mesh.vertices[14 * 8].uv.y < 0.5);
    // One mesh: joined by a triangle between each two boxes.
    let mut head = teeth();
    for k in 1..14 {
        head.mesh.triangles.push([8 * k - 8, 8 * k, 8 * k + 1]);
        head.mesh.triangles.push([8 * k + 104, 8 * k + 112, 8 * k + 113]);
    }
    head.mesh.parts[0].triangles = 0..head.mesh.triangles.len() as u32;
    fit_coordinates(&mut head, false);
    let edge = |v: &Vertex| 100.0 * (v.uv.y - 0.5).abs();
    let heights: Vec<f32> = head.mesh.vertices[..8].iter().map(edge).collect();
    assert!(
        heights.iter().any(|h| *h < 0.1) && heights.iter().any(|h| (*h - 16.0).abs() < 0.2),
        "{heights:?}"
    );
}

/// Lash cards of one eye: `layers` on each other above, one below; `u` of the file runs from tip to root.
fn lashes(layers: usize) -> Head {
    let mut head = Head::default();
    for (layer, y) in (0..layers).map(|l| (l, 0.003)).chain([(9, -0.006)]) {
        let first = head.mesh.points.len() as u32;
        for i in 0..=12u32 {
            for j in 0..=4u32 {
                let (a, b) = (i as f32 / 12.0, j as f32 / 4.0);
                let x = 0.02 + 0.03 * a;
                let z = 0.05 + 0.009 * b - 20.0 * (x - 0.035).powi(2);
                let sign = if y > 0.0 { 1.0 } else { -1.0 };
                head.mesh.points.push(Vec3::new(x, y + sign * 0.004 * b * b, z) + 1e-5 * layer as f32);
                let uv = Vec2::new(6.9 - 0.2 * b, 0.1 + 0.8 * a);
                head.mesh.vertices.push(Vertex { point: head.mesh.points.len() as u32 - 1, uv });
            }
        }
        for i in 0..12 {
            for j in 0..4 {
                let a = first + i * 5 + j;
                head.mesh.triangles.extend([[a, a + 5, a + 6], [a, a + 6, a + 1]]);
            }
        }
    }
    let triangles = 0..head.mesh.triangles.len() as u32;
    head.mesh.parts.push(Part { name: "M_EyeLashes".into(), material: Material::Lash, triangles });
    head
}

#[test]
fn lash_cards_of_any_layout_become_hairs_of_one_fringe() {
    let mut head = lashes(3);
    let notes = fit_coordinates(&mut head, false);
    head.validate().unwrap();
    assert!(notes.iter().any(|n| n.message.contains("lie on each other")), "{notes:?}");
    let names: Vec<(&str, Material)> =
        head.mesh.parts.iter().map(|p| (p.name.as_str(), p.material)).collect();
    assert_eq!(names.iter().filter(|n| n.1 == Material::Hidden).count(), 2, "{names:?}");
    let hairs: Vec<&str> = names.iter().filter(|n| n.1 == Material::Lash).map(|n| n.0).collect();
    assert_eq!(hairs, ["M_EyeLashes left upper", "M_EyeLashes left lower"]);
    for part in head.mesh.parts.iter().filter(|p| p.material == Material::Lash) {
        let vertices: HashSet<u32> = head.mesh.triangles
            [part.triangles.start as usize..part.triangles.end as usize]
            .iter()
            .flatten()
            .copied()
            .collect();
        // Hairs are told from cards by u; roots lie behind tips.
        let mean = |root: bool| {
            let of: Vec<f32> = (vertices.iter().map(|v| head.mesh.vertices[*v as usize]))
                .filter(|v| v.uv.x >= 2.0 && (v.uv.y < 0.01) == root)
                .map(|v| head.mesh.points[v.point as usize].z)
                .collect();
            of.iter().sum::<f32>() / of.len() as f32
        };
        assert!(mean(true) < mean(false), "{}: roots {} tips {}", part.name, mean(true), mean(false));
    }
}

#[test]
fn pieces_of_a_part_that_touch_at_a_place_hang_together() {
    let mut head = Head::default();
    cuboid(&mut head.mesh, Vec3::ZERO, Vec3::ONE);
    cuboid(&mut head.mesh, Vec3::new(2.0, 0.0, 0.0), Vec3::ONE);
    cuboid(&mut head.mesh, Vec3::new(9.0, 0.0, 0.0), Vec3::ONE);
    head.mesh.parts.push(Part { name: "x".into(), material: Material::Other, triangles: 0..36 });
    let found = components(&head, 0);
    assert_eq!(found.iter().map(|c| c.triangles.len()).collect::<Vec<_>>(), [24, 12]);
    split_part(
        &mut head,
        0,
        found.iter().rev().map(|c| (String::new(), Material::Eye, c.triangles.clone())).collect(),
    );
    assert_eq!(head.mesh.parts.iter().map(|p| p.triangles.clone()).collect::<Vec<_>>(), [0..12, 12..36]);
    head.validate().unwrap();
}
