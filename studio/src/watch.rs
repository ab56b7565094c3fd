//! Progress of long work.

use crate::notes::Note;

/// Receives the progress of long work, on the calling thread. The unit type ignores it.
pub trait Watch {
    /// Work of `total` steps starts; `what` is a plural such as `frames`.
    fn begin(&mut self, what: &'static str, total: u64) {
        let _ = (what, total);
    }

    /// One more step is done.
    fn step(&mut self) {}

    /// The work has ended.
    fn end(&mut self) {}

    /// Notes, as soon as they are known; reports contain them too.
    fn notes(&mut self, notes: &[Note]) {
        let _ = notes;
    }
}

impl Watch for () {}
