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
