//! `rubor adapters`: what can draw here.

use crate::failure::{Failure, Outcome};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let found = rubor_renderer::list_adapters();
    if arguments.json {
        let text = serde_json::to_string_pretty(&found).map_err(Failure::job)?;
        println!("{text}");
        return Ok(());
    }
    if found.is_empty() {
        return Err(rubor_renderer::RenderError::NoAdapter.into());
    }
    for a in found {
        let timing = if a.has_timestamps { "times passes" } else { "no pass times" };
        println!(
            "{}: {} ({}, {}, {}), images up to {} pixels, {timing}",
            a.index, a.name, a.kind, a.backend, a.driver, a.max_image_size
        );
    }
    Ok(())
}
