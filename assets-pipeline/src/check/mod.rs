//! Lint: finds faults in files and entries without effect, with the reasons.
//!
//! ```text
//! glTF document --gltf----> broken or missing names, normals, weights of joints
//! Head ---------head------> sizes, names, shapes without points, maps that change nothing
//! Head + Rig + Sequence --visibility--> why a wrinkle zone or a distribution does not show
//! USD layer ------usd-----> units, blend shapes, weights, pictures that are not there
//! Recording + Retarget --capture--> columns that move nothing
//! ```

pub mod capture;
pub mod head;
pub mod performance;
pub mod usd;
pub mod visibility;

use serde::Serialize;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The file cannot be used as it is.
    Error,
    /// It can be used, but its effect is most likely not what its author wants.
    Warning,
    /// Good to know.
    Note,
}

/// One thing to say about a file.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// Place inside the file, such as `zone "forehead"` or `line 12`; empty for the whole.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub at: String,
    /// The finding, and why it matters.
    pub message: String,
    /// The fix.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fix: Option<String>,
}

impl Finding {
    /// Without a fix.
    pub fn new(severity: Severity, at: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity, at: at.into(), message: message.into(), fix: None }
    }

    /// [`Severity::Error`].
    pub fn error(at: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Severity::Error, at, message)
    }

    /// [`Severity::Warning`].
    pub fn warning(at: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Severity::Warning, at, message)
    }

    /// [`Severity::Note`].
    pub fn note(at: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Severity::Note, at, message)
    }

    /// Adds what helps.
    pub fn fix(mut self, fix: impl Into<String>) -> Self {
        self.fix = Some(fix.into());
        self
    }
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if !self.at.is_empty() {
            write!(f, "{}: ", self.at)?;
        }
        f.write_str(&self.message)
    }
}

/// Findings that differ only in their place as one, in the order of the first of each kind.
pub fn summed(findings: Vec<Finding>) -> Vec<Finding> {
    let mut kinds: Vec<(Finding, Vec<String>)> = Vec::new();
    let mut seen = std::collections::HashSet::new();
    let mut place_of = std::collections::HashMap::new();
    for finding in findings {
        let kind = (finding.severity, finding.message.clone(), finding.fix.clone());
        let place = *place_of.entry(kind).or_insert(kinds.len());
        let at = finding.at.clone();
        match kinds.get_mut(place) {
            Some((_, places)) if seen.insert((place, at.clone())) => places.push(at),
            Some(_) => {}
            None => {
                seen.insert((place, at.clone()));
                kinds.push((finding, vec![at]));
            }
        }
    }
    kinds.into_iter().map(|(finding, places)| Finding { at: list(&places), ..finding }).collect()
}

/// Names in a message: all of a few, the first of many.
pub fn list<S: AsRef<str>>(names: &[S]) -> String {
    const SHOWN: usize = 8;
    let shown = names.iter().take(SHOWN).map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    match names.len().checked_sub(SHOWN) {
        Some(more @ 1..) => format!("{shown} and {more} more"),
        _ => shown,
    }
}

#[cfg(test)]
mod tests;
