//! `rubor render`: a sequence on one head, or on several side by side.

use std::path::PathBuf;

use crate::failure::Outcome;
use crate::{inputs, sequence_job};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Head (.glb, .gltf); repeat for several side by side [default: the built-in head]
    #[arg(long, value_name = "FILE")]
    head: Vec<PathBuf>,
    /// Rig (.json) [default: the one in the head, else the six basic expressions for ARKit names]
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Sequence (.json) [default: the demo]
    #[arg(long, value_name = "FILE")]
    sequence: Option<PathBuf>,
    /// Light instead of the sequence's: three-point, window, backlit-ear, low-key, soft-box, sky, or a sequence file to take it from
    #[arg(long, value_name = "NAME|FILE")]
    lights: Option<String>,
    #[command(flatten)]
    job: sequence_job::Arguments,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let heads = if arguments.head.is_empty() {
        vec![inputs::head(None)?]
    } else {
        arguments.head.iter().map(|path| inputs::head(Some(path))).collect::<Outcome<_>>()?
    };
    let of_head = heads.first().and_then(|h| h.rig.clone());
    let mut sequence = inputs::sequence(arguments.sequence.as_deref())?;
    if let Some(lights) = &arguments.lights {
        sequence.relight(inputs::lights(lights)?);
    }
    let job = sequence_job::Job { rig: inputs::rig(arguments.rig.as_deref(), of_head)?, sequence, heads };
    sequence_job::run(job, &arguments.job)
}
