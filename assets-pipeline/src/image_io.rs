//! Image files to [`Map`] and back: PNG and TIFF of 8 and 16 bits, TIFF and EXR of floats.
//!
//! Values are those of the file: integers become 0..1 by their largest code, floats stay. No transfer function is
//! applied; what the numbers mean is the converter's business. Alpha is kept apart as coverage.

use std::path::{Path, PathBuf};

use exr::prelude as exr;
use image::{DynamicImage, ImageBuffer};
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;

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
        /// What the decoder says.
        message: String,
    },
    /// The image is readable but not what is asked for.
    #[error("{}, {at}: found {found}, expected {expected}", file.display())]
    Content {
        /// The file.
        file: PathBuf,
        /// Place in it.
        at: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
}

/// How samples are stored in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleKind {
    /// 8-bit integers.
    U8,
    /// 16-bit integers.
    U16,
    /// 16- or 32-bit floats; 32-bit when written.
    F32,
}

/// An image with its alpha apart.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedImage {
    /// Where it comes from, for messages.
    pub file: PathBuf,
    /// Channels without alpha: grey or (R, G, B); an EXR without R, G, B has its channels by name.
    pub map: Map,
    /// Alpha, 1 channel, where the file has one.
    pub alpha: Option<Map>,
    /// How the file stores samples.
    pub kind: SampleKind,
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

/// Reads an image; the kind is told by the content, not by the name.
///
/// # Errors
/// A file that is missing, unreadable or of no known kind.
pub fn load_image(file: &Path) -> Result<LoadedImage, ImageError> {
    let bytes = std::fs::read(file).map_err(|source| ImageError::Io { file: file.to_owned(), source })?;
    if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        return load_exr(file, &bytes);
    }
    let decode = |e: image::ImageError| ImageError::Decode { file: file.to_owned(), message: e.to_string() };
    let mut reader = image::ImageReader::new(std::io::Cursor::new(&bytes));
    reader =
        reader.with_guessed_format().map_err(|source| ImageError::Io { file: file.to_owned(), source })?;
    // Scans of 16k by 16k are usual; the default limit of the decoder is below them.
    reader.no_limits();
    let decoded = reader.decode().map_err(decode)?;
    let (width, height) = (decoded.width(), decoded.height());
    let u8s = |v: Vec<u8>| v.into_iter().map(|c| f32::from(c) / 255.0).collect::<Vec<_>>();
    let u16s = |v: Vec<u16>| v.into_iter().map(|c| f32::from(c) / 65535.0).collect::<Vec<_>>();
    let (kind, channels, values) = match decoded {
        DynamicImage::ImageLuma8(i) => (SampleKind::U8, 1, u8s(i.into_raw())),
        DynamicImage::ImageLumaA8(i) => (SampleKind::U8, 2, u8s(i.into_raw())),
        DynamicImage::ImageRgb8(i) => (SampleKind::U8, 3, u8s(i.into_raw())),
        DynamicImage::ImageRgba8(i) => (SampleKind::U8, 4, u8s(i.into_raw())),
        DynamicImage::ImageLuma16(i) => (SampleKind::U16, 1, u16s(i.into_raw())),
        DynamicImage::ImageLumaA16(i) => (SampleKind::U16, 2, u16s(i.into_raw())),
        DynamicImage::ImageRgb16(i) => (SampleKind::U16, 3, u16s(i.into_raw())),
        DynamicImage::ImageRgba16(i) => (SampleKind::U16, 4, u16s(i.into_raw())),
        DynamicImage::ImageRgb32F(i) => (SampleKind::F32, 3, i.into_raw()),
        DynamicImage::ImageRgba32F(i) => (SampleKind::F32, 4, i.into_raw()),
        other => {
            return Err(ImageError::Content {
                file: file.to_owned(),
                at: "samples".into(),
                found: format!("{:?}", other.color()),
                expected: "grey or RGB of 8, 16 or 32 bits, with or without alpha".into(),
            });
        }
    };
    Ok(split_alpha(file, kind, width, height, channels, values))
}

/// Takes the alpha of interleaved grey-alpha or RGB-alpha values apart.
fn split_alpha(
    file: &Path,
    kind: SampleKind,
    width: u32,
    height: u32,
    channels: u32,
    values: Vec<f32>,
) -> LoadedImage {
    let file = file.to_owned();
    if channels == 1 || channels == 3 {
        return LoadedImage { file, map: Map { width, height, channels, values }, alpha: None, kind };
    }
    let n = channels as usize;
    let alpha = values.iter().skip(n - 1).step_by(n).copied().collect();
    let rest = values.chunks_exact(n).flat_map(|t| &t[..n - 1]).copied().collect();
    LoadedImage {
        file,
        map: Map { width, height, channels: channels - 1, values: rest },
        alpha: Some(Map { width, height, channels: 1, values: alpha }),
        kind,
    }
}

fn load_exr(file: &Path, bytes: &[u8]) -> Result<LoadedImage, ImageError> {
    use exr::{ReadChannels, ReadLayers};
    let decode = |e: exr::Error| ImageError::Decode { file: file.to_owned(), message: e.to_string() };
    let image = exr::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(bytes))
        .map_err(decode)?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.width() as u32, layer.size.height() as u32);
    let channel =
        |name: &str| layer.channel_data.list.iter().find(|c| c.name.to_string().eq_ignore_ascii_case(name));
    let colors: Vec<_> = ["R", "G", "B"].iter().filter_map(|n| channel(n)).collect();
    let colors = if colors.is_empty() {
        layer.channel_data.list.iter().filter(|c| !c.name.to_string().eq_ignore_ascii_case("A")).collect()
    } else {
        colors
    };
    let size = width as usize * height as usize;
    let fail = |found: String, expected: &str| ImageError::Content {
        file: file.to_owned(),
        at: "channels".into(),
        found,
        expected: expected.to_owned(),
    };
    if colors.is_empty() {
        return Err(fail("alpha only".into(), "at least one other channel"));
    }
    if let Some(c) = colors.iter().find(|c| c.sample_data.len() != size) {
        return Err(fail(format!("channel {} is subsampled", c.name), "all channels at full resolution"));
    }
    let mut values = vec![0.0; size * colors.len()];
    for (c, data) in colors.iter().enumerate() {
        for (i, v) in data.sample_data.values_as_f32().enumerate() {
            values[i * colors.len() + c] = v;
        }
    }
    let alpha = channel("A").filter(|c| c.sample_data.len() == size).map(|c| Map {
        width,
        height,
        channels: 1,
        values: c.sample_data.values_as_f32().collect(),
    });
    let map = Map { width, height, channels: colors.len() as u32, values };
    Ok(LoadedImage { file: file.to_owned(), map, alpha, kind: SampleKind::F32 })
}

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
    let io = |source| ImageError::Io { file: file.to_owned(), source };
    let mut temporary = file.as_os_str().to_owned();
    temporary.push(".tmp");
    std::fs::write(&temporary, bytes.into_inner()).map_err(io)?;
    std::fs::rename(&temporary, file).map_err(io)
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
        exr::Encoding::FAST_LOSSLESS,
        AnyChannels::sort(channels),
    );
    Image::from_layer(layer).write().to_buffered(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("rubor-image-io-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        path
    }

    fn ramp(channels: u32) -> Map {
        let values = (0..27 * 51 * channels).map(|i| (i % 1009) as f32 / 1008.0).collect();
        Map { width: 27, height: 51, channels, values }
    }

    #[test]
    fn maps_survive_every_format() {
        let folder = folder("formats");
        for (name, kind, step) in [
            ("a.png", SampleKind::U8, 0.51 / 255.0),
            ("b.png", SampleKind::U16, 0.51 / 65535.0),
            ("c.tif", SampleKind::U16, 0.51 / 65535.0),
            ("d.tiff", SampleKind::F32, 0.0),
            ("e.exr", SampleKind::F32, 0.0),
        ] {
            for channels in [1, 3] {
                let map = ramp(channels);
                save_image(&folder.join(name), &map, kind).unwrap();
                let back = load_image(&folder.join(name)).unwrap();
                assert_eq!(back.kind, kind);
                let back =
                    if channels == 1 { back.require_grey().unwrap() } else { back.require_rgb().unwrap() };
                assert_eq!((back.width, back.height, back.channels), (27, 51, channels), "{name}");
                for (a, b) in map.values.iter().zip(&back.values) {
                    assert!((a - b).abs() <= step, "{name}: {a} {b}");
                }
            }
        }
        save_image(&folder.join("slopes.exr"), &ramp(2), SampleKind::F32).unwrap();
        assert_eq!(load_image(&folder.join("slopes.exr")).unwrap().map, ramp(2));
        assert!(!folder.join("e.exr.tmp").exists());
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn alpha_becomes_a_mask() {
        let folder = folder("alpha");
        let file = folder.join("a.png");
        let image =
            image::RgbaImage::from_fn(4, 2, |x, _| image::Rgba([10, 20, 30, if x < 2 { 255 } else { 0 }]));
        image.save(&file).unwrap();
        let loaded = load_image(&file).unwrap();
        assert_eq!(loaded.map.channels, 3);
        assert_eq!(loaded.mask().mapped, [true, true, false, false, true, true, false, false]);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn errors_name_file_place_and_expectation() {
        let folder = folder("errors");
        let message = |e: ImageError| e.to_string();
        assert!(message(load_image(&folder.join("none.png")).unwrap_err()).contains("none.png"));
        std::fs::write(folder.join("text.png"), b"not an image").unwrap();
        assert!(message(load_image(&folder.join("text.png")).unwrap_err()).contains("not a readable image"));
        std::fs::write(folder.join("cut.exr"), [0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0, 9]).unwrap();
        assert!(load_image(&folder.join("cut.exr")).is_err());

        let mut bad = ramp(1);
        bad.values[27 + 3] = f32::NAN;
        save_image(&folder.join("nan.exr"), &bad, SampleKind::F32).unwrap();
        let loaded = load_image(&folder.join("nan.exr")).unwrap();
        let error = loaded.require_finite(&loaded.mask()).unwrap_err();
        assert!(message(error).contains("texel (3, 1): found [NaN]"));
        assert!(message(loaded.require_size(3, 4).unwrap_err()).contains("27x51"));
        save_image(&folder.join("color.png"), &ramp(3), SampleKind::U8).unwrap();
        let error = load_image(&folder.join("color.png")).unwrap().require_grey().unwrap_err();
        assert!(message(error).contains("a grey image"));
        assert!(
            message(save_image(&folder.join("a.gif"), &bad, SampleKind::U8).unwrap_err()).contains(".png")
        );
        assert!(
            message(save_image(&folder.join("a.png"), &bad, SampleKind::F32).unwrap_err()).contains("floats")
        );
        std::fs::remove_dir_all(folder).unwrap();
    }
}
