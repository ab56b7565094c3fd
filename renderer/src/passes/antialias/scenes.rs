//! Analytic scenes: any point has a colour, so that samples and coverage are known.

use super::reference::Picture;

/// A scene: encoded grey at a point in pixels, y down.
pub(super) type Scene<'a> = dyn Fn(f64, f64) -> f32 + Sync + 'a;

/// The scene sampled once a pixel, `offset` pixels from the centres.
pub(super) fn sampled(scene: &Scene, size: [usize; 2], offset: [f32; 2]) -> Picture {
    Picture::from_fn(size[0], size[1], |x, y| {
        let v = scene(x as f64 + 0.5 + f64::from(offset[0]), y as f64 + 0.5 + f64::from(offset[1]));
        [v, v, v, 1.0]
    })
}
