//! A recording, and a retarget file for it.

use rubor_rig::head::Head;
use rubor_rig::names::{ARKIT, Key, Resolver, nearest, vocabulary};

use super::{Finding, list};
use crate::import::capture::{Recording, Report, Retarget, to_sequence};

/// Columns of one kind that get a finding, with the nearest name, of their own; the rest is summed.
const MOST_APART: usize = 16;

/// Columns that move nothing, entries without a column, channels that never change.
pub fn check(recording: &Recording, retarget: &Retarget, head: &Head) -> Vec<Finding> {
    let (sequence, report) = match to_sequence(recording, retarget, None) {
        Ok(done) => done,
        Err(e) => return vec![Finding::error("", e.to_string())],
    };
    let mut findings: Vec<Finding> = report.notes.iter().map(|n| Finding::warning("", n.clone())).collect();
    let Report { unmapped, unused, limited, .. } = &report;
    for channel in unmapped.iter().take(MOST_APART) {
        let message = "no shape is known for this column: it moves nothing";
        let fix = match nearest(channel, vocabulary()) {
            Some(near) => {
                format!("if it is {near:?}, write \"{channel}\": \"{near}\" into the retarget file")
            }
            None => format!("name a shape in the retarget file, or \"{channel}\": null to leave it out"),
        };
        findings.push(Finding::warning(format!("column {channel:?}"), message).fix(fix));
    }
    let rest = unmapped.len().saturating_sub(MOST_APART);
    if rest > 0 {
        let first: Vec<&str> = unmapped[MOST_APART..].iter().take(MOST_APART).map(String::as_str).collect();
        let message =
            format!("{rest} further columns move nothing, as no shape is known: {}, ...", list(&first));
        findings.push(Finding::warning("", message).fix("name shapes in the retarget file, or null"));
    }
    let rest = unused.len().saturating_sub(MOST_APART);
    if rest > 0 {
        let message = format!("{rest} further entries of the retarget file have no column");
        findings.push(Finding::warning("", message).fix("remove the entries"));
    }
    for entry in unused.iter().take(MOST_APART) {
        let message = "the retarget file names it, and the recording has no such column";
        let channels = recording.channels.iter().map(|c| c.name.as_str());
        let finding = Finding::warning(format!("column {entry:?}"), message);
        findings.push(match nearest(entry, channels) {
            Some(near) => finding.fix(format!("write {near:?}")),
            None => finding.fix("remove the entry"),
        });
    }
    let resolver = Resolver::shapes(head);
    let absent: Vec<&str> =
        (sequence.shapes.keys()).filter(|s| resolver.resolve(s).is_empty()).map(String::as_str).collect();
    if !absent.is_empty() {
        let message = format!("{:?} has no shape for {}: they move nothing", head.name, list(&absent));
        findings
            .push(Finding::warning("", message).fix("map their columns to other shapes in a retarget file"));
    }
    let keys: Vec<Key> = recording.channels.iter().map(|c| Key::new(&c.name)).collect();
    let missing: Vec<&str> = ARKIT.into_iter().filter(|n| !keys.contains(&Key::new(n))).collect();
    if !missing.is_empty() {
        let message = format!("{} ARKit columns are missing and rest: {}", missing.len(), list(&missing));
        findings.push(Finding::note("", message));
    }
    let still: Vec<&str> = (recording.channels.iter())
        .filter(|c| c.values.len() > 1 && c.values.iter().all(|v| *v == c.values[0]))
        .map(|c| c.name.as_str())
        .collect();
    if !still.is_empty() {
        findings.push(Finding::note("", format!("these columns never change: {}", list(&still))));
    }
    if *limited > 0 {
        let message = format!("{limited} weights above the limit are cut");
        findings
            .push(Finding::note("", message).fix("set \"limit\" in the retarget file, null to keep them"));
    }
    findings
}
