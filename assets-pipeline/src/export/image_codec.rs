//! Maps as images: quantisation to 8 or 16 bits, PNG or JPEG.

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rubor_rig::color::srgb_encode;
use rubor_rig::map::Map;

use crate::error::ExportError;
use crate::facial_appearance::ChannelLayout;

/// How a map is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapEncoding {
    /// 8-bit PNG: half a step of 1/255 of the map's range at most.
    Png8,
    /// 16-bit PNG: half a step of 1/65535 of the map's range at most.
    Png16,
    /// JPEG of this quality, 1 to 100: small, not exact.
    Jpeg(u8),
}

/// How pictures for other programs are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureFormat {
    /// Exact.
    Png,
    /// Small; pictures with transparency stay PNG.
    #[default]
    Jpeg,
    /// Exact, smaller than PNG; glTF needs `EXT_texture_webp` for it.
    Webp,
}

impl TextureFormat {
    /// The extension of a file name.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg => "jpg",
            Self::Webp => "webp",
        }
    }

    /// The format that a picture gets: JPEG has no transparency.
    pub(crate) fn of(self, color: ExtendedColorType) -> Self {
        if self == Self::Jpeg && color == ExtendedColorType::Rgba8 { Self::Png } else { self }
    }

    /// As in HTTP and glTF.
    pub(crate) fn mime_type(self) -> &'static str {
        match self {
            Self::Png => "image/png",
            Self::Jpeg => "image/jpeg",
            Self::Webp => "image/webp",
        }
    }
}

/// Quality of JPEG pictures that only other programs use.
const PICTURE_QUALITY: u8 = 90;

/// Encodes a picture for other programs; the format may differ from the one asked for (see [`TextureFormat::of`]).
pub(crate) fn encode_picture(
    what: &str,
    texels: &[u8],
    (width, height): (u32, u32),
    color: ExtendedColorType,
    format: TextureFormat,
) -> Result<(Vec<u8>, TextureFormat), ExportError> {
    let format = format.of(color);
    let bytes = match format {
        TextureFormat::Png => encode_png(what, texels, width, height, color)?,
        TextureFormat::Jpeg => encode_jpeg(what, texels, width, height, color, PICTURE_QUALITY)?,
        TextureFormat::Webp => {
            let mut bytes = Vec::new();
            WebPEncoder::new_lossless(&mut bytes)
                .write_image(texels, width, height, color)
                .map_err(|e| ExportError::Encode { what: what.into(), reason: e.to_string() })?;
            bytes
        }
    };
    Ok((bytes, format))
}

/// An encoded image and what turns its texels back into values.
pub(crate) struct EncodedMap {
    pub(crate) bytes: Vec<u8>,
    pub(crate) mime_type: &'static str,
    pub(crate) layout: ChannelLayout,
    pub(crate) offset: Vec<f32>,
    pub(crate) scale: Vec<f32>,
}

/// Encodes a map of one or two channels over its own range of values. Two channels are stacked.
pub(crate) fn encode_map(what: &str, map: &Map, encoding: MapEncoding) -> Result<EncodedMap, ExportError> {
    let channels = map.channels as usize;
    let (offset, scale): (Vec<f32>, Vec<f32>) = (0..channels).map(|c| range(map, c)).unzip();
    let texel = |c: usize, levels: f32| {
        let (offset, scale) = (offset[c], scale[c]);
        let values = map.values.iter().skip(c).step_by(channels);
        values.map(move |v| if scale > 0.0 { ((v - offset) / scale * levels).round() } else { 0.0 })
    };
    let (width, height) = (map.width, map.height * map.channels);
    let eight = || -> Vec<u8> { (0..channels).flat_map(|c| texel(c, 255.0)).map(|t| t as u8).collect() };
    let (bytes, mime_type) = match encoding {
        MapEncoding::Png8 => (encode_png(what, &eight(), width, height, ExtendedColorType::L8)?, "image/png"),
        MapEncoding::Png16 => {
            let texels: Vec<u16> = (0..channels).flat_map(|c| texel(c, 65535.0)).map(|t| t as u16).collect();
            // The encoder takes native byte order and writes the big-endian order of PNG.
            let bytes = bytemuck::cast_slice(&texels);
            (encode_png(what, bytes, width, height, ExtendedColorType::L16)?, "image/png")
        }
        MapEncoding::Jpeg(quality) => {
            (encode_jpeg(what, &eight(), width, height, ExtendedColorType::L8, quality)?, "image/jpeg")
        }
    };
    let layout = if channels == 1 { ChannelLayout::First } else { ChannelLayout::Stacked };
    Ok(EncodedMap { bytes, mime_type, layout, offset, scale })
}

/// Encodes a map of linear Rec. 709 colours from 0 to 1 in 8 bits of sRGB.
pub(crate) fn encode_colors(what: &str, map: &Map, encoding: MapEncoding) -> Result<EncodedMap, ExportError> {
    let texels: Vec<u8> =
        map.values.iter().map(|v| (srgb_encode(v.clamp(0.0, 1.0)) * 255.0).round() as u8).collect();
    let (width, height) = (map.width, map.height);
    let (bytes, mime_type) = match encoding {
        MapEncoding::Png8 | MapEncoding::Png16 => {
            (encode_png(what, &texels, width, height, ExtendedColorType::Rgb8)?, "image/png")
        }
        MapEncoding::Jpeg(quality) => {
            (encode_jpeg(what, &texels, width, height, ExtendedColorType::Rgb8, quality)?, "image/jpeg")
        }
    };
    Ok(EncodedMap {
        bytes,
        mime_type,
        layout: ChannelLayout::Color,
        offset: vec![0.0; 3],
        scale: vec![1.0; 3],
    })
}

fn range(map: &Map, channel: usize) -> (f32, f32) {
    let values = map.values.iter().skip(channel).step_by(map.channels as usize);
    let (low, high) =
        values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    (low, high - low)
}

pub(crate) fn encode_png(
    what: &str,
    texels: &[u8],
    width: u32,
    height: u32,
    color: ExtendedColorType,
) -> Result<Vec<u8>, ExportError> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(texels, width, height, color)
        .map_err(|e| ExportError::Encode { what: what.into(), reason: e.to_string() })?;
    Ok(bytes)
}

pub(crate) fn encode_jpeg(
    what: &str,
    texels: &[u8],
    width: u32,
    height: u32,
    color: ExtendedColorType,
    quality: u8,
) -> Result<Vec<u8>, ExportError> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality.clamp(1, 100))
        .write_image(texels, width, height, color)
        .map_err(|e| ExportError::Encode { what: what.into(), reason: e.to_string() })?;
    Ok(bytes)
}
