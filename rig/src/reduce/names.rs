//! Rigs and sequences on a head with less: names that mean what they meant on the whole head.

use std::collections::{BTreeMap, BTreeSet};

use super::{Reduction, kept};
use crate::evaluate::LIVING_SHAPES;
use crate::expression::{Combination, Expression, Fallback, Inbetween, Rig, State};
use crate::head::{BlendShape, Distribution, Head, SkinMaps, WrinkleZone};
use crate::json::Source;
use crate::map::Map;
use crate::names::{Resolver, Target, is_known_shape};
use crate::timeline::Sequence;

/// What a rig lost with a head.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RigLoss {
    /// Expressions and states that have nothing left and went.
    pub emptied: Vec<String>,
    /// Those that have nothing left and stay, since sequences name them.
    pub empty: Vec<String>,
    /// Those that have lost something.
    pub lessened: Vec<String>,
    /// Combination shapes that went: their shapes.
    pub combinations: Vec<String>,
    /// In-betweens that went: shape and target.
    pub inbetweens: Vec<(String, String)>,
}

/// Names of one kind before and after.
struct Names {
    whole: Resolver,
    left: Resolver,
    /// New number of each.
    numbers: Vec<Option<u32>>,
    names: Vec<String>,
}

/// What becomes of a name.
enum Becomes {
    /// It means what it meant, less what went.
    Same,
    /// All that it meant went, or it would mean something else.
    Gone,
    /// What is left of its meaning, by exact names with factors.
    Others(Vec<(String, f32)>),
}

impl Names {
    fn of<'a>(names: impl Iterator<Item = &'a str> + Clone, gone: &BTreeSet<usize>) -> Self {
        let all: Vec<String> = names.clone().map(str::to_owned).collect();
        let mut numbers = vec![None; all.len()];
        for (new, old) in kept(all.len(), gone).enumerate() {
            numbers[old] = Some(new as u32);
        }
        let left = names.enumerate().filter(|(i, _)| !gone.contains(i)).map(|(_, name)| name);
        Self {
            left: Resolver::new(left),
            whole: Resolver::new(all.iter().map(String::as_str)),
            numbers,
            names: all,
        }
    }

    /// What the name meant on the whole head, and what is left of that by new numbers.
    fn targets(&self, name: &str) -> (Vec<Target>, Vec<Target>) {
        let whole = self.whole.resolve(name);
        let number = |t: &Target| Some(Target { index: self.numbers[t.index as usize]?, ..*t });
        let left = whole.iter().filter_map(number).collect();
        (whole, left)
    }

    fn becomes(&self, name: &str) -> Becomes {
        let (whole, left) = self.targets(name);
        let now = self.left.resolve(name);
        match (whole.is_empty(), left.is_empty()) {
            // The head never had it.
            (true, _) if now.is_empty() => Becomes::Same,
            (true, _) | (false, true) => Becomes::Gone,
            (false, false) if now == left => Becomes::Same,
            (false, false) => {
                let stays = whole.iter().filter(|t| self.numbers[t.index as usize].is_some());
                Becomes::Others(stays.map(|t| (self.names[t.index as usize].clone(), t.factor)).collect())
            }
        }
    }

    /// Weights by the names that are left; whether any went.
    fn weights(&self, weights: &BTreeMap<String, f32>) -> (BTreeMap<String, f32>, bool) {
        let mut left = BTreeMap::new();
        let mut is_less = false;
        for (name, weight) in weights {
            let (whole, kept) = self.targets(name);
            is_less |= kept.len() < whole.len();
            match self.becomes(name) {
                Becomes::Same => *left.entry(name.clone()).or_insert(0.0) += weight,
                Becomes::Gone => {}
                Becomes::Others(others) => {
                    for (other, factor) in others {
                        *left.entry(other).or_insert(0.0) += weight * factor;
                    }
                }
            }
        }
        (left, is_less)
    }

    /// Whether a head has what the names of all weights mean.
    fn has_all(&self, weights: &BTreeMap<String, f32>) -> bool {
        weights.keys().all(|name| !self.whole.resolve(name).is_empty())
    }
}

impl Reduction {
    fn shape_names(&self, head: &Head) -> Names {
        Names::of(head.shapes.iter().map(|s| s.name.as_str()), &self.shapes)
    }

    /// A head of the names that are left, without geometry and maps: enough for [`crate::bind::BoundRig`], and for the faces of
    /// [`crate::evaluate::Evaluator`].
    pub fn names_alone(&self, head: &Head) -> Head {
        let texel = || Map::filled(1, 1, &[0.0]);
        let maps = &head.maps;
        Head {
            name: head.name.clone(),
            shapes: kept(head.shapes.len(), &self.shapes)
                .map(|i| BlendShape { name: head.shapes[i].name.clone(), ..BlendShape::default() })
                .collect(),
            maps: SkinMaps {
                distributions: kept(maps.distributions.len(), &self.distributions)
                    .map(|i| Distribution {
                        name: maps.distributions[i].name.clone(),
                        scale: texel(),
                        bias: texel(),
                    })
                    .collect(),
                zones: kept(maps.zones.len(), &self.zones)
                    .map(|i| WrinkleZone { name: maps.zones[i].name.clone(), wrinkle_map: 0, mask: texel() })
                    .collect(),
                ..SkinMaps::default()
            },
            landmarks: head.landmarks.clone(),
            ..Head::default()
        }
    }

    /// Shapes of those that are to go which have to stay: without them a name of a track, or of what moves eyes and lids by itself,
    /// would mean another shape, or nothing that is known.
    pub fn held(&self, head: &Head, sequence: &Sequence) -> BTreeSet<usize> {
        let names = self.shape_names(head);
        let living = (sequence.eyes.is_some() || sequence.life.is_some()).then_some(LIVING_SHAPES);
        let written = sequence.shapes.keys().map(String::as_str).chain(living.into_iter().flatten());
        let mut held = BTreeSet::new();
        for name in written {
            let (whole, left) = names.targets(name);
            let is_lost = left.is_empty() && !whole.is_empty() && !is_known_shape(name);
            if is_lost || names.left.resolve(name) != left {
                held.extend(whole.iter().map(|t| t.index as usize).filter(|i| self.shapes.contains(i)));
            }
        }
        held
    }

    /// The rig for the head with less. Expressions and states that lose everything go, but for those that `needed` names.
    pub fn rig(&self, head: &Head, rig: &Rig, needed: &BTreeSet<String>) -> (Rig, RigLoss) {
        let shapes = self.shape_names(head);
        let zones = Names::of(head.maps.zones.iter().map(|z| z.name.as_str()), &self.zones);
        let blood = Names::of(head.maps.distributions.iter().map(|d| d.name.as_str()), &self.distributions);
        let mut loss = RigLoss::default();
        let mut reduced = Rig {
            expressions: BTreeMap::new(),
            states: BTreeMap::new(),
            combinations: Vec::new(),
            inbetweens: Vec::new(),
            // Places in the text are those of the whole rig.
            source: Source::default(),
            ..rig.clone()
        };
        for (name, expression) in &rig.expressions {
            let (left_shapes, less_shapes) = shapes.weights(&expression.shapes);
            let (left_zones, less_zones) = zones.weights(&expression.wrinkles);
            let (left_blood, less_blood) = blood.weights(&expression.hemoglobin);
            let left = Expression {
                shapes: left_shapes,
                wrinkles: left_zones,
                hemoglobin: left_blood,
                hemoglobin_scale: expression.hemoglobin_scale,
            };
            let is_less = less_shapes || less_zones || less_blood;
            let is_empty = left == Expression::default();
            if loss.note(name, is_less, is_empty, needed) {
                reduced.expressions.insert(name.clone(), left);
            }
        }
        for (name, state) in &rig.states {
            let (left, is_less, is_empty) = of_state(state, &blood);
            if loss.note(name, is_less, is_empty, needed) {
                reduced.states.insert(name.clone(), left);
            }
        }
        for combination in &rig.combinations {
            let left = of_combination(combination, &shapes);
            if left.is_empty() {
                loss.combinations.push(combination.shape.clone());
            }
            reduced.combinations.extend(left);
        }
        for inbetween in &rig.inbetweens {
            let left = of_inbetween(inbetween, &shapes);
            if left.is_empty() {
                loss.inbetweens.push((inbetween.shape.clone(), inbetween.target.clone()));
            }
            reduced.inbetweens.extend(left);
        }
        (reduced, loss)
    }
}

impl RigLoss {
    /// Notes what became of an expression or a state; whether it stays.
    fn note(&mut self, name: &str, is_less: bool, is_empty: bool, needed: &BTreeSet<String>) -> bool {
        let list = match (is_less, is_empty, needed.contains(name)) {
            (false, ..) => return true,
            (true, false, _) => &mut self.lessened,
            (true, true, true) => &mut self.empty,
            (true, true, false) => &mut self.emptied,
        };
        list.push(name.to_owned());
        !(is_less && is_empty) || needed.contains(name)
    }
}

/// What is left of a state, whether that is less, and whether it is nothing.
fn of_state(state: &State, blood: &Names) -> (State, bool, bool) {
    // A head that lacks a distribution shows the fallback; so it has to, whatever goes.
    match &state.fallback {
        Some(fallback) if !blood.has_all(&state.hemoglobin) => {
            let (hemoglobin, is_less) = blood.weights(&fallback.hemoglobin);
            let is_empty = hemoglobin.is_empty() && fallback.hemoglobin_scale == 1.0;
            let fallback = Some(Fallback { hemoglobin, ..fallback.clone() });
            (State { fallback, ..state.clone() }, is_less, is_empty)
        }
        fallback => {
            let (hemoglobin, is_less) = blood.weights(&state.hemoglobin);
            let is_empty = hemoglobin.is_empty() && state.hemoglobin_scale == 1.0;
            let left = |f: &Fallback| Fallback { hemoglobin: blood.weights(&f.hemoglobin).0, ..f.clone() };
            (State { hemoglobin, fallback: fallback.as_ref().map(left), ..state.clone() }, is_less, is_empty)
        }
    }
}

/// What is left of a combination: without one of its drivers it never acts.
fn of_combination(combination: &Combination, shapes: &Names) -> Vec<Combination> {
    let mut drivers = Vec::new();
    for driver in &combination.drivers {
        let (whole, left) = shapes.targets(driver);
        if left.len() < whole.len() {
            return Vec::new();
        }
        match shapes.becomes(driver) {
            Becomes::Same => drivers.push(driver.clone()),
            Becomes::Gone => return Vec::new(),
            Becomes::Others(others) => drivers.extend(others.into_iter().map(|(name, _)| name)),
        }
    }
    let mut seen = BTreeSet::new();
    drivers.retain(|driver| seen.insert(driver.clone()));
    match shapes.becomes(&combination.shape) {
        Becomes::Same => vec![Combination { drivers, ..combination.clone() }],
        Becomes::Gone => Vec::new(),
        // A combination gives its shape all of its weight.
        Becomes::Others(others) => {
            (others.into_iter().filter(|(name, factor)| *factor == 1.0 && !seen.contains(name)))
                .map(|(shape, _)| Combination { shape, drivers: drivers.clone(), mode: combination.mode })
                .collect()
        }
    }
}

/// What is left of an in-between, pair by pair.
fn of_inbetween(inbetween: &Inbetween, shapes: &Names) -> Vec<Inbetween> {
    let ((whole, left), (whole_targets, left_targets)) =
        (shapes.targets(&inbetween.shape), shapes.targets(&inbetween.target));
    let is_same = |name| matches!(shapes.becomes(name), Becomes::Same);
    let is_whole = left.len() == whole.len() && left_targets.len() == whole_targets.len();
    if is_whole && is_same(&inbetween.shape) && is_same(&inbetween.target) {
        return vec![inbetween.clone()];
    }
    let stays = |t: &Target| shapes.numbers[t.index as usize].is_some();
    let name = |t: &Target| shapes.names[t.index as usize].clone();
    (whole.iter().zip(&whole_targets))
        .filter(|(shape, target)| stays(shape) && stays(target))
        .map(|(shape, target)| Inbetween { shape: name(shape), target: name(target), ..*inbetween })
        .collect()
}
