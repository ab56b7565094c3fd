//! The same light from the equations, in f64 and with the angles of Marschner et al. 2003.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

const ETA: f64 = 1.55;
/// Mirrored, through, returned: shift and deviation of the sum of sines, papers' alpha and beta.
const LOBES: [(f64, f64); 3] = [(-0.07, 0.17), (0.035, 0.12), (0.14, 0.30)];
const THROUGH: f64 = 0.15;
const DIFFUSE: f64 = 0.4;

fn gaussian(x: f64, deviation: f64) -> f64 {
    (-0.5 * (x / deviation).powi(2)).exp() / (deviation * TAU.sqrt())
}

fn fresnel(cosine: f64) -> f64 {
    let f0 = ((ETA - 1.0) / (ETA + 1.0)).powi(2);
    f0 + (1.0 - f0) * (1.0 - cosine).powi(5)
}

/// exp(k cos(angle)) scaled to integrate to one over a turn.
fn around(angle: f64, k: f64) -> f64 {
    // 2 pi I0(k), the Bessel function from its series.
    let (mut term, mut bessel) = (1.0, 1.0);
    for n in 1..30 {
        term *= (0.5 * k / f64::from(n)).powi(2);
        bessel += term;
    }
    (k * angle.cos()).exp() / (TAU * bessel)
}

/// Radiance for unit irradiance across the light; inclinations towards the tip and azimuth in radians.
pub(super) fn radiance(light: f64, view: f64, azimuth: f64, color: [f64; 3], spread: f64) -> [f64; 3] {
    let sum = light.sin() + view.sin();
    let difference = 0.5 * (view - light);
    let to_light = DVec3::new(light.cos(), light.sin(), 0.0);
    let to_viewer = DVec3::new(view.cos() * azimuth.cos(), view.sin(), view.cos() * azimuth.sin());
    let [mirrored, through, returned] =
        LOBES.map(|(shift, width)| gaussian(sum - shift, width.hypot(spread)));
    // Bravais: the cross-section refracts by an index that grows with the inclination.
    let bent_eta = (ETA * ETA - difference.sin().powi(2)).sqrt() / difference.cos();
    let inside = (0.75f64.sqrt() / bent_eta).asin();
    let path = 2.0 * inside.cos() / (difference.sin() / ETA).asin().cos();
    let entering = (1.0 - fresnel(0.5 * difference.cos())).powi(2);
    let half = 0.5 * to_light.angle_between(to_viewer);
    let cuticle = mirrored * 0.25 * (0.5 * azimuth).cos() * fresnel(half.cos());
    let side = azimuth.abs();
    let cylinder = ((PI - side) * side.cos() + side.sin()) / (4.0 * PI);
    color.map(|c| {
        let passed = (-(c.ln() / 5.888).powi(2) * path).exp();
        let lobes = cuticle
            + THROUGH * entering * passed * through * around(azimuth + PI, 3.65)
            + entering * (1.0 - entering.sqrt()) * passed * passed * returned * around(azimuth, 6.0);
        lobes * (light.cos() / view.cos()).min(1.0) + DIFFUSE * c * cylinder * light.cos()
    })
}
