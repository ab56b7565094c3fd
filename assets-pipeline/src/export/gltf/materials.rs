//! Materials for viewers that do not know the extension: one per part.

use rubor_rig::head::{Head, Material};
use serde_json::{Value, json};

use super::Options;
use super::buffer::Buffer;
use crate::error::ExportError;
use crate::export::TextureFormat;
use crate::export::image_codec::encode_picture;
use crate::export::pictures::{Picture, Pictures, appearance};

/// glTF extension of WebP pictures.
const WEBP: &str = "EXT_texture_webp";

/// Materials and textures of the document.
pub(super) struct Materials {
    materials: Vec<Value>,
    textures: Vec<Value>,
    format: TextureFormat,
}

impl Materials {
    pub(super) fn put_into(self, document: &mut Value) {
        document["materials"] = Value::Array(self.materials);
        if self.textures.is_empty() {
            return;
        }
        document["textures"] = Value::Array(self.textures);
        document["samplers"] =
            json!([{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}]);
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

pub(super) fn write(
    head: &Head,
    options: &Options<'_>,
    color_factor: f32,
    buffer: &mut Buffer,
) -> Result<Materials, ExportError> {
    let mut out = Materials { materials: Vec::new(), textures: Vec::new(), format: options.textures };
    let pictures = Pictures::new(
        head,
        options.pose.as_ref(),
        options.color_map_size,
        options.normal_map_size,
        color_factor,
    );
    let mut texture = |name: &str, picture: &Option<Picture>| {
        picture.as_ref().map(|p| out.texture(name, p, buffer)).transpose()
    };
    let base_color = texture("base colour", &pictures.base_color)?;
    let normal = texture("normals", &pictures.normals)?;
    let eye = texture("eye", &pictures.eye)?;
    let lash = texture("lashes", &pictures.lashes)?;
    for part in &head.mesh.parts {
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
