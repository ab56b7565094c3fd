//! `rubor render`: a sequence on one head, or on several side by side, or a job that was written before.

use std::path::PathBuf;

use rubor::auto::{Auto, Bound, Calibration};
use rubor::inputs::{self, LoadedHead};
use rubor::job::{Format, FrameList};
use rubor::looks;
use rubor::notes::Note;
use rubor::review::inset;
use rubor::{Destination, Job, Outcome, Plan, Report, Studio, Watch, run};
use rubor_renderer::settings::Preset;

use super::console::{self, Progress};
use super::settings_flags::{One, SettingsFlags};
use super::{print_json, signals};

/// Size of the demo on a machine without a graphics card, pixels: a minute on two cores.
const PREVIEW: [u32; 2] = [480, 480];

#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    contents: Contents,
    #[command(flatten)]
    shared: Shared,
}

/// Arguments that say what is drawn: those of `render` and `job`.
#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct Contents {
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
}

/// Arguments that change a job.
#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct Changes {
    /// Frames per second [default: the sequence's]
    #[arg(long)]
    fps: Option<f64>,
    /// Lens and look that replace those of the sequence and the job: portrait, film-still, or a file of a look; flags replace
    /// single settings
    #[arg(long, value_name = "NAME|FILE")]
    look: Option<String>,
    /// Draw a map of the (first) head's current state into a corner
    #[arg(long, value_enum, value_name = "MAP")]
    inset: Option<inset::Map>,
    /// Choose the cheapest settings for each frame whose error against full quality stays under a bound: flip=X (mean FLIP
    /// over the head) or rel-rmse=X (relative RMSE of linear light); settings given by flags stay [default: flip=0.01 for all but
    /// --antialias, unless --preset or a flag of quality is given]
    #[arg(long, value_name = "flip=X|rel-rmse=X", value_parser = parse_error)]
    max_error: Option<Bound>,
    /// Choose the most exact settings for each frame that fit into a time, in milliseconds
    #[arg(long, value_name = "MS", conflicts_with = "max_error", value_parser = parse_budget)]
    budget_ms: Option<Bound>,
    /// Files of each frame
    #[arg(long, value_enum, value_name = "FORMAT")]
    format: Option<Format>,
    /// Draw only these frames, such as 1,12-20 (the first is 1); makes no video
    #[arg(long, value_name = "LIST")]
    frames: Option<FrameList>,
    #[command(flatten)]
    settings: SettingsFlags<One>,
}

/// Arguments that `render`, `gather` and `demo` share.
#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct Shared {
    #[command(flatten)]
    pub(crate) results: Results,
    /// Keep the frames that a stopped run of the same job left
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    changes: Changes,
}

/// Arguments that say where the results go and which there are.
#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct Results {
    /// Folder for the results; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Make no video
    #[arg(long)]
    no_video: bool,
    /// Write frame, time and expressions onto the pictures of the video
    #[arg(long, conflicts_with = "no_video")]
    burn_in: bool,
    /// Write no animated head
    #[arg(long)]
    no_export: bool,
    /// Print the report as JSON on standard output
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let shared = &arguments.shared;
    let (job, heads) = arguments.contents.job(&shared.changes)?;
    shared.results.make(&job, &heads, shared.resume, None)
}

impl Contents {
    /// The job with the changes by flags, its files known by their fingerprints, and its heads.
    pub(crate) fn job(&self, changes: &Changes) -> Outcome<(Job, Vec<LoadedHead>)> {
        let (mut job, heads) = match &self.job {
            Some(path) => {
                let job = Job::read(path, changes.settings.preset())?;
                if changes.settings.preset().is_some() && Job::read(path, None)? == job {
                    let message = "--preset has no effect: the job says all that it would choose";
                    console::notes(&[Note::new(path.display().to_string(), message)]);
                }
                let heads = job.load_heads()?;
                (job, heads)
            }
            None => {
                inputs::check_number_of_heads(self.head.len())?;
                let heads: Vec<LoadedHead> = match &self.head[..] {
                    [] => vec![inputs::head(None)?],
                    files => files.iter().map(|path| inputs::head(Some(path))).collect::<Outcome<_>>()?,
                };
                let (sequence, notes) = inputs::sequence(self.sequence.as_deref())?;
                console::notes(&notes);
                let of_head = heads.first().and_then(|h| h.rig.clone());
                let mut job = Job::new(&heads, inputs::rig(self.rig.as_deref(), of_head)?, sequence)?;
                job.settings = changes.settings.settings(job.sequence.size)?;
                changes.leave_out(&mut job)?;
                (job, heads)
            }
        };
        if let Some(lights) = &self.lights {
            job.relight(inputs::lights(lights)?)?;
        }
        changes.apply(&mut job)?;
        job.seal(&heads)?;
        Ok((job, heads))
    }
}

/// Error of what is left out without being asked: a quarter of what `smaa-1x` has to 64 samples of a pixel (docs/speed.md).
const UNSEEN: Bound = Bound::Flip(0.01);

/// A bound of an error.
pub(super) fn parse_error(text: &str) -> Result<Bound, String> {
    match text.parse() {
        Ok(bound @ (Bound::Flip(_) | Bound::RelativeRmse(_))) => Ok(bound),
        _ => Err(format!("found {text:?}, expected flip=X or rel-rmse=X with X above 0, such as flip=0.02")),
    }
}

fn parse_budget(text: &str) -> Result<Bound, String> {
    format!("ms={text}")
        .parse()
        .map_err(|_| format!("found {text:?}, expected milliseconds above 0, such as 1.5"))
}

fn calibration() -> Outcome<Calibration> {
    let devices = rubor::studio::adapters();
    let (calibration, notes) = Calibration::of_devices(devices.iter().map(|d| d.name.as_str()))?;
    console::notes(&notes);
    Ok(calibration)
}

impl Changes {
    /// Where nobody says anything about quality: leaves out what frames do not show. Antialiasing stays as it is, as no
    /// choice of it is near to full quality.
    fn leave_out(&self, job: &mut Job) -> Outcome {
        if self.settings.preset().is_none() && !self.settings.says_quality() {
            let held = vec!["antialias".to_owned()];
            job.auto = Some(Auto { bound: UNSEEN, held, calibration: calibration()? });
        }
        Ok(())
    }

    fn apply(&self, job: &mut Job) -> Outcome {
        if let Some(bound) = self.max_error.or(self.budget_ms) {
            job.auto = Some(Auto { bound, held: self.settings.given(), calibration: calibration()? });
        }
        if let Some(look) = &self.look {
            console::notes(&looks::load(look)?.apply(job)?);
        }
        self.settings.overlay(&mut job.settings)?;
        job.sequence.fps = self.fps.unwrap_or(job.sequence.fps);
        job.inset = self.inset.or(job.inset);
        job.format = self.format.unwrap_or(job.format);
        job.frames = self.frames.clone().or(job.frames.take());
        Ok(())
    }
}

impl Shared {
    /// The built-in head and the demo.
    pub(crate) fn demo(&self) -> Outcome {
        let heads = [inputs::head(None)?];
        let (sequence, _) = inputs::sequence(None)?;
        let mut job = Job::new(&heads, inputs::rig(None, heads[0].rig.clone())?, sequence)?;
        job.settings = self.changes.settings.settings(job.sequence.size)?;
        let studio = super::open_studio(self.results.adapter.as_deref())?;
        if self.changes.settings.preset().is_none() && studio.is_software() {
            job.settings.quality = Preset::Draft.quality();
            let [width, height] = std::mem::replace(&mut job.settings.output.size, PREVIEW);
            let message = format!(
                "this machine draws on its processor: a preview of {} x {} with --preset draft; \
                 all of it: --preset review --size {width}x{height}",
                PREVIEW[0], PREVIEW[1]
            );
            console::notes(&[Note::new("demo", message)]);
        } else {
            self.changes.leave_out(&mut job)?;
        }
        self.changes.apply(&mut job)?;
        job.seal(&heads)?;
        self.results.draw(&Plan::new(&job, &heads)?, studio, self.resume, None)
    }
}

impl Results {
    /// Draws a job, or what the chunks of other runs do not have of it.
    pub(crate) fn make(
        &self,
        job: &Job,
        heads: &[LoadedHead],
        resume: bool,
        chunks: Option<PathBuf>,
    ) -> Outcome {
        let plan = Plan::new(job, heads)?;
        self.draw(&plan, super::open_studio(self.adapter.as_deref())?, resume, chunks)
    }

    fn draw(&self, plan: &Plan<'_>, mut studio: Studio, resume: bool, chunks: Option<PathBuf>) -> Outcome {
        let to = Destination {
            folder: self.output.clone(),
            resume,
            chunks,
            video: !self.no_video,
            burn_in: self.burn_in,
            animated_head: !self.no_export,
            stop: signals::watched()?,
        };
        let mut progress = Progress::default();
        let report = run::run(plan, &mut studio, &to, &mut progress);
        progress.end();
        let report = report?;
        if self.json {
            return print_json(&Report::Job(report));
        }
        say!("{} frames in {}", report.frames, self.output.display());
        if let Some(utilisation) = &report.utilisation {
            say!("at work in {utilisation}");
        }
        Ok(())
    }
}
