//! A performance over time: keyframed tracks of a sequence (`sequence.json`).
//!
//! Times are seconds from the start. A track is a constant or keys; between two keys it follows the easing of the
//! earlier one, before the first and after the last key it holds.
//!
//! Lengths are metres and positions are relative to the middle of the face between the eyes, with the head's axes:
//! +X the character's left, +Y up, +Z out of the face. So a sequence fits every head.
//!
//! ```
//! use rubor_rig::timeline::Sequence;
//! let sequence = Sequence::from_json("wink.json", r#"{
//!     "fps": 24, "duration": 1,
//!     "expressions": { "joy": [{ "t": 0, "v": 0, "ease": "smooth" }, { "t": 1, "v": 1 }] },
//! }"#).unwrap();
//! assert_eq!(sequence.frame_count(), 24);
//! assert_eq!(sequence.expressions["joy"].at(0.5), 0.5);
//! ```

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::path::Path;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};

pub use crate::camera::{Camera, Focus, FocusPoint, Framing};
use crate::error::RigError;
use crate::json::{self, Source, Step, steps};
use crate::life::{Eyes, Life};

/// A performance, its camera and its lights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[schemars(title = "rubor sequence")]
pub struct Sequence {
    /// Address of the JSON schema, for editors.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// What happens, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// Frames per second.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub fps: f64,
    /// Length in seconds.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub duration: f64,
    /// Width and height of the pictures in pixels, unless the command line says otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[u32; 2]>,
    /// Weight of each expression of the rig, 0 to 2; 1 is the expression as written there.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub expressions: BTreeMap<String, Track<f32>>,
    /// Weight of each state of the rig, 0 to 2.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub states: BTreeMap<String, Track<f32>>,
    /// Weight of single shapes, added to what expressions do. `eyeBlink` moves both eyes. Weights below 0 and above 1 are
    /// used unclamped.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub shapes: BTreeMap<String, Track<f32>>,
    /// A recorded performance that adds tracks of shapes and of the head. Tracks written here win over recorded ones.
    /// The rig reads no recordings; the program that loads the sequence does
    /// (`rubor_assets::import::capture::load_into`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capture: Option<Capture>,
    /// Motion of the head as a whole.
    #[serde(default)]
    pub head: HeadMotion,
    /// Where the eyes look, and their pupils.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eyes: Option<Eyes>,
    /// Blinks, saccades, breath and sway, which are not keyed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub life: Option<Life>,
    /// Camera.
    #[serde(default)]
    pub camera: Camera,
    /// Lights; without any, and without an environment, the renderer uses its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lights: Vec<Light>,
    /// Light from all around.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<Environment>,
    /// The text that it was read from.
    #[serde(skip)]
    pub source: Source,
}

/// Rotation about the head's pivot, then translation. The rotation is yaw times pitch times roll: roll acts first.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct HeadMotion {
    /// Positive turns the face to the character's left.
    #[serde(default)]
    pub yaw_degrees: Track<f32>,
    /// Positive lowers the chin.
    #[serde(default)]
    pub pitch_degrees: Track<f32>,
    /// Positive leans the head to the character's right.
    #[serde(default)]
    pub roll_degrees: Track<f32>,
    /// Metres.
    #[serde(default)]
    pub translation: Track<[f32; 3]>,
}

/// A recording as a track.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Capture {
    /// Live Link Face `.csv`, MediaPipe or ARKit `.json`: a path in the folder of the sequence or below it.
    pub file: String,
    /// Which recorded channel moves which shape; a path as above. Without it, names decide.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retarget: Option<String>,
    /// Seconds of the sequence at which the recording starts, 0 or more.
    #[serde(default)]
    #[schemars(range(min = 0))]
    pub start: f64,
    /// Only the part between two times of the recording, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trim: Option<[f64; 2]>,
}

/// A light. Which fields it needs depends on its kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Light {
    /// Such as `key`, `fill`, `rim`; for messages only.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Kind of the light.
    pub kind: LightKind,
    /// Linear Rec. 709, each 0 or more.
    #[serde(default = "white")]
    pub color: Track<[f32; 3]>,
    /// `directional`: irradiance of a surface that faces it (a white matte surface gets radiance intensity / pi).
    /// `point`, `spot`: radiant intensity, so the irradiance at a distance of d metres is intensity / d^2.
    #[serde(default = "unit")]
    pub intensity: Track<f32>,
    /// `point`, `spot`: metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<Track<[f32; 3]>>,
    /// `directional`, `spot`: the direction in which the light travels; any length but 0.
    /// A spot without a direction points at the middle of the face.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Track<[f32; 3]>>,
    /// `spot`: full angles of the cone, degrees: the inner one is fully lit, outside the outer one it is dark.
    #[serde(default = "cone", skip_serializing_if = "is_default_cone")]
    pub cone_degrees: [f32; 2],
    /// `point`, `spot`: diameter of the lamp, 0 to 2 metres: the softness of its shadows and the width of its highlights.
    #[serde(default = "diameter", skip_serializing_if = "is_default_diameter")]
    #[schemars(range(min = 0, max = 2))]
    pub diameter: f32,
    /// `directional`: full angle that the lamp subtends, 0 to 60 degrees; the sun has 0.53.
    #[serde(default = "angle", skip_serializing_if = "is_default_angle")]
    #[schemars(range(min = 0, max = 60))]
    pub angle_degrees: f32,
    /// Whether it casts shadows.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub shadow: bool,
}

/// Kind of a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub enum LightKind {
    /// From far away: parallel rays.
    Directional,
    /// From a point within a cone.
    Spot,
    /// From a point to all sides.
    Point,
}

/// Light from all around.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Environment {
    /// A built-in environment or the path of an equirectangular HDR image; the program that renders loads it.
    pub name: String,
    /// Factor of its radiance, 0 or more.
    #[serde(default = "unit")]
    pub intensity: Track<f32>,
    /// About +Y; positive turns it as a positive yaw turns the head.
    #[serde(default)]
    pub rotation_degrees: Track<f32>,
}

/// A value over time.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Track<T> {
    /// The same at all times.
    Constant(T),
    /// Keys at strictly increasing times; at least one.
    Keys(Vec<Key<T>>),
}

/// A value at a time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Key_of_{T}")]
pub struct Key<T> {
    /// Seconds from the start of the sequence, 0 or more.
    #[schemars(range(min = 0))]
    pub t: f64,
    /// Value at that time.
    pub v: T,
    /// Interpolation to the next key.
    #[serde(default)]
    pub ease: Ease,
}

/// The interpolation from one key to the next. Each starts at 0 and ends at 1 exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub enum Ease {
    /// Constant speed.
    #[default]
    Linear,
    /// Slow at both ends: `3u^2 - 2u^3`.
    Smooth,
    /// Slow at both ends without a jump of acceleration: `6u^5 - 15u^4 + 10u^3`.
    Smoother,
    /// Slow start: `u^2`.
    EaseIn,
    /// Slow end: `1 - (1 - u)^2`.
    EaseOut,
    /// Slow start and end, faster between than `smooth`: cubic.
    EaseInOut,
    /// Holds, then jumps at the next key.
    Step,
}

impl Ease {
    /// Every easing.
    pub const ALL: [Ease; 7] = [
        Ease::Linear,
        Ease::Smooth,
        Ease::Smoother,
        Ease::EaseIn,
        Ease::EaseOut,
        Ease::EaseInOut,
        Ease::Step,
    ];

    /// Fraction of the change at a fraction `u` of the time, both 0 to 1.
    pub fn apply(self, u: f64) -> f64 {
        let u = u.clamp(0.0, 1.0);
        match self {
            Ease::Linear => u,
            Ease::Smooth => u * u * (3.0 - 2.0 * u),
            Ease::Smoother => u * u * u * (u * (6.0 * u - 15.0) + 10.0),
            Ease::EaseIn => u * u,
            Ease::EaseOut => 1.0 - (1.0 - u) * (1.0 - u),
            Ease::EaseInOut if u < 0.5 => 4.0 * u * u * u,
            Ease::EaseInOut => 1.0 - 4.0 * (1.0 - u).powi(3),
            Ease::Step if u < 1.0 => 0.0,
            Ease::Step => 1.0,
        }
    }
}

/// A value that a [`Track`] can hold.
pub trait TrackValue: Copy + Default {
    /// The numbers of it.
    fn components(&self) -> &[f32];
    /// `self` at 0, `other` at 1.
    fn mix(self, other: Self, share: f64) -> Self;
    #[doc(hidden)]
    fn from_components(components: &[f32]) -> Option<Self>;
    #[doc(hidden)]
    const IS_NUMBER: bool;
}

fn mix_f32(a: f32, b: f32, share: f64) -> f32 {
    // In f64 and as a weighted mean, so that both ends are exact and the result stays between them.
    (f64::from(a) * (1.0 - share) + f64::from(b) * share) as f32
}

impl TrackValue for f32 {
    const IS_NUMBER: bool = true;

    fn components(&self) -> &[f32] {
        std::slice::from_ref(self)
    }

    fn mix(self, other: Self, share: f64) -> Self {
        mix_f32(self, other, share)
    }

    fn from_components(components: &[f32]) -> Option<Self> {
        components.first().copied()
    }
}

impl TrackValue for [f32; 3] {
    const IS_NUMBER: bool = false;

    fn components(&self) -> &[f32] {
        self
    }

    fn mix(self, other: Self, share: f64) -> Self {
        std::array::from_fn(|i| mix_f32(self[i], other[i], share))
    }

    fn from_components(components: &[f32]) -> Option<Self> {
        components.try_into().ok()
    }
}

impl<T: Default> Default for Track<T> {
    fn default() -> Self {
        Self::Constant(T::default())
    }
}

impl<T: TrackValue> Track<T> {
    /// Value at a time in seconds.
    pub fn at(&self, time_s: f64) -> T {
        let keys = match self {
            Track::Constant(value) => return *value,
            Track::Keys(keys) => keys,
        };
        let next = keys.partition_point(|key| key.t <= time_s);
        match (next.checked_sub(1).and_then(|i| keys.get(i)), keys.get(next)) {
            (Some(from), Some(to)) => {
                let share = from.ease.apply((time_s - from.t) / (to.t - from.t));
                from.v.mix(to.v, share)
            }
            (Some(only), None) | (None, Some(only)) => only.v,
            (None, None) => T::default(),
        }
    }

    /// Every value in the track, with the path from the track to it.
    fn values(&self) -> Vec<(Vec<Step>, T)> {
        match self {
            Track::Constant(value) => vec![(Vec::new(), *value)],
            Track::Keys(keys) => {
                keys.iter().enumerate().map(|(i, key)| (steps![i, "v"].to_vec(), key.v)).collect()
            }
        }
    }

    /// Time of the last key, seconds; `None` for a constant.
    pub fn last_key_s(&self) -> Option<f64> {
        match self {
            Track::Constant(_) => None,
            Track::Keys(keys) => keys.last().map(|key| key.t),
        }
    }
}

/// A number or a key: the elements of a track's array.
enum Element<T> {
    Number(f32),
    Key(Key<T>),
}

impl<'de, T: TrackValue + Deserialize<'de>> Deserialize<'de> for Element<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ElementVisitor<T>(PhantomData<T>);
        impl<'de, T: TrackValue + Deserialize<'de>> Visitor<'de> for ElementVisitor<T> {
            type Value = Element<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(if T::IS_NUMBER {
                    "a key {\"t\", \"v\"}"
                } else {
                    "a number or a key {\"t\", \"v\"}"
                })
            }

            fn visit_f64<E: de::Error>(self, number: f64) -> Result<Element<T>, E> {
                if T::IS_NUMBER {
                    return Err(E::invalid_type(de::Unexpected::Float(number), &self));
                }
                Ok(Element::Number(number as f32))
            }

            fn visit_u64<E: de::Error>(self, number: u64) -> Result<Element<T>, E> {
                self.visit_f64(number as f64)
            }

            fn visit_i64<E: de::Error>(self, number: i64) -> Result<Element<T>, E> {
                self.visit_f64(number as f64)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Element<T>, A::Error> {
                Key::deserialize(MapAccessDeserializer::new(map)).map(Element::Key)
            }
        }
        deserializer.deserialize_any(ElementVisitor(PhantomData))
    }
}

impl<'de, T: TrackValue + Deserialize<'de>> Deserialize<'de> for Track<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TrackVisitor<T>(PhantomData<T>);
        impl<'de, T: TrackValue + Deserialize<'de>> Visitor<'de> for TrackVisitor<T> {
            type Value = Track<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(if T::IS_NUMBER {
                    "a number or an array of keys {\"t\", \"v\"}"
                } else {
                    "an array of three numbers or of keys {\"t\", \"v\"}"
                })
            }

            fn visit_f64<E: de::Error>(self, number: f64) -> Result<Track<T>, E> {
                match T::from_components(&[number as f32]) {
                    Some(value) => Ok(Track::Constant(value)),
                    None => Err(E::invalid_type(de::Unexpected::Float(number), &self)),
                }
            }

            fn visit_u64<E: de::Error>(self, number: u64) -> Result<Track<T>, E> {
                self.visit_f64(number as f64)
            }

            fn visit_i64<E: de::Error>(self, number: i64) -> Result<Track<T>, E> {
                self.visit_f64(number as f64)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Track<T>, A::Error> {
                let (mut numbers, mut keys) = (Vec::new(), Vec::new());
                while let Some(element) = seq.next_element::<Element<T>>()? {
                    match element {
                        Element::Number(number) => numbers.push(number),
                        Element::Key(key) => keys.push(key),
                    }
                }
                match (numbers.len(), keys.len()) {
                    (0, 0) => Err(de::Error::invalid_length(0, &self)),
                    (0, _) => Ok(Track::Keys(keys)),
                    (count, 0) => T::from_components(&numbers)
                        .map(Track::Constant)
                        .ok_or_else(|| de::Error::invalid_length(count, &self)),
                    (count, more) => Err(de::Error::invalid_length(count + more, &self)),
                }
            }
        }
        deserializer.deserialize_any(TrackVisitor(PhantomData))
    }
}

impl<T: JsonSchema> JsonSchema for Track<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("Track_of_{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let constant = generator.subschema_for::<T>();
        let key = generator.subschema_for::<Key<T>>();
        json_schema!({
            "description": "The same at all times, or keys in the order of their times.",
            "anyOf": [constant, { "type": "array", "items": key, "minItems": 1 }],
        })
    }
}

fn white() -> Track<[f32; 3]> {
    Track::Constant([1.0; 3])
}

fn unit() -> Track<f32> {
    Track::Constant(1.0)
}

fn cone() -> [f32; 2] {
    [30.0, 40.0]
}

fn is_default_cone(degrees: &[f32; 2]) -> bool {
    *degrees == cone()
}

/// Diameter of a lamp with a place of which nothing is said, metres: a small soft box.
const DIAMETER: f32 = 0.24;
/// Angle of a distant lamp of which nothing is said, degrees: half of it has a tangent of 0.05.
const ANGLE_DEGREES: f32 = 5.724_81;

fn diameter() -> f32 {
    DIAMETER
}

fn is_default_diameter(metres: &f32) -> bool {
    *metres == DIAMETER
}

fn angle() -> f32 {
    ANGLE_DEGREES
}

fn is_default_angle(degrees: &f32) -> bool {
    *degrees == ANGLE_DEGREES
}

fn yes() -> bool {
    true
}

fn is_yes(value: &bool) -> bool {
    *value
}

/// File name that messages give the demo sequence.
const DEMO_SEQUENCE_FILE: &str = "demo_sequence.json";
/// The demo sequence as text, comments included: a sequence to learn from.
pub const DEMO_SEQUENCE_JSON: &str = include_str!("demo_sequence.json");

/// Largest weight of an expression or state.
const STRONGEST_WEIGHT: f32 = 2.0;
/// A day: a longer duration is a mistake, and the number of its frames would overflow.
const LONGEST_S: f64 = 86_400.0;
/// Faster than any camera that films faces.
const FASTEST_FPS: f64 = 10_000.0;

impl Sequence {
    /// Reads and checks a sequence. `file` is the name that messages give it.
    ///
    /// # Errors
    /// The first fault that depends on neither rig nor head, with its place.
    pub fn from_json(file: &str, text: &str) -> Result<Self, RigError> {
        let (mut sequence, source) = json::from_str::<Self>(file, text)?;
        sequence.source = source;
        sequence.check()?;
        Ok(sequence)
    }

    /// Reads a sequence file.
    ///
    /// # Errors
    /// As [`Sequence::from_json`], and if the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, RigError> {
        Self::from_json(&path.display().to_string(), &json::read_text(path)?)
    }

    /// The sequence that `rubor demo` shows, for the default rig.
    ///
    /// # Errors
    /// None that a user can cause: the text is part of the program and a test reads it.
    pub fn demo() -> Result<Self, RigError> {
        Self::from_json(DEMO_SEQUENCE_FILE, DEMO_SEQUENCE_JSON)
    }

    /// A sequence without tracks.
    pub fn still(fps: f64, duration: f64) -> Self {
        Self {
            schema: None,
            description: String::new(),
            fps,
            duration,
            size: None,
            expressions: BTreeMap::new(),
            states: BTreeMap::new(),
            shapes: BTreeMap::new(),
            capture: None,
            head: HeadMotion::default(),
            eyes: None,
            life: None,
            camera: Camera::default(),
            lights: Vec::new(),
            environment: None,
            source: Source::default(),
        }
    }

    /// Number of frames: frame i stands at i / fps, and the last one before `duration`. At least 1.
    pub fn frame_count(&self) -> u32 {
        // A duration that is a whole number of frames up to rounding has no extra frame.
        const ROUNDING: f64 = 1e-6;
        ((self.duration * self.fps - ROUNDING).ceil() as u32).max(1)
    }

    /// Time of a frame, seconds.
    pub fn frame_time_s(&self, frame: u32) -> f64 {
        f64::from(frame) / self.fps
    }

    /// Checks what depends on neither rig nor head.
    ///
    /// # Errors
    /// The first violation, with its place if the sequence was read from a text.
    pub fn check(&self) -> Result<(), RigError> {
        if !(self.fps > 0.0 && self.fps <= FASTEST_FPS) {
            let expected = "frames per second, more than 0 and at most 10000";
            return self.wrong(&steps!["fps"], &self.fps.to_string(), expected);
        }
        if !(self.duration > 0.0 && self.duration <= LONGEST_S) {
            let expected = "a length in seconds, more than 0 and at most 86400";
            return self.wrong(&steps!["duration"], &self.duration.to_string(), expected);
        }
        if let Some([width, height]) = self.size
            && (width == 0 || height == 0)
        {
            let expected = "a width and a height of at least 1 pixel";
            return self.wrong(&steps!["size"], &format!("{width} x {height}"), expected);
        }
        let any = (f32::NEG_INFINITY, f32::INFINITY);
        let weight = (0.0, STRONGEST_WEIGHT);
        for (name, track) in &self.expressions {
            self.check_track(&steps!["expressions", name], track, weight)?;
        }
        for (name, track) in &self.states {
            self.check_track(&steps!["states", name], track, weight)?;
        }
        for (name, track) in &self.shapes {
            self.check_track(&steps!["shapes", name], track, any)?;
        }
        self.check_life()?;
        if let Some(capture) = &self.capture {
            if !(capture.start >= 0.0 && capture.start <= LONGEST_S) {
                let expected = "a time in seconds, from 0 to 86400";
                return self.wrong(&steps!["capture", "start"], &capture.start.to_string(), expected);
            }
            if let Some([from, to]) = capture.trim
                && !(from >= 0.0 && to > from)
            {
                let expected = "two times in seconds, the second after the first";
                return self.wrong(&steps!["capture", "trim"], &format!("[{from}, {to}]"), expected);
            }
        }
        self.check_track(&steps!["head", "yawDegrees"], &self.head.yaw_degrees, any)?;
        self.check_track(&steps!["head", "pitchDegrees"], &self.head.pitch_degrees, any)?;
        self.check_track(&steps!["head", "rollDegrees"], &self.head.roll_degrees, any)?;
        self.check_track(&steps!["head", "translation"], &self.head.translation, any)?;
        let camera = &self.camera;
        self.check_optional(&steps!["camera", "position"], camera.position.as_ref(), any)?;
        self.check_optional(&steps!["camera", "target"], camera.target.as_ref(), any)?;
        self.check_optional(&steps!["camera", "fovDegrees"], camera.fov_degrees.as_ref(), (1.0, 170.0))?;
        self.check_lens()?;
        self.check_track(&steps!["camera", "orbitDegrees"], &camera.orbit_degrees, any)?;
        self.check_track(&steps!["camera", "elevationDegrees"], &camera.elevation_degrees, (-89.0, 89.0))?;
        for (i, light) in self.lights.iter().enumerate() {
            self.check_light(i, light)?;
        }
        if let Some(environment) = &self.environment {
            self.check_track(
                &steps!["environment", "intensity"],
                &environment.intensity,
                (0.0, f32::INFINITY),
            )?;
            self.check_track(&steps!["environment", "rotationDegrees"], &environment.rotation_degrees, any)?;
        }
        Ok(())
    }

    fn check_light(&self, i: usize, light: &Light) -> Result<(), RigError> {
        let any = (f32::NEG_INFINITY, f32::INFINITY);
        let positive = (0.0, f32::INFINITY);
        self.check_track(&steps!["lights", i, "color"], &light.color, positive)?;
        self.check_track(&steps!["lights", i, "intensity"], &light.intensity, positive)?;
        self.check_optional(&steps!["lights", i, "position"], light.position.as_ref(), any)?;
        self.check_optional(&steps!["lights", i, "direction"], light.direction.as_ref(), any)?;
        if let Some(direction) = &light.direction {
            for (inner, value) in direction.values() {
                if value == [0.0; 3] {
                    let at = [&steps!["lights", i, "direction"][..], &inner].concat();
                    return self.wrong(&at, "a direction of length 0", "a direction");
                }
            }
        }
        let [inner, outer] = light.cone_degrees;
        if !(inner >= 0.0 && inner <= outer && outer > 0.0 && outer < 180.0) {
            let expected = "inner and outer angle, 0 <= inner <= outer < 180 degrees";
            return self.wrong(&steps!["lights", i, "coneDegrees"], &format!("[{inner}, {outer}]"), expected);
        }
        if !(0.0..=2.0).contains(&light.diameter) {
            let found = light.diameter.to_string();
            return self.wrong(&steps!["lights", i, "diameter"], &found, "0 to 2 metres");
        }
        if !(0.0..=60.0).contains(&light.angle_degrees) {
            let found = light.angle_degrees.to_string();
            return self.wrong(&steps!["lights", i, "angleDegrees"], &found, "0 to 60 degrees");
        }
        let missing = match light.kind {
            LightKind::Directional if light.direction.is_none() => "direction",
            LightKind::Spot | LightKind::Point if light.position.is_none() => "position",
            _ => return Ok(()),
        };
        let kind = match light.kind {
            LightKind::Directional => "directional",
            LightKind::Spot => "spot",
            LightKind::Point => "point",
        };
        let found = format!("a {kind} light without a {missing}");
        self.wrong(&steps!["lights", i], &found, &format!("the field {missing:?}"))
    }

    fn check_life(&self) -> Result<(), RigError> {
        if let Some(eyes) = &self.eyes {
            let turn = (-45.0, 45.0);
            self.check_track(&steps!["eyes", "yawDegrees"], &eyes.yaw_degrees, turn)?;
            self.check_track(&steps!["eyes", "pitchDegrees"], &eyes.pitch_degrees, turn)?;
            self.check_track(&steps!["eyes", "pupilMm"], &eyes.pupil_mm, (1.5, 9.0))?;
        }
        let Some(life) = &self.life else { return Ok(()) };
        // NaN fails this comparison too.
        if !(life.blinks >= 0.0 && life.blinks <= 4.0) {
            return self.wrong(&steps!["life", "blinks"], &life.blinks.to_string(), "a number from 0 to 4");
        }
        let breaths = life.breaths_per_minute;
        if !(4.0..=60.0).contains(&breaths) {
            let expected = "breaths per minute, 4 to 60";
            return self.wrong(&steps!["life", "breathsPerMinute"], &breaths.to_string(), expected);
        }
        let factor = (0.0, 5.0);
        self.check_track(&steps!["life", "saccades"], &life.saccades, factor)?;
        self.check_track(&steps!["life", "breathing"], &life.breathing, factor)?;
        self.check_track(&steps!["life", "sway"], &life.sway, factor)
    }

    pub(crate) fn check_optional<T: TrackValue>(
        &self,
        at: &[Step],
        track: Option<&Track<T>>,
        range: (f32, f32),
    ) -> Result<(), RigError> {
        track.map_or(Ok(()), |track| self.check_track(at, track, range))
    }

    pub(crate) fn check_track<T: TrackValue>(
        &self,
        at: &[Step],
        track: &Track<T>,
        (least, most): (f32, f32),
    ) -> Result<(), RigError> {
        if let Track::Keys(keys) = track {
            if keys.is_empty() {
                return self.wrong(at, "no keys", "at least one key");
            }
            let mut earlier = None;
            for (i, key) in keys.iter().enumerate() {
                let inner = [at, &steps![i, "t"]].concat();
                if !(key.t.is_finite() && key.t >= 0.0) {
                    return self.wrong(&inner, &key.t.to_string(), "a time in seconds, 0 or more");
                }
                if let Some(earlier) = earlier
                    && key.t <= earlier
                {
                    let expected = format!("a time after that of the key before it ({earlier})");
                    return self.wrong(&inner, &key.t.to_string(), &expected);
                }
                earlier = Some(key.t);
            }
        }
        for (inner, value) in track.values() {
            for number in value.components() {
                let expected = if !number.is_finite() {
                    "a finite number".to_owned()
                } else if *number < least || *number > most {
                    match (least.is_finite(), most.is_finite()) {
                        (true, false) => format!("a number of {least} or more"),
                        (false, true) => format!("a number of {most} or less"),
                        _ => format!("a number from {least} to {most}"),
                    }
                } else {
                    continue;
                };
                return self.wrong(&[at, &inner].concat(), &number.to_string(), &expected);
            }
        }
        Ok(())
    }

    pub(crate) fn wrong<T>(&self, path: &[Step], found: &str, expected: &str) -> Result<T, RigError> {
        Err(RigError {
            place: self.source.place_of_value(path),
            found: found.to_owned(),
            expected: expected.to_owned(),
            nearest: None,
        })
    }
}

/// JSON schema of `sequence.json`.
pub fn sequence_schema() -> serde_json::Value {
    schemars::schema_for!(Sequence).to_value()
}
