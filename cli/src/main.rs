//! The `rubor` command.
//!
//! Each subcommand is one file: its arguments, its work, its report. What several share:
//! `inputs` (heads, rigs, sequences), `studio` (shots to scenes), `sequence_job` (frames of a sequence to a folder),
//! `output` (whole files or none), `failure` (messages and exit codes).

use std::process::ExitCode;

use clap::{Parser, Subcommand};

mod adapters;
mod antialias_method;
mod bench;
mod capture;
mod chart;
mod check;
mod compare;
mod contact_sheet;
mod demo;
mod export;
mod failure;
mod filter;
mod gallery;
mod import;
mod inputs;
mod inset;
mod kernel;
mod maps;
mod maya;
mod output;
mod profile;
mod progress;
mod render;
mod schema;
mod sequence_job;
mod studio;
mod video;
mod walks;

/// Faces whose skin changes colour and wrinkles as they act.
///
/// Exit codes: 0 done, 1 the job failed, 2 the input or the arguments are wrong.
#[derive(Parser)]
#[command(name = "rubor", version, max_term_width = 110)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render the built-in head through six expressions, blush, pallor and exercise
    Demo(demo::Arguments),
    /// Render a sequence to frames, a contact sheet, a video and an animated head
    Render(render::Arguments),
    /// Draw a page of views, expressions, lights and characters
    Gallery(gallery::Arguments),
    /// Make a head from other files
    Import(import::Arguments),
    /// Write an animated head for other programs: .glb, .usda
    Export(export::Arguments),
    /// Tell what is wrong with files, what has no effect, and why a wrinkle does not show
    Check(check::Arguments),
    /// Make the maps of a head: hemoglobin, chromophores, normals, transfer
    Maps(maps::MapsArgs),
    /// Maya ASCII scenes in and out
    Maya(maya::Arguments),
    /// Antialias images
    Filter(filter::Arguments),
    /// Measure how far two images or two folders of images are apart
    Compare(compare::Arguments),
    /// Chart the cost and the error of scattering methods
    Chart(chart::Arguments),
    /// Measure what each pass of a frame costs on the GPU
    Bench(bench::Arguments),
    /// Print a diffusion profile: R(r), Gaussians, transmittance
    Profile(profile::Arguments),
    /// Print a separable kernel of a profile
    Kernel(kernel::Arguments),
    /// List the graphics adapters of this machine
    Adapters(adapters::Arguments),
    /// Print the JSON schema of a rig or a sequence
    Schema(schema::Arguments),
}

fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Demo(a) => demo::run(&a),
        Command::Render(a) => render::run(&a),
        Command::Gallery(a) => gallery::run(&a),
        Command::Import(a) => import::run(&a),
        Command::Export(a) => export::run(&a),
        Command::Check(a) => check::run(&a),
        Command::Maya(a) => maya::run(&a),
        Command::Maps(a) => maps::run(&a),
        Command::Filter(a) => filter::run(&a),
        Command::Compare(a) => compare::run(&a),
        Command::Chart(a) => chart::run(&a),
        Command::Bench(a) => bench::run(&a),
        Command::Profile(a) => profile::run(&a),
        Command::Kernel(a) => kernel::run(&a),
        Command::Adapters(a) => adapters::run(&a),
        Command::Schema(a) => schema::run(&a),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::from(failure.code)
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        super::Arguments::command().debug_assert();
    }
}
