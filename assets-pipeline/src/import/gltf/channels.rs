//! Channels of animations, from the JSON of the document.
//!
//! glTF 2.0 lets a channel have no node (it "SHOULD be ignored") and extensions add paths; the `gltf` crate refuses such
//! files whole and panics on nodes that do not exist. A channel that cannot be read is left out with a note and never
//! costs the head.

use std::collections::HashSet;

use rubor_rig::timeline::{Ease, Key, Track};
use serde_json::Value;

use super::accessor::{by_index, floats};
use super::document::{Document, Share};
use crate::error::ImportError;
use crate::notes::Notes;

/// Slopes of an easing may be off by this part of a weight: they are written in f32.
const SLOPE_ROUNDING: f64 = 1e-4;
/// Keys after this are left out, seconds: a day, the longest sequence.
pub(super) const LAST_S: f32 = 86_400.0;
/// Most keys that a cubic segment without an easing becomes: lines between them are off by less than 1e-5 of its height.
const MOST_SAMPLES: f64 = 256.0;

/// Target of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Target {
    /// Weights of the mesh of the node.
    Weights,
    /// Rotation of the node.
    Rotation,
    /// Translation of the node.
    Translation,
    /// Scale of the node.
    Scale,
}

/// Between keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    Cubic,
}

/// Names in a channel; its accessors are not yet read.
#[derive(Clone, Debug)]
pub(super) struct Named {
    /// `animation 0, channel 2`.
    pub(super) at: String,
    pub(super) node: usize,
    pub(super) target: Target,
    interpolation: Interpolation,
    input: u32,
    output: u32,
}

/// Channels of an animation whose targets exist.
pub(super) fn of_animation(document: &Document, animation: usize, notes: &mut Notes) -> Vec<Named> {
    let raw = &document.raw["animations"][animation];
    let mut found: Vec<Named> = Vec::new();
    let mut moved: HashSet<(usize, Target)> = HashSet::new();
    for (i, channel) in raw["channels"].as_array().into_iter().flatten().enumerate() {
        let at = format!("animation {animation}, channel {i}");
        match named(document, raw, channel, at.clone()) {
            Ok(named) if !moved.insert((named.node, named.target)) => {
                notes.add("channels of a target that another channel moves are left out", at);
            }
            Ok(named) => found.push(named),
            Err(message) => notes.add(message, at),
        }
    }
    found
}

fn named(document: &Document, animation: &Value, channel: &Value, at: String) -> Result<Named, &'static str> {
    let target = &channel["target"];
    if target["path"] == "pointer" || target["extensions"].get("KHR_animation_pointer").is_some() {
        return Err(
            "animation pointers (KHR_animation_pointer) are not followed: these channels move nothing",
        );
    }
    let Some(node) = target.get("node") else {
        return Err("channels without a node move nothing, as glTF 2.0 has it");
    };
    let node = index(node).filter(|n| *n < document.gltf.nodes().len());
    let node = node.ok_or("channels of a node that does not exist are left out")?;
    let target = match target["path"].as_str() {
        Some("weights") => Target::Weights,
        Some("rotation") => Target::Rotation,
        Some("translation") => Target::Translation,
        Some("scale") => Target::Scale,
        _ => return Err("channels with a path that glTF 2.0 does not know are left out"),
    };
    let sampler = index(&channel["sampler"]).map_or(&Value::Null, |s| &animation["samplers"][s]);
    let accessor = |key: &str| index(&sampler[key]).and_then(|a| u32::try_from(a).ok());
    let (Some(input), Some(output)) = (accessor("input"), accessor("output")) else {
        return Err("channels without a sampler are left out");
    };
    let interpolation = match sampler.get("interpolation").map(Value::as_str) {
        None | Some(Some("LINEAR")) => Interpolation::Linear,
        Some(Some("STEP")) => Interpolation::Step,
        Some(Some("CUBICSPLINE")) => Interpolation::Cubic,
        Some(_) => return Err("channels with an interpolation that glTF 2.0 does not know are left out"),
    };
    Ok(Named { at, node, target, interpolation, input, output })
}

fn index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|i| usize::try_from(i).ok())
}

/// A channel in memory: at least one key, times rising strictly from 0 on or from one key before it.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    interpolation: Interpolation,
    pub(super) times_s: Vec<f32>,
    /// `width` numbers per key; three times as many where it is cubic.
    numbers: Vec<f32>,
    /// Numbers of a key.
    width: usize,
}

impl Channel {
    /// Reads a channel; where that fails it is left out with a note.
    pub(super) fn read(document: &Document, named: &Named, width: usize, notes: &mut Notes) -> Option<Self> {
        let read = match named.target {
            Target::Weights => Self::numbers::<1>(document, named),
            Target::Rotation => Self::numbers::<4>(document, named),
            Target::Translation | Target::Scale => Self::numbers::<3>(document, named),
        };
        let leave_out = |notes: &mut Notes, why: String| {
            notes.add("channels that cannot be read are left out", format!("{} ({why})", named.at));
            None
        };
        let (times_s, numbers) = match read {
            Ok(read) => read,
            Err(ImportError::Content { found, expected, .. }) => {
                return leave_out(notes, format!("found {found}, expected {expected}"));
            }
            Err(e) => return leave_out(notes, e.to_string()),
        };
        if times_s.is_empty() {
            return leave_out(notes, "no keys".into());
        }
        let per_key = if named.interpolation == Interpolation::Cubic { 3 } else { 1 };
        let expected = times_s.len() * width * per_key;
        if numbers.len() != expected {
            let why =
                format!("found {} numbers, expected {expected} for {} keys", numbers.len(), times_s.len());
            return leave_out(notes, why);
        }
        let channel = Self { interpolation: named.interpolation, times_s, numbers, width };
        let channel = channel.repaired(&named.at, notes);
        if channel.times_s.is_empty() {
            return leave_out(notes, format!("all keys are later than {LAST_S} s"));
        }
        if let Err((found, expected)) = document.try_take(Share::Keys, channel.most_keys()) {
            return leave_out(notes, format!("found {found}, expected {expected}"));
        }
        Some(channel)
    }

    fn numbers<const N: usize>(
        document: &Document,
        named: &Named,
    ) -> Result<(Vec<f32>, Vec<f32>), ImportError> {
        let times = floats::<1>(document, &named.at, &by_index(document, &named.at, named.input)?)?;
        let numbers = floats::<N>(document, &named.at, &by_index(document, &named.at, named.output)?)?;
        Ok((times.into_flattened(), numbers.into_flattened()))
    }

    /// Keys by rising time. Of keys at the same time the first ends the way before, the last begins the way after, as
    /// players show them; keys before 0 shape the rest of their segment and are cut off in [`Channel::track`].
    fn repaired(mut self, at: &str, notes: &mut Notes) -> Self {
        let before = self.times_s.len();
        let mut order: Vec<usize> = (0..before).collect();
        if !self.times_s.is_sorted() {
            notes.add("keys that do not stand in the order of their times are sorted", at);
            order.sort_by(|a, b| self.times_s[*a].total_cmp(&self.times_s[*b]));
        }
        if self.times_s.iter().any(|t| *t < 0.0) {
            notes.add("keys before 0 are cut off: animations of glTF 2.0 begin at 0", at);
        }
        if self.times_s.iter().any(|t| *t > LAST_S) {
            notes.add(format!("keys later than {LAST_S} s are left out"), at);
            order.retain(|k| self.times_s[*k] <= LAST_S);
        }
        let mut times: Vec<f32> = Vec::with_capacity(order.len());
        let mut kept: Vec<usize> = Vec::with_capacity(order.len());
        let mut jumps = false;
        for key in order {
            let time = self.times_s[key];
            match times.last() {
                Some(last) if *last == time => {
                    jumps = true;
                    let count = times.len();
                    // The end of the way before stands as late as a number before the time can say.
                    let early = time.next_down();
                    if count >= 2 && times[count - 2] >= early {
                        kept.pop();
                        times.pop();
                    } else {
                        times[count - 1] = early;
                    }
                }
                _ => {}
            }
            times.push(time);
            kept.push(key);
        }
        if jumps {
            notes.add("keys at the same time are a jump from the first to the last of them", at);
        }
        // The last key at or before 0 is where the first segment starts.
        let start = times.partition_point(|t| *t <= 0.0).saturating_sub(1);
        let (times, kept) = (times.split_off(start), kept.split_off(start));
        let stride = self.width * if self.interpolation == Interpolation::Cubic { 3 } else { 1 };
        let numbers = &self.numbers;
        self.numbers = kept.iter().flat_map(|k| &numbers[k * stride..(k + 1) * stride]).copied().collect();
        self.times_s = times;
        self
    }

    /// Keys that the tracks of its numbers have at most, at up to 120 frames a second.
    fn most_keys(&self) -> u64 {
        let samples = |w: &[f32]| (120.0 * f64::from(w[1] - w[0])).ceil().clamp(1.0, MOST_SAMPLES) as u64;
        let keys = match self.is_cubic() {
            true => self.times_s.windows(2).map(samples).sum(),
            false => self.times_s.len() as u64,
        };
        keys.max(1) * self.width as u64
    }

    fn is_cubic(&self) -> bool {
        self.interpolation == Interpolation::Cubic
    }

    fn value(&self, key: usize, c: usize) -> f32 {
        if self.is_cubic() {
            self.numbers[(3 * key + 1) * self.width + c]
        } else {
            self.numbers[key * self.width + c]
        }
    }

    /// Numbers of all keys, without slopes.
    pub(super) fn values(&self) -> impl Iterator<Item = f32> {
        (0..self.times_s.len()).flat_map(move |k| (0..self.width).map(move |c| self.value(k, c)))
    }

    /// Slopes out of a key and into the next, times the way between them.
    fn slopes(&self, key: usize, c: usize) -> [f64; 2] {
        let length = f64::from(self.times_s[key + 1]) - f64::from(self.times_s[key]);
        let at = |i: usize| length * f64::from(self.numbers[i * self.width + c]);
        [at(3 * key + 2), at(3 * (key + 1))]
    }

    /// Number `c` at a time, as players interpolate it; rotations are made unit afterwards.
    pub(super) fn at(&self, time_s: f64, c: usize) -> f32 {
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
            Interpolation::Cubic => hermite(a, b, self.slopes(key, c), u),
        };
        // Slopes near the end of f32 may lead beyond it.
        value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
    }

    /// One number over time, from 0 on.
    pub(super) fn track(&self, c: usize, fps: f64) -> Track<f32> {
        let mut keys: Vec<Key<f32>> = Vec::new();
        for (i, time) in self.times_s.iter().enumerate() {
            let start = f64::from(*time).max(0.0);
            let key = |ease| Key {
                t: start,
                v: if *time < 0.0 { self.at(0.0, c) } else { self.value(i, c) },
                ease,
            };
            let Some(next) = self.times_s.get(i + 1) else {
                keys.push(key(Ease::Linear));
                break;
            };
            // A part of a straight line is one; a part of an easing is none.
            let whole = *time >= 0.0 || !self.is_cubic();
            match self.ease(i, c).filter(|_| whole) {
                Some(ease) => keys.push(key(ease)),
                None => {
                    keys.push(key(Ease::Linear));
                    let end = f64::from(*next);
                    let step = (((end - start) * fps / MOST_SAMPLES).ceil().max(1.0)) / fps;
                    let mut number = (start / step + 1e-6).floor() + 1.0;
                    while number * step < end - 1e-6 {
                        let t = number * step;
                        keys.push(Key { t, v: self.at(t, c), ease: Ease::Linear });
                        number += 1.0;
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
            Interpolation::Cubic => {}
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
