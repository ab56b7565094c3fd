//! Which recorded channel moves which shape: a file that can be edited.
//!
//! ```
//! use rubor_assets::import::capture::Retarget;
//! let retarget = Retarget::from_json("actor.json", r#"{
//!     "neutral": { "from": 0, "to": 0.5 },           // the actor at rest
//!     "shapes": {
//!         "JawOpen": { "shape": "jawOpen", "gain": 1.2 },
//!         "CheekPuff": ["cheekPuffLeft", "cheekPuffRight"],
//!         "TongueOut": null,                          // not wanted
//!     },
//! }"#).unwrap();
//! assert_eq!(retarget.neutral.unwrap().to, 0.5);
//! ```

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::path::Path;

use rubor_rig::error::RigError;
use rubor_rig::json;
use rubor_rig::names::{Key, canonical};
use serde::de::value::MapAccessDeserializer;
use serde::de::{self, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::ImportError;

/// Largest gain, offset and limit.
const MOST_GAIN: f32 = 1000.0;

/// How a recording becomes tracks. Channels that it does not name keep their name and value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields, default)]
pub struct Retarget {
    /// For whom, in words.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// Where the actor is at rest: the median weights of that time are subtracted, and the rest is scaled so
    /// that a full weight stays full. Angles of the head are only shifted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub neutral: Option<Neutral>,
    /// Removes jitter; null keeps every sample as it is.
    pub smoothing: Option<Smoothing>,
    /// Captured weights above this are cut before the gain; null keeps them.
    pub limit: Option<f32>,
    /// Keys that a straight line replaces within this weight (or this many tenths of a degree) are left out.
    pub tolerance: f32,
    /// Channel as the recording spells it, in any letter case, to its targets: a shape, several, or null for none.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub shapes: BTreeMap<String, Targets>,
    /// Rotation of the head.
    pub head: HeadRetarget,
}

/// A time at which the actor is at rest, seconds of the recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Neutral {
    /// Start.
    pub from: f64,
    /// End.
    pub to: f64,
}

/// A bilateral filter over time: jitter smaller than the amplitude goes, fast moves stay.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Smoothing {
    /// Standard deviation in time, milliseconds.
    pub window_ms: f64,
    /// Standard deviation in weight.
    pub amplitude: f64,
    /// Standard deviation of angles, degrees.
    pub amplitude_degrees: f64,
}

impl Default for Smoothing {
    /// Judged on still seconds of ARKit recordings, where weights tremble by up to 0.01.
    fn default() -> Self {
        Self { window_ms: 40.0, amplitude: 0.012, amplitude_degrees: 0.4 }
    }
}

/// Shapes that one channel moves. Written as a shape, a list of shapes, or null for none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Targets(pub Vec<ShapeTarget>);

/// A shape that a channel moves: `weight * gain + offset`. Written as its name, or as an object.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeTarget {
    /// Name of the shape.
    pub shape: String,
    /// Factor of the weight.
    pub gain: f32,
    /// Added to the weight.
    pub offset: f32,
}

/// The object form of a [`ShapeTarget`].
#[derive(Serialize, Deserialize)]
#[serde(rename = "target", deny_unknown_fields)]
struct Scaled {
    shape: String,
    #[serde(default = "one")]
    gain: f32,
    #[serde(default)]
    offset: f32,
}

impl Serialize for ShapeTarget {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Scaled { shape: self.shape.clone(), gain: self.gain, offset: self.offset }.serialize(serializer)
    }
}

impl Serialize for Targets {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0[..] {
            [] => serializer.serialize_unit(),
            [target] => target.serialize(serializer),
            list => list.serialize(serializer),
        }
    }
}

// Written by hand instead of as untagged enums, so that an error has the place of the wrong value.
impl<'de> Deserialize<'de> for ShapeTarget {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TargetVisitor;
        impl<'de> Visitor<'de> for TargetVisitor {
            type Value = ShapeTarget;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a shape or an object {\"shape\", \"gain\", \"offset\"}")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<ShapeTarget, E> {
                Ok(ShapeTarget { shape: name.to_owned(), gain: 1.0, offset: 0.0 })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ShapeTarget, A::Error> {
                let Scaled { shape, gain, offset } = Scaled::deserialize(MapAccessDeserializer::new(map))?;
                Ok(ShapeTarget { shape, gain, offset })
            }
        }
        deserializer.deserialize_any(TargetVisitor)
    }
}

impl<'de> Deserialize<'de> for Targets {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TargetsVisitor;
        impl<'de> Visitor<'de> for TargetsVisitor {
            type Value = Targets;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a shape, an object {\"shape\", \"gain\", \"offset\"}, a list of them or null")
            }

            fn visit_unit<E: de::Error>(self) -> Result<Targets, E> {
                Ok(Targets::default())
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<Targets, E> {
                Ok(Targets(vec![ShapeTarget { shape: name.to_owned(), gain: 1.0, offset: 0.0 }]))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Targets, A::Error> {
                ShapeTarget::deserialize(MapAccessDeserializer::new(map)).map(|t| Targets(vec![t]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Targets, A::Error> {
                let mut targets = Vec::new();
                while let Some(target) = seq.next_element()? {
                    targets.push(target);
                }
                Ok(Targets(targets))
            }
        }
        deserializer.deserialize_any(TargetsVisitor)
    }
}

/// Factors and shifts of the head's angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeadRetarget {
    /// Positive turns the face to the character's left.
    pub yaw: HeadAngle,
    /// Positive lowers the chin.
    pub pitch: HeadAngle,
    /// Positive leans the head to the character's right.
    pub roll: HeadAngle,
}

/// `angle * gain + offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default, deny_unknown_fields)]
pub struct HeadAngle {
    /// Factor; 0 keeps the head still, -1 mirrors.
    pub gain: f32,
    /// Degrees.
    pub offset_degrees: f32,
}

fn one() -> f32 {
    1.0
}

impl Default for HeadAngle {
    fn default() -> Self {
        Self { gain: 1.0, offset_degrees: 0.0 }
    }
}

impl Default for Retarget {
    fn default() -> Self {
        Self {
            description: String::new(),
            neutral: None,
            smoothing: Some(Smoothing::default()),
            limit: Some(1.0),
            tolerance: 5e-4,
            shapes: BTreeMap::new(),
            head: HeadRetarget::default(),
        }
    }
}

impl Retarget {
    /// Reads and checks a retarget file. `file` is the name that messages give it.
    ///
    /// # Errors
    /// Syntax, unknown fields, numbers out of range, with file, line and column.
    pub fn from_json(file: &str, text: &str) -> Result<Self, RigError> {
        let (retarget, source) = json::from_str::<Self>(file, text)?;
        retarget.check().map_err(|(path, found, expected)| RigError {
            place: source.place_of_value(&path),
            found,
            expected: expected.into(),
            nearest: None,
        })?;
        Ok(retarget)
    }

    /// Reads a retarget file.
    ///
    /// # Errors
    /// As [`Retarget::from_json`], and if the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, ImportError> {
        Ok(Self::from_json(&path.display().to_string(), &json::read_text(path)?)?)
    }

    /// A file to edit: every channel of a recording with its shape, null where none is known.
    pub fn template(recording: &super::Recording) -> Self {
        let entry = |c: &super::Channel| {
            let known = canonical(&c.name);
            let target = |shape: &str| ShapeTarget { shape: shape.to_owned(), gain: 1.0, offset: 0.0 };
            (c.name.clone(), Targets(known.into_iter().map(target).collect()))
        };
        Self { shapes: recording.channels.iter().map(entry).collect(), ..Self::default() }
    }

    /// Finds the shapes of channels by name in any spelling; the first entry of a spelling counts.
    pub(super) fn by_key(&self) -> HashMap<Key, &[ShapeTarget]> {
        let mut found = HashMap::new();
        for (name, targets) in &self.shapes {
            found.entry(Key::new(name)).or_insert(&targets.0[..]);
        }
        found
    }

    fn check(&self) -> Result<(), (Vec<json::Step>, String, &'static str)> {
        let at = |keys: &[&str]| keys.iter().map(|k| json::Step::from(*k)).collect::<Vec<_>>();
        if let Some(n) = self.neutral
            && !(n.from >= 0.0 && n.to >= n.from && n.to.is_finite())
        {
            return Err((at(&["neutral"]), format!("{} to {}", n.from, n.to), "a time range from 0 on"));
        }
        if let Some(s) = self.smoothing {
            // Longer windows and larger amplitudes are means over the whole take, at a cost that grows with both.
            for (name, v, most, expected) in [
                ("windowMs", s.window_ms, 500.0, "more than 0 and at most 500"),
                ("amplitude", s.amplitude, 10.0, "more than 0 and at most 10"),
                ("amplitudeDegrees", s.amplitude_degrees, 360.0, "more than 0 and at most 360"),
            ] {
                if !(v > 0.0 && v <= most) {
                    return Err((at(&["smoothing", name]), v.to_string(), expected));
                }
            }
        }
        if !(self.tolerance >= 0.0 && self.tolerance < 1.0) {
            return Err((at(&["tolerance"]), self.tolerance.to_string(), "0 or more and less than 1"));
        }
        if let Some(limit) = self.limit
            && !(limit > 0.0 && limit <= MOST_GAIN)
        {
            return Err((at(&["limit"]), limit.to_string(), "more than 0 and at most 1000, or null"));
        }
        let fits = |value: f32| value.abs() <= MOST_GAIN;
        for (name, targets) in &self.shapes {
            for ShapeTarget { shape, gain, offset } in &targets.0 {
                if shape.is_empty() || !fits(*gain) || !fits(*offset) {
                    let found = format!("{shape:?}, gain {gain}, offset {offset}");
                    let expected = "a shape with gain and offset from -1000 to 1000";
                    return Err((at(&["shapes", name]), found, expected));
                }
            }
        }
        let head = &self.head;
        for (name, angle) in [("yaw", head.yaw), ("pitch", head.pitch), ("roll", head.roll)] {
            if !fits(angle.gain) || !fits(angle.offset_degrees) {
                let found = format!("gain {}, offset {}", angle.gain, angle.offset_degrees);
                return Err((at(&["head", name]), found, "gain and offset from -1000 to 1000"));
            }
        }
        Ok(())
    }
}
