//! Tests and benchmarks across the crates.
//!
//! ```text
//! actual picture, reference --picture::Difference::between--> largest difference, FLIP --Tolerance::allows--> verdict
//! ```

use std::io::Write;

pub mod picture;
pub mod tolerance;

/// Whether there is an adapter; if not, that is said loudly, and is a fault where `RUBOR_REQUIRE_GPU` is set.
///
/// # Panics
/// There is none, and the variable is set.
pub fn can_draw() -> bool {
    let found = !rubor::studio::adapters().is_empty();
    assert!(found || std::env::var_os("RUBOR_REQUIRE_GPU").is_none(), "RUBOR_REQUIRE_GPU is set: no adapter");
    if !found {
        // What a passing test prints is hidden; this is not.
        let _ = writeln!(std::io::stderr(), "SKIPPED: no graphics adapter");
    }
    found
}
