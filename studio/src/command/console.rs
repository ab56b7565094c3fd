//! What the command prints: results on standard output, remarks, progress and errors on standard error.
//!
//! A closed pipe (`rubor check x | head`) is not an error: the command stops without a message.

use std::fmt::Arguments;
use std::io::{ErrorKind, IsTerminal, Write};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use rubor::notes::{Note, summed};
use rubor::{Failure, Outcome, Watch};

/// Prints a line of the result; returns from the function if the pipe is closed.
macro_rules! say {
    ($($text:tt)*) => { $crate::command::console::line(format_args!($($text)*))? };
}

/// A line on standard output.
pub(crate) fn line(text: Arguments<'_>) -> Outcome {
    let mut out = std::io::stdout().lock();
    out.write_fmt(text).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush()).map_err(|e| {
        match e.kind() {
            ErrorKind::BrokenPipe => Failure::closed_pipe(),
            _ => Failure::job(format!("standard output: cannot be written: {e}")),
        }
    })
}

/// A line on standard error. A closed standard error is ignored.
pub(crate) fn error_line(text: Arguments<'_>) {
    let mut out = std::io::stderr().lock();
    let _ = out.write_fmt(text).and_then(|()| out.write_all(b"\n"));
}

/// Prints remarks on standard error, one line per kind.
pub(crate) fn notes(notes: &[Note]) {
    for note in summed(notes) {
        error_line(format_args!("note: {note}"));
    }
}

/// Progress of long work: a bar on a terminal, plain lines elsewhere.
#[derive(Default)]
pub(crate) struct Progress {
    bar: Option<ProgressBar>,
    what: &'static str,
    total: u64,
    done: u64,
    started: Option<Instant>,
}

/// Number of plain lines over the whole work.
const LINES: u64 = 8;

impl Progress {
    /// Starts to show progress; `what` is a plural such as `frames`.
    pub(crate) fn new(what: &'static str, total: u64) -> Self {
        let mut progress = Self::default();
        progress.begin(what, total);
        progress
    }
}

impl Watch for Progress {
    fn begin(&mut self, what: &'static str, total: u64) {
        self.bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(total);
            let template = "{wide_bar} {pos}/{len} {msg}  {per_sec}  {eta} left";
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style);
            }
            bar.set_message(what);
            bar
        });
        (self.what, self.total, self.done, self.started) = (what, total, 0, Some(Instant::now()));
    }

    fn step(&mut self) {
        self.done += 1;
        if let Some(bar) = &self.bar {
            bar.inc(1);
            return;
        }
        let total = self.total.max(1);
        let is_due = self.done * LINES / total != (self.done - 1) * LINES / total;
        if is_due || self.done == self.total {
            let spent_s = self.started.map_or(0.0, |at| at.elapsed().as_secs_f64());
            let each_s = spent_s / self.done as f64;
            let left_s = each_s * self.total.saturating_sub(self.done) as f64;
            let (done, total, what) = (self.done, self.total, self.what);
            error_line(format_args!("{done}/{total} {what}, {each_s:.2} s each, {left_s:.0} s left"));
        }
    }

    fn end(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }

    fn notes(&mut self, found: &[Note]) {
        match &self.bar {
            Some(bar) => bar.suspend(|| notes(found)),
            None => notes(found),
        }
    }
}
