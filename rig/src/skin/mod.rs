//! Skin as a medium: its colour from chromophores.

pub mod chromophores;
