//! Maps of the skin as images of the document.

use rubor_rig::head::{SkinMaps, WrinkleZone};
use rubor_rig::map::Map;

use super::buffer::Buffer;
use crate::error::ExportError;
use crate::export::image_codec::{MapEncoding, encode_colors, encode_map, encode_png};
use crate::facial_appearance::{ChannelLayout, DistributionEntry, MapEntries, MapEntry, ZoneEntry};

/// Steepest slope that 8 bits hold: half a step is 0.2 degrees.
const MOST_IN_8_BITS: f32 = 1.0;

/// How each kind of map is stored. Zone masks are always 8-bit PNG, four to an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapEncodings {
    /// Colour of the skin by itself.
    pub albedo: MapEncoding,
    /// Melanin.
    pub melanin: MapEncoding,
    /// Neutral hemoglobin.
    pub hemoglobin: MapEncoding,
    /// Scale and bias of the distributions: smooth, so banding would show; 16 bits by default.
    pub distributions: MapEncoding,
    /// Surface slopes; 16-bit PNG in any case where they are steep.
    pub slopes: MapEncoding,
    /// Wrinkle slopes.
    pub wrinkle_slopes: MapEncoding,
    /// Specular intensity and roughness.
    pub specular: MapEncoding,
    /// Scattering strength and hair.
    pub scattering: MapEncoding,
}

impl Default for MapEncodings {
    /// Exact to 8 bits, distributions to 16.
    fn default() -> Self {
        let png = MapEncoding::Png8;
        Self {
            albedo: png,
            melanin: png,
            hemoglobin: png,
            distributions: MapEncoding::Png16,
            slopes: png,
            wrinkle_slopes: png,
            specular: png,
            scattering: png,
        }
    }
}

impl MapEncodings {
    /// Small files: JPEG where the eye cannot tell.
    pub fn small() -> Self {
        Self {
            albedo: MapEncoding::Jpeg(93),
            melanin: MapEncoding::Jpeg(92),
            hemoglobin: MapEncoding::Jpeg(85),
            // Smooth enough that 8 bits over their own range do not band.
            distributions: MapEncoding::Png8,
            slopes: MapEncoding::Jpeg(70),
            wrinkle_slopes: MapEncoding::Jpeg(92),
            specular: MapEncoding::Jpeg(82),
            scattering: MapEncoding::Jpeg(72),
        }
    }
}

/// The colour of the skin as an image of the document.
pub(super) fn write_albedo(
    albedo: &Map,
    encodings: &MapEncodings,
    buffer: &mut Buffer,
) -> Result<MapEntry, ExportError> {
    let encoded = encode_colors("albedo", albedo, encodings.albedo)?;
    let image = buffer.image("albedo", &encoded.bytes, encoded.mime_type) as u32;
    Ok(MapEntry { image, layout: encoded.layout, offset: encoded.offset, scale: encoded.scale })
}

/// Adds the images and returns the entries of the extension. `albedo` is an image that is there already.
pub(super) fn write(
    maps: &SkinMaps,
    encodings: &MapEncodings,
    albedo: Option<MapEntry>,
    buffer: &mut Buffer,
) -> Result<MapEntries, ExportError> {
    let albedo = match (&maps.albedo, albedo) {
        (Some(map), None) => Some(write_albedo(map, encodings, buffer)?),
        (_, written) => written,
    };
    let mut put = |name: &str, map: &Map, encoding| -> Result<MapEntry, ExportError> {
        let encoded = encode_map(name, map, encoding)?;
        let image = buffer.image(name, &encoded.bytes, encoded.mime_type) as u32;
        Ok(MapEntry { image, layout: encoded.layout, offset: encoded.offset, scale: encoded.scale })
    };
    let mut optional = |name: &str, map: &Option<Map>, encoding| {
        map.as_ref().map(|map| put(name, map, encoding)).transpose()
    };
    let melanin = optional("melanin", &maps.melanin, encodings.melanin)?;
    let hemoglobin = optional("hemoglobin", &maps.hemoglobin, encodings.hemoglobin)?;
    let hemoglobin_mean = optional("hemoglobin mean", &maps.hemoglobin_mean, encodings.distributions)?;
    let slopes =
        optional("slopes", &maps.slopes, encoding_of_slopes(maps.slopes.as_ref(), encodings.slopes))?;
    let specular = optional("specular", &maps.specular, encodings.specular)?;
    let scattering = optional("scattering", &maps.scattering, encodings.scattering)?;
    let hair = optional("hair", &maps.hair, encodings.scattering)?;
    let mut distributions = Vec::new();
    for d in &maps.distributions {
        let scale = put(&format!("{} scale", d.name), &d.scale, encodings.distributions)?;
        let bias = put(&format!("{} bias", d.name), &d.bias, encodings.distributions)?;
        distributions.push(DistributionEntry { name: d.name.clone(), scale, bias });
    }
    let mut wrinkle_slopes = Vec::new();
    for (i, map) in maps.wrinkle_slopes.iter().enumerate() {
        wrinkle_slopes.push(put(&format!("wrinkle slopes {i}"), map, encodings.wrinkle_slopes)?);
    }
    let zones = zones(&maps.zones, buffer)?;
    Ok(MapEntries {
        albedo,
        melanin,
        hemoglobin,
        hemoglobin_mean,
        distributions,
        slopes,
        wrinkle_slopes,
        zones,
        specular,
        scattering,
        hair,
        hair_color_linear: maps.hair_color_linear,
        hair_count: maps.hair_count,
    })
}

/// 16 bits where the slopes of a map lie so far apart that a step of 8 bits would tilt level skin: by half a step, as 0 is no code.
fn encoding_of_slopes(map: Option<&Map>, encoding: MapEncoding) -> MapEncoding {
    let steepest = map.iter().flat_map(|m| &m.values).fold(0.0f32, |most, s| most.max(s.abs()));
    if steepest > MOST_IN_8_BITS { MapEncoding::Png16 } else { encoding }
}

/// Four masks of one size share an RGBA image; values are clamped to 0 to 1.
fn zones(zones: &[WrinkleZone], buffer: &mut Buffer) -> Result<Vec<ZoneEntry>, ExportError> {
    let mut entries = Vec::new();
    let mut rest = zones;
    while let Some(first) = rest.first() {
        let size = (first.mask.width, first.mask.height);
        let count = rest.iter().take(4).take_while(|z| (z.mask.width, z.mask.height) == size).count();
        let (together, after) = rest.split_at(count);
        rest = after;
        // A missing alpha is opaque, so that tools that show the image show something.
        let mut texels = [0, 0, 0, 255].repeat(first.mask.values.len());
        for (channel, zone) in together.iter().enumerate() {
            for (texel, value) in texels.iter_mut().skip(channel).step_by(4).zip(&zone.mask.values) {
                *texel = (value.clamp(0.0, 1.0) * 255.0).round() as u8;
            }
        }
        let name = together.iter().map(|z| z.name.as_str()).collect::<Vec<_>>().join(", ");
        let bytes = encode_png(&name, &texels, size.0, size.1, image::ExtendedColorType::Rgba8)?;
        let image = buffer.image(&name, &bytes, "image/png") as u32;
        entries.extend(together.iter().enumerate().map(|(channel, zone)| ZoneEntry {
            name: zone.name.clone(),
            wrinkle_map: zone.wrinkle_map,
            channel: channel as u32,
            mask: MapEntry { image, layout: ChannelLayout::Channel, offset: vec![0.0], scale: vec![1.0] },
        }));
    }
    Ok(entries)
}
