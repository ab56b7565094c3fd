//! The `rubor` command: see the `rubor` library for what does the work.

use std::process::ExitCode;

mod command;

fn main() -> ExitCode {
    command::without_desktop_noise();
    command::run()
}
