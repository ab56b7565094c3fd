//! `rubor chart`: cost and error of scattering methods on one frame of a sequence.

use std::path::PathBuf;

use rubor::measure::chart::{self, Options};
use rubor::{Outcome, Report, Studio, inputs};
use rubor_renderer::settings::ScatterMethod;
use rubor_rig::evaluate::Evaluator;

use super::settings_flags::{Purpose, SettingsFlags};
use super::{console, print_json};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Sequence (.json) whose first frame is drawn [default: the demo]
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// Batches of 65 536 samples of reference-surface, which includes the light through thin parts
    #[arg(long, default_value_t = 64)]
    batches: u32,
    /// Timed frames, of which the median counts; as many warm-up frames are drawn before them
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(..=10_000))]
    frames: u32,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Folder for pictures of each method, its visible differences from reference-surface, and its diffuse light (EXR)
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: SettingsFlags<Charting>,
}

#[derive(Clone, Debug)]
struct Charting;
impl Purpose for Charting {
    const LISTS: bool = true;
    const DEFAULTS: &[(&str, &str)] = &[
        ("size", "256x256"),
        ("antialias", "none"),
        (
            "scatter",
            "none,separable:9,separable:17,separable:33,screen-gauss:4,screen-gauss:6,screen-jitter,burley-disk:16,burley-disk:64,pre-integrated:1,pre-integrated:3,texture-space:1024,dipole-cubemap:16",
        ),
    ];
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let all = arguments.settings.all()?;
    ScatterMethod::ReferenceSurface(arguments.batches).validate().map_err(rubor::Failure::input)?;
    let loaded = inputs::head(None)?;
    let rig = inputs::rig(None, loaded.rig.clone())?;
    let (sequence, notes) = inputs::sequence(arguments.sequence.as_deref())?;
    console::notes(&notes);
    let (evaluator, _) = Evaluator::new(&loaded.head, &rig, &sequence)?;
    let mut studio = Studio::open(arguments.adapter.as_deref())?;
    studio.set_heads([&loaded.head])?;
    let options =
        Options { batches: arguments.batches, frames: arguments.frames, folder: arguments.output.clone() };
    let report = chart::run(&mut studio, &evaluator.at(0.0), &all, &options)?;
    if arguments.json {
        return print_json(&Report::Chart(report));
    }
    say!("noise of reference-surface: {:.4}", report.surface_noise.unwrap_or(0.0));
    say!("| method | relRMSE to reference-screen | to reference-surface | FLIP mean | 99 % | ms |");
    say!("| --- | --- | --- | --- | --- | --- |");
    for r in report.methods {
        let ms = r.scatter_ms.map_or("-".to_owned(), |ms| format!("{ms:.3}"));
        say!(
            "| `{}` | {:.4} | {:.4} | {:.4} | {:.4} | {ms} |",
            r.name,
            r.relative_rmse_to_screen,
            r.relative_rmse_to_surface,
            r.flip_mean,
            r.flip_99
        );
    }
    Ok(())
}
