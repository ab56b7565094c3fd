//! Maps to image files.

use std::path::Path;

use exr::prelude as exr;
use image::{DynamicImage, ImageBuffer};
use rubor_rig::map::Map;

use super::{ImageError, SampleKind};

/// Writes a map by the extension of the file: `.png` (8 or 16 bits), `.tif`/`.tiff`, `.exr` (floats).
///
/// Integers clamp to 0..1 and round. Two channels become (R, G, 0) in PNG and TIFF and channels R, G in EXR. The file
/// appears under its name only when it is complete.
///
/// # Errors
/// Another extension, more than 3 channels, floats in a PNG, or a folder that cannot be written.
pub fn save_image(file: &Path, map: &Map, kind: SampleKind) -> Result<(), ImageError> {
    let fail = |at: &str, found: String, expected: &str| {
        Err(ImageError::Content {
            file: file.to_owned(),
            at: at.into(),
            found,
            expected: expected.to_owned(),
        })
    };
    if !(1..=3).contains(&map.channels) {
        return fail("channels", map.channels.to_string(), "1 to 3");
    }
    let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let mut bytes = std::io::Cursor::new(Vec::new());
    let encode = |message: String| ImageError::Decode { file: file.to_owned(), message };
    match extension.as_str() {
        "exr" => write_exr(map, &mut bytes).map_err(|e| encode(e.to_string()))?,
        "png" | "tif" | "tiff" => {
            if extension == "png" && kind == SampleKind::F32 {
                return fail("samples", "floats".into(), "8 or 16 bits in a PNG; floats go to .exr or .tiff");
            }
            let format = if extension == "png" { image::ImageFormat::Png } else { image::ImageFormat::Tiff };
            to_dynamic(map, kind).write_to(&mut bytes, format).map_err(|e| encode(e.to_string()))?;
        }
        other => return fail("file name", format!("extension {other:?}"), ".png, .tif, .tiff or .exr"),
    }
    crate::files::replace(file, &bytes.into_inner())
        .map_err(|source| ImageError::Io { file: file.to_owned(), source })
}

fn to_dynamic(map: &Map, kind: SampleKind) -> DynamicImage {
    let (w, h) = (map.width, map.height);
    let padded;
    let (channels, values) = if map.channels == 2 {
        padded = map.values.chunks_exact(2).flat_map(|t| [t[0], t[1], 0.0]).collect::<Vec<_>>();
        (3, &padded)
    } else {
        (map.channels, &map.values)
    };
    let code = |v: f32, max: f32| (v.clamp(0.0, 1.0) * max + 0.5).floor();
    let expect = "the buffer has the size of the map";
    match (kind, channels) {
        (SampleKind::U8, 1) => {
            let codes = values.iter().map(|v| code(*v, 255.0) as u8).collect();
            DynamicImage::ImageLuma8(ImageBuffer::from_raw(w, h, codes).expect(expect))
        }
        (SampleKind::U8, _) => {
            let codes = values.iter().map(|v| code(*v, 255.0) as u8).collect();
            DynamicImage::ImageRgb8(ImageBuffer::from_raw(w, h, codes).expect(expect))
        }
        (SampleKind::U16, 1) => {
            let codes = values.iter().map(|v| code(*v, 65535.0) as u16).collect();
            DynamicImage::ImageLuma16(ImageBuffer::from_raw(w, h, codes).expect(expect))
        }
        (SampleKind::U16, _) => {
            let codes = values.iter().map(|v| code(*v, 65535.0) as u16).collect();
            DynamicImage::ImageRgb16(ImageBuffer::from_raw(w, h, codes).expect(expect))
        }
        (SampleKind::F32, 1) => {
            let values = values.iter().flat_map(|v| [*v; 3]).collect();
            DynamicImage::ImageRgb32F(ImageBuffer::from_raw(w, h, values).expect(expect))
        }
        (SampleKind::F32, _) => {
            DynamicImage::ImageRgb32F(ImageBuffer::from_raw(w, h, values.clone()).expect(expect))
        }
    }
}

fn write_exr(map: &Map, out: &mut std::io::Cursor<Vec<u8>>) -> exr::Result<()> {
    use exr::{AnyChannel, AnyChannels, FlatSamples, Image, Layer, SmallVec, WritableImage};
    let names: &[&str] = if map.channels == 1 { &["Y"] } else { &["R", "G", "B"][..map.channels as usize] };
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = names
        .iter()
        .enumerate()
        .map(|(c, name)| {
            let samples = map.values.iter().skip(c).step_by(map.channels as usize).copied().collect();
            AnyChannel::new(*name, FlatSamples::F32(samples))
        })
        .collect();
    let layer = Layer::new(
        (map.width as usize, map.height as usize),
        exr::LayerAttributes::named("map"),
        // Blocks in a fixed order: equal maps give equal bytes, however many threads compress them.
        exr::Encoding { line_order: exr::LineOrder::Increasing, ..exr::Encoding::FAST_LOSSLESS },
        AnyChannels::sort(channels),
    );
    Image::from_layer(layer).write().to_buffered(out)
}
