//! Each subcommand is one file: arguments in, a job or a report, text out.
//!
//! `settings_flags` makes the flags of all settings, `console` prints.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use rubor::cache::Cache;
use rubor::{Failure, Fault, Outcome, Studio};
use rubor_rig::limits::Limits;

#[macro_use]
mod console;

mod adapters;
mod bench;
mod budget;
mod capture;
mod chart;
mod check;
mod compare;
mod demo;
mod export;
mod filter;
mod fit;
mod gallery;
mod gather;
mod import;
mod job;
mod kernel;
mod manual;
mod maps;
mod maya;
mod profile;
mod render;
mod scan_maps;
mod schema;
mod settings_flags;
mod signals;
#[cfg(feature = "view")]
mod view;

/// Faces whose skin changes colour and wrinkles as they act.
///
/// Exit codes: 0 done, 1 the job failed, 2 the input or the arguments are wrong, 130 stopped by Ctrl-C.
#[derive(Parser)]
#[command(name = "rubor", version, max_term_width = 110)]
struct Arguments {
    /// Memory that files may ask for, such as 4G: limits on sizes, points, texels and values are parts of it [default:
    /// $RUBOR_LIMIT_MEMORY, else 2G]
    #[arg(long, global = true, value_name = "SIZE", help_heading = "Global options")]
    limit_memory: Option<Limits>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render the built-in head through six expressions, blush, pallor and exercise
    Demo(demo::Arguments),
    /// Render a sequence to frames, a review page, a contact sheet, a video and an animated head
    Render(render::Arguments),
    /// Open a window: pose, key and look at a face live, while its files are edited and weights arrive
    #[cfg(feature = "view")]
    View(view::Arguments),
    /// Draw a page of views, expressions, lights and characters
    Gallery(gallery::Arguments),
    /// Make a head from other files
    Import(import::Arguments),
    /// Write an animated head for other programs: .glb, .usda, .usdz
    Export(export::Arguments),
    /// Tell what is wrong with files, what has no effect, why a wrinkle does not show, and what sequences do not need (--budget)
    Check(check::Arguments),
    /// Make the maps of a head: hemoglobin, chromophores, normals, transfer
    Maps(maps::MapsArgs),
    /// Read and write Maya ASCII scenes
    Maya(maya::Arguments),
    /// Antialias images
    Filter(filter::Arguments),
    /// Measure how far two images or two folders of images are apart; show two runs on a page or in a video
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
    /// Write a job for many machines: an Open Job Description template
    Job(job::Arguments),
    /// Make one run of the frames of chunks
    Gather(gather::Arguments),
    /// Print the completions of a shell
    Completions(manual::Completions),
    /// Write manual pages
    Man(manual::Man),
    /// Print the JSON schema of a job, its settings, a rig, a sequence, a report or a manifest
    Schema(schema::Arguments),
}

/// Runs the command of this process.
pub(crate) fn run() -> ExitCode {
    let arguments = Arguments::parse();
    match arguments.limit_memory.map_or_else(Limits::of_variable, |limits| Ok(Some(limits))) {
        Ok(limits) => {
            limits.unwrap_or_default().set();
        }
        Err(message) => return report(Err(Failure::input(message))),
    }
    let outcome = match arguments.command {
        Command::Demo(a) => demo::run(&a),
        Command::Render(a) => render::run(&a),
        #[cfg(feature = "view")]
        Command::View(a) => view::run(&a),
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
        Command::Job(a) => job::run(&a),
        Command::Gather(a) => gather::run(&a),
        Command::Completions(a) => manual::completions(&a),
        Command::Man(a) => manual::man(&a),
        Command::Schema(a) => schema::run(&a),
    };
    report(outcome)
}

fn report(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if failure.fault() != Fault::ClosedPipe {
                console::error_line(format_args!("error: {failure}"));
            }
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Mesa's layer that chooses between several GPUs by the desktop session prints a warning on standard error if there is
/// no session. It can only be disabled by a variable that is set before the process starts, so the process starts once
/// more, as the same program with the same process id.
pub(crate) fn without_desktop_noise() {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::process::CommandExt;
        const SILENCE: &str = "NODEVICE_SELECT";
        let is_set = |name: &str| std::env::var_os(name).is_some_and(|v| !v.is_empty());
        if is_set("XDG_RUNTIME_DIR") || is_set(SILENCE) {
            return;
        }
        let mut arguments = std::env::args_os();
        let (name, Ok(program)) = (arguments.next().unwrap_or_default(), std::env::current_exe()) else {
            return;
        };
        // `exec` returns only if it fails; then the command continues with the warning.
        let _ = std::process::Command::new(program).arg0(name).args(arguments).env(SILENCE, "1").exec();
    }
}

/// A studio that keeps what takes long in the folder of the user.
fn open_studio(adapter: Option<&str>) -> Outcome<Studio> {
    let mut studio = Studio::open(adapter)?;
    studio.keep_in(Cache::of_user());
    Ok(studio)
}

/// JSON on standard output.
fn print_json(value: &impl serde::Serialize) -> Outcome {
    say!("{}", serde_json::to_string_pretty(value).map_err(Failure::job)?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        super::Arguments::command().debug_assert();
    }
}
