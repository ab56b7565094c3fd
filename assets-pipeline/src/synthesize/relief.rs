//! Fine relief of the skin as a height field in millimetres: pores, the net of furrows between them, lines of lips,
//! lids and neck.
//!
//! Depths and sizes are those of profilometry of adult faces: pores 0.2 to 0.5 mm wide and 0.05 to 0.1 mm deep, the
//! furrow net 0.3 to 1 mm wide in mesh and 0.02 to 0.05 mm deep, lip lines about 1.5 mm apart and 0.1 mm deep.
//! Furrows stretch along the lines of relaxed skin tension (Borges 1984).

use glam::{Vec2, Vec3};

use super::face_space::{plan, plan_gradient};
use super::noise::{features, gradient_noise, noise, smoothstep, unit};
use super::regions::{Regions, lid_fold};
use super::surface::Site;

/// Mesh of the furrow net, mm.
const MESH_MM: f32 = 0.62;

/// Relief at a point.
pub(crate) struct ReliefSample {
    /// Gradient of the height (mm per mm) in canonical space.
    pub gradient: Vec3,
    /// How much the point lies in a pore or furrow, 0 to 1.
    pub cavity: f32,
}

/// The fine relief of a person on maps of a given fineness.
pub(crate) struct Relief {
    seed: u32,
    /// Finest feature that the map can hold, mm.
    finest_mm: f32,
    /// Deepens pores and furrows; 1 for a young adult.
    coarseness: f32,
}

/// Direction of relaxed skin tension on the plan as cos and sin of the doubled angle; its length says how strongly
/// the skin is oriented.
fn tension(p: Vec2, r: &Regions) -> Vec2 {
    let side = (p.x / 10.0).clamp(-1.0, 1.0);
    let turned = |degrees: f32| {
        let angle = (2.0 * degrees).to_radians();
        Vec2::new(angle.cos(), side * angle.sin())
    };
    // Around the eye the lines run in rings.
    let eye = Vec2::new(p.x.abs() - 33.5, (p.y + 3.0) * 1.3);
    let ring = eye.perp().normalize_or_zero();
    let ring = Vec2::new(ring.x * ring.x - ring.y * ring.y, 2.0 * ring.x * ring.y * side);
    let near_eye = smoothstep(34.0, 14.0, eye.length()) * smoothstep(4.0, 9.0, eye.length());
    let sum = turned(0.0) * (0.9 * r.forehead + 0.9 * r.neck + 0.5 * r.chin + 0.4 * r.scalp)
        + turned(-62.0) * (r.cheek + r.lower_cheek + 0.6 * r.jaw)
        + turned(-40.0) * r.cheek_bone
        + ring * near_eye;
    sum.clamp_length_max(1.0)
}

/// A symmetric tensor that stretches lengths across a direction of the surface by `stretch`.
struct Metric {
    across: Vec3,
    excess: f32,
}

impl Metric {
    fn new(place: Vec3, tension: Vec2, stretch: f32) -> Self {
        let angle = 0.5 * tension.y.atan2(tension.x);
        let radial = Vec2::new(place.x, place.z).normalize_or_zero();
        let lateral = Vec3::new(radial.y, 0.0, -radial.x);
        let across = -angle.sin() * lateral + angle.cos() * Vec3::Y;
        let stretch = 1.0 + (stretch - 1.0) * tension.length();
        Self { across, excess: stretch * stretch - 1.0 }
    }

    fn apply(&self, d: Vec3) -> Vec3 {
        d + self.across * (self.excess * self.across.dot(d))
    }
}

/// Noise on the plan with wavelengths `along_mm` and `across_mm` about a direction, and its canonical gradient.
fn line_noise(place: Vec3, degrees: f32, along_mm: f32, across_mm: f32, seed: u32) -> (f32, Vec3) {
    let p = plan(place);
    let (sin, cos) = degrees.to_radians().sin_cos();
    let depth = Vec2::new(place.x, place.z).length().max(10.0);
    let q =
        Vec3::new((cos * p.x + sin * p.y) / along_mm, (cos * p.y - sin * p.x) / across_mm, depth / along_mm);
    let (value, g) = gradient_noise(q, seed);
    let (du, dv) = (g.x / along_mm, g.y / across_mm);
    let on_plan = plan_gradient(place, Vec2::new(cos * du - sin * dv, sin * du + cos * dv));
    let radial = Vec3::new(place.x, 0.0, place.z) / depth;
    (value, on_plan + radial * (g.z / along_mm))
}

/// Turns noise into grooves along its zeros with soft swellings between: height sqrt(n^2 + c).
fn grooved((n, g): (f32, Vec3), roundness: f32) -> (f32, Vec3) {
    let root = (n * n + roundness).sqrt();
    (root, g * (n / root))
}

impl Relief {
    pub(crate) fn new(seed: u32, texel_mm: f32, age_years: f32) -> Self {
        let coarseness = 1.0 + 0.012 * (age_years - 30.0).clamp(-15.0, 50.0);
        Self { seed: seed ^ 0x4e11, finest_mm: 2.0 * texel_mm, coarseness }
    }

    /// How much of a feature of this width a map can hold: 1 for wide ones, 0 for those under half the finest.
    fn held(&self, width_mm: f32) -> f32 {
        smoothstep(0.5, 1.2, width_mm / self.finest_mm)
    }

    pub(crate) fn sample(&self, site: &Site, r: &Regions) -> ReliefSample {
        let c = site.place;
        let p = plan(c);
        let dry = (1.0 - r.lips.max(r.inner)).max(0.0);
        // The skin of the ear is drawn tight over cartilage, and the warp is loose there.
        let hollow = r.hollow(site.open);
        // Where the texture is much coarser than on the face, pores and furrows would alias into scales.
        let held = smoothstep(2.2, 1.5, site.coarseness);
        let skin = held * dry * (1.0 - 0.75 * r.lids) * (1.0 - 0.9 * r.ear) * (1.0 - 0.8 * hollow);
        let tension = tension(p, r);
        let mut gradient = Vec3::ZERO;
        let mut cavity = 0.0;

        // Unevenness between pores and features; skin over bone and cartilage is even.
        let tight =
            (1.0 - 0.5 * r.forehead) * (1.0 - 0.6 * r.temple) * (1.0 - 0.85 * r.ear) * (1.0 - 0.6 * r.scalp);
        for (wavelength, height_mm, seed) in [(8.0, 0.030, 1u32), (2.7, 0.009, 2)] {
            let g = gradient_noise(c / wavelength, self.seed ^ seed).1;
            let held = self.held(0.5 * wavelength / site.coarseness.max(1.0));
            gradient += g * (height_mm * self.coarseness * dry * tight * held / wavelength);
        }

        if skin > 0.01 {
            let patch = (1.0 + 0.25 * noise(c, 6.0, self.seed ^ 3)).clamp(0.3, 1.7);
            let (g, depth) = self.furrows(site, tension);
            // Thin and smooth towards the side of the head and down the neck.
            let side = smoothstep(58.0, 92.0, p.x.abs());
            let depth_mm = 0.026
                * (1.0 - 0.45 * r.forehead - 0.3 * r.nose + 0.2 * r.lower_cheek - 0.25 * r.jaw).max(0.3)
                * (1.0 - 0.5 * r.neck)
                * (1.0 - 0.35 * side)
                * (1.0 - 0.4 * r.temple);
            let strength = skin * patch * self.coarseness;
            gradient += g * (strength * depth_mm);
            cavity += 0.45 * depth * strength;

            let open = 0.16
                + 0.75 * r.nose
                + 0.9 * r.nose_tip
                + 0.8 * r.nose_wing
                + 0.6 * r.cheek
                + 0.35 * r.chin
                + 0.25 * r.glabella
                + 0.2 * r.forehead
                + 0.2 * r.upper_lip;
            let open = open.min(1.0) * (1.0 - 0.8 * r.neck) * (1.0 - 0.7 * r.under_eye) * (1.0 - 0.7 * r.ear);
            let metric = Metric::new(c, tension, 1.35);
            for (layer, spacing_mm, radius_mm, share) in
                [(0u32, 1.25, 0.22, 0.85 * open), (1, 0.74, 0.15, 0.35 + 0.6 * open)]
            {
                let (g, depth) = self.pores(site, &metric, layer, spacing_mm, radius_mm, share);
                let depth_mm = if layer == 0 { 0.06 } else { 0.036 } * (0.6 + 0.7 * open);
                let strength = skin * self.coarseness;
                gradient += g * (strength * depth_mm);
                cavity += depth * strength * if layer == 0 { 0.9 } else { 0.6 };
            }
        }

        if r.lids > 0.01 {
            gradient += self.lid_crease(c) * (r.lids * (1.0 - r.lid_edge));
        }
        if r.lips > 0.01 {
            let wave = 0.7 * noise(c, 5.0, self.seed ^ 11);
            let at = c + Vec3::new(wave, 0.0, 0.0);
            for (across, height_mm, seed) in [(1.7, 0.115, 12u32), (0.8, 0.04, 13)] {
                let (n, g) = grooved(line_noise(at, 90.0, 7.0, across, self.seed ^ seed), 0.03);
                let strength = r.lips * self.held(0.5 * across);
                gradient += g * (strength * height_mm);
                cavity += 0.4 * strength * smoothstep(0.5, 0.15, n);
            }
        }
        let fine = [
            // Lids: two crossing sets of fine lines.
            (r.lids, 34.0, 2.6, 0.75, 0.011, 21u32),
            (r.lids, -30.0, 2.6, 0.75, 0.011, 22),
            (r.under_eye, -16.0, 5.0, 1.3, 0.016, 23),
            (r.forehead * (1.0 - r.scalp), 2.0, 12.0, 2.2, 0.012, 24),
            // Neck: rings and a crossing net.
            (r.neck, 0.0, 70.0, 15.0, 0.10, 25),
            (r.neck, 24.0, 7.0, 2.0, 0.007, 26),
            (r.neck, -24.0, 7.0, 2.0, 0.007, 27),
        ];
        for (weight, degrees, along, across, height_mm, seed) in fine {
            let strength = weight * dry * self.held(0.6 * across / site.coarseness.max(1.0));
            if strength > 0.01 {
                let mirrored = if p.x < 0.0 { -degrees } else { degrees };
                let (_, g) = grooved(line_noise(c, mirrored, along, across, self.seed ^ seed), 0.06);
                gradient += g * (strength * height_mm * self.coarseness);
            }
        }
        ReliefSample { gradient, cavity: cavity.min(1.0) }
    }

    /// Fold of the upper lid: gradient of its height.
    fn lid_crease(&self, c: Vec3) -> Vec3 {
        const DEPTH_MM: f32 = 0.22;
        const WIDTH_MM: f32 = 0.85;
        const STEP_MM: f32 = 0.2;
        let height = |p: Vec2| {
            let (above, mean) = lid_fold(p);
            -DEPTH_MM * mean * (-(above / WIDTH_MM).powi(2)).exp()
        };
        let p = plan(c);
        if lid_fold(p).0.abs() > 3.0 * WIDTH_MM {
            return Vec3::ZERO;
        }
        let along = |d: Vec2| (height(p + d) - height(p - d)) / (2.0 * STEP_MM);
        plan_gradient(c, Vec2::new(along(Vec2::X * STEP_MM), along(Vec2::Y * STEP_MM))) * self.coarseness
    }

    /// Polygonal net: gradient per mm of depth, and nearness of a furrow.
    fn furrows(&self, site: &Site, tension: Vec2) -> (Vec3, f32) {
        // Grooves of under two texels would alias into grain. A coarse map gets a wider net, much shallower, or it would
        // look like scales; the renderer has a finer one of its own.
        let mesh_mm = MESH_MM.max(1.8 * self.finest_mm);
        let share = (MESH_MM / mesh_mm).powi(2);
        let width = (0.95 * self.finest_mm / mesh_mm).clamp(0.24, 0.45);
        let metric = Metric::new(site.place, tension, 1.6);
        let (mut first, mut second) = (f32::MAX, f32::MAX);
        let (mut at_first, mut at_second) = (Vec3::ZERO, Vec3::ZERO);
        features(site.place / mesh_mm, self.seed ^ 0xf0, |_, d| {
            let m = metric.apply(d);
            let length2 = d.dot(m);
            if length2 < first {
                (second, at_second) = (first, at_first);
                (first, at_first) = (length2, m);
            } else if length2 < second {
                (second, at_second) = (length2, m);
            }
        });
        let (f1, f2) = (first.sqrt().max(1e-4), second.sqrt().max(1e-4));
        let gap = (f2 - f1) / width;
        let groove = (-gap * gap).exp();
        let slope = 2.0 * gap / width * groove / mesh_mm * share;
        ((at_second / f2 - at_first / f1) * slope, groove * share)
    }

    /// Round pits in the plane of the surface: gradient per mm of depth, and nearness of a pit's bottom.
    fn pores(
        &self,
        site: &Site,
        metric: &Metric,
        layer: u32,
        spacing_mm: f32,
        radius_mm: f32,
        share: f32,
    ) -> (Vec3, f32) {
        let (mut gradient, mut depth) = (Vec3::ZERO, 0.0f32);
        // A map too coarse for a pore shows a wider and shallower one.
        let true_radius_mm = radius_mm;
        let radius_mm = radius_mm.max(0.62 * self.finest_mm);
        let shallow = (true_radius_mm / radius_mm).sqrt();
        let spacing_mm = spacing_mm.max(3.0 * radius_mm);
        features(site.place / spacing_mm, self.seed ^ (0xb0 + layer), |h, d| {
            let there = smoothstep(0.0, 0.12, share - unit(h));
            let out = d.dot(site.normal);
            // Features far above or below the surface do not reach it.
            let reach = there * smoothstep(0.62, 0.38, out.abs());
            if reach > 0.0 {
                let d = d - site.normal * out;
                let m = metric.apply(d);
                let size = radius_mm * (0.75 + 0.55 * unit(h.wrapping_mul(0x2545_f491))) / spacing_mm;
                let t = 1.0 - d.dot(m) / (size * size);
                if t > 0.0 {
                    let strength = shallow * reach * (0.5 + 0.8 * unit(h.wrapping_mul(0x85eb_ca6b)));
                    gradient += m * (strength * 4.0 * t / (size * size * spacing_mm));
                    depth += strength * t * t;
                }
            }
        });
        (gradient, depth.min(1.0))
    }
}
