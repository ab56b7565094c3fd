//! The disk sum of a texel in f64, from the equations: the profile itself in place of its table.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rubor_rig::skin::directional::Passage;
use rubor_rig::skin::profile::Profile;

use super::layers::Layer;
use super::tables::{Samples, window};
use super::{Cube, Fixes};

/// Texels of all layers as the light pass packs them.
pub(crate) struct Texels<'a> {
    pub(crate) cube: &'a Cube,
    pub(crate) packed: &'a [[u32; 4]],
}

#[derive(Clone, Copy)]
struct Texel {
    z: f64,
    normal: DVec3,
    flux: DVec3,
    strength: f64,
}

fn half(bits: u32) -> f64 {
    half::f16::from_bits(bits as u16).to_f64()
}

fn xyz(v: [f32; 4]) -> DVec3 {
    DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
}

impl Layer {
    fn is_perspective(&self) -> bool {
        self.origin[3] > 0.0
    }

    fn place(&self, position: DVec3) -> (DVec2, f64) {
        let v = position - xyz(self.origin);
        let z = v.dot(xyz(self.forward));
        let w = if self.is_perspective() { z } else { 1.0 };
        let at = |axis: [f32; 4]| v.dot(xyz(axis)) / w + f64::from(axis[3]);
        (DVec2::new(at(self.right), at(self.up)), z)
    }

    fn world(&self, ndc: DVec2, z: f64) -> DVec3 {
        let along = |axis: [f32; 4], at: f64, half: f32| {
            xyz(axis) * f64::from(half).powi(2) * (at - f64::from(axis[3]))
        };
        let across = along(self.right, ndc.x, self.extent[0]) + along(self.up, ndc.y, self.extent[1]);
        let scale = if self.is_perspective() { z } else { 1.0 };
        xyz(self.origin) + z * xyz(self.forward) + across * scale
    }

    fn to_viewer(self, position: DVec3) -> DVec3 {
        if self.is_perspective() { (xyz(self.origin) - position).normalize() } else { -xyz(self.forward) }
    }
}

impl Texels<'_> {
    fn texel(&self, at: DVec2, layer: usize) -> Option<Texel> {
        let side = self.cube.size as usize;
        if at.min_element() < 0.0 || at.max_element() >= side as f64 {
            return None;
        }
        let [z, rg, b_strength, normal] = self.packed[(layer * side + at.y as usize) * side + at.x as usize];
        let snorm = |bits: u32| f64::from(bits as u16 as i16).max(-32767.0) / 32767.0;
        let p = DVec2::new(snorm(normal), snorm(normal >> 16));
        let up = 1.0 - p.x.abs() - p.y.abs();
        let fold = |a: f64, b: f64| (1.0 - b.abs()) * if a >= 0.0 { 1.0 } else { -1.0 };
        let (x, y) = if up >= 0.0 { (p.x, p.y) } else { (fold(p.x, p.y), fold(p.y, p.x)) };
        let z = f64::from(f32::from_bits(z));
        (z > 0.0).then(|| Texel {
            z,
            normal: DVec3::new(x, y, up).normalize(),
            flux: DVec3::new(half(rg), half(rg >> 16), half(b_strength)),
            strength: half(b_strength >> 16),
        })
    }

    fn ndc(&self, at: DVec2) -> DVec2 {
        DVec2::new(2.0, -2.0) * (at / f64::from(self.cube.size)) + DVec2::new(-1.0, 1.0)
    }

    fn at(&self, ndc: DVec2) -> DVec2 {
        (ndc * DVec2::new(0.5, -0.5) + 0.5) * f64::from(self.cube.size)
    }

    /// Light of a texel of an axis from farther than the picture's own disk, without refinement.
    pub(crate) fn far_light(
        &self,
        profile: &Profile,
        samples: &Samples,
        axis: usize,
        [x, y]: [u32; 2],
    ) -> DVec3 {
        let cube = self.cube;
        let middle = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let index = cube.lamps as usize + axis;
        let Some(own) = self.texel(middle, index) else { return DVec3::ZERO };
        let position = cube.layer[index].world(self.ndc(middle), own.z);
        // Interleaved gradient noise in the precision of the shader, whose last bits it depends on.
        let (x, y) = (x as f32 + 17.0 * axis as f32, y as f32 + 17.0 * axis as f32);
        let noise = (52.982_918f32 * (x * 0.067_110_56 + y * 0.005_837_15).fract()).fract();
        let turn = DVec2::from_angle(TAU * f64::from(noise));
        let end = if cube.has_sky != 0 { cube.layers } else { cube.lamps };
        (0..end as usize).map(|i| self.of_layer(profile, samples, i, (position, own), turn)).sum()
    }

    fn of_layer(
        &self,
        profile: &Profile,
        samples: &Samples,
        index: usize,
        (position, own): (DVec3, Texel),
        turn: DVec2,
    ) -> DVec3 {
        let cube = self.cube;
        let layer = &cube.layer[index];
        let total = profile.total();
        let reach = f64::from(cube.half_width_mm);
        let r_of = |r: f64| {
            let k = profile.reflectance(r.max(1e-6));
            if r < reach { DVec3::from_array([0, 1, 2].map(|c| k[c] / total[c])) } else { DVec3::ZERO }
        };
        let beyond =
            |r: f64| DVec3::from_array([0, 1, 2].map(|c| profile.channels[c].mass_beyond(r) / total[c]));
        let mean = |v: DVec3| v.element_sum() / 3.0;
        let windowed = |r: f64| window([f64::from(cube.near_start_mm), f64::from(cube.near_end_mm)], r);
        let directional = profile.directional();

        let to_viewer = layer.to_viewer(position);
        let cosine = own.normal.dot(to_viewer);
        let across = own.normal - to_viewer * cosine;
        let shrinks = cube.fixes
            & Fixes { has_bias: false, shrinks_to_axis: false, weighs_by_facing: false, ..Fixes::ALL }.bits()
            != 0;
        let center = position - if shrinks { 1e-3 * f64::from(cube.lamp_shrink_mm) } else { 0.0 } * across;
        let reach_mm = reach * own.strength;
        let behind = |p: DVec3| {
            let (ndc, z) = layer.place(p);
            self.texel(self.at(ndc), index).map_or(1e6, |t| 1e3 * (z - t.z))
        };
        let e = if to_viewer.x.abs() > 0.7 { DVec3::Y } else { DVec3::X };
        let tilt =
            if across.length_squared() > 1e-6 { across.normalize() } else { to_viewer.cross(e).normalize() };
        let beside = to_viewer.cross(tilt);
        let depth_mm = behind(center);
        if depth_mm.abs() >= reach_mm {
            let probe = 0.35e-3 * reach_mm;
            let around = [tilt, -tilt, beside, -beside].map(|d| behind(center + probe * d).abs());
            if around.into_iter().all(|d| d >= reach_mm) {
                return DVec3::ZERO;
            }
        }
        let squash = cosine.abs().clamp(0.25, 1.0);
        let depth = if depth_mm < reach_mm { depth_mm * squash / own.strength } else { 0.0 };
        let through = depth > (2.0 * f64::from(cube.bias_mm) / own.strength).max(0.25);
        let first_z = layer.place(position).1;
        let count = cube.samples as usize;
        let (mut sum, mut even) = (DVec3::ZERO, DVec3::ZERO);
        for (i, place) in samples.places.iter().enumerate() {
            let angle = DVec2::new(f64::from(place[0]), f64::from(place[1])).normalize_or(DVec2::X);
            let (mut r, mut weight) = (f64::from(place[2]), f64::from(place[3]));
            if through {
                if i % 2 == 1 {
                    // The radius outside of which this share of the slab's light is.
                    let share = ((i / 2) as f64 + 0.5) / (count / 2) as f64 * mean(beyond(depth));
                    let (mut low, mut high) = (0.0, reach);
                    for _ in 0..60 {
                        let middle = 0.5 * (low + high);
                        if mean(beyond(middle)) > share { low = middle } else { high = middle }
                    }
                    r = (low * low - depth * depth).max(0.0).sqrt();
                }
                let flat = match directional {
                    Some(_) => mean(r_of(r)),
                    None => mean(r_of(r)) * windowed(r) / f64::from(cube.near_light[3]),
                };
                let deep = r_of(r.hypot(depth));
                weight = 2.0 / (flat + mean(deep) / mean(beyond(depth)));
                even += deep * weight;
            }
            let turned = r * turn.rotate(angle);
            let offset = own.strength * 1e-3 * (squash * turned.x * tilt + turned.y * beside);
            let (ndc, z) = layer.place(position + offset);
            let at = self.at(ndc);
            let Some(t) = self.texel(at, index).filter(|t| t.strength > 0.0 && z > 0.0) else { continue };
            let step = layer.world(ndc, t.z) - layer.world(self.ndc(at.floor() + 0.5), t.z);
            let steepest = 4.0 * step.length();
            let slope = (-t.normal.dot(step) / t.normal.dot(xyz(layer.forward)).min(-0.25))
                .clamp(-steepest, steepest);
            let entry = layer.world(ndc, t.z + slope);
            let way = 1e3 * (position - entry) / own.strength;
            let r = way.length();
            if r >= reach {
                continue;
            }
            let s = ((t.normal.dot(own.normal) + 0.2) / 0.6).clamp(0.0, 1.0);
            let one_side = s * s * (3.0 - 2.0 * s);
            let near = r_of(r) * (1.0 - windowed(r)) * one_side;
            let whole = match directional {
                Some(dipoles) if layer.extent[3] >= 0.0 => {
                    let eta = dipoles[0].numbers().eta;
                    let to_light = layer.to_viewer(entry);
                    // Light from below the horizon counts as light along it.
                    let cosine = t.normal.dot(to_light).max(0.0);
                    let inside = (1.0 - (1.0 - cosine * cosine) / (eta * eta)).max(0.0);
                    let ray = ((cosine / eta - inside.sqrt()) * t.normal - to_light / eta).normalize();
                    let passage =
                        Passage { way_mm: way, normal_in: t.normal, normal_out: own.normal, refracted: ray };
                    DVec3::from_array([0, 1, 2].map(|c| dipoles[c].exitance(&passage) / total[c]))
                }
                _ => r_of(r),
            };
            let spread = if layer.is_perspective() { t.z / first_z } else { 1.0 };
            sum += (whole - near) * t.flux * (weight * squash * spread * spread);
        }
        let n = count as f64;
        if through {
            return sum / n * (beyond(depth) * n / even).clamp(DVec3::ZERO, DVec3::splat(4.0));
        }
        sum / n * DVec3::from_array(samples.plane_factor.map(f64::from))
    }
}
