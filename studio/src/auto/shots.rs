//! Random shots of a head: what estimates are fitted to.

use std::collections::BTreeMap;

use glam::{Quat, Vec3};
use rubor_renderer::settings::Leaf;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::framing::FaceFrame;
use rubor_rig::head::Head;
use rubor_rig::random::SplitMix64;
use rubor_rig::timeline::Sequence;
use serde_json::Value;

use crate::error::{Failure, Outcome};
use crate::measure::chart::Scene;

/// Settings that `auto` chooses, each with its choices, the cheapest first and the right one last.
pub const CALIBRATED: &[(&str, &[&str])] = &[
    ("scatter", &["none", "separable:9", "separable:17", "separable:33"]),
    ("transmit", &["none", "shadow-depth"]),
    ("wrinkles", &["none", "partial-derivative"]),
    ("color", &["static", "hemoglobin"]),
    ("antialias", &["none", "smaa-1x", "smaa-s2x", "ssaa:2", "ssaa:4"]),
    ("shadow-size", &["512", "1024", "2048"]),
    ("bounce", &["none", "patches"]),
];

/// Seed of shots that estimates are judged in.
const UNSEEN_SEED: u64 = 0x5eed;

/// [`CALIBRATED`] as a chart takes lists.
///
/// # Errors
/// A value that a setting refuses, which a test excludes.
pub(super) fn calibrated() -> Outcome<Vec<(String, Vec<Value>)>> {
    let value = |flag: &str, text: &str| {
        let leaf = Leaf::of_flag(flag).ok_or_else(|| Failure::job(format!("there is no setting {flag}")))?;
        leaf.parse(text).map_err(Failure::job)
    };
    let of = |(flag, texts): &(&str, &[&str])| -> Outcome<(String, Vec<Value>)> {
        Ok(((*flag).to_owned(), texts.iter().map(|text| value(flag, text)).collect::<Outcome<_>>()?))
    };
    CALIBRATED.iter().map(of).collect()
}

/// Random shots that no estimates were fitted to: those of another seed.
///
/// # Errors
/// A rig that does not fit the head.
pub fn unseen_shots(head: &Head, rig: &Rig, count: usize) -> Outcome<Vec<Scene>> {
    random_shots(head, rig, count, UNSEEN_SEED)
}

/// Shots from a seed: a face at any distance, from the front and the sides, under one to three lamps anywhere, with any
/// expression of its rig.
///
/// # Errors
/// A rig that does not fit the head.
pub(super) fn random_shots(head: &Head, rig: &Rig, count: usize, seed: u64) -> Outcome<Vec<Scene>> {
    let mut random = SplitMix64(seed);
    let origin = FaceFrame::of(head).origin;
    let all_expressions: Vec<&String> = rig.expressions.keys().collect();
    let all_states: Vec<&String> = rig.states.keys().collect();
    let mut scenes = Vec::new();
    for i in 0..count {
        // Half of the faces act, a third blush or pale.
        let mut weights = |names: &[&String], share: usize| -> BTreeMap<String, f64> {
            let drawn = names.get(random.below(share * names.len()));
            drawn.map(|name| ((*name).clone(), random.uniform())).into_iter().collect()
        };
        let (expressions, states) = (weights(&all_expressions, 2), weights(&all_states, 3));
        let text = serde_json::json!({
            "fps": 1, "duration": 1, "expressions": expressions, "states": states,
            "lights": (0..1 + random.below(3)).map(|_| serde_json::json!({
                "kind": "spot", "intensity": 1.0 + 4.0 * random.uniform(), "position": [0, 0, 1], "coneDegrees": [60, 75]
            })).collect::<Vec<_>>(),
            "environment": { "name": "studio", "intensity": 0.4 * random.uniform() },
        });
        let name = format!("shot-{i}");
        let sequence = Sequence::from_json(&name, &text.to_string())?;
        let mut shot = Evaluator::new(head, rig, &sequence)?.0.at(0.0);
        // Around the face, within 70 degrees of its front and 25 of the level, from 12 cm to 5 m.
        let turn = Quat::from_rotation_y(((random.uniform() * 2.0 - 1.0) * 70f64.to_radians()) as f32)
            * Quat::from_rotation_x(((random.uniform() * 2.0 - 1.0) * 25f64.to_radians()) as f32);
        let metres = 0.2 * 25f64.powf(random.uniform());
        let aside = |random: &mut SplitMix64| (random.uniform() * 2.0 - 1.0) as f32;
        // The nearer, the further from the middle of the face the camera may look.
        let target = origin + Vec3::new(0.05 * aside(&mut random), -0.03 + 0.05 * aside(&mut random), 0.0);
        shot.camera.target = target;
        shot.camera.position = target + turn * Vec3::Z * metres as f32;
        shot.camera.fov_y = (18.0 + 14.0 * random.uniform()).to_radians() as f32;
        for light in &mut shot.lights {
            let azimuth = (random.uniform() * 2.0 - 1.0) * std::f64::consts::PI;
            let height = (random.uniform() * 1.2 - 0.3) as f32;
            let direction = Vec3::new(azimuth.sin() as f32, height, azimuth.cos() as f32).normalize();
            light.position = origin + direction * (0.7 + 0.6 * random.uniform() as f32);
            light.direction = -direction;
        }
        scenes.push(Scene::of(name, shot));
    }
    Ok(scenes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::auto::Outline;
    use crate::inputs;

    #[test]
    fn shots_repeat_from_their_seed_and_show_the_head() {
        let loaded = inputs::head(None).unwrap();
        let rig = inputs::rig(None, loaded.rig.clone()).unwrap();
        let of = |seed| random_shots(&loaded.head, &rig, 12, seed).unwrap();
        let (a, b) = (of(1), of(1));
        assert!(a.iter().zip(&b).all(|(a, b)| a.shot == b.shot));
        assert!(a.iter().zip(&of(2)).any(|(a, b)| a.shot != b.shot));
        let outline = Outline::of(&loaded.head);
        let features: Vec<_> = a.iter().map(|s| outline.features(&s.shot, [256, 256])).collect();
        assert!(features.iter().all(|f| f.share > 0.0), "{features:?}");
        assert!(features.iter().any(|f| f.wrinkles > 0.1) && features.iter().any(|f| f.blood == 0.0));
    }
}
