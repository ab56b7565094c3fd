//! Weights that stand in front of the tracks of a sequence: those of sliders that were moved and those that arrive live.
//!
//! ```text
//! Sequence + live Pose + Pose of the sliders --apply--> Sequence with constants in their place
//! ```
//!
//! So a face with moved sliders is drawn exactly as `rubor render` draws a sequence with these constants.

use std::collections::BTreeMap;

use rubor_rig::head::Head;
use rubor_rig::names::{Key as NameKey, Resolver, Side};
use rubor_rig::timeline::{Sequence, Track};

/// Weights by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Of expressions of the rig.
    pub expressions: BTreeMap<String, f32>,
    /// Of states of the rig.
    pub states: BTreeMap<String, f32>,
    /// Of shapes, as the head spells them: what single tracks add to expressions.
    pub shapes: BTreeMap<String, f32>,
    /// Of wrinkle zones of the head; no sequence has tracks of them.
    pub zones: BTreeMap<String, f32>,
    /// Yaw, pitch and roll of the head, degrees.
    pub head_degrees: Option<[f32; 3]>,
}

/// What a weight belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Group {
    /// Expressions of the rig.
    Expressions,
    /// States of the rig.
    States,
    /// Shapes of the head.
    Shapes,
    /// Wrinkle zones of the head.
    Zones,
}

impl Group {
    /// All, in the order of the panel.
    pub const ALL: [Self; 4] = [Self::Expressions, Self::States, Self::Shapes, Self::Zones];

    /// Its heading.
    pub fn heading(self) -> &'static str {
        match self {
            Self::Expressions => "Expressions",
            Self::States => "States",
            Self::Shapes => "Shapes",
            Self::Zones => "Wrinkle zones",
        }
    }

    /// The word for one of it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Expressions => "expression",
            Self::States => "state",
            Self::Shapes => "shape",
            Self::Zones => "zone",
        }
    }

    /// Its field in a sequence; zones have none.
    pub fn field(self) -> Option<&'static str> {
        match self {
            Self::Expressions => Some("expressions"),
            Self::States => Some("states"),
            Self::Shapes => Some("shapes"),
            Self::Zones => None,
        }
    }
}

impl Pose {
    /// Weights of a group.
    pub fn of(&self, group: Group) -> &BTreeMap<String, f32> {
        match group {
            Group::Expressions => &self.expressions,
            Group::States => &self.states,
            Group::Shapes => &self.shapes,
            Group::Zones => &self.zones,
        }
    }

    /// Weights of a group, to change.
    pub fn of_mut(&mut self, group: Group) -> &mut BTreeMap<String, f32> {
        match group {
            Group::Expressions => &mut self.expressions,
            Group::States => &mut self.states,
            Group::Shapes => &mut self.shapes,
            Group::Zones => &mut self.zones,
        }
    }

    /// Whether nothing is held.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Number of weights.
    pub fn len(&self) -> usize {
        Group::ALL.iter().map(|g| self.of(*g).len()).sum::<usize>() + usize::from(self.head_degrees.is_some())
    }

    /// Puts constants in place of tracks. `shapes` resolves the names of the head that the sequence is for.
    pub fn apply(&self, sequence: &mut Sequence, shapes: &Resolver) {
        for (name, weight) in &self.expressions {
            sequence.expressions.insert(name.clone(), Track::Constant(*weight));
        }
        for (name, weight) in &self.states {
            sequence.states.insert(name.clone(), Track::Constant(*weight));
        }
        if !self.shapes.is_empty() {
            self.apply_shapes(sequence, shapes);
        }
        if let Some(degrees) = self.head_degrees {
            let [yaw, pitch, roll] = degrees.map(Track::Constant);
            sequence.head.yaw_degrees = yaw;
            sequence.head.pitch_degrees = pitch;
            sequence.head.roll_degrees = roll;
        }
    }

    /// A held shape loses what every track gives it. A track that moves others too is divided among them.
    fn apply_shapes(&self, sequence: &mut Sequence, shapes: &Resolver) {
        let names: Vec<&str> = shapes.names().collect();
        let held = |index: u32| names.get(index as usize).is_some_and(|n| self.shapes.contains_key(*n));
        let mut kept = BTreeMap::new();
        let mut divided: Vec<(String, Track<f32>)> = Vec::new();
        for (written, track) in std::mem::take(&mut sequence.shapes) {
            let targets = shapes.resolve(&written);
            if !targets.iter().any(|t| held(t.index)) {
                kept.insert(written, track);
                continue;
            }
            for target in targets.iter().filter(|t| !held(t.index)) {
                if let Some(name) = names.get(target.index as usize) {
                    divided.push(((*name).to_owned(), scaled(&track, target.factor)));
                }
            }
        }
        for (name, track) in divided {
            // Two tracks of one shape in two spellings add up; under one name only constants can be added here.
            let sum = match (kept.remove(&name), track) {
                (None, track) => track,
                (Some(Track::Constant(a)), Track::Constant(b)) => Track::Constant(a + b),
                (Some(first), second) => added(&first, &second),
            };
            kept.insert(name, sum);
        }
        for (name, weight) in &self.shapes {
            kept.insert(name.clone(), Track::Constant(*weight));
        }
        sequence.shapes = kept;
    }
}

fn scaled(track: &Track<f32>, factor: f32) -> Track<f32> {
    let mut track = track.clone();
    match &mut track {
        Track::Constant(value) => *value *= factor,
        Track::Keys(keys) => keys.iter_mut().for_each(|k| k.v *= factor),
    }
    track
}

/// The sum of two tracks at the keys of both: exact there, linear between.
fn added(a: &Track<f32>, b: &Track<f32>) -> Track<f32> {
    let times = |track: &Track<f32>| match track {
        Track::Constant(_) => Vec::new(),
        Track::Keys(keys) => keys.iter().map(|k| k.t).collect::<Vec<f64>>(),
    };
    let mut all = [times(a), times(b)].concat();
    all.sort_by(f64::total_cmp);
    all.dedup();
    let key = |t: &f64| rubor_rig::timeline::Key { t: *t, v: a.at(*t) + b.at(*t), ease: Default::default() };
    Track::Keys(all.iter().map(key).collect())
}

/// What single tracks give each shape of a head at a time.
pub fn shape_weights(sequence: &Sequence, head: &Head, shapes: &Resolver, time_s: f64) -> Vec<f32> {
    let mut sums = vec![0.0; head.shapes.len()];
    for (name, track) in &sequence.shapes {
        let weight = track.at(time_s);
        for target in shapes.resolve(name) {
            if let Some(sum) = sums.get_mut(target.index as usize) {
                *sum += weight * target.factor;
            }
        }
    }
    sums
}

/// The other half of each name that has one, by index.
pub fn pairs<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<Option<usize>> {
    let keys: Vec<NameKey> = names.into_iter().map(NameKey::new).collect();
    let other = |key: &NameKey| {
        let side = match key.side? {
            Side::Left => Side::Right,
            Side::Right => Side::Left,
        };
        // The whole jaw and the whole mouth move to a side: no halves.
        if key.base == "jaw" || key.base == "mouth" {
            return None;
        }
        keys.iter().position(|k| k.base == key.base && k.side == Some(side))
    };
    keys.iter().map(other).collect()
}

#[cfg(test)]
mod tests {
    use rubor_rig::timeline::Key;

    use super::*;

    #[test]
    fn a_held_half_leaves_the_other_half_of_its_track() {
        let names = ["eyeBlinkLeft", "eyeBlinkRight", "jawOpen"];
        let shapes = Resolver::new(names);
        let key = |t, v| Key { t, v, ease: Default::default() };
        let mut sequence = Sequence::still(24.0, 1.0);
        sequence.shapes.insert("eyeBlink".into(), Track::Keys(vec![key(0.0, 0.0), key(1.0, 1.0)]));
        sequence.shapes.insert("eyeBlink_R".into(), Track::Constant(0.25));
        let mut pose = Pose::default();
        pose.shapes.insert("eyeBlinkLeft".into(), 0.6);
        pose.apply(&mut sequence, &shapes);
        let head = Head {
            shapes: names
                .map(|n| rubor_rig::head::BlendShape { name: n.into(), ..Default::default() })
                .to_vec(),
            ..Head::default()
        };
        for (t, right) in [(0.0, 0.25), (0.5, 0.75), (1.0, 1.25)] {
            assert_eq!(shape_weights(&sequence, &head, &shapes, t), [0.6, right, 0.0], "{t}");
        }
    }

    #[test]
    fn halves_know_each_other() {
        let names = ["browInnerUp", "eyeBlink_L", "jawLeft", "eyeBlink_R", "jawRight"];
        assert_eq!(pairs(names), [None, Some(3), None, Some(1), None]);
    }
}
