//! `rubor schema`: JSON schemas for editors.

use clap::ValueEnum;
use rubor::manifest::Manifest;
use rubor::{Job, Outcome, Report};
use rubor_renderer::settings::Settings;

use super::print_json;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// File that the schema describes
    of: Kind,
}

#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    /// Contents and settings of a run: job.json
    Job,
    /// How frames are made: `settings` in job.json and stats.json
    Settings,
    /// Expressions and states: rig.json
    Rig,
    /// Tracks, camera and lights: sequence.json
    Sequence,
    /// Measurements of a job, a benchmark, a chart or a gallery: stats.json and --json
    Report,
    /// Files of a run with their checksums: manifest.json
    Manifest,
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    print_json(&match arguments.of {
        Kind::Job => Job::json_schema_value(),
        Kind::Settings => schemars::schema_for!(Settings).to_value(),
        Kind::Rig => rubor_rig::expression::rig_schema(),
        Kind::Sequence => rubor_rig::timeline::sequence_schema(),
        Kind::Report => Report::json_schema_value(),
        Kind::Manifest => Manifest::json_schema_value(),
    })
}
