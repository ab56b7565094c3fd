//! `screen-gauss:4`, `screen-gauss:6`: Gaussians one after the other (Jimenez 2012 ch. 4), wide ones on smaller images.
//!
//! ```text
//! irradiance --line, line--> G2 --line, line--> G3 ...      each blurs the one before by the difference in variance
//!      |  +-------------------+-----mix by w'---+---> scattered
//!    halve                                                ^ + bilinear sum of the level below
//!      v                                                  |
//!    1/2 ----line, line--> G4 --line, line--> G5 ... --> sum
//!      v                                                  ^
//!     ...                                                 |
//! ```
//!
//! Theory: the profile as a sum of Gaussians of common variances (eq. 5.3). The narrowest is under a pixel on any
//! screen: the unblurred image replaces it (section 4.2.1). A Gaussian whose standard deviation is under half a
//! pixel is skipped (eq. 4.5); sums stay normalised with the accumulated weights of eq. 4.8.
//!
//! A Gaussian runs on the smallest image whose pixels are not wider than [`PIXELS_A_DEVIATION`] allows (Burt and
//! Adelson 1983, "The Laplacian pyramid as a compact image code": the result of a wide blur has no finer detail).
//! Halving and interpolating blur too; that variance is subtracted from the first Gaussian of a level.
//!
//! Differs from the source: stretch is the cosine of the surface's tilt, not eqs. 4.1 and 4.2 with tuned constants, the
//! kernel follows the surface, so that there are no haloes around ears and nose; the source runs all Gaussians at full
//! size.
//!
//! Limits: levels are chosen for the farthest head; where several stand at very different distances, all take the cost.
//! Where strength is a fraction, kernels under half a pixel of their level are as wide as the level's own blur.

use rubor_rig::skin::fit::{Emphasis, RgbGaussian, fit_gaussians};
use rubor_rig::skin::profile::{Profile, RadialProfile};

use super::COMMON;
use super::line::{Line, Params, Sum, Sums};
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::error::RenderError;
use crate::passes::diffusion::Diffusion;
use crate::passes::shade::Lit;
use crate::scene::PosedHead;
use crate::scene::view::Seen;

const HALVE: Module = module!("gauss_halve", "halve.wesl");

/// The shader that halves an image.
pub(crate) fn halve_program() -> Program {
    Program::new(HALVE).with(&[COMMON])
}

/// Least standard deviation in pixels of the image that a Gaussian runs on: the blur of halving and interpolation (the
/// square root of a third, see [`blur_of_level_px2`]).
const PIXELS_A_DEVIATION: f64 = 0.577;

/// Number of halvings from the view to the smallest image: one pass halves three times.
const MAX_LEVEL: usize = 3;

/// Pixels across of the view that a workgroup halves.
const HALVED_PIXELS: u32 = 32;

/// The method, ready for one profile.
pub(crate) struct ScreenGauss {
    gaussians: Vec<RgbGaussian>,
    halve: Kernel,
    /// Each for the view itself and for smaller images.
    horizontal: [Line; 2],
    vertical: [Line; 2],
    vertical_with_coarser: [Line; 2],
}

/// One step of the blur.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Step {
    /// Standard deviation that this step adds, mm.
    pub(crate) deviation_mm: f64,
    /// Standard deviation of the image after it, mm.
    pub(crate) reached_mm: f64,
    /// Share of the result in the sum of its level, eq. 4.8.
    pub(crate) share: [f64; 3],
}

/// The Gaussians of one size of image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Level {
    pub(crate) steps: Vec<Step>,
    /// Share of the next level's sum in this level's, and the narrowest deviation there, mm.
    pub(crate) coarser: Option<([f64; 3], f64)>,
}

/// The Gaussians of a profile, narrowest first: its own where it is such a sum, else fitted.
pub(crate) fn gaussians(profile: &Profile, terms: usize) -> Result<Vec<RgbGaussian>, RenderError> {
    if let [RadialProfile::Gaussians(r), RadialProfile::Gaussians(g), RadialProfile::Gaussians(b)] =
        &profile.channels
    {
        let (r, g, b) = (r.terms(), g.terms(), b.terms());
        let common = r.len() == terms
            && g.len() == terms
            && b.len() == terms
            && (0..terms)
                .all(|i| r[i].variance_mm2 == g[i].variance_mm2 && g[i].variance_mm2 == b[i].variance_mm2);
        if common {
            return Ok((0..terms)
                .map(|i| RgbGaussian {
                    variance_mm2: r[i].variance_mm2,
                    weights: [r[i].weight, g[i].weight, b[i].weight],
                })
                .collect());
        }
    }
    Ok(fit_gaussians(profile, terms, Emphasis::Energy)?.gaussians)
}

/// Which Gaussians (narrowest first; the narrowest is the unblurred image) run on which image, from the view's own size
/// on, each half as large as the one before.
pub(crate) fn plan(gaussians: &[RgbGaussian], pixels_per_mm: f64) -> Vec<Level> {
    let level_of = |g: &RgbGaussian| {
        let pixels = g.variance_mm2.sqrt() * pixels_per_mm / PIXELS_A_DEVIATION;
        if pixels >= 1.0 { (pixels.log2().floor() as usize).min(MAX_LEVEL) } else { 0 }
    };
    let wide = gaussians.get(1..).unwrap_or_default();
    let count = wide.last().map_or(0, level_of) + 1;
    let total =
        |of: &[RgbGaussian]| -> [f64; 3] { std::array::from_fn(|c| of.iter().map(|g| g.weights[c]).sum()) };
    (0..count)
        .map(|level| {
            let own: Vec<RgbGaussian> = wide.iter().filter(|g| level_of(g) == level).cloned().collect();
            let coarser: Vec<RgbGaussian> = wide.iter().filter(|g| level_of(g) > level).cloned().collect();
            let mut so_far = if level == 0 { gaussians[0].weights } else { [0.0; 3] };
            let mut before_mm2 = blur_of_level_px2(level) / (pixels_per_mm * pixels_per_mm);
            let steps = own
                .iter()
                .map(|g| {
                    let deviation_mm = (g.variance_mm2 - before_mm2).max(0.0).sqrt();
                    before_mm2 = g.variance_mm2;
                    let share = accumulate(&mut so_far, g.weights);
                    Step { deviation_mm, reached_mm: g.variance_mm2.sqrt(), share }
                })
                .collect();
            let narrowest = coarser.first().map(|g| g.variance_mm2.sqrt());
            let coarser = narrowest.map(|mm| (accumulate(&mut so_far, total(&coarser)), mm));
            Level { steps, coarser }
        })
        .collect()
}

/// Adds weights to a sum and returns their share of it (eq. 4.8).
fn accumulate(so_far: &mut [f64; 3], weights: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| {
        so_far[c] += weights[c];
        if so_far[c] > 0.0 { weights[c] / so_far[c] } else { 0.0 }
    })
}

/// Variance of halving `level` times and interpolating back, along one axis, square pixels of the view: means of two
/// pixels have a quarter of the squared distance of the two, interpolation at a quarter of the way 3/16 of it.
fn blur_of_level_px2(level: usize) -> f64 {
    (0..level).map(|k| 4f64.powi(k as i32) * (0.25 + 0.75)).sum()
}

/// Taps at 0.75, 1.5, 2.25 and 3 standard deviations: a step of 1, as in listing 4.1, leaves a ripple on a narrow
/// bright line.
pub(crate) fn taps(deviation_mm: f64) -> Vec<([f64; 3], f64)> {
    let density = |x: f64| (-0.5 * x * x).exp();
    let at = [0.75, 1.5, 2.25, 3.0];
    let sum = 1.0 + 2.0 * at.map(density).iter().sum::<f64>();
    at.iter().map(|&x| ([density(x) / sum; 3], x * deviation_mm)).collect()
}

impl ScreenGauss {
    pub(crate) fn new(gpu: &Gpu, profile: &Profile, terms: usize) -> Result<Self, RenderError> {
        let lines = |vertical, sum| [false, true].map(|levels| Line::new(gpu, vertical, levels, sum));
        Ok(Self {
            gaussians: gaussians(profile, terms)?,
            halve: Kernel::without_clear(gpu, "scatter halve", &halve_program(), "halve"),
            horizontal: lines(false, Sum::None),
            vertical: lines(true, Sum::Own),
            vertical_with_coarser: lines(true, Sum::WithCoarser),
        })
    }

    /// The light of the view and of smaller images.
    fn halved(&self, r: &mut Recorder<'_>, lit: &Lit) -> Vec<Image> {
        let size = lit.irradiance.size();
        let level = |level: usize| ImageSpec::light(size.map(|s| s.div_ceil(1 << level)));
        let mut lights = vec![lit.irradiance.clone()];
        lights.extend((1..=MAX_LEVEL).map(|i| r.image("gauss light", level(i))));
        let resources: Vec<_> =
            ["source", "half", "quarter", "eighth"].into_iter().zip(lights.iter().map(Bind::bound)).collect();
        let [x, y] = size.map(|s| s.div_ceil(HALVED_PIXELS));
        r.dispatch(&self.halve, &resources, [x, y, 1]);
        lights
    }

    /// Blurs the light of a level: the sum of its Gaussians and of the `coarser` level.
    fn record_level(
        &self,
        r: &mut Recorder<'_>,
        (seen, lit): (&Seen, &Lit),
        (index, level): (usize, &Level),
        light: &Image,
        coarser: Option<&Image>,
    ) -> Image {
        let spec = ImageSpec::light(light.size());
        let is_small = usize::from(index > 0);
        let mut params: Vec<Params> =
            level.steps.iter().map(|s| Params::new(&taps(s.deviation_mm), s.reached_mm, s.share)).collect();
        // A level without Gaussians of its own still adds the coarser ones.
        if params.is_empty() {
            params.push(Params::new(&[], 0.0, [0.0; 3]));
        }
        let last = params.len() - 1;
        let [mut blurred, mut sum] = [light.clone(), light.clone()];
        for (i, mut params) in params.into_iter().enumerate() {
            params.level = index as u32;
            let mut vertical = &self.vertical[is_small];
            let mut coarser_sum = None;
            if let (true, Some(image), Some((share, narrowest_mm))) = (i == last, coarser, level.coarser) {
                vertical = &self.vertical_with_coarser[is_small];
                let [red, green, blue] = share.map(|s| s as f32);
                params.share_coarser = [red, green, blue, narrowest_mm as f32];
                coarser_sum = Some(image);
            }
            let params = r.uniform("screen-gauss", &params);
            let mut source = blurred;
            if !level.steps.is_empty() {
                let scratch = r.image("gauss scratch", spec);
                self.horizontal[is_small].record(r, &params, seen, lit, [&source, &scratch], Sums::default());
                source = scratch;
            }
            let [next, next_sum] = ["gauss", "gauss sum"].map(|label| r.image(label, spec));
            let sums = Sums { own: Some([&sum, &next_sum]), coarser: coarser_sum };
            vertical.record(r, &params, seen, lit, [&source, &next], sums);
            (blurred, sum) = (next, next_sum);
        }
        sum
    }
}

impl Diffusion for ScreenGauss {
    fn after_shading(&mut self, r: &mut Recorder<'_>, _: &[PosedHead<'_>], seen: &Seen, lit: &Lit) -> Image {
        let plan = plan(&self.gaussians, seen.pixels_per_mm);
        let lights = match plan.len() {
            1 => vec![lit.irradiance.clone()],
            _ => self.halved(r, lit),
        };
        let mut sum: Option<Image> = None;
        for (level, light) in plan.iter().enumerate().zip(&lights).rev() {
            sum = Some(self.record_level(r, (seen, lit), level, light, sum.as_ref()));
        }
        sum.unwrap_or_else(|| lit.irradiance.clone())
    }
}
