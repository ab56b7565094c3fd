//! Strands of brows and lashes, which are geometry: in random order, so that the first ones can stand for all.

use std::collections::BTreeMap;

use rubor_rig::head::{Head, Material};

use super::hair_roots::hash;

/// `u` of a strand is twice its number, from 1 on, and 1 more at its other side; cards have theirs below it.
const FIRST_U: f32 = 2.0;

/// Triangles that are blended over the picture: cards and films, then strand by strand. Then how many of them there are
/// before the first strand and after each.
pub(crate) fn ordered(head: &Head) -> (Vec<u32>, Vec<u32>) {
    let mesh = &head.mesh;
    let mut all = Vec::new();
    let mut strands: BTreeMap<(u32, usize, u32), Vec<u32>> = BTreeMap::new();
    let blended = |material: Material| !material.is_opaque() && material != Material::Hidden;
    for (index, part) in mesh.parts.iter().enumerate().filter(|(_, part)| blended(part.material)) {
        let has_strands = matches!(part.material, Material::Lash | Material::Hair);
        for triangle in part.triangles.clone() {
            let u = mesh.vertices[mesh.triangles[triangle as usize][0] as usize].uv.x;
            if !has_strands || u < FIRST_U {
                all.push(triangle);
                continue;
            }
            let number = (0.5 * u) as u32;
            let of_part = number.wrapping_add(hash(index as u32));
            strands.entry((hash(of_part), index, number)).or_default().push(triangle);
        }
    }
    let mut ends = vec![all.len() as u32];
    for triangles in strands.into_values() {
        all.extend(triangles);
        ends.push(all.len() as u32);
    }
    (all, ends)
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use rubor_rig::head::{Mesh, Part, Vertex};

    use super::*;

    #[test]
    fn cards_come_first_and_strands_stay_whole() {
        let mut mesh = Mesh { points: vec![Vec3::ZERO], ..Mesh::default() };
        let mut triangle = |u: f32| {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend([Vertex { point: 0, uv: Vec2::new(u, 0.0) }; 3]);
            mesh.triangles.push([first, first + 1, first + 2]);
        };
        // Forty strands of two triangles, a card in between, films.
        (0..40).flat_map(|i| [2.0 * (1 + i % 20) as f32; 2]).for_each(&mut triangle);
        (0..3).for_each(|_| triangle(0.5));
        (0..2).for_each(|_| triangle(7.0));
        let part = |name: &str, material, triangles| Part { name: name.into(), material, triangles };
        mesh.parts = vec![
            part("left", Material::Hair, 0..40),
            part("right", Material::Lash, 40..83),
            part("film", Material::Wet, 83..85),
        ];
        let head = Head { name: "brows".into(), mesh, ..Head::default() };
        let (all, ends) = ordered(&head);
        assert_eq!(all[..5], [80, 81, 82, 83, 84]);
        assert_eq!((ends.len(), ends[0], ends[40]), (41, 5, 85));
        for range in ends.windows(2) {
            let strand = &all[range[0] as usize..range[1] as usize];
            assert_eq!(strand, [strand[0], strand[0] + 1], "whole, in their order");
            assert_eq!(strand[0] % 2, 0);
        }
        // Any part of the order has strands of both parts.
        let left = |range: std::ops::Range<usize>| all[range].iter().filter(|t| **t < 40).count();
        assert!((10..=30).contains(&left(5..45)), "{}", left(5..45));
    }
}
