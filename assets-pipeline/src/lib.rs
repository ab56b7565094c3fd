//! Files to heads and back.

pub mod convert;
pub mod image_io;
