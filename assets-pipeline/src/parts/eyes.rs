//! Coordinates of eyeballs: the azimuthal projection of [`rubor_rig::head::Material::Eye`].

use std::collections::HashMap;

use rubor_rig::head::Head;

use super::{components, set_coordinates};
use crate::import::eye_projection::EyeProjection;

pub(super) fn assign(head: &mut Head, part: usize) {
    // Each side of a part is a ball, whatever it is made of.
    let found = components(head, part);
    let middle = found.iter().map(|c| c.center(head).x).sum::<f32>() / found.len().max(1) as f32;
    let wide = found.iter().map(|c| c.bounds(head)).fold(0.0f32, |w, (a, b)| w.max(b.x - a.x));
    let spread = found.iter().map(|c| (c.center(head).x - middle).abs()).fold(0.0, f32::max);
    let two = spread > 0.6 * wide;
    for left in [true, false] {
        let ball: Vec<_> =
            found.iter().filter(|c| (!two && left) || (two && (c.center(head).x > middle) == left)).collect();
        let places: Vec<_> = ball.iter().flat_map(|c| c.places(head)).collect();
        if places.len() < 12 {
            continue;
        }
        let projection = EyeProjection::fit(&places);
        let uv_of: HashMap<u32, _> = ball
            .iter()
            .flat_map(|c| c.points.iter())
            .map(|p| (*p, projection.uv(head.mesh.points[*p as usize])))
            .collect();
        let triangles: Vec<u32> = ball.iter().flat_map(|c| c.triangles.iter().copied()).collect();
        set_coordinates(head, &triangles, &uv_of);
    }
}
