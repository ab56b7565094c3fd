//! Files to heads.

pub mod gltf;
pub mod makehuman;
pub mod materials;
pub mod obj;
