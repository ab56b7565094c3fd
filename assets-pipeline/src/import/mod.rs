//! Files to heads.

pub(crate) mod eye_projection;
pub mod gltf;
pub mod makehuman;
pub mod materials;
pub mod obj;
pub mod obj_set;
mod tiles;
