//! Two runs beside each other: their frames, what is unlike, and a page of both.
//!
//! ```text
//! folders of runs --RunFolder--> pairs of frames --measure--> differences
//!                                     +--page---> DIR/review.html, DIR/a, DIR/b
//!                                     +--video--> FILE.mp4
//! ```

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use image::RgbImage;
use rubor_assets::files;

use super::page::{self, Curve, PAGE_FILE, PageData, rounded};
use super::text;
use super::video::{self, Video};
use crate::error::{Failure, Outcome};
use crate::job::Job;
use crate::measure::difference::Difference;
use crate::notes::Note;
use crate::output;
use crate::run::{JOB_FILE, frame_path, letters};

/// Folders of the two runs beside their page.
const FOLDERS: [&str; 2] = ["a", "b"];
/// Frames per second of a folder that says nothing about them.
const USUAL_FPS: f64 = 24.0;

/// Seconds in which the line of a wipe goes over the picture and back.
const WIPE_SECONDS: f64 = 4.0;
/// Factor of differences in a video, as the page begins with.
const GAIN: u32 = 4;

/// How two pictures become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Layout {
    /// The first left, the second right
    #[default]
    SideBySide,
    /// The first left of a line that goes over the picture and back in four seconds
    Wipe,
    /// Four times what they are apart
    Difference,
}

/// The folder of a run.
#[derive(Clone, Debug)]
pub struct RunFolder {
    /// The folder.
    pub folder: PathBuf,
    /// What its page shows; without a page of its own, its frames alone.
    pub data: PageData,
    /// What is missing of it.
    pub notes: Vec<Note>,
}

/// Frames that stand for each other, from 1: of the first run and of the second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Of the first run.
    pub first: u32,
    /// Of the second run.
    pub second: u32,
}

impl RunFolder {
    /// Looks at the folder of a run.
    ///
    /// # Errors
    /// A folder that cannot be read or has no frames.
    pub fn open(folder: &Path) -> Outcome<Self> {
        let about = folder.display().to_string();
        let found = frames(folder)?;
        if found.is_empty() {
            let expected = "expected those of a run: frame.0001.png and so on";
            return Err(Failure::input(format!("{about}: found no frames, {expected}")));
        }
        let mut notes = Vec::new();
        let data = match PageData::read(&folder.join(PAGE_FILE)) {
            Ok(data) => {
                let lacking: Vec<u32> =
                    data.frames.iter().copied().filter(|n| found.binary_search(n).is_err()).collect();
                if let Some(first) = lacking.first() {
                    let (count, all) = (lacking.len(), data.frames.len());
                    let message =
                        format!("found no picture of {count} of {all} frames; the first is {first}");
                    notes.push(Note::new(&about, message));
                }
                data
            }
            Err(failure) => {
                let message = format!("weights and settings are unknown: {failure}");
                notes.push(Note::new(&about, message));
                plain(folder, found, &mut notes)?
            }
        };
        Ok(Self { folder: folder.to_owned(), data, notes })
    }

    /// The picture of a frame, from 1.
    pub fn picture(&self, number: u32) -> PathBuf {
        frame_path(&self.folder, number.saturating_sub(1))
    }
}

/// Numbers of the frames in a folder, ascending.
fn frames(folder: &Path) -> Outcome<Vec<u32>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Failure::read(folder, e))?;
    let number = |name: &str| -> Option<u32> {
        let digits = name.strip_prefix("frame.")?.strip_suffix(".png")?;
        let is_number = digits.len() >= 4 && digits.bytes().all(|b| b.is_ascii_digit());
        digits.parse().ok().filter(|n| is_number && *n > 0)
    };
    let mut numbers: Vec<u32> = entries.filter_map(|e| number(e.ok()?.file_name().to_str()?)).collect();
    numbers.sort_unstable();
    numbers.dedup();
    Ok(numbers)
}

/// What is known of a folder that has no page.
fn plain(folder: &Path, frames: Vec<u32>, notes: &mut Vec<Note>) -> Outcome<PageData> {
    let path = frame_path(folder, frames.first().map_or(0, |n| n - 1));
    let (width, height) = image::image_dimensions(&path).map_err(|e| Failure::read(&path, e))?;
    let job = folder.join(JOB_FILE);
    let (fps, id) = match Job::read(&job, None) {
        Ok(job) => (job.sequence.fps, job.identity()?.to_string()),
        Err(_) => {
            let message = format!("no job: {USUAL_FPS} frames a second are assumed");
            notes.push(Note::new(folder.display().to_string(), message));
            (USUAL_FPS, page::title(folder))
        }
    };
    Ok(PageData { id, title: page::title(folder), fps, size: [width, height], frames, ..PageData::default() })
}

/// The frames that stand for each other: those of one number where both runs have one rate, else those of one time.
/// Frames without a partner are left out.
pub fn pairs(first: &PageData, second: &PageData) -> Vec<Pair> {
    let partner = |number: u32| {
        if first.fps == second.fps {
            return number;
        }
        // The frame of the second run that is on the screen then. What is next to a whole number is one.
        const ROUNDING: f64 = 1e-6;
        (f64::from(number - 1) / first.fps * second.fps + ROUNDING).floor() as u32 + 1
    };
    let pair = |number: &u32| {
        let partner = partner(*number);
        second.frames.binary_search(&partner).ok().map(|_| Pair { first: *number, second: partner })
    };
    first.frames.iter().filter_map(pair).collect()
}

/// What is unlike about two runs, beside their pixels.
pub fn unlike(first: &RunFolder, second: &RunFolder) -> Vec<Note> {
    let (a, b) = (&first.data, &second.data);
    let about = second.folder.display().to_string();
    let mut notes = Vec::new();
    if a.size != b.size {
        let (found, expected) = (b.size, a.size);
        notes.push(Note::new(
            &about,
            format!(
                "found {}x{} pixels, expected {}x{} as in {}: no differences are measured",
                found[0],
                found[1],
                expected[0],
                expected[1],
                first.folder.display()
            ),
        ));
    }
    if a.fps != b.fps {
        let message = format!("found {} frames a second, {} in the other: paired by time", b.fps, a.fps);
        notes.push(Note::new(&about, message));
    }
    let paired = pairs(a, b).len();
    if paired < a.frames.len() {
        let message = format!("found partners of {paired} of the {} frames of the other", a.frames.len());
        notes.push(Note::new(&about, message));
    }
    notes
}

/// Writes a page of two runs into a folder, with their pictures in folders beside it, so that the folder can be moved
/// and sent. Pictures are links to the same data where the file system can, else copies. `differences` are those of
/// frames of the first run.
///
/// # Errors
/// The folder is that of a run; the system reports an error.
pub fn page(
    first: &RunFolder,
    second: &RunFolder,
    differences: &BTreeMap<u32, Difference>,
    to: &Path,
) -> Outcome<PathBuf> {
    let place = |path: &Path| path.canonicalize().ok();
    if let Some(run) =
        [first, second].into_iter().find(|run| place(to).is_some_and(|p| place(&run.folder) == Some(p)))
    {
        let found =
            format!("{}: found the folder of a run, whose page it would replace", run.folder.display());
        return Err(Failure::input(format!("{found}, expected another one")));
    }
    let mut data = [first, second].map(|run| run.data.clone());
    for ((run, data), name) in [first, second].into_iter().zip(&mut data).zip(FOLDERS) {
        let folder = to.join(name);
        output::folder(&folder)?;
        for old in frames(&folder)? {
            let path = frame_path(&folder, old - 1);
            std::fs::remove_file(&path).map_err(|e| Failure::write(&path, e))?;
        }
        for number in &data.frames {
            let (from, to) = (run.picture(*number), frame_path(&folder, number - 1));
            // The page says which pictures are missing.
            if from.is_file() {
                link(&from, &to)?;
            }
        }
        data.folder = format!("{name}/");
        data.files = Vec::new();
        data.second = None;
    }
    let [mut page, other] = data;
    if !differences.is_empty() {
        let curve = |name: &str, value: fn(&Difference) -> f64| Curve {
            group: "difference".into(),
            name: name.into(),
            rest: 0.0,
            values: page.frames.iter().map(|n| differences.get(n).map(|d| rounded(value(d)))).collect(),
            keys: Vec::new(),
        };
        let curves = [curve("FLIP, mean", |d| d.flip_mean), curve("FLIP, 99 %", |d| d.flip_99)];
        page.curves.splice(0..0, curves);
    }
    page.id = format!("{}-{}", page.id, other.id);
    page.second = Some(Box::new(other));
    let path = to.join(PAGE_FILE);
    page.write(&path)?;
    Ok(path)
}

/// Another name of a file, or a copy of it.
fn link(from: &Path, to: &Path) -> Outcome {
    if std::fs::hard_link(from, to).is_ok() {
        return Ok(());
    }
    let bytes = std::fs::read(from).map_err(|e| Failure::read(from, e))?;
    files::replace(to, &bytes).map_err(|e| Failure::write(to, e))
}

/// Encodes the frames that both runs have, with their names and numbers. Both are pictures of one size.
///
/// # Errors
/// Sizes that differ; no pair; a picture that cannot be read; the encoder fails.
pub fn video(first: &RunFolder, second: &RunFolder, layout: Layout, path: &Path) -> Outcome<Video> {
    let (size, other) = (first.data.size, second.data.size);
    if size != other {
        return Err(Failure::input(format!(
            "{}: found {}x{} pixels, expected {}x{} as in {}: a video needs one size",
            second.folder.display(),
            other[0],
            other[1],
            size[0],
            size[1],
            first.folder.display()
        )));
    }
    let pairs = pairs(&first.data, &second.data);
    if pairs.is_empty() {
        let found = format!("found no frames that belong to those of {}", first.folder.display());
        return Err(Failure::input(format!("{}: {found}", second.folder.display())));
    }
    let read = |run: &RunFolder, number: u32| -> Outcome<RgbImage> {
        let path = run.picture(number);
        Ok(image::open(&path).map_err(|e| Failure::read(&path, e))?.into_rgb8())
    };
    let pictures = pairs.iter().map(|pair| {
        let (a, b) = (read(first, pair.first)?, read(second, pair.second)?);
        for (run, picture) in [(first, &a), (second, &b)] {
            if picture.dimensions() != (size[0], size[1]) {
                let (width, height) = picture.dimensions();
                let found = format!("found a frame of {width}x{height} pixels");
                let expected = format!("expected {}x{}", size[0], size[1]);
                return Err(Failure::input(format!("{}: {found}, {expected}", run.folder.display())));
            }
        }
        let time_s = f64::from(pair.first - 1) / first.data.fps;
        let names = [&first.data.title, &second.data.title].map(String::as_str);
        Ok(beside(&a, &b, layout, time_s, names, pair.first))
    });
    let wide = if layout == Layout::SideBySide { 2 * size[0] } else { size[0] };
    video::encode(path, [wide, size[1]], first.data.fps, pictures)
}

/// Two pictures of one size as one.
fn beside(
    a: &RgbImage,
    b: &RgbImage,
    layout: Layout,
    time_s: f64,
    [a_name, b_name]: [&str; 2],
    number: u32,
) -> RgbImage {
    let (width, height) = a.dimensions();
    let letters = letters(height);
    let right = |text: &str, edge: u32| edge as f32 - text::width(text, letters) - letters;
    let frame = format!("{number:04}");
    let mut picture = a.clone();
    match layout {
        Layout::SideBySide => {
            picture = RgbImage::new(2 * width, height);
            image::imageops::replace(&mut picture, a, 0, 0);
            image::imageops::replace(&mut picture, b, i64::from(width), 0);
            text::draw_on_picture(&mut picture, [letters; 2], letters, a_name);
            text::draw_on_picture(&mut picture, [width as f32 + letters, letters], letters, b_name);
            text::draw_on_picture(&mut picture, [right(&frame, 2 * width), letters], letters, &frame);
        }
        Layout::Wipe => {
            // A triangle wave between the sides.
            let turn = (time_s / WIPE_SECONDS).fract();
            let share = 1.0 - (2.0 * turn - 1.0).abs();
            let line = ((share * f64::from(width)).round() as u32).min(width);
            for (x, y, pixel) in picture.enumerate_pixels_mut() {
                if x >= line {
                    *pixel = *b.get_pixel(x, y);
                }
                if x == line {
                    *pixel = image::Rgb([255; 3]);
                }
            }
            text::draw_on_picture(&mut picture, [letters; 2], letters, a_name);
            text::draw_on_picture(&mut picture, [right(b_name, width), letters], letters, b_name);
            let at = [letters, height as f32 - 2.0 * letters];
            text::draw_on_picture(&mut picture, at, letters, &frame);
        }
        Layout::Difference => {
            for (pixel, other) in picture.pixels_mut().zip(b.pixels()) {
                for (value, other) in pixel.0.iter_mut().zip(other.0) {
                    *value = (u32::from(value.abs_diff(other)) * GAIN).min(255) as u8;
                }
            }
            let words = format!("{frame}  {a_name} - {b_name}  x{GAIN}");
            text::draw_on_picture(&mut picture, [letters; 2], letters, &words);
        }
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_beside_each_other_or_share_one() {
        let [a, b] = [[200, 10, 10], [10, 10, 210]].map(|c| RgbImage::from_pixel(200, 60, image::Rgb(c)));
        let at = |layout, time_s| beside(&a, &b, layout, time_s, ["a", "b"], 7);
        let both = at(Layout::SideBySide, 0.0);
        assert_eq!(both.dimensions(), (400, 60));
        assert_eq!((both.get_pixel(100, 40).0, both.get_pixel(300, 40).0), ([200, 10, 10], [10, 10, 210]));
        // A quarter of the way there and back: the line is in the middle, twice.
        for time_s in [1.0, 3.0] {
            let wipe = at(Layout::Wipe, time_s);
            let pixel = |x| wipe.get_pixel(x, 30).0;
            assert_eq!([pixel(90), pixel(100), pixel(110)], [[200, 10, 10], [255; 3], [10, 10, 210]]);
        }
        assert_eq!(at(Layout::Wipe, 2.0).get_pixel(199, 40).0, [200, 10, 10], "the line is beyond the edge");
        assert_eq!(at(Layout::Difference, 0.0).get_pixel(150, 40).0, [255, 0, 255]);
    }

    #[test]
    fn frames_are_paired_by_number_or_by_time() {
        let run = |fps: f64, frames: Vec<u32>| PageData { fps, size: [1, 1], frames, ..PageData::default() };
        let of = |a: &PageData, b: &PageData| -> Vec<[u32; 2]> {
            pairs(a, b).iter().map(|pair| [pair.first, pair.second]).collect()
        };
        let slow = run(12.0, vec![1, 2, 3, 5]);
        assert_eq!(of(&slow, &run(12.0, vec![2, 3, 4])), [[2, 2], [3, 3]]);
        assert_eq!(of(&slow, &run(24.0, (1..=6).collect())), [[1, 1], [2, 3], [3, 5]]);
        assert_eq!(of(&run(24.0, vec![1, 2, 3]), &slow), [[1, 1], [2, 1], [3, 2]]);
    }
}
