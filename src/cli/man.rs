//! `man`: the manual pages, one a command.

use std::path::PathBuf;

use clap::CommandFactory;
use clap_mangen::Man;

use super::screen::Screen;
use super::{Cli, CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::json::WrittenJson;

/// Write the manual pages into a folder
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  coilwright man -o ~/.local/share/man/man1")]
pub(crate) struct Arguments {
    /// The folder
    #[arg(long, short, value_name = "DIR", default_value = "man")]
    output: PathBuf,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let mut root = Cli::command();
    root.build();
    let mut files = Vec::new();
    for command in std::iter::once(&root).chain(root.get_subcommands()) {
        if command.is_hide_set() || command.get_name() == "help" {
            continue;
        }
        let title = if command.get_name() == "coilwright" {
            "coilwright".to_owned()
        } else {
            format!("coilwright-{}", command.get_name())
        };
        let mut page = Vec::new();
        Man::new(command.clone().display_name(title.clone())).render(&mut page).map_err(CliError::Stdout)?;
        let path = arguments.output.join(format!("{title}.1"));
        write_atomically(&path, &page)?;
        files.push(path.display().to_string());
    }
    screen.note(&format!("wrote {} pages to {}", files.len(), arguments.output.display()));
    screen.answer(WrittenJson { files }, |_| String::new())?;
    Ok(Ending::Done)
}
