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
use rubor_assets::image_io::{LoadedImage, SampleKind, load_image};
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};
use serde_json::{Value, json};

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
    let report = match &arguments.command {
        MapsCommand::Hemoglobin(a) => hemoglobin::run(a)?,
        MapsCommand::Chromophores(a) => chromophores::run(a)?,
        MapsCommand::Normals(a) => normals::run(a)?,
        MapsCommand::Transfer(a) => transfer::run(a)?,
        MapsCommand::Predict(a) => predict::run(a)?,
        MapsCommand::Compare(a) => compare::run(a)?,
        MapsCommand::List(a) => list::run(a)?,
        MapsCommand::Extract(a) => list::extract(a)?,
        MapsCommand::Lookup(a) => run_lookup(a)?,
    };
    if arguments.json { super::print_json(&report) } else { print_fields(&report) }
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

/// Skin texels of an image: its alpha, and a drawn mask of its size.
fn load_mask(image: &LoadedImage, file: Option<&Path>) -> Outcome<Mask> {
    let mask = image.mask();
    let Some(file) = file else { return Ok(mask) };
    let drawn = load_image(file)?;
    drawn.require_size(mask.width, mask.height)?;
    Ok(mask.and(&Mask::above(&drawn.require_grey()?, 0, 0.5)))
}

/// A grey map of values, finite everywhere.
fn load_values(file: &Path) -> Outcome<Map> {
    let image = load_image(file)?;
    image.require_finite(&Mask::full(image.map.width, image.map.height))?;
    Ok(image.require_grey()?)
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
