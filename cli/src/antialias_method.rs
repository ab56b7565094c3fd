//! Names of antialiasing methods.

use std::fmt;

use rubor_renderer::antialias::Mode;

/// An antialiasing method by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Antialias {
    Filter(Mode),
    Supersampling(u32),
}

impl Antialias {
    /// The filter, and the samples on a side of a pixel.
    pub(crate) fn parts(self) -> (Mode, u32) {
        match self {
            Self::Filter(mode) => (mode, 1),
            Self::Supersampling(n) => (Mode::None, n),
        }
    }
}

impl fmt::Display for Antialias {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Filter(mode) => f.write_str(mode.name()),
            Self::Supersampling(n) => write!(f, "ssaa:{n}"),
        }
    }
}

/// `smaa-1x`, `ssaa:4`.
pub(crate) fn parse_antialias(text: &str) -> Result<Antialias, String> {
    if let Some(mode) = Mode::ALL.into_iter().find(|mode| mode.name() == text) {
        return Ok(Antialias::Filter(mode));
    }
    match text.strip_prefix("ssaa:").and_then(|n| n.parse().ok()) {
        Some(n) if (1..=8).contains(&n) => Ok(Antialias::Supersampling(n)),
        _ => {
            let names = Mode::ALL.map(Mode::name).join(", ");
            Err(format!("found {text:?}, expected {names}, or ssaa:N with N from 1 to 8"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for name in ["none", "mlaa", "smaa-1x", "smaa-4x", "ssaa:4"] {
            assert_eq!(parse_antialias(name).unwrap().to_string(), name);
        }
        for wrong in ["ssaa:0", "ssaa:9", "smaa", "fxaa"] {
            assert!(parse_antialias(wrong).unwrap_err().contains("smaa-1x"));
        }
    }
}
