//! The first animation of a document that moves the head, and default weights, as tracks of a sequence.
//!
//! Weights of morph targets by node; rotation and translation of the node of the first mesh that has targets, as a change
//! from its rest pose. Cubic segments that an easing says become that easing, others are sampled at frames.

use std::collections::HashMap;

use glam::{EulerRot, Quat, Vec3};
use gltf::{Mesh, Node};
use rubor_rig::timeline::{Ease, Key, Sequence, Track};

use super::channels::{Channel, LAST_S, Named, Target, of_animation};
use super::document::Document;
use super::names::of_mesh;
use crate::notes::Notes;

/// Rates that times of keys are tried against, in this order.
const RATES: [f64; 8] = [24.0, 25.0, 30.0, 60.0, 48.0, 50.0, 120.0, 100.0];
/// Rate of a sequence whose keys lie on no frames.
const DEFAULT_RATE: f64 = 30.0;
/// Most keys of the motion of the head; longer animations get one every few frames.
const MOST_KEYS: u32 = 1 << 18;

/// The source that moves a morph target.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Driver {
    /// Keys of the animation.
    Keyed(Track<f32>),
    /// A default weight other than 0.
    Default(f32),
    /// Nothing.
    Rest,
}

impl Driver {
    pub(super) fn track(&self) -> Option<Track<f32>> {
        match self {
            Self::Keyed(track) => Some(track.clone()),
            Self::Default(weight) => Some(Track::Constant(*weight)),
            Self::Rest => None,
        }
    }
}

/// Everything that moves.
#[derive(Default)]
pub(super) struct Motion {
    is_animated: bool,
    name: String,
    fps: f64,
    end_s: f64,
    /// By node: a track for each target of its mesh.
    weights: HashMap<usize, Vec<Track<f32>>>,
    /// Of nodes and meshes; a node's win.
    node_defaults: HashMap<usize, Vec<f32>>,
    mesh_defaults: HashMap<usize, Vec<f32>>,
    rotation: Option<Channel>,
    translation: Option<Channel>,
}

impl Motion {
    pub(super) fn read(document: &Document, notes: &mut Notes) -> Self {
        let count = document.raw["animations"].as_array().map_or(0, Vec::len);
        let mut unread = Notes::default();
        let mut motion = Self { fps: DEFAULT_RATE, ..Self::default() };
        for animation in 0..count {
            let mut here = Notes::default();
            if let Some(read) = Self::of_animation(document, animation, &mut here) {
                motion = read;
                notes.append(here);
                if count > 1 {
                    let message = "only the first animation that moves the head is read";
                    notes.add(message, format!("animation {animation} of {count}, {:?}", motion.name));
                }
                break;
            }
            unread.append(here);
        }
        if count > 0 && !motion.is_animated {
            notes.append(unread);
            notes.say("the animations of the file move no morph target and not the head: none is read");
        }
        motion.defaults(document, notes);
        motion
    }

    /// `None` where an animation has no channel of the head.
    fn of_animation(document: &Document, animation: usize, notes: &mut Notes) -> Option<Self> {
        let head = head_node(document).map(|n| n.index());
        let mut read: Vec<(Named, Channel)> = Vec::new();
        for named in of_animation(document, animation, notes) {
            let width = match named.target {
                Target::Rotation if head == Some(named.node) => 4,
                Target::Translation if head == Some(named.node) => 3,
                Target::Weights => match target_count(document, named.node) {
                    0 => {
                        notes.add("weights of nodes without morph targets move nothing", named.at);
                        continue;
                    }
                    count => count,
                },
                Target::Rotation | Target::Translation | Target::Scale => {
                    let message = "channels that move other nodes than the head, or scale, are not read";
                    notes.add(message, named.at);
                    continue;
                }
            };
            if let Some(channel) = Channel::read(document, &named, width, notes) {
                read.push((named, channel));
            }
        }
        if read.is_empty() {
            return None;
        }
        let times = || read.iter().flat_map(|(_, c)| &c.times_s).map(|t| f64::from(t.max(0.0)));
        let on_frames = |fps: &f64| {
            let off = |t: f64| (t * fps).fract().abs().min((t * fps).ceil() - t * fps);
            times().all(|t| off(t) < 1e-3)
        };
        let fps = RATES.into_iter().find(on_frames).unwrap_or(DEFAULT_RATE);
        let end_s = times().fold(0.0, f64::max).min(f64::from(LAST_S));
        let name = document.raw["animations"][animation]["name"].as_str().unwrap_or_default().to_owned();
        let mut motion = Self { is_animated: true, name, fps, end_s, ..Self::default() };
        for (named, channel) in read {
            match named.target {
                Target::Weights => {
                    let tracks = (0..target_count(document, named.node)).map(|c| channel.track(c, fps));
                    motion.weights.insert(named.node, tracks.collect());
                }
                Target::Rotation => motion.rotation = Some(channel),
                Target::Translation => motion.translation = Some(channel),
                Target::Scale => {}
            }
        }
        Some(motion)
    }

    fn defaults(&mut self, document: &Document, notes: &mut Notes) {
        let mut checked = |at: String, weights: Option<&[f32]>, count: usize| {
            let weights = weights?;
            if weights.len() != count {
                let found = format!("{at}: {} weights for {count} targets", weights.len());
                notes.add(
                    "default weights are not as many as morph targets: those that are there count",
                    found,
                );
            }
            if weights.iter().any(|w| !w.is_finite()) {
                notes.add("default weights beyond the range of f32 count as 0", at);
            }
            Some(weights.iter().map(|w| if w.is_finite() { *w } else { 0.0 }).collect::<Vec<f32>>())
        };
        for mesh in document.gltf.meshes() {
            let count = of_mesh(document, &mesh).0.len();
            if let Some(weights) = checked(format!("mesh {}", mesh.index()), mesh.weights(), count) {
                self.mesh_defaults.insert(mesh.index(), weights);
            }
        }
        for node in document.gltf.nodes() {
            let count = target_count(document, node.index());
            if let Some(weights) = checked(format!("node {}", node.index()), node.weights(), count) {
                self.node_defaults.insert(node.index(), weights);
            }
        }
    }

    /// The source that moves a target of a mesh that a node shows.
    pub(super) fn driver(&self, node: Option<usize>, mesh: &Mesh<'_>, target: usize) -> Driver {
        if let Some(track) = node.and_then(|n| self.weights.get(&n)).and_then(|tracks| tracks.get(target)) {
            return Driver::Keyed(track.clone());
        }
        let of_node = node.and_then(|n| self.node_defaults.get(&n));
        let weights = of_node.or_else(|| self.mesh_defaults.get(&mesh.index()));
        match weights.and_then(|w| w.get(target)) {
            Some(weight) if *weight != 0.0 => Driver::Default(*weight),
            _ => Driver::Rest,
        }
    }

    /// The sequence of shapes that these drivers move; `None` where nothing does.
    pub(super) fn sequence(
        &self,
        document: &Document,
        shapes: Vec<(String, Driver)>,
        notes: &mut Notes,
    ) -> Option<Sequence> {
        let mut sequence = Sequence::still(self.fps, self.end_s.max(1.0 / self.fps));
        sequence.description.clone_from(&self.name);
        for (name, driver) in shapes {
            if let Driver::Default(weight) = driver {
                let message = "default weights are constant tracks of the sequence; the head rests at 0";
                notes.add(message, format!("{name:?} at {weight}"));
            }
            if let Some(track) = driver.track().filter(|t| *t != Track::Constant(0.0)) {
                sequence.shapes.insert(name, track);
            }
        }
        if !self.is_animated && sequence.shapes.is_empty() {
            return None;
        }
        if let (Some(node), true) =
            (head_node(document), self.rotation.is_some() || self.translation.is_some())
        {
            self.head_motion(&mut sequence, &node, notes);
        }
        Some(sequence)
    }

    /// Rotation and translation of the head at every frame, relative to the rest pose of its node.
    fn head_motion(&self, sequence: &mut Sequence, node: &Node<'_>, notes: &mut Notes) {
        let (rest_translation, rest_rotation, _) = node.transform().decomposed();
        let (rest_translation, rest_rotation) =
            (Vec3::from_array(rest_translation), Quat::from_array(rest_rotation));
        let frames = sequence.frame_count() + 1;
        let step = frames.div_ceil(MOST_KEYS).max(1);
        if step > 1 {
            notes.say(format!("the motion of the head is read at every {step}th frame: it is long"));
        }
        let times: Vec<f64> = (0..frames).step_by(step as usize).map(|f| sequence.frame_time_s(f)).collect();
        let mut angles: [Vec<f32>; 3] = Default::default();
        let mut places: Vec<[f32; 3]> = Vec::new();
        for time in &times {
            let turned = match &self.rotation {
                Some(channel) => Quat::from_array([0, 1, 2, 3].map(|c| channel.at(*time, c))).normalize(),
                None => rest_rotation,
            };
            let moved = match &self.translation {
                Some(channel) => Vec3::from_array([0, 1, 2].map(|c| channel.at(*time, c))),
                None => rest_translation,
            };
            let turn = turned * rest_rotation.inverse();
            let turn = if turn.is_finite() { turn } else { Quat::IDENTITY };
            let (yaw, pitch, roll) = turn.to_euler(EulerRot::YXZ);
            angles.iter_mut().zip([yaw, pitch, roll]).for_each(|(list, a)| list.push(a.to_degrees()));
            let place = moved - turn * rest_translation;
            places.push(if place.is_finite() { place.to_array() } else { [0.0; 3] });
        }
        let [yaw, pitch, roll] = angles.map(|list| keyed(&list, &times));
        sequence.head.yaw_degrees = yaw;
        sequence.head.pitch_degrees = pitch;
        sequence.head.roll_degrees = roll;
        sequence.head.translation = keyed(&places, &times);
    }
}

/// The node of the first mesh that has targets.
fn head_node(document: &Document) -> Option<Node<'_>> {
    document
        .gltf
        .nodes()
        .find(|n| n.mesh().is_some_and(|m| m.primitives().any(|p| p.morph_targets().len() > 0)))
}

/// Morph targets of the mesh of a node.
fn target_count(document: &Document, node: usize) -> usize {
    let mesh = document.gltf.nodes().nth(node).and_then(|n| n.mesh());
    mesh.and_then(|m| m.primitives().map(|p| p.morph_targets().len()).max()).unwrap_or(0)
}

/// A key at every time, or a constant.
fn keyed<T: PartialEq + Copy + Default>(values: &[T], times: &[f64]) -> Track<T> {
    match values {
        [] => Track::Constant(T::default()),
        [first, rest @ ..] if rest.iter().all(|v| v == first) => Track::Constant(*first),
        _ => {
            let key = |(v, t): (&T, &f64)| Key { t: *t, v: *v, ease: Ease::Linear };
            Track::Keys(values.iter().zip(times).map(key).collect())
        }
    }
}
