//! Morphological antialiasing.

pub mod lookups;
