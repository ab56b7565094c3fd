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

/// Whether a program of ffmpeg is there; if not, that is said loudly.
#[allow(dead_code, reason = "only some files of tests make videos")]
pub(crate) fn has_program(name: &str) -> bool {
    let found = std::process::Command::new(name).arg("-version").output().is_ok_and(|o| o.status.success());
    if !found {
        writeln!(std::io::stderr(), "SKIPPED: no {name} on this machine").expect("stderr is open");
    }
    found
}
