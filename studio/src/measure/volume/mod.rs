//! The open benchmark: methods in real time beside light that was traced through the volume of the head.
//!
//! ```text
//! stills --bare--> lamps, pose --path tracer--> diffuse light, its standard error, patches --over that of a flat half space--> truth
//!             \--> every method: diffuse light before albedo, times what leaves towards the viewer -------> error, bias of each patch
//! ```
//!
//! Both sides have the same medium: the volume its coefficients, the methods the profile of a photon walk in it. Both are
//! over the light that a flat piece of skin returns of an even sky, seen from the front. So what differs is geometry and direction:
//! how far the surface is from a plane, and how far light in skin is from knowing no direction.
//!
//! What differs by definition, and so is in every error:
//! - A profile is that of light that enters straight on and leaves in any direction. In the volume, light that grazes the surface
//!   enters nearer to it and returns sooner, and what leaves is no Lambertian cone.
//! - The real-time boundary loses `rho(L)` on entry and `rho(V)` on exit, by the lobe of the highlight (Beckmann, Kelemen and
//!   Szirmay-Kalos 2001); the volume has the transmittance of microfacets (GGX, Walter et al. 2007).
//! - Light that leaves the skin and enters elsewhere goes along its path in the volume, through patches of the surface in rubor.
//! - Light that crosses a thin part without a collision counts in rubor (its scatterers stand for forward ones), not in the volume.
//! - The lining of mouth and eyes is tissue in the volume; methods scatter in skin alone.
//! - Soft shadows: the lamp is a disk in the volume, a filter of a shadow map in real time.
//!
//! What is off on both sides: sky, relief, wrinkles, hair, blood, colour. Every lamp casts shadows.

pub mod export;
pub mod page;
pub mod skin;
mod truth;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rubor_renderer::BARE_SKIN;
use rubor_renderer::channels::Channel;
use rubor_renderer::settings::Settings;
use rubor_rig::head::Head;
use rubor_rig::skin::volume::{Patch, flat_reflectance};
use serde_json::Value;

use super::chart::{self, Effort, Measure, RightLight, Scene, Suite};
use super::file_name;
use crate::error::{Failure, Outcome};
use crate::output;
use crate::report::{VolumeChoice, VolumePatch, VolumePoint, VolumeReport, VolumeStill};
use crate::studio::Studio;
use crate::watch::Watch;
pub use skin::MediumName;
use truth::Truth;

/// Scenes of the suite that are no stills of the benchmark: what they provoke is switched off.
const LEFT_OUT: [&str; 2] = ["frown", "flush"];
/// Paths of the flat piece of skin: 0.15 % of its light.
const FLAT_PATHS: u64 = 1_000_000;
/// Random numbers of all stills.
const SEED: u64 = 1;

/// Options of the benchmark.
#[derive(Clone, Debug)]
pub struct Options {
    /// The skin.
    pub medium: MediumName,
    /// Paths of a pixel.
    pub paths: u32,
    /// Folder for pictures, and for truths that later runs read again.
    pub folder: Option<PathBuf>,
}

/// The stills: the scenes of a suite whose subject is light in skin.
///
/// # Errors
/// A rig that does not fit the head.
pub fn stills(
    suite: Suite,
    head: &Head,
    rig: &rubor_rig::expression::Rig,
) -> Outcome<(Vec<Scene>, Vec<crate::notes::Note>)> {
    let (mut scenes, notes) = chart::scenes(suite, head, rig)?;
    scenes.retain(|scene| !LEFT_OUT.contains(&scene.name.as_str()));
    Ok((scenes, notes))
}

/// What is compared: the lists of the user, or every scattering method; the integral over the surface last.
///
/// # Errors
/// Values that the settings refuse.
pub fn choices(
    base: &Settings,
    listed: &[(String, Vec<Value>)],
    batches: u32,
) -> Outcome<Vec<(String, Settings)>> {
    let held: Vec<String> = rubor_renderer::settings::GROUPS
        .iter()
        .map(|g| g.name.to_owned())
        .filter(|name| name != "scatter")
        .collect();
    let effort = Effort { light: RightLight::Surface(batches), samples: 1 };
    let mut all: Vec<(String, Settings)> = Vec::new();
    for group in chart::groups(Suite::Whole, base, listed, &held, effort)? {
        if group.measure != Measure::Light {
            let found = group.flag;
            return Err(Failure::input(format!(
                "--volume: found a list of --{found}, expected one that changes light in skin: --scatter, --transmit or --curvature"
            )));
        }
        let surface = (group.truth.quality.scatter.to_string(), group.truth);
        for choice in group.choices.into_iter().chain([surface]) {
            if !all.iter().any(|(_, settings)| *settings == choice.1) {
                all.push(choice);
            }
        }
    }
    Ok(all)
}

/// Compares methods with the volume in stills of one head. `choices` are of settings made by [`MediumName::settings`].
///
/// # Errors
/// A head without an inside; errors of the studio; files that cannot be written.
pub fn run(
    studio: &mut Studio,
    head: &Head,
    base: &Settings,
    stills: &[Scene],
    choices: &[(String, Settings)],
    options: &Options,
    watch: &mut dyn Watch,
) -> Outcome<VolumeReport> {
    let flesh = options.medium.flesh()?;
    let [flat, _] = flat_reflectance(&flesh, 1.0, FLAT_PATHS, SEED);
    let fractions = skin::fractions_of(flat, studio.skin());
    let head = skin::bare_head(head, fractions);
    studio.set_heads([&head])?;
    let color = skin::bare_color(fractions, studio.skin());
    let size = base.output.size;
    let mut report = VolumeReport {
        adapter: studio.adapter(),
        settings: base.clone(),
        medium: options.medium,
        eta: skin::BOUNDARY[0],
        alpha: skin::BOUNDARY[1],
        flat,
        paths: options.paths,
        stills: Vec::new(),
        choices: choices
            .iter()
            .map(|(name, settings)| VolumeChoice {
                name: name.clone(),
                settings: settings.clone(),
                relative_rmse: 0.0,
                worst: 0.0,
                bias: BTreeMap::new(),
                points: Vec::new(),
            })
            .collect(),
    };
    let mut pooled = vec![BTreeMap::<&str, [f64; 2]>::new(); choices.len()];
    watch.begin("stills", stills.len() as u64);
    for still in stills {
        let folder = match &options.folder {
            Some(folder) => {
                let folder = folder.join(file_name(&still.name));
                output::folder(&folder)?;
                Some(folder)
            }
            None => None,
        };
        let shot = skin::bare_shot(&still.shot);
        let amount = [u64::from(options.paths), SEED];
        let mut truth = truth::of(&head, &shot, &flesh, size, amount, folder.as_deref())?;
        over_flat(&mut truth, flat);
        let shown = Shown::new(&truth, flat, size);
        let relative = |name: &str| Some(format!("{}/{name}", file_name(&still.name)));
        if let Some(folder) = &folder {
            output::save_picture(&folder.join("truth.png"), &shown.light(&truth.light))?;
        }
        for (c, (name, settings)) in choices.iter().enumerate() {
            let light = drawn(studio, &shot, settings, color)?;
            let compared = Compared::new(&light, &truth);
            let mut point = compared.point();
            for (patch, sums) in compared.patches {
                let all = pooled[c].entry(patch).or_default();
                // Every still counts alike, whatever its light.
                let scale = compared.signal.sqrt().max(f64::MIN_POSITIVE);
                all[0] += sums[0] / scale;
                all[1] += sums[1] / scale;
            }
            if let Some(folder) = &folder {
                let file = file_name(name);
                let [picture, difference] = [format!("{file}.png"), format!("{file}-difference.png")];
                let light: Vec<[f32; 3]> = light.iter().map(|p| p.unwrap_or_default()).collect();
                output::save_picture(&folder.join(&picture), &shown.light(&light))?;
                output::save_picture(&folder.join(&difference), &shown.difference(&light, &truth))?;
                point.picture = relative(&picture);
                point.difference = relative(&difference);
            }
            report.choices[c].points.push(point);
        }
        report.stills.push(VolumeStill {
            name: still.name.clone(),
            provokes: still.provokes.clone(),
            noise: noise(&truth),
            lost: truth.lost,
            patches: patches(&truth),
            picture: folder.as_ref().and_then(|_| relative("truth.png")),
        });
        watch.step();
    }
    watch.end();
    for (choice, pooled) in report.choices.iter_mut().zip(pooled) {
        let errors = || choice.points.iter().map(|p| p.relative_rmse);
        choice.relative_rmse = (errors().map(|e| e * e).sum::<f64>() / stills.len().max(1) as f64).sqrt();
        choice.worst = errors().fold(0.0, f64::max);
        choice.bias = pooled.into_iter().map(|(patch, [d, t])| (patch.to_owned(), d / t)).collect();
    }
    Ok(report)
}

/// Light over that of a flat half space under a sky of radiance 1.
fn over_flat(truth: &mut Truth, flat: [f64; 3]) {
    for pixel in truth.light.iter_mut().chain(&mut truth.error) {
        pixel.iter_mut().zip(flat).for_each(|(v, flat)| *v /= flat as f32);
    }
}

/// Diffuse light that leaves towards the viewer for a colour of 1, of pixels of skin.
fn drawn(
    studio: &mut Studio,
    shot: &rubor_rig::evaluate::Shot,
    settings: &Settings,
    color: [f32; 3],
) -> Outcome<Vec<Option<[f32; 3]>>> {
    let mut settings = settings.clone();
    settings.output.channels = vec![Channel::Diffuse, Channel::Albedo];
    studio.cut(0);
    let frame = studio.render(std::slice::from_ref(shot), 0.0, &settings)?;
    let [diffuse, albedo] = frame.channels.as_slice() else {
        return Err(Failure::job("the frame has no diffuse light"));
    };
    let pixel = |([r, g, b, _], albedo): ([f32; 4], [f32; 4])| {
        // What leaves towards the viewer is one number for all channels; red is the brightest.
        let leaving = albedo[0] / color[0];
        (albedo[3] >= BARE_SKIN).then(|| [r, g, b].map(|v| v * leaving))
    };
    Ok(diffuse.texels::<4>().zip(albedo.texels::<4>()).map(pixel).collect())
}

/// Sums over the pixels that are skin on both sides.
struct Compared {
    /// Squares of differences, of truth, and of the truth's noise.
    error: f64,
    signal: f64,
    noise: f64,
    /// Difference and truth of each patch.
    patches: BTreeMap<&'static str, [f64; 2]>,
}

impl Compared {
    fn new(light: &[Option<[f32; 3]>], truth: &Truth) -> Self {
        let mut sums = Self { error: 0.0, signal: 0.0, noise: 0.0, patches: BTreeMap::new() };
        for (i, light) in light.iter().enumerate() {
            let (Some(light), Some(patch)) = (light, truth.patches[i]) else { continue };
            let of_patch = sums.patches.entry(patch.name()).or_default();
            for c in 0..3 {
                let [t, noise] = [truth.light[i][c], truth.error[i][c]].map(f64::from);
                let difference = f64::from(light[c]) - t;
                sums.error += difference * difference;
                sums.signal += t * t;
                sums.noise += noise * noise;
                of_patch[0] += difference;
                of_patch[1] += t;
            }
        }
        sums
    }

    /// Errors without what noise of the truth adds to them: the squares of a difference of independent numbers add up.
    fn point(&self) -> VolumePoint {
        let signal = (self.signal - self.noise).max(f64::MIN_POSITIVE);
        VolumePoint {
            relative_rmse: ((self.error - self.noise).max(0.0) / signal).sqrt(),
            relative_rmse_with_noise: (self.error / signal).sqrt(),
            bias: self.patches.iter().map(|(name, [d, t])| ((*name).to_owned(), d / t)).collect(),
            picture: None,
            difference: None,
        }
    }
}

/// Relative standard error of the truth: root mean square over skin.
fn noise(truth: &Truth) -> f64 {
    let (mut noise, mut signal) = (0.0, 0.0);
    for i in (0..truth.light.len()).filter(|i| truth.patches[*i].is_some()) {
        for c in 0..3 {
            noise += f64::from(truth.error[i][c]).powi(2);
            signal += f64::from(truth.light[i][c]).powi(2);
        }
    }
    (noise / f64::max(signal, f64::MIN_POSITIVE)).sqrt()
}

fn patches(truth: &Truth) -> Vec<VolumePatch> {
    let of = |patch: Patch| {
        let pixels: Vec<usize> =
            (0..truth.patches.len()).filter(|i| truth.patches[*i] == Some(patch)).collect();
        let n = pixels.len().max(1) as f64;
        let mean = |c: usize| pixels.iter().map(|i| f64::from(truth.light[*i][c])).sum::<f64>() / n;
        let error =
            |c: usize| pixels.iter().map(|i| f64::from(truth.error[*i][c]).powi(2)).sum::<f64>().sqrt() / n;
        VolumePatch {
            patch: patch.name().to_owned(),
            pixels: pixels.len(),
            light: [0, 1, 2].map(mean),
            error: [0, 1, 2].map(error),
        }
    };
    Patch::ALL.into_iter().map(of).filter(|p| p.pixels > 0).collect()
}

/// How light becomes a picture: with the colour of the skin, so bright that the truth nearly fills the range.
struct Shown {
    scale: [f32; 3],
    /// Of differences: of the same light on all channels.
    grey: f32,
    size: [u32; 2],
}

impl Shown {
    fn new(truth: &Truth, flat: [f64; 3], size: [u32; 2]) -> Self {
        let mut all: Vec<f32> =
            truth.light.iter().map(|p| p.iter().copied().fold(0.0, f32::max)).filter(|v| *v > 0.0).collect();
        all.sort_unstable_by(f32::total_cmp);
        let bright = all.get(all.len() * 98 / 100).copied().unwrap_or(1.0);
        let scale = flat.map(|f| 0.85 * (f / flat[0]) as f32 / bright);
        Self { scale, grey: 1.0 / bright, size }
    }

    fn light(&self, light: &[[f32; 3]]) -> image::RgbImage {
        let [width, height] = self.size;
        image::RgbImage::from_fn(width, height, |x, y| {
            let p = light[(y * width + x) as usize];
            image::Rgb(std::array::from_fn(|c| byte(self.scale[c] * p[c])))
        })
    }

    /// Too bright is red, too dark is blue, 25 % of the brightest light is full; what is no skin is grey.
    fn difference(&self, light: &[[f32; 3]], truth: &Truth) -> image::RgbImage {
        let [width, height] = self.size;
        image::RgbImage::from_fn(width, height, |x, y| {
            let i = (y * width + x) as usize;
            if truth.patches[i].is_none() {
                return image::Rgb([110; 3]);
            }
            let d: f32 = (0..3).map(|c| light[i][c] - truth.light[i][c]).sum::<f32>() / 3.0;
            let v = (4.0 * self.grey * d).clamp(-1.0, 1.0);
            let fade = byte((1.0 - v.abs()).powi(2));
            image::Rgb(if v > 0.0 { [255, fade, fade] } else { [fade, fade, 255] })
        })
    }
}

fn byte(linear: f32) -> u8 {
    (255.0 * rubor_rig::color::srgb_encode(linear.clamp(0.0, 1.0))).round() as u8
}

/// Folder of a still.
fn folder_of(folder: &Path, still: &Scene) -> Outcome<PathBuf> {
    let folder = folder.join(file_name(&still.name));
    output::folder(&folder)?;
    Ok(folder)
}

#[cfg(test)]
mod tests;
