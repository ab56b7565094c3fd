//! `rubor demo`: renders the demo sequence on the built-in head.

use rubor::Outcome;

use super::render::Shared;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    shared: Shared,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    arguments.shared.demo()
}
