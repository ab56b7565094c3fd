//! The surface: deformed points, tangent frames, visibility from lights and camera, motion, data for other programs.

pub(crate) mod morph;
pub(crate) mod raster;
pub(crate) mod shadow;
pub(crate) mod surface_data;
pub(crate) mod tangent_frames;
pub(crate) mod velocity;
pub(crate) mod visibility;
