//! The `rubor` command: the work is in the `rubor` library.

use std::process::ExitCode;

mod command;

fn main() -> ExitCode {
    command::without_desktop_noise();
    command::run()
}
