//! A sequence on a head: what the face, the camera and the lights are at a time.
//!
//! ```
//! use rubor_rig::{evaluate::Evaluator, expression::Rig, head::{BlendShape, Head}, timeline::Sequence};
//! let shape = |name: &str| BlendShape { name: name.into(), ..BlendShape::default() };
//! let head = Head { shapes: vec![shape("jawOpen"), shape("browInnerUp")], ..Head::default() };
//! let (evaluator, notes) = Evaluator::new(&head, &Rig::default_rig().unwrap(), &Sequence::demo().unwrap()).unwrap();
//! assert_eq!(evaluator.frame_count(), 480);
//! let surprised = evaluator.at(2.6).face;
//! assert!(surprised.shapes[0] > 0.4 && surprised.shapes[1] > 0.8);
//! assert!(!notes.is_empty()); // this head lacks nearly everything
//! ```

use std::collections::BTreeMap;

use glam::{EulerRot, Quat, Vec3};

use crate::bind::{Binder, BoundRig, Limits, Weights};
use crate::camera::LensState;
use crate::error::{Note, RigError};
use crate::expression::Rig;
use crate::face_state::FaceState;
use crate::framing::FaceFrame;
use crate::head::Head;
use crate::json::steps;
use crate::life::CALM_PUPIL_MM;
use crate::names::{Target, nearest};
use crate::timeline::{LightKind, Sequence, Track};

/// Everything that a frame shows, in the space of the head (metres, +Y up, +Z out of the face).
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// Seconds from the start.
    pub time_s: f64,
    /// Number of the frame that is nearest to the time, from 0: film grain follows it.
    pub frame: u32,
    /// Where the face of the head at rest is.
    pub place: FaceFrame,
    /// The face.
    pub face: FaceState,
    /// The camera.
    pub camera: CameraState,
    /// The lights, in the order of the sequence.
    pub lights: Vec<LightState>,
    /// Light from all around.
    pub environment: Option<EnvironmentState>,
}

/// A perspective camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraState {
    /// Metres.
    pub position: Vec3,
    /// Point in the middle of the picture, metres; never at `position`.
    pub target: Vec3,
    /// Upwards in the picture, unit length, not along the view.
    pub up: Vec3,
    /// Vertical field of view, radians.
    pub fov_y: f32,
    /// Aperture and focus.
    pub lens: LensState,
}

/// One light.
#[derive(Clone, Debug, PartialEq)]
pub struct LightState {
    /// As in the sequence; may be empty.
    pub name: String,
    /// Kind of the light.
    pub kind: LightKind,
    /// Colour times intensity, linear Rec. 709. Directional: irradiance on a surface that faces it.
    /// Point and spot: radiant intensity, so irradiance times square metre.
    pub power_linear: Vec3,
    /// Metres; zero for a directional light.
    pub position: Vec3,
    /// Direction in which the light travels, unit length; zero for a point light.
    pub direction: Vec3,
    /// Half angles of a spot's cone, radians: fully lit up to the first, dark from the second.
    pub cone_half_angles: [f32; 2],
    /// Radius of the lamp: metres, or of a directional light the tangent of half the angle that it subtends.
    pub radius: f32,
    /// Whether it casts shadows.
    pub shadow: bool,
}

/// Light from all around.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentState {
    /// A built-in environment or the path of an image.
    pub name: String,
    /// Factor of its radiance.
    pub intensity: f32,
    /// About +Y, radians.
    pub rotation_y: f32,
}

/// A sequence whose names are resolved against a rig and a head.
#[derive(Clone, Debug)]
pub struct Evaluator {
    rig: BoundRig,
    sequence: Sequence,
    frame: FaceFrame,
    landmarks: BTreeMap<String, Vec3>,
    expressions: Vec<(usize, Track<f32>)>,
    states: Vec<(usize, Track<f32>)>,
    shapes: Vec<(Vec<Target>, Track<f32>)>,
    /// Indices of the shapes that gaze, blinks and breath move, in the order of [`LIVING_SHAPES`].
    living: Vec<Vec<Target>>,
}

/// Shapes that [`crate::life`] moves.
pub(crate) const LIVING_SHAPES: [&str; 12] = [
    "eyeBlinkLeft",
    "eyeBlinkRight",
    "eyeLookOutLeft",
    "eyeLookInRight",
    "eyeLookInLeft",
    "eyeLookOutRight",
    "eyeLookDownLeft",
    "eyeLookDownRight",
    "eyeLookUpLeft",
    "eyeLookUpRight",
    "noseSneerLeft",
    "noseSneerRight",
];
/// Rotation of an eye at `eyeLook*` weight 1, degrees: the usual value of heads made for ARKit.
const LOOK_DEGREES: f32 = 30.0;

impl Evaluator {
    /// Resolves all names once. Notes name the entries that have no effect on this head.
    ///
    /// # Errors
    /// What [`Rig::check`] and [`Sequence::check`] refuse; an expression or state that the rig does not have; a shape
    /// that neither rubor nor the head knows.
    pub fn new(head: &Head, rig: &Rig, sequence: &Sequence) -> Result<(Self, Vec<Note>), RigError> {
        sequence.check()?;
        let (bound, mut notes) = BoundRig::new(head, rig)?;
        let source = &sequence.source;
        let unknown = |kind: &str, field: &str, name: &String, valid: Vec<&str>| RigError {
            place: source.place_of_key(&steps![field, name]),
            found: format!("the unknown {kind} {name:?}"),
            expected: match valid.len() {
                0 => format!("no {kind}: the rig has none"),
                _ => format!("one of the rig's: {}", crate::json::quoted_list(valid.iter().copied())),
            },
            nearest: nearest(name, valid),
        };
        let mut expressions = Vec::new();
        for (name, track) in &sequence.expressions {
            let index = bound.expression_index(name).ok_or_else(|| {
                unknown("expression", "expressions", name, bound.expression_names().collect())
            })?;
            expressions.push((index, track.clone()));
        }
        let mut states = Vec::new();
        for (name, track) in &sequence.states {
            let index = bound
                .state_index(name)
                .ok_or_else(|| unknown("state", "states", name, bound.state_names().collect()))?;
            states.push((index, track.clone()));
        }
        let mut binder = Binder::new(head, source);
        let mut shapes = Vec::new();
        for (name, track) in &sequence.shapes {
            let targets = binder.shape(name, &steps!["shapes", name], true)?;
            if !targets.is_empty() {
                shapes.push((targets, track.clone()));
            }
        }
        notes.append(&mut binder.notes);
        notes.append(&mut sequence.check_focus(&head.landmarks)?);
        let mut living = Vec::new();
        if sequence.eyes.is_some() || sequence.life.is_some() {
            // A head without these shapes keeps still. The sequence is not at fault, so there is no note.
            let mut binder = Binder::new(head, source);
            for name in LIVING_SHAPES {
                living.push(binder.shape(name, &[], true)?);
            }
        }
        if let Some(capture) = &sequence.capture {
            let message = format!("the recording {:?} was not loaded: it has no effect", capture.file);
            let place = source.place_of_key(&steps!["capture"]);
            notes.push(Note { place, message, subject: None, nearest: None });
        }
        let tracks = [
            ("expressions", &sequence.expressions),
            ("states", &sequence.states),
            ("shapes", &sequence.shapes),
        ];
        for (field, tracks) in tracks {
            for (name, track) in tracks {
                if track.last_key_s().is_some_and(|t| t > sequence.duration) {
                    let message =
                        format!("{name:?} has keys after the end of the sequence ({} s)", sequence.duration);
                    let place = source.place_of_key(&steps![field, name]);
                    notes.push(Note { place, message, subject: Some(name.clone()), nearest: None });
                }
            }
        }
        let evaluator = Self {
            rig: bound,
            sequence: sequence.clone(),
            frame: FaceFrame::of(head),
            landmarks: head.landmarks.clone(),
            expressions,
            states,
            shapes,
            living,
        };
        Ok((evaluator, notes))
    }

    /// Number of frames of the sequence, at least 1.
    pub fn frame_count(&self) -> u32 {
        self.sequence.frame_count()
    }

    /// Time of a frame, seconds.
    pub fn frame_time_s(&self, frame: u32) -> f64 {
        self.sequence.frame_time_s(frame)
    }

    /// The sequence that it was made from.
    pub fn sequence(&self) -> &Sequence {
        &self.sequence
    }

    /// The rig on the head.
    pub fn rig(&self) -> &BoundRig {
        &self.rig
    }

    /// Everything at a time in seconds. Before the start and after the end the first and last values hold.
    pub fn at(&self, time_s: f64) -> Shot {
        let radians = |track: &Track<f32>| track.at(time_s).to_radians();
        let environment = self.sequence.environment.as_ref().map(|environment| EnvironmentState {
            name: environment.name.clone(),
            intensity: environment.intensity.at(time_s),
            rotation_y: radians(&environment.rotation_degrees),
        });
        let face = self.face_at(time_s);
        Shot {
            time_s,
            frame: (time_s * self.sequence.fps).round().max(0.0) as u32,
            place: self.frame,
            camera: self.camera(time_s, &face),
            face,
            lights: self.lights(time_s),
            environment,
        }
    }

    /// Weights of expressions and states as their tracks have them at a time in seconds; those of shapes are 0.
    pub fn weights_at(&self, time_s: f64) -> Weights {
        let mut weights = self.rig.neutral_weights();
        for (index, track) in &self.expressions {
            weights.expressions[*index] = track.at(time_s);
        }
        for (index, track) in &self.states {
            weights.states[*index] = track.at(time_s);
        }
        weights
    }

    /// The face alone at a time in seconds.
    pub fn face_at(&self, time_s: f64) -> FaceState {
        let mut weights = self.weights_at(time_s);
        // A single track is used unclamped; a sum of tracks is clamped to the widest range among them.
        let mut limits = vec![Limits::default(); weights.shapes.len()];
        for (targets, track) in &self.shapes {
            let weight = track.at(time_s);
            for target in targets {
                weights.shapes[target.index as usize] += weight * target.factor;
                limits[target.index as usize].include(weight * target.factor);
            }
        }
        let eyes = self.sequence.eyes.as_ref();
        let motion = self.sequence.life.as_ref().map(|life| life.at(time_s)).unwrap_or_default();
        let [mut yaw, mut pitch] = motion.gaze_degrees;
        if let Some(eyes) = eyes {
            yaw += eyes.yaw_degrees.at(time_s);
            pitch += eyes.pitch_degrees.at(time_s);
        }
        let [left, right, down, up] = [yaw, -yaw, pitch, -pitch].map(|d| (d / LOOK_DEGREES).max(0.0));
        let ([blink_left, blink_right], nostrils) = (motion.blink, motion.nostrils);
        let living =
            [blink_left, blink_right, left, left, right, right, down, down, up, up, nostrils, nostrils];
        for (targets, weight) in self.living.iter().zip(living) {
            for target in targets {
                weights.shapes[target.index as usize] += weight * target.factor;
            }
        }
        for (weight, limits) in weights.shapes.iter_mut().zip(&limits) {
            *weight = limits.hold(*weight);
        }
        let head = &self.sequence.head;
        let sum = |track: &Track<f32>, more: f32| (track.at(time_s) + more).to_radians();
        let [head_yaw, head_pitch, head_roll] = motion.head_degrees;
        FaceState {
            head_rotation: Quat::from_euler(
                EulerRot::YXZ,
                sum(&head.yaw_degrees, head_yaw),
                sum(&head.pitch_degrees, head_pitch),
                sum(&head.roll_degrees, head_roll),
            ),
            head_translation: Vec3::from(head.translation.at(time_s)) + Vec3::from(motion.translation),
            pupil_mm: eyes.map_or(CALM_PUPIL_MM, |eyes| eyes.pupil_mm.at(time_s)),
            ..self.rig.face(&weights)
        }
    }

    fn camera(&self, time_s: f64, face: &FaceState) -> CameraState {
        let camera = &self.sequence.camera;
        let aspect = self.sequence.size.map_or(1.0, |[width, height]| width as f32 / height as f32);
        let mut state = self.frame.camera(camera.framing, camera.fov_y(time_s), aspect);
        if let Some(target) = &camera.target {
            state.target = self.frame.origin + Vec3::from(target.at(time_s));
        }
        if let Some(position) = &camera.position {
            state.position = self.frame.origin + Vec3::from(position.at(time_s));
        }
        let away = state.position - state.target;
        // A camera at its own target has no view direction: it looks at the face from the front.
        let away = if away.length() > 1e-6 { away } else { Vec3::Z * 1e-3 };
        let orbit = camera.orbit_degrees.at(time_s).to_radians();
        let elevation = camera.elevation_degrees.at(time_s).to_radians();
        let turned = Quat::from_euler(EulerRot::YXZ, orbit, -elevation, 0.0) * away;
        state.position = state.target + turned;
        state.up = if turned.normalize().y.abs() > 0.999 { Vec3::NEG_Z } else { Vec3::Y };
        state.lens = camera.lens(time_s, &state, face, &self.landmarks, self.frame.origin);
        state
    }

    fn lights(&self, time_s: f64) -> Vec<LightState> {
        let origin = self.frame.origin;
        self.sequence
            .lights
            .iter()
            .map(|light| {
                let position = match (&light.position, light.kind) {
                    (Some(track), LightKind::Spot | LightKind::Point) => {
                        origin + Vec3::from(track.at(time_s))
                    }
                    _ => Vec3::ZERO,
                };
                let direction = match (&light.direction, light.kind) {
                    (_, LightKind::Point) => Vec3::ZERO,
                    // Two opposite keys have no direction halfway: then the light comes from the front.
                    (Some(track), _) => Vec3::from(track.at(time_s)).normalize_or(Vec3::NEG_Z),
                    (None, _) => (origin - position).normalize_or(Vec3::NEG_Z),
                };
                LightState {
                    name: light.name.clone(),
                    kind: light.kind,
                    power_linear: Vec3::from(light.color.at(time_s)) * light.intensity.at(time_s),
                    position,
                    direction,
                    cone_half_angles: light.cone_degrees.map(|degrees| 0.5 * degrees.to_radians()),
                    radius: match light.kind {
                        LightKind::Directional => (0.5 * light.angle_degrees.to_radians()).tan(),
                        LightKind::Spot | LightKind::Point => 0.5 * light.diameter,
                    },
                    shadow: light.shadow,
                }
            })
            .collect()
    }
}
