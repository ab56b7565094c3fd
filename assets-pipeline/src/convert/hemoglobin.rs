//! Measured hemoglobin maps into distributions (Jimenez 2012 section 7.4, equations 7.1 and 7.5).
//!
//! A manifest (or the same fields by arguments) names a neutral map and any number of others. Numbers become volume
//! fractions by unit and calibration; texels outside the mask never mix with skin. With a head, its skin is a mask
//! too, and its own blood may be the neutral map.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use rubor_rig::head::{Distribution, Head};
use rubor_rig::hemoglobin::{self, DISTRIBUTION_SIZE};
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped};
use rubor_rig::skin::chromophores::MAX_HEMOGLOBIN;
use serde::de::IntoDeserializer;
use serde::de::value::StrDeserializer;
use serde::{Deserialize, Serialize};

use super::ConvertError;
use super::skin_texels::{SkinTexels, require_layout};
use crate::files::{is_plain_name, plain_names};
use crate::image_io::{ImageError, ReadOptions, SampleKind, load_image, load_image_with, save_image};

/// Share of mapped texels outside of 0..0.32 above which a map is refused: its unit is then another one.
const MOST_CLAMPED: f64 = 0.5;

/// Unit of the numbers of a hemoglobin map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HemoglobinUnit {
    /// `normalized` for files of integers, `volume-fraction` for files of floats.
    #[default]
    Automatic,
    /// 1 (white, the largest code) is the largest fraction of the model, 0.32.
    Normalized,
    /// Volume fraction of the dermis.
    VolumeFraction,
    /// Volume percent.
    Percent,
}

impl HemoglobinUnit {
    /// Volume fraction of one unit in a file of these samples.
    fn factor(self, kind: SampleKind) -> f64 {
        match self {
            Self::Automatic if kind == SampleKind::F32 => 1.0,
            Self::Automatic | Self::Normalized => MAX_HEMOGLOBIN,
            Self::VolumeFraction => 1.0,
            Self::Percent => 0.01,
        }
    }
}

impl FromStr for HemoglobinUnit {
    type Err = ConvertError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        // The names are those of manifests.
        let names: StrDeserializer<'_, serde::de::value::Error> = name.into_deserializer();
        Self::deserialize(names).map_err(|_| {
            let expected = "automatic, normalized, volume-fraction or percent";
            ConvertError::argument("unit", format!("{name:?}"), expected)
        })
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
    /// Layer of an EXR where it differs from that of the manifest.
    #[serde(default)]
    pub layer: Option<String>,
}

/// The maps to convert: the manifest of `rubor maps hemoglobin`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HemoglobinManifest {
    /// Neutral map, relative to the manifest; that of the head without.
    #[serde(default)]
    pub neutral: Option<PathBuf>,
    /// The other maps.
    #[serde(default)]
    pub distributions: Vec<HemoglobinSource>,
    /// Image whose white is skin, in the layout of the neutral map; alpha of each map applies as well.
    #[serde(default)]
    pub mask: Option<PathBuf>,
    /// Of every map without its own.
    #[serde(default)]
    pub calibration: Calibration,
    /// Layer of each EXR without its own (see [`ReadOptions::layer`]); the mask is read without it.
    #[serde(default)]
    pub layer: Option<String>,
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
    /// Maps without any contrast where they are mapped: their scale is 0, 1 or the largest, as the rules of
    /// [`rubor_rig::hemoglobin`] say.
    pub constant: Vec<String>,
    /// Notes on everything that the readers of the images chose, left out or rotated, with the file.
    pub notes: Vec<String>,
}

/// Reads a manifest.
///
/// # Errors
/// A file that cannot be read or is not a manifest, with line and column.
pub fn read_manifest(file: &Path) -> Result<HemoglobinManifest, ConvertError> {
    let text = rubor_rig::limits::read_to_string(file)
        .map_err(|source| ImageError::Io { file: file.to_owned(), source })?;
    serde_json::from_str(&text).map_err(|e| {
        ConvertError::argument(file.display().to_string(), e.to_string(), "a manifest of hemoglobin maps")
    })
}

/// A map of volume fractions.
#[derive(Clone, Debug, PartialEq)]
pub struct Fractions {
    /// 1 channel, 0 where unmapped.
    pub map: Map,
    /// Texels that alpha keeps.
    pub mask: Mask,
    /// Mapped texels that were clamped to 0..0.32.
    pub clamped_texels: usize,
    /// Notes of the image's reader.
    pub notes: Vec<String>,
}

/// Reads a map of volume fractions.
///
/// # Errors
/// An image that is not grey or not finite where mapped; a calibration that is not finite, or that sends more than half
/// of the texels out of 0..0.32.
pub fn read_fractions(
    file: &Path,
    calibration: Calibration,
    options: &ReadOptions,
) -> Result<Fractions, ConvertError> {
    if !(calibration.gain.is_finite() && calibration.offset.is_finite()) {
        let found = format!("gain {}, offset {}", calibration.gain, calibration.offset);
        return Err(ConvertError::argument(file.display().to_string(), found, "finite numbers"));
    }
    let image = load_image_with(file, options)?;
    let mask = image.mask();
    image.require_finite(&mask)?;
    let mut map = image.require_grey()?;
    let factor = calibration.unit.factor(image.kind);
    let mut clamped_texels = 0;
    for (v, mapped) in map.values.iter_mut().zip(&mask.mapped) {
        if *mapped {
            let fraction = (f64::from(*v) * calibration.gain + calibration.offset) * factor;
            // The rounding of a code does not count as a violation.
            clamped_texels += usize::from(!(-1e-4..=MAX_HEMOGLOBIN + 1e-4).contains(&fraction));
            *v = fraction.clamp(0.0, MAX_HEMOGLOBIN) as f32;
        } else {
            *v = 0.0;
        }
    }
    if clamped_texels as f64 > MOST_CLAMPED * mask.count() as f64 {
        let share = 100 * clamped_texels / mask.count().max(1);
        let found = format!("{share} % of the texels outside of 0 to {MAX_HEMOGLOBIN} volume fraction");
        return Err(ConvertError::argument(
            file.display().to_string(),
            found,
            "another unit or calibration (units: automatic, normalized, volume-fraction, percent)",
        ));
    }
    Ok(Fractions { map, mask, clamped_texels, notes: image.notes })
}

/// Converts all maps of a manifest whose files are relative to `folder`.
///
/// Maps may differ in size from the neutral one, not in proportions. Texels that the masks or the skin of the head
/// leave out are filled from the skin around them in every result, so filtering across a texture seam stays on skin.
///
/// # Errors
/// The first file, map or number that cannot be used; a map in another layout than the head's.
pub fn convert(
    manifest: &HemoglobinManifest,
    folder: &Path,
    head: Option<&Head>,
) -> Result<HemoglobinMaps, ConvertError> {
    if manifest.size == 0 {
        return Err(ConvertError::argument("size", "0", "at least 1 texel"));
    }
    for (i, source) in manifest.distributions.iter().enumerate() {
        let name = &source.name;
        if !is_plain_name(name) || manifest.distributions[..i].iter().any(|s| s.name == *name) {
            let at = format!("distribution {i}");
            let expected = "a name of its own that can be a file's";
            return Err(ConvertError::argument(at, format!("name {name:?}"), expected));
        }
    }
    let (mut neutral, neutral_name) = neutral_of(manifest, folder, head)?;
    let (width, height) = (neutral.map.width, neutral.map.height);
    let mut mask = neutral.mask.clone();
    let mut notes = Vec::new();
    let mut note = |file: &str, found: &[String]| notes.extend(found.iter().map(|n| format!("{file}: {n}")));
    note(&neutral_name, &neutral.notes);
    if let Some(file) = &manifest.mask {
        let image = load_image(&folder.join(file))?;
        note(&file.display().to_string(), &image.notes);
        image.require_size(width, height)?;
        mask = mask.and(&Mask::above(&image.require_grey()?, 0, 0.5));
    }
    if let Some(head) = head {
        let skin = SkinTexels::new(head, width, height).mask();
        require_layout(&neutral_name, &data_of(&neutral.map, &mask), &skin)?;
        mask = mask.and(&skin);
    }
    if mask.count() == 0 {
        return Err(ConvertError::argument(neutral_name, "no mapped texel", "some skin"));
    }
    let radius_px = manifest.radius_px.unwrap_or_else(|| default_radius(&neutral.map));
    let failed = |name: &str| {
        let name = name.to_owned();
        move |source| ConvertError::Hemoglobin { name, source }
    };
    let mut constant = Vec::new();
    if is_constant(&neutral.map, &mask) {
        constant.push("neutral".to_owned());
    }
    let statistics =
        hemoglobin::neutral(&neutral.map, &mask, radius_px, manifest.size).map_err(failed("neutral"))?;
    let mut clamped_texels = neutral.clamped_texels;
    let mut distributions = Vec::with_capacity(manifest.distributions.len());
    for source in &manifest.distributions {
        let calibration = source.calibration.unwrap_or(manifest.calibration);
        let file = folder.join(&source.file);
        let layer = source.layer.as_ref().or(manifest.layer.as_ref()).cloned();
        let options = ReadOptions { layer, ..ReadOptions::default() };
        let target = read_fractions(&file, calibration, &options)?;
        clamped_texels += target.clamped_texels;
        note(&source.file.display().to_string(), &target.notes);
        let target_mask = target_mask(&file, &target, &mask, head)?;
        if is_constant(&target.map, &target_mask) {
            constant.push(source.name.clone());
        }
        distributions.push(
            hemoglobin::distribution(
                &source.name,
                &statistics,
                &target.map,
                &target_mask,
                radius_px,
                manifest.size,
            )
            .map_err(failed(&source.name))?,
        );
    }
    fill_unmapped(&mut neutral.map, &mask);
    Ok(HemoglobinMaps {
        neutral: neutral.map,
        neutral_mean: statistics.mean,
        mask,
        distributions,
        radius_px,
        clamped_texels,
        constant,
        notes,
    })
}

/// A 64th of the larger side.
pub fn default_radius(neutral: &Map) -> u32 {
    (neutral.width.max(neutral.height) / 64).max(1)
}

/// The neutral map of a manifest, or the head's own, and its name for messages.
fn neutral_of(
    manifest: &HemoglobinManifest,
    folder: &Path,
    head: Option<&Head>,
) -> Result<(Fractions, String), ConvertError> {
    if let Some(file) = &manifest.neutral {
        let file = folder.join(file);
        let options = ReadOptions { layer: manifest.layer.clone(), ..ReadOptions::default() };
        return Ok((read_fractions(&file, manifest.calibration, &options)?, file.display().to_string()));
    }
    let expected = "a neutral map, or a head that has one";
    let Some(head) = head else { return Err(ConvertError::argument("neutral", "nothing", expected)) };
    let Some(map) = head.maps.hemoglobin.clone() else {
        let found = format!("head {:?} without hemoglobin", head.name);
        return Err(ConvertError::argument("neutral", found, expected));
    };
    let mask = Mask::full(map.width, map.height);
    Ok((
        Fractions { map, mask, clamped_texels: 0, notes: Vec::new() },
        format!("hemoglobin of head {:?}", head.name),
    ))
}

/// Mapped texels of a target, in its own size.
fn target_mask(
    file: &Path,
    target: &Fractions,
    neutral_mask: &Mask,
    head: Option<&Head>,
) -> Result<Mask, ConvertError> {
    let (width, height) = (target.map.width, target.map.height);
    let (to_width, to_height) = (neutral_mask.width, neutral_mask.height);
    if (width, height) == (to_width, to_height) {
        if let Some(head) = head {
            let skin = SkinTexels::new(head, width, height).mask();
            require_layout(&file.display().to_string(), &data_of(&target.map, &target.mask), &skin)?;
        }
        return Ok(target.mask.and(neutral_mask));
    }
    // Rounding to whole texels is no other proportion.
    let expected = f64::from(width) * f64::from(to_height) / f64::from(to_width);
    if (expected - f64::from(height)).abs() > 1.0 {
        let found = format!("{width}x{height} texels");
        let expected = format!("the proportions of the neutral map, {to_width}x{to_height}");
        return Err(ConvertError::argument(file.display().to_string(), found, expected));
    }
    let Some(head) = head else { return Ok(target.mask.clone()) };
    let skin = SkinTexels::new(head, width, height).mask();
    require_layout(&file.display().to_string(), &data_of(&target.map, &target.mask), &skin)?;
    Ok(target.mask.and(&skin))
}

/// Mapped texels that hold something: black counts as the background of a map without alpha.
fn data_of(map: &Map, mask: &Mask) -> Mask {
    let mapped = mask.mapped.iter().zip(&map.values).map(|(m, v)| *m && *v > 0.0).collect();
    Mask { mapped, ..*mask }
}

fn is_constant(map: &Map, mask: &Mask) -> bool {
    let mut mapped = map.values.iter().zip(&mask.mapped).filter(|(_, m)| **m).map(|(v, _)| *v);
    let Some(first) = mapped.next() else { return true };
    mapped.all(|v| v == first)
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
    let names = plain_names(maps.distributions.iter().map(|d| d.name.as_str()));
    for (name, d) in names.iter().zip(&maps.distributions) {
        save(format!("{name}_scale.exr"), &d.scale)?;
        save(format!("{name}_bias.exr"), &d.bias)?;
    }
    Ok(written)
}
