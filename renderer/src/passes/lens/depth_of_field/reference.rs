//! The blur of a lens from its definition: every pixel of every disk, in f64.

use std::f64::consts::PI;

/// A pixel before the lens.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pixel {
    /// Radiance less that of the backdrop.
    pub(crate) light: [f64; 3],
    /// Radius of its disk, pixels; below 0 in front of the focus.
    pub(crate) radius: f64,
    /// Whether a surface is seen.
    pub(crate) is_surface: bool,
}

fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Light of a disk of a radius at a distance from its middle, for one unit of light.
fn density(distance: f64, radius: f64) -> f64 {
    (radius - distance + 0.5).clamp(0.0, 1.0) / (PI * (radius * radius + 1.0 / 12.0))
}

/// Radiance less that of the backdrop at a pixel, behind the lens. No disk is wider than `most` pixels from its middle.
pub(crate) fn blurred(pixels: &[Pixel], [width, height]: [usize; 2], at: [usize; 2], most: f64) -> [f64; 3] {
    let own = pixels[at[1] * width + at[0]];
    let own_radius = own.radius.abs().max(0.5);
    let is_near = if own.is_surface { smoothstep(0.5, 2.0, -own.radius) } else { 0.0 };
    let (mut main, mut front) = ([0.0; 4], [0.0; 4]);
    let add = |sum: &mut [f64; 4], weight: f64, light: [f64; 3]| {
        for c in 0..3 {
            sum[c] += weight * light[c];
        }
        sum[3] += weight;
    };
    let reach = most.ceil() as usize + 1;
    for y in at[1].saturating_sub(reach)..(at[1] + reach + 1).min(height) {
        for x in at[0].saturating_sub(reach)..(at[0] + reach + 1).min(width) {
            let other = pixels[y * width + x];
            let distance = (x as f64 - at[0] as f64).hypot(y as f64 - at[1] as f64);
            let radius = other.radius.abs().max(0.5);
            let slope = 0.15 * (radius + own_radius);
            let step = |difference| smoothstep(0.5 + slope, 1.5 + 2.0 * slope, difference);
            let (before, beyond) = match (own.is_surface, other.is_surface) {
                (true, true) => (step(own.radius - other.radius), step(other.radius - own.radius)),
                (true, false) => (0.0, 1.0),
                (false, _) => (0.0, 0.0),
            };
            let hidden = radius.min(own_radius) * (1.0 - is_near) + own_radius * is_near;
            let used = radius * (1.0 - beyond) + hidden * beyond;
            add(&mut main, (1.0 - before) * density(distance, used), other.light);
            add(&mut front, before * density(distance, radius), other.light);
        }
    }
    let coverage = front[3].min(1.0);
    std::array::from_fn(|c| main[c] / main[3] * (1.0 - coverage) + front[c] / front[3].max(1e-9) * coverage)
}
