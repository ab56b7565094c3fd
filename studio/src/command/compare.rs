//! `rubor compare A B`: measures the difference of two images, or of the images of two folders; two runs on one page or in
//! one video.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rubor::measure::difference::{Compared, Difference, of_files};
use rubor::notes::Note;
use rubor::review::versus::{self, Layout, RunFolder};
use rubor::review::video::{NO_ENCODER, Video};
use rubor::{Failure, Outcome, output};
use rubor_assets::compare::flip;
use serde::Serialize;

use super::{console, print_json};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Image (PNG, TIFF, EXR) or folder to judge
    test: PathBuf,
    /// Reference image or folder
    reference: PathBuf,
    /// Picture of the visible differences (PNG; for folders, a folder)
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Pixels per degree of vision, for FLIP
    #[arg(long, default_value_t = flip::PIXELS_PER_DEGREE, value_name = "PIXELS")]
    pixels_per_degree: f64,
    /// Fail with exit code 1 when the mean of FLIP is larger
    #[arg(long, value_name = "MEAN")]
    most: Option<f64>,
    /// Page of two runs, in a folder with their frames that can be moved and sent: wipe, difference, notes
    #[arg(long, value_name = "DIR", conflicts_with = "output")]
    page: Option<PathBuf>,
    /// Video (.mp4) of the frames that two runs share
    #[arg(long, value_name = "FILE", conflicts_with = "output")]
    video: Option<PathBuf>,
    /// How the video shows both
    #[arg(long, value_enum, value_name = "LAYOUT", default_value = "side-by-side", requires = "video")]
    layout: Layout,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// One pair of images.
#[derive(Serialize)]
struct Row {
    name: String,
    #[serde(flatten)]
    difference: Difference,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let ppd = arguments.pixels_per_degree;
    if !(ppd.is_finite() && (1.0..=1000.0).contains(&ppd)) {
        return Err(Failure::input(format!("--pixels-per-degree: found {ppd}, expected 1 to 1000")));
    }
    if arguments.page.is_some() || arguments.video.is_some() {
        return runs(arguments);
    }
    let is_folder = arguments.reference.is_dir();
    let pairs = if is_folder {
        folder_pairs(&arguments.test, &arguments.reference)?
    } else {
        let name = arguments.reference.display().to_string();
        vec![(name, arguments.test.clone(), arguments.reference.clone())]
    };
    let (mut differences, mut notes) = (Vec::new(), Vec::new());
    for (name, test, reference) in pairs {
        let picture = arguments.output.as_ref().map(|o| match is_folder {
            true => o.join(Path::new(&name).with_extension("png")),
            false => o.clone(),
        });
        if is_folder && let Some(folder) = &arguments.output {
            output::folder(folder)?;
        }
        let Compared { difference, picture: visible, notes: found } = of_files(&test, &reference, ppd)?;
        notes.extend(found);
        if let Some(path) = picture {
            output::save_picture(&path, &visible)?;
        }
        if !arguments.json {
            tell(&name, &difference)?;
        }
        differences.push(Row { name, difference });
    }
    console::notes(&notes);
    judge(arguments, &differences)
}

fn tell(name: &str, difference: &Difference) -> Outcome {
    say!(
        "{name}: relative RMSE {:.5}, relMSE {:.6}, FLIP mean {:.4}, 99th percentile {:.4}",
        difference.relative_rmse,
        difference.rel_mse,
        difference.flip_mean,
        difference.flip_99
    );
    Ok(())
}

/// Prints the JSON, and fails where the images are too far apart.
fn judge(arguments: &Arguments, differences: &[Row]) -> Outcome {
    if arguments.json {
        print_json(&differences)?;
    }
    let worst = differences.iter().map(|d| d.difference.flip_mean).fold(0.0, f64::max);
    match arguments.most {
        Some(most) if worst > most => Err(Failure::job(format!(
            "the images differ: mean of FLIP {worst:.4}, at most {most} is allowed"
        ))),
        _ => Ok(()),
    }
}

/// Compares the frames of two runs, as far as they can be, and shows both on a page.
fn runs(arguments: &Arguments) -> Outcome {
    for folder in [&arguments.test, &arguments.reference] {
        if !folder.is_dir() {
            let found = if folder.exists() { "a file" } else { "no such folder" };
            let expected = "expected the folder of a run, as --page and --video need";
            return Err(Failure::input(format!("{}: found {found}, {expected}", folder.display())));
        }
    }
    let (test, reference) = (RunFolder::open(&arguments.test)?, RunFolder::open(&arguments.reference)?);
    let mut notes = [&test.notes[..], &reference.notes[..], &versus::unlike(&test, &reference)].concat();
    let mut differences: BTreeMap<u32, Difference> = BTreeMap::new();
    if test.data.size == reference.data.size {
        let pairs = versus::pairs(&test.data, &reference.data);
        let mut progress = console::Progress::new("frames compared", pairs.len() as u64);
        for pair in pairs {
            let (a, b) = (test.picture(pair.first), reference.picture(pair.second));
            match of_files(&a, &b, arguments.pixels_per_degree) {
                Ok(compared) => {
                    notes.extend(compared.notes);
                    differences.insert(pair.first, compared.difference);
                }
                // One frame that cannot be read does not hide the others; the page shows it as missing.
                Err(failure) => notes.push(Note::new("", failure.to_string())),
            }
            rubor::Watch::step(&mut progress);
        }
        rubor::Watch::end(&mut progress);
    }
    console::notes(&notes);
    if let Some(folder) = &arguments.page {
        let path = versus::page(&test, &reference, &differences, folder)?;
        console::error_line(format_args!("page: {}", path.display()));
    }
    if let Some(path) = &arguments.video {
        match versus::video(&test, &reference, arguments.layout, path)? {
            Video::Written => console::error_line(format_args!("video: {}", path.display())),
            Video::NoEncoder => return Err(Failure::job(NO_ENCODER)),
        }
    }
    let rows: Vec<Row> = differences
        .into_iter()
        .map(|(number, difference)| Row { name: format!("frame.{number:04}.png"), difference })
        .collect();
    if !arguments.json {
        rows.iter().try_for_each(|row| tell(&row.name, &row.difference))?;
    }
    judge(arguments, &rows)
}

/// Images of the reference folder with the images of the same name.
fn folder_pairs(test: &Path, reference: &Path) -> Outcome<Vec<(String, PathBuf, PathBuf)>> {
    let wrong = |e: std::io::Error| Failure::read(reference, e);
    let mut pairs = Vec::new();
    for entry in std::fs::read_dir(reference).map_err(wrong)? {
        let path = entry.map_err(wrong)?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        if !matches!(extension.as_deref(), Some("png" | "exr" | "tif" | "tiff")) {
            continue;
        }
        let Some(name) = path.file_name() else { continue };
        let other = test.join(name);
        if !other.is_file() {
            let name = name.to_string_lossy();
            return Err(Failure::input(format!(
                "{}: found no {name}, which {} has",
                test.display(),
                reference.display()
            )));
        }
        pairs.push((name.to_string_lossy().into_owned(), other, path));
    }
    pairs.sort();
    if pairs.is_empty() {
        return Err(Failure::input(format!("{}: found no images (png, tif, exr)", reference.display())));
    }
    Ok(pairs)
}
