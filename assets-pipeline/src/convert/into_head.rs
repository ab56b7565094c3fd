//! Converted maps into a head, with what follows from them.
//!
//! Distributions are relative to the neutral blood of a head. Where new maps replace that blood, the distributions
//! that stay follow it by ratio (section 7.4.2 of Jimenez 2012: only relative changes belong to an expression), and the
//! local mean that they stand on is taken anew.

use rubor_rig::head::{Distribution, Head, Provenance, ProvenanceKind, WrinkleZone};
use rubor_rig::hemoglobin::{self, DISTRIBUTION_SIZE};
use rubor_rig::map::Map;

use super::ConvertError;
use super::hemoglobin::{HemoglobinMaps, default_radius};
use super::skin_texels::SkinTexels;
use super::transfer::{BiasTransfer, Warp, transfer};
use crate::synthesize::strands::hide_brows;

/// Where maps come from, for the provenance of a head.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Measured, painted, ...
    pub kind: ProvenanceKind,
    /// Files or words.
    pub source: String,
    /// SPDX expression.
    pub licence: String,
}

impl Origin {
    fn stamp(&self, head: &mut Head, of: &str) {
        let of = format!("maps.{of}");
        head.provenance.retain(|p| p.of != of);
        head.provenance.push(Provenance {
            of,
            kind: self.kind,
            source: self.source.clone(),
            licence: self.licence.clone(),
        });
    }
}

/// Puts a neutral map and its distributions into a head; returns the names of the distributions that stayed.
///
/// # Errors
/// Distributions of the head that cannot follow because their maps are broken.
pub fn put_hemoglobin(
    head: &mut Head,
    maps: HemoglobinMaps,
    origin: &Origin,
) -> Result<Vec<String>, ConvertError> {
    let kept = follow(head, &maps.neutral_mean, &maps.distributions)?;
    let measured_neutral = head.maps.hemoglobin.as_ref() != Some(&maps.neutral);
    head.maps.hemoglobin = Some(maps.neutral);
    head.maps.hemoglobin_mean = Some(maps.neutral_mean);
    let names: Vec<String> = kept.iter().map(|d| d.name.clone()).collect();
    let has_new = !maps.distributions.is_empty();
    head.maps.distributions = kept;
    put_distributions(head, maps.distributions);
    if measured_neutral {
        origin.stamp(head, "hemoglobin");
    }
    if has_new {
        origin.stamp(head, "distributions");
    }
    Ok(names)
}

/// Puts melanin and hemoglobin of one size into a head; its distributions follow the new blood.
///
/// # Errors
/// Maps that the statistics of the blood refuse; see [`hemoglobin::neutral`].
pub fn put_chromophores(
    head: &mut Head,
    melanin: Map,
    hemoglobin: Map,
    origin: &Origin,
) -> Result<(), ConvertError> {
    if !head.maps.distributions.is_empty() {
        let mean = neutral_mean(head, &hemoglobin)?;
        head.maps.distributions = follow(head, &mean, &[])?;
        head.maps.hemoglobin_mean = Some(mean);
    } else {
        head.maps.hemoglobin_mean = None;
    }
    head.maps.melanin = Some(melanin);
    head.maps.hemoglobin = Some(hemoglobin);
    origin.stamp(head, "melanin");
    origin.stamp(head, "hemoglobin");
    Ok(())
}

/// Puts a linear Rec. 709 albedo of 3 channels into a head as the colour that its skin has by itself. Hair that was to be
/// drawn with the skin goes, and brows that were grown are hidden: that colour has its own.
///
/// # Errors
/// Other channels.
pub fn put_albedo(head: &mut Head, albedo: Map, origin: &Origin) -> Result<(), ConvertError> {
    if albedo.channels != 3 {
        return Err(ConvertError::argument("albedo", format!("{} channels", albedo.channels), "3"));
    }
    let values = albedo.values.iter().map(|v| v.clamp(0.0, 1.0)).collect();
    head.maps.albedo = Some(Map { values, ..albedo });
    head.maps.hair = None;
    hide_brows(head);
    origin.stamp(head, "albedo");
    Ok(())
}

/// Local mean of a hemoglobin map over the skin of a head, at the size of its distributions.
///
/// # Errors
/// See [`hemoglobin::neutral`].
pub fn neutral_mean(head: &Head, hemoglobin: &Map) -> Result<Map, ConvertError> {
    let size = head.maps.hemoglobin_mean.as_ref().map_or(DISTRIBUTION_SIZE, |m| m.width.max(m.height));
    let mask = SkinTexels::new(head, hemoglobin.width, hemoglobin.height).mask();
    hemoglobin::neutral(hemoglobin, &mask, default_radius(hemoglobin), size)
        .map(|n| n.mean)
        .map_err(|source| ConvertError::Hemoglobin { name: "neutral".into(), source })
}

/// Adds distributions, or replaces those of the same name.
pub fn put_distributions(head: &mut Head, distributions: Vec<Distribution>) {
    for new in distributions {
        match head.maps.distributions.iter_mut().find(|d| d.name == new.name) {
            Some(old) => *old = new,
            None => head.maps.distributions.push(new),
        }
    }
}

/// Puts distributions that another head gave, or that were predicted, into a head, and the mean they stand on.
pub fn put_given_distributions(
    head: &mut Head,
    distributions: Vec<Distribution>,
    mean: Map,
    origin: &Origin,
) {
    head.maps.hemoglobin_mean = Some(mean);
    put_distributions(head, distributions);
    origin.stamp(head, "distributions");
}

/// Puts slopes of the surface into a head.
///
/// # Errors
/// Channels other than 2.
pub fn put_slopes(head: &mut Head, slopes: Map, origin: &Origin) -> Result<(), ConvertError> {
    require_slopes(&slopes)?;
    head.maps.slopes = Some(slopes);
    origin.stamp(head, "slopes");
    Ok(())
}

/// Puts intensity and Beckmann roughness of reflection into a head.
///
/// # Errors
/// Channels other than 2, values outside 0..1.
pub fn put_specular(head: &mut Head, specular: Map, origin: &Origin) -> Result<(), ConvertError> {
    if specular.channels != 2 {
        return Err(ConvertError::argument("specular", format!("{} channels", specular.channels), "2"));
    }
    if let Some(v) = specular.values.iter().find(|v| !(0.0..=1.0).contains(*v)) {
        return Err(ConvertError::argument("specular", v.to_string(), "values from 0 to 1"));
    }
    head.maps.specular = Some(specular);
    origin.stamp(head, "specular");
    Ok(())
}

/// Puts slopes of wrinkles into a head as its map `index` (a new one where it is their number), with zones that fade
/// them in; zones of the same name are replaced.
///
/// # Errors
/// Channels other than 2, an index beyond the next free one, a mask with other than 1 channel or values outside 0..1.
pub fn put_wrinkles(
    head: &mut Head,
    index: usize,
    slopes: Map,
    zones: Vec<(String, Map)>,
    origin: &Origin,
) -> Result<(), ConvertError> {
    require_slopes(&slopes)?;
    let count = head.maps.wrinkle_slopes.len();
    if index > count {
        let expected = format!("0 to {count}, the next free one");
        return Err(ConvertError::argument("wrinkle map", index.to_string(), expected));
    }
    for (name, mask) in &zones {
        let at = format!("mask of zone {name:?}");
        if name.is_empty() || mask.channels != 1 {
            let found = format!("name {name:?}, {} channels", mask.channels);
            return Err(ConvertError::argument(at, found, "a name and 1 channel"));
        }
        if let Some(v) = mask.values.iter().find(|v| !(0.0..=1.0).contains(*v)) {
            return Err(ConvertError::argument(at, v.to_string(), "weights from 0 to 1"));
        }
    }
    if index == count {
        head.maps.wrinkle_slopes.push(slopes);
    } else {
        head.maps.wrinkle_slopes[index] = slopes;
    }
    let has_zones = !zones.is_empty();
    for (name, mask) in zones {
        let zone = WrinkleZone { name, wrinkle_map: index as u32, mask };
        match head.maps.zones.iter_mut().find(|z| z.name == zone.name) {
            Some(old) => *old = zone,
            None => head.maps.zones.push(zone),
        }
    }
    origin.stamp(head, "wrinkle_slopes");
    if has_zones {
        origin.stamp(head, "zones");
    }
    Ok(())
}

fn require_slopes(map: &Map) -> Result<(), ConvertError> {
    if map.channels != 2 {
        return Err(ConvertError::argument("slopes", format!("{} channels", map.channels), "2"));
    }
    Ok(())
}

/// Distributions of a head that `replaced` does not name, on a new local mean.
fn follow(head: &Head, mean: &Map, replaced: &[Distribution]) -> Result<Vec<Distribution>, ConvertError> {
    let Some(old_mean) = &head.maps.hemoglobin_mean else { return Ok(Vec::new()) };
    let stay = head.maps.distributions.iter().filter(|d| replaced.iter().all(|r| r.name != d.name));
    stay.map(|d| {
        if old_mean == mean {
            return Ok(d.clone());
        }
        transfer(d, old_mean, mean, &Warp::Identity, BiasTransfer::Ratio)
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::super::skin_texels::tests::sheet;
    use super::*;
    use glam::Vec2;
    use rubor_rig::head::Material;
    use rubor_rig::mask::Mask;

    fn origin() -> Origin {
        Origin { kind: ProvenanceKind::Painted, source: "test".into(), licence: "CC0-1.0".into() }
    }

    fn head() -> Head {
        let mut head = sheet(Vec2::ZERO, Vec2::ONE);
        let flat = |v| Map::filled(8, 8, &[v]);
        head.maps.hemoglobin = Some(flat(0.02));
        head.maps.hemoglobin_mean = Some(flat(0.02));
        let d = |name: &str, bias| Distribution { name: name.into(), scale: flat(1.5), bias: flat(bias) };
        head.maps.distributions = vec![d("joy", 0.03), d("fear", 0.01)];
        head
    }

    #[test]
    fn distributions_that_stay_follow_the_new_blood() {
        let mut head = head();
        let flat = |v| Map::filled(16, 16, &[v]);
        let maps = HemoglobinMaps {
            neutral: flat(0.04),
            neutral_mean: flat(0.04),
            mask: Mask::full(16, 16),
            distributions: vec![Distribution { name: "joy".into(), scale: flat(2.0), bias: flat(0.07) }],
            radius_px: 1,
            clamped_texels: 0,
            constant: Vec::new(),
            notes: Vec::new(),
        };
        assert_eq!(put_hemoglobin(&mut head, maps, &origin()).unwrap(), ["fear"]);
        assert!(head.validate().is_ok());
        let bias = |name: &str| {
            let d = head.maps.distributions.iter().find(|d| d.name == name).unwrap();
            d.bias.values[0]
        };
        // Fear was half of the neutral blood and stays half of it.
        assert!((bias("fear") - 0.02).abs() < 1e-6 && bias("joy") == 0.07);
        let kind = |of: &str| head.provenance.iter().find(|p| p.of == of).map(|p| p.kind);
        assert_eq!(kind("maps.hemoglobin"), Some(ProvenanceKind::Painted));
        assert_eq!(kind("maps.distributions"), Some(ProvenanceKind::Painted));
    }

    #[test]
    fn chromophores_bring_a_mean_where_there_are_distributions() {
        let mut head = head();
        let flat = |v| Map::filled(32, 32, &[v]);
        put_chromophores(&mut head, flat(0.1), flat(0.01), &origin()).unwrap();
        assert!(head.validate().is_ok());
        let mean = head.maps.hemoglobin_mean.as_ref().unwrap();
        assert_eq!((mean.width, mean.values[9]), (8, 0.01));
        assert!((head.maps.distributions[0].bias.values[5] - 0.015).abs() < 1e-7);
    }

    #[test]
    fn a_colour_of_its_own_has_its_own_hair() {
        let mut head = head();
        head.maps.hair = Some(Map::filled(4, 4, &[1.0]));
        let brows = rubor_rig::head::Part { name: "brows".into(), material: Material::Hair, triangles: 2..2 };
        head.mesh.parts.push(brows);
        put_albedo(&mut head, Map::filled(4, 4, &[1.2, 0.5, -0.1]), &origin()).unwrap();
        assert!(head.validate().is_ok() && head.maps.hair.is_none());
        assert_eq!(head.mesh.parts[1].material, Material::Hidden);
        assert_eq!(head.maps.albedo.as_ref().unwrap().values[..3], [1.0, 0.5, 0.0]);
        assert!(put_albedo(&mut head, Map::filled(4, 4, &[1.0]), &origin()).is_err());
    }

    #[test]
    fn wrinkle_maps_and_zones_are_added_and_replaced() {
        let mut head = head();
        let slopes = || Map::filled(4, 4, &[0.1, 0.2]);
        let zone = |v| vec![("brow".to_owned(), Map::filled(2, 2, &[v]))];
        put_wrinkles(&mut head, 0, slopes(), zone(1.0), &origin()).unwrap();
        put_wrinkles(&mut head, 1, slopes(), zone(0.5), &origin()).unwrap();
        assert_eq!((head.maps.wrinkle_slopes.len(), head.maps.zones.len()), (2, 1));
        assert_eq!(head.maps.zones[0].wrinkle_map, 1);
        assert!(head.validate().is_ok());
        let fails = |index, zones| {
            put_wrinkles(&mut self::head(), index, slopes(), zones, &origin()).unwrap_err().to_string()
        };
        assert!(fails(1, zone(1.0)).contains("0 to 0"));
        assert!(fails(0, zone(1.5)).contains("weights from 0 to 1"));
        assert!(put_slopes(&mut head, Map::filled(2, 2, &[1.0]), &origin()).is_err());
    }
}
