//! BSSRDFs as shaders evaluate them: bssrdf.wesl.

use rubor_rig::skin::profile::Profile;

use crate::device::wgsl::{Module, module};
use crate::error::RenderError;

/// The module that shaders import.
pub(crate) const BSSRDF: Module = module!("bssrdf", "bssrdf.wesl");

/// A directional dipole as the shader reads it; the fields are described there.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Dipole {
    pub(crate) boundary: [f32; 4],
    pub(crate) diffusion_mm: [f32; 4],
    pub(crate) sigma_tr_per_mm: [f32; 4],
    pub(crate) d_e_mm: [f32; 4],
    pub(crate) least_mm2: [f32; 4],
    pub(crate) white: [f32; 4],
}

impl Dipole {
    /// The directional dipole of a profile, if it is one.
    ///
    /// # Errors
    /// Its channels refract light into different directions.
    pub(crate) fn of(profile: &Profile) -> Result<Option<Self>, RenderError> {
        let Some(channels) = profile.directional() else { return Ok(None) };
        let [first, ..] = channels.map(|c| *c.numbers());
        if let Some(other) = channels.iter().map(|c| c.numbers().eta).find(|eta| *eta != first.eta) {
            return Err(RenderError::Limit {
                what: "index of refraction of a directional dipole",
                found: format!("{} and {other}", first.eta),
                expected: "expected the same for R, G and B: light has one direction".into(),
            });
        }
        let each = |f: &dyn Fn(usize) -> f64| [f(0) as f32, f(1) as f32, f(2) as f32, 0.0];
        let numbers = channels.map(|c| *c.numbers());
        let total = profile.total();
        Ok(Some(Self {
            boundary: [first.eta, first.a_e, first.c_phi, first.c_e].map(|x| x as f32),
            diffusion_mm: each(&|c| numbers[c].diffusion_mm),
            sigma_tr_per_mm: each(&|c| numbers[c].sigma_tr_per_mm),
            d_e_mm: each(&|c| numbers[c].d_e_mm),
            least_mm2: each(&|c| numbers[c].least_mm2),
            white: each(&|c| 1.0 / total[c]),
        }))
    }
}
