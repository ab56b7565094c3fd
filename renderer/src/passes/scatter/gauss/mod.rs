//! `screen-gauss:4`, `screen-gauss:6`: a Gaussian after the other (papers/004 ch. 4), wide ones on smaller images.
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
//! screen: the unblurred image stands for it (section 4.2.1). A Gaussian whose standard deviation is under half a
//! pixel is skipped (eq. 4.5); sums stay normalised with the accumulated weights of eq. 4.8.
//!
//! A Gaussian runs on the smallest image whose pixels are not wider than [`PIXELS_A_DEVIATION`] allows (Burt and
//! Adelson 1983, "The Laplacian pyramid as a compact image code": what a wide blur leaves has no finer detail). Halving
//! and interpolating blur too; that much is taken off the first Gaussian of a level.
//!
//! Differs from the source: stretch is the cosine of the surface's tilt, not eqs. 4.1 and 4.2 with tuned constants, the
//! surface is followed, so that there are no haloes around ears and nose, and all its Gaussians are of full size.
//!
//! Limits: levels are chosen for the farthest head; where several stand at very different distances all pay for it.
//! Where strength is a fraction, kernels under half a pixel of their level are as wide as the level's own blur.

use rubor_rig::skin::fit::{Emphasis, RgbGaussian, fit_gaussians};
use rubor_rig::skin::profile::{Profile, RadialProfile};

use super::line::{Line, Params, Sum};
use super::{Images, Recorder};
use crate::error::RenderError;
use crate::gpu::Gpu;

/// WGSL of halving an image.
pub(crate) const HALVE: &str = concat!(
    include_str!("../../../shared/view.wgsl"),
    include_str!("../common.wgsl"),
    include_str!("halve.wgsl")
);

/// Least standard deviation in pixels of the image that a Gaussian runs on: what halving and interpolation blur (the
/// square root of a third, see [`blur_of_level_px2`]).
const PIXELS_A_DEVIATION: f64 = 0.577;

/// The smallest image is the view halved this often: one pass halves three times.
const MAX_LEVEL: usize = 3;

/// Pixels across of the view that a workgroup halves.
const HALVED_PIXELS: u32 = 32;

/// The method, ready for one profile.
pub(crate) struct ScreenGauss {
    gaussians: Vec<RgbGaussian>,
    halve: wgpu::ComputePipeline,
    /// Each for the view itself and for smaller images.
    horizontal: [Line; 2],
    vertical: [Line; 2],
    vertical_with_coarser: [Line; 2],
    canvases: Vec<Canvas>,
}

/// The images of a level.
struct Canvas {
    light: wgpu::TextureView,
    scratch: wgpu::TextureView,
    /// Gaussians and sums alternate between two.
    blurred: [wgpu::TextureView; 2],
    sums: [wgpu::TextureView; 2],
}

/// One blur after the other.
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

/// Adds weights to a sum and says what share of it they are (eq. 4.8).
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

impl Canvas {
    fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let image = |label| super::half_image(gpu, label, size);
        Self {
            light: image("gauss light"),
            scratch: image("gauss scratch"),
            blurred: [image("gauss 0"), image("gauss 1")],
            sums: [image("gauss sum 0"), image("gauss sum 1")],
        }
    }

    fn size(&self) -> [u32; 2] {
        let size = self.blurred[0].texture().size();
        [size.width, size.height]
    }
}

impl ScreenGauss {
    pub(crate) fn new(gpu: &Gpu, profile: &Profile, terms: usize) -> Result<Self, RenderError> {
        let lines = |vertical, sum| [false, true].map(|levels| Line::new(gpu, vertical, levels, sum));
        Ok(Self {
            gaussians: gaussians(profile, terms)?,
            halve: gpu.compute_pipeline_without_clear("scatter halve", HALVE, "halve"),
            horizontal: lines(false, Sum::None),
            vertical: lines(true, Sum::Own),
            vertical_with_coarser: lines(true, Sum::WithCoarser),
            canvases: Vec::new(),
        })
    }

    pub(crate) fn record(&mut self, r: &mut Recorder<'_>, images: &Images<'_>) {
        let plan = plan(&self.gaussians, r.pixels_per_mm);
        let size = images.irradiance.texture().size();
        let size = [size.width, size.height];
        if self.canvases.first().is_some_and(|c| c.size() != size) {
            self.canvases.clear();
        }
        if self.canvases.is_empty() {
            self.canvases.push(Canvas::new(r.gpu, size));
        }
        let of_view = &mut self.canvases[0];
        of_view.light = images.irradiance.clone();
        of_view.scratch = images.scratch.clone();
        of_view.sums[0] = images.scattered.clone();
        if plan.len() > 1 {
            for level in self.canvases.len()..=MAX_LEVEL {
                self.canvases.push(Canvas::new(r.gpu, size.map(|s| s.div_ceil(1 << level))));
            }
            let lights: Vec<_> =
                self.canvases.iter().map(|c| wgpu::BindingResource::TextureView(&c.light)).collect();
            let group = r.gpu.bind("scatter halve", &self.halve, 0, &lights);
            let mut pass = r.timer.compute(r.encoder, "scatter halve");
            pass.set_pipeline(&self.halve);
            pass.set_bind_group(0, &group, &[]);
            let [x, y] = size.map(|s| s.div_ceil(HALVED_PIXELS));
            pass.dispatch_workgroups(x, y, 1);
        }

        let mut coarser = None;
        for (index, level) in plan.iter().enumerate().rev() {
            self.record_level(r, images, index, level, coarser);
            coarser = Some(&self.canvases[index].sums[0]);
        }
    }

    /// Blurs the light of a level; the sum of its Gaussians and of what is `coarser` is then in the first of its sums.
    fn record_level(
        &self,
        r: &mut Recorder<'_>,
        images: &Images<'_>,
        index: usize,
        level: &Level,
        coarser: Option<&wgpu::TextureView>,
    ) {
        let canvas = &self.canvases[index];
        let is_small = usize::from(index > 0);
        let mut params: Vec<Params> =
            level.steps.iter().map(|s| Params::new(&taps(s.deviation_mm), s.reached_mm, s.share)).collect();
        // A level without Gaussians of its own still takes the coarser ones up.
        if params.is_empty() {
            params.push(Params::new(&[], 0.0, [0.0; 3]));
        }
        let last = params.len() - 1;
        let [mut blurred, mut sum] = [&canvas.light; 2];
        for (i, mut params) in params.into_iter().enumerate() {
            params.level = index as u32;
            let mut vertical = &self.vertical[is_small];
            let next = &canvas.blurred[i % 2];
            let next_sum = &canvas.sums[(last - i) % 2];
            let mut sums = vec![sum, next_sum];
            if let (true, Some(image), Some((share, narrowest_mm))) = (i == last, coarser, level.coarser) {
                vertical = &self.vertical_with_coarser[is_small];
                let [red, green, blue] = share.map(|s| s as f32);
                params.share_coarser = [red, green, blue, narrowest_mm as f32];
                sums.push(image);
            }
            let params = r.gpu.uniform("screen-gauss", &params);
            let mut source = blurred;
            if !level.steps.is_empty() {
                let step = [source, &canvas.scratch];
                self.horizontal[is_small].record(
                    r.gpu,
                    r.encoder,
                    r.timer,
                    r.view,
                    &params,
                    images,
                    step,
                    &[],
                );
                source = &canvas.scratch;
            }
            let step = [source, next];
            vertical.record(r.gpu, r.encoder, r.timer, r.view, &params, images, step, &sums);
            (blurred, sum) = (next, next_sum);
        }
    }
}
