//! Subsurface scattering in screen space: diffuse radiance of a white surface, blurred by the diffusion profile.
//!
//! ```text
//! irradiance (a = depth), strength, depth --the method of the frame--> scattered (rgba16f, linear Rec. 709)
//! ```
//!
//! Each method is a file or folder of its own: `separable`, `gauss`, `jitter`, `disk`, and the references `exact` and
//! `surface`.
//! All keep to the same rules: kernels are in millimetres on the surface, projected with the depth, field of view and
//! tilt at each pixel and scaled by its strength; a neighbour off the tangent plane of the centre, or one that is not
//! skin, gives way to the centre; a pixel whose kernel is under half a pixel keeps its light; weights sum to one, so
//! even light stays even.
//!
//! Does not: scatter across depth steps, or through thin parts (that is transmittance, in `shade`).

use std::sync::Arc;

use rubor_rig::skin::profile::Profile;

use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::pass_timer::PassTimer;
use crate::settings::ScatterMethod;

pub(crate) mod disk;
pub(crate) mod exact;
pub(crate) mod gather;
pub(crate) mod gauss;
pub(crate) mod jitter;
pub(crate) mod line;
pub(crate) mod separable;
pub(crate) mod surface;

#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;

/// Share of a neighbour that is given back to the centre for each millimetre that it is off the centre's tangent plane.
/// A step of 4 mm (lip over teeth, wing of the nose over cheek) separates fully; the curve of a cheek does not.
pub(crate) const FOLLOW_PER_MM: f32 = 0.25;

/// What recording needs.
pub(crate) struct Recorder<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) encoder: &'a mut wgpu::CommandEncoder,
    pub(crate) timer: &'a mut PassTimer,
    pub(crate) view: &'a wgpu::Buffer,
    /// Pixels for a millimetre of the farthest head.
    pub(crate) pixels_per_mm: f64,
}

/// Images of the frame that methods read and write.
pub(crate) struct Images<'a> {
    /// rgb, a = depth in mm relative to `View::depth_origin_mm`: a texel is all that a tap needs, and interpolates.
    pub(crate) irradiance: &'a wgpu::TextureView,
    /// a = strength.
    pub(crate) albedo: &'a wgpu::TextureView,
    pub(crate) depth: &'a wgpu::TextureView,
    pub(crate) scratch: &'a wgpu::TextureView,
    pub(crate) scattered: &'a wgpu::TextureView,
}

enum Prepared {
    Separable(separable::Separable),
    ScreenGauss(Box<gauss::ScreenGauss>),
    Gather(gather::Gather),
}

/// The method of the last frame, with its pipelines and kernels; nothing before the first frame that scatters.
#[derive(Default)]
pub(crate) struct Scatter {
    key: Option<(ScatterMethod, Arc<Profile>)>,
    prepared: Option<Prepared>,
}

impl Scatter {
    /// Makes pipelines and kernels for a method and a profile, unless they are there.
    ///
    /// # Errors
    /// The method's number is out of range, or the profile cannot be fitted.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        method: ScatterMethod,
        profile: &Arc<Profile>,
    ) -> Result<(), RenderError> {
        if self.key.as_ref().is_some_and(|(m, p)| *m == method && p == profile) {
            return Ok(());
        }
        self.key = None;
        self.prepared = match method.validate()? {
            ScatterMethod::None | ScatterMethod::ReferenceSurface(_) => None,
            ScatterMethod::Separable(n) => {
                Some(Prepared::Separable(separable::Separable::new(gpu, profile, n as usize)?))
            }
            ScatterMethod::ScreenGauss(n) => {
                Some(Prepared::ScreenGauss(Box::new(gauss::ScreenGauss::new(gpu, profile, n as usize)?)))
            }
            ScatterMethod::ScreenJitter => Some(Prepared::Gather(jitter::gather(gpu, profile))),
            ScatterMethod::BurleyDisk(n) => Some(Prepared::Gather(disk::gather(gpu, profile, n as usize)?)),
            ScatterMethod::ReferenceScreen => Some(Prepared::Gather(exact::gather(gpu, profile))),
        };
        self.key = Some((method, profile.clone()));
        Ok(())
    }

    /// Blurs `irradiance` into `scattered` (or not at all) and says where the result is.
    pub(crate) fn record<'a>(&mut self, mut r: Recorder<'_>, images: &Images<'a>) -> &'a wgpu::TextureView {
        match &mut self.prepared {
            None => return images.irradiance,
            Some(Prepared::Separable(m)) => m.record(&mut r, images),
            Some(Prepared::ScreenGauss(m)) => m.record(&mut r, images),
            Some(Prepared::Gather(m)) => m.record(&mut r, images),
        }
        images.scattered
    }
}

/// An image between passes.
pub(crate) fn half_image(gpu: &Gpu, label: &str, size: [u32; 2]) -> wgpu::TextureView {
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    gpu.target(label, size, wgpu::TextureFormat::Rgba16Float, usage).create_view(&Default::default())
}
