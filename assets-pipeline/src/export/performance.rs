//! A sequence on a head as curves.

use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;

use super::curves::{Breaks, Curve, fit};
use crate::error::ExportError;

/// A sequence and the rig that its expressions and states are looked up in.
#[derive(Clone, Copy, Debug)]
pub struct Performance<'a> {
    /// Expressions, states, combinations, in-betweens.
    pub rig: &'a Rig,
    /// The performance.
    pub sequence: &'a Sequence,
}

impl Performance<'_> {
    /// Resolves names; what has no effect on the head is noted.
    ///
    /// # Errors
    /// A rig or sequence that does not fit the head.
    pub fn evaluator(&self, head: &Head, notes: &mut Vec<String>) -> Result<Evaluator, ExportError> {
        let (evaluator, found) =
            Evaluator::new(head, self.rig, self.sequence).map_err(|e| ExportError::Content {
                at: "sequence".into(),
                found: e.to_string(),
                expected: "one for this head".into(),
            })?;
        notes.extend(found.iter().map(ToString::to_string));
        Ok(evaluator)
    }
}

/// Curves of a performance from 0 to its last moment.
pub(super) struct PerformanceCurves {
    /// One channel a kept shape.
    pub(super) weights: Curve,
    /// Quaternion (x, y, z, w).
    pub(super) rotation: Curve,
    /// Metres.
    pub(super) translation: Curve,
}

impl PerformanceCurves {
    /// `kept`: indices of the shapes that the file will have.
    pub(super) fn new(
        evaluator: &Evaluator,
        kept: &[usize],
        height_metres: f32,
        tolerance: f32,
        only_lines: bool,
    ) -> Self {
        let sequence = evaluator.sequence();
        let face = |t: f64| evaluator.face_at(t);
        let with = |tracks: &[&rubor_rig::timeline::Track<f32>]| {
            let mut breaks = Breaks::new(sequence.duration);
            tracks.iter().for_each(|t| breaks.add(t));
            // Involuntary motion is not keyed.
            if sequence.life.is_some() {
                breaks.add_frames(sequence.fps);
            }
            breaks
        };
        let gaze = sequence.eyes.iter().flat_map(|eyes| [&eyes.yaw_degrees, &eyes.pitch_degrees]);
        let moving: Vec<_> =
            sequence.expressions.values().chain(sequence.shapes.values()).chain(gaze).collect();
        let weights = |t: f64| {
            let shapes = face(t).shapes;
            kept.iter().map(|i| shapes[*i]).collect()
        };
        let motion = &sequence.head;
        let turning = [&motion.yaw_degrees, &motion.pitch_degrees, &motion.roll_degrees];
        let rotation = |t: f64| face(t).head_rotation.to_array().to_vec();
        let mut shifting = with(&[]);
        shifting.add(&motion.translation);
        let translation = |t: f64| face(t).head_translation.to_array().to_vec();
        Self {
            weights: fit(&with(&moving), &weights, tolerance, only_lines),
            // An angle is four times the change of a component at most, and a head is about as wide as high.
            rotation: fit(&with(&turning), &rotation, 0.25 * tolerance, only_lines),
            translation: fit(&shifting, &translation, tolerance * height_metres, only_lines),
        }
    }
}

/// Shapes that matter most, in the order of the head: the way that they move the mesh at the strongest weight that they
/// reach in the performance; at full weight without one, and among those that it does not use.
///
/// # Errors
/// A rig or sequence that does not fit the head.
pub fn top_shapes(
    head: &Head,
    performance: Option<Performance<'_>>,
    count: usize,
) -> Result<Vec<usize>, ExportError> {
    let mut strongest = vec![1.0_f32; head.shapes.len()];
    if let Some(performance) = performance {
        let evaluator = performance.evaluator(head, &mut Vec::new())?;
        strongest.fill(0.0);
        for frame in 0..evaluator.frame_count() {
            let FaceState { shapes, .. } = evaluator.face_at(evaluator.frame_time_s(frame));
            strongest.iter_mut().zip(shapes).for_each(|(most, w)| *most = most.max(w.abs()));
        }
    }
    let path: Vec<f64> =
        head.shapes.iter().map(|s| s.offsets.iter().map(|o| f64::from(o.length())).sum()).collect();
    let used = |s: usize| f64::from(strongest[s]) * path[s];
    let mut order: Vec<usize> = (0..head.shapes.len()).collect();
    order.sort_by(|a, b| used(*b).total_cmp(&used(*a)).then(path[*b].total_cmp(&path[*a])));
    order.truncate(count);
    order.sort_unstable();
    Ok(order)
}
