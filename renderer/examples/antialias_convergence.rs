//! Error of every antialiasing mode on analytic scenes against 16 x 16 samples per pixel, and how much the result of
//! each mode changes when an image is rotated. Prints the tables of `docs/antialiasing.md` and writes its plot into the
//! folder named on the command line.
//!
//! The scenes are filtered by the CPU reference, which the kernels equal (tests of the renderer).

use rayon::prelude::*;
use rubor_renderer::antialias::reference::{Picture, average, filter_sample, filter_samples};
use rubor_renderer::antialias::{Encoding, Mode, Preset, Settings, Tables};
use std::fmt::Write;

const SIDE: usize = 96;
/// Points a side of a pixel for the truth.
const POINTS: usize = 16;

type Scene = Box<dyn Fn(f64, f64) -> f32 + Sync + Send>;

/// Light at a point turned by `degrees` around the middle of the picture.
fn turned(degrees: f64, scene: impl Fn(f64, f64) -> bool + Sync + Send + 'static) -> Scene {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let middle = SIDE as f64 / 2.0 + 0.13;
    Box::new(move |x, y| {
        let (x, y) = (x - middle, y - middle);
        if scene(x * cos + y * sin, y * cos - x * sin) { 0.9 } else { 0.05 }
    })
}

/// Bars of the letters R U B O R in a grid of 4 x 5 units.
fn letters(x: f64, y: f64) -> bool {
    const ROWS: [[u32; 5]; 5] = [
        [0b1110, 0b1001, 0b1110, 0b0110, 0b1110],
        [0b1001, 0b1001, 0b1001, 0b1001, 0b1001],
        [0b1110, 0b1001, 0b1110, 0b1001, 0b1110],
        [0b1010, 0b1001, 0b1001, 0b1001, 0b1010],
        [0b1001, 0b0110, 0b1110, 0b0110, 0b1001],
    ];
    let unit = 3.1;
    let (column, row) = ((x / unit + 12.5).floor() as i32, (y / unit + 2.5).floor() as i32);
    let letter = column.div_euclid(5);
    let bit = column.rem_euclid(5);
    (0..5).contains(&letter)
        && (0..5).contains(&row)
        && bit < 4
        && ROWS[row as usize][letter as usize] >> (3 - bit) & 1 == 1
}

/// Circles of a radius about 16 places in a pixel.
fn circles(radius: f64) -> impl Iterator<Item = Scene> {
    (0..16).map(move |i| {
        let (x, y) = (0.25 * f64::from(i % 4), 0.25 * f64::from(i / 4));
        turned(0.0, move |px, py| (px + x).hypot(py + y) < radius)
    })
}

fn groups() -> Vec<(&'static str, Vec<Scene>)> {
    let angles = |step: usize| (0..90).step_by(step).map(|d| d as f64);
    vec![
        ("lines, 0 to 90 degrees", angles(1).map(|d| turned(d, |_, y| y > 0.0)).collect()),
        ("corners", angles(9).map(|d| turned(d, |x, y| x.abs() < 21.0 && y.abs() < 21.0)).collect()),
        ("circles", [3.0, 7.5, 16.2, 33.7].into_iter().flat_map(circles).collect()),
        ("wires, 0.6 px", angles(9).map(|d| turned(d, |_, y| (y + 60.0).rem_euclid(12.0) < 0.6)).collect()),
        ("wires, 1.5 px", angles(9).map(|d| turned(d, |_, y| (y + 60.0).rem_euclid(12.0) < 1.5)).collect()),
        ("letters", angles(15).map(|d| turned(d, letters)).collect()),
        (
            "checkers, 7.3 px",
            angles(9)
                .map(|d| turned(d, |x, y| ((x / 7.3).floor() + (y / 7.3).floor()) % 2.0 == 0.0))
                .collect(),
        ),
        (
            "turning grid, 1 px",
            angles(9)
                .map(|d| {
                    turned(d, |x, y| (x + 80.0).rem_euclid(9.0) < 1.0 || (y + 80.0).rem_euclid(9.0) < 1.0)
                })
                .collect(),
        ),
    ]
}

fn sampled(scene: &Scene, offset: [f32; 2]) -> Picture {
    Picture::from_fn(SIDE, SIDE, |x, y| {
        let v = scene(x as f64 + 0.5 + f64::from(offset[0]), y as f64 + 0.5 + f64::from(offset[1]));
        [v, v, v, 1.0]
    })
}

fn truth(scene: &Scene) -> Vec<f32> {
    let at = |i: usize| (i as f64 + 0.5) / POINTS as f64;
    (0..SIDE * SIDE)
        .map(|i| {
            let (x, y) = ((i % SIDE) as f64, (i / SIDE) as f64);
            let sum: f32 = (0..POINTS * POINTS).map(|p| scene(x + at(p % POINTS), y + at(p / POINTS))).sum();
            sum / (POINTS * POINTS) as f32
        })
        .collect()
}

/// A still scene after the history has converged.
fn result(scene: &Scene, tables: &Tables, settings: &Settings) -> Picture {
    let frame = |frame| {
        let samples = settings.mode.subsamples(frame);
        let pictures: Vec<Picture> =
            samples.iter().map(|sample| sampled(scene, sample.position_px)).collect();
        filter_samples(&pictures, frame, tables, settings)
    };
    if settings.mode.is_temporal() { average(&[frame(0), frame(1)], settings) } else { frame(0) }
}

/// Root of the mean square error in light over pixels that contain an edge, away from the border.
fn error(picture: &[f32], truth: &[f32]) -> (f64, f64) {
    let margin = 8..SIDE - 8;
    (0..truth.len())
        .filter(|i| margin.contains(&(i % SIDE)) && margin.contains(&(i / SIDE)))
        .filter(|&i| truth[i] > 0.0501 && truth[i] < 0.8999)
        .map(|i| f64::from(picture[i] - truth[i]).powi(2))
        .fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0))
}

fn main() {
    let mut names: Vec<String> = Mode::ALL.map(|mode| mode.name().to_owned()).into();
    names.push("ssaa:4".to_owned());
    println!("| scene | {} |", names.join(" | "));
    println!("| --- |{}", " --- |".repeat(names.len()));
    let settings =
        Mode::ALL.map(|mode| Settings { encoding: Encoding::Linear, ..Settings::new(mode, Preset::Ultra) });
    let tables = settings.map(|s| Tables::new(&s));
    let mut by_angle: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
    for (name, scenes) in groups() {
        let errors: Vec<Vec<(f64, f64)>> = scenes
            .par_iter()
            .map(|scene| {
                let truth = truth(scene);
                let mut errors: Vec<(f64, f64)> = settings
                    .iter()
                    .zip(&tables)
                    .map(|(settings, tables)| {
                        let picture = result(scene, tables, settings);
                        let light: Vec<f32> = picture.pixels.iter().map(|pixel| pixel[0]).collect();
                        error(&light, &truth)
                    })
                    .collect();
                let quarter = [-0.25f32, 0.25];
                let four: Vec<Picture> =
                    (0..4).map(|i| sampled(scene, [quarter[i % 2], quarter[i / 2]])).collect();
                let light: Vec<f32> = (0..truth.len())
                    .map(|i| four.iter().map(|p| p.pixels[i][0]).sum::<f32>() / 4.0)
                    .collect();
                errors.push(error(&light, &truth));
                errors
            })
            .collect();
        print!("| {name} |");
        for mode in 0..names.len() {
            let (sum, count) =
                errors.iter().fold((0.0, 0.0), |total, e| (total.0 + e[mode].0, total.1 + e[mode].1));
            print!(" {:.4} |", (sum / count).sqrt());
        }
        println!();
        if name.starts_with("lines") {
            for scene in &errors {
                for (mode, (sum, count)) in scene.iter().enumerate() {
                    by_angle[mode].push(if *count > 0.0 { (sum / count).sqrt() } else { 0.0 });
                }
            }
        }
    }
    turning();
    if let Some(folder) = std::env::args().nth(1) {
        let path = std::path::Path::new(&folder).join("antialiasing-lines.svg");
        match std::fs::write(&path, plot(&names, &by_angle)) {
            Ok(()) => println!("\nwrote {}", path.display()),
            Err(error) => eprintln!("{}: {error}", path.display()),
        }
    }
}

/// Share of edge pixels that change by more than 1/255 when the picture is turned or mirrored, filtered and turned back.
fn turning() {
    type Place = fn(usize, usize) -> (usize, usize);
    let last = SIDE - 1;
    let turns: [(&str, Place, Place); 4] = [
        ("90 degrees", |x, y| (SIDE - 1 - y, x), |x, y| (y, SIDE - 1 - x)),
        ("180 degrees", |x, y| (SIDE - 1 - x, SIDE - 1 - y), |x, y| (SIDE - 1 - x, SIDE - 1 - y)),
        ("mirrored", |x, y| (SIDE - 1 - x, y), |x, y| (SIDE - 1 - x, y)),
        ("transposed", |x, y| (y, x), |x, y| (y, x)),
    ];
    debug_assert_eq!(turns[0].1(0, last), (0, 0));
    println!("\n| turned by | {} |", [Mode::Mlaa, Mode::Smaa1x].map(Mode::name).join(" | "));
    println!("| --- | --- | --- |");
    for (name, there, back) in turns {
        print!("| {name} |");
        for mode in [Mode::Mlaa, Mode::Smaa1x] {
            let settings = Settings::new(mode, Preset::High);
            let tables = Tables::new(&settings);
            let filter =
                |picture: &Picture| filter_sample(picture, None, &mode.subsamples(0)[0], &tables, &settings);
            let (mut edge, mut different) = (0, 0);
            for (_, scenes) in groups() {
                for scene in scenes {
                    let picture = sampled(&scene, [0.0; 2]);
                    let moved = Picture::from_fn(SIDE, SIDE, |x, y| {
                        let (x, y) = there(x, y);
                        picture.at(x as isize, y as isize)
                    });
                    let (plain, other) = (filter(&picture), filter(&moved));
                    for i in 0..SIDE * SIDE {
                        let (x, y) = back(i % SIDE, i / SIDE);
                        let (a, b) = (plain.pixels[i][0], other.at(x as isize, y as isize)[0]);
                        if a != picture.pixels[i][0] || b != picture.pixels[i][0] {
                            edge += 1;
                            different += usize::from((a - b).abs() > 1.0 / 255.0);
                        }
                    }
                }
            }
            print!(" {:.2} % |", 100.0 * different as f64 / edge as f64);
        }
        println!();
    }
}

/// Error against angle as a vector picture.
fn plot(names: &[String], errors: &[Vec<f64>]) -> String {
    const COLORS: [&str; 7] = ["#888888", "#c0504d", "#e8a33d", "#4f9d4f", "#3b76b5", "#7b4fa3", "#222222"];
    let (width, height, left, bottom) = (720.0, 360.0, 54.0, 40.0);
    let top = errors.iter().flatten().fold(0.0f64, |a, b| a.max(*b)) * 1.05;
    let x = |degrees: f64| left + degrees / 89.0 * (width - left - 120.0);
    let y = |error: f64| (height - bottom) - error / top * (height - bottom - 12.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    let mut add = |line: String| svg.push_str(&(line + "\n"));
    for tick in 0..=4 {
        let error = top * f64::from(tick) / 4.0;
        let line_y = y(error);
        add(format!(
            "<path d=\"M{left} {line_y:.1}H{:.1}\" stroke=\"#dddddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{error:.2}</text>",
            x(89.0),
            left - 6.0,
            line_y + 4.0
        ));
    }
    for degrees in (0..=90).step_by(15) {
        let at = x(f64::from(degrees.min(89)));
        add(format!(
            "<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{degrees}°</text>",
            height - bottom + 18.0
        ));
    }
    add(format!(
        "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">direction of the line; RMS error in light at its pixels</text>",
        x(45.0),
        height - 6.0
    ));
    for (mode, name) in names.iter().enumerate() {
        let mut path = String::new();
        for (degrees, error) in errors[mode].iter().enumerate() {
            let _ = write!(
                path,
                "{}{:.1} {:.1}",
                if degrees == 0 { "M" } else { "L" },
                x(degrees as f64),
                y(*error)
            );
        }
        let color = COLORS[mode % COLORS.len()];
        add(format!("<path d=\"{path}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.6\"/>"));
        let label_y = 24.0 + 18.0 * mode as f64;
        add(format!("<text x=\"{}\" y=\"{label_y}\" fill=\"{color}\">{name}</text>", width - 108.0));
    }
    svg + "</svg>\n"
}
