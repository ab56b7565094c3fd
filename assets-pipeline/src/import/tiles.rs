//! Texture tiles (UDIM) into the one unit square that the maps of a head have.

use std::collections::BTreeMap;

use glam::{IVec2, Vec2};
use rubor_rig::head::Material;

use crate::poly::PolyMesh;

/// Share of the square's side that the tile with most faces keeps.
const MAIN_SIDE: f32 = 0.75;
/// Cells of the remaining border, each a third of the main tile's side: right column downwards, then bottom row.
const CELLS: [[f32; 2]; 7] =
    [[0.75, 0.0], [0.75, 0.25], [0.75, 0.5], [0.75, 0.75], [0.0, 0.75], [0.25, 0.75], [0.5, 0.75]];

/// Moves the texture coordinates of skin faces into the unit square if they lie in several tiles: the tile with most
/// faces gets nine sixteenths of the square, the others a sixteenth each. Tiles beyond the eighth stay where they are.
/// A face counts where its middle lies, so that one that ends on the border of a tile is inside.
pub(crate) fn pack(mesh: &mut PolyMesh, parts: &[(String, Material)]) {
    let is_skin = |f: usize| parts[mesh.face_groups[f] as usize].1 == Material::Skin;
    let tile = |f: usize| {
        let corners = mesh.face(f);
        let sum: Vec2 = corners.iter().map(|c| mesh.uvs[c.uv as usize]).sum();
        (sum / corners.len().max(1) as f32).floor().as_ivec2()
    };
    let mut faces_of: BTreeMap<(i32, i32), Vec<usize>> = BTreeMap::new();
    for f in (0..mesh.face_count()).filter(|f| is_skin(*f)) {
        let t = tile(f);
        faces_of.entry((t.x, t.y)).or_default().push(f);
    }
    if faces_of.keys().all(|t| *t == (0, 0)) {
        return;
    }
    let mut tiles: Vec<_> = faces_of.into_iter().collect();
    tiles.sort_by_key(|(t, faces)| (std::cmp::Reverse(faces.len()), *t));
    let single = tiles.len() == 1;
    for (rank, ((x, y), faces)) in tiles.into_iter().enumerate() {
        let (scale, place) = match rank {
            0 if single => (1.0, Vec2::ZERO),
            0 => (MAIN_SIDE, Vec2::ZERO),
            _ => match CELLS.get(rank - 1) {
                Some(cell) => (1.0 - MAIN_SIDE, Vec2::from_array(*cell)),
                None => return,
            },
        };
        let origin = IVec2::new(x, y).as_vec2();
        let mut moved: BTreeMap<u32, u32> = BTreeMap::new();
        for f in faces {
            for k in mesh.face_starts[f]..mesh.face_starts[f + 1] {
                let uv = mesh.corners[k as usize].uv;
                let packed = *moved.entry(uv).or_insert_with(|| {
                    mesh.uvs.push(place + scale * (mesh.uvs[uv as usize] - origin));
                    mesh.uvs.len() as u32 - 1
                });
                mesh.corners[k as usize].uv = packed;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::poly::Corner;

    /// Triangles whose corners all lie at one place of the texture.
    fn triangles_at(uvs: &[Vec2]) -> PolyMesh {
        let mut mesh =
            PolyMesh { points: vec![Vec3::ZERO], groups: vec!["face".into()], ..PolyMesh::default() };
        for uv in uvs {
            mesh.uvs.push(*uv);
            let corner = Corner { point: 0, uv: mesh.uvs.len() as u32 - 1 };
            mesh.corners.extend([corner; 3]);
            mesh.face_starts.push(mesh.corners.len() as u32);
            mesh.face_groups.push(0);
        }
        mesh
    }

    fn packed(uvs: &[Vec2]) -> Vec<Vec2> {
        let mut mesh = triangles_at(uvs);
        pack(&mut mesh, &[("face".into(), Material::Skin)]);
        mesh.faces().map(|f| mesh.uvs[f[0].uv as usize]).collect()
    }

    #[test]
    fn one_tile_stays_and_several_share_the_square() {
        let inside = [Vec2::new(0.2, 0.4)];
        assert_eq!(packed(&inside), inside);
        assert!(packed(&[Vec2::new(3.5, 0.5)])[0].abs_diff_eq(Vec2::splat(0.5), 1e-6));
        let two = packed(&[Vec2::splat(0.5), Vec2::new(0.25, 0.5), Vec2::new(1.5, 0.5)]);
        assert!(two[0].abs_diff_eq(Vec2::splat(0.375), 1e-6), "{two:?}");
        assert!(two[2].abs_diff_eq(Vec2::new(0.875, 0.125), 1e-6), "{two:?}");
    }
}
