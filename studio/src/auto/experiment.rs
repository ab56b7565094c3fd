//! Whether `auto` keeps its word: its choices in scenes that its estimates never saw, beside every fixed setting.
//!
//! ```text
//! scenes x every combination of choices --> error, time
//! bound --choose--> one of them in each scene --> bounds kept, time over the cheapest that keeps it
//! ```

use rubor_renderer::settings::{AntialiasMethod, ScatterMethod, Settings};
use rubor_rig::head::Head;
use serde::Serialize;

use super::{Auto, Bound, Chosen, Features, Outline, features_of};
use crate::error::{Failure, Outcome};
use crate::measure::chart::{Drawn, Measure, Scene, Truth, WAKING_FRAMES, draw};
use crate::report::{Adapter, AutoReport, AutoRow, median};
use crate::studio::Studio;
use crate::watch::Watch;

/// Frames that are timed, and rounds in which all combinations take turns.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Rounds.
    pub rounds: u32,
    /// Timed frames of a combination in a scene and a round; as many warm-up frames before them.
    pub frames: u32,
}

/// Errors and times of every combination, for each scene.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Features of the heads of each scene.
    pub features: Vec<Vec<Features>>,
    /// Index of the choice of each group of the calibration; of a held group none.
    pub combinations: Vec<Vec<Option<usize>>>,
    /// Mean FLIP by combination and scene.
    pub errors: Vec<Vec<f64>>,
    /// Milliseconds by combination and scene.
    pub ms: Vec<Vec<f64>>,
}

/// Draws and times every combination of choices in scenes of a head, or of as many of them as the studio has.
///
/// # Errors
/// A device without timestamps; errors of the studio.
pub fn measured(
    studio: &mut Studio,
    head: &Head,
    base: &Settings,
    scenes: &[Scene],
    auto: &Auto,
    timing: Timing,
    watch: &mut dyn Watch,
) -> Outcome<Measured> {
    if !studio.has_timestamps() {
        let Adapter { name, .. } = studio.adapter();
        return Err(Failure::job(format!("{name} has no timestamps, so choices cannot be timed")));
    }
    let outline = Outline::of(head);
    let size = base.output.size;
    let of = |scene: &Scene| {
        let shots = scene.shots();
        features_of(&vec![&outline; shots.len()], &shots, scene.spacing_m, size)
    };
    let features: Vec<_> = scenes.iter().map(of).collect();
    measure(studio, base, scenes, (auto, features), timing, watch)
}

/// Judges `auto` under each bound of error by what was measured with a base of settings.
pub fn judged(
    adapter: Adapter,
    base: &Settings,
    scenes: &[Scene],
    auto: &Auto,
    bounds: &[f64],
    measured: &Measured,
) -> AutoReport {
    let rows = bounds
        .iter()
        .map(|bound| {
            let auto = Auto { bound: Bound::Flip(*bound), ..auto.clone() };
            let choose = |heads: &Vec<Features>| auto.choose(heads, base.output.size, None);
            row(*bound, measured, &measured.features.iter().map(choose).collect::<Vec<_>>())
        })
        .collect();
    AutoReport {
        adapter,
        settings: base.clone(),
        scenes: scenes.iter().map(|s| s.name.clone()).collect(),
        combinations: measured.combinations.len(),
        rows,
    }
}

fn row(bound: f64, measured: &Measured, chosen: &[Chosen]) -> AutoRow {
    let scenes = chosen.len();
    let all = || 0..measured.combinations.len();
    let keeps = |c: usize, s: usize| measured.errors[c][s] <= bound;
    let cheapest = |s: usize| {
        all().filter(|c| keeps(*c, s)).min_by(|a, b| measured.ms[*a][s].total_cmp(&measured.ms[*b][s]))
    };
    let own: Vec<usize> = chosen
        .iter()
        .map(|chosen| measured.combinations.iter().position(|c| *c == chosen.choices).unwrap_or(0))
        .collect();
    let possible: Vec<(usize, usize)> = (0..scenes).filter_map(|s| Some((s, cheapest(s)?))).collect();
    let kept = possible.iter().filter(|(s, _)| keeps(own[*s], *s)).count();
    let own_ms: f64 = possible.iter().map(|(s, _)| measured.ms[own[*s]][*s]).sum();
    let least_ms: f64 = possible.iter().map(|(s, c)| measured.ms[*c][*s]).sum();
    // One setting for all scenes: the cheapest that keeps the bound in as many of them as `auto` does.
    let fixed_ms = all()
        .filter(|c| possible.iter().filter(|(s, _)| keeps(*c, *s)).count() >= kept)
        .map(|c| possible.iter().map(|(s, _)| measured.ms[c][*s]).sum::<f64>())
        .fold(f64::INFINITY, f64::min);
    let n = possible.len().max(1) as f64;
    AutoRow {
        bound,
        possible: possible.len(),
        kept,
        mean_ms: own_ms / n,
        over_cheapest: own_ms / least_ms.max(1e-9),
        over_fixed: Some(own_ms / fixed_ms).filter(|r| r.is_finite() && *r > 0.0),
        mean_flip: possible.iter().map(|(s, _)| measured.errors[own[*s]][*s]).sum::<f64>() / n,
    }
}

fn measure(
    studio: &mut Studio,
    base: &Settings,
    scenes: &[Scene],
    (auto, features): (&Auto, Vec<Vec<Features>>),
    timing: Timing,
    watch: &mut dyn Watch,
) -> Outcome<Measured> {
    let combinations = auto.combinations();
    let settings = |c: &Vec<Option<usize>>| {
        let chosen = Chosen { choices: c.clone(), ..Chosen::default() };
        auto.settings(base, &chosen)
    };
    let all: Vec<Settings> = combinations.iter().map(settings).collect::<Outcome<_>>()?;
    let Some(mut right) = all.last().cloned() else {
        return Err(Failure::input("there is nothing to choose"));
    };
    right.quality.scatter = ScatterMethod::ReferenceScreen;
    right.quality.antialias = AntialiasMethod::Ssaa(8);
    let truths: Vec<Truth> = scenes
        .iter()
        .map(|scene| Truth::draw(studio, scene, &right, Measure::Picture, base))
        .collect::<Outcome<_>>()?;
    watch.begin("combinations", all.len() as u64);
    let mut errors = Vec::new();
    for settings in &all {
        let mut shown = Vec::new();
        for scene in scenes {
            shown.push(draw(studio, scene, settings, false)?);
        }
        errors.push(flips(&shown, &truths));
        watch.step();
    }
    watch.end();
    let mut times = vec![vec![Vec::new(); scenes.len()]; all.len()];
    // A device that has had nothing to do runs slower.
    if let (Some(scene), Some(settings)) = (scenes.first(), all.last()) {
        studio.measure(&scene.shots(), scene.spacing_m, settings, WAKING_FRAMES, 1)?;
    }
    watch.begin("combinations timed", u64::from(timing.rounds) * all.len() as u64);
    for _ in 0..timing.rounds {
        for (settings, times) in all.iter().zip(&mut times) {
            for (scene, times) in scenes.iter().zip(times) {
                let frames = studio.measure(
                    &scene.shots(),
                    scene.spacing_m,
                    settings,
                    timing.frames,
                    timing.frames,
                )?;
                times.extend(frames.iter().map(|f| f.frame_ms));
            }
            watch.step();
        }
    }
    watch.end();
    let medians =
        |times: Vec<Vec<f64>>| times.into_iter().map(|mut t| median(&mut t).unwrap_or(0.0)).collect();
    Ok(Measured { features, combinations, errors, ms: times.into_iter().map(medians).collect() })
}

/// Mean FLIP of each picture, on all cores.
fn flips(shown: &[Drawn], truths: &[Truth]) -> Vec<f64> {
    let of = |(shown, truth): (&Drawn, &Truth)| truth.error(shown).0.flip_mean;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let share = shown.len().div_ceil(cores).max(1);
    std::thread::scope(|scope| {
        let jobs: Vec<_> = (shown.chunks(share).zip(truths.chunks(share)))
            .map(|(shown, truths)| {
                scope.spawn(move || shown.iter().zip(truths).map(of).collect::<Vec<f64>>())
            })
            .collect();
        jobs.into_iter().flat_map(|job| job.join().unwrap_or_default()).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_counts_bounds_kept_and_the_price() {
        let combinations = vec![vec![Some(0)], vec![Some(1)], vec![Some(2)]];
        // Two scenes; the third combination is right and dear, the second keeps the bound in the first scene.
        let measured = Measured {
            features: Vec::new(),
            combinations,
            errors: vec![vec![0.5, 0.5], vec![0.01, 0.1], vec![0.0, 0.0]],
            ms: vec![vec![1.0, 1.0], vec![2.0, 2.0], vec![4.0, 4.0]],
        };
        let chosen = |c: usize| Chosen { choices: vec![Some(c)], ..Chosen::default() };
        let found = row(0.02, &measured, &[chosen(1), chosen(2)]);
        assert_eq!((found.possible, found.kept), (2, 2));
        assert_eq!((found.over_cheapest, found.over_fixed), (1.0, Some(6.0 / 8.0)));
        let broken = row(0.02, &measured, &[chosen(1), chosen(1)]);
        assert_eq!(broken.kept, 1);
    }
}
