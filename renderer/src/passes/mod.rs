//! The passes of a frame, one folder each.

pub mod antialias;
