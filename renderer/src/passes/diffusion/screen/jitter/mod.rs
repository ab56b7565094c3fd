//! `screen-jitter`: thirteen jittered taps (Hable, Borshukov and Hejl 2009; Jimenez 2012 ch. 4, "SS Jittered").
//!
//! ```text
//! irradiance, depth --one pass--> scattered
//! ```
//!
//! One tap stands for light that leaves where it entered, six for middle distances, six for the wide red scattering.
//!
//! Differs from the source: places and weights follow from the profile and not from a table for one skin. The widest
//! channel's light is divided into three annuli; each tap stands for a sixth of its annulus.
//!
//! Fails where light varies faster than the taps are apart: a shadow edge shows ghost copies.

use rubor_rig::skin::profile::Profile;

use super::gather::{self, Gather, Tap};
use crate::device::Gpu;
use crate::device::wgsl::{Module, Program, module};

/// Share of the widest channel's light inside of the middle and inside of the wide annulus: two fifths of skin's red
/// scatters less than a millimetre, the rest is nearly all in its two widest Gaussians (Jimenez 2012 table 4.2).
const ANNULI: [f64; 2] = [0.35, 0.6];

const SHADER: Module = module!("jitter", "jitter.wesl");

/// The shader of the pass.
pub(crate) fn program() -> Program {
    gather::program(SHADER)
}

/// Its entry point.
pub(crate) const ENTRY: &str = "screen_jitter";

/// The twelve taps around the centre.
pub(crate) fn taps(profile: &Profile) -> Vec<Tap> {
    let reach = |c: &rubor_rig::skin::profile::RadialProfile| c.sample_radius(0.9);
    let Some(widest) = profile.channels.iter().max_by(|a, b| reach(a).total_cmp(&reach(b))) else {
        return Vec::new();
    };
    let mut taps = Vec::new();
    for (ring, (from, to)) in [(ANNULI[0], ANNULI[1]), (ANNULI[1], 1.0)].into_iter().enumerate() {
        let edges = [from, to].map(|u| if u < 1.0 { widest.sample_radius(u) } else { f64::INFINITY });
        let light = profile.channels.each_ref().map(|c| {
            let inside = |r: f64| if r.is_finite() { c.cdf(r) } else { 1.0 };
            (inside(edges[1]) - inside(edges[0])) / 6.0
        });
        for i in 0..6 {
            // Every second tap is on the inner half of the annulus, so that neighbours differ in radius.
            let share = (((i * 5 + 2) % 6) as f64 + 0.5) / 6.0;
            let radius = widest.sample_radius(from + (to - from) * share);
            let angle = std::f64::consts::TAU * (i as f64 + 0.5 * ring as f64 + 0.15) / 6.0;
            let place = [radius * angle.cos(), radius * angle.sin()];
            taps.push(Tap {
                place: [place[0] as f32, place[1] as f32, 0.0, 0.0],
                weight: [light[0] as f32, light[1] as f32, light[2] as f32, 0.0],
            });
        }
    }
    taps
}

/// The method for one profile.
pub(crate) fn gather(gpu: &Gpu, profile: &Profile) -> Gather {
    let taps = taps(profile);
    let half_width = taps.iter().map(|t| t.place[0].hypot(t.place[1])).fold(0.0, f32::max);
    Gather::new(gpu, &program(), ENTRY, &taps, half_width, [0.0; 4])
}
