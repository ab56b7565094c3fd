//! Errors of the studio: one message, an optional hint, and the kind of fault.
//!
//! One rule decides the exit code of the command: 0 done, 1 the job failed (a file that cannot be written, a lost
//! device, a result that is not good enough), 2 the input or the arguments are wrong, 128 + n stopped by signal n (130
//! for Ctrl-C), as shells have it.
//!
//! The command prints the message and the hint as they are. `miette` would break long paths over lines, which then cannot
//! be searched for, and adds nothing: messages already name file, line, column, what was found and what was expected.

use std::fmt::Display;
use std::path::Path;

use rubor_assets::error::{ExportError, ImportError};
use rubor_assets::image_io::ImageError;
use rubor_renderer::RenderError;

/// Kind of a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The input or the arguments are wrong.
    Input,
    /// The input is right, and the job failed.
    Job,
    /// The reader of the output has closed the pipe. This is not an error; the command stops.
    ClosedPipe,
    /// A signal asked to stop.
    Stopped(u8),
}

/// A failure, with its message and hint.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}{}", .hint.as_ref().map(|h| format!("\n  hint: {h}")).unwrap_or_default())]
pub struct Failure {
    fault: Fault,
    message: String,
    hint: Option<String>,
}

/// Result of the studio's functions.
pub type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    /// The input or the arguments are wrong.
    pub fn input(message: impl Display) -> Self {
        Self { fault: Fault::Input, message: message.to_string(), hint: None }
    }

    /// The job failed.
    pub fn job(message: impl Display) -> Self {
        Self { fault: Fault::Job, message: message.to_string(), hint: None }
    }

    /// A file or folder cannot be written.
    pub fn write(path: &Path, reason: impl Display) -> Self {
        Self::job(format!("{}: cannot be written: {reason}", path.display()))
    }

    /// A file or folder cannot be read.
    pub fn read(path: &Path, reason: impl Display) -> Self {
        Self::input(format!("{}: cannot be read: {reason}", path.display()))
    }

    /// The reader of the output has closed the pipe.
    pub fn closed_pipe() -> Self {
        Self { fault: Fault::ClosedPipe, message: "the output was closed".into(), hint: None }
    }

    /// A signal asked to stop.
    pub fn stopped(signal: u8) -> Self {
        Self { fault: Fault::Stopped(signal), message: "stopped".into(), hint: None }
    }

    /// The same failure with something said before its message.
    #[must_use]
    pub fn context(mut self, before: impl Display) -> Self {
        self.message = format!("{before}: {}", self.message);
        self
    }

    /// Adds a hint.
    #[must_use]
    pub fn hint(mut self, hint: impl Display) -> Self {
        self.hint = Some(hint.to_string());
        self
    }

    /// The kind of the failure.
    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// Exit code of the process.
    pub fn exit_code(&self) -> u8 {
        match self.fault {
            Fault::ClosedPipe => 0,
            Fault::Job => 1,
            Fault::Input => 2,
            Fault::Stopped(signal) => signal.saturating_add(128),
        }
    }
}

impl From<rubor_rig::error::RigError> for Failure {
    fn from(e: rubor_rig::error::RigError) -> Self {
        Self::input(e)
    }
}

impl From<ImportError> for Failure {
    fn from(e: ImportError) -> Self {
        Self::input(e)
    }
}

impl From<ExportError> for Failure {
    fn from(e: ExportError) -> Self {
        match e {
            ExportError::Content { .. } | ExportError::Head(_) => Self::input(e),
            ExportError::Write { .. } | ExportError::Encode { .. } => Self::job(e),
        }
    }
}

impl From<rubor_maya::error::ReadError> for Failure {
    fn from(e: rubor_maya::error::ReadError) -> Self {
        Self::input(e)
    }
}

impl From<rubor_maya::error::WriteError> for Failure {
    fn from(e: rubor_maya::error::WriteError) -> Self {
        use rubor_maya::error::WriteError as E;
        match e {
            E::Write { .. } | E::Encode { .. } => Self::job(e),
            E::Content { .. } | E::Head(_) => Self::input(e),
        }
    }
}

impl From<rubor_assets::convert::ConvertError> for Failure {
    fn from(e: rubor_assets::convert::ConvertError) -> Self {
        Self::input(with_causes(&e))
    }
}

impl From<ImageError> for Failure {
    /// Errors of reading an image; see [`crate::output::save_map`] for those that are written.
    fn from(e: ImageError) -> Self {
        Self::input(with_causes(&e))
    }
}

impl From<rubor_renderer::settings::SettingsError> for Failure {
    fn from(e: rubor_renderer::settings::SettingsError) -> Self {
        Self::input(e)
    }
}

impl From<RenderError> for Failure {
    fn from(e: RenderError) -> Self {
        match e {
            RenderError::NoAdapter => Self::job(e).hint("`make demo` installs one on Debian and Ubuntu"),
            RenderError::Device { .. } | RenderError::Lost(_) => Self::job(e),
            _ => Self::input(e),
        }
    }
}

/// An error and what caused it, unless its message already contains the cause.
pub(crate) fn with_causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(e) = cause {
        let more = e.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = e.source();
    }
    text
}
