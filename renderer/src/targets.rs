//! Images between the passes of a frame.

use crate::gpu::Gpu;
use crate::settings::Settings;

/// Images between passes.
pub(crate) struct Targets {
    pub(crate) size: [u32; 2],
    pub(crate) samples: Vec<SampleTargets>,
    pub(crate) velocity: Option<wgpu::TextureView>,
    pub(crate) image: wgpu::Texture,
    pub(crate) irradiance: wgpu::TextureView,
    pub(crate) albedo: wgpu::TextureView,
    pub(crate) direct: wgpu::TextureView,
    pub(crate) scratch: wgpu::TextureView,
    pub(crate) scattered: wgpu::TextureView,
    pub(crate) hdr: wgpu::TextureView,
    pub(crate) shadows: wgpu::Texture,
}

/// Images of one sample of each pixel.
pub(crate) struct SampleTargets {
    pub(crate) ids: wgpu::TextureView,
    pub(crate) depth: wgpu::TextureView,
    /// Encoded for display, before antialiasing.
    pub(crate) displayed: wgpu::TextureView,
}

impl Targets {
    /// Images for frames with these settings and so many shadow maps.
    pub(crate) fn new(gpu: &Gpu, settings: &Settings, shadow_layers: u32) -> Self {
        use wgpu::TextureFormat::{Depth32Float, R32Uint, Rgba8Unorm, Rgba16Float};
        use wgpu::TextureUsages as Use;
        let size = settings.frame_size();
        let storage = Use::STORAGE_BINDING;
        let view = |label, size, format, usage| {
            gpu.target(label, size, format, usage | Use::TEXTURE_BINDING | Use::COPY_SRC)
                .create_view(&Default::default())
        };
        let light = |label| view(label, size, Rgba16Float, storage);
        let mode = settings.antialias().mode;
        let samples = mode
            .subsamples(0)
            .iter()
            .map(|_| SampleTargets {
                ids: view("ids", size, R32Uint, Use::RENDER_ATTACHMENT),
                depth: view("depth", size, Depth32Float, Use::RENDER_ATTACHMENT),
                displayed: view("displayed", settings.output.size, Rgba8Unorm, storage),
            })
            .collect();
        let shadows = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("shadows"),
            size: wgpu::Extent3d {
                width: settings.quality.shadow_size,
                height: settings.quality.shadow_size,
                depth_or_array_layers: shadow_layers.max(1),
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: Depth32Float,
            usage: Use::RENDER_ATTACHMENT | Use::TEXTURE_BINDING,
            view_formats: &[],
        });
        Self {
            size,
            samples,
            velocity: mode
                .is_temporal()
                .then(|| view("velocity", size, Rgba16Float, storage | Use::RENDER_ATTACHMENT)),
            image: gpu.target(
                "image",
                settings.output.size,
                Rgba8Unorm,
                storage | Use::COPY_SRC | Use::TEXTURE_BINDING,
            ),
            irradiance: light("irradiance"),
            albedo: light("albedo"),
            direct: light("direct"),
            scratch: light("scratch"),
            scattered: light("scattered"),
            hdr: view("hdr", size, Rgba16Float, storage | Use::RENDER_ATTACHMENT),
            shadows,
        }
    }

    /// Whether frames with these settings find what they need.
    pub(crate) fn matches(&self, settings: &Settings, shadow_layers: u32) -> bool {
        let mode = settings.antialias().mode;
        self.size == settings.frame_size()
            && [self.image.width(), self.image.height()] == settings.output.size
            && self.samples.len() == mode.subsamples(0).len()
            && self.velocity.is_some() == mode.is_temporal()
            && self.shadows.width() == settings.quality.shadow_size
            && self.shadows.depth_or_array_layers() >= shadow_layers
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        let image = u64::from(self.image.width()) * u64::from(self.image.height()) * 4;
        let samples = self.samples.len() as u64;
        let s = self.shadows.size();
        let shadow = u64::from(s.width) * u64::from(s.height) * u64::from(s.depth_or_array_layers) * 4;
        let lights = 6 + u64::from(self.velocity.is_some());
        pixels * (samples * 8 + lights * 8) + image * (1 + samples) + shadow
    }
}
