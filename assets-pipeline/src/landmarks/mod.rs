//! Finds the landmarks of any face: no names are needed, no particular mesh, pose, unit or texture.
//!
//! ```text
//! triangles --search--> where a face may be --align--> pose and size --bend--> canonical face on the surface
//!           --front picture--> eyes, lips, tip of the nose --bend again--> landmarks, and a confidence from 0 to 1
//! ```
//!
//! The canonical face is made of the default head (`face.bin`). The confidence is that of a logistic model of how well the bent
//! face lies on the surface, set on heads of many shapes and on things that are no heads (`examples/landmark_confidence.rs`);
//! under [`TRUSTED`] the landmarks are a guess that nothing should be placed by.
//!
//! What it does not do: heads in strong expressions or with open jaws lose accuracy about the mouth; of stylised
//! faces without a nose it says so by its confidence.

mod features;
mod given;
mod picture;
mod raster;
mod register;
mod search;
mod surface;
mod template;
mod tree;

use std::collections::BTreeMap;

use glam::Vec3;
use rubor_rig::head::{Head, MM_PER_METRE};

pub(crate) use features::kind;
pub use given::{GivenError, read as read_given};
pub use picture::{Picture, draw as draw_picture};
pub use template::canonical_face;

use features::Feature;
use register::{Quality, Target};
use search::Candidate;
use surface::{Cloud, Similarity, Surface, is_seen};
use template::template;

use crate::synthesize::FaceSpace;

/// Confidence from which landmarks are used.
pub const TRUSTED: f32 = 0.5;

/// Landmarks found on a head.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Places on the surface by name, in the space of the head.
    pub landmarks: BTreeMap<String, Vec3>,
    /// 0 (no face) to 1 (certainly one).
    pub confidence: f32,
    /// What counted, for a note: distance, relief and so on.
    pub reason: String,
    /// Angle between the face and an upright one that looks along +Z, degrees.
    pub turned_degrees: f32,
    /// Length of the head's unit, mm, if its face is as large as the mean adult's.
    pub unit_mm: f32,
    /// Canonical millimetres from the space of the head, without bending.
    canonical_from_head: Similarity,
    /// Measures that the confidence was computed from, by name.
    pub measures: Vec<(&'static str, f32)>,
}

/// Pixels of the pictures that points are taken of, mm: first and last.
const COARSE_MM: f32 = 3.0;
const FINE_MM: f32 = 2.0;

/// Looks for a face in the surface of a head. `None` where there is nothing to look at.
pub fn find(head: &Head) -> Option<Fit> {
    let surface = Surface::of(head, |part| is_seen(head, part));
    let candidates = search::candidates(&surface);
    let mut best: Option<Fitted> = None;
    for candidate in candidates {
        let fitted = refine(&surface, candidate);
        let is_better = best.as_ref().is_none_or(|b| fitted.confidence > b.confidence);
        let is_clear = fitted.confidence > 0.9;
        if is_better {
            best = Some(fitted);
        }
        if is_clear {
            break;
        }
    }
    Some(finish(head, &surface, best?, &BTreeMap::new()))
}

/// Fewest given landmarks that say where a face is by themselves.
const FEWEST_GIVEN: usize = 4;

/// As [`find`], with landmarks that somebody gave: they stay where they are. From four on they say where the face is, and the
/// confidence is 1.
pub fn find_with(head: &Head, given: &BTreeMap<String, Vec3>) -> Option<Fit> {
    let surface = Surface::of(head, |part| is_seen(head, part));
    let canonical: BTreeMap<&str, Vec3> =
        template().landmarks.iter().map(|(n, p)| (n.as_str(), *p)).collect();
    let known: Vec<(Vec3, Vec3)> =
        given.iter().filter_map(|(name, place)| Some((*place, *canonical.get(name.as_str())?))).collect();
    let weight = 1.0 / known.len().max(1) as f32;
    let pairs: Vec<(Vec3, Vec3, f32)> = known.iter().map(|(a, b)| (*a, *b, weight)).collect();
    let pose = (known.len() >= FEWEST_GIVEN).then(|| register::similarity_of(&pairs, (1e-6, 1e9))).flatten();
    let Some(pose) = pose else {
        let mut fit = find(head)?;
        fit.landmarks.extend(given.iter().map(|(name, place)| (name.clone(), *place)));
        return Some(fit);
    };
    let cloud = Cloud::of(&surface.mapped(&pose), FINE_MM);
    let fixed: Vec<(Vec3, Vec3)> = known.iter().map(|(a, b)| (*b, pose.apply(*a))).collect();
    let (bend, quality) = register::bend(&Target::new(&cloud), &fixed, None);
    let fitted = Fitted { pose, bend, quality, score: 1.0, confidence: 1.0 };
    Some(finish(head, &surface, fitted, given))
}

/// A candidate laid over the surface.
struct Fitted {
    pose: Similarity,
    bend: register::Bend,
    quality: Quality,
    score: f32,
    confidence: f32,
}

fn refine(surface: &Surface, candidate: Candidate) -> Fitted {
    let mut pose = candidate.pose;
    for rounds in [14, 8] {
        let cloud = Cloud::of(&surface.mapped(&pose), COARSE_MM);
        pose = pose.then(&register::align(&Target::new(&cloud), rounds));
    }
    let cloud = Cloud::of(&surface.mapped(&pose), FINE_MM);
    let (bend, quality) = register::bend(&Target::new(&cloud), &[], None);
    let confidence = confidence(&quality, candidate.score);
    Fitted { pose, bend, quality, score: candidate.score, confidence }
}

/// Weights of the logistic model: constant, then of [`measures`]. Set by hand on the faces and other things of
/// `examples/landmark_confidence.rs`: faces of persons get 0.96 and more, a crude one made of bumps 0.65, other things under 0.01.
const MODEL: [f32; 8] = [-10.0, 6.0, -1.0, 0.0, 9.0, -1.0, 2.0, -1.0];

/// What tells a face from other things.
fn measures(quality: &Quality, score: f32) -> [(&'static str, f32); 7] {
    [
        ("correlation", score),
        ("distance", (quality.distance_mm / 2.0).min(3.0)),
        ("normals", quality.normals),
        ("bumps", quality.bumps),
        ("relief", quality.relief.max(1e-3).ln().abs().min(3.0)),
        ("covered", quality.covered),
        ("bend", (quality.bend_mm / 5.0).min(3.0)),
    ]
}

fn confidence(quality: &Quality, score: f32) -> f32 {
    let sum =
        MODEL[0] + measures(quality, score).iter().zip(&MODEL[1..]).map(|((_, v), w)| v * w).sum::<f32>();
    1.0 / (1.0 + (-sum).exp())
}

/// Canonical places of [`Feature`]s, left side, measured on the default head; and how far off, mm, what is seen may be by the
/// pixels of the picture and the shape of lids and lips. Within that the surface knows better.
const FEATURES: [(&str, [f32; 3], f32); 7] = [
    ("eye-inner", [19.6, -4.4, 74.4], 2.0),
    ("eye-outer", [45.2, -1.6, 68.5], 1.5),
    ("eye-top", [32.4, 2.0, 78.4], 1.2),
    ("eye-bottom", [32.4, -5.2, 76.5], 1.2),
    ("mouth-corner", [22.0, -72.0, 87.1], 3.0),
    ("mouth-middle", [0.0, -70.8, 93.3], 1.5),
    ("nose-tip", [0.0, -32.2, 110.4], 1.5),
];

/// Places on the canonical face of what a head that has all landmarks, the default head, shows of its openings: name and
/// the mean of both sides, mm. They are those of this module; `examples/landmark_confidence.rs` prints them.
pub fn canonical_features(head: &Head) -> Vec<(String, Vec3)> {
    let space = FaceSpace::fit(head);
    let mut surface = Surface::of(head, |part| is_seen(head, part));
    surface.corners.iter_mut().for_each(|t| *t = t.map(|p| space.warp(p)));
    let pose = Similarity { linear: glam::Mat3::IDENTITY * MM_PER_METRE, shift: Vec3::ZERO };
    let found = features::Front::new(head, &surface, pose).features(|p| p);
    let mean = |name: &str| {
        let of = found.iter().filter(|f| f.name == name);
        let places: Vec<Vec3> =
            of.map(|f| if f.left { f.place } else { f.place * Vec3::new(-1.0, 1.0, 1.0) }).collect();
        places.iter().sum::<Vec3>() / places.len().max(1) as f32
    };
    FEATURES.iter().map(|(name, ..)| ((*name).to_owned(), mean(name))).collect()
}

/// The canonical place of a feature, and how far off what is seen may be.
fn canonical_feature(feature: &Feature) -> Option<(Vec3, f32)> {
    let (_, p, tolerance) = FEATURES.iter().find(|(name, ..)| *name == feature.name)?;
    let p = Vec3::from_array(*p);
    Some((if feature.left { p } else { p * Vec3::new(-1.0, 1.0, 1.0) }, *tolerance))
}

fn finish(head: &Head, surface: &Surface, fitted: Fitted, given: &BTreeMap<String, Vec3>) -> Fit {
    let pose = fitted.pose;
    let mapped = surface.mapped(&pose);
    let cloud = Cloud::of(&mapped, FINE_MM);
    let target = Target::new(&cloud);
    let front = features::Front::new(head, &mapped, pose);
    let found = front.features(|p| fitted.bend.apply(p));
    let held = |feature: &Feature| {
        let (canonical, tolerance) = canonical_feature(feature)?;
        let expected = fitted.bend.apply(canonical);
        let off = feature.place - expected;
        let excess = (off.length() - tolerance).max(0.0);
        Some((canonical, expected + off.normalize_or_zero() * excess))
    };
    let mut fixed: Vec<(Vec3, Vec3)> = found.iter().filter_map(held).collect();
    // What was given counts for more than what was seen near it.
    let canonical = &template().landmarks;
    let given_pairs: Vec<(Vec3, Vec3)> = (canonical.iter())
        .filter_map(|(name, place)| Some((*place, pose.apply(*given.get(name)?))))
        .collect();
    fixed.retain(|(place, _)| given_pairs.iter().all(|(g, _)| g.distance(*place) > 12.0));
    fixed.extend(given_pairs);
    let bend =
        if fixed.is_empty() { fitted.bend } else { register::bend(&target, &fixed, Some(fitted.bend)).0 };
    let head_from_canonical = pose.inverse();
    let keys: Vec<[f32; 3]> = cloud.places.iter().map(|p| p.to_array()).collect();
    let tree = tree::Tree::new(&keys);
    let mut landmarks = BTreeMap::new();
    for (name, canonical) in canonical {
        let place = bend.apply(*canonical);
        if name.starts_with("eye-") {
            landmarks.insert(name.clone(), head_from_canonical.apply(place));
            continue;
        }
        // Onto the surface where it is near.
        let on_surface = tree
            .nearest(&place.to_array(), 6.0)
            .map_or(place, |(i, _)| place + cloud.normals[i] * cloud.normals[i].dot(cloud.places[i] - place));
        landmarks.insert(name.clone(), head_from_canonical.apply(on_surface));
    }
    if let Some(top) = top_of(head, &mapped, bend.apply(Vec3::new(0.0, 108.0, 0.0))) {
        landmarks.insert("vertex".into(), head_from_canonical.apply(top));
    }
    landmarks.extend(given.iter().map(|(name, place)| (name.clone(), *place)));
    let quality = fitted.quality;
    let measures = measures(&quality, fitted.score).to_vec();
    let turn = pose.linear * (1.0 / pose.scale());
    let cosine = 0.5 * (turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0);
    let reason = format!(
        "its relief correlates {:.2} with that of a face, a canonical face bent onto it is {:.1} mm off at a relief of {:.2}",
        fitted.score, quality.distance_mm, quality.bumps
    );
    Fit {
        landmarks,
        confidence: fitted.confidence,
        reason,
        turned_degrees: cosine.clamp(-1.0, 1.0).acos().to_degrees(),
        unit_mm: pose.scale(),
        canonical_from_head: pose,
        measures,
    }
}

/// The highest skin about the expected top of a head, on its middle plane; `None` where it is cut off or covered.
fn top_of(head: &Head, mapped: &Surface, expected: Vec3) -> Option<Vec3> {
    let parts = &head.mesh.parts;
    let skin = |t: u32| {
        let part = parts.partition_point(|p| p.triangles.end <= t);
        part < parts.len() && matches!(kind(head, part), rubor_rig::head::Material::Skin)
    };
    let near = |p: &Vec3| (p.x - expected.x).abs() < 25.0 && (p.z - expected.z).abs() < 60.0;
    let corners = mapped.corners.iter().zip(&mapped.source).filter(|(_, t)| skin(**t)).flat_map(|(c, _)| c);
    let top = corners.filter(|p| near(p)).max_by(|a, b| a.y.total_cmp(&b.y))?;
    ((top.y - expected.y).abs() < 35.0).then(|| Vec3::new(expected.x, top.y, top.z))
}

impl Fit {
    /// Rotation from the head into the upright frame of its face.
    pub(crate) fn frame(&self) -> glam::Mat3 {
        self.canonical_from_head.linear * (1.0 / self.unit_mm)
    }

    /// Scale of the face against the mean adult's if the head's unit is the metre: 1 is the mean.
    pub fn size(&self) -> f32 {
        MM_PER_METRE / self.unit_mm
    }

    /// Puts the landmarks into a head that lacks them; those that it has stay.
    pub fn complete(&self, head: &mut Head) {
        for (name, place) in &self.landmarks {
            head.landmarks.entry(name.clone()).or_insert(*place);
        }
    }
}
