//! The size of a head: units of files, and what unit a head of an unlikely size is in.

use glam::Vec2;
use rubor_rig::head::{Head, Material};

use super::crop::face_box;
use crate::import::obj_set::Units;

/// Heights of heads, with a throat or with shoulders, metres.
const HEADS_METRES: std::ops::RangeInclusive<f32> = 0.1..=0.8;
/// Heights of whole figures, half ones of avatars too, metres.
const FIGURES_METRES: std::ops::RangeInclusive<f32> = 0.5..=2.5;
/// Of a head with its throat, as scans and rigs have it.
const USUAL_HEAD_METRES: f32 = 0.26;
const USUAL_FIGURE_METRES: f32 = 1.7;
/// A unit is believed where it gives a height within this factor of the usual one.
const NEAR: f32 = 1.7;
/// From the brows to the chin is at least this part of a head with its shoulders; of a figure it is less.
const LEAST_FACE: f32 = 0.2;
/// The same of what follows the joints of head and neck, which has hair and throat.
const LEAST_HEAD: f32 = 0.4;

/// What the size of a head says.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// Factor that makes its lengths metres.
    pub factor: f32,
    /// The unit that it is in, where one fits.
    pub unit: Option<Units>,
    /// Whether it is a whole figure.
    pub is_figure: bool,
}

/// Multiplies all lengths.
pub fn scale(head: &mut Head, factor: f32) {
    head.mesh.points.iter_mut().for_each(|p| *p *= factor);
    head.shapes.iter_mut().flat_map(|s| &mut s.offsets).for_each(|o| *o *= factor);
    head.landmarks.values_mut().for_each(|p| *p *= factor);
}

/// Turns textures upside down: for files whose v grows upwards. Eyes keep the coordinates that rubor gave them.
pub fn flip_v(head: &mut Head) {
    let flip = |uv: &mut Vec2| uv.y = 1.0 - uv.y;
    let mut is_eye = vec![false; head.mesh.vertices.len()];
    for part in head.mesh.parts.iter().filter(|p| p.material == Material::Eye) {
        let triangles = &head.mesh.triangles[part.triangles.start as usize..part.triangles.end as usize];
        triangles.as_flattened().iter().for_each(|v| is_eye[*v as usize] = true);
    }
    let others = head.mesh.vertices.iter_mut().zip(is_eye).filter(|(_, is_eye)| !is_eye);
    others.for_each(|(v, _)| flip(&mut v.uv));
    head.authored.second_uvs.iter_mut().for_each(flip);
}

/// Whether the face, or where no shape says what that is the part that follows the joints of head and neck, is so small
/// that a whole figure is there. `head_share` as in [`super::crop::to_head`].
pub fn is_figure(head: &Head, head_share: &[f32]) -> bool {
    let height = head.height();
    if let Some((low, high)) = face_box(head) {
        return high.y - low.y < LEAST_FACE * height;
    }
    let of_head = head.mesh.vertices.iter().zip(head_share).filter(|(_, share)| **share >= 0.5);
    let bounds = of_head.map(|(v, _)| head.mesh.points[v.point as usize].y);
    let (low, high) = bounds.fold((f32::MAX, f32::MIN), |(low, high), y| (low.min(y), high.max(y)));
    high > low && high - low < LEAST_HEAD * height
}

/// The factor that a head of an unlikely size needs; `None` where its size is likely.
pub fn guess(head: &Head, head_share: &[f32]) -> Option<Guess> {
    let height = head.height();
    let is_figure = is_figure(head, head_share);
    let (likely, usual) = match is_figure {
        false => (HEADS_METRES, USUAL_HEAD_METRES),
        true => (FIGURES_METRES, USUAL_FIGURE_METRES),
    };
    if height <= 0.0 || !height.is_finite() || likely.contains(&height) {
        return None;
    }
    let off = |unit: &Units| (height * unit.metres() / usual).ln().abs();
    let units = [Units::Decimetres, Units::Centimetres, Units::Millimetres, Units::Inches];
    let nearest = units.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)));
    let unit = nearest.filter(|unit| off(unit) < NEAR.ln());
    Some(Guess { factor: unit.map_or(usual / height, Units::metres), unit, is_figure })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use rubor_rig::head::{BlendShape, Vertex};

    use super::*;

    fn of_height(height: f32) -> Head {
        let mut head = Head::default();
        head.mesh.points = vec![Vec3::ZERO, Vec3::Y * height];
        head
    }

    #[test]
    fn a_height_says_its_unit() {
        for (height, unit) in [
            (0.25, None),
            (2.3, Some(Units::Decimetres)),
            (8.0, Some(Units::Inches)),
            (26.0, Some(Units::Centimetres)),
            (240.0, Some(Units::Millimetres)),
        ] {
            let found = guess(&of_height(height), &[]);
            assert_eq!(found.and_then(|g| g.unit), unit, "{height}");
        }
        // No unit of length makes a head of 1 or 5000.
        for height in [1.0, 5000.0] {
            let found = guess(&of_height(height), &[]).expect("an unlikely height");
            assert_eq!(found.unit, None, "{height}");
            assert!((found.factor * height - USUAL_HEAD_METRES).abs() < 1e-4);
        }
        assert_eq!(guess(&of_height(0.0), &[]), None);
    }

    #[test]
    fn a_small_face_is_that_of_a_figure() {
        let mut head = of_height(170.0);
        head.mesh.points.extend([Vec3::Y * 150.0, Vec3::Y * 160.0]);
        head.shapes.push(BlendShape {
            name: "jawOpen".into(),
            points: vec![2, 3],
            offsets: vec![Vec3::Z; 2],
            ..BlendShape::default()
        });
        let found = guess(&head, &[]).expect("an unlikely height");
        assert_eq!((found.unit, found.is_figure), (Some(Units::Centimetres), true));
        scale(&mut head, found.factor);
        assert!((head.height() - 1.7).abs() < 1e-5 && (head.shapes[0].offsets[0].z - 0.01).abs() < 1e-6);
        assert_eq!(guess(&head, &[]), None);
    }

    #[test]
    fn textures_turn_upside_down() {
        let mut head = of_height(1.0);
        head.mesh.vertices.push(Vertex { point: 0, uv: Vec2::new(0.25, 0.25) });
        flip_v(&mut head);
        assert_eq!(head.mesh.vertices[0].uv, Vec2::new(0.25, 0.75));
    }
}
