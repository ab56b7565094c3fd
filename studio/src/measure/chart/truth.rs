//! Right pictures of scenes, and how far a choice is from them.

use std::path::Path;

use rubor_assets::compare::{Pixels, flip, mean_and_percentile, relative_rmse};
use rubor_assets::image_io::SampleKind;
use rubor_renderer::BARE_SKIN;
use rubor_renderer::channels::Channel;
use rubor_renderer::settings::{ScatterMethod, Settings};
use rubor_rig::map::Map;

use super::choices::Measure;
use super::suite::Scene;
use crate::error::{Failure, Outcome};
use crate::measure::difference::{picture, pixels};
use crate::output;
use crate::report::ChartError;
use crate::studio::{Frame, Studio};

/// Frames of a still scene after which antialiasing over time changes no more.
pub(crate) const SETTLED_FRAMES: u32 = 4;

/// A frame with its diffuse light before albedo and the strength of scattering, where they were asked for.
pub(crate) struct Drawn {
    pub(crate) frame: Frame,
    pub(super) diffuse: Vec<[f32; 4]>,
}

/// Draws a scene with settings; with `light` its diffuse light too.
pub(crate) fn draw(studio: &mut Studio, scene: &Scene, settings: &Settings, light: bool) -> Outcome<Drawn> {
    let mut settings = settings.clone();
    settings.output.channels = if light { vec![Channel::Diffuse, Channel::Albedo] } else { Vec::new() };
    let frame = settled(studio, scene, &settings)?;
    // The fourth component of the diffuse light is for the methods on the screen.
    let diffuse = match frame.channels.as_slice() {
        [diffuse, albedo] => (diffuse.texels::<4>().zip(albedo.texels::<4>()))
            .map(|(light, albedo)| [light[0], light[1], light[2], albedo[3]])
            .collect(),
        _ => Vec::new(),
    };
    Ok(Drawn { frame, diffuse })
}

/// The frame of a still scene after which antialiasing over time changes no more.
fn settled(studio: &mut Studio, scene: &Scene, settings: &Settings) -> Outcome<Frame> {
    let shots = scene.shots();
    studio.cut(0);
    if settings.quality.antialias.is_temporal() {
        for _ in 1..SETTLED_FRAMES {
            studio.draw(&shots, scene.spacing_m, settings)?;
        }
    }
    studio.render(&shots, scene.spacing_m, settings)
}

/// A scene as it should be.
pub(crate) struct Truth {
    /// The right picture.
    pub(super) frame: Frame,
    pixels: Pixels,
    /// Pixels of the picture that count.
    counts: Vec<bool>,
    /// Diffuse light of skin, and its mask, where the measure is light.
    skin: Option<Skin>,
}

struct Skin {
    light: Vec<[f32; 3]>,
    /// Of `reference-screen`.
    screen: Vec<[f32; 3]>,
    is_skin: Vec<bool>,
    diffuse: Vec<[f32; 4]>,
}

impl Truth {
    /// Draws the truth of a group in a scene.
    pub(crate) fn draw(
        studio: &mut Studio,
        scene: &Scene,
        settings: &Settings,
        measure: Measure,
        base: &Settings,
    ) -> Outcome<Self> {
        match measure {
            Measure::Light => {
                let Drawn { frame, diffuse } = draw(studio, scene, settings, true)?;
                let is_skin: Vec<bool> = diffuse.iter().map(|p| p[3] >= BARE_SKIN).collect();
                let counts = samples(&is_skin, settings).into_iter().map(|(all, _)| all).collect();
                let mut screen = base.clone();
                screen.quality.scatter = ScatterMethod::ReferenceScreen;
                let on_screen = draw(studio, scene, &screen, true)?.diffuse;
                let skin = Skin {
                    light: of_skin(&diffuse, &is_skin),
                    screen: of_skin(&on_screen, &is_skin),
                    is_skin,
                    diffuse,
                };
                Ok(Self { pixels: pixels(&frame.image), frame, counts, skin: Some(skin) })
            }
            Measure::Picture => {
                let mut covered = settings.clone();
                covered.output.channels = vec![Channel::Radiance];
                let mut frame = settled(studio, scene, &covered)?;
                let Some(radiance) = frame.channels.pop() else {
                    return Err(Failure::job("the frame has no radiance"));
                };
                let is_head: Vec<bool> = radiance.texels::<4>().map(|p| p[3] > 0.0).collect();
                let counts = head_pixels(&is_head, settings);
                Ok(Self { pixels: pixels(&frame.image), frame, counts, skin: None })
            }
        }
    }

    /// Relative standard error of the diffuse light.
    pub(super) fn noise(&self) -> Option<f64> {
        self.frame.stats.scatter_noise
    }

    /// How far a choice is from it, and its map of visible differences.
    pub(crate) fn error(&self, test: &Drawn) -> (ChartError, Vec<f32>) {
        let shown = pixels(&test.frame.image);
        let map = flip::ldr(&shown, &self.pixels, flip::PIXELS_PER_DEGREE);
        let counted_of = |p: &Pixels| -> Vec<[f32; 3]> {
            p.linear.iter().zip(&self.counts).filter(|(_, counts)| **counts).map(|(v, _)| *v).collect()
        };
        let counted: Vec<f32> =
            map.iter().zip(&self.counts).filter(|(_, counts)| **counts).map(|(v, _)| *v).collect();
        let (flip_mean, flip_99) = mean_and_percentile(&counted);
        let light = self.skin.as_ref().map(|skin| {
            let light = of_skin(&test.diffuse, &skin.is_skin);
            [relative_rmse(&light, &skin.light), relative_rmse(&light, &skin.screen)]
        });
        let error = ChartError {
            flip_mean,
            flip_99,
            relative_rmse: relative_rmse(&counted_of(&shown), &counted_of(&self.pixels)),
            relative_rmse_to_surface: light.map(|l| l[0]),
            relative_rmse_to_screen: light.map(|l| l[1]),
        };
        (error, map)
    }

    /// Its map of visible differences as a picture.
    pub(super) fn save_difference(&self, path: &Path, map: &[f32]) -> Outcome {
        let image = &self.frame.image;
        output::save_picture(path, &picture(map, image.width, image.height))
    }

    /// Its diffuse light on bare skin.
    pub(super) fn save_light(&self, path: &Path, settings: &Settings) -> Outcome {
        match &self.skin {
            Some(skin) => save_light(path, &skin.diffuse, settings),
            None => Ok(()),
        }
    }
}

fn of_skin(diffuse: &[[f32; 4]], is_skin: &[bool]) -> Vec<[f32; 3]> {
    diffuse.iter().zip(is_skin).filter(|(_, s)| **s).map(|(p, _)| [p[0], p[1], p[2]]).collect()
}

/// Marks of samples for each pixel of the picture: whether all have one, and whether any has.
fn samples(marks: &[bool], settings: &Settings) -> Vec<(bool, bool)> {
    let [width, height] = settings.output.size.map(|n| n as usize);
    let n = settings.samples_per_side() as usize;
    let of = |i: usize| {
        let (x, y) = (i % width * n, i / width * n);
        let at = |s: usize| marks[(y + s / n) * width * n + x + s % n];
        ((0..n * n).all(at), (0..n * n).any(at))
    };
    (0..width * height).map(of).collect()
}

/// Pixels of the picture that show a head or lie beside one, from marks of samples.
fn head_pixels(is_head: &[bool], settings: &Settings) -> Vec<bool> {
    let any: Vec<bool> = samples(is_head, settings).into_iter().map(|(_, any)| any).collect();
    grown(&any, settings.output.size[0] as usize)
}

/// A mask and the neighbours of its pixels: an edge shows on both of its sides.
fn grown(mask: &[bool], width: usize) -> Vec<bool> {
    let height = mask.len() / width.max(1);
    let near = |n: usize, most: usize| n.saturating_sub(1)..(n + 2).min(most);
    let is_near = |i: usize| {
        let (x, y) = (i % width, i / width);
        near(y, height).any(|y| near(x, width).any(|x| mask[y * width + x]))
    };
    (0..mask.len()).map(is_near).collect()
}

/// Diffuse light of bare skin, black elsewhere.
pub(super) fn save_light(path: &Path, diffuse: &[[f32; 4]], settings: &Settings) -> Outcome {
    let values =
        diffuse.iter().flat_map(|p| if p[3] >= BARE_SKIN { [p[0], p[1], p[2]] } else { [0.0; 3] }).collect();
    let [width, height] = settings.frame_size();
    output::save_map(path, &Map { width, height, channels: 3, values }, SampleKind::F32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_grow_by_a_pixel_and_not_around_the_picture() {
        let mut mask = vec![false; 12];
        mask[3] = true;
        let grown = grown(&mask, 4);
        let found: Vec<usize> = (0..12).filter(|i| grown[*i]).collect();
        assert_eq!(found, [2, 3, 6, 7]);
    }
}
