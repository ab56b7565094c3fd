//! Files to heads and back.

pub mod synthesize;
