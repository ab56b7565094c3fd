//! Draws the state of a face.

pub mod passes;
