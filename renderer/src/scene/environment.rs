//! Light from all directions: an equirectangular map, filtered once at load.
//!
//! Column 0 looks towards +Z; the middle column, -Z; row 0 is straight up. Radiance is linear Rec. 709.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use crate::device::Gpu;
use crate::device::texture;

/// An equirectangular radiance map on the CPU.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    /// Columns, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Linear Rec. 709 radiance, row 0 straight up.
    pub texels: Vec<Vec3>,
}

/// An environment ready to light a scene.
pub struct Environment {
    pub(crate) filtered: wgpu::TextureView,
    pub(crate) levels: u32,
    /// Coefficients of irradiance / pi.
    pub(crate) harmonics: [Vec3; 9],
}

impl Environment {
    /// [`turned_harmonics`] of its light.
    pub(crate) fn harmonics_at(&self, angle: f32) -> [[f32; 4]; 9] {
        turned_harmonics(&self.harmonics, angle)
    }
}

/// Coefficients of irradiance / pi as shaders read them, of the environment turned about +Y by an angle in radians.
///
/// Turned light from `n` is light from `n' = (x c - z s, y, z c + x s)`; the polynomials of n' are mixtures of those of
/// n in each order.
fn turned_harmonics(h: &[Vec3; 9], angle: f32) -> [[f32; 4]; 9] {
    let (s, c) = angle.sin_cos();
    let turned = [
        h[0],
        h[1],
        c * h[2] - s * h[3],
        s * h[2] + c * h[3],
        c * h[4] + s * h[5],
        c * h[5] - s * h[4],
        (c * c - 0.5 * s * s) * h[6] - 0.5 * c * s * h[7] + 0.5 * s * s * h[8],
        6.0 * c * s * h[6] + (c * c - s * s) * h[7] - 2.0 * c * s * h[8],
        1.5 * s * s * h[6] + 0.5 * c * s * h[7] + 0.5 * (1.0 + c * c) * h[8],
    ];
    turned.map(|v| v.extend(0.0).to_array())
}

/// Width of level 0 of the filtered map.
const FILTERED_WIDTH: u32 = 128;
/// Levels of the filtered map; level i is filtered for Beckmann roughness (i / (LEVELS - 1))^2.
const LEVELS: u32 = 6;

/// Direction of a point of the map.
fn direction(u: f32, v: f32) -> Vec3 {
    let (phi, theta) = ((u - 0.5) * 2.0 * PI, v * PI);
    Vec3::new(phi.sin() * theta.sin(), theta.cos(), -phi.cos() * theta.sin())
}

impl EnvironmentMap {
    /// A map from a function of direction.
    pub fn from_fn(width: u32, height: u32, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> Self {
        let texels = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let (x, y) = (i % width, i / width);
                radiance(direction((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32))
            })
            .collect();
        Self { width, height, texels }
    }

    /// A photo studio: two large soft boxes above left and right, a weak one below, grey walls.
    /// The brightness of the front box is 6; the mean over the sphere about 0.5.
    pub fn studio() -> Self {
        // Soft rectangle around a direction: extents in radians along its own horizontal and vertical.
        let panel = |d: Vec3, azimuth: f32, elevation: f32, half: [f32; 2]| {
            let yaw = d.x.atan2(d.z) - azimuth;
            let yaw = (yaw + PI).rem_euclid(2.0 * PI) - PI;
            let pitch = d.y.clamp(-1.0, 1.0).asin() - elevation;
            let soft = |x: f32, h: f32| 1.0 - ((x.abs() - h) / 0.12).clamp(0.0, 1.0);
            soft(yaw * elevation.cos(), half[0]) * soft(pitch, half[1])
        };
        Self::from_fn(256, 128, move |d| {
            let wall = Vec3::splat(0.16 + 0.14 * (0.5 + 0.5 * d.y));
            let key = Vec3::new(1.0, 0.96, 0.9) * 6.0 * panel(d, -0.75, 0.65, [0.42, 0.34]);
            let fill = Vec3::new(0.86, 0.93, 1.0) * 2.4 * panel(d, 0.95, 0.35, [0.35, 0.45]);
            let rim = Vec3::new(1.0, 1.0, 1.0) * 4.0 * panel(d, 2.5, 0.5, [0.22, 0.5]);
            let floor = Vec3::new(0.9, 0.8, 0.7) * 0.25 * (-d.y).max(0.0);
            wall + key + fill + rim + floor
        })
    }

    /// A room lit by one soft box: a large panel above in front, dim warm walls that are darker towards the floor, a pale
    /// ceiling. The brightness of the panel is 5; the mean over the sphere about 0.4.
    pub fn soft_box() -> Self {
        Self::from_fn(256, 128, |d| {
            // Where the direction meets the plane of the panel, 1 in front of the head along its axis.
            let axis = Vec3::new(0.0, 0.62, 0.785).normalize();
            let across = Vec3::X;
            let up = axis.cross(across);
            let ahead = d.dot(axis);
            let panel = if ahead > 0.05 {
                let soft = |x: f32, half: f32| 1.0 - ((x.abs() - half) / 0.10).clamp(0.0, 1.0);
                soft(d.dot(across) / ahead, 0.62) * soft(d.dot(up) / ahead, 0.36)
            } else {
                0.0
            };
            let height = 0.5 + 0.5 * d.y;
            let room = Vec3::new(0.9, 0.84, 0.76).lerp(Vec3::new(0.98, 0.98, 1.0), height);
            room * (0.06 + 0.20 * height * height) + Vec3::new(1.0, 0.97, 0.92) * 5.0 * panel
        })
    }

    /// Clear sky: a sun at 38 degrees in front on the left of a viewer of the face, blue that pales towards the
    /// horizon and about the sun, and sunlit ground.
    ///
    /// The sun's disc, which eyes reflect, has a radius of 5 degrees in place of a quarter, and only a third of the
    /// sky's light, because a map casts no shadows. A directional light along (0.506, -0.616, -0.604) stands for the
    /// rest. The mean over the sphere is about 0.5.
    pub fn sky() -> Self {
        const SUN_RADIUS: f32 = 5.0 * PI / 180.0;
        let (elevation, azimuth) = (38.0f32.to_radians(), -40.0f32.to_radians());
        let sun =
            Vec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
        Self::from_fn(256, 128, move |d| {
            let angle = d.dot(sun).clamp(-1.0, 1.0).acos();
            let disc = 1.0 - ((angle - SUN_RADIUS) / 0.03).clamp(0.0, 1.0);
            let light = Vec3::new(1.0, 0.92, 0.80) * 32.0 * disc;
            if d.y < 0.0 {
                let near = Vec3::new(0.34, 0.31, 0.26) * (0.75 + 0.25 * -d.y);
                return near.lerp(Vec3::new(0.50, 0.53, 0.56), (1.0 + d.y * 6.0).clamp(0.0, 1.0));
            }
            let pale = (-d.y * 3.2).exp();
            let blue = Vec3::new(0.16, 0.30, 0.62).lerp(Vec3::new(0.62, 0.72, 0.84), pale);
            let glow = Vec3::new(1.0, 0.9, 0.72) * 0.9 * (-angle * 4.0).exp();
            blue + glow + light
        })
    }

    /// A built-in environment by its name, one of [`EnvironmentMap::NAMES`].
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "studio" => Some(Self::studio()),
            "soft-box" => Some(Self::soft_box()),
            "sky" => Some(Self::sky()),
            _ => None,
        }
    }

    /// Names of the built-in environments.
    pub const NAMES: [&str; 3] = ["studio", "soft-box", "sky"];

    /// The map turned about +Y by an angle in degrees; positive turns the surroundings to the left of a viewer who
    /// looks along -Z.
    pub fn rotated(&self, degrees: f32) -> Self {
        let shift = (degrees / 360.0 * self.width as f32).round() as i64;
        let texels = (0..self.height as i64)
            .flat_map(|y| (0..self.width as i64).map(move |x| (x, y)))
            .map(|(x, y)| {
                let from = (x + shift).rem_euclid(i64::from(self.width));
                self.texels[(y * i64::from(self.width) + from) as usize]
            })
            .collect();
        Self { texels, ..*self }
    }

    /// Solid angle of a texel of row y, steradians.
    fn solid_angle(&self, y: u32) -> f32 {
        let edge = |row: u32| (row as f32 / self.height as f32 * PI).cos();
        (edge(y) - edge(y + 1)) * 2.0 * PI / self.width as f32
    }

    /// Mean over the texels that a smaller map's texel covers, weighted by solid angle.
    fn resized(&self, width: u32, height: u32) -> Self {
        let texels = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let (x, y) = (i % width, i / width);
                let range = |j: u32, n: u32, of: u32| {
                    let first = (j as u64 * u64::from(of) / u64::from(n)) as u32;
                    let last = ((j as u64 + 1) * u64::from(of)).div_ceil(u64::from(n)) as u32;
                    first..last.max(first + 1)
                };
                let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
                for sy in range(y, height, self.height) {
                    let w = self.solid_angle(sy);
                    for sx in range(x, width, self.width) {
                        sum += w * self.texels[(sy * self.width + sx) as usize];
                        weight += w;
                    }
                }
                sum / weight
            })
            .collect();
        Self { width, height, texels }
    }

    /// Coefficients c such that irradiance(n) / pi is the polynomial that shade.wesl evaluates
    /// (Ramamoorthi and Hanrahan 2001, order 2; the cosine lobe has factors pi, 2 pi / 3 and pi / 4).
    pub fn irradiance_harmonics(&self) -> [Vec3; 9] {
        let mut c = [Vec3::ZERO; 9];
        for y in 0..self.height {
            let w = self.solid_angle(y);
            for x in 0..self.width {
                let l = w * self.texels[(y * self.width + x) as usize];
                let d =
                    direction((x as f32 + 0.5) / self.width as f32, (y as f32 + 0.5) / self.height as f32);
                for (c, b) in c.iter_mut().zip(basis(d)) {
                    *c += b * l;
                }
            }
        }
        // Each term: normalisation of the basis squared, times lobe factor / pi.
        let n0 = 1.0 / (4.0 * PI);
        let n1 = 3.0 / (4.0 * PI) * (2.0 / 3.0);
        let n2 = 15.0 / (4.0 * PI) * 0.25;
        let factors = [n0, n1, n1, n1, n2, n2, n2 / 12.0, n2, n2 / 4.0];
        std::array::from_fn(|i| factors[i] * c[i])
    }

    /// Filters the map for a device.
    pub fn upload(&self, gpu: &Gpu) -> Environment {
        let base = self.resized(FILTERED_WIDTH, FILTERED_WIDTH / 2);
        let source = base.resized(FILTERED_WIDTH / 2, FILTERED_WIDTH / 4);
        let levels: Vec<Vec<[f32; 4]>> = (0..LEVELS)
            .map(|level| {
                let roughness = (level as f32 / (LEVELS - 1) as f32).powi(2);
                let (w, h) = (FILTERED_WIDTH >> level, (FILTERED_WIDTH / 2) >> level);
                let map = if level == 0 { base.clone() } else { source.filtered(w, h, roughness) };
                map.texels.iter().map(|t| t.extend(1.0).to_array()).collect()
            })
            .collect();
        let filtered =
            texture::upload_half(gpu, "environment", [FILTERED_WIDTH, FILTERED_WIDTH / 2], &[levels]);
        let harmonics = self.resized(64, 32).irradiance_harmonics();
        Environment { filtered, levels: LEVELS, harmonics }
    }

    /// Reflection of the map in a surface of this Beckmann roughness seen head on.
    fn filtered(&self, width: u32, height: u32, roughness: f32) -> Self {
        let m2 = (roughness * roughness).max(1e-4);
        let directions: Vec<(Vec3, f32, Vec3)> = (0..self.height)
            .flat_map(|y| (0..self.width).map(move |x| (x, y)))
            .map(|(x, y)| {
                let d =
                    direction((x as f32 + 0.5) / self.width as f32, (y as f32 + 0.5) / self.height as f32);
                (d, self.solid_angle(y), self.texels[(y * self.width + x) as usize])
            })
            .collect();
        Self::from_fn(width, height, |n| {
            let (mut sum, mut weight) = (Vec3::ZERO, 1e-12);
            for (d, solid_angle, radiance) in &directions {
                let cos_light = n.dot(*d);
                if cos_light <= 0.0 {
                    continue;
                }
                // The half vector stands halfway to the light.
                let cos2_half = 0.5 * (1.0 + cos_light);
                let w = solid_angle * ((cos2_half - 1.0) / (cos2_half * m2)).exp() / (cos2_half * cos2_half);
                sum += w * *radiance;
                weight += w;
            }
            sum / weight
        })
    }
}

/// The polynomials of the shader, without normalisation.
fn basis(d: Vec3) -> [f32; 9] {
    [1.0, d.y, d.z, d.x, d.x * d.y, d.y * d.z, 3.0 * d.z * d.z - 1.0, d.x * d.z, d.x * d.x - d.y * d.y]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn irradiance_over_pi(c: &[Vec3; 9], n: Vec3) -> Vec3 {
        basis(n).iter().zip(c).map(|(b, c)| *b * *c).sum()
    }

    #[test]
    fn a_uniform_sky_gives_its_radiance_in_every_direction() {
        let c = EnvironmentMap::from_fn(64, 32, |_| Vec3::splat(0.7)).irradiance_harmonics();
        for n in [Vec3::X, -Vec3::Y, Vec3::Z, Vec3::new(0.6, 0.64, -0.48)] {
            assert!(irradiance_over_pi(&c, n).abs_diff_eq(Vec3::splat(0.7), 1e-3));
        }
    }

    #[test]
    fn a_quadratic_sky_matches_direct_integration() {
        let sky = |d: Vec3| Vec3::splat(1.0 + 0.5 * d.y + 0.4 * d.x * d.z + 0.3 * d.y * d.y);
        let map = EnvironmentMap::from_fn(128, 64, sky);
        let c = map.irradiance_harmonics();
        for n in [Vec3::Y, Vec3::new(0.48, -0.6, 0.64)] {
            let mut direct = Vec3::ZERO;
            for y in 0..map.height {
                for x in 0..map.width {
                    let d = direction((x as f32 + 0.5) / 128.0, (y as f32 + 0.5) / 64.0);
                    direct += map.solid_angle(y) * d.dot(n).max(0.0) * sky(d) / PI;
                }
            }
            assert!(irradiance_over_pi(&c, n).abs_diff_eq(direct, 2e-3), "{n}");
        }
    }

    #[test]
    fn built_in_environments_are_finite_and_light_a_face_from_in_front_and_above() {
        for name in EnvironmentMap::NAMES {
            let map = EnvironmentMap::named(name).unwrap();
            assert!(map.texels.iter().all(|t| t.is_finite() && t.min_element() >= 0.0), "{name}");
            let c = map.irradiance_harmonics();
            let light = |n: Vec3| irradiance_over_pi(&c, n).dot(Vec3::new(0.2126, 0.7152, 0.0722));
            let front = light(Vec3::new(0.0, 0.5, 0.866));
            assert!(front > 1.5 * light(-Vec3::Y), "{name}");
            assert!((0.2..3.0).contains(&front), "{name}: {front}");
            let mean = c[0];
            assert!((0.15..1.2).contains(&mean.dot(Vec3::splat(1.0 / 3.0))), "{name}: {mean}");
        }
        assert!(EnvironmentMap::named("nowhere").is_none());
    }

    #[test]
    fn the_disc_of_the_sun_has_a_third_of_the_light_of_its_sky() {
        let map = EnvironmentMap::sky();
        let (mut sun, mut sky) = (0.0, 0.0);
        for y in 0..map.height / 2 {
            for x in 0..map.width {
                let d = direction((x as f32 + 0.5) / 256.0, (y as f32 + 0.5) / 128.0);
                let t = map.texels[(y * map.width + x) as usize].y * map.solid_angle(y) * d.y;
                if map.texels[(y * map.width + x) as usize].y > 5.0 { sun += t } else { sky += t }
            }
        }
        assert!((0.2..0.6).contains(&(sun / sky)), "{sun} to {sky}");
    }

    #[test]
    fn filtering_keeps_a_uniform_map() {
        let map = EnvironmentMap::from_fn(32, 16, |_| Vec3::splat(2.0));
        for roughness in [0.04, 0.3, 1.0] {
            assert!(
                map.filtered(8, 4, roughness).texels.iter().all(|t| t.abs_diff_eq(Vec3::splat(2.0), 1e-4))
            );
        }
    }

    #[test]
    fn turned_harmonics_are_those_of_the_turned_map() {
        let sky = |d: Vec3| {
            Vec3::splat(1.0 + 0.5 * d.y + 0.4 * d.x * d.z + 0.3 * d.y * d.x + 0.7 * (d.z - 0.2).max(0.0))
        };
        let map = EnvironmentMap::from_fn(256, 128, sky);
        let h = map.irradiance_harmonics();
        for columns in [1, 40, 128, 200] {
            let degrees = columns as f32 * 360.0 / 256.0;
            let expected = map.rotated(degrees).irradiance_harmonics();
            let turned = turned_harmonics(&h, degrees.to_radians());
            for (t, e) in turned.iter().zip(expected) {
                assert!((Vec3::new(t[0], t[1], t[2]) - e).abs().max_element() < 2e-5, "{degrees}: {t:?} {e}");
            }
        }
        assert_eq!(turned_harmonics(&h, 0.0), h.map(|v| v.extend(0.0).to_array()), "exactly, without a turn");
    }

    #[test]
    fn a_quarter_turn_moves_a_column_by_a_quarter() {
        let mut map = EnvironmentMap { width: 4, height: 1, texels: vec![Vec3::ZERO; 4] };
        map.texels[2] = Vec3::ONE;
        assert_eq!(map.rotated(90.0).texels[1], Vec3::ONE);
    }
}
