//! Files to heads and back.
//!
//! ```text
//! OBJ set ---------+                                        +--> .glb (one file, any glTF viewer opens it)
//! glTF / GLB ------+--> import --> Head --> convert --------+
//! MakeHuman data --+                (occlusion)             +--> animated .glb
//! ```

pub mod convert;
pub mod error;
pub mod export;
pub mod facial_appearance;
pub mod import;
pub mod poly;
pub mod synthesize;
