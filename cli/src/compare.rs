//! `rubor compare A B`: how far two images, or the images of two folders, are apart.

use std::path::{Path, PathBuf};

use rubor_assets::compare::{Pixels, flip, mean_and_percentile, rel_mse, relative_rmse};
use rubor_assets::image_io::{SampleKind, load_image};
use rubor_rig::color::srgb_decode;
use serde::Serialize;

use crate::failure::{Failure, Outcome};
use crate::output;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Image (PNG, TIFF, EXR) or folder to judge
    test: PathBuf,
    /// Image or folder that is right
    reference: PathBuf,
    /// Picture of the visible differences (PNG; for folders, a folder)
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Pixels in a degree of vision, for FLIP
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
#[serde(rename_all = "camelCase")]
struct Difference {
    name: String,
    /// Of linear light, over all pixels.
    relative_rmse: f64,
    rel_mse: f64,
    flip_mean: f64,
    #[serde(rename = "flip99")]
    flip_99: f64,
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
    let mut differences = Vec::new();
    for (name, test, reference) in pairs {
        let picture = arguments.output.as_ref().map(|o| match is_folder {
            true => o.join(Path::new(&name).with_extension("png")),
            false => o.clone(),
        });
        if is_folder && let Some(folder) = &arguments.output {
            output::folder(folder)?;
        }
        let difference = compare(name, &test, &reference, ppd, picture.as_deref())?;
        if !arguments.json {
            println!(
                "{}: relative RMSE {:.5}, relMSE {:.6}, FLIP mean {:.4}, 99th percentile {:.4}",
                difference.name,
                difference.relative_rmse,
                difference.rel_mse,
                difference.flip_mean,
                difference.flip_99
            );
        }
        differences.push(difference);
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&differences).map_err(Failure::job)?);
    }
    let worst = differences.iter().map(|d| d.flip_mean).fold(0.0, f64::max);
    match arguments.most {
        Some(most) if worst > most => Err(Failure::job(format!(
            "the images differ: mean of FLIP {worst:.4}, at most {most} is allowed"
        ))),
        _ => Ok(()),
    }
}

/// Images of the reference folder with their namesakes.
fn folder_pairs(test: &Path, reference: &Path) -> Outcome<Vec<(String, PathBuf, PathBuf)>> {
    let wrong = |e: std::io::Error| Failure::input(format!("{}: cannot be read: {e}", reference.display()));
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

fn compare(
    name: String,
    test: &Path,
    reference: &Path,
    pixels_per_degree: f64,
    picture: Option<&Path>,
) -> Outcome<Difference> {
    let ((t, t_is_light), (r, r_is_light)) = (read(test)?, read(reference)?);
    if (t.width, t.height) != (r.width, r.height) {
        return Err(Failure::input(format!(
            "{}: found {}x{} pixels, expected {}x{} as in {}",
            test.display(),
            t.width,
            t.height,
            r.width,
            r.height,
            reference.display()
        )));
    }
    let map = if t_is_light && r_is_light {
        flip::hdr(&t, &r, pixels_per_degree)
    } else {
        flip::ldr(&t, &r, pixels_per_degree)
    };
    if let Some(path) = picture {
        let image = difference_picture(&map, r.width as u32, r.height as u32);
        output::commit(path, |partial| image.save(partial).map_err(std::io::Error::other))?;
    }
    let (flip_mean, flip_99) = mean_and_percentile(&map);
    Ok(Difference {
        name,
        relative_rmse: relative_rmse(&t.linear, &r.linear),
        rel_mse: rel_mse(&t.linear, &r.linear),
        flip_mean,
        flip_99,
    })
}

/// Black, violet, orange, yellow, white: each step brighter than the last.
pub(crate) fn difference_picture(map: &[f32], width: u32, height: u32) -> image::RgbImage {
    const STOPS: [[f32; 3]; 5] = [
        [0.0, 0.0, 4.0],
        [87.0, 16.0, 110.0],
        [229.0, 92.0, 48.0],
        [252.0, 200.0, 60.0],
        [255.0, 255.0, 245.0],
    ];
    image::RgbImage::from_fn(width, height, |x, y| {
        let v = map[(y * width + x) as usize].clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
        let i = (v as usize).min(STOPS.len() - 2);
        let t = v - i as f32;
        image::Rgb(std::array::from_fn(|c| (STOPS[i][c] + t * (STOPS[i + 1][c] - STOPS[i][c])).round() as u8))
    })
}

/// Linear pixels, and whether the file holds light (floats) and not display values.
fn read(path: &Path) -> Outcome<(Pixels, bool)> {
    let image = load_image(path).map_err(Failure::input)?;
    let is_light = image.kind == SampleKind::F32;
    let map = &image.map;
    let texel = |i: usize| -> [f32; 3] {
        let at = &map.values[i * map.channels as usize..];
        let rgb = if map.channels >= 3 { [at[0], at[1], at[2]] } else { [at[0]; 3] };
        if is_light { rgb } else { rgb.map(srgb_decode) }
    };
    let (width, height) = (map.width as usize, map.height as usize);
    let linear: Vec<_> = (0..width * height).map(texel).collect();
    if let Some(i) = linear.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
        return Err(Failure::input(format!(
            "{}: found a value that is not finite at column {}, row {}",
            path.display(),
            i % width,
            i / width
        )));
    }
    Ok((Pixels { width, height, linear }, is_light))
}
