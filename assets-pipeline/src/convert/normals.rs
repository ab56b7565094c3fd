//! Normal maps, partial derivative slopes and difference maps (papers/004 sections 8.2 and 8.2.1).
//!
//! Slopes are (n_x / n_z, n_y / n_z) with y towards -v (up), as [`rubor_rig::head::SkinMaps`] holds them; they add like
//! displacements. Stored in 8 bits with a fixed range of 1 they cannot pass 45 degrees, so every encoding here carries
//! its own range: the value that the largest code stands for.

use rubor_rig::map::Map;
use serde::{Deserialize, Serialize};

use super::ConvertError;

/// Direction of growing green.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GreenAxis {
    /// Up in the image (OpenGL, glTF).
    #[default]
    OpenGl,
    /// Down in the image (DirectX).
    DirectX,
}

impl GreenAxis {
    fn sign(self) -> f32 {
        match self {
            Self::OpenGl => 1.0,
            Self::DirectX => -1.0,
        }
    }
}

/// Steepest slope that a normal map can give: 87 degrees. Normals flatter than that (n_z near 0 or negative) are no
/// height field.
pub const MAX_SLOPE: f32 = 20.0;

/// Slopes of a normal map.
#[derive(Clone, Debug, PartialEq)]
pub struct Slopes {
    /// 2 channels.
    pub map: Map,
    /// Texels steeper than [`MAX_SLOPE`], clamped to it.
    pub clamped_texels: usize,
    /// Texels steeper than 45 degrees in x or y: what an encoding of range 1 would lose.
    pub beyond_45_degrees: usize,
    /// Largest absolute slope.
    pub largest: f32,
}

fn require_channels(name: &str, map: &Map, channels: u32) -> Result<(), ConvertError> {
    if map.channels != channels {
        return Err(ConvertError::argument(name, format!("{} channels", map.channels), channels.to_string()));
    }
    Ok(())
}

fn require_alike(name: &str, map: &Map, other: &Map) -> Result<(), ConvertError> {
    if (map.width, map.height) != (other.width, other.height) {
        let found = format!("{}x{} texels", map.width, map.height);
        return Err(ConvertError::argument(name, found, format!("{}x{}", other.width, other.height)));
    }
    Ok(())
}

/// Slopes of a normal map in codes 0..1 (`n = 2 c - 1`), 3 channels.
///
/// # Errors
/// Other channels.
pub fn slopes_from_normals(normals: &Map, green: GreenAxis) -> Result<Slopes, ConvertError> {
    require_channels("normal map", normals, 3)?;
    let mut values = Vec::with_capacity(normals.values.len() / 3 * 2);
    let (mut clamped_texels, mut beyond_45_degrees, mut largest) = (0, 0, 0.0f32);
    for c in normals.values.chunks_exact(3) {
        let n = [2.0 * c[0] - 1.0, green.sign() * (2.0 * c[1] - 1.0), 2.0 * c[2] - 1.0];
        // The direction survives the clamp, also where n_z is 0 or negative.
        let across = n[0].hypot(n[1]);
        let steep = n[2] * MAX_SLOPE < across;
        clamped_texels += usize::from(steep);
        let inverse = if !steep {
            1.0 / n[2]
        } else if across > 0.0 {
            MAX_SLOPE / across
        } else {
            0.0
        };
        // A texel of (0, 0, 0) is empty: flat. `inverse` is infinite only there.
        let slope = [n[0] * inverse, n[1] * inverse].map(|s| if s.is_finite() { s } else { 0.0 });
        let steepest = slope[0].abs().max(slope[1].abs());
        beyond_45_degrees += usize::from(steepest > 1.0);
        largest = largest.max(steepest);
        values.extend(slope);
    }
    let map = Map { channels: 2, values, ..*normals };
    Ok(Slopes { map, clamped_texels, beyond_45_degrees, largest })
}

/// Normal map in codes 0..1 of slopes: `n = normalize(s_x, s_y, 1)`.
///
/// # Errors
/// Channels other than 2.
pub fn normals_from_slopes(slopes: &Map, green: GreenAxis) -> Result<Map, ConvertError> {
    require_channels("slopes", slopes, 2)?;
    let values = slopes
        .values
        .chunks_exact(2)
        .flat_map(|s| {
            let z = 1.0 / (s[0] * s[0] + s[1] * s[1] + 1.0).sqrt();
            [s[0] * z, green.sign() * s[1] * z, z].map(|n| 0.5 + 0.5 * n)
        })
        .collect();
    Ok(Map { channels: 3, values, ..*slopes })
}

/// Signed values in codes 0..1, with the value that the largest code stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoded {
    /// Codes 0..1; write them with as many bits as they were made for.
    pub codes: Map,
    /// Largest absolute value that the codes hold.
    pub range: f32,
    /// Bits that the codes are made for, 8 or 16.
    pub bits: u32,
}

/// Codes of signed values: `code = (2^(b-1) + (2^(b-1) - 1) value / range) / (2^b - 1)`.
///
/// Zero has a code of its own, so flat skin stays flat (with 0.5 + 0.5 v it would fall between two codes). Without a
/// range, the largest absolute value is taken.
///
/// # Errors
/// Bits other than 8 or 16, a range that is not positive, a value that is not finite.
pub fn encode_signed(map: &Map, range: Option<f32>, bits: u32) -> Result<Encoded, ConvertError> {
    if bits != 8 && bits != 16 {
        return Err(ConvertError::argument("bits", bits.to_string(), "8 or 16"));
    }
    if let Some(i) = map.values.iter().position(|v| !v.is_finite()) {
        return Err(ConvertError::argument(format!("value {i}"), map.values[i].to_string(), "finite values"));
    }
    let largest = map.values.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    let range = range.unwrap_or(if largest > 0.0 { largest } else { 1.0 });
    if !(range > 0.0 && range.is_finite()) {
        return Err(ConvertError::argument("range", range.to_string(), "a positive number"));
    }
    let (half, full) = ((1u32 << (bits - 1)) as f32, ((1u32 << bits) - 1) as f32);
    let code = |v: &f32| (half + ((half - 1.0) * (v / range).clamp(-1.0, 1.0)).round()) / full;
    let codes = Map { values: map.values.iter().map(code).collect(), ..*map };
    Ok(Encoded { codes, range, bits })
}

/// Signed values of codes, the inverse of [`encode_signed`] to half a step.
pub fn decode_signed(encoded: &Encoded) -> Map {
    let (half, full) = ((1u32 << (encoded.bits - 1)) as f32, ((1u32 << encoded.bits) - 1) as f32);
    let value = |c: &f32| (c * full - half) / (half - 1.0) * encoded.range;
    Map { values: encoded.codes.values.iter().map(value).collect(), ..encoded.codes }
}

/// Difference map (section 8.2.1): unit normals of the wrinkles minus those of the base, 3 channels, -2..2.
///
/// Both are normal maps in codes 0..1. [`encode_signed`] stores it; with range 1 that is `0.5 + 0.5 (w - b)` of the
/// thesis, but for the code of zero.
///
/// # Errors
/// Other channels, or maps of different sizes.
pub fn difference(base: &Map, wrinkles: &Map) -> Result<Map, ConvertError> {
    require_channels("base normal map", base, 3)?;
    require_channels("wrinkle normal map", wrinkles, 3)?;
    require_alike("wrinkle normal map", wrinkles, base)?;
    let values = base
        .values
        .chunks_exact(3)
        .zip(wrinkles.values.chunks_exact(3))
        .flat_map(|(b, w)| {
            let (b, w) = (unit(b), unit(w));
            [w[0] - b[0], w[1] - b[1], w[2] - b[2]]
        })
        .collect();
    Ok(Map { values, ..*base })
}

/// Base normal map with a weighted difference added, renormalised; codes 0..1.
///
/// # Errors
/// Other channels, or maps of different sizes.
pub fn apply_difference(base: &Map, difference: &Map, weight: f32) -> Result<Map, ConvertError> {
    require_channels("base normal map", base, 3)?;
    require_channels("difference map", difference, 3)?;
    require_alike("difference map", difference, base)?;
    let values = base
        .values
        .chunks_exact(3)
        .zip(difference.values.chunks_exact(3))
        .flat_map(|(b, d)| {
            let b = unit(b);
            normalized([0, 1, 2].map(|i| b[i] + weight * d[i])).map(|n| 0.5 + 0.5 * n)
        })
        .collect();
    Ok(Map { values, ..*base })
}

fn unit(codes: &[f32]) -> [f32; 3] {
    normalized([0, 1, 2].map(|i| 2.0 * codes[i] - 1.0))
}

/// Unit vector; straight up for one without length.
fn normalized(n: [f32; 3]) -> [f32; 3] {
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 1e-6 { n.map(|c| c / length) } else { [0.0, 0.0, 1.0] }
}
