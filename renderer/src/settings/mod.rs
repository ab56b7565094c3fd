//! How frames are made, as one value: [`Settings`] = [`Output`] + [`Quality`] + [`Look`].
//!
//! ```text
//! defaults, presets, JSON, flags --overlay--> Settings --validate--> a frame
//! Settings --schema, leaves--> JSON schema, command flags, documentation
//! ```
//!
//! This is the only definition of a setting. Its documentation comments are the help of the flags, its schema gives
//! their ranges, and `job.json` and `stats.json` hold the value itself. Methods and their names are in [`methods`].
//!
//! ```
//! use rubor_renderer::settings::{Preset, Settings};
//! let mut settings = Settings::default();
//! settings.overlay(&serde_json::json!({ "quality": { "scatter": "burley-disk:16" }, "output": { "size": [64, 64] } }))?;
//! assert_eq!(settings.quality.scatter.to_string(), "burley-disk:16");
//! assert_eq!(Preset::Draft.quality().scatter.name(), "separable");
//! # Ok::<(), rubor_renderer::settings::SettingsError>(())
//! ```

mod antialias;
mod leaves;
pub mod methods;
mod profile;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::channels::Channel;
pub use antialias::{AntialiasPatterns, AntialiasPreset};
pub use leaves::{Leaf, leaves};
pub use methods::{
    AntialiasMethod, BackdropMethod, BounceMethod, ColorMethod, CurvatureMethod, DepthOfFieldMethod,
    DetailMethod, DitherMethod, GROUPS, Group, Method, RasterMethod, ScatterMethod, SpecularMethod, Stage,
    ToneMap, TransmitMethod, UnknownMethod, WrinkleMethod,
};
pub use profile::DiffusionProfile;

/// How frames are made.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "camelCase")]
#[schemars(title = "rubor settings", inline)]
pub struct Settings {
    /// The output of a frame.
    pub output: Output,
    /// Quality against speed.
    pub quality: Quality,
    /// How the light becomes a picture.
    pub look: Look,
}

/// The output of a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "camelCase")]
#[schemars(inline)]
pub struct Output {
    /// Width and height of the picture in pixels
    #[schemars(extend("x-flag" = "WxH"))]
    pub size: [u32; 2],
    /// Samples on a side of a pixel that are drawn and averaged before antialiasing; multiplies those of ssaa:N
    #[schemars(range(min = 1, max = 8))]
    pub supersampling: u32,
    /// Further images that the frame keeps, by name
    pub channels: Vec<Channel>,
}

/// How well and how fast a frame is made: a choice of each group of methods, and their numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "camelCase")]
#[schemars(inline)]
pub struct Quality {
    /// How light scatters in skin
    pub scatter: ScatterMethod,
    /// How light passes through thin parts
    pub transmit: TransmitMethod,
    /// Light from one place of a head on another
    pub bounce: BounceMethod,
    /// Where pre-integrated scattering takes the curvature of the skin from
    pub curvature: CurvatureMethod,
    /// Whether the blood of a face moves
    pub color: ColorMethod,
    /// How wrinkles join the relief of the skin
    pub wrinkles: WrinkleMethod,
    /// The highlight of skin
    pub specular: SpecularMethod,
    /// What turns triangles into pixels; the picture is the same up to the rounding of edges
    pub raster: RasterMethod,
    /// What is drawn of things smaller than a pixel.
    pub detail: DetailMethod,
    /// Antialiasing of the displayed picture
    pub antialias: AntialiasMethod,
    /// Thresholds and search lengths of the antialiasing
    pub antialias_preset: AntialiasPreset,
    /// Which patterns of edges stand for which contours; published is for comparisons with the published tables
    pub antialias_patterns: AntialiasPatterns,
    /// How the blur of a lens is computed, where the camera has an f-stop
    pub depth_of_field: DepthOfFieldMethod,
    /// How far light goes in skin, for every scattering method
    pub profile: DiffusionProfile,
    /// Share of the skin's colour that texture-space gives to light before it scatters; 0 leaves all of it for after
    #[schemars(range(min = 0, max = 1))]
    pub pre_scatter: f32,
    /// What texture-space leaves out: culled skin faces away, sized texels are under a pixel, clipped skin is out of view
    pub map_savings: Vec<MapSaving>,
    /// Texels on a side of a shadow map
    #[schemars(range(min = 16, max = 16384))]
    pub shadow_size: u32,
}

/// What texture-space need not light and blur (Jimenez 2012 ch. 3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
pub enum MapSaving {
    /// Skin that faces away from the camera by more than 105 degrees.
    Culled,
    /// Texels smaller than a pixel of the nearest part of the head: the map is halved until they are not.
    Sized,
    /// Skin so far outside of the picture that no light scatters in.
    Clipped,
}

impl MapSaving {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Culled, Self::Sized, Self::Clipped];
}

/// How the light of a frame becomes a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "camelCase")]
#[schemars(inline)]
pub struct Look {
    /// Factor of the light before the tone map
    #[schemars(range(min = 0, max = 1e6))]
    pub exposure: f32,
    /// Stops of exposure on top of it: 1 is twice the light
    #[schemars(range(min = -20, max = 20))]
    pub ev: f32,
    /// Colour temperature, in kelvin, of the light that is shown as white; less makes the picture bluer, 6504 changes nothing
    #[schemars(range(min = 1500, max = 15000))]
    pub temperature: f32,
    /// Tint of the light that is shown as white, in steps of 1/3000 of CIE 1960 uv: above 0 the picture turns more magenta
    #[schemars(range(min = -150, max = 150))]
    pub tint: f32,
    /// From radiance to the brightness of a display
    pub tone_map: ToneMap,
    /// Darker corners, in units of the natural fall-off of a lens: cos^4 of the angle to its axis
    #[schemars(range(min = 0, max = 16))]
    pub vignette: f32,
    /// Share of the light that the lens spreads around bright places
    #[schemars(range(min = 0, max = 1))]
    pub bloom: f32,
    /// How far it spreads the light, in heights of the picture
    #[schemars(range(min = 0.002, max = 1))]
    pub bloom_radius: f32,
    /// Graininess of the film: 1000 times the standard deviation of density in a circle of 48 micrometres; fine film has 5 to 8,
    /// fast film 15 to 30
    #[schemars(range(min = 0, max = 100))]
    pub grain: f32,
    /// Size of the grain on the film, in micrometres
    #[schemars(range(min = 1, max = 200))]
    pub grain_size: f32,
    /// Noise that hides the steps of 8 bits
    pub dither: DitherMethod,
    /// What is behind the heads
    pub backdrop: BackdropMethod,
    /// Factor of the light of the backdrop
    #[schemars(range(min = 0, max = 1000))]
    pub backdrop_light: f32,
    /// Millimetres above the lower end of a head, and beside the cut of its shoulders, over which it fades into the backdrop
    #[schemars(range(min = 0, max = 500))]
    pub fade: f32,
}

/// Temperature that changes nothing, kelvin: that of D65, the white of displays.
pub const NEUTRAL_KELVIN: f32 = 6504.0;

/// Qualities by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// For trials: cheap scattering, small shadow maps, no light through thin parts.
    Draft,
    /// For previewing a performance; the default.
    Review,
    /// For final pictures: more taps, sixteen samples per pixel.
    Final,
    /// As exact as time allows: the integral over the surface.
    Reference,
}

/// Settings with which no frame can be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SettingsError {
    /// A value is outside of its range.
    #[error("{setting}: found {found}, expected {expected}")]
    Range {
        /// Its path, such as `output.supersampling`.
        setting: String,
        /// Its value.
        found: String,
        /// The range.
        expected: String,
    },
    /// A field has an unknown name, or a value has the wrong type.
    #[error("{0}")]
    Json(String),
}

impl Default for Output {
    fn default() -> Self {
        Self { size: [640, 640], supersampling: 1, channels: Vec::new() }
    }
}

impl Default for Quality {
    fn default() -> Self {
        Self {
            scatter: ScatterMethod::Separable(17),
            transmit: TransmitMethod::ShadowDepth,
            bounce: BounceMethod::Patches,
            curvature: CurvatureMethod::Mesh,
            color: ColorMethod::Hemoglobin,
            wrinkles: WrinkleMethod::PartialDerivative,
            specular: SpecularMethod::OneLobe,
            raster: RasterMethod::Auto,
            detail: DetailMethod::Auto,
            antialias: AntialiasMethod::SmaaS2x,
            antialias_preset: AntialiasPreset::High,
            antialias_patterns: AntialiasPatterns::Revised,
            depth_of_field: DepthOfFieldMethod::Gather(48),
            profile: DiffusionProfile::default(),
            pre_scatter: 0.0,
            map_savings: MapSaving::ALL.to_vec(),
            shadow_size: 2048,
        }
    }
}

impl Default for Look {
    fn default() -> Self {
        Self {
            exposure: 1.8,
            ev: 0.0,
            temperature: NEUTRAL_KELVIN,
            tint: 0.0,
            tone_map: ToneMap::Filmic,
            vignette: 0.0,
            bloom: 0.0,
            bloom_radius: 0.1,
            grain: 0.0,
            grain_size: 10.0,
            dither: DitherMethod::None,
            backdrop: BackdropMethod::Plain,
            backdrop_light: 1.0,
            fade: 0.0,
        }
    }
}

impl Look {
    /// Factor of the light before the tone map: `exposure` with its stops.
    pub fn gain(&self) -> f32 {
        self.exposure * self.ev.exp2()
    }

    /// Whether the picture gets noise after it is antialiased.
    pub fn has_noise(&self) -> bool {
        self.grain > 0.0 || self.dither != DitherMethod::None
    }

    /// Whether white is another than that of displays.
    pub fn is_balanced(&self) -> bool {
        self.temperature != NEUTRAL_KELVIN || self.tint != 0.0
    }
}

impl Preset {
    /// Every preset, the fastest first.
    pub const ALL: [Self; 4] = [Self::Draft, Self::Review, Self::Final, Self::Reference];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Review => "review",
            Self::Final => "final",
            Self::Reference => "reference",
        }
    }

    /// The quality that it chooses.
    pub fn quality(self) -> Quality {
        let review = Quality::default();
        match self {
            Self::Draft => Quality {
                scatter: ScatterMethod::Separable(9),
                transmit: TransmitMethod::None,
                antialias: AntialiasMethod::Smaa1x,
                shadow_size: 1024,
                ..review
            },
            Self::Review => review,
            Self::Final => Quality {
                scatter: ScatterMethod::Separable(33),
                antialias: AntialiasMethod::Ssaa(4),
                shadow_size: 4096,
                ..review
            },
            Self::Reference => Quality {
                scatter: ScatterMethod::ReferenceSurface(64),
                antialias: AntialiasMethod::Ssaa(4),
                shadow_size: 4096,
                ..review
            },
        }
    }
}

impl Settings {
    /// Samples on a side of a pixel: those asked for and those of `ssaa:N`.
    pub fn samples_per_side(&self) -> u32 {
        self.output.supersampling * self.quality.antialias.supersampling()
    }

    /// Pixels that the passes before the resolve draw.
    pub fn frame_size(&self) -> [u32; 2] {
        self.output.size.map(|n| n * self.samples_per_side())
    }

    /// Replaces the settings that a JSON object of the same structure names; the others stay.
    ///
    /// # Errors
    /// An unknown field, a value of the wrong type, an unknown method.
    pub fn overlay(&mut self, changes: &Value) -> Result<(), SettingsError> {
        let wrong = |e: serde_json::Error| SettingsError::Json(e.to_string());
        let mut whole = serde_json::to_value(&*self).map_err(wrong)?;
        merge(&mut whole, changes);
        *self = serde_json::from_value(whole).map_err(wrong)?;
        Ok(())
    }

    /// Checks every range of the schema.
    ///
    /// # Errors
    /// The first setting out of range.
    pub fn validate(&self) -> Result<(), SettingsError> {
        self.quality.scatter.validate().map_err(|e| out_of_range("quality.scatter", e))?;
        self.quality.antialias.validate().map_err(|e| out_of_range("quality.antialias", e))?;
        let (scatter, transmit) = (self.quality.scatter, self.quality.transmit);
        if transmit == TransmitMethod::TranslucentShadowMap
            && !matches!(scatter, ScatterMethod::TextureSpace(_))
        {
            return Err(SettingsError::Range {
                setting: "quality.transmit".into(),
                found: format!("{transmit} with {scatter}, which has no map of the light on all of the skin"),
                expected: "shadow-depth or none, or scatter texture-space".into(),
            });
        }
        let look = &self.look;
        let numbers = [
            ("exposure", look.exposure),
            ("ev", look.ev),
            ("temperature", look.temperature),
            ("tint", look.tint),
            ("vignette", look.vignette),
            ("bloom", look.bloom),
            ("bloomRadius", look.bloom_radius),
            ("grain", look.grain),
            ("grainSize", look.grain_size),
            ("backdropLight", look.backdrop_light),
            ("fade", look.fade),
        ];
        // JSON has no such numbers, so the schema does not say it.
        if let Some((name, value)) = numbers.into_iter().find(|(_, value)| !value.is_finite()) {
            return Err(SettingsError::Range {
                setting: format!("look.{name}"),
                found: value.to_string(),
                expected: "a finite number".into(),
            });
        }
        leaves::check_ranges(self)
    }
}

fn out_of_range(setting: &str, e: UnknownMethod) -> SettingsError {
    SettingsError::Range { setting: setting.into(), found: e.found, expected: e.expected }
}

/// Objects are merged, everything else is replaced.
fn merge(whole: &mut Value, changes: &Value) {
    match (whole, changes) {
        (Value::Object(whole), Value::Object(changes)) => {
            for (name, change) in changes {
                merge(whole.entry(name).or_insert(Value::Null), change);
            }
        }
        (whole, changes) => *whole = changes.clone(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn settings_read_back_and_unknown_fields_are_refused() {
        for preset in Preset::ALL {
            let settings = Settings { quality: preset.quality(), ..Settings::default() };
            settings.validate().expect("presets are in range");
            let text = serde_json::to_string(&settings).expect("it is written");
            assert_eq!(serde_json::from_str::<Settings>(&text).expect("it reads"), settings);
        }
        let mut settings = Settings::default();
        let unknown = settings.overlay(&json!({ "quality": { "scater": "none" } }));
        assert!(unknown.expect_err("a slip").to_string().contains("scater"));
        let wrong = settings.overlay(&json!({ "quality": { "scatter": "separable:8" } }));
        assert!(wrong.expect_err("even").to_string().contains("N odd"));
        assert_eq!(settings, Settings::default(), "a refused overlay changes nothing");
    }

    #[test]
    fn ranges_are_those_of_the_schema() {
        let wrong = |change: fn(&mut Settings)| {
            let mut settings = Settings::default();
            change(&mut settings);
            settings.validate().expect_err("it is out of range").to_string()
        };
        assert_eq!(wrong(|s| s.output.supersampling = 9), "output.supersampling: found 9, expected 1 to 8");
        assert!(wrong(|s| s.quality.shadow_size = 8).contains("16 to 16384"));
        assert!(wrong(|s| s.look.exposure = -1.0).starts_with("look.exposure: found -1"));
        assert!(wrong(|s| s.look.exposure = f32::NAN).contains("finite"));
        assert!(wrong(|s| s.quality.scatter = ScatterMethod::Separable(4)).contains("separable:N"));
    }
}
