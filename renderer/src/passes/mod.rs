//! One folder a pass: `mod.rs` with its theory, parameters and recording, its kernels, its tests.

pub mod appearance;
pub mod compose;
pub mod display;
pub mod morph;
pub mod overlay;
pub mod scatter;
pub mod shade;
pub mod shadow;
pub mod surface_frames;
pub mod visibility;
