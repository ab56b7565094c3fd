//! Maps for a head that has no measured ones.
//!
//! ```text
//! head --landmarks--> face space (canonical mm) --+
//!      --skin UVs---> surface (texel -> place) ---+--> fields of place --> SkinMaps
//! ```
//!
//! Every map is a field of the canonical place of the skin: noise, regions, lines and hairs live in three dimensions
//! (or on the unrolled front of the face) and never see the texture, so no border of the texture shows. Heights are in
//! millimetres and become slopes by differentiation along the texture frame, so relief has its true depth on any head.
//! All of it follows from the head, the options and the seed; the number of threads has no influence.
//!
//! Limits: nothing here is measured from a person. The distributions of expressions follow the findings
//! of Jimenez 2012 section 7.3.1, not their data.

mod brows;
mod chromophores;
mod expressions;
mod face_space;
mod lines;
mod noise;
mod own_folds;
mod own_hair;
mod regions;
mod relief;
mod specular;
pub(crate) mod strands;
mod surface;
#[cfg(test)]
mod tests;
mod wrinkles;

use rubor_rig::head::{Distribution, Head, Provenance, ProvenanceKind, SkinMaps, WrinkleZone};
use rubor_rig::hemoglobin;
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::{MAX_HEMOGLOBIN, MAX_MELANIN};
use thiserror::Error;

use brows::Hairs;
use chromophores::Chromophores;
pub(crate) use face_space::FaceSpace;
use regions::Regions;
use relief::Relief;
pub use strands::grow_lashes;
pub(crate) use strands::grow_lashes_along;
use surface::SkinSurface;
use wrinkles::Wrinkles;

use crate::convert::hemoglobin::default_radius;
use crate::convert::skin_texels::SkinTexels;
use crate::convert::transfer::{BiasTransfer, Warp, transfer};

/// Side of the maps of hemoglobin distributions, texels (Jimenez 2012 section 7.6).
pub const DISTRIBUTION_RESOLUTION: u32 = 256;
/// Side of the maps that local statistics are taken on, texels: they need many values, not their neighbourhood.
const STATISTICS_RESOLUTION: u32 = 512;
/// Radius of the disc of local statistics (Jimenez 2012 eq. 7.1), mm on the front of the face.
const STATISTICS_RADIUS_MM: f32 = 8.0;
/// Side of zone masks, texels.
pub const MASK_RESOLUTION: u32 = 128;
/// Side of the maps that [`synthesize`] accepts, texels.
pub const RESOLUTIONS: std::ops::RangeInclusive<u32> = 256..=4096;

/// The person whose maps are made.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Another seed is another person with the same parameters.
    pub seed: u64,
    /// Side of the detailed maps, texels, within [`RESOLUTIONS`].
    pub resolution: u32,
    /// Mean melanin volume fraction of the epidermis, 0 to 0.5: 0.02 very light, 0.3 very dark.
    pub melanin: f32,
    /// Mean hemoglobin volume fraction of the dermis, 0 to 0.15.
    pub hemoglobin: f32,
    /// Age in years, 15 to 90: deeper relief and lasting expression lines.
    pub age_years: f32,
    /// Amount of freckles, 0 to 1.
    pub freckles: f32,
    /// Number of moles, up to 100.
    pub moles: u32,
    /// Fullness of the brows, 0 (none) to 2.
    pub brows: f32,
    /// Beard stubble, 0 to 1.
    pub stubble: f32,
    /// Cropped scalp hair, 0 (bald) to 1.
    pub scalp_hair: f32,
    /// Melanin fraction that represents hair, up to 0.5.
    pub hair_melanin: f32,
    /// Share of hairs without pigment, 0 to 1.
    pub grey_hair: f32,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            resolution: 2048,
            melanin: 0.026,
            hemoglobin: 0.017,
            age_years: 32.0,
            freckles: 0.3,
            moles: 7,
            brows: 1.0,
            stubble: 0.0,
            scalp_hair: 0.85,
            hair_melanin: 0.47,
            grey_hair: 0.0,
        }
    }
}

impl Options {
    /// How often [`synthesize_into_with`] reports: once for each row of its detailed maps.
    pub fn steps(&self) -> u64 {
        u64::from(self.resolution) + u64::from(self.half_resolution())
    }

    fn half_resolution(&self) -> u32 {
        (self.resolution / 2).max(*RESOLUTIONS.start())
    }

    /// The seed as the hashes take it.
    fn seed_bits(&self) -> u32 {
        (self.seed ^ (self.seed >> 32)) as u32
    }

    fn check(&self) -> Result<(), SynthesizeError> {
        if !RESOLUTIONS.contains(&self.resolution) {
            return Err(SynthesizeError::Resolution { found: self.resolution });
        }
        let ranges = [
            ("melanin", self.melanin, 0.0, 0.5),
            ("hemoglobin", self.hemoglobin, 0.0, 0.15),
            ("age_years", self.age_years, 15.0, 90.0),
            ("freckles", self.freckles, 0.0, 1.0),
            ("moles", self.moles as f32, 0.0, 100.0),
            ("brows", self.brows, 0.0, 2.0),
            ("stubble", self.stubble, 0.0, 1.0),
            ("scalp_hair", self.scalp_hair, 0.0, 1.0),
            ("hair_melanin", self.hair_melanin, 0.0, 0.5),
            ("grey_hair", self.grey_hair, 0.0, 1.0),
        ];
        for (option, found, low, high) in ranges {
            // Written so that NaN fails.
            if !(low..=high).contains(&found) {
                return Err(SynthesizeError::Option { option, found, low, high });
            }
        }
        Ok(())
    }
}

/// Why maps could not be made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SynthesizeError {
    /// The resolution is out of range.
    #[error("resolution: found {found}, expected {} to {} texels", RESOLUTIONS.start(), RESOLUTIONS.end())]
    Resolution {
        /// The value that was asked for.
        found: u32,
    },
    /// An option is out of range or not a number.
    #[error("option {option}: found {found}, expected {low} to {high}")]
    Option {
        /// Name of the field of [`Options`].
        option: &'static str,
        /// The value that was asked for.
        found: f32,
        /// Least accepted value.
        low: f32,
        /// Greatest accepted value.
        high: f32,
    },
    /// The hemoglobin of a state could not be reduced to statistics.
    #[error("hemoglobin distributions: {0}")]
    Hemoglobin(#[from] rubor_rig::hemoglobin::HemoglobinError),
    /// There is nothing to draw on.
    #[error(
        "head {head}: found no skin triangle with area in the texture's unit square, expected a part of material skin"
    )]
    NoSkin {
        /// Name of the head.
        head: String,
    },
}

/// Makes all maps of a head.
///
/// Melanin, hemoglobin and slopes have the resolution of the options; wrinkle slopes, specular and scattering half of
/// it; distributions [`DISTRIBUTION_RESOLUTION`], zone masks [`MASK_RESOLUTION`]. Texels without skin hold means of
/// the skin about them. Landmarks that a head lacks are done without; with fewer than six the maps are placed by the
/// head's bounds, which is rough.
///
/// # Errors
/// Options out of range, or a head without skin.
pub fn synthesize(head: &Head, options: &Options) -> Result<SkinMaps, SynthesizeError> {
    synthesize_with(head, options, &|| ())
}

fn synthesize_with(
    head: &Head,
    options: &Options,
    step: &(dyn Fn() + Sync),
) -> Result<SkinMaps, SynthesizeError> {
    options.check()?;
    let space = FaceSpace::fit(head);
    let surface = SkinSurface::new(head, &space);
    if surface.is_empty() {
        return Err(SynthesizeError::NoSkin { head: head.name.clone() });
    }
    let is_placed = space.follows_landmarks();
    let without_hair = Options { brows: 0.0, stubble: 0.0, scalp_hair: 0.0, ..options.clone() };
    let options = if is_placed { options } else { &without_hair };
    let seed = options.seed_bits();
    let chromophores = Chromophores::new(options);
    let wrinkles = Wrinkles::new(seed);
    let lasting = if is_placed { lasting_lines(options.age_years) } else { 0.0 };

    let half = surface.rasterise(options.half_resolution());
    let texel_mm = surface.texel_mm(half.resolution());
    let half_relief = Relief::new(seed, texel_mm, options.age_years);
    let half_hairs = Hairs::new(options, texel_mm);
    let mut broad = half.bake_with::<5>(&[2, 2, 1], step, |site| {
        let r = Regions::of(site);
        let [x, y] =
            if Wrinkles::reach(site.place) { site.slopes(wrinkles.gradient(site.place)) } else { [0.0; 2] };
        let hair = half_hairs.cover(site.place, &r);
        let cavity = half_relief.sample(site, &r).cavity;
        let hollow = r.hollow(site.open);
        let [intensity, roughness] = specular::specular(site.place, &r, cavity, hair, seed);
        // Light that enters a hollow is not given back beside it.
        let scattering = (1.0 - 0.7 * hair) * (1.0 - 0.8 * hollow);
        [x, y, intensity * (1.0 - 0.85 * hollow), roughness, scattering]
    });
    let scattering = broad.pop();
    let specular = broad.pop();
    let wrinkle_slopes = broad;

    let full = surface.rasterise(options.resolution);
    let texel_mm = surface.texel_mm(options.resolution);
    let relief = Relief::new(seed, texel_mm, options.age_years);
    let hairs = Hairs::new(options, texel_mm);
    let mut detailed = full.bake_with::<5>(&[1, 1, 2, 1], step, |site| {
        let r = Regions::of(site);
        let relief = relief.sample(site, &r);
        let hair = hairs.cover(site.place, &r);
        let hollow = r.hollow(site.open);
        let melanin = chromophores.melanin(site.place, &r, relief.cavity, hollow);
        let (_, hemoglobin) = chromophores.hemoglobin_with_mean(site.place, &r, hollow);
        let [mut x, mut y] = site.slopes(relief.gradient);
        if let Some(map) = wrinkle_slopes.first() {
            // Both maps have the same texture frame, so slopes simply add.
            x += lasting * map.sample(site.uv.x, site.uv.y, 0);
            y += lasting * map.sample(site.uv.x, site.uv.y, 1);
        }
        [melanin.clamp(0.0, MAX_MELANIN as f32), hemoglobin.clamp(0.0, MAX_HEMOGLOBIN as f32), x, y, hair]
    });
    let hair = detailed.pop();
    let slopes = detailed.pop();
    let hemoglobin = detailed.pop();
    let melanin = detailed.pop();

    let coarse = surface.rasterise(STATISTICS_RESOLUTION);
    let texel_mm = surface.texel_mm(STATISTICS_RESOLUTION);
    let radius_px = (STATISTICS_RADIUS_MM / texel_mm).round().clamp(2.0, 64.0) as u32;
    let (hemoglobin_mean, distributions) =
        expressions::distributions(&coarse, radius_px, DISTRIBUTION_RESOLUTION, seed, |site| {
            let r = Regions::of(site);
            let (mean, value) = chromophores.hemoglobin_with_mean(site.place, &r, r.hollow(site.open));
            (r, mean, value)
        })?;
    let masks = surface.rasterise(MASK_RESOLUTION);
    let zones = masks
        .bake::<12>(&[1; 12], |site| wrinkles::zone_weights(site.place))
        .into_iter()
        .zip(wrinkles::ZONES)
        .map(|(mask, name)| WrinkleZone { name: name.into(), wrinkle_map: 0, mask })
        .collect();
    Ok(SkinMaps {
        albedo: None,
        melanin,
        hemoglobin,
        hemoglobin_mean: Some(hemoglobin_mean),
        distributions,
        slopes,
        wrinkle_slopes: if is_placed { wrinkle_slopes } else { Vec::new() },
        zones: if is_placed { zones } else { Vec::new() },
        specular,
        scattering,
        hair,
        hair_color_linear: hair_color_linear(options.hair_melanin, options.grey_hair),
        hair_count: None,
    })
}

/// Albedo of hair: more melanin is darker and, first, redder. Fitted by eye to golden blond (0.1), copper (0.24) and black
/// (0.5). Grey hair is a mix of hairs with pigment and of white ones.
fn hair_color_linear(melanin: f32, grey: f32) -> [f32; 3] {
    let white = [0.27, 0.23, 0.185];
    let red = (-((melanin - 0.24) / 0.09).powi(2)).exp();
    let pigmented = [(0.80, 8.0, 0.0), (0.66, 8.6, 0.36), (0.46, 8.8, 0.66)]
        .map(|(root, k, taken): (f32, f32, f32)| root * (-k * melanin).exp() * (1.0 - taken * red));
    std::array::from_fn(|i| pigmented[i] + grey * (white[i] - pigmented[i]))
}

/// Share of the expression wrinkles that stays on the face at rest.
fn lasting_lines(age_years: f32) -> f32 {
    0.03 + 0.5 * noise::smoothstep(26.0, 85.0, age_years)
}

/// Whether a head has the landmarks that say where its face is. Without them no hair, brows and wrinkles are made: their
/// places would be guesses.
pub fn finds_face(head: &Head) -> bool {
    FaceSpace::fit(head).follows_landmarks()
}

/// Provenance of maps made by [`synthesize`].
pub fn provenance(options: &Options) -> Vec<Provenance> {
    let source = format!(
        "rubor {} map synthesis, seed {}, {} texels, melanin {}, hemoglobin {}, age {}",
        env!("CARGO_PKG_VERSION"),
        options.seed,
        options.resolution,
        options.melanin,
        options.hemoglobin,
        options.age_years
    );
    ["melanin", "hemoglobin", "distributions", "slopes", "wrinkle_slopes", "zones", "specular", "scattering"]
        .into_iter()
        .map(|map| Provenance {
            of: format!("maps.{map}"),
            kind: ProvenanceKind::Synthesised,
            source: source.clone(),
            licence: "CC0-1.0".into(),
        })
        .collect()
}

/// Makes all maps of a head and puts them into it, replacing maps and their provenance, and grows brows as geometry. A head
/// whose skin has a colour by itself keeps the maps that it has and gets those that it lacks, but no relief.
///
/// # Errors
/// As [`synthesize`]; the head is then unchanged.
pub fn synthesize_into(head: &mut Head, options: &Options) -> Result<(), SynthesizeError> {
    synthesize_into_with(head, options, &|| ())
}

/// Gives skin that has a colour by itself what it lacks: distributions, and where landmarks say where the face is wrinkles.
/// Its own maps stay. No hair is made, as its colour holds it, and no relief: neutral skin is as smooth as its author made it.
fn complete(head: &mut Head, options: &Options, step: &(dyn Fn() + Sync)) -> Result<(), SynthesizeError> {
    options.check()?;
    let own = head.maps.clone();
    let Some(blood) = &own.hemoglobin else { return Ok(()) };
    let size = DISTRIBUTION_RESOLUTION;
    let mask = SkinTexels::new(head, blood.width, blood.height).mask();
    let radius_px = default_radius(blood);
    let mean = hemoglobin::neutral(blood, &mask, radius_px, size)?.mean;
    let mut made = vec!["distributions"];
    if finds_face(head) {
        let without_hair = Options { brows: 0.0, stubble: 0.0, scalp_hair: 0.0, ..options.clone() };
        let from = synthesize_with(head, &without_hair, step)?;
        // Only relative changes belong to an expression (Jimenez 2012 section 7.4.2).
        let followed = |d: &Distribution| match &from.hemoglobin_mean {
            Some(old) => transfer(d, old, &mean, &Warp::Identity, BiasTransfer::Ratio).ok(),
            None => None,
        };
        head.maps.distributions = from.distributions.iter().filter_map(followed).collect();
        head.maps.wrinkle_slopes = from.wrinkle_slopes;
        let mut zones = from.zones;
        own_folds::fade_zones(head, &mut zones);
        head.maps.zones = zones;
        made.extend(["wrinkle_slopes", "zones"]);
        if own.scattering.is_none() {
            head.maps.scattering = from.scattering;
            made.push("scattering");
        }
    } else {
        let distribution = |(name, factor): (&str, f32)| Distribution {
            name: name.into(),
            scale: Map::filled(size, size, &[1.0]),
            bias: Map { values: mean.values.iter().map(|v| factor * v).collect(), ..mean },
        };
        head.maps.distributions = expressions::mean_factors().into_iter().map(distribution).collect();
        (0..options.steps()).for_each(|_| step());
    }
    head.maps.hemoglobin_mean = Some(mean.clone());
    let stamps = provenance(options).into_iter().filter(|p| made.iter().any(|m| p.of == format!("maps.{m}")));
    head.provenance.retain(|p| !made.iter().any(|m| p.of == format!("maps.{m}")));
    head.provenance.extend(stamps);
    Ok(())
}

/// As [`synthesize_into`]; calls `step` [`Options::steps`] times on the way, from several threads.
///
/// # Errors
/// As [`synthesize`]; the head is then unchanged.
pub fn synthesize_into_with(
    head: &mut Head,
    options: &Options,
    step: &(dyn Fn() + Sync),
) -> Result<(), SynthesizeError> {
    if head.maps.albedo.is_some() {
        return complete(head, options, step);
    }
    let options = &own_hair::without_own(head, &FaceSpace::fit(head), options);
    head.maps = synthesize_with(head, options, step)?;
    strands::grow_brows(head, options);
    head.provenance.retain(|p| !p.of.starts_with("maps."));
    head.provenance.extend(provenance(options));
    Ok(())
}
