//! `rubor maps normals`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use rubor_assets::convert::into_head;
use rubor_assets::convert::normals::{self, GreenAxis, Slopes};
use rubor_assets::image_io::{LoadedImage, Purpose, ReadOptions, SampleKind};
use rubor_rig::map::Map;
use rubor_rig::mask::fill_unmapped;
use serde_json::{Value, json};

use super::destination::{Destination, file_name};
use super::{ImageArgs, is_exr, load, note_image};
use rubor::inputs::LoadedHead;
use rubor::notes::Note;
use rubor::{Failure, Outcome, output};

/// Results of `rubor maps normals`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum NormalsTarget {
    /// Partial derivative slopes of a normal map; with --into the relief of the head
    Slopes,
    /// Slopes of wrinkles: those of the input, less those of --base; with --into a wrinkle map of the head
    Wrinkles,
    /// A normal map of slopes (floats)
    Normals,
    /// The difference of a wrinkle normal map to a base
    Difference,
}

/// Arguments of `rubor maps normals`.
#[derive(Debug, Args)]
pub(crate) struct NormalsArgs {
    /// Normal map, or slopes as floats
    input: PathBuf,
    /// Result to make
    #[arg(long, value_enum)]
    to: NormalsTarget,
    /// Base normal map of a difference, or of wrinkles whose normal map holds the base as well
    #[arg(long, required_if_eq("to", "difference"))]
    base: Option<PathBuf>,
    /// Green grows downwards (DirectX)
    #[arg(long)]
    directx: bool,
    /// Value of the largest code of an image [default: the largest value of the map]
    #[arg(long)]
    range: Option<f32>,
    /// Bits of a PNG or integer TIFF: 8 or 16
    #[arg(long, default_value_t = 16)]
    bits: u32,
    /// Wrinkle map of the head to replace, or the next free number to add one
    #[arg(long, default_value_t = 0, requires = "into")]
    wrinkle_map: usize,
    /// NAME=FILE, or NAME=FILE#r (g, b, a) for a channel: mask of a zone that fades these wrinkles in; repeat for more
    #[arg(long, value_name = "NAME=FILE", requires = "into")]
    zone: Vec<String>,
    #[command(flatten)]
    images: ImageArgs,
    #[command(flatten)]
    destination: Destination,
}

pub(super) fn run(a: &NormalsArgs, notes: &mut Vec<Note>) -> Outcome<Value> {
    let receiver = a.destination.head(notes)?;
    if receiver.is_some() && !matches!(a.to, NormalsTarget::Slopes | NormalsTarget::Wrinkles) {
        return Err(Failure::input("--into: a head holds slopes, expected --to slopes or wrinkles"));
    }
    let green = if a.directx { GreenAxis::DirectX } else { GreenAxis::OpenGl };
    let purpose = if a.to == NormalsTarget::Normals { Purpose::Values } else { Purpose::Normals };
    let options = a.images.options(purpose);
    let input = load(&a.input, &options, notes)?;
    let (signed, mut report) = match a.to {
        NormalsTarget::Normals => {
            let mask = input.mask();
            input.require_finite(&mask)?;
            let mut slopes = input.map;
            fill_unmapped(&mut slopes, &mask);
            let codes = normals::normals_from_slopes(&slopes, green)?;
            let output = &a.destination.output;
            let kind = if is_exr(output) { SampleKind::F32 } else { integer_kind(a.bits)? };
            output::save_map(output, &codes, kind)?;
            return Ok(json!({ "written": output }));
        }
        NormalsTarget::Slopes => {
            let slopes = slopes_of(&input, green, notes)?;
            let report = slopes_report(&slopes);
            (slopes.map, report)
        }
        NormalsTarget::Wrinkles => wrinkles(a, &input, &options, green, notes)?,
        NormalsTarget::Difference => {
            let Some(base) = &a.base else { return Err(Failure::input("a difference needs --base")) };
            let base = load(base, &options, notes)?;
            let mut difference = normals::difference(&codes_of(&base, notes)?, &codes_of(&input, notes)?)?;
            fill_unmapped(&mut difference, &base.mask().and(&input.mask()));
            (difference, json!({}))
        }
    };
    let output = &a.destination.output;
    match receiver {
        Some(receiver) => put(a, receiver, signed, &mut report, notes)?,
        None if is_exr(output) => output::save_map(output, &signed, SampleKind::F32)?,
        None => {
            let encoded = normals::encode_signed(&signed, a.range, a.bits)?;
            output::save_map(output, &encoded.codes, integer_kind(a.bits)?)?;
            report["range"] = json!(encoded.range);
        }
    }
    report["written"] = json!(output);
    Ok(report)
}

fn put(
    a: &NormalsArgs,
    mut receiver: LoadedHead,
    slopes: Map,
    report: &mut Value,
    notes: &mut Vec<Note>,
) -> Outcome {
    let origin = a.destination.origin(format!("rubor maps normals of {}", file_name(&a.input)));
    if a.to == NormalsTarget::Slopes {
        into_head::put_slopes(&mut receiver.head, slopes, &origin)?;
    } else {
        let zones = a.zone.iter().map(|z| zone(z, notes)).collect::<Outcome<Vec<_>>>()?;
        let names: Vec<String> = zones.iter().map(|z| z.0.clone()).collect();
        into_head::put_wrinkles(&mut receiver.head, a.wrinkle_map, slopes, zones, &origin)?;
        let driven = |name: &String| {
            let rig = receiver.rig.as_ref();
            rig.is_none_or(|r| r.expressions.values().any(|e| e.wrinkles.contains_key(name)))
        };
        let still: Vec<_> = names.iter().filter(|n| !driven(n)).collect();
        if !still.is_empty() {
            report["zones_without_expression"] = json!(still);
        }
        let of_map = |index: usize| receiver.head.maps.zones.iter().any(|z| z.wrinkle_map as usize == index);
        if !of_map(a.wrinkle_map) {
            notes.push(Note::new("", "no zone shows this wrinkle map: --zone NAME=MASK adds one"));
        }
    }
    a.destination.write(&receiver)
}

/// Slopes of a normal map, less those of its base.
fn wrinkles(
    a: &NormalsArgs,
    input: &LoadedImage,
    options: &ReadOptions,
    green: GreenAxis,
    notes: &mut Vec<Note>,
) -> Outcome<(Map, Value)> {
    let mut slopes = slopes_of(input, green, notes)?;
    if let Some(file) = &a.base {
        let base = load(file, options, notes)?;
        base.require_size(slopes.map.width, slopes.map.height)?;
        for (s, b) in slopes.map.values.iter_mut().zip(&slopes_of(&base, green, notes)?.map.values) {
            *s -= b;
        }
        slopes.largest = slopes.map.values.iter().fold(0.0, |m, v| m.max(v.abs()));
        slopes.beyond_45_degrees =
            slopes.map.values.chunks_exact(2).filter(|s| s[0].abs().max(s[1].abs()) > 1.0).count();
    }
    let report = slopes_report(&slopes);
    Ok((slopes.map, report))
}

/// Slopes of a normal map; what was told from its values becomes a note.
fn slopes_of(image: &LoadedImage, green: GreenAxis, notes: &mut Vec<Note>) -> Outcome<Slopes> {
    let (slopes, found) = normals::slopes_of(image, green)?;
    note_image(&image.file, &found, notes);
    Ok(slopes)
}

/// Codes of a normal map; what was told from its values becomes a note.
fn codes_of(image: &LoadedImage, notes: &mut Vec<Note>) -> Outcome<Map> {
    let (codes, found) = normals::codes_of(image)?;
    note_image(&image.file, &found, notes);
    Ok(codes)
}

fn slopes_report(slopes: &Slopes) -> Value {
    json!({
        "largest_slope": slopes.largest,
        "texels_beyond_45_degrees": slopes.beyond_45_degrees,
        "clamped_texels": slopes.clamped_texels,
    })
}

/// Name and mask of `NAME=FILE` or `NAME=FILE#channel`.
fn zone(text: &str, notes: &mut Vec<Note>) -> Outcome<(String, Map)> {
    let wrong = || Failure::input(format!("--zone {text}: expected NAME=FILE such as chin=masks.png#r"));
    let (name, file) = text.split_once('=').ok_or_else(wrong)?;
    if name.is_empty() {
        return Err(wrong());
    }
    let (file, channel) = match file.rsplit_once('#') {
        Some((file, "r")) => (file, Some(0)),
        Some((file, "g")) => (file, Some(1)),
        Some((file, "b")) => (file, Some(2)),
        Some((file, "a")) => (file, Some(3)),
        _ => (file, None),
    };
    let mut image = load(Path::new(file), &ReadOptions::default(), notes)?;
    let mapped = image.mask();
    image.require_finite(&mapped)?;
    // What stands where alpha is 0 shows nothing.
    for (texel, _) in image
        .map
        .values
        .chunks_exact_mut(image.map.channels as usize)
        .zip(&mapped.mapped)
        .filter(|(_, m)| !**m)
    {
        texel.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
    }
    let lacks = |what: &str| Failure::input(format!("--zone {text}: the image has no {what}"));
    let mask = match channel {
        None => image.require_grey()?,
        Some(3) => image.alpha.clone().ok_or_else(|| lacks("alpha"))?,
        Some(c) if c < image.map.channels => Map {
            channels: 1,
            values: image
                .map
                .values
                .iter()
                .skip(c as usize)
                .step_by(image.map.channels as usize)
                .copied()
                .collect(),
            ..image.map
        },
        Some(_) => return Err(lacks("such channel")),
    };
    Ok((name.to_owned(), mask))
}

fn integer_kind(bits: u32) -> Outcome<SampleKind> {
    match bits {
        8 => Ok(SampleKind::U8),
        16 => Ok(SampleKind::U16),
        other => Err(Failure::input(format!("--bits {other}: expected 8 or 16"))),
    }
}
