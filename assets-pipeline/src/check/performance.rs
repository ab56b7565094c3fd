//! A rig or a sequence on a head.

use std::collections::BTreeSet;

use rubor_rig::bind::BoundRig;
use rubor_rig::error::{Note, RigError, summed};
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::timeline::{Sequence, Track, TrackValue};

use super::Finding;

/// An error of a rig or a sequence.
pub fn of_error(error: &RigError) -> Finding {
    let finding =
        Finding::error(place(&error.place), format!("found {}, expected {}", error.found, error.expected));
    match &error.nearest {
        Some(name) => finding.fix(format!("write {name:?}")),
        None => finding,
    }
}

fn of_note(note: &Note) -> Finding {
    let finding = Finding::warning(place(&note.place), note.message.clone());
    match &note.nearest {
        Some(name) => finding.fix(format!("write {name:?}, if that is meant")),
        None => finding,
    }
}

/// Line and column; the file is said elsewhere.
fn place(place: &rubor_rig::error::Place) -> String {
    if place.line == 0 { String::new() } else { format!("line {}, column {}", place.line, place.column) }
}

/// A rig on a head.
pub fn check_rig(head: &Head, rig: &Rig) -> Vec<Finding> {
    let (bound, notes) = match BoundRig::new(head, rig) {
        Ok(bound) => bound,
        Err(e) => return vec![of_error(&e)],
    };
    let mut findings: Vec<Finding> = summed(&notes).iter().map(of_note).collect();
    let neutral = bound.face(&bound.neutral_weights());
    for (i, name) in rig.expressions.keys().enumerate() {
        if bound.face_of_expression(i) == neutral {
            let message = "it changes nothing on this head";
            findings.push(
                Finding::warning(format!("expression {name:?}"), message)
                    .fix("give it shapes, wrinkles or hemoglobin that the head has"),
            );
        }
    }
    for (i, name) in rig.states.keys().enumerate() {
        if bound.face_of_state(i) == neutral {
            let message = "it changes nothing on this head";
            findings.push(
                Finding::warning(format!("state {name:?}"), message)
                    .fix("give it distributions that the head has, or a fallback with a hemoglobinScale"),
            );
        }
    }
    for (name, expression) in &rig.expressions {
        for (shape, weight) in expression.shapes.iter().filter(|(_, w)| !(-1.0..=1.0).contains(*w)) {
            let message = format!("the weight {weight} of {shape:?} is cut to 0 to 1 when it is summed up");
            findings.push(Finding::note(format!("expression {name:?}"), message));
        }
    }
    findings
}

/// A sequence on a head, and its evaluator if it has one.
pub fn check_sequence(head: &Head, rig: &Rig, sequence: &Sequence) -> (Vec<Finding>, Option<Evaluator>) {
    let (evaluator, notes) = match Evaluator::new(head, rig, sequence) {
        Ok(evaluator) => evaluator,
        Err(e) => return (vec![of_error(&e)], None),
    };
    // Findings about the rig alone were reported with the rig.
    let of_rig = BoundRig::new(head, rig).map(|(_, notes)| notes).unwrap_or_default();
    let of_rig: BTreeSet<Note> = of_rig.into_iter().collect();
    let of_sequence: Vec<Note> = notes.into_iter().filter(|n| !of_rig.contains(n)).collect();
    let mut findings: Vec<Finding> = summed(&of_sequence).iter().map(of_note).collect();
    let end = sequence.duration;
    let head_tracks = [
        ("head.yawDegrees", &sequence.head.yaw_degrees),
        ("head.pitchDegrees", &sequence.head.pitch_degrees),
        ("head.rollDegrees", &sequence.head.roll_degrees),
        ("camera.orbitDegrees", &sequence.camera.orbit_degrees),
        ("camera.elevationDegrees", &sequence.camera.elevation_degrees),
    ];
    for (name, track) in head_tracks {
        after_end(name, track, end, &mut findings);
    }
    after_end("head.translation", &sequence.head.translation, end, &mut findings);
    for (name, track) in &sequence.shapes {
        let outside = values(track).filter(|v| !(0.0..=1.0).contains(v)).count();
        if outside > 0 {
            let message = format!("{outside} keys leave 0 to 1: they are used as they stand");
            findings.push(Finding::note(format!("shape {name:?}"), message));
        }
    }
    for (kind, tracks) in [("expression", &sequence.expressions), ("state", &sequence.states)] {
        for (name, track) in tracks {
            if values(track).all(|v| v == 0.0) {
                let message = "its weight is 0 throughout: it has no effect";
                findings.push(Finding::note(format!("{kind} {name:?}"), message));
            }
            if values(track).any(|v| v > 1.0) {
                let message = "keys above 1 exaggerate; shapes are still cut at 1";
                findings.push(Finding::note(format!("{kind} {name:?}"), message));
            }
        }
    }
    let (pitch, yaw) = (&sequence.head.pitch_degrees, &sequence.head.yaw_degrees);
    for (name, track, most) in [("pitch", pitch, 60.0), ("yaw", yaw, 90.0)] {
        if values(track).any(|v| v.abs() > most) {
            let message = format!("the head turns by more than {most} degrees, which necks do not");
            findings.push(Finding::warning(format!("head.{name}Degrees"), message).fix("angles are degrees"));
        }
    }
    let far = |v: f32| v.abs() > 1.0;
    if let Track::Keys(keys) = &sequence.head.translation
        && keys.iter().any(|k| k.v.into_iter().any(far))
    {
        let message = "the head moves by more than a metre";
        findings.push(Finding::warning("head.translation", message).fix("lengths are metres"));
    }
    (findings, Some(evaluator))
}

fn values(track: &Track<f32>) -> Box<dyn Iterator<Item = f32> + '_> {
    match track {
        Track::Constant(v) => Box::new(std::iter::once(*v)),
        Track::Keys(keys) => Box::new(keys.iter().map(|k| k.v)),
    }
}

fn after_end<T: TrackValue>(name: &str, track: &Track<T>, end_s: f64, findings: &mut Vec<Finding>) {
    if track.last_key_s().is_some_and(|t| t > end_s) {
        let message = format!("there are keys after the end of the sequence ({end_s} s)");
        findings.push(Finding::warning(name, message).fix("move the keys, or make the sequence longer"));
    }
}
