//! `rubor maps transfer`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use rubor_assets::convert::into_head;
use rubor_assets::convert::surface_warp::surface_warp;
use rubor_assets::convert::transfer::{self, BiasTransfer, Correspondence, Warp};
use rubor_assets::files::plain_names;
use rubor_assets::image_io::{Purpose, ReadOptions, SampleKind};
use rubor_rig::head::{Distribution, Head};
use rubor_rig::map::Map;
use serde_json::{Value, json};

use super::destination::{Destination, file_name};
use super::{ImageArgs, load_values};
use rubor::notes::Note;
use rubor::{Failure, Outcome};
use rubor::{inputs, output};

/// Arguments of `rubor maps transfer`.
#[derive(Debug, Args)]
pub(crate) struct TransferArgs {
    /// Giver: a head (.glb, .gltf), or a folder as written by `rubor maps hemoglobin`
    #[arg(long)]
    from: PathBuf,
    /// Neutral mean of the receiver (`neutral_mean.exr`) where the results are files
    #[arg(long, required_unless_present = "into", conflicts_with = "into")]
    to_mean: Option<PathBuf>,
    /// JSON list of {"receiver": [u, v], "giver": [u, v]}
    #[arg(long)]
    correspondences: Option<PathBuf>,
    /// Both have one texture layout [default: for files, and for heads with equal texture coordinates; other heads
    /// are matched by the landmarks that both have]
    #[arg(long, conflicts_with = "correspondences")]
    same_layout: bool,
    /// Only these distributions; repeat for more [default: all]
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// How the bias is adapted to another level of blood
    #[arg(long, value_enum, default_value = "ratio")]
    bias: BiasArg,
    #[command(flatten)]
    images: ImageArgs,
    #[command(flatten)]
    to: Destination,
}

/// Bias modes as arguments.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum BiasArg {
    /// The same percentage
    Ratio,
    /// The same amount
    Difference,
    /// The giver's blood
    Absolute,
}

/// The giver: distributions, their neutral mean, and the head if there is one.
struct Giver {
    distributions: Vec<Distribution>,
    mean: Map,
    head: Option<Head>,
}

pub(super) fn run(a: &TransferArgs, notes: &mut Vec<Note>) -> Outcome<Value> {
    let receiver = a.to.head(notes)?;
    let giver = giver(a, notes)?;
    let receiver_mean = match (&receiver, &a.to_mean) {
        (Some(receiver), _) => mean_of(&receiver.head)?,
        (None, Some(file)) => load_values(file, &a.images.options(Purpose::Values), notes)?,
        (None, None) => return Err(Failure::input("expected --to-mean or --into")),
    };
    let head = receiver.as_ref().map(|r| &r.head);
    let (warp, way) = warp(a, giver.head.as_ref(), head, &receiver_mean)?;
    let mode = match a.bias {
        BiasArg::Ratio => BiasTransfer::Ratio,
        BiasArg::Difference => BiasTransfer::Difference,
        BiasArg::Absolute => BiasTransfer::Absolute,
    };
    let given = giver.distributions.iter();
    let own = given
        .map(|d| Ok(transfer::transfer(d, &giver.mean, &receiver_mean, &warp, mode)?))
        .collect::<Outcome<Vec<_>>>()?;
    let names: Vec<&String> = giver.distributions.iter().map(|d| &d.name).collect();
    let report = json!({ "distributions": names, "through": way, "written": a.to.output });
    match receiver {
        Some(mut receiver) => {
            let origin = a.to.origin(format!("rubor maps transfer from {}", file_name(&a.from)));
            into_head::put_given_distributions(&mut receiver.head, own, receiver_mean, &origin);
            a.to.write(&receiver)?;
        }
        None => {
            output::folder(&a.to.output)?;
            let files = plain_names(own.iter().map(|d| d.name.as_str()));
            for (d, stem) in own.iter().zip(&files) {
                note_renamed("distribution", &d.name, stem, notes);
                for (what, map) in [("scale", &d.scale), ("bias", &d.bias)] {
                    let file = a.to.output.join(format!("{stem}_{what}.exr"));
                    output::save_map(&file, map, SampleKind::F32)?;
                }
            }
            output::save_map(&a.to.output.join("neutral_mean.exr"), &receiver_mean, SampleKind::F32)?;
        }
    }
    Ok(report)
}

/// Says where a file got another name than what it holds.
pub(super) fn note_renamed(what: &str, name: &str, file: &str, notes: &mut Vec<Note>) {
    if name != file {
        let message = format!("{what} {name:?}: no name of a file of its own, written as {file:?}");
        notes.push(Note::new("", message));
    }
}

fn giver(a: &TransferArgs, notes: &mut Vec<Note>) -> Outcome<Giver> {
    let mut giver = if a.from.is_dir() {
        from_folder(&a.from, notes)?
    } else {
        let loaded = inputs::head(Some(&a.from))?;
        notes.extend(loaded.notes);
        let head = loaded.head;
        let distributions = head.maps.distributions.clone();
        if distributions.is_empty() {
            let found = "found a head without distributions, expected one that has some";
            return Err(Failure::input(format!("{}: {found}", a.from.display())));
        }
        Giver { distributions, mean: mean_of(&head)?, head: Some(head) }
    };
    for name in &a.only {
        if giver.distributions.iter().all(|d| d.name != *name) {
            let names: Vec<_> = giver.distributions.iter().map(|d| d.name.as_str()).collect();
            return Err(Failure::input(format!("--only {name}: expected one of {}", names.join(", "))));
        }
    }
    giver.distributions.retain(|d| a.only.is_empty() || a.only.contains(&d.name));
    Ok(giver)
}

fn from_folder(folder: &Path, notes: &mut Vec<Note>) -> Outcome<Giver> {
    let entries = std::fs::read_dir(folder)
        .map_err(|e| Failure::input(format!("{}: cannot be read: {e}", folder.display())))?;
    let mut names: Vec<String> = entries
        .filter_map(|e| e.ok()?.file_name().to_str()?.strip_suffix("_scale.exr").map(str::to_owned))
        .collect();
    names.sort();
    if names.is_empty() {
        let found = "found no NAME_scale.exr, expected distributions";
        return Err(Failure::input(format!("{}: {found}", folder.display())));
    }
    let options = ReadOptions::default();
    let mean = load_values(&folder.join("neutral_mean.exr"), &options, notes)?;
    let read = |name: &String| {
        let mut map = |what: &str| load_values(&folder.join(format!("{name}_{what}.exr")), &options, notes);
        Ok(Distribution { name: name.clone(), scale: map("scale")?, bias: map("bias")? })
    };
    let distributions = names.iter().map(read).collect::<Outcome<_>>()?;
    Ok(Giver { distributions, mean, head: None })
}

/// The neutral mean of a head's distributions, or that of its blood.
pub(super) fn mean_of(head: &Head) -> Outcome<Map> {
    if let Some(mean) = &head.maps.hemoglobin_mean {
        return Ok(mean.clone());
    }
    let Some(blood) = &head.maps.hemoglobin else {
        let found = format!("head {:?}: found no hemoglobin map, expected one", head.name);
        return Err(Failure::input(found).hint("`rubor maps chromophores` makes one from an albedo texture"));
    };
    Ok(into_head::neutral_mean(head, blood)?)
}

/// The mapping from the receiver's texture to the giver's, and its name.
fn warp(
    a: &TransferArgs,
    giver: Option<&Head>,
    receiver: Option<&Head>,
    mean: &Map,
) -> Outcome<(Warp, &'static str)> {
    if let Some(file) = &a.correspondences {
        let text = rubor_rig::limits::read_to_string(file)
            .map_err(|e| Failure::input(format!("{}: cannot be read: {e}", file.display())))?;
        let pairs: Vec<Correspondence> =
            serde_json::from_str(&text).map_err(|e| Failure::input(format!("{}: {e}", file.display())))?;
        return Ok((Warp::through(&pairs)?, "correspondences"));
    }
    match (giver, receiver) {
        (Some(giver), Some(receiver)) if !a.same_layout && !same_layout(giver, receiver) => {
            Ok((surface_warp(receiver, giver, mean.width, mean.height)?, "landmarks"))
        }
        _ => Ok((Warp::Identity, "one layout")),
    }
}

fn same_layout(a: &Head, b: &Head) -> bool {
    let (a, b) = (&a.mesh, &b.mesh);
    a.vertices.len() == b.vertices.len()
        && a.vertices.iter().zip(&b.vertices).all(|(v, w)| v.uv.distance(w.uv) < 1e-4)
}
