//! Textures with mip levels from arrays.

use half::f16;
use rayon::prelude::*;
use rubor_rig::color::srgb_encode;

use crate::device::Gpu;

/// A texel that can be averaged.
pub(crate) type Texel = [f32; 4];

/// Mip levels of an image by 2 x 2 averages, the image itself first. Odd sizes repeat their last row or column.
pub(crate) fn mip_chain(size: [u32; 2], texels: Vec<Texel>) -> Vec<Vec<Texel>> {
    let mut chain = vec![texels];
    let mut from = size;
    while from != [1, 1] {
        let to = from.map(|n| (n / 2).max(1));
        let last = &chain[chain.len() - 1];
        let next = (0..(to[0] * to[1]) as usize)
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| {
                let (x, y) = (i as u32 % to[0] * 2, i as u32 / to[0] * 2);
                let at = |x: u32, y: u32| last[(y.min(from[1] - 1) * from[0] + x.min(from[0] - 1)) as usize];
                let corners = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
                std::array::from_fn(|c| corners.iter().map(|t| t[c]).sum::<f32>() * 0.25)
            })
            .collect();
        chain.push(next);
        from = to;
    }
    chain
}

/// A texture array of 16-bit floats; `layers[layer][level][texel]`.
pub(crate) fn upload_half(
    gpu: &Gpu,
    label: &str,
    size: [u32; 2],
    layers: &[Vec<Vec<Texel>>],
) -> wgpu::TextureView {
    upload_half_channels::<4>(gpu, label, size, layers)
}

/// As [`upload_half`] with the first 1, 2 or 4 channels.
pub(crate) fn upload_half_channels<const N: usize>(
    gpu: &Gpu,
    label: &str,
    size: [u32; 2],
    layers: &[Vec<Vec<Texel>>],
) -> wgpu::TextureView {
    use wgpu::TextureFormat::{R16Float, Rg16Float, Rgba16Float};
    upload_channels::<N, f16>(gpu, label, size, layers, [R16Float, Rg16Float, Rgba16Float], f16::from_f32)
}

/// A texture array of 8-bit values 0 to 1 with the first 1, 2 or 4 channels; `layers[layer][level][texel]`.
pub(crate) fn upload_bytes<const N: usize>(
    gpu: &Gpu,
    label: &str,
    size: [u32; 2],
    layers: &[Vec<Vec<Texel>>],
) -> wgpu::TextureView {
    use wgpu::TextureFormat::{R8Unorm, Rg8Unorm, Rgba8Unorm};
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    upload_channels::<N, u8>(gpu, label, size, layers, [R8Unorm, Rg8Unorm, Rgba8Unorm], byte)
}

/// A texture array of sRGB colours with alpha from linear ones; `layers[layer][level][texel]`.
pub(crate) fn upload_srgb(
    gpu: &Gpu,
    label: &str,
    size: [u32; 2],
    layers: &[Vec<Vec<Texel>>],
) -> wgpu::TextureView {
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    upload(gpu, label, size, layers, wgpu::TextureFormat::Rgba8UnormSrgb, &|texels| {
        let encode = |t: &Texel| {
            let [r, g, b] = [t[0], t[1], t[2]].map(|c| byte(srgb_encode(c)));
            [r, g, b, byte(t[3])]
        };
        texels.par_iter().with_min_len(4096).flat_map_iter(encode).collect::<Vec<u8>>()
    })
}

/// The first N channels of texels; `formats` are those of 1, 2 and 4.
fn upload_channels<const N: usize, T: bytemuck::Pod + Send + Sync>(
    gpu: &Gpu,
    label: &str,
    size: [u32; 2],
    layers: &[Vec<Vec<Texel>>],
    formats: [wgpu::TextureFormat; 3],
    encode: impl Fn(f32) -> T + Sync,
) -> wgpu::TextureView {
    let format = formats[const { if N < 4 { N - 1 } else { 2 } }];
    upload(gpu, label, size, layers, format, &|texels| {
        let first = |t: &Texel| std::array::from_fn::<T, N, _>(|c| encode(t[c]));
        texels.par_iter().with_min_len(4096).flat_map_iter(first).collect::<Vec<_>>()
    })
}

fn upload<T: bytemuck::Pod>(
    gpu: &Gpu,
    label: &str,
    size: [u32; 2],
    layers: &[Vec<Vec<Texel>>],
    format: wgpu::TextureFormat,
    encode: &dyn Fn(&[Texel]) -> Vec<T>,
) -> wgpu::TextureView {
    let levels = layers.first().map_or(1, Vec::len) as u32;
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: layers.len() as u32 },
        mip_level_count: levels,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let texel_bytes = format.block_copy_size(None).unwrap_or(4);
    for (layer, chain) in layers.iter().enumerate() {
        for (level, texels) in chain.iter().enumerate() {
            let width = (size[0] >> level).max(1);
            let height = (size[1] >> level).max(1);
            gpu.queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    texture: &texture,
                    mip_level: level as u32,
                    origin: wgpu::Origin3d { x: 0, y: 0, z: layer as u32 },
                    aspect: wgpu::TextureAspect::All,
                },
                bytemuck::cast_slice(&encode(texels)),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(width * texel_bytes),
                    rows_per_image: None,
                },
                wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            );
        }
    }
    texture.create_view(&Default::default())
}

/// Writes level 0 of a texture of four half floats.
#[cfg(test)]
pub(crate) fn write_half(gpu: &Gpu, texture: &wgpu::Texture, texels: &[Texel]) {
    let halves: Vec<[f16; 4]> = texels.iter().map(|t| t.map(f16::from_f32)).collect();
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(8 * texture.width()),
        rows_per_image: None,
    };
    gpu.queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(&halves), layout, texture.size());
}

/// The same texture seen as an array, whatever its number of layers.
pub(crate) fn array_view(view: &wgpu::TextureView) -> wgpu::TextureView {
    array_view_of(view.texture())
}

/// A texture as an array, whatever its number of layers.
pub(crate) fn array_view_of(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mips_end_in_the_mean() {
        let texels = (0..8).map(|i| [i as f32; 4]).collect();
        let chain = mip_chain([4, 2], texels);
        assert_eq!(chain.iter().map(Vec::len).collect::<Vec<_>>(), [8, 2, 1]);
        assert_eq!(chain[2][0], [3.5; 4]);
    }

    #[test]
    fn odd_sizes_work() {
        assert_eq!(mip_chain([5, 3], vec![[1.0; 4]; 15]).last(), Some(&vec![[1.0; 4]]));
    }
}
