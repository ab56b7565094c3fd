//! `EXT_meshopt_compression`: numbers, directions and indices as its coders take them.
//!
//! ```text
//! numbers    --whole multiples of 2^e: 24 bits, and 8 bits of e--> EXPONENTIAL filter --> ATTRIBUTES
//! directions --octahedron-----------------------------------------> OCTAHEDRAL filter --> ATTRIBUTES
//! triangles, rising indices --------------------------------------> TRIANGLES, INDICES
//! ```
//!
//! Numbers stay floats to who reads the file: no transform of nodes undoes a quantisation, so sizes and skeletons are what
//! they were. One exponent for a whole list makes its bytes all alike, which the coder stores in next to nothing; the
//! error is half a step wherever a number lies.

use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{
    IndexEncoding, VertexEncoding, encode_filter_oct, encode_index_buffer, encode_index_sequence,
    encode_vertex_buffer,
};

use super::buffer::Precision;
use crate::error::ExportError;

/// Its name.
pub(super) const NAME: &str = "EXT_meshopt_compression";
/// Normals and tangents as whole numbers.
pub(super) const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Mantissas of the filter have 24 bits.
const LARGEST_MANTISSA: f64 = 8_388_607.0;

/// Coded data and what the extension says about it.
#[derive(Default)]
pub(super) struct Coded {
    pub(super) bytes: Vec<u8>,
    pub(super) count: usize,
    /// Bytes of a decoded element.
    pub(super) stride: usize,
    pub(super) mode: &'static str,
    pub(super) filter: Option<&'static str>,
}

/// The nearest multiple of `2^exponent` that a mantissa holds.
pub(super) fn nearest(value: f32, exponent: i32) -> f32 {
    (f64::from(mantissa(value, exponent)) * 2.0_f64.powi(exponent)) as f32
}

fn mantissa(value: f32, exponent: i32) -> i32 {
    let steps = (f64::from(value) / 2.0_f64.powi(exponent)).round();
    steps.clamp(-LARGEST_MANTISSA, LARGEST_MANTISSA) as i32
}

/// Rows of `width` numbers.
pub(super) fn numbers(values: &[f32], width: usize, precision: Precision) -> Result<Coded, ExportError> {
    let (bytes, filter): (Vec<u8>, _) = match precision {
        Precision::Exact => (bytemuck::cast_slice(values).to_vec(), None),
        Precision::PowerOfTwo(exponent) => {
            let word = |v: &f32| (exponent as u32) << 24 | (mantissa(*v, exponent) as u32 & 0x00ff_ffff);
            (values.iter().flat_map(|v| word(v).to_le_bytes()).collect(), Some("EXPONENTIAL"))
        }
    };
    attributes(&bytes, 4 * width, filter)
}

/// Unit vectors and a fourth number from -1 to 1: four bytes each up to 8 bits, else eight.
pub(super) fn directions(values: &[[f32; 4]], bits: u32) -> Result<Coded, ExportError> {
    let stride = if bits <= 8 { 4 } else { 8 };
    let filtered =
        encode_filter_oct(values.len(), stride, bits, values.as_flattened(), &mut Workspace::default());
    attributes(&filtered.map_err(fault)?, stride, Some("OCTAHEDRAL"))
}

fn attributes(bytes: &[u8], stride: usize, filter: Option<&'static str>) -> Result<Coded, ExportError> {
    let count = bytes.len() / stride;
    let encoding = VertexEncoding::new(0, 2).map_err(fault)?;
    let bytes =
        encode_vertex_buffer(bytes, count, stride, encoding, &mut Workspace::default()).map_err(fault)?;
    Ok(Coded { bytes, count, stride, mode: "ATTRIBUTES", filter })
}

/// Corners of triangles; the coder may turn a triangle to begin at another corner.
pub(super) fn triangles(indices: &[u32], stride: usize) -> Result<Coded, ExportError> {
    let bytes =
        encode_index_buffer(indices, IndexEncoding::DEFAULT, &mut Workspace::default()).map_err(fault)?;
    Ok(Coded { bytes, count: indices.len(), stride, mode: "TRIANGLES", filter: None })
}

/// Indices that mostly rise.
pub(super) fn sequence(indices: &[u32], stride: usize) -> Result<Coded, ExportError> {
    let bytes =
        encode_index_sequence(indices, IndexEncoding::DEFAULT, &mut Workspace::default()).map_err(fault)?;
    Ok(Coded { bytes, count: indices.len(), stride, mode: "INDICES", filter: None })
}

fn fault(error: meshoptimizer_rs::Error) -> ExportError {
    ExportError::Encode { what: NAME.into(), reason: error.to_string() }
}

#[cfg(test)]
mod tests {
    use meshoptimizer_rs::codec::{Filter, Mode, decode_buffer_view};

    use super::*;

    fn decoded(coded: &Coded) -> Vec<u8> {
        let mode = match coded.mode {
            "ATTRIBUTES" => Mode::Attributes,
            "TRIANGLES" => Mode::Triangles,
            _ => Mode::Indices,
        };
        let filter = Filter::parse(coded.filter.unwrap_or("NONE")).unwrap();
        decode_buffer_view(mode, filter, coded.count, coded.stride, &coded.bytes, &mut Workspace::default())
            .unwrap()
    }

    fn random(count: usize, range: f32) -> Vec<f32> {
        let mut random = fastrand::Rng::with_seed(7);
        (0..count).map(|_| range * (2.0 * random.f32() - 1.0)).collect()
    }

    #[test]
    fn numbers_come_back_within_half_a_step() {
        for (exponent, range) in [(-18, 0.3_f32), (-8, 2.0), (-17, 40.0)] {
            let values = random(3 * 500, range);
            let coded = numbers(&values, 3, Precision::PowerOfTwo(exponent)).unwrap();
            let bytes = decoded(&coded);
            let back: &[f32] = bytemuck::cast_slice(&bytes);
            let step = 2.0_f32.powi(exponent);
            for (v, b) in values.iter().zip(back) {
                assert!((v - b).abs() <= 0.5 * step * 1.0001, "{v} is {b}");
                assert_eq!(b.to_bits(), nearest(*v, exponent).to_bits());
            }
            assert!(coded.bytes.len() < 3 * 500 * 4);
        }
        // A mantissa ends: the largest number that it holds stands in.
        assert_eq!(nearest(1e9, -18), 8_388_607.0 / 262_144.0);
    }

    #[test]
    fn exact_numbers_keep_every_bit() {
        let values = random(64 * 9, 1e-3);
        let coded = numbers(&values, 64, Precision::Exact).unwrap();
        assert_eq!(decoded(&coded), bytemuck::cast_slice::<f32, u8>(&values));
    }

    #[test]
    fn directions_are_within_their_bits() {
        let raw = random(4 * 400, 1.0);
        let units: Vec<[f32; 4]> = (raw.as_chunks::<4>().0.iter())
            .map(|[x, y, z, w]| {
                let n = glam::Vec3::new(*x, *y, *z).normalize();
                [n.x, n.y, n.z, w.signum()]
            })
            .collect();
        // At 8 bits the decoded numbers are rounded to 8 bits as well.
        for (bits, most_degrees) in [(8, 1.4), (12, 0.07)] {
            let coded = directions(&units, bits).unwrap();
            let bytes = decoded(&coded);
            for (i, unit) in units.iter().enumerate() {
                let c: [f32; 4] = std::array::from_fn(|k| match bits {
                    8 => f32::from(bytes[4 * i + k] as i8) / 127.0,
                    _ => {
                        f32::from(i16::from_le_bytes([bytes[8 * i + 2 * k], bytes[8 * i + 2 * k + 1]]))
                            / 32767.0
                    }
                });
                let cosine = glam::Vec3::from_slice(&c).normalize().dot(glam::Vec3::from_slice(unit));
                assert!(cosine.min(1.0).acos().to_degrees() < most_degrees, "{unit:?} is {c:?}");
                assert_eq!(c[3], unit[3]);
            }
        }
    }

    #[test]
    fn triangles_keep_their_corners_and_their_way_round() {
        let grid: Vec<u32> = (0..20_u32).flat_map(|i| [i, i + 1, i + 21, i + 1, i + 22, i + 21]).collect();
        let coded = triangles(&grid, 2).unwrap();
        let bytes = decoded(&coded);
        let back: Vec<u32> =
            bytes.as_chunks::<2>().0.iter().map(|b| u32::from(u16::from_le_bytes(*b))).collect();
        for (a, b) in grid.as_chunks::<3>().0.iter().zip(back.as_chunks::<3>().0) {
            let turns = [[b[0], b[1], b[2]], [b[1], b[2], b[0]], [b[2], b[0], b[1]]];
            assert!(turns.contains(a), "{a:?} is {b:?}");
        }
        let rising: Vec<u32> = (0..300).map(|i| 3 * i + i % 2).collect();
        let coded = sequence(&rising, 4).unwrap();
        assert_eq!(decoded(&coded), bytemuck::cast_slice::<u32, u8>(&rising));
        assert!(coded.bytes.len() < 2 * rising.len());
    }
}
