//! Estimates of error and cost, fitted to a chart of random shots.
//!
//! The error of a choice, as mean FLIP and as relative RMSE, is `d exp(c . f)`: `f` are the logarithm of the millimetres of a pixel, its square, the
//! logarithms of the share of the picture, of visible relief, of brightness and of light through thin parts, backlight, contrast and how much the face looks at the
//! camera; `d` is the weight that drives it
//! (wrinkles, blood), or 1. Least squares with a small ridge; a margin on top covers 95 % of the shots, each predicted without itself.
//!
//! Errors of several choices together, [`Together`]: a share of the sum of their means, and a factor on the root of the sum of squares of their margins, as
//! for independent errors, that covers 95 % of random combinations of choices. The cost over that of the cheapest choice is linear in the
//! pixels of the head.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rubor_renderer::settings::{Leaf, Settings};
use serde::{Deserialize, Serialize};

use super::features::Features;
use crate::report::{Adapter, ChartError, ChartReport};

/// Errors below this are none: a hundredth of a grey level over the whole head.
const LEAST_ERROR: f64 = 2e-5;
/// Weight below which a shot says nothing about what the weight drives.
const LEAST_DRIVE: f64 = 0.05;
const RIDGE: f64 = 1e-3;
/// Share of shots that the margin covers.
const COVERED: f64 = 0.95;
/// Terms of the model.
const TERMS: usize = 10;
/// Fewest shots that an estimate rests on.
const FEWEST_SHOTS: usize = 12;

/// What an error is proportional to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Drive {
    /// It is always there.
    Nothing,
    /// Weights of wrinkle zones.
    Wrinkles,
    /// Distance of blood from neutral.
    Blood,
}

impl Drive {
    fn of(self, f: &Features) -> f64 {
        match self {
            Self::Nothing => 1.0,
            Self::Wrinkles => f.wrinkles,
            Self::Blood => f.blood,
        }
    }
}

/// An error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metric {
    /// Mean FLIP over the head.
    Flip,
    /// Relative RMSE of the displayed picture in linear light, over the same pixels.
    RelativeRmse,
}

/// An estimate of an error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Estimate {
    /// Coefficients of its logarithm.
    coefficients: [f64; TERMS],
    /// Added to that logarithm, so that 95 % of shots lie below.
    margin: f64,
}

impl Estimate {
    /// Fits errors over their drive, and covers 95 % of them; none if there are too few.
    fn of(rows: &[([f64; TERMS], f64)]) -> Option<Self> {
        if rows.len() < FEWEST_SHOTS {
            return None;
        }
        let coefficients = fit(rows)?;
        let left_out = (0..rows.len()).filter_map(|i| {
            let mut others = rows.to_vec();
            let (terms, value) = others.remove(i);
            Some(value - dot(&fit(&others)?, &terms))
        });
        Some(Self { coefficients, margin: quantile(left_out.collect(), COVERED).max(0.0) })
    }
}

/// Estimates for a choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Choice {
    /// The value of the setting.
    pub value: serde_json::Value,
    /// Its name.
    pub name: String,
    /// Mean FLIP over the head; none where the choice is right by definition.
    flip: Option<Estimate>,
    /// Relative RMSE of the displayed picture in linear light, likewise.
    relative_rmse: Option<Estimate>,
    /// Milliseconds over the first choice: constant, and per million pixels of the head's box.
    cost_ms: [f64; 2],
}

/// Estimates for a setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Group {
    /// Its flag.
    pub flag: String,
    drive: Drive,
    /// Its choices; the first has a cost of 0.
    pub choices: Vec<Choice>,
}

/// What an error is expected to be, and how much more 95 % of shots do not exceed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Expected {
    /// The estimate.
    pub mean: f64,
    /// Added to it.
    pub margin: f64,
}

/// How errors of choices of several settings add up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Together {
    /// Share of the sum of their means: errors hide each other.
    share: f64,
    /// Factor on the root of the sum of squares of their margins.
    factor: f64,
}

impl Together {
    /// From combinations: what was expected of each choice, and the error that was measured. Those without an error are left out.
    fn of(combinations: &[(Vec<Expected>, f64)]) -> Self {
        let sums: Vec<(f64, f64, f64)> = (combinations.iter())
            .map(|(parts, error)| {
                let (mean, margin) = sums(parts);
                (mean, margin, *error)
            })
            .filter(|(mean, margin, error)| *mean > LEAST_ERROR && *margin > 0.0 && *error > LEAST_ERROR)
            .collect();
        let share = quantile(sums.iter().map(|(mean, _, error)| error / mean).collect(), 0.5);
        let over = |(mean, margin, error): &(f64, f64, f64)| (error - share * mean) / margin;
        Self { share, factor: quantile(sums.iter().map(over).collect(), COVERED) }
    }

    /// Error that 95 % of frames do not exceed.
    pub fn error(&self, parts: &[Expected]) -> f64 {
        let (mean, margin) = sums(parts);
        (self.share * mean + self.factor * margin).clamp(0.0, 1.0)
    }
}

/// Sum of means, and root of the sum of squares of margins.
fn sums(parts: &[Expected]) -> (f64, f64) {
    let mean = parts.iter().map(|p| p.mean).sum();
    (mean, parts.iter().map(|p| p.margin * p.margin).sum::<f64>().sqrt())
}

/// A combination of choices in a shot, and its error.
#[derive(Clone, Debug)]
pub struct Combined {
    /// Index of the shot.
    pub shot: usize,
    /// Index of the choice of each group.
    pub choices: Vec<usize>,
    /// Mean FLIP and relative RMSE.
    pub errors: [f64; 2],
}

/// Estimates, and those without each shot.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Of all shots.
    pub calibration: Calibration,
    /// For each shot, of the others: what would be chosen in it without knowing it.
    pub left_out: Vec<Calibration>,
}

/// Estimates for a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Calibration {
    /// The device that was measured.
    pub adapter: Adapter,
    /// Version of rubor.
    pub rubor: String,
    /// Shots that it rests on.
    pub shots: usize,
    /// Milliseconds of a frame with the first choice of every group: constant, and per million pixels of the head's box.
    base_ms: [f64; 2],
    /// Settings that are chosen.
    pub groups: Vec<Group>,
    /// Least and largest value of each term in the shots: beyond them a fit says nothing, so they are used in their place.
    range: [[f64; 2]; TERMS],
    /// How their mean FLIP adds up.
    flip: Together,
    /// How their relative RMSE adds up.
    relative_rmse: Together,
}

/// Term of the logarithm of millimetres across a pixel.
const DISTANCE: usize = 1;

fn terms(f: &Features) -> [f64; TERMS] {
    let s = f.mm_per_pixel.max(1e-4).ln();
    let [relief, brightness] = [f.relief.max(1e-3).ln(), f.brightness.max(1e-2).ln()];
    let through = f.through.max(1e-4).ln();
    [1.0, s, s * s, f.share.max(1e-6).ln(), f.backlight, f.contrast, relief, brightness, through, f.facing]
}

/// Least and largest value of each term.
fn range_of(features: &[Features]) -> [[f64; 2]; TERMS] {
    let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; TERMS];
    for f in features.iter().filter(|f| f.share > 0.0) {
        for (range, term) in range.iter_mut().zip(terms(f)) {
            *range = [range[0].min(term), range[1].max(term)];
        }
    }
    range
}

fn megapixels(f: &Features, size: [u32; 2]) -> f64 {
    f.share * f64::from(size[0]) * f64::from(size[1]) * 1e-6
}

fn dot(a: &[f64; TERMS], b: &[f64; TERMS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Least squares with a ridge on all but the constant; rows are terms and values.
fn fit(rows: &[([f64; TERMS], f64)]) -> Option<[f64; TERMS]> {
    let a = DMatrix::from_fn(rows.len(), TERMS, |r, c| rows[r].0[c]);
    let b = DVector::from_fn(rows.len(), |r, _| rows[r].1);
    let mut normal = a.transpose() * &a;
    for i in 1..TERMS {
        normal[(i, i)] += RIDGE * rows.len() as f64;
    }
    normal[(0, 0)] += 1e-9;
    let solved = normal.cholesky()?.solve(&(a.transpose() * b));
    Some(std::array::from_fn(|i| solved[i]))
}

/// Value that a share of numbers does not exceed.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (share * values.len() as f64).ceil() as usize;
    values.get(at.saturating_sub(1)).copied().unwrap_or(0.0)
}

/// Straight line through places and values.
fn line(points: &[(f64, f64)]) -> [f64; 2] {
    let n = points.len().max(1) as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let spread = points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>();
    let slope =
        if spread > 1e-12 { points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / spread } else { 0.0 };
    [y - slope * x, slope]
}

impl Calibration {
    /// Estimates of the choices of a chart, without a shot if one is named.
    fn groups(
        report: &ChartReport,
        features: &[Features],
        times: &[Times],
        without: Option<usize>,
    ) -> Option<Vec<Group>> {
        let mut groups = Vec::new();
        for (g, group) in report.groups.iter().enumerate() {
            let drive = match group.flag.as_str() {
                "wrinkles" => Drive::Wrinkles,
                "color" => Drive::Blood,
                _ => Drive::Nothing,
            };
            let is_timed = |c: usize| times.iter().all(|t| t.ms.contains_key(&[g, c, 0]));
            let first = (0..group.choices.len()).find(|c| is_timed(*c))?;
            let mut choices = Vec::new();
            for (c, choice) in group.choices.iter().enumerate().filter(|(c, _)| is_timed(*c)) {
                let rows = |of: fn(&ChartError) -> f64| -> Vec<([f64; TERMS], f64)> {
                    (choice.points.iter().zip(features).enumerate())
                        .filter(|(s, (_, f))| {
                            without != Some(*s) && f.share > 0.0 && drive.of(f) >= LEAST_DRIVE
                        })
                        .map(|(_, (p, f))| (terms(f), (of(&p.error) / drive.of(f)).max(LEAST_ERROR).ln()))
                        .collect()
                };
                let is_right = choice.points.iter().all(|p| p.error.flip_mean < LEAST_ERROR);
                let (flip, relative_rmse) = match is_right {
                    true => (None, None),
                    false => (
                        Some(Estimate::of(&rows(|e| e.flip_mean))?),
                        Some(Estimate::of(&rows(|e| e.relative_rmse))?),
                    ),
                };
                choices.push(Choice {
                    value: value_of(&choice.settings, &group.flag)?,
                    name: choice.name.clone(),
                    flip,
                    relative_rmse,
                    cost_ms: line(&over(times, features, |s| [[g, c, s], [g, first, s]])),
                });
            }
            groups.push(Group { flag: group.flag.clone(), drive, choices });
        }
        Some(groups)
    }

    /// Fits a chart of shots whose features are known to their times, in one or more sizes of pictures; none if a group has
    /// too few shots or no times.
    pub fn of(
        report: &ChartReport,
        features: &[Features],
        times: &[Times],
        combined: &[Combined],
    ) -> Option<Fitted> {
        let groups = Self::groups(report, features, times, None)?;
        // A frame of the base, less what its choices cost over the first ones.
        let [g, c] = (report.groups.iter().enumerate()).find_map(|(g, group)| {
            Some([g, group.choices.iter().position(|c| c.settings == report.settings)?])
        })?;
        let mut calibration = Self {
            adapter: report.adapter.clone(),
            rubor: env!("CARGO_PKG_VERSION").to_owned(),
            shots: features.len(),
            base_ms: [0.0; 2],
            groups,
            range: range_of(features),
            flip: Together { share: 1.0, factor: 1.0 },
            relative_rmse: Together { share: 1.0, factor: 1.0 },
        };
        let mut left_out = (0..features.len())
            .map(|s| {
                let groups = Self::groups(report, features, times, Some(s))?;
                Some(Self { groups, ..calibration.clone() })
            })
            .collect::<Option<Vec<Self>>>()?;
        // How errors add up is asked of estimates that do not know the shot, too.
        let together = |metric: Metric, of: usize| {
            let expected = |c: &Combined| {
                let parts = c.choices.iter().enumerate();
                let estimates = &left_out[c.shot];
                let parts = parts.map(|(g, choice)| estimates.error(metric, g, *choice, &features[c.shot]));
                (parts.collect(), c.errors[of])
            };
            Together::of(&combined.iter().map(expected).collect::<Vec<_>>())
        };
        let both = [together(Metric::Flip, 0), together(Metric::RelativeRmse, 1)];
        [calibration.flip, calibration.relative_rmse] = both;
        let mut places = Vec::new();
        for times in times {
            for (s, f) in features.iter().enumerate() {
                let extra = calibration.groups.iter().enumerate().map(|(g, group)| {
                    let value = value_of(&report.settings, &group.flag);
                    let choice = group.choices.iter().position(|c| Some(&c.value) == value.as_ref());
                    choice.map_or(0.0, |c| calibration.cost_ms(g, c, f, times.size))
                });
                let ms = times.ms.get(&[g, c, s])?;
                places.push((megapixels(f, times.size), ms - extra.sum::<f64>()));
            }
        }
        calibration.base_ms = line(&places);
        for other in &mut left_out {
            *other = Self { groups: std::mem::take(&mut other.groups), ..calibration.clone() };
        }
        Some(Fitted { calibration, left_out })
    }

    /// With margins by a factor wider.
    pub(super) fn widened(mut self, factor: f64) -> Self {
        for together in [&mut self.flip, &mut self.relative_rmse] {
            together.factor = together.factor.max(0.1) * factor;
        }
        self
    }

    /// How errors of choices of several groups add up.
    pub fn together(&self, metric: Metric) -> &Together {
        match metric {
            Metric::Flip => &self.flip,
            Metric::RelativeRmse => &self.relative_rmse,
        }
    }

    /// Expected error of a choice.
    pub fn error(&self, metric: Metric, group: usize, choice: usize, f: &Features) -> Expected {
        let Some((group, choice)) = self.groups.get(group).and_then(|g| Some((g, g.choices.get(choice)?)))
        else {
            return Expected::default();
        };
        let estimate = match metric {
            Metric::Flip => &choice.flip,
            Metric::RelativeRmse => &choice.relative_rmse,
        };
        match estimate {
            Some(e) if f.share > 0.0 => {
                let seen = terms(f);
                let known: [f64; TERMS] = std::array::from_fn(|i| {
                    seen[i].clamp(self.range[i][0], self.range[i][1].max(self.range[i][0]))
                });
                let mean = (group.drive.of(f) * dot(&e.coefficients, &known).exp()).min(1.0);
                // A head that is further away than those of the shots is known less well.
                let beyond = (seen[DISTANCE] - known[DISTANCE]).max(0.0);
                Expected { mean, margin: (mean * (e.margin + beyond).exp_m1()).min(1.0) }
            }
            _ => Expected::default(),
        }
    }

    /// Estimated milliseconds of a choice over the first of its group; never less than 0.
    pub fn cost_ms(&self, group: usize, choice: usize, f: &Features, size: [u32; 2]) -> f64 {
        let found = self.groups.get(group).and_then(|g| g.choices.get(choice));
        found.map_or(0.0, |c| (c.cost_ms[0] + c.cost_ms[1] * megapixels(f, size)).max(0.0))
    }

    /// Estimated milliseconds of a frame with the first choice of every group.
    pub fn base_ms(&self, f: &Features, size: [u32; 2]) -> f64 {
        (self.base_ms[0] + self.base_ms[1] * megapixels(f, size)).max(0.0)
    }
}

/// Times of the choices of a chart in a size of pictures, by group, choice and shot.
#[derive(Clone, Debug)]
pub struct Times {
    /// Pixels.
    pub size: [u32; 2],
    /// Milliseconds.
    pub ms: BTreeMap<[usize; 3], f64>,
}

/// Millions of pixels and milliseconds of a choice over another, for each size and shot.
fn over(times: &[Times], features: &[Features], pair: impl Fn(usize) -> [[usize; 3]; 2]) -> Vec<(f64, f64)> {
    let mut all = Vec::new();
    for times in times {
        for (s, f) in features.iter().enumerate() {
            let [own, first] = pair(s);
            if let (Some(own), Some(first)) = (times.ms.get(&own), times.ms.get(&first)) {
                all.push((megapixels(f, times.size), own - first));
            }
        }
    }
    all
}

/// The value of a flag in settings.
fn value_of(settings: &Settings, flag: &str) -> Option<serde_json::Value> {
    let all = serde_json::to_value(settings).ok()?;
    Some(Leaf::of_flag(flag)?.value_in(&all).clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_is_found_again_and_a_line_too() {
        let features = |i: u32| Features {
            mm_per_pixel: 0.05 * 1.2f64.powi(i as i32),
            share: 0.1 + 0.02 * f64::from(i % 7),
            backlight: f64::from(i % 3) / 3.0,
            contrast: f64::from(i % 5) / 5.0,
            relief: 0.02 * f64::from(1 + i % 11),
            brightness: 0.05 * f64::from(1 + i % 13),
            through: 1e-3 * f64::from(1 + i % 17),
            facing: f64::from(i % 4) / 4.0,
            ..Features::default()
        };
        let law = [-3.0, -0.5, 0.1, 0.2, 0.7, 0.3, 0.4, 0.6, 0.3, -0.2];
        let rows: Vec<_> = (0..40).map(|i| (terms(&features(i)), dot(&law, &terms(&features(i))))).collect();
        let found = fit(&rows).unwrap();
        for (terms, value) in &rows {
            assert!((dot(&found, terms) - value).abs() < 0.02, "{found:?}");
        }
        let points: Vec<(f64, f64)> = (0..5).map(|i| (f64::from(i), 3.0 + 0.5 * f64::from(i))).collect();
        let [at_zero, slope] = line(&points);
        assert!((at_zero - 3.0).abs() < 1e-12 && (slope - 0.5).abs() < 1e-12);
        assert_eq!(line(&[(1.0, 2.0)]), [2.0, 0.0]);
    }

    #[test]
    fn errors_together_cover_nineteen_of_twenty_combinations() {
        let mut random = rubor_rig::random::SplitMix64(3);
        let combinations: Vec<(Vec<Expected>, f64)> = (0..400)
            .map(|_| {
                let parts: Vec<Expected> = (0..3)
                    .map(|_| {
                        let mean = 0.01 + 0.02 * random.uniform();
                        Expected { mean, margin: 0.5 * mean }
                    })
                    .collect();
                let error = parts.iter().map(|p| 0.8 * p.mean + p.margin * (random.uniform() - 0.5)).sum();
                (parts, error)
            })
            .collect();
        let together = Together::of(&combinations);
        assert!((together.share - 0.8).abs() < 0.03, "{together:?}");
        let kept = combinations.iter().filter(|(parts, error)| *error <= together.error(parts)).count();
        assert!((378..=382).contains(&kept), "{kept} of 400, {together:?}");
        assert_eq!(together.error(&[]), 0.0);
    }

    #[test]
    fn a_quantile_covers_its_share() {
        let values: Vec<f64> = (1..=20).map(f64::from).collect();
        assert_eq!(quantile(values, 0.95), 19.0);
    }
}
