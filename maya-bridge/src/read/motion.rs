//! Animation curves of a scene to a sequence.

use glam::{DAffine3, EulerRot};
use rubor_rig::timeline::{Key, Sequence, Track};

use super::curve::Curve;
use super::geometry::{local_matrix, world_matrix};
use super::head::Built;
use crate::ascii::scene::{Data, NodeId, Scene, Transform};

/// Longest sequence, seconds: a day, as the rig allows.
const LONGEST_S: f64 = 86_400.0;
/// Most frames that are baked for a moving head.
const MOST_FRAMES: f64 = 1_000_000.0;

/// The keyed weights and the motion of the head; none without any.
pub(super) fn sequence(scene: &Scene, built: &Built, notes: &mut Vec<String>) -> Option<Sequence> {
    let mut weights: Vec<(&str, Curve)> = Vec::new();
    let mut constants: Vec<(&str, f64)> = Vec::new();
    for (node, index, shape) in &built.weights {
        match weight_curve(scene, *node, *index, notes) {
            Some(curve) => weights.push((shape, curve)),
            None => {
                if let Data::BlendShape(data) = &scene.nodes[*node].data
                    && let Some(weight) = data.weights.get(index).filter(|w| **w != 0.0)
                {
                    constants.push((shape, *weight));
                }
            }
        }
    }
    let movers = movers(scene, built);
    let moving = movers.iter().any(|m| m.channels.iter().flatten().next().is_some());
    let carried = built
        .carrier
        .and_then(|id| scene.transform(id))
        .is_some_and(|t| t.translate_cm != [0.0; 3] || t.rotate != [0.0; 3]);
    if weights.is_empty() && constants.is_empty() && !moving && !carried {
        return None;
    }
    let curves = || {
        let channels = movers.iter().flat_map(|m| m.channels.iter().flatten());
        weights.iter().map(|(_, c)| c).chain(channels)
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
    let mut baked = 0;
    for (shape, curve) in &weights {
        let (track, segments) = curve.track(start_s, rate, |v| v as f32);
        baked += segments;
        sequence.shapes.entry((*shape).to_owned()).or_insert(track);
    }
    for (shape, weight) in constants {
        sequence.shapes.entry(shape.to_owned()).or_insert(Track::Constant(weight as f32));
    }
    match &movers[..] {
        // Our own head: its angles are the tracks.
        [only] if Some(only.node) == built.carrier && only.is_plain() => {
            baked += direct(only, &mut sequence, start_s, rate);
        }
        _ if moving => bake(scene, &movers, built, &mut sequence, start_s, notes),
        _ => {}
    }
    if baked > 0 {
        notes
            .push(format!("{baked} curve segments have no easing like them and were sampled at every frame"));
    }
    match sequence.check() {
        Ok(()) => Some(sequence),
        Err(e) => {
            notes.push(format!("the animation was left out: {e}"));
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

fn weight_curve(scene: &Scene, node: NodeId, index: u32, notes: &mut Vec<String>) -> Option<Curve> {
    let Data::BlendShape(data) = &scene.nodes[node].data else { return None };
    let indexed = format!("w[{index}]");
    let by_alias = data.aliases.get(&index).and_then(|alias| scene.source(node, alias));
    let plug = scene.source(node, &indexed).or(by_alias)?;
    let source = &scene.nodes[plug.node];
    match &source.data {
        Data::Curve(curve) => {
            if curve.pre_infinity > 0 || curve.post_infinity > 0 {
                notes.push(format!("{}: before and after its keys the curve holds", source.name));
            }
            Curve::new(curve, scene.fps, 1.0)
        }
        _ => {
            notes.push(format!(
                "line {}: {} ({}) drives {}.{indexed} and is not followed; bake the weights to keys in Maya",
                source.line, source.name, source.kind, scene.nodes[node].name
            ));
            None
        }
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

fn movers<'s>(scene: &'s Scene, built: &Built) -> Vec<Mover<'s>> {
    let mut seen: Vec<NodeId> = Vec::new();
    for mesh in &built.meshes {
        let mut at = scene.nodes[*mesh].parent;
        while let Some(id) = at {
            if !seen.contains(&id) {
                seen.push(id);
            }
            at = scene.nodes[id].parent;
        }
    }
    let channel = |node: NodeId, whole: &str, axis: &str| {
        let single = format!("{whole}{axis}");
        let nested = format!("{whole}.{single}");
        let plug = scene.source(node, &single).or_else(|| scene.source(node, &nested))?;
        let unit = match whole {
            "t" => scene.metres * 100.0,
            "r" => scene.radians,
            _ => 1.0,
        };
        match &scene.nodes[plug.node].data {
            Data::Curve(curve) => Curve::new(curve, scene.fps, unit),
            _ => None,
        }
    };
    let mover = |node: NodeId| {
        let transform = scene.transform(node)?;
        let names = ["t", "r", "s"].into_iter().flat_map(|w| ["x", "y", "z"].map(|a| (w, a)));
        let mut channels: [Option<Curve>; 9] = Default::default();
        for (slot, (whole, axis)) in channels.iter_mut().zip(names) {
            *slot = channel(node, whole, axis);
        }
        let keyed = channels.iter().any(Option::is_some);
        (keyed || Some(node) == built.carrier).then_some(Mover { node, transform, channels })
    };
    seen.into_iter().filter_map(mover).collect()
}

/// Channels of our own transform as tracks; returns the number of baked segments.
fn direct(mover: &Mover<'_>, sequence: &mut Sequence, start_s: f64, fps: f64) -> usize {
    let mut baked = 0;
    let degrees = |v: f64| v.to_degrees() as f32;
    let rotate = mover.transform.rotate;
    let head = &mut sequence.head;
    // x is the pitch, y the yaw, z the roll.
    let angles = [(&mut head.pitch_degrees, 3), (&mut head.yaw_degrees, 4), (&mut head.roll_degrees, 5)];
    for (track, i) in angles {
        *track = match &mover.channels[i] {
            Some(curve) => {
                let (track, segments) = curve.track(start_s, fps, degrees);
                baked += segments;
                track
            }
            None => Track::Constant(degrees(rotate[i - 3])),
        };
    }
    let metres = |v: f64| (v * 0.01) as f32;
    let tracks: Vec<Track<f32>> = (0..3)
        .map(|i| match &mover.channels[i] {
            Some(curve) => {
                let (track, segments) = curve.track(start_s, fps, metres);
                baked += segments;
                track
            }
            None => Track::Constant(metres(mover.transform.translate_cm[i])),
        })
        .collect();
    head.translation = together(&tracks);
    baked
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

/// Motion of the whole head frame by frame, relative to where it stands in the scene.
fn bake(
    scene: &Scene,
    movers: &[Mover<'_>],
    built: &Built,
    sequence: &mut Sequence,
    start_s: f64,
    notes: &mut Vec<String>,
) {
    let Some(mesh) = built.meshes.first() else { return };
    let at = |time_s: Option<f64>| {
        let replaced = |id: NodeId| {
            let mover = movers.iter().find(|m| m.node == id)?;
            Some(match time_s {
                Some(t) => local_matrix(&mover.at(t)),
                None if Some(id) == built.carrier => DAffine3::IDENTITY,
                None => local_matrix(mover.transform),
            })
        };
        world_matrix(scene, *mesh, &replaced)
    };
    let frames = f64::from(sequence.frame_count());
    if frames > MOST_FRAMES {
        notes.push("the motion of the head was left out: the sequence is too long".into());
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
        notes.push("keyed scale of the head is left out".into());
    }
    let [yaw, pitch, roll] = keys;
    sequence.head.yaw_degrees = Track::Keys(yaw);
    sequence.head.pitch_degrees = Track::Keys(pitch);
    sequence.head.roll_degrees = Track::Keys(roll);
    sequence.head.translation = Track::Keys(translation);
    notes.push("the motion of the head was sampled at every frame".into());
}
