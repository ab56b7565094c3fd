//! The first animation of a document as tracks of a sequence.
//!
//! Weights of morph targets by name; rotation and translation of the node of the first mesh that has targets, as a change
//! from its rest pose. Cubic segments that an easing says become that easing, others are sampled at frames.

use std::collections::BTreeMap;

use glam::{EulerRot, Quat, Vec3};
use gltf::Node;
use gltf::animation::{Interpolation, Property, Sampler};
use rubor_rig::timeline::{Ease, Key, Sequence, Track};

use super::accessor::floats;
use super::document::Document;
use super::foreign::target_names;
use crate::error::ImportError;

/// Rates that times of keys are tried against, in this order.
const RATES: [f64; 8] = [24.0, 25.0, 30.0, 60.0, 48.0, 50.0, 120.0, 100.0];
/// Rate of a sequence whose keys lie on no frames.
const DEFAULT_RATE: f64 = 30.0;
/// Slopes of an easing may be off by this part of a weight: they are written in f32.
const SLOPE_ROUNDING: f64 = 1e-4;

/// A channel in memory.
struct Channel<const N: usize> {
    interpolation: Interpolation,
    times_s: Vec<f32>,
    /// N numbers a key; three times as many where it is cubic.
    numbers: Vec<f32>,
    /// Numbers of a key.
    width: usize,
}

pub(super) fn read(document: &Document) -> Result<Option<Sequence>, ImportError> {
    let Some(animation) = document.gltf.animations().next() else { return Ok(None) };
    let mut shapes: BTreeMap<String, Track<f32>> = BTreeMap::new();
    let mut channels: Vec<(usize, Property, Sampler<'_>, String)> = Vec::new();
    for (i, channel) in animation.channels().enumerate() {
        let target = channel.target();
        let at = format!("animation 0, channel {i}");
        channels.push((target.node().index(), target.property(), channel.sampler(), at));
    }
    let head = document.gltf.nodes().find(|n| n.mesh().is_some_and(|m| !target_names(&m).is_empty()));
    let mut times: Vec<f32> = Vec::new();
    for (_, _, sampler, at) in &channels {
        times.extend(floats::<1>(document, at, &sampler.input())?.as_flattened());
    }
    let end_s = f64::from(times.iter().copied().fold(0.0, f32::max));
    let on_frames = |fps: &f64| {
        times.iter().all(|t| {
            (f64::from(*t) * fps).fract().abs().min((f64::from(*t) * fps).ceil() - f64::from(*t) * fps) < 1e-3
        })
    };
    let fps = RATES.into_iter().find(on_frames).unwrap_or(DEFAULT_RATE);
    let mut motion = [None, None];
    for (node, property, sampler, at) in &channels {
        let is_head = head.as_ref().is_some_and(|h| h.index() == *node);
        match property {
            Property::MorphTargetWeights => {
                let mesh = document.gltf.nodes().nth(*node).and_then(|n| n.mesh());
                let names = mesh.map(|m| target_names(&m)).unwrap_or_default();
                let channel = Channel::<1>::read(document, at, sampler, names.len())?;
                for (c, name) in names.into_iter().enumerate() {
                    let track = channel.track(c, fps);
                    // Several meshes of one face share their shapes.
                    shapes.entry(name).or_insert(track);
                }
            }
            Property::Rotation if is_head => {
                motion[0] = Some(Channel::<4>::read(document, at, sampler, 4)?);
            }
            Property::Translation if is_head => {
                let c = Channel::<3>::read(document, at, sampler, 3)?;
                motion[1] = Some(Channel::<4> {
                    interpolation: c.interpolation,
                    times_s: c.times_s,
                    numbers: c.numbers,
                    width: 3,
                });
            }
            _ => {}
        }
    }
    let duration = end_s.max(1.0 / fps);
    let mut sequence = Sequence::still(fps, duration);
    sequence.description = animation.name().unwrap_or_default().to_owned();
    sequence.shapes = shapes.into_iter().filter(|(_, t)| *t != Track::Constant(0.0)).collect();
    if let (Some(node), true) = (head, motion.iter().any(Option::is_some)) {
        head_motion(&mut sequence, &node, &motion);
    }
    Ok(Some(sequence))
}

impl<const N: usize> Channel<N> {
    fn read(document: &Document, at: &str, sampler: &Sampler<'_>, width: usize) -> Result<Self, ImportError> {
        let interpolation = sampler.interpolation();
        let times = floats::<1>(document, at, &sampler.input())?;
        let numbers = floats::<N>(document, at, &sampler.output())?.as_flattened().to_vec();
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let times_s: Vec<f32> = times.into_iter().map(|[t]| t).collect();
        if times_s.is_empty() || times_s.windows(2).any(|w| w[0] >= w[1]) || times_s[0] < 0.0 {
            return Err(document.fail(at, "times that do not rise from 0 on", "rising times of keys"));
        }
        if numbers.len() != times_s.len() * width * per_key {
            let found = format!("{} numbers", numbers.len());
            let expected = format!("{} for {} keys", times_s.len() * width * per_key, times_s.len());
            return Err(document.fail(at, found, expected));
        }
        Ok(Self { interpolation, times_s, numbers, width })
    }

    fn is_cubic(&self) -> bool {
        self.interpolation == Interpolation::CubicSpline
    }

    fn value(&self, key: usize, c: usize) -> f32 {
        if self.is_cubic() {
            self.numbers[(3 * key + 1) * self.width + c]
        } else {
            self.numbers[key * self.width + c]
        }
    }

    /// Slopes out of a key and into the next, times the way between them.
    fn slopes(&self, key: usize, c: usize) -> [f64; 2] {
        let length = f64::from(self.times_s[key + 1]) - f64::from(self.times_s[key]);
        let at = |i: usize| length * f64::from(self.numbers[i * self.width + c]);
        [at(3 * key + 2), at(3 * (key + 1))]
    }

    /// Number `c` at a time, as players interpolate it; rotations are made unit afterwards.
    fn at(&self, time_s: f64, c: usize) -> f32 {
        let next = self.times_s.partition_point(|t| f64::from(*t) <= time_s);
        let Some(key) = next.checked_sub(1) else { return self.value(0, c) };
        if next == self.times_s.len() {
            return self.value(key, c);
        }
        let (from, to) = (f64::from(self.times_s[key]), f64::from(self.times_s[next]));
        let u = (time_s - from) / (to - from);
        let (a, b) = (f64::from(self.value(key, c)), f64::from(self.value(next, c)));
        let value = match self.interpolation {
            Interpolation::Step => a,
            Interpolation::Linear => a + u * (b - a),
            Interpolation::CubicSpline => hermite(a, b, self.slopes(key, c), u),
        };
        value as f32
    }

    fn track(&self, c: usize, fps: f64) -> Track<f32> {
        let mut keys: Vec<Key<f32>> = Vec::new();
        for (i, time) in self.times_s.iter().enumerate() {
            let key = |ease| Key { t: f64::from(*time), v: self.value(i, c), ease };
            let Some(next) = self.times_s.get(i + 1) else {
                keys.push(key(Ease::Linear));
                break;
            };
            match self.ease(i, c) {
                Some(ease) => keys.push(key(ease)),
                None => {
                    keys.push(key(Ease::Linear));
                    let mut frame = (f64::from(*time) * fps + 1e-6).floor() + 1.0;
                    while frame / fps < f64::from(*next) - 1e-6 {
                        keys.push(Key { t: frame / fps, v: self.at(frame / fps, c), ease: Ease::Linear });
                        frame += 1.0;
                    }
                }
            }
        }
        simplified(keys)
    }

    /// The easing of a segment, if one is this curve.
    fn ease(&self, key: usize, c: usize) -> Option<Ease> {
        match self.interpolation {
            Interpolation::Step => return Some(Ease::Step),
            Interpolation::Linear => return Some(Ease::Linear),
            Interpolation::CubicSpline => {}
        }
        let change = f64::from(self.value(key + 1, c)) - f64::from(self.value(key, c));
        let slopes = self.slopes(key, c);
        let close = |a: f64, b: f64| (a - b).abs() <= SLOPE_ROUNDING;
        [
            (Ease::Linear, [1.0, 1.0]),
            (Ease::Smooth, [0.0, 0.0]),
            (Ease::EaseIn, [0.0, 2.0]),
            (Ease::EaseOut, [2.0, 0.0]),
        ]
        .into_iter()
        .find(|(_, s)| close(slopes[0], s[0] * change) && close(slopes[1], s[1] * change))
        .map(|(ease, _)| ease)
    }
}

fn hermite(a: f64, b: f64, slopes: [f64; 2], u: f64) -> f64 {
    let (u2, u3) = (u * u, u * u * u);
    let from_a = 2.0 * u3 - 3.0 * u2 + 1.0;
    from_a * a + (1.0 - from_a) * b + (u3 - 2.0 * u2 + u) * slopes[0] + (u3 - u2) * slopes[1]
}

/// Without keys between which nothing changes, and without those that a jump by two neighbouring times made.
fn simplified(keys: Vec<Key<f32>>) -> Track<f32> {
    let mut out: Vec<Key<f32>> = Vec::with_capacity(keys.len());
    for (i, key) in keys.iter().enumerate() {
        if let Some(before) = out.last_mut() {
            // Two keys that f32 times can hardly tell apart are a jump: the earlier one holds until the later.
            let at_once = key.t - before.t < 1e-6 * key.t.max(1.0);
            if at_once {
                let before_jump = before.clone();
                out.pop();
                match out.last_mut() {
                    Some(held) if held.v == before_jump.v => held.ease = Ease::Step,
                    _ => out.push(Key { t: before_jump.t, ..before_jump }),
                }
                out.push(key.clone());
                continue;
            }
            let same_after = keys.get(i + 1).is_none_or(|next| next.v == key.v);
            if before.v == key.v && same_after && i + 1 < keys.len() {
                continue;
            }
        }
        out.push(key.clone());
    }
    match &out[..] {
        [] => Track::Constant(0.0),
        [first, rest @ ..] if rest.iter().all(|k| k.v == first.v) => Track::Constant(first.v),
        _ => Track::Keys(out),
    }
}

/// Rotation and translation of the head at every frame, relative to the rest pose of its node.
fn head_motion(sequence: &mut Sequence, node: &Node<'_>, [rotation, translation]: &[Option<Channel<4>>; 2]) {
    let (rest_translation, rest_rotation, _) = node.transform().decomposed();
    let (rest_translation, rest_rotation) =
        (Vec3::from_array(rest_translation), Quat::from_array(rest_rotation));
    let frames = sequence.frame_count() + 1;
    let mut angles: [Vec<f32>; 3] = Default::default();
    let mut places: Vec<[f32; 3]> = Vec::new();
    for frame in 0..frames {
        let time = sequence.frame_time_s(frame);
        let turned = match rotation {
            Some(channel) => Quat::from_array([0, 1, 2, 3].map(|c| channel.at(time, c))).normalize(),
            None => rest_rotation,
        };
        let moved = match translation {
            Some(channel) => Vec3::from_array([0, 1, 2].map(|c| channel.at(time, c))),
            None => rest_translation,
        };
        let turn = turned * rest_rotation.inverse();
        let turn = if turn.is_finite() { turn } else { Quat::IDENTITY };
        let (yaw, pitch, roll) = turn.to_euler(EulerRot::YXZ);
        angles.iter_mut().zip([yaw, pitch, roll]).for_each(|(list, a)| list.push(a.to_degrees()));
        places.push((moved - turn * rest_translation).to_array());
    }
    let fps = sequence.fps;
    let [yaw, pitch, roll] = angles.map(|list| keyed(&list, fps, |v| *v));
    sequence.head.yaw_degrees = yaw;
    sequence.head.pitch_degrees = pitch;
    sequence.head.roll_degrees = roll;
    sequence.head.translation = keyed(&places, fps, |v| *v);
}

/// A key a frame, or a constant.
fn keyed<A: PartialEq, T: Copy + Default>(values: &[A], fps: f64, value: impl Fn(&A) -> T) -> Track<T> {
    match values {
        [] => Track::Constant(T::default()),
        [first, rest @ ..] if rest.iter().all(|v| v == first) => Track::Constant(value(first)),
        _ => {
            let key = |(i, v): (usize, &A)| Key { t: i as f64 / fps, v: value(v), ease: Ease::Linear };
            Track::Keys(values.iter().enumerate().map(key).collect())
        }
    }
}
