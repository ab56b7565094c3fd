//! Progress of long work: a bar on a terminal, plain lines elsewhere.

use std::io::IsTerminal;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

/// Progress over a known number of steps.
pub(crate) struct Progress {
    bar: Option<ProgressBar>,
    what: &'static str,
    total: u64,
    done: u64,
    started: Instant,
}

/// Plain lines over the whole work.
const LINES: u64 = 8;

impl Progress {
    /// `what` is a plural such as `frames`.
    pub(crate) fn new(what: &'static str, total: u64) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(total);
            let template = "{wide_bar} {pos}/{len} {msg}  {per_sec}  {eta} left";
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style);
            }
            bar.set_message(what);
            bar
        });
        Self { bar, what, total, done: 0, started: Instant::now() }
    }

    /// One more step is done.
    pub(crate) fn step(&mut self) {
        self.done += 1;
        if let Some(bar) = &self.bar {
            bar.inc(1);
            return;
        }
        let line = self.done * LINES / self.total.max(1) != (self.done - 1) * LINES / self.total.max(1);
        if line || self.done == self.total {
            let each_s = self.started.elapsed().as_secs_f64() / self.done as f64;
            let left_s = each_s * (self.total - self.done) as f64;
            eprintln!("{}/{} {}, {each_s:.2} s each, {left_s:.0} s left", self.done, self.total, self.what);
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}
