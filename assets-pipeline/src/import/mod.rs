//! Files to heads.

pub mod capture;
pub(crate) mod eye_projection;
pub mod file;
pub mod gltf;
pub mod makehuman;
pub mod materials;
mod mtl;
pub mod obj;
pub mod obj_file;
mod obj_match;
pub mod obj_set;
pub mod picture;
mod tiles;
pub mod usd;
mod usd_materials;
pub mod usda;
