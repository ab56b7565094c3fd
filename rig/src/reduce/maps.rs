//! Maps with less: smaller ones, fewer zones and distributions.

use std::collections::BTreeSet;

use super::{Reduction, kept};
use crate::authored::{Authored, AuthoredImage};
use crate::color::{srgb_decode, srgb_encode};
use crate::head::{Distribution, SkinMaps, WrinkleZone};
use crate::map::Map;
use crate::mask::{Mask, resize_area};

/// Maps that have one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MapKind {
    /// Colour of the skin by itself.
    Albedo,
    /// Melanin.
    Melanin,
    /// Neutral hemoglobin.
    Hemoglobin,
    /// Scale and bias of all distributions, and the mean of the neutral hemoglobin.
    Distributions,
    /// Slopes of pores and fine lines.
    Slopes,
    /// All wrinkle maps.
    WrinkleSlopes,
    /// Masks of all wrinkle zones.
    ZoneMasks,
    /// Specular intensity and roughness.
    Specular,
    /// Strength of scattering.
    Scattering,
    /// Share of skin under short hair.
    Hair,
    /// All pictures of authored materials.
    Pictures,
}

impl MapKind {
    /// Every kind.
    pub const ALL: [MapKind; 11] = [
        MapKind::Albedo,
        MapKind::Melanin,
        MapKind::Hemoglobin,
        MapKind::Distributions,
        MapKind::Slopes,
        MapKind::WrinkleSlopes,
        MapKind::ZoneMasks,
        MapKind::Specular,
        MapKind::Scattering,
        MapKind::Hair,
        MapKind::Pictures,
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::Melanin => "melanin",
            Self::Hemoglobin => "hemoglobin",
            Self::Distributions => "distributions",
            Self::Slopes => "slopes",
            Self::WrinkleSlopes => "wrinkle slopes",
            Self::ZoneMasks => "zone masks",
            Self::Specular => "specular",
            Self::Scattering => "scattering",
            Self::Hair => "hair",
            Self::Pictures => "pictures of materials",
        }
    }

    /// Size of the largest map of this kind of a head, texels; none where there is none.
    pub fn size(self, maps: &SkinMaps, authored: &Authored) -> Option<[u32; 2]> {
        let largest = |all: &mut dyn Iterator<Item = &Map>| {
            all.map(|m| [m.width, m.height]).reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])])
        };
        match self {
            Self::Albedo => largest(&mut maps.albedo.iter()),
            Self::Melanin => largest(&mut maps.melanin.iter()),
            Self::Hemoglobin => largest(&mut maps.hemoglobin.iter()),
            Self::Distributions => largest(&mut maps.distributions.iter().flat_map(|d| [&d.scale, &d.bias])),
            Self::Slopes => largest(&mut maps.slopes.iter()),
            Self::WrinkleSlopes => largest(&mut maps.wrinkle_slopes.iter()),
            Self::ZoneMasks => largest(&mut maps.zones.iter().map(|z| &z.mask)),
            Self::Specular => largest(&mut maps.specular.iter()),
            Self::Scattering => largest(&mut maps.scattering.iter()),
            Self::Hair => largest(&mut maps.hair.iter()),
            Self::Pictures => (authored.images.iter().map(|image| [image.width, image.height]))
                .reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]),
        }
    }
}

impl Reduction {
    fn halvings(&self, kind: MapKind) -> u32 {
        self.halvings.get(&kind).copied().unwrap_or(0)
    }

    pub(super) fn maps(&self, maps: &SkinMaps) -> SkinMaps {
        let smaller = |kind, map: &Map| halved(map, self.halvings(kind));
        let optional = |kind, map: &Option<Map>| map.as_ref().map(|m| smaller(kind, m));
        let distributions: Vec<Distribution> = kept(maps.distributions.len(), &self.distributions)
            .map(|i| &maps.distributions[i])
            .map(|d| Distribution {
                name: d.name.clone(),
                scale: smaller(MapKind::Distributions, &d.scale),
                bias: smaller(MapKind::Distributions, &d.bias),
            })
            .collect();
        let has_lost_all = distributions.is_empty() && !maps.distributions.is_empty();
        let zones: Vec<&WrinkleZone> = kept(maps.zones.len(), &self.zones).map(|i| &maps.zones[i]).collect();
        // Numbers of the wrinkle maps that stay.
        let of_zones: BTreeSet<u32> = zones.iter().map(|z| z.wrinkle_map).collect();
        let stays = |i: usize| self.zones.is_empty() || of_zones.contains(&(i as u32));
        let wrinkle_maps: Vec<usize> = (0..maps.wrinkle_slopes.len()).filter(|i| stays(*i)).collect();
        let number = |old: u32| wrinkle_maps.partition_point(|i| *i < old as usize) as u32;
        SkinMaps {
            albedo: optional(MapKind::Albedo, &maps.albedo),
            melanin: optional(MapKind::Melanin, &maps.melanin),
            hemoglobin: optional(MapKind::Hemoglobin, &maps.hemoglobin),
            hemoglobin_mean: match has_lost_all {
                true => None,
                false => optional(MapKind::Distributions, &maps.hemoglobin_mean),
            },
            distributions,
            slopes: optional(MapKind::Slopes, &maps.slopes),
            wrinkle_slopes: wrinkle_maps
                .iter()
                .map(|i| smaller(MapKind::WrinkleSlopes, &maps.wrinkle_slopes[*i]))
                .collect(),
            zones: zones
                .iter()
                .map(|z| WrinkleZone {
                    name: z.name.clone(),
                    wrinkle_map: number(z.wrinkle_map),
                    mask: smaller(MapKind::ZoneMasks, &z.mask),
                })
                .collect(),
            specular: optional(MapKind::Specular, &maps.specular),
            scattering: optional(MapKind::Scattering, &maps.scattering),
            hair: optional(MapKind::Hair, &maps.hair),
            hair_color_linear: maps.hair_color_linear,
            hair_count: [maps.hair_count, self.hairs].into_iter().flatten().min(),
        }
    }

    pub(super) fn pictures(&self, authored: &Authored) -> Vec<AuthoredImage> {
        let halvings = self.halvings(MapKind::Pictures);
        if halvings == 0 {
            return authored.images.clone();
        }
        let is_color = |i: usize| {
            authored.materials.iter().any(|m| {
                let colors = [&m.base_color_texture, &m.emission_texture, &m.specular_color_texture];
                colors.into_iter().flatten().any(|t| t.image as usize == i)
            })
        };
        let images = authored.images.iter().enumerate();
        images.map(|(i, image)| smaller_picture(image, halvings, is_color(i))).collect()
    }
}

/// A size with its sides halved some times, at least one texel each.
pub(super) fn halved_size([width, height]: [u32; 2], halvings: u32) -> [u32; 2] {
    [width, height].map(|n| n.checked_shr(halvings).unwrap_or(0).max(1))
}

/// The mean of the texels under each texel of a smaller map.
fn halved(map: &Map, halvings: u32) -> Map {
    let [width, height] = halved_size([map.width, map.height], halvings);
    if [width, height] == [map.width, map.height] {
        return map.clone();
    }
    resize_area(map, &Mask::full(map.width, map.height), width, height).0
}

/// The same of a picture: of light where it is a colour.
fn smaller_picture(image: &AuthoredImage, halvings: u32, is_color: bool) -> AuthoredImage {
    let decode = |(c, byte): (usize, &u8)| {
        let v = f32::from(*byte) / 255.0;
        if is_color && c % 4 < 3 { srgb_decode(v) } else { v }
    };
    let values = image.rgba.iter().enumerate().map(decode).collect();
    let map = halved(&Map { width: image.width, height: image.height, channels: 4, values }, halvings);
    let encode = |(c, v): (usize, &f32)| {
        let v = if is_color && c % 4 < 3 { srgb_encode(*v) } else { *v };
        (v.clamp(0.0, 1.0) * 255.0).round() as u8
    };
    AuthoredImage {
        name: image.name.clone(),
        width: map.width,
        height: map.height,
        rgba: map.values.iter().enumerate().map(encode).collect(),
    }
}
