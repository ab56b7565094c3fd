//! `rubor import capture`: a recorded performance to a sequence.

use std::path::PathBuf;

use rubor_assets::import::capture::{self, Retarget};
use rubor_rig::names::Resolver;

use rubor::notes::Note;
use rubor::{Failure, Outcome};
use rubor::{inputs, output};

use super::console;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Live Link Face .csv, MediaPipe or ARKit .json
    recording: PathBuf,
    /// The sequence to write (.json)
    #[arg(short, long, value_name = "FILE", required_unless_present = "write_retarget")]
    output: Option<PathBuf>,
    /// Which channel moves which shape (.json)
    #[arg(long, value_name = "FILE")]
    retarget: Option<PathBuf>,
    /// Write a retarget file with every channel of the recording, to edit
    #[arg(long, value_name = "FILE")]
    write_retarget: Option<PathBuf>,
    /// Frames per second of the sequence [default: those of the recording]
    #[arg(long)]
    fps: Option<f64>,
    /// Frame numbers in per second of the timecodes, where the recording does not show it (59.94 counts as such)
    #[arg(long, value_name = "RATE")]
    timecode_rate: Option<f64>,
    /// List the tracks for which this head (.glb) has no shape
    #[arg(long, value_name = "FILE")]
    head: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let path = &arguments.recording;
    let recording = match arguments.timecode_rate {
        Some(rate) => {
            let bytes = rubor_rig::limits::read(path).map_err(|e| Failure::read(path, e))?;
            capture::live_link::from_bytes(&bytes, path, Some(rate))?
        }
        None => capture::read(path)?,
    };
    let retarget = match &arguments.retarget {
        Some(file) => Retarget::load(file)?,
        None => Retarget::default(),
    };
    if let Some(file) = &arguments.write_retarget {
        let template = Retarget::template(&recording);
        output::write_json(file, &template)?;
        say!("{}: {} channels", file.display(), template.shapes.len());
    }
    let Some(file) = &arguments.output else { return Ok(()) };
    let (sequence, report) = capture::to_sequence(&recording, &retarget, arguments.fps)?;
    output::write_json(file, &sequence)?;
    let mut notes = report.notes;
    let list = |names: &[String]| names.join(", ");
    if !report.unmapped.is_empty() {
        notes.push(format!("no shape is known for {}; a retarget file can name one", list(&report.unmapped)));
    }
    if !report.unused.is_empty() {
        notes.push(format!(
            "the recording has no channel {}, which the retarget file names",
            list(&report.unused)
        ));
    }
    if report.limited > 0 {
        notes.push(format!("{} weights above the limit were cut", report.limited));
    }
    if let Some(head) = &arguments.head {
        let head = inputs::head(Some(head))?.head;
        let resolver = Resolver::shapes(&head);
        let missing: Vec<String> =
            sequence.shapes.keys().filter(|name| resolver.resolve(name).is_empty()).cloned().collect();
        if !missing.is_empty() {
            notes.push(format!("{} has no shape for {}", head.name, list(&missing)));
        }
    }
    console::notes(&notes.into_iter().map(|n| Note::new(path.display().to_string(), n)).collect::<Vec<_>>());
    say!(
        "{}: {} samples at {} per second to {} frames at {}, {} tracks, {} keys",
        file.display(),
        report.samples,
        report.rate,
        sequence.frame_count(),
        sequence.fps,
        sequence.shapes.len(),
        report.keys
    );
    Ok(())
}
