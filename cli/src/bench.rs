//! `rubor bench`: GPU time of each pass, frames drawn back to back.
//!
//! ```text
//! moment of a sequence --each setting--> warm-up, frames --timestamps--> median and spread of each pass
//! ```

use std::path::PathBuf;

use rubor_renderer::{
    FrameTimes, Gpu, Renderer, ScatterMethod, SpecularMethod, TransmitMethod, list_adapters,
};
use rubor_rig::evaluate::Evaluator;
use rubor_rig::timeline::{Camera, Framing};
use serde::Serialize;
use serde_json::json;

use crate::antialias_method::{Antialias, parse_antialias};
use crate::failure::{Failure, Outcome};
use crate::studio::{self, Studio};
use crate::{inputs, output};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Head (.glb, .gltf) [default: the built-in head]
    #[arg(long, value_name = "FILE")]
    head: Option<PathBuf>,
    /// Sequence (.json) of which one moment is drawn [default: the demo, close enough for the head to fill the frame]
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// That moment, seconds
    #[arg(long, default_value_t = 5.0)]
    time: f64,
    /// Size of the frame in pixels
    #[arg(long, value_parser = inputs::parse_size, default_value = "1920x1080", value_name = "WxH")]
    size: [u32; 2],
    /// Scattering methods
    #[arg(long, value_delimiter = ',', default_value = "separable:17", value_name = "METHODS")]
    scatter: Vec<ScatterMethod>,
    /// Methods for light through thin parts
    #[arg(long, value_delimiter = ',', default_value = "shadow-depth", value_name = "METHODS")]
    transmit: Vec<TransmitMethod>,
    /// Highlights of skin: one-lobe or two-lobes
    #[arg(long, default_value = "one-lobe", value_name = "METHOD")]
    specular: SpecularMethod,
    /// Antialiasing methods
    #[arg(long, value_delimiter = ',', value_parser = parse_antialias, default_value = "smaa-s2x", value_name = "METHODS")]
    antialias: Vec<Antialias>,
    /// Frames that are timed
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// Frames before them that are not
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(..=10_000))]
    warm_up: u32,
    /// Factor of the light before the tone map
    #[arg(long, default_value_t = 1.8)]
    exposure: f32,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Folder for a picture of each setting
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A pass in milliseconds a frame.
#[derive(Serialize)]
struct PassCost {
    name: &'static str,
    /// Times a frame that it runs.
    runs: usize,
    median: f64,
    /// Tenth and ninetieth percentile.
    p10: f64,
    p90: f64,
}

/// A setting in milliseconds a frame.
#[derive(Serialize)]
struct Cost {
    scatter: String,
    transmit: String,
    antialias: String,
    /// From the beginning of the first pass to the end of the last.
    frame: PassCost,
    passes: Vec<PassCost>,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let loaded = inputs::head(arguments.head.as_deref())?;
    let rig = inputs::rig(None, loaded.rig.clone())?;
    let mut sequence = inputs::sequence(arguments.sequence.as_deref())?;
    if arguments.sequence.is_none() {
        sequence.camera = Camera { framing: Framing::Close, ..Camera::default() };
    }
    let (evaluator, _) = Evaluator::new(&loaded.head, &rig, &sequence)?;
    let shot = evaluator.at(arguments.time);
    let renderer = Renderer::new(Gpu::new(arguments.adapter.as_deref())?)?;
    let adapter = renderer.gpu().info.name.clone();
    if !list_adapters().iter().any(|a| a.name == adapter && a.has_timestamps) {
        return Err(Failure::job(format!("{adapter} has no timestamps, so passes cannot be timed")));
    }
    let mut studio = Studio::new(renderer, &[&loaded.head])?;
    if let Some(folder) = &arguments.output {
        output::folder(folder)?;
    }
    let mut costs = Vec::new();
    for &scatter in &arguments.scatter {
        for &transmit in &arguments.transmit {
            for &antialias in &arguments.antialias {
                let mut settings =
                    studio::settings(arguments.size, scatter, transmit, antialias, arguments.exposure);
                settings.appearance.specular = arguments.specular;
                let times = studio.measure(&shot, &settings, arguments.warm_up, arguments.frames)?;
                let cost = Cost {
                    scatter: scatter.to_string(),
                    transmit: transmit.to_string(),
                    antialias: antialias.to_string(),
                    frame: summary("frame", 1, times.iter().map(|t| t.frame_ms).collect()),
                    passes: passes(&times),
                };
                if let Some(folder) = &arguments.output {
                    let (image, _) = studio.render(std::slice::from_ref(&shot), 0.0, &settings)?;
                    let name = format!("{}_{}_{}.png", cost.scatter, cost.transmit, cost.antialias);
                    output::save_image(&folder.join(name.replace(':', "-")), &image)?;
                }
                if !arguments.json {
                    print(&cost);
                }
                costs.push(cost);
            }
        }
    }
    if arguments.json {
        let result = json!({
            "adapter": adapter,
            "size": arguments.size,
            "frames": arguments.frames,
            "unit": "milliseconds",
            "settings": costs,
        });
        println!("{}", serde_json::to_string_pretty(&result).map_err(Failure::job)?);
    } else {
        let [w, h] = arguments.size;
        println!("{adapter}, {w}x{h}, medians of {} frames back to back", arguments.frames);
    }
    Ok(())
}

/// Passes of one name added up, in the order of their first run.
fn passes(times: &[FrameTimes]) -> Vec<PassCost> {
    let Some(first) = times.first() else { return Vec::new() };
    let mut names: Vec<&'static str> = Vec::new();
    for (name, _) in &first.passes_ms {
        if !names.contains(name) {
            names.push(name);
        }
    }
    let of = |t: &FrameTimes, name: &str| -> Vec<f64> {
        t.passes_ms.iter().filter(|(n, _)| *n == name).map(|(_, ms)| *ms).collect()
    };
    names
        .into_iter()
        .map(|name| {
            summary(name, of(first, name).len(), times.iter().map(|t| of(t, name).iter().sum()).collect())
        })
        .collect()
}

fn summary(name: &'static str, runs: usize, mut ms: Vec<f64>) -> PassCost {
    ms.sort_by(f64::total_cmp);
    let at = |share: f64| ms.get(((ms.len() as f64 - 1.0) * share).round() as usize).copied().unwrap_or(0.0);
    PassCost { name, runs, median: at(0.5), p10: at(0.1), p90: at(0.9) }
}

fn print(cost: &Cost) {
    println!("{}, {}, {}", cost.scatter, cost.transmit, cost.antialias);
    for pass in cost.passes.iter().chain([&cost.frame]) {
        let runs = if pass.runs > 1 { format!(" ({} runs)", pass.runs) } else { String::new() };
        let name = format!("{}{runs}", pass.name);
        println!("  {name:28} {:9.4} ms  ({:.4} to {:.4})", pass.median, pass.p10, pass.p90);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_a_pass_are_added_within_a_frame() {
        let frame = |a: f64| FrameTimes {
            passes_ms: vec![("shadow", a), ("shade", 5.0), ("shadow", 1.0)],
            frame_ms: 9.0,
        };
        let costs = passes(&[frame(1.0), frame(2.0), frame(30.0)]);
        let found: Vec<_> = costs.iter().map(|c| (c.name, c.runs, c.median)).collect();
        assert_eq!(found, [("shadow", 2, 3.0), ("shade", 1, 5.0)]);
        assert_eq!(costs[0].p90, 31.0);
    }
}
