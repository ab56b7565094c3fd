//! The vendor extension `RUBOR_facial_appearance`, version 1: the data of a head beyond glTF 2.0.
//!
//! It is in the root `extensions` of the document; its JSON schema is `docs/RUBOR_facial_appearance.schema.json`.
//! Texel to value: `value = offset + scale * texel`, texel from 0 to 1, one offset and scale a channel.

use std::collections::BTreeMap;

use rubor_rig::head::{Material, Provenance};
use serde::{Deserialize, Serialize};

/// Name in `extensionsUsed`.
pub const NAME: &str = "RUBOR_facial_appearance";

/// Version written and read here.
pub const VERSION: u32 = 1;

/// In the copy of the extension in the extras of the mesh: names of images by their index in the extension.
pub(crate) const IMAGE_NAMES: &str = "imageNames";
/// Names of accessors by their index in the extension.
pub(crate) const ACCESSOR_NAMES: &str = "accessorNames";
/// Fields that are indices of accessors of the head's geometry.
pub(crate) const ACCESSOR_FIELDS: [&str; 2] = ["points", "changes"];

/// Root object of the extension.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct FacialAppearance {
    /// [`VERSION`].
    pub version: u32,
    /// Name of the head.
    pub name: String,
    /// glTF mesh that is the head.
    pub mesh: u32,
    /// Number of points: places of the surface with one normal.
    pub point_count: u32,
    /// One a primitive of the mesh, in order.
    pub parts: Vec<PartEntry>,
    /// NORMAL holds the normals of the author, which lean from those of the geometry; else they are computed from it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub authored_normals: bool,
    /// Accessor: ambient visibility of each point, SCALAR, unsigned short normalized.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occlusion: Option<u32>,
    /// How blend shapes change it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shape_occlusion: Vec<ShapeOcclusionEntry>,
    /// Anatomical points, metres.
    #[serde(default)]
    pub landmarks: BTreeMap<String, [f32; 3]>,
    /// Maps of the skin.
    #[serde(default)]
    pub maps: MapEntries,
    /// The colour of skin of any melanin and hemoglobin, for programs that have no model of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skin_look_up: Option<SkinLookUpEntry>,
    /// What the sequence does to the skin, frame by frame, for programs that evaluate no rig.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skin_animation: Option<SkinAnimationEntry>,
    /// Where geometry and maps come from.
    #[serde(default)]
    pub provenance: Vec<Provenance>,
    /// The rig file, as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig: Option<serde_json::Value>,
    /// The sequence file that the animation was made from, as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<serde_json::Value>,
}

/// A picture of skin, sRGB without alpha: melanin along a row, hemoglobin down. The texel at the place
/// `(cbrt(melanin / mostMelanin), cbrt(hemoglobin / mostHemoglobin))`, from the middle of the first texel to that of the last,
/// is the diffuse reflectance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SkinLookUpEntry {
    /// glTF image.
    pub image: u32,
    /// Volume fraction at the right edge.
    pub most_melanin: f32,
    /// Volume fraction at the lower edge.
    pub most_hemoglobin: f32,
}

/// Weights at times; all accessors are SCALAR floats, lists frame after frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SkinAnimationEntry {
    /// Accessor: seconds, rising.
    pub times: u32,
    /// Names of the rig's expressions.
    pub expressions: Vec<String>,
    /// Accessor: their weights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expression_weights: Option<u32>,
    /// Names of the rig's states.
    pub states: Vec<String>,
    /// Accessor: their weights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub state_weights: Option<u32>,
    /// Accessor: weights of `maps.zones`, 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zone_weights: Option<u32>,
    /// Accessor: weights of `maps.distributions`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distribution_weights: Option<u32>,
    /// Accessor: factor of all hemoglobin.
    pub hemoglobin_scales: u32,
    /// Accessor: diameter of the pupils, millimetres.
    pub pupils_mm: u32,
}

/// A part of the mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PartEntry {
    /// Name in the source file.
    pub name: String,
    /// How it is shaded.
    pub material: Material,
    /// It is drawn in the glTF material of its primitive; of skin that material says where it has holes.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub authored: bool,
    /// Accessor: point of each vertex of the primitive, SCALAR, unsigned short or int.
    pub points: u32,
}

/// How a blend shape changes ambient visibility.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ShapeOcclusionEntry {
    /// One of the mesh's `targetNames`.
    pub shape: String,
    /// Accessor: points whose visibility changes, SCALAR, unsigned short or int, strictly increasing.
    pub points: u32,
    /// Accessor: change at weights 0.5 and 1 of each of them, VEC2, byte normalized.
    pub changes: u32,
}

/// All maps; those that the head does not have are absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct MapEntries {
    /// Colour that the neutral skin has by itself, linear Rec. 709, 3 channels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub albedo: Option<MapEntry>,
    /// Volume fraction of melanin in the epidermis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub melanin: Option<MapEntry>,
    /// Volume fraction of hemoglobin in the dermis, neutral state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hemoglobin: Option<MapEntry>,
    /// Local mean of the neutral hemoglobin, which `distributions` are relative to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hemoglobin_mean: Option<MapEntry>,
    /// Local statistics of other states.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub distributions: Vec<DistributionEntry>,
    /// Surface slopes, 2 channels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slopes: Option<MapEntry>,
    /// Slopes of wrinkles, 2 channels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wrinkle_slopes: Vec<MapEntry>,
    /// Masks of areas whose wrinkles appear together; up to four share an image.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub zones: Vec<ZoneEntry>,
    /// Specular intensity and Beckmann roughness, 2 channels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specular: Option<MapEntry>,
    /// Strength of subsurface scattering.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scattering: Option<MapEntry>,
    /// Share of the skin under short hair.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hair: Option<MapEntry>,
    /// Albedo of that hair, linear Rec. 709.
    #[serde(skip_serializing_if = "is_black")]
    pub hair_color_linear: [f32; 3],
    /// Most single hairs of the scalp that are drawn, standing for all that would grow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hair_count: Option<u32>,
}

fn is_black(color: &[f32; 3]) -> bool {
    *color == [0.0; 3]
}

/// A map in an image of the document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct MapEntry {
    /// glTF image.
    pub image: u32,
    /// Where the channels are.
    pub layout: ChannelLayout,
    /// Value of texel 0, per channel.
    pub offset: Vec<f32>,
    /// Value of texel 1 minus that of texel 0, per channel.
    pub scale: Vec<f32>,
}

/// Where the channels of a map are in its image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChannelLayout {
    /// One channel: all of a grey image, or the first channel of a colour image.
    First,
    /// Two channels as the upper and lower half of a grey image (colour transforms of JPEG would mix them).
    Stacked,
    /// The first two channels of a colour image.
    Interleaved,
    /// Three channels: a colour image in sRGB, decoded before offset and scale.
    Color,
    /// One of the four channels of an RGBA image, named by [`ZoneEntry::channel`].
    Channel,
}

/// A hemoglobin distribution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DistributionEntry {
    /// Such as `joy`.
    pub name: String,
    /// `sigma_i / sigma_n`.
    pub scale: MapEntry,
    /// `mu_i`, volume fraction.
    pub bias: MapEntry,
}

/// A wrinkle zone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ZoneEntry {
    /// Such as `forehead-left`.
    pub name: String,
    /// Index into `wrinkleSlopes`.
    pub wrinkle_map: u32,
    /// 0 red to 3 alpha.
    pub channel: u32,
    /// Image, offset and scale.
    pub mask: MapEntry,
}
