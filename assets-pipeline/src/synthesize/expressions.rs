//! Hemoglobin of expressions and conditions, as local statistics.
//!
//! A full map of each state is made from the neutral one and reduced to mean and deviation (Jimenez 2012 eq. 7.1, 7.5).
//! The rules follow the findings of section 7.3.1: blood leaves compressed skin and gathers elsewhere (over the cheek
//! bones in a smile); the pattern of a person's vessels stays and only its strength changes; exercise and alcohol
//! have different patterns, neither is the neutral map times a number. Changes are relative to neutral and differ a
//! few percent between the sides.

use glam::Vec3;
use rayon::prelude::*;
use rubor_rig::head::Distribution;
use rubor_rig::hemoglobin::{self, HemoglobinError};
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;

use super::face_space::canonical_landmarks;
use super::noise::{Stream, noise};
use super::regions::Regions;
use super::surface::{Coverage, Site};

/// Relative change of the mean hemoglobin by region, and how much patchier it becomes.
struct State {
    name: &'static str,
    /// Factor of `everywhere` and `change`, tuned by eye on the default head under the skin look-up, whose colour
    /// follows about the cube root of hemoglobin.
    strength: f32,
    everywhere: f32,
    change: fn(&Regions) -> f32,
    /// Factor of the relative spread where the mean rises fully.
    patchiness: f32,
}

const STATES: [State; 9] = [
    State {
        name: "joy",
        strength: 1.05,
        everywhere: 0.0,
        // The cheek is lifted against the bone; lips and the fold's rim are stretched thin.
        change: |r| {
            0.10 * r.cheek_bone + 0.46 * r.cheek - 0.20 * r.lips - 0.10 * r.upper_lip - 0.12 * r.chin
                + 0.05 * r.nose_wing
                - 0.10 * r.under_eye
        },
        patchiness: 0.92,
    },
    State {
        name: "surprise",
        strength: 1.4,
        everywhere: -0.03,
        // The frontalis folds the forehead; the jaw drops and stretches cheeks and lips.
        change: |r| {
            0.16 * r.forehead
                - 0.10 * r.cheek
                - 0.12 * r.lower_cheek
                - 0.14 * r.lips
                - 0.08 * r.chin
                - 0.06 * r.lids
        },
        patchiness: 1.0,
    },
    State {
        name: "fear",
        strength: 1.6,
        everywhere: -0.16,
        // Vessels close; the mouth is drawn wide.
        change: |r| {
            -0.14 * r.cheek
                - 0.12 * r.lower_cheek
                - 0.20 * r.lips
                - 0.10 * r.forehead
                - 0.12 * r.upper_lip
                - 0.10 * r.nose
                - 0.08 * r.ear
        },
        patchiness: 0.85,
    },
    State {
        name: "anger",
        strength: 1.6,
        everywhere: 0.08,
        // Brows press blood up the forehead; face, ears and neck flush; lips are pressed pale.
        change: |r| {
            0.34 * r.forehead
                + 0.16 * r.glabella
                + 0.20 * r.temple
                + 0.22 * r.cheek
                + 0.18 * r.lower_cheek
                + 0.30 * r.ear
                + 0.26 * r.neck
                + 0.16 * r.nose
                - 0.28 * r.lips
                - 0.14 * r.upper_lip
                - 0.06 * r.chin
        },
        patchiness: 1.2,
    },
    State {
        name: "disgust",
        strength: 1.4,
        everywhere: -0.02,
        // The nose is wrinkled and drained, the cheek beside it is bunched.
        change: |r| {
            -0.24 * r.nose + 0.16 * r.nose_wing + 0.26 * r.cheek + 0.10 * r.cheek_bone
                - 0.20 * r.upper_lip
                - 0.10 * r.lips
                + 0.10 * r.glabella
                + 0.10 * r.under_eye
        },
        patchiness: 1.1,
    },
    State {
        name: "sadness",
        strength: 1.5,
        everywhere: -0.04,
        // Eyes and the tip of the nose redden; the tensed chin drains.
        change: |r| {
            0.30 * r.lids + 0.26 * r.under_eye + 0.35 * r.lid_edge + 0.30 * r.nose_tip + 0.18 * r.nose_wing
                - 0.10 * r.cheek
                - 0.18 * r.chin
                + 0.06 * r.lips
                + 0.06 * r.forehead
        },
        patchiness: 1.05,
    },
    State {
        name: "exercise",
        strength: 1.9,
        everywhere: 0.16,
        // Heat is shed over a large area: cheeks, forehead, temples, neck; the mouth's surroundings stay pale.
        change: |r| {
            0.46 * r.cheek
                + 0.38 * r.lower_cheek
                + 0.30 * r.cheek_bone
                + 0.34 * r.forehead
                + 0.34 * r.temple
                + 0.24 * r.chin
                + 0.30 * r.neck
                + 0.24 * r.ear
                + 0.08 * r.nose
                + 0.10 * r.lips
                - 0.22 * r.upper_lip
        },
        patchiness: 1.0,
    },
    State {
        name: "alcohol",
        strength: 1.9,
        everywhere: 0.05,
        // Centred on nose and inner cheeks, with lids and ears.
        change: |r| {
            0.46 * r.nose
                + 0.40 * r.nose_tip
                + 0.34 * r.nose_wing
                + 0.50 * r.cheek
                + 0.10 * r.cheek_bone
                + 0.24 * r.lids
                + 0.14 * r.chin
                + 0.26 * r.ear
                + 0.06 * r.forehead
                + 0.08 * r.lips
        },
        patchiness: 1.4,
    },
    State {
        name: "blush",
        strength: 2.2,
        everywhere: 0.04,
        // Cheeks and ears first, spreading to the neck in blotches.
        change: |r| {
            0.46 * r.cheek
                + 0.36 * r.cheek_bone
                + 0.24 * r.lower_cheek
                + 0.55 * r.ear
                + 0.26 * r.neck
                + 0.14 * r.forehead
                + 0.12 * r.nose
                + 0.10 * r.chin
        },
        patchiness: 0.72,
    },
];

/// Effect of one state at a place: factors of mean and of relative spread.
fn response(state: &State, index: usize, side: f32, place: Vec3, r: &Regions, seed: u32) -> (f32, f32) {
    let lateral = (place.x / 25.0).clamp(-1.0, 1.0);
    let own = noise(place, 24.0, seed ^ (0x600 + index as u32));
    let change = (state.change)(r) * (1.0 + side * lateral) * (1.0 + 0.14 * own) + state.everywhere;
    let rise = (change / 0.5).clamp(0.0, 1.0);
    ((1.0 + state.strength * change).max(0.25), 1.0 + (state.patchiness - 1.0) * rise)
}

/// Every state where the place of the face is not known: its name, and the factor of the mean hemoglobin that it has on
/// average over the landmarks of the canonical face.
pub(crate) fn mean_factors() -> Vec<(&'static str, f32)> {
    let regions: Vec<Regions> = canonical_landmarks().map(Regions::at).collect();
    let mean = |state: &State| {
        let changes: f32 = regions.iter().map(|r| (state.change)(r)).sum();
        1.0 + state.strength * (changes / regions.len() as f32 + state.everywhere)
    };
    STATES.iter().map(|state| (state.name, mean(state).max(0.25))).collect()
}

/// Place, regions, mean and value of the neutral map at a texel.
type Neutral = (Vec3, Regions, f32, f32);

/// Neutral and all states as statistics in discs of `radius_px` texels of `coverage`.
///
/// The map is `mu_n` (`bias_0` of eq. 7.5). `hemoglobin` gives the regions, the mean and the value of the neutral map at a place.
pub(crate) fn distributions(
    coverage: &Coverage<'_>,
    radius_px: u32,
    size: u32,
    seed: u32,
    hemoglobin: impl Fn(&Site) -> (Regions, f32, f32) + Sync,
) -> Result<(Map, Vec<Distribution>), HemoglobinError> {
    let mut stream = Stream::new(seed ^ 0x51de);
    let sides: Vec<f32> = STATES.iter().map(|_| (0.045 * stream.normal()).clamp(-0.09, 0.09)).collect();
    let side = coverage.resolution();
    let sites: Vec<Option<Neutral>> = (0..side * side)
        .into_par_iter()
        .map(|i| {
            let site = coverage.site(i % side, i / side)?;
            let (r, mean, value) = hemoglobin(&site);
            Some((site.place, r, mean, value))
        })
        .collect();
    let mask = Mask { width: side, height: side, mapped: sites.iter().map(Option::is_some).collect() };
    let map_of = |value: &(dyn Fn(&Neutral) -> f32 + Sync)| Map {
        width: side,
        height: side,
        channels: 1,
        values: sites.par_iter().map(|s| s.as_ref().map_or(0.0, value)).collect(),
    };
    let neutral = hemoglobin::neutral(&map_of(&|(_, _, _, value)| *value), &mask, radius_px, size)?;
    let mut all = Vec::new();
    for (index, state) in STATES.iter().enumerate() {
        let target = map_of(&|(place, r, mean, value)| {
            let (gain, spread) = response(state, index, sides[index], *place, r, seed);
            gain * (mean + spread * (value - mean))
        });
        all.push(hemoglobin::distribution(state.name, &neutral, &target, &mask, radius_px, size)?);
    }
    Ok((neutral.mean, all))
}
