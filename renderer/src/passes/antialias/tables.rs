//! The coverage tables of a mode, and the blocks of each subsample.

use super::lookups::{AreaTable, OPPOSITE_DIAGONAL_OFFSET, area_texture, mlaa_area_texture};
use super::settings::{Mode, Patterns, Settings, Subsample};

/// Coverage for the subsample offsets of a mode.
#[derive(Debug, Clone)]
pub struct Tables {
    /// The entries, as the kernels read them.
    pub areas: AreaTable,
    orthogonal_blocks: Vec<usize>,
    diagonal_blocks: Vec<usize>,
}

impl Tables {
    /// Makes the tables of a mode, in some 30 ms on two cores.
    pub fn new(settings: &Settings) -> Self {
        let used = |channels: [usize; 2]| {
            let mut blocks: Vec<usize> = (0..2)
                .flat_map(|frame| settings.mode.subsamples(frame))
                .flat_map(|subsample| channels.map(|channel| subsample.blocks[channel]))
                .collect();
            blocks.sort_unstable();
            blocks.dedup();
            blocks
        };
        let (orthogonal_blocks, diagonal_blocks) = (used([0, 1]), used([2, 3]));
        let (_, longest) = super::settings::search_limits(settings);
        let areas = if settings.mode == Mode::Mlaa {
            AreaTable::mlaa(&mlaa_area_texture())
        } else if settings.patterns == Patterns::Published {
            AreaTable::smaa(&area_texture(), longest as usize, &orthogonal_blocks, &diagonal_blocks)
        } else {
            let steps = settings.diagonal_steps as usize;
            AreaTable::exact(longest as usize, steps, &orthogonal_blocks, &diagonal_blocks)
        };
        Self { areas, orthogonal_blocks, diagonal_blocks }
    }

    /// Places in `areas` of the blocks of a subsample of the same mode, in the same order; the last block is that of
    /// diagonals that fall to the right as seen from columns, where the sample lies on their other side.
    pub fn positions(&self, subsample: &Subsample) -> [usize; 5] {
        let place = |blocks: &[usize], block| blocks.iter().position(|&b| b == block).unwrap_or(0);
        let [left, top, rising, falling] = subsample.blocks;
        [
            place(&self.orthogonal_blocks, left),
            place(&self.orthogonal_blocks, top),
            place(&self.diagonal_blocks, rising),
            place(&self.diagonal_blocks, falling),
            place(&self.diagonal_blocks, OPPOSITE_DIAGONAL_OFFSET[falling]),
        ]
    }
}
