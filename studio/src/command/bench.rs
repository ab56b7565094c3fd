//! `rubor bench`: GPU time of each pass, of frames drawn back to back.

use std::path::PathBuf;

use rubor::measure::bench::{self, Crowd, Frames};
use rubor::measure::file_name;
use rubor::report::BenchRow;
use rubor::{Outcome, Report, inputs, output, plan};
use rubor_renderer::MAX_HEADS;
use rubor_rig::evaluate::Evaluator;
use rubor_rig::timeline::{Camera, Framing};

use super::settings_flags::{Purpose, SettingsFlags};
use super::{console, print_json};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Head (.glb, .gltf, .vrm, .obj, .usda, .usdz) [default: the built-in head]
    #[arg(long, value_name = "FILE")]
    head: Option<PathBuf>,
    /// Sequence (.json) of which one frame is drawn [default: the demo, close enough for the head to fill the frame]
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// Time of that frame, seconds
    #[arg(long, default_value_t = 5.0, value_parser = parse_time)]
    time: f64,
    /// Numbers of copies of the head side by side, all in view (1 to 31); several with commas between
    #[arg(long, value_name = "N", default_value = "1", value_delimiter = ',', value_parser = parse_heads)]
    heads: Vec<usize>,
    /// Timed frames
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// Warm-up frames before them, not timed
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(..=10_000))]
    warm_up: u32,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Folder for a picture of each combination of settings
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: SettingsFlags<Timing>,
}

fn parse_time(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|t| t.is_finite() && *t >= 0.0);
    number.ok_or_else(|| format!("found {text:?}, expected a time in seconds, 0 or more"))
}

fn parse_heads(text: &str) -> Result<usize, String> {
    let number = text.parse::<usize>().ok().filter(|n| (1..=MAX_HEADS).contains(n));
    number.ok_or_else(|| format!("found {text:?}, expected a number of heads from 1 to {MAX_HEADS}"))
}

#[derive(Clone, Debug)]
struct Timing;
impl Purpose for Timing {
    const LISTS: bool = true;
    const DEFAULTS: &[(&str, &str)] = &[("size", "1920x1080")];
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let all = arguments.settings.all()?;
    let loaded = inputs::head(arguments.head.as_deref())?;
    console::notes(&loaded.notes);
    let rig = inputs::rig(None, loaded.rig.clone())?;
    let (mut sequence, notes) = inputs::sequence(arguments.sequence.as_deref())?;
    console::notes(&notes);
    if arguments.sequence.is_none() {
        sequence.camera = Camera { framing: Framing::Close, ..Camera::default() };
    }
    let (evaluator, _) = Evaluator::new(&loaded.head, &rig, &sequence)?;
    let shot = evaluator.at(arguments.time);
    let mut studio = super::open_studio(arguments.adapter.as_deref())?;
    if let Some(folder) = &arguments.output {
        output::folder(folder)?;
    }
    let frames = Frames { timed: arguments.frames, warm_up: arguments.warm_up };
    let crowd = Crowd { head: &loaded.head, shot: &shot, counts: &arguments.heads };
    let report = bench::run(&mut studio, &crowd, &all, frames, |row, studio, shots| {
        if let Some(folder) = &arguments.output {
            studio.cut(0);
            let frame = studio.render(shots, plan::spacing_m([&loaded.head]), &row.settings)?;
            output::save_picture(&folder.join(format!("{}.png", file_name(&row.name))), &frame.picture())?;
        }
        if arguments.json { Ok(()) } else { print(row) }
    })?;
    if arguments.json {
        return print_json(&Report::Bench(report));
    }
    say!("{}, medians of {} frames back to back", report.adapter.name, report.frames);
    Ok(())
}

fn print(row: &BenchRow) -> Outcome {
    let [width, height] = row.settings.output.size;
    say!("{}, {width}x{height}", row.name);
    for pass in row.passes.iter().chain([&row.frame]) {
        let runs = if pass.runs > 1 { format!(" ({} runs)", pass.runs) } else { String::new() };
        let name = format!("{}{runs}", pass.name);
        say!("  {name:28} {:9.4} ms  ({:.4} to {:.4})", pass.median, pass.p10, pass.p90);
    }
    Ok(())
}
