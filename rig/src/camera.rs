//! The camera of a sequence: framing, lens and focus.
//!
//! A lens is said in the terms of photography. The vertical field of view of a focal length `f` on a sensor of height `h` is
//! `2 atan(h / (2 f))`, the value with the lens at infinity; that a lens shows a little less when it focuses close
//! (breathing) is left out.
//!
//! ```
//! use rubor_rig::camera::{field_of_view, focal_length_mm};
//! assert!((field_of_view(85.0, 24.0).to_degrees() - 16.07).abs() < 0.01);
//! assert!((focal_length_mm(field_of_view(50.0, 24.0), 24.0) - 50.0).abs() < 1e-3);
//! ```

use std::collections::BTreeMap;
use std::fmt;

use glam::Vec3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::error::{Note, RigError};
use crate::evaluate::CameraState;
use crate::face_state::FaceState;
use crate::json::{Step, steps};
use crate::landmarks;
use crate::names::nearest;
use crate::timeline::{Key, Sequence, Track};

/// Height of a 36 x 24 mm sensor, millimetres.
pub const FULL_FRAME_HEIGHT_MM: f32 = 24.0;
/// Name of the focus on the eye that is nearer to the camera.
pub const NEAREST_EYE: &str = "nearest-eye";
/// From the centre of an eyeball to its iris, metres (Gullstrand's schematic eye: the iris lies 3.6 mm behind the front of
/// the cornea, which is 13.5 mm before the centre of rotation). Focus on an eye is focus on its iris.
const IRIS_METRES: f32 = 0.0099;
/// No lens focuses nearer, metres.
const NEAREST_FOCUS_METRES: f32 = 0.02;

/// Camera. `position`, `target` and `fovDegrees` or `focalLength` each replace what the framing gives.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Camera {
    /// How much of the character is seen.
    #[serde(default)]
    pub framing: Framing,
    /// Metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<Track<[f32; 3]>>,
    /// Point in the middle of the picture, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<Track<[f32; 3]>>,
    /// Vertical field of view, 1 to 170 degrees; or say `focalLength`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov_degrees: Option<Track<f32>>,
    /// Focal length, 2 to 2000 mm, in place of `fovDegrees`: the field of view is that on `sensorHeight`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focal_length: Option<Track<f32>>,
    /// Height of the sensor, 1 to 200 mm; 24 if it is not said (36 x 24 mm). Bloom does not depend on it, depth of field, focal
    /// length and film grain do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_height: Option<f32>,
    /// The f-number, 0.5 to 128: focal length over the width of the aperture. Without it everything is in focus.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub f_stop: Option<Track<f32>>,
    /// What is in focus: a landmark of the head (`eye-left`, `pronasale`), `nearest-eye`, or a distance from the camera along its
    /// view, metres. `nearest-eye` if it is not said. Landmarks move with the head, not with shapes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focus: Option<Focus>,
    /// Moves the camera around its target: positive shows the character's left side.
    #[serde(default)]
    pub orbit_degrees: Track<f32>,
    /// Raises the camera around its target, -89 to 89.
    #[serde(default)]
    pub elevation_degrees: Track<f32>,
}

/// A picture in a photographer's terms, scaled to the size of the head.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub enum Framing {
    /// From brows to chin.
    Close,
    /// The head with some air.
    #[default]
    Head,
    /// Head and shoulders.
    Bust,
}

/// What a lens is focused on.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum FocusPoint {
    /// Distance from the camera along its view, metres.
    Distance(f32),
    /// A landmark of the head, or [`NEAREST_EYE`].
    Landmark(String),
}

/// What a lens is focused on over time. Between two keys the distance changes.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Focus {
    /// The same at all times.
    Constant(FocusPoint),
    /// Keys at strictly increasing times; at least one.
    Keys(Vec<Key<FocusPoint>>),
}

/// Aperture and focus at a time. The default is a pinhole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensState {
    /// Height of the sensor, millimetres.
    pub sensor_height_mm: f32,
    /// Focal length over the width of the aperture; without it everything is in focus.
    pub f_stop: Option<f32>,
    /// Distance of what is in focus along the view, metres.
    pub focus_metres: f32,
}

impl Default for LensState {
    fn default() -> Self {
        Self { sensor_height_mm: FULL_FRAME_HEIGHT_MM, f_stop: None, focus_metres: 1.0 }
    }
}

/// Vertical field of view, radians, of a focal length on a sensor of a height, both in millimetres.
pub fn field_of_view(focal_length_mm: f32, sensor_height_mm: f32) -> f32 {
    2.0 * (0.5 * sensor_height_mm / focal_length_mm).atan()
}

/// Focal length, millimetres, of a vertical field of view in radians on a sensor of a height in millimetres.
pub fn focal_length_mm(fov_y: f32, sensor_height_mm: f32) -> f32 {
    0.5 * sensor_height_mm / (0.5 * fov_y).tan()
}

impl Camera {
    /// Vertical field of view at a time in seconds, radians; `None` where the framing gives it.
    pub fn fov_y(&self, time_s: f64) -> Option<f32> {
        let height = self.sensor_height.unwrap_or(FULL_FRAME_HEIGHT_MM);
        let of_lens = self.focal_length.as_ref().map(|track| field_of_view(track.at(time_s), height));
        of_lens.or(self.fov_degrees.as_ref().map(|track| track.at(time_s).to_radians()))
    }

    /// Aperture and focus at a time in seconds, of a camera that stands where `state` says, before a head in the state `face`.
    /// `origin` stands for landmarks that the head does not have.
    pub(crate) fn lens(
        &self,
        time_s: f64,
        state: &CameraState,
        face: &FaceState,
        landmarks: &BTreeMap<String, Vec3>,
        origin: Vec3,
    ) -> LensState {
        let forward = (state.target - state.position).normalize_or(Vec3::NEG_Z);
        let depth = |point: Vec3| {
            let moved = face.head_rotation * point + face.head_translation;
            (moved - state.position).dot(forward)
        };
        let of_name = |name: &str| match (name, landmarks.get(name)) {
            (NEAREST_EYE, _) => {
                let eyes = ["eye-left", "eye-right"].iter().filter_map(|name| landmarks.get(*name));
                eyes.map(|eye| depth(*eye) - IRIS_METRES).reduce(f32::min).unwrap_or_else(|| depth(origin))
            }
            ("eye-left" | "eye-right", Some(eye)) => depth(*eye) - IRIS_METRES,
            (_, Some(point)) => depth(*point),
            (_, None) => depth(origin),
        };
        let metres = |point: &FocusPoint| match point {
            FocusPoint::Distance(metres) => *metres,
            FocusPoint::Landmark(name) => of_name(name),
        };
        let focus_metres = match &self.focus {
            None => of_name(NEAREST_EYE),
            Some(Focus::Constant(point)) => metres(point),
            Some(Focus::Keys(keys)) => {
                let keys: Vec<_> =
                    keys.iter().map(|k| Key { t: k.t, v: metres(&k.v), ease: k.ease }).collect();
                Track::Keys(keys).at(time_s)
            }
        };
        LensState {
            sensor_height_mm: self.sensor_height.unwrap_or(FULL_FRAME_HEIGHT_MM),
            f_stop: self.f_stop.as_ref().map(|track| track.at(time_s)),
            focus_metres: focus_metres.max(NEAREST_FOCUS_METRES),
        }
    }
}

impl Focus {
    /// Its points with the paths from it to them.
    fn points(&self) -> Vec<(Vec<Step>, &FocusPoint)> {
        match self {
            Self::Constant(point) => vec![(Vec::new(), point)],
            Self::Keys(keys) => {
                keys.iter().enumerate().map(|(i, key)| (steps![i, "v"].to_vec(), &key.v)).collect()
            }
        }
    }
}

impl Sequence {
    /// Checks the lens.
    pub(crate) fn check_lens(&self) -> Result<(), RigError> {
        let camera = &self.camera;
        let lens = camera.focal_length.as_ref();
        if lens.is_some() && camera.fov_degrees.is_some() {
            let expected = "either of them: both say how much is seen";
            return self.wrong(
                &steps!["camera", "focalLength"],
                "\"focalLength\" beside \"fovDegrees\"",
                expected,
            );
        }
        self.check_optional(&steps!["camera", "focalLength"], lens, (2.0, 2000.0))?;
        if let Some(height) = camera.sensor_height
            && !(1.0..=200.0).contains(&height)
        {
            let expected = "a height in millimetres from 1 to 200, such as 24";
            return self.wrong(&steps!["camera", "sensorHeight"], &height.to_string(), expected);
        }
        self.check_optional(&steps!["camera", "fStop"], camera.f_stop.as_ref(), (0.5, 128.0))?;
        let Some(focus) = &camera.focus else { return Ok(()) };
        if let Focus::Keys(keys) = focus {
            // Times as of any track.
            let times = keys.iter().map(|k| Key { t: k.t, v: 0.0, ease: k.ease }).collect();
            self.check_track(&steps!["camera", "focus"], &Track::<f32>::Keys(times), (0.0, 0.0))?;
        }
        for (inner, point) in focus.points() {
            if let FocusPoint::Distance(metres) = point
                && !(metres.is_finite() && *metres >= NEAREST_FOCUS_METRES)
            {
                let at = [&steps!["camera", "focus"][..], &inner].concat();
                let expected = format!("a distance of at least {NEAREST_FOCUS_METRES} m, or a landmark");
                return self.wrong(&at, &metres.to_string(), &expected);
            }
        }
        Ok(())
    }

    /// Notes on names of the focus that a head does not have, and on a focus without effect.
    ///
    /// # Errors
    /// A name that is no landmark, neither of this head nor of others.
    pub(crate) fn check_focus(&self, of_head: &BTreeMap<String, Vec3>) -> Result<Vec<Note>, RigError> {
        let mut notes = Vec::new();
        let note = |at: &[Step], message: String| Note {
            place: self.source.place_of_value(at),
            message,
            subject: None,
            nearest: None,
        };
        let at_focus = steps!["camera", "focus"];
        if self.camera.focus.is_some() && self.camera.f_stop.is_none() {
            let message = "the focus has no effect without \"fStop\": everything is in focus".into();
            notes.push(note(&at_focus, message));
        }
        let known: Vec<String> = [NEAREST_EYE.to_owned()]
            .into_iter()
            .chain(landmarks::MIDDLE.map(str::to_owned))
            .chain(landmarks::PAIRED.iter().flat_map(|n| [true, false].map(|l| landmarks::paired(n, l))))
            .chain(of_head.keys().cloned())
            .collect();
        let eyes_are_known = of_head.contains_key("eye-left") || of_head.contains_key("eye-right");
        for (inner, point) in self.camera.focus.iter().flat_map(Focus::points) {
            let FocusPoint::Landmark(name) = point else { continue };
            let at = [&at_focus[..], &inner].concat();
            if !known.contains(name) {
                return Err(RigError {
                    place: self.source.place_of_value(&at),
                    found: format!("the unknown landmark {name:?}"),
                    expected:
                        "nearest-eye, a landmark such as eye-left or pronasale, or a distance in metres"
                            .into(),
                    nearest: nearest(name, known.iter().map(String::as_str)),
                });
            }
            let is_there =
                if name == NEAREST_EYE { eyes_are_known } else { of_head.contains_key(name.as_str()) };
            if !is_there {
                let message = format!(
                    "the head has no landmark {name:?}: the focus is on the middle between the eyes, from proportions"
                );
                notes.push(note(&at, message));
            }
        }
        Ok(notes)
    }
}

impl<'de> Deserialize<'de> for FocusPoint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PointVisitor;
        impl Visitor<'_> for PointVisitor {
            type Value = FocusPoint;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a landmark or a distance in metres")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<FocusPoint, E> {
                Ok(FocusPoint::Landmark(name.to_owned()))
            }

            fn visit_f64<E: de::Error>(self, metres: f64) -> Result<FocusPoint, E> {
                Ok(FocusPoint::Distance(metres as f32))
            }

            fn visit_u64<E: de::Error>(self, metres: u64) -> Result<FocusPoint, E> {
                self.visit_f64(metres as f64)
            }

            fn visit_i64<E: de::Error>(self, metres: i64) -> Result<FocusPoint, E> {
                self.visit_f64(metres as f64)
            }
        }
        deserializer.deserialize_any(PointVisitor)
    }
}

impl<'de> Deserialize<'de> for Focus {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FocusVisitor;
        impl<'de> Visitor<'de> for FocusVisitor {
            type Value = Focus;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a landmark, a distance in metres, or an array of keys {\"t\", \"v\"}")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<Focus, E> {
                Ok(Focus::Constant(FocusPoint::Landmark(name.to_owned())))
            }

            fn visit_f64<E: de::Error>(self, metres: f64) -> Result<Focus, E> {
                Ok(Focus::Constant(FocusPoint::Distance(metres as f32)))
            }

            fn visit_u64<E: de::Error>(self, metres: u64) -> Result<Focus, E> {
                self.visit_f64(metres as f64)
            }

            fn visit_i64<E: de::Error>(self, metres: i64) -> Result<Focus, E> {
                self.visit_f64(metres as f64)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Focus, A::Error> {
                let mut keys = Vec::new();
                while let Some(key) = seq.next_element()? {
                    keys.push(key);
                }
                match keys.len() {
                    0 => Err(de::Error::invalid_length(0, &self)),
                    _ => Ok(Focus::Keys(keys)),
                }
            }
        }
        deserializer.deserialize_any(FocusVisitor)
    }
}

impl JsonSchema for FocusPoint {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "FocusPoint".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A landmark, nearest-eye, or a distance in metres.",
            "anyOf": [{ "type": "string" }, { "type": "number", "minimum": 0.02 }],
        })
    }
}

impl JsonSchema for Focus {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Focus".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let constant = generator.subschema_for::<FocusPoint>();
        let key = generator.subschema_for::<Key<FocusPoint>>();
        json_schema!({
            "description": "The same at all times, or keys in the order of their times.",
            "anyOf": [constant, { "type": "array", "items": key, "minItems": 1 }],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::Evaluator;
    use crate::expression::Rig;
    use crate::head::Head;

    fn head() -> Head {
        let landmarks = [
            ("eye-left", [0.03, 0.0, 0.0]),
            ("eye-right", [-0.03, 0.0, 0.0]),
            ("pronasale", [0.0, -0.04, 0.03]),
        ];
        Head {
            landmarks: landmarks.map(|(name, at)| (name.to_owned(), Vec3::from(at))).into_iter().collect(),
            ..Head::default()
        }
    }

    fn lens(camera: &str, time_s: f64) -> (CameraState, Vec<Note>) {
        let text = format!(r#"{{ "fps": 10, "duration": 2, "camera": {camera} }}"#);
        let sequence = Sequence::from_json("s.json", &text).unwrap();
        let rig = Rig::from_json("r.json", r#"{ "expressions": {} }"#).unwrap();
        let (evaluator, notes) = Evaluator::new(&head(), &rig, &sequence).unwrap();
        (evaluator.at(time_s).camera, notes)
    }

    #[test]
    fn a_focal_length_is_a_field_of_view() {
        let (camera, _) = lens(r#"{ "focalLength": 85 }"#, 0.0);
        assert!((camera.fov_y.to_degrees() - 16.071).abs() < 1e-2, "{}", camera.fov_y.to_degrees());
        assert_eq!(camera.lens.f_stop, None);
        let (smaller, _) = lens(r#"{ "focalLength": 50, "sensorHeight": 15.6 }"#, 0.0);
        assert!((smaller.fov_y.to_degrees() - 17.74).abs() < 1e-2, "{}", smaller.fov_y.to_degrees());
        let (zoom, _) = lens(r#"{ "focalLength": [{ "t": 0, "v": 50 }, { "t": 2, "v": 100 }] }"#, 1.0);
        assert!((zoom.fov_y - field_of_view(75.0, 24.0)).abs() < 1e-6);
        assert!((focal_length_mm(zoom.fov_y, 24.0) - 75.0).abs() < 1e-3);
    }

    #[test]
    fn focus_follows_names_and_distances() {
        let place = r#""position": [0, 0, 1], "target": [0, 0, 0]"#;
        let metres = |focus: &str, time| {
            let (camera, notes) = lens(&format!(r#"{{ {place}, "fStop": 2.8{focus} }}"#), time);
            assert!(notes.is_empty(), "{notes:?}");
            assert_eq!(camera.lens.f_stop, Some(2.8));
            camera.lens.focus_metres
        };
        let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-5, "{a}, expected {b}");
        near(metres("", 0.0), 1.0 - IRIS_METRES);
        near(metres(r#", "focus": "eye-left""#, 0.0), 1.0 - IRIS_METRES);
        near(metres(r#", "focus": "pronasale""#, 0.0), 0.97);
        near(metres(r#", "focus": 0.7"#, 0.0), 0.7);
        near(metres(r#", "focus": [{ "t": 0, "v": "pronasale" }, { "t": 1, "v": 0.77 }]"#, 0.5), 0.87);
        // From the character's left, the left eye is the nearer one.
        let (camera, _) = lens(r#"{ "position": [1, 0, 0], "target": [0, 0, 0], "fStop": 2 }"#, 0.0);
        near(camera.lens.focus_metres, 0.97 - IRIS_METRES);
    }

    #[test]
    fn wrong_lenses_say_where() {
        let wrong = |camera: &str| {
            let text = format!("{{ \"fps\": 10, \"duration\": 1,\n \"camera\": {camera} }}");
            Sequence::from_json("s.json", &text).expect_err("it is wrong").to_string()
        };
        let both = wrong(r#"{ "fovDegrees": 20, "focalLength": 85 }"#);
        assert!(both.starts_with("s.json:2:") && both.contains("\"focalLength\" beside"), "{both}");
        assert!(wrong(r#"{ "focalLength": 1 }"#).contains("from 2 to 2000"));
        assert!(wrong(r#"{ "fStop": 0 }"#).contains("from 0.5 to 128"));
        assert!(wrong(r#"{ "sensorHeight": 0 }"#).contains("from 1 to 200"));
        assert!(wrong(r#"{ "fStop": 2, "focus": -1 }"#).contains("a distance of at least"));
        assert!(wrong(r#"{ "focus": [{ "t": 1, "v": 1 }, { "t": 1, "v": 2 }] }"#).contains("after that"));
        let text = r#"{ "fps": 10, "duration": 1, "camera": { "fStop": 2, "focus": "eye-lft" } }"#;
        let sequence = Sequence::from_json("s.json", text).unwrap();
        let error = sequence.check_focus(&head().landmarks).unwrap_err();
        assert_eq!(error.nearest.as_deref(), Some("eye-left"));
        let without = Sequence::from_json("s.json", &text.replace("eye-lft", "menton")).unwrap();
        assert!(
            without.check_focus(&head().landmarks).unwrap()[0].message.contains("no landmark \"menton\"")
        );
        let (_, notes) = lens(r#"{ "focus": 1 }"#, 0.0);
        assert!(notes[0].message.contains("no effect without"));
    }

    #[test]
    fn a_camera_reads_back() {
        let text = r#"{ "fps": 10, "duration": 1, "camera": { "focalLength": 85, "fStop": [{ "t": 0, "v": 2 }],
            "focus": [{ "t": 0, "v": "eye-left" }, { "t": 1, "v": 0.5, "ease": "smooth" }] } }"#;
        let sequence = Sequence::from_json("s.json", text).unwrap();
        let again = Sequence::from_json("s.json", &serde_json::to_string(&sequence).unwrap()).unwrap();
        assert_eq!(again.camera, sequence.camera);
    }
}
