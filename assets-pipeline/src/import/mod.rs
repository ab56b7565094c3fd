//! Files to heads.

pub mod capture;
pub(crate) mod eye_projection;
pub mod gltf;
pub mod makehuman;
pub mod materials;
pub mod obj;
mod obj_match;
pub mod obj_set;
mod tiles;
pub mod usda;
