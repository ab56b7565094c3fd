//! What the camera sees of the surface, as numbers for other programs; runs only where a frame keeps such a channel.
//!
//! ```text
//! id, positions, tangent frames, maps, blood --surface data--> normal      world, unit length
//!                                                            > melanin     share of the volume of the epidermis
//!                                                            > hemoglobin  share of the volume of the dermis, now
//!                                                            > part        number of the material plus one
//! ```
//!
//! Theory: as `velocity`, the ray of a pixel and the triangle that it sees give exact barycentric coordinates. Chromophores
//! are those that `shade` looks the colour of skin up with (Jimenez 2012 eq. 7.6).
//!
//! Does not: bend normals by the relief of skin; see hair, lashes and what is blended; give blood where skin has no maps.
//!
//! Costs: four images and three fetches for each pixel of skin; nothing where no channel is kept.

use crate::channels::Channel;
use crate::device::wgsl::{Module, Program, module};
use crate::device::{Bind, Gpu, Image, ImageSpec, Kernel, Recorder};
use crate::passes::block_groups;
use crate::scene::head::AUTHORED_SHIFT;
use crate::scene::view::Seen;
use crate::scene::{MAX_HEMOGLOBIN, MAX_MELANIN, PosedHead};
use crate::settings::Settings;
use rubor_rig::head::Material;

#[cfg(test)]
mod tests;

const SHADER: Module = module!("surface_data", "surface_data.wesl");

/// The channels of the pass, in the order of [`SurfaceData::record`].
pub(crate) const CHANNELS: [Channel; 4] =
    [Channel::Normal, Channel::Melanin, Channel::Hemoglobin, Channel::Parts];

/// Whether frames with these settings keep a channel of the pass.
pub(crate) fn is_wanted(settings: &Settings) -> bool {
    CHANNELS.iter().any(|channel| settings.output.channels.contains(channel))
}

/// The shader of the pass.
pub(crate) fn program() -> Program {
    Program::new(SHADER)
        .constant("AUTHORED_SHIFT", AUTHORED_SHIFT)
        .constant("MAX_HEMOGLOBIN", MAX_HEMOGLOBIN)
        .constant("MAX_MELANIN", MAX_MELANIN)
        .constant("SKIN", Material::Skin.number())
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Params {
    pub(crate) head: u32,
    pub(crate) has_maps: u32,
    pub(crate) hemoglobin_scale: f32,
    pub(crate) padding: u32,
}

/// The pipeline of the pass.
pub(crate) struct SurfaceData {
    kernel: Kernel,
    trilinear_repeat: wgpu::Sampler,
    linear_clamp: wgpu::Sampler,
    black: wgpu::TextureView,
}

impl SurfaceData {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let linear = wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        };
        let repeat = wgpu::AddressMode::Repeat;
        let spec = ImageSpec::light([1, 1]);
        Self {
            kernel: Kernel::new(gpu, "surface data", &program(), "surface_data"),
            trilinear_repeat: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("trilinear repeat"),
                address_mode_u: repeat,
                address_mode_v: repeat,
                ..linear.clone()
            }),
            linear_clamp: gpu
                .device
                .create_sampler(&wgpu::SamplerDescriptor { label: Some("linear clamp"), ..linear }),
            black: Image::new(gpu, "black", spec).view().clone(),
        }
    }

    /// Normal, melanin, hemoglobin and part of what a sample sees of heads, in the order of their ids.
    pub(crate) fn record(&self, r: &mut Recorder<'_>, seen: &Seen, heads: &[PosedHead<'_>]) -> [Image; 4] {
        use wgpu::TextureFormat as Format;
        let size = seen.ids.size();
        let formats = [Format::Rgba16Float, Format::R32Float, Format::R32Float, Format::R32Uint];
        // Without heads nothing is written; a new image is zero.
        let images = formats.map(|format| match heads.is_empty() {
            true => Image::new(r.gpu, "surface data", ImageSpec::storage(size, format)),
            false => r.image("surface data", ImageSpec::storage(size, format)),
        });
        let params: Vec<_> = heads
            .iter()
            .map(|h| {
                let params = Params {
                    head: h.index,
                    has_maps: u32::from(h.head.maps.is_some()),
                    hemoglobin_scale: h.state.hemoglobin_scale,
                    padding: 0,
                };
                r.uniform("surface data", &params)
            })
            .collect();
        let [normal, melanin, hemoglobin, part] = &images;
        let each = heads.iter().zip(&params).map(|(h, params)| {
            let resources = vec![
                ("view", seen.view.bound()),
                ("params", params.bound()),
                ("visible", seen.ids.bound()),
                ("positions", h.positions.bound()),
                ("vertices", h.head.vertices.bound()),
                ("triangles", h.head.triangles.bound()),
                ("frames", h.tangent_frames.bound()),
                ("skin_map", h.head.maps.as_ref().map_or(&self.black, |m| &m.skin).bound()),
                ("blood", h.blood.bound()),
                ("trilinear_repeat", self.trilinear_repeat.bound()),
                ("linear_clamp", self.linear_clamp.bound()),
                ("normal_out", normal.bound()),
                ("melanin_out", melanin.bound()),
                ("hemoglobin_out", hemoglobin.bound()),
                ("part_out", part.bound()),
            ];
            (resources, block_groups(size))
        });
        r.dispatch_each(&self.kernel, each);
        images
    }
}
