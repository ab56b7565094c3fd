//! PNG, JPEG, WebP and the TIFFs of the `image` crate, upright and within limits.

use std::io::Cursor;
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::{ImageError, Limits, orientation};

/// Whether a picture is turned as its Exif tag says.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Turn {
    Upright,
    AsStored,
}

pub(super) fn decode(
    file: &Path,
    bytes: &[u8],
    limits: &Limits,
    turn: Turn,
) -> Result<(DynamicImage, Vec<String>), ImageError> {
    let fail = |message: String| ImageError::Decode { file: file.to_owned(), message };
    let decode = |e: image::ImageError| fail(e.to_string());
    let format = image::guess_format(bytes).ok();
    let Some(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP | ImageFormat::Tiff)) =
        format
    else {
        let known = "PNG, JPEG, TIFF, WebP, Radiance (#?) or OpenEXR";
        return Err(fail(format!("its first bytes are of no known kind, expected those of {known}")));
    };
    let mut notes = Vec::new();
    let mut late_exif = None;
    match format {
        ImageFormat::Jpeg => require_end_of_jpeg(bytes).map_err(&fail)?,
        ImageFormat::Png => late_exif = png_chunks(bytes, &mut notes),
        // "ANIM" of the flags of a VP8X chunk (WebP container specification, "Extended file format").
        ImageFormat::WebP
            if bytes.get(12..16) == Some(b"VP8X") && bytes.get(20).is_some_and(|f| f & 2 != 0) =>
        {
            notes.push("the picture moves; its first frame was read".into());
        }
        _ => {}
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut image_limits = image::Limits::no_limits();
    image_limits.max_alloc = Some(limits.bytes);
    reader.limits(image_limits);
    let mut decoder = reader.into_decoder().map_err(decode)?;
    let (width, height) = decoder.dimensions();
    let color = decoder.color_type();
    // Samples as decoded and the floats made of them; a progressive JPEG keeps its 16-bit coefficients as well.
    let extra = if format == ImageFormat::Jpeg { 2 } else { 0 };
    let per_pixel = u64::from(color.bytes_per_pixel()) * (1 + extra) + 4 * u64::from(color.channel_count());
    limits.check(file, "size", (u64::from(width), u64::from(height)), per_pixel)?;

    let turned = if turn == Turn::Upright {
        // TIFF has a tag of its own; the others carry Exif, some writers with the prefix that only JPEG has.
        let exif = decoder.exif_metadata().map_err(decode)?.or(late_exif);
        let in_exif = exif
            .as_deref()
            .and_then(|e| Orientation::from_exif_chunk(e.strip_prefix(b"Exif\0\0").unwrap_or(e)));
        match in_exif {
            Some(orientation) => orientation,
            None => decoder.orientation().map_err(decode)?,
        }
    } else {
        Orientation::NoTransforms
    };
    let mut image = DynamicImage::from_decoder(decoder).map_err(decode)?;
    image.apply_orientation(turned);
    notes.extend(orientation::note(turned));
    Ok((image, notes))
}

/// The decoder fills what a cut JPEG lacks with grey and says nothing, so the end is looked for here.
fn require_end_of_jpeg(bytes: &[u8]) -> Result<(), String> {
    let last = |marker: u8| bytes.windows(2).rposition(|w| w == [0xff, marker]);
    // Start of scan and end of image (ITU T.81, table B.1); neither occurs within a scan.
    match (last(0xda), last(0xd9)) {
        (Some(scan), Some(end)) if end > scan => Ok(()),
        _ => Err("the JPEG is cut: found no end of image after the last scan".into()),
    }
}

/// Exif data behind the pixels, where the decoder does not look (PNG, third edition, 11.3.4.5); notes an
/// animation.
fn png_chunks(bytes: &[u8], notes: &mut Vec<String>) -> Option<Vec<u8>> {
    let mut rest = bytes.get(8..)?;
    let mut exif = None;
    while let Some((head, body)) = rest.split_at_checked(8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        match &head[4..] {
            b"acTL" => notes.push("the picture moves; its first frame was read".into()),
            b"IEND" => break,
            b"eXIf" => exif = Some(body.get(..length)?.to_vec()),
            _ => {}
        }
        // Four bytes of checksum follow; the decoder compares those that it reads.
        match body.get(length.saturating_add(4)..) {
            Some(next) => rest = next,
            None => break,
        }
    }
    exif
}
