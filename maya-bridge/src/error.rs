//! Errors with the line of the scene.

use std::path::PathBuf;

/// A scene that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be opened or read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// Reason given by the system.
        source: std::io::Error,
    },
    /// The text breaks the format, or something that it names is missing.
    #[error("{}:{line}: found {found}, expected {expected}", path.display())]
    Content {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The value there.
        found: String,
        /// The values that are allowed.
        expected: String,
    },
    /// The head breaks a rule of [`rubor_rig::head::Head::validate`].
    #[error(transparent)]
    Head(#[from] rubor_rig::error::HeadError),
}

/// A head that cannot be written as a scene.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// A file cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// File.
        path: PathBuf,
        /// Reason given by the system.
        source: std::io::Error,
    },
    /// A map cannot be encoded.
    #[error("{what}: cannot be encoded: {reason}")]
    Encode {
        /// Which map.
        what: String,
        /// Reason given by the encoder.
        reason: String,
    },
    /// A request that does not fit the head or the format.
    #[error("{at}: found {found}, expected {expected}")]
    Content {
        /// Which input.
        at: String,
        /// The content of the file.
        found: String,
        /// The content that is expected.
        expected: String,
    },
    /// The head breaks a rule of [`rubor_rig::head::Head::validate`].
    #[error(transparent)]
    Head(#[from] rubor_rig::error::HeadError),
}

/// A fault at a line, before the file's name is known.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) line: usize,
    pub(crate) found: String,
    pub(crate) expected: String,
}

impl Fault {
    pub(crate) fn new(line: usize, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { line, found: found.into(), expected: expected.into() }
    }

    pub(crate) fn of(self, path: &std::path::Path) -> ReadError {
        ReadError::Content {
            path: path.to_owned(),
            line: self.line,
            found: self.found,
            expected: self.expected,
        }
    }
}
