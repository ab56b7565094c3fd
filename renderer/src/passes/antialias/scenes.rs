//! Analytic scenes: any point has a colour, so that samples and coverage are known.

use super::reference::Picture;

/// A scene: encoded grey at a point in pixels, y down.
pub(super) type Scene<'a> = dyn Fn(f64, f64) -> f32 + Sync + 'a;

/// The scene sampled once per pixel, `offset` pixels from the centres.
pub(super) fn sampled(scene: &Scene, size: [usize; 2], offset: [f32; 2]) -> Picture {
    Picture::from_fn(size[0], size[1], |x, y| {
        let v = scene(x as f64 + 0.5 + f64::from(offset[0]), y as f64 + 0.5 + f64::from(offset[1]));
        [v, v, v, 1.0]
    })
}

/// White above a line through `at` that rises by `degrees`, black below.
pub(super) fn half_plane(degrees: f64, at: [f64; 2]) -> impl Fn(f64, f64) -> f32 + Sync {
    let (sin, cos) = degrees.to_radians().sin_cos();
    move |x, y| if (x - at[0]) * sin + (y - at[1]) * cos > 0.0 { 0.0 } else { 1.0 }
}

/// Mean of a pixel over `side * side` points.
pub(super) fn covered(scene: &Scene, x: usize, y: usize, side: usize) -> f32 {
    let point = |i: usize| (i as f64 + 0.5) / side as f64;
    let sum: f32 =
        (0..side * side).map(|i| scene(x as f64 + point(i % side), y as f64 + point(i / side))).sum();
    sum / (side * side) as f32
}
