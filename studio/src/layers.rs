//! A frame as one OpenEXR file of many layers, for compositing.
//!
//! ```text
//! channels of a frame --reduced to the size of the picture--> frame.0001.exr
//! ```
//!
//! One part whose channels are named `layer.component`, which Nuke, RV, OpenImageIO and Blender show as layers; beauty has no
//! layer name. Light is linear Rec. 709 before exposure and tone map, in halves; depth, motion and chromophores are floats,
//! ids whole numbers. Rows are compressed by 16 (ZIP), without loss.
//!
//! Beauty is `(diffuse * albedo + specular) * (1 - hair.A) + hair`, with what is seen through on top; `irradiance` is `diffuse`
//! before it scatters, and `transmittance` the part of that which came through thin parts.
//!
//! Where a pixel has several samples, light and masks are means over the pixel, and data that have no mean (depth, normals,
//! motion, ids, chromophores) are those of the sample next to its middle. With `smaa-s2x` and `smaa-4x` all are those of the
//! second sample, except motion.

use std::path::Path;

use exr::meta::attribute::{AttributeValue, Chromaticities};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, LineOrder, Text, Vec2, WritableImage, f16,
};
use rubor_renderer::channels::{Channel, ChannelData};
use rubor_rig::head::Material;

use crate::error::{Failure, Outcome};
use crate::output;

/// Channels that the file is made of.
pub const CHANNELS: [Channel; 14] = [
    Channel::Radiance,
    Channel::Diffuse,
    Channel::Irradiance,
    Channel::Transmitted,
    Channel::Albedo,
    Channel::Direct,
    Channel::Hair,
    Channel::Depth,
    Channel::Ids,
    Channel::Velocity,
    Channel::Normal,
    Channel::Melanin,
    Channel::Hemoglobin,
    Channel::Parts,
];

/// Primaries and white of Rec. 709 (ITU-R BT.709-6, 3.3 and 3.4).
const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.3, 0.6),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.329),
};
/// Largest finite half.
const LARGEST_HALF: f32 = 65504.0;
/// Bits of a triangle in an id; above them stands the head.
const TRIANGLE_BITS: u32 = 27;

/// What is said about a frame beside its pixels.
#[derive(Clone, Copy, Debug)]
pub struct About {
    /// Width and height of the picture.
    pub size: [u32; 2],
    /// Number of the frame, from 1.
    pub number: u32,
    /// Frames per second.
    pub fps: f64,
    /// Near plane of the camera, metres: depth is this over the distance.
    pub near_metres: f32,
}

/// Writes the layers of a frame: see [`encode`].
///
/// # Errors
/// The system reports an error.
pub fn write(path: &Path, channels: &[ChannelData], about: &About) -> Outcome {
    output::write(path, &encode(channels, about)?)
}

/// The layers of a frame as the bytes of a file. Channels that the frame does not have are left out.
///
/// # Errors
/// The encoder fails.
pub fn encode(channels: &[ChannelData], about: &About) -> Outcome<Vec<u8>> {
    let [width, height] = about.size.map(|n| n as usize);
    let mut all = Vec::new();
    for data in channels.iter().filter(|data| CHANNELS.contains(&data.channel)) {
        layers(data, about, &mut all);
    }
    let text = |text: &str| Text::new_or_panic(text);
    let counter = (text("imageCounter"), AttributeValue::I32(about.number as i32));
    let attributes = LayerAttributes {
        software_name: Some(text(concat!("rubor ", env!("CARGO_PKG_VERSION")))),
        frames_per_second: rational(about.fps),
        other: [counter].into_iter().collect(),
        ..LayerAttributes::default()
    };
    let layer = Layer::new(
        (width, height),
        attributes,
        // Blocks in a fixed order: equal values give equal bytes, however many threads compress them.
        Encoding { line_order: LineOrder::Increasing, ..Encoding::SMALL_LOSSLESS },
        AnyChannels::sort(all.into_iter().collect()),
    );
    let mut frame = ImageAttributes::new(IntegerBounds::from_dimensions((width, height)));
    frame.chromaticities = Some(REC_709);
    let mut image = Image::from_layer(layer);
    image.attributes = frame;
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).map_err(Failure::job)?;
    Ok(bytes.into_inner())
}

/// Frames per second as a ratio: whole, NTSC (n * 1000 / 1001), or to a thousandth.
fn rational(fps: f64) -> Option<(i32, u32)> {
    let is_near = |a: f64, b: f64| (a - b).abs() < 1e-3;
    let ntsc = (fps * 1.001).round();
    let ratio = if is_near(fps, fps.round()) {
        (fps.round(), 1)
    } else if is_near(ntsc / 1.001, fps) {
        (ntsc * 1000.0, 1001)
    } else {
        ((fps * 1000.0).round(), 1000)
    };
    (ratio.0 >= 1.0 && ratio.0 <= f64::from(i32::MAX)).then_some((ratio.0 as i32, ratio.1))
}

/// Adds the layers that a channel becomes.
fn layers(data: &ChannelData, about: &About, all: &mut Vec<AnyChannel<FlatSamples>>) {
    let mut color = |layer: &str, components: &str| {
        for (c, component) in components.chars().enumerate() {
            all.push(halves(&format!("{layer}{component}"), &means(data, about.size, |texel| texel[c])));
        }
    };
    match data.channel {
        Channel::Radiance => color("", "RGBA"),
        Channel::Diffuse => color("diffuse.", "RGB"),
        Channel::Irradiance => color("irradiance.", "RGB"),
        Channel::Transmitted => color("transmittance.", "RGB"),
        Channel::Albedo => color("albedo.", "RGB"),
        Channel::Direct => color("specular.", "RGB"),
        Channel::Hair => color("hair.", "RGBA"),
        Channel::Normal => {
            for (c, component) in ["N.X", "N.Y", "N.Z"].into_iter().enumerate() {
                all.push(halves(component, &middles(data, about.size, |texel| texel[c])));
            }
        }
        Channel::Depth => {
            // Nothing is infinitely far; 0 would be the lens.
            let metres =
                |texel: &[f32]| if texel[0] > 0.0 { about.near_metres / texel[0] } else { f32::INFINITY };
            all.push(AnyChannel::new("Z", FlatSamples::F32(middles(data, about.size, metres))));
        }
        Channel::Velocity => {
            let factor = data.size[0] as f32 / about.size[0].max(1) as f32;
            for (c, component) in ["velocity.X", "velocity.Y"].into_iter().enumerate() {
                let values = middles(data, about.size, |texel| texel[c] / factor);
                all.push(AnyChannel::new(component, FlatSamples::F32(values)));
            }
        }
        Channel::Melanin | Channel::Hemoglobin => {
            let name = format!("chromophores.{}", data.channel.name());
            let values = middles(data, about.size, |texel| texel[0]);
            all.push(AnyChannel::new(name.as_str(), FlatSamples::F32(values)));
        }
        Channel::Ids => {
            let ids = middles(data, about.size, |texel| texel[0].to_bits());
            let seen = |id: &u32, part: u32| if *id == 0 { 0 } else { part };
            let heads = ids.iter().map(|id| seen(id, (id >> TRIANGLE_BITS) + 1)).collect();
            let triangles = ids.iter().map(|id| seen(id, id & ((1 << TRIANGLE_BITS) - 1))).collect();
            all.push(AnyChannel::new("id.head", FlatSamples::U32(heads)));
            all.push(AnyChannel::new("id.triangle", FlatSamples::U32(triangles)));
        }
        Channel::Parts => {
            let parts = middles(data, about.size, |texel| texel[0].to_bits());
            for material in Material::ALL.into_iter().filter(|material| material.is_opaque()) {
                let number = material.number() + 1;
                let covered = |texel: &[f32]| f32::from(u8::from(texel[0].to_bits() == number));
                let material = format!("{material:?}").to_lowercase();
                let name = format!("mask.{material}");
                all.push(halves(&name, &means(data, about.size, covered)));
            }
            all.push(AnyChannel::new("id.part", FlatSamples::U32(parts)));
        }
        Channel::Positions | Channel::Visibility | Channel::TangentFrames => {}
    }
}

/// A channel of halves; what they cannot hold becomes the largest one.
fn halves(name: &str, values: &[f32]) -> AnyChannel<FlatSamples> {
    let halves = values.iter().map(|v| f16::from_f32(v.clamp(-LARGEST_HALF, LARGEST_HALF))).collect();
    AnyChannel::new(name, FlatSamples::F16(halves))
}

/// For each pixel the mean over its samples.
fn means(data: &ChannelData, size: [u32; 2], value: impl Fn(&[f32]) -> f32) -> Vec<f32> {
    let n = data.size[0] / size[0].max(1);
    let share = 1.0 / (n * n).max(1) as f32;
    pixels(size, |x, y| {
        let samples = (0..n * n).map(|k| value(texel(data, x * n + k % n, y * n + k / n)));
        share * samples.sum::<f32>()
    })
}

/// For each pixel the sample next to its middle, right and below where two are as near.
fn middles<T>(data: &ChannelData, size: [u32; 2], value: impl Fn(&[f32]) -> T) -> Vec<T> {
    let n = data.size[0] / size[0].max(1);
    pixels(size, |x, y| value(texel(data, x * n + n / 2, y * n + n / 2)))
}

fn pixels<T>(size: [u32; 2], value: impl Fn(u32, u32) -> T) -> Vec<T> {
    (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect()
}

fn texel(data: &ChannelData, x: u32, y: u32) -> &[f32] {
    let n = data.channel.row().components.len();
    let at = (y as usize * data.size[0] as usize + x as usize) * n;
    &data.values[at..at + n]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(channel: Channel, size: [u32; 2], value: impl Fn(usize, usize) -> f32) -> ChannelData {
        let n = channel.row().components.len();
        let count = (size[0] * size[1]) as usize;
        let values = (0..count * n).map(|i| value(i / n, i % n)).collect();
        ChannelData { channel, size, values }
    }

    #[test]
    fn layers_have_the_names_kinds_and_values_that_readers_expect() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.exr");
        // Two by two samples of a picture of 2 x 1; the second pixel sees nothing.
        let size = [4, 2];
        let is_left = |i: usize| i % 4 < 2;
        let all = [
            data(Channel::Radiance, size, |i, c| if is_left(i) { (i + c) as f32 * 1e5 } else { 0.0 }),
            data(Channel::Albedo, size, |i, c| if is_left(i) { 0.25 * c as f32 } else { 0.0 }),
            data(Channel::Depth, size, |i, _| if is_left(i) { 0.02 } else { 0.0 }),
            data(Channel::Velocity, size, |_, c| 3.0 - c as f32),
            data(Channel::Hemoglobin, size, |_, _| 0.03),
            data(Channel::Ids, size, |i, _| f32::from_bits(if is_left(i) { (2 << 27) | 77 } else { 0 })),
            data(Channel::Parts, size, |i, _| f32::from_bits(if i == 0 { 1 } else { 0 })),
            data(Channel::Positions, [8, 1], |_, _| 1.0),
        ];
        let about = About { size: [2, 1], number: 12, fps: 23.976, near_metres: 0.01 };
        write(&path, &all, &about).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        write(&path, &all, &about).unwrap();
        assert!(bytes == std::fs::read(&path).unwrap(), "equal values give equal bytes");

        let read = exr::prelude::read_all_flat_layers_from_file(&path).unwrap();
        assert_eq!(read.layer_data.len(), 1);
        let layer = &read.layer_data[0];
        assert_eq!(read.attributes.chromaticities, Some(REC_709));
        assert_eq!(read.attributes.display_window, IntegerBounds::from_dimensions((2, 1)));
        assert_eq!(layer.attributes.frames_per_second, Some((24000, 1001)));
        let of = |name: &str| {
            let channel = layer.channel_data.list.iter().find(|c| c.name.to_string() == name);
            channel.unwrap_or_else(|| panic!("no {name}")).sample_data.clone()
        };
        let halves = |values: &[f32]| FlatSamples::F16(values.iter().map(|v| f16::from_f32(*v)).collect());
        // The mean of samples 0, 1, 4 and 5 is over the largest half.
        assert_eq!(of("R"), halves(&[LARGEST_HALF, 0.0]));
        assert_eq!(of("albedo.G"), halves(&[0.25, 0.0]));
        assert_eq!(of("Z"), FlatSamples::F32(vec![0.5, f32::INFINITY]));
        // Pixels of the picture are two of the samples.
        assert_eq!(of("velocity.X"), FlatSamples::F32(vec![1.5; 2]));
        assert_eq!(of("velocity.Y"), FlatSamples::F32(vec![1.0; 2]));
        assert_eq!(of("chromophores.hemoglobin"), FlatSamples::F32(vec![0.03; 2]));
        assert_eq!(of("id.head"), FlatSamples::U32(vec![3, 0]));
        assert_eq!(of("id.triangle"), FlatSamples::U32(vec![77, 0]));
        assert_eq!(of("id.part"), FlatSamples::U32(vec![0, 0]));
        assert_eq!(of("mask.skin"), halves(&[0.25, 0.0]));
        let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
        assert!(!names.iter().any(|name| name.contains("lash") || name.starts_with("albedo.A")), "{names:?}");
        assert!(names.iter().is_sorted());
    }

    #[test]
    fn rates_are_ratios() {
        assert_eq!(rational(24.0), Some((24, 1)));
        assert_eq!(rational(29.97), Some((30000, 1001)));
        assert_eq!(rational(12.5), Some((12500, 1000)));
        assert_eq!(rational(1e-9), None);
    }
}
