//! How a command fails: one message, perhaps a hint, and an exit code.

use std::fmt::{Display, Write};

/// Exit code of a job that failed although its input was right.
const JOB: u8 = 1;
/// Exit code of wrong input or arguments.
const INPUT: u8 = 2;

/// Why a command stopped.
#[derive(Debug)]
pub(crate) struct Failure {
    /// Exit code of the process.
    pub(crate) code: u8,
    message: String,
    hint: Option<String>,
}

/// What commands return.
pub(crate) type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    /// The input or the arguments are wrong.
    pub(crate) fn input(message: impl Display) -> Self {
        Self { code: INPUT, message: message.to_string(), hint: None }
    }

    /// The job failed.
    pub(crate) fn job(message: impl Display) -> Self {
        Self { code: JOB, message: message.to_string(), hint: None }
    }

    /// Adds what to try.
    pub(crate) fn hint(mut self, hint: impl Display) -> Self {
        self.hint = Some(hint.to_string());
        self
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)?;
        if let Some(hint) = &self.hint {
            f.write_char('\n')?;
            write!(f, "  hint: {hint}")?;
        }
        Ok(())
    }
}

impl From<rubor_rig::error::RigError> for Failure {
    fn from(e: rubor_rig::error::RigError) -> Self {
        Self::input(e)
    }
}

impl From<rubor_assets::error::ImportError> for Failure {
    fn from(e: rubor_assets::error::ImportError) -> Self {
        Self::input(e)
    }
}

impl From<rubor_renderer::RenderError> for Failure {
    fn from(e: rubor_renderer::RenderError) -> Self {
        use rubor_renderer::RenderError as E;
        match e {
            E::UnknownAdapter { .. } | E::Limit { .. } | E::Head(_) | E::Antialias(_) | E::Skin(_) => {
                Self::input(e)
            }
            E::NoAdapter => Self::job(e).hint("`make demo` installs one on Debian and Ubuntu"),
            E::Device { .. } | E::Lost(_) => Self::job(e),
        }
    }
}
