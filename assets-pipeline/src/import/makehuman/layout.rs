//! Texture space of the head: which islands of the base mesh are skin, and where they lie in the unit square.

use glam::Vec2;

use crate::poly::PolyMesh;

/// A place inside each island of the hm08 layout (glTF convention) and the group that its faces get.
const ISLANDS: [(Vec2, &str); 5] = [
    (Vec2::new(0.80, 0.52), "skin"),          // head
    (Vec2::new(0.38, 0.20), "skin"),          // torso with neck
    (Vec2::new(0.84, 0.93), "mouth"),         // lining of the mouth, behind the lips
    (Vec2::new(0.044, 0.41), "socket-right"), // behind the edge of the lids
    (Vec2::new(0.118, 0.41), "socket-left"),
];

/// Empty texels around islands, as part of the square: 4 texels at 1024.
const GUTTER: f32 = 4.0 / 1024.0;

/// Splits the group `body` into skin, mouth and eye sockets; other islands of the body get the group `limb`.
pub(super) fn split_body(mesh: &mut PolyMesh) {
    let Some(body) = mesh.groups.iter().position(|g| g == "body") else { return };
    let islands = mesh.uv_islands();
    let in_body: Vec<usize> =
        (0..mesh.face_count()).filter(|f| mesh.face_groups[*f] == body as u32).collect();
    let nearest = |place: Vec2| {
        let corners = in_body.iter().flat_map(|f| mesh.face(*f)).map(|c| c.uv);
        corners.min_by(|a, b| {
            let distance = |uv: u32| mesh.uvs[uv as usize].distance_squared(place);
            distance(*a).total_cmp(&distance(*b))
        })
    };
    let labels: Vec<(Option<u32>, &str)> = ISLANDS
        .iter()
        .map(|(place, group)| (nearest(*place).map(|uv| islands[uv as usize]), *group))
        .collect();
    for f in in_body {
        let island = islands[mesh.face(f)[0].uv as usize];
        let name = labels.iter().find(|(label, _)| *label == Some(island)).map_or("limb", |(_, name)| name);
        mesh.face_groups[f] = mesh.group(name);
    }
}

/// Turns the head upright and packs the islands of the skin into the unit square: the head over the full width, what is
/// left of the torso below it.
pub(super) fn pack_skin(mesh: &mut PolyMesh) {
    let Some(skin) = mesh.groups.iter().position(|g| g == "skin") else { return };
    let labels = mesh.uv_islands();
    let mut islands: Vec<(u32, Vec<u32>)> = Vec::new();
    for f in (0..mesh.face_count()).filter(|f| mesh.face_groups[*f] == skin as u32) {
        for corner in mesh.face(f) {
            let label = labels[corner.uv as usize];
            match islands.iter_mut().find(|(l, _)| *l == label) {
                Some((_, uvs)) => uvs.push(corner.uv),
                None => islands.push((label, vec![corner.uv])),
            }
        }
    }
    islands.iter_mut().for_each(|(_, uvs)| {
        uvs.sort_unstable();
        uvs.dedup();
    });
    // The head's island has by far the most corners; in the base layout its forehead points to -u.
    islands.sort_by_key(|(_, uvs)| std::cmp::Reverse(uvs.len()));
    let mut top = GUTTER;
    for (i, (_, uvs)) in islands.iter().enumerate() {
        if i == 0 {
            uvs.iter().for_each(|uv| {
                let p = &mut mesh.uvs[*uv as usize];
                *p = Vec2::new(1.0 - p.y, p.x);
            });
        }
        let all = || uvs.iter().map(|uv| mesh.uvs[*uv as usize]);
        let (low, high) = (all().fold(Vec2::INFINITY, Vec2::min), all().fold(Vec2::NEG_INFINITY, Vec2::max));
        let space = Vec2::new(1.0 - 2.0 * GUTTER, 1.0 - GUTTER - top);
        let scale = (space / (high - low)).min_element();
        let left = 0.5 * (1.0 - scale * (high.x - low.x));
        uvs.iter().for_each(|uv| {
            let p = &mut mesh.uvs[*uv as usize];
            *p = Vec2::new(left, top) + scale * (*p - low);
        });
        top += scale * (high.y - low.y) + GUTTER;
    }
}
