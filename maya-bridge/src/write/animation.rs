//! Tracks to animation curves.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use rubor_rig::evaluate::Evaluator;
use rubor_rig::head::Head;
use rubor_rig::life::{Life, Motion};
use rubor_rig::names::Resolver;
use rubor_rig::timeline::{Ease, Key, Sequence, Track, TrackValue};

use super::mesh::Targets;
use super::{Performance, centimetres, digits, line};
use crate::error::WriteError;

/// A performance as tracks of single numbers.
pub(super) struct Animation {
    /// By shape of the head.
    weights: BTreeMap<usize, Track<f32>>,
    yaw: Track<f32>,
    pitch: Track<f32>,
    roll: Track<f32>,
    translation: Track<[f32; 3]>,
    /// Weights of distributions and zones, and the global factor, for the colour node.
    skin: Vec<(String, Track<f32>)>,
    frame_count: u32,
    fps: f64,
}

/// True where weights of shapes are not simply the tracks of the sequence.
pub(super) fn needs_bake(head: &Head, performance: Performance<'_>) -> bool {
    let sequence = performance.sequence;
    if sequence.life.is_some() || sequence.eyes.is_some() {
        return true;
    }
    let drives = |track: &Track<f32>| *track != Track::Constant(0.0);
    if sequence.expressions.values().chain(sequence.states.values()).any(drives) {
        return true;
    }
    let resolver = Resolver::shapes(head);
    let mut taken = vec![false; head.shapes.len()];
    sequence.shapes.keys().any(|name| {
        let targets = resolver.resolve(name);
        targets.iter().any(|t| t.factor != 1.0 || std::mem::replace(&mut taken[t.index as usize], true))
    }) || !performance.rig.combinations.is_empty()
        && performance.rig.combinations.iter().any(|c| !resolver.resolve(&c.shape).is_empty())
}

impl Animation {
    pub(super) fn new(
        head: &Head,
        performance: Performance<'_>,
        baked: bool,
        notes: &mut Vec<String>,
    ) -> Result<Self, WriteError> {
        let sequence = performance.sequence;
        let (evaluator, found) =
            Evaluator::new(head, performance.rig, sequence).map_err(|e| WriteError::Content {
                at: "sequence".into(),
                found: e.to_string(),
                expected: "one for this head".into(),
            })?;
        notes.extend(found.iter().filter(|_| baked).map(ToString::to_string));
        let motion = &sequence.head;
        let mut animation = Self {
            weights: BTreeMap::new(),
            yaw: motion.yaw_degrees.clone(),
            pitch: motion.pitch_degrees.clone(),
            roll: motion.roll_degrees.clone(),
            translation: motion.translation.clone(),
            skin: Vec::new(),
            frame_count: sequence.frame_count(),
            fps: sequence.fps,
        };
        if let Some(life) = &sequence.life {
            animation.live(life);
        }
        if baked {
            animation.bake(head, &evaluator);
            notes.push("expressions are written as weights of shapes at every frame".into());
        } else {
            animation.resolve(head, sequence);
        }
        Ok(animation)
    }

    fn resolve(&mut self, head: &Head, sequence: &Sequence) {
        let resolver = Resolver::shapes(head);
        for (name, track) in &sequence.shapes {
            for target in resolver.resolve(name) {
                self.weights.insert(target.index as usize, track.clone());
            }
        }
    }

    /// Head motion with breath and sway, at every frame.
    fn live(&mut self, life: &Life) {
        let times: Vec<f64> = (0..self.frame_count).map(|i| f64::from(i) / self.fps).collect();
        let (motions, fps): (Vec<_>, f64) = (times.iter().map(|t| life.at(*t)).collect(), self.fps);
        for (k, track) in [&mut self.yaw, &mut self.pitch, &mut self.roll].into_iter().enumerate() {
            let values: Vec<f32> =
                times.iter().zip(&motions).map(|(t, m)| track.at(*t) + m.head_degrees[k]).collect();
            *track = keyed(&values, fps);
        }
        let place = |(i, (t, m)): (usize, (&f64, &Motion))| {
            let keyed = self.translation.at(*t);
            let v = std::array::from_fn(|k| keyed[k] + m.translation[k]);
            Key { t: i as f64 / fps, v, ease: Ease::Linear }
        };
        self.translation = Track::Keys(times.iter().zip(&motions).enumerate().map(place).collect());
    }

    fn bake(&mut self, head: &Head, evaluator: &Evaluator) {
        let mut shapes: Vec<Vec<f32>> = vec![Vec::new(); head.shapes.len()];
        let mut skin: Vec<Vec<f32>> =
            vec![Vec::new(); head.maps.distributions.len() + head.maps.zones.len() + 1];
        for frame in 0..self.frame_count {
            let face = evaluator.at(evaluator.frame_time_s(frame)).face;
            shapes.iter_mut().zip(&face.shapes).for_each(|(list, w)| list.push(*w));
            let values = face.distributions.iter().chain(&face.zones).chain([&face.hemoglobin_scale]);
            skin.iter_mut().zip(values).for_each(|(list, w)| list.push(*w));
        }
        let fps = self.fps;
        self.weights = (shapes.iter().enumerate())
            .map(|(i, values)| (i, keyed(values, fps)))
            .filter(|(_, track)| *track != Track::Constant(0.0))
            .collect();
        let distributions = (0..head.maps.distributions.len()).map(|i| format!("distribution_weight_{i}"));
        let zones = (0..head.maps.zones.len()).map(|i| format!("zone_weight_{i}"));
        let names = distributions.chain(zones).chain(["hemoglobin_scale".to_owned()]);
        self.skin = names.zip(&skin).map(|(name, values)| (name, keyed(values, fps))).collect();
    }

    /// True where something gives a shape a weight.
    pub(super) fn moves(&self, shape: usize) -> bool {
        self.weights.get(&shape).is_some_and(|track| *track != Track::Constant(0.0))
    }

    /// Constant weight of each target, 0 where there is none or a curve.
    pub(super) fn rest_weights(&self, targets: &Targets) -> Vec<f32> {
        let weight = |shape: &usize| match self.weights.get(shape) {
            Some(Track::Constant(weight)) => *weight,
            _ => 0.0,
        };
        targets.0.iter().map(|t| weight(&t.shape)).collect()
    }

    /// Values of the head's transform that do not change.
    pub(super) fn write_pose(&self, out: &mut String) {
        for (name, track) in [(".rx", &self.pitch), (".ry", &self.yaw), (".rz", &self.roll)] {
            if let Track::Constant(degrees) = track
                && *degrees != 0.0
            {
                line(out, &format!("\tsetAttr \"{name}\" {degrees};"));
            }
        }
        if let Track::Constant(metres) = &self.translation
            && *metres != [0.0; 3]
        {
            let [x, y, z] = metres.map(centimetres);
            line(out, &format!("\tsetAttr \".t\" -type \"double3\" {x} {y} {z} ;"));
        }
    }

    pub(super) fn write(&self, out: &mut String, targets: &Targets, unit_fps: f64, has_shader: bool) {
        let mut links = Vec::new();
        let mut curve = |out: &mut String,
                         kind: &str,
                         name: String,
                         to: String,
                         track: &Track<f32>,
                         value: &dyn Fn(f32) -> String,
                         unit: f64| {
            if let Track::Keys(keys) = track {
                write_curve(out, kind, &name, keys, value, unit, unit_fps, self.fps);
                links.push((name, to));
            }
        };
        let plain = |v: f32| v.to_string();
        for (i, target) in targets.0.iter().enumerate() {
            if let Some(track) = self.weights.get(&target.shape) {
                let name = format!("rubor_shapes_{}", target.alias);
                curve(out, "animCurveTU", name, format!("rubor_shapes.w[{i}]"), track, &plain, 1.0);
            }
        }
        let radians = std::f64::consts::PI / 180.0;
        for (axis, track) in [("X", &self.pitch), ("Y", &self.yaw), ("Z", &self.roll)] {
            let to = format!("rubor_head.r{}", axis.to_lowercase());
            curve(out, "animCurveTA", format!("rubor_head_rotate{axis}"), to, track, &plain, radians);
        }
        if let Track::Keys(keys) = &self.translation {
            for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                let one = |k: &Key<[f32; 3]>| Key { t: k.t, v: k.v[i], ease: k.ease };
                let track = Track::Keys(keys.iter().map(one).collect());
                let to = format!("rubor_head.t{}", axis.to_lowercase());
                let name = format!("rubor_head_translate{axis}");
                curve(out, "animCurveTL", name, to, &track, &centimetres, 100.0);
            }
        }
        if has_shader {
            for (name, track) in &self.skin {
                let to = format!("rubor_skin_color.param_{name}");
                curve(out, "animCurveTU", format!("rubor_skin_{name}"), to, track, &plain, 1.0);
            }
        }
        line(out, "createNode script -n \"rubor_playback\";");
        let last = digits(f64::from(self.frame_count - 1) * unit_fps / self.fps);
        let body = format!("playbackOptions -min 0 -max {last} -ast 0 -aet {last} ");
        line(out, &format!("\tsetAttr \".b\" -type \"string\" \"{body}\";\n\tsetAttr \".st\" 6;"));
        for (name, to) in links {
            line(out, &format!("connectAttr \"{name}.o\" \"{to}\";"));
        }
    }
}

/// A track of one value per frame.
fn keyed(values: &[f32], fps: f64) -> Track<f32> {
    match values.first() {
        Some(first) if values.iter().any(|v| v != first) => Track::Keys(
            (values.iter().enumerate())
                .map(|(i, v)| Key { t: i as f64 / fps, v: *v, ease: Ease::Linear })
                .collect(),
        ),
        Some(first) => Track::Constant(*first),
        None => Track::Constant(0.0),
    }
}

/// Keys of which every ease is a cubic: others are sampled at every frame.
fn cubic<T: TrackValue>(keys: &[Key<T>], fps: f64) -> Vec<Key<T>> {
    let mut out = Vec::with_capacity(keys.len());
    let track = Track::Keys(keys.to_vec());
    for (i, key) in keys.iter().enumerate() {
        let next = keys.get(i + 1).filter(|_| matches!(key.ease, Ease::Smoother | Ease::EaseInOut));
        let Some(next) = next else {
            out.push(key.clone());
            continue;
        };
        out.push(Key { ease: Ease::Linear, ..key.clone() });
        let mut frame = (key.t * fps + 1e-6).floor() + 1.0;
        while frame / fps < next.t - 1e-9 {
            out.push(Key { t: frame / fps, v: track.at(frame / fps), ease: Ease::Linear });
            frame += 1.0;
        }
    }
    out
}

/// `unit`: internal units (radians, centimetres) in a unit of the track, for the slopes of fixed tangents.
fn write_curve(
    out: &mut String,
    kind: &str,
    name: &str,
    keys: &[Key<f32>],
    value: &dyn Fn(f32) -> String,
    unit: f64,
    unit_fps: f64,
    fps: f64,
) {
    let keys = cubic(keys, fps);
    let last = keys.len() - 1;
    line(out, &format!("createNode {kind} -n \"{name}\";"));
    let linear = keys.iter().all(|k| k.ease == Ease::Linear);
    line(out, &format!("\tsetAttr \".tan\" {};\n\tsetAttr \".wgt\" no;", if linear { 2 } else { 1 }));
    let _ = write!(out, "\tsetAttr -s {} \".ktv[0:{last}]\"", keys.len());
    super::values(out, keys.iter().map(|k| format!("{} {}", frame_of(k.t, unit_fps), value(k.v))));
    line(out, ";");
    if linear {
        return;
    }
    // (type, slope a second) of the tangents before and after each key.
    let mut inward = vec![(2, 0.0); keys.len()];
    let mut outward = vec![(2, 0.0); keys.len()];
    for i in 0..last {
        let (from, to) = (&keys[i], &keys[i + 1]);
        let chord = (f64::from(to.v) - f64::from(from.v)) / (to.t - from.t) * unit;
        let (out_tangent, in_tangent) = match from.ease {
            Ease::Smooth => ((3, 0.0), (3, 0.0)),
            Ease::Step => ((5, 0.0), (2, 0.0)),
            Ease::EaseIn => ((3, 0.0), (1, 2.0 * chord)),
            Ease::EaseOut => ((1, 2.0 * chord), (3, 0.0)),
            Ease::Linear | Ease::Smoother | Ease::EaseInOut => ((2, 0.0), (2, 0.0)),
        };
        outward[i] = out_tangent;
        inward[i + 1] = in_tangent;
    }
    // The ease of the last key acts on nothing.
    outward[last] = (2, 0.0);
    let n = keys.len();
    for (types, xs, ys, list) in [(".kit", ".kix", ".kiy", &inward), (".kot", ".kox", ".koy", &outward)] {
        let _ = write!(out, "\tsetAttr -s {n} \"{types}[0:{last}]\"");
        super::values(out, list.iter().map(|(kind, _)| kind.to_string()));
        line(out, ";");
        let direction = |slope: f64| 1.0 / (1.0 + slope * slope).sqrt();
        let _ = write!(out, "\tsetAttr -s {n} \"{xs}[0:{last}]\"");
        super::values(out, list.iter().map(|(_, slope)| direction(*slope).to_string()));
        let _ = write!(out, ";\n\tsetAttr -s {n} \"{ys}[0:{last}]\"");
        super::values(out, list.iter().map(|(_, slope)| (slope * direction(*slope)).to_string()));
        line(out, ";");
    }
}

/// The frame whose time is exactly `t` seconds: rounding of the product is undone by trying its neighbours.
fn frame_of(t: f64, fps: f64) -> f64 {
    let frame = t * fps;
    let candidates = [frame, frame.next_up(), frame.next_down(), frame.round()];
    candidates.into_iter().find(|f| f / fps == t).unwrap_or(frame)
}

/// Maya's name for a frame rate, and its rate.
pub(super) fn time_unit(fps: f64, notes: &mut Vec<String>) -> (String, f64) {
    const WHOLE: [u32; 40] = [
        2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 40, 75, 80, 90, 100, 120, 125, 150, 200, 240, 250, 300, 375, 400,
        500, 600, 750, 1200, 1500, 2000, 3000, 6000, 24, 25, 30, 48, 50, 60, 15, 1000,
    ];
    for name in [
        "film",
        "pal",
        "ntsc",
        "show",
        "palf",
        "ntscf",
        "game",
        "23.976fps",
        "29.97fps",
        "47.952fps",
        "59.94fps",
    ] {
        if let Some(rate) = crate::ascii::words::fps(name)
            && (rate - fps).abs() < 1e-9 * fps
        {
            return (name.into(), fps);
        }
    }
    if WHOLE.iter().any(|w| f64::from(*w) == fps) {
        return (format!("{fps}fps"), fps);
    }
    notes.push(format!(
        "Maya has no rate of {fps} frames per second: the scene is at 24, with keys between frames"
    ));
    ("film".into(), 24.0)
}
