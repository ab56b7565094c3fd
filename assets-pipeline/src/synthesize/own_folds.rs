//! Folds that the shapes of a head make themselves: no groove is drawn into them.
//!
//! A smile of some heads pushes the cheek over the corner of the mouth. A groove drawn there is squeezed into a dark smudge,
//! and it repeats what the surface shows anyway.

use glam::{Mat2, Vec2, Vec3};
use rubor_rig::head::{Head, WrinkleZone};
use rubor_rig::names::Resolver;

use super::noise::smoothstep;
use crate::convert::skin_texels::SkinTexels;

/// Zones, and the shapes with which they show.
const FOLDED_BY: [(&str, [&str; 2]); 2] = [
    ("nasolabial-left", ["mouthSmileLeft", "cheekSquintLeft"]),
    ("nasolabial-right", ["mouthSmileRight", "cheekSquintRight"]),
];
/// Shortest length of an edge of a unit that such shapes leave, from which the surface folds, and to which it does not. Set by
/// eye on an avatar whose smile smudged: 0.52 is the least in its fold, and a tenth of its moved skin is under 0.74.
const FOLDED: f32 = 0.55;
const SMOOTH: f32 = 0.8;

/// Fades zones out where the shapes that they go with fold the surface.
pub(super) fn fade_zones(head: &Head, zones: &mut [WrinkleZone]) {
    let resolver = Resolver::shapes(head);
    for zone in zones {
        let Some((_, names)) = FOLDED_BY.iter().find(|(name, _)| *name == zone.name) else { continue };
        let mut moved = head.mesh.points.clone();
        for target in names.iter().flat_map(|name| resolver.resolve(name)) {
            let shape = &head.shapes[target.index as usize];
            for (point, offset) in shape.points.iter().zip(&shape.offsets) {
                moved[*point as usize] += *offset * target.factor;
            }
        }
        let kept: Vec<f32> =
            shortest_stretch(head, &moved).iter().map(|s| smoothstep(FOLDED, SMOOTH, *s)).collect();
        if kept.iter().all(|k| *k == 1.0) {
            continue;
        }
        let factor = SkinTexels::new(head, zone.mask.width, zone.mask.height).map_of_points(&kept);
        zone.mask.values.iter_mut().zip(&factor.values).for_each(|(v, f)| *v *= f);
    }
}

/// Of each point the length that a unit along the surface has at least when the points have moved: the mean of its triangles by
/// area, once more averaged over their corners.
fn shortest_stretch(head: &Head, moved: &[Vec3]) -> Vec<f32> {
    let mesh = &head.mesh;
    let corners: Vec<[usize; 3]> = (mesh.triangles.iter())
        .map(|t| t.map(|v| mesh.vertices[v as usize].point as usize))
        .filter(|t| t.iter().any(|p| moved[*p] != mesh.points[*p]))
        .collect();
    let mut sums = vec![(0.0, 0.0); mesh.points.len()];
    for t in &corners {
        let rest = t.map(|p| mesh.points[p]);
        let area = (rest[1] - rest[0]).cross(rest[2] - rest[0]).length();
        let stretch = stretch(rest, t.map(|p| moved[p]));
        t.iter().for_each(|p| sums[*p] = (sums[*p].0 + area * stretch, sums[*p].1 + area));
    }
    let of_points: Vec<f32> =
        sums.iter().map(|(sum, area)| if *area > 0.0 { sum / area } else { 1.0 }).collect();
    // Grooves are wider than a triangle.
    let mut wide: Vec<(f32, f32)> = of_points.iter().map(|s| (*s, 1.0)).collect();
    for t in &corners {
        let mean = t.iter().map(|p| of_points[*p]).sum::<f32>() / 3.0;
        t.iter().for_each(|p| wide[*p] = (wide[*p].0 + mean, wide[*p].1 + 1.0));
    }
    wide.iter().map(|(sum, count)| sum / count).collect()
}

/// The smaller singular value of the map in the plane from one triangle to another; 1 where the first has no area.
fn stretch(from: [Vec3; 3], to: [Vec3; 3]) -> f32 {
    let flat = |[a, b, c]: [Vec3; 3]| {
        let x = (b - a).normalize_or_zero();
        let across = c - a;
        let along = across.dot(x);
        Mat2::from_cols(Vec2::new((b - a).length(), 0.0), Vec2::new(along, (across - x * along).length()))
    };
    let (from, to) = (flat(from), flat(to));
    if from.determinant() <= 1e-12 {
        return 1.0;
    }
    let map = to * from.inverse();
    // The singular values of a matrix of two by two are the half sum and half difference of these lengths.
    let (e, f) = (map.x_axis.x + map.y_axis.y, map.x_axis.x - map.y_axis.y);
    let (g, h) = (map.x_axis.y + map.y_axis.x, map.x_axis.y - map.y_axis.x);
    0.5 * (e.hypot(h) - f.hypot(g)).abs()
}

#[cfg(test)]
mod tests {
    use rubor_rig::head::BlendShape;
    use rubor_rig::map::Map;

    use super::*;

    #[test]
    fn a_triangle_is_stretched_by_its_shorter_axis() {
        let from = [Vec3::ZERO, Vec3::X, Vec3::new(0.3, 1.0, 0.0)];
        // Three times as wide, half as high, and turned.
        let turn = glam::Quat::from_rotation_y(1.1) * glam::Quat::from_rotation_x(0.4);
        let to = from.map(|p| turn * (p * Vec3::new(3.0, 0.5, 1.0)));
        assert!((stretch(from, to) - 0.5).abs() < 1e-5);
        assert_eq!(stretch([Vec3::ZERO; 3], from), 1.0);
    }

    #[test]
    fn a_zone_ends_where_its_shape_folds_the_skin() {
        let mut head = crate::convert::skin_texels::tests::sheet(Vec2::ZERO, Vec2::ONE);
        // The corners of the sheet come near its middle.
        let points = 0..head.mesh.points.len() as u32;
        let middle = head.mesh.points.iter().sum::<Vec3>() / points.len() as f32;
        head.shapes = vec![BlendShape {
            name: "mouthSmileLeft".into(),
            offsets: head.mesh.points.iter().map(|p| 0.5 * (middle - *p)).collect(),
            points: points.collect(),
            ..BlendShape::default()
        }];
        let zone =
            |name: &str| WrinkleZone { name: name.into(), wrinkle_map: 0, mask: Map::filled(4, 4, &[1.0]) };
        let mut zones = [zone("nasolabial-left"), zone("nasolabial-right"), zone("chin")];
        fade_zones(&head, &mut zones);
        assert!(zones[0].mask.values.iter().all(|v| *v == 0.0));
        assert!(zones[1..].iter().all(|z| z.mask.values.iter().all(|v| *v == 1.0)));
    }
}
