//! `rubor gallery`: one page of pictures of a head, the expressions, the lights and the characters.

use std::path::PathBuf;

use rubor::{Outcome, Report, Watch, gallery, output};

use super::console::Progress;
use super::print_json;
use super::settings_flags::{Purpose, SettingsFlags};

/// Name of the page in the output folder.
const PAGE_FILE: &str = "gallery.jpg";

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// MakeHuman data (see `rubor import makehuman`): adds a row of all characters
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Folder for the page; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Graphics adapter: its number or a part of its name (see `rubor adapters`)
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Print the contents of the page as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    settings: SettingsFlags<Pictures>,
}

#[derive(Clone, Debug)]
struct Pictures;
impl Purpose for Pictures {
    const DEFAULTS: &[(&str, &str)] = &[("size", "320x320")];
}

pub(crate) fn run(arguments: &Arguments) -> Outcome {
    let settings = arguments.settings.settings(None)?;
    let mut studio = super::open_studio(arguments.adapter.as_deref())?;
    output::folder(&arguments.output)?;
    let mut progress = Progress::default();
    let drawn = gallery::run(&mut studio, &settings, arguments.data.as_deref(), &mut progress);
    progress.end();
    let (page, mut report) = drawn?;
    let path = arguments.output.join(PAGE_FILE);
    gallery::save(&path, &page)?;
    report.page = Some(path.clone());
    if arguments.json {
        return print_json(&Report::Gallery(report));
    }
    say!("{} pictures on {}", report.pictures.len(), path.display());
    Ok(())
}
