//! Files to heads.

pub mod makehuman;
pub mod obj;
