//! Image files to [`Map`] and back: PNG, JPEG and WebP, TIFF of whole numbers and floats, OpenEXR, Radiance.
//!
//! ```text
//! bytes --limits--> exr       layer by the meaning of its channels, display window --+
//!                   radiance  exposure, order of scan lines -------------------------+--> LoadedImage: values, alpha,
//!                   tiff      grey, RGB, two channels; any sample type --------------+    notes
//!                   raster    PNG, JPEG, WebP, other TIFF, upright by Exif ----------+
//! ```
//!
//! Values are those of the file: integers become 0..1 by their largest code, floats stay. No transfer function is
//! applied; what the numbers mean is the converter's business. Alpha is kept apart as coverage. What a reader chose,
//! left out or rotated is in [`LoadedImage::notes`]. `docs/interchange.md` lists what is read, refused and repaired.

use std::io::Read;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageBuffer};
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;

pub use self::limits::Limits;
pub use self::stored::{PictureLayer, StoredExr, load_stored_exr};
pub use self::write::save_image;

mod channels;
mod exr;
mod limits;
mod orientation;
mod radiance;
mod raster;
mod stored;
mod tiff;
mod write;

#[cfg(test)]
mod tests;

/// An image that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be opened, read or written.
    #[error("{}: cannot be read or written", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The bytes are not an image of a known kind.
    #[error("{}: not a readable image: {message}", file.display())]
    Decode {
        /// The file.
        file: PathBuf,
        /// The decoder's message.
        message: String,
    },
    /// The image is readable but of the wrong kind.
    #[error("{}, {at}: found {found}, expected {expected}", file.display())]
    Content {
        /// The file.
        file: PathBuf,
        /// Place in it.
        at: String,
        /// The value there.
        found: String,
        /// The values that are allowed.
        expected: String,
    },
}

/// How samples are stored in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleKind {
    /// 8-bit integers.
    U8,
    /// 16-bit integers, and wider ones of a TIFF that was read.
    U16,
    /// 16-, 32- or 64-bit floats; 32-bit when written.
    F32,
}

/// An image with its alpha apart.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedImage {
    /// Where it comes from, for messages.
    pub file: PathBuf,
    /// Channels without alpha: grey, (R, G, B), (x, y, z) or two channels such as slopes.
    pub map: Map,
    /// Alpha, 1 channel, where the file has one.
    pub alpha: Option<Map>,
    /// How the file stores samples.
    pub kind: SampleKind,
    /// Notes on everything that the reader chose, left out or rotated.
    pub notes: Vec<String>,
}

/// Which layer a reader prefers where a file holds several and none is named.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Purpose {
    /// A picture or a map of values: the unnamed layer, then one called combined, beauty, rgba or the like.
    #[default]
    Values,
    /// A normal map: a layer called normal, N or the like, then as for values.
    Normals,
}

/// How an image is read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Limits on the claims of a header.
    pub limits: Limits,
    /// Part, layer or channel of an EXR by its name, or by the last word of it (`Normal` of `ViewLayer.Normal`), in
    /// any case of letters. Images of other kinds have no layers and refuse a name.
    pub layer: Option<String>,
    /// How a layer is chosen if none is named.
    pub purpose: Purpose,
}

impl LoadedImage {
    /// Texels with alpha above one half; all of them without alpha.
    pub fn mask(&self) -> Mask {
        match &self.alpha {
            Some(alpha) => Mask::above(alpha, 0, 0.5),
            None => Mask::full(self.map.width, self.map.height),
        }
    }

    /// An error about this file.
    pub fn content_error(
        &self,
        at: impl Into<String>,
        found: impl Into<String>,
        expected: &str,
    ) -> ImageError {
        ImageError::Content {
            file: self.file.clone(),
            at: at.into(),
            found: found.into(),
            expected: expected.to_owned(),
        }
    }

    /// Fails unless the image has this size.
    ///
    /// # Errors
    /// Another size.
    pub fn require_size(&self, width: u32, height: u32) -> Result<(), ImageError> {
        if (self.map.width, self.map.height) == (width, height) {
            return Ok(());
        }
        let found = format!("{}x{} texels", self.map.width, self.map.height);
        Err(self.content_error("size", found, &format!("{width}x{height}")))
    }

    /// Fails where a mapped texel is not finite.
    ///
    /// # Errors
    /// The first such texel.
    pub fn require_finite(&self, mask: &Mask) -> Result<(), ImageError> {
        let channels = self.map.channels as usize;
        for (i, texel) in self.map.values.chunks_exact(channels).enumerate() {
            if mask.mapped[i] && texel.iter().any(|v| !v.is_finite()) {
                let (x, y) = (i % self.map.width as usize, i / self.map.width as usize);
                let expected = "finite values in mapped texels (alpha 0 or a mask excludes a texel)";
                return Err(self.content_error(format!("texel ({x}, {y})"), format!("{texel:?}"), expected));
            }
        }
        Ok(())
    }

    /// The one channel of a grey image; a coloured one only when its channels are equal.
    ///
    /// # Errors
    /// Channels that differ, naming the first texel.
    pub fn require_grey(&self) -> Result<Map, ImageError> {
        let channels = self.map.channels as usize;
        for (i, texel) in self.map.values.chunks_exact(channels).enumerate() {
            // A hair over half a code of 8 bits: grey survives a round trip through lossy tools.
            if texel.iter().any(|v| (v - texel[0]).abs() > 0.003) {
                let (x, y) = (i % self.map.width as usize, i / self.map.width as usize);
                let expected = "a grey image: one channel, or channels that are equal";
                return Err(self.content_error(format!("texel ({x}, {y})"), format!("{texel:?}"), expected));
            }
        }
        let values = self.map.values.iter().step_by(channels).copied().collect();
        Ok(Map { channels: 1, values, ..self.map })
    }

    /// The image as three channels; grey is repeated.
    ///
    /// # Errors
    /// Another number of channels.
    pub fn require_rgb(&self) -> Result<Map, ImageError> {
        match self.map.channels {
            3 => Ok(self.map.clone()),
            1 => {
                let values = self.map.values.iter().flat_map(|v| [*v; 3]).collect();
                Ok(Map { channels: 3, values, ..self.map })
            }
            n => Err(self.content_error("channels", n.to_string(), "3 (R, G, B)")),
        }
    }
}

/// Reads an image with the default options; the kind is told by the content, not by the name.
///
/// # Errors
/// As for [`load_image_with`].
pub fn load_image(file: &Path) -> Result<LoadedImage, ImageError> {
    load_image_with(file, &ReadOptions::default())
}

/// Reads an image; the kind is told by the content, not by the name.
///
/// # Errors
/// A file that is missing, unreadable, of no known kind or beyond the limits; an EXR whose channels have no known
/// meaning; a layer that the file lacks.
pub fn load_image_with(file: &Path, options: &ReadOptions) -> Result<LoadedImage, ImageError> {
    let bytes = read_file(file, &options.limits)?;
    decode_image(file, &bytes, options)
}

/// Decodes the bytes of an image file; `file` is for messages.
///
/// # Errors
/// As for [`load_image_with`].
pub fn decode_image(file: &Path, bytes: &[u8], options: &ReadOptions) -> Result<LoadedImage, ImageError> {
    if exr::matches(bytes) {
        return Ok(contained(file, || exr::read(file, bytes, options))?.image);
    }
    if let Some(layer) = &options.layer {
        return Err(ImageError::Content {
            file: file.to_owned(),
            at: "layer".into(),
            found: format!("{layer:?}"),
            expected: "an OpenEXR, or no name of a layer: other images have none".into(),
        });
    }
    if radiance::matches(bytes) {
        return radiance::read(file, bytes, &options.limits);
    }
    if tiff::matches(bytes)
        && let Some(image) = contained(file, || tiff::read(file, bytes, &options.limits))?
    {
        return Ok(image);
    }
    let (decoded, notes) =
        contained(file, || raster::decode(file, bytes, &options.limits, raster::Turn::Upright))?;
    from_dynamic(file, decoded, notes)
}

/// A decoded picture with the samples of its file.
#[derive(Clone, Debug)]
pub struct LoadedPicture {
    /// The picture, upright.
    pub image: DynamicImage,
    /// Notes on everything that the reader left out or rotated.
    pub notes: Vec<String>,
}

/// Reads a picture and keeps the type of its samples: 8 and 16 bits of PNG, JPEG, WebP and TIFF, floats of TIFF and
/// Radiance. The Exif orientation is applied.
///
/// # Errors
/// As for [`load_image_with`]; an OpenEXR, whose channels are no picture before a layer is chosen.
pub fn load_picture(file: &Path, limits: &Limits) -> Result<LoadedPicture, ImageError> {
    let bytes = read_file(file, limits)?;
    if exr::matches(&bytes) {
        return Err(ImageError::Content {
            file: file.to_owned(),
            at: "kind".into(),
            found: "an OpenEXR".into(),
            expected: "PNG, JPEG, WebP, TIFF or Radiance".into(),
        });
    }
    let values = if radiance::matches(&bytes) {
        Some(radiance::read(file, &bytes, limits)?)
    } else if tiff::matches(&bytes) {
        contained(file, || tiff::read(file, &bytes, limits))?
    } else {
        None
    };
    if let Some(values) = values {
        let notes = values.notes.clone();
        return Ok(LoadedPicture { image: to_picture(values)?, notes });
    }
    let (image, notes) = contained(file, || raster::decode(file, &bytes, limits, raster::Turn::Upright))?;
    Ok(LoadedPicture { image, notes })
}

/// Decodes a picture as stored, without regard to its Exif orientation: texture coordinates count from the stored
/// corner (glTF 2.0, 3.8.2). `name` is for messages.
///
/// # Errors
/// Bytes that are no PNG, JPEG, WebP or TIFF, or beyond the limits.
pub fn decode_stored(name: &Path, bytes: &[u8], limits: &Limits) -> Result<DynamicImage, ImageError> {
    Ok(contained(name, || raster::decode(name, bytes, limits, raster::Turn::AsStored))?.0)
}

/// Reads a picture as stored (see [`decode_stored`]).
///
/// # Errors
/// As for [`decode_stored`]; a file that is missing, no regular file or beyond the limits.
pub fn load_stored(file: &Path, limits: &Limits) -> Result<DynamicImage, ImageError> {
    decode_stored(file, &read_file(file, limits)?, limits)
}

/// An image for [`crate::environment`], and whether its header says that it is a cube map.
pub(crate) fn load_environment(
    file: &Path,
    options: &ReadOptions,
) -> Result<(LoadedImage, bool), ImageError> {
    let bytes = read_file(file, &options.limits)?;
    if exr::matches(&bytes) {
        let found = contained(file, || exr::read(file, &bytes, options))?;
        return Ok((found.image, found.is_cube_map));
    }
    Ok((decode_image(file, &bytes, options)?, false))
}

/// Runs a decoder of another crate. Those check their arithmetic late or not at all (`tiff` 0.11 multiplies tags of the
/// file, `exr` 1.74 adds window corners), so a panic of theirs on hostile bytes becomes the error that it should be.
fn contained<T>(file: &Path, decode: impl FnOnce() -> Result<T, ImageError>) -> Result<T, ImageError> {
    // No state outlives a failed call: the closure owns its decoder and only borrows bytes.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        let message = "the decoder failed on values that no valid file has".into();
        Err(ImageError::Decode { file: file.to_owned(), message })
    })
}

/// All bytes of a regular file; a device or a pipe may never end.
fn read_file(file: &Path, limits: &Limits) -> Result<Vec<u8>, ImageError> {
    let io = |source| ImageError::Io { file: file.to_owned(), source };
    let fail = |found: String, expected: String| ImageError::Content {
        file: file.to_owned(),
        at: "file".into(),
        found,
        expected,
    };
    let metadata = std::fs::metadata(file).map_err(io)?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(fail(found.into(), "a regular file".into()));
    }
    if metadata.len() > limits.bytes {
        return Err(fail(format!("{} bytes", metadata.len()), format!("at most {}", limits.bytes)));
    }
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    // A file may grow while it is read.
    std::fs::File::open(file).map_err(io)?.take(limits.bytes).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

fn from_dynamic(file: &Path, decoded: DynamicImage, notes: Vec<String>) -> Result<LoadedImage, ImageError> {
    let size = (decoded.width(), decoded.height());
    let u8s = |codes: &[u8], n| to_map(codes, size, n, |c| f32::from(c) / 255.0);
    let u16s = |codes: &[u16], n| to_map(codes, size, n, |c| f32::from(c) / 65535.0);
    let (kind, (map, alpha)) = match &decoded {
        DynamicImage::ImageLuma8(i) => (SampleKind::U8, u8s(i.as_raw(), 1)),
        DynamicImage::ImageLumaA8(i) => (SampleKind::U8, u8s(i.as_raw(), 2)),
        DynamicImage::ImageRgb8(i) => (SampleKind::U8, u8s(i.as_raw(), 3)),
        DynamicImage::ImageRgba8(i) => (SampleKind::U8, u8s(i.as_raw(), 4)),
        DynamicImage::ImageLuma16(i) => (SampleKind::U16, u16s(i.as_raw(), 1)),
        DynamicImage::ImageLumaA16(i) => (SampleKind::U16, u16s(i.as_raw(), 2)),
        DynamicImage::ImageRgb16(i) => (SampleKind::U16, u16s(i.as_raw(), 3)),
        DynamicImage::ImageRgba16(i) => (SampleKind::U16, u16s(i.as_raw(), 4)),
        other => {
            return Err(ImageError::Content {
                file: file.to_owned(),
                at: "samples".into(),
                found: format!("{:?}", other.color()),
                expected: "grey or RGB of 8 or 16 bits, with or without alpha".into(),
            });
        }
    };
    Ok(LoadedImage { file: file.to_owned(), map, alpha, kind, notes })
}

/// Values of interleaved samples, alpha apart where there are two or four.
fn to_map<T: Copy>(
    samples: &[T],
    size: (u32, u32),
    channels: usize,
    value: impl Fn(T) -> f32,
) -> (Map, Option<Map>) {
    if channels.is_multiple_of(2) {
        let (map, alpha) = separated(samples, size, channels, value);
        return (map, Some(alpha));
    }
    let values = samples.iter().map(|s| value(*s)).collect();
    (Map { width: size.0, height: size.1, channels: channels as u32, values }, None)
}

/// Values and alpha, the last channel, of interleaved samples.
fn separated<T: Copy>(
    samples: &[T],
    (width, height): (u32, u32),
    channels: usize,
    value: impl Fn(T) -> f32,
) -> (Map, Map) {
    let texels = samples.chunks_exact(channels);
    let alpha = texels.clone().map(|t| value(t[channels - 1])).collect();
    let values = texels.flat_map(|t| &t[..channels - 1]).map(|s| value(*s)).collect();
    (
        Map { width, height, channels: channels as u32 - 1, values },
        Map { width, height, channels: 1, values: alpha },
    )
}

/// Values back in the samples of their file.
fn to_picture(loaded: LoadedImage) -> Result<DynamicImage, ImageError> {
    let (w, h) = (loaded.map.width, loaded.map.height);
    let (mut channels, mut values) = (loaded.map.channels as usize, loaded.map.values);
    // The picture type knows no grey of floats.
    if loaded.kind == SampleKind::F32 && channels == 1 {
        values = values.iter().flat_map(|v| [*v; 3]).collect();
        channels = 3;
    }
    if let Some(alpha) = &loaded.alpha {
        let texels = values.chunks_exact(channels).zip(&alpha.values);
        values = texels.flat_map(|(t, a)| t.iter().chain([a])).copied().collect();
        channels += 1;
    }
    let codes = |max: f32| values.iter().map(move |v| (v * max).round());
    let u8s = || codes(255.0).map(|c| c as u8).collect();
    let u16s = || codes(65535.0).map(|c| c as u16).collect();
    let with_alpha = loaded.alpha.is_some();
    let picture = match (loaded.kind, channels, with_alpha) {
        (SampleKind::U8, 1, _) => ImageBuffer::from_raw(w, h, u8s()).map(DynamicImage::ImageLuma8),
        (SampleKind::U8, 2, true) => ImageBuffer::from_raw(w, h, u8s()).map(DynamicImage::ImageLumaA8),
        (SampleKind::U8, 3, false) => ImageBuffer::from_raw(w, h, u8s()).map(DynamicImage::ImageRgb8),
        (SampleKind::U8, 4, true) => ImageBuffer::from_raw(w, h, u8s()).map(DynamicImage::ImageRgba8),
        (SampleKind::U16, 1, _) => ImageBuffer::from_raw(w, h, u16s()).map(DynamicImage::ImageLuma16),
        (SampleKind::U16, 2, true) => ImageBuffer::from_raw(w, h, u16s()).map(DynamicImage::ImageLumaA16),
        (SampleKind::U16, 3, false) => ImageBuffer::from_raw(w, h, u16s()).map(DynamicImage::ImageRgb16),
        (SampleKind::U16, 4, true) => ImageBuffer::from_raw(w, h, u16s()).map(DynamicImage::ImageRgba16),
        (SampleKind::F32, 3, false) => ImageBuffer::from_raw(w, h, values).map(DynamicImage::ImageRgb32F),
        (SampleKind::F32, 4, true) => ImageBuffer::from_raw(w, h, values).map(DynamicImage::ImageRgba32F),
        _ => None,
    };
    picture.ok_or_else(|| ImageError::Content {
        file: loaded.file.clone(),
        at: "samples".into(),
        found: format!("{channels} channels"),
        expected: "grey or RGB, with or without alpha".into(),
    })
}
