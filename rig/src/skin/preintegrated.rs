//! Scattered light as look-up tables: what a profile makes of Lambert's law on a round surface, of the edge of a
//! shadow and of a smooth environment (Penner and Borshukov 2011, "Pre-integrated skin shading").
//!
//! ```text
//! profile --> light on a sphere, or around a cylinder  --> DiffuseTable   (N.L, curvature)
//!        +--> its Legendre coefficients on a sphere    --> HarmonicTable  (band, curvature)
//!        +--> edge of light through a disk filter      --> ShadowTable    (shadow value, width of the penumbra)
//! ```
//!
//! **Sphere and ring.** The paper integrates over a ring. What arrives on a ring depends on the weight of a place:
//!
//! - [`Shape::Sphere`], the tables of frames. On a sphere of radius `r` the cap inside of a chord `c` has the area
//!   `pi c^2` (Archimedes), so the profile's own CDF is the distribution of light over chords, and the mean of Lambert's
//!   law over a circle of equal chords has a closed form: one integral, exact for any profile.
//! - [`Shape::Cylinder`] is the ring with the profile's line spread as its weight. It is the integral over an infinite
//!   cylinder that is lit across its axis: along the axis light does not vary.
//! - [`Shape::Ring`] is the paper's eq. 1.1 with its two slips mended (the whole circle, one radius above and below the
//!   line). The weight is R itself, as if the surface were a wire: a narrow Gaussian of R counts as much more than its
//!   share of the light, so the fall-off is too sharp (`cargo run --release -p rubor-rig --example preintegrated_table`), and the integral does
//!   not exist for a profile that is infinite at 0. It is here to be compared with, no frame uses it.
//!
//! All are white: light that a sphere narrower than the profile cannot hold is left out above and below the line.
//!
//! **Curvature.** A surface has two principal curvatures. Scattering blurs the normal over the surface; to second order
//! the light falls by the Laplacian of the normal, `-(k1^2 + k2^2) N` where the curvature changes slowly, which is `-2 k^2 N` on a sphere. So
//! the sphere that scatters alike has [`curvedness`] `sqrt((k1^2 + k2^2) / 2)` and not the mean curvature, which is 0 on
//! a saddle. Where the light ends, only the curvature across the terminator counts: [`curvature_towards`].

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::LazyLock;

use rayon::prelude::*;

use super::numerics::{gauss_legendre, integrate, invert_cdf};
use super::profile::{Profile, RadialProfile};
use crate::error::SkinError;

/// Nodes of a panel over which an integrand is smooth.
static PANEL_RULE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss_legendre(8));

/// Radius of the first panel over the profile's scale: light inside of it counts as if it left where it entered.
const FIRST_PANEL: f64 = 1e-3;
/// Ratio of the ends of a panel of a sphere.
const PANEL_RATIO: f64 = 2.0;
/// Ratio of the ends of a panel of a ring, where Lambert's law has a corner.
const RING_RATIO: f64 = 1.15;

/// The surface over which light is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A sphere: exact.
    Sphere,
    /// A cylinder lit across its axis: a ring weighted by the profile's line spread.
    Cylinder,
    /// The ring of Penner and Borshukov 2011, eq. 1.1, weighted by R itself.
    Ring,
}

/// Share of the light of a lamp that leaves a round surface, over Lambert's cosine and curvature.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffuseTable {
    /// Columns: N.L from -1 to 1 at even steps; odd, so that one stands at 0.
    pub cosines: usize,
    /// Rows: curvatures by [`CurvatureAxis`].
    pub axis: CurvatureAxis,
    /// R, G, B, row by row, each relative to light that falls straight on a plane.
    pub values: Vec<[f64; 3]>,
}

/// Attenuation of each band of spherical harmonics by scattering on a sphere, over curvature.
#[derive(Clone, Debug, PartialEq)]
pub struct HarmonicTable {
    /// Curvatures.
    pub axis: CurvatureAxis,
    /// R, G, B of bands 1 and 2 at each step; band 0 keeps its light.
    pub bands: [Vec<[f64; 3]>; 2],
}

/// Curvatures of the entries of a table: entry i of n has `k = k_middle v / (1 - v)` with `v = v_end i / (n - 1)`, which
/// is fine where surfaces are nearly flat and reaches spheres narrower than the profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvatureAxis {
    /// Entries.
    pub entries: usize,
    /// Curvature in the middle of the axis, 1/mm.
    pub middle_per_mm: f64,
}

/// The end of the axis as a share of infinite curvature.
const AXIS_END: f64 = 0.95;

impl CurvatureAxis {
    /// An axis that fits a profile: its middle is a sphere as wide as the profile's reach.
    ///
    /// # Errors
    /// The profile has no finite width.
    pub fn new(profile: &Profile, entries: usize) -> Result<Self, SkinError> {
        if entries < 2 {
            return Err(SkinError::new("preintegrated.curvatures", entries, "2 or more entries"));
        }
        Ok(Self { entries, middle_per_mm: 0.5 / reach_mm(profile)? })
    }

    /// Curvature of an entry, 1/mm.
    pub fn curvature(&self, entry: usize) -> f64 {
        let v = AXIS_END * entry as f64 / (self.entries - 1) as f64;
        self.middle_per_mm * v / (1.0 - v)
    }

    /// Factor that makes of `k / (k + k_middle)` a place between the first (0) and the last (1) entry.
    pub fn scale(&self) -> f64 {
        1.0 / AXIS_END
    }

    /// Place of a curvature, 0 to 1 from the first to the last entry; clamped at the end.
    pub fn place(&self, curvature_per_mm: f64) -> f64 {
        let k = curvature_per_mm.max(0.0);
        let v = if k.is_finite() { k / (k + self.middle_per_mm) } else { 1.0 };
        (v * self.scale()).min(1.0)
    }
}

/// Radius of the disk that holds 99.5 % of the light of each channel, mm.
///
/// # Errors
/// The profile has no finite width, or no light.
pub fn reach_mm(profile: &Profile) -> Result<f64, SkinError> {
    let reach = profile.channels.iter().map(|c| c.sample_radius(0.995)).fold(0.0, f64::max);
    if reach > 0.0 && reach.is_finite() {
        return Ok(reach);
    }
    Err(SkinError::new("preintegrated.profile", format!("a reach of {reach} mm"), "a positive finite reach"))
}

/// Curvature of the sphere that scatters light like a surface of two principal curvatures, to second order; in their unit.
pub fn curvedness([first, second]: [f64; 2]) -> f64 {
    (0.5 * (first * first + second * second)).sqrt()
}

/// Curvature of the sphere that scatters light like a surface where a lamp's direction meets it at a cosine, with the
/// part of the direction in the tangent plane at `angle` from the first principal direction: across the terminator the
/// curvature in the direction of the light counts, elsewhere [`curvedness`]. Exact on spheres.
pub fn curvature_towards([first, second]: [f64; 2], cosine: f64, angle: f64) -> f64 {
    let across = (first * angle.cos()).hypot(second * angle.sin());
    let c2 = cosine * cosine;
    ((1.0 - c2) * across * across + c2 * curvedness([first, second]).powi(2)).sqrt()
}

/// Mean of `max(cos, 0)` towards a lamp over a circle around a point of a sphere, from the cosine and sine of the
/// point's angle to the lamp and of the circle's radius as an angle.
///
/// On the circle the cosine is `a + b cos(phi)`: its positive part has the mean `(a phi_0 + b sin(phi_0)) / pi` with
/// `cos(phi_0) = -a / b`.
fn mean_of_circle(point: [f64; 2], circle: [f64; 2]) -> f64 {
    let (a, b) = (point[0] * circle[0], point[1] * circle[1]);
    if a.abs() >= b {
        return a.max(0.0);
    }
    let end = (-a / b).acos();
    // b sin(phi_0) without the loss of digits near the ends.
    (a * end + (b * b - a * a).sqrt()) / PI
}

/// A ring of light on a sphere.
struct Circle {
    /// Cosine and sine of its angle.
    angle: [f64; 2],
    /// Its share of the light.
    share: f64,
}

/// The light of a profile around a point of a sphere, in rings; all of it in the point for a plane.
fn circles(profile: &RadialProfile, radius_mm: f64) -> Vec<Circle> {
    let point = |share| Circle { angle: [1.0, 0.0], share };
    let total = profile.total();
    let end = 2.0 * radius_mm;
    if !(end.is_finite() && total > 0.0) {
        return vec![point(1.0)];
    }
    let start = (FIRST_PANEL * profile.scale_mm()).min(0.5 * end);
    let mut circles = vec![point(total - profile.mass_beyond(start))];
    let mut from = start;
    while from < end {
        let to = (PANEL_RATIO * from).min(end);
        // The light of a panel is known exactly; quadrature in the logarithm of the chord decides only where in the
        // panel it is.
        let light = profile.mass_beyond(from) - profile.mass_beyond(to);
        let half = 0.5 * (to / from).ln();
        let nodes: Vec<(f64, f64)> = (PANEL_RULE.iter())
            .map(|&(x, w)| {
                let chord = from * (half * (x + 1.0)).exp();
                (chord, w * chord * chord * profile.reflectance(chord))
            })
            .collect();
        let mass: f64 = nodes.iter().map(|n| n.1).sum();
        if mass > 0.0 && light > 0.0 {
            circles.extend(nodes.into_iter().map(|(chord, w)| {
                // Half of the angle has the sine chord / 2 r.
                let sine = (0.5 * chord / radius_mm).min(1.0);
                let cosine = (1.0 - sine * sine).sqrt();
                Circle { angle: [1.0 - 2.0 * sine * sine, 2.0 * sine * cosine], share: light * w / mass }
            }));
        }
        if profile.mass_beyond(to) <= 1e-12 * total {
            break;
        }
        from = to;
    }
    let sum: f64 = circles.iter().map(|c| c.share).sum();
    if sum <= 0.0 {
        return vec![point(1.0)];
    }
    circles.iter_mut().for_each(|c| c.share /= sum);
    circles
}

/// Scattered light where the normal has a cosine to the lamp.
fn scattered(circles: &[Circle], cosine: f64) -> f64 {
    let point = [cosine, (1.0 - cosine * cosine).max(0.0).sqrt()];
    circles.iter().map(|c| c.share * mean_of_circle(point, c.angle)).sum()
}

/// Mean of a function of the angle, from -pi to pi, around a ring with weights that are even in the angle.
fn mean_on_ring(radius_mm: f64, scale_mm: f64, weight: impl Fn(f64) -> f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    let mut from = 0.0;
    let mut to = (FIRST_PANEL * scale_mm / radius_mm).min(PI);
    while from < PI {
        for &(x, w) in PANEL_RULE.iter() {
            let angle = 0.5 * (to - from) * (x + 1.0) + from;
            let w = w * (to - from) * weight(2.0 * radius_mm * (0.5 * angle).sin());
            sum += w * (f(angle) + f(-angle));
            total += 2.0 * w;
        }
        (from, to) = (to, (RING_RATIO * to).min(PI));
    }
    if total > 0.0 { sum / total } else { f(0.0) }
}

/// Light that leaves a round surface of a radius, relative to light that falls straight on a plane, where the normal has
/// the cosine `cosine` with the direction to a lamp far away. An infinite radius is a plane: `max(cosine, 0)`.
///
/// # Errors
/// The radius is not positive, the cosine not from -1 to 1, or the profile is infinite at 0 and the shape [`Shape::Ring`].
pub fn scattered_cosine(
    profile: &RadialProfile,
    shape: Shape,
    cosine: f64,
    radius_mm: f64,
) -> Result<f64, SkinError> {
    if radius_mm.is_nan() || radius_mm <= 0.0 {
        return Err(SkinError::new("preintegrated.radius_mm", radius_mm, "a positive radius"));
    }
    if !(-1.0..=1.0).contains(&cosine) {
        return Err(SkinError::new("preintegrated.cosine", cosine, "a cosine from -1 to 1"));
    }
    if !radius_mm.is_finite() {
        return Ok(cosine.max(0.0));
    }
    let start = cosine.acos();
    let lambert = |angle: f64| (start + angle).cos().max(0.0);
    match shape {
        Shape::Sphere => Ok(scattered(&circles(profile, radius_mm), cosine)),
        Shape::Cylinder => {
            // The line spread as the difference of its sums over each panel's nodes would lose digits: a central
            // difference of a hundredth of the place is exact to 1e-4 of the spread's curvature.
            let spread = |x: f64| {
                let step = 0.01 * x;
                (profile.line_cdf(x + step) - profile.line_cdf(x - step)) / step
            };
            Ok(mean_on_ring(radius_mm, profile.scale_mm(), spread, lambert))
        }
        Shape::Ring => {
            if !profile.reflectance(0.0).is_finite() {
                return Err(SkinError::new(
                    "preintegrated.shape",
                    "a ring with a profile that is infinite at 0",
                    "a sphere or a cylinder: the ring's integral does not exist",
                ));
            }
            Ok(mean_on_ring(radius_mm, profile.scale_mm(), |x| profile.reflectance(x), lambert))
        }
    }
}

/// Share that scattering on a sphere leaves of the spherical harmonics of bands 0, 1 and 2 of the light: the profile's
/// Legendre coefficients on the sphere, the mean of `P_l(cos angle)` over its light (Funk and Hecke). 1 on a plane.
pub fn band_shares(profile: &RadialProfile, radius_mm: f64) -> [f64; 3] {
    let circles = circles(profile, radius_mm);
    let mean = |f: &dyn Fn(f64) -> f64| circles.iter().map(|c| c.share * f(c.angle[0])).sum();
    [1.0, mean(&|cosine| cosine), mean(&|cosine| 1.5 * cosine * cosine - 0.5)]
}

impl DiffuseTable {
    /// Tabulates [`scattered_cosine`] of a sphere.
    ///
    /// # Errors
    /// Fewer than 3 columns or an even number of them; fewer than 2 rows; a profile without a finite width.
    pub fn new(profile: &Profile, cosines: usize, curvatures: usize) -> Result<Self, SkinError> {
        if cosines < 3 || cosines.is_multiple_of(2) {
            return Err(SkinError::new("preintegrated.cosines", cosines, "an odd number, 3 or more"));
        }
        let axis = CurvatureAxis::new(profile, curvatures)?;
        let row = |row: usize| {
            let rings = profile.channels.each_ref().map(|c| circles(c, 1.0 / axis.curvature(row)));
            (0..cosines)
                .map(|column| {
                    let cosine = 2.0 * column as f64 / (cosines - 1) as f64 - 1.0;
                    rings.each_ref().map(|rings| scattered(rings, cosine))
                })
                .collect::<Vec<_>>()
        };
        let values = (0..curvatures).into_par_iter().flat_map_iter(row).collect();
        Ok(Self { cosines, axis, values })
    }

    /// Bilinear interpolation, as a sampler does it; clamped at all sides.
    pub fn sample(&self, cosine: f64, curvature_per_mm: f64) -> [f64; 3] {
        let size = [self.cosines, self.axis.entries];
        bilinear(&self.values, size, [0.5 * cosine + 0.5, self.axis.place(curvature_per_mm)])
    }
}

impl HarmonicTable {
    /// Tabulates [`band_shares`].
    ///
    /// # Errors
    /// Fewer than 2 entries; a profile without a finite width.
    pub fn new(profile: &Profile, curvatures: usize) -> Result<Self, SkinError> {
        let axis = CurvatureAxis::new(profile, curvatures)?;
        let mut bands = [Vec::new(), Vec::new()];
        for row in 0..curvatures {
            let shares = profile.channels.each_ref().map(|c| band_shares(c, 1.0 / axis.curvature(row)));
            for (band, values) in bands.iter_mut().enumerate() {
                values.push(shares.map(|s| s[band + 1]));
            }
        }
        Ok(Self { axis, bands })
    }
}

/// Interpolation of rows of values at a place from (0, 0), the middle of the first, to (1, 1), that of the last.
fn bilinear<const N: usize>(values: &[[f64; N]], [width, height]: [usize; 2], [u, v]: [f64; 2]) -> [f64; N] {
    let at = |u: f64, n: usize| {
        let x = u.clamp(0.0, 1.0) * (n - 1) as f64;
        let i = (x as usize).min(n.saturating_sub(2));
        (i, (i + 1).min(n - 1), x - i as f64)
    };
    let ((x0, x1, s), (y0, y1, t)) = (at(u, width), at(v, height));
    let value = |x: usize, y: usize| values[y * width + x];
    std::array::from_fn(|c| {
        let row = |y: usize| value(x0, y)[c] * (1.0 - s) + value(x1, y)[c] * s;
        row(y0) * (1.0 - t) + row(y1) * t
    })
}

/// Light through a filter that is a disk of radius 1, `x` from the edge of a shadow, -1 (dark) to 1 (lit): the share of
/// the disk on the lit side, `1/2 + (x sqrt(1 - x^2) + asin x) / pi`.
///
/// It is the edge response of percentage-closer soft shadows whose taps lie evenly in a disk, and that of a
/// disk-shaped lamp.
pub fn disk_edge(x: f64) -> f64 {
    let x = x.clamp(-1.0, 1.0);
    0.5 + (x * (1.0 - x * x).sqrt() + x.asin()) / PI
}

/// The place where [`disk_edge`] has a value, 0 to 1.
pub fn inverse_disk_edge(share: f64) -> f64 {
    // The edge is symmetric and rises, so bisection over one half finds the place.
    let far = (share - 0.5).abs();
    let x = invert_cdf(far.min(0.5), 0.5, |x| disk_edge(x) - 0.5).min(1.0);
    if share < 0.5 { -x } else { x }
}

/// Light beside the edge of a shadow over the value of the shadow's filter and the radius of its penumbra, mm.
///
/// A shadow's filter has to be wider than the penumbra by the reach of the light in the skin: its value then tells the
/// distance to the edge wherever the edge has an effect (Penner and Borshukov 2011, section 1.6). A wide filter tells
/// the distance only roughly (its taps are few), so light that goes far and light that goes near have a filter each:
///
/// ```text
/// light(x) = near(P_n(x)) + far(P_f(x)),   P of radius penumbra + reach of the part
/// ```
///
/// The profile's line spread l is parted by a window: `l W(x / reach_near)` is near, the rest far. Both parts of an edge
/// add up to the penumbra of a disk-shaped lamp blurred by l, exactly for a straight edge on a plane.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowTable {
    /// Columns: values of the filter from 0 to 1 at even steps.
    pub shares: usize,
    /// Rows: radii of the penumbra from 0 to [`ShadowTable::widest_mm`]; row i of n stands at `widest (i / (n - 1))^2`.
    pub widths: usize,
    /// Radius of the penumbra in the last row, mm.
    pub widest_mm: f64,
    /// What the radius of each filter has more than that of the penumbra, mm: near, far.
    pub reach_mm: [f64; 2],
    /// R, G, B of the light of the near and the far part, row by row; a = the unscattered penumbra, from the near filter.
    pub values: [Vec<[f64; 4]>; 2],
}

/// Reach of the near part over that of the far part.
const NEAR_REACH: f64 = 0.12;
/// Narrowest penumbra over the reach of the near part: sharper edges would show the noise of the filter's taps.
const LEAST_PENUMBRA: f64 = 0.3;
/// Steps of the integral over a part's line spread.
const SPREAD_STEPS: usize = 400;

impl ShadowTable {
    /// Tabulates the light of both parts, for penumbrae up to a radius and light that goes up to `farthest_mm`; what goes
    /// farther counts as if it went evenly up to there.
    ///
    /// # Errors
    /// Fewer than 2 columns or rows; a width that is not positive and finite; a profile without a finite width.
    pub fn new(
        profile: &Profile,
        [shares, widths]: [usize; 2],
        widest_mm: f64,
        farthest_mm: f64,
    ) -> Result<Self, SkinError> {
        for (at, n) in [("preintegrated.shares", shares), ("preintegrated.widths", widths)] {
            if n < 2 {
                return Err(SkinError::new(at, n, "2 or more entries"));
            }
        }
        for (at, mm) in [("preintegrated.widest_mm", widest_mm), ("preintegrated.farthest_mm", farthest_mm)] {
            if !(mm > 0.0 && mm.is_finite()) {
                return Err(SkinError::new(at, mm, "a positive finite width"));
            }
        }
        let far = reach_mm(profile)?.min(farthest_mm);
        let reach = [NEAR_REACH * far, far];
        let spreads = profile.channels.each_ref().map(|c| parts(c, reach));
        let mut values = [Vec::new(), Vec::new()];
        for row in 0..widths {
            let penumbra = widest_mm * (row as f64 / (widths - 1) as f64).powi(2);
            let sharp = penumbra.max(LEAST_PENUMBRA * reach[0]);
            for (part, values) in values.iter_mut().enumerate() {
                let filter = penumbra + reach[part];
                let light = |x: f64| -> [f64; 3] {
                    spreads
                        .each_ref()
                        .map(|s| s[part].iter().map(|(y, w)| w * disk_edge((x - y) / sharp)).sum())
                };
                // The ends of the filter see no edge: nothing and everything, whatever the sum leaves there.
                let (dark, lit) = (light(-filter), light(filter));
                for column in 0..shares {
                    let x = filter * inverse_disk_edge(column as f64 / (shares - 1) as f64);
                    let here = light(x);
                    let fitted = |c: usize| {
                        let whole: f64 = spreads[c][part].iter().map(|s| s.1).sum();
                        let range = lit[c] - dark[c];
                        if range > 0.0 { whole * (here[c] - dark[c]) / range } else { 0.0 }
                    };
                    let plain = if part == 0 { disk_edge(x / sharp) } else { 0.0 };
                    values.push([fitted(0), fitted(1), fitted(2), plain]);
                }
            }
        }
        Ok(Self { shares, widths, widest_mm, reach_mm: reach, values })
    }

    /// Row of a penumbra, 0 to 1 from the first to the last; clamped.
    pub fn place(&self, penumbra_mm: f64) -> f64 {
        (penumbra_mm / self.widest_mm).clamp(0.0, 1.0).sqrt()
    }

    /// Light from the values of both filters, R, G, B, and the unscattered penumbra; bilinear, as a sampler does it.
    pub fn sample(&self, [near, far]: [f64; 2], penumbra_mm: f64) -> [f64; 4] {
        let v = self.place(penumbra_mm);
        let size = [self.shares, self.widths];
        let near = bilinear(&self.values[0], size, [near, v]);
        let far = bilinear(&self.values[1], size, [far, v]);
        std::array::from_fn(|c| near[c] + far[c])
    }
}

/// The line spread of a profile as steps (place in mm, share of the light), in a near and a far part.
fn parts(profile: &RadialProfile, [near, far]: [f64; 2]) -> [Vec<(f64, f64)>; 2] {
    let mut parts = [Vec::new(), Vec::new()];
    // Steps grow from the middle, where line spreads are steep.
    let place = |i: usize| far * (i as f64 / SPREAD_STEPS as f64).powi(3);
    let all = profile.line_cdf(far).max(f64::MIN_POSITIVE);
    for i in 0..SPREAD_STEPS {
        let (from, to) = (place(i), place(i + 1));
        let share = 0.5 * (profile.line_cdf(to) - profile.line_cdf(from)) / all;
        let middle = 0.5 * (from + to);
        // 1 up to half of the reach, then a cosine to 0.
        let t = (2.0 * middle / near - 1.0).clamp(0.0, 1.0);
        let window = 0.5 + 0.5 * (PI * t).cos();
        for (part, w) in parts.iter_mut().zip([window, 1.0 - window]) {
            if w * share > 0.0 {
                part.extend([(middle, w * share), (-middle, w * share)]);
            }
        }
    }
    parts
}

/// Factor by which a profile weakens a wave of light of a wavelength on a plane, R, G, B: its Hankel transform, here the
/// cosine transform of the line spread.
pub fn wave_shares(profile: &Profile, wavelength_mm: f64) -> [f64; 3] {
    profile.channels.each_ref().map(|c| {
        // By parts: the integral of L(x) q sin(q x) from 0 on, with 1 - L in place of L so that it ends.
        let q = 2.0 * PI / wavelength_mm;
        let (mut sum, mut from) = (0.0, 0.0);
        let step = FRAC_PI_2 / q;
        // Quarter waves until nothing is left beyond.
        for _ in 0..4000 {
            let panel = integrate(&PANEL_RULE, from, from + step, |x| (1.0 - c.line_cdf(x)) * (q * x).sin());
            sum += panel;
            from += step;
            if 1.0 - c.line_cdf(from) < 1e-6 {
                break;
            }
        }
        (1.0 - q * sum).clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests;
