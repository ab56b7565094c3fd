//! What can be known of a frame without drawing it.

use glam::Vec3;
use rubor_rig::evaluate::Shot;
use rubor_rig::head::Head;
use serde::{Deserialize, Serialize};

/// Points of a head that stand for its surface.
const MOST_POINTS: usize = 3000;
/// Share of a head's points in view that are nearer than the distance that counts.
const NEAR_SHARE: usize = 10;

/// Numbers of a shot of a head from which errors and costs are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Features {
    /// Millimetres of skin across a pixel, where the head is near.
    pub mm_per_pixel: f64,
    /// Share of the picture that the head's box covers, 0 to 1.
    pub share: f64,
    /// How much of the lamps' light comes from behind the head, 0 to 1.
    pub backlight: f64,
    /// Share of lamps in all light, 0 to 1: a face in even light has no edges of shadows.
    pub contrast: f64,
    /// Largest weight of a wrinkle zone, 0 to 1.
    pub wrinkles: f64,
    /// How far blood is from neutral: weights of distributions and the change of the global factor.
    pub blood: f64,
}

/// A head as features see it.
#[derive(Clone, Debug)]
pub struct Outline {
    points: Vec<Vec3>,
}

impl Outline {
    /// Some points of the neutral head.
    pub fn of(head: &Head) -> Self {
        let all = &head.mesh.points;
        let stride = all.len().div_ceil(MOST_POINTS).max(1);
        Self { points: all.iter().step_by(stride).copied().collect() }
    }

    /// Features of a shot of the head, in a picture of a size in pixels. A head out of view has a share of 0.
    pub fn features(&self, shot: &Shot, size: [u32; 2]) -> Features {
        let camera = &shot.camera;
        let forward = (camera.target - camera.position).normalize_or_zero();
        let right = forward.cross(camera.up).normalize_or_zero();
        let up = right.cross(forward);
        let [width, height] = size.map(|n| f64::from(n.max(1)));
        let half_height = f64::from((camera.fov_y / 2.0).tan());
        let half_width = half_height * width / height;
        let face = &shot.face;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut depths = Vec::new();
        let mut middle = Vec3::ZERO;
        for point in &self.points {
            let world = face.head_rotation * *point + face.head_translation;
            let from_camera = world - camera.position;
            let depth = f64::from(from_camera.dot(forward));
            if depth <= 1e-4 {
                continue;
            }
            let place = [
                f64::from(from_camera.dot(right)) / (depth * half_width),
                f64::from(from_camera.dot(up)) / (depth * half_height),
            ];
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis].clamp(-1.0, 1.0));
                high[axis] = high[axis].max(place[axis].clamp(-1.0, 1.0));
            }
            if place.iter().all(|p| p.abs() <= 1.0) {
                depths.push(depth);
                middle += world;
            }
        }
        depths.sort_by(f64::total_cmp);
        let Some(near) = depths.get(depths.len() / NEAR_SHARE) else { return Features::default() };
        let middle = middle / depths.len() as f32;
        let to_camera = (camera.position - middle).normalize_or_zero();
        let (mut behind, mut lamps) = (0.0, 0.0);
        for light in &shot.lights {
            let (to_light, falloff) = if light.position == Vec3::ZERO {
                (-light.direction, 1.0)
            } else {
                let away = light.position - middle;
                (away.normalize_or_zero(), 1.0 / away.length_squared().max(1e-4))
            };
            let power = f64::from(light.power_linear.element_sum() * falloff / 3.0);
            lamps += power;
            behind += power * f64::from(-to_light.dot(to_camera)).max(0.0);
        }
        let around = shot.environment.as_ref().map_or(0.0, |e| f64::from(e.intensity));
        Features {
            mm_per_pixel: 2000.0 * near * half_height / height,
            share: (high[0] - low[0]) * (high[1] - low[1]) / 4.0,
            backlight: if lamps > 0.0 { behind / lamps } else { 0.0 },
            contrast: if lamps > 0.0 { lamps / (lamps + std::f64::consts::PI * around) } else { 0.0 },
            wrinkles: face.zones.iter().fold(0.0, |most, w| most.max(f64::from(w.abs()))),
            blood: face.distributions.iter().map(|w| f64::from(w.abs())).sum::<f64>()
                + f64::from((face.hemoglobin_scale - 1.0).abs()),
        }
    }
}

#[cfg(test)]
mod tests {
    use rubor_rig::evaluate::Evaluator;
    use rubor_rig::timeline::Sequence;

    use super::*;
    use crate::inputs;

    #[test]
    fn features_say_what_a_shot_shows() {
        let loaded = inputs::head(None).unwrap();
        let rig = inputs::rig(None, loaded.rig.clone()).unwrap();
        let outline = Outline::of(&loaded.head);
        let of = |distance: f32, lamp_z: f32, more: &str| {
            let text = format!(
                r#"{{ "fps": 1, "duration": 1, "camera": {{ "position": [0, 0, {distance}], "target": [0, 0, 0], "fovDegrees": 20 }},
                    "lights": [{{ "kind": "point", "intensity": 2, "position": [0.1, 0.2, {lamp_z}] }}] {more} }}"#
            );
            let sequence = Sequence::from_json("s", &text).unwrap();
            let (evaluator, _) = Evaluator::new(&loaded.head, &rig, &sequence).unwrap();
            outline.features(&evaluator.at(0.0), [200, 100])
        };
        let near = of(1.0, 1.0, "");
        let far = of(4.0, 1.0, "");
        assert!((far.mm_per_pixel / near.mm_per_pixel - 4.0).abs() < 0.4, "{near:?} {far:?}");
        // 1 m less the 3 to 6 cm of a face before the eyes, over 100 pixels.
        let expected = 2000.0 * 0.95 * 10f64.to_radians().tan() / 100.0;
        assert!((near.mm_per_pixel / expected - 1.0).abs() < 0.08, "{near:?}");
        assert!(far.share < near.share && far.share > 0.0);
        assert!(near.backlight == 0.0 && of(1.0, -1.0, "").backlight > 0.8);
        assert_eq!(near.contrast, 1.0);
        assert!(of(1.0, 1.0, r#", "environment": { "name": "studio", "intensity": 1 }"#).contrast < 0.6);
        assert_eq!((near.wrinkles, near.blood), (0.0, 0.0));
        let angry = of(1.0, 1.0, r#", "expressions": { "anger": 1 }"#);
        assert!(angry.wrinkles > 0.3 && angry.blood > 0.1, "{angry:?}");
        let away = r#", "head": { "translation": [5, 0, 0] }"#;
        assert_eq!(of(1.0, 1.0, away).share, 0.0, "out of view");
    }
}
