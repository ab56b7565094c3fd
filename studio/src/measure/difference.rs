//! Differences of pictures.

use std::path::Path;

use rubor_assets::compare::{Pixels, flip, mean_and_percentile, rel_mse, relative_rmse};
use rubor_assets::image_io::{Limits, ReadOptions, SampleKind, load_image_with};
use rubor_renderer::Image;
use rubor_rig::color::srgb_decode;
use serde::Serialize;

use crate::error::{Failure, Outcome};
use crate::notes::Note;

/// One pair of images.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Difference {
    /// Of linear light, over all pixels.
    pub relative_rmse: f64,
    /// Mean of squared errors, each relative to the square of the reference.
    pub rel_mse: f64,
    /// Mean of the visible difference.
    pub flip_mean: f64,
    /// Its 99th percentile.
    #[serde(rename = "flip99")]
    pub flip_99: f64,
}

/// What a comparison of two files gives.
#[derive(Clone, Debug)]
pub struct Compared {
    /// How far they are apart.
    pub difference: Difference,
    /// The visible differences.
    pub picture: image::RgbImage,
    /// What the readers of the images chose, left out or turned.
    pub notes: Vec<Note>,
}

/// Compares two image files; the second is right.
///
/// # Errors
/// A file that is no image; images of different sizes; values that are not finite.
pub fn of_files(test: &Path, reference: &Path, pixels_per_degree: f64) -> Outcome<Compared> {
    let mut notes = Vec::new();
    let ((t, t_is_light), (r, r_is_light)) = (read(test, &mut notes)?, read(reference, &mut notes)?);
    if (t.width, t.height) != (r.width, r.height) {
        return Err(Failure::input(format!(
            "{}: found {}x{} pixels, expected {}x{} as in {}",
            test.display(),
            t.width,
            t.height,
            r.width,
            r.height,
            reference.display()
        )));
    }
    let map = if t_is_light && r_is_light {
        flip::hdr(&t, &r, pixels_per_degree)
    } else {
        flip::ldr(&t, &r, pixels_per_degree)
    };
    let picture = picture(&map, r.width as u32, r.height as u32);
    let (flip_mean, flip_99) = mean_and_percentile(&map);
    let difference = Difference {
        relative_rmse: relative_rmse(&t.linear, &r.linear),
        rel_mse: rel_mse(&t.linear, &r.linear),
        flip_mean,
        flip_99,
    };
    Ok(Compared { difference, picture, notes })
}

/// A map of FLIP as a picture: black, violet, orange, yellow, white, each step brighter than the last.
pub fn picture(map: &[f32], width: u32, height: u32) -> image::RgbImage {
    const STOPS: [[f32; 3]; 5] = [
        [0.0, 0.0, 4.0],
        [87.0, 16.0, 110.0],
        [229.0, 92.0, 48.0],
        [252.0, 200.0, 60.0],
        [255.0, 255.0, 245.0],
    ];
    image::RgbImage::from_fn(width, height, |x, y| {
        let v = map[(y * width + x) as usize].clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
        let i = (v as usize).min(STOPS.len() - 2);
        let t = v - i as f32;
        image::Rgb(std::array::from_fn(|c| (STOPS[i][c] + t * (STOPS[i + 1][c] - STOPS[i][c])).round() as u8))
    })
}

/// Light of a displayed frame.
pub(crate) fn pixels(image: &Image) -> Pixels {
    let decode = |p: &[u8]| std::array::from_fn(|c| srgb_decode(f32::from(p[c]) / 255.0));
    Pixels {
        width: image.width as usize,
        height: image.height as usize,
        linear: image.rgba.chunks_exact(4).map(decode).collect(),
    }
}

/// Linear pixels, and whether the file holds light (floats) and not display values.
fn read(path: &Path, notes: &mut Vec<Note>) -> Outcome<(Pixels, bool)> {
    // Two images, their light and the steps of FLIP: 64 bytes of memory for a pixel.
    let all = Limits::default();
    let limits = Limits { pixels: all.bytes / 64, bytes: all.bytes / 2, ..all };
    let image = load_image_with(path, &ReadOptions { limits, ..ReadOptions::default() })?;
    notes.extend(image.notes.iter().map(|message| Note::new(path.display().to_string(), message)));
    let is_light = image.kind == SampleKind::F32;
    let map = &image.map;
    let texel = |i: usize| -> [f32; 3] {
        let at = &map.values[i * map.channels as usize..];
        let rgb = match map.channels {
            1 => [at[0]; 3],
            2 => [at[0], at[1], 0.0],
            _ => [at[0], at[1], at[2]],
        };
        if is_light { rgb } else { rgb.map(srgb_decode) }
    };
    let (width, height) = (map.width as usize, map.height as usize);
    let linear: Vec<_> = (0..width * height).map(texel).collect();
    if let Some(i) = linear.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
        return Err(Failure::input(format!(
            "{}: found a value that is not finite at column {}, row {}",
            path.display(),
            i % width,
            i / width
        )));
    }
    Ok((Pixels { width, height, linear }, is_light))
}
