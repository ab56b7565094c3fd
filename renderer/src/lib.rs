//! Draws the state of a face.

pub mod error;
pub mod gpu;
pub mod passes;
