//! Measures a device for settings by need: random shots, what they show, errors and times of choices.
//!
//! ```text
//! head --random_shots--> scenes --chart--> errors \
//!                            +--times in two sizes--> Calibration
//! ```

use rubor_renderer::settings::Settings;
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;

use super::calibration::Times;
use super::shots::{calibrated, random_shots};
use super::{Calibration, Features, Outline};
use crate::error::{Failure, Outcome};
use crate::measure::chart::{self, Effort, RightLight, Suite, Timing};
use crate::report::ChartReport;
use crate::studio::Studio;
use crate::watch::Watch;

/// Seed of the random shots.
const SEED: u64 = 1;

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
    let calibration = Calibration::of(&report, &features, &times)
        .ok_or_else(|| Failure::job("the shots do not suffice for estimates").hint("more --shots"))?;
    Ok(Measured { calibration, features, report })
}
