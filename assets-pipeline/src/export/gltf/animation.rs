//! One animation: weights, rotation and translation of the node.

use serde_json::{Value, json};

use super::buffer::{Buffer, Precision, Target, WEIGHT};
use crate::export::curves::{Curve, Interpolation};
use crate::export::performance::PerformanceCurves;

/// `None` where nothing moves.
pub(super) fn write(curves: &PerformanceCurves, buffer: &mut Buffer) -> Option<Value> {
    let rests = |curve: &Curve, rest: &[f32]| curve.is_constant() && curve.keys[0].values == rest;
    let mut tracks: Vec<(&str, &Curve, usize)> = Vec::new();
    if !rests(&curves.rotation, &[0.0, 0.0, 0.0, 1.0]) {
        tracks.push(("rotation", &curves.rotation, elements(&curves.rotation, 4, buffer)));
    }
    if !rests(&curves.translation, &[0.0; 3]) {
        tracks.push(("translation", &curves.translation, elements(&curves.translation, 3, buffer)));
    }
    if !curves.weights.keys[0].values.is_empty() {
        tracks.push(("weights", &curves.weights, elements(&curves.weights, 1, buffer)));
    }
    if tracks.is_empty() {
        return None;
    }
    let mut samplers = Vec::new();
    let mut channels = Vec::new();
    for (path, curve, output) in tracks {
        let times: Vec<[f32; 1]> = curve.keys.iter().map(|k| [k.time_s]).collect();
        let input = buffer.floats(&times, Target::None, true, Precision::Exact);
        let interpolation = match curve.interpolation {
            Interpolation::Step => "STEP",
            Interpolation::Linear => "LINEAR",
            Interpolation::Cubic => "CUBICSPLINE",
        };
        channels.push(json!({"sampler": samplers.len(), "target": {"node": 0, "path": path}}));
        samplers.push(json!({"input": input, "output": output, "interpolation": interpolation}));
    }
    Some(json!({"name": "performance", "samplers": samplers, "channels": channels}))
}

/// Values of all keys; a cubic has slope in, value, slope out for each. Weights are scalars, all targets of a key after
/// each other.
fn elements(curve: &Curve, size: usize, buffer: &mut Buffer) -> usize {
    let mut numbers: Vec<f32> = Vec::new();
    for key in &curve.keys {
        match curve.interpolation {
            Interpolation::Cubic => {
                numbers.extend(&key.slopes[0]);
                numbers.extend(&key.values);
                numbers.extend(&key.slopes[1]);
            }
            Interpolation::Step | Interpolation::Linear => numbers.extend(&key.values),
        }
    }
    match size {
        4 => buffer.floats(numbers.as_chunks::<4>().0, Target::None, false, Precision::Exact),
        3 => buffer.floats(numbers.as_chunks::<3>().0, Target::None, false, Precision::Exact),
        _ => buffer.rows(&numbers, curve.keys[0].values.len(), WEIGHT),
    }
}
