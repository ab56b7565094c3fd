//! The main job: a sequence of shots to a folder of frames, with everything that a review needs beside them.
//!
//! ```text
//! heads, rig, sequence --evaluate--> shots --studio--> frame.0001.png ...
//!                                      |                   +--> contact_sheet.png, video.mp4
//!                                      +--> animated head.glb        stats.json
//! ```

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use image::RgbImage;
use rubor_assets::export;
use rubor_renderer::{
    AppearanceMethods, ColorMethod, Gpu, Image, Renderer, ScatterMethod, SpecularMethod, TransmitMethod,
    WrinkleMethod,
};
use rubor_rig::evaluate::{Evaluator, Shot};
use rubor_rig::expression::Rig;
use rubor_rig::head::Head;
use rubor_rig::timeline::Sequence;
use serde_json::json;

use crate::antialias_method::{Antialias, parse_antialias};
use crate::failure::{Failure, Outcome};
use crate::inputs::LoadedHead;
use crate::progress::Progress;
use crate::studio::{self, Studio};
use crate::video::Video;
use crate::{contact_sheet, inset, output, video};

/// What `render` and `demo` have in common.
#[derive(Clone, clap::Args)]
#[group(skip)]
pub(crate) struct Arguments {
    /// Folder for the results; made if missing
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Size of a frame in pixels [default: the sequence's, else 640x640]
    #[arg(long, value_parser = crate::inputs::parse_size, value_name = "WxH")]
    pub(crate) size: Option<[u32; 2]>,
    /// Frames a second [default: the sequence's]
    #[arg(long)]
    pub(crate) fps: Option<f64>,
    /// Subsurface scattering: none, separable:N (N odd, 5 to 65), screen-gauss:4, screen-gauss:6, screen-jitter,
    /// burley-disk:N (N from 4 to 256), reference-screen, reference-surface
    #[arg(long, default_value = "separable:17", value_name = "METHOD")]
    pub(crate) scatter: ScatterMethod,
    /// Light through thin parts: none or shadow-depth
    #[arg(long, default_value = "shadow-depth", value_name = "METHOD")]
    pub(crate) transmit: TransmitMethod,
    /// Colour of the skin: hemoglobin (blood moves) or static
    #[arg(long, default_value = "hemoglobin", value_name = "METHOD")]
    pub(crate) color: ColorMethod,
    /// Wrinkles: none, partial-derivative (slopes add) or difference (differences of normals add)
    #[arg(long, default_value = "partial-derivative", value_name = "METHOD")]
    pub(crate) wrinkles: WrinkleMethod,
    /// Highlights of skin: one-lobe (of the map's roughness) or two-lobes (a sharp and a broad one in its place)
    #[arg(long, default_value = "one-lobe", value_name = "METHOD")]
    pub(crate) specular: SpecularMethod,
    /// Draw a map of the moment of the (first) head into a corner: hemoglobin (dark is more) or wrinkles
    #[arg(long, value_enum, value_name = "MAP")]
    pub(crate) inset: Option<inset::Map>,
    /// Antialiasing: none, mlaa, smaa-1x, smaa-s2x, smaa-t2x, smaa-4x, or ssaa:N with N x N samples a pixel
    #[arg(long, default_value = "smaa-s2x", value_parser = parse_antialias, value_name = "METHOD")]
    pub(crate) antialias: Antialias,
    /// Factor of the light before the tone map
    #[arg(long, default_value_t = 1.8)]
    pub(crate) exposure: f32,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    pub(crate) adapter: Option<String>,
    /// Draw only these frames, such as 1,12-20 (the first is 1); makes no video
    #[arg(long, value_parser = parse_frames, value_name = "LIST")]
    pub(crate) frames: Option<FrameList>,
    /// Keep the frames that a stopped run of the same job left
    #[arg(long)]
    pub(crate) resume: bool,
    /// Make no video
    #[arg(long)]
    pub(crate) no_video: bool,
    /// Write no animated head
    #[arg(long)]
    pub(crate) no_export: bool,
    /// Print the statistics as JSON on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// Numbers of frames from 1, ascending, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FrameList(Vec<u32>);

fn parse_frames(text: &str) -> Result<FrameList, String> {
    let wrong = || format!("found {text:?}, expected frame numbers from 1 such as 1,12-20");
    let mut numbers = std::collections::BTreeSet::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let first: u32 = first.trim().parse().map_err(|_| wrong())?;
        let last: u32 = last.trim().parse().map_err(|_| wrong())?;
        if first == 0 || last < first || last - first > 1_000_000 {
            return Err(wrong());
        }
        numbers.extend(first..=last);
    }
    Ok(FrameList(numbers.into_iter().collect()))
}

/// What to draw.
pub(crate) struct Job {
    pub(crate) heads: Vec<LoadedHead>,
    pub(crate) rig: Rig,
    pub(crate) sequence: Sequence,
}

/// Names of the results in the output folder.
const JOB_FILE: &str = "job.json";
const STATS_FILE: &str = "stats.json";
const SHEET_FILE: &str = "contact_sheet.png";
const VIDEO_FILE: &str = "video.mp4";
const HEAD_FILE: &str = "animated_head.glb";
/// Share of the width of a head that is left free between two of them.
const SPACING: f32 = 1.05;

/// Does the job.
pub(crate) fn run(mut job: Job, arguments: &Arguments) -> Outcome {
    let started = Instant::now();
    if let Some(fps) = arguments.fps {
        job.sequence.fps = fps;
    }
    let size = arguments.size.or(job.sequence.size).unwrap_or([640, 640]);
    let mut settings = studio::settings(
        size,
        arguments.scatter,
        arguments.transmit,
        arguments.antialias,
        arguments.exposure,
    );
    settings.appearance = AppearanceMethods {
        color: arguments.color,
        wrinkles: arguments.wrinkles,
        specular: arguments.specular,
    };
    let mut evaluators = Vec::new();
    for loaded in &job.heads {
        let (evaluator, notes) = Evaluator::new(&loaded.head, &job.rig, &job.sequence)?;
        for note in notes {
            eprintln!("note: head {:?}: {note}", loaded.head.name);
        }
        evaluators.push(evaluator);
    }
    let Some(first) = evaluators.first() else { return Err(Failure::input("there is no head to draw")) };
    let frames = chosen_frames(first.frame_count(), arguments.frames.as_ref())?;
    let renderer = Renderer::new(Gpu::new(arguments.adapter.as_deref())?)?;

    output::folder(&arguments.output)?;
    let is_new = claim_folder(&job, size, arguments)?;
    let heads: Vec<&Head> = job.heads.iter().map(|h| &h.head).collect();
    let spacing = heads.iter().map(|h| width(h)).fold(0.0, f32::max) * SPACING;
    let mut studio = Studio::new(renderer, &heads)?;

    let mut inset = arguments.inset.map(|map| inset::Inset::new(map, heads[0])).transpose()?;
    let mut sheet = Vec::new();
    let on_sheet = contact_sheet::choose(frames.len() as u32);
    let mut times = PassTimes::default();
    let mut first_frame_s = None;
    let mut drawn = Vec::new();
    let mut drawn_last = None;
    let mut progress = Progress::new("frames", frames.len() as u64);
    for (place, frame) in frames.iter().copied().enumerate() {
        let path = frame_path(&arguments.output, frame);
        let kept = if is_new { None } else { read_frame(&path, size) };
        let picture = match kept {
            Some(picture) => picture,
            None => {
                let at = Instant::now();
                if settings.antialias.mode.is_temporal() && frame > 0 && drawn_last != Some(frame - 1) {
                    // Frames were left out: antialiasing over time needs the one before.
                    studio.renderer.cut(u64::from(frame) - 1);
                    studio.render(&shots_of(&evaluators, frame - 1), spacing, &settings)?;
                }
                drawn_last = Some(frame);
                let shots = shots_of(&evaluators, frame);
                let (image, stats) = studio.render(&shots, spacing, &settings)?;
                let mut picture = opaque(image);
                if let (Some(inset), Some(shot)) = (&mut inset, shots.first()) {
                    inset.draw(&shot.face, settings.appearance, &mut picture);
                }
                write_png(&path, &picture)?;
                first_frame_s.get_or_insert_with(|| started.elapsed().as_secs_f64());
                drawn.push(at.elapsed().as_secs_f64());
                times.add(&stats);
                picture
            }
        };
        if on_sheet.contains(&(place as u32)) {
            sheet.push(contact_sheet::reduce(&picture));
        }
        progress.step();
    }
    progress.finish();

    write_png(&arguments.output.join(SHEET_FILE), &contact_sheet::page(&sheet))?;
    if !arguments.no_video && arguments.frames.is_none() {
        let path = arguments.output.join(VIDEO_FILE);
        if let Video::NoEncoder = video::encode(&arguments.output, 1, job.sequence.fps, &path)? {
            eprintln!("note: no video: the program ffmpeg is not on this machine (Debian, Ubuntu: ffmpeg)");
        }
    }
    if !arguments.no_export {
        export_animated(&job, &arguments.output)?;
    }
    let gpu = &studio.renderer.gpu().info;
    let stats = json!({
        "adapter": { "name": gpu.name, "backend": format!("{:?}", gpu.backend), "driver": gpu.driver_info },
        "size": size,
        "frames": frames.len(),
        "framesDrawn": drawn.len(),
        "scatter": arguments.scatter.to_string(),
        "transmit": arguments.transmit.to_string(),
        "color": arguments.color.to_string(),
        "wrinkles": arguments.wrinkles.to_string(),
        "specular": arguments.specular.to_string(),
        "antialias": arguments.antialias.to_string(),
        "secondsToFirstFrame": first_frame_s,
        "secondsPerFrame": median(&mut drawn),
        "gpuMillisecondsPerPass": times.medians(),
        "triangles": times.triangles,
        "deviceMemoryBytes": times.memory_bytes,
        "mapTextures": heads.first().map(|h| rubor_renderer::footprint::of_maps(&h.maps)),
    });
    let text = serde_json::to_string_pretty(&stats).map_err(Failure::job)?;
    output::write(&arguments.output.join(STATS_FILE), text.as_bytes())?;
    if arguments.json {
        println!("{text}");
    } else {
        println!("{} frames in {}", frames.len(), arguments.output.display());
    }
    Ok(())
}

/// Indices from 0 of the frames to draw.
fn chosen_frames(count: u32, list: Option<&FrameList>) -> Outcome<Vec<u32>> {
    let Some(FrameList(numbers)) = list else { return Ok((0..count).collect()) };
    match numbers.last() {
        Some(last) if *last > count => Err(Failure::input(format!(
            "--frames: found {last}, expected at most {count}, the length of the sequence"
        ))),
        _ => Ok(numbers.iter().map(|n| n - 1).collect()),
    }
}

/// Writes down what job the folder holds. False where a stopped run of the same job goes on.
fn claim_folder(job: &Job, size: [u32; 2], arguments: &Arguments) -> Outcome<bool> {
    let content = json!({
        "heads": job.heads.iter().map(|h| format!("{:016x}", h.fingerprint)).collect::<Vec<_>>(),
        "rig": job.rig,
        "sequence": job.sequence,
        "size": size,
        "scatter": arguments.scatter.to_string(),
        "transmit": arguments.transmit.to_string(),
        "color": arguments.color.to_string(),
        "wrinkles": arguments.wrinkles.to_string(),
        "specular": arguments.specular.to_string(),
        "inset": arguments.inset.map(|i| format!("{i:?}")),
        "antialias": arguments.antialias.to_string(),
        "exposure": arguments.exposure,
        "program": env!("CARGO_PKG_VERSION"),
    });
    let text = serde_json::to_string_pretty(&content).map_err(Failure::job)?;
    let path = arguments.output.join(JOB_FILE);
    if arguments.resume && path.is_file() {
        let before = std::fs::read_to_string(&path)
            .map_err(|e| Failure::input(format!("{}: cannot be read: {e}", path.display())))?;
        if before != text {
            return Err(Failure::input(format!(
                "{}: found the frames of another job, expected those of this one",
                arguments.output.display()
            ))
            .hint("leave out --resume to draw all frames again, or choose another folder"));
        }
        return Ok(false);
    }
    output::write(&path, text.as_bytes())?;
    Ok(true)
}

/// Frames are numbered from 1.
pub(crate) fn frame_path(folder: &Path, frame: u32) -> PathBuf {
    folder.join(format!("frame.{:04}.png", frame + 1))
}

/// A frame that is there, whole and of the right size.
fn read_frame(path: &Path, size: [u32; 2]) -> Option<RgbImage> {
    let image = image::open(path).ok()?.into_rgb8();
    (image.dimensions() == (size[0], size[1])).then_some(image)
}

fn opaque(image: Image) -> RgbImage {
    RgbImage::from_fn(image.width, image.height, |x, y| {
        let i = 4 * (y as usize * image.width as usize + x as usize);
        image::Rgb([image.rgba[i], image.rgba[i + 1], image.rgba[i + 2]])
    })
}

fn write_png(path: &Path, picture: &RgbImage) -> Outcome {
    output::commit(path, |partial| picture.save(partial).map_err(std::io::Error::other))
}

fn width(head: &Head) -> f32 {
    head.bounds().map_or(0.0, |(low, high)| high.x - low.x)
}

/// Shots of all heads at a frame, from the camera of the first; several heads are seen from further away.
fn shots_of(evaluators: &[Evaluator], frame: u32) -> Vec<Shot> {
    let mut shots: Vec<Shot> = evaluators.iter().map(|e| e.at(e.frame_time_s(frame))).collect();
    let n = shots.len() as f32;
    if let Some(Shot { camera, .. }) = shots.first_mut() {
        camera.position = camera.target + (camera.position - camera.target) * n;
    }
    shots
}

/// Writes the (first) head with its performance.
fn export_animated(job: &Job, folder: &Path) -> Outcome {
    let Some(loaded) = job.heads.first() else { return Ok(()) };
    let options = export::gltf::Options {
        rig: Some(&job.rig),
        sequence: Some(&job.sequence),
        shape_colors: true,
        ..export::gltf::Options::default()
    };
    // What has no effect on the head was said before the first frame.
    export::gltf::write(&loaded.head, &options, &folder.join(HEAD_FILE)).map_err(Failure::job)?;
    Ok(())
}

/// GPU times over frames.
#[derive(Default)]
struct PassTimes {
    by_pass: BTreeMap<&'static str, Vec<f64>>,
    triangles: u64,
    memory_bytes: u64,
}

impl PassTimes {
    fn add(&mut self, stats: &rubor_renderer::FrameStats) {
        let mut frame: BTreeMap<&'static str, f64> = BTreeMap::new();
        for (name, ms) in &stats.passes_ms {
            *frame.entry(name).or_default() += ms;
        }
        for (name, ms) in frame {
            self.by_pass.entry(name).or_default().push(ms);
        }
        self.triangles = stats.triangles;
        self.memory_bytes = stats.memory_bytes;
    }

    fn medians(&mut self) -> BTreeMap<&'static str, Option<f64>> {
        self.by_pass.iter_mut().map(|(name, ms)| (*name, median(ms))).collect()
    }
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_lists_are_read() {
        assert_eq!(parse_frames("3, 1-2,2"), Ok(FrameList(vec![1, 2, 3])));
        for wrong in ["", "0", "4-3", "a", "1,,2"] {
            assert!(parse_frames(wrong).unwrap_err().contains(wrong));
        }
    }
}
