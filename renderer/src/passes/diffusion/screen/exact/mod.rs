//! `reference-screen`: the profile itself as a two-dimensional kernel, over every pixel within its reach.
//!
//! ```text
//! irradiance, depth --one pass--> scattered
//! ```
//!
//! `separable:N` approximates this with the same rules for depth and tilt: the difference is the error of two
//! one-dimensional passes and of N taps. The weight of a pixel is the light of its area, from a table of the light in
//! rectangles: this is right for steep profiles, and the weights sum to one for every pixel size.
//!
//! Costs the square of the kernel's width in pixels. A kernel that reaches over more than 256 pixels skips pixels.

use rayon::prelude::*;
use rubor_rig::skin::profile::Profile;

use super::gather::{self, Gather, Tap};
use crate::device::Gpu;
use crate::device::wgsl::{Module, Program, module};

/// Corners of the table per side.
const SIDE: usize = 192;
/// Share of the widest channel's light inside of the kernel.
const COVERAGE: f64 = 0.9995;

const SHADER: Module = module!("exact", "exact.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    gather::program(SHADER).constant("SIDE", SIDE as u32)
}

/// Its entry point.
pub(crate) const ENTRY: &str = "reference_screen";

/// Radius of the kernel, mm.
pub(crate) fn half_width_mm(profile: &Profile) -> f64 {
    profile.channels.iter().map(|c| c.sample_radius(COVERAGE)).fold(0.0, f64::max)
}

/// The method for one profile.
pub(crate) fn gather(gpu: &Gpu, profile: &Profile) -> Gather {
    let half_width = half_width_mm(profile);
    let place = |i: usize| half_width * (i as f64 / (SIDE - 1) as f64).powi(3);
    let taps: Vec<Tap> = (0..SIDE * SIDE)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (place(i % SIDE), place(i / SIDE));
            let light = profile.channels.each_ref().map(|c| c.quadrant_cdf(x, y) as f32);
            Tap { place: [0.0; 4], weight: [light[0], light[1], light[2], 0.0] }
        })
        .collect();
    Gather::new(gpu, &program(), ENTRY, &taps, half_width as f32, [0.0; 4])
}
