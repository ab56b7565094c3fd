//! Image files written in code, so that every byte of a case is known.

use std::io::Cursor;

use exr::meta::attribute::EnvironmentMap;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, SmallVec, Text, Vec2, WritableImage,
};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder};

/// Value of a channel at a column and a row.
type Samples = Box<dyn Fn(usize, usize) -> f32>;

/// A part of an EXR: channels with a value for each texel, counted from the corner of the data.
pub(crate) struct Part<'a> {
    pub(crate) name: Option<&'a str>,
    pub(crate) channels: Vec<(String, Samples)>,
    pub(crate) position: [i32; 2],
    pub(crate) size: [usize; 2],
    pub(crate) is_cube_map: bool,
}

pub(crate) fn exr_parts(parts: &[Part], display: ([i32; 2], [usize; 2])) -> Vec<u8> {
    let display = IntegerBounds::new(Vec2(display.0[0], display.0[1]), Vec2(display.1[0], display.1[1]));
    let layers: SmallVec<[Layer<AnyChannels<FlatSamples>>; 2]> = parts
        .iter()
        .map(|part| {
            let [width, height] = part.size;
            let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = part
                .channels
                .iter()
                .map(|(name, value)| {
                    let samples = (0..width * height).map(|i| value(i % width, i / width)).collect();
                    AnyChannel::new(name.as_str(), FlatSamples::F32(samples))
                })
                .collect();
            let attributes = LayerAttributes {
                layer_name: part.name.map(Text::from),
                layer_position: Vec2(part.position[0], part.position[1]),
                environment_map: part.is_cube_map.then_some(EnvironmentMap::Cube),
                ..LayerAttributes::default()
            };
            Layer::new((width, height), attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels))
        })
        .collect();
    let mut bytes = Cursor::new(Vec::new());
    let image = Image { attributes: ImageAttributes::new(display), layer_data: layers };
    image.write().to_buffered(&mut bytes).expect("an EXR");
    bytes.into_inner()
}

/// One part of this size whose channel number c holds `value(c, x, y)`.
pub(crate) fn exr(
    names: &[&str],
    size: [usize; 2],
    value: impl Fn(usize, usize, usize) -> f32 + Copy + 'static,
) -> Vec<u8> {
    exr_parts(&[part(None, names, size, value)], ([0, 0], size))
}

pub(crate) fn part<'a>(
    name: Option<&'a str>,
    names: &[&str],
    size: [usize; 2],
    value: impl Fn(usize, usize, usize) -> f32 + Copy + 'static,
) -> Part<'a> {
    let channel = |(c, n): (usize, &&str)| -> (String, Samples) {
        ((*n).to_owned(), Box::new(move |x, y| value(c, x, y)))
    };
    Part {
        name,
        channels: names.iter().enumerate().map(channel).collect(),
        position: [0, 0],
        size,
        is_cube_map: false,
    }
}

/// Exif with nothing but an orientation, little-endian.
pub(crate) fn exif(orientation: u8) -> Vec<u8> {
    let mut bytes = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
    bytes.extend([orientation, 0, 0, 0, 0, 0, 0, 0]);
    bytes
}

/// RGB codes that differ in every texel: red is the column, green the row.
pub(crate) fn rgb(width: u32, height: u32) -> Vec<u8> {
    (0..height).flat_map(|y| (0..width).flat_map(move |x| [10 * x as u8, 10 * y as u8, 200])).collect()
}

pub(crate) fn png(codes: &[u8], width: u32, height: u32, color: ExtendedColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(codes, width, height, color).expect("a PNG");
    bytes
}

pub(crate) fn png_chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let mut crc = flate2::Crc::new();
    crc.update(kind);
    crc.update(data);
    let length = (data.len() as u32).to_be_bytes();
    [&length[..], kind, data, &crc.sum().to_be_bytes()].concat()
}

/// A PNG with a chunk more: behind the header, or behind the pixels.
pub(crate) fn png_with_chunk(png: &[u8], chunk: &[u8], behind_pixels: bool) -> Vec<u8> {
    // Signature and IHDR take 33 bytes, IEND takes 12.
    let at = if behind_pixels { png.len() - 12 } else { 33 };
    [&png[..at], chunk, &png[at..]].concat()
}

/// A PNG whose header claims another size, with a right checksum.
pub(crate) fn png_claiming(png: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut header = png[16..29].to_vec();
    header[..4].copy_from_slice(&width.to_be_bytes());
    header[4..8].copy_from_slice(&height.to_be_bytes());
    [&png[..8], &png_chunk(b"IHDR", &header), &png[33..]].concat()
}

pub(crate) fn jpeg(codes: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 100)
        .write_image(codes, width, height, ExtendedColorType::Rgb8)
        .expect("a JPEG");
    bytes
}

pub(crate) fn jpeg_with_exif(jpeg: &[u8], exif: &[u8]) -> Vec<u8> {
    let length = (exif.len() as u16 + 8).to_be_bytes();
    [&jpeg[..2], &[0xff, 0xe1], &length, b"Exif\0\0", exif, &jpeg[2..]].concat()
}

pub(crate) fn webp(codes: &[u8], width: u32, height: u32, exif: Option<Vec<u8>>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = WebPEncoder::new_lossless(&mut bytes);
    if let Some(exif) = exif {
        encoder.set_exif_metadata(exif).expect("WebP carries Exif");
    }
    encoder.write_image(codes, width, height, ExtendedColorType::Rgb8).expect("a WebP");
    bytes
}

/// Description of the samples in a TIFF.
#[derive(Clone, Copy)]
pub(crate) struct Tiff<'a> {
    pub(crate) size: [u32; 2],
    pub(crate) samples: u16,
    pub(crate) bits: u16,
    /// 1 unsigned, 2 signed, 3 floats.
    pub(crate) format: u16,
    /// 0 white is zero, 1 black is zero, 2 RGB.
    pub(crate) photometric: u16,
    /// Meaning of the last samples: 0 unknown, 2 alpha.
    pub(crate) extra: &'a [u16],
    pub(crate) orientation: u16,
    pub(crate) planar: bool,
    /// Pages that follow, each the same.
    pub(crate) more_pages: bool,
}

impl Tiff<'_> {
    pub(crate) const GREY_F32: Self = Self {
        size: [4, 3],
        samples: 1,
        bits: 32,
        format: 3,
        photometric: 1,
        extra: &[],
        orientation: 1,
        planar: false,
        more_pages: false,
    };

    /// Little-endian, one strip (one for each plane).
    pub(crate) fn bytes(&self, data: &[u8]) -> Vec<u8> {
        let data_at = 8u32;
        let mut out = b"II*\0".to_vec();
        let lists_at = data_at + (data.len() as u32).next_multiple_of(2);
        let planes = if self.planar { self.samples as u32 } else { 1 };
        let shorts = |v: &[u16]| v.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        let longs = |v: Vec<u32>| v.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
        let strip = data.len() as u32 / planes;
        let mut entries: Vec<(u16, u16, Vec<u8>)> = vec![
            (256, 4, self.size[0].to_le_bytes().to_vec()),
            (257, 4, self.size[1].to_le_bytes().to_vec()),
            (258, 3, shorts(&vec![self.bits; self.samples as usize])),
            (259, 3, shorts(&[1])),
            (262, 3, shorts(&[self.photometric])),
            (273, 4, longs((0..planes).map(|p| data_at + p * strip).collect())),
            (274, 3, shorts(&[self.orientation])),
            (277, 3, shorts(&[self.samples])),
            (278, 4, self.size[1].to_le_bytes().to_vec()),
            (279, 4, longs(vec![strip; planes as usize])),
            (284, 3, shorts(&[if self.planar { 2 } else { 1 }])),
        ];
        if !self.extra.is_empty() {
            entries.push((338, 3, shorts(self.extra)));
        }
        entries.push((339, 3, shorts(&vec![self.format; self.samples as usize])));
        let (mut lists, mut table) = (Vec::<u8>::new(), Vec::<u8>::new());
        for (tag, kind, value) in &entries {
            let count = value.len() as u32 / if *kind == 3 { 2 } else { 4 };
            table.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
            table.extend(count.to_le_bytes());
            if value.len() <= 4 {
                table.extend(value);
                table.resize(table.len() + 4 - value.len(), 0);
            } else {
                table.extend((lists_at + lists.len() as u32).to_le_bytes());
                lists.extend(value);
            }
        }
        let directory_at = lists_at + lists.len() as u32;
        let next = directory_at + 2 + table.len() as u32 + 4;
        out.extend(directory_at.to_le_bytes());
        out.extend(data);
        out.resize(lists_at as usize, 0);
        out.extend(lists);
        let directory =
            |next: u32| [&(entries.len() as u16).to_le_bytes()[..], &table, &next.to_le_bytes()].concat();
        out.extend(directory(if self.more_pages { next } else { 0 }));
        if self.more_pages {
            out.extend(directory(0));
        }
        out
    }
}

/// A Radiance picture without runs; every pixel is red, green, blue, exponent.
pub(crate) fn radiance(head: &str, width: u32, height: u32, pixel: [u8; 4]) -> Vec<u8> {
    let mut bytes = format!("{head}\n-Y {height} +X {width}\n").into_bytes();
    bytes.extend((0..width * height).flat_map(|_| pixel));
    bytes
}
