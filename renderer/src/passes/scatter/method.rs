//! Names of the scattering methods.

use std::fmt;
use std::str::FromStr;

use crate::error::RenderError;

/// How light scatters in skin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScatterMethod {
    /// `none`: it does not.
    None,
    /// `separable:N`: two passes of N taps, N odd, 5 to 65.
    Separable(u32),
    /// `screen-gauss:4`, `screen-gauss:6`: Gaussians one after the other.
    ScreenGauss(u32),
    /// `screen-jitter`: thirteen taps in one pass.
    ScreenJitter,
    /// `burley-disk:N`: N importance-sampled taps in one pass, 4 to 256.
    BurleyDisk(u32),
    /// `reference-screen`: the profile as a 2D kernel over all pixels.
    ReferenceScreen,
    /// `reference-surface:N`: the integral over the surface with N times 65 536 samples, 1 to 4096; 64 without N.
    ReferenceSurface(u32),
}

/// Names as a user writes them.
const NAMES: &str = "none, separable:N (N odd, 5 to 65), screen-gauss:4, screen-gauss:6, screen-jitter, \
                     burley-disk:N (N from 4 to 256), reference-screen or reference-surface[:N] (N from 1 to 4096)";

impl ScatterMethod {
    /// Checks the number of the method.
    ///
    /// # Errors
    /// It is outside the method's range.
    pub fn validate(self) -> Result<Self, RenderError> {
        let is_valid = match self {
            Self::None | Self::ScreenJitter | Self::ReferenceScreen => true,
            Self::Separable(n) => n % 2 == 1 && (5..=65).contains(&n),
            Self::ScreenGauss(n) => n == 4 || n == 6,
            Self::BurleyDisk(n) => (4..=256).contains(&n),
            Self::ReferenceSurface(n) => (1..=4096).contains(&n),
        };
        if is_valid {
            return Ok(self);
        }
        Err(wrong(&self.to_string()))
    }
}

fn wrong(found: &str) -> RenderError {
    RenderError::Limit {
        what: "scattering method",
        found: found.into(),
        expected: format!("expected {NAMES}"),
    }
}

impl fmt::Display for ScatterMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::Separable(n) => write!(f, "separable:{n}"),
            Self::ScreenGauss(n) => write!(f, "screen-gauss:{n}"),
            Self::ScreenJitter => f.write_str("screen-jitter"),
            Self::BurleyDisk(n) => write!(f, "burley-disk:{n}"),
            Self::ReferenceScreen => f.write_str("reference-screen"),
            Self::ReferenceSurface(n) => write!(f, "reference-surface:{n}"),
        }
    }
}

impl FromStr for ScatterMethod {
    type Err = RenderError;

    fn from_str(text: &str) -> Result<Self, RenderError> {
        let (name, number) = match text.split_once(':') {
            Some((name, number)) => (name, Some(number.parse::<u32>().map_err(|_| wrong(text))?)),
            None => (text, None),
        };
        match (name, number) {
            ("none", None) => Ok(Self::None),
            ("separable", Some(n)) => Ok(Self::Separable(n)),
            ("screen-gauss", Some(n)) => Ok(Self::ScreenGauss(n)),
            ("screen-jitter", None) => Ok(Self::ScreenJitter),
            ("burley-disk", Some(n)) => Ok(Self::BurleyDisk(n)),
            ("reference-screen", None) => Ok(Self::ReferenceScreen),
            ("reference-surface", n) => Ok(Self::ReferenceSurface(n.unwrap_or(64))),
            _ => Err(wrong(text)),
        }?
        .validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for name in [
            "none",
            "separable:5",
            "separable:65",
            "screen-gauss:4",
            "screen-gauss:6",
            "screen-jitter",
            "burley-disk:16",
            "reference-screen",
            "reference-surface:8",
        ] {
            assert_eq!(name.parse::<ScatterMethod>().unwrap().to_string(), name);
        }
    }

    #[test]
    fn wrong_names_say_what_is_possible() {
        for name in [
            "separable:16",
            "separable:67",
            "separable",
            "screen-gauss:5",
            "burley-disk:0",
            "none:1",
            "gauss",
            "separable:-1",
        ] {
            let message = name.parse::<ScatterMethod>().unwrap_err().to_string();
            assert!(message.contains(name) && message.contains("separable:N"), "{message}");
        }
    }
}
