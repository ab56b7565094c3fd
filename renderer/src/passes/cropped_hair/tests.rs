use rubor_rig::head::{Material, Part, Vertex};
use rubor_rig::map::Map;

use super::*;
use crate::testing::{assert_layout, offsets, validated_workgroups};
use crate::tests::dome;

/// The dome with hair on the half of its texture where v is under one half, and its triangles.
fn half_haired() -> (rubor_rig::head::Head, Vec<[u32; 4]>) {
    let mut head = dome();
    let side = 64;
    let mut hair = Map::filled(side, side, &[0.0]);
    hair.values[..(side * side / 2) as usize].fill(0.9);
    head.maps.hair = Some(hair);
    let triangles = head.mesh.triangles.iter().map(|t| [t[0], t[1], t[2], 0]).collect();
    (head, triangles)
}

#[test]
fn shader_is_valid_and_laid_out_as_here() {
    assert_eq!(validated_workgroups(SHADER), []);
    assert_layout(
        SHADER,
        "Params",
        size_of::<Params>(),
        &offsets!(Params; color as "color", ambient as "ambient"),
    );
    assert_layout(
        SHADER,
        "Root",
        size_of::<Root>(),
        &offsets!(Root; triangle as "triangle", weights as "weights", flow as "flow", look as "look"),
    );
}

#[test]
fn hairs_stand_where_the_map_has_hair_and_flow_along_the_skin() {
    let (head, triangles) = half_haired();
    let roots = roots(&head, &triangles);
    assert!(roots.len() > 1000, "{}", roots.len());
    let unorm = |v: u32| [v & 0xffff, v >> 16].map(|h| h as f32 / 65535.0);
    for root in &roots {
        let corners = triangles[root.triangle as usize];
        let of = |i: usize| head.mesh.vertices[corners[i] as usize];
        let point = |i: usize| head.mesh.points[of(i).point as usize];
        let [x, y] = unorm(root.weights);
        let v = x * of(0).uv.y + y * of(1).uv.y + (1.0 - x - y) * of(2).uv.y;
        // Bilinear fetches reach over by a texel.
        assert!(v < 0.5 + 1.0 / 64.0, "a hair at v = {v}");
        let halves = [root.flow as u16, (root.flow >> 16) as u16].map(|b| half::f16::from_bits(b).to_f32());
        let flow = halves[0] * (point(1) - point(0)) + halves[1] * (point(2) - point(0));
        assert!((flow.length() - 1.0).abs() < 0.01, "{flow}");
        assert!(unorm(root.look)[0] > 0.2);
    }
    assert_eq!(roots, super::roots(&head, &triangles), "the same head has the same hairs");
}

#[test]
fn strands_keep_their_skin_and_bald_heads_have_no_hair() {
    let (mut head, triangles) = half_haired();
    let all = roots(&head, &triangles);
    // A strand somewhere on the haired half.
    let corners = triangles[all[0].triangle as usize];
    let point = head.mesh.vertices[corners[0] as usize].point;
    let first = head.mesh.vertices.len() as u32;
    for k in 0..3 {
        let uv = glam::Vec2::new(2.0, k as f32 / 2.0);
        head.mesh.vertices.push(Vertex { point, uv });
    }
    let end = head.mesh.triangles.len() as u32;
    head.mesh.triangles.push([first, first + 1, first + 2]);
    head.mesh.parts.push(Part { name: "brow".into(), material: Material::Hair, triangles: end..end + 1 });
    let fewer = roots(&head, &triangles);
    assert!(fewer.len() < all.len() && !fewer.is_empty(), "{} and {}", fewer.len(), all.len());
    head.maps.hair = None;
    assert_eq!(roots(&head, &triangles), []);
}
