//! Measures heads with less against the whole head.
//!
//! ```text
//! Reduction --names--> rig, weights of what is left --spread--> face of the head on the device
//!           \--parts, maps, hairs--> another head on the device, where these differ from the last one
//! face, head --draw--> picture --FLIP over the head--> error of a frame
//! ```
//!
//! Shapes, zones and distributions that go are weights of 0 on the head that is there already: nothing is uploaded for them, and
//! a frame whose face stays as it was needs no picture.

use rubor_renderer::settings::{RasterMethod, Settings};
use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::expression::Rig;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::Head;
use rubor_rig::reduce::Reduction;
use rubor_rig::timeline::Sequence;

use super::looks::Look;
use super::needed_names;
use crate::error::Outcome;
use crate::measure::chart::{Measure, Scene, Truth, draw};
use crate::report::BudgetError;
use crate::studio::Studio;

/// The whole head before a device, with the right pictures of all looks.
pub(super) struct Trials<'a> {
    pub(super) studio: &'a mut Studio,
    pub(super) head: &'a Head,
    pub(super) rig: &'a Rig,
    pub(super) sequences: &'a [Sequence],
    pub(super) looks: &'a [Look],
    /// Settings of each sequence.
    settings: Vec<Settings>,
    truths: Vec<Truth>,
    /// What the head on the device lacks.
    lacks: Reduction,
    /// Errors of faces that were drawn of it, for each look.
    known: Vec<Vec<(FaceState, f64)>>,
    /// Bytes of the whole head on the device, and its hairs.
    pub(super) device_bytes: u64,
    pub(super) hairs: u32,
    /// Pictures that were drawn.
    pub(super) drawn: usize,
}

/// Errors of looks, in their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Errors {
    pub(super) each: Vec<f64>,
    /// Not all looks have one: one of them was beyond what is allowed.
    is_part: bool,
}

impl Errors {
    pub(super) fn largest(&self) -> f64 {
        self.each.iter().copied().fold(0.0, f64::max)
    }

    /// The look with the largest one.
    pub(super) fn worst(&self) -> usize {
        (0..self.each.len()).rev().max_by(|a, b| self.each[*a].total_cmp(&self.each[*b])).unwrap_or(0)
    }

    pub(super) fn summed(&self) -> BudgetError {
        let mean = self.each.iter().sum::<f64>() / self.each.len().max(1) as f64;
        BudgetError { largest: self.largest(), mean, is_least: self.is_part }
    }
}

impl<'a> Trials<'a> {
    /// Draws the right pictures.
    pub(super) fn new(
        studio: &'a mut Studio,
        head: &'a Head,
        rig: &'a Rig,
        sequences: &'a [Sequence],
        looks: &'a [Look],
        settings: Vec<Settings>,
    ) -> Outcome<Self> {
        // What turns triangles into pixels may be chosen anew with each head, and rounds edges in its own way.
        let exact = |mut settings: Settings| {
            if settings.quality.raster == RasterMethod::Auto {
                settings.quality.raster = RasterMethod::Hardware;
            }
            settings
        };
        let settings: Vec<Settings> = settings.into_iter().map(exact).collect();
        studio.set_heads([head])?;
        let mut truths = Vec::new();
        for look in looks {
            let of = &settings[look.sequence];
            truths.push(Truth::draw(studio, &Scene::of("", look.shot.clone()), of, Measure::Picture, of)?);
        }
        let (device_bytes, hairs) = (studio.head_bytes(), studio.hairs());
        let known = looks.iter().map(|look| vec![(look.shot.face.clone(), 0.0)]).collect();
        let lacks = Reduction::default();
        Ok(Self {
            studio,
            head,
            rig,
            sequences,
            looks,
            settings,
            truths,
            lacks,
            known,
            device_bytes,
            hairs,
            drawn: 0,
        })
    }

    /// Faces of all looks of the head with less, by the numbers of the whole head.
    pub(super) fn faces(&self, less: &Reduction) -> Outcome<Vec<FaceState>> {
        let names = less.names_alone(self.head);
        let (rig, _) = less.rig(self.head, self.rig, &needed_names(self.sequences));
        let evaluators: Vec<Evaluator> = (self.sequences.iter())
            .map(|sequence| Ok(Evaluator::new(&names, &rig, sequence)?.0))
            .collect::<Outcome<_>>()?;
        let face =
            |look: &Look| spread(less, &look.shot.face, &evaluators[look.sequence].face_at(look.shot.time_s));
        Ok(self.looks.iter().map(face).collect())
    }

    /// Error of the head with less. Stops at a look whose error is beyond `most`.
    pub(super) fn error(&mut self, less: &Reduction, most: f64) -> Outcome<Errors> {
        let faces = self.faces(less)?;
        self.put(less)?;
        let mut errors = Errors::default();
        for (i, face) in faces.into_iter().enumerate() {
            let known = self.known[i].iter().find(|(known, _)| *known == face).map(|(_, error)| *error);
            let error = match known {
                Some(error) => error,
                None => {
                    let look = &self.looks[i];
                    let shot = Shot { face: face.clone(), ..look.shot.clone() };
                    let error = self.draw(i, &shot)?;
                    self.known[i].push((face, error));
                    error
                }
            };
            errors.each.push(error);
            if error > most {
                errors.is_part = errors.each.len() < self.looks.len();
                break;
            }
        }
        Ok(errors)
    }

    /// Error of another head with its own rig, such as one from a file. Stays on the device.
    pub(super) fn error_of(&mut self, head: &Head, rig: &Rig) -> Outcome<Errors> {
        let shots = shots(head, rig, self.sequences, self.looks)?;
        self.studio.set_heads([head])?;
        // Nothing is known of this head, and the next trial needs its own.
        self.known.iter_mut().for_each(Vec::clear);
        self.lacks = Reduction { hairs: Some(u32::MAX), ..Reduction::default() };
        let mut errors = Errors::default();
        for (i, shot) in shots.iter().enumerate() {
            errors.each.push(self.draw(i, shot)?);
        }
        Ok(errors)
    }

    /// Bytes on the device that the head with less saves by what is drawn from other buffers and textures.
    pub(super) fn saves(&mut self, less: &Reduction) -> Outcome<u64> {
        self.put(less)?;
        Ok(self.device_bytes.saturating_sub(self.studio.head_bytes()))
    }

    /// Puts the head onto the device, with all that only weights decide.
    fn put(&mut self, less: &Reduction) -> Outcome {
        let lacks = less.without_weights();
        if lacks != self.lacks {
            match lacks.is_empty() {
                true => self.studio.set_heads([self.head])?,
                false => self.studio.set_heads([&lacks.head(self.head)])?,
            }
            self.known.iter_mut().for_each(Vec::clear);
            self.lacks = lacks;
        }
        Ok(())
    }

    fn draw(&mut self, look: usize, shot: &Shot) -> Outcome<f64> {
        let settings = &self.settings[self.looks[look].sequence];
        let drawn = draw(self.studio, &Scene::of("", shot.clone()), settings, false)?;
        self.drawn += 1;
        Ok(self.truths[look].error(&drawn).0.flip_mean)
    }
}

/// What another head shows at all looks.
pub(super) fn shots(head: &Head, rig: &Rig, sequences: &[Sequence], looks: &[Look]) -> Outcome<Vec<Shot>> {
    let evaluators: Vec<Evaluator> = (sequences.iter())
        .map(|sequence| Ok(Evaluator::new(head, rig, sequence)?.0))
        .collect::<Outcome<_>>()?;
    Ok(looks.iter().map(|look| evaluators[look.sequence].at(look.shot.time_s)).collect())
}

/// A face of a head with less by the numbers of the whole head: what went has the weight 0.
fn spread(less: &Reduction, whole: &FaceState, face: &FaceState) -> FaceState {
    let of = |count: usize, gone: &std::collections::BTreeSet<usize>, left: &[f32]| -> Vec<f32> {
        let mut left = left.iter();
        (0..count)
            .map(|i| if gone.contains(&i) { 0.0 } else { left.next().copied().unwrap_or(0.0) })
            .collect()
    };
    FaceState {
        shapes: of(whole.shapes.len(), &less.shapes, &face.shapes),
        zones: of(whole.zones.len(), &less.zones, &face.zones),
        distributions: of(whole.distributions.len(), &less.distributions, &face.distributions),
        ..face.clone()
    }
}
