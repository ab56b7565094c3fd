//! Animation curves of a scene to a sequence.

use std::collections::HashSet;

use glam::{DAffine3, EulerRot};
use rubor_rig::timeline::{Key, Sequence, Track};

use super::curve::{Baking, Curve, MOST_BAKED_FRAMES};
use super::geometry::{Instance, local_matrix, world_matrix};
use super::head::Built;
use super::weight::{Drive, Effect};
use crate::ascii::scene::{Data, NodeId, Plug, Scene, Transform};
use crate::notes::Notes;

/// Longest sequence, seconds: a day, as the rig allows.
const LONGEST_S: f64 = 86_400.0;
/// Most frames that are baked for a moving head.
const MOST_FRAMES: f64 = 1_000_000.0;

/// A weight as a sequence has it.
enum Played {
    Constant(f64),
    /// A curve and the factor of its values.
    Scaled(Curve, f64),
    /// Two curves and what their product is multiplied by.
    Product([Curve; 2], f64),
}

impl Played {
    fn curves(&self) -> &[Curve] {
        match self {
            Self::Constant(_) => &[],
            Self::Scaled(curve, _) => std::slice::from_ref(curve),
            Self::Product(curves, _) => curves,
        }
    }
}

/// The keyed weights and the motion of the head; none without any.
pub(super) fn sequence(scene: &Scene, built: &Built<'_>, notes: &mut Notes) -> Option<Sequence> {
    let mut weights: Vec<(&str, Played)> = Vec::new();
    let mut seen = HashSet::new();
    for weight in &built.weights {
        // Weights that share a shape have the same effect.
        if !seen.insert(weight.shape.as_str()) {
            continue;
        }
        let Effect { weight: drive, envelope, factor } = &weight.effect;
        if let Drive::Foreign(plug, _) = drive {
            let source = &scene.nodes[plug.node];
            notes.about(
                format!(
                    "weights that {} nodes drive are not followed; bake them to keys in Maya",
                    source.kind
                ),
                format!("{} by {} (line {})", weight.shape, source.name, source.line),
            );
        }
        let parts = (part(scene, drive, notes), part(scene, envelope, notes));
        let played = match parts {
            (Part::Constant(0.0), _) => continue,
            (Part::Constant(w), Part::Constant(e)) => Played::Constant(w * e * factor),
            (Part::Curve(c), Part::Constant(s)) | (Part::Constant(s), Part::Curve(c)) => {
                let scale = s * factor;
                if scale == 0.0 { Played::Constant(0.0) } else { Played::Scaled(c, scale) }
            }
            (Part::Curve(..), Part::Curve(..)) if *factor == 0.0 => Played::Constant(0.0),
            (Part::Curve(w), Part::Curve(e)) => Played::Product([w, e], *factor),
        };
        weights.push((&weight.shape, played));
    }
    let movers = movers(scene, built, notes);
    let moving = movers.iter().any(|m| m.channels.iter().flatten().next().is_some());
    let carried = built
        .carrier
        .and_then(|id| scene.transform(id))
        .is_some_and(|t| t.translate_cm != [0.0; 3] || t.rotate != [0.0; 3]);
    if weights.is_empty() && !moving && !carried {
        return None;
    }
    let curves = || {
        let channels = movers.iter().flat_map(|m| m.channels.iter().flatten());
        weights.iter().flat_map(|(_, played)| played.curves()).chain(channels)
    };
    // Time 0 is the start of the playback range, or the earliest key before it.
    let range = playback(scene);
    let first_key = curves().map(Curve::first_s).fold(f64::INFINITY, f64::min);
    let last_key = curves().map(Curve::last_s).fold(f64::NEG_INFINITY, f64::max);
    let fps = scene.fps;
    let start_s = range.map_or(first_key, |(from, _)| (from / fps).min(first_key));
    let start_s = if start_s.is_finite() { start_s } else { 0.0 };
    let end_s = range.map_or(last_key, |(_, to)| to / fps);
    let end_s = if end_s.is_finite() { end_s } else { start_s };
    let frames = ((end_s - start_s) * fps + 1e-6).floor().max(0.0) + 1.0;
    let duration = (frames / fps).min(LONGEST_S);
    // A unit of time that is no frame rate (seconds, hours) is sampled as film.
    let rate = if (2.0..=10_000.0).contains(&fps) { fps } else { 24.0 };

    let mut sequence = Sequence::still(rate, duration.max(1.0 / rate));
    let mut baking = Baking::default();
    for (shape, played) in &weights {
        let track = match played {
            Played::Constant(value) => Track::Constant(*value as f32),
            Played::Scaled(curve, scale) => curve.track(start_s, rate, &mut baking, |v| (v * scale) as f32),
            Played::Product(curves, scale) => product(curves, *scale, start_s, rate, &mut baking),
        };
        let (low, high) = range_of(&track);
        if low < 0.0 || high > 1.0 {
            notes.about(
                "weights outside of 0..1 stay in the sequence as keyed; a rig may cut them",
                format!("{shape} ({low} to {high})"),
            );
        }
        sequence.shapes.insert((*shape).to_owned(), track);
    }
    match &movers[..] {
        // Our own head: its angles are the tracks.
        [only] if Some(only.node) == built.carrier && only.is_plain() => {
            direct(only, &mut sequence, start_s, rate, &mut baking);
        }
        _ if moving => bake(scene, &movers, built, &mut sequence, start_s, notes),
        _ => {}
    }
    if baking.too_long > 0 {
        notes.say(format!(
            "{} curve segments are too long to be sampled at frames (more than {MOST_BAKED_FRAMES} in all) and are straight lines",
            baking.too_long
        ));
    }
    if baking.segments > 0 {
        let baked = baking.segments;
        notes.say(format!("{baked} curve segments have no easing like them and were sampled at every frame"));
    }
    match sequence.check() {
        Ok(()) => Some(sequence),
        Err(e) => {
            notes.say(format!("the animation was left out: {e}"));
            None
        }
    }
}

/// First and last frame of the playback range, from the script node that Maya saves with each scene.
fn playback(scene: &Scene) -> Option<(f64, f64)> {
    scene.nodes.iter().find_map(|node| {
        let Data::Script(body) = &node.data else { return None };
        let words: Vec<&str> = body.split_ascii_whitespace().collect();
        if words.first() != Some(&"playbackOptions") {
            return None;
        }
        let value = |flag: &str| {
            let at = words.iter().position(|w| *w == flag)?;
            words.get(at + 1)?.parse::<f64>().ok().filter(|v| v.is_finite())
        };
        Some((value("-min")?, value("-max")?)).filter(|(from, to)| from <= to)
    })
}

/// A number that moves or does not.
enum Part {
    Constant(f64),
    Curve(Curve),
}

fn part(scene: &Scene, drive: &Drive<'_>, notes: &mut Notes) -> Part {
    match drive {
        Drive::Constant(value) | Drive::Foreign(_, value) => Part::Constant(*value),
        Drive::Curve(node, data) => {
            if data.pre_infinity > 0 || data.post_infinity > 0 {
                let note = "curves that go on before or after their keys hold there";
                notes.about(note, scene.nodes[*node].name.clone());
            }
            Curve::new(data, scene.fps, 1.0).map_or(Part::Constant(0.0), Part::Curve)
        }
    }
}

/// Two curves multiplied, sampled at their keys and at every frame between the first and the last.
fn product(curves: &[Curve; 2], scale: f64, start_s: f64, fps: f64, baking: &mut Baking) -> Track<f32> {
    let first = curves.iter().map(Curve::first_s).fold(f64::INFINITY, f64::min) - start_s;
    let last = curves.iter().map(Curve::last_s).fold(f64::NEG_INFINITY, f64::max) - start_s;
    let mut times: Vec<f64> =
        curves.iter().flat_map(Curve::times_s).map(|t| (t - start_s).max(0.0)).collect();
    let from = (first * fps).max(0.0).ceil();
    let count = ((last * fps - from).floor() + 1.0).max(0.0);
    let count = if baking.segment(count) { count as u64 } else { 0 };
    times.extend((0..count).map(|frame| (from + frame as f64) / fps));
    times.sort_by(f64::total_cmp);
    times.dedup_by(|later, earlier| *later - *earlier < 1e-9);
    let value = |t: f64| (curves[0].at(t + start_s) * curves[1].at(t + start_s) * scale) as f32;
    Track::Keys(times.into_iter().map(|t| Key { t, v: value(t), ease: Default::default() }).collect())
}

/// Smallest and largest value at the keys.
fn range_of(track: &Track<f32>) -> (f32, f32) {
    match track {
        Track::Constant(value) => (*value, *value),
        Track::Keys(keys) => keys
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), k| (low.min(k.v), high.max(k.v))),
    }
}

/// A transform above the meshes with keys, or our own.
struct Mover<'s> {
    node: NodeId,
    transform: &'s Transform,
    /// Translation x, y, z (cm), rotation (radians), scale.
    channels: [Option<Curve>; 9],
}

impl Mover<'_> {
    /// The transform at a time.
    fn at(&self, time_s: f64) -> Transform {
        let mut t = self.transform.clone();
        let values = t.translate_cm.iter_mut().chain(&mut t.rotate).chain(&mut t.scale);
        for (value, curve) in values.zip(&self.channels) {
            if let Some(curve) = curve {
                *value = curve.at(time_s);
            }
        }
        t
    }

    /// True if translation and rotation in the order of a sequence's head are all there is.
    fn is_plain(&self) -> bool {
        let t = self.transform;
        t.order == 2
            && t.scale == [1.0; 3]
            && self.channels[6..].iter().all(Option::is_none)
            && [t.rotate_pivot_cm, t.rotate_pivot_translate_cm, t.scale_pivot_cm, t.scale_pivot_translate_cm]
                .iter()
                .chain([&t.joint_orient, &t.rotate_axis])
                .all(|v| *v == [0.0; 3])
    }
}

/// Attributes of a transform that place its children, besides the nine channels.
const PLACING: [&str; 12] = ["t", "r", "s", "sh", "opm", "ro", "rp", "rpt", "sp", "spt", "jo", "ra"];

fn movers<'s>(scene: &'s Scene, built: &Built<'_>, notes: &mut Notes) -> Vec<Mover<'s>> {
    let mut seen: HashSet<NodeId> = HashSet::new();
    let mut order: Vec<NodeId> = Vec::new();
    for instance in &built.instances {
        order.extend(instance.above.iter().filter(|id| seen.insert(**id)));
        visibility_is_not_followed(scene, instance.mesh, notes);
    }
    let channel = |node: NodeId, whole: &str, axis: &str, notes: &mut Notes| {
        let single = format!("{whole}{axis}");
        let nested = format!("{whole}.{single}");
        let plug = scene.source(node, &single).or_else(|| scene.source(node, &nested))?;
        let unit = match whole {
            "t" => scene.metres * 100.0,
            "r" => scene.radians,
            _ => 1.0,
        };
        let source = &scene.nodes[plug.node];
        match &source.data {
            Data::Curve(curve) => {
                if curve.pre_infinity > 0 || curve.post_infinity > 0 {
                    let note = "curves that go on before or after their keys hold there";
                    notes.about(note, source.name.clone());
                }
                Curve::new(curve, scene.fps, unit)
            }
            _ => {
                not_followed(scene, node, &single, plug, notes);
                None
            }
        }
    };
    let mut movers = Vec::new();
    for node in order {
        let Some(transform) = scene.transform(node) else { continue };
        visibility_is_not_followed(scene, node, notes);
        for attribute in PLACING {
            if let Some(plug) = scene.source(node, attribute) {
                not_followed(scene, node, attribute, plug, notes);
            }
        }
        let names = ["t", "r", "s"].into_iter().flat_map(|w| ["x", "y", "z"].map(|a| (w, a)));
        let mut channels: [Option<Curve>; 9] = Default::default();
        for (slot, (whole, axis)) in channels.iter_mut().zip(names) {
            *slot = channel(node, whole, axis, notes);
        }
        let keyed = channels.iter().any(Option::is_some);
        if keyed || Some(node) == built.carrier {
            movers.push(Mover { node, transform, channels });
        }
    }
    movers
}

fn not_followed(scene: &Scene, node: NodeId, attribute: &str, plug: &Plug, notes: &mut Notes) {
    let source = &scene.nodes[plug.node];
    notes.about(
        format!(
            "transforms that {} nodes drive stand where they are stored; bake them to keys in Maya",
            source.kind
        ),
        format!("{}.{attribute} by {}", scene.nodes[node].name, source.name),
    );
}

fn visibility_is_not_followed(scene: &Scene, node: NodeId, notes: &mut Notes) {
    if let Some(plug) = scene.source(node, "v") {
        let source = &scene.nodes[plug.node];
        notes.about(
            "driven visibility is not followed, the stored one counts",
            format!("{} by {} ({})", scene.nodes[node].name, source.name, source.kind),
        );
    }
}

/// Channels of our own transform as tracks.
fn direct(mover: &Mover<'_>, sequence: &mut Sequence, start_s: f64, fps: f64, baking: &mut Baking) {
    let degrees = |v: f64| v.to_degrees() as f32;
    let rotate = mover.transform.rotate;
    let head = &mut sequence.head;
    // x is the pitch, y the yaw, z the roll.
    let angles = [(&mut head.pitch_degrees, 3), (&mut head.yaw_degrees, 4), (&mut head.roll_degrees, 5)];
    for (track, i) in angles {
        *track = match &mover.channels[i] {
            Some(curve) => curve.track(start_s, fps, baking, degrees),
            None => Track::Constant(degrees(rotate[i - 3])),
        };
    }
    let metres = |v: f64| (v * 0.01) as f32;
    let tracks: Vec<Track<f32>> = (0..3)
        .map(|i| match &mover.channels[i] {
            Some(curve) => curve.track(start_s, fps, baking, metres),
            None => Track::Constant(metres(mover.transform.translate_cm[i])),
        })
        .collect();
    head.translation = together(&tracks);
}

/// Three tracks as one. Keys of the same times and easings stay; otherwise every time of any of them gets a key.
fn together(tracks: &[Track<f32>]) -> Track<[f32; 3]> {
    let value = |t: f64| -> [f32; 3] { std::array::from_fn(|i| tracks[i].at(t)) };
    let keyed: Vec<&Vec<Key<f32>>> =
        tracks.iter().filter_map(|t| if let Track::Keys(keys) = t { Some(keys) } else { None }).collect();
    let Some(first) = keyed.first() else { return Track::Constant(value(0.0)) };
    let alike = keyed.iter().all(|keys| {
        keys.len() == first.len() && keys.iter().zip(*first).all(|(a, b)| a.t == b.t && a.ease == b.ease)
    });
    if alike {
        return Track::Keys(first.iter().map(|k| Key { t: k.t, v: value(k.t), ease: k.ease }).collect());
    }
    let mut times: Vec<f64> = keyed.iter().flat_map(|keys| keys.iter().map(|k| k.t)).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    Track::Keys(times.into_iter().map(|t| Key { t, v: value(t), ease: Default::default() }).collect())
}

/// Motion of the whole head frame by frame, relative to its place in the scene.
fn bake(
    scene: &Scene,
    movers: &[Mover<'_>],
    built: &Built<'_>,
    sequence: &mut Sequence,
    start_s: f64,
    notes: &mut Notes,
) {
    let Some(first) = built.instances.first() else { return };
    // A sequence has one motion for the whole head: that of the first mesh.
    let moved_by = |instance: &Instance| -> Vec<NodeId> {
        instance.above.iter().filter(|id| movers.iter().any(|m| m.node == **id)).copied().collect()
    };
    let of_first = moved_by(first);
    for instance in built.instances.iter().filter(|i| moved_by(i) != of_first) {
        let note = format!("meshes that do not move as {} does are moved with it", first.path(scene));
        notes.about(note, instance.path(scene));
    }
    let at = |time_s: Option<f64>| {
        let replaced = |id: NodeId| {
            let mover = movers.iter().find(|m| m.node == id)?;
            Some(match time_s {
                Some(t) => local_matrix(&mover.at(t)),
                None if Some(id) == built.carrier => DAffine3::IDENTITY,
                None => local_matrix(mover.transform),
            })
        };
        world_matrix(scene, first, &replaced)
    };
    let frames = f64::from(sequence.frame_count());
    if frames > MOST_FRAMES {
        notes.say("the motion of the head was left out: the sequence is too long");
        return;
    }
    let rest = at(None).inverse();
    let mut keys: [Vec<Key<f32>>; 3] = Default::default();
    let mut translation = Vec::new();
    let mut stretched = false;
    for frame in 0..sequence.frame_count() {
        let t = sequence.frame_time_s(frame);
        let motion = at(Some(t + start_s)) * rest;
        let (scale, rotation, shift) = motion.to_scale_rotation_translation();
        stretched |= (scale - glam::DVec3::ONE).abs().max_element() > 1e-4;
        let (yaw, pitch, roll) = rotation.to_euler(EulerRot::YXZ);
        for (keys, angle) in keys.iter_mut().zip([yaw, pitch, roll]) {
            keys.push(Key { t, v: angle.to_degrees() as f32, ease: Default::default() });
        }
        translation.push(Key { t, v: (shift * 0.01).as_vec3().to_array(), ease: Default::default() });
    }
    if stretched || !rest.is_finite() {
        notes.say("keyed scale of the head is left out");
    }
    let [yaw, pitch, roll] = keys;
    sequence.head.yaw_degrees = Track::Keys(yaw);
    sequence.head.pitch_degrees = Track::Keys(pitch);
    sequence.head.roll_degrees = Track::Keys(roll);
    sequence.head.translation = Track::Keys(translation);
    notes.say("the motion of the head was sampled at every frame");
}
