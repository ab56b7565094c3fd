//! Materials of a document with their pictures.
//!
//! Read from the JSON, as faults of materials never cost the head: what is broken or not known is left out with a note.

use std::collections::HashMap;

use glam::Vec2;
use rubor_rig::authored::{AlphaMode, Authored, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap};
use serde_json::Value;

use super::document::{Document, Share};
use crate::import::picture;
use crate::notes::Notes;

/// Extensions of materials whose whole effect is read.
const READ: [&str; 6] = [
    "KHR_materials_unlit",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_clearcoat",
    "KHR_materials_transmission",
];
/// Extensions of textures that say where the picture is, in the order in which they are preferred to `source`.
const SOURCES: [&str; 2] = ["KHR_texture_basisu", "EXT_texture_webp"];

/// Reads each material and picture once.
pub(super) struct Materials<'a> {
    document: &'a Document,
    pub(super) authored: Authored,
    /// By index in the document; none for the default material.
    materials: HashMap<Option<usize>, u32>,
    /// Pictures by index in the document; none where one cannot be read.
    images: HashMap<usize, Option<u32>>,
    /// Transforms that moved from the textures of a material to its vertices.
    taken: HashMap<u32, Option<TextureTransform>>,
}

impl<'a> Materials<'a> {
    pub(super) fn new(document: &'a Document) -> Self {
        Self {
            document,
            authored: Authored::default(),
            materials: HashMap::new(),
            images: HashMap::new(),
            taken: HashMap::new(),
        }
    }

    /// The material of a primitive; without one it is the default of glTF 2.0.
    pub(super) fn read(&mut self, index: Option<usize>, notes: &mut Notes) -> u32 {
        if let Some(known) = self.materials.get(&index) {
            return *known;
        }
        let raw = index.map_or(&Value::Null, |i| &self.document.raw["materials"][i]);
        let at = index.map_or_else(|| "the default material".into(), |i| format!("material {i}"));
        let material = self.material(raw, &at, notes);
        let known = self.authored.materials.len() as u32;
        self.authored.materials.push(material);
        self.materials.insert(index, known);
        known
    }

    /// The transform that all textures of a material share for the first set of texture coordinates; they keep none. A
    /// material is asked once for each primitive that shows it, so the answer is remembered.
    pub(super) fn take_transform(&mut self, material: u32) -> Option<TextureTransform> {
        if let Some(known) = self.taken.get(&material) {
            return *known;
        }
        let material_of = &mut self.authored.materials[material as usize];
        let first: Vec<TextureTransform> = (material_of.textures().iter())
            .filter_map(|(_, texture)| texture.filter(|t| t.uv_set == 0).map(|t| t.transform))
            .collect();
        let shared = first.first().copied().filter(|t| first.iter().all(|other| other == t));
        if shared.is_some() {
            for texture in material_of.textures_mut().into_iter().flatten().filter(|t| t.uv_set == 0) {
                texture.transform = TextureTransform::default();
            }
        }
        self.taken.insert(material, shared);
        shared
    }

    fn material(&mut self, raw: &Value, at: &str, notes: &mut Notes) -> AuthoredMaterial {
        let surface = &raw["pbrMetallicRoughness"];
        let extensions = raw["extensions"].as_object().into_iter().flatten();
        for (name, _) in extensions.filter(|(name, _)| !READ.contains(&name.as_str())) {
            notes.add(format!("{name} is not drawn: the part looks as without it"), at);
        }
        if !raw["extensions"]["KHR_materials_clearcoat"]["clearcoatNormalTexture"].is_null() {
            notes.add("normal maps of clear coats are not drawn: the coat is as smooth as the part", at);
        }
        let extension = |name: &str, field: &str| &raw["extensions"][name][field];
        let mut share = |value: &Value, default: f32| number(value, default, 0.0..=1.0, at, notes);
        let base = &surface["baseColorFactor"];
        let emission = &raw["emissiveFactor"];
        let base_color = [0, 1, 2, 3].map(|c| share(&base[c], 1.0));
        let (metallic, roughness) =
            (share(&surface["metallicFactor"], 1.0), share(&surface["roughnessFactor"], 1.0));
        let occlusion_strength = share(&raw["occlusionTexture"]["strength"], 1.0);
        let specular = share(extension("KHR_materials_specular", "specularFactor"), 1.0);
        let clearcoat = share(extension("KHR_materials_clearcoat", "clearcoatFactor"), 0.0);
        let clearcoat_roughness =
            share(extension("KHR_materials_clearcoat", "clearcoatRoughnessFactor"), 0.0);
        let transmission = share(extension("KHR_materials_transmission", "transmissionFactor"), 0.0);
        let tint = extension("KHR_materials_specular", "specularColorFactor");
        let specular_color = [0, 1, 2].map(|c| number(&tint[c], 1.0, 0.0..=f32::MAX, at, notes));
        let ior = match extension("KHR_materials_ior", "ior") {
            // 0 stands for a reflectance of 1.
            zero if zero.as_f64() == Some(0.0) => 0.0,
            index => number(index, 1.5, 1.0..=f32::MAX, at, notes),
        };
        let any = f32::MIN..=f32::MAX;
        let normal_scale = number(&raw["normalTexture"]["scale"], 1.0, any, at, notes);
        let strength = &raw["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"];
        let strength = number(strength, 1.0, 0.0..=f32::MAX, at, notes);
        let emission_linear =
            [0, 1, 2].map(|c| strength * number(&emission[c], 0.0, 0.0..=1.0, at, notes)).map(finite);
        let alpha = match raw["alphaMode"].as_str() {
            Some("MASK") => {
                AlphaMode::Mask { cutoff: number(&raw["alphaCutoff"], 0.5, 0.0..=f32::MAX, at, notes) }
            }
            Some("BLEND") => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        };
        let mut texture = |value: &Value, what: &str| self.texture(value, &format!("{at}, {what}"), notes);
        AuthoredMaterial {
            name: raw["name"].as_str().unwrap_or_default().to_owned(),
            base_color,
            base_color_texture: texture(&surface["baseColorTexture"], "base colour"),
            metallic,
            roughness,
            metallic_roughness_texture: texture(&surface["metallicRoughnessTexture"], "metallic-roughness"),
            normal_texture: texture(&raw["normalTexture"], "normal"),
            normal_scale,
            occlusion_texture: texture(&raw["occlusionTexture"], "occlusion"),
            occlusion_strength,
            emission_linear,
            emission_texture: texture(&raw["emissiveTexture"], "emission"),
            alpha,
            is_double_sided: raw["doubleSided"] == true,
            is_unlit: raw["extensions"].get("KHR_materials_unlit").is_some(),
            ior,
            specular,
            specular_texture: texture(extension("KHR_materials_specular", "specularTexture"), "specular"),
            specular_color,
            specular_color_texture: texture(
                extension("KHR_materials_specular", "specularColorTexture"),
                "specular colour",
            ),
            clearcoat,
            clearcoat_texture: texture(
                extension("KHR_materials_clearcoat", "clearcoatTexture"),
                "clear coat",
            ),
            clearcoat_roughness,
            clearcoat_roughness_texture: texture(
                extension("KHR_materials_clearcoat", "clearcoatRoughnessTexture"),
                "clear coat roughness",
            ),
            transmission,
            transmission_texture: texture(
                extension("KHR_materials_transmission", "transmissionTexture"),
                "transmission",
            ),
        }
    }

    fn texture(&mut self, info: &Value, at: &str, notes: &mut Notes) -> Option<AuthoredTexture> {
        if info.is_null() {
            return None;
        }
        let found = index(&info["index"]).and_then(|i| self.document.raw["textures"].get(i));
        let Some(texture) = found else {
            notes.add("textures that do not exist are left out", at);
            return None;
        };
        let extended = SOURCES.iter().find_map(|name| index(&texture["extensions"][*name]["source"]));
        let plain = index(&texture["source"]);
        let Some(source) = extended.or(plain) else {
            let names =
                texture["extensions"].as_object().into_iter().flatten().map(|(name, _)| name.as_str());
            let names: Vec<&str> = names.collect();
            let message = match names[..] {
                [] => "textures without a picture are left out".to_owned(),
                _ => format!("pictures of {} cannot be read and are left out", names.join(", ")),
            };
            notes.add(message, at);
            return None;
        };
        let image = match (self.image(source, at, notes), plain) {
            (Some(image), _) => image,
            (None, Some(plain)) if plain != source => {
                notes.add("textures are read from their plain copy", at);
                self.image(plain, at, notes)?
            }
            (None, _) => return None,
        };
        let moved = &info["extensions"]["KHR_texture_transform"];
        let set = index(&moved["texCoord"]).or_else(|| index(&info["texCoord"])).unwrap_or(0);
        let Some(uv_set) = u32::try_from(set).ok().filter(|set| *set <= 1) else {
            notes.add("textures of a third set of texture coordinates are left out", at);
            return None;
        };
        let sampler = index(&texture["sampler"]).map_or(&Value::Null, |s| &self.document.raw["samplers"][s]);
        if [&sampler["magFilter"], &sampler["minFilter"]].iter().any(|f| index(f) == Some(9728)) {
            notes.add("textures with the filter NEAREST are drawn smooth", at);
        }
        let wrap = ["wrapS", "wrapT"].map(|axis| match index(&sampler[axis]) {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        });
        let any = || f32::MIN..=f32::MAX;
        let mut pair = |value: &Value, default: f32| {
            Vec2::new(
                number(&value[0], default, any(), at, notes),
                number(&value[1], default, any(), at, notes),
            )
        };
        let (offset, scale) = (pair(&moved["offset"], 0.0), pair(&moved["scale"], 1.0));
        let rotation_radians = number(&moved["rotation"], 0.0, any(), at, notes);
        let transform = TextureTransform { offset, rotation_radians, scale };
        if !transform.matrix().is_finite() {
            notes.add("transforms of textures that are out of range are left out", at);
            return Some(AuthoredTexture { image, uv_set, transform: TextureTransform::default(), wrap });
        }
        Some(AuthoredTexture { image, uv_set, transform, wrap })
    }

    fn image(&mut self, source: usize, at: &str, notes: &mut Notes) -> Option<u32> {
        if let Some(known) = self.images.get(&source) {
            if known.is_none() {
                notes.add("textures whose picture cannot be read are left out", at);
            }
            return *known;
        }
        let read = u32::try_from(source).map_err(|e| e.to_string()).and_then(|source| {
            let bytes = self.document.image(source).map_err(|e| e.to_string())?;
            let name = self.document.raw["images"][source as usize]["name"].as_str().unwrap_or_default();
            let (width, height) = picture::size(&bytes)?;
            let texels = u64::from(width) * u64::from(height);
            self.document
                .try_take(Share::PictureTexels, texels)
                .map_err(|(found, expected)| format!("found {found}, expected {expected}"))?;
            picture::decode(&bytes, name)
        });
        let known = match read {
            Ok(image) => {
                self.authored.images.push(image);
                Some(self.authored.images.len() as u32 - 1)
            }
            Err(why) => {
                let place = format!("{at} (image {source}: {why})");
                notes.add("textures whose picture cannot be read are left out", place);
                None
            }
        };
        self.images.insert(source, known);
        known
    }
}

/// A number of a material: what is out of range or no number is the nearest one that is allowed.
fn number(
    value: &Value,
    default: f32,
    range: std::ops::RangeInclusive<f32>,
    at: &str,
    notes: &mut Notes,
) -> f32 {
    if value.is_null() {
        return default;
    }
    let number = value.as_f64().map_or(default, |v| v as f32).clamp(*range.start(), *range.end());
    if value.as_f64().is_none_or(|v| v as f32 != number) {
        notes.add("factors of materials that glTF 2.0 does not allow are clamped", format!("{at} ({value})"));
    }
    number
}

fn finite(value: f32) -> f32 {
    value.min(f32::MAX)
}

fn index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|i| usize::try_from(i).ok())
}
