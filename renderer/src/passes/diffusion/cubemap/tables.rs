//! The BSSRDF as tables, its division between the picture's own disk and the layers, and the places of samples.

use rubor_rig::skin::profile::Profile;

use super::super::bssrdf::Dipole;
use super::super::screen::gather::Tap;
use crate::error::RenderError;

/// Entries of the table.
const ENTRIES: usize = 1024;
/// Share of the widest channel's light inside of the table.
const COVERAGE: f64 = 0.9999;
/// Rings that integrals over the radius are summed over.
const RINGS: usize = 4096;
/// Turn from one sample to the next, radians.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Taps of the picture's own disk. It is narrow, a few pixels in a picture of a face.
const NEAR_TAPS: usize = 24;
/// Where the window between disk and layers begins and ends, relative to its middle.
const WINDOW: [f64; 2] = [0.25, 1.25];

/// An entry as bssrdf.wesl reads it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Entry {
    pub(crate) reflectance: [f32; 4],
    pub(crate) beyond: [f32; 4],
}

/// A ring of the plane around a place.
#[derive(Clone, Copy)]
struct Ring {
    radius_mm: f64,
    /// Light of the profile in it, each channel totals one.
    light: [f64; 3],
    /// Share that the layers carry.
    far: f64,
}

/// A profile as the passes need it.
pub(crate) struct Tables {
    pub(crate) entries: Vec<Entry>,
    pub(crate) half_width_mm: f64,
    pub(crate) window_mm: [f64; 2],
    /// Light of each channel that the picture's own disk carries.
    pub(crate) near_light: [f64; 3],
    pub(crate) dipole: Option<Dipole>,
    /// Places and weights of the taps of the picture's own disk.
    pub(crate) near_taps: Vec<Tap>,
    rings: Vec<Ring>,
    profile: Profile,
}

/// Samples of the disk of a layer.
pub(crate) struct Samples {
    /// x, y, radius in mm, one over the density in mm^2.
    pub(crate) places: Vec<[f32; 4]>,
    /// Exact light of an evenly lit plane over that of the samples.
    pub(crate) plane_factor: [f32; 3],
}

impl Tables {
    /// Tables of a profile that is divided around the radius `near_mm`.
    ///
    /// # Errors
    /// A directional dipole whose channels refract differently; a profile without a finite width.
    pub(crate) fn new(profile: &Profile, near_mm: f64) -> Result<Self, RenderError> {
        let half_width_mm = profile.channels.iter().map(|c| c.sample_radius(COVERAGE)).fold(0.0, f64::max);
        if !(half_width_mm > 0.0 && half_width_mm.is_finite()) {
            return Err(RenderError::Limit {
                what: "radius of the profile",
                found: format!("{half_width_mm} mm"),
                expected: "expected a positive finite radius".into(),
            });
        }
        let total = profile.total();
        let window_mm = WINDOW.map(|w| w * near_mm);
        let last = (ENTRIES - 1) as f64;
        let radius = |i: f64| half_width_mm * (i / last).powi(2);
        let beyond_of =
            |r: f64| -> [f64; 3] { std::array::from_fn(|c| profile.channels[c].mass_beyond(r) / total[c]) };
        let beyond: Vec<[f64; 3]> = (0..ENTRIES).map(|i| beyond_of(radius(i as f64))).collect();
        let mean: Vec<f64> = beyond.iter().map(|b| b.iter().sum::<f64>() / 3.0).collect();
        let inverse = |share: f64| {
            // `mean` falls; the last entry takes what is left outside of the table.
            let after = mean.partition_point(|m| *m > share).clamp(1, ENTRIES - 1);
            let (a, b) = (mean[after - 1], mean[after]);
            let t = if a > b { ((a - share) / (a - b)).clamp(0.0, 1.0) } else { 0.0 };
            radius((after - 1) as f64) * (1.0 - t) + radius(after as f64) * t
        };
        let entries = (0..ENTRIES)
            .map(|i| {
                // Half an entry instead of 0, where R may be infinite.
                let r = profile.reflectance(radius((i as f64).max(0.5)));
                let channel = |c: usize| (r[c] / total[c]) as f32;
                let of = |c: usize| beyond[i][c] as f32;
                Entry {
                    reflectance: [channel(0), channel(1), channel(2), mean[i] as f32],
                    beyond: [of(0), of(1), of(2), inverse((i as f64 / last).powi(2)) as f32],
                }
            })
            .collect();
        let edge = |k: usize| half_width_mm * (k as f64 / RINGS as f64).powi(2);
        let mut inner = beyond_of(0.0);
        let rings: Vec<Ring> = (0..RINGS)
            .map(|k| {
                let outer = beyond_of(edge(k + 1));
                let radius_mm = (0.5 * (edge(k).powi(2) + edge(k + 1).powi(2))).sqrt();
                let light = std::array::from_fn(|c| inner[c] - outer[c]);
                inner = outer;
                Ring { radius_mm, light, far: window(window_mm, radius_mm) }
            })
            .collect();
        let near_light =
            std::array::from_fn(|c| rings.iter().map(|r| r.light[c] * (1.0 - r.far)).sum::<f64>());
        let mut tables = Self {
            entries,
            half_width_mm,
            window_mm,
            near_light,
            dipole: Dipole::of(profile)?,
            near_taps: Vec::new(),
            rings,
            profile: profile.clone(),
        };
        tables.near_taps = tables.near_disk();
        Ok(tables)
    }

    /// R of each channel, which totals one.
    fn reflectance(&self, r_mm: f64) -> [f64; 3] {
        let total = self.profile.total();
        let r = self.profile.reflectance(r_mm);
        std::array::from_fn(|c| r[c] / total[c])
    }

    /// Radii that hold equal shares of a part of the mean light, and the light of that part.
    fn quantiles(&self, count: usize, shift: f64, part: impl Fn(&Ring) -> f64) -> (Vec<f64>, f64) {
        let mean = |r: &Ring| r.light.iter().sum::<f64>() / 3.0 * part(r);
        let total: f64 = self.rings.iter().map(mean).sum();
        let mut radii = Vec::with_capacity(count);
        let (mut ring, mut inside) = (0, 0.0);
        for i in 0..count {
            let at = total * (i as f64 + shift) / count as f64;
            while ring + 1 < self.rings.len() && inside + mean(&self.rings[ring]) < at {
                inside += mean(&self.rings[ring]);
                ring += 1;
            }
            let of_ring = mean(&self.rings[ring]);
            let t = if of_ring > 0.0 { ((at - inside) / of_ring).clamp(0.0, 1.0) } else { 0.5 };
            // Evenly over the area of the ring.
            let edge = |k: usize| self.half_width_mm * (k as f64 / RINGS as f64).powi(2);
            radii.push((edge(ring).powi(2) * (1.0 - t) + edge(ring + 1).powi(2) * t).sqrt());
        }
        (radii, total)
    }

    fn near_disk(&self) -> Vec<Tap> {
        let (radii, light) = self.quantiles(NEAR_TAPS, 0.5, |r| 1.0 - r.far);
        let tap = |(i, &r): (usize, &f64)| {
            let each = self.reflectance(r).map(|k| k * (1.0 - window(self.window_mm, r)));
            let density = each.iter().sum::<f64>() / 3.0 / light.max(1e-12);
            let angle = i as f64 * GOLDEN_ANGLE;
            let weight = each.map(|k| if density > 0.0 { (k / density) as f32 } else { 0.0 });
            Tap {
                place: [(r * angle.cos()) as f32, (r * angle.sin()) as f32, r as f32, 0.0],
                weight: [weight[0], weight[1], weight[2], 0.0],
            }
        };
        radii.iter().enumerate().map(tap).collect()
    }

    /// Mean light that samples are drawn by: that of the layers, or all of it for a BSSRDF that knows the light's
    /// direction, which differs from its mean near the entry too.
    pub(crate) fn sampled_light(&self) -> f64 {
        if self.dipole.is_some() {
            return 1.0;
        }
        1.0 - self.near_light.iter().sum::<f64>() / 3.0
    }

    /// Samples of a disk; `shift` from 0 to 1 moves all of them within their shares.
    pub(crate) fn samples(&self, count: usize, shift: f64) -> Samples {
        let far = |r: f64| if self.dipole.is_some() { 1.0 } else { window(self.window_mm, r) };
        let (radii, light) = self.quantiles(count, shift, |ring| far(ring.radius_mm));
        let exact = [0, 1, 2].map(|c| match self.dipole {
            Some(_) => 1.0,
            None => 1.0 - self.near_light[c],
        });
        let mut even = [0.0; 3];
        let places = radii
            .iter()
            .enumerate()
            .map(|(i, &r)| {
                let each = self.reflectance(r).map(|k| k * far(r));
                let density = each.iter().sum::<f64>() / 3.0 / light.max(1e-12);
                let area = if density > 1e-12 { 1.0 / density } else { 0.0 };
                for c in 0..3 {
                    even[c] += each[c] * area / count as f64;
                }
                let angle = i as f64 * GOLDEN_ANGLE;
                [r * angle.cos(), r * angle.sin(), r, area].map(|x| x as f32)
            })
            .collect();
        let plane_factor = std::array::from_fn(|c| {
            if even[c] > 1e-9 { (exact[c] / even[c]).clamp(0.0, 4.0) as f32 } else { 0.0 }
        });
        Samples { places, plane_factor }
    }
}

/// Share of the light at a radius that the layers carry.
pub(crate) fn window([start, end]: [f64; 2], r_mm: f64) -> f64 {
    let t = ((r_mm - start) / (end - start)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
