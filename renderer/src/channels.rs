//! Channels: the data of a frame that can be read besides its picture, in one table of name, extent, components, unit
//! and space.
//!
//! A frame keeps the channels that [`crate::settings::Output::channels`] names; [`crate::Renderer::read`] brings them
//! back as numbers. With two samples per pixel a channel holds the last sample; with supersampling it has the size of
//! the supersampled frame.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The elements for which a channel has values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Pixels of the frame, rows from the top.
    Pixels,
    /// Points of the first head.
    Points,
    /// Vertices of the first head.
    Vertices,
}

/// A channel by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
pub enum Channel {
    /// Radiance of the finished light, before lens and tone map; the fourth component is coverage.
    Radiance,
    /// Diffuse light after scattering, of a white surface.
    Diffuse,
    /// Diffuse light before scattering, of a white surface.
    Irradiance,
    /// The part of `irradiance` that came through thin parts, by `shadow-depth`; 0 with methods that do not tell it.
    Transmitted,
    /// Albedo of skin less what its surface reflects at this angle, 0 elsewhere; the fourth component is the strength
    /// of scattering.
    Albedo,
    /// Specular light, and all light of what does not scatter.
    Direct,
    /// Hairs, lashes, brows and the wet film of the eye, which lie over the rest: radiance times coverage, and coverage.
    Hair,
    /// Reversed infinite depth: near plane over distance, 0 for the background.
    Depth,
    /// Head in the upper 5 bits, triangle plus one in the lower 27; 0 for the background.
    Ids,
    /// Motion since the previous frame, x right, y down, without jitter; 0 where the renderer drew no frame before.
    Velocity,
    /// Normal of the surface, without the relief of skin; it faces the camera.
    Normal,
    /// Melanin of skin with maps, share of the volume of the epidermis; 0 elsewhere.
    Melanin,
    /// Hemoglobin of skin with maps as it is in this frame, share of the volume of the dermis; 0 elsewhere.
    Hemoglobin,
    /// Number of the material plus one, in the order of `rubor_rig::head::Material::ALL`; 0 for the background.
    Parts,
    /// Deformed points.
    Positions,
    /// Ambient visibility of each point.
    Visibility,
    /// Normal and tangent of each vertex; the sixth component is the sign of the bitangent.
    TangentFrames,
}

/// A row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelRow {
    /// The channel.
    pub channel: Channel,
    /// The elements that it has values for.
    pub extent: Extent,
    /// Names of the components, in the order of [`ChannelData`].
    pub components: &'static [&'static str],
    /// Unit of a component.
    pub unit: &'static str,
    /// Colour space or frame of reference.
    pub space: &'static str,
}

const RGB_A: &[&str] = &["R", "G", "B", "A"];

/// Every channel.
pub const CHANNELS: &[ChannelRow] = &[
    row(Channel::Radiance, Extent::Pixels, RGB_A, "radiance", "linear Rec. 709"),
    row(Channel::Diffuse, Extent::Pixels, RGB_A, "radiance", "linear Rec. 709"),
    row(Channel::Irradiance, Extent::Pixels, RGB_A, "radiance", "linear Rec. 709"),
    row(Channel::Transmitted, Extent::Pixels, RGB_A, "radiance", "linear Rec. 709"),
    row(Channel::Albedo, Extent::Pixels, RGB_A, "share", "linear Rec. 709"),
    row(Channel::Direct, Extent::Pixels, RGB_A, "radiance", "linear Rec. 709"),
    row(Channel::Hair, Extent::Pixels, RGB_A, "radiance", "linear Rec. 709"),
    row(Channel::Depth, Extent::Pixels, &["Z"], "near plane / distance", "view"),
    row(Channel::Ids, Extent::Pixels, &["id"], "bits", "none"),
    row(Channel::Velocity, Extent::Pixels, &["X", "Y"], "pixels", "picture"),
    row(Channel::Normal, Extent::Pixels, &["X", "Y", "Z"], "unit vectors", "world"),
    row(Channel::Melanin, Extent::Pixels, &["Y"], "share of the volume", "none"),
    row(Channel::Hemoglobin, Extent::Pixels, &["Y"], "share of the volume", "none"),
    row(Channel::Parts, Extent::Pixels, &["id"], "bits", "none"),
    row(Channel::Positions, Extent::Points, &["X", "Y", "Z"], "metres", "world"),
    row(Channel::Visibility, Extent::Points, &["V"], "share of the sky", "none"),
    row(
        Channel::TangentFrames,
        Extent::Vertices,
        &["NX", "NY", "NZ", "TX", "TY", "TZ", "sign"],
        "unit vectors",
        "world",
    ),
];

const fn row(
    channel: Channel,
    extent: Extent,
    components: &'static [&'static str],
    unit: &'static str,
    space: &'static str,
) -> ChannelRow {
    ChannelRow { channel, extent, components, unit, space }
}

impl Channel {
    /// Its row of the table.
    pub fn row(self) -> &'static ChannelRow {
        let mut i = 0;
        while CHANNELS[i].channel != self {
            i += 1;
        }
        &CHANNELS[i]
    }

    /// Whether its values are bits of whole numbers.
    pub fn is_whole(self) -> bool {
        self.row().unit == "bits"
    }

    /// Name in arguments and files.
    pub fn name(self) -> String {
        serde_json::to_value(self).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
    }
}

/// The numbers of a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelData {
    /// The channel.
    pub channel: Channel,
    /// Columns and rows; points and vertices are one row.
    pub size: [u32; 2],
    /// Values with interleaved components, in the order of [`ChannelRow::components`]; ids keep their bits
    /// (`f32::to_bits`).
    pub values: Vec<f32>,
}

impl ChannelData {
    /// Values of `N` components.
    ///
    /// # Panics
    /// `N` differs from the number of components of the channel.
    pub fn texels<const N: usize>(&self) -> impl ExactSizeIterator<Item = [f32; N]> + '_ {
        assert_eq!(N, self.channel.row().components.len(), "components of {}", self.channel.name());
        self.values.chunks_exact(N).map(|c| std::array::from_fn(|i| c[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_has_one_row_and_reads_back_by_name() {
        for row in CHANNELS {
            assert_eq!(row.channel.row(), row);
            let name = row.channel.name();
            assert_eq!(serde_json::from_value::<Channel>(name.into()).expect("it reads"), row.channel);
        }
        let velocity =
            ChannelData { channel: Channel::Velocity, size: [2, 1], values: vec![1.0, 2.0, 3.0, 4.0] };
        assert_eq!(velocity.texels().collect::<Vec<[f32; 2]>>(), [[1.0, 2.0], [3.0, 4.0]]);
    }
}
