//! `burley-disk:N`: N importance-sampled taps in a disk (Golubev 2018, "Efficient screen-space subsurface scattering
//! using Burley's normalized diffusion in real-time").
//!
//! ```text
//! irradiance, depth --one pass--> scattered
//! ```
//!
//! Theory: normalized diffusion (Christensen and Burley 2015) fitted to each channel of the profile. Radii are
//! quantiles of the light, angles a golden spiral turned by interleaved gradient noise: the same in every frame of a
//! still picture. A tap weighs R at its true distance over the density of taps; weights are made to sum to one, so a
//! tap that meets another surface is left out and the others are scaled up.
//!
//! Differs from the source: radii follow the mean of the three channels' quantiles and not the widest channel's, so that
//! narrow channels get taps too; distance is measured from the tangent plane.
//!
//! Fails: noise where light changes fast, with few taps.

use rubor_rig::skin::diffusion::NormalizedDiffusion;
use rubor_rig::skin::fit::refit_normalized_diffusion;
use rubor_rig::skin::profile::Profile;

use super::gather::{self, Gather, Tap};
use crate::device::Gpu;
use crate::device::wgsl::{Module, Program, module};
use crate::error::RenderError;

/// Turn from one tap to the next, radians.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

const SHADER: Module = module!("disk", "disk.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    gather::program(SHADER)
}

/// Its entry point.
pub(crate) const ENTRY: &str = "burley_disk";

/// Taps by radius, and d of each channel in mm.
pub(crate) fn taps(profile: &Profile, count: usize) -> Result<(Vec<Tap>, [f64; 3]), RenderError> {
    let mut fits: Vec<NormalizedDiffusion> = Vec::new();
    for channel in &profile.channels {
        fits.push(refit_normalized_diffusion(channel)?.0);
    }
    let inside = |f: &NormalizedDiffusion, r: f64| 1.0 - f.mass_beyond(r) / f.mass_beyond(0.0);
    let mean = |r: f64| fits.iter().map(|f| inside(f, r)).sum::<f64>() / 3.0;
    let longest = fits.iter().map(|f| f.d_mm).fold(0.0, f64::max);
    let quantile = |u: f64| {
        let (mut low, mut high) = (0.0, 100.0 * longest);
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if mean(middle) < u { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    };
    let taps = (0..count)
        .map(|i| {
            let r = quantile((i as f64 + 0.5) / count as f64);
            let each: Vec<f64> = fits.iter().map(|f| f.reflectance(r) / f.mass_beyond(0.0)).collect();
            let density = each.iter().sum::<f64>() / 3.0;
            // The shader multiplies by the falloff at the tap's true distance.
            let falloff = |c: usize| {
                let e = (-r / (3.0 * fits[c].d_mm)).exp();
                (e + e.powi(3)) / r
            };
            let weight = [0, 1, 2].map(|c| (each[c] / density / count as f64 / falloff(c)) as f32);
            let angle = i as f64 * GOLDEN_ANGLE;
            Tap {
                place: [(r * angle.cos()) as f32, (r * angle.sin()) as f32, r as f32, 0.0],
                weight: [weight[0], weight[1], weight[2], 0.0],
            }
        })
        .collect();
    Ok((taps, [fits[0].d_mm, fits[1].d_mm, fits[2].d_mm]))
}

/// The method for one profile.
pub(crate) fn gather(gpu: &Gpu, profile: &Profile, count: usize) -> Result<Gather, RenderError> {
    let (taps, d) = taps(profile, count)?;
    let half_width = taps.iter().map(|t| t.place[2]).fold(0.0, f32::max);
    let method = [d[0] as f32, d[1] as f32, d[2] as f32, 0.0];
    Ok(Gather::new(gpu, &program(), ENTRY, &taps, half_width, method))
}
