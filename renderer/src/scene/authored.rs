//! Materials of authors on the device: numbers in a buffer, pictures as layers of two texture arrays, one of colours
//! (sRGB) and one of values. All layers of an array have one size, that of the largest picture up to a power of two and to
//! 2048, less where all would take more than 256 MiB; texture coordinates do not know it. Pictures of other sizes are
//! resampled.

use std::collections::HashMap;

use half::f16;
use rayon::prelude::*;
use rubor_rig::authored::{
    AlphaMode, Authored, AuthoredImage, AuthoredMaterial, AuthoredTexture, TEXTURES, Wrap,
};
use rubor_rig::color::srgb_decode;
use rubor_rig::head::Head;

use crate::device::kernel::Resource;
use crate::device::texture::{self, Texel};
use crate::device::{Bind, Gpu};
use crate::error::RenderError;

/// Largest side of a layer.
const MAX_SIDE: u32 = 2048;
/// Bytes of the first levels of an array.
const MAX_BYTES: u64 = 256 << 20;
/// Blended parts are opaque from this alpha on: they go through the visibility buffer there.
pub(crate) const OPAQUE_ALPHA: f32 = 0.99;
/// More than any alpha.
const NEVER: f32 = 2.0;
/// Layers of an array that every device has (WebGPU's default limit).
const MAX_LAYERS: usize = 256;

/// A texture as `authored.wesl` reads it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuTexture {
    pub(crate) to_u: [f32; 4],
    pub(crate) to_v: [f32; 4],
    pub(crate) place: [i32; 4],
}

/// A material as `authored.wesl` reads it.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuMaterial {
    pub(crate) base_color: [f32; 4],
    pub(crate) emission: [f32; 4],
    pub(crate) factors: [f32; 4],
    pub(crate) coats: [f32; 4],
    pub(crate) tint: [f32; 4],
    pub(crate) cutoffs: [f32; 4],
    pub(crate) flags: [u32; 4],
    pub(crate) textures: [GpuTexture; TEXTURES],
}

/// What only these materials read of a vertex.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuAuthoredVertex {
    pub(crate) u: f32,
    pub(crate) v: f32,
    pub(crate) red_green: [f16; 2],
    pub(crate) blue_alpha: [f16; 2],
}

/// Materials of the parts of a head that are drawn with those of their author.
#[derive(Clone)]
pub(crate) struct AuthoredOnGpu {
    pub(crate) materials: wgpu::Buffer,
    pub(crate) vertices: wgpu::Buffer,
    pub(crate) colors: wgpu::TextureView,
    pub(crate) data: wgpu::TextureView,
    pub(crate) repeat: wgpu::Sampler,
}

/// Pictures that become layers of one array, in the order in which materials name them.
#[derive(Default)]
struct Layers {
    of_images: HashMap<u32, i32>,
    images: Vec<u32>,
}

impl Layers {
    fn of(&mut self, texture: Option<&AuthoredTexture>) -> i32 {
        let Some(texture) = texture else { return -1 };
        *self.of_images.entry(texture.image).or_insert_with(|| {
            self.images.push(texture.image);
            self.images.len() as i32 - 1
        })
    }

    fn upload(
        &self,
        gpu: &Gpu,
        label: &str,
        all: &[AuthoredImage],
        is_color: bool,
    ) -> Result<wgpu::TextureView, RenderError> {
        if self.images.len() > MAX_LAYERS {
            return Err(RenderError::Limit {
                what: "number of pictures of materials",
                found: self.images.len().to_string(),
                expected: format!("at most {MAX_LAYERS}"),
            });
        }
        let images: Vec<&AuthoredImage> = self.images.iter().map(|i| &all[*i as usize]).collect();
        let side = side_of(&images);
        let chains: Vec<_> = match images.is_empty() {
            true => vec![texture::mip_chain([1, 1], vec![[1.0; 4]])],
            false => images
                .iter()
                .map(|image| texture::mip_chain([side; 2], resampled(image, side, is_color)))
                .collect(),
        };
        let view = match is_color {
            true => texture::upload_srgb(gpu, label, [side; 2], &chains),
            false => texture::upload_bytes::<4>(gpu, label, [side; 2], &chains),
        };
        Ok(texture::array_view(&view))
    }
}

impl AuthoredOnGpu {
    /// Uploads the materials of a head; `None` where no part is drawn with one.
    pub(crate) fn new(gpu: &Gpu, head: &Head) -> Result<Option<Self>, RenderError> {
        let drawn: Vec<u32> = (0..head.mesh.parts.len()).filter_map(|p| head.needed_material(p)).collect();
        if drawn.is_empty() {
            return Ok(None);
        }
        let authored = &head.authored;
        let (mut colors, mut data) = (Layers::default(), Layers::default());
        let materials: Vec<GpuMaterial> = (authored.materials.iter().enumerate())
            .map(|(i, material)| match drawn.contains(&(i as u32)) {
                true => {
                    let is_skin = (0..head.mesh.parts.len()).any(|p| head.hole_material(p) == Some(i as u32));
                    gpu_material(material, is_skin, &mut colors, &mut data)
                }
                false => {
                    let none = (&mut Layers::default(), &mut Layers::default());
                    gpu_material(&AuthoredMaterial::default(), false, none.0, none.1)
                }
            })
            .collect();
        let repeat = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("authored repeat"),
            address_mode_u: wgpu::AddressMode::Repeat,
            address_mode_v: wgpu::AddressMode::Repeat,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        });
        Ok(Some(Self {
            materials: gpu.storage("authored materials", &materials),
            vertices: vertices(gpu, head),
            colors: colors.upload(gpu, "authored colours", &authored.images, true)?,
            data: data.upload(gpu, "authored values", &authored.images, false)?,
            repeat,
        }))
    }
}

fn vertices(gpu: &Gpu, head: &Head) -> wgpu::Buffer {
    let of = |v| gpu_vertex(&head.authored, v);
    let vertices: Vec<GpuAuthoredVertex> = (0..head.mesh.vertices.len() as u32).map(of).collect();
    gpu.storage("authored vertices", &vertices)
}

impl AuthoredOnGpu {
    /// The same materials for other vertices.
    pub(crate) fn of_level(&self, gpu: &Gpu, head: &Head) -> Self {
        Self { vertices: vertices(gpu, head), ..self.clone() }
    }

    /// What tells colour and alpha of a place.
    pub(crate) fn resources(&self) -> [Resource<'_>; 4] {
        [
            ("authored_materials", self.materials.bound()),
            ("authored_vertices", self.vertices.bound()),
            ("authored_colors", self.colors.bound()),
            ("authored_repeat", self.repeat.bound()),
        ]
    }
}

fn gpu_vertex(authored: &Authored, vertex: u32) -> GpuAuthoredVertex {
    let uv = authored.second_uv(vertex);
    let [r, g, b, a] = authored.color_linear(vertex).map(f16::from_f32);
    GpuAuthoredVertex { u: uv.x, v: uv.y, red_green: [r, g], blue_alpha: [b, a] }
}

/// `is_skin`: only its holes are drawn.
fn gpu_material(
    material: &AuthoredMaterial,
    is_skin: bool,
    colors: &mut Layers,
    data: &mut Layers,
) -> GpuMaterial {
    let textures = material.textures().map(|(_, texture)| texture);
    // Pictures that nothing reads take no memory.
    let is_read = |i: usize| match i {
        0 => true,
        _ if is_skin || material.is_unlit => false,
        7 | 8 => material.clearcoat > 0.0,
        9 => material.transmission > 0.0,
        _ => true,
    };
    let layers: [i32; TEXTURES] = std::array::from_fn(|i| {
        let of = if [0, 4, 6].contains(&i) { &mut *colors } else { &mut *data };
        of.of(textures[i].filter(|_| is_read(i)))
    });
    let [r, g, b] = material.emission_linear;
    let [tint_r, tint_g, tint_b] = material.specular_color;
    let for_lamps = material.cutoff().unwrap_or(0.0);
    let cutoffs = match material.alpha {
        _ if is_skin => [for_lamps; 2],
        // Glass is dark for no lamp.
        _ if material.transmission > 0.0 => [NEVER; 2],
        AlphaMode::Blend => [for_lamps, OPAQUE_ALPHA],
        AlphaMode::Opaque | AlphaMode::Mask { .. } => [for_lamps; 2],
    };
    let flags = [
        material.is_unlit,
        material.is_double_sided || is_skin,
        material.alpha == AlphaMode::Blend && !is_skin,
    ];
    GpuMaterial {
        base_color: material.base_color,
        emission: [r, g, b, 0.0],
        factors: [material.metallic, material.roughness, material.normal_scale, material.occlusion_strength],
        coats: [
            material.dielectric_f0(),
            material.specular,
            material.clearcoat,
            material.clearcoat_roughness,
        ],
        tint: [tint_r, tint_g, tint_b, material.transmission],
        cutoffs: [cutoffs[0], cutoffs[1], 0.0, 0.0],
        flags: [flags.iter().enumerate().map(|(bit, is)| u32::from(*is) << bit).sum(), 0, 0, 0],
        textures: std::array::from_fn(|i| gpu_texture(textures[i].filter(|_| layers[i] >= 0), layers[i])),
    }
}

fn gpu_texture(texture: Option<&AuthoredTexture>, layer: i32) -> GpuTexture {
    let Some(texture) = texture else {
        return GpuTexture { to_u: [0.0; 4], to_v: [0.0; 4], place: [-1, 0, 0, 0] };
    };
    let matrix = texture.transform.matrix();
    let [x, y] = [matrix.matrix2.x_axis, matrix.matrix2.y_axis];
    let wrap = texture.wrap.map(|w| match w {
        Wrap::Repeat => 0,
        Wrap::Clamp => 1,
        Wrap::Mirror => 2,
    });
    GpuTexture {
        to_u: [x.x, y.x, matrix.translation.x, 0.0],
        to_v: [x.y, y.y, matrix.translation.y, 0.0],
        place: [layer, texture.uv_set as i32, wrap[0], wrap[1]],
    }
}

/// Side of the layers that pictures get.
fn side_of(images: &[&AuthoredImage]) -> u32 {
    let largest = images.iter().map(|i| i.width.max(i.height)).max().unwrap_or(1);
    let mut side = largest.min(MAX_SIDE).next_power_of_two();
    while side > 1 && images.len() as u64 * u64::from(side) * u64::from(side) * 4 > MAX_BYTES {
        side /= 2;
    }
    side
}

/// A picture of another size: means over the texels that a new one covers, linear between them where it covers less.
fn resampled(image: &AuthoredImage, side: u32, is_color: bool) -> Vec<Texel> {
    let decode: Vec<f32> = (0..=255u8)
        .map(|byte| f32::from(byte) / 255.0)
        .map(|v| if is_color { srgb_decode(v) } else { v })
        .collect();
    let texel = |x: i64, y: i64| -> Texel {
        let x = x.clamp(0, i64::from(image.width) - 1) as usize;
        let y = y.clamp(0, i64::from(image.height) - 1) as usize;
        let at = 4 * (y * image.width as usize + x);
        let [r, g, b] = [0, 1, 2].map(|c| decode[usize::from(image.rgba[at + c])]);
        [r, g, b, f32::from(image.rgba[at + 3]) / 255.0]
    };
    let steps = [image.width, image.height].map(|n| n.div_ceil(side));
    let linear = |x: f64, y: f64| -> Texel {
        let (x, y) = (x - 0.5, y - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (right_share, lower_share) = ((x - left) as f32, (y - top) as f32);
        let (left, top) = (left as i64, top as i64);
        let mix = |a: Texel, b: Texel, t: f32| -> Texel { std::array::from_fn(|c| a[c] + t * (b[c] - a[c])) };
        let upper = mix(texel(left, top), texel(left + 1, top), right_share);
        let lower = mix(texel(left, top + 1), texel(left + 1, top + 1), right_share);
        mix(upper, lower, lower_share)
    };
    let per_texel = [f64::from(image.width) / f64::from(side), f64::from(image.height) / f64::from(side)];
    (0..side * side)
        .into_par_iter()
        .with_min_len(4096)
        .map(|i| {
            let (x, y) = (i % side, i / side);
            let mut sum = [0.0; 4];
            for step_y in 0..steps[1] {
                for step_x in 0..steps[0] {
                    let inside = |step: u32, steps: u32| (f64::from(step) + 0.5) / f64::from(steps);
                    let at = linear(
                        (f64::from(x) + inside(step_x, steps[0])) * per_texel[0],
                        (f64::from(y) + inside(step_y, steps[1])) * per_texel[1],
                    );
                    (0..4).for_each(|c| sum[c] += at[c]);
                }
            }
            sum.map(|v| v / (steps[0] * steps[1]) as f32)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> u8) -> AuthoredImage {
        let grey = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let rgba = grey.flat_map(|(x, y)| [texel(x, y), texel(x, y), texel(x, y), 255]).collect();
        AuthoredImage { name: "grey".into(), width, height, rgba }
    }

    #[test]
    fn pictures_of_the_size_keep_their_texels_and_others_their_mean() {
        let ramp = image(4, 4, |x, y| (40 * x + 10 * y) as u8);
        let same = resampled(&ramp, 4, false);
        for (i, texel) in same.iter().enumerate() {
            assert!((texel[0] - f32::from(ramp.rgba[4 * i]) / 255.0).abs() < 1e-6, "{i}: {texel:?}");
        }
        let mean = |texels: &[Texel]| texels.iter().map(|t| t[0]).sum::<f32>() / texels.len() as f32;
        for side in [1, 2, 8] {
            let found = mean(&resampled(&ramp, side, false));
            assert!((found - mean(&same)).abs() < 1e-5, "{side}: {found}");
        }
        // A colour is averaged in linear light: half black, half white.
        let halves = image(2, 1, |x, _| if x == 0 { 0 } else { 255 });
        assert!((resampled(&halves, 1, true)[0][0] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn layers_stay_within_their_memory() {
        let large = image(1, 1, |_, _| 0);
        let large = AuthoredImage { width: 5000, height: 3, ..large };
        assert_eq!(side_of(&[&large]), 2048);
        assert_eq!(side_of(&[&large; 17]), 1024);
        let small = image(3, 2, |_, _| 0);
        assert_eq!(side_of(&[&small]), 4);
    }
}
