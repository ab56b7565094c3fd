//! One folder per pass: `mod.rs` with its theory, parameters and recording, its kernels, its CPU reference, its tests.

pub mod antialias;
pub(crate) mod appearance;
pub(crate) mod backdrop;
pub(crate) mod bounce;
pub(crate) mod compose;
pub(crate) mod diffusion;
pub(crate) mod display;
pub(crate) mod geometry;
pub(crate) mod hair;
pub(crate) mod lens;
pub(crate) mod resolve;
pub(crate) mod see_through;
pub(crate) mod shade;

/// Workgroups of a pass whose invocations compute the pixels of blocks.wesl, for an image of a size.
pub(crate) fn block_groups(size: [u32; 2]) -> [u32; 3] {
    const PIXELS: u32 = 16;
    [size[0].div_ceil(PIXELS), size[1].div_ceil(PIXELS), 1]
}

/// Workgroups of 8 x 8 invocations with one pixel each.
pub(crate) fn pixel_groups(size: [u32; 2]) -> [u32; 3] {
    [size[0].div_ceil(8), size[1].div_ceil(8), 1]
}
