//! Pictures of the light of a head, and what a flat piece of the same skin returns.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::lamp::Lamp;
use super::walk::{Brought, Meet, Surroundings, Walker, What};
use super::{CHANNELS, Flesh};
use crate::evaluate::CameraState;
use crate::head::MM_PER_METRE;
use crate::random::{SplitMix64, mixed};

/// A camera with a picture before it, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    origin: Vec3,
    forward: Vec3,
    right: Vec3,
    up: Vec3,
    size: [u32; 2],
}

impl View {
    /// The view of a camera through a picture of `size` pixels.
    pub fn new(camera: &CameraState, size: [u32; 2]) -> Self {
        let forward = (camera.target - camera.position).normalize_or(Vec3::NEG_Z);
        let right = forward.cross(camera.up).normalize_or(Vec3::X);
        let tangent = (0.5 * camera.fov_y).tan();
        let aspect = size[0] as f32 / size[1].max(1) as f32;
        Self {
            origin: MM_PER_METRE * camera.position,
            forward,
            right: tangent * aspect * right,
            up: tangent * right.cross(forward),
            size,
        }
    }

    /// Direction through a place of the picture in pixels from the upper left corner; pixel centres are at .5.
    fn direction(&self, pixel: Vec2) -> Vec3 {
        let ndc = 2.0 * pixel / Vec2::new(self.size[0] as f32, self.size[1] as f32) - 1.0;
        (self.forward + ndc.x * self.right - ndc.y * self.up).normalize()
    }

    fn pixels(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }

    /// Middle of a pixel by its number, rows from the top.
    fn middle(&self, pixel: usize) -> Vec2 {
        let width = self.size[0] as usize;
        Vec2::new((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5)
    }
}

/// Where in a pixel rays go through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Filter {
    /// Its middle, as a frame without antialiasing has it.
    Middle,
    /// Anywhere, evenly.
    Box,
}

/// How a picture is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// Paths of a pixel that shows skin.
    pub paths: u32,
    /// Of all random numbers.
    pub seed: u64,
    /// Where in a pixel.
    pub filter: Filter,
}

/// Light by pixel, rows from the top. The unit is that of radiance where lamps have irradiance.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height.
    pub size: [u32; 2],
    /// Diffuse light, R, G, B.
    pub diffuse: Vec<[f32; 3]>,
    /// Its standard error.
    pub diffuse_error: Vec<[f32; 3]>,
    /// Diffuse light with what the surface reflects of it to the camera: all light that was scattered inside.
    pub scattered: Vec<[f32; 3]>,
    /// Its standard error.
    pub scattered_error: Vec<[f32; 3]>,
    /// Share of paths that found no way out of the closed surface.
    pub lost: f64,
}

/// Sums of a pixel.
#[derive(Clone, Copy, Default)]
struct Sums {
    diffuse: [[f64; 2]; CHANNELS],
    scattered: [[f64; 2]; CHANNELS],
    lost: u64,
    paths: u64,
}

impl Sums {
    fn add(&mut self, brought: Brought) {
        let each = |sums: &mut [[f64; 2]; CHANNELS], light: Vec3| {
            for (sum, v) in sums.iter_mut().zip(light.to_array().map(f64::from)) {
                sum[0] += v;
                sum[1] += v * v;
            }
        };
        each(&mut self.diffuse, brought.refracted);
        each(&mut self.scattered, brought.refracted + brought.reflected);
        self.lost += u64::from(brought.lost);
        self.paths += 1;
    }

    fn joined(mut self, other: Self) -> Self {
        for (a, b) in [(&mut self.diffuse, other.diffuse), (&mut self.scattered, other.scattered)] {
            for (a, b) in a.iter_mut().zip(b) {
                a[0] += b[0];
                a[1] += b[1];
            }
        }
        self.lost += other.lost;
        self.paths += other.paths;
        self
    }
}

/// Mean and its standard error.
fn statistics(sums: &[[f64; 2]; CHANNELS], n: u64) -> [[f64; CHANNELS]; 2] {
    let n = n.max(1) as f64;
    let mean = sums.map(|s| s[0] / n);
    let error = std::array::from_fn(|c| {
        let variance = (sums[c][1] / n - mean[c] * mean[c]).max(0.0);
        (variance / (n - 1.0).max(1.0)).sqrt()
    });
    [mean, error]
}

/// Draws the light of lamps in a body.
pub fn picture(
    flesh: &Flesh,
    body: &impl Surroundings,
    lamps: &[Lamp],
    view: &View,
    options: &Options,
) -> Picture {
    let walker = Walker { flesh, around: body, lamps, sky: 0.0 };
    let pixel = |i: usize| {
        let mut random = SplitMix64(mixed(options.seed ^ mixed(i as u64 + 1)));
        let mut sums = Sums::default();
        let seen = |at: Vec2| {
            let direction = view.direction(at);
            (body.meet(view.origin, direction, f32::INFINITY, None), -direction)
        };
        let middle = view.middle(i);
        let known = (options.filter == Filter::Middle).then(|| seen(middle));
        for _ in 0..options.paths {
            let jitter = |r: &mut SplitMix64| Vec2::new(r.uniform() as f32 - 0.5, r.uniform() as f32 - 0.5);
            let (met, to_viewer) = known.unwrap_or_else(|| seen(middle + jitter(&mut random)));
            match met {
                Some(met) if met.what != What::Blocker => sums.add(walker.path(&met, to_viewer, &mut random)),
                _ if known.is_some() => break,
                _ => sums.add(Brought::default()),
            }
        }
        sums
    };
    let all: Vec<Sums> = (0..view.pixels()).into_par_iter().map(pixel).collect();
    let narrow = |v: [f64; CHANNELS]| v.map(|v| v as f32);
    let of = |which: &dyn Fn(&Sums) -> [[f64; 2]; CHANNELS]| -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        all.iter().map(|s| statistics(&which(s), s.paths)).map(|[m, e]| (narrow(m), narrow(e))).unzip()
    };
    let (diffuse, diffuse_error) = of(&|s| s.diffuse);
    let (scattered, scattered_error) = of(&|s| s.scattered);
    let paths: u64 = all.iter().map(|s| s.paths).sum();
    let lost: u64 = all.iter().map(|s| s.lost).sum();
    let lost = lost as f64 / paths.max(1) as f64;
    Picture { size: view.size, diffuse, diffuse_error, scattered, scattered_error, lost }
}

/// Skin below the plane z = 0.
pub(super) struct HalfSpace;

impl HalfSpace {
    pub(super) fn at(place: Vec3, distance_mm: f32) -> Meet {
        let (facet, normal, lifted) = (Vec3::Z, Vec3::Z, place);
        Meet { distance_mm, place, facet, normal, lifted, what: What::Skin, number: 0 }
    }
}

/// Beyond this depth no light comes back, mm.
const DEEP_MM: f32 = 1e4;

impl Surroundings for HalfSpace {
    fn meet(&self, origin: Vec3, direction: Vec3, far_mm: f32, on: Option<u32>) -> Option<Meet> {
        let distance_mm = -origin.z / direction.z;
        let is_met = on.is_none() && distance_mm > 0.0 && distance_mm < far_mm;
        is_met.then(|| Self::at((origin + distance_mm * direction).with_z(0.0), distance_mm))
    }

    fn is_blocked(&self, _: Vec3, _: Vec3, _: f32) -> bool {
        false
    }

    fn bounds(&self) -> (Vec3, Vec3) {
        (Vec3::splat(-DEEP_MM), Vec3::splat(DEEP_MM))
    }
}

/// Diffuse light of a flat half space seen at the cosine `mu` under a sky of radiance 1, and its standard error: by
/// reciprocity the share of a beam at that cosine that is refracted, scattered and comes out again. `mu` is above 0.
pub fn flat_reflectance(flesh: &Flesh, mu: f32, paths: u64, seed: u64) -> [[f64; 3]; 2] {
    const STREAMS: u64 = 64;
    let walker = Walker { flesh, around: &HalfSpace, lamps: &[], sky: 1.0 };
    let to_viewer = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
    let seen = HalfSpace::at(Vec3::ZERO, 1.0);
    let stream = |i: u64| {
        let mut random = SplitMix64(mixed(seed ^ mixed(i + 1)));
        let mut sums = Sums::default();
        (0..paths.div_ceil(STREAMS)).for_each(|_| sums.add(walker.path(&seen, to_viewer, &mut random)));
        sums
    };
    // Collected first, so that the order of additions is always the same.
    let all: Vec<Sums> = (0..STREAMS).into_par_iter().map(stream).collect();
    let sums = all.into_iter().fold(Sums::default(), Sums::joined);
    statistics(&sums.diffuse, sums.paths)
}

/// What a pixel of skin shows, by its geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Patch {
    /// A lamp lights it, its cosine is above 0.3.
    Lit,
    /// Not that, but a lamp that nothing hides is within 0.3 of the horizon.
    Terminator,
    /// No lamp, and another surface is nearer than 8 mm behind.
    Thin,
    /// No lamp, and nothing behind.
    Shadow,
}

impl Patch {
    /// All, in the order of reports.
    pub const ALL: [Self; 4] = [Self::Lit, Self::Terminator, Self::Thin, Self::Shadow];

    /// As in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lit => "lit",
            Self::Terminator => "terminator",
            Self::Thin => "thin",
            Self::Shadow => "shadow",
        }
    }
}

/// Cosine to a lamp up to which light counts as that of a terminator: 17 degrees.
const GRAZING: f32 = 0.3;
/// Thickness below which skin counts as thin: that of ears, lips and wings of the nose. Five mean free paths of red light.
const THIN_MM: f32 = 8.0;

/// Patch of each pixel whose middle shows skin.
pub fn patches(body: &impl Surroundings, lamps: &[Lamp], view: &View) -> Vec<Option<Patch>> {
    let pixel = |i: usize| {
        let met = body.meet(view.origin, view.direction(view.middle(i)), f32::INFINITY, None)?;
        if met.what != What::Skin {
            return None;
        }
        let mut patch = None;
        for lamp in lamps {
            let light = lamp.arriving(met.place, [0.0; 2]);
            let cosine = light.to_lamp.dot(met.normal);
            if cosine < -GRAZING || light.irradiance == Vec3::ZERO {
                continue;
            }
            // Just below the horizon the head itself is in the way, which is what a terminator is.
            let is_open = cosine <= 0.0 || !body.is_blocked(met.lifted, light.to_lamp, light.distance_mm);
            if is_open && cosine > GRAZING {
                return Some(Patch::Lit);
            }
            if is_open {
                patch = Some(Patch::Terminator);
            }
        }
        let is_thin = || body.is_blocked(met.place, -met.normal, THIN_MM);
        Some(patch.unwrap_or(if is_thin() { Patch::Thin } else { Patch::Shadow }))
    };
    (0..view.pixels()).into_par_iter().map(pixel).collect()
}
