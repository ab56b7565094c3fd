//! Coverage tables of morphological antialiasing, computed from geometry.
//!
//! ```text
//!            orthogonal.rs                diagonal.rs                 search.rs
//!   line of edges with two ends   stair of edges at 45 degrees   four edge bits in one
//!   re-vectorised, exact areas    re-vectorised, 30 x 30 points  bilinear fetch, inverted
//!               |                           |                           |
//!               +------- area texture ------+                    search texture
//!               |      160 x 560, RG8                                64 x 16, R8
//!         AreaTable: one entry per pair of whole distances (what the kernels read)
//! ```
//!
//! Source: J. Jimenez, *Practical real-time strategies for photorealistic skin rendering and antialiasing*,
//! 2012, sections 9.4.3 and 10.4; J. Jimenez et al., *SMAA: Enhanced Subpixel Morphological Antialiasing*,
//! 2012. The textures equal those published with SMAA in every byte (tests), but no part of them is stored
//! here.
//!
//! Differs: the kernels read neither texture. Distances are whole pixels, so [`AreaTable`] holds the value
//! that a bilinear fetch of the area texture returns for each pair of distances: one read instead of a
//! square root and a filtered fetch, the same bits on every adapter. Unless the published values are asked for, it
//! holds exact areas instead of bytes, and other diagonals ([`stair_area`]). The search needs no table at all,
//! since edges are kept as bits (see `edges.wesl`); the search texture serves as an oracle for it.

mod diagonal;
mod orthogonal;
mod search;

pub use diagonal::{DIAGONAL_OFFSETS, OPPOSITE_DIAGONAL_OFFSET, diagonal_area, stair_area};
pub use orthogonal::{ORTHOGONAL_OFFSETS, Smoothing, orthogonal_area};
pub use search::{SEARCH_HEIGHT, SEARCH_WIDTH, search_texture, search_texture_uncropped};

use rayon::prelude::*;

/// Width of the area texture in texels: orthogonal patterns left, diagonal patterns right.
pub const AREA_WIDTH: usize = 160;
/// Height of the area texture in texels: one block of 80 rows per subsample offset.
pub const AREA_HEIGHT: usize = 560;
/// Distances in an orthogonal slot; texel `i` stands for the distance `i * i`.
pub const ORTHOGONAL_SLOT: usize = 16;
/// Distances in a diagonal slot.
pub const DIAGONAL_SLOT: usize = 20;
/// Distances in a slot of the MLAA table, 0 to 8 pixels (section 9.4.3).
pub const MLAA_SLOT: usize = 9;

const BLOCK_HEIGHT: usize = 80;

/// Which edges cross the end of a line: bit 0 on the upper (or left) side, bit 1 on the lower (or right) side.
pub type Crossing = u32;

/// Where a crossing stands in the 5 x 5 grid of slots: four times the value which a bilinear fetch a quarter of
/// a pixel off the line returns (figure 9.4), so that slot 2 stays empty.
const SLOT_OF_CROSSING: [usize; 4] = [0, 1, 3, 4];

/// The area texture of SMAA: [`AREA_WIDTH`] x [`AREA_HEIGHT`] texels of 2 bytes, row 0 first, linear values.
///
/// The first byte is the weight of the pixel below (or right of) the edge, the second that of the pixel above
/// (or left of) it.
pub fn area_texture() -> Vec<u8> {
    let mut texels = vec![0u8; AREA_WIDTH * AREA_HEIGHT * 2];
    texels.par_chunks_mut(BLOCK_HEIGHT * AREA_WIDTH * 2).enumerate().for_each(|(block, rows)| {
        let mut put = |x: usize, y: usize, area: [f64; 2]| {
            let at = (y * AREA_WIDTH + x) * 2;
            rows[at] = truncate_to_byte(area[0]);
            rows[at + 1] = truncate_to_byte(area[1]);
        };
        let offset = ORTHOGONAL_OFFSETS[block];
        for (near, far) in all_crossings() {
            for right in 0..ORTHOGONAL_SLOT {
                for left in 0..ORTHOGONAL_SLOT {
                    let area =
                        orthogonal_area(near, far, left * left, right * right, offset, Smoothing::Smaa);
                    let slot_x = SLOT_OF_CROSSING[near as usize] * ORTHOGONAL_SLOT;
                    let slot_y = SLOT_OF_CROSSING[far as usize] * ORTHOGONAL_SLOT;
                    put(slot_x + left, slot_y + right, area);
                }
            }
        }
        let Some(&offset) = DIAGONAL_OFFSETS.get(block) else { return };
        for (near, far) in all_crossings() {
            for right in 0..DIAGONAL_SLOT {
                for left in 0..DIAGONAL_SLOT {
                    let area = diagonal_area(near, far, left, right, offset);
                    let x = AREA_WIDTH / 2 + near as usize * DIAGONAL_SLOT + left;
                    put(x, far as usize * DIAGONAL_SLOT + right, area);
                }
            }
        }
    });
    texels
}

/// The area table of chapter 9: 5 x 5 slots of 9 x 9 distances, 2 bytes per texel, 45 texels per row.
///
/// Distances are linear from 0 to 8 pixels and U patterns are not smoothed.
pub fn mlaa_area_texture() -> Vec<u8> {
    let width = 5 * MLAA_SLOT;
    let mut texels = vec![0u8; width * width * 2];
    for (near, far) in all_crossings() {
        for right in 0..MLAA_SLOT {
            for left in 0..MLAA_SLOT {
                let area = orthogonal_area(near, far, left, right, 0.0, Smoothing::None);
                let x = SLOT_OF_CROSSING[near as usize] * MLAA_SLOT + left;
                let y = SLOT_OF_CROSSING[far as usize] * MLAA_SLOT + right;
                let at = (y * width + x) * 2;
                texels[at] = truncate_to_byte(area[0]);
                texels[at + 1] = truncate_to_byte(area[1]);
            }
        }
    }
    texels
}

/// Coverage for whole distances, as the kernels read it.
///
/// An entry packs two 16-bit fractions: the weight of the pixel below (right of) the edge in the low half, that
/// of the pixel above (left of) it in the high half. `areas` starts with the orthogonal entries at
/// `((block * 16 + near + 4 * far) * stride + left) * stride + right`; from `diagonal_base` on follow the
/// diagonal ones at `((block * 16 + near + 4 * far) * 20 + left) * 20 + right` ([`AreaTable::smaa`]) or
/// `(block * slot + before) * slot + after` with `slot = 2 * steps + 1` ([`AreaTable::exact`]).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AreaTable {
    /// All entries.
    pub areas: Vec<u32>,
    /// Number of distances per side in the orthogonal part: the longest distance plus one.
    pub stride: u32,
    /// Index of the first diagonal entry.
    pub diagonal_base: u32,
}

impl AreaTable {
    /// What bilinear fetches of `texture` (from [`area_texture`]) return for distances up to `longest` pixels,
    /// for the given blocks of subsample offsets. Diagonals exist for blocks 0 to 4.
    ///
    /// # Panics
    /// A block does not exist or `longest` is over 225, the last distance in the texture.
    pub fn smaa(
        texture: &[u8],
        longest: usize,
        orthogonal_blocks: &[usize],
        diagonal_blocks: &[usize],
    ) -> Self {
        let last = ORTHOGONAL_SLOT - 1;
        assert!(longest <= last * last, "the area texture ends at a distance of {} pixels", last * last);
        let stride = longest + 1;
        // Bilinear filtering weights in 1/256, which is what GPUs' samplers use.
        let positions: Vec<(usize, u32)> = (0..=longest)
            .map(|distance| {
                let fixed = ((distance as f64).sqrt() * 256.0).round() as usize;
                (fixed / 256, (fixed % 256) as u32)
            })
            .collect();
        let texel =
            |x: usize, y: usize, channel: usize| u32::from(texture[(y * AREA_WIDTH + x) * 2 + channel]);
        let mut areas = Vec::with_capacity((orthogonal_blocks.len() * stride * stride + 400) * 16);
        for &block in orthogonal_blocks {
            for pattern in 0..16 {
                let slot_x = SLOT_OF_CROSSING[pattern & 3] * ORTHOGONAL_SLOT;
                let slot_y = block * BLOCK_HEIGHT + SLOT_OF_CROSSING[pattern >> 2] * ORTHOGONAL_SLOT;
                for &(left, left_part) in &positions {
                    for &(right, right_part) in &positions {
                        let (x0, x1) = (slot_x + left, slot_x + (left + 1).min(last));
                        let (y0, y1) = (slot_y + right, slot_y + (right + 1).min(last));
                        let fetch = |channel| {
                            let upper = texel(x0, y0, channel) * (256 - left_part)
                                + texel(x1, y0, channel) * left_part;
                            let lower = texel(x0, y1, channel) * (256 - left_part)
                                + texel(x1, y1, channel) * left_part;
                            // 255 * 65536 times the fraction becomes 65535 times it: divide by 255 * 65536 / 65535.
                            let sum = upper * (256 - right_part) + lower * right_part;
                            ((u64::from(sum) * 257 + 32768) >> 16) as u32
                        };
                        areas.push(fetch(0) | (fetch(1) << 16));
                    }
                }
            }
        }
        let diagonal_base = areas.len() as u32;
        for &block in diagonal_blocks {
            assert!(block < DIAGONAL_OFFSETS.len(), "no diagonal areas for subsample offset {block}");
            for pattern in 0..16 {
                for left in 0..DIAGONAL_SLOT {
                    for right in 0..DIAGONAL_SLOT {
                        let x = AREA_WIDTH / 2 + (pattern & 3) * DIAGONAL_SLOT + left;
                        let y = block * BLOCK_HEIGHT + (pattern >> 2) * DIAGONAL_SLOT + right;
                        areas.push((texel(x, y, 0) * 257) | (texel(x, y, 1) * 257) << 16);
                    }
                }
            }
        }
        Self { areas, stride: stride as u32, diagonal_base }
    }

    /// Exact areas for distances up to `longest` pixels and stairs of up to `2 * steps` edges to each side of an edge,
    /// for the given blocks of subsample offsets. Stairs exist for blocks 0 to 4.
    ///
    /// # Panics
    /// A block does not exist.
    pub fn exact(
        longest: usize,
        steps: usize,
        orthogonal_blocks: &[usize],
        diagonal_blocks: &[usize],
    ) -> Self {
        // Halves go up in spite of rounding, so that mirrored patterns have the same areas.
        let pack = |area: [f64; 2]| {
            let [low, high] = area.map(|part| (part.clamp(0.0, 1.0) * 65535.0 + 0.5 + 1e-6).floor() as u32);
            low | high << 16
        };
        let (stride, slot) = (longest + 1, 2 * steps + 1);
        let orthogonal = orthogonal_blocks.par_iter().flat_map_iter(|&block| {
            (0..16 * stride * stride).map(move |i| {
                let (pattern, left, right) = (i / (stride * stride), i / stride % stride, i % stride);
                let (near, far) = (pattern as Crossing & 3, pattern as Crossing >> 2);
                let offset = ORTHOGONAL_OFFSETS[block];
                pack(orthogonal_area(near, far, left, right, offset, Smoothing::None))
            })
        });
        let mut areas: Vec<u32> = orthogonal.collect();
        let diagonal_base = areas.len() as u32;
        if steps > 0 {
            areas.extend(diagonal_blocks.iter().flat_map(|&block| {
                (0..slot * slot).map(move |i| {
                    let (before, after) = (i / slot, i % slot);
                    // Ends that differ do not belong to a straight line.
                    let line = before % 2 == after % 2;
                    if line { pack(stair_area(before, after, DIAGONAL_OFFSETS[block])) } else { 0 }
                })
            }));
        }
        Self { areas, stride: stride as u32, diagonal_base }
    }

    /// The table of chapter 9, distances 0 to 8; it has no diagonal part.
    pub fn mlaa(texture: &[u8]) -> Self {
        let mut areas = Vec::with_capacity(16 * MLAA_SLOT * MLAA_SLOT);
        for pattern in 0..16 {
            for left in 0..MLAA_SLOT {
                for right in 0..MLAA_SLOT {
                    let x = SLOT_OF_CROSSING[pattern & 3] * MLAA_SLOT + left;
                    let y = SLOT_OF_CROSSING[pattern >> 2] * MLAA_SLOT + right;
                    let at = (y * 5 * MLAA_SLOT + x) * 2;
                    areas.push((u32::from(texture[at]) * 257) | ((u32::from(texture[at + 1]) * 257) << 16));
                }
            }
        }
        Self { diagonal_base: areas.len() as u32, areas, stride: MLAA_SLOT as u32 }
    }
}

fn all_crossings() -> impl Iterator<Item = (Crossing, Crossing)> {
    (0..4).flat_map(|far| (0..4).map(move |near| (near, far)))
}

/// The published textures truncate instead of rounding.
fn truncate_to_byte(fraction: f64) -> u8 {
    (fraction * 255.0) as u8
}

#[cfg(test)]
mod tests;
