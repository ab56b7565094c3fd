//! `rubor maps`: measured and painted maps into what a head needs.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use miette::{IntoDiagnostic, WrapErr, miette};
use rubor_assets::convert::chromophores::{self, AlbedoEncoding, DEFAULT_GAMUT_THRESHOLD};
use rubor_assets::convert::hemoglobin::{
    self, Calibration, HemoglobinManifest, HemoglobinSource, HemoglobinUnit,
};
use rubor_assets::convert::normals::{self, GreenAxis};
use rubor_assets::convert::transfer::{self, BiasTransfer, Correspondence, Warp};
use rubor_assets::image_io::{SampleKind, load_image, save_image};
use rubor_rig::head::Distribution;
use rubor_rig::hemoglobin::histogram_matching::{map_difference, match_locally};
use rubor_rig::hemoglobin::{blend, distribution, local_statistics, neutral};
use rubor_rig::map::Map;
use rubor_rig::mask::Mask;
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};
use serde_json::json;

/// Texels of the look-up along each axis for conversions.
const LOOKUP_SIZE: u32 = 128;

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
    Hemoglobin(HemoglobinArgs),
    /// Melanin and hemoglobin maps from an albedo texture
    Chromophores(ChromophoresArgs),
    /// Normal maps, slopes and difference maps into each other
    Normals(NormalsArgs),
    /// The hemoglobin changes of one head for another
    Transfer(TransferArgs),
    /// How far scale and bias are from exact local histogram matching
    Compare(CompareArgs),
    /// The skin colour look-up as a picture
    Lookup(LookupArgs),
}

/// Unit names as arguments.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum UnitArg {
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
            UnitArg::Normalized => Self::Normalized,
            UnitArg::VolumeFraction => Self::VolumeFraction,
            UnitArg::Percent => Self::Percent,
        }
    }
}

/// Arguments of `rubor maps hemoglobin`.
#[derive(Debug, Args)]
pub(crate) struct HemoglobinArgs {
    /// Manifest (JSON) that names all maps; the other arguments are then not needed
    #[arg(long, conflicts_with_all = ["neutral", "target"])]
    pub(crate) manifest: Option<PathBuf>,
    /// Neutral hemoglobin map (PNG, TIFF or EXR)
    #[arg(long, required_unless_present = "manifest")]
    pub(crate) neutral: Option<PathBuf>,
    /// NAME=FILE of an expression or condition; repeat for more
    #[arg(long, value_name = "NAME=FILE")]
    pub(crate) target: Vec<String>,
    /// Image whose white is skin
    #[arg(long)]
    pub(crate) mask: Option<PathBuf>,
    /// Unit of the values
    #[arg(long, value_enum, default_value = "normalized")]
    pub(crate) unit: UnitArg,
    /// Factor of calibration
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    pub(crate) gain: f64,
    /// Offset of calibration, after the factor
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub(crate) offset: f64,
    /// Radius of the window, texels [default: a 64th of the larger side]
    #[arg(long)]
    pub(crate) radius: Option<u32>,
    /// Side of the results, texels
    #[arg(long, default_value_t = 256)]
    pub(crate) size: u32,
    /// Folder for the results
    #[arg(short, long)]
    pub(crate) output: PathBuf,
}

/// Arguments of `rubor maps chromophores`.
#[derive(Debug, Args)]
pub(crate) struct ChromophoresArgs {
    /// Albedo texture or cross-polarised photograph
    pub(crate) albedo: PathBuf,
    /// Image whose white is skin; alpha applies as well
    #[arg(long)]
    pub(crate) mask: Option<PathBuf>,
    /// The file is linear Rec. 709 [default: sRGB for integers, linear for floats]
    #[arg(long)]
    pub(crate) linear: bool,
    /// Factor that brings the values to reflectance
    #[arg(long, default_value_t = 1.0)]
    pub(crate) gain: f32,
    /// CIEDE2000 residual above which a texel is out of gamut
    #[arg(long, default_value_t = DEFAULT_GAMUT_THRESHOLD)]
    pub(crate) threshold: f32,
    /// Folder for the results
    #[arg(short, long)]
    pub(crate) output: PathBuf,
}

/// What `rubor maps normals` makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum NormalsTarget {
    /// Partial derivative slopes of a normal map
    Slopes,
    /// A normal map of slopes (floats)
    Normals,
    /// The difference of a wrinkle normal map to a base
    Difference,
}

/// Arguments of `rubor maps normals`.
#[derive(Debug, Args)]
pub(crate) struct NormalsArgs {
    /// Normal map, or slopes as floats
    pub(crate) input: PathBuf,
    /// What to make
    #[arg(long, value_enum)]
    pub(crate) to: NormalsTarget,
    /// Base normal map of a difference
    #[arg(long, required_if_eq("to", "difference"))]
    pub(crate) base: Option<PathBuf>,
    /// Green grows downwards (DirectX)
    #[arg(long)]
    pub(crate) directx: bool,
    /// Value of the largest code [default: the largest value of the map]
    #[arg(long)]
    pub(crate) range: Option<f32>,
    /// Bits of a PNG or integer TIFF: 8 or 16
    #[arg(long, default_value_t = 16)]
    pub(crate) bits: u32,
    /// Result; `.exr` holds the values themselves
    #[arg(short, long)]
    pub(crate) output: PathBuf,
}

/// Arguments of `rubor maps transfer`.
#[derive(Debug, Args)]
pub(crate) struct TransferArgs {
    /// Folder of the giver as written by `rubor maps hemoglobin`
    #[arg(long)]
    pub(crate) from: PathBuf,
    /// Neutral mean of the receiver (`neutral_mean.exr`)
    #[arg(long)]
    pub(crate) to_mean: PathBuf,
    /// JSON list of {"receiver": [u, v], "giver": [u, v]}; without it both share one layout
    #[arg(long)]
    pub(crate) correspondences: Option<PathBuf>,
    /// How the bias crosses to another level of blood
    #[arg(long, value_enum, default_value = "ratio")]
    pub(crate) bias: BiasArg,
    /// Folder for the results
    #[arg(short, long)]
    pub(crate) output: PathBuf,
}

/// Bias modes as arguments.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum BiasArg {
    /// The same percentage
    Ratio,
    /// The same amount
    Difference,
    /// The giver's blood
    Absolute,
}

/// Arguments of `rubor maps compare`.
#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// Neutral map
    #[arg(long)]
    pub(crate) neutral: PathBuf,
    /// Expression or condition map of the same size
    #[arg(long)]
    pub(crate) target: PathBuf,
    /// Unit of the values
    #[arg(long, value_enum, default_value = "normalized")]
    pub(crate) unit: UnitArg,
    /// Radius of the window, texels
    #[arg(long)]
    pub(crate) radius: u32,
    /// Side of the distribution, texels
    #[arg(long, default_value_t = 256)]
    pub(crate) size: u32,
    /// Grid of regions, along each axis
    #[arg(long, default_value_t = 4)]
    pub(crate) regions: u32,
    /// Picture: exact, Gaussian, difference x 8, side by side
    #[arg(short, long)]
    pub(crate) output: Option<PathBuf>,
}

/// Arguments of `rubor maps lookup`.
#[derive(Debug, Args)]
pub(crate) struct LookupArgs {
    /// Texels along each axis
    #[arg(long, default_value_t = 128)]
    pub(crate) size: u32,
    /// `.png` in sRGB or `.exr` linear
    #[arg(short, long)]
    pub(crate) output: PathBuf,
}

/// Runs `rubor maps`.
///
/// # Errors
/// Input that cannot be used and output that cannot be written; all of them are the user's to mend (exit code 2)
/// except those of writing.
pub(crate) fn run(arguments: &MapsArgs) -> miette::Result<()> {
    let report = match &arguments.command {
        MapsCommand::Hemoglobin(a) => run_hemoglobin(a)?,
        MapsCommand::Chromophores(a) => run_chromophores(a)?,
        MapsCommand::Normals(a) => run_normals(a)?,
        MapsCommand::Transfer(a) => run_transfer(a)?,
        MapsCommand::Compare(a) => run_compare(a)?,
        MapsCommand::Lookup(a) => run_lookup(a)?,
    };
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&report).into_diagnostic()?);
    } else if let Some(fields) = report.as_object() {
        for (name, value) in fields {
            match value.as_array() {
                Some(items) => {
                    println!("{name}:");
                    items.iter().for_each(|item| println!("  {item}"));
                }
                None => println!("{name}: {value}"),
            }
        }
    }
    Ok(())
}

fn load_mask(image: &rubor_assets::image_io::LoadedImage, file: Option<&Path>) -> miette::Result<Mask> {
    let mask = image.mask();
    let Some(file) = file else { return Ok(mask) };
    let drawn = load_image(file).into_diagnostic()?;
    drawn.require_size(mask.width, mask.height).into_diagnostic()?;
    Ok(mask.and(&Mask::above(&drawn.require_grey().into_diagnostic()?, 0, 0.5)))
}

fn make_folder(folder: &Path) -> miette::Result<()> {
    std::fs::create_dir_all(folder)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot make {}", folder.display()))
}

fn run_hemoglobin(a: &HemoglobinArgs) -> miette::Result<serde_json::Value> {
    let (manifest, folder) = match &a.manifest {
        Some(file) => {
            let folder = file.parent().unwrap_or(Path::new("")).to_owned();
            (hemoglobin::read_manifest(file).into_diagnostic()?, folder)
        }
        None => {
            let source = |t: &String| {
                let (name, file) =
                    t.split_once('=').ok_or_else(|| miette!("--target {t}: expected NAME=FILE"))?;
                Ok(HemoglobinSource { name: name.into(), file: file.into(), calibration: None })
            };
            let manifest = HemoglobinManifest {
                neutral: a.neutral.clone().ok_or_else(|| miette!("--neutral or --manifest is needed"))?,
                distributions: a.target.iter().map(source).collect::<miette::Result<_>>()?,
                mask: a.mask.clone(),
                calibration: Calibration { unit: a.unit.into(), gain: a.gain, offset: a.offset },
                radius_px: a.radius,
                size: a.size,
            };
            (manifest, PathBuf::new())
        }
    };
    let maps = hemoglobin::convert(&manifest, &folder).into_diagnostic()?;
    let written = hemoglobin::write(&maps, &a.output).into_diagnostic()?;
    let summary = |d: &Distribution| {
        let mean = |m: &Map| m.values.iter().sum::<f32>() / m.values.len() as f32;
        json!({ "name": d.name, "mean_scale": mean(&d.scale), "mean_bias": mean(&d.bias) })
    };
    Ok(json!({
        "radius_px": maps.radius_px,
        "skin_texels": maps.mask.count(),
        "clamped_texels": maps.clamped_texels,
        "distributions": maps.distributions.iter().map(summary).collect::<Vec<_>>(),
        "written": written,
    }))
}

fn run_chromophores(a: &ChromophoresArgs) -> miette::Result<serde_json::Value> {
    let image = load_image(&a.albedo).into_diagnostic()?;
    let mask = load_mask(&image, a.mask.as_deref())?;
    let encoding = if a.linear { AlbedoEncoding::Linear } else { AlbedoEncoding::Automatic };
    let albedo = chromophores::linear_albedo(&image, encoding, a.gain).into_diagnostic()?;
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(LOOKUP_SIZE, LOOKUP_SIZE);
    let maps = chromophores::convert(&albedo, &mask, &lookup, a.threshold).into_diagnostic()?;
    make_folder(&a.output)?;
    for (name, map) in
        [("melanin", &maps.melanin), ("hemoglobin", &maps.hemoglobin), ("residual", &maps.residual)]
    {
        save_image(&a.output.join(format!("{name}.exr")), map, SampleKind::F32).into_diagnostic()?;
    }
    let marks = Map {
        values: maps.out_of_gamut.mapped.iter().map(|m| f32::from(u8::from(*m))).collect(),
        ..maps.residual.clone()
    };
    save_image(&a.output.join("out_of_gamut.png"), &marks, SampleKind::U8).into_diagnostic()?;
    serde_json::to_value(maps.summary).into_diagnostic()
}

fn run_normals(a: &NormalsArgs) -> miette::Result<serde_json::Value> {
    let green = if a.directx { GreenAxis::DirectX } else { GreenAxis::OpenGl };
    let input = load_image(&a.input).into_diagnostic()?;
    input.require_finite(&Mask::full(input.map.width, input.map.height)).into_diagnostic()?;
    let floats = a.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    let (signed, mut report) = match a.to {
        NormalsTarget::Normals => {
            let codes = normals::normals_from_slopes(&input.map, green).into_diagnostic()?;
            let kind = if floats { SampleKind::F32 } else { integer_kind(a.bits)? };
            save_image(&a.output, &codes, kind).into_diagnostic()?;
            return Ok(json!({ "written": a.output }));
        }
        NormalsTarget::Slopes => {
            let rgb = input.require_rgb().into_diagnostic()?;
            let slopes = normals::slopes_from_normals(&rgb, green).into_diagnostic()?;
            let report = json!({
                "largest_slope": slopes.largest,
                "texels_beyond_45_degrees": slopes.beyond_45_degrees,
                "clamped_texels": slopes.clamped_texels,
            });
            (slopes.map, report)
        }
        NormalsTarget::Difference => {
            let base = a.base.as_deref().ok_or_else(|| miette!("a difference needs --base"))?;
            let base = load_image(base).into_diagnostic()?.require_rgb().into_diagnostic()?;
            let wrinkles = input.require_rgb().into_diagnostic()?;
            (normals::difference(&base, &wrinkles).into_diagnostic()?, json!({}))
        }
    };
    if floats {
        save_image(&a.output, &signed, SampleKind::F32).into_diagnostic()?;
    } else {
        let encoded = normals::encode_signed(&signed, a.range, a.bits).into_diagnostic()?;
        save_image(&a.output, &encoded.codes, integer_kind(a.bits)?).into_diagnostic()?;
        report["range"] = json!(encoded.range);
    }
    report["written"] = json!(a.output);
    Ok(report)
}

fn integer_kind(bits: u32) -> miette::Result<SampleKind> {
    match bits {
        8 => Ok(SampleKind::U8),
        16 => Ok(SampleKind::U16),
        other => Err(miette!("--bits {other}: expected 8 or 16")),
    }
}

fn run_transfer(a: &TransferArgs) -> miette::Result<serde_json::Value> {
    let grey = |file: &Path| -> miette::Result<Map> {
        let image = load_image(file).into_diagnostic()?;
        image.require_finite(&Mask::full(image.map.width, image.map.height)).into_diagnostic()?;
        image.require_grey().into_diagnostic()
    };
    let (giver_mean, receiver_mean) = (grey(&a.from.join("neutral_mean.exr"))?, grey(&a.to_mean)?);
    let warp = match &a.correspondences {
        None => Warp::Identity,
        Some(file) => {
            let text = std::fs::read_to_string(file)
                .into_diagnostic()
                .wrap_err_with(|| format!("cannot read {}", file.display()))?;
            let pairs: Vec<Correspondence> = serde_json::from_str(&text)
                .into_diagnostic()
                .wrap_err_with(|| format!("{}", file.display()))?;
            Warp::through(&pairs).into_diagnostic()?
        }
    };
    let mode = match a.bias {
        BiasArg::Ratio => BiasTransfer::Ratio,
        BiasArg::Difference => BiasTransfer::Difference,
        BiasArg::Absolute => BiasTransfer::Absolute,
    };
    let entries =
        std::fs::read_dir(&a.from).into_diagnostic().wrap_err_with(|| format!("{}", a.from.display()))?;
    let mut names: Vec<String> = entries
        .filter_map(|e| e.ok()?.file_name().to_str()?.strip_suffix("_scale.exr").map(str::to_owned))
        .collect();
    names.sort();
    if names.is_empty() {
        return Err(miette!("{}: found no NAME_scale.exr, expected distributions", a.from.display()));
    }
    make_folder(&a.output)?;
    for name in &names {
        let given = Distribution {
            name: name.clone(),
            scale: grey(&a.from.join(format!("{name}_scale.exr")))?,
            bias: grey(&a.from.join(format!("{name}_bias.exr")))?,
        };
        let own = transfer::transfer(&given, &giver_mean, &receiver_mean, &warp, mode).into_diagnostic()?;
        for (what, map) in [("scale", &own.scale), ("bias", &own.bias)] {
            let file = a.output.join(format!("{name}_{what}.exr"));
            save_image(&file, map, SampleKind::F32).into_diagnostic()?;
        }
    }
    save_image(&a.output.join("neutral_mean.exr"), &receiver_mean, SampleKind::F32).into_diagnostic()?;
    Ok(json!({ "distributions": names }))
}

fn run_compare(a: &CompareArgs) -> miette::Result<serde_json::Value> {
    let unit = HemoglobinUnit::from(a.unit);
    let fractions =
        |file: &Path| hemoglobin::read_fractions(file, Calibration { unit, gain: 1.0, offset: 0.0 });
    let (base, base_mask, _) = fractions(&a.neutral).into_diagnostic()?;
    let (target, target_mask, _) = fractions(&a.target).into_diagnostic()?;
    if (base.width, base.height) != (target.width, target.height) {
        return Err(miette!(
            "{}: found {}x{} texels, expected {}x{} as the neutral map",
            a.target.display(),
            target.width,
            target.height,
            base.width,
            base.height
        ));
    }
    let mask = base_mask.and(&target_mask);
    let exact = match_locally(&base, &target, &mask, a.radius).into_diagnostic()?;
    // Full resolution: the Gaussian approximation alone. Reduced: with what storage adds.
    let full_size = base.width.max(base.height);
    let approximate = |size: u32| -> miette::Result<Map> {
        let n = neutral(&base, &mask, a.radius, size).into_diagnostic()?;
        let d = distribution("target", &n, &target, &mask, a.radius, size).into_diagnostic()?;
        Ok(blend(&base, &n.mean, &[d], &[1.0], 1.0))
    };
    let (gaussian, reduced) = (approximate(full_size)?, approximate(a.size)?);
    let mut regions = Vec::new();
    for j in 0..a.regions.max(1) {
        for i in 0..a.regions.max(1) {
            let mut region = mask.clone();
            for (k, m) in region.mapped.iter_mut().enumerate() {
                let (x, y) = (k as u32 % base.width, k as u32 / base.width);
                *m &= x * a.regions / base.width == i && y * a.regions / base.height == j;
            }
            if region.count() > 0 {
                regions.push(json!({
                    "column": i,
                    "row": j,
                    "gaussian": map_difference(&exact, &gaussian, &region),
                    "reduced": map_difference(&exact, &reduced, &region),
                }));
            }
        }
    }
    if let Some(file) = &a.output {
        // White is the 99th percentile: a few hairs must not turn the face black.
        let mut sorted = exact.values.clone();
        sorted.sort_by(f32::total_cmp);
        let top = sorted[(sorted.len() - 1) * 99 / 100].max(1e-6);
        let mut picture = Map { width: base.width * 3, height: base.height, channels: 1, values: Vec::new() };
        for y in 0..base.height as usize {
            let row = y * base.width as usize..(y + 1) * base.width as usize;
            picture.values.extend(exact.values[row.clone()].iter().map(|v| v / top));
            picture.values.extend(gaussian.values[row.clone()].iter().map(|v| v / top));
            let pairs = exact.values[row.clone()].iter().zip(&gaussian.values[row]);
            picture.values.extend(pairs.map(|(e, g)| 8.0 * (e - g).abs() / top));
        }
        save_image(file, &picture, SampleKind::U8).into_diagnostic()?;
    }
    let contrast = local_statistics(&base, &mask, a.radius).into_diagnostic()?.deviation;
    let mean_deviation = contrast.values.iter().sum::<f32>() / contrast.values.len() as f32;
    Ok(json!({
        "gaussian": map_difference(&exact, &gaussian, &mask),
        "reduced": map_difference(&exact, &reduced, &mask),
        "downsampling_alone": map_difference(&gaussian, &reduced, &mask),
        "neutral_mean_deviation": mean_deviation,
        "regions": regions,
    }))
}

fn run_lookup(a: &LookupArgs) -> miette::Result<serde_json::Value> {
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(a.size, a.size);
    let floats = a.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    let encode = |c: f32| if floats { c } else { rubor_rig::color::srgb_encode(c.clamp(0.0, 1.0)) };
    let values = lookup.texels.iter().flatten().map(|c| encode(*c)).collect();
    let map = Map { width: lookup.width, height: lookup.height, channels: 3, values };
    save_image(&a.output, &map, if floats { SampleKind::F32 } else { SampleKind::U8 }).into_diagnostic()?;
    Ok(json!({ "written": a.output }))
}
