//! An albedo texture into melanin and hemoglobin by inverting the skin colour look-up.
//!
//! The projection is onto the colours that the two chromophores can make; what remains is kept as a residual map, and
//! texels beyond a threshold (make-up, brows, stubble, background, shading baked into a photograph) are marked. These
//! take their hemoglobin from the skin around them and the melanin that comes closest with it.

use rayon::prelude::*;
use rubor_rig::color::srgb_decode;
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped};
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
}

/// Linear Rec. 709 albedo of an image, times a gain (what brings the photograph's exposure to reflectance).
///
/// # Errors
/// Channels other than grey or RGB; a mapped value that is not finite; a gain that is not positive.
pub fn linear_albedo(image: &LoadedImage, encoding: AlbedoEncoding, gain: f32) -> Result<Map, ConvertError> {
    if !(gain > 0.0 && gain.is_finite()) {
        return Err(ConvertError::argument("gain", gain.to_string(), "a positive number"));
    }
    image.require_finite(&image.mask())?;
    let mut map = image.require_rgb()?;
    let srgb = match encoding {
        AlbedoEncoding::Automatic => image.kind != SampleKind::F32,
        AlbedoEncoding::Srgb => true,
        AlbedoEncoding::Linear => false,
    };
    map.values.par_iter_mut().for_each(|v| *v = gain * if srgb { srgb_decode(*v) } else { *v });
    Ok(map)
}

/// Chromophores of a linear Rec. 709 albedo map of 3 channels.
///
/// # Errors
/// Other channels, a mask of another size, or a threshold that is not positive.
pub fn convert(
    albedo_linear: &Map,
    mask: &Mask,
    lookup: &SkinLookup,
    gamut_threshold: f32,
) -> Result<ChromophoreMaps, ConvertError> {
    let (width, height) = (albedo_linear.width, albedo_linear.height);
    if albedo_linear.channels != 3 {
        return Err(ConvertError::argument("albedo", format!("{} channels", albedo_linear.channels), "3"));
    }
    if (mask.width, mask.height) != (width, height) {
        let found = format!("{}x{}", mask.width, mask.height);
        return Err(ConvertError::argument("mask", found, format!("{width}x{height} as the albedo")));
    }
    if gamut_threshold.is_nan() || gamut_threshold <= 0.0 {
        return Err(ConvertError::argument("threshold", gamut_threshold.to_string(), "a positive CIEDE2000"));
    }
    let inverse = SkinInverse::new(lookup);
    let empty = ChromophoreFit { melanin: 0.0, hemoglobin: 0.0, residual: 0.0 };
    let fits: Vec<ChromophoreFit> = albedo_linear
        .values
        .par_chunks_exact(3)
        .zip(&mask.mapped)
        .with_min_len(4096)
        .map(|(c, mapped)| if *mapped { inverse.fit([c[0], c[1], c[2]]) } else { empty })
        .collect();
    let map = |value: fn(&ChromophoreFit) -> f32| Map {
        width,
        height,
        channels: 1,
        values: fits.iter().map(value).collect(),
    };
    let (mut melanin, mut hemoglobin) = (map(|f| f.melanin), map(|f| f.hemoglobin));
    let residual = map(|f| f.residual);
    // A fit that stops at the end of the range would go on: dark grey hair reads as blood without end.
    let most = SATURATED * MAX_HEMOGLOBIN as f32;
    let mapped =
        fits.iter().map(|f| f.residual > gamut_threshold || f.hemoglobin > most).collect::<Vec<bool>>();
    let out_of_gamut = Mask { width, height, mapped };
    let mut summary = ChromophoreSummary { mapped_texels: mask.count(), ..Default::default() };
    for ((fit, mapped), out) in fits.iter().zip(&mask.mapped).zip(&out_of_gamut.mapped) {
        if *mapped {
            summary.mean_melanin += f64::from(fit.melanin);
            summary.mean_hemoglobin += f64::from(fit.hemoglobin);
            if *out {
                summary.out_of_gamut_texels += 1;
            } else {
                summary.mean_residual_inside += f64::from(fit.residual);
                summary.max_residual_inside = summary.max_residual_inside.max(f64::from(fit.residual));
            }
        }
    }
    let mapped = summary.mapped_texels.max(1) as f64;
    let inside = (summary.mapped_texels - summary.out_of_gamut_texels).max(1) as f64;
    summary.mean_melanin /= mapped;
    summary.mean_hemoglobin /= mapped;
    summary.mean_residual_inside /= inside;
    // Texels that are not skin do not show blood: their hemoglobin comes from the skin around, their darkness counts as
    // melanin.
    let mut skin = mask.clone();
    for (s, out) in skin.mapped.iter_mut().zip(&out_of_gamut.mapped) {
        *s &= !*out;
    }
    if skin.count() > 0 {
        fill_unmapped(&mut hemoglobin, &skin);
        melanin.values.par_iter_mut().enumerate().for_each(|(i, m)| {
            if out_of_gamut.mapped[i] {
                let c = &albedo_linear.values[3 * i..3 * i + 3];
                *m = inverse.fit_melanin([c[0], c[1], c[2]], hemoglobin.values[i]).melanin;
            }
        });
    }
    fill_unmapped(&mut melanin, mask);
    fill_unmapped(&mut hemoglobin, mask);
    Ok(ChromophoreMaps { melanin, hemoglobin, residual, out_of_gamut, summary })
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
