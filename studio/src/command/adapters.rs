//! `rubor adapters`: lists the graphics adapters of this machine.

use rubor::{Outcome, studio};

use super::print_json;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let found = studio::adapters();
    if arguments.json {
        return print_json(&found);
    }
    if found.is_empty() {
        return Err(rubor_renderer::RenderError::NoAdapter.into());
    }
    for a in found {
        let timing = if a.has_timestamps { "times passes" } else { "no pass times" };
        say!(
            "{}: {} ({}, {}, {}), images up to {} pixels, {timing}",
            a.index,
            a.name,
            a.kind,
            a.backend,
            a.driver,
            a.max_image_size
        );
    }
    Ok(())
}
