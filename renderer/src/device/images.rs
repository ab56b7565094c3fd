//! Images between passes: made by the pass that needs them, reused when the last reference is dropped.

use std::sync::Arc;

use super::gpu::Gpu;

/// Description of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ImageSpec {
    pub(crate) size: [u32; 2],
    pub(crate) layers: u32,
    /// Whether shaders see an array, even with one layer.
    pub(crate) is_array: bool,
    pub(crate) format: wgpu::TextureFormat,
    pub(crate) usage: wgpu::TextureUsages,
}

/// An image of a frame. Clones are the same image; it can be reused when the last is dropped.
#[derive(Clone)]
pub(crate) struct Image(Arc<Slot>);

struct Slot {
    spec: ImageSpec,
    texture: wgpu::Texture,
    view: wgpu::TextureView,
}

/// All images of a renderer.
#[derive(Default)]
pub(crate) struct Images {
    slots: Vec<(Arc<Slot>, u64)>,
    frame: u64,
}

/// Number of frames after which an unused image is dropped: two, because methods may alternate.
const KEPT_FRAMES: u64 = 2;

impl ImageSpec {
    /// An image that compute passes write and any pass reads.
    pub(crate) fn storage(size: [u32; 2], format: wgpu::TextureFormat) -> Self {
        use wgpu::TextureUsages as Use;
        Self {
            size,
            layers: 1,
            is_array: false,
            format,
            usage: Use::STORAGE_BINDING | Use::TEXTURE_BINDING | Use::COPY_SRC,
        }
    }

    /// A storage image of half floats, for light.
    pub(crate) fn light(size: [u32; 2]) -> Self {
        Self::storage(size, wgpu::TextureFormat::Rgba16Float)
    }

    /// An image that triangles are drawn into and any pass reads.
    pub(crate) fn attachment(size: [u32; 2], format: wgpu::TextureFormat) -> Self {
        use wgpu::TextureUsages as Use;
        Self {
            size,
            layers: 1,
            is_array: false,
            format,
            usage: Use::RENDER_ATTACHMENT | Use::TEXTURE_BINDING | Use::COPY_SRC,
        }
    }

    /// The same with additional uses.
    pub(crate) fn also(self, usage: wgpu::TextureUsages) -> Self {
        Self { usage: self.usage | usage, ..self }
    }

    /// The same as an array of layers.
    pub(crate) fn layers(self, layers: u32) -> Self {
        Self { layers, is_array: true, ..self }
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let texel = u64::from(self.format.block_copy_size(None).unwrap_or(4));
        u64::from(self.size[0]) * u64::from(self.size[1]) * u64::from(self.layers) * texel
    }
}

impl Image {
    /// An image outside the pool, for data that is carried from frame to frame.
    pub(crate) fn new(gpu: &Gpu, label: &'static str, spec: ImageSpec) -> Self {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: spec.size[0],
                height: spec.size[1],
                depth_or_array_layers: spec.layers,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: spec.format,
            usage: spec.usage,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: spec.is_array.then_some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        Self(Arc::new(Slot { spec, texture, view }))
    }

    /// A view of all layers.
    pub(crate) fn view(&self) -> &wgpu::TextureView {
        &self.0.view
    }

    pub(crate) fn texture(&self) -> &wgpu::Texture {
        &self.0.texture
    }

    pub(crate) fn size(&self) -> [u32; 2] {
        self.0.spec.size
    }

    /// A view of one layer.
    pub(crate) fn layer(&self, layer: u32) -> wgpu::TextureView {
        self.0.texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2),
            base_array_layer: layer,
            array_layer_count: Some(1),
            ..Default::default()
        })
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.0.spec.bytes()
    }
}

impl Images {
    /// An image without other references. Its texels are undefined.
    pub(crate) fn take(&mut self, gpu: &Gpu, label: &'static str, spec: ImageSpec) -> Image {
        let frame = self.frame;
        let free = self.slots.iter_mut().find(|(slot, _)| slot.spec == spec && Arc::strong_count(slot) == 1);
        if let Some((slot, last_used)) = free {
            *last_used = frame;
            return Image(slot.clone());
        }
        let image = Image::new(gpu, label, spec);
        self.slots.push((image.0.clone(), frame));
        image
    }

    /// Drops images that the last frames did not use; called at the beginning of a frame.
    pub(crate) fn begin_frame(&mut self) {
        self.frame += 1;
        let frame = self.frame;
        self.slots
            .retain(|(slot, last_used)| Arc::strong_count(slot) > 1 || last_used + KEPT_FRAMES >= frame);
    }

    /// Bytes of all images on the device.
    pub(crate) fn bytes(&self) -> u64 {
        self.slots.iter().map(|(slot, _)| slot.spec.bytes()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::gpu;

    #[test]
    fn images_are_used_again_and_dropped_when_nobody_asks() {
        let Some(gpu) = gpu() else { return };
        let mut images = Images::default();
        images.begin_frame();
        let spec = ImageSpec::light([8, 4]);
        let first = images.take(gpu, "first", spec);
        let second = images.take(gpu, "second", spec);
        assert_ne!(first.texture(), second.texture(), "an image that is held is not given away");
        assert_eq!(images.bytes(), 2 * 8 * 4 * 8);
        let texture = first.texture().clone();
        drop(first);
        assert_eq!(images.take(gpu, "third", spec).texture(), &texture, "a dropped one is");
        for _ in 0..4 {
            images.begin_frame();
        }
        assert_eq!(images.bytes(), 8 * 4 * 8, "what is held stays");
        drop(second);
        images.begin_frame();
        assert_eq!(images.bytes(), 0);
    }
}
