//! Sweeps: a scene in which one quantity moves in small steps.

use glam::Vec3;
use rubor_assets::convert::size;
use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::expression::Rig;
use rubor_rig::framing::FaceFrame;
use rubor_rig::head::{Head, SkinMaps};
use rubor_rig::hemoglobin::MAX_SCALE;
use rubor_rig::timeline::Sequence;

use crate::error::Outcome;

/// A scene that moves.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Name.
    pub name: &'static str,
    /// What moves, and its unit.
    pub moves: &'static str,
    /// Whether each step multiplies the quantity, so that its axis is logarithmic.
    pub is_geometric: bool,
    /// Steps in their order.
    pub steps: Vec<Step>,
}

/// A picture of a sweep.
#[derive(Clone, Debug)]
pub struct Step {
    /// The quantity.
    pub value: f64,
    /// What the head shows, from where, in which light.
    pub shot: Shot,
    /// What is changed of the head.
    pub change: Option<Change>,
}

/// A change of a head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Factor of its size: light goes as far as ever, so thin parts get thinner and curves narrower.
    Size(f32),
    /// Factor of the local contrast of the neutral blood, 0 to 1; the scales of distributions make up for it up to
    /// [`MAX_SCALE`].
    BloodContrast(f32),
    /// Steepest slope of the relief and of its wrinkles, degrees.
    Relief(f32),
}

impl Step {
    /// The head as the step has it, where it is another one.
    pub fn head(&self, head: &Head) -> Option<Head> {
        let mut changed = self.change.map(|_| head.clone())?;
        match self.change? {
            Change::Size(factor) => size::scale(&mut changed, factor),
            Change::BloodContrast(factor) => flatten_blood(&mut changed.maps, factor),
            Change::Relief(degrees) => steepen(&mut changed.maps, degrees),
        }
        Some(changed)
    }
}

/// Brings the neutral blood nearer to its local mean and the scales of distributions up by as much.
fn flatten_blood(maps: &mut SkinMaps, factor: f32) {
    if let (Some(neutral), Some(mean)) = (&mut maps.hemoglobin, &maps.hemoglobin_mean) {
        let [width, height] = [neutral.width, neutral.height];
        for (i, value) in neutral.values.iter_mut().enumerate() {
            let [x, y] = [i as u32 % width, i as u32 / width];
            let [u, v] = [(x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32];
            let mean = mean.sample(u, v, 0);
            *value = mean + factor * (*value - mean);
        }
    }
    for scale in maps.distributions.iter_mut().flat_map(|d| &mut d.scale.values) {
        *scale = (*scale / factor.max(1e-6)).min(MAX_SCALE);
    }
}

/// Makes the steepest slope of the relief, and that of its wrinkles, an angle.
fn steepen(maps: &mut SkinMaps, degrees: f32) {
    for map in maps.slopes.iter_mut().chain(&mut maps.wrinkle_slopes) {
        let steepest = map.values.chunks_exact(2).map(|s| s[0].hypot(s[1])).fold(0.0, f32::max);
        let factor = degrees.to_radians().tan() / steepest.max(1e-6);
        map.values.iter_mut().for_each(|v| *v *= factor);
    }
}

const PORTRAIT: &str = r#"{ "fps": 1, "duration": 1,
    "camera": { "position": [0.1, -0.01, 0.62], "target": [0, -0.035, 0], "fovDegrees": 22 },
    "lights": [{ "kind": "spot", "intensity": 4, "position": [0.75, 0.45, 0.6], "coneDegrees": [46, 62] }],
    "environment": { "name": "studio", "intensity": 0.1 } }"#;
const EAR: &str = include_str!("../../../../tests/scenes/ear.json");
const FROWN: &str = include_str!("../../../../tests/scenes/frown.json");
const BLUSH: &str = include_str!("../../../../tests/scenes/blush.json");

/// A place on the cheek, from the middle between the eyes, metres.
const CHEEK: Vec3 = Vec3::new(0.03, -0.034, 0.012);

/// Values from `from` to `to` in equal factors.
fn geometric(from: f64, to: f64, steps: usize) -> impl Iterator<Item = f64> {
    (0..steps).map(move |i| from * (to / from).powf(i as f64 / (steps - 1) as f64))
}

fn linear(from: f64, to: f64, steps: usize) -> impl Iterator<Item = f64> {
    (0..steps).map(move |i| from + (to - from) * i as f64 / (steps - 1) as f64)
}

/// Every sweep, of `steps` pictures each, of a head with its rig; `side` is the pixels of a picture.
///
/// # Errors
/// A rig that does not fit the head.
pub fn sweeps(head: &Head, rig: &Rig, steps: usize, side: u32) -> Outcome<Vec<Sweep>> {
    let steps = steps.max(3);
    let shot = |name: &str, text: &str| -> Outcome<Shot> {
        let sequence = Sequence::from_json(name, text)?;
        Ok(Evaluator::new(head, rig, &sequence)?.0.at(0.0))
    };
    let portrait = shot("portrait", PORTRAIT)?;
    let at = |value: f64, shot: Shot| Step { value, shot, change: None };
    let mut all = Vec::new();

    // Two pixels to the side, in eighths and finer.
    let metres_per_pixel = |shot: &Shot| {
        let away = (shot.camera.position - shot.camera.target).length();
        2.0 * away * (shot.camera.fov_y / 2.0).tan() / side as f32
    };
    let pan = linear(0.0, 2.0, steps).map(|pixels| {
        let mut shot = portrait.clone();
        let aside = Vec3::X * (pixels as f32 * metres_per_pixel(&portrait));
        shot.camera.position += aside;
        shot.camera.target += aside;
        at(pixels, shot)
    });
    all.push(Sweep {
        name: "pan",
        moves: "camera to the side, pixels",
        is_geometric: false,
        steps: pan.collect(),
    });

    // The cheek from a head of a few pixels to pores.
    let cheek = FaceFrame::of(head).origin + CHEEK;
    let zoom = geometric(8.0, 0.05, steps).map(|metres| {
        let mut shot = portrait.clone();
        let direction = Vec3::new(0.25, 0.12, 1.0).normalize();
        shot.camera.target = cheek;
        shot.camera.position = cheek + direction * metres as f32;
        at(metres, shot)
    });
    all.push(Sweep {
        name: "zoom",
        moves: "distance of the camera, m",
        is_geometric: true,
        steps: zoom.collect(),
    });

    let lamp = |shot: &Shot, degrees: f64, metres: f32| {
        let mut shot = shot.clone();
        let (sin, cos) = (degrees as f32).to_radians().sin_cos();
        if let Some(light) = shot.lights.first_mut() {
            light.position = shot.camera.target + Vec3::new(0.9 * sin, 0.35, 0.9 * cos).normalize() * metres;
            light.direction = (shot.camera.target - light.position).normalize();
        }
        shot
    };
    let turn = linear(0.0, 180.0, steps).map(|degrees| at(degrees, lamp(&portrait, degrees, 1.0)));
    all.push(Sweep {
        name: "lamp-turns",
        moves: "azimuth of the lamp, degrees",
        is_geometric: false,
        steps: turn.collect(),
    });

    // The nearer a lamp, the softer its shadows; its light stays the same.
    let soft = geometric(3.0, 0.3, steps).map(|metres| {
        let mut shot = lamp(&portrait, 70.0, metres as f32);
        if let Some(light) = shot.lights.first_mut() {
            light.power_linear *= (metres * metres) as f32;
        }
        at(metres, shot)
    });
    all.push(Sweep {
        name: "shadow-softens",
        moves: "distance of the lamp, m",
        is_geometric: true,
        steps: soft.collect(),
    });

    // Half of the steps dark, half lit.
    let switch = linear(0.0, 1.0, steps).map(|t| {
        let mut shot = portrait.clone();
        if let Some(light) = shot.lights.first_mut() {
            light.power_linear *= if t < 0.5 { 0.0 } else { 1.0 };
        }
        at(t, shot)
    });
    all.push(Sweep {
        name: "lamp-switched-on",
        moves: "time, the lamp is on from 0.5",
        is_geometric: false,
        steps: switch.collect(),
    });

    // An expression from its opposite to twice itself: shapes, wrinkles and blood.
    for (name, text) in [("frown-weight", FROWN), ("blush-weight", BLUSH)] {
        let full = shot(name, text)?;
        let steps = linear(-1.0, 2.0, steps).map(|weight| {
            let mut shot = full.clone();
            let times = |values: &mut Vec<f32>| values.iter_mut().for_each(|v| *v *= weight as f32);
            times(&mut shot.face.shapes);
            times(&mut shot.face.zones);
            times(&mut shot.face.distributions);
            shot.face.hemoglobin_scale = (1.0 + (shot.face.hemoglobin_scale - 1.0) * weight as f32).max(0.0);
            at(weight, shot)
        });
        all.push(Sweep {
            name,
            moves: "weight of the expression",
            is_geometric: false,
            steps: steps.collect(),
        });
    }

    // An ear of a fortieth of its size to twice its size, filling the same picture.
    let ear = shot("ear", EAR)?;
    let sizes = geometric(0.025, 2.0, steps).map(|factor| {
        let mut shot = ear.clone();
        let f = factor as f32;
        shot.camera.position *= f;
        shot.camera.target *= f;
        for light in &mut shot.lights {
            light.position *= f;
            light.power_linear *= f * f;
        }
        Step { value: factor, shot, change: Some(Change::Size(f)) }
    });
    all.push(Sweep {
        name: "size",
        moves: "size of the head before a lamp behind it",
        is_geometric: true,
        steps: sizes.collect(),
    });

    // Blood without contrast, of which expressions still ask for some: the scale would be without limit.
    let blush = shot("blush", BLUSH)?;
    let flat = geometric(1.0, 0.001, steps).map(|factor| Step {
        value: factor,
        shot: blush.clone(),
        change: Some(Change::BloodContrast(factor as f32)),
    });
    all.push(Sweep {
        name: "blood-contrast",
        moves: "contrast of the neutral blood",
        is_geometric: true,
        steps: flat.collect(),
    });

    let frown = shot("frown", FROWN)?;
    let steep = linear(5.0, 89.0, steps).map(|degrees| Step {
        value: degrees,
        shot: frown.clone(),
        change: Some(Change::Relief(degrees as f32)),
    });
    all.push(Sweep {
        name: "relief",
        moves: "steepest slope of relief and wrinkles, degrees",
        is_geometric: false,
        steps: steep.collect(),
    });
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inputs;

    #[test]
    fn sweeps_move_one_thing_from_end_to_end() {
        let loaded = inputs::head(None).unwrap();
        let rig = inputs::rig(None, loaded.rig.clone()).unwrap();
        let all = sweeps(&loaded.head, &rig, 5, 64).unwrap();
        for sweep in &all {
            assert_eq!(sweep.steps.len(), 5, "{}", sweep.name);
            let rises = sweep.steps.windows(2).map(|w| w[1].value > w[0].value);
            assert!(rises.clone().all(|r| r) || rises.clone().all(|r| !r), "{}", sweep.name);
            let differs =
                sweep.steps.windows(2).any(|w| w[0].shot != w[1].shot || w[0].change != w[1].change);
            assert!(differs, "{}", sweep.name);
        }
        let size = all.iter().find(|s| s.name == "size").unwrap();
        let small = size.steps[0].head(&loaded.head).unwrap();
        let span = |head: &Head| head.bounds().map(|(low, high)| (high - low).length()).unwrap();
        assert!((span(&small) / span(&loaded.head) - 0.025).abs() < 1e-4);
        assert!(all[0].steps[0].head(&loaded.head).is_none());
        let of = |name: &str, step: usize| {
            all.iter().find(|s| s.name == name).unwrap().steps[step].head(&loaded.head).unwrap().maps
        };
        // What the scales multiply is what the neutral blood has lost, up to the limit.
        let spread = |maps: &SkinMaps| {
            let [neutral, mean] = [&maps.hemoglobin, &maps.hemoglobin_mean].map(|m| m.as_ref().unwrap());
            let at = |i: u32| (i as f32 + 0.5) / 64.0;
            let places = (0..64).flat_map(|y| (0..64).map(move |x| [at(x), at(y)]));
            places.map(|[u, v]| (neutral.sample(u, v, 0) - mean.sample(u, v, 0)).abs()).sum::<f32>()
        };
        let [whole, tenth] = [0, 4].map(|step| spread(&of("blood-contrast", step)));
        assert!(tenth < 0.005 * whole, "{tenth} of {whole}");
        let most = of("blood-contrast", 4)
            .distributions
            .iter()
            .flat_map(|d| d.scale.values.clone())
            .fold(0.0, f32::max);
        assert_eq!(most, MAX_SCALE);
        let steepest = of("relief", 4)
            .slopes
            .unwrap()
            .values
            .chunks_exact(2)
            .map(|s| s[0].hypot(s[1]))
            .fold(0.0, f32::max);
        assert!((steepest.atan().to_degrees() - 89.0).abs() < 0.01, "{steepest}");
    }
}
