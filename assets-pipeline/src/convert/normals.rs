//! Normal maps, partial derivative slopes and difference maps (Jimenez 2012 sections 8.2 and 8.2.1).
//!
//! Slopes are (n_x / n_z, n_y / n_z) with y towards -v (up), as [`rubor_rig::head::SkinMaps`] holds them; they add like
//! displacements. Stored in 8 bits with a fixed range of 1 they cannot pass 45 degrees, so every encoding here carries
//! its own range: the value that the largest code stands for.

use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped};
use serde::{Deserialize, Serialize};

use super::ConvertError;
use crate::image_io::{ImageError, LoadedImage, SampleKind};

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
    /// Texels steeper than 45 degrees in x or y: an encoding of range 1 would lose them.
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

/// How far apart the channels of a grey picture may be: a code and a half of 8 bits, what lossy tools leave.
const GREY: f32 = 1.5 / 255.0;
/// Floats below this are no codes: signed normals.
const SIGNED: f32 = -0.02;
/// Mean difference of a normal's length to 1 above which a note asks whether this is a normal map.
const ODD_LENGTH: f64 = 0.2;

/// The normal map of an image as codes 0..1 (`n = 2 c - 1`), 3 channels, and notes on what was told from the values.
///
/// Floats may hold codes or the normals themselves, -1..1: negative values tell, else whichever gives the more unit
/// lengths. Two-channel normal maps in a colour image (blue 0 everywhere) get the z that unit length gives.
///
/// # Errors
/// A grey picture, also one with three equal channels; other channels; values that are not finite in mapped texels.
pub fn codes_of(image: &LoadedImage) -> Result<(Map, Vec<String>), ImageError> {
    let expected = "a normal map: three channels that differ";
    if image.map.channels != 3 {
        let found = format!("{} channels", image.map.channels);
        let found = if image.map.channels == 1 { "a grey picture".into() } else { found };
        return Err(image.content_error("channels", found, expected));
    }
    let mask = image.mask();
    image.require_finite(&mask)?;
    let mapped = || {
        let texels = image.map.values.chunks_exact(3).zip(&mask.mapped);
        texels.filter(|(_, mapped)| **mapped).map(|(t, _)| [t[0], t[1], t[2]])
    };
    if mapped().all(|[r, g, b]| (r - g).abs() <= GREY && (r - b).abs() <= GREY) {
        return Err(image.content_error(
            "channels",
            "a grey picture: red, green and blue are equal",
            expected,
        ));
    }
    let mut notes = Vec::new();
    let mut map = image.map.clone();
    if image.kind == SampleKind::F32 {
        let lowest = mapped().flatten().fold(f32::INFINITY, f32::min);
        let as_codes = |n: [f32; 3]| n.map(|v| 2.0 * v - 1.0);
        if lowest < SIGNED || mean_length_error(mapped()) < mean_length_error(mapped().map(as_codes)) {
            notes.push("the floats are normals from -1 to 1, not codes from 0 to 1".into());
            for v in &mut map.values {
                *v = 0.5 + 0.5 * *v;
            }
        }
    }
    let mapped_codes = || map.values.chunks_exact(3).zip(&mask.mapped).filter(|(_, m)| **m).map(|(c, _)| c);
    // n_z = -1 or n_z = 0 everywhere is the normal of no height field.
    let (is_black, is_zero) =
        (mapped_codes().all(|c| c[2] <= GREY), mapped_codes().all(|c| (c[2] - 0.5).abs() <= GREY));
    if is_black || is_zero {
        notes.push("blue is empty: a two-channel normal map, z follows from unit length".into());
        for c in map.values.chunks_exact_mut(3) {
            let (x, y) = (2.0 * c[0] - 1.0, 2.0 * c[1] - 1.0);
            c[2] = 0.5 + 0.5 * (1.0 - x * x - y * y).max(0.0).sqrt();
        }
    }
    let normals = map.values.chunks_exact(3).zip(&mask.mapped).filter(|(_, m)| **m);
    let error = mean_length_error(normals.map(|(c, _)| [c[0], c[1], c[2]].map(|v| 2.0 * v - 1.0)));
    if error > ODD_LENGTH {
        notes.push(format!(
            "lengths of normals differ from 1 by {error:.2} in the mean: is this a normal map?"
        ));
    }
    Ok((map, notes))
}

/// Mean of | |n| - 1 |.
fn mean_length_error(normals: impl Iterator<Item = [f32; 3]>) -> f64 {
    let (mut sum, mut count) = (0.0, 0u64);
    for n in normals {
        let length = n.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        sum += (length - 1.0).abs();
        count += 1;
    }
    sum / count.max(1) as f64
}

/// Slopes of the normal map of an image (see [`codes_of`]), with its notes; texels without alpha take those around
/// them. Two channels of floats are slopes already and stay.
///
/// # Errors
/// As for [`codes_of`].
pub fn slopes_of(image: &LoadedImage, green: GreenAxis) -> Result<(Slopes, Vec<String>), ConvertError> {
    let (mut slopes, notes) = if image.map.channels == 2 && image.kind == SampleKind::F32 {
        image.require_finite(&image.mask())?;
        let largest = image.map.values.iter().fold(0.0f32, |m, v| m.max(v.abs()));
        let steep = |s: &&[f32]| s[0].abs().max(s[1].abs()) > 1.0;
        let beyond_45_degrees = image.map.values.chunks_exact(2).filter(steep).count();
        (Slopes { map: image.map.clone(), clamped_texels: 0, beyond_45_degrees, largest }, Vec::new())
    } else {
        let (mut codes, notes) = codes_of(image)?;
        // Texels outside the mask hold no normal: they become flat, so that they do not count as steep.
        let mask: Mask = image.mask();
        for (c, _) in codes.values.chunks_exact_mut(3).zip(&mask.mapped).filter(|(_, m)| !**m) {
            c.copy_from_slice(&[0.5, 0.5, 1.0]);
        }
        (slopes_from_normals(&codes, green)?, notes)
    };
    fill_unmapped(&mut slopes.map, &image.mask());
    Ok((slopes, notes))
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
/// thesis, except for the code of zero.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Unit normals of slopes 0.3 sin(x / 6), 0.2 cos(y / 5).
    fn normals() -> Map {
        let values = (0..48 * 64).flat_map(|i| {
            let (x, y) = ((i % 64) as f32, (i / 64) as f32);
            let s = [0.3 * (x / 6.0).sin(), 0.2 * (y / 5.0).cos()];
            let z = 1.0 / (s[0] * s[0] + s[1] * s[1] + 1.0).sqrt();
            [s[0] * z, s[1] * z, z]
        });
        Map { width: 64, height: 48, channels: 3, values: values.collect() }
    }

    fn image(map: Map, kind: SampleKind) -> LoadedImage {
        LoadedImage { file: "n.exr".into(), map, alpha: None, kind, notes: Vec::new() }
    }

    fn mapped(f: impl Fn([f32; 3]) -> [f32; 3]) -> Map {
        let mut map = normals();
        for n in map.values.chunks_exact_mut(3) {
            n.copy_from_slice(&f([n[0], n[1], n[2]]));
        }
        map
    }

    fn largest_error(map: Map, kind: SampleKind) -> (f32, Vec<String>) {
        let (slopes, notes) = slopes_of(&image(map, kind), GreenAxis::OpenGl).unwrap();
        let expected = normals();
        let error = slopes
            .map
            .values
            .chunks_exact(2)
            .zip(expected.values.chunks_exact(3))
            .map(|(s, n)| (s[0] - n[0] / n[2]).abs().max((s[1] - n[1] / n[2]).abs()));
        (error.fold(0.0, f32::max), notes)
    }

    #[test]
    fn codes_signed_floats_and_two_channels_give_the_same_slopes() {
        let code = |n: [f32; 3]| n.map(|v| 0.5 + 0.5 * v);
        let (error, notes) = largest_error(mapped(code), SampleKind::F32);
        assert!(error < 1e-5 && notes.is_empty(), "{error} {notes:?}");
        let (error, notes) = largest_error(normals(), SampleKind::F32);
        assert!(error < 1e-5 && notes[0].contains("-1 to 1"), "{error} {notes:?}");
        for blue in [0.0, 0.5] {
            let (error, notes) =
                largest_error(mapped(|n| [0.5 + 0.5 * n[0], 0.5 + 0.5 * n[1], blue]), SampleKind::U8);
            assert!(error < 1e-4 && notes[0].contains("two-channel"), "{error} {notes:?}");
        }
        // Signed normals that never go below 0 are told by their length.
        let flat = image(Map::filled(4, 4, &[0.0, 0.0, 1.0]), SampleKind::F32);
        let (slopes, notes) = slopes_of(&flat, GreenAxis::OpenGl).unwrap();
        assert!(slopes.largest < 1e-6 && notes.len() == 1, "{} {notes:?}", slopes.largest);
        let flat = image(Map::filled(4, 4, &[0.5, 0.5, 1.0]), SampleKind::F32);
        assert!(slopes_of(&flat, GreenAxis::OpenGl).unwrap().1.is_empty());
    }

    #[test]
    fn grey_pictures_are_refused_and_odd_ones_told() {
        let refused = |map: Map, kind| {
            let message = slopes_of(&image(map, kind), GreenAxis::OpenGl).unwrap_err().to_string();
            assert!(message.contains("grey picture") && message.contains("normal map"), "{message}");
        };
        let height = |n: [f32; 3]| [0.5 + n[0]; 3];
        refused(mapped(height), SampleKind::U8);
        refused(mapped(height), SampleKind::F32);
        let values = normals().values.iter().step_by(3).copied().collect();
        refused(Map { channels: 1, values, ..normals() }, SampleKind::F32);
        let photo = mapped(|n| [0.8, 0.5 + 0.3 * n[1], 0.4]);
        let (_, notes) = codes_of(&image(photo, SampleKind::U8)).unwrap();
        assert!(notes[0].contains("is this a normal map"), "{notes:?}");
        let two = Map { width: 2, height: 1, channels: 2, values: vec![0.1; 4] };
        assert!(codes_of(&image(two.clone(), SampleKind::U8)).is_err());
        assert_eq!(slopes_of(&image(two.clone(), SampleKind::F32), GreenAxis::OpenGl).unwrap().0.map, two);
    }

    #[test]
    fn texels_outside_of_alpha_say_nothing_and_are_filled() {
        let mut with_hole = image(normals(), SampleKind::F32);
        let mut alpha = Map::filled(64, 48, &[1.0]);
        for y in 10..20 {
            for x in 10..20 {
                alpha.values[y * 64 + x] = 0.0;
                with_hole.map.values[(y * 64 + x) * 3..][..3].fill(f32::NAN);
            }
        }
        with_hole.alpha = Some(alpha);
        let (slopes, _) = slopes_of(&with_hole, GreenAxis::OpenGl).unwrap();
        assert!(slopes.map.values.iter().all(|v| v.is_finite() && v.abs() < 0.31));
        assert_eq!(slopes.clamped_texels, 0);
    }
}
