//! The same skin for methods that draw in real time and for the path tracer.
//!
//! ```text
//! medium --photon walk--> profile   of every method
//!        \--Flesh-------> volume    with a boundary of the roughness that the head's map has
//! head ----bare---------> head without relief, wrinkles, hair and blood that moves
//! shot ----bare---------> lamps with shadows, no sky
//! ```

use rubor_renderer::settings::{
    AntialiasMethod, ColorMethod, DetailMethod, DiffusionProfile, Settings, SpecularMethod, WrinkleMethod,
};
use rubor_rig::evaluate::Shot;
use rubor_rig::head::{Head, SkinMaps};
use rubor_rig::map::Map;
use rubor_rig::skin::chromophores::{SkinLookup, fractions_at};
use rubor_rig::skin::medium::{Medium, SKIN1, SKIN2, rgb_media};
use rubor_rig::skin::model::ProfileModel;
use rubor_rig::skin::volume::{Flesh, Lamp, Masking};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Outcome};

/// Index of refraction of skin.
const ETA: f64 = 1.4;
/// Roughness of its boundary: alpha of GGX in the volume, m of Beckmann in real time, which is the same width of slopes. Skin has
/// 0.2 to 0.4; what a rougher one loses to second microfacets would be the larger error
/// ([`rubor_rig::skin::volume::Boundary`]).
const ROUGHNESS: f64 = 0.1;
/// The same for scenes of other programs: their paths find a lamp through the boundary by chance, and the chance grows with its
/// square.
const EXPORTED_ROUGHNESS: f64 = 0.3;
/// Photons of the profile: 0.3 % on its total.
const PHOTONS: u64 = 400_000;
/// Steps on a side of the colours among which [`fractions_of`] looks.
const STEPS: u32 = 256;

/// A skin of Jensen, Marschner, Levoy and Hanrahan 2001.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MediumName {
    /// Lighter absorption of red; mean free paths of 1.3, 0.95 and 0.67 mm.
    Skin1,
    /// Mean free paths of 0.9, 0.6 and 0.52 mm; darker edges are narrower.
    Skin2,
}

impl MediumName {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Skin1 => "skin1",
            Self::Skin2 => "skin2",
        }
    }

    /// Media of R, G and B.
    ///
    /// # Errors
    /// None that a user can cause: the coefficients are published.
    pub fn media(self) -> Outcome<[Medium; 3]> {
        let coefficients = match self {
            Self::Skin1 => SKIN1,
            Self::Skin2 => SKIN2,
        };
        rgb_media(&coefficients, ETA).map_err(Failure::input)
    }

    /// The volume.
    ///
    /// # Errors
    /// As [`MediumName::media`].
    pub fn flesh(self) -> Outcome<Flesh> {
        Flesh::new(&self.media()?, BOUNDARY[1], Masking::Separable).map_err(Failure::input)
    }

    /// The volume of scenes for other programs, and its roughness.
    ///
    /// # Errors
    /// As [`MediumName::media`].
    pub fn exported_flesh(self, masking: Masking) -> Outcome<(Flesh, f64)> {
        let flesh = Flesh::new(&self.media()?, EXPORTED_ROUGHNESS, masking).map_err(Failure::input)?;
        Ok((flesh, EXPORTED_ROUGHNESS))
    }

    /// Settings of methods in real time: the profile of this medium by a photon walk, nothing but light in skin.
    ///
    /// # Errors
    /// As [`MediumName::media`].
    pub fn settings(self, base: &Settings) -> Outcome<Settings> {
        let name = format!("{}-monte-carlo", self.name());
        let profile =
            ProfileModel::MonteCarlo.profile(&name, &self.media()?, None, PHOTONS).map_err(Failure::input)?;
        let mut settings = base.clone();
        let quality = &mut settings.quality;
        quality.profile = DiffusionProfile::from(profile);
        quality.wrinkles = WrinkleMethod::None;
        quality.color = ColorMethod::Static;
        quality.specular = SpecularMethod::OneLobe;
        quality.detail = DetailMethod::Full;
        quality.antialias = AntialiasMethod::None;
        Ok(settings)
    }
}

/// Index and roughness of the boundary.
pub const BOUNDARY: [f64; 2] = [ETA, ROUGHNESS];

/// Melanin and hemoglobin whose colour is nearest to one, by its logarithm.
///
/// Light that crosses a thin part, or goes from one place to another, depends on the colour of the skin; else it would not matter,
/// as it is divided out.
pub fn fractions_of(color: [f64; 3], lookup: &SkinLookup) -> [f32; 2] {
    let at = |i: u32| (i as f32 + 0.5) / STEPS as f32;
    let error = |[u, v]: [f32; 2]| {
        let found = lookup.sample_at(u, v);
        (0..3).map(|c| (f64::from(found[c]).max(1e-4) / color[c]).ln().powi(2)).sum::<f64>()
    };
    let places = (0..STEPS * STEPS).map(|i| [at(i % STEPS), at(i / STEPS)]);
    let best = places.min_by(|a, b| error(*a).total_cmp(&error(*b))).unwrap_or([0.5; 2]);
    fractions_at(f64::from(best[0]), f64::from(best[1])).map(|f| f as f32)
}

/// The head with maps that say the same everywhere: volume fractions of melanin and hemoglobin.
pub fn bare_head(head: &Head, fractions: [f32; 2]) -> Head {
    let even = |texel: &[f32]| Some(Map::filled(1, 1, texel));
    let maps = SkinMaps {
        melanin: even(&fractions[..1]),
        hemoglobin: even(&fractions[1..]),
        // Reflectance of the index 1.4.
        specular: even(&[1.0, ROUGHNESS as f32]),
        scattering: even(&[1.0]),
        ..SkinMaps::default()
    };
    Head { maps, ..head.clone() }
}

/// Colour of [`bare_head`] seen from the front, linear.
pub fn bare_color(fractions: [f32; 2], lookup: &SkinLookup) -> [f32; 3] {
    lookup.sample(fractions[0], fractions[1])
}

/// The shot in the light of its lamps alone, all with shadows; the head has no zones and no blood that moves.
pub fn bare_shot(shot: &Shot) -> Shot {
    let mut bare = shot.clone();
    bare.environment = None;
    bare.lights.iter_mut().for_each(|light| light.shadow = true);
    bare.face.zones.clear();
    bare.face.distributions.clear();
    bare.face.hemoglobin_scale = 1.0;
    bare
}

/// The lamps of a shot, as wide as the renderer makes them.
pub fn lamps(shot: &Shot) -> Vec<Lamp> {
    shot.lights.iter().map(|state| Lamp::new(state, state.radius, state.radius)).collect()
}
