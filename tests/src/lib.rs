//! Tests and benchmarks across the crates.
//!
//! ```text
//! actual picture, reference --picture::Difference::between--> largest difference, FLIP --Tolerance::allows--> verdict
//! ```

pub mod picture;
pub mod tolerance;
