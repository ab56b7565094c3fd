//! `rubor maps chromophores`.

use std::path::PathBuf;

use clap::Args;
use rubor_assets::convert::chromophores::{self, AlbedoEncoding, DEFAULT_GAMUT_THRESHOLD};
use rubor_assets::convert::into_head;
use rubor_assets::convert::skin_texels::{SkinTexels, require_layout};
use rubor_assets::image_io::{Purpose, SampleKind};
use rubor_rig::map::Map;
use rubor_rig::mask::{Mask, fill_unmapped};
use rubor_rig::skin::chromophores::{ChromophoreModel, SkinModel};
use serde_json::{Value, json};

use super::destination::{Destination, file_name};
use super::{ImageArgs, load, load_mask};
use rubor::notes::Note;
use rubor::output;
use rubor::{Failure, Outcome};

/// Texels of the look-up along each axis.
const LOOKUP_SIZE: u32 = 128;

/// Arguments of `rubor maps chromophores`.
#[derive(Debug, Args)]
pub(crate) struct ChromophoresArgs {
    /// Albedo texture or cross-polarised photograph
    albedo: PathBuf,
    /// Image whose white is skin; alpha applies as well
    #[arg(long)]
    mask: Option<PathBuf>,
    /// The file is linear Rec. 709 [default: sRGB for integers, linear for floats]
    #[arg(long)]
    linear: bool,
    /// Factor from the values to reflectance, for melanin and hemoglobin: the colour stays [default: estimated]
    #[arg(long)]
    gain: Option<f32>,
    /// Leave the colour out: the head then shows what melanin and hemoglobin can say
    #[arg(long)]
    no_color: bool,
    /// CIEDE2000 residual above which a texel is out of gamut
    #[arg(long, default_value_t = DEFAULT_GAMUT_THRESHOLD)]
    threshold: f32,
    #[command(flatten)]
    images: ImageArgs,
    #[command(flatten)]
    to: Destination,
}

/// Texels that show no skin take the colour of the skin around them: filters read it at the edges.
fn filled(mut albedo: Map, mask: &Mask) -> Map {
    fill_unmapped(&mut albedo, mask);
    albedo
}

pub(super) fn run(a: &ChromophoresArgs, notes: &mut Vec<Note>) -> Outcome<Value> {
    let receiver = a.to.head(notes)?;
    let image = load(&a.albedo, &a.images.options(Purpose::Values), notes)?;
    let mut mask = load_mask(&image, a.mask.as_deref(), notes)?;
    let encoding = if a.linear { AlbedoEncoding::Linear } else { AlbedoEncoding::Automatic };
    let albedo = chromophores::linear_albedo(&image, encoding)?;
    if let Some(receiver) = &receiver {
        let skin = SkinTexels::new(&receiver.head, mask.width, mask.height).mask();
        let not_black = |(m, c): (&bool, &[f32])| *m && c.iter().any(|v| *v > 0.0);
        let data = Mask {
            mapped: mask.mapped.iter().zip(albedo.values.chunks_exact(3)).map(not_black).collect(),
            ..mask
        };
        require_layout(&a.albedo.display().to_string(), &data, &skin)?;
        mask = mask.and(&skin);
    }
    if mask.count() == 0 {
        return Err(Failure::input(format!("{}: found no mapped texel, expected skin", a.albedo.display())));
    }
    let lookup = SkinModel::new(&ChromophoreModel::default()).bake(LOOKUP_SIZE, LOOKUP_SIZE);
    let options = chromophores::Options { gain: a.gain, threshold: a.threshold };
    let maps = chromophores::convert(&albedo, &mask, &lookup, &options)?;
    let mut report = serde_json::to_value(maps.summary).map_err(Failure::job)?;
    report["exposure"] = serde_json::to_value(maps.exposure).map_err(Failure::job)?;
    let about = a.albedo.display().to_string();
    if a.gain.is_none() {
        notes.push(Note::new(&about, format!("the exposure was estimated: gain {}", maps.exposure)));
    }
    if maps.summary.is_painted {
        let message = "hardly a texel has a colour of skin: all have the blood and the pigment of one colour";
        notes.push(Note::new(&about, message));
    }
    let Some(mut receiver) = receiver else {
        output::folder(&a.to.output)?;
        for (name, map) in
            [("melanin", &maps.melanin), ("hemoglobin", &maps.hemoglobin), ("residual", &maps.residual)]
        {
            output::save_map(&a.to.output.join(format!("{name}.exr")), map, SampleKind::F32)?;
        }
        let marks = Map {
            values: maps.out_of_gamut.mapped.iter().map(|m| f32::from(u8::from(*m))).collect(),
            ..maps.residual.clone()
        };
        output::save_map(&a.to.output.join("out_of_gamut.png"), &marks, SampleKind::U8)?;
        report["written"] = json!(a.to.output);
        return Ok(report);
    };
    let origin = a.to.origin(format!("rubor maps chromophores of {}", file_name(&a.albedo)));
    into_head::put_chromophores(&mut receiver.head, maps.melanin, maps.hemoglobin, &origin)?;
    if a.no_color {
        receiver.head.maps.albedo = None;
    } else {
        if receiver.head.maps.hair.is_some() {
            let message = "the hair map of the head and its grown brows are left out: the colour of its skin has its own hair";
            notes.push(Note::new(&about, message));
        }
        into_head::put_albedo(&mut receiver.head, filled(albedo, &mask), &origin)?;
    }
    a.to.write(&receiver)?;
    report["written"] = json!(a.to.output);
    Ok(report)
}
