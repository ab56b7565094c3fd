//! How long work tells what it is doing.

use crate::notes::Note;

/// Hears of the progress of long work, on the thread that called it. The unit type hears nothing.
pub trait Watch {
    /// Work of `total` steps starts; `what` is a plural such as `frames`.
    fn begin(&mut self, what: &'static str, total: u64) {
        let _ = (what, total);
    }

    /// One more step is done.
    fn step(&mut self) {}

    /// The work that was begun has ended.
    fn end(&mut self) {}

    /// Remarks, as soon as they are known; reports hold them too.
    fn notes(&mut self, notes: &[Note]) {
        let _ = notes;
    }
}

impl Watch for () {}
