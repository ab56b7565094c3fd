//! A rough dielectric boundary: microfacets that reflect and refract (Walter, Marschner, Li and Torrance 2007).
//!
//! Directions point away from the surface, as in that paper. Radiance is divided by the square of the index where it travels,
//! so factors of eta^2 do not appear: paths begin and end outside, where the index is 1.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::random::SplitMix64;
use crate::skin::medium::fresnel_from_inside;

/// How microfacets hide each other towards two directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Masking {
    /// The product of Smith's terms of both directions (Walter et al. 2007, eq. 23); Mitsuba has it.
    Separable,
    /// `1 / (1 + Lambda(i) + Lambda(o))` (Heitz 2014, eq. 99), for refraction too; and light of lamps is also let in by microfacets
    /// that face away from the normal or from the lamp, which no light meets. Cycles 5.0 does both
    /// (`tests/interchange/volume_cycles_lobe.py`): only for comparisons with it.
    AllFacets,
}

/// A boundary with GGX microfacets. Light that meets a second microfacet is lost, as in the paper: a flat half space of the red of
/// skin1 returns 0.388 under a smooth boundary, 0.374 with an alpha of 0.1 and 0.325 with 0.3.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Boundary {
    /// Index of refraction inside over outside, above 1.
    pub eta: f32,
    /// Width of GGX, 0.001 to 1; towards 0 the boundary is smooth.
    pub alpha: f32,
    /// Masking and shadowing.
    pub masking: Masking,
}

/// What light does where it meets the boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Event {
    Reflected,
    Refracted,
}

impl Boundary {
    /// GGX, eq. 33 of Walter et al. 2007, by the cosine between normal and microfacet.
    fn distribution(&self, cosine: f32) -> f32 {
        if cosine <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        let below = cosine * cosine * (a2 - 1.0) + 1.0;
        a2 / (PI * below * below)
    }

    /// Lambda of Smith for GGX (Heitz 2014, eq. 72), by the cosine between normal and direction.
    fn lambda(&self, cosine: f32) -> f32 {
        let c2 = (cosine * cosine).max(1e-12);
        0.5 * ((1.0 + self.alpha * self.alpha * (1.0 - c2).max(0.0) / c2).sqrt() - 1.0)
    }

    fn masked(&self, one: f32, other: f32) -> f32 {
        let (a, b) = (self.lambda(one), self.lambda(other));
        match self.masking {
            Masking::Separable => 1.0 / ((1.0 + a) * (1.0 + b)),
            Masking::AllFacets => 1.0 / (1.0 + a + b),
        }
    }

    /// Share of light that a microfacet reflects, met at a cosine from a side.
    fn fresnel(&self, cosine: f32, outside: bool) -> f32 {
        let ratio = if outside { 1.0 / self.eta } else { self.eta };
        fresnel_from_inside(f64::from(cosine.min(1.0)), f64::from(ratio)) as f32
    }

    /// A microfacet as `v` sees them (Dupuy and Benyoub 2023); `n` is on the side of `v`.
    fn visible_microfacet(&self, v: Vec3, n: Vec3, random: &mut SplitMix64) -> Vec3 {
        let (t, b) = n.any_orthonormal_pair();
        let stretched = Vec3::new(self.alpha * v.dot(t), self.alpha * v.dot(b), v.dot(n)).normalize();
        let phi = TAU * random.uniform() as f32;
        let z = (1.0 - random.uniform() as f32) * (1.0 + stretched.z) - stretched.z;
        let sine = (1.0 - z * z).max(0.0).sqrt();
        let m = Vec3::new(sine * phi.cos(), sine * phi.sin(), z) + stretched;
        let m = Vec3::new(self.alpha * m.x, self.alpha * m.y, m.z.max(1e-7)).normalize();
        m.x * t + m.y * b + m.z * n
    }

    /// A direction into which light from `v` goes, with its weight: masking is the only factor left of the chosen
    /// densities. None where the microfacet sends it back through the surface that it came from.
    pub(super) fn sample(
        &self,
        v: Vec3,
        outward: Vec3,
        random: &mut SplitMix64,
    ) -> Option<(Event, Vec3, f32)> {
        let outside = v.dot(outward) > 0.0;
        let n = if outside { outward } else { -outward };
        let m = self.visible_microfacet(v, n, random);
        let cosine = v.dot(m);
        if cosine <= 0.0 {
            return None;
        }
        let (event, o) = if (random.uniform() as f32) < self.fresnel(cosine, outside) {
            (Event::Reflected, 2.0 * cosine * m - v)
        } else {
            (Event::Refracted, self.refracted(v, m, outside))
        };
        let along = o.dot(n);
        if (event == Event::Reflected) != (along > 0.0) {
            return None;
        }
        let (seen, masking) = (1.0 / (1.0 + self.lambda(v.dot(n))), self.masked(v.dot(n), along));
        Some((event, o.normalize(), masking / seen))
    }

    /// The direction into which a microfacet refracts light from `v` (eq. 40); total reflection has been ruled out.
    fn refracted(&self, v: Vec3, m: Vec3, outside: bool) -> Vec3 {
        let ratio = if outside { 1.0 / self.eta } else { self.eta };
        let cosine = v.dot(m);
        let beyond = (1.0 - ratio * ratio * (1.0 - cosine * cosine)).max(0.0).sqrt();
        (ratio * cosine - beyond) * m - ratio * v
    }

    /// A direction inside from which light leaves towards `l`, through a boundary with the normal `n`; none where `l` is not
    /// outside of it. [`Boundary::density_towards`] is its density.
    pub(super) fn sample_towards(&self, l: Vec3, n: Vec3, random: &mut SplitMix64) -> Option<Vec3> {
        if l.dot(n) <= 0.0 {
            return None;
        }
        let m = self.visible_microfacet(l, n, random);
        (l.dot(m) > 0.0).then(|| self.refracted(l, m, true).normalize())
    }

    /// The microfacet between a direction outside and one inside (eq. 16), and the sum in its Jacobian (eq. 17).
    fn refracting(&self, l: Vec3, w: Vec3, n: Vec3) -> Option<(Vec3, f32)> {
        let h = -(l + self.eta * w).normalize_or_zero();
        let (lh, wh) = (l.dot(h), w.dot(h));
        (lh > 0.0 && wh < 0.0 && h.dot(n) > 0.0).then_some((h, lh + self.eta * wh))
    }

    /// The same of a microfacet that faces away, where such count.
    fn away(&self, l: Vec3, w: Vec3) -> Option<(Vec3, f32)> {
        let h = -(l + self.eta * w).normalize_or_zero();
        (self.masking == Masking::AllFacets).then(|| (h, l.dot(h) + self.eta * w.dot(h)))
    }

    /// Density by solid angle of [`Boundary::sample_towards`] (eq. 17, with visible microfacets).
    pub(super) fn density_towards(&self, l: Vec3, w: Vec3, n: Vec3) -> f32 {
        let cosine = l.dot(n);
        if cosine <= 0.0 {
            return 0.0;
        }
        let Some((h, sum)) = self.refracting(l, w, n) else { return 0.0 };
        let visible = self.distribution(h.dot(n)) * l.dot(h) / (cosine * (1.0 + self.lambda(cosine)));
        visible * self.eta * self.eta * w.dot(h).abs() / (sum * sum)
    }

    /// The refracting lobe between `l` outside and `w` inside (eq. 21), over the square of the index inside.
    pub(super) fn refraction(&self, l: Vec3, w: Vec3, n: Vec3) -> f32 {
        let (cos_l, cos_w) = (l.dot(n), w.dot(n));
        if cos_l <= 0.0 || cos_w >= 0.0 {
            return 0.0;
        }
        let Some((h, sum)) = self.refracting(l, w, n).or_else(|| self.away(l, w)) else { return 0.0 };
        let (lh, wh) = (l.dot(h).abs(), w.dot(h).abs());
        let through =
            (1.0 - self.fresnel(lh, true)) * self.distribution(h.dot(n).abs()) * self.masked(cos_l, cos_w);
        // The square of the index that light gains inside and loses again on its way to the camera is left out.
        lh * wh / (cos_l * -cos_w) * through / (sum * sum)
    }

    /// The reflecting lobe between two directions outside (eq. 20).
    pub(super) fn reflection(&self, l: Vec3, v: Vec3, n: Vec3) -> f32 {
        let (cos_l, cos_v) = (l.dot(n), v.dot(n));
        if cos_l <= 0.0 || cos_v <= 0.0 {
            return 0.0;
        }
        let h = (l + v).normalize_or_zero();
        self.fresnel(l.dot(h), true) * self.distribution(h.dot(n)) * self.masked(cos_l, cos_v)
            / (4.0 * cos_l * cos_v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boundary(alpha: f32) -> Boundary {
        Boundary { eta: 1.4, alpha, masking: Masking::Separable }
    }

    /// Integral of a function over a hemisphere, z of the sign given. Steps are small about the pole, where lobes are narrow.
    fn over_hemisphere(sign: f32, f: impl Fn(Vec3) -> f32) -> f32 {
        let (n, mut sum) = (700, 0.0_f64);
        for i in 0..n {
            let t = (i as f32 + 0.5) / n as f32;
            let z = 1.0 - t * t;
            for j in 0..n {
                let phi = TAU * (j as f32 + 0.5) / n as f32;
                let r = (1.0 - z * z).sqrt();
                sum += f64::from(2.0 * t * f(Vec3::new(r * phi.cos(), r * phi.sin(), sign * z)));
            }
        }
        (sum / f64::from(n * n)) as f32 * TAU
    }

    #[test]
    fn densities_towards_a_lamp_sum_to_the_share_that_is_refracted_inwards() {
        for (alpha, slant) in [(0.3, 0.0_f32), (0.3, 1.0), (0.5, 0.6)] {
            let l = Vec3::new(slant.sin(), 0.0, slant.cos());
            let sum = over_hemisphere(-1.0, |w| boundary(alpha).density_towards(l, w, Vec3::Z));
            let mut random = SplitMix64(3);
            let n = 20_000;
            let inwards = (0..n)
                .filter_map(|_| boundary(alpha).sample_towards(l, Vec3::Z, &mut random))
                .filter(|w| w.z < 0.0)
                .count() as f32
                / n as f32;
            assert!((sum - inwards).abs() < 4e-3, "alpha {alpha}, {slant}: {sum} and {inwards}");
        }
    }

    #[test]
    fn lobes_and_samples_carry_the_same_light() {
        // Light from l: what samples reflect and refract, beside the integrals of both lobes.
        let b = boundary(0.4);
        let l = Vec3::new(0.6, 0.0, 0.8);
        let (mut reflected, mut refracted, n) = (0.0, 0.0, 100_000);
        let mut random = SplitMix64(5);
        for _ in 0..n {
            match b.sample(l, Vec3::Z, &mut random) {
                Some((Event::Reflected, _, w)) => reflected += w / n as f32,
                Some((Event::Refracted, _, w)) => refracted += w / n as f32,
                None => {}
            }
        }
        let eta2 = 1.4 * 1.4;
        let out = over_hemisphere(1.0, |v| b.reflection(l, v, Vec3::Z) * v.z);
        let into = over_hemisphere(-1.0, |w| eta2 * b.refraction(l, w, Vec3::Z) * -w.z);
        assert!((reflected - out).abs() < 2e-3, "{reflected} {out}");
        assert!((refracted - into).abs() < 4e-3, "{refracted} {into}");
        assert!((0.95..1.0).contains(&(reflected + refracted)));
    }

    #[test]
    fn the_boundary_is_the_same_from_both_sides() {
        // What leaves from w towards l, sampled, is the lobe that lets light from l enter towards w.
        let b = boundary(0.4);
        let w = Vec3::new(0.3, 0.0, -(1.0f32 - 0.09).sqrt());
        let (mut sampled, mut random, n) = (0.0, SplitMix64(6), 100_000);
        for _ in 0..n {
            if let Some((Event::Refracted, o, weight)) = b.sample(w, Vec3::Z, &mut random) {
                sampled += weight * o.z / n as f32;
            }
        }
        // Weighted by the cosine outside, so that neither side is trivially one; light out of the medium spreads by eta^2.
        let found = over_hemisphere(1.0, |l| b.refraction(l, w, Vec3::Z) * l.z * l.z);
        assert!((sampled - found).abs() < 4e-3, "{sampled} {found}");
    }

    #[test]
    fn facets_that_face_away_add_what_cycles_has_beyond_the_equation() {
        // Mean over a square picture of 50 degrees, its axis tilted: numbers of volume_cycles_lobe.py, lamp at 60 degrees.
        let (sin, cos) = 60f32.to_radians().sin_cos();
        let l = Vec3::new(sin, 0.0, cos);
        let mean = |masking, tilt: f32| {
            let b = Boundary { masking, ..boundary(0.3) };
            let (s, c) = tilt.to_radians().sin_cos();
            let (forward, right) = (Vec3::new(s, 0.0, c), Vec3::new(-c, 0.0, s));
            let (n, half, mut sum) = (64, 25f32.to_radians().tan(), 0.0_f64);
            for i in 0..n * n {
                let [x, y] = [i % n, i / n].map(|i| half * (2.0 * (i as f32 + 0.5) / n as f32 - 1.0));
                let ray = (forward + x * right + y * Vec3::Y).normalize();
                if ray.z > 0.02 {
                    sum += f64::from(b.refraction(l, -ray, Vec3::Z) * l.z);
                }
            }
            sum / f64::from(n * n)
        };
        for (tilt, cycles) in [(0.0, 0.00691), (50.0, 0.42444), (65.0, 0.36479), (-50.0, 0.00829)] {
            let found = mean(Masking::AllFacets, tilt);
            assert!((found - cycles).abs() < 0.002 * cycles + 2e-5, "{tilt}: {found} {cycles}");
        }
        assert!((mean(Masking::Separable, 50.0) / 0.4046 - 1.0).abs() < 0.01);
        assert_eq!(mean(Masking::Separable, -50.0), 0.0);
    }

    #[test]
    fn a_smooth_boundary_follows_snell_and_fresnel() {
        let b = boundary(0.002);
        let v = Vec3::new(0.8, 0.0, 0.6);
        let mut random = SplitMix64(7);
        let (mut reflected, mut stray) = (0, 0);
        for _ in 0..20_000 {
            let (event, o, weight) = b.sample(v, Vec3::Z, &mut random).expect("nothing is masked");
            assert!((weight - 1.0).abs() < 1e-3);
            match event {
                Event::Reflected => reflected += 1,
                Event::Refracted => stray += i32::from((o.x + 0.8 / 1.4).abs() > 0.01),
            }
        }
        // GGX has long tails.
        assert!(stray < 100, "{stray}");
        let expected = fresnel_from_inside(0.6, 1.0 / 1.4);
        assert!((f64::from(reflected) / 2e4 - expected).abs() < 4e-3, "{reflected} {expected}");
    }
}
