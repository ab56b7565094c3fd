//! `rubor demo`: the main job on the built-in head.

use crate::failure::Outcome;
use crate::{inputs, sequence_job};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    job: sequence_job::Arguments,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let head = inputs::head(None)?;
    let job = sequence_job::Job {
        rig: inputs::rig(None, head.rig.clone())?,
        sequence: inputs::sequence(None)?,
        heads: vec![head],
    };
    sequence_job::run(job, &arguments.job)
}
