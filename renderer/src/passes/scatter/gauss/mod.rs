//! `screen-gauss:4`, `screen-gauss:6`: a Gaussian after the other (papers/004 ch. 4).
//!
//! ```text
//! irradiance --line, line--> G2 --line, line--> G3 ...      each blurs the one before by the difference in variance
//!      +----------------------+-----mix by w'---+---> scattered
//! ```
//!
//! Theory: the profile as a sum of Gaussians of common variances (eq. 5.3). The narrowest is under a pixel on any
//! screen: the unblurred image stands for it (section 4.2.1). A Gaussian whose standard deviation is under half a
//! pixel is skipped (eq. 4.5); sums stay normalised with the accumulated weights of eq. 4.8.
//!
//! Differs from the source: stretch is the cosine of the surface's tilt, not eqs. 4.1 and 4.2 with tuned constants, and
//! the surface is followed, so that there are no haloes around ears and nose.

use rubor_rig::skin::fit::{Emphasis, RgbGaussian, fit_gaussians};
use rubor_rig::skin::profile::{Profile, RadialProfile};

use super::line::{Line, Params};
use super::{Images, Recorder};
use crate::error::RenderError;
use crate::gpu::Gpu;

/// The method, ready for one profile and one size of image.
pub(crate) struct ScreenGauss {
    horizontal: Line,
    vertical: Line,
    steps: Vec<wgpu::Buffer>,
    own: Option<Own>,
}

/// Two images that Gaussians alternate between, and one for sums.
struct Own {
    blurred: [wgpu::TextureView; 2],
    sum: wgpu::TextureView,
}

/// One blur after the other.
pub(crate) struct Step {
    /// Standard deviation that this step adds, mm.
    pub(crate) deviation_mm: f64,
    /// Share of the result in the sum, eq. 4.8.
    pub(crate) share: [f64; 3],
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

/// Steps for Gaussians (narrowest first); the narrowest is the unblurred image.
pub(crate) fn steps(gaussians: &[RgbGaussian]) -> Vec<Step> {
    let mut so_far = gaussians.first().map_or([0.0; 3], |g| g.weights);
    let mut steps = Vec::new();
    for (i, g) in gaussians.iter().enumerate().skip(1) {
        // The image that the first step blurs is sharp: its Gaussian has not been applied.
        let before = if i == 1 { 0.0 } else { gaussians[i - 1].variance_mm2 };
        let share = std::array::from_fn(|c| {
            so_far[c] += g.weights[c];
            if so_far[c] > 0.0 { g.weights[c] / so_far[c] } else { 0.0 }
        });
        steps.push(Step { deviation_mm: (g.variance_mm2 - before).sqrt(), share });
    }
    steps
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
        let buffers = steps(&gaussians(profile, terms)?)
            .iter()
            .map(|s| {
                gpu.uniform("screen-gauss", &Params::new(&taps(s.deviation_mm), s.deviation_mm, s.share))
            })
            .collect();
        Ok(Self {
            horizontal: Line::new(gpu, false, false),
            vertical: Line::new(gpu, true, true),
            steps: buffers,
            own: None,
        })
    }

    pub(crate) fn record(&mut self, r: &mut Recorder<'_>, images: &Images<'_>) {
        let size = images.irradiance.texture().size();
        let size = [size.width, size.height];
        if self
            .own
            .as_ref()
            .is_some_and(|o| o.sum.texture().width() != size[0] || o.sum.texture().height() != size[1])
        {
            self.own = None;
        }
        let own = self.own.get_or_insert_with(|| {
            let image = |label| super::half_image(r.gpu, label, size);
            Own { blurred: [image("gauss 0"), image("gauss 1")], sum: image("gauss sum") }
        });
        let mut blurred = images.irradiance;
        let mut sum = images.irradiance;
        let last = self.steps.len() - 1;
        for (i, params) in self.steps.iter().enumerate() {
            // The last sum must be the result.
            let next_sum = if (last - i).is_multiple_of(2) { images.scattered } else { &own.sum };
            let next = &own.blurred[i % 2];
            let step = [blurred, images.scratch];
            self.horizontal.record(r.gpu, r.encoder, r.timer, r.view, params, images, step, None);
            let step = [images.scratch, next];
            let sums = Some([sum, next_sum]);
            self.vertical.record(r.gpu, r.encoder, r.timer, r.view, params, images, step, sums);
            (blurred, sum) = (next, next_sum);
        }
    }
}
