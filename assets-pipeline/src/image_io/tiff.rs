//! TIFF with any count and type of samples: the `image` crate reads RGB of floats, but no grey of floats and no grey
//! with alpha, so samples come straight from the `tiff` crate that it is built on.

use std::io::Cursor;
use std::path::Path;

use image::metadata::Orientation;
use rubor_rig::map::Map;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::Tag;

use super::{ImageError, Limits, LoadedImage, SampleKind, orientation, separated};

/// Tells whether these bytes open a TIFF or a BigTIFF.
pub(super) fn matches(bytes: &[u8]) -> bool {
    [*b"II*\0", *b"MM\0*", *b"II+\0", *b"MM\0+"].iter().any(|m| bytes.starts_with(m))
}

/// Reads grey, RGB and two-channel TIFF; `None` where the file has other colours (palette, CMYK, Lab), which the
/// `image` crate reads or refuses.
pub(super) fn read(file: &Path, bytes: &[u8], limits: &Limits) -> Result<Option<LoadedImage>, ImageError> {
    let decode = |e: tiff::TiffError| ImageError::Decode { file: file.to_owned(), message: e.to_string() };
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(decode)?;
    let (channels, bits, has_alpha) = match decoder.colortype().map_err(decode)? {
        // Bits and nibbles are packed: the `image` crate unpacks those that it knows.
        ColorType::Gray(bits) if bits >= 8 => (1, bits, false),
        ColorType::RGB(bits) => (3, bits, false),
        ColorType::RGBA(bits) => (4, bits, true),
        ColorType::GrayA(bits) => (2, bits, true),
        ColorType::Multiband { bit_depth, num_samples } => {
            let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples).map_err(decode)?;
            // 1 and 2 are associated and unassociated alpha (TIFF 6.0, section 18).
            let has_alpha = num_samples > 1 && extra.is_some_and(|kinds| matches!(kinds[..], [1 | 2]));
            (usize::from(num_samples), bit_depth, has_alpha)
        }
        _ => return Ok(None),
    };
    let shown = channels.saturating_sub(usize::from(has_alpha));
    if !(1..=3).contains(&shown) {
        return Err(ImageError::Content {
            file: file.to_owned(),
            at: "samples".into(),
            found: format!("{channels} samples per texel"),
            expected: "1 to 3, and alpha".into(),
        });
    }
    let (width, height) = decoder.dimensions().map_err(decode)?;
    let bytes_per_pixel = channels as u64 * (u64::from(bits).div_ceil(8) + 4);
    let size = (u64::from(width), u64::from(height));
    let (width, height) = limits.check(file, "size", size, bytes_per_pixel)?;
    let mut tiff_limits = tiff::decoder::Limits::default();
    let most = usize::try_from(limits.bytes).unwrap_or(usize::MAX);
    tiff_limits.decoding_buffer_size = most;
    tiff_limits.intermediate_buffer_size = most;
    let mut decoder = decoder.with_limits(tiff_limits);

    let turned = decoder.find_tag(Tag::Orientation).map_err(decode)?;
    let turned = turned
        .and_then(|v| Orientation::from_exif(u8::try_from(v.into_u16().ok()?).ok()?))
        .unwrap_or(Orientation::NoTransforms);
    let mut samples = DecodingResult::U8(Vec::new());
    let layout = decoder.read_image_to_buffer(&mut samples).map_err(decode)?;
    let planes = layout.planes.max(1);
    let (kind, values) = floats(samples).ok_or_else(|| ImageError::Content {
        file: file.to_owned(),
        at: "samples".into(),
        found: "signed whole numbers".into(),
        expected: "unsigned whole numbers or floats".into(),
    })?;
    let pixels = width as usize * height as usize;
    let per_pixel = values.len() / pixels;
    if per_pixel * pixels != values.len() || per_pixel < channels || (planes > 1 && planes != per_pixel) {
        return Err(ImageError::Content {
            file: file.to_owned(),
            at: "samples".into(),
            found: format!("{} samples", values.len()),
            expected: format!("{channels} for each of {pixels} texels"),
        });
    }
    // Planes follow each other or samples of a texel do; samples beyond the known ones are left out.
    let values = if planes > 1 {
        (0..pixels).flat_map(|i| (0..channels).map(move |c| c * pixels + i)).map(|i| values[i]).collect()
    } else if per_pixel > channels {
        values.chunks_exact(per_pixel).flat_map(|t| &t[..channels]).copied().collect()
    } else {
        values
    };
    let mut notes: Vec<String> = orientation::note(turned).into_iter().collect();
    if per_pixel > channels {
        notes.push(format!("{} more samples per texel were not read", per_pixel - channels));
    }
    if decoder.more_images() {
        notes.push("the file holds several pages; the first was read".into());
    }
    let (map, alpha) = if has_alpha {
        let (map, alpha) = separated(&values, (width, height), channels, |v| v);
        (map, Some(alpha))
    } else {
        (Map { width, height, channels: channels as u32, values }, None)
    };
    let map = orientation::applied(map, turned);
    let alpha = alpha.map(|a| orientation::applied(a, turned));
    Ok(Some(LoadedImage { file: file.to_owned(), map, alpha, kind, notes }))
}

/// Samples as floats; `None` for signed whole numbers, whose zero could be anywhere.
fn floats(samples: DecodingResult) -> Option<(SampleKind, Vec<f32>)> {
    Some(match samples {
        DecodingResult::U8(v) => (SampleKind::U8, v.into_iter().map(|c| f32::from(c) / 255.0).collect()),
        DecodingResult::U16(v) => (SampleKind::U16, v.into_iter().map(|c| f32::from(c) / 65535.0).collect()),
        DecodingResult::U32(v) => {
            let value = |c: u32| (f64::from(c) / f64::from(u32::MAX)) as f32;
            (SampleKind::U16, v.into_iter().map(value).collect())
        }
        DecodingResult::U64(v) => {
            let value = |c: u64| (c as f64 / u64::MAX as f64) as f32;
            (SampleKind::U16, v.into_iter().map(value).collect())
        }
        DecodingResult::F16(v) => (SampleKind::F32, v.into_iter().map(|c| c.to_f32()).collect()),
        DecodingResult::F32(v) => (SampleKind::F32, v),
        DecodingResult::F64(v) => (SampleKind::F32, v.into_iter().map(|c| c as f32).collect()),
        _ => return None,
    })
}
