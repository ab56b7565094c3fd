//! `rubor completions` and `rubor man`: what shells and `man` want to know.

use std::path::PathBuf;

use clap::CommandFactory;
use clap_complete::Shell;
use rubor::{Failure, Outcome, output};

#[derive(clap::Args)]
pub(crate) struct Completions {
    /// The shell
    shell: Shell,
}

#[derive(clap::Args)]
pub(crate) struct Man {
    /// Folder for rubor.1 and a page of each subcommand; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(crate) fn completions(arguments: &Completions) -> Outcome {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut super::Arguments::command(), "rubor", &mut script);
    say!("{}", String::from_utf8_lossy(&script).trim_end());
    Ok(())
}

pub(crate) fn man(arguments: &Man) -> Outcome {
    output::folder(&arguments.output)?;
    let mut all = super::Arguments::command().disable_help_subcommand(true);
    // Names of subcommands and their usage as a whole: `rubor maps transfer`.
    all.build();
    let mut open = vec![all];
    let mut count = 0;
    while let Some(command) = open.pop() {
        open.extend(command.get_subcommands().cloned());
        let name = command.get_display_name().unwrap_or("rubor").to_owned();
        let mut page = Vec::new();
        clap_mangen::Man::new(command).render(&mut page).map_err(Failure::job)?;
        output::write(&arguments.output.join(format!("{name}.1")), &page)?;
        count += 1;
    }
    say!("{count} pages in {}", arguments.output.display());
    Ok(())
}
