//! `rubor compare A B`: measures the difference of two images, or of the images of two folders.

use std::path::{Path, PathBuf};

use rubor::measure::difference::{Compared, Difference, of_files};
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
            say!(
                "{name}: relative RMSE {:.5}, relMSE {:.6}, FLIP mean {:.4}, 99th percentile {:.4}",
                difference.relative_rmse,
                difference.rel_mse,
                difference.flip_mean,
                difference.flip_99
            );
        }
        differences.push(Row { name, difference });
    }
    console::notes(&notes);
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
