//! Materials: for viewers that do not know the extension, one per part; those of authors as they came.

use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};

use image::ExtendedColorType;
use rubor_rig::authored::{AlphaMode, Authored, AuthoredMaterial, AuthoredTexture, TextureTransform, Wrap};
use rubor_rig::head::{Head, Material};
use serde_json::{Value, json};

use super::Options;
use super::buffer::Buffer;
use super::maps::write_albedo;
use crate::error::ExportError;
use crate::export::TextureFormat;
use crate::export::image_codec::encode_picture;
use crate::export::pictures::{Picture, Pictures, appearance};
use crate::export::skin_color::has_skin_color;
use crate::facial_appearance::MapEntry;

/// glTF extension of WebP pictures.
const WEBP: &str = "EXT_texture_webp";
/// glTF extension of textures that are moved, turned and scaled.
const TEXTURE_TRANSFORM: &str = "KHR_texture_transform";
/// glTF extension of materials that show their colour without light.
const UNLIT: &str = "KHR_materials_unlit";
/// glTF extensions of reflections, coats and glass.
const IOR: &str = "KHR_materials_ior";
const SPECULAR: &str = "KHR_materials_specular";
const CLEARCOAT: &str = "KHR_materials_clearcoat";
const TRANSMISSION: &str = "KHR_materials_transmission";
/// glTF extension of emission above 1.
const EMISSIVE_STRENGTH: &str = "KHR_materials_emissive_strength";

/// Materials and textures of the document.
pub(super) struct Materials {
    materials: Vec<Value>,
    textures: Vec<Value>,
    samplers: Vec<Value>,
    /// Names of extensions that are used.
    extensions: BTreeSet<&'static str>,
    format: TextureFormat,
    /// The colour of the skin by itself, where other viewers show the same picture.
    pub(super) albedo: Option<MapEntry>,
}

impl Materials {
    pub(super) fn put_into(self, document: &mut Value) {
        document["materials"] = Value::Array(self.materials);
        if let Some(used) = document["extensionsUsed"].as_array_mut() {
            used.extend(self.extensions.iter().map(|name| json!(name)));
        }
        if self.textures.is_empty() {
            return;
        }
        document["textures"] = Value::Array(self.textures);
        document["samplers"] = Value::Array(self.samplers);
        if self.format == TextureFormat::Webp {
            if let Some(used) = document["extensionsUsed"].as_array_mut() {
                used.push(json!(WEBP));
            }
            document["extensionsRequired"] = json!([WEBP]);
        }
    }

    fn texture(&mut self, name: &str, picture: &Picture, buffer: &mut Buffer) -> Result<Value, ExportError> {
        let (bytes, format) =
            encode_picture(name, &picture.texels, picture.size, picture.color, self.format)?;
        let image = buffer.image(name, &bytes, format.mime_type());
        self.textures.push(match format {
            TextureFormat::Webp => json!({"sampler": 0, "extensions": {WEBP: {"source": image}}}),
            TextureFormat::Png | TextureFormat::Jpeg => json!({"sampler": 0, "source": image}),
        });
        Ok(json!({"index": self.textures.len() - 1}))
    }
}

impl Materials {
    /// A material as its author gave it. Pictures are exact.
    fn authored(
        &mut self,
        authored: &Authored,
        index: u32,
        images: &mut HashMap<u32, usize>,
        buffer: &mut Buffer,
    ) -> Result<Value, ExportError> {
        let from = &authored.materials[index as usize];
        let mut texture = |texture: &Option<AuthoredTexture>| -> Result<Option<Value>, ExportError> {
            texture.as_ref().map(|t| self.authored_texture(authored, t, images, buffer)).transpose()
        };
        let mut surface = json!({
            "baseColorFactor": from.base_color, "metallicFactor": from.metallic, "roughnessFactor": from.roughness,
        });
        let mut material = json!({"name": from.name, "doubleSided": from.is_double_sided});
        if let Some(info) = texture(&from.base_color_texture)? {
            surface["baseColorTexture"] = info;
        }
        if let Some(info) = texture(&from.metallic_roughness_texture)? {
            surface["metallicRoughnessTexture"] = info;
        }
        if let Some(mut info) = texture(&from.normal_texture)? {
            info["scale"] = json!(from.normal_scale);
            material["normalTexture"] = info;
        }
        if let Some(mut info) = texture(&from.occlusion_texture)? {
            info["strength"] = json!(from.occlusion_strength);
            material["occlusionTexture"] = info;
        }
        if let Some(info) = texture(&from.emission_texture)? {
            material["emissiveTexture"] = info;
        }
        material["pbrMetallicRoughness"] = surface;
        let plain = AuthoredMaterial::default();
        let mut extended: Vec<(&'static str, Value)> = Vec::new();
        if from.ior != plain.ior {
            extended.push((IOR, json!({"ior": from.ior})));
        }
        let mut reflection = json!({});
        if from.specular != plain.specular {
            reflection["specularFactor"] = json!(from.specular);
        }
        if from.specular_color != plain.specular_color {
            reflection["specularColorFactor"] = json!(from.specular_color);
        }
        if let Some(info) = texture(&from.specular_texture)? {
            reflection["specularTexture"] = info;
        }
        if let Some(info) = texture(&from.specular_color_texture)? {
            reflection["specularColorTexture"] = info;
        }
        if reflection != json!({}) {
            extended.push((SPECULAR, reflection));
        }
        if from.clearcoat > 0.0 {
            let mut coat = json!({
                "clearcoatFactor": from.clearcoat, "clearcoatRoughnessFactor": from.clearcoat_roughness,
            });
            if let Some(info) = texture(&from.clearcoat_texture)? {
                coat["clearcoatTexture"] = info;
            }
            if let Some(info) = texture(&from.clearcoat_roughness_texture)? {
                coat["clearcoatRoughnessTexture"] = info;
            }
            extended.push((CLEARCOAT, coat));
        }
        if from.transmission > 0.0 {
            let mut glass = json!({"transmissionFactor": from.transmission});
            if let Some(info) = texture(&from.transmission_texture)? {
                glass["transmissionTexture"] = info;
            }
            extended.push((TRANSMISSION, glass));
        }
        for (name, value) in extended {
            material["extensions"][name] = value;
            self.extensions.insert(name);
        }
        match from.alpha {
            AlphaMode::Opaque => {}
            AlphaMode::Mask { cutoff } => {
                material["alphaMode"] = json!("MASK");
                material["alphaCutoff"] = json!(cutoff);
            }
            AlphaMode::Blend => material["alphaMode"] = json!("BLEND"),
        }
        // Factors of glTF 2.0 end at 1.
        let strength = from.emission_linear.iter().fold(1.0_f32, |most, c| most.max(*c));
        material["emissiveFactor"] = json!(from.emission_linear.map(|c| c / strength));
        if strength > 1.0 {
            material["extensions"][EMISSIVE_STRENGTH] = json!({"emissiveStrength": strength});
            self.extensions.insert(EMISSIVE_STRENGTH);
        }
        if from.is_unlit {
            material["extensions"][UNLIT] = json!({});
            self.extensions.insert(UNLIT);
        }
        Ok(material)
    }

    fn authored_texture(
        &mut self,
        authored: &Authored,
        texture: &AuthoredTexture,
        images: &mut HashMap<u32, usize>,
        buffer: &mut Buffer,
    ) -> Result<Value, ExportError> {
        let image = match images.get(&texture.image) {
            Some(image) => *image,
            None => {
                let from = &authored.images[texture.image as usize];
                let size = (from.width, from.height);
                let is_opaque = from.rgba.chunks_exact(4).all(|t| t[3] == 255);
                let without_alpha = || from.rgba.chunks_exact(4).flat_map(|t| [t[0], t[1], t[2]]).collect();
                let (texels, color): (Cow<'_, [u8]>, _) = match is_opaque {
                    true => (Cow::Owned(without_alpha()), ExtendedColorType::Rgb8),
                    false => (Cow::Borrowed(&from.rgba), ExtendedColorType::Rgba8),
                };
                let (bytes, format) = encode_picture(&from.name, &texels, size, color, TextureFormat::Png)?;
                let image = buffer.image(&from.name, &bytes, format.mime_type());
                images.insert(texture.image, image);
                image
            }
        };
        let wanted = sampler(texture.wrap);
        let known = self.samplers.iter().position(|s| *s == wanted);
        let sampler = known.unwrap_or_else(|| {
            self.samplers.push(wanted);
            self.samplers.len() - 1
        });
        let wanted = json!({"sampler": sampler, "source": image});
        let known = self.textures.iter().position(|t| *t == wanted);
        let index = known.unwrap_or_else(|| {
            self.textures.push(wanted);
            self.textures.len() - 1
        });
        let mut info = json!({"index": index});
        if texture.uv_set != 0 {
            info["texCoord"] = json!(texture.uv_set);
        }
        let moved = &texture.transform;
        if *moved != TextureTransform::default() {
            let offset = moved.offset.to_array();
            info["extensions"][TEXTURE_TRANSFORM] = json!({"offset": offset, "rotation": moved.rotation_radians, "scale": moved.scale.to_array()});
            self.extensions.insert(TEXTURE_TRANSFORM);
        }
        Ok(info)
    }
}

fn sampler(wrap: [Wrap; 2]) -> Value {
    let [s, t] = wrap.map(|w| match w {
        Wrap::Repeat => 10497,
        Wrap::Clamp => 33071,
        Wrap::Mirror => 33648,
    });
    json!({"magFilter": 9729, "minFilter": 9987, "wrapS": s, "wrapT": t})
}

pub(super) fn write(
    head: &Head,
    options: &Options<'_>,
    color_factor: f32,
    buffer: &mut Buffer,
) -> Result<Materials, ExportError> {
    let mut out = Materials {
        materials: Vec::new(),
        textures: Vec::new(),
        samplers: vec![sampler([Wrap::Clamp; 2])],
        extensions: BTreeSet::new(),
        format: options.textures,
        albedo: None,
    };
    // The neutral colour of the skin is that map itself.
    let own_color = head.maps.albedo.as_ref().filter(|_| {
        options.pose.is_none() && color_factor == 1.0 && options.color_map_size > 0 && has_skin_color(head)
    });
    let pictures = Pictures::new(
        head,
        options.pose.as_ref(),
        if own_color.is_some() { 0 } else { options.color_map_size },
        options.normal_map_size,
        color_factor,
    );
    let mut texture = |name: &str, picture: &Option<Picture>| {
        picture.as_ref().map(|p| out.texture(name, p, buffer)).transpose()
    };
    let mut base_color = texture("base colour", &pictures.base_color)?;
    let normal = texture("normals", &pictures.normals)?;
    let eye = texture("eye", &pictures.eye)?;
    let lash = texture("lashes", &pictures.lashes)?;
    if let Some(albedo) = own_color {
        let entry = write_albedo(albedo, &options.maps, buffer)?;
        out.textures.push(json!({"sampler": 0, "source": entry.image}));
        base_color = Some(json!({"index": out.textures.len() - 1}));
        out.albedo = Some(entry);
    }
    let mut images = HashMap::new();
    for (index, part) in head.mesh.parts.iter().enumerate() {
        if let Some(material) = head.needed_material(index) {
            let material = out.authored(&head.authored, material, &mut images, buffer)?;
            out.materials.push(material);
            continue;
        }
        let look = appearance(part.material, base_color.is_some());
        let mut material = json!({
            "name": part.name,
            "pbrMetallicRoughness": {
                "baseColorFactor": look.color_linear, "metallicFactor": 0.0, "roughnessFactor": look.roughness,
            },
        });
        let texture = match part.material {
            Material::Skin => &base_color,
            Material::Eye => &eye,
            Material::Lash => &lash,
            _ => &None,
        };
        if let Some(texture) = texture {
            material["pbrMetallicRoughness"]["baseColorTexture"] = texture.clone();
        }
        if let (Material::Skin, Some(normal)) = (part.material, &normal) {
            material["normalTexture"] = normal.clone();
        }
        if !part.material.is_opaque() {
            material["alphaMode"] = json!("BLEND");
            material["doubleSided"] = json!(true);
        }
        out.materials.push(material);
    }
    Ok(out)
}
