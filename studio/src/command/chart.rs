//! `rubor chart`: cost and error of every choice of a frame, in a suite of scenes.

use std::path::{Path, PathBuf};

use rubor::auto::measured::{self, Measured};
use rubor::auto::{Auto, Bound, Calibration, experiment, unseen_shots};
use rubor::measure::chart::{self, Effort, Measure, Options, RightLight, Suite, Timing, page, plot::number};
use rubor::measure::stability;
use rubor::measure::volume::{self, MediumName};
use rubor::report::{ChartError, ChartGroup, ChartReport, StabilityReport};
use rubor::{Failure, Outcome, Report, Studio, Watch, inputs, output};
use rubor_renderer::settings::{ScatterMethod, Settings};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::json;
use serde_json::Value;

use super::console::Progress;
use super::settings_flags::{Choices, Purpose, SettingsFlags};
use super::{console, print_json};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Scenes and methods: quick has six scenes and the common methods, whole has everything [default: whole; quick on a
    /// software device]
    #[arg(long, value_name = "NAME", value_parser = ["quick", "whole"])]
    suite: Option<String>,
    /// Head (.glb, .gltf, .vrm, .obj, .usda, .usdz) [default: the built-in head]
    #[arg(long, value_name = "FILE")]
    head: Option<PathBuf>,
    /// Sequences (.json) whose first frames are drawn in place of the suite's scenes; may be given again
    #[arg(long, value_name = "FILE")]
    sequence: Vec<PathBuf>,
    /// Batches of 65 536 samples of reference-surface [default: 64; 8 for quick]
    #[arg(long, value_name = "N")]
    batches: Option<u32>,
    /// Samples on a side of a pixel of the picture that counts as right for antialiasing [default: 8; 4 for quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=8))]
    samples: Option<u32>,
    /// Timed frames of a choice in a scene and a round; 0 times nothing [default: 20; 2 for quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(..=10_000))]
    frames: Option<u32>,
    /// Rounds in which all choices take turns [default: 3; 2 for quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100))]
    rounds: Option<u32>,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Folder for the chart: index.html, chart.svg, chart.csv, chart.json, and pictures of each choice, of the truths and of
    /// visible differences; with --sequence the diffuse light too (EXR)
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Draw the page of a chart that was measured before: its chart.json or volume.json
    #[arg(long, value_name = "FILE", requires = "output", conflicts_with_all = ["sequence", "head", "stability", "calibrate", "auto"])]
    from: Option<PathBuf>,
    /// In place of time and error: what methods do while one quantity moves in small steps (stability.svg, .csv, .json)
    #[arg(long, conflicts_with = "sequence")]
    stability: bool,
    /// Steps of each sweep of --stability [default: 24; 8 for quick]
    #[arg(long, value_name = "N", requires = "stability", value_parser = clap::value_parser!(u32).range(3..=1000))]
    steps: Option<u32>,
    /// In place of a chart: measure this device for --max-error and --budget-ms of `render`, on random shots of the head, and
    /// keep the estimates
    #[arg(long, conflicts_with_all = ["sequence", "stability"])]
    calibrate: bool,
    /// Random shots: of --calibrate [default: 64; 24 for quick], or of --auto in place of the suite, others than those
    #[arg(long, value_name = "N", conflicts_with_all = ["stability", "volume", "sequence"],
        value_parser = clap::value_parser!(u32).range(16..=4096))]
    shots: Option<u32>,
    /// In place of a chart: how well --max-error chooses in the suite's scenes, in random shots (--shots), or in 12 frames of each
    /// --sequence, beside every fixed setting; what flags say is not chosen
    #[arg(long, conflicts_with_all = ["stability", "calibrate"])]
    auto: bool,
    /// Heads side by side in the sequences of --auto, each further in the sequence than its neighbour
    #[arg(long, value_name = "N", requires_all = ["auto", "sequence"], default_value_t = 1,
        value_parser = clap::value_parser!(u8).range(1..=64))]
    heads: u8,
    /// In place of a chart: light of scattering methods beside paths traced through the volume of the head (index.html, volume.json,
    /// volume.csv, stills.csv, pictures, and the right light of each still, which a later run with the same options reads again)
    #[arg(long, conflicts_with_all = ["stability", "calibrate", "auto", "from"])]
    volume: bool,
    /// Paths of a pixel of --volume [default: 256; 64 for quick]
    #[arg(long, value_name = "N", requires = "volume", value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    paths: Option<u32>,
    /// Skin of --volume (Jensen et al. 2001)
    #[arg(long, value_name = "NAME", requires = "volume", default_value = "skin1", value_parser = ["skin1", "skin2"])]
    medium: String,
    /// Stills of --volume by name; may be given again [default: all]
    #[arg(long, value_name = "NAME", requires = "volume")]
    still: Vec<String>,
    /// In place of methods: write the stills of --volume for Mitsuba and Cycles (see tests/interchange/volume.sh)
    #[arg(long, requires_all = ["volume", "output"])]
    export: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: SettingsFlags<Charting>,
}

impl Arguments {
    fn rounds(&self, is_quick: bool) -> u32 {
        self.rounds.unwrap_or(if is_quick { 2 } else { 3 })
    }
}

#[derive(Clone, Debug)]
struct Charting;
impl Purpose for Charting {
    const LISTS: bool = true;
    // Antialiasing would soften what the other groups compare.
    const DEFAULTS: &[(&str, &str)] = &[("antialias", "none"), ("size", SIZE)];
}
const SIZE: &str = "384x384";
const QUICK_SIZE: [u32; 2] = [128, 128];
const VOLUME_SIZE: [u32; 2] = [160, 160];
/// Paths of a pixel of stills for other programs.
const EXPORTED_PATHS: u32 = 1024;

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    if let (Some(path), Some(folder)) = (&arguments.from, &arguments.output) {
        return draw_again(path, folder);
    }
    if arguments.shots.is_some() && !arguments.calibrate && !arguments.auto {
        return Err(Failure::input("--shots: found it alone, expected it with --calibrate or --auto"));
    }
    let Choices { mut base, listed, held } = arguments.settings.choices()?;
    let has_size = held.iter().chain(listed.iter().map(|(flag, _)| flag)).any(|flag| flag == "size");
    let loaded = inputs::head(arguments.head.as_deref())?;
    console::notes(&loaded.notes);
    let rig = inputs::rig(None, loaded.rig.clone())?;
    if arguments.volume {
        if !has_size {
            base.output.size = VOLUME_SIZE;
        }
        return measure_volume(arguments, &loaded.head, &rig, &base, &listed);
    }
    let mut studio = super::open_studio(arguments.adapter.as_deref())?;
    let is_quick = arguments.suite.as_deref().map_or(studio.is_software(), |name| name == "quick");
    let (suite, [batches, samples, frames]) =
        if is_quick { (Suite::Quick, [8, 4, 2]) } else { (Suite::Whole, [64, 8, 20]) };
    if is_quick && !has_size {
        base.output.size = QUICK_SIZE;
    }
    let batches = arguments.batches.unwrap_or(batches);
    ScatterMethod::ReferenceSurface(batches).validate().map_err(Failure::input)?;
    let effort =
        Effort { light: RightLight::Surface(batches), samples: arguments.samples.unwrap_or(samples) };
    if arguments.calibrate {
        return calibrate(arguments, &mut studio, &loaded.head, &rig, &base, is_quick);
    }
    if arguments.auto {
        let timing = experiment::Timing {
            rounds: arguments.rounds(is_quick),
            frames: arguments.frames.unwrap_or(5).max(1),
        };
        return judge(arguments, &mut studio, &loaded.head, &rig, (&base, held), suite, timing);
    }
    let groups = chart::groups(suite, &base, &listed, &held, effort)?;
    let frames = arguments.frames.unwrap_or(frames);
    if let Some(folder) = &arguments.output {
        output::folder(folder)?;
    }
    studio.set_heads([&loaded.head])?;
    let mut progress = Progress::default();
    if arguments.stability {
        let steps = arguments.steps.unwrap_or(if is_quick { 8 } else { 24 }) as usize;
        let [width, height] = base.output.size;
        let sweeps = stability::sweeps(&loaded.head, &rig, steps, width.min(height))?;
        let options = stability::Options { samples: effort.samples.min(4), frames };
        let groups: Vec<_> = groups.into_iter().filter(|g| MOVING.contains(&g.flag.as_str())).collect();
        if groups.is_empty() {
            let expected = format!("several values of one of --{}", MOVING.join(", --"));
            return Err(Failure::input(format!(
                "--stability: found nothing that may flicker, expected {expected}"
            )));
        }
        let report =
            stability::run(&mut studio, &loaded.head, &base, &sweeps, &groups, options, &mut progress);
        progress.end();
        return tell_stability(arguments, report?);
    }
    let mut scenes = own_scenes(arguments, &loaded.head, &rig)?;
    if scenes.is_empty() {
        let (found, notes) = chart::scenes(suite, &loaded.head, &rig)?;
        console::notes(&notes);
        scenes = found;
    }
    let timing = timing(arguments.rounds(is_quick), frames);
    let options = Options {
        timing: Some(timing).filter(|t| t.frames > 0),
        folder: arguments.output.clone(),
        light: !arguments.sequence.is_empty(),
    };
    let report = chart::run(&mut studio, &base, &scenes, &groups, &options, &mut progress);
    progress.end();
    console::notes(&studio.take_notes());
    let report = report?;
    let page = arguments.output.as_deref().map(|folder| page::write(folder, &report)).transpose()?;
    if arguments.json {
        return print_json(&Report::Chart(report));
    }
    print(&report)?;
    if let Some(page) = page {
        say!("{}", page.display());
    }
    Ok(())
}

/// Scenes of the user.
fn own_scenes(arguments: &Arguments, head: &Head, rig: &Rig) -> Outcome<Vec<chart::Scene>> {
    let mut scenes = Vec::new();
    for path in &arguments.sequence {
        let (scene, notes) = chart::scene_of(path, head, rig)?;
        console::notes(&notes);
        scenes.push(scene);
    }
    Ok(scenes)
}

fn measure_volume(
    arguments: &Arguments,
    head: &Head,
    rig: &Rig,
    base: &Settings,
    listed: &[(String, Vec<Value>)],
) -> Outcome {
    let suite = if arguments.suite.as_deref() == Some("quick") { Suite::Quick } else { Suite::Whole };
    let mut stills = own_scenes(arguments, head, rig)?;
    if stills.is_empty() {
        let (found, notes) = volume::stills(suite, head, rig)?;
        console::notes(&notes);
        stills = found;
    }
    if !arguments.still.is_empty() {
        let names: Vec<String> = stills.iter().map(|s| s.name.clone()).collect();
        if let Some(name) = arguments.still.iter().find(|name| !names.contains(name)) {
            return Err(Failure::input(format!(
                "--still: found {name:?}, expected one of {}",
                names.join(", ")
            )));
        }
        stills.retain(|still| arguments.still.contains(&still.name));
    }
    let medium = if arguments.medium == "skin2" { MediumName::Skin2 } else { MediumName::Skin1 };
    if let Some(folder) = &arguments.output {
        output::folder(folder)?;
    }
    let mut progress = Progress::default();
    if let (true, Some(folder)) = (arguments.export, &arguments.output) {
        let (size, paths) = (base.output.size, arguments.paths.unwrap_or(EXPORTED_PATHS));
        let written = volume::export::write(folder, head, &stills, medium, size, paths, &mut progress);
        progress.end();
        written?;
        say!("{}", folder.display());
        return Ok(());
    }
    let mut studio = super::open_studio(arguments.adapter.as_deref())?;
    let [batches, paths] = if suite == Suite::Quick { [8, 64] } else { [16, 256] };
    let batches = arguments.batches.unwrap_or(batches);
    ScatterMethod::ReferenceSurface(batches).validate().map_err(Failure::input)?;
    let base = medium.settings(base)?;
    let choices = volume::choices(&base, listed, batches)?;
    let options =
        volume::Options { medium, paths: arguments.paths.unwrap_or(paths), folder: arguments.output.clone() };
    let report = volume::run(&mut studio, head, &base, &stills, &choices, &options, &mut progress);
    progress.end();
    console::notes(&studio.take_notes());
    let report = report?;
    let page = arguments.output.as_deref().map(|folder| volume::page::write(folder, &report)).transpose()?;
    if arguments.json {
        return print_json(&Report::Volume(report));
    }
    say!("{}", volume::page::about(&report));
    say!("| method | {} |", volume::page::COLUMNS.join(" | "));
    say!("| --- | {} |", ["---"; volume::page::COLUMNS.len()].join(" | "));
    for choice in &report.choices {
        say!("| `{}` | {} |", choice.name, volume::page::cells(choice).join(" | "));
    }
    if let Some(page) = page {
        say!("{}", page.display());
    }
    Ok(())
}

/// The page of a report.
fn draw_again(path: &Path, folder: &Path) -> Outcome {
    let text = json::read_text(path)?;
    match serde_json::from_str(&text) {
        Ok(Report::Chart(report)) => {
            output::folder(folder)?;
            say!("{}", page::write(folder, &report)?.display());
            Ok(())
        }
        Ok(Report::Volume(report)) => {
            output::folder(folder)?;
            say!("{}", volume::page::write(folder, &report)?.display());
            Ok(())
        }
        Ok(_) => {
            Err(Failure::input(format!("{}: found another report, expected that of a chart", path.display())))
        }
        Err(e) => Err(Failure::input(format!("{}: {e}, expected chart.json of a chart", path.display()))),
    }
}

fn calibrate(
    arguments: &Arguments,
    studio: &mut Studio,
    head: &Head,
    rig: &Rig,
    base: &Settings,
    is_quick: bool,
) -> Outcome {
    let [shots, samples, frames] = if is_quick { [24, 4, 2] } else { [64, 8, 20] };
    let options = measured::Options {
        shots: arguments.shots.unwrap_or(shots) as usize,
        samples: arguments.samples.unwrap_or(samples),
        timing: timing(arguments.rounds(is_quick), arguments.frames.unwrap_or(frames)),
        large: if is_quick { [256, 256] } else { [1280, 720] },
    };
    let mut progress = Progress::default();
    let measured = measured::run(studio, head, rig, base, &options, &mut progress);
    progress.end();
    let Measured { calibration, features, report } = measured?;
    let kept = calibration.keep()?;
    if let Some(folder) = &arguments.output {
        output::folder(folder)?;
        output::write_json(&folder.join("auto.json"), &calibration)?;
        output::write_json(&folder.join("auto-shots.json"), &(&features, &Report::Chart(report.clone())))?;
    }
    if arguments.json {
        return print_json(&calibration);
    }
    print(&report)?;
    match kept {
        Some(file) => say!("kept for {}: {}", calibration.adapter.name, file.display()),
        None => say!("not kept: this system names no folder for data"),
    }
    Ok(())
}

fn timing(rounds: u32, frames: u32) -> Timing {
    Timing { rounds, warm_up: frames.div_ceil(2), frames }
}

/// Frames of a sequence that --auto looks at.
const FRAMES_OF_SEQUENCE: u32 = 12;
/// Bounds under which choices are judged.
const BOUNDS: [f64; 5] = [0.005, 0.01, 0.02, 0.04, 0.08];

fn judge(
    arguments: &Arguments,
    studio: &mut Studio,
    head: &Head,
    rig: &Rig,
    (base, held): (&Settings, Vec<String>),
    suite: Suite,
    timing: experiment::Timing,
) -> Outcome {
    let (mut scenes, mut notes) = (Vec::new(), Vec::new());
    for path in &arguments.sequence {
        let heads = usize::from(arguments.heads);
        let (frames, found) = chart::frames_of(path, head, rig, FRAMES_OF_SEQUENCE, heads)?;
        scenes.extend(frames);
        notes.extend(found);
    }
    if let Some(count) = arguments.shots {
        scenes = unseen_shots(head, rig, count as usize)?;
    }
    if scenes.is_empty() {
        (scenes, notes) = chart::scenes(suite, head, rig)?;
    }
    console::notes(&notes);
    let name = studio.adapter().name;
    let (calibration, notes) = Calibration::of_devices([name.as_str()])?;
    console::notes(&notes);
    let auto = Auto { bound: Bound::Flip(1.0), held, calibration };
    studio.set_heads(std::iter::repeat_n(head, usize::from(arguments.heads)))?;
    let mut progress = Progress::default();
    let measured = experiment::measured(studio, head, base, &scenes, &auto, timing, &mut progress);
    progress.end();
    let measured = measured?;
    let report = experiment::judged(studio.adapter(), base, &scenes, &auto, &BOUNDS, &measured);
    if let Some(folder) = &arguments.output {
        output::folder(folder)?;
        output::write_json(&folder.join("auto-experiment.json"), &Report::Auto(report.clone()))?;
        output::write_json(&folder.join("auto-measured.json"), &measured)?;
    }
    if arguments.json {
        return print_json(&Report::Auto(report));
    }
    let [width, height] = base.output.size;
    say!(
        "{}, {width}x{height}, {} scenes, {} combinations",
        report.adapter.name,
        report.scenes.len(),
        report.combinations
    );
    say!(
        "| bound | scenes that can keep it | kept | ms | over the cheapest of each scene | over the best fixed one | FLIP |"
    );
    say!("| --- | --- | --- | --- | --- | --- | --- |");
    for r in &report.rows {
        if r.possible == 0 {
            say!("| {} | 0 | - | - | - | - | - |", r.bound);
            continue;
        }
        let fixed = r.over_fixed.map_or("-".to_owned(), |v| format!("{v:.2}"));
        say!(
            "| {} | {} | {} | {} | {:.2} | {fixed} | {:.4} |",
            r.bound,
            r.possible,
            r.kept,
            number(r.mean_ms),
            r.over_cheapest,
            r.mean_flip
        );
    }
    Ok(())
}

/// Groups whose methods may flicker or fail where something moves.
const MOVING: [&str; 4] = ["scatter", "transmit", "antialias", "detail"];

fn tell_stability(arguments: &Arguments, report: StabilityReport) -> Outcome {
    let picture =
        arguments.output.as_deref().map(|folder| stability::page::write(folder, &report)).transpose()?;
    if arguments.json {
        return print_json(&Report::Stability(report));
    }
    say!("{}", stability::page::about(&report));
    say!("| sweep | setting | choice | residual | jump | halo | energy | broken values | cost spike |");
    say!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for r in &report.rows {
        let spike = r.cost_spike.map_or("-".to_owned(), |v| format!("{v:.2}"));
        let [least, most] = r.energy;
        say!(
            "| {} | {} | `{}` | {:.4} | {:.2} | {:.4} | {least:.3} to {most:.3} | {} | {spike} |",
            r.sweep,
            r.group,
            r.choice,
            r.residual,
            r.jump,
            r.halo,
            r.broken_values
        );
    }
    if let Some(picture) = picture {
        say!("{}", picture.display());
    }
    Ok(())
}

fn print(report: &ChartReport) -> Outcome {
    say!("{}", page::about(report));
    let noise = report.scenes.iter().filter_map(|s| s.noise).reduce(f64::max);
    if let Some(noise) = noise {
        say!("noise of reference-surface: at most {noise:.4}");
    }
    report.groups.iter().try_for_each(table)
}

/// A table of a group: over all scenes where there are several.
fn table(group: &ChartGroup) -> Outcome {
    say!("");
    say!("{} ({} to {})", group.flag, page::measured(group), group.truth);
    let is_light = group.measure == Measure::Light;
    let columns =
        if is_light { "relRMSE | to reference-screen | FLIP | FLIP 99 %" } else { "FLIP | FLIP 99 %" };
    say!("| choice | ms a frame | {columns} | worst scene | front |");
    say!("| --- | {} |", vec!["---"; if is_light { 7 } else { 5 }].join(" | "));
    for choice in &group.choices {
        let Some(overall) = &choice.overall else { continue };
        let n = choice.points.len() as f64;
        let mean = |of: &dyn Fn(&ChartError) -> f64| {
            format!("{:.4}", choice.points.iter().map(|p| of(&p.error)).sum::<f64>() / n)
        };
        let root = |of: &dyn Fn(&ChartError) -> Option<f64>| {
            let sum: f64 = choice.points.iter().map(|p| of(&p.error).unwrap_or(f64::NAN).powi(2)).sum();
            format!("{:.4}", (sum / n).sqrt())
        };
        let mut cells = vec![format!("`{}`", choice.name), overall.frame_ms.map_or("-".into(), number)];
        if is_light {
            cells.push(root(&|e| e.relative_rmse_to_surface));
            cells.push(root(&|e| e.relative_rmse_to_screen));
        }
        cells.push(mean(&|e| e.flip_mean));
        cells.push(mean(&|e| e.flip_99));
        cells.push(format!("{:.4}", overall.worst));
        cells.push(if overall.is_on_front { "yes" } else { "" }.into());
        say!("| {} |", cells.join(" | "));
    }
    Ok(())
}
