//! `rubor render`: a sequence on one head, or on several side by side, or a job that was written before.

use std::path::PathBuf;

use rubor::inputs::{self, LoadedHead};
use rubor::job::FrameList;
use rubor::notes::Note;
use rubor::review::inset;
use rubor::{Destination, Job, Outcome, Plan, Report, Studio, Watch, run};

use super::console::{self, Progress};
use super::print_json;
use super::settings_flags::{One, SettingsFlags};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Head (.glb, .gltf, .vrm, .obj, .usda, .usdz); repeat for several side by side [default: the built-in head]
    #[arg(long, value_name = "FILE")]
    head: Vec<PathBuf>,
    /// Rig (.json) [default: the one in the head, else the six basic expressions for ARKit names]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Sequence (.json) [default: the demo]
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// Job (.json) to draw, such as `job.json` of another run; flags replace single settings
    #[arg(long, value_name = "FILE", conflicts_with_all = ["head", "rig", "sequence"])]
    job: Option<PathBuf>,
    /// Lights that replace those of the sequence: three-point, window, backlit-ear, low-key, soft-box, sky, or a
    /// sequence file
    #[arg(long, value_name = "NAME|FILE")]
    lights: Option<String>,
    #[command(flatten)]
    shared: Shared,
}

/// Arguments that `render` and `demo` share.
#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct Shared {
    /// Folder for the results; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Frames per second [default: the sequence's]
    #[arg(long)]
    fps: Option<f64>,
    /// Draw a map of the (first) head's current state into a corner
    #[arg(long, value_enum, value_name = "MAP")]
    inset: Option<inset::Map>,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Draw only these frames, such as 1,12-20 (the first is 1); makes no video
    #[arg(long, value_name = "LIST")]
    frames: Option<FrameList>,
    /// Keep the frames that a stopped run of the same job left
    #[arg(long)]
    resume: bool,
    /// Make no video
    #[arg(long)]
    no_video: bool,
    /// Write no animated head
    #[arg(long)]
    no_export: bool,
    /// Print the report as JSON on standard output
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: SettingsFlags<One>,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let shared = &arguments.shared;
    let (mut job, heads) = match &arguments.job {
        Some(path) => {
            let job = Job::read(path, shared.settings.preset())?;
            if shared.settings.preset().is_some() && Job::read(path, None)? == job {
                let message = "--preset has no effect: the job says all that it would choose";
                console::notes(&[Note::new(path.display().to_string(), message)]);
            }
            let heads = job.load_heads()?;
            (job, heads)
        }
        None => {
            let heads: Vec<LoadedHead> = match &arguments.head[..] {
                [] => vec![inputs::head(None)?],
                files => files.iter().map(|path| inputs::head(Some(path))).collect::<Outcome<_>>()?,
            };
            let (sequence, notes) = inputs::sequence(arguments.sequence.as_deref())?;
            console::notes(&notes);
            let of_head = heads.first().and_then(|h| h.rig.clone());
            let mut job = Job::new(&heads, inputs::rig(arguments.rig.as_deref(), of_head)?, sequence)?;
            job.settings = shared.settings.settings(job.sequence.size)?;
            (job, heads)
        }
    };
    if let Some(lights) = &arguments.lights {
        job.relight(inputs::lights(lights)?)?;
    }
    shared.run(job, &heads)
}

impl Shared {
    /// The built-in head and the demo.
    pub(crate) fn demo(&self) -> Outcome {
        let heads = [inputs::head(None)?];
        let (sequence, _) = inputs::sequence(None)?;
        let mut job = Job::new(&heads, inputs::rig(None, heads[0].rig.clone())?, sequence)?;
        job.settings = self.settings.settings(job.sequence.size)?;
        self.run(job, &heads)
    }

    /// Draws a job with the changes by flags.
    fn run(&self, mut job: Job, heads: &[LoadedHead]) -> Outcome {
        self.settings.overlay(&mut job.settings)?;
        job.sequence.fps = self.fps.unwrap_or(job.sequence.fps);
        job.inset = self.inset.or(job.inset);
        job.frames = self.frames.clone().or(job.frames);
        let plan = Plan::new(&job, heads)?;
        let mut studio = Studio::open(self.adapter.as_deref())?;
        let to = Destination {
            folder: self.output.clone(),
            resume: self.resume,
            video: !self.no_video,
            animated_head: !self.no_export,
        };
        let mut progress = Progress::default();
        let report = run::run(&plan, &mut studio, &to, &mut progress);
        progress.end();
        let report = report?;
        if self.json {
            return print_json(&Report::Job(report));
        }
        say!("{} frames in {}", report.frames, self.output.display());
        Ok(())
    }
}
