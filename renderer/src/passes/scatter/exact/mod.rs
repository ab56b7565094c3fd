//! `reference-screen`: the profile itself as a two-dimensional kernel, over every pixel that it reaches.
//!
//! ```text
//! irradiance, depth --one pass--> scattered
//! ```
//!
//! What `separable:N` approximates, with the same rules for depth and tilt: the difference is the price of two
//! one-dimensional passes and of N taps. The light of each pixel's area is R integrated over it (8 x 8 parts near the
//! centre, where R is steep or infinite); the centre has what is left to one.
//!
//! Costs the square of the kernel's width in pixels. A kernel that reaches over more than 256 pixels skips pixels.

use rubor_rig::skin::profile::Profile;

use super::gather::{Gather, Tap};
use crate::gpu::Gpu;

/// Entries of the table of R.
const ENTRIES: usize = 1024;
/// Share of the widest channel's light inside of the kernel.
const COVERAGE: f64 = 0.9995;

/// WGSL of the pass.
pub(crate) const METHOD: &str = include_str!("exact.wgsl");

/// Radius of the kernel, mm.
pub(crate) fn half_width_mm(profile: &Profile) -> f64 {
    profile.channels.iter().map(|c| c.sample_radius(COVERAGE)).fold(0.0, f64::max)
}

/// The method for one profile.
pub(crate) fn gather(gpu: &Gpu, profile: &Profile) -> Gather {
    let half_width = half_width_mm(profile);
    let total = profile.total();
    let taps: Vec<Tap> = (0..ENTRIES)
        .map(|i| {
            // Half an entry instead of 0, where R may be infinite.
            let x = (i as f64).max(0.5) / (ENTRIES - 1) as f64;
            let r = profile.reflectance(half_width * x * x);
            let weight = [0, 1, 2].map(|c| (r[c] / total[c]) as f32);
            Tap { place: [0.0; 4], weight: [weight[0], weight[1], weight[2], 0.0] }
        })
        .collect();
    Gather::new(gpu, METHOD, &taps, half_width as f32, half_width as f32, [0.0; 4])
}
