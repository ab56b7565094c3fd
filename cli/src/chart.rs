//! `rubor chart`: cost and error of scattering methods on one frame of a sequence.
//!
//! ```text
//! frame --each method--> diffuse light, picture, GPU time
//!       --reference-screen, reference-surface--> truth --> relative RMSE of skin, FLIP
//! ```

use std::path::PathBuf;

use rubor_assets::compare::{Pixels, flip, mean_and_percentile, relative_rmse};
use rubor_assets::image_io::{SampleKind, save_image};
use rubor_renderer::antialias::Mode;
use rubor_renderer::{BARE_SKIN, Gpu, Image, Renderer, ScatterMethod, TransmitMethod};
use rubor_rig::color::srgb_decode;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::map::Map;
use serde::Serialize;

use crate::antialias_method::Antialias;
use crate::compare::difference_picture;
use crate::failure::{Failure, Outcome};
use crate::studio::{self, Studio};
use crate::{inputs, output};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Sequence (.json) whose first frame is drawn [default: the demo]
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// Size of the frame in pixels
    #[arg(long, value_parser = inputs::parse_size, default_value = "256x256", value_name = "WxH")]
    size: [u32; 2],
    /// Methods to chart, by name
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "none,separable:9,separable:17,separable:33,screen-gauss:4,screen-gauss:6,screen-jitter,burley-disk:16,burley-disk:64"
    )]
    scatter: Vec<ScatterMethod>,
    /// Light through thin parts, for all methods but reference-surface, which holds it
    #[arg(long, default_value = "shadow-depth", value_name = "METHOD")]
    transmit: TransmitMethod,
    /// Batches of 65 536 samples of reference-surface
    #[arg(long, default_value_t = 64)]
    batches: u32,
    /// Frames of which the GPU time is the median; as many are drawn before them
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(..=10_000))]
    frames: u32,
    /// Factor of the light before the tone map
    #[arg(long, default_value_t = 1.8)]
    exposure: f32,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Folder for pictures of each method, its visible differences from reference-surface, and its diffuse light (EXR)
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A method in numbers.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Row {
    scatter: String,
    /// Of diffuse radiance before albedo, on skin.
    relative_rmse_to_screen: f64,
    relative_rmse_to_surface: f64,
    /// FLIP of the displayed picture, over skin.
    flip_mean: f64,
    #[serde(rename = "flip99")]
    flip_99: f64,
    /// GPU milliseconds of scattering; none without timestamps.
    scatter_ms: Option<f64>,
}

/// What one method draws.
struct Drawn {
    diffuse: Vec<[f32; 4]>,
    image: Image,
    scatter_ms: Option<f64>,
    noise: Option<f64>,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let loaded = inputs::head(None)?;
    let rig = inputs::rig(None, loaded.rig.clone())?;
    let sequence = inputs::sequence(arguments.sequence.as_deref())?;
    let (evaluator, _) = Evaluator::new(&loaded.head, &rig, &sequence)?;
    let shots = [evaluator.at(0.0)];
    let renderer = Renderer::new(Gpu::new(arguments.adapter.as_deref())?)?;
    let mut studio = Studio::new(renderer, &[&loaded.head])?;
    let mut draw = |scatter: ScatterMethod, transmit: TransmitMethod, frames: u32| -> Outcome<Drawn> {
        let none = Antialias::Filter(Mode::None);
        let settings = studio::settings(arguments.size, scatter, transmit, none, arguments.exposure);
        let (image, stats) = studio.render(&shots, 0.0, &settings)?;
        let mut times = Vec::new();
        if frames > 0 {
            let of_scatter = |(name, _): &&(&'static str, f64)| name.starts_with("scatter");
            // As many frames before, so that the clock is up.
            for frame in studio.measure(&shots[0], &settings, frames, frames)? {
                times.push(frame.passes_ms.iter().filter(of_scatter).fold(0.0, |sum, (_, ms)| sum + ms));
            }
        }
        times.sort_by(f64::total_cmp);
        let scatter_ms = times.get(times.len() / 2).copied();
        let diffuse = studio.renderer.read_diffuse()?;
        Ok(Drawn { diffuse, image, scatter_ms, noise: stats.scatter_noise })
    };
    let screen = draw(ScatterMethod::ReferenceScreen, arguments.transmit, 0)?;
    let surface = draw(ScatterMethod::ReferenceSurface(arguments.batches), TransmitMethod::None, 0)?;
    let is_skin: Vec<bool> = surface.diffuse.iter().map(|p| p[3] >= BARE_SKIN).collect();
    if let Some(folder) = &arguments.output {
        output::folder(folder)?;
        output::save_image(&folder.join("reference-surface.png"), &surface.image)?;
        save_light(folder.join("reference-surface.exr"), &surface)?;
    }
    let mut rows = Vec::new();
    let references = [("reference-screen".to_owned(), Some(screen))];
    let methods = arguments.scatter.iter().map(|m| (m.to_string(), None));
    let mut screen_diffuse = Vec::new();
    for (name, drawn) in references.into_iter().chain(methods) {
        let drawn = match drawn {
            Some(drawn) => {
                screen_diffuse = on_skin(&drawn.diffuse, &is_skin);
                drawn
            }
            None => draw(name.parse()?, arguments.transmit, arguments.frames)?,
        };
        let diffuse = on_skin(&drawn.diffuse, &is_skin);
        let map = flip::ldr(&pixels(&drawn.image), &pixels(&surface.image), flip::PIXELS_PER_DEGREE);
        let skin_map: Vec<f32> = map.iter().zip(&is_skin).filter(|(_, s)| **s).map(|(v, _)| *v).collect();
        let (flip_mean, flip_99) = mean_and_percentile(&skin_map);
        if let Some(folder) = &arguments.output {
            let file = name.replace(':', "-");
            output::save_image(&folder.join(format!("{file}.png")), &drawn.image)?;
            save_light(folder.join(format!("{file}.exr")), &drawn)?;
            let picture = difference_picture(&map, drawn.image.width, drawn.image.height);
            let path = folder.join(format!("{file}-difference.png"));
            output::commit(&path, |partial| picture.save(partial).map_err(std::io::Error::other))?;
        }
        rows.push(Row {
            scatter: name,
            relative_rmse_to_screen: relative_rmse(&diffuse, &screen_diffuse),
            relative_rmse_to_surface: relative_rmse(&diffuse, &on_skin(&surface.diffuse, &is_skin)),
            flip_mean,
            flip_99,
            scatter_ms: drawn.scatter_ms,
        });
    }
    if arguments.json {
        let result = serde_json::json!({ "surfaceNoise": surface.noise, "methods": rows });
        println!("{}", serde_json::to_string_pretty(&result).map_err(Failure::job)?);
        return Ok(());
    }
    println!("noise of reference-surface: {:.4}", surface.noise.unwrap_or(0.0));
    println!("| method | relRMSE to reference-screen | to reference-surface | FLIP mean | 99 % | ms |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for r in rows {
        let ms = r.scatter_ms.map_or("-".to_owned(), |ms| format!("{ms:.3}"));
        println!(
            "| `{}` | {:.4} | {:.4} | {:.4} | {:.4} | {ms} |",
            r.scatter, r.relative_rmse_to_screen, r.relative_rmse_to_surface, r.flip_mean, r.flip_99
        );
    }
    Ok(())
}

fn on_skin(diffuse: &[[f32; 4]], is_skin: &[bool]) -> Vec<[f32; 3]> {
    diffuse.iter().zip(is_skin).filter(|(_, s)| **s).map(|(p, _)| [p[0], p[1], p[2]]).collect()
}

fn pixels(image: &Image) -> Pixels {
    let decode = |p: &[u8]| std::array::from_fn(|c| srgb_decode(f32::from(p[c]) / 255.0));
    Pixels {
        width: image.width as usize,
        height: image.height as usize,
        linear: image.rgba.chunks_exact(4).map(decode).collect(),
    }
}

/// Diffuse light of bare skin, black elsewhere.
fn save_light(path: PathBuf, drawn: &Drawn) -> Outcome {
    let values = drawn
        .diffuse
        .iter()
        .flat_map(|p| if p[3] >= BARE_SKIN { [p[0], p[1], p[2]] } else { [0.0; 3] })
        .collect();
    let map = Map { width: drawn.image.width, height: drawn.image.height, channels: 3, values };
    save_image(&path, &map, SampleKind::F32).map_err(Failure::job)
}
