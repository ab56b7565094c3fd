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
