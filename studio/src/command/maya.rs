//! `rubor maya`: Maya ASCII scenes in and out.

use std::path::{Path, PathBuf};

use clap::Subcommand;
use rubor_assets::import::gltf::Extent;
use rubor_maya::read;
use rubor_maya::write::{self, Performance};
use rubor_rig::expression::Rig;

use super::fit::{Fit, Read};
use super::import::{Common, finish_with};
use rubor::notes::Note;
use rubor::{Failure, Outcome};
use rubor::{inputs, output};

use super::console;

#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Make a head, and a sequence of its keys, from a Maya ASCII scene
    Import(Import),
    /// Write a head, with a performance if one is given, as a Maya ASCII scene with its textures
    Export(Export),
}

#[derive(clap::Args)]
struct Import {
    /// Maya ASCII scene (.ma)
    scene: PathBuf,
    /// Only meshes whose path contains this, such as |head_grp|
    #[arg(long, value_name = "PART")]
    mesh: Option<String>,
    /// Also write the keyed weights and the motion of the head (.json)
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    #[command(flatten)]
    fit: Fit,
    #[command(flatten)]
    common: Common,
}

#[derive(clap::Args)]
struct Export {
    /// A head (.glb, .gltf, .vrm, .obj, .usda or .usdz) [default: the built-in head]
    #[arg(long, value_name = "FILE")]
    head: Option<PathBuf>,
    /// A rig (.json) [default: the head's own]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// A sequence (.json) to key
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// The scene to write (.ma); textures and the OSL shader go beside it
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    match &arguments.action {
        Action::Import(a) => import(a),
        Action::Export(a) => export(a),
    }
}

fn require_extension(path: &Path, extension: &str) -> Outcome {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension)) {
        return Ok(());
    }
    Err(Failure::input(format!("{}: expected a name that ends in .{extension}", path.display())))
}

fn import(arguments: &Import) -> Outcome {
    let options = read::Options { mesh: arguments.mesh.clone() };
    let mut imported = read::read(&arguments.scene, &options)?;
    let about = arguments.scene.display().to_string();
    console::notes(&imported.notes.iter().map(|note| Note::new(&about, note)).collect::<Vec<_>>());
    // The reader makes metres of the scene's own unit.
    arguments.fit.apply(&mut imported.head, &Extent::default(), Read::METRES, &arguments.scene)?;
    if let Some(path) = &arguments.sequence {
        require_extension(path, "json")?;
        let Some(sequence) = &imported.sequence else {
            let found = format!("{}: found no keys, expected some for --sequence", arguments.scene.display());
            return Err(Failure::input(found));
        };
        output::write_json(path, sequence)?;
        say!("{}: {} frames at {} per second", path.display(), sequence.frame_count(), sequence.fps);
    }
    let mut rig = match &imported.rig {
        Some(value) => Rig::from_json(&format!("{} (rig)", arguments.scene.display()), &value.to_string())?,
        None => Rig::default_rig()?,
    };
    for inbetween in imported.inbetweens {
        let same =
            |i: &rubor_rig::expression::Inbetween| i.shape == inbetween.shape && i.target == inbetween.target;
        if !rig.inbetweens.iter().any(same) {
            rig.inbetweens.push(inbetween);
        }
    }
    finish_with(imported.head, &rig, rubor_assets::synthesize::Options::default(), &arguments.common)
}

fn export(arguments: &Export) -> Outcome {
    require_extension(&arguments.output, "ma")?;
    let loaded = inputs::head(arguments.head.as_deref())?;
    console::notes(&loaded.notes);
    let rig = inputs::rig(arguments.rig.as_deref(), loaded.rig)?;
    let sequence = match &arguments.sequence {
        Some(path) => {
            let (sequence, found) = inputs::sequence(Some(path))?;
            console::notes(&found);
            Some(sequence)
        }
        None => None,
    };
    let options = write::Options {
        base_color: rubor_assets::export::skin_color::bake(&loaded.head, None, 2048, 1.0),
        // Only those of which the head has both ends.
        inbetweens: (rig.inbetweens.iter())
            .filter(|i| [&i.shape, &i.target].iter().all(|n| loaded.head.shape_index(n).is_some()))
            .cloned()
            .collect(),
        rig: Some(rig.clone()),
    };
    let performance = sequence.as_ref().map(|sequence| Performance { rig: &rig, sequence });
    let notes = write::write(&loaded.head, performance, &options, &arguments.output)?;
    console::notes(&notes.iter().map(|note| Note::new("", note)).collect::<Vec<_>>());
    say!(
        "{}: {} points, {} targets{}",
        arguments.output.display(),
        loaded.head.mesh.points.len(),
        loaded.head.shapes.len(),
        sequence.map_or_else(String::new, |s| format!(", {} frames", s.frame_count()))
    );
    Ok(())
}
