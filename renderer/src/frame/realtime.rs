//! A frame in one go: the order of the stages.

use super::Frame;
use super::stages::Samples;
use crate::device::{Image, Recorder};
use crate::error::RenderError;
use crate::passes::diffusion::Diffusion;

/// Records a frame; the picture is in the returned image, or in the frame's target.
///
/// # Errors
/// The antialiasing lacks an input.
pub(crate) fn record(
    r: &mut Recorder<'_>,
    frame: &mut Frame<'_>,
    diffusion: &mut dyn Diffusion,
) -> Result<Option<Image>, RenderError> {
    frame.pose(r);
    let mut light = frame.light(r);
    frame.bounce(r, &mut light);
    if frame.needs.before_view {
        let before = frame.before(r, &light);
        diffusion.before_view(r, &before);
    }

    let mut samples = Samples::default();
    for subsample in frame.subsamples() {
        let seen = frame.see(r, subsample);
        let lit = frame.shade(r, &light, &seen, &samples, diffusion.skin_light());
        let diffuse = diffusion.after_shading(r, &frame.heads, &seen, &lit);
        frame.show(r, &light, seen, lit, &diffuse, &mut samples);
    }
    frame.antialias(r, samples)
}
