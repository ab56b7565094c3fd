//! `rubor maps`: converts measured and painted maps to the maps of a head, as files or into a head file.
//!
//! ```text
//! images --hemoglobin, chromophores, normals, transfer, predict--> folder of maps
//!                                                   --into HEAD--> another head with these maps
//! head   --list, extract--> sizes and origins of its maps, their images
//! ```

use std::path::Path;

use clap::{Args, Subcommand, ValueEnum};
use rubor_assets::convert::hemoglobin::HemoglobinUnit;
use rubor_assets::image_io::{LoadedImage, Purpose, ReadOptions, SampleKind, load_image_with};
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped};
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};
use serde_json::{Value, json};

use super::console;
use rubor::notes::{Note, summed};
use rubor::{Outcome, output};

mod chromophores;
mod compare;
mod destination;
mod hemoglobin;
mod list;
mod normals;
mod predict;
mod transfer;

/// Arguments of `rubor maps`.
#[derive(Debug, Args)]
pub(crate) struct MapsArgs {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: MapsCommand,
    /// Print the result as JSON.
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

/// Subcommands of `rubor maps`.
#[derive(Debug, Subcommand)]
pub(crate) enum MapsCommand {
    /// Scale and bias of hemoglobin distributions from measured maps
    Hemoglobin(hemoglobin::HemoglobinArgs),
    /// Melanin and hemoglobin maps from an albedo texture
    Chromophores(chromophores::ChromophoresArgs),
    /// Normal maps, slopes, wrinkles and difference maps into each other
    Normals(normals::NormalsArgs),
    /// The hemoglobin changes of one head for another
    Transfer(transfer::TransferArgs),
    /// Distributions and wrinkle weights of a head from the strain of its expressions
    Predict(predict::PredictArgs),
    /// The error of scale and bias against exact local histogram matching
    Compare(compare::CompareArgs),
    /// The maps of a head: sizes, ranges, origin, memory on the graphics card
    List(list::ListArgs),
    /// The maps of a head as images of their values
    Extract(list::ExtractArgs),
    /// The skin colour look-up as a picture
    Lookup(LookupArgs),
}

/// Unit names as arguments.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum UnitArg {
    /// `normalized` for files of integers, `volume-fraction` for files of floats
    Automatic,
    /// White is the largest fraction of the model, 0.32
    Normalized,
    /// Volume fraction of the dermis
    VolumeFraction,
    /// Volume percent
    Percent,
}

impl From<UnitArg> for HemoglobinUnit {
    fn from(unit: UnitArg) -> Self {
        match unit {
            UnitArg::Automatic => Self::Automatic,
            UnitArg::Normalized => Self::Normalized,
            UnitArg::VolumeFraction => Self::VolumeFraction,
            UnitArg::Percent => Self::Percent,
        }
    }
}

/// How images are read.
#[derive(Debug, Args)]
pub(crate) struct ImageArgs {
    /// Layer of the EXR images by its name, or by the last word of it [default: the unnamed one, or one whose name fits]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
}

impl ImageArgs {
    /// Options of the readers.
    fn options(&self, purpose: Purpose) -> ReadOptions {
        ReadOptions { layer: self.layer.clone(), purpose, ..ReadOptions::default() }
    }
}

/// Arguments of `rubor maps lookup`.
#[derive(Debug, Args)]
pub(crate) struct LookupArgs {
    /// Texels along each axis
    #[arg(long, default_value_t = 128, value_parser = clap::value_parser!(u32).range(2..=8192))]
    pub(crate) size: u32,
    /// `.png` in sRGB or `.exr` linear
    #[arg(short, long)]
    pub(crate) output: std::path::PathBuf,
}

/// Runs `rubor maps`.
///
/// # Errors
/// Input that cannot be used; output that cannot be written.
pub(crate) fn run(arguments: &MapsArgs) -> Outcome {
    let mut notes = Vec::new();
    let report = match &arguments.command {
        MapsCommand::Hemoglobin(a) => hemoglobin::run(a, &mut notes),
        MapsCommand::Chromophores(a) => chromophores::run(a, &mut notes),
        MapsCommand::Normals(a) => normals::run(a, &mut notes),
        MapsCommand::Transfer(a) => transfer::run(a, &mut notes),
        MapsCommand::Predict(a) => predict::run(a, &mut notes),
        MapsCommand::Compare(a) => compare::run(a, &mut notes),
        MapsCommand::List(a) => list::run(a, &mut notes),
        MapsCommand::Extract(a) => list::extract(a, &mut notes),
        MapsCommand::Lookup(a) => run_lookup(a),
    };
    // Before an error: what a reader chose may explain it.
    console::notes(&notes);
    let mut report = report?;
    if !arguments.json {
        return print_fields(&report);
    }
    if !notes.is_empty() {
        report["notes"] = json!(summed(&notes));
    }
    super::print_json(&report)
}

/// One line for each field; the entries of a list on lines of their own.
fn print_fields(report: &Value) -> Outcome {
    let plain = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    for (name, value) in report.as_object().into_iter().flatten() {
        match value.as_array() {
            Some(items) => {
                say!("{name}:");
                for item in items {
                    match item.as_object() {
                        Some(fields) => {
                            let title =
                                ["name", "region", "texture"].into_iter().find(|k| fields.contains_key(*k));
                            let rest: Vec<_> = (fields.iter())
                                .filter(|(k, _)| Some(k.as_str()) != title)
                                .map(|(k, v)| format!("{k} {}", plain(v)))
                                .collect();
                            let title = title.map(|k| format!("{}: ", plain(&fields[k]))).unwrap_or_default();
                            say!("  {title}{}", rest.join(", "));
                        }
                        None => say!("  {}", plain(item)),
                    }
                }
            }
            None => say!("{name}: {}", plain(value)),
        }
    }
    Ok(())
}

/// Reads an image and keeps what its reader has to say.
fn load(file: &Path, options: &ReadOptions, notes: &mut Vec<Note>) -> Outcome<LoadedImage> {
    let image = load_image_with(file, options)?;
    note_image(file, &image.notes, notes);
    Ok(image)
}

/// Remarks of a reader about its file.
fn note_image(file: &Path, found: &[String], notes: &mut Vec<Note>) {
    notes.extend(found.iter().map(|message| Note::new(file.display().to_string(), message)));
}

/// Skin texels of an image: its alpha, and a drawn mask of its size.
fn load_mask(image: &LoadedImage, file: Option<&Path>, notes: &mut Vec<Note>) -> Outcome<Mask> {
    let mask = image.mask();
    let Some(file) = file else { return Ok(mask) };
    let drawn = load(file, &ReadOptions::default(), notes)?;
    drawn.require_size(mask.width, mask.height)?;
    Ok(mask.and(&Mask::above(&drawn.require_grey()?, 0, 0.5)))
}

/// A grey map of values, finite everywhere: texels without alpha take those around them.
fn load_values(file: &Path, options: &ReadOptions, notes: &mut Vec<Note>) -> Outcome<Map> {
    let image = load(file, options, notes)?;
    let mask = image.mask();
    image.require_finite(&mask)?;
    let mut map = image.require_grey()?;
    fill_unmapped(&mut map, &mask);
    Ok(map)
}

fn is_exr(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"))
}

fn run_lookup(a: &LookupArgs) -> Outcome<Value> {
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(a.size, a.size);
    let floats = is_exr(&a.output);
    let encode = |c: f32| if floats { c } else { rubor_rig::color::srgb_encode(c.clamp(0.0, 1.0)) };
    let values = lookup.texels.iter().flatten().map(|c| encode(*c)).collect();
    let map = Map { width: lookup.width, height: lookup.height, channels: 3, values };
    output::save_map(&a.output, &map, if floats { SampleKind::F32 } else { SampleKind::U8 })?;
    Ok(json!({ "written": a.output }))
}
