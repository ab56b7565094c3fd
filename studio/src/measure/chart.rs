//! Cost and error of scattering methods on one frame.
//!
//! ```text
//! shot --each settings--> diffuse light, picture, GPU time
//!      --reference-screen, reference-surface--> truth --> relative RMSE of skin, FLIP
//! ```

use std::path::{Path, PathBuf};

use rubor_assets::compare::{flip, mean_and_percentile, relative_rmse};
use rubor_assets::image_io::SampleKind;
use rubor_renderer::BARE_SKIN;
use rubor_renderer::channels::Channel;
use rubor_renderer::settings::{ScatterMethod, Settings, Stage, TransmitMethod};
use rubor_rig::evaluate::Shot;
use rubor_rig::map::Map;

use super::difference::{picture, pixels};
use super::{file_name, names};
use crate::error::Outcome;
use crate::output;
use crate::report::{ChartReport, ChartRow, median};
use crate::studio::{Frame, Studio};

/// Options of a chart.
#[derive(Clone, Debug)]
pub struct Options {
    /// Batches of 65 536 samples of `reference-surface`.
    pub batches: u32,
    /// Timed frames, of which the median counts; as many warm-up frames are drawn before them.
    pub frames: u32,
    /// Folder for pictures of each method, its visible differences from `reference-surface`, and its diffuse light.
    pub folder: Option<PathBuf>,
}

/// The reference for all settings that differ only in scattering and transmittance.
struct Truth {
    /// The settings with which `reference-surface` was drawn.
    settings: Settings,
    surface: Frame,
    diffuse: Vec<[f32; 4]>,
    /// Mask of the frame's own pixels.
    is_skin: Vec<bool>,
    /// Mask of the picture's pixels: all averaged pixels are skin.
    is_skin_in_picture: Vec<bool>,
}

/// Charts settings on a shot of the one head of a studio. A row before the first of the settings that differ in
/// scattering only gives the error of `reference-screen` against `reference-surface`.
///
/// # Errors
/// Errors of the studio; files that cannot be written.
pub fn run(studio: &mut Studio, shot: &Shot, all: &[Settings], options: &Options) -> Outcome<ChartReport> {
    let shots = std::slice::from_ref(shot);
    if let Some(folder) = &options.folder {
        output::folder(folder)?;
    }
    // Rows in their order, each with the index of its references.
    let mut truths: Vec<Truth> = Vec::new();
    let mut screens: Vec<(Settings, Vec<[f32; 3]>)> = Vec::new();
    let mut rows = Vec::new();
    let screen_of = |settings: &Settings| {
        let mut screen = settings.clone();
        screen.quality.scatter = ScatterMethod::ReferenceScreen;
        screen
    };
    let mut listed: Vec<Settings> = Vec::new();
    for settings in all {
        let screen = screen_of(settings);
        if !listed.contains(&screen) {
            listed.push(screen);
        }
        listed.push(settings.clone());
    }
    let surface_names =
        names(&listed.iter().map(|s| surface_of(s, options.batches)).collect::<Vec<_>>(), &[]);
    let names = names(&listed, &["scatter"]);
    for ((settings, name), surface_name) in listed.iter().zip(names).zip(surface_names) {
        let wanted = surface_of(settings, options.batches);
        if !truths.iter().any(|t| t.settings == wanted) {
            let truth = Truth::draw(studio, shots, wanted.clone())?;
            if let Some(folder) = &options.folder {
                let name = match surface_name.as_str() {
                    "" => "reference-surface".to_owned(),
                    differs => format!("reference-surface_{}", file_name(differs)),
                };
                output::save_picture(&folder.join(format!("{name}.png")), &truth.surface.picture())?;
                save_light(&folder.join(format!("{name}.exr")), &truth.diffuse, &wanted)?;
            }
            truths.push(truth);
        }
        let Some(truth) = truths.iter().find(|t| t.settings == wanted) else { continue };
        let is_reference = settings.quality.scatter == ScatterMethod::ReferenceScreen;
        let (frame, diffuse) = draw(studio, shots, settings)?;
        let on_skin = |diffuse: &[[f32; 4]]| -> Vec<[f32; 3]> {
            let skin = diffuse.iter().zip(&truth.is_skin).filter(|(_, s)| **s);
            skin.map(|(p, _)| [p[0], p[1], p[2]]).collect()
        };
        let light = on_skin(&diffuse);
        let screen = screen_of(settings);
        if is_reference && !screens.iter().any(|(s, _)| *s == screen) {
            screens.push((screen.clone(), light.clone()));
        }
        let map = flip::ldr(&pixels(&frame.image), &pixels(&truth.surface.image), flip::PIXELS_PER_DEGREE);
        let skin_map: Vec<f32> =
            map.iter().zip(&truth.is_skin_in_picture).filter(|(_, s)| **s).map(|(v, _)| *v).collect();
        let (flip_mean, flip_99) = mean_and_percentile(&skin_map);
        if let Some(folder) = &options.folder {
            let file = file_name(&name);
            output::save_picture(&folder.join(format!("{file}.png")), &frame.picture())?;
            save_light(&folder.join(format!("{file}.exr")), &diffuse, settings)?;
            let visible = picture(&map, frame.image.width, frame.image.height);
            output::save_picture(&folder.join(format!("{file}-difference.png")), &visible)?;
        }
        let right = screens.iter().find(|(s, _)| *s == screen).map_or(&[][..], |(_, light)| light);
        let scatter_ms =
            if is_reference { None } else { scatter_ms(studio, shot, settings, options.frames)? };
        rows.push(ChartRow {
            name,
            settings: settings.clone(),
            relative_rmse_to_screen: relative_rmse(&light, right),
            relative_rmse_to_surface: relative_rmse(&light, &on_skin(&truth.diffuse)),
            flip_mean,
            flip_99,
            scatter_ms,
        });
    }
    let noise = truths.iter().filter_map(|t| t.surface.stats.scatter_noise);
    Ok(ChartReport { adapter: studio.adapter(), surface_noise: noise.reduce(f64::max), methods: rows })
}

/// The integral over the surface includes the light from behind.
fn surface_of(settings: &Settings, batches: u32) -> Settings {
    let mut surface = settings.clone();
    surface.quality.scatter = ScatterMethod::ReferenceSurface(batches);
    surface.quality.transmit = TransmitMethod::None;
    surface
}

impl Truth {
    fn draw(studio: &mut Studio, shots: &[Shot], settings: Settings) -> Outcome<Self> {
        let (surface, diffuse) = draw(studio, shots, &settings)?;
        let is_skin: Vec<bool> = diffuse.iter().map(|p| p[3] >= BARE_SKIN).collect();
        let n = settings.samples_per_side() as usize;
        let [width, height] = settings.output.size.map(|n| n as usize);
        let all_skin = |i: usize| {
            let (x, y) = (i % width * n, i / width * n);
            (0..n * n).all(|s| is_skin[(y + s / n) * width * n + x + s % n])
        };
        let is_skin_in_picture = (0..width * height).map(all_skin).collect();
        Ok(Self { settings, surface, diffuse, is_skin, is_skin_in_picture })
    }
}

/// A frame, and its diffuse light before albedo with the strength of scattering.
fn draw(studio: &mut Studio, shots: &[Shot], settings: &Settings) -> Outcome<(Frame, Vec<[f32; 4]>)> {
    let mut settings = settings.clone();
    settings.output.channels = vec![Channel::Diffuse, Channel::Albedo];
    studio.cut(0);
    let frame = studio.render(shots, 0.0, &settings)?;
    // The fourth component of the diffuse light is for the methods on the screen.
    let diffuse = match frame.channels.as_slice() {
        [diffuse, albedo] => (diffuse.texels::<4>().zip(albedo.texels::<4>()))
            .map(|(light, albedo)| [light[0], light[1], light[2], albedo[3]])
            .collect(),
        _ => Vec::new(),
    };
    Ok((frame, diffuse))
}

/// Median GPU time of scattering; none without timestamps. A method that works while surfaces are lit has the time by which
/// that takes longer than without scattering.
fn scatter_ms(studio: &mut Studio, shot: &Shot, settings: &Settings, frames: u32) -> Outcome<Option<f64>> {
    if frames == 0 || matches!(settings.quality.scatter, ScatterMethod::ReferenceSurface(_)) {
        return Ok(None);
    }
    let is_in_shade = settings.quality.scatter.method().stage == Stage::Shading;
    let scatter = passes_ms(studio, shot, settings, frames, &|name| {
        name.starts_with("scatter") || (is_in_shade && name == "shade")
    })?;
    if !is_in_shade {
        return Ok(scatter);
    }
    let mut plain = settings.clone();
    plain.quality.scatter = ScatterMethod::None;
    let plain = passes_ms(studio, shot, &plain, frames, &|name| name == "shade")?;
    Ok(scatter.zip(plain).map(|(with, without)| with - without))
}

/// Median of the sum of some passes of a frame.
fn passes_ms(
    studio: &mut Studio,
    shot: &Shot,
    settings: &Settings,
    frames: u32,
    counts: &dyn Fn(&str) -> bool,
) -> Outcome<Option<f64>> {
    // As many warm-up frames, which raise the clock of the device.
    let times = studio.measure(std::slice::from_ref(shot), 0.0, settings, frames, frames)?;
    let mut ms: Vec<f64> = times
        .iter()
        .map(|t| t.passes_ms.iter().filter(|(name, _)| counts(name)).fold(0.0, |sum, (_, ms)| sum + ms))
        .collect();
    Ok(median(&mut ms))
}

/// Diffuse light of bare skin, black elsewhere.
fn save_light(path: &Path, diffuse: &[[f32; 4]], settings: &Settings) -> Outcome {
    let values =
        diffuse.iter().flat_map(|p| if p[3] >= BARE_SKIN { [p[0], p[1], p[2]] } else { [0.0; 3] }).collect();
    let [width, height] = settings.frame_size();
    output::save_map(path, &Map { width, height, channels: 3, values }, SampleKind::F32)
}
