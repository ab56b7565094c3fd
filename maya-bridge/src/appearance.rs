//! Data that a Maya scene has no place for: maps with their units, original names, landmarks, provenance.
//!
//! It stands as JSON in one string attribute of the head's transform, `ruborFacialAppearance`, so it survives every
//! edit and save in Maya. Maps are 16-bit PNG files beside the scene: `value = offset + scale * texel / 65535`, two
//! channels below each other, at most half a step (1/131070 of the map's range) from the values.

use std::collections::BTreeMap;
use std::path::Path;

use glam::Vec3;
use image::ImageEncoder;
use rubor_assets::files::is_plain_name;
use rubor_assets::image_io::{Limits, load_stored};
use rubor_rig::head::{Distribution, Head, Material, Provenance, SkinMaps, WrinkleZone};
use rubor_rig::map::Map;
use serde::{Deserialize, Serialize};

/// Name and content of a file beside the scene.
pub(crate) type NamedFile = (String, Vec<u8>);
/// A map that cannot be encoded, and why.
pub(crate) type Unencodable = (String, String);
/// PNG, and offset and scale of each channel.
type Encoded = (Vec<u8>, Vec<f32>, Vec<f32>);

/// Version of the layout.
const VERSION: u32 = 1;

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Appearance {
    pub(crate) version: u32,
    pub(crate) name: String,
    /// In the order of the object groups of the mesh.
    pub(crate) parts: Vec<PartEntry>,
    /// Names of the targets in their order, as rubor spells them.
    pub(crate) shapes: Vec<String>,
    #[serde(default)]
    pub(crate) landmarks: BTreeMap<String, Vec3>,
    #[serde(default)]
    pub(crate) provenance: Vec<Provenance>,
    #[serde(default)]
    pub(crate) occlusion: Vec<f32>,
    /// Of shapes that change it: name; point, change at weights 0.5 and 1.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) shape_occlusion: BTreeMap<String, Vec<(u32, f32, f32)>>,
    #[serde(default)]
    pub(crate) maps: Vec<MapEntry>,
    #[serde(default)]
    pub(crate) hair_color_linear: [f32; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) hair_count: Option<u32>,
    /// The rig file, as it is: expressions and combination shapes have no nodes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) rig: Option<serde_json::Value>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct PartEntry {
    pub(crate) name: String,
    pub(crate) material: Material,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct MapEntry {
    /// `melanin`, `distributionScale`, `zone`, ...
    pub(crate) role: String,
    /// Of a distribution or a zone.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) name: String,
    /// Wrinkle map of a zone.
    #[serde(default)]
    pub(crate) wrinkle_map: u32,
    /// File name beside the scene.
    pub(crate) file: String,
    pub(crate) offset: Vec<f32>,
    pub(crate) scale: Vec<f32>,
}

impl Appearance {
    /// Entries of a head; maps go to files named `stem_role.png`, returned with their bytes.
    pub(crate) fn of(head: &Head, stem: &str) -> Result<(Self, Vec<NamedFile>), Unencodable> {
        let mut appearance = Self {
            version: VERSION,
            name: head.name.clone(),
            parts: (head.mesh.parts.iter())
                .map(|p| PartEntry { name: p.name.clone(), material: p.material })
                .collect(),
            shapes: head.shapes.iter().map(|s| s.name.clone()).collect(),
            landmarks: head.landmarks.clone(),
            provenance: head.provenance.clone(),
            occlusion: head.mesh.occlusion.clone(),
            shape_occlusion: (head.shapes.iter().filter(|s| !s.occlusion.is_empty()))
                .map(|s| {
                    (s.name.clone(), s.occlusion.iter().map(|c| (c.point, c.at_half, c.at_full)).collect())
                })
                .collect(),
            maps: Vec::new(),
            hair_color_linear: head.maps.hair_color_linear,
            hair_count: head.maps.hair_count,
            rig: None,
        };
        let mut files = Vec::new();
        let maps = &head.maps;
        let mut add = |role: &str, name: &str, wrinkle_map: u32, map: &Map| {
            let file = format!(
                "{stem}_{role}{}.png",
                if files.is_empty() { String::new() } else { format!("_{}", files.len()) }
            );
            let (bytes, offset, scale) =
                encode(map).map_err(|reason| (format!("map {role} {name}"), reason))?;
            files.push((file.clone(), bytes));
            let entry = MapEntry { role: role.into(), name: name.into(), wrinkle_map, file, offset, scale };
            appearance.maps.push(entry);
            Ok::<(), Unencodable>(())
        };
        let single = [
            ("albedo", &maps.albedo),
            ("melanin", &maps.melanin),
            ("hemoglobin", &maps.hemoglobin),
            ("hemoglobinMean", &maps.hemoglobin_mean),
            ("slopes", &maps.slopes),
            ("specular", &maps.specular),
            ("scattering", &maps.scattering),
            ("hair", &maps.hair),
        ];
        for (role, map) in single {
            if let Some(map) = map {
                add(role, "", 0, map)?;
            }
        }
        for d in &maps.distributions {
            add("distributionScale", &d.name, 0, &d.scale)?;
            add("distributionBias", &d.name, 0, &d.bias)?;
        }
        for map in &maps.wrinkle_slopes {
            add("wrinkleSlopes", "", 0, map)?;
        }
        for zone in &maps.zones {
            add("zone", &zone.name, zone.wrinkle_map, &zone.mask)?;
        }
        Ok((appearance, files))
    }

    pub(crate) fn parse(json: &str) -> Result<Self, String> {
        let read: Self = serde_json::from_str(json).map_err(|e| e.to_string())?;
        if read.version != VERSION {
            return Err(format!("version {}, where {VERSION} is known", read.version));
        }
        Ok(read)
    }

    /// Reads the maps beside the scene. Maps that cannot be read are named and left out, with what is nothing without them.
    pub(crate) fn load_maps(&self, folder: &Path, notes: &mut Vec<String>) -> SkinMaps {
        let (hair_color_linear, hair_count) = (self.hair_color_linear, self.hair_count);
        let mut maps = SkinMaps { hair_color_linear, hair_count, ..SkinMaps::default() };
        let mut scales: BTreeMap<String, Map> = BTreeMap::new();
        for entry in &self.maps {
            let channels = match entry.role.as_str() {
                "albedo" => 3,
                "slopes" | "specular" | "wrinkleSlopes" => 2,
                _ => 1,
            };
            let read = load(entry, folder).and_then(|map| match map.channels == channels {
                true => Ok(map),
                false => Err(format!("{} channels, where {channels} belong", map.channels)),
            });
            let map = match read {
                Ok(map) => map,
                Err(reason) => {
                    notes.push(format!("the map {} {} was left out: {reason}", entry.role, entry.name));
                    continue;
                }
            };
            match entry.role.as_str() {
                "albedo" => {
                    // Offset and scale may round past the ends.
                    let values = map.values.iter().map(|v| v.clamp(0.0, 1.0)).collect();
                    maps.albedo = Some(Map { values, ..map });
                }
                "melanin" => maps.melanin = Some(map),
                "hemoglobin" => maps.hemoglobin = Some(map),
                "hemoglobinMean" => maps.hemoglobin_mean = Some(map),
                "slopes" => maps.slopes = Some(map),
                "specular" => maps.specular = Some(map),
                "scattering" => maps.scattering = Some(map),
                "hair" => maps.hair = Some(map),
                "distributionScale" => {
                    scales.insert(entry.name.clone(), map);
                }
                "distributionBias" => {
                    if let Some(scale) = scales.remove(&entry.name) {
                        maps.distributions.push(Distribution { name: entry.name.clone(), scale, bias: map });
                    }
                }
                "wrinkleSlopes" => maps.wrinkle_slopes.push(map),
                "zone" => maps.zones.push(WrinkleZone {
                    name: entry.name.clone(),
                    wrinkle_map: entry.wrinkle_map,
                    mask: map,
                }),
                other => notes.push(format!("the map role {other:?} is not known and was left out")),
            }
        }
        // Zones name wrinkle maps by their place: where one is gone, the others are not theirs.
        let written = self.maps.iter().filter(|entry| entry.role == "wrinkleSlopes").count();
        if maps.wrinkle_slopes.len() < written {
            maps.wrinkle_slopes.clear();
        }
        let known = maps.wrinkle_slopes.len();
        let zones = maps.zones.len();
        maps.zones.retain(|zone| (zone.wrinkle_map as usize) < known);
        if maps.zones.len() < zones {
            notes.push("wrinkle zones were left out, as their wrinkle maps are not there".into());
        }
        if maps.hemoglobin_mean.is_none() && !maps.distributions.is_empty() {
            maps.distributions.clear();
            notes.push("hemoglobin distributions were left out, as their mean is not there".into());
        }
        maps
    }
}

/// 16-bit PNG of a map over its own range, channels below each other.
fn encode(map: &Map) -> Result<Encoded, String> {
    let channels = map.channels as usize;
    let mut bytes = Vec::with_capacity(map.values.len() * 2);
    let (mut offsets, mut scales) = (Vec::new(), Vec::new());
    for c in 0..channels {
        let values = || map.values.iter().skip(c).step_by(channels).copied();
        let (low, high) = values().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let range = high - low;
        for v in values() {
            let share = if range > 0.0 { f64::from(v - low) / f64::from(range) } else { 0.0 };
            // The encoder takes the byte order of the machine.
            bytes.extend_from_slice(&((share * 65535.0).round() as u16).to_ne_bytes());
        }
        offsets.push(low);
        scales.push(range);
    }
    let mut png = Vec::new();
    image::codecs::png::PngEncoder::new(&mut png)
        .write_image(&bytes, map.width, map.height * map.channels, image::ExtendedColorType::L16)
        .map_err(|e| e.to_string())?;
    Ok((png, offsets, scales))
}

fn load(entry: &MapEntry, folder: &Path) -> Result<Map, String> {
    if !is_plain_name(&entry.file) {
        return Err(format!("{:?} is no name of a file beside the scene", entry.file));
    }
    let channels = entry.offset.len();
    if channels == 0 || channels != entry.scale.len() || channels > 4 {
        return Err(format!("{channels} offsets and {} scales", entry.scale.len()));
    }
    let image = load_stored(&folder.join(&entry.file), &Limits::default())
        .map_err(|e| std::error::Error::source(&e).map_or_else(|| e.to_string(), |s| format!("{e}: {s}")))?
        .into_luma16();
    let (width, height) = (image.width(), image.height() / channels as u32);
    if height == 0 || height * channels as u32 != image.height() {
        return Err(format!("{}: {} rows for {channels} channels", entry.file, image.height()));
    }
    let texels = image.into_raw();
    let plane = width as usize * height as usize;
    let value = |i: usize| {
        let (texel, c) = (i / channels, i % channels);
        let share = f64::from(texels[c * plane + texel]) / 65535.0;
        (f64::from(entry.offset[c]) + f64::from(entry.scale[c]) * share) as f32
    };
    Ok(Map { width, height, channels: channels as u32, values: (0..plane * channels).map(value).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_beside_a_scene_are_plain_files_within_limits() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("scene");
        std::fs::create_dir(&inside).unwrap();
        let map = Map { width: 3, height: 2, channels: 1, values: vec![0.0, 0.1, 0.2, 0.3, 0.4, 1.0] };
        let (png, offset, scale) = encode(&map).unwrap();
        // Exif that says "lie on your side" (6): texture coordinates count from the stored corner all the same.
        let exif = b"eXIfII*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";
        let crc = |bytes: &[u8]| {
            !bytes.iter().fold(!0u32, |crc, byte| {
                let bit = |c: u32, _| if c & 1 == 1 { (c >> 1) ^ 0xedb8_8320 } else { c >> 1 };
                (0..8).fold(crc ^ u32::from(*byte), bit)
            })
        };
        let chunk = [&(exif.len() as u32 - 4).to_be_bytes()[..], exif, &crc(exif).to_be_bytes()].concat();
        let tagged = [&png[..33], &chunk, &png[33..]].concat();
        let mut header = png[12..29].to_vec();
        header[4..12].copy_from_slice(&[0, 0, 0x9c, 0x40, 0, 0, 0x9c, 0x40]);
        let bomb = [&png[..12], &header, &crc(&header).to_be_bytes(), &png[33..]].concat();
        std::fs::write(inside.join("melanin.png"), &tagged).unwrap();
        std::fs::write(inside.join("bomb.png"), bomb).unwrap();
        std::fs::write(folder.path().join("melanin.png"), &png).unwrap();
        let read = |file: &str| {
            let entry = MapEntry {
                role: "melanin".into(),
                name: String::new(),
                wrinkle_map: 0,
                file: file.into(),
                offset: offset.clone(),
                scale: scale.clone(),
            };
            load(&entry, &inside)
        };
        let found = read("melanin.png").unwrap();
        assert_eq!((found.width, found.height), (3, 2));
        assert!(found.values.iter().zip(&map.values).all(|(a, b)| (a - b).abs() < 1e-4));
        assert!(read("bomb.png").unwrap_err().contains("the limit on pixels"));
        let absolute = folder.path().join("melanin.png").to_string_lossy().into_owned();
        for name in ["../melanin.png", &absolute, "", "..", "sub\\melanin.png", "C:melanin.png"] {
            assert!(read(name).unwrap_err().contains("no name of a file beside the scene"), "{name}");
        }
        assert!(read("none.png").unwrap_err().contains("none.png"));
    }

    #[test]
    fn a_lost_map_takes_with_it_what_is_nothing_without_it() {
        let folder = tempfile::tempdir().unwrap();
        let map = |channels: usize| Map::filled(2, 2, &[0.25, 0.5, 0.75][..channels]);
        let zone = WrinkleZone { name: "brow".into(), wrinkle_map: 1, mask: map(1) };
        let maps = SkinMaps {
            melanin: Some(map(1)),
            hemoglobin_mean: Some(map(1)),
            distributions: vec![Distribution { name: "joy".into(), scale: map(1), bias: map(1) }],
            wrinkle_slopes: vec![map(2), map(2)],
            zones: vec![zone],
            ..SkinMaps::default()
        };
        let head = Head { maps, ..Head::default() };
        let (mut appearance, files) = Appearance::of(&head, "t").unwrap();
        for (name, bytes) in files {
            std::fs::write(folder.path().join(name), bytes).unwrap();
        }
        let mut notes = Vec::new();
        assert_eq!(appearance.load_maps(folder.path(), &mut notes).zones.len(), 1);
        assert!(notes.is_empty(), "{notes:?}");
        for entry in &mut appearance.maps {
            match entry.role.as_str() {
                "hemoglobinMean" => entry.file = "gone.png".into(),
                // A second channel.
                "melanin" => (entry.offset, entry.scale) = (vec![0.0; 2], vec![1.0; 2]),
                _ => {}
            }
        }
        let first = appearance.maps.iter_mut().find(|e| e.role == "wrinkleSlopes").unwrap();
        first.file = "gone.png".into();
        let maps = appearance.load_maps(folder.path(), &mut notes);
        let head = Head { maps, ..Head::default() };
        head.validate().unwrap();
        assert_eq!(head.maps, SkinMaps::default());
        for words in
            ["map melanin", "map hemoglobinMean", "map wrinkleSlopes", "wrinkle zones", "distributions"]
        {
            assert!(notes.iter().any(|n| n.contains(words)), "{words}: {notes:?}");
        }
    }
}
