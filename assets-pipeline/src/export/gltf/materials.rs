//! Materials for viewers that do not know the extension: one a part.

use glam::Vec3;
use image::ExtendedColorType;
use rubor_rig::head::{Head, Material};
use rubor_rig::map::Map;
use serde_json::{Value, json};

use super::Options;
use super::buffer::Buffer;
use crate::error::ExportError;
use crate::export::image_codec::{encode_jpeg, encode_png};
use crate::import::eye_projection::LIMBUS_UV;

/// Quality of the pictures that only other viewers use.
const JPEG_QUALITY: u8 = 90;
/// Side of the eye picture.
const EYE_SIZE: u32 = 512;
/// Size of the lash picture: along the lid, root to tip.
const LASH_SIZE: (u32, u32) = (512, 64);
/// Texture radius of the pupil in the projection of [`Material::Eye`].
const PUPIL_UV: f32 = 0.035;

/// Materials and textures of the document.
pub(super) struct Materials {
    materials: Vec<Value>,
    textures: Vec<Value>,
}

impl Materials {
    pub(super) fn put_into(self, document: &mut Value) {
        document["materials"] = Value::Array(self.materials);
        if !self.textures.is_empty() {
            document["textures"] = Value::Array(self.textures);
            document["samplers"] =
                json!([{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}]);
        }
    }

    fn texture(&mut self, image: usize) -> Value {
        self.textures.push(json!({"source": image, "sampler": 0}));
        json!({"index": self.textures.len() - 1})
    }
}

pub(super) fn write(head: &Head, options: &Options, buffer: &mut Buffer) -> Result<Materials, ExportError> {
    let mut out = Materials { materials: Vec::new(), textures: Vec::new() };
    let has = |m: Material| head.mesh.parts.iter().any(|p| p.material == m);
    let mut base_color = None;
    let mut normal = None;
    let (mut eye, mut lash) = (None, None);
    if has(Material::Skin) {
        if let Some(picture) = &options.base_color {
            let (w, h) = picture.dimensions();
            let bytes = encode_jpeg("base colour", picture, w, h, ExtendedColorType::Rgb8, JPEG_QUALITY)?;
            let image = buffer.image("base colour", &bytes, "image/jpeg");
            base_color = Some(out.texture(image));
        }
        if let (Some(slopes), size @ 1..) = (&head.maps.slopes, options.normal_map_size) {
            let bytes = normal_map(slopes, size)?;
            let image = buffer.image("normals", &bytes, "image/jpeg");
            normal = Some(out.texture(image));
        }
    }
    if has(Material::Eye) {
        let bytes = encode_png("eye", &eye_picture(), EYE_SIZE, EYE_SIZE, ExtendedColorType::Rgb8)?;
        let image = buffer.image("eye", &bytes, "image/png");
        eye = Some(out.texture(image));
    }
    if has(Material::Lash) {
        let bytes =
            encode_png("lashes", &lash_picture(), LASH_SIZE.0, LASH_SIZE.1, ExtendedColorType::Rgba8)?;
        let image = buffer.image("lashes", &bytes, "image/png");
        lash = Some(out.texture(image));
    }
    for part in &head.mesh.parts {
        let (color, roughness) = match part.material {
            Material::Skin if base_color.is_some() => ([1.0; 4], 0.5),
            Material::Skin => ([0.60, 0.36, 0.27, 1.0], 0.5),
            Material::Mucosa => ([0.40, 0.10, 0.09, 1.0], 0.35),
            Material::Gums => ([0.45, 0.14, 0.13, 1.0], 0.3),
            Material::Teeth => ([0.78, 0.72, 0.60, 1.0], 0.2),
            Material::Eye => ([1.0; 4], 0.1),
            Material::Lash => ([1.0; 4], 0.7),
            Material::Hair => ([0.05, 0.03, 0.02, 1.0], 0.6),
            Material::Wet => ([1.0, 1.0, 1.0, 0.06], 0.05),
            Material::Hidden => ([0.0; 4], 1.0),
            Material::Other => ([0.5, 0.5, 0.5, 1.0], 0.8),
        };
        let mut material = json!({
            "name": part.name,
            "pbrMetallicRoughness": {"baseColorFactor": color, "metallicFactor": 0.0, "roughnessFactor": roughness},
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

/// Tangent space normals of a map of slopes; x to the right, y up, in 8 bits.
fn normal_map(slopes: &Map, size: u32) -> Result<Vec<u8>, ExportError> {
    let (width, height) = (size.min(slopes.width), size.min(slopes.height));
    let mut texels = Vec::with_capacity((width * height * 3) as usize);
    for y in 0..height {
        for x in 0..width {
            let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let n = Vec3::new(slopes.sample(u, v, 0), slopes.sample(u, v, 1), 1.0).normalize();
            texels.extend(n.to_array().map(|c| ((0.5 + 0.5 * c) * 255.0).round() as u8));
        }
    }
    encode_jpeg("normals", &texels, width, height, ExtendedColorType::Rgb8, JPEG_QUALITY)
}

/// Sclera, iris with radial fibres and dark rim, pupil; sRGB.
fn eye_picture() -> Vec<u8> {
    let mut texels = Vec::with_capacity((EYE_SIZE * EYE_SIZE * 3) as usize);
    for y in 0..EYE_SIZE {
        for x in 0..EYE_SIZE {
            let (dx, dy) =
                ((x as f32 + 0.5) / EYE_SIZE as f32 - 0.5, (y as f32 + 0.5) / EYE_SIZE as f32 - 0.5);
            let (r, phi) = (dx.hypot(dy), dy.atan2(dx));
            let soft = |edge: f32| ((r - edge) * EYE_SIZE as f32 / 1.5 + 0.5).clamp(0.0, 1.0);
            let fibres = 0.85 + 0.15 * (phi * 37.0).sin() * (phi * 11.0 + 1.3).cos();
            let rim = 1.0 - 0.6 * ((r - 0.065) / (LIMBUS_UV - 0.065)).clamp(0.0, 1.0);
            let iris = Vec3::new(0.33, 0.24, 0.15) * fibres * rim;
            let sclera = Vec3::new(0.90, 0.87, 0.84);
            let color = (iris * soft(PUPIL_UV) + 0.02).lerp(sclera, soft(LIMBUS_UV));
            texels.extend(color.to_array().map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8));
        }
    }
    texels
}

/// Dark hairs that taper from root (top row) to tip; straight alpha.
fn lash_picture() -> Vec<u8> {
    let (width, height) = LASH_SIZE;
    let hairs = 56.0;
    let mut texels = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let across = ((u * hairs).fract() - 0.5).abs();
            let length = 0.75 + 0.2 * ((u * hairs).floor() * 2.4).sin();
            let half_width = 0.28 * (1.0 - v / length).max(0.0);
            let alpha = ((half_width - across) * 8.0 + 0.5).clamp(0.0, 1.0) * f32::from(v < length);
            texels.extend([18, 12, 10, (alpha * 255.0).round() as u8]);
        }
    }
    texels
}
