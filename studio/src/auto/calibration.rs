//! Estimates of error and cost, fitted to a chart of random shots.
//!
//! The error of a choice, as mean FLIP and as relative RMSE, is `d exp(c . f)`: `f` are the logarithm of the millimetres of a pixel, its square, the
//! logarithm of the share of the picture, backlight and contrast; `d` is the weight that drives it (wrinkles, blood), or 1.
//! Least squares with a small ridge; a margin on top covers 95 % of the shots, each predicted without itself. The cost over
//! that of the cheapest choice is linear in the pixels of the head.

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
const TERMS: usize = 6;

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
        if rows.len() < 2 * TERMS {
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
}

fn terms(f: &Features) -> [f64; TERMS] {
    let s = f.mm_per_pixel.max(1e-4).ln();
    [1.0, s, s * s, f.share.max(1e-6).ln(), f.backlight, f.contrast]
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
    /// Fits a chart of shots whose features are known to their times, in one or more sizes of pictures; none if a group has
    /// too few shots or no times.
    pub fn of(report: &ChartReport, features: &[Features], times: &[Times]) -> Option<Self> {
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
                    (choice.points.iter().zip(features))
                        .filter(|(_, f)| f.share > 0.0 && drive.of(f) >= LEAST_DRIVE)
                        .map(|(p, f)| (terms(f), (of(&p.error) / drive.of(f)).max(LEAST_ERROR).ln()))
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
        };
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
        Some(calibration)
    }

    /// Estimated error of a choice, which 95 % of shots do not exceed.
    pub fn error(&self, metric: Metric, group: usize, choice: usize, f: &Features) -> f64 {
        let Some((group, choice)) = self.groups.get(group).and_then(|g| Some((g, g.choices.get(choice)?)))
        else {
            return 0.0;
        };
        let estimate = match metric {
            Metric::Flip => &choice.flip,
            Metric::RelativeRmse => &choice.relative_rmse,
        };
        match estimate {
            Some(e) if f.share > 0.0 => {
                (group.drive.of(f) * (dot(&e.coefficients, &terms(f)) + e.margin).exp()).min(1.0)
            }
            _ => 0.0,
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
            ..Features::default()
        };
        let law = [-3.0, -0.5, 0.1, 0.2, 0.7, 0.3];
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
    fn a_quantile_covers_its_share() {
        let values: Vec<f64> = (1..=20).map(f64::from).collect();
        assert_eq!(quantile(values, 0.95), 19.0);
    }
}
