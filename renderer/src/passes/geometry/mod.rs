//! Where the surface is: deformed points, tangent frames, what lights and camera see of it, how it moves.

pub(crate) mod morph;
pub(crate) mod shadow;
pub(crate) mod tangent_frames;
pub(crate) mod velocity;
pub(crate) mod visibility;
