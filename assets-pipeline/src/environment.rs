//! Environment maps: equirectangular images as radiance.
//!
//! OpenEXR, Radiance and TIFF of floats hold radiance. Images of 8 and 16 bits hold sRGB codes: they are decoded, and a
//! note says that light brighter than their white is lost.

use std::path::Path;

use glam::Vec3;
use rubor_rig::color::srgb_decode;

use crate::image_io::{self, ImageError, LoadedImage, ReadOptions, SampleKind};

/// An equirectangular map.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentImage {
    /// Columns, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Linear Rec. 709 radiance, finite and at least 0, row by row from the top.
    pub texels: Vec<Vec3>,
}

/// Share of the brightest value below which a negative one is taken for ringing of a filter and set to 0.
const RINGING: f32 = 0.01;

/// Reads an environment map; the second result says what was chosen, left out, decoded or repaired.
///
/// # Errors
/// A file that cannot be read as an image (see [`image_io::load_image_with`]), a cube map, a channel layout that is no
/// light, radiance that is not finite, or clearly negative radiance.
pub fn read(file: &Path, options: &ReadOptions) -> Result<(EnvironmentImage, Vec<String>), ImageError> {
    let (image, is_cube_map) = image_io::load_environment(file, options)?;
    if is_cube_map {
        return Err(image.content_error(
            "envmap",
            "a cube map",
            "an equirectangular (latitude-longitude) map",
        ));
    }
    let mut notes = image.notes.clone();
    let mut map = image.require_rgb()?;
    if image.alpha.is_some() {
        notes.push("alpha of the environment was not used".into());
    }
    let (width, height) = (map.width, map.height);
    if width != 2 * height {
        notes.push(format!("{width}x{height} texels: an equirectangular map is twice as wide as high"));
    }
    if image.kind != SampleKind::F32 {
        for v in &mut map.values {
            *v = srgb_decode(*v);
        }
        notes.push(
            "low dynamic range: sRGB codes were decoded to radiance 0 to 1; lamps and the sun are too dark"
                .into(),
        );
    }
    repair(&image, &mut map.values, &mut notes)?;
    let texels = map.values.chunks_exact(3).map(Vec3::from_slice).collect();
    Ok((EnvironmentImage { width, height, texels }, notes))
}

/// Sets small negative radiance to 0.
fn repair(image: &LoadedImage, values: &mut [f32], notes: &mut Vec<String>) -> Result<(), ImageError> {
    let fail = |i: usize, v: f32| {
        let texel = i / 3;
        let (x, y) = (texel % image.map.width as usize, texel / image.map.width as usize);
        image.content_error(
            format!("texel ({x}, {y})"),
            format!("radiance {v}"),
            "finite radiance of at least 0",
        )
    };
    if let Some(i) = values.iter().position(|v| !v.is_finite()) {
        return Err(fail(i, values[i]));
    }
    let brightest = values.iter().fold(0.0f32, |a, b| a.max(*b));
    if let Some(i) = values.iter().position(|v| *v < -RINGING * brightest) {
        return Err(fail(i, values[i]));
    }
    let mut repaired = 0;
    for v in values.iter_mut().filter(|v| **v < 0.0) {
        *v = 0.0;
        repaired += 1;
    }
    if repaired > 0 {
        notes.push(format!("{repaired} slightly negative values of radiance were set to 0"));
    }
    Ok(())
}
