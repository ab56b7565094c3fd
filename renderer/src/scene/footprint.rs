//! Device memory of the maps of a head, as stored and in block formats.
//!
//! Papers/004 section 8.3 counts 96 KB for wrinkles in block formats; this counts the same for any head, without a
//! device. Block formats (BC4: half a byte per texel and channel, BC5: one byte for two channels, BC7: one byte for
//! four) hold 4 x 4 texels; a level smaller than that still takes a whole block.

use rubor_rig::head::SkinMaps;
use rubor_rig::map::Map;
use serde::Serialize;

/// Side of the maps that are blended for each frame (256 in Jimenez 2012 section 7.6).
pub(crate) const APPEARANCE_SIZE: u32 = 256;

/// The size that holds all of some maps: at least one texel.
pub(crate) fn largest_of<'a>(maps: impl IntoIterator<Item = &'a Map>) -> [u32; 2] {
    maps.into_iter().fold([1, 1], |s, m| [s[0].max(m.width), s[1].max(m.height)])
}

/// One texture of a head.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Footprint {
    /// Its contents.
    pub texture: &'static str,
    /// Texels of the largest level.
    pub size: [u32; 2],
    /// Layers of an array.
    pub layers: u32,
    /// Format as it is stored.
    pub format: &'static str,
    /// Bytes as it is stored, all levels and layers.
    pub bytes: u64,
    /// Suitable block format.
    pub block_format: &'static str,
    /// Bytes in that format.
    pub block_bytes: u64,
}

/// How the texels of a texture are stored.
struct Storage {
    format: &'static str,
    texel_bytes: u64,
    block_format: &'static str,
    /// Bytes of a block of 4 x 4 texels.
    block_bytes: u64,
}

const COLOR: Storage = Storage { format: "rgba8unorm", texel_bytes: 4, block_format: "BC7", block_bytes: 16 };
const ALBEDO: Storage =
    Storage { format: "rgba8unorm-srgb", texel_bytes: 4, block_format: "BC7", block_bytes: 16 };
const GLOSS: Storage = Storage { format: "rg8unorm", texel_bytes: 2, block_format: "BC5", block_bytes: 16 };
const SLOPES: Storage =
    Storage { format: "rgba16float", texel_bytes: 8, block_format: "BC5 + BC4", block_bytes: 24 };
const WRINKLES: Storage =
    Storage { format: "rgba16float", texel_bytes: 8, block_format: "BC5", block_bytes: 16 };
const CHANGES: Storage =
    Storage { format: "rg16float", texel_bytes: 4, block_format: "BC5", block_bytes: 16 };
const MEAN: Storage = Storage { format: "r16float", texel_bytes: 2, block_format: "BC4", block_bytes: 8 };

/// The textures of a head's maps; none where the head lacks melanin or hemoglobin and is drawn without maps.
pub fn of_maps(maps: &SkinMaps) -> Vec<Footprint> {
    let (Some(melanin), Some(hemoglobin)) = (&maps.melanin, &maps.hemoglobin) else { return Vec::new() };
    let skin = [Some(melanin), Some(hemoglobin), maps.scattering.as_ref(), maps.hair.as_ref()];
    let side = [APPEARANCE_SIZE; 2];
    let count = |n: usize| (n as u32).max(1);
    vec![
        entry("chromophores", largest_of(skin.into_iter().flatten()), 1, true, &COLOR),
        match &maps.albedo {
            // Roughness shares the texture of the slopes.
            Some(_) => entry(
                "albedo, specular",
                largest_of(maps.albedo.iter().chain(&maps.specular)),
                1,
                true,
                &ALBEDO,
            ),
            None => entry("specular", largest_of(maps.specular.iter()), 1, true, &GLOSS),
        },
        entry("slopes", slope_size(maps), 1, true, &SLOPES),
        entry(
            "wrinkles",
            largest_of(maps.wrinkle_slopes.iter()),
            count(maps.wrinkle_slopes.len()),
            true,
            &WRINKLES,
        ),
        entry("distributions", side, count(maps.distributions.len()), false, &CHANGES),
        entry("neutral mean", side, 1, false, &MEAN),
        entry("zone masks", mask_size(maps), count(maps.zones.len().div_ceil(4)), false, &COLOR),
    ]
}

/// Texels of the texture of slopes, which holds the roughness of skin that has a colour by itself.
pub(crate) fn slope_size(maps: &SkinMaps) -> [u32; 2] {
    let roughness = maps.specular.iter().filter(|_| maps.albedo.is_some());
    largest_of(maps.slopes.iter().chain(roughness))
}

/// Texels of the textures of zone masks: their own, which is little (64 x 64 in Jimenez 2012 section 8.3).
pub(crate) fn mask_size(maps: &SkinMaps) -> [u32; 2] {
    largest_of(maps.zones.iter().map(|z| &z.mask))
}

fn entry(texture: &'static str, size: [u32; 2], layers: u32, has_mips: bool, storage: &Storage) -> Footprint {
    let mut levels = vec![size];
    while has_mips && levels[levels.len() - 1] != [1, 1] {
        levels.push(levels[levels.len() - 1].map(|n| (n / 2).max(1)));
    }
    let of_levels = |bytes: &dyn Fn(u64, u64) -> u64| -> u64 {
        levels.iter().map(|l| bytes(u64::from(l[0]), u64::from(l[1]))).sum::<u64>() * u64::from(layers)
    };
    Footprint {
        texture,
        size,
        layers,
        format: storage.format,
        bytes: of_levels(&|w, h| w * h * storage.texel_bytes),
        block_format: storage.block_format,
        block_bytes: of_levels(&|w, h| w.div_ceil(4) * h.div_ceil(4) * storage.block_bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rubor_rig::head::WrinkleZone;
    use rubor_rig::map::Map;

    #[test]
    fn the_wrinkles_of_the_thesis_take_what_it_says() {
        // 256 x 256 wrinkles and eight zones of 64 x 64 in two textures: 96 KB with mip levels, which its masks
        // have and ours do not.
        let zone =
            |i| WrinkleZone { name: format!("{i}"), wrinkle_map: 0, mask: Map::filled(64, 64, &[1.0]) };
        let maps = SkinMaps {
            melanin: Some(Map::filled(1, 1, &[0.1])),
            hemoglobin: Some(Map::filled(1, 1, &[0.1])),
            wrinkle_slopes: vec![Map::filled(256, 256, &[0.0, 0.0])],
            zones: (0..8).map(zone).collect(),
            ..SkinMaps::default()
        };
        let of = |name: &str| of_maps(&maps).into_iter().find(|f| f.texture == name).expect("listed");
        assert_eq!((of("wrinkles").block_bytes, of("zone masks").block_bytes), (87_408, 8192));
        assert_eq!(of("zone masks").bytes, 2 * 64 * 64 * 4);
        assert_eq!(of("distributions").bytes, 256 * 256 * 4);
        assert!(of_maps(&SkinMaps::default()).is_empty());
    }
}
