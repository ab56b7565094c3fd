//! Errors of import and export. Each names the file, the place inside it, what was found and what was expected.

use std::path::{Path, PathBuf};

/// A file that cannot become part of a head.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The file or folder cannot be opened or read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// File or folder.
        path: PathBuf,
        /// Reason given by the system.
        source: std::io::Error,
    },
    /// The content breaks the format or a rule of heads.
    #[error("{}, {at}: found {found}, expected {expected}", path.display())]
    Content {
        /// File.
        path: PathBuf,
        /// Place inside it, such as `line 12` or `mesh 0, primitive 1`.
        at: String,
        /// The value there.
        found: String,
        /// The values that are allowed.
        expected: String,
    },
    /// The imported head breaks a rule of [`rubor_rig::head::Head::validate`].
    #[error(transparent)]
    Head(#[from] rubor_rig::error::HeadError),
    /// A file that belongs to the import and that people write is wrong at one place.
    #[error(transparent)]
    Text(#[from] rubor_rig::error::RigError),
}

impl ImportError {
    pub(crate) fn read(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Read { path: path.to_owned(), source }
    }

    pub(crate) fn content(
        path: &Path,
        at: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Content { path: path.to_owned(), at: at.into(), found: found.into(), expected: expected.into() }
    }
}

/// A head that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// File.
        path: PathBuf,
        /// Reason given by the system.
        source: std::io::Error,
    },
    /// A map or picture cannot be encoded.
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
