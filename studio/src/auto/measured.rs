//! Measures a device for settings by need: random shots, what they show, errors and times of choices.
//!
//! ```text
//! head --random_shots--> scenes --chart--> errors of choices \
//!                            +--errors of random combinations--> Calibration
//!                            +--times in two sizes /
//! ```

use rubor_renderer::settings::{AntialiasMethod, Leaf, ScatterMethod, Settings};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::random::SplitMix64;

use super::calibration::{Combined, Times};
use super::shots::{calibrated, random_shots};
use super::{Calibration, Features, Outline};
use crate::error::{Failure, Outcome};
use crate::measure::chart::{self, Effort, Group, Measure, RightLight, Scene, Suite, Timing, Truth, draw};
use crate::report::ChartReport;
use crate::studio::Studio;
use crate::watch::Watch;

/// Seed of the random shots.
const SEED: u64 = 1;
/// Random combinations of choices in a shot.
const COMBINATIONS: usize = 8;

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Random shots.
    pub shots: usize,
    /// Samples on a side of a pixel of the picture that is right for antialiasing.
    pub samples: u32,
    /// How frames are timed.
    pub timing: Timing,
    /// A larger size than that of the base, for times alone: what a pixel costs, and what a frame costs without any.
    pub large: [u32; 2],
}

/// What was measured.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The estimates.
    pub calibration: Calibration,
    /// What each shot shows.
    pub features: Vec<Features>,
    /// Errors of choices in each shot.
    pub report: ChartReport,
}

/// Measures the device of a studio on a head with its rig.
///
/// # Errors
/// Too few shots; a device without timestamps; errors of the studio.
pub fn run(
    studio: &mut Studio,
    head: &Head,
    rig: &Rig,
    base: &Settings,
    options: &Options,
    watch: &mut dyn Watch,
) -> Outcome<Measured> {
    if !studio.has_timestamps() {
        let name = studio.adapter().name;
        return Err(Failure::job(format!("{name} has no timestamps, so choices cannot be timed")));
    }
    let scenes = random_shots(head, rig, options.shots, SEED)?;
    let effort = Effort { light: RightLight::Screen, samples: options.samples };
    let groups = |base: &Settings| chart::groups(Suite::Whole, base, &calibrated()?, &[], effort);
    studio.set_heads([head])?;
    let untimed = chart::Options { timing: None, folder: None, light: false };
    let report = chart::run(studio, base, &scenes, &groups(base)?, &untimed, watch)?;
    let combined = combined(studio, &scenes, &groups(base)?, base, watch)?;
    let mut times = Vec::new();
    for size in [base.output.size, options.large] {
        let mut sized = base.clone();
        sized.output.size = size;
        times.push(Times {
            size,
            ms: chart::times(studio, &scenes, &groups(&sized)?, options.timing, watch)?,
        });
    }
    let outline = Outline::of(head);
    let features: Vec<_> = scenes.iter().map(|s| outline.features(&s.shot, base.output.size)).collect();
    let calibration = Calibration::of(&report, &features, &times, &combined)
        .ok_or_else(|| Failure::job("the shots do not suffice for estimates").hint("more --shots"))?;
    Ok(Measured { calibration, features, report })
}

/// Draws random combinations of choices in scenes and measures how far they are from full quality.
fn combined(
    studio: &mut Studio,
    scenes: &[Scene],
    groups: &[Group],
    base: &Settings,
    watch: &mut dyn Watch,
) -> Outcome<Vec<Combined>> {
    let mut random = SplitMix64(SEED);
    let mut all = Vec::new();
    let right = full_quality(base)?;
    watch.begin("combinations", scenes.len() as u64);
    for (shot, scene) in scenes.iter().enumerate() {
        let truth = Truth::draw(studio, scene, &right, Measure::Picture, base)?;
        for _ in 0..COMBINATIONS {
            let choices: Vec<usize> = groups.iter().map(|g| random.below(g.choices.len())).collect();
            let mut settings = base.clone();
            for (group, choice) in groups.iter().zip(&choices) {
                let (_, chosen) = &group.choices[*choice];
                if let (Some(leaf), Ok(all)) = (Leaf::of_flag(&group.flag), serde_json::to_value(chosen)) {
                    settings.overlay(&leaf.change(leaf.value_in(&all)))?;
                }
            }
            let (error, _) = truth.error(&draw(studio, scene, &settings, false)?);
            all.push(Combined { shot, choices, errors: [error.flip_mean, error.relative_rmse] });
        }
        watch.step();
    }
    watch.end();
    Ok(all)
}

/// What combinations of choices are compared with: the last choice of each, and more taps and samples than any of them.
pub(super) fn full_quality(base: &Settings) -> Outcome<Settings> {
    let mut right = base.clone();
    for (flag, values) in calibrated()? {
        if let (Some(leaf), Some(value)) = (Leaf::of_flag(&flag), values.last()) {
            right.overlay(&leaf.change(value))?;
        }
    }
    right.quality.scatter = ScatterMethod::Separable(65);
    right.quality.antialias = AntialiasMethod::Ssaa(8);
    Ok(right)
}
