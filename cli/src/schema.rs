//! `rubor schema`: JSON schemas for editors.

use clap::ValueEnum;

use crate::failure::{Failure, Outcome};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Which file the schema is for
    of: Kind,
}

#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    /// Expressions and states: rig.json
    Rig,
    /// Tracks, camera and lights: sequence.json
    Sequence,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let schema = match arguments.of {
        Kind::Rig => rubor_rig::expression::rig_schema(),
        Kind::Sequence => rubor_rig::timeline::sequence_schema(),
    };
    println!("{}", serde_json::to_string_pretty(&schema).map_err(Failure::job)?);
    Ok(())
}
