//! A rig on a head: every name resolved to indices once, then weights to [`FaceState`] without a look-up.
//!
//! ```text
//! Weights (expressions, states, single shapes)
//!   --sum-->  shapes --limits--> combinations --limits--> in-betweens --limits--> FaceState.shapes
//!   --sum-->  zones --clamp 0..1------------------------------------------> FaceState.zones
//!   --sum-->  distributions --if over 1: divided by the sum---------------> FaceState.distributions
//!   1 + sum of weight (scale - 1), at least 0 ----------------------------> FaceState.hemoglobin_scale
//! ```
//!
//! Limits: a weight is clamped to 0..1 where expressions, states, combinations and in-betweens add up. A track of a
//! single shape is used as authored, also below 0 and above 1, as glTF allows: the limits of that shape are widened to
//! its track. Combinations read their drivers clamped to 0..1; in-betweens extrapolate their first and last segment.
//!
//! Source: zones from Jimenez 2012 section 8.2 (negative weights, clamped sum), distributions from eq. 7.6 (weights sum to
//! one with the neutral), global scale from section 7.7. Ours: how several distributions share when they ask for more
//! than one together (in proportion, nothing left for the neutral), and that global scales add their differences from 1,
//! so that the order of expressions does not matter and half an expression has half its effect.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use crate::error::{Note, RigError};
use crate::expression::{CombinationMode, Rig};
use crate::face_state::FaceState;
use crate::head::Head;
use crate::json::{Source, Step, steps};
use crate::names::{self, Resolver, Target};

/// Weights of everything that a rig can do, in the order of [`BoundRig`]'s names.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// One per expression, 0 to 2.
    pub expressions: Vec<f32>,
    /// One per state, 0 to 2.
    pub states: Vec<f32>,
    /// One per shape of the head, added to the effect of the expressions. Any finite number: the sum is clamped to 0..1
    /// only as far as this weight itself lies there.
    pub shapes: Vec<f32>,
}

/// Range to which the weight of a shape is clamped: 0..1, widened to the authored weights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    low: f32,
    high: f32,
}

impl Default for Limits {
    fn default() -> Self {
        Self { low: 0.0, high: 1.0 }
    }
}

impl Limits {
    pub(crate) fn include(&mut self, authored: f32) {
        self.low = self.low.min(authored);
        self.high = self.high.max(authored);
    }

    pub(crate) fn hold(self, weight: f32) -> f32 {
        weight.clamp(self.low, self.high)
    }
}

/// A rig whose names are indices into one head.
#[derive(Clone, Debug)]
pub struct BoundRig {
    expressions: Vec<(String, Effect)>,
    states: Vec<(String, Effect)>,
    /// Indices by name.
    expression_of_name: HashMap<String, usize>,
    state_of_name: HashMap<String, usize>,
    combinations: Vec<BoundCombination>,
    inbetweens: Vec<Inbetweens>,
    shape_count: usize,
    zone_count: usize,
    distribution_count: usize,
}

/// What one expression or state does at weight 1.
#[derive(Clone, Debug, Default)]
struct Effect {
    shapes: Vec<(u32, f32)>,
    zones: Vec<(u32, f32)>,
    distributions: Vec<(u32, f32)>,
    /// `hemoglobin_scale - 1`.
    scale_change: f32,
}

#[derive(Clone, Debug)]
struct BoundCombination {
    shapes: Vec<Target>,
    drivers: Vec<u32>,
    mode: CombinationMode,
}

/// The path of one shape: in-between targets by rising weight, then the shape itself at 1.
#[derive(Clone, Debug)]
struct Inbetweens {
    shape: u32,
    stops: Vec<(f32, u32)>,
}

impl BoundRig {
    /// Resolves a rig. Names that the head lacks are left out, each with a note.
    ///
    /// # Errors
    /// A rig that [`Rig::check`] refuses, or a shape name that neither rubor nor the head knows.
    pub fn new(head: &Head, rig: &Rig) -> Result<(Self, Vec<Note>), RigError> {
        rig.check()?;
        let mut binder = Binder::new(head, &rig.source);
        let mut expressions = Vec::new();
        for (name, expression) in &rig.expressions {
            let at = steps!["expressions", name];
            let effect = Effect {
                shapes: binder.shapes(&[&at, &steps!["shapes"][..]].concat(), &expression.shapes)?,
                zones: binder.zones(&[&at, &steps!["wrinkles"][..]].concat(), &expression.wrinkles),
                distributions: binder
                    .distributions(&[&at, &steps!["hemoglobin"][..]].concat(), &expression.hemoglobin),
                scale_change: expression.hemoglobin_scale - 1.0,
            };
            expressions.push((name.clone(), effect));
        }
        let mut states = Vec::new();
        for (name, state) in &rig.states {
            let complete = state.hemoglobin.keys().all(|d| !binder.distributions.resolve(d).is_empty());
            let effect = match &state.fallback {
                Some(fallback) if !complete => Effect {
                    distributions: binder.distributions(
                        &steps!["states", name, "fallback", "hemoglobin"],
                        &fallback.hemoglobin,
                    ),
                    scale_change: fallback.hemoglobin_scale - 1.0,
                    ..Effect::default()
                },
                _ => Effect {
                    distributions: binder
                        .distributions(&steps!["states", name, "hemoglobin"], &state.hemoglobin),
                    scale_change: state.hemoglobin_scale - 1.0,
                    ..Effect::default()
                },
            };
            states.push((name.clone(), effect));
        }
        let combinations = binder.combinations(rig)?;
        let inbetweens = binder.inbetweens(rig)?;
        let by_name = |list: &[(String, Effect)]| {
            list.iter().enumerate().map(|(i, (name, _))| (name.clone(), i)).collect()
        };
        let bound = Self {
            expression_of_name: by_name(&expressions),
            state_of_name: by_name(&states),
            expressions,
            states,
            combinations,
            inbetweens,
            shape_count: head.shapes.len(),
            zone_count: head.maps.zones.len(),
            distribution_count: head.maps.distributions.len(),
        };
        Ok((bound, binder.notes))
    }

    /// Names of the expressions, in the order of [`Weights::expressions`].
    pub fn expression_names(&self) -> impl Iterator<Item = &str> {
        self.expressions.iter().map(|(name, _)| name.as_str())
    }

    /// Names of the states, in the order of [`Weights::states`].
    pub fn state_names(&self) -> impl Iterator<Item = &str> {
        self.states.iter().map(|(name, _)| name.as_str())
    }

    /// Index of an expression in [`Weights::expressions`].
    pub fn expression_index(&self, name: &str) -> Option<usize> {
        self.expression_of_name.get(name).copied()
    }

    /// Index of a state in [`Weights::states`].
    pub fn state_index(&self, name: &str) -> Option<usize> {
        self.state_of_name.get(name).copied()
    }

    /// Weights of the neutral face.
    pub fn neutral_weights(&self) -> Weights {
        Weights {
            expressions: vec![0.0; self.expressions.len()],
            states: vec![0.0; self.states.len()],
            shapes: vec![0.0; self.shape_count],
        }
    }

    /// The face at these weights; the head itself does not move. Missing weights count as 0.
    pub fn face(&self, weights: &Weights) -> FaceState {
        let expressions = self.expressions.iter().zip(&weights.expressions);
        let states = self.states.iter().zip(&weights.states);
        let effects = expressions.chain(states).map(|((_, effect), weight)| (effect, *weight));
        self.face_of(effects, &weights.shapes)
    }

    /// The face with one expression at 1 and nothing else, at a cost that does not grow with the number of expressions.
    pub fn face_of_expression(&self, index: usize) -> FaceState {
        self.face_of(self.expressions.get(index).map(|(_, effect)| (effect, 1.0)).into_iter(), &[])
    }

    /// As [`BoundRig::face_of_expression`], of a state.
    pub fn face_of_state(&self, index: usize) -> FaceState {
        self.face_of(self.states.get(index).map(|(_, effect)| (effect, 1.0)).into_iter(), &[])
    }

    fn face_of<'a>(&self, effects: impl Iterator<Item = (&'a Effect, f32)>, authored: &[f32]) -> FaceState {
        let mut shapes = vec![0.0; self.shape_count];
        let mut zones = vec![0.0; self.zone_count];
        let mut distributions = vec![0.0; self.distribution_count];
        let mut scale = 1.0;
        for (effect, weight) in effects {
            if weight == 0.0 {
                continue;
            }
            add(&mut shapes, &effect.shapes, weight);
            add(&mut zones, &effect.zones, weight);
            add(&mut distributions, &effect.distributions, weight);
            scale += weight * effect.scale_change;
        }
        let mut limits = vec![Limits::default(); self.shape_count];
        for (limits, direct) in limits.iter_mut().zip(authored) {
            limits.include(*direct);
        }
        for (i, (sum, limits)) in shapes.iter_mut().zip(&limits).enumerate() {
            *sum = limits.hold(*sum + authored.get(i).copied().unwrap_or_default());
        }
        for combination in &self.combinations {
            let drivers = combination.drivers.iter().map(|d| shapes[*d as usize].clamp(0.0, 1.0));
            let weight = match combination.mode {
                CombinationMode::Product => drivers.product(),
                CombinationMode::Min => drivers.fold(1.0, f32::min),
            };
            for target in &combination.shapes {
                let shape = &mut shapes[target.index as usize];
                *shape = limits[target.index as usize].hold(*shape + weight * target.factor);
            }
        }
        let driven = shapes.clone();
        for inbetweens in &self.inbetweens {
            inbetweens.distribute(driven[inbetweens.shape as usize], &mut shapes, &mut limits);
        }
        for (shape, limits) in shapes.iter_mut().zip(&limits) {
            *shape = limits.hold(*shape);
        }
        for zone in &mut zones {
            *zone = zone.clamp(0.0, 1.0);
        }
        let sum: f32 = distributions.iter().sum();
        if sum > 1.0 {
            for distribution in &mut distributions {
                *distribution /= sum;
            }
        }
        FaceState {
            shapes,
            zones,
            distributions,
            hemoglobin_scale: scale.max(0.0),
            pupil_mm: crate::life::CALM_PUPIL_MM,
            head_rotation: glam::Quat::IDENTITY,
            head_translation: glam::Vec3::ZERO,
        }
    }
}

fn add(sums: &mut [f32], effects: &[(u32, f32)], weight: f32) {
    for (index, effect) in effects {
        sums[*index as usize] += weight * effect;
    }
}

impl Inbetweens {
    /// Shares the weight of a shape between the two stops around it. The rest shape stands at 0, the shape at 1; beyond
    /// them the first and the last segment are extrapolated.
    fn distribute(&self, weight: f32, shapes: &mut [f32], limits: &mut [Limits]) {
        // Subtracts only this weight, so that a target which is also driven directly keeps its own.
        shapes[self.shape as usize] -= weight;
        let beyond = !(0.0..=1.0).contains(&weight);
        let mut give = |shape: u32, share: f32| {
            shapes[shape as usize] += share;
            if beyond {
                limits[shape as usize].include(shapes[shape as usize]);
            }
        };
        let above = self.stops.partition_point(|(at, _)| *at <= weight).min(self.stops.len() - 1);
        let (high, high_shape) = self.stops[above];
        let (low, low_shape) =
            above.checked_sub(1).map_or((0.0, None), |i| (self.stops[i].0, Some(self.stops[i].1)));
        let share = (weight - low) / (high - low);
        give(high_shape, share);
        if let Some(low_shape) = low_shape {
            give(low_shape, 1.0 - share);
        }
    }
}

/// Resolves names and collects one note per missing name.
pub(crate) struct Binder<'a> {
    pub(crate) notes: Vec<Note>,
    source: &'a Source,
    shapes: Resolver,
    zones: Arc<Resolver>,
    distributions: Arc<Resolver>,
    noted: BTreeSet<(&'static str, String)>,
}

impl<'a> Binder<'a> {
    pub(crate) fn new(head: &Head, source: &'a Source) -> Self {
        Self {
            notes: Vec::new(),
            source,
            shapes: Resolver::shapes(head),
            zones: Arc::new(Resolver::zones(head)),
            distributions: Arc::new(Resolver::distributions(head)),
            noted: BTreeSet::new(),
        }
    }

    /// Targets of a shape name. `at_key`: the name is the last key of the path, not the value at it.
    pub(crate) fn shape(&mut self, name: &str, at: &[Step], at_key: bool) -> Result<Vec<Target>, RigError> {
        let targets = self.shapes.resolve(name);
        if targets.is_empty() {
            let place = || if at_key { self.source.place_of_key(at) } else { self.source.place_of_value(at) };
            if !names::is_known_shape(name) {
                return Err(RigError {
                    place: place(),
                    found: format!("the unknown shape {name:?}"),
                    expected: "a shape of the head or an ARKit name".into(),
                    nearest: self.nearest_shape(name),
                });
            }
            if self.noted.insert(("shape", name.to_owned())) {
                let message = format!("the head has no shape {name:?}: it has no effect");
                let subject = Some(name.to_owned());
                self.notes.push(Note { place: place(), message, subject, nearest: None });
            }
        }
        Ok(targets)
    }

    fn nearest_shape(&self, name: &str) -> Option<String> {
        let of_head = self.shapes.names().map(str::to_owned);
        let known: Vec<String> = of_head.chain(names::vocabulary().map(str::to_owned)).collect();
        names::nearest(name, known.iter().map(String::as_str))
    }

    fn shapes(&mut self, at: &[Step], weights: &BTreeMap<String, f32>) -> Result<Vec<(u32, f32)>, RigError> {
        let mut effects = Vec::new();
        for (name, weight) in weights {
            let inner = [at, &steps![name]].concat();
            for target in self.shape(name, &inner, true)? {
                effects.push((target.index, weight * target.factor));
            }
        }
        Ok(effects)
    }

    fn zones(&mut self, at: &[Step], weights: &BTreeMap<String, f32>) -> Vec<(u32, f32)> {
        let resolver = self.zones.clone();
        self.optional("wrinkle zone", &resolver, at, weights)
    }

    fn distributions(&mut self, at: &[Step], weights: &BTreeMap<String, f32>) -> Vec<(u32, f32)> {
        let resolver = self.distributions.clone();
        self.optional("hemoglobin distribution", &resolver, at, weights)
    }

    fn optional(
        &mut self,
        kind: &'static str,
        resolver: &Resolver,
        at: &[Step],
        weights: &BTreeMap<String, f32>,
    ) -> Vec<(u32, f32)> {
        let mut effects = Vec::new();
        for (name, weight) in weights {
            let targets = resolver.resolve(name);
            if targets.is_empty() {
                self.note_missing(kind, name, resolver, &[at, &steps![name]].concat());
            }
            effects.extend(targets.iter().map(|t| (t.index, weight * t.factor)));
        }
        effects
    }

    fn note_missing(&mut self, kind: &'static str, name: &str, resolver: &Resolver, at: &[Step]) {
        // One note is enough for a head that has none of the kind.
        let (name, message) = if resolver.is_empty() {
            (String::new(), format!("the head has no {kind}s: none of the rig's has an effect"))
        } else {
            (name.to_owned(), format!("the head has no {kind} {name:?}: it has no effect"))
        };
        if self.noted.insert((kind, name.clone())) {
            let nearest = names::nearest(&name, resolver.names());
            let subject = Some(name).filter(|n| !n.is_empty());
            self.notes.push(Note { place: self.source.place_of_key(at), message, subject, nearest });
        }
    }

    fn combinations(&mut self, rig: &Rig) -> Result<Vec<BoundCombination>, RigError> {
        let mut bound = Vec::new();
        for (i, combination) in rig.combinations.iter().enumerate() {
            let shapes = self.shape(&combination.shape, &steps!["combinations", i, "shape"], false)?;
            let mut drivers = Vec::new();
            let mut complete = true;
            for (j, driver) in combination.drivers.iter().enumerate() {
                let targets = self.shape(driver, &steps!["combinations", i, "drivers", j], false)?;
                complete &= !targets.is_empty();
                drivers.extend(targets.iter().map(|t| t.index));
            }
            drivers.sort_unstable();
            drivers.dedup();
            if complete && !shapes.is_empty() {
                bound.push(BoundCombination { shapes, drivers, mode: combination.mode });
            }
        }
        Ok(bound)
    }

    fn inbetweens(&mut self, rig: &Rig) -> Result<Vec<Inbetweens>, RigError> {
        let mut stops: BTreeMap<u32, Vec<(f32, u32)>> = BTreeMap::new();
        for (i, inbetween) in rig.inbetweens.iter().enumerate() {
            let shapes = self.shape(&inbetween.shape, &steps!["inbetweens", i, "shape"], false)?;
            let targets = self.shape(&inbetween.target, &steps!["inbetweens", i, "target"], false)?;
            if shapes.is_empty() || targets.is_empty() {
                continue;
            }
            let pairs: Vec<_> = shapes.iter().zip(&targets).collect();
            // Where the head has only the undivided shape, a half of it has no path of its own.
            let halves = pairs.iter().any(|(shape, target)| shape.factor != 1.0 || target.factor != 1.0);
            if shapes.len() != targets.len() || halves {
                return Err(RigError {
                    place: self.source.place_of_value(&steps!["inbetweens", i, "target"]),
                    found: format!("{:?} for {:?}", inbetween.target, inbetween.shape),
                    expected: "as many shapes of the head for the target as for the shape".into(),
                    nearest: None,
                });
            }
            for (shape, target) in pairs {
                stops.entry(shape.index).or_default().push((inbetween.weight, target.index));
            }
        }
        Ok(stops
            .into_iter()
            .map(|(shape, mut stops)| {
                stops.sort_by(|a, b| a.0.total_cmp(&b.0));
                stops.push((1.0, shape));
                Inbetweens { shape, stops }
            })
            .collect())
    }
}
