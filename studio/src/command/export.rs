//! `rubor export`: an animated head for other programs.

use std::path::{Path, PathBuf};

use rubor_assets::export::gltf::{self, MapEncodings};
use rubor_assets::export::{Performance, TextureFormat, top_shapes, usd};
use rubor_rig::evaluate::Evaluator;
use rubor_rig::expression::Rig;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::Head;
use rubor_rig::names::nearest;
use rubor_rig::timeline::{Sequence, Track};
use serde_json::json;

use rubor::inputs;
use rubor::notes::Note;
use rubor::{Failure, Outcome};

use super::{console, print_json};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A head (.glb, .gltf, .vrm, .obj, .usda or .usdz) [default: the built-in head]
    #[arg(long, value_name = "FILE")]
    head: Option<PathBuf>,
    /// A rig (.json) [default: the head's own]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// A sequence (.json) to animate [default: the one in the head, if it has one]
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// The file to write (.glb, .usda with its pictures beside it, or .usdz with them inside)
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Write no animation
    #[arg(long, conflicts_with = "sequence")]
    still: bool,
    /// Bake blood and wrinkles of one pose into the pictures: a time in seconds, or an expression or state
    #[arg(long, value_name = "TIME|NAME")]
    bake: Option<String>,
    /// Largest error of weights when keys are left out; 0 keeps every authored key
    #[arg(long, default_value_t = 1e-5, value_name = "WEIGHT", value_parser = parse_tolerance)]
    tolerance: f32,
    /// Straight lines between more keys instead of cubics, for programs that drop the slopes of keys (Blender)
    #[arg(long)]
    linear: bool,
    /// Pictures for other programs: png, jpeg, or webp (.glb only)
    #[arg(long, default_value = "jpeg", value_name = "FORMAT", value_parser = parse_textures)]
    textures: TextureFormat,
    /// Only the N shapes that move most, for viewers with a limit
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    top_shapes: Option<u32>,
    /// No vertex colours per shape, which viewers without the extension would show
    #[arg(long)]
    no_colors: bool,
    /// Smaller file: maps as JPEG, no normals of shapes for other viewers
    #[arg(long)]
    small: bool,
    /// A file for the web, about a third of the size: geometry and animation coded (EXT_meshopt_compression, positions within
    /// 4 micrometres), maps as JPEG. three.js, Babylon.js, model-viewer and glTFast read it; Blender does not (.glb only)
    #[arg(long)]
    compress: bool,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

fn parse_tolerance(text: &str) -> Result<f32, String> {
    let number = text.parse::<f32>().ok().filter(|t| (0.0..0.5).contains(t));
    number.ok_or_else(|| format!("found {text:?}, expected a weight from 0 to less than 0.5"))
}

fn parse_textures(text: &str) -> Result<TextureFormat, String> {
    match text {
        "png" => Ok(TextureFormat::Png),
        "jpeg" | "jpg" => Ok(TextureFormat::Jpeg),
        "webp" => Ok(TextureFormat::Webp),
        "ktx2" => {
            Err("KTX2 for glTF needs a Basis Universal encoder, which rubor does not have: export with \
                       png and convert the file, for example with `gltf-transform uastc` or `toktx`"
                .into())
        }
        _ => Err(format!("found {text:?}, expected png, jpeg or webp")),
    }
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let path = &arguments.output;
    let is = |extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    if !is("glb") && !is("usda") && !is("usdz") {
        return Err(Failure::input(format!(
            "{}: expected a name that ends in .glb, .usda or .usdz",
            path.display()
        )));
    }
    let loaded = inputs::head(arguments.head.as_deref())?;
    console::notes(&loaded.notes);
    let rig = inputs::rig(arguments.rig.as_deref(), loaded.rig)?;
    let head = &loaded.head;
    let sequence = match &arguments.sequence {
        Some(path) => {
            let (sequence, found) = inputs::sequence(Some(path))?;
            console::notes(&found);
            Some(sequence)
        }
        None => loaded.sequence.filter(|_| !arguments.still),
    };
    let pose = arguments.bake.as_deref().map(|at| pose(at, head, &rig, sequence.as_ref())).transpose()?;
    let shapes = match arguments.top_shapes {
        Some(count) => {
            let performance = sequence.as_ref().map(|sequence| Performance { rig: &rig, sequence });
            Some(top_shapes(head, performance, count as usize)?)
        }
        None => None,
    };
    let kept = shapes.as_ref().map_or(head.shapes.len(), Vec::len);
    let mut notes = Vec::new();
    if kept < head.shapes.len() {
        let left: Vec<&str> = (head.shapes.iter().enumerate())
            .filter(|(i, _)| shapes.as_ref().is_some_and(|kept| !kept.contains(i)))
            .map(|(_, s)| s.name.as_str())
            .collect();
        notes.push(format!("{} shapes are left out: {}", left.len(), left.join(", ")));
    }
    if is("usda") || is("usdz") {
        if arguments.compress {
            return Err(Failure::input(
                "--compress: USD has no such coding, expected a name that ends in .glb",
            ));
        }
        let options = usd::Options {
            color_map_size: if arguments.small { 1024 } else { 2048 },
            pose,
            textures: arguments.textures,
            shape_normals: !arguments.small,
            shapes,
            rig: Some(&rig),
            sequence: sequence.as_ref(),
            tolerance: arguments.tolerance,
            ..usd::Options::default()
        };
        let layer = if is("usdz") {
            usd::write_package(head, &options, path)?
        } else {
            usd::write(head, &options, path)?
        };
        let size = layer.package_size.unwrap_or(layer.text.len());
        notes.extend(layer.notes);
        return report(arguments, path, head, kept, layer.keys, size, &notes);
    }
    let options = gltf::Options {
        color_map_size: if arguments.small { 1024 } else { 2048 },
        pose,
        textures: arguments.textures,
        morph_normals: !arguments.small,
        shape_colors: !arguments.no_colors,
        compress: arguments.compress,
        maps: if arguments.small || arguments.compress {
            MapEncodings::small()
        } else {
            MapEncodings::default()
        },
        shapes,
        rig: Some(&rig),
        sequence: sequence.as_ref(),
        tolerance: arguments.tolerance,
        only_lines: arguments.linear,
        ..gltf::Options::default()
    };
    let exported = gltf::write(head, &options, path)?;
    notes.extend(exported.notes);
    report(arguments, path, head, kept, exported.keys, exported.bytes.len(), &notes)
}

/// The face at a time of the sequence, or with one expression or state at full weight.
fn pose(at: &str, head: &Head, rig: &Rig, sequence: Option<&Sequence>) -> Outcome<FaceState> {
    let mut still = Sequence::still(24.0, 1.0);
    let full = || Track::Constant(1.0);
    let (sequence, time_s) = match at.parse::<f64>() {
        Ok(time) => {
            let Some(sequence) = sequence else {
                return Err(Failure::input(format!("--bake {at}: a time needs a sequence"))
                    .hint("add --sequence FILE, or name an expression"));
            };
            if !(0.0..=sequence.duration).contains(&time) {
                return Err(Failure::input(format!(
                    "--bake: found {at}, expected a time from 0 to {} s",
                    sequence.duration
                )));
            }
            (sequence, time)
        }
        Err(_) if rig.expressions.contains_key(at) => {
            still.expressions.insert(at.to_owned(), full());
            (&still, 0.0)
        }
        Err(_) if rig.states.contains_key(at) => {
            still.states.insert(at.to_owned(), full());
            (&still, 0.0)
        }
        Err(_) => {
            let known = || rig.expressions.keys().chain(rig.states.keys()).map(String::as_str);
            let list = known().collect::<Vec<_>>().join(", ");
            let failure =
                Failure::input(format!("--bake: found {at:?}, expected a time in seconds or one of {list}"));
            return Err(match nearest(at, known()) {
                Some(name) => failure.hint(format!("did you mean {name:?}?")),
                None => failure,
            });
        }
    };
    let (evaluator, _) = Evaluator::new(head, rig, sequence)?;
    Ok(evaluator.face_at(time_s))
}

fn report(
    arguments: &Arguments,
    path: &Path,
    head: &Head,
    shapes: usize,
    keys: usize,
    bytes: usize,
    notes: &[String],
) -> Outcome {
    if arguments.json {
        return print_json(&json!({
            "file": path, "bytes": bytes, "points": head.mesh.points.len(),
            "triangles": head.mesh.triangles.len(), "shapes": shapes, "keys": keys, "notes": notes,
        }));
    }
    console::notes(&notes.iter().map(|n| Note::new(path.display().to_string(), n)).collect::<Vec<_>>());
    say!(
        "{}: {} points, {} triangles, {shapes} shapes, {keys} keys, {:.1} MB",
        path.display(),
        head.mesh.points.len(),
        head.mesh.triangles.len(),
        bytes as f64 * 1e-6
    );
    Ok(())
}
