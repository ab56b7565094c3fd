//! Which techniques of colour, wrinkles and highlights a frame uses, by name.

use std::fmt;
use std::str::FromStr;

/// How colour, wrinkles and highlights of skin are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AppearanceMethods {
    /// Whether blood moves.
    pub color: ColorMethod,
    /// How wrinkles join the relief of the skin.
    pub wrinkles: WrinkleMethod,
    /// The highlight of skin.
    pub specular: SpecularMethod,
}

/// The highlight of skin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpecularMethod {
    /// A Beckmann lobe of the roughness in the map.
    #[default]
    OneLobe,
    /// A sharp and a broad lobe, with the mean square slope of the one lobe: skin has slopes at scales from cells to
    /// furrows, and measured patches fit two lobes better than one (Graham et al. 2013, "Measurement-based synthesis of
    /// facial microgeometry"). Factors chosen by eye on cheek and forehead.
    TwoLobes,
}

impl SpecularMethod {
    /// Factors of the map's roughness of a first and a second lobe, and the share of the second.
    pub(crate) fn lobes(self) -> [f32; 3] {
        match self {
            Self::OneLobe => [1.0, 1.0, 0.0],
            // 0.72^2 (1 - 0.278) + 1.5^2 0.278 = 1.
            Self::TwoLobes => [0.72, 1.5, 0.278],
        }
    }
}

/// Whether the blood of a face moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorMethod {
    /// The neutral hemoglobin map, whatever the face does.
    Static,
    /// Distributions blended by their weights (papers/004 eq. 7.6).
    #[default]
    Hemoglobin,
}

/// How wrinkles join the relief of the skin (papers/004 section 8.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WrinkleMethod {
    /// No wrinkles.
    None,
    /// Slopes of wrinkles add to those of the skin. Exact for height fields, at any number of maps.
    #[default]
    PartialDerivative,
    /// Differences of unit normals add to the normal of the skin, which is then renormalised (section 8.2.1).
    Difference,
}

macro_rules! by_name {
    ($method:ident, $($variant:ident => $name:literal),*) => {
        impl $method {
            /// Every method.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// Name in arguments and files.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name),*
                }
            }
        }

        impl fmt::Display for $method {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())
            }
        }

        impl FromStr for $method {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                let names = [$($name),*].join(", ");
                let found = Self::ALL.iter().find(|m| m.name() == text);
                found.copied().ok_or_else(|| format!("found {text:?}, expected one of {names}"))
            }
        }
    };
}

by_name!(ColorMethod, Static => "static", Hemoglobin => "hemoglobin");
by_name!(SpecularMethod, OneLobe => "one-lobe", TwoLobes => "two-lobes");
by_name!(WrinkleMethod, None => "none", PartialDerivative => "partial-derivative", Difference => "difference");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_read_by_name() {
        for method in WrinkleMethod::ALL {
            assert_eq!(method.to_string().parse(), Ok(*method));
        }
        for method in ColorMethod::ALL {
            assert_eq!(method.to_string().parse(), Ok(*method));
        }
        for method in SpecularMethod::ALL {
            assert_eq!(method.to_string().parse(), Ok(*method));
            let [first, second, share] = method.lobes();
            let square = (1.0 - share) * first * first + share * second * second;
            assert!((square - 1.0).abs() < 2e-3, "{method} keeps the mean square slope: {square}");
        }
        assert!("bump".parse::<WrinkleMethod>().unwrap_err().contains("partial-derivative, difference"));
        assert!("".parse::<ColorMethod>().unwrap_err().contains("static, hemoglobin"));
    }
}
