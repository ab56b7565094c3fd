//! How light scatters in skin: a closed set of methods with hooks by stage.
//!
//! ```text
//! needs --------> inputs that the frame prepares: backs of the heads, a margin around the picture, transmittance
//! take_heads ---> what it keeps of each head, or why it cannot draw it
//! before_view --> maps of a head, light on all of its surface; only for methods that ask for it
//! skin_light ---> the rule by which `shade` lights skin, with its tables and maps
//! after_shading -> diffuse radiance from images of the lit surface
//! ```
//!
//! The frame calls the stages and knows no method. A method is a folder here, a row in [`crate::settings::methods`] and
//! an arm of the `match` in [`method`], which the compiler enforces.

pub(crate) mod bssrdf;
pub(crate) mod cubemap;
pub(crate) mod preintegrated;
pub(crate) mod screen;
pub(crate) mod surface;
pub(crate) mod texture;

use std::sync::Arc;

use rubor_rig::skin::profile::Profile;

use crate::device::{Gpu, Image, ImageSpec, Recorder};
use crate::error::RenderError;
use crate::passes::geometry::raster::Rasteriser;
use crate::passes::shade::{Lighting, Lit, Shade, SkinLight, Transmittance};
use crate::scene::lamp::Illumination;
use crate::scene::view::Seen;
use crate::scene::{HeadInstance, PosedHead, Scene};
use crate::settings::{Quality, ScatterMethod};

/// Requirements of a method on the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Needs {
    /// Whether it needs light on surfaces that face away from the camera.
    pub(crate) backs: bool,
    /// Size of the picture including the margin whose light is needed, relative to the picture.
    pub(crate) margin: f32,
    /// Whether transmittance has to be added; methods whose integral includes it do not need it.
    pub(crate) transmittance: bool,
    /// Whether it works before the view.
    pub(crate) before_view: bool,
}

impl Default for Needs {
    fn default() -> Self {
        Self { backs: false, margin: 1.0, transmittance: true, before_view: false }
    }
}

/// The frame before any sample of a pixel is drawn.
pub(crate) struct Before<'a> {
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) quality: &'a Quality,
    /// Size of the picture with all samples, pixels.
    pub(crate) size: [u32; 2],
    pub(crate) heads: &'a [PosedHead<'a>],
    pub(crate) light: &'a Illumination<'a>,
    /// [`crate::scene::view::View`] through the middle of each pixel.
    pub(crate) view: wgpu::Buffer,
    pub(crate) shade: &'a Shade,
    pub(crate) transmittance: Option<&'a Transmittance>,
}

impl Before<'_> {
    /// What light on the whole surface has in place of a picture: images that belong to pixels are not used.
    pub(crate) fn without_picture(&self, r: &mut Recorder<'_>) -> Seen {
        Seen {
            view: self.view.clone(),
            pixels_per_mm: 1.0,
            ids: r.image("no ids", ImageSpec::attachment([1, 1], wgpu::TextureFormat::R32Uint)),
            depth: r.image("no depth", ImageSpec::attachment([1, 1], wgpu::TextureFormat::Depth32Float)),
            windows: Vec::new(),
        }
    }

    /// The light of the frame on what was made by [`Before::without_picture`].
    pub(crate) fn lighting<'a>(
        &'a self,
        seen: &'a Seen,
        transmittance: Option<&'a Transmittance>,
    ) -> Lighting<'a> {
        let (light, quality) = (self.light, self.quality);
        Lighting { light, seen, first: None, transmittance, quality, skin_light: None }
    }
}

/// A method that draws a frame in one go. Every hook is optional.
pub(crate) trait Diffusion {
    /// What it asks of the frame.
    fn needs(&self) -> Needs {
        Needs::default()
    }

    /// Prepares what it keeps of the heads of the next frame, and drops what it keeps of others.
    ///
    /// # Errors
    /// It cannot draw one of them.
    fn take_heads(&mut self, _gpu: &Gpu, _heads: &[HeadInstance<'_>]) -> Result<(), RenderError> {
        Ok(())
    }

    /// Bytes that it keeps on the device from frame to frame.
    fn memory_bytes(&self) -> u64 {
        0
    }

    /// Work before any sample of a pixel is drawn: maps of the heads, light on all of their surface. Only for methods
    /// with [`Needs::before_view`].
    fn before_view(&mut self, _r: &mut Recorder<'_>, _frame: &Before<'_>) {}

    /// How skin is lit for it; `None` for Lambert's law.
    fn skin_light(&self) -> Option<&dyn SkinLight> {
        None
    }

    /// Diffuse radiance of a white surface from images of its light.
    fn after_shading(
        &mut self,
        _r: &mut Recorder<'_>,
        _heads: &[PosedHead<'_>],
        _seen: &Seen,
        lit: &Lit,
    ) -> Image {
        lit.irradiance.clone()
    }

    /// Drops what it keeps from frame to frame.
    fn forget(&mut self) {}
}

/// No scattering: light leaves skin where it enters.
struct Unscattered;

impl Diffusion for Unscattered {}

/// A method with its pipelines and kernels for a profile; `None` for a method that needs a frame of its own.
///
/// # Errors
/// Its number is out of range, or the profile cannot be fitted.
pub(crate) fn method(
    gpu: &Gpu,
    rasteriser: Rasteriser,
    method: ScatterMethod,
    profile: &Profile,
) -> Result<Option<Box<dyn Diffusion>>, RenderError> {
    use screen::{disk, exact, gauss, jitter, separable};
    Ok(Some(match method.validate()? {
        ScatterMethod::None => Box::new(Unscattered),
        ScatterMethod::PreIntegrated(n) => Box::new(preintegrated::PreIntegrated::new(gpu, profile, n)?),
        ScatterMethod::Separable(n) => Box::new(separable::Separable::new(gpu, profile, n as usize)?),
        ScatterMethod::ScreenGauss(n) => Box::new(gauss::ScreenGauss::new(gpu, profile, n as usize)?),
        ScatterMethod::ScreenJitter => Box::new(jitter::gather(gpu, profile)),
        ScatterMethod::BurleyDisk(n) => Box::new(disk::gather(gpu, profile, n as usize)?),
        ScatterMethod::TextureSpace(side) => {
            Box::new(texture::TextureSpace::new(gpu, rasteriser, profile, side)?)
        }
        ScatterMethod::DipoleCubemap(n) => {
            Box::new(cubemap::DipoleCubemap::new(gpu, rasteriser, profile, n)?)
        }
        ScatterMethod::ReferenceScreen => Box::new(exact::gather(gpu, profile)),
        ScatterMethod::ReferenceSurface(_) => return Ok(None),
    }))
}

/// The method of the last frame.
#[derive(Default)]
pub(crate) struct Prepared {
    key: Option<(Rasteriser, ScatterMethod, Arc<Profile>)>,
    pub(crate) method: Option<Box<dyn Diffusion>>,
}

impl Prepared {
    /// Makes a method for a profile, unless it exists.
    ///
    /// # Errors
    /// As [`method`].
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        rasteriser: Rasteriser,
        wanted: ScatterMethod,
        profile: &Arc<Profile>,
    ) -> Result<(), RenderError> {
        if self.key.as_ref().is_some_and(|(r, m, p)| (*r, *m) == (rasteriser, wanted) && p == profile) {
            return Ok(());
        }
        self.key = None;
        self.method = method(gpu, rasteriser, wanted, profile)?;
        self.key = Some((rasteriser, wanted, profile.clone()));
        Ok(())
    }
}
