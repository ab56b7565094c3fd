//! The look-up tables of a profile as one texture: a shader may bind sixteen, and `shade` has fifteen already.

use rubor_rig::skin::preintegrated::{CurvatureAxis, DiffuseTable, HarmonicTable, ShadowTable};
use rubor_rig::skin::profile::Profile;

use crate::device::wgsl::Program;
use crate::device::{Gpu, texture};
use crate::error::RenderError;

/// Values of N.L; odd, so that one is 0.
const COSINES: u32 = 129;
/// Curvatures of light and of harmonic bands.
const CURVATURES: u32 = 64;
/// Values of a shadow's filter.
const SHARES: u32 = 129;
/// Widths of penumbrae.
const WIDTHS: u32 = 24;
/// Widest radius of a penumbra on the skin, mm.
const WIDEST_MM: f64 = 12.0;
/// Light that goes farther beside the edge of a shadow counts as if it went up to here, mm: shadow maps have 12 mm of room.
const FARTHEST_MM: f64 = 8.0;

const NEAR_ROW: u32 = CURVATURES;
const FAR_ROW: u32 = NEAR_ROW + WIDTHS;
const BANDS_ROW: u32 = FAR_ROW + WIDTHS;

/// The tables on the device.
pub(super) struct Tables {
    pub(super) texture: wgpu::TextureView,
    pub(super) axis: CurvatureAxis,
    pub(super) reach_mm: [f64; 2],
    pub(super) widest_mm: f64,
}

/// Tells a shader where the tables are.
pub(super) fn constants(program: Program) -> Program {
    program
        .constant("DIFFUSE_ROW", 0u32)
        .constant("COSINES", COSINES)
        .constant("CURVATURES", CURVATURES)
        .constant("NEAR_ROW", NEAR_ROW)
        .constant("FAR_ROW", FAR_ROW)
        .constant("SHARES", SHARES)
        .constant("WIDTHS", WIDTHS)
        .constant("BANDS_ROW", BANDS_ROW)
}

impl Tables {
    /// # Errors
    /// The profile has no finite width.
    pub(super) fn new(gpu: &Gpu, profile: &Profile) -> Result<Self, RenderError> {
        let diffuse = DiffuseTable::new(profile, COSINES as usize, CURVATURES as usize)?;
        let shadow = ShadowTable::new(profile, [SHARES as usize, WIDTHS as usize], WIDEST_MM, FARTHEST_MM)?;
        let harmonics = HarmonicTable::new(profile, CURVATURES as usize)?;
        let size = [COSINES, BANDS_ROW + 2];
        let mut texels: Vec<[f32; 4]> = Vec::with_capacity((size[0] * size[1]) as usize);
        texels.extend(diffuse.values.iter().map(opaque));
        for part in &shadow.values {
            texels.extend(part.iter().map(|v| v.map(|x| x as f32)));
        }
        for band in &harmonics.bands {
            texels.extend(band.iter().map(opaque));
            texels.resize(texels.len() + (COSINES - CURVATURES) as usize, [0.0; 4]);
        }
        Ok(Self {
            texture: texture::upload_half(gpu, "pre-integrated light", size, &[vec![texels]]),
            axis: diffuse.axis,
            reach_mm: shadow.reach_mm,
            widest_mm: shadow.widest_mm,
        })
    }

    pub(super) fn bytes(&self) -> u64 {
        let t = self.texture.texture();
        u64::from(t.width()) * u64::from(t.height()) * 8
    }
}

fn opaque(rgb: &[f64; 3]) -> [f32; 4] {
    [rgb[0] as f32, rgb[1] as f32, rgb[2] as f32, 1.0]
}

/// One row is as wide as another: the tables share their columns.
const _: () = assert!(SHARES == COSINES && CURVATURES <= COSINES);
