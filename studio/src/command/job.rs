//! `rubor job`: a job and its template for farms that speak Open Job Description.

use std::path::PathBuf;

use rubor::{Outcome, farm};

use super::render::{Changes, Contents};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    contents: Contents,
    /// Template to write (.yaml); the job goes beside it, into a file that ends in .json
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Frames of a task [default: 10, more where there would be over 1024 tasks]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    chunk: Option<u32>,
    #[command(flatten)]
    changes: Changes,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let (job, heads) = arguments.contents.job(&arguments.changes)?;
    let written = farm::write(&job, &heads, arguments.chunk, &arguments.output)?;
    say!("{} frames in {} tasks: {}", written.frames, written.tasks, arguments.output.display());
    Ok(())
}
