//! Pictures and plain materials for programs that know nothing of the head's maps.

use glam::Vec3;
use image::ExtendedColorType;
use rubor_rig::face_state::FaceState;
use rubor_rig::head::{Head, Material};
use rubor_rig::map::Map;

use super::skin_color::{bake, bake_slopes};
use crate::import::eye_projection::LIMBUS_UV;

/// Side of the eye picture.
const EYE_SIZE: u32 = 512;
/// Size of the lash picture: along the lid, root to tip.
const LASH_SIZE: (u32, u32) = (512, 64);
/// Texture radius of the pupil in the projection of [`Material::Eye`].
const PUPIL_UV: f32 = 0.035;

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
    /// sRGB.
    pub(super) eye: Option<Picture>,
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
            eye: has(Material::Eye).then(eye_picture),
            lashes: has(Material::Lash).then(lash_picture),
        }
    }
}

/// A material in two numbers.
pub(super) struct Look {
    /// Linear Rec. 709 and opacity.
    pub(super) color_linear: [f32; 4],
    /// Perceptual roughness.
    pub(super) roughness: f32,
}

/// `textured`: the skin has a picture.
pub(super) fn appearance(material: Material, textured: bool) -> Look {
    let (color_linear, roughness) = match material {
        Material::Skin if textured => ([1.0; 4], 0.5),
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
    Look { color_linear, roughness }
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

/// Sclera, iris with radial fibres and dark rim, pupil; sRGB.
fn eye_picture() -> Picture {
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
    Picture { texels, size: (EYE_SIZE, EYE_SIZE), color: ExtendedColorType::Rgb8 }
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
