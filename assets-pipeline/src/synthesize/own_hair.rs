//! Hair that a head has as geometry: none is grown or drawn on top of it.

use glam::Vec3;
use rubor_rig::head::{Head, Material};

use super::Options;
use super::face_space::{FaceSpace, plan};
use super::regions::above_hairline;
use super::strands::BROWS;
use crate::landmarks::kind;

/// Share of the points of a part that lie about a place of hair from which it is that hair.
const LEAST_SHARE: f32 = 0.25;

/// The options without the hair that parts of the head are already.
pub(super) fn without_own(head: &Head, space: &FaceSpace, options: &Options) -> Options {
    let mut left = options.clone();
    for (i, part) in head.mesh.parts.iter().enumerate() {
        // Hidden parts are not drawn; grown brows are replaced.
        if part.name == BROWS || part.material == Material::Hidden || kind(head, i) != Material::Hair {
            continue;
        }
        let range = part.triangles.start as usize..part.triangles.end as usize;
        let corners = head.mesh.triangles[range].iter().flatten();
        let places: Vec<Vec3> = corners
            .map(|v| space.warp(head.mesh.points[head.mesh.vertices[*v as usize].point as usize]))
            .collect();
        let share = |inside: &dyn Fn(Vec3) -> bool| {
            places.iter().filter(|c| inside(**c)).count() as f32 / places.len().max(1) as f32
        };
        let brow = |c: Vec3| {
            let s = plan(c).x.abs();
            c.z > 20.0 && (6.0..70.0).contains(&s) && (8.0..36.0).contains(&c.y)
        };
        let beard = |c: Vec3| c.z > 0.0 && (-140.0..-48.0).contains(&c.y);
        let scalp = |c: Vec3| c.y > 60.0 || above_hairline(plan(c)) > 2.0;
        // A fringe hangs over brows and is no brow.
        if share(&brow) > LEAST_SHARE && share(&scalp) < share(&brow) {
            left.brows = 0.0;
        }
        if share(&beard) > LEAST_SHARE && share(&scalp) < share(&beard) {
            left.stubble = 0.0;
        }
        if share(&scalp) > LEAST_SHARE {
            left.scalp_hair = 0.0;
        }
    }
    left
}

#[cfg(test)]
mod tests {
    use super::*;
    use rubor_rig::head::{MM_PER_METRE, Part, Vertex};

    /// A head of one triangle of hair about a canonical place.
    fn with(name: &str, place: Vec3) -> Options {
        let mut head = Head::default();
        super::super::tests::landmarks(&mut head);
        for (i, d) in [Vec3::ZERO, Vec3::X, Vec3::Y].into_iter().enumerate() {
            head.mesh.points.push((place + d) / MM_PER_METRE);
            head.mesh.vertices.push(Vertex { point: i as u32, uv: glam::Vec2::ZERO });
        }
        head.mesh.triangles.push([0, 1, 2]);
        head.mesh.parts.push(Part { name: name.into(), material: Material::Hair, triangles: 0..1 });
        let all = Options { stubble: 0.5, ..Options::default() };
        without_own(&head, &FaceSpace::fit(&head), &all)
    }

    #[test]
    fn hair_that_is_there_is_not_made_again() {
        let all = Options { stubble: 0.5, ..Options::default() };
        let brow = Vec3::new(31.0, 24.0, 82.0);
        assert_eq!(with("eyebrow_mesh", brow), Options { brows: 0.0, ..all.clone() });
        assert_eq!(with("brows", brow), all, "those that rubor grew are grown anew");
        assert_eq!(with("bun", Vec3::new(0.0, 105.0, -20.0)), Options { scalp_hair: 0.0, ..all.clone() });
        assert_eq!(with("goatee", Vec3::new(0.0, -105.0, 88.0)), Options { stubble: 0.0, ..all });
    }
}
