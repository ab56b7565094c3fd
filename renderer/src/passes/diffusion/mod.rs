//! How light scatters in skin: a closed set of methods with hooks by stage.
//!
//! ```text
//! needs --------> what the frame prepares: backs of the heads, a margin around the picture, transmittance
//! before_view --> maps of a head, light on all of its surface
//! after_shading -> diffuse radiance from images of the lit surface
//! ```
//!
//! The frame calls the stages and knows no method. A method is a folder here, a row in [`crate::settings::methods`] and
//! its line in [`method`], which the compiler asks for.

pub(crate) mod screen;
pub(crate) mod surface;

use std::sync::Arc;

use rubor_rig::skin::profile::Profile;

use crate::device::{Gpu, Image, Recorder};
use crate::error::RenderError;
use crate::passes::shade::Lit;
use crate::scene::PosedHead;
use crate::scene::lamp::Illumination;
use crate::scene::view::Seen;
use crate::settings::ScatterMethod;

/// What a method asks of the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Needs {
    /// Whether light on what faces away from the camera counts.
    pub(crate) backs: bool,
    /// Size of the picture with the surroundings whose light counts, over its own.
    pub(crate) margin: f32,
    /// Whether light through thin parts is to be added; methods whose integral holds it do not.
    pub(crate) transmittance: bool,
}

impl Default for Needs {
    fn default() -> Self {
        Self { backs: false, margin: 1.0, transmittance: true }
    }
}

/// A method that draws a frame in one go. Every hook may be left out.
pub(crate) trait Diffusion {
    /// What it asks of the frame.
    fn needs(&self) -> Needs {
        Needs::default()
    }

    /// Work that no view is needed for: maps of the heads, light on all of their surface.
    fn before_view(&mut self, _r: &mut Recorder<'_>, _heads: &[PosedHead<'_>], _light: &Illumination<'_>) {}

    /// Diffuse radiance of a white surface from images of its light.
    fn after_shading(&mut self, _r: &mut Recorder<'_>, _seen: &Seen, lit: &Lit) -> Image {
        lit.irradiance.clone()
    }
}

/// Light leaves skin where it enters.
struct Unscattered;

impl Diffusion for Unscattered {}

/// A method with its pipelines and kernels for a profile; nothing for one that needs a frame of its own.
///
/// # Errors
/// Its number is out of range, or the profile cannot be fitted.
pub(crate) fn method(
    gpu: &Gpu,
    method: ScatterMethod,
    profile: &Profile,
) -> Result<Option<Box<dyn Diffusion>>, RenderError> {
    use screen::{disk, exact, gauss, jitter, separable};
    Ok(Some(match method.validate()? {
        ScatterMethod::None => Box::new(Unscattered),
        ScatterMethod::Separable(n) => Box::new(separable::Separable::new(gpu, profile, n as usize)?),
        ScatterMethod::ScreenGauss(n) => Box::new(gauss::ScreenGauss::new(gpu, profile, n as usize)?),
        ScatterMethod::ScreenJitter => Box::new(jitter::gather(gpu, profile)),
        ScatterMethod::BurleyDisk(n) => Box::new(disk::gather(gpu, profile, n as usize)?),
        ScatterMethod::ReferenceScreen => Box::new(exact::gather(gpu, profile)),
        ScatterMethod::ReferenceSurface(_) => return Ok(None),
    }))
}

/// The method of the last frame.
#[derive(Default)]
pub(crate) struct Prepared {
    key: Option<(ScatterMethod, Arc<Profile>)>,
    pub(crate) method: Option<Box<dyn Diffusion>>,
}

impl Prepared {
    /// Makes a method for a profile, unless it is there.
    ///
    /// # Errors
    /// As [`method`].
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        wanted: ScatterMethod,
        profile: &Arc<Profile>,
    ) -> Result<(), RenderError> {
        if self.key.as_ref().is_some_and(|(m, p)| *m == wanted && p == profile) {
            return Ok(());
        }
        self.key = None;
        self.method = method(gpu, wanted, profile)?;
        self.key = Some((wanted, profile.clone()));
        Ok(())
    }
}
