//! What several files of tests need.

use std::io::Write;

/// Whether there is an adapter; if not, that is said loudly, and is a fault where `RUBOR_REQUIRE_GPU` is set.
pub(crate) fn can_draw() -> bool {
    let found = !rubor::studio::adapters().is_empty();
    assert!(found || std::env::var_os("RUBOR_REQUIRE_GPU").is_none(), "RUBOR_REQUIRE_GPU is set: no adapter");
    if !found {
        writeln!(std::io::stderr(), "SKIPPED: no graphics adapter").expect("stderr is open");
    }
    found
}
