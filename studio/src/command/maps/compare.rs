//! `rubor maps compare`: the Gaussian approximation against exact local histogram matching.

use std::path::{Path, PathBuf};

use clap::Args;
use glam::Vec3;
use rubor_assets::convert::hemoglobin::{Calibration, read_fractions};
use rubor_assets::convert::skin_texels::SkinTexels;
use rubor_assets::image_io::{Purpose, SampleKind};
use rubor_rig::head::Head;
use rubor_rig::hemoglobin::histogram_matching::{map_difference, match_locally};
use rubor_rig::hemoglobin::{HemoglobinError, blend, distribution, local_statistics, neutral};
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;
use serde_json::{Value, json};

use super::{ImageArgs, UnitArg, is_exr, note_image};
use rubor::inputs;
use rubor::notes::Note;
use rubor::{Failure, Outcome, output};

/// Arguments of `rubor maps compare`.
#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// Neutral map
    #[arg(long)]
    neutral: PathBuf,
    /// Expression or condition map of the same size
    #[arg(long)]
    target: PathBuf,
    /// Unit of the values
    #[arg(long, value_enum, default_value = "automatic")]
    unit: UnitArg,
    /// Radius of the window, texels
    #[arg(long)]
    radius: u32,
    /// Side of the distribution, texels
    #[arg(long, default_value_t = 256)]
    size: u32,
    /// Head whose skin is compared, in regions about its landmarks
    #[arg(long)]
    head: Option<PathBuf>,
    /// Grid of regions along each axis where there is no head
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    regions: u32,
    /// Picture: exact, Gaussian, difference x 8, side by side
    #[arg(short, long)]
    output: Option<PathBuf>,
    #[command(flatten)]
    images: ImageArgs,
}

pub(super) fn run(a: &CompareArgs, notes: &mut Vec<Note>) -> Outcome<Value> {
    let calibration = Calibration { unit: a.unit.into(), gain: 1.0, offset: 0.0 };
    let options = a.images.options(Purpose::Values);
    let base = read_fractions(&a.neutral, calibration, &options)?;
    note_image(&a.neutral, &base.notes, notes);
    let target = read_fractions(&a.target, calibration, &options)?;
    note_image(&a.target, &target.notes, notes);
    let (width, height) = (base.map.width, base.map.height);
    if (width, height) != (target.map.width, target.map.height) {
        return Err(Failure::input(format!(
            "{}: found {}x{} texels, expected {width}x{height} as the neutral map",
            a.target.display(),
            target.map.width,
            target.map.height,
        )));
    }
    let head = a.head.as_ref().map(|path| inputs::head(Some(path))).transpose()?;
    notes.extend(head.iter().flat_map(|loaded| loaded.notes.iter().cloned()));
    let mut mask = base.mask.and(&target.mask);
    let regions = match &head {
        Some(loaded) => {
            mask = mask.and(&SkinTexels::new(&loaded.head, width, height).mask());
            landmark_regions(&loaded.head, &mask)
        }
        None => grid_regions(a.regions, &mask),
    };
    let (base, target) = (base.map, target.map);
    let wrong = |e: HemoglobinError| Failure::input(e);
    let exact = match_locally(&base, &target, &mask, a.radius).map_err(wrong)?;
    // Full resolution: the Gaussian approximation alone. Reduced: with the error of storage.
    let full_size = width.max(height);
    let approximate = |size: u32| -> Outcome<Map> {
        let n = neutral(&base, &mask, a.radius, size).map_err(wrong)?;
        let d = distribution("target", &n, &target, &mask, a.radius, size).map_err(wrong)?;
        Ok(blend(&base, &n.mean, &[d], &[1.0], 1.0))
    };
    let (gaussian, reduced) = (approximate(full_size)?, approximate(a.size)?);
    let rows: Vec<Value> = regions
        .iter()
        .map(|(name, region)| {
            json!({
                "region": name,
                "gaussian": map_difference(&exact, &gaussian, region),
                "reduced": map_difference(&exact, &reduced, region),
            })
        })
        .collect();
    if let Some(file) = &a.output {
        picture(file, &exact, &gaussian, &mask)?;
    }
    let contrast = local_statistics(&base, &mask, a.radius).map_err(wrong)?;
    let covered = contrast.covered.and(&mask);
    let deviations = contrast.deviation.values.iter().zip(&covered.mapped).filter(|(_, m)| **m);
    let mean_deviation = deviations.map(|(v, _)| f64::from(*v)).sum::<f64>() / covered.count().max(1) as f64;
    Ok(json!({
        "gaussian": map_difference(&exact, &gaussian, &mask),
        "reduced": map_difference(&exact, &reduced, &mask),
        "downsampling_alone": map_difference(&gaussian, &reduced, &mask),
        "neutral_mean_deviation": mean_deviation,
        "regions": rows,
    }))
}

fn grid_regions(n: u32, mask: &Mask) -> Vec<(String, Mask)> {
    let mut regions = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let mut region = mask.clone();
            for (k, m) in region.mapped.iter_mut().enumerate() {
                let (x, y) = (k as u32 % mask.width, k as u32 / mask.width);
                *m &= x * n / mask.width == i && y * n / mask.height == j;
            }
            if region.count() > 0 {
                regions.push((format!("column {i}, row {j}"), region));
            }
        }
    }
    regions
}

/// Skin texels by the landmark that they are nearest to; both sides of a pair are one region.
fn landmark_regions(head: &Head, mask: &Mask) -> Vec<(String, Mask)> {
    let marks: Vec<(&str, Vec3)> = head
        .landmarks
        .iter()
        .map(|(name, p)| {
            let name = name.strip_suffix("-left").or(name.strip_suffix("-right")).unwrap_or(name);
            (name, *p)
        })
        .collect();
    let texels = SkinTexels::new(head, mask.width, mask.height);
    let mut regions: Vec<(String, Mask)> = Vec::new();
    for (k, _) in mask.mapped.iter().enumerate().filter(|(_, m)| **m) {
        let Some(p) = texels.position(k as u32 % mask.width, k as u32 / mask.width) else { continue };
        let nearest = marks.iter().min_by(|a, b| a.1.distance(p).total_cmp(&b.1.distance(p)));
        let name = nearest.map_or("skin", |m| m.0);
        let index = regions.iter().position(|r| r.0 == name).unwrap_or_else(|| {
            let empty = Mask { mapped: vec![false; mask.mapped.len()], ..*mask };
            regions.push((name.to_owned(), empty));
            regions.len() - 1
        });
        regions[index].1.mapped[k] = true;
    }
    regions.sort_by(|a, b| a.0.cmp(&b.0));
    regions
}

/// Exact, Gaussian and eight times their difference side by side; black where unmapped.
fn picture(file: &Path, exact: &Map, gaussian: &Map, mask: &Mask) -> Outcome {
    // White is the 99th percentile: a few hairs must not turn the face black.
    let mut sorted: Vec<f32> =
        exact.values.iter().zip(&mask.mapped).filter(|(_, m)| **m).map(|(v, _)| *v).collect();
    sorted.sort_by(f32::total_cmp);
    let top = sorted.get(sorted.len() * 99 / 100).copied().unwrap_or(1.0).max(1e-6);
    let (width, height) = (exact.width as usize, exact.height as usize);
    let mut picture = Map { width: exact.width * 3, height: exact.height, channels: 1, values: Vec::new() };
    for y in 0..height {
        let row = y * width..(y + 1) * width;
        let shown = |i: usize, v: f32| if mask.mapped[i] { v / top } else { 0.0 };
        picture.values.extend(row.clone().map(|i| shown(i, exact.values[i])));
        picture.values.extend(row.clone().map(|i| shown(i, gaussian.values[i])));
        picture.values.extend(row.map(|i| shown(i, 8.0 * (exact.values[i] - gaussian.values[i]).abs())));
    }
    let kind = if is_exr(file) { SampleKind::F32 } else { SampleKind::U8 };
    output::save_map(file, &picture, kind)
}
