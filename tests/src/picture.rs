//! 8-bit pictures: files, how far two of them are apart, and the picture of that difference.

use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rubor_assets::compare::{Pixels, flip, mean_and_percentile};

/// Factor of the difference in [`Picture::difference`]: one step of 255 is visible.
const AMPLIFICATION: u32 = 16;

/// RGB pixels with the sRGB transfer, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels.
    pub pixels: Vec<[u8; 3]>,
}

/// What is wrong with the file of a picture.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {reason}")]
pub struct PictureError {
    /// Path.
    pub file: String,
    /// What the reader or the writer found.
    pub reason: String,
}

impl PictureError {
    fn new(file: &Path, reason: impl std::fmt::Display) -> Self {
        Self { file: file.display().to_string(), reason: reason.to_string() }
    }
}

/// How far a picture is from its reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Largest difference of two values, steps of 255.
    pub largest: u8,
    /// Pixels that differ.
    pub pixels: usize,
    /// Mean of FLIP, 0 (no visible difference) to 1.
    pub flip_mean: f64,
}

impl Picture {
    /// From RGBA bytes; alpha is left out.
    pub fn from_rgba(width: u32, height: u32, rgba: &[u8]) -> Self {
        Self {
            width,
            height,
            pixels: rgba.as_chunks::<4>().0.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect(),
        }
    }

    /// Reads a PNG of 8 bits.
    ///
    /// # Errors
    /// No such file, or no picture.
    pub fn read(file: &Path) -> Result<Self, PictureError> {
        let image = image::open(file).map_err(|e| PictureError::new(file, e))?.into_rgb8();
        let (width, height) = image.dimensions();
        Ok(Self { width, height, pixels: image.as_chunks::<3>().0.to_vec() })
    }

    /// Writes a PNG, as small as the encoder can.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), PictureError> {
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
            .write_image(self.pixels.as_flattened(), self.width, self.height, ExtendedColorType::Rgb8)
            .map_err(|e| PictureError::new(file, e))?;
        std::fs::write(file, bytes).map_err(|e| PictureError::new(file, e))
    }

    /// The absolute difference to another picture of the same size, amplified by 16.
    pub fn difference(&self, other: &Self) -> Self {
        let amplified = |a: u8, b: u8| (u32::from(a.abs_diff(b)) * AMPLIFICATION).min(255) as u8;
        let pixel = |(a, b): (&[u8; 3], &[u8; 3])| std::array::from_fn(|c| amplified(a[c], b[c]));
        Self { pixels: self.pixels.iter().zip(&other.pixels).map(pixel).collect(), ..*self }
    }

    fn linear(&self) -> Pixels {
        let linear = self.pixels.iter().map(|p| p.map(linear_from_srgb)).collect();
        Pixels { width: self.width as usize, height: self.height as usize, linear }
    }
}

/// The sRGB transfer function of IEC 61966-2-1.
fn linear_from_srgb(byte: u8) -> f32 {
    let v = f32::from(byte) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

impl Difference {
    /// Compares a picture with its reference; `None` where their sizes differ.
    pub fn between(actual: &Picture, reference: &Picture) -> Option<Self> {
        if (actual.width, actual.height) != (reference.width, reference.height) {
            return None;
        }
        if actual == reference {
            return Some(Self::default());
        }
        let pairs = || actual.pixels.iter().zip(&reference.pixels);
        let values = pairs().flat_map(|(a, b)| (0..3).map(|c| a[c].abs_diff(b[c])));
        let map = flip::ldr(&actual.linear(), &reference.linear(), flip::PIXELS_PER_DEGREE);
        Some(Self {
            largest: values.max().unwrap_or(0),
            pixels: pairs().filter(|(a, b)| a != b).count(),
            flip_mean: mean_and_percentile(&map).0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient() -> Picture {
        let pixels = (0..24 * 16u32).map(|i| [(i % 24 * 10) as u8, (i / 24 * 15) as u8, 90]).collect();
        Picture { width: 24, height: 16, pixels }
    }

    #[test]
    fn equal_pictures_do_not_differ_and_one_step_is_found() {
        let reference = gradient();
        assert_eq!(Difference::between(&reference, &reference), Some(Difference::default()));
        let mut actual = reference.clone();
        actual.pixels[100][1] += 1;
        let one = Difference::between(&actual, &reference).expect("the same size");
        assert_eq!((one.largest, one.pixels), (1, 1));
        assert!(one.flip_mean > 0.0 && one.flip_mean < 1e-3, "{one:?}");
        actual.pixels[200] = [255, 0, 255];
        let two = Difference::between(&actual, &reference).expect("the same size");
        assert_eq!((two.largest, two.pixels), (175, 2));
        assert!(two.flip_mean > one.flip_mean);
    }

    #[test]
    fn pictures_of_other_sizes_have_no_difference() {
        let reference = gradient();
        let turned = Picture { width: 16, height: 24, ..reference.clone() };
        assert_eq!(Difference::between(&turned, &reference), None);
    }

    #[test]
    fn a_difference_is_amplified_and_ends_at_white() {
        let reference = gradient();
        let mut actual = reference.clone();
        actual.pixels[0] = [1, 0, 87];
        actual.pixels[1][0] += 100;
        let difference = actual.difference(&reference);
        assert_eq!(difference.pixels[..3], [[16, 0, 48], [255, 0, 0], [0, 0, 0]]);
    }

    #[test]
    fn a_written_picture_reads_back() {
        let folder = std::env::temp_dir().join(format!("rubor-picture-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for the test");
        let file = folder.join("gradient.png");
        gradient().write(&file).expect("written");
        assert_eq!(Picture::read(&file).expect("read"), gradient());
        let missing = Picture::read(&folder.join("none.png")).expect_err("no file").to_string();
        assert!(missing.contains("none.png"), "{missing}");
        std::fs::remove_dir_all(&folder).expect("the folder goes away");
    }
}
