//! `rubor maps list` and `rubor maps extract`: the maps of a head.

use std::path::PathBuf;

use clap::Args;
use rubor_assets::files::plain_names;
use rubor_assets::image_io::SampleKind;
use rubor_renderer::footprint::{self, Footprint};
use rubor_rig::head::{Head, SkinMaps};
use rubor_rig::map::Map;
use serde_json::{Value, json};

use super::transfer::note_renamed;
use rubor::Outcome;
use rubor::notes::Note;
use rubor::{inputs, output};

/// Arguments of `rubor maps list`.
#[derive(Debug, Args)]
pub(crate) struct ListArgs {
    /// Head (.glb, .gltf, .vrm, .obj, .usda, .usdz) [default: the built-in head]
    head: Option<PathBuf>,
}

/// Arguments of `rubor maps extract`.
#[derive(Debug, Args)]
pub(crate) struct ExtractArgs {
    /// Head (.glb, .gltf, .vrm, .obj, .usda, .usdz) [default: the built-in head]
    head: Option<PathBuf>,
    /// Folder for the images (.exr)
    #[arg(short, long)]
    output: PathBuf,
}

/// Every map with its name; distributions and zones are called as told.
fn named<'a>(maps: &'a SkinMaps, distributions: &[String], zones: &[String]) -> Vec<(String, &'a Map)> {
    let single = [
        ("albedo", &maps.albedo),
        ("melanin", &maps.melanin),
        ("hemoglobin", &maps.hemoglobin),
        ("neutral_mean", &maps.hemoglobin_mean),
        ("slopes", &maps.slopes),
        ("specular", &maps.specular),
        ("scattering", &maps.scattering),
        ("hair", &maps.hair),
    ];
    let mut all: Vec<(String, &Map)> =
        single.into_iter().filter_map(|(name, map)| Some((name.to_owned(), map.as_ref()?))).collect();
    for (d, name) in maps.distributions.iter().zip(distributions) {
        all.push((format!("{name}_scale"), &d.scale));
        all.push((format!("{name}_bias"), &d.bias));
    }
    all.extend(maps.wrinkle_slopes.iter().enumerate().map(|(i, m)| (format!("wrinkles_{i}"), m)));
    all.extend(maps.zones.iter().zip(zones).map(|(z, name)| (format!("zone_{name}"), &z.mask)));
    all
}

/// Key of [`rubor_rig::head::Provenance::of`] for a file name.
fn provenance_key(name: &str) -> &str {
    match name {
        "neutral_mean" => "hemoglobin",
        _ if name.ends_with("_scale") || name.ends_with("_bias") => "distributions",
        _ if name.starts_with("wrinkles_") => "wrinkle_slopes",
        _ if name.starts_with("zone_") => "zones",
        _ => name,
    }
}

pub(super) fn run(a: &ListArgs, notes: &mut Vec<Note>) -> Outcome<Value> {
    let loaded = inputs::head(a.head.as_deref())?;
    notes.extend(loaded.notes);
    let head = loaded.head;
    let row = |(name, map): (String, &Map)| {
        let low = map.values.iter().copied().fold(f32::INFINITY, f32::min);
        let high = map.values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let of = format!("maps.{}", provenance_key(&name));
        let origin = head.provenance.iter().find(|p| p.of == of);
        json!({
            "name": name,
            "size": format!("{}x{}", map.width, map.height),
            "channels": map.channels,
            "low": low,
            "high": high,
            "origin": origin.map(|p| p.kind),
        })
    };
    let distributions: Vec<String> = head.maps.distributions.iter().map(|d| d.name.clone()).collect();
    let zones: Vec<String> = head.maps.zones.iter().map(|z| z.name.clone()).collect();
    let maps: Vec<Value> = named(&head.maps, &distributions, &zones).into_iter().map(row).collect();
    Ok(json!({ "maps": maps, "on_the_graphics_card": on_card(&head) }))
}

/// Bytes of the textures of a head, raw and in block formats.
pub(crate) fn on_card(head: &Head) -> Vec<Value> {
    let row = |f: Footprint| {
        json!({
            "texture": f.texture,
            "size": format!("{}x{}x{}", f.size[0], f.size[1], f.layers),
            "format": f.format,
            "bytes": f.bytes,
            "block_format": f.block_format,
            "block_bytes": f.block_bytes,
        })
    };
    footprint::of_maps(&head.maps).into_iter().map(row).collect()
}

pub(super) fn extract(a: &ExtractArgs, notes: &mut Vec<Note>) -> Outcome<Value> {
    let loaded = inputs::head(a.head.as_deref())?;
    notes.extend(loaded.notes);
    let head = loaded.head;
    output::folder(&a.output)?;
    let distributions = plain_names(head.maps.distributions.iter().map(|d| d.name.as_str()));
    let zones = plain_names(head.maps.zones.iter().map(|z| z.name.as_str()));
    for (d, name) in head.maps.distributions.iter().zip(&distributions) {
        note_renamed("distribution", &d.name, name, notes);
    }
    for (z, name) in head.maps.zones.iter().zip(&zones) {
        note_renamed("zone", &z.name, name, notes);
    }
    let maps = named(&head.maps, &distributions, &zones);
    // A distribution "zone_a" and a zone "a_scale" would share a file.
    let files = plain_names(maps.iter().map(|m| m.0.as_str()));
    let mut written = Vec::new();
    for ((name, map), stem) in maps.iter().zip(files) {
        note_renamed("map", name, &stem, notes);
        let file = a.output.join(format!("{stem}.exr"));
        output::save_map(&file, map, SampleKind::F32)?;
        written.push(file);
    }
    Ok(json!({ "written": written }))
}
