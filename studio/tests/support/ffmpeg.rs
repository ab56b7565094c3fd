//! What tests of videos need.

use std::io::Write;

/// Whether a program of ffmpeg is there; if not, that is said loudly.
pub(crate) fn has_program(name: &str) -> bool {
    let found = std::process::Command::new(name).arg("-version").output().is_ok_and(|o| o.status.success());
    if !found {
        writeln!(std::io::stderr(), "SKIPPED: no {name} on this machine").expect("stderr is open");
    }
    found
}
