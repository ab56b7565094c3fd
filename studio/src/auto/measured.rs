//! Measures a device for settings by need: random shots, what they show, errors and times of choices.
//!
//! ```text
//! head --random_shots--> scenes --chart--> errors of choices \
//!                            +--errors of random combinations--> Calibration
//!                            +--times in two sizes /             \--choices under bounds--> wider margins, until they are kept
//! ```

use std::collections::BTreeMap;

use rubor_renderer::settings::{AntialiasMethod, Leaf, ScatterMethod, Settings};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::random::SplitMix64;

use super::calibration::{Combined, Fitted, Times};
use super::shots::{calibrated, random_shots};
use super::{Auto, Bound, Calibration, Features, Outline};
use crate::error::{Failure, Outcome};
use crate::measure::chart::{self, Effort, Group, Measure, RightLight, Scene, Suite, Timing, Truth, draw};
use crate::report::ChartReport;
use crate::studio::Studio;
use crate::watch::Watch;

/// Seed of the random shots.
const SEED: u64 = 1;
/// Random combinations of choices in a shot.
const COMBINATIONS: usize = 6;
/// Bounds of FLIP under which choices are tried, and the share of shots that has to keep them.
const TRIED_BOUNDS: [f64; 3] = [0.01, 0.02, 0.04];
const KEPT: f64 = 0.95;
/// Factor by which margins grow until they are kept, and the number of times.
const WIDER: f64 = 1.2;
const MOST_TRIALS: usize = 10;

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
    let right = full_quality(base)?;
    let truth = |scene: &Scene| Truth::draw(studio, scene, &right, Measure::Picture, base);
    let truths: Vec<Truth> = scenes.iter().map(truth).collect::<Outcome<_>>()?;
    let mut trials =
        Trials { studio: &mut *studio, scenes: &scenes, truths: &truths, base, known: BTreeMap::new() };
    let combined = trials.combined(&groups(base)?, watch)?;
    let known = trials.known;
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
    let fitted = Calibration::of(&report, &features, &times, &combined)
        .ok_or_else(|| Failure::job("the shots do not suffice for estimates").hint("more --shots"))?;
    let mut trials = Trials { studio, scenes: &scenes, truths: &truths, base, known };
    let calibration = trials.kept(fitted, &features, watch)?;
    Ok(Measured { calibration, features, report })
}

/// Combinations of choices that are drawn in scenes and compared with full quality.
struct Trials<'a> {
    studio: &'a mut Studio,
    scenes: &'a [Scene],
    truths: &'a [Truth],
    base: &'a Settings,
    /// Mean FLIP and relative RMSE by scene and choices.
    known: BTreeMap<(usize, Vec<usize>), [f64; 2]>,
}

impl Trials<'_> {
    /// Errors of choices in a scene.
    fn errors(&mut self, shot: usize, choices: &[usize], settings: &Settings) -> Outcome<[f64; 2]> {
        if let Some(known) = self.known.get(&(shot, choices.to_vec())) {
            return Ok(*known);
        }
        let (error, _) = self.truths[shot].error(&draw(self.studio, &self.scenes[shot], settings, false)?);
        let errors = [error.flip_mean, error.relative_rmse];
        self.known.insert((shot, choices.to_vec()), errors);
        Ok(errors)
    }

    /// Random combinations in every scene.
    fn combined(&mut self, groups: &[Group], watch: &mut dyn Watch) -> Outcome<Vec<Combined>> {
        let mut random = SplitMix64(SEED);
        let mut all = Vec::new();
        watch.begin("combinations", self.scenes.len() as u64);
        for shot in 0..self.scenes.len() {
            for _ in 0..COMBINATIONS {
                let choices: Vec<usize> = groups.iter().map(|g| random.below(g.choices.len())).collect();
                let mut settings = self.base.clone();
                for (group, choice) in groups.iter().zip(&choices) {
                    let (_, chosen) = &group.choices[*choice];
                    if let (Some(leaf), Ok(all)) = (Leaf::of_flag(&group.flag), serde_json::to_value(chosen))
                    {
                        settings.overlay(&leaf.change(leaf.value_in(&all)))?;
                    }
                }
                let errors = self.errors(shot, &choices, &settings)?;
                all.push(Combined { shot, choices, errors });
            }
            watch.step();
        }
        watch.end();
        Ok(all)
    }

    /// Widens margins until what is chosen under bounds keeps them: the cheapest of many choices is one whose error is estimated too low
    /// more often than any choice is. What is chosen in a shot is chosen by estimates that do not know it.
    fn kept(&mut self, fitted: Fitted, features: &[Features], watch: &mut dyn Watch) -> Outcome<Calibration> {
        let size = self.base.output.size;
        let Fitted { mut calibration, mut left_out } = fitted;
        let auto = |calibration: &Calibration, most: f64| Auto {
            bound: Bound::Flip(most),
            held: Vec::new(),
            calibration: calibration.clone(),
        };
        for _ in 0..MOST_TRIALS {
            let (mut chosen, mut kept) = (0usize, 0usize);
            watch.begin("choices under bounds", (TRIED_BOUNDS.len() * self.scenes.len()) as u64);
            for (shot, (f, without)) in features.iter().zip(&left_out).enumerate() {
                for most in TRIED_BOUNDS {
                    let auto = auto(without, most);
                    let found = auto.choose(&[*f], size, None);
                    let choices: Vec<usize> = found.choices.iter().filter_map(|c| *c).collect();
                    if found.is_kept {
                        let settings = auto.settings(self.base, &found)?;
                        chosen += 1;
                        kept += usize::from(self.errors(shot, &choices, &settings)?[0] <= most);
                    }
                    watch.step();
                }
            }
            watch.end();
            if kept as f64 >= KEPT * chosen as f64 {
                break;
            }
            calibration = calibration.widened(WIDER);
            left_out = left_out.into_iter().map(|c| c.widened(WIDER)).collect();
        }
        Ok(calibration)
    }
}

/// What combinations of choices are compared with: the last choice of each, the integral over the screen that the chart compares with, and more samples than any
/// of them.
pub(super) fn full_quality(base: &Settings) -> Outcome<Settings> {
    let mut right = base.clone();
    for (flag, values) in calibrated()? {
        if let (Some(leaf), Some(value)) = (Leaf::of_flag(&flag), values.last()) {
            right.overlay(&leaf.change(value))?;
        }
    }
    right.quality.scatter = ScatterMethod::ReferenceScreen;
    right.quality.antialias = AntialiasMethod::Ssaa(8);
    Ok(right)
}
