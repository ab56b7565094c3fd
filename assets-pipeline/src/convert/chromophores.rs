//! An albedo texture into melanin and hemoglobin by inverting the skin colour look-up.
//!
//! ```text
//! albedo x gain --fit------> melanin, hemoglobin, CIEDE2000 residual of each colour
//!               --weights--> 1 on skin, 0 where the residual or the blood is too large (make-up, brows, stubble, tattoos,
//!                            background), softly between
//!               --fill-----> melanin and hemoglobin of the rest from the skin around it
//! ```
//!
//! A head keeps the albedo itself as the colour of its neutral skin ([`rubor_rig::head::SkinMaps::albedo`]); the two
//! chromophores say how blood moves it, by the ratio of the look-up
//! ([`rubor_rig::skin::chromophores::SkinLookup::change`]). So what the look-up cannot say is not lost, and what is not
//! skin changes by the same share as the skin around it: dark hair hardly, painted skin as much as skin.
//!
//! The gain brings the values of a picture to reflectances for the fit alone. Where it is not given it is estimated: the one
//! at which most colours are colours of skin, and what cast their median then has ([`estimate_exposure`]).

use rayon::prelude::*;
use rubor_rig::color::srgb_decode;
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped, resize_area};
use rubor_rig::skin::chromophores::invert::{ChromophoreFit, SkinInverse};
use rubor_rig::skin::chromophores::{MAX_HEMOGLOBIN, SkinLookup};
use serde::Serialize;

use super::ConvertError;
use crate::image_io::{LoadedImage, SampleKind};

/// CIEDE2000 residual above which a texel counts as out of gamut unless asked otherwise: a clearly visible difference.
pub const DEFAULT_GAMUT_THRESHOLD: f32 = 3.0;

/// Share of the largest hemoglobin fraction above which a fit counts as stopped by the range. Half the range is 16 %
/// blood, several times what flushed skin holds.
const SATURATED: f32 = 0.5;

/// Share of the mapped texels that must be skin for the rest to take its blood from them. With less, the picture is
/// painted, and all of it gets the chromophores of its median colour.
const LEAST_SKIN: f64 = 0.02;

/// Blood of a painted skin, volume fraction: that of pale to ruddy faces.
const PAINTED_BLOOD: std::ops::RangeInclusive<f32> = 0.01..=0.035;

/// Gains that an estimate tries: from a stop below to half a stop above, in quarters of a stop.
const GAIN_QUARTER_STOPS: std::ops::RangeInclusive<i32> = -4..=2;

/// Gains that pictures of skin mostly have: painters and cameras make it brighter than it is.
const USUAL_GAINS: std::ops::RangeInclusive<f32> = 0.7..=1.0;

/// What a gain outside of those must be better by per stop, CIEDE2000: pale paint fits dark skin well when it is darkened
/// enough, and would then hardly show its blood.
const UNUSUAL: f32 = 3.0;

/// Residual of the median colour from which on a colour cast is removed before colours are fitted, CIEDE2000.
const SEEN_CAST: f32 = 1.0;

/// Largest factor, and one over the least, of a component that a cast is removed with, relative to its gain.
const MOST_CAST: f32 = 1.35;

/// Colours of which an exposure is estimated.
const EXPOSURE_SAMPLES: usize = 600;

/// How much the mean residual must fall for a gain other than 1, and how far above the least one it may be for a gain to
/// count as possible, CIEDE2000.
const CLEARLY_BETTER: f64 = 0.3;

/// Transfer function of an albedo file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AlbedoEncoding {
    /// sRGB for integers, linear for floats.
    Automatic,
    /// sRGB transfer function.
    Srgb,
    /// Linear Rec. 709.
    Linear,
}

/// How an albedo is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Factor from the values to reflectances, above 0; none: estimated.
    pub gain: Option<f32>,
    /// CIEDE2000 residual above which a texel counts as out of gamut, above 0.
    pub threshold: f32,
}

impl Default for Options {
    fn default() -> Self {
        Self { gain: None, threshold: DEFAULT_GAMUT_THRESHOLD }
    }
}

/// The factor from the values of a picture to reflectances.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Exposure {
    /// Reflectance over value.
    pub gain: f32,
    /// Factors of red, green and blue that remove a colour cast, on top of the gain.
    pub balance: [f32; 3],
    /// Least and largest gain that fit about as well.
    pub range: [f32; 2],
    /// 0 to 1: the share of the colours that are colours of skin at this gain, less the more the wider the range is. 1 for
    /// a gain that was given.
    pub confidence: f32,
}

impl std::fmt::Display for Exposure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [low, high] = self.range;
        write!(f, "{:.2} ({low:.2} to {high:.2}, confidence {:.2})", self.gain, self.confidence)?;
        let [r, g, b] = self.balance;
        if self.balance == [1.0; 3] {
            return Ok(());
        }
        write!(f, ", less a cast of {:.2} {:.2} {:.2}", 1.0 / r, 1.0 / g, 1.0 / b)
    }
}

impl Exposure {
    /// A colour of the picture as reflectance.
    fn of(&self, color: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|c| self.gain * self.balance[c] * color[c])
    }
}

/// Chromophores of an albedo texture.
#[derive(Clone, Debug, PartialEq)]
pub struct ChromophoreMaps {
    /// Melanin volume fraction, 1 channel, holes filled.
    pub melanin: Map,
    /// Hemoglobin volume fraction, 1 channel, holes filled.
    pub hemoglobin: Map,
    /// CIEDE2000 difference between albedo and the nearest colour of the model, 1 channel; 0 where unmapped.
    pub residual: Map,
    /// Mapped texels whose residual is above the threshold, or whose hemoglobin is beyond half the range.
    pub out_of_gamut: Mask,
    /// Numbers of the conversion.
    pub summary: ChromophoreSummary,
    /// The gain of the fit.
    pub exposure: Exposure,
}

/// Numbers of a conversion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ChromophoreSummary {
    /// Texels that the mask keeps.
    pub mapped_texels: usize,
    /// Texels marked as out of gamut.
    pub out_of_gamut_texels: usize,
    /// Mean CIEDE2000 residual of the texels inside the gamut.
    pub mean_residual_inside: f64,
    /// Largest CIEDE2000 residual of the texels inside the gamut.
    pub max_residual_inside: f64,
    /// Mean melanin fraction.
    pub mean_melanin: f64,
    /// Mean hemoglobin fraction.
    pub mean_hemoglobin: f64,
    /// So few texels are in the gamut that all have the chromophores of one colour.
    pub is_painted: bool,
}

/// Linear Rec. 709 albedo of an image.
///
/// # Errors
/// Channels other than grey or RGB; a mapped value that is not finite.
pub fn linear_albedo(image: &LoadedImage, encoding: AlbedoEncoding) -> Result<Map, ConvertError> {
    image.require_finite(&image.mask())?;
    let mut map = image.require_rgb()?;
    let srgb = match encoding {
        AlbedoEncoding::Automatic => image.kind != SampleKind::F32,
        AlbedoEncoding::Srgb => true,
        AlbedoEncoding::Linear => false,
    };
    if srgb {
        map.values.par_iter_mut().for_each(|v| *v = srgb_decode(*v));
    }
    Ok(map)
}

/// The gain at which the mapped colours of a linear Rec. 709 albedo are colours of skin, 1 where no other is clearly better,
/// and the cast that their median still has.
pub fn estimate_exposure(albedo_linear: &Map, mask: &Mask, lookup: &SkinLookup, threshold: f32) -> Exposure {
    let colors = spread(albedo_linear, mask, EXPOSURE_SAMPLES);
    if colors.is_empty() {
        return Exposure { gain: 1.0, balance: [1.0; 3], range: [1.0; 2], confidence: 0.0 };
    }
    let inverse = SkinInverse::new(lookup);
    // Residuals beyond twice the threshold say that a colour is no skin, and no more.
    let most = f64::from(2.0 * threshold);
    let try_gain = |gain: f32| -> (f64, f64) {
        let residuals: Vec<f64> = colors
            .par_iter()
            .map(|c| {
                let fit = inverse.fit(c.map(|v| gain * v));
                if is_saturated(&fit) { most } else { f64::from(fit.residual).min(most) }
            })
            .collect();
        let inside = residuals.iter().filter(|r| **r <= f64::from(threshold)).count();
        let stops = (USUAL_GAINS.start() / gain).log2().max((gain / USUAL_GAINS.end()).log2()).max(0.0);
        let mean = residuals.iter().sum::<f64>() / residuals.len() as f64;
        (mean + f64::from(UNUSUAL * stops), inside as f64 / residuals.len() as f64)
    };
    let gains: Vec<f32> = GAIN_QUARTER_STOPS.map(|i| (i as f32 / 4.0).exp2()).collect();
    let tried: Vec<(f64, f64)> = gains.iter().map(|g| try_gain(*g)).collect();
    let least = tried.iter().map(|t| t.0).fold(f64::INFINITY, f64::min);
    let one = (-*GAIN_QUARTER_STOPS.start()) as usize;
    let best = match tried[one].0 <= least + CLEARLY_BETTER {
        true => one,
        false => tried.iter().position(|t| t.0 == least).unwrap_or(one),
    };
    let possible = |i: &usize| tried[*i].0 <= least.max(tried[best].0) + CLEARLY_BETTER;
    let first = (0..=best).rev().take_while(possible).last().unwrap_or(best);
    let last = (best..gains.len()).take_while(possible).last().unwrap_or(best);
    let stops = (last - first) as f64 / 4.0;
    Exposure {
        gain: gains[best],
        balance: balance(median(colors.clone()).map(|c| gains[best] * c), &inverse, lookup),
        range: [gains[first], gains[last]],
        confidence: (tried[best].1 * (1.0 - stops / 3.0)) as f32,
    }
}

/// Factors that bring the median of skin to a colour of skin.
fn balance(median: [f32; 3], inverse: &SkinInverse<'_>, lookup: &SkinLookup) -> [f32; 3] {
    let nearest = inverse.fit(median);
    if nearest.residual <= SEEN_CAST {
        return [1.0; 3];
    }
    let blood = nearest.hemoglobin.clamp(*PAINTED_BLOOD.start(), *PAINTED_BLOOD.end());
    let skin = lookup.sample(inverse.fit_melanin(median, blood).melanin, blood);
    [0, 1, 2].map(|c| (skin[c] / median[c].max(1e-3)).clamp(1.0 / MOST_CAST, MOST_CAST))
}

/// At most `count` mapped colours, spread evenly over the mapped texels.
fn spread(albedo_linear: &Map, mask: &Mask, count: usize) -> Vec<[f32; 3]> {
    let mapped = mask.count();
    let step = mapped.div_ceil(count).max(1);
    let colors = albedo_linear.values.chunks_exact(3).zip(&mask.mapped).filter(|(_, m)| **m);
    colors.map(|(c, _)| [c[0], c[1], c[2]]).skip(step / 2).step_by(step).collect()
}

/// A fit that stops at the end of the range would go on: dark grey hair reads as blood without end.
fn is_saturated(fit: &ChromophoreFit) -> bool {
    fit.hemoglobin > SATURATED * MAX_HEMOGLOBIN as f32
}

/// Fits of the colours of a picture. Pictures have few colours for their texels, so each is fitted once.
fn fits(
    albedo_linear: &Map,
    mask: &Mask,
    exposure: &Exposure,
    inverse: &SkinInverse<'_>,
) -> Vec<ChromophoreFit> {
    let key = |c: &[f32]| [c[0], c[1], c[2]].map(f32::to_bits);
    let texels = || albedo_linear.values.par_chunks_exact(3).zip(&mask.mapped).with_min_len(4096);
    let mut colors: Vec<[u32; 3]> = texels().filter(|(_, m)| **m).map(|(c, _)| key(c)).collect();
    colors.par_sort_unstable();
    colors.dedup();
    let fit = |c: &[u32; 3]| inverse.fit(exposure.of(c.map(f32::from_bits)));
    let known: Vec<ChromophoreFit> = colors.par_iter().with_min_len(256).map(fit).collect();
    let empty = ChromophoreFit { melanin: 0.0, hemoglobin: 0.0, residual: 0.0 };
    let found = |c: &[f32]| colors.binary_search(&key(c)).map_or(empty, |i| known[i]);
    texels().map(|(c, mapped)| if *mapped { found(c) } else { empty }).collect()
}

/// Chromophores of a linear Rec. 709 albedo map of 3 channels.
///
/// # Errors
/// Other channels, a mask of another size, a gain or a threshold that is not positive.
pub fn convert(
    albedo_linear: &Map,
    mask: &Mask,
    lookup: &SkinLookup,
    options: &Options,
) -> Result<ChromophoreMaps, ConvertError> {
    let (width, height) = (albedo_linear.width, albedo_linear.height);
    if albedo_linear.channels != 3 {
        return Err(ConvertError::argument("albedo", format!("{} channels", albedo_linear.channels), "3"));
    }
    if (mask.width, mask.height) != (width, height) {
        let found = format!("{}x{}", mask.width, mask.height);
        return Err(ConvertError::argument("mask", found, format!("{width}x{height} as the albedo")));
    }
    let Options { gain, threshold } = *options;
    if threshold.is_nan() || threshold <= 0.0 {
        return Err(ConvertError::argument("threshold", threshold.to_string(), "a positive CIEDE2000"));
    }
    if let Some(gain) = gain.filter(|g| !(*g > 0.0 && g.is_finite())) {
        return Err(ConvertError::argument("gain", gain.to_string(), "a positive number"));
    }
    let exposure = match gain {
        Some(gain) => Exposure { gain, balance: [1.0; 3], range: [gain; 2], confidence: 1.0 },
        None => estimate_exposure(albedo_linear, mask, lookup, threshold),
    };
    let inverse = SkinInverse::new(lookup);
    let fits = fits(albedo_linear, mask, &exposure, &inverse);
    let map = |value: fn(&ChromophoreFit) -> f32| Map {
        width,
        height,
        channels: 1,
        values: fits.iter().map(value).collect(),
    };
    let (mut melanin, mut hemoglobin) = (map(|f| f.melanin), map(|f| f.hemoglobin));
    let residual = map(|f| f.residual);
    let mapped = fits.iter().map(|f| f.residual > threshold || is_saturated(f)).collect::<Vec<bool>>();
    let out_of_gamut = Mask { width, height, mapped };
    let mut summary = ChromophoreSummary { mapped_texels: mask.count(), ..Default::default() };
    for ((fit, mapped), out) in fits.iter().zip(&mask.mapped).zip(&out_of_gamut.mapped) {
        if !*mapped {
            continue;
        }
        if *out {
            summary.out_of_gamut_texels += 1;
        } else {
            summary.mean_residual_inside += f64::from(fit.residual);
            summary.max_residual_inside = summary.max_residual_inside.max(f64::from(fit.residual));
        }
    }
    let mapped = summary.mapped_texels.max(1) as f64;
    let inside = summary.mapped_texels - summary.out_of_gamut_texels;
    summary.mean_residual_inside /= inside.max(1) as f64;
    summary.is_painted = summary.mapped_texels > 0 && (inside as f64) < LEAST_SKIN * mapped;
    if summary.is_painted {
        let median = exposure.of(median(spread(albedo_linear, mask, 4096)));
        let blood = inverse.fit(median).hemoglobin.clamp(*PAINTED_BLOOD.start(), *PAINTED_BLOOD.end());
        melanin.values.fill(inverse.fit_melanin(median, blood).melanin);
        hemoglobin.values.fill(blood);
    } else {
        let weights = weights(&fits, mask, threshold, width, height);
        take_from_around(&mut melanin, &weights);
        take_from_around(&mut hemoglobin, &weights);
    }
    for (i, _) in mask.mapped.iter().enumerate().filter(|(_, m)| **m) {
        summary.mean_melanin += f64::from(melanin.values[i]) / mapped;
        summary.mean_hemoglobin += f64::from(hemoglobin.values[i]) / mapped;
    }
    Ok(ChromophoreMaps { melanin, hemoglobin, residual, out_of_gamut, summary, exposure })
}

/// How much of a texel's own fit counts: 1 up to half the threshold, 0 from the threshold on, and no more than the least of
/// its neighbours has, as a texel at the edge of a brow holds some of the brow.
fn weights(fits: &[ChromophoreFit], mask: &Mask, threshold: f32, width: u32, height: u32) -> Map {
    let own: Vec<f32> = (fits.iter().zip(&mask.mapped))
        .map(|(fit, mapped)| {
            if !*mapped || is_saturated(fit) {
                return 0.0;
            }
            let t = (2.0 - 2.0 * fit.residual / threshold).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        })
        .collect();
    let (w, h) = (width as usize, height as usize);
    let around = |i: usize, end: usize| i.saturating_sub(1)..(i + 2).min(end);
    let values = (0..w * h)
        .into_par_iter()
        .with_min_len(4096)
        .map(|i| {
            let (x, y) = (i % w, i / w);
            let neighbours = around(y, h).flat_map(|y| around(x, w).map(move |x| y * w + x));
            // What is not mapped says nothing about its neighbours.
            let least = neighbours.filter(|j| mask.mapped[*j]).map(|j| own[j]).fold(1.0, f32::min);
            own[i].min(least)
        })
        .collect();
    Map { width, height, channels: 1, values }
}

/// Values of the skin around where weights are below 1.
fn take_from_around(map: &mut Map, weights: &Map) {
    // Where no texel is skin without doubt, the surest ones are.
    let surest = weights.values.iter().copied().fold(0.0, f32::max);
    if surest <= 0.0 {
        return;
    }
    let skin = Mask {
        width: map.width,
        height: map.height,
        mapped: weights.values.iter().map(|w| *w >= surest.min(0.999)).collect(),
    };
    let mut filled = map.clone();
    fill_unmapped(&mut filled, &skin);
    for ((value, around), weight) in map.values.iter_mut().zip(&filled.values).zip(&weights.values) {
        *value = around + weight * (*value - around);
    }
}

/// The median of each component.
fn median(colors: Vec<[f32; 3]>) -> [f32; 3] {
    [0, 1, 2].map(|c| {
        let mut values: Vec<f32> = colors.iter().map(|color| color[c]).collect();
        values.sort_unstable_by(f32::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    })
}

/// A map with its means over squares of texels, no larger than `side` in either direction: chromophores only say how a
/// colour moves, so they need not have its detail.
pub fn no_larger(map: Map, side: u32) -> Map {
    let most = map.width.max(map.height);
    if most <= side {
        return map;
    }
    let size =
        [map.width, map.height].map(|n| (u64::from(n) * u64::from(side) / u64::from(most)).max(1) as u32);
    resize_area(&map, &Mask::full(map.width, map.height), size[0], size[1]).0
}

/// Linear Rec. 709 albedo that chromophore maps make: the other direction of [`convert`].
///
/// # Errors
/// Maps that differ in size or have other than 1 channel.
pub fn albedo(melanin: &Map, hemoglobin: &Map, lookup: &SkinLookup) -> Result<Map, ConvertError> {
    let shape = |m: &Map| (m.width, m.height, m.channels);
    if shape(melanin) != shape(hemoglobin) || melanin.channels != 1 {
        let found = format!("{:?} and {:?}", shape(melanin), shape(hemoglobin));
        return Err(ConvertError::argument("chromophore maps", found, "one size and 1 channel"));
    }
    let values =
        melanin.values.iter().zip(&hemoglobin.values).flat_map(|(m, h)| lookup.sample(*m, *h)).collect();
    Ok(Map { channels: 3, values, ..*melanin })
}
