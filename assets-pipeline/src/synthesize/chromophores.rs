//! Melanin and hemoglobin of the neutral face.

use glam::{Vec2, Vec3};

use super::Options;
use super::face_space::plan;
use super::noise::{Stream, features, noise, smoothstep, unit};
use super::regions::{Regions, eye_distance};

/// Standard deviation of hemoglobin about its regional mean, relative to it, on calm skin.
const HEMOGLOBIN_SPREAD: f32 = 0.105;

/// A mole on the plan of the face.
struct Mole {
    at: Vec2,
    radius_mm: f32,
    /// Added melanin fraction.
    melanin: f32,
}

/// The colouring of a person.
pub(crate) struct Chromophores {
    seed: u32,
    melanin: f32,
    hemoglobin: f32,
    freckles: f32,
    moles: Vec<Mole>,
}

impl Chromophores {
    pub(crate) fn new(options: &Options) -> Self {
        let seed = options.seed_bits() ^ 0xc010;
        let mut stream = Stream::new(seed ^ 0x301e);
        let mut moles = Vec::new();
        // Plan of cheeks, forehead, temples and neck; the eyes and the mouth stay free.
        while moles.len() < options.moles as usize {
            let at = Vec2::new(stream.range(-95.0, 95.0), stream.range(-160.0, 66.0));
            let clear = eye_distance(at).0 > 9.0
                && !(at.x.abs() < 32.0 && (-90.0..-54.0).contains(&at.y))
                && !(at.x.abs() < 14.0 && at.y > -54.0);
            if clear {
                let size = stream.range(0.0, 1.0);
                moles.push(Mole {
                    at,
                    radius_mm: 0.45 + 1.1 * size * size,
                    melanin: stream.range(0.08, 0.2),
                });
            }
        }
        Self {
            seed,
            melanin: options.melanin,
            hemoglobin: options.hemoglobin,
            freckles: options.freckles,
            moles,
        }
    }

    fn noise(&self, place: Vec3, wavelength_mm: f32, seed: u32) -> f32 {
        noise(place, wavelength_mm, self.seed ^ seed)
    }

    /// Melanin volume fraction of the epidermis without hair. A hollow ([`Regions::hollow`]) holds melanin that
    /// imitates its depth.
    pub(crate) fn melanin(&self, place: Vec3, r: &Regions, cavity: f32, hollow: f32) -> f32 {
        let uneven = 0.055 * self.noise(place, 28.0, 1)
            + 0.045 * self.noise(place, 9.0, 2)
            + 0.05 * self.noise(place, 3.2, 3)
            + 0.05 * self.noise(place, 1.1, 4);
        // Sun and rubbing darken; the lids are thin and pigmented, the underside of the chin is shaded.
        let regional = 0.10 * r.forehead
            + 0.06 * r.nose
            + 0.05 * r.cheek_bone
            + 0.10 * r.temple
            + 0.10 * r.lids
            + 0.09 * r.under_eye
            + 0.12 * r.eye_corner
            + 0.22 * r.lip_border
            + 0.06 * r.upper_lip
            - 0.10 * r.neck
            + 0.05 * r.ear
            - 0.05 * r.lips
            - 0.5 * r.inner;
        // Dark skin is of one piece: the same relative change of melanin is seen more on it.
        let even = 1.0 / (1.0 + 2.5 * self.melanin);
        let mut fraction = self.melanin * (even * (uneven + regional) + 0.10 * cavity).exp();
        let spots = self.freckle_weight(place, r);
        // Freckles matter on light skin and drown in dark.
        fraction += spots * self.freckles * 0.045 * (-self.melanin / 0.12).exp();
        let p = plan(place);
        if place.z > -20.0 {
            for mole in &self.moles {
                let away = p - mole.at;
                if away.length_squared() < 9.0 {
                    let edge = mole.radius_mm * (1.0 + 0.12 * self.noise(place, 0.9, 7));
                    let core = smoothstep(1.35 * edge, 0.55 * edge, away.length());
                    fraction += core * mole.melanin * (1.0 + 0.15 * self.noise(place, 0.5, 8));
                }
            }
        }
        fraction + 0.42 * hollow
    }

    /// Density of freckles' pigment, about 0 to 1.
    fn freckle_weight(&self, place: Vec3, r: &Regions) -> f32 {
        if self.freckles <= 0.0 {
            return 0.0;
        }
        let density = (0.10
            + 0.55 * r.nose
            + 0.75 * r.cheek
            + 0.6 * r.cheek_bone
            + 0.2 * r.forehead
            + 0.2 * r.temple
            + 0.3 * r.under_eye)
            .min(1.0)
            * (1.0 - r.lips)
            * (1.0 - r.inner)
            * (1.0 - 0.8 * r.neck)
            * (1.0 + 0.35 * self.noise(place, 14.0, 9)).clamp(0.2, 1.6);
        if density < 0.02 {
            return 0.0;
        }
        let ragged =
            Vec3::new(self.noise(place, 0.9, 10), self.noise(place, 0.9, 11), self.noise(place, 0.9, 12));
        let mut sum = 0.0;
        for (spacing_mm, share, seed) in [(3.4, 0.5, 13u32), (1.7, 0.55, 14)] {
            let p = (place + 0.16 * ragged) / spacing_mm;
            features(p, self.seed ^ seed, |h, d| {
                let there = smoothstep(0.0, 0.25, density * share - unit(h));
                let radius = 0.16 + 0.16 * unit(h.wrapping_mul(0x2545_f491));
                let t = 1.0 - d.length_squared() / (radius * radius);
                if there > 0.0 && t > 0.0 {
                    sum += there * (0.3 + 0.7 * unit(h.wrapping_mul(0x85eb_ca6b))) * smoothstep(0.0, 0.8, t);
                }
            });
        }
        sum.min(1.3)
    }

    /// Local mean of the neutral hemoglobin fraction of the dermis.
    pub(crate) fn hemoglobin_mean(&self, place: Vec3, r: &Regions, hollow: f32) -> f32 {
        let lobe = (-((place.y + 38.0) / 10.0).powi(2)).exp() * r.ear;
        let relative = 0.52 * r.cheek
            + 0.26 * r.cheek_bone
            + 0.16 * r.lower_cheek
            + 0.26 * r.nose
            + 0.38 * r.nose_tip
            + 0.52 * r.nose_wing
            + 0.30 * r.chin
            + 0.55 * r.ear
            + 0.30 * r.ear_rim
            + 0.15 * lobe
            + 0.55 * r.eye_corner
            + 0.16 * r.under_eye
            + 0.10 * r.glabella
            - 0.16 * r.forehead
            - 0.12 * r.temple
            - 0.06 * r.lids
            + 0.42 * r.lid_edge
            - 0.12 * r.upper_lip
            - 0.12 * r.neck
            - 0.10 * r.scalp;
        let drift = 0.06 * self.noise(place, 32.0, 21) + 0.07 * self.noise(place, 13.0, 22);
        let red = 1.42 * r.lips + 1.2 * r.inner * (1.0 - r.lips) + 0.10 * r.lip_border + 1.1 * hollow;
        self.hemoglobin * (relative * (1.0 - r.lips) + drift * (1.0 - 0.6 * r.lips) + red).exp()
    }

    /// Standardised variation of perfusion: capillary mottling and a few vessels, near Gaussian with unit variance.
    pub(crate) fn mottling(&self, place: Vec3, r: &Regions) -> f32 {
        let octaves = 0.34 * self.noise(place, 6.5, 23)
            + 0.46 * self.noise(place, 3.0, 24)
            + 0.56 * self.noise(place, 1.4, 25)
            + 0.48 * self.noise(place, 0.75, 26);
        let vessel_area = 0.06
            + 0.5 * r.nose_wing
            + 0.4 * r.cheek
            + 0.25 * r.cheek_bone
            + 0.2 * r.nose_tip
            + 0.25 * r.under_eye;
        let mut vessels = 0.0;
        if vessel_area > 0.1 {
            let bent = place + 0.5 * Vec3::splat(self.noise(place, 2.1, 27));
            let line = self.noise(bent, 5.2, 28);
            let broken = smoothstep(0.5, 1.3, self.noise(place, 7.5, 29));
            vessels = vessel_area * broken * (-(line / 0.07).powi(2)).exp();
        }
        octaves / 0.936 + 1.1 * vessels
    }

    /// Relative standard deviation of hemoglobin in a region.
    pub(crate) fn hemoglobin_spread(&self, r: &Regions) -> f32 {
        HEMOGLOBIN_SPREAD * (1.0 + 0.3 * r.cheek + 0.2 * r.nose_wing - 0.35 * r.lips - 0.2 * r.forehead)
    }

    /// Local mean and value of the neutral hemoglobin volume fraction `H_n`.
    pub(crate) fn hemoglobin_with_mean(&self, place: Vec3, r: &Regions, hollow: f32) -> (f32, f32) {
        let variation = (self.hemoglobin_spread(r) * self.mottling(place, r)).max(-0.85);
        let mean = self.hemoglobin_mean(place, r, hollow);
        (mean, mean * (1.0 + variation))
    }
}
