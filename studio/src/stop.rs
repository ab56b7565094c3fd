//! A wish to stop, from outside of a run: it finishes its frame and says how to go on.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of the signal that asks a run to stop; 0 is none. Clones are the same wish.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicUsize>);

impl Stop {
    /// Asks to stop.
    pub fn ask(&self, signal: u8) {
        self.0.store(usize::from(signal), Ordering::Relaxed);
    }

    /// The signal that asked to stop.
    pub fn asked(&self) -> Option<u8> {
        u8::try_from(self.0.load(Ordering::Relaxed)).ok().filter(|n| *n != 0)
    }

    /// The number itself, for handlers of signals.
    pub fn number(&self) -> Arc<AtomicUsize> {
        self.0.clone()
    }
}
