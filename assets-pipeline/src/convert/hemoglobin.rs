//! Measured hemoglobin maps into distributions (papers/004 section 7.4, equations 7.1 and 7.5).
//!
//! A manifest (or the same fields by arguments) names a neutral map and any number of others. Numbers become volume
//! fractions by unit and calibration; texels outside the mask never mix with skin.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use rubor_rig::head::Distribution;
use rubor_rig::hemoglobin::{self, DISTRIBUTION_SIZE};
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped};
use rubor_rig::skin::chromophores::MAX_HEMOGLOBIN;
use serde::{Deserialize, Serialize};

use super::ConvertError;
use crate::image_io::{ImageError, SampleKind, load_image, save_image};

/// What the numbers of a hemoglobin map mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HemoglobinUnit {
    /// 1 (white, the largest code) is the largest fraction of the model, 0.32. The default for integer files.
    #[default]
    Normalized,
    /// Volume fraction of the dermis.
    VolumeFraction,
    /// Volume percent.
    Percent,
}

impl HemoglobinUnit {
    /// Volume fraction of one unit.
    fn factor(self) -> f64 {
        match self {
            Self::Normalized => MAX_HEMOGLOBIN,
            Self::VolumeFraction => 1.0,
            Self::Percent => 0.01,
        }
    }
}

impl FromStr for HemoglobinUnit {
    type Err = ConvertError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match name {
            "normalized" => Ok(Self::Normalized),
            "volume-fraction" => Ok(Self::VolumeFraction),
            "percent" => Ok(Self::Percent),
            other => Err(ConvertError::argument(
                "unit",
                format!("{other:?}"),
                "normalized, volume-fraction or percent",
            )),
        }
    }
}

/// Volume fractions from the numbers of a file: `fraction = (value * gain + offset) * unit`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Calibration {
    /// Unit of the calibrated value.
    pub unit: HemoglobinUnit,
    /// Factor; negative for maps where dark means more blood.
    pub gain: f64,
    /// Added after the factor.
    pub offset: f64,
}

impl Default for Calibration {
    fn default() -> Self {
        Self { unit: HemoglobinUnit::default(), gain: 1.0, offset: 0.0 }
    }
}

/// One distribution of a manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HemoglobinSource {
    /// Name of the distribution, such as `joy` or `exercise`.
    pub name: String,
    /// Image file, relative to the manifest.
    pub file: PathBuf,
    /// Calibration where it differs from that of the manifest.
    #[serde(default)]
    pub calibration: Option<Calibration>,
}

/// What to convert: the manifest of `rubor maps hemoglobin`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HemoglobinManifest {
    /// Neutral map, relative to the manifest.
    pub neutral: PathBuf,
    /// The other maps.
    #[serde(default)]
    pub distributions: Vec<HemoglobinSource>,
    /// Image whose white is skin, in the layout of the neutral map; alpha of each map applies as well.
    #[serde(default)]
    pub mask: Option<PathBuf>,
    /// Of every map without its own.
    #[serde(default)]
    pub calibration: Calibration,
    /// Radius r of the disk, texels of the neutral map; a 64th of its larger side without.
    #[serde(default)]
    pub radius_px: Option<u32>,
    /// Side of the results, texels.
    #[serde(default = "default_size")]
    pub size: u32,
}

fn default_size() -> u32 {
    DISTRIBUTION_SIZE
}

/// Maps of a head as converted.
#[derive(Clone, Debug, PartialEq)]
pub struct HemoglobinMaps {
    /// `H_n`, volume fraction, holes filled.
    pub neutral: Map,
    /// `mu_n` at the size of the distributions: `bias_0`.
    pub neutral_mean: Map,
    /// Skin texels of the neutral map.
    pub mask: Mask,
    /// Scale and bias of each.
    pub distributions: Vec<Distribution>,
    /// Radius used, texels.
    pub radius_px: u32,
    /// Mapped texels that left 0..0.32 and were clamped, of all maps.
    pub clamped_texels: usize,
}

/// Reads a manifest.
///
/// # Errors
/// A file that cannot be read or is not a manifest, with line and column.
pub fn read_manifest(file: &Path) -> Result<HemoglobinManifest, ConvertError> {
    let text =
        std::fs::read_to_string(file).map_err(|source| ImageError::Io { file: file.to_owned(), source })?;
    serde_json::from_str(&text).map_err(|e| {
        ConvertError::argument(file.display().to_string(), e.to_string(), "a manifest of hemoglobin maps")
    })
}

/// A map of volume fractions with its mask and the number of texels that were clamped to 0..0.32.
///
/// # Errors
/// An image that is not grey or not finite where mapped; a calibration that is not finite.
pub fn read_fractions(file: &Path, calibration: Calibration) -> Result<(Map, Mask, usize), ConvertError> {
    if !(calibration.gain.is_finite() && calibration.offset.is_finite()) {
        let found = format!("gain {}, offset {}", calibration.gain, calibration.offset);
        return Err(ConvertError::argument(file.display().to_string(), found, "finite numbers"));
    }
    let image = load_image(file)?;
    let mask = image.mask();
    image.require_finite(&mask)?;
    let mut map = image.require_grey()?;
    let factor = calibration.unit.factor();
    let mut clamped = 0;
    for (v, mapped) in map.values.iter_mut().zip(&mask.mapped) {
        if *mapped {
            let fraction = (f64::from(*v) * calibration.gain + calibration.offset) * factor;
            // Rounding of a code is no violation.
            clamped += usize::from(!(-1e-4..=MAX_HEMOGLOBIN + 1e-4).contains(&fraction));
            *v = fraction.clamp(0.0, MAX_HEMOGLOBIN) as f32;
        } else {
            *v = 0.0;
        }
    }
    Ok((map, mask, clamped))
}

/// Converts all maps of a manifest whose files are relative to `folder`.
///
/// Maps may differ in size from the neutral one. Texels that the mask leaves out are filled from the skin around them
/// in every result, so filtering across a texture seam stays on skin.
///
/// # Errors
/// The first file, map or number that cannot be used.
pub fn convert(manifest: &HemoglobinManifest, folder: &Path) -> Result<HemoglobinMaps, ConvertError> {
    if manifest.size == 0 {
        return Err(ConvertError::argument("size", "0", "at least 1 texel"));
    }
    for (i, source) in manifest.distributions.iter().enumerate() {
        if source.name.is_empty() || manifest.distributions[..i].iter().any(|s| s.name == source.name) {
            let at = format!("distribution {i}");
            return Err(ConvertError::argument(at, format!("name {:?}", source.name), "a name of its own"));
        }
    }
    let neutral_file = folder.join(&manifest.neutral);
    let (mut neutral, mut mask, mut clamped_texels) = read_fractions(&neutral_file, manifest.calibration)?;
    if let Some(file) = &manifest.mask {
        let image = load_image(&folder.join(file))?;
        image.require_size(neutral.width, neutral.height)?;
        mask = mask.and(&Mask::above(&image.require_grey()?, 0, 0.5));
    }
    if mask.count() == 0 {
        let found = "no mapped texel";
        return Err(ConvertError::argument(neutral_file.display().to_string(), found, "some skin"));
    }
    let radius_px = manifest.radius_px.unwrap_or_else(|| (neutral.width.max(neutral.height) / 64).max(1));
    let failed = |name: &str| {
        let name = name.to_owned();
        move |source| ConvertError::Hemoglobin { name, source }
    };
    let statistics =
        hemoglobin::neutral(&neutral, &mask, radius_px, manifest.size).map_err(failed("neutral"))?;
    let mut distributions = Vec::with_capacity(manifest.distributions.len());
    for source in &manifest.distributions {
        let calibration = source.calibration.unwrap_or(manifest.calibration);
        let (target, target_mask, clamped) = read_fractions(&folder.join(&source.file), calibration)?;
        clamped_texels += clamped;
        let same_size = (target.width, target.height) == (neutral.width, neutral.height);
        let target_mask = if same_size { target_mask.and(&mask) } else { target_mask };
        distributions.push(
            hemoglobin::distribution(
                &source.name,
                &statistics,
                &target,
                &target_mask,
                radius_px,
                manifest.size,
            )
            .map_err(failed(&source.name))?,
        );
    }
    fill_unmapped(&mut neutral, &mask);
    Ok(HemoglobinMaps {
        neutral,
        neutral_mean: statistics.mean,
        mask,
        distributions,
        radius_px,
        clamped_texels,
    })
}

/// Writes `neutral.exr`, `neutral_mean.exr` and `NAME_scale.exr`, `NAME_bias.exr` into a folder that it makes.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn write(maps: &HemoglobinMaps, folder: &Path) -> Result<Vec<PathBuf>, ConvertError> {
    std::fs::create_dir_all(folder).map_err(|source| ImageError::Io { file: folder.to_owned(), source })?;
    let mut written = Vec::new();
    let mut save = |name: String, map: &Map| -> Result<(), ConvertError> {
        let file = folder.join(name);
        save_image(&file, map, SampleKind::F32)?;
        written.push(file);
        Ok(())
    };
    save("neutral.exr".into(), &maps.neutral)?;
    save("neutral_mean.exr".into(), &maps.neutral_mean)?;
    for d in &maps.distributions {
        save(format!("{}_scale.exr", d.name), &d.scale)?;
        save(format!("{}_bias.exr", d.name), &d.bias)?;
    }
    Ok(written)
}
