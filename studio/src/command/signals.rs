//! Ctrl-C and a request to end: the run finishes its frame and says how to go on; asked a second time, it ends at once.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rubor::{Failure, Outcome, Stop};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// A wish to stop that signals set.
pub(crate) fn watched() -> Outcome<Stop> {
    let failed = |e: std::io::Error| Failure::job(format!("signals cannot be watched: {e}"));
    let stop = Stop::default();
    for signal in [SIGINT, SIGTERM] {
        let asked_before = Arc::new(AtomicBool::new(false));
        // Handlers run in this order: the first signal finds no earlier one.
        flag::register_conditional_shutdown(signal, 128 + signal, asked_before.clone()).map_err(failed)?;
        flag::register(signal, asked_before).map_err(failed)?;
        flag::register_usize(signal, stop.number(), signal as usize).map_err(failed)?;
    }
    Ok(stop)
}
