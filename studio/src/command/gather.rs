//! `rubor gather`: the frames of chunks that other runs drew become one run, with its video, sheet and head.

use std::path::PathBuf;

use rubor::{Job, Outcome};

use super::render::Results;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Job (.json) that the chunks are parts of
    #[arg(long, value_name = "FILE")]
    job: PathBuf,
    /// Folder whose folders are runs of parts of the job (`rubor render --frames`)
    #[arg(value_name = "CHUNKS")]
    chunks: PathBuf,
    #[command(flatten)]
    results: Results,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let mut job = Job::read(&arguments.job, None)?;
    let heads = job.load_heads()?;
    job.seal(&heads)?;
    arguments.results.make(&job, &heads, true, Some(arguments.chunks.clone()))
}
