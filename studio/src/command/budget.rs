//! `rubor check --budget`: what sequences need of a head, and the head with no more than that.

use std::path::{Path, PathBuf};

use rubor::auto::Bound;
use rubor::measure::budget::{self, Budget, Options, Scene};
use rubor::measure::chart::Timing;
use rubor::notes::Note;
use rubor::report::{BudgetError, BudgetFate, BudgetItem, BudgetKind, BudgetReport};
use rubor::{Failure, Outcome, Report, Watch, inputs, output};
use rubor_renderer::settings::Settings;
use rubor_rig::timeline::Sequence;

use super::console::Progress;
use super::settings_flags::{One, SettingsFlags};
use super::{console, print_json};

/// What a picture looks like on a processor, pixels.
const PREVIEW: [u32; 2] = [256, 256];
const HEADING: &str = "Budget";

#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct Arguments {
    /// Tell which shapes, distributions, zones, parts, map sizes and hairs of a head make no visible difference in sequences, and
    /// write the head without them
    #[arg(long, requires = "sequence", help_heading = HEADING)]
    pub(crate) budget: bool,
    /// Sequence (.json) that the head is to play; may be given again
    #[arg(long, value_name = "FILE", requires = "budget", help_heading = HEADING)]
    sequence: Vec<PathBuf>,
    /// Head (.glb, .gltf, .vrm, .obj, .usda, .usdz) [default: the built-in head]
    #[arg(long, value_name = "FILE", requires = "budget", help_heading = HEADING)]
    head: Option<PathBuf>,
    /// Rig (.json) [default: the one in the head, else the six basic expressions for ARKit names]
    #[arg(long, value_name = "FILE", requires = "budget", help_heading = HEADING)]
    rig: Option<PathBuf>,
    /// Lights that replace those of the sequences: a name or a sequence file, as `rubor render` takes them
    #[arg(long, value_name = "NAME|FILE", requires = "budget", help_heading = HEADING)]
    lights: Option<String>,
    /// Error that each frame may have: mean FLIP over the head against the whole head [default: flip=0.005]
    #[arg(long, value_name = "flip=X", requires = "budget", value_parser = super::render::parse_error, help_heading = HEADING)]
    max_error: Option<Bound>,
    /// Frames of each sequence that are looked at: half of them evenly spread, half with the peaks of weights [default: 12]
    #[arg(long, value_name = "N", requires = "budget", value_parser = clap::value_parser!(u32).range(1..=100_000), help_heading = HEADING)]
    frames: Option<u32>,
    /// Rounds in which the whole and the reduced head are timed in turns; 0 times nothing [default: 3]
    #[arg(long, value_name = "N", requires = "budget", value_parser = clap::value_parser!(u32).range(..=100), help_heading = HEADING)]
    rounds: Option<u32>,
    /// The reduced head (.glb); without it nothing is written
    #[arg(short, long, value_name = "FILE", requires = "budget", help_heading = HEADING)]
    output: Option<PathBuf>,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME", requires = "budget", help_heading = HEADING)]
    adapter: Option<String>,
    #[command(flatten)]
    settings: SettingsFlags<One>,
}

/// Error of a frame that is allowed by default.
const BOUND: f64 = 0.005;
const FRAMES: u32 = 12;
const ROUNDS: u32 = 3;

impl Arguments {
    /// Refuses settings where nothing is drawn.
    pub(crate) fn refuse_settings(&self) -> Outcome {
        let flag =
            self.settings.given().into_iter().next().or(self.settings.preset().map(|_| "preset".to_owned()));
        match flag {
            Some(flag) => {
                Err(Failure::input(format!("--{flag}: nothing is drawn, expected --budget with it")))
            }
            None => Ok(()),
        }
    }
}

pub(crate) fn run(arguments: &Arguments, files: &[PathBuf], json: bool) -> Outcome {
    if let Some(file) = files.first() {
        return Err(Failure::input(format!(
            "{}: found a file to check, expected none with --budget",
            file.display()
        ))
        .hint("name files by --head, --rig and --sequence"));
    }
    if let Some(path) = &arguments.output {
        check_output(path, arguments.head.as_deref())?;
    }
    let loaded = inputs::head(arguments.head.as_deref())?;
    console::notes(&loaded.notes);
    let rig = inputs::rig(arguments.rig.as_deref(), loaded.rig)?;
    let lights = arguments.lights.as_deref().map(inputs::lights).transpose()?;
    let mut sequences: Vec<(PathBuf, Sequence)> = Vec::new();
    for path in &arguments.sequence {
        let (mut sequence, notes) = inputs::sequence(Some(path))?;
        console::notes(&notes);
        if let Some(lights) = &lights {
            sequence.lights.clone_from(&lights.lights);
            sequence.environment.clone_from(&lights.environment);
        }
        sequences.push((path.clone(), sequence));
    }
    let input_bytes = inputs::head_file_bytes(arguments.head.as_deref())?;
    let scene = Scene { head: loaded.head, input_bytes, rig, sequences };
    let mut studio = super::open_studio(arguments.adapter.as_deref())?;
    let options =
        Options {
            bound: arguments.max_error.unwrap_or(Bound::Flip(BOUND)),
            frames: arguments.frames.unwrap_or(FRAMES) as usize,
            timing: Some(arguments.rounds.unwrap_or(ROUNDS))
                .filter(|rounds| *rounds > 0)
                .map(|rounds| Timing { rounds, warm_up: 1, frames: 3 }),
            settings: settings(arguments, &scene, studio.is_software())?,
        };
    let name = arguments.output.as_deref().unwrap_or(Path::new("reduced.glb"));
    let mut progress = Progress::default();
    let found = budget::run(&mut studio, &scene, &options, name, &mut progress);
    progress.end();
    console::notes(&studio.take_notes());
    let Budget { mut report, file } = found?;
    if loaded.sequence.is_some() || loaded.animation.is_some() {
        let note = Note::new(
            "",
            "the animation of the head is not in the reduced one: `rubor export` makes another",
        );
        report.notes.push(note.to_string());
    }
    if let (Some(path), Some(bytes)) = (&arguments.output, file) {
        output::write(path, &bytes)?;
        report.written = Some(path.clone());
    }
    if json {
        return print_json(&Report::Budget(report));
    }
    print(&report, arguments)
}

/// Settings of each sequence: its own size unless a flag says one, on a processor a small one.
fn settings(arguments: &Arguments, scene: &Scene, is_software: bool) -> Outcome<Vec<Settings>> {
    let is_given = arguments.settings.given().iter().any(|flag| flag == "size");
    let of = |(_, sequence): &(PathBuf, Sequence)| -> Outcome<Settings> {
        let mut settings = arguments.settings.settings(sequence.size)?;
        if is_software && !is_given {
            settings.output.size = PREVIEW;
        }
        Ok(settings)
    };
    let all: Vec<Settings> = scene.sequences.iter().map(of).collect::<Outcome<_>>()?;
    if is_software && !is_given {
        let message = format!(
            "this machine draws on its processor: pictures of {} x {}, in which less is seen than in larger ones; --size says another",
            PREVIEW[0], PREVIEW[1]
        );
        console::notes(&[Note::new("budget", message)]);
    }
    Ok(all)
}

fn check_output(path: &Path, head: Option<&Path>) -> Outcome {
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("glb")) {
        return Err(Failure::input(format!("{}: expected a name that ends in .glb", path.display())));
    }
    // Said before the work, which is long.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| !folder.is_dir()) {
        return Err(Failure::input(format!("{}: found no such folder to write to", path.display())));
    }
    let real = |path: &Path| std::fs::canonicalize(path).ok();
    if head.is_some_and(|head| real(head).is_some() && real(head) == real(path)) {
        return Err(Failure::input(format!(
            "{}: found the head itself, expected another file: it would be lost",
            path.display()
        )));
    }
    Ok(())
}

fn print(report: &BudgetReport, arguments: &Arguments) -> Outcome {
    let looked: usize = report.sequences.iter().map(|s| s.looked_at.len()).sum();
    let [width, height] = report.settings.output.size;
    say!("{}, {width}x{height}, {} of {} frames looked at", report.adapter.name, looked, frames(report));
    for s in &report.sequences {
        let numbers = s.looked_at.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
        say!("  {}: frames {numbers} of {}", s.file.display(), s.frames);
    }
    say!("");
    say!("| what | name | largest weight | moves | memory | file | FLIP without it alone | |");
    say!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let (unused, others): (Vec<&BudgetItem>, Vec<_>) =
        report.items.iter().partition(|item| item.fate == BudgetFate::Unused);
    for kind in [BudgetKind::Shape, BudgetKind::Distribution, BudgetKind::Zone, BudgetKind::Part] {
        unused_row(kind, &unused)?;
    }
    others.into_iter().try_for_each(row)?;
    say!("");
    for kind in [BudgetKind::Shape, BudgetKind::Distribution, BudgetKind::Zone, BudgetKind::Part] {
        let names: Vec<&str> = unused.iter().filter(|i| i.kind == kind).map(|i| i.name.as_str()).collect();
        if !names.is_empty() {
            say!("{} that no frame uses: {}", words(kind, true), names.join(", "));
        }
    }
    totals(report)?;
    console::notes(&report.notes.iter().map(|note| Note::new("", note)).collect::<Vec<_>>());
    match (&report.written, report.items.iter().any(|i| i.fate.is_loss()), &arguments.output) {
        (Some(path), ..) => say!("{}", path.display()),
        (None, false, Some(path)) => say!(
            "nothing can go: {} is not written, the head is as small as these sequences allow",
            path.display()
        ),
        (None, false, None) => say!("nothing can go"),
        (None, true, _) => say!("nothing is written: -o HEAD.glb writes the reduced head"),
    }
    say!(
        "samples of scattering, antialiasing and shadows by the same kind of bound: rubor render --max-error flip=X"
    );
    Ok(())
}

fn frames(report: &BudgetReport) -> u32 {
    report.sequences.iter().map(|s| s.frames).sum()
}

fn totals(report: &BudgetReport) -> Outcome {
    let (whole, reduced) = (&report.whole, &report.reduced);
    say!("");
    say!("| | whole | reduced | |");
    say!("| --- | --- | --- | --- |");
    let share = |a: f64, b: f64| if a > 0.0 { format!("{:.0} %", 100.0 * b / a) } else { "-".to_owned() };
    let bytes = |name: &str, a: u64, b: u64| -> Outcome {
        say!("| {name} | {} | {} | {} |", megabytes(a), megabytes(b), share(a as f64, b as f64));
        Ok(())
    };
    bytes("memory on the device", whole.device_bytes, reduced.device_bytes)?;
    bytes("file as it came", report.input_bytes, reduced.file_bytes)?;
    bytes("file, coded alike", whole.file_bytes, reduced.file_bytes)?;
    if let (Some(a), Some(b)) = (whole.frame_ms, reduced.frame_ms) {
        say!("| a frame | {a:.2} ms | {b:.2} ms | {} |", share(a, b));
    }
    for (name, a, b) in [
        ("shapes", whole.shapes, reduced.shapes),
        ("distributions", whole.distributions, reduced.distributions),
        ("wrinkle zones", whole.zones, reduced.zones),
        ("triangles", whole.triangles, reduced.triangles),
        ("hairs", whole.hairs as usize, reduced.hairs as usize),
    ] {
        if a > 0 {
            say!("| {name} | {a} | {b} | {} |", share(a as f64, b as f64));
        }
    }
    say!("");
    say!(
        "error of the reduced head as written: FLIP {:.5} in the worst frame ({} of {}), {:.5} in the mean; allowed: {}",
        report.error.largest,
        report.worst.frame,
        report.worst.sequence.display(),
        report.error.mean,
        report.bound
    );
    Ok(())
}

fn words(kind: BudgetKind, many: bool) -> &'static str {
    match (kind, many) {
        (BudgetKind::Shape, false) => "shape",
        (BudgetKind::Shape, true) => "shapes",
        (BudgetKind::Distribution, false) => "distribution",
        (BudgetKind::Distribution, true) => "distributions",
        (BudgetKind::Zone, false) => "zone",
        (BudgetKind::Zone, true) => "zones",
        (BudgetKind::Part, false) => "part",
        (BudgetKind::Part, true) => "parts",
        (BudgetKind::Map, _) => "map",
        (BudgetKind::Hairs, _) => "hairs",
    }
}

/// One row for all of a kind that no frame uses.
fn unused_row(kind: BudgetKind, unused: &[&BudgetItem]) -> Outcome {
    let of: Vec<&&BudgetItem> = unused.iter().filter(|i| i.kind == kind).collect();
    let sum = |bytes: fn(&BudgetItem) -> u64| megabytes(of.iter().map(|i| bytes(i)).sum());
    if !of.is_empty() {
        let (device, file) = (sum(|i| i.device_bytes), sum(|i| i.file_bytes));
        let many = words(kind, of.len() > 1);
        say!("| {many} | {} | 0 | - | {device} | {file} | 0 | goes: no frame uses it |", of.len());
    }
    Ok(())
}

fn row(item: &BudgetItem) -> Outcome {
    let number = |v: Option<f64>, digits: usize| v.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
    let name = match (item.kind, item.from, item.to) {
        (BudgetKind::Map, Some([w, h]), Some([v, g])) if [w, h] != [v, g] => {
            format!("{}, {w}x{h} to {v}x{g}", item.name)
        }
        (BudgetKind::Map, Some([w, h]), _) => format!("{}, {w}x{h}", item.name),
        (BudgetKind::Hairs, Some([a, _]), Some([b, _])) if a != b => format!("{a} to {b}"),
        (BudgetKind::Hairs, Some([a, _]), _) => a.to_string(),
        _ => item.name.clone(),
    };
    let error = |e: BudgetError| format!("{}{:.5}", if e.is_least { "over " } else { "" }, e.largest);
    let fate = match item.fate {
        BudgetFate::Unused => "goes: no frame uses it",
        BudgetFate::Gone => "goes",
        BudgetFate::Smaller => "shrinks",
        BudgetFate::Needed => "stays",
        BudgetFate::Held => "stays: a name or the camera depends on it",
    };
    let moves = item.moves_pixels.map_or("-".to_owned(), |p| format!("{p:.2} px"));
    say!(
        "| {} | {name} | {} | {moves} | {} | {} | {} | {fate} |",
        words(item.kind, false),
        number(item.most_weight, 3),
        megabytes(item.device_bytes),
        megabytes(item.file_bytes),
        item.error.map_or("-".to_owned(), error)
    );
    Ok(())
}

fn megabytes(bytes: u64) -> String {
    match bytes {
        0 => "0".to_owned(),
        1..100_000 => format!("{:.1} kB", bytes as f64 * 1e-3),
        _ => format!("{:.2} MB", bytes as f64 * 1e-6),
    }
}
