//! The scenes of a chart: those of the thesis's experiment, and those in which methods fail.

use std::path::Path;

use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::Outcome;
use crate::inputs;
use crate::notes::Note;
use crate::plan;

/// How much of the suite is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Suite {
    /// Six scenes and the common methods, small: minutes on a processor.
    Quick,
    /// Every scene and every method.
    Whole,
}

/// A scene of a head, or of several that stand side by side.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Name, also of its folder of pictures.
    pub name: String,
    /// The failure that it provokes, a sentence; empty for a scene of the user.
    pub provokes: String,
    /// What the head shows, from where, in which light.
    pub shot: Shot,
    /// What further heads beside it show.
    pub beside: Vec<Shot>,
    /// Metres between the middles of heads.
    pub spacing_m: f32,
}

impl Scene {
    /// A scene of one head that provokes nothing.
    pub fn of(name: impl Into<String>, shot: Shot) -> Self {
        Self { name: name.into(), provokes: String::new(), shot, beside: Vec::new(), spacing_m: 0.0 }
    }

    /// What each head shows; camera and lamps are those of the first.
    pub fn shots(&self) -> Vec<Shot> {
        std::iter::once(&self.shot).chain(&self.beside).cloned().collect()
    }
}

/// A scene that provokes a failure: name, failure, text.
type Provocation = (&'static str, &'static str, &'static str);

macro_rules! provocations {
    ($($name:literal, $file:literal, $why:literal;)*) => {
        &[$(($name, $why, include_str!(concat!("../../../../tests/scenes/", $file, ".json")))),*]
    };
}

/// The scenes in which methods fail.
const PROVOCATIONS: &[Provocation] = provocations! {
    "shadow-edge", "nose", "The edge of a hard shadow has to be soft and red: few taps leave bands, jitter leaves noise.";
    "light-through-ear", "ear", "A lamp behind an ear: the light enters where the camera does not look.";
    "frown", "frown", "Wrinkles under a lamp that grazes them: where they are left out it shows at once.";
    "flush", "blush", "Blood that moves, in even light: without it the face is another one.";
    "halo-at-silhouette", "silhouette", "Light of the far cheek spreads into the nose before it, or past the outline.";
    "thin-rim", "lamella", "The rim of an ear before a lamp: a thin part at a grazing angle, most of the picture dark.";
    "gap-of-lips", "lips", "Light crosses between lips that touch and under the nose: the hidden sides are on no screen.";
    "crease", "crease", "The fold of a smile: curvature changes faster than one number for a place can say.";
    "grazing-view", "grazing", "Skin seen along its surface: a millimetre has many pixels one way and few the other.";
    "tiny-face", "tiny", "A face of some forty pixels: a kernel is narrower than a pixel, edges are all there is.";
    "pores", "pores", "Skin from so near that a kernel is hundreds of pixels wide: taps lie far apart.";
    "map-seam", "seam", "The seam of the texture map behind ear and neck: methods over the map end there.";
    "lids", "eye", "Surfaces a millimetre before another that is no skin: light of lids must not fall on the eye.";
    "open-mouth", "mouth", "Lips, teeth and tongue lie behind each other, a centimetre apart.";
};
/// The first of [`PROVOCATIONS`] that the quick suite has.
const QUICK: usize = 4;

/// Metres of a unit of length in the thesis, where a head is 27 units tall.
const UNIT_METRES: f32 = 0.009;
/// Distances of the camera from the head, units (Jimenez 2012, section 4.3.2).
const DISTANCES: [(&str, f32); 3] = [("zoom", 28.0), ("near", 50.0), ("far", 132.0)];
/// Azimuths of the lamp, degrees; its elevation is 45 degrees (same section).
const AZIMUTHS: [f32; 4] = [0.0, 60.0, 110.0, 150.0];
/// Middle of the head, and the place on it that the camera looks at, metres.
const MIDDLE_Z: f32 = -0.06;
const TARGET: [f32; 3] = [0.0, -0.035, 0.0];
/// Distance of the lamp, metres; ours, since the thesis does not say it.
const LAMP_METRES: f32 = 0.9;

/// A picture of the thesis's experiment.
fn stimulus((name, units): (&str, f32), azimuth: f32) -> (String, String) {
    let distance = MIDDLE_Z + units * UNIT_METRES;
    let [x, y, z] = TARGET;
    let (sin, cos) = azimuth.to_radians().sin_cos();
    let along = LAMP_METRES * std::f32::consts::FRAC_1_SQRT_2;
    let lamp = [x + along * sin, y + along, z + along * cos];
    let text = format!(
        r#"{{ "fps": 1, "duration": 1,
            "camera": {{ "position": [{x}, {y}, {distance}], "target": [{x}, {y}, {z}], "fovDegrees": 30 }},
            "lights": [{{ "kind": "spot", "intensity": 4, "position": [{}, {}, {}], "coneDegrees": [46, 62] }}],
            "environment": {{ "name": "studio", "intensity": 0.05 }} }}"#,
        lamp[0], lamp[1], lamp[2]
    );
    (format!("{name}-{azimuth}"), text)
}

/// The scenes of a suite, of a head with its rig, and what in them has no effect on it.
///
/// # Errors
/// A rig that does not fit the head.
pub fn scenes(suite: Suite, head: &Head, rig: &Rig) -> Outcome<(Vec<Scene>, Vec<Note>)> {
    let thesis = |(name, text): (String, String)| {
        (name, "The thesis's experiment: distance of the camera, azimuth of the lamp.", text)
    };
    let provocation = |&(name, why, text): &Provocation| (name.to_owned(), why, text.to_owned());
    let listed: Vec<(String, &str, String)> = match suite {
        Suite::Quick => [thesis(stimulus(DISTANCES[1], AZIMUTHS[1]))]
            .into_iter()
            .chain(PROVOCATIONS[..QUICK].iter().map(provocation))
            .collect(),
        Suite::Whole => DISTANCES
            .into_iter()
            .flat_map(|d| AZIMUTHS.map(|a| thesis(stimulus(d, a))))
            .chain(PROVOCATIONS.iter().map(provocation))
            .collect(),
    };
    let (mut scenes, mut notes) = (Vec::new(), Vec::new());
    for (name, why, text) in listed {
        let sequence = Sequence::from_json(&name, &text)?;
        let (evaluator, found) = Evaluator::new(head, rig, &sequence)?;
        notes.extend(found.iter().map(|note| Note::of_rig(&name, note)));
        scenes.push(Scene { provokes: why.to_owned(), ..Scene::of(name, evaluator.at(0.0)) });
    }
    Ok((scenes, notes))
}

/// The first frame of a sequence of the user.
///
/// # Errors
/// A file that is missing or that is no sequence.
pub fn scene_of(path: &Path, head: &Head, rig: &Rig) -> Outcome<(Scene, Vec<Note>)> {
    let (sequence, mut notes) = inputs::sequence(Some(path))?;
    let name = path.file_stem().map_or_else(|| "sequence".into(), |stem| stem.to_string_lossy().into_owned());
    let (evaluator, found) = Evaluator::new(head, rig, &sequence)?;
    notes.extend(found.iter().map(|note| Note::of_rig(&name, note)));
    Ok((Scene::of(name, evaluator.at(0.0)), notes))
}

/// Frames of a sequence file at equal distances of time, from its beginning, as scenes. Of several heads side by side each is
/// further in the sequence than its neighbour, by an equal share of it, and the camera steps back until it sees all.
///
/// # Errors
/// As [`scene_of`].
pub fn frames_of(
    path: &Path,
    head: &Head,
    rig: &Rig,
    count: u32,
    heads: usize,
) -> Outcome<(Vec<Scene>, Vec<Note>)> {
    let (first, notes) = scene_of(path, head, rig)?;
    let (sequence, _) = inputs::sequence(Some(path))?;
    let (evaluator, _) = Evaluator::new(head, rig, &sequence)?;
    let frame = |i: u32| {
        let seconds = f64::from(i) * sequence.duration / f64::from(count.max(1));
        let name = format!("{}-{seconds:.2}", first.name);
        let later = |head: usize| {
            evaluator
                .at((seconds + head as f64 * sequence.duration / heads as f64) % sequence.duration.max(1e-9))
        };
        let mut shots: Vec<Shot> = (0..heads.max(1)).map(later).collect();
        plan::step_back(&mut shots);
        let shot = shots.remove(0);
        Scene { beside: shots, spacing_m: plan::spacing_m([head]), ..Scene::of(name, shot) }
    };
    Ok(((0..count).map(frame).collect(), notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_have_names_of_their_own_and_light() {
        let loaded = inputs::head(None).unwrap();
        let rig = inputs::rig(None, loaded.rig.clone()).unwrap();
        let (whole, notes) = scenes(Suite::Whole, &loaded.head, &rig).unwrap();
        assert!(notes.is_empty(), "{notes:?}");
        assert_eq!(whole.len(), 12 + PROVOCATIONS.len());
        let mut names: Vec<_> = whole.iter().map(|s| s.name.clone()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), whole.len());
        assert!(whole.iter().all(|s| !s.shot.lights.is_empty() && s.provokes.ends_with('.')));
        let (quick, _) = scenes(Suite::Quick, &loaded.head, &rig).unwrap();
        assert!(quick.iter().all(|q| whole.iter().any(|w| w.name == q.name && w.shot == q.shot)));
    }

    #[test]
    fn lamps_of_the_experiment_stand_where_the_thesis_says() {
        let loaded = inputs::head(None).unwrap();
        let rig = inputs::rig(None, loaded.rig.clone()).unwrap();
        let (whole, _) = scenes(Suite::Whole, &loaded.head, &rig).unwrap();
        let shot = |name: &str| &whole.iter().find(|s| s.name == name).unwrap().shot;
        let lamp = |name: &str| shot(name).lights[0].position - shot(name).camera.target;
        assert!((lamp("near-0").y / lamp("near-0").length() - 0.5f32.sqrt()).abs() < 1e-5);
        assert!(lamp("near-0").x.abs() < 1e-6 && lamp("near-0").z > 0.0);
        assert!(lamp("near-110").x > 0.0 && lamp("near-150").z < lamp("near-110").z);
        let z = |name: &str| shot(name).camera.position.z;
        let steps = (z("far-0") - z("zoom-0")) / (z("near-0") - z("zoom-0"));
        assert!((steps - (132.0 - 28.0) / (50.0 - 28.0)).abs() < 1e-4, "{steps}");
    }
}
