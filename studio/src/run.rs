//! The main job: the frames of a plan to a folder, with everything that a review needs beside them.
//!
//! ```text
//! Plan --draw--> frames n+2, n+1 | writers: frame n --> frame.0001.png, frame.0001.exr ...
//!                                        +--> contact_sheet.png, video.mp4, sequence.otio
//! heads --------> animated_head.glb      job.json, stats.json --> review.html --> manifest.json
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Instant;

use image::RgbImage;
use rubor_assets::{export, files};
use rubor_renderer::{FrameStats, footprint};

use crate::claim::{self, Claim};
use crate::error::{Failure, Fault, Outcome};
use crate::job::{Format, Job};
use crate::layers;
use crate::manifest::{MANIFEST_FILE, Manifest};
use crate::notes::{Note, summed};
use crate::output;
use crate::plan::{Coming, Plan};
use crate::report::{AutoRun, JobReport, PassTimes, Report, median};
use crate::review::inset::Inset;
use crate::review::page::{self, FrameCost, PAGE_FILE, PageData};
use crate::review::timeline::{self, TIMELINE_FILE};
use crate::review::{contact_sheet, text, video};
use crate::stop::Stop;
use crate::studio::{Frame, Studio};
use crate::utilisation::{Clock, Work};
use crate::watch::Watch;
use crate::writers;

/// Name of the job in the folder of a run.
pub const JOB_FILE: &str = "job.json";
/// Name of the report.
pub const STATS_FILE: &str = "stats.json";
/// Name of the contact sheet.
pub const SHEET_FILE: &str = "contact_sheet.png";
/// Name of the video.
pub const VIDEO_FILE: &str = "video.mp4";
/// Name of the animated head.
pub const HEAD_FILE: &str = "animated_head.glb";

/// Destination and choice of the results.
#[derive(Clone, Debug)]
pub struct Destination {
    /// The folder; made if missing.
    pub folder: PathBuf,
    /// Keep the frames that a stopped run of the same job left.
    pub resume: bool,
    /// Folder of folders with frames of the same job, which are taken before others are drawn; only with `resume`.
    pub chunks: Option<PathBuf>,
    /// Make a video, if the job has all frames.
    pub video: bool,
    /// Write frame, time and expressions onto the pictures of the video.
    pub burn_in: bool,
    /// Write the first head with its performance.
    pub animated_head: bool,
    /// Asks the run to stop after the frame at hand.
    pub stop: Stop,
}

impl Destination {
    /// Everything into a folder, all of it new.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        let stop = Stop::default();
        Self {
            folder: folder.into(),
            resume: false,
            chunks: None,
            video: true,
            burn_in: false,
            animated_head: true,
            stop,
        }
    }
}

/// A frame for the writers.
struct Page {
    place: usize,
    /// From the frame before.
    seconds: f64,
    frame: Coming,
}

/// Results of the writers for a frame.
struct Written {
    place: usize,
    frame: u32,
    seconds: f64,
    stats: FrameStats,
    small: Option<RgbImage>,
}

/// Draws a plan into a folder.
///
/// # Errors
/// The folder holds the frames of another job, or another run works in it; errors of the studio; files that cannot be
/// written; a wish to stop. Where frames are missing then, the message names the first of them.
pub fn run(
    plan: &Plan<'_>,
    studio: &mut Studio,
    to: &Destination,
    watch: &mut dyn Watch,
) -> Outcome<JobReport> {
    let started = Instant::now();
    watch.notes(plan.notes());
    let (job, heads) = (plan.job(), plan.heads());
    let inset = job.inset.zip(heads.first()).map(|(map, head)| Inset::new(map, &head.head)).transpose()?;
    let mut claim = Claim::look(job, &to.folder, to.resume)?;
    let mut notes = plan.notes().to_vec();
    if let Some(chunks) = &to.chunks {
        notes.extend(claim.take()?);
        gather(job, chunks, &to.folder)?;
    }
    let size = job.settings.output.size;
    plan.enter(studio)?;

    let on_sheet = contact_sheet::choose(plan.frames().len() as u32);
    let mut sheet: BTreeMap<usize, RgbImage> = BTreeMap::new();
    let mut to_draw = Vec::new();
    let mut done: BTreeSet<usize> = BTreeSet::new();
    watch.begin("frames", plan.frames().len() as u64);
    for (place, frame) in plan.frames().iter().copied().enumerate() {
        let kept =
            if claim.is_new && to.chunks.is_none() { None } else { read_frame(job, &to.folder, frame, size) };
        match kept {
            Some(picture) => {
                if on_sheet.contains(&(place as u32)) {
                    sheet.insert(place, contact_sheet::reduce(&picture));
                }
                done.insert(place);
                watch.step();
            }
            None => to_draw.push(frame),
        }
    }

    let mut first_frame_s = None;
    let mut costs: BTreeMap<u32, (f64, FrameStats)> = BTreeMap::new();
    let clock = Clock::start();
    let write = |page: Page| -> Outcome<Written> {
        let Page { place, seconds, frame: Coming { frame, shots, drawn } } = page;
        let drawn = clock.time(Work::Read, || drawn.take())?;
        let picture = clock.time(Work::Encode, || -> Outcome<RgbImage> {
            let mut picture = drawn.picture();
            if let (Some(inset), Some(shot)) = (&inset, shots.first()) {
                inset.draw(&shot.face, &plan.settings(frame).quality, &mut picture);
            }
            Ok(picture)
        })?;
        // Written last: if the picture of a frame exists, the frame is complete.
        for file in files_of(job, &to.folder, frame, &drawn, &picture) {
            let (path, encode) = file;
            let bytes = clock.time(Work::Encode, encode)?;
            clock.time(Work::Write, || output::write(&path, &bytes))?;
        }
        let small = on_sheet.contains(&(place as u32)).then(|| contact_sheet::reduce(&picture));
        Ok(Written { place, frame, seconds, stats: drawn.stats, small })
    };
    let mut written = |written: Written| {
        done.insert(written.place);
        first_frame_s.get_or_insert_with(|| started.elapsed().as_secs_f64());
        sheet.extend(written.small.map(|small| (written.place, small)));
        costs.insert(written.frame, (written.seconds, written.stats));
        watch.step();
    };
    let drawn = writers::beside(&write, &mut written, |push| {
        let mut since = Instant::now();
        stop_if_asked(&to.stop)?;
        plan.draw_ahead(studio, &to_draw, &clock, |frame| {
            // With the first frame, so that a job that cannot be drawn leaves nothing.
            notes.extend(claim.take()?);
            let seconds = since.elapsed().as_secs_f64();
            since = Instant::now();
            let place = plan.frames().partition_point(|f| *f < frame.frame);
            push(Page { place, seconds, frame })?;
            stop_if_asked(&to.stop)
        })
    });
    let mut times = PassTimes::default();
    costs.values().for_each(|(_, stats)| times.add(stats));
    let device_ms = studio.has_timestamps().then(|| costs.values().map(|(_, stats)| stats.frame_ms).sum());
    let utilisation = (!costs.is_empty()).then(|| clock.utilisation(device_ms));
    let costs: BTreeMap<u32, FrameCost> = costs
        .into_iter()
        .map(|(frame, (seconds, stats))| {
            (frame, FrameCost { seconds, passes_ms: stats.passes_ms.into_iter().collect() })
        })
        .collect();
    if let Err(failure) = drawn {
        watch.end();
        return Err(with_way_on(failure, plan, &done, &to.folder));
    }
    notes.extend(claim.take()?);
    watch.end();
    watch.notes(&notes[plan.notes().len()..]);

    let of_surroundings = studio.take_notes();
    watch.notes(&of_surroundings);
    notes.extend(of_surroundings);
    let mut files = vec![PathBuf::from(SHEET_FILE)];
    let words = |place: usize| plan.frames().get(place).map(|frame| moment(plan, *frame)).unwrap_or_default();
    let small: Vec<(RgbImage, Vec<String>)> =
        sheet.into_iter().map(|(place, small)| (small, words(place))).collect();
    output::save_picture(&to.folder.join(SHEET_FILE), &contact_sheet::page(&small))?;
    // A video that fails costs neither the head nor the report.
    let mut failed = None;
    if to.video && job.frames.is_none() {
        match make_video(plan, to) {
            Ok(video::Video::Written) => files.push(VIDEO_FILE.into()),
            Ok(video::Video::NoEncoder) => {
                let note = Note::new("", video::NO_ENCODER);
                watch.notes(std::slice::from_ref(&note));
                notes.push(note);
            }
            Err(failure) => failed = Some(failure),
        }
        stop_if_asked(&to.stop).map_err(|failure| with_way_on(failure, plan, &done, &to.folder))?;
    }
    if to.animated_head {
        export_animated(plan, &to.folder)?;
        files.push(HEAD_FILE.into());
    }
    // Frames that other runs of this job left are on the page too.
    let mut on_page: Vec<u32> = match claim.frames() {
        None => (0..plan.evaluator().map_or(0, |evaluator| evaluator.frame_count())).collect(),
        Some(list) => list.numbers().iter().map(|number| number - 1).collect(),
    };
    on_page.retain(|frame| frame_path(&to.folder, *frame).is_file());
    if let [first, .., last] | [first @ last] = on_page[..] {
        let name = page::title(&to.folder);
        let video = files.iter().any(|file| file.as_os_str() == VIDEO_FILE).then_some(VIDEO_FILE);
        let clip = timeline::Clip { name: &name, frames: [first + 1, last + 1], video };
        output::write_json(&to.folder.join(TIMELINE_FILE), &timeline::of(&job.sequence, &clip))?;
        files.push(TIMELINE_FILE.into());
    }
    if on_page.len() > page::MOST_FRAMES {
        let found =
            format!("no page: found {} frames, expected at most {}", on_page.len(), page::MOST_FRAMES);
        let note = Note::new(PAGE_FILE, found);
        watch.notes(std::slice::from_ref(&note));
        notes.push(note);
    } else {
        files.push(PAGE_FILE.into());
    }
    files.push(MANIFEST_FILE.into());
    let mut seconds: Vec<f64> = costs.values().map(|cost| cost.seconds).collect();
    let report = JobReport {
        adapter: studio.adapter(),
        settings: job.settings.clone(),
        auto: plan.chosen().into_iter().map(|(frames, chosen)| AutoRun { frames, chosen }).collect(),
        frames: plan.frames().len(),
        frames_drawn: to_draw.len(),
        seconds_to_first_frame: first_frame_s,
        seconds_per_frame: median(&mut seconds),
        utilisation,
        gpu_milliseconds_per_pass: times.medians(),
        triangles: times.triangles,
        device_memory_bytes: times.memory_bytes,
        map_textures: heads
            .first()
            .map(|h| footprint::of_maps(&h.head.maps).into_iter().map(Into::into).collect())
            .unwrap_or_default(),
        files,
        notes: summed(&notes),
    };
    output::write_json(&to.folder.join(STATS_FILE), &Report::Job(report.clone()))?;
    if on_page.len() <= page::MOST_FRAMES {
        let inset = job.inset.zip(inset.as_ref());
        let data = PageData::new(plan, &on_page, &to.folder, inset, &costs, &report)?;
        data.write(&to.folder.join(PAGE_FILE))?;
    }
    let is_listed = |name: &str| name == JOB_FILE || claim::is_result(name);
    Manifest::of(&to.folder, is_listed)?.write(&to.folder)?;
    match failed {
        Some(failure) => Err(failure),
        None => Ok(report),
    }
}

/// Copies the frames of runs of the same job into the folder, each with its channels before its picture.
fn gather(job: &Job, chunks: &Path, folder: &Path) -> Outcome {
    let entries = std::fs::read_dir(chunks).map_err(|e| Failure::read(chunks, e))?;
    let mut runs: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    runs.retain(|run| run.join(JOB_FILE).is_file());
    runs.sort();
    if runs.is_empty() {
        let expected = "expected folders of runs (`rubor render --frames`)";
        return Err(Failure::input(format!(
            "{}: found no folder with a {JOB_FILE}, {expected}",
            chunks.display()
        )));
    }
    let copy = |from: PathBuf, to: PathBuf| match rubor_rig::limits::read(&from) {
        Ok(bytes) => files::replace_with(&to, |file, _| std::io::Write::write_all(file, &bytes))
            .map_err(|e| Failure::write(&to, e)),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(e) => Err(Failure::read(&from, e)),
    };
    for run in runs {
        let part = Job::read(&run.join(JOB_FILE), None)?;
        if !part.draws_like(job)? {
            let found =
                format!("{}: found the frames of another job, expected those of this one", run.display());
            return Err(Failure::input(found).hint("draw the chunk again, or take it out of the folder"));
        }
        let frames = part.frames.iter().flat_map(|list| list.numbers()).map(|number| number - 1);
        for frame in frames.filter(|frame| frame_path(&run, *frame).is_file()) {
            for channel in &job.settings.output.channels {
                let name = channel.name();
                copy(channel_path(&run, frame, &name), channel_path(folder, frame, &name))?;
            }
            if job.format == Format::Exr {
                copy(layers_path(&run, frame), layers_path(folder, frame))?;
            }
            copy(frame_path(&run, frame), frame_path(folder, frame))?;
        }
    }
    Ok(())
}

fn stop_if_asked(stop: &Stop) -> Outcome {
    stop.asked().map_or(Ok(()), |signal| Err(Failure::stopped(signal)))
}

/// A failure of the middle of a run with the frame to go on from.
fn with_way_on(failure: Failure, plan: &Plan<'_>, done: &BTreeSet<usize>, folder: &Path) -> Failure {
    if done.is_empty() || failure.fault() == Fault::Input {
        return failure;
    }
    let (count, all) = (done.len(), plan.frames().len());
    let next = (0..all).find(|place| !done.contains(place)).and_then(|place| plan.frames().get(place));
    let way = match next {
        Some(next) => format!("the same command with --resume goes on at frame {}", next + 1),
        None => "the same command with --resume makes the rest".into(),
    };
    failure.context(format!("{count} of {all} frames are in {}", folder.display())).hint(way)
}

/// The picture of a frame, from 0; files are numbered from 1.
pub fn frame_path(folder: &Path, frame: u32) -> PathBuf {
    folder.join(format!("frame.{:04}.png", frame + 1))
}

/// The file of a channel of a frame, from 0; files are numbered from 1.
pub fn channel_path(folder: &Path, frame: u32, channel: &str) -> PathBuf {
    folder.join(format!("frame.{:04}.{channel}.exr", frame + 1))
}

/// The file of the layers of a frame, from 0; files are numbered from 1.
pub fn layers_path(folder: &Path, frame: u32) -> PathBuf {
    folder.join(format!("frame.{:04}.exr", frame + 1))
}

/// Whether a frame exists with all its channels, complete and of the right size.
fn read_frame(job: &Job, folder: &Path, frame: u32, size: [u32; 2]) -> Option<RgbImage> {
    let mut channels = job.settings.output.channels.iter();
    if channels.any(|c| !channel_path(folder, frame, &c.name()).is_file())
        || (job.format == Format::Exr && !layers_path(folder, frame).is_file())
    {
        return None;
    }
    let image = image::open(frame_path(folder, frame)).ok()?.into_rgb8();
    (image.dimensions() == (size[0], size[1])).then_some(image)
}

/// Makes the bytes of a file.
type Encode<'a> = Box<dyn FnOnce() -> Outcome<Vec<u8>> + 'a>;

/// The files of a frame, its picture last.
fn files_of<'a>(
    job: &'a Job,
    folder: &Path,
    frame: u32,
    drawn: &'a Frame,
    picture: &'a RgbImage,
) -> Vec<(PathBuf, Encode<'a>)> {
    let output = &job.settings.output;
    let wanted = drawn.channels.iter().filter(|data| output.channels.contains(&data.channel));
    let mut files: Vec<(PathBuf, Encode<'a>)> = wanted
        .map(|data| -> (PathBuf, Encode<'a>) {
            let path = channel_path(folder, frame, &data.channel.name());
            (path, Box::new(|| output::encode_channel(data)))
        })
        .collect();
    if job.format != Format::Png {
        let about = layers::About {
            size: output.size,
            number: frame + 1,
            fps: job.sequence.fps,
            near_metres: rubor_renderer::NEAR_METRES,
        };
        files.push((layers_path(folder, frame), Box::new(move || layers::encode(&drawn.channels, &about))));
    }
    files.push((frame_path(folder, frame), Box::new(|| output::encode_png(picture))));
    files
}

/// A frame in words: its number and time, then the expressions and states that show, the strongest first.
fn moment(plan: &Plan<'_>, frame: u32) -> Vec<String> {
    // Weights under this do not show.
    const LEAST: f32 = 0.05;
    let Some(evaluator) = plan.evaluator() else { return Vec::new() };
    let time_s = evaluator.frame_time_s(frame);
    let (rig, weights) = (evaluator.rig(), evaluator.weights_at(time_s));
    let expressions = rig.expression_names().zip(&weights.expressions);
    let mut shown: Vec<(&str, f32)> = expressions
        .chain(rig.state_names().zip(&weights.states))
        .map(|(name, weight)| (name, *weight))
        .filter(|(_, weight)| *weight >= LEAST)
        .collect();
    shown.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut words = vec![format!("{:04}  {time_s:.2} s", frame + 1)];
    words.extend(shown.iter().map(|(name, weight)| format!("{name} {weight:.2}")));
    words
}

/// Encodes the frames.
fn make_video(plan: &Plan<'_>, to: &Destination) -> Outcome<video::Video> {
    let pictures = plan.frames().iter().map(|frame| {
        let path = frame_path(&to.folder, *frame);
        let mut picture = image::open(&path).map_err(|e| Failure::read(&path, e))?.into_rgb8();
        if to.burn_in {
            let height = letters(picture.height());
            for (line, words) in moment(plan, *frame).iter().enumerate() {
                let top = height * (1.0 + 1.8 * line as f32);
                text::draw_on_picture(&mut picture, [height, top], height, words);
            }
        }
        Ok(picture)
    });
    let job = plan.job();
    video::encode(&to.folder.join(VIDEO_FILE), job.settings.output.size, job.sequence.fps, pictures)
}

/// Height of capitals on a picture, pixels.
pub(crate) fn letters(picture_height: u32) -> f32 {
    (picture_height as f32 / 40.0).max(8.0)
}

/// Writes the (first) head with its performance.
fn export_animated(plan: &Plan<'_>, folder: &Path) -> Outcome {
    let Some(loaded) = plan.heads().first() else { return Ok(()) };
    let sequence = plan.job().lit_sequence();
    let options = export::gltf::Options {
        rig: Some(&plan.job().rig),
        sequence: Some(&sequence),
        shape_colors: true,
        ..export::gltf::Options::default()
    };
    // Entries without effect on the head were reported before the first frame.
    export::gltf::write(&loaded.head, &options, &folder.join(HEAD_FILE))?;
    Ok(())
}
