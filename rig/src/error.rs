//! Errors of the rig crate.

/// A head that breaks a rule of [`crate::head::Head`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("head {head:?}, {at}: found {found}, expected {expected}")]
pub struct HeadError {
    /// Name of the head.
    pub head: String,
    /// Place inside it.
    pub at: String,
    /// What stands there.
    pub found: String,
    /// What should.
    pub expected: &'static str,
}

/// A medium, profile, fit or kernel that is not defined for what it was given.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{at}: found {found}, expected {expected}")]
pub struct SkinError {
    /// Which number of which value, for example `medium.sigma_a_per_mm`.
    pub at: String,
    /// What was given.
    pub found: String,
    /// What would do.
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
    /// Where.
    pub place: Place,
    /// What stands there.
    pub found: String,
    /// What should.
    pub expected: String,
    /// The valid name that is most like the one found.
    pub nearest: Option<String>,
}

/// Something in a rig or sequence that has no effect on this head, or not the expected one. Work goes on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Note {
    /// Where it is written.
    pub place: Place,
    /// What has no effect, and why.
    pub message: String,
    /// The valid name that is most like the one found.
    pub nearest: Option<String>,
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}{}", self.place, self.message, did_you_mean(self.nearest.as_deref()))
    }
}

/// A place in a file. Printed as `file:line:column: `, ready to stand before a message.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// As the user named it; empty for what was made by a program.
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
