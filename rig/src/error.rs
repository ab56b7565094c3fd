//! Errors of the rig crate.

/// A head that breaks a rule of [`crate::head::Head`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("head {head:?}, {at}: found {found}, expected {expected}")]
pub struct HeadError {
    /// Name of the head.
    pub head: String,
    /// Place inside the head.
    pub at: String,
    /// The value there.
    pub found: String,
    /// The values that are allowed.
    pub expected: &'static str,
}

/// A medium, profile, fit or kernel that is not defined for its input.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{at}: found {found}, expected {expected}")]
pub struct SkinError {
    /// Which number of which value, for example `medium.sigma_a_per_mm`.
    pub at: String,
    /// The value that was given.
    pub found: String,
    /// The values that are allowed.
    pub expected: &'static str,
}

impl SkinError {
    /// An error about the value at `at`.
    pub fn new(at: impl Into<String>, found: impl ToString, expected: &'static str) -> Self {
        Self { at: at.into(), found: found.to_string(), expected }
    }
}
/// A rig or sequence that is wrong at one place of a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}found {found}, expected {expected}{}", did_you_mean(.nearest.as_deref()))]
pub struct RigError {
    /// Where it is.
    pub place: Place,
    /// The text or value there.
    pub found: String,
    /// What is allowed there.
    pub expected: String,
    /// The valid name that is most like the one found.
    pub nearest: Option<String>,
}

/// A warning: something in a rig or sequence has no effect on this head, or not the expected one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Note {
    /// Where it is written.
    pub place: Place,
    /// What has no effect, and why.
    pub message: String,
    /// The name in the message. Notes that differ only in the name are of one kind.
    pub subject: Option<String>,
    /// The valid name that is most like the one found.
    pub nearest: Option<String>,
}

impl Note {
    /// The message without the name that it is about.
    fn kind(&self) -> String {
        match &self.subject {
            Some(subject) => self.message.replacen(&format!("{subject:?}"), "\0", 1),
            None => self.message.clone(),
        }
    }
}

/// Largest number of names in a message.
const NAMES_SHOWN: usize = 8;

/// Merges the notes of one kind: each result has the place of the first note and the names of all.
pub fn summed(notes: &[Note]) -> Vec<Note> {
    let mut kinds: Vec<(String, Vec<&Note>)> = Vec::new();
    let mut place_of: std::collections::HashMap<String, usize> = std::collections::HashMap::new();
    for note in notes {
        let kind = note.kind();
        let place = *place_of.entry(kind.clone()).or_insert(kinds.len());
        if place == kinds.len() {
            kinds.push((kind, Vec::new()));
        }
        kinds[place].1.push(note);
    }
    let sum = |(kind, notes): (String, Vec<&Note>)| {
        let mut names: Vec<String> =
            notes.iter().filter_map(|n| n.subject.as_ref()).map(|s| format!("{s:?}")).collect();
        let first = notes[0].clone();
        if notes.len() == 1 || names.is_empty() {
            return first;
        }
        if names.len() > NAMES_SHOWN {
            let more = names.len() - NAMES_SHOWN;
            names.truncate(NAMES_SHOWN);
            names.push(format!("{more} more"));
        }
        let message = format!("{} ({} times)", kind.replacen('\0', &names.join(", "), 1), notes.len());
        Note { message, subject: None, nearest: None, ..first }
    };
    kinds.into_iter().map(sum).collect()
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}{}", self.place, self.message, did_you_mean(self.nearest.as_deref()))
    }
}

/// A place in a file. Printed as `file:line:column: `, ready to stand before a message.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// As the user named it; empty for a value that a program made.
    pub file: String,
    /// From 1; 0 where the file as a whole is meant.
    pub line: usize,
    /// In characters, from 1; 0 where the file as a whole is meant.
    pub column: usize,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.file.is_empty(), self.line) {
            (true, _) => Ok(()),
            (false, 0) => write!(f, "{}: ", self.file),
            (false, line) => write!(f, "{}:{line}:{}: ", self.file, self.column),
        }
    }
}

fn did_you_mean(nearest: Option<&str>) -> String {
    nearest.map(|name| format!("; did you mean {name:?}?")).unwrap_or_default()
}
