//! The `rubor` command.
fn main() {}
