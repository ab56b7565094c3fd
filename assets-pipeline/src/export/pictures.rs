//! Pictures and plain materials for programs that know nothing of the head's maps.

use glam::Vec3;
use image::ExtendedColorType;
use rayon::prelude::*;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{BASE_COLOR_F0, Head, Material, SKIN_F0};
use rubor_rig::map::Map;

use super::eye_mouth;
use super::skin_color::{bake, bake_slopes, hidden_by_hair};
use crate::convert::skin_texels::SkinTexels;

/// Size of the lash picture: along the lid, root to tip.
const LASH_SIZE: (u32, u32) = (512, 64);
/// Largest side of the pictures of gloss, which is smooth.
const GLOSS_SIZE: u32 = 1024;

/// Of skin (Jimenez 2012 section 7.6: 1.4).
const SKIN_IOR: f32 = 1.4;
/// Of glTF's materials, and so of skin with a colour by itself.
const BASE_COLOR_IOR: f32 = 1.5;

/// 8-bit texels.
pub(super) struct Picture {
    pub(super) texels: Vec<u8>,
    pub(super) size: (u32, u32),
    pub(super) color: ExtendedColorType,
}

/// Pictures that the parts of a head need; absent if no part needs them.
pub(super) struct Pictures {
    /// sRGB.
    pub(super) base_color: Option<Picture>,
    /// Tangent space, x to the right, y up.
    pub(super) normals: Option<Picture>,
    /// Linear: red is ambient visibility, green perceptual roughness, blue 0.
    pub(super) gloss: Option<Picture>,
    /// Alpha is the strength of reflection; the colours are white.
    pub(super) specular: Option<Picture>,
    /// sRGB, of the front half of the eye (see [`eye_mouth::EYE_TRANSFORM`]).
    pub(super) eye: Option<Picture>,
    /// sRGB; absent too where the teeth have other texture coordinates than rubor's (see [`eye_mouth::teeth`]).
    pub(super) teeth: Option<Picture>,
    /// sRGB with straight alpha.
    pub(super) lashes: Option<Picture>,
}

impl Pictures {
    /// Of a pose, or of the neutral face. `color_factor` multiplies the colour of the skin.
    pub(super) fn new(
        head: &Head,
        pose: Option<&FaceState>,
        color_size: u32,
        normal_size: u32,
        color_factor: f32,
    ) -> Self {
        let has = |m: Material| head.mesh.parts.iter().any(|p| p.material == m);
        let base_color = bake(head, pose, color_size, color_factor).map(|picture| Picture {
            size: picture.dimensions(),
            texels: picture.into_raw(),
            color: ExtendedColorType::Rgb8,
        });
        let wrinkled = pose.and_then(|face| bake_slopes(head, face));
        let slopes = wrinkled.as_ref().or(head.maps.slopes.as_ref());
        Self {
            base_color,
            normals: slopes
                .filter(|_| normal_size > 0 && has(Material::Skin))
                .map(|slopes| normal_map(slopes, normal_size)),
            gloss: gloss(head, color_size.min(GLOSS_SIZE)),
            specular: specular(head, color_size.min(GLOSS_SIZE / 2)),
            eye: has(Material::Eye).then(|| eye_mouth::eye(head.maps.hair_color_linear)),
            teeth: eye_mouth::has_teeth_coordinates(head).then(eye_mouth::teeth),
            lashes: has(Material::Lash).then(lash_picture),
        }
    }
}

/// A material in numbers.
pub(super) struct Look {
    /// Linear Rec. 709 and opacity.
    pub(super) color_linear: [f32; 4],
    /// Perceptual roughness.
    pub(super) roughness: f32,
    /// Index of refraction.
    pub(super) ior: f32,
    /// Strength of reflection, 0 to 1.
    pub(super) specular: f32,
}

/// `textured`: the part has a picture. Colours, reflection and roughness are those of the renderer, whose Beckmann
/// roughness is about the square of the perceptual one.
pub(super) fn appearance(head: &Head, material: Material, textured: bool) -> Look {
    let white = [1.0; 4];
    let solid = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
    let hair = head.maps.hair_color_linear;
    let (color_linear, roughness, ior, specular) = match material {
        Material::Skin if textured && head.maps.albedo.is_some() => (white, 0.5, BASE_COLOR_IOR, 1.0),
        Material::Skin if textured => (white, 0.5, SKIN_IOR, 1.0),
        Material::Skin => (solid([0.60, 0.36, 0.27]), 0.57, SKIN_IOR, 0.6),
        Material::Mucosa => (solid([0.36, 0.105, 0.095]), 0.49, SKIN_IOR, 0.8),
        Material::Gums => (solid([0.37, 0.13, 0.12]), 0.49, SKIN_IOR, 0.8),
        Material::Teeth if textured => (white, 0.4, 1.62, 0.6),
        Material::Teeth => (solid([0.66, 0.56, 0.42]), 0.4, 1.62, 0.6),
        Material::Eye => (white, 0.25, 1.376, 1.0),
        Material::Lash => (white, 0.7, 1.5, 0.5),
        Material::Hair if hair != [0.0; 3] => (solid(hair), 0.6, 1.5, 0.5),
        Material::Hair => (solid([0.05, 0.03, 0.02]), 0.6, 1.5, 0.5),
        Material::Wet => ([1.0, 1.0, 1.0, 0.06], 0.05, 1.336, 1.0),
        Material::Hidden => ([0.0; 4], 1.0, 1.5, 1.0),
        Material::Other => (solid([0.2, 0.2, 0.2]), 0.7, 1.4, 0.3),
    };
    Look { color_linear, roughness, ior, specular }
}

/// Visibility and roughness of the skin; `None` where the head says nothing of either.
fn gloss(head: &Head, size: u32) -> Option<Picture> {
    let has_skin = head.mesh.parts.iter().any(|p| p.material == Material::Skin);
    let open = &head.mesh.occlusion;
    let map = head.maps.specular.as_ref();
    if size == 0 || !has_skin || (open.is_empty() && map.is_none()) {
        return None;
    }
    let open = (!open.is_empty()).then(|| SkinTexels::new(head, size, size).map_of_points(open));
    let texel = |i: u32| {
        let (u, v) = ((i % size) as f32 + 0.5, (i / size) as f32 + 0.5);
        let (u, v) = (u / size as f32, v / size as f32);
        let open = open.as_ref().map_or(1.0, |m| m.values[i as usize]);
        let roughness = map.map_or(0.5, |m| m.sample(u, v, 1).max(0.0).sqrt());
        [open, roughness, 0.0].map(byte)
    };
    let texels = (0..size * size).into_par_iter().flat_map_iter(texel).collect();
    Some(Picture { texels, size: (size, size), color: ExtendedColorType::Rgb8 })
}

/// Strength of the skin's reflection, without what short hair hides.
fn specular(head: &Head, size: u32) -> Option<Picture> {
    let map = head.maps.specular.as_ref().filter(|_| size > 0)?;
    let over = if head.maps.albedo.is_some() { SKIN_F0 / BASE_COLOR_F0 } else { 1.0 };
    let texel = |i: u32| {
        let (u, v) = ((i % size) as f32 + 0.5, (i / size) as f32 + 0.5);
        let (u, v) = (u / size as f32, v / size as f32);
        let hair = head.maps.hair.as_ref().map_or(0.0, |h| hidden_by_hair(h.sample(u, v, 0)));
        [255, 255, 255, byte(over * map.sample(u, v, 0) * (1.0 - hair))]
    };
    let texels = (0..size * size).into_par_iter().flat_map_iter(texel).collect();
    Some(Picture { texels, size: (size, size), color: ExtendedColorType::Rgba8 })
}

fn byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Tangent space normals of a map of slopes; x to the right, y up, in 8 bits.
fn normal_map(slopes: &Map, size: u32) -> Picture {
    let (width, height) = (size.min(slopes.width), size.min(slopes.height));
    let mut texels = Vec::with_capacity((width * height * 3) as usize);
    for y in 0..height {
        for x in 0..width {
            let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let n = Vec3::new(slopes.sample(u, v, 0), slopes.sample(u, v, 1), 1.0).normalize();
            texels.extend(n.to_array().map(|c| ((0.5 + 0.5 * c) * 255.0).round() as u8));
        }
    }
    Picture { texels, size: (width, height), color: ExtendedColorType::Rgb8 }
}

/// Dark hairs that taper from root (top row) to tip; straight alpha.
fn lash_picture() -> Picture {
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
    Picture { texels, size: LASH_SIZE, color: ExtendedColorType::Rgba8 }
}
