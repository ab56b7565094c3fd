//! `rubor filter`: antialiases finished images.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use exr::prelude::{FlatSamples, WritableImage, f16};
use image::{ColorType, DynamicImage, ImageFormat};
use rubor::studio::open_device;
use rubor_assets::image_io::{Limits, StoredExr, load_picture, load_stored_exr};
use rubor_renderer::antialias::reference::Picture;
use rubor_renderer::antialias::{
    Alpha, AntialiasError, EdgeSource, Encoding, Filter, Mode, Preset, Settings,
};
use rubor_renderer::settings::AntialiasMethod;
use rubor_renderer::{Gpu, native};

use super::console::{self, Progress};
use rubor::notes::Note;
use rubor::output;
use rubor::{Failure, Fault, Outcome, Watch};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// How edges are smoothed: smaa or mlaa
    #[arg(value_parser = parse_method)]
    method: Method,
    /// An image (PNG, EXR, JPEG, TIFF), or a folder of them
    input: PathBuf,
    /// The new image (.png or .exr), or a folder; files that exist are replaced
    #[arg(short, long)]
    output: PathBuf,
    /// Source of edges: luma (fast), or color (also between colours of equal luma)
    #[arg(long, default_value = "luma")]
    mode: EdgeMode,
    /// Quality, from fast to fine
    #[arg(long, default_value = "high")]
    preset: Quality,
    /// Which patterns of edges stand for which contours: revised, or published for comparisons with the published tables
    #[arg(long, default_value = "revised")]
    patterns: EdgePatterns,
    /// Smallest difference that is an edge, 0.0001 to 0.5 (preset high: 0.1)
    #[arg(long)]
    threshold: Option<f32>,
    /// Image to write: the result, or the edges (red left, green top) or blending weights that lead to it (PNG)
    #[arg(long, default_value = "result")]
    stage: Stage,
    /// How to treat values of an EXR that are not finite
    #[arg(long, default_value = "error")]
    non_finite: NonFinite,
    /// Graphics adapter: its index or a part of its name
    #[arg(long)]
    adapter: Option<String>,
    /// Print what was done as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Method {
    /// Enhanced subpixel morphological antialiasing, one sample.
    Smaa,
    /// Morphological antialiasing: softer, rounds corners.
    Mlaa,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum EdgePatterns {
    Revised,
    Published,
}

/// `smaa` or `mlaa`; methods of the renderer that need more than a finished picture are refused by name.
fn parse_method(text: &str) -> Result<Method, String> {
    const EXPECTED: &str = "expected smaa or mlaa";
    match (text, text.parse::<AntialiasMethod>()) {
        ("smaa", _) | (_, Ok(AntialiasMethod::Smaa1x)) => Ok(Method::Smaa),
        (_, Ok(AntialiasMethod::Mlaa)) => Ok(Method::Mlaa),
        (_, Ok(method)) => {
            let needs = match method {
                AntialiasMethod::None => return Err(format!("found {text:?}, {EXPECTED}")),
                AntialiasMethod::SmaaT2x | AntialiasMethod::Smaa4x => "the frame before and the motion since",
                _ => "several samples per pixel",
            };
            Err(format!("{text} does not exist for stills, as it needs {needs}; {EXPECTED}"))
        }
        (_, Err(_)) => Err(format!("found {text:?}, {EXPECTED}")),
    }
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum EdgeMode {
    Luma,
    Color,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Quality {
    Low,
    Medium,
    High,
    Ultra,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Stage {
    Result,
    Edges,
    Weights,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum NonFinite {
    /// Stop and report the place of the first one
    Error,
    /// Replace them by black
    Zero,
}

/// One file's report.
#[derive(Debug, serde::Serialize)]
struct Done {
    input: PathBuf,
    output: PathBuf,
    width: usize,
    height: usize,
    changed_pixels: usize,
    replaced_values: usize,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let jobs = jobs(arguments)?;
    let gpu = open_device(arguments.adapter.as_deref())?;
    let mut filters = Filters::new(&gpu, arguments)?;
    let many = jobs.len() > 1;
    let mut progress = many.then(|| Progress::new("images", jobs.len() as u64));
    let (mut done, mut failures) = (Vec::new(), Vec::new());
    for (input, output) in &jobs {
        match filters.file(input, output) {
            Ok(report) => done.push(report),
            Err(failure) if many => failures.push(failure),
            Err(failure) => {
                console::notes(&filters.notes);
                return Err(failure);
            }
        }
        if let Some(progress) = &mut progress {
            progress.step();
        }
    }
    if let Some(mut progress) = progress {
        progress.end();
    }
    console::notes(&filters.notes);
    if arguments.json {
        super::print_json(&done)?;
    } else {
        for report in &done {
            let replaced = match report.replaced_values {
                0 => String::new(),
                values => format!(", {values} values that were no finite numbers taken for black"),
            };
            let Done { width, height, changed_pixels, .. } = report;
            say!(
                "{}: {width} x {height}, {changed_pixels} pixels changed{replaced}",
                report.output.display()
            );
        }
    }
    if failures.is_empty() {
        return Ok(());
    }
    let lines: Vec<String> = failures.iter().map(ToString::to_string).collect();
    let message = format!("{} of {} images failed:\n{}", failures.len(), jobs.len(), lines.join("\n"));
    let is_job = failures.iter().any(|f| f.fault() == Fault::Job);
    Err(if is_job { Failure::job(message) } else { Failure::input(message) })
}

/// Supported extensions.
const READ: [&str; 6] = ["png", "exr", "jpg", "jpeg", "tif", "tiff"];

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Input and output files.
fn jobs(arguments: &Arguments) -> Outcome<Vec<(PathBuf, PathBuf)>> {
    let (input, target) = (&arguments.input, &arguments.output);
    let as_picture = arguments.stage != Stage::Result;
    if !input.is_dir() {
        if !input.exists() {
            return Err(Failure::input(format!("{}: there is no such file", input.display())));
        }
        let target = if target.is_dir() { named_like(input, target, as_picture) } else { target.clone() };
        let (from, to) = (extension(input), extension(&target));
        let fits = if as_picture {
            to == "png"
        } else {
            (to == "exr") == (from == "exr") && (to == "png" || to == "exr")
        };
        if !fits {
            let expected = if from == "exr" && !as_picture { ".exr" } else { ".png" };
            return Err(Failure::input(format!(
                "{}: expected a name that ends in {expected}",
                target.display()
            )));
        }
        return Ok(vec![(input.clone(), target)]);
    }
    let entries = std::fs::read_dir(input)
        .and_then(Iterator::collect::<std::io::Result<Vec<_>>>)
        .map_err(|e| Failure::input(format!("{}: cannot read this folder: {e}", input.display())))?;
    let mut files: Vec<PathBuf> = entries.iter().map(std::fs::DirEntry::path).collect();
    files.retain(|path| path.is_file() && READ.contains(&extension(path).as_str()));
    files.sort();
    if files.is_empty() {
        let expected = READ.join(", ");
        return Err(Failure::input(format!("{}: no images here, expected {expected}", input.display())));
    }
    output::folder(target)?;
    let jobs: Vec<_> =
        files.into_iter().map(|path| (path.clone(), named_like(&path, target, as_picture))).collect();
    let mut names: Vec<_> = jobs.iter().map(|(_, to)| to).collect();
    names.sort();
    if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Failure::input(format!(
            "{}: two images of the folder would get this name",
            twice[0].display()
        )));
    }
    Ok(jobs)
}

/// Output path of an image in a folder: the same name; formats other than EXR become PNG.
fn named_like(input: &Path, folder: &Path, as_picture: bool) -> PathBuf {
    let kept = extension(input) == "exr" && !as_picture;
    let name = Path::new(input.file_name().unwrap_or_default());
    folder.join(if kept { name.to_owned() } else { name.with_extension("png") })
}

/// Filters for stored values (PNG and the like) and for light (EXR).
struct Filters<'a> {
    gpu: &'a Gpu,
    stored: Filter<'a>,
    light: Filter<'a>,
    stage: Stage,
    non_finite: NonFinite,
    /// What the readers of the images chose, left out or turned.
    notes: Vec<Note>,
}

impl<'a> Filters<'a> {
    fn new(gpu: &'a Gpu, arguments: &Arguments) -> Outcome<Self> {
        let mode = match arguments.method {
            Method::Smaa => Mode::Smaa1x,
            Method::Mlaa => Mode::Mlaa,
        };
        let preset = match arguments.preset {
            Quality::Low => Preset::Low,
            Quality::Medium => Preset::Medium,
            Quality::High => Preset::High,
            Quality::Ultra => Preset::Ultra,
        };
        let mut settings = match arguments.patterns {
            EdgePatterns::Revised => Settings::new(mode, preset),
            EdgePatterns::Published => Settings::published(mode, preset),
        };
        settings.threshold = arguments.threshold.unwrap_or(settings.threshold);
        settings.edges = match arguments.mode {
            EdgeMode::Luma => EdgeSource::Luma,
            EdgeMode::Color => EdgeSource::Color,
        };
        let light = Settings { encoding: Encoding::Linear, alpha: Alpha::Associated, ..settings };
        Ok(Self {
            gpu,
            stored: Filter::new(gpu, settings).map_err(Failure::input)?,
            light: Filter::new(gpu, light).map_err(Failure::input)?,
            stage: arguments.stage,
            non_finite: arguments.non_finite,
            notes: Vec::new(),
        })
    }

    fn file(&mut self, input: &Path, target: &Path) -> Outcome<Done> {
        let empty = std::fs::metadata(input).is_ok_and(|metadata| metadata.len() == 0);
        if empty {
            return Err(Failure::input(format!("{}: the file is empty, expected an image", input.display())));
        }
        if extension(input) == "exr" { self.exr(input, target) } else { self.image(input, target) }
    }

    fn note(&mut self, file: &Path, found: &[String]) {
        self.notes.extend(found.iter().map(|message| Note::new(file.display().to_string(), message)));
    }

    /// Images of whole numbers, upright. Number of channels and depth are kept; palettes become colours.
    fn image(&mut self, input: &Path, target: &Path) -> Outcome<Done> {
        let picture = load_picture(input, &Limits::default())?;
        self.note(input, &picture.notes);
        let image = picture.image;
        if matches!(image.color(), ColorType::Rgb32F | ColorType::Rgba32F) {
            return Err(Failure::input(format!(
                "{}: found floats, expected whole numbers of 8 or 16 bits",
                input.display()
            ))
            .hint("light is filtered in an OpenEXR (.exr)"));
        }
        let (width, height) = (image.width() as usize, image.height() as usize);
        let picture = || {
            let pixels = image.to_rgba32f();
            Picture { width, height, pixels: pixels.pixels().map(|pixel| pixel.0).collect() }
        };
        if self.stage != Stage::Result {
            return save_stage(self.gpu, &mut self.stored, self.stage, &picture(), input, target);
        }
        let color = image.color();
        let failed = |error: AntialiasError| device_failure(input, error);
        let filtered = if color.bytes_per_pixel() == color.channel_count() {
            let rgba = image.to_rgba8();
            let bytes =
                native::wait(self.gpu, self.stored.bytes(image.width(), image.height(), rgba.as_raw()))
                    .map_err(failed)?;
            image::RgbaImage::from_raw(image.width(), image.height(), bytes).map(DynamicImage::from)
        } else {
            let result = native::wait(self.gpu, self.stored.picture(&picture())).map_err(failed)?;
            let whole = |v: &f32| (v.clamp(0.0, 1.0) * 65535.0).round() as u16;
            let values = result.pixels.iter().flatten().map(whole).collect();
            image::ImageBuffer::from_raw(image.width(), image.height(), values).map(DynamicImage::ImageRgba16)
        };
        let filtered = filtered.ok_or_else(|| Failure::job("the filtered image has a wrong size"))?;
        // Grey stays grey: the three channels were equal and had equal weights.
        let filtered = match color {
            ColorType::L8 => {
                DynamicImage::from(first_channels::<u8, 1, _>(&filtered.to_rgba8(), image::Luma))
            }
            ColorType::La8 => DynamicImage::from(grey_alpha(&filtered.to_rgba8())),
            ColorType::L16 => {
                DynamicImage::from(first_channels::<u16, 1, _>(&filtered.to_rgba16(), image::Luma))
            }
            ColorType::La16 => DynamicImage::from(grey_alpha(&filtered.to_rgba16())),
            ColorType::Rgb8 => filtered.to_rgb8().into(),
            ColorType::Rgb16 => filtered.to_rgb16().into(),
            _ => filtered,
        };
        let before = image.as_bytes().chunks(usize::from(color.bytes_per_pixel()));
        let after = filtered.as_bytes().chunks(usize::from(color.bytes_per_pixel()));
        let changed_pixels = before.zip(after).filter(|(a, b)| a != b).count();
        save_png(&filtered, target)?;
        Ok(Done {
            input: input.into(),
            output: target.into(),
            width,
            height,
            changed_pixels,
            replaced_values: 0,
        })
    }

    /// Scene-linear images. The layers that are pictures are filtered, all others are kept.
    fn exr(&mut self, input: &Path, target: &Path) -> Outcome<Done> {
        let StoredExr { mut image, pictures, notes } = load_stored_exr(input, &Limits::default())?;
        self.note(input, &notes);
        let mut report = Done {
            input: input.into(),
            output: target.into(),
            width: 0,
            height: 0,
            changed_pixels: 0,
            replaced_values: 0,
        };
        for place in pictures {
            let layer = &mut image.layer_data[place.part];
            let (width, height) = (layer.size.x(), layer.size.y());
            let channels = &mut layer.channel_data.list;
            let (color, alpha) = (place.color, place.alpha);
            let values = |index: usize| -> Vec<f32> { channels[index].sample_data.values_as_f32().collect() };
            let [r, g, b] = color.map(values);
            let cover = alpha.map(values);
            if r.len() != width * height || g.len() != r.len() || b.len() != r.len() {
                let message = "colour channels of different resolutions are not supported";
                return Err(Failure::input(format!("{}: {message}", input.display())));
            }
            let mut picture = Picture {
                width,
                height,
                pixels: (0..r.len())
                    .map(|i| [r[i], g[i], b[i], cover.as_ref().map_or(1.0, |a| a[i])])
                    .collect(),
            };
            report.replaced_values += self.make_finite(&mut picture, input)?;
            (report.width, report.height) = (width, height);
            if self.stage != Stage::Result {
                return save_stage(self.gpu, &mut self.light, self.stage, &picture, input, target);
            }
            let result = native::wait(self.gpu, self.light.picture(&picture))
                .map_err(|error| device_failure(input, error))?;
            let changed: Vec<usize> =
                (0..r.len()).filter(|&i| result.pixels[i] != picture.pixels[i]).collect();
            report.changed_pixels += changed.len();
            let mut targets: Vec<(usize, usize)> = color.into_iter().zip(0..3).collect();
            targets.extend(alpha.map(|index| (index, 3)));
            for (index, channel) in targets {
                set_samples(&mut channels[index].sample_data, |i| result.pixels[i][channel]);
            }
        }
        output::commit(target, |partial| image.write().to_file(partial).map_err(std::io::Error::other))?;
        Ok(report)
    }

    /// Deals with values that are not finite; returns how many were replaced.
    fn make_finite(&self, picture: &mut Picture, input: &Path) -> Outcome<usize> {
        let width = picture.width;
        let mut replaced = 0;
        for (i, pixel) in picture.pixels.iter_mut().enumerate() {
            for (channel, value) in pixel.iter_mut().enumerate().filter(|(_, value)| !value.is_finite()) {
                if self.non_finite == NonFinite::Error {
                    let name = ["red", "green", "blue", "alpha"][channel];
                    return Err(Failure::input(format!(
                        "{}: {name} is {value} at pixel ({}, {}), expected a finite number",
                        input.display(),
                        i % width,
                        i / width
                    ))
                    .hint("`--non-finite zero` takes such values for black"));
                }
                *value = 0.0;
                replaced += 1;
            }
        }
        Ok(replaced)
    }
}

/// Writes values back in the channel's own type.
fn set_samples(samples: &mut FlatSamples, value: impl Fn(usize) -> f32) {
    match samples {
        FlatSamples::F16(values) => {
            values.iter_mut().enumerate().for_each(|(i, v)| *v = f16::from_f32(value(i)))
        }
        FlatSamples::F32(values) => values.iter_mut().enumerate().for_each(|(i, v)| *v = value(i)),
        FlatSamples::U32(values) => {
            values.iter_mut().enumerate().for_each(|(i, v)| *v = value(i).round() as u32);
        }
    }
}

fn first_channels<T: image::Primitive, const N: usize, P: image::Pixel<Subpixel = T>>(
    image: &image::ImageBuffer<image::Rgba<T>, Vec<T>>,
    make: impl Fn([T; 1]) -> P,
) -> image::ImageBuffer<P, Vec<T>>
where
    image::Rgba<T>: image::Pixel<Subpixel = T>,
{
    image::ImageBuffer::from_fn(image.width(), image.height(), |x, y| make([image.get_pixel(x, y).0[0]]))
}

fn grey_alpha<T: image::Primitive>(
    image: &image::ImageBuffer<image::Rgba<T>, Vec<T>>,
) -> image::ImageBuffer<image::LumaA<T>, Vec<T>>
where
    image::Rgba<T>: image::Pixel<Subpixel = T>,
    image::LumaA<T>: image::Pixel<Subpixel = T>,
{
    image::ImageBuffer::from_fn(image.width(), image.height(), |x, y| {
        let [grey, _, _, alpha] = image.get_pixel(x, y).0;
        image::LumaA([grey, alpha])
    })
}

fn save_png(image: &DynamicImage, target: &Path) -> Outcome {
    output::commit(target, |partial| {
        image.save_with_format(partial, ImageFormat::Png).map_err(std::io::Error::other)
    })
}

/// Edges as in figure 9.1 (red left, green top), or the four weights of a pixel's edges.
fn save_stage(
    gpu: &Gpu,
    filter: &mut Filter,
    stage: Stage,
    picture: &Picture,
    input: &Path,
    target: &Path,
) -> Outcome<Done> {
    let (width, height) = (picture.width, picture.height);
    let failed = |error: AntialiasError| device_failure(input, error);
    let (image, changed_pixels) = if stage == Stage::Edges {
        let edges = native::wait(gpu, filter.edges(picture)).map_err(failed)?;
        let values =
            edges.left.iter().zip(&edges.top).flat_map(|(l, t)| [u8::from(*l) * 255, u8::from(*t) * 255, 0]);
        let count = edges.left.iter().zip(&edges.top).filter(|(l, t)| **l || **t).count();
        let image = image::RgbImage::from_raw(width as u32, height as u32, values.collect());
        (image.map(DynamicImage::from), count)
    } else {
        let weights = native::wait(gpu, filter.weights(picture)).map_err(failed)?;
        let count = weights.iter().filter(|weights| **weights != [0; 4]).count();
        let image = image::RgbaImage::from_raw(width as u32, height as u32, weights.concat());
        (image.map(DynamicImage::from), count)
    };
    save_png(&image.ok_or_else(|| Failure::job("the filtered image has a wrong size"))?, target)?;
    Ok(Done { input: input.into(), output: target.into(), width, height, changed_pixels, replaced_values: 0 })
}

fn device_failure(input: &Path, error: AntialiasError) -> Failure {
    match error {
        AntialiasError::Device(_) => Failure::job(format!("{}: {error}", input.display())),
        _ => Failure::input(format!("{}: {error}", input.display())),
    }
}

#[cfg(test)]
mod tests;
