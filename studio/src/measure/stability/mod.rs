//! Stability: what methods do while one quantity moves in small steps.
//!
//! ```text
//! sweeps x choices --> pictures of steps \
//! sweeps x truths  --> pictures of steps / --> change of each step less that of the truth, halo, energy, cost --> report
//! ```
//!
//! The truth of a choice is the same choice with many samples per pixel, and for light in skin `reference-screen`: what moves
//! in the truth may move, the rest is flicker. A step that changes the picture much more than its neighbours is a jump.

pub mod page;
pub mod sweeps;

use rubor_renderer::channels::Channel;
use rubor_renderer::settings::{AntialiasMethod, DetailMethod, ScatterMethod, Settings};
use rubor_rig::evaluate::Shot;
use rubor_rig::head::Head;

pub use sweeps::{Step, Sweep, sweeps};

use super::chart::{Group, SETTLED_FRAMES};
use super::difference::pixels;
use crate::error::{Failure, Outcome};
use crate::report::{StabilityReport, StabilityRow, SweepReport, median};
use crate::studio::Studio;
use crate::watch::Watch;

/// Options of the sweeps.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Samples on a side of a pixel of truths.
    pub samples: u32,
    /// Timed frames of each step; 0 times nothing.
    pub frames: u32,
}

/// A picture with what its measures need.
struct Shown {
    /// Displayed light, linear.
    linear: Vec<[f32; 3]>,
    /// Sum of diffuse light on skin, and values that are no numbers.
    energy: f64,
    broken: usize,
    ms: Option<f64>,
}

/// Truth of a step.
struct Right {
    linear: Vec<[f32; 3]>,
    /// Pixels that no head touches, two pixels away from any.
    outside: Vec<bool>,
    energy: f64,
}

/// Sweeps each choice of groups; `head` is the one that the sweeps were made for.
///
/// # Errors
/// Errors of the studio.
pub fn run(
    studio: &mut Studio,
    head: &Head,
    base: &Settings,
    sweeps: &[Sweep],
    groups: &[Group],
    options: Options,
    watch: &mut dyn Watch,
) -> Outcome<StabilityReport> {
    let choices: Vec<(&str, &str, &Settings)> = groups
        .iter()
        .flat_map(|g| g.choices.iter().map(|(name, settings)| (g.flag.as_str(), name.as_str(), settings)))
        .filter(|(.., s)| {
            !matches!(s.quality.scatter, ScatterMethod::ReferenceScreen | ScatterMethod::ReferenceSurface(_))
        })
        .collect();
    let frames = options.frames * u32::from(studio.has_timestamps());
    let total: usize = sweeps.iter().map(|s| s.steps.len()).sum();
    watch.begin("steps", (total * (choices.len() + 1)) as u64);
    let (mut rows, mut told) = (Vec::new(), Vec::new());
    for sweep in sweeps {
        let rights = rights(studio, head, base, sweep, options.samples, watch)?;
        let mut all: Vec<Vec<Shown>> = choices.iter().map(|_| Vec::new()).collect();
        // Where the head changes, it is loaded once a step; else a choice runs through its steps, as a film does.
        if sweep.steps.iter().any(|step| step.change.is_some()) {
            for step in &sweep.steps {
                enter(studio, head, step)?;
                for ((.., settings), shown) in choices.iter().zip(&mut all) {
                    studio.cut(0);
                    shown.push(show(studio, &step.shot, settings, frames)?);
                    watch.step();
                }
            }
        } else {
            enter_plain(studio, head)?;
            for ((.., settings), shown) in choices.iter().zip(&mut all) {
                studio.cut(0);
                // A film does not begin with the first step.
                if let (true, Some(first)) = (settings.quality.antialias.is_temporal(), sweep.steps.first()) {
                    for _ in 0..SETTLED_FRAMES {
                        show(studio, &first.shot, settings, 0)?;
                    }
                }
                for step in &sweep.steps {
                    shown.push(show(studio, &step.shot, settings, 0)?);
                    watch.step();
                }
                // Timing draws frames of its own, which would be history.
                if frames > 0 {
                    for (step, shown) in sweep.steps.iter().zip(shown.iter_mut()) {
                        shown.ms = time(studio, &step.shot, settings, frames)?;
                    }
                }
            }
        }
        for ((group, name, _), shown) in choices.iter().zip(&all) {
            rows.push(row(group, name, sweep, shown, &rights));
        }
        told.push(SweepReport {
            name: sweep.name.to_owned(),
            moves: sweep.moves.to_owned(),
            is_geometric: sweep.is_geometric,
            values: sweep.steps.iter().map(|s| s.value).collect(),
        });
    }
    watch.end();
    enter_plain(studio, head)?;
    Ok(StabilityReport { adapter: studio.adapter(), settings: base.clone(), sweeps: told, rows })
}

fn enter_plain(studio: &mut Studio, head: &Head) -> Outcome {
    studio.set_heads([head])
}

fn enter(studio: &mut Studio, head: &Head, step: &Step) -> Outcome {
    match step.head(head) {
        Some(scaled) => studio.set_heads([&scaled]),
        None => studio.set_heads([head]),
    }
}

fn time(studio: &mut Studio, shot: &Shot, settings: &Settings, frames: u32) -> Outcome<Option<f64>> {
    let times = studio.measure(std::slice::from_ref(shot), 0.0, settings, frames.div_ceil(2), frames)?;
    Ok(median(&mut times.iter().map(|t| t.frame_ms).collect::<Vec<_>>()))
}

fn show(studio: &mut Studio, shot: &Shot, settings: &Settings, frames: u32) -> Outcome<Shown> {
    let mut settings = settings.clone();
    settings.output.channels = vec![Channel::Diffuse, Channel::Albedo];
    let frame = studio.render(std::slice::from_ref(shot), 0.0, &settings)?;
    let [diffuse, albedo] = frame.channels.as_slice() else {
        return Err(Failure::job("the frame has no diffuse light"));
    };
    let broken = diffuse.values.iter().filter(|v| !v.is_finite()).count();
    let lit = diffuse.texels::<4>().zip(albedo.texels::<4>()).filter(|(_, a)| a[3] > 0.0);
    let energy: f64 = lit.map(|(d, _)| f64::from(d[0] + d[1] + d[2])).sum();
    let n = f64::from(settings.samples_per_side().pow(2));
    let ms = if frames > 0 { time(studio, shot, &settings, frames)? } else { None };
    Ok(Shown { linear: pixels(&frame.image).linear, energy: energy / n, broken, ms })
}

fn rights(
    studio: &mut Studio,
    head: &Head,
    base: &Settings,
    sweep: &Sweep,
    samples: u32,
    watch: &mut dyn Watch,
) -> Outcome<Vec<Right>> {
    let mut settings = base.clone();
    settings.quality.scatter = ScatterMethod::ReferenceScreen;
    settings.quality.detail = DetailMethod::Full;
    let mut smooth = settings.clone();
    smooth.quality.scatter = ScatterMethod::Separable(65);
    smooth.quality.antialias = AntialiasMethod::Ssaa(samples);
    smooth.output.channels = vec![Channel::Radiance];
    settings.quality.antialias = AntialiasMethod::None;
    let [width, height] = base.output.size.map(|n| n as usize);
    let n = smooth.samples_per_side() as usize;
    let mut all = Vec::new();
    if sweep.steps.iter().all(|step| step.change.is_none()) {
        enter_plain(studio, head)?;
    }
    for step in &sweep.steps {
        if step.change.is_some() {
            enter(studio, head, step)?;
        }
        studio.cut(0);
        let energy = show(studio, &step.shot, &settings, 0)?.energy;
        let frame = studio.render(std::slice::from_ref(&step.shot), 0.0, &smooth)?;
        let covered: Vec<bool> = match frame.channels.as_slice() {
            [radiance] => radiance.texels::<4>().map(|p| p[3] > 0.0).collect(),
            _ => return Err(Failure::job("the frame has no radiance")),
        };
        let linear = pixels(&frame.image).linear;
        let mut is_bare = vec![true; width * height];
        for (i, _) in covered.iter().enumerate().filter(|(_, c)| **c) {
            is_bare[i / (width * n) / n * width + i % (width * n) / n] = false;
        }
        let outside = outside(&linear, &is_bare, width);
        all.push(Right { linear, outside, energy });
        watch.step();
    }
    Ok(all)
}

/// Pixels that show the backdrop and nothing else, as do all within two pixels: hairs cover pixels without being surfaces.
fn outside(linear: &[[f32; 3]], is_bare: &[bool], width: usize) -> Vec<bool> {
    let height = linear.len() / width.max(1);
    // Hairs darken and lighten; the backdrop is what most bare pixels have.
    let mut counts: Vec<([f32; 3], usize)> = Vec::new();
    for (color, _) in linear.iter().zip(is_bare).filter(|(_, bare)| **bare) {
        match counts.iter().position(|(known, _)| known == color) {
            Some(i) => counts[i].1 += 1,
            None if counts.len() < MOST_COLORS => counts.push((*color, 1)),
            None => {}
        }
    }
    let Some((backdrop, _)) = counts.into_iter().max_by_key(|(_, count)| *count) else {
        return vec![false; linear.len()];
    };
    let is_backdrop = |i: usize| is_bare[i] && linear[i] == backdrop;
    let near = |n: usize, most: usize| n.saturating_sub(2)..(n + 3).min(most);
    (0..linear.len())
        .map(|i| near(i / width, height).all(|y| near(i % width, width).all(|x| is_backdrop(y * width + x))))
        .collect()
}

/// Colours among which the backdrop is looked for.
const MOST_COLORS: usize = 64;

/// Root of the mean square over pixels of the change from `a` to `b`, less that of the truth.
fn residual(a: &[[f32; 3]], b: &[[f32; 3]], right_a: &[[f32; 3]], right_b: &[[f32; 3]]) -> f64 {
    let flat = |p: &[[f32; 3]]| p.as_flattened().to_vec();
    let (a, b, ra, rb) = (flat(a), flat(b), flat(right_a), flat(right_b));
    let sum: f64 = (0..a.len()).map(|i| f64::from((b[i] - a[i]) - (rb[i] - ra[i])).powi(2)).sum();
    (sum / a.len().max(1) as f64).sqrt()
}

/// Largest value over the mean of its neighbours, 1 where nothing stands out; values below `least` do not count.
fn jump(values: &[f64], least: f64) -> f64 {
    let of = |i: usize| {
        let before = i.checked_sub(1).and_then(|b| values.get(b));
        let near: Vec<f64> = before.into_iter().chain(values.get(i + 1)).copied().collect();
        let mean = near.iter().sum::<f64>() / near.len().max(1) as f64;
        values[i].max(least) / mean.max(least)
    };
    (0..values.len()).map(of).fold(1.0, f64::max)
}

/// Changes below this are rounding of eight bits.
const LEAST_CHANGE: f64 = 0.002;

fn row(group: &str, name: &str, sweep: &Sweep, shown: &[Shown], rights: &[Right]) -> StabilityRow {
    let residuals: Vec<f64> = (shown.windows(2).zip(rights.windows(2)))
        .map(|(s, r)| residual(&s[0].linear, &s[1].linear, &r[0].linear, &r[1].linear))
        .collect();
    let halo = |(s, r): (&Shown, &Right)| -> f64 {
        // Whatever the backdrop is, it is the same in the truth.
        let outside = (0..s.linear.len()).filter(|i| r.outside[*i]);
        let off =
            |i: usize| (0..3).map(|c| f64::from(s.linear[i][c] - r.linear[i][c]).abs()).fold(0.0, f64::max);
        outside.map(off).fold(0.0, f64::max)
    };
    let energies =
        || shown.iter().zip(rights).filter(|(_, r)| r.energy > 0.0).map(|(s, r)| s.energy / r.energy);
    let mut times: Vec<f64> = shown.iter().filter_map(|s| s.ms).collect();
    let most_ms = times.iter().copied().fold(0.0, f64::max);
    StabilityRow {
        group: group.to_owned(),
        choice: name.to_owned(),
        sweep: sweep.name.to_owned(),
        residual: residuals.iter().copied().fold(0.0, f64::max),
        jump: jump(&residuals, LEAST_CHANGE),
        halo: shown.iter().zip(rights).map(halo).fold(0.0, f64::max),
        energy: [energies().fold(f64::INFINITY, f64::min), energies().fold(0.0, f64::max)],
        broken_values: shown.iter().map(|s| s.broken).sum(),
        cost_spike: median(&mut times).map(|middle| most_ms / middle.max(1e-9)),
        residuals,
        energies: shown
            .iter()
            .zip(rights)
            .map(|(s, r)| if r.energy > 0.0 { s.energy / r.energy } else { 1.0 })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_stands_out_is_a_jump() {
        assert_eq!(jump(&[0.01, 0.01, 0.01], 0.002), 1.0);
        assert!((jump(&[0.01, 0.05, 0.01, 0.01], 0.002) - 5.0).abs() < 1e-9);
        assert_eq!(jump(&[0.0, 0.0019, 0.0], 0.002), 1.0, "rounding is no jump");
        assert_eq!(jump(&[], 0.002), 1.0);
    }

    #[test]
    fn hairs_are_not_outside() {
        // 9 x 9 pixels of backdrop with a hair in a corner.
        let mut linear = vec![[0.1; 3]; 81];
        linear[0] = [0.0; 3];
        let found = outside(&linear, &[true; 81], 9);
        assert!(!found[2 * 9 + 2] && found[3 * 9 + 2] && found[4 * 9 + 4]);
        assert!(outside(&linear, &[false; 81], 9).iter().all(|o| !o));
    }

    #[test]
    fn what_moves_in_the_truth_may_move() {
        let flat = |v: f32| vec![[v; 3]; 4];
        assert!(residual(&flat(0.1), &flat(0.3), &flat(0.2), &flat(0.4)) < 1e-6);
        let flicker = residual(&flat(0.1), &flat(0.3), &flat(0.2), &flat(0.2));
        assert!((flicker - 0.2).abs() < 1e-6, "{flicker}");
    }
}
