//! Every method of rendering a frame, in one table: name, number, stage, summary, source.
//!
//! A row declares the variant of the group's type and all of its properties. Parsing, messages, command flags,
//! JSON schemas, the chart, the benchmark, documentation and tests read this table; nothing else names a method.
//!
//! ```
//! use rubor_renderer::settings::ScatterMethod;
//! let method: ScatterMethod = "separable:17".parse()?;
//! assert_eq!(method, ScatterMethod::Separable(17));
//! assert_eq!(method.to_string(), "separable:17");
//! assert!("seperable:17".parse::<ScatterMethod>().unwrap_err().to_string().contains("did you mean \"separable:17\""));
//! # Ok::<(), rubor_renderer::settings::UnknownMethod>(())
//! ```

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use rubor_rig::names::nearest;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The stage of the frame at which a method does its work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// The method does nothing.
    Nowhere,
    /// While triangles become pixels.
    Geometry,
    /// Before the view is known: maps of the head, light on all of its surface.
    BeforeView,
    /// While the visible surfaces are lit.
    Shading,
    /// On images of the lit surface.
    AfterShading,
    /// On the displayed picture.
    Picture,
    /// In a frame of its own, as exact as time allows.
    Reference,
}

/// The number after the colon in a method's name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Number {
    /// Least and largest value.
    pub range: RangeInclusive<u32>,
    /// Distance between allowed values, counted from the least.
    pub step: u32,
    /// The value of a name without a number; `None` if the number must be given.
    pub default: Option<u32>,
    /// The quantity that it counts.
    pub counts: &'static str,
}

/// A row of the table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Method {
    /// Name in arguments and files, without its number.
    pub name: &'static str,
    /// Its number, if it has one.
    pub number: Option<Number>,
    /// The stage at which it works.
    pub stage: Stage,
    /// One sentence that describes it.
    pub summary: &'static str,
    /// Source: author and year, or chapter.
    pub source: &'static str,
}

/// A group of methods of which a frame uses one.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// Name of the setting and of the flag.
    pub name: &'static str,
    /// The property that the methods decide.
    pub about: &'static str,
    /// Its methods, the cheapest first.
    pub methods: &'static [Method],
}

/// A name that is not in the table, or a number out of range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found {found:?}, expected {expected}{}", .nearest.as_ref().map(|n| format!("; did you mean {n:?}?")).unwrap_or_default())]
pub struct UnknownMethod {
    /// The text that was found.
    pub found: String,
    /// The texts that are allowed.
    pub expected: String,
    /// The most similar name, with its number.
    pub nearest: Option<String>,
}

impl Number {
    const fn any(least: u32, most: u32, default: Option<u32>, counts: &'static str) -> Option<Self> {
        Some(Self { range: least..=most, step: 1, default, counts })
    }

    const fn every(
        step: u32,
        least: u32,
        most: u32,
        default: Option<u32>,
        counts: &'static str,
    ) -> Option<Self> {
        Some(Self { range: least..=most, step, default, counts })
    }

    /// Whether `n` is one of its values.
    pub fn contains(&self, n: u32) -> bool {
        self.range.contains(&n) && (n - self.range.start()).is_multiple_of(self.step)
    }

    /// The value of it that is closest to `n`, the lesser of two.
    fn closest(&self, n: u32) -> u32 {
        let (least, most) = (*self.range.start(), *self.range.end());
        least + (n.clamp(least, most) - least) / self.step * self.step
    }

    fn values(&self) -> String {
        let (least, most) = (self.range.start(), self.range.end());
        match self.step {
            1 => format!("N from {least} to {most}"),
            _ if most - least == self.step => format!("N {least} or {most}"),
            2 => format!("N odd, {least} to {most}"),
            step => format!("N from {least} to {most} in steps of {step}"),
        }
    }
}

impl Method {
    /// Its syntax: `separable:N (N odd, 5 to 65)`.
    pub fn usage(&self) -> String {
        match &self.number {
            None => self.name.to_owned(),
            Some(n) if n.default.is_some() => format!("{}[:N] ({})", self.name, n.values()),
            Some(n) => format!("{}:N ({})", self.name, n.values()),
        }
    }

    /// A name that can be parsed: with the least number if one must be given.
    pub fn example(&self) -> String {
        match &self.number {
            Some(n) => format!("{}:{}", self.name, n.default.unwrap_or(*n.range.start())),
            None => self.name.to_owned(),
        }
    }
}

impl Group {
    /// Every allowed name, with ranges.
    pub fn usage(&self) -> String {
        let all: Vec<String> = self.methods.iter().map(Method::usage).collect();
        match all.split_last() {
            Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
            _ => all.concat(),
        }
    }

    /// Finds the row and the number of a name.
    fn find(&self, text: &str) -> Result<(usize, u32), UnknownMethod> {
        let (name, number) = match text.split_once(':') {
            Some((name, number)) => (name, Some(number)),
            None => (text, None),
        };
        let wrong = || {
            let names = self.methods.iter().map(|m| m.name);
            let nearest = nearest(name, names).and_then(|near| {
                let row = self.methods.iter().find(|m| m.name == near)?;
                match (&row.number, number.map(str::parse::<u32>)) {
                    (Some(n), Some(Ok(number))) => Some(format!("{near}:{}", n.closest(number))),
                    _ => Some(row.example()),
                }
            });
            UnknownMethod { found: text.to_owned(), expected: self.usage(), nearest }
        };
        let row = self.methods.iter().position(|m| m.name == name).ok_or_else(wrong)?;
        let value = match (&self.methods[row].number, number) {
            (None, None) => 0,
            (Some(range), Some(n)) => n.parse().ok().filter(|n| range.contains(*n)).ok_or_else(wrong)?,
            (Some(Number { default: Some(n), .. }), None) => *n,
            _ => return Err(wrong()),
        };
        Ok((row, value))
    }

    fn schema(&self) -> Schema {
        let names: Vec<String> = self.methods.iter().map(|m| m.name.to_owned()).collect();
        let examples: Vec<String> = self.methods.iter().map(Method::example).collect();
        json_schema!({
            "type": "string",
            "description": format!("{}: {}.", self.about, self.usage()),
            "x-usage": self.usage(),
            "pattern": format!("^({})(:[0-9]+)?$", names.join("|")),
            "examples": examples,
        })
    }
}

macro_rules! groups {
    ($($(#[$about:meta])* $group:ident, $name:literal, $says:literal {
        $($(#[doc = $summary:literal])+ $variant:ident $(($n:ident: $number:expr))?, $method:literal, $stage:ident, $source:literal;)*
    })*) => {
        /// Every group.
        pub const GROUPS: &[Group] = &[$($group::GROUP),*];

        $(
            $(#[$about])*
            #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
            pub enum $group {
                $($(#[doc = $summary])+ $variant $((groups!(@number $n)))?),*
            }

            impl $group {
                /// The rows of its methods.
                pub const GROUP: Group = Group {
                    name: $name,
                    about: $says,
                    methods: &[$(Method {
                        name: $method,
                        number: groups!(@or_none $($number)?),
                        stage: Stage::$stage,
                        summary: concat!($($summary),+),
                        source: $source,
                    }),*],
                };

                /// Every method; those with a number have their default or least number.
                pub fn all() -> impl Iterator<Item = Self> {
                    Self::GROUP.methods.iter().filter_map(|m| m.example().parse().ok())
                }

                /// Its row.
                pub fn method(self) -> &'static Method {
                    let mut row = 0;
                    $(
                        if let Self::$variant { .. } = self {
                            return &Self::GROUP.methods[row];
                        }
                        row += 1;
                    )*
                    &Self::GROUP.methods[row - 1]
                }

                /// Name in arguments and files, without its number.
                pub fn name(self) -> &'static str {
                    self.method().name
                }

                /// The number of its name.
                pub fn number(self) -> Option<u32> {
                    match self {
                        $(Self::$variant $(($n))? => groups!(@some $($n)?)),*
                    }
                }

                /// Checks the number.
                ///
                /// # Errors
                /// It is outside of the method's range.
                pub fn validate(self) -> Result<Self, UnknownMethod> {
                    self.to_string().parse()
                }
            }

            impl fmt::Display for $group {
                fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                    f.write_str(self.name())?;
                    self.number().map_or(Ok(()), |n| write!(f, ":{n}"))
                }
            }

            impl FromStr for $group {
                type Err = UnknownMethod;

                fn from_str(text: &str) -> Result<Self, UnknownMethod> {
                    let (found, _number) = Self::GROUP.find(text)?;
                    let mut row = 0;
                    $(
                        if found == row {
                            return Ok(Self::$variant $((groups!(@value $n _number)))?);
                        }
                        row += 1;
                    )*
                    unreachable!("row {found} of {row}")
                }
            }

            impl Serialize for $group {
                fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                    serializer.collect_str(self)
                }
            }

            impl<'de> Deserialize<'de> for $group {
                fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                    String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
                }
            }

            impl JsonSchema for $group {
                fn schema_name() -> std::borrow::Cow<'static, str> {
                    stringify!($group).into()
                }

                fn json_schema(_: &mut SchemaGenerator) -> Schema {
                    Self::GROUP.schema()
                }
            }
        )*
    };
    (@number $n:ident) => { u32 };
    (@value $n:ident $value:ident) => { $value };
    (@or_none) => { None };
    (@or_none $number:expr) => { $number };
    (@some) => { None };
    (@some $n:ident) => { Some($n) };
}

groups! {
    /// How light scatters in skin.
    ScatterMethod, "scatter", "Subsurface scattering" {
        /// Light leaves skin where it enters.
        None, "none", Nowhere, "";
        /// Light looked up over the cosine to the lamp, curvature and shadow, with N blurred maps of slopes: one for the
        /// three channels of light, or one for each.
        PreIntegrated(n: Number::every(2, 1, 3, Some(3), "blurred maps of slopes")), "pre-integrated", Shading,
            "Penner and Borshukov 2011";
        /// Six Gaussians over a map of the light on all of the skin, N texels on a side.
        TextureSpace(n: Number::every(64, 64, 4096, Some(1024), "texels on a side of the map of light")),
            "texture-space", BeforeView, "d'Eon and Luebke 2007; Jimenez 2012 ch. 3";
        /// Two passes of one kernel of N taps that follows the surface.
        Separable(n: Number::every(2, 5, 65, None, "taps")), "separable", AfterShading,
            "Jimenez et al. 2015; Jimenez 2012 ch. 6";
        /// Four or six Gaussians one after the other, wide ones on smaller images.
        ScreenGauss(n: Number::every(2, 4, 6, None, "Gaussians")), "screen-gauss", AfterShading, "Jimenez 2012 ch. 4";
        /// Thirteen jittered taps in one pass.
        ScreenJitter, "screen-jitter", AfterShading, "Hable, Borshukov and Hejl 2009; Jimenez 2012 ch. 4";
        /// N importance-sampled taps of normalized diffusion in one pass.
        BurleyDisk(n: Number::any(4, 256, None, "taps")), "burley-disk", AfterShading, "Golubev 2018";
        /// Disks of N samples of the BSSRDF in what each lamp sees, kept on six views of the head; knows the light's direction.
        DipoleCubemap(n: Number::any(2, 1024, Some(16), "samples per texel")), "dipole-cubemap", BeforeView,
            "DTU thesis draft, real-time directional subsurface scattering; Frisvad et al. 2014";
        /// The profile itself as a kernel in two dimensions, over all pixels that it reaches.
        ReferenceScreen, "reference-screen", AfterShading, "Jimenez 2012 eq. 3.2";
        /// The integral of the profile over the deformed surface, with N times 65 536 samples.
        ReferenceSurface(n: Number::any(1, 4096, Some(64), "batches of 65 536 samples")), "reference-surface",
            Reference, "Jensen et al. 2001; Jimenez 2012 eq. 5.1";
    }
    /// How light passes through thin parts.
    TransmitMethod, "transmit", "Light through thin parts" {
        /// None comes through.
        None, "none", Nowhere, "";
        /// Thickness from shadow maps, light from the integral of the profile over what the lamp shines on.
        ShadowDepth, "shadow-depth", Shading, "Jimenez et al. 2010; Jimenez 2012 ch. 5";
        /// Thickness and the place nearest to the lamp, blurred light from there; only with texture-space.
        TranslucentShadowMap, "translucent-shadow-map", BeforeView, "d'Eon and Luebke 2007; Lee, Realistic Skin Rendering";
    }
    /// Light from one place of a head on another.
    BounceMethod, "bounce", "Light from one place of a head on another" {
        /// None, but for a guess of the sky's light between the walls of a cavity.
        None, "none", Nowhere, "Jimenez et al. 2016, multiple-bounce ambient occlusion";
        /// Light of lamps and sky on patches of the skin, sent on along rays of every point of the head at rest.
        Patches, "patches", BeforeView, "Goral et al. 1984";
    }
    /// Where methods that need the curvature of the skin take it from.
    CurvatureMethod, "curvature", "Curvature of the skin" {
        /// Both principal curvatures of the deformed mesh, smoothed over neighbouring points.
        Mesh, "mesh", BeforeView, "least squares over the normals around a point; see Rusinkiewicz 2004";
        /// How fast normal and place change from pixel to pixel: one curvature for each triangle, whose edges may show.
        Screen, "screen", Shading, "Penner and Borshukov 2011";
    }
    /// Whether the blood of a face moves.
    ColorMethod, "color", "Colour of skin" {
        /// The neutral hemoglobin map, whatever the face does.
        Static, "static", Nowhere, "";
        /// Hemoglobin distributions blended by their weights.
        Hemoglobin, "hemoglobin", Shading, "Jimenez 2012 eq. 7.6";
    }
    /// How wrinkles join the relief of the skin.
    WrinkleMethod, "wrinkles", "Wrinkles" {
        /// No wrinkles.
        None, "none", Nowhere, "";
        /// Slopes of wrinkles add to those of the skin: exact for height fields, with any number of maps.
        PartialDerivative, "partial-derivative", Shading, "Jimenez 2012 section 8.2";
        /// Differences of unit normals add to the normal of the skin, which is then normalised again.
        Difference, "difference", Shading, "Jimenez 2012 section 8.2.1";
    }
    /// The highlight of skin.
    SpecularMethod, "specular", "Highlights of skin" {
        /// A Beckmann lobe of the roughness in the map.
        OneLobe, "one-lobe", Shading, "Kelemen and Szirmay-Kalos 2001; Lee, Realistic Skin Rendering";
        /// A sharp and a broad lobe with the mean square slope of the one lobe.
        TwoLobes, "two-lobes", Shading, "Graham et al. 2013";
    }
    /// What turns triangles into pixels.
    RasterMethod, "raster", "What turns triangles into pixels" {
        /// The faster of the two, once a device and a scene have been measured; until then the raster units.
        Auto, "auto", Geometry, "";
        /// The raster units of the device.
        Hardware, "hardware", Geometry, "Burns and Hunt 2013";
        /// Compute: one invocation per triangle, the largest key of depth and number per pixel.
        Compute, "compute", Geometry, "Laine and Karras 2011; Karis et al. 2021";
    }
    /// What is drawn of things that are smaller than a pixel.
    DetailMethod, "detail", "Things smaller than a pixel" {
        /// Coarser levels of a head while they are off by less than an eighth of a pixel; fewer and denser hairs where a pixel
        /// is wider than a hair.
        Auto, "auto", Geometry, "Garland and Heckbert 1997; Cook et al. 2007";
        /// All triangles and hairs.
        Full, "full", Geometry, "";
    }
    /// Antialiasing of the displayed picture.
    AntialiasMethod, "antialias", "Antialiasing" {
        /// Edges stay stairs.
        None, "none", Nowhere, "";
        /// Practical morphological antialiasing.
        Mlaa, "mlaa", Picture, "Jimenez 2012 ch. 9";
        /// One sample per pixel, with diagonals and corners.
        Smaa1x, "smaa-1x", Picture, "Jimenez 2012 ch. 10";
        /// One sample per pixel at alternating places, and the reprojected previous frame.
        SmaaT2x, "smaa-t2x", Picture, "Jimenez 2012 section 10.3.3";
        /// Two samples per pixel, each filtered for its own place in the pixel.
        SmaaS2x, "smaa-s2x", Picture, "Jimenez 2012 section 10.3.2";
        /// Two samples per pixel at alternating places, and the reprojected previous frame.
        Smaa4x, "smaa-4x", Picture, "Jimenez 2012 section 10.3.4";
        /// N x N samples per pixel, each lit and tone mapped: the reference.
        Ssaa(n: Number::any(1, 8, None, "samples on a side of a pixel")), "ssaa", Picture, "supersampling";
    }
    /// From radiance to the brightness of a display.
    ToneMap, "tone-map", "Tone map" {
        /// Radiance above 1 is white, nothing else changes: for comparisons with other programs.
        Linear, "linear", Picture, "IEC 61966-2-1";
        /// Shoulder, toe and linear part as one rational function; 4 becomes white.
        Filmic, "filmic", Picture, "Hable 2010; Jimenez 2012 section 8.3 and ch. 11";
        /// Close to the reference rendering of ACES 1.0 for sRGB: strong contrast, bright colours turn pale.
        Aces, "aces", Picture, "Hill 2016, fit of the ACES RRT and sRGB ODT";
        /// A log curve between rotated primaries: soft contrast, bright colours turn pale without a change of hue.
        Agx, "agx", Picture, "Sobotka 2022; polynomial of Wrensch 2023";
        /// Colours below 0.76 stay as they are; only highlights are compressed and turn pale.
        Neutral, "neutral", Picture, "Khronos PBR neutral tone mapper 2024";
    }
    /// Blur of what a lens with an aperture does not focus on.
    DepthOfFieldMethod, "depth-of-field", "Depth of field, where the camera has an f-stop" {
        /// Everything is in focus.
        None, "none", Nowhere, "";
        /// N taps in the largest circle of confusion that reaches a tile, each on a level as coarse as its share of the circle.
        Gather(n: Number::any(8, 256, Some(48), "taps")), "gather", Picture, "Potmesil and Chakravarty 1981; Jimenez 2014";
    }
    /// What is behind the heads.
    BackdropMethod, "backdrop", "What is behind the heads" {
        /// One dark grey.
        Plain, "plain", Nowhere, "";
        /// A grey wall with a lamp on it behind the head, which falls off to the sides.
        Gradient, "gradient", Picture, "inverse square law";
        /// The surroundings of the sequence, out of focus; a plain grey without any.
        Environment, "environment", Picture, "the environment of the sequence";
    }
    /// Noise that hides the steps of 8 bits.
    DitherMethod, "dither", "Noise that hides the steps of 8 bits" {
        /// Values are rounded.
        None, "none", Nowhere, "";
        /// Triangular noise of one step either way, the same for each frame number.
        Triangular, "triangular", Picture, "Lipshitz, Wannamaker and Vanderkooy 1992";
    }
}

impl AntialiasMethod {
    /// Samples on a side of a pixel that are drawn and averaged.
    pub fn supersampling(self) -> u32 {
        match self {
            Self::Ssaa(n) => n,
            _ => 1,
        }
    }

    /// Whether the previous frame takes part.
    pub fn is_temporal(self) -> bool {
        matches!(self, Self::SmaaT2x | Self::Smaa4x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back_and_rows_are_complete() {
        fn check<M: FromStr<Err = UnknownMethod> + fmt::Display>(group: &Group) {
            for row in group.methods {
                let text = row.example();
                assert_eq!(text.parse::<M>().expect("an example parses").to_string(), text);
                assert!(row.summary.trim().ends_with('.'), "{}: {:?}", row.name, row.summary);
                assert!(
                    !row.source.is_empty() || [Stage::Nowhere, Stage::Geometry].contains(&row.stage),
                    "{} has a source",
                    row.name
                );
            }
            let mut names: Vec<_> = group.methods.iter().map(|m| m.name).collect();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), group.methods.len(), "names of {} are unique", group.name);
        }
        check::<ScatterMethod>(&ScatterMethod::GROUP);
        check::<TransmitMethod>(&TransmitMethod::GROUP);
        check::<ColorMethod>(&ColorMethod::GROUP);
        check::<WrinkleMethod>(&WrinkleMethod::GROUP);
        check::<BounceMethod>(&BounceMethod::GROUP);
        check::<SpecularMethod>(&SpecularMethod::GROUP);
        check::<RasterMethod>(&RasterMethod::GROUP);
        check::<DetailMethod>(&DetailMethod::GROUP);
        check::<AntialiasMethod>(&AntialiasMethod::GROUP);
        check::<ToneMap>(&ToneMap::GROUP);
        check::<CurvatureMethod>(&CurvatureMethod::GROUP);
        check::<DepthOfFieldMethod>(&DepthOfFieldMethod::GROUP);
        check::<BackdropMethod>(&BackdropMethod::GROUP);
        check::<DitherMethod>(&DitherMethod::GROUP);
        assert_eq!(GROUPS.len(), 14, "a new group is checked above");
        assert_eq!(ScatterMethod::all().count(), ScatterMethod::GROUP.methods.len());
        assert_eq!("reference-surface".parse(), Ok(ScatterMethod::ReferenceSurface(64)));
    }

    #[test]
    fn wrong_names_say_what_is_possible() {
        for name in [
            "separable:16",
            "separable:67",
            "separable",
            "screen-gauss:5",
            "burley-disk:0",
            "none:1",
            "gauss",
        ] {
            let message = name.parse::<ScatterMethod>().expect_err("it is wrong").to_string();
            assert!(message.contains(name) && message.contains("separable:N (N odd, 5 to 65)"), "{message}");
        }
        let message = "smaa-2x".parse::<AntialiasMethod>().expect_err("it is wrong").to_string();
        assert!(
            message.ends_with("did you mean \"smaa-s2x\"?") || message.contains("did you mean"),
            "{message}"
        );
        for (wrong, near) in [
            ("separable:18", "separable:17"),
            ("separable:99", "separable:65"),
            ("seperable:2", "separable:5"),
        ] {
            let message = wrong.parse::<ScatterMethod>().expect_err("it is wrong").to_string();
            assert!(message.ends_with(&format!("did you mean {near:?}?")), "{message}");
        }
        assert!(ScatterMethod::Separable(4).validate().is_err());
    }

    #[test]
    fn methods_are_strings_in_json() {
        let text = serde_json::to_string(&ScatterMethod::BurleyDisk(16)).expect("it is written");
        assert_eq!(text, "\"burley-disk:16\"");
        assert_eq!(
            serde_json::from_str::<ScatterMethod>(&text).expect("it reads"),
            ScatterMethod::BurleyDisk(16)
        );
        assert!(serde_json::from_str::<ScatterMethod>("\"burley\"").is_err());
    }
}
