//! Maps of the skin as images of the document.

use rayon::prelude::*;
use rubor_rig::head::{SkinMaps, WrinkleZone};
use rubor_rig::map::Map;

use super::buffer::Buffer;
use crate::error::ExportError;
use crate::export::image_codec::{EncodedMap, MapEncoding, encode_colors, encode_map, encode_png};
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

/// The maps of a head as images, encoded side by side.
pub(super) struct EncodedMaps {
    maps: std::vec::IntoIter<EncodedMap>,
    zones: std::vec::IntoIter<Vec<u8>>,
}

/// Maps of one and two channels with their names and encodings, in the order of their images.
fn listed<'a>(maps: &'a SkinMaps, encodings: &MapEncodings) -> Vec<(String, &'a Map, MapEncoding)> {
    let of_slopes = encoding_of_slopes(maps.slopes.as_ref(), encodings.slopes);
    let single = [
        ("melanin", &maps.melanin, encodings.melanin),
        ("hemoglobin", &maps.hemoglobin, encodings.hemoglobin),
        ("hemoglobin mean", &maps.hemoglobin_mean, encodings.distributions),
        ("slopes", &maps.slopes, of_slopes),
        ("specular", &maps.specular, encodings.specular),
        ("scattering", &maps.scattering, encodings.scattering),
        ("hair", &maps.hair, encodings.scattering),
    ];
    let single = single
        .into_iter()
        .filter_map(|(name, map, encoding)| map.as_ref().map(|map| (name.to_owned(), map, encoding)));
    let distributions = maps.distributions.iter().flat_map(|d| {
        [("scale", &d.scale), ("bias", &d.bias)]
            .map(|(what, map)| (format!("{} {what}", d.name), map, encodings.distributions))
    });
    let wrinkles = maps.wrinkle_slopes.iter().enumerate();
    let wrinkles = wrinkles.map(|(i, map)| (format!("wrinkle slopes {i}"), map, encodings.wrinkle_slopes));
    single.chain(distributions).chain(wrinkles).collect()
}

/// Encodes all maps but the colour of the skin.
pub(super) fn encode(maps: &SkinMaps, encodings: &MapEncodings) -> Result<EncodedMaps, ExportError> {
    let (maps, zones) = rayon::join(
        || {
            let all = listed(maps, encodings);
            all.par_iter()
                .map(|(name, map, encoding)| encode_map(name, map, *encoding))
                .collect::<Result<Vec<_>, _>>()
        },
        || {
            zone_images(&maps.zones)
                .par_iter()
                .map(|zones| encode_zones(zones))
                .collect::<Result<Vec<_>, _>>()
        },
    );
    Ok(EncodedMaps { maps: maps?.into_iter(), zones: zones?.into_iter() })
}

/// Adds the images and returns the entries of the extension. `albedo` is an image that is there already.
pub(super) fn write(
    maps: &SkinMaps,
    encodings: &MapEncodings,
    albedo: Option<MapEntry>,
    encoded: EncodedMaps,
    buffer: &mut Buffer,
) -> Result<MapEntries, ExportError> {
    let albedo = match (&maps.albedo, albedo) {
        (Some(map), None) => Some(write_albedo(map, encodings, buffer)?),
        (_, written) => written,
    };
    let mut entries = listed(maps, encodings).into_iter().zip(encoded.maps).map(|((name, ..), encoded)| {
        let image = buffer.image(&name, &encoded.bytes, encoded.mime_type) as u32;
        MapEntry { image, layout: encoded.layout, offset: encoded.offset, scale: encoded.scale }
    });
    // Maps that are there have an entry each, in this order.
    let mut next = |is_there: bool| if is_there { entries.next() } else { None };
    let melanin = next(maps.melanin.is_some());
    let hemoglobin = next(maps.hemoglobin.is_some());
    let hemoglobin_mean = next(maps.hemoglobin_mean.is_some());
    let slopes = next(maps.slopes.is_some());
    let specular = next(maps.specular.is_some());
    let scattering = next(maps.scattering.is_some());
    let hair = next(maps.hair.is_some());
    let distributions = (maps.distributions.iter())
        .filter_map(|d| {
            Some(DistributionEntry { name: d.name.clone(), scale: next(true)?, bias: next(true)? })
        })
        .collect();
    let wrinkle_slopes = maps.wrinkle_slopes.iter().filter_map(|_| next(true)).collect();
    let zones = write_zones(&maps.zones, encoded.zones, buffer);
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

/// Four masks of one size share an image.
fn zone_images(zones: &[WrinkleZone]) -> Vec<&[WrinkleZone]> {
    let size = |zone: &WrinkleZone| (zone.mask.width, zone.mask.height);
    zones.chunk_by(|a, b| size(a) == size(b)).flat_map(|same| same.chunks(4)).collect()
}

/// Masks as the channels of an RGBA image; values are clamped to 0 to 1.
fn encode_zones(zones: &[WrinkleZone]) -> Result<Vec<u8>, ExportError> {
    let Some(first) = zones.first() else { return Ok(Vec::new()) };
    // A missing alpha is opaque, so that tools that show the image show something.
    let mut texels = [0, 0, 0, 255].repeat(first.mask.values.len());
    for (channel, zone) in zones.iter().enumerate() {
        for (texel, value) in texels.iter_mut().skip(channel).step_by(4).zip(&zone.mask.values) {
            *texel = (value.clamp(0.0, 1.0) * 255.0).round() as u8;
        }
    }
    let size = (first.mask.width, first.mask.height);
    encode_png(&name_of(zones), &texels, size.0, size.1, image::ExtendedColorType::Rgba8)
}

fn name_of(zones: &[WrinkleZone]) -> String {
    zones.iter().map(|z| z.name.as_str()).collect::<Vec<_>>().join(", ")
}

fn write_zones(
    zones: &[WrinkleZone],
    encoded: impl Iterator<Item = Vec<u8>>,
    buffer: &mut Buffer,
) -> Vec<ZoneEntry> {
    let mut entries = Vec::new();
    for (together, bytes) in zone_images(zones).into_iter().zip(encoded) {
        let image = buffer.image(&name_of(together), &bytes, "image/png") as u32;
        entries.extend(together.iter().enumerate().map(|(channel, zone)| ZoneEntry {
            name: zone.name.clone(),
            wrinkle_map: zone.wrinkle_map,
            channel: channel as u32,
            mask: MapEntry { image, layout: ChannelLayout::Channel, offset: vec![0.0], scale: vec![1.0] },
        }));
    }
    entries
}
