//! `rubor maps hemoglobin`.

use std::path::{Path, PathBuf};

use clap::Args;
use rubor_assets::convert::hemoglobin::{self, Calibration, HemoglobinManifest, HemoglobinSource};
use rubor_assets::convert::into_head;
use rubor_rig::head::{Distribution, Head};
use rubor_rig::map::Map;
use serde_json::{Value, json};

use super::UnitArg;
use super::destination::{Destination, file_name};
use rubor::{Failure, Outcome};

/// Arguments of `rubor maps hemoglobin`.
#[derive(Debug, Args)]
pub(crate) struct HemoglobinArgs {
    /// Manifest (JSON) that names all maps; the arguments that describe maps are then not needed
    #[arg(long, conflicts_with_all = ["neutral", "target", "mask", "unit", "gain", "offset", "radius", "size"])]
    manifest: Option<PathBuf>,
    /// Neutral hemoglobin map (PNG, TIFF or EXR) [default with --into: that of the head]
    #[arg(long, required_unless_present_any = ["manifest", "into"])]
    neutral: Option<PathBuf>,
    /// NAME=FILE of an expression or condition; repeat for more
    #[arg(long, value_name = "NAME=FILE")]
    target: Vec<String>,
    /// Image whose white is skin
    #[arg(long)]
    mask: Option<PathBuf>,
    /// Unit of the values
    #[arg(long, value_enum, default_value = "automatic")]
    unit: UnitArg,
    /// Factor of calibration
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    gain: f64,
    /// Offset of calibration, after the factor
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    offset: f64,
    /// Radius of the window, texels [default: a 64th of the larger side]
    #[arg(long)]
    radius: Option<u32>,
    /// Side of the results, texels
    #[arg(long, default_value_t = 256)]
    size: u32,
    #[command(flatten)]
    to: Destination,
}

pub(super) fn run(a: &HemoglobinArgs) -> Outcome<Value> {
    let (manifest, folder) = manifest(a)?;
    let receiver = a.to.head()?;
    let maps = hemoglobin::convert(&manifest, &folder, receiver.as_ref().map(|r| &r.head))?;
    let summary = |d: &Distribution| {
        let mean = |m: &Map| m.values.iter().sum::<f32>() / m.values.len() as f32;
        json!({ "name": d.name, "mean_scale": mean(&d.scale), "mean_bias": mean(&d.bias) })
    };
    let mut report = json!({
        "radius_px": maps.radius_px,
        "skin_texels": maps.mask.count(),
        "clamped_texels": maps.clamped_texels,
        "distributions": maps.distributions.iter().map(summary).collect::<Vec<_>>(),
    });
    if !maps.constant.is_empty() {
        report["constant_maps"] = json!(maps.constant);
    }
    let Some(mut receiver) = receiver else {
        report["written"] = json!(hemoglobin::write(&maps, &a.to.output)?);
        return Ok(report);
    };
    let files: Vec<String> = (manifest.neutral.iter())
        .chain(manifest.distributions.iter().map(|d| &d.file))
        .map(|f| file_name(f))
        .collect();
    let notes = notes(&receiver.head, &maps.distributions, receiver.rig.as_ref());
    let origin = a.to.origin(format!("rubor maps hemoglobin of {}", files.join(", ")));
    let kept = into_head::put_hemoglobin(&mut receiver.head, maps, &origin)?;
    a.to.write(&receiver)?;
    report["kept_distributions"] = json!(kept);
    report["written"] = json!(a.to.output);
    if !notes.is_empty() {
        report["notes"] = json!(notes);
    }
    Ok(report)
}

/// The manifest of a file or of the arguments, and the folder that its files are relative to.
fn manifest(a: &HemoglobinArgs) -> Outcome<(HemoglobinManifest, PathBuf)> {
    if let Some(file) = &a.manifest {
        let folder = file.parent().unwrap_or(Path::new("")).to_owned();
        return Ok((hemoglobin::read_manifest(file)?, folder));
    }
    let source = |t: &String| {
        let (name, file) = t
            .split_once('=')
            .ok_or_else(|| Failure::input(format!("--target {t}: expected NAME=FILE such as joy=joy.exr")))?;
        Ok(HemoglobinSource { name: name.into(), file: file.into(), calibration: None })
    };
    let manifest = HemoglobinManifest {
        neutral: a.neutral.clone(),
        distributions: a.target.iter().map(source).collect::<Outcome<_>>()?,
        mask: a.mask.clone(),
        calibration: Calibration { unit: a.unit.into(), gain: a.gain, offset: a.offset },
        radius_px: a.radius,
        size: a.size,
    };
    Ok((manifest, PathBuf::new()))
}

/// Notes on reasons why the new maps do not show.
fn notes(head: &Head, new: &[Distribution], rig: Option<&rubor_rig::expression::Rig>) -> Vec<String> {
    let mut notes = Vec::new();
    if head.maps.melanin.is_none() {
        notes.push(
            "the head has no melanin map, so its blood does not show: `rubor maps chromophores` makes one"
                .into(),
        );
    }
    if let Some(rig) = rig {
        let used = |name: &str| {
            let expressions = rig.expressions.values().map(|e| &e.hemoglobin);
            expressions.chain(rig.states.values().map(|s| &s.hemoglobin)).any(|h| h.contains_key(name))
        };
        for d in new.iter().filter(|d| !used(&d.name)) {
            notes.push(format!("no expression or state of the head's rig uses {:?}", d.name));
        }
    }
    notes
}
