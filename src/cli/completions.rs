//! `completions`: what a shell needs to complete coilwright's commands.

use clap::CommandFactory;
use clap_complete::Shell;

use super::screen::Screen;
use super::{Cli, CliError, Ending};
use crate::io::json::CompletionsJson;

/// Completions for a shell, on stdout
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  coilwright completions bash > ~/.local/share/bash-completion/completions/coilwright"
)]
pub(crate) struct Arguments {
    #[arg(value_enum)]
    shell: Shell,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command(), "coilwright", &mut script);
    let script = String::from_utf8_lossy(&script).into_owned();
    let shell = arguments.shell.to_string();
    if screen.is_json() {
        screen.answer(CompletionsJson { shell, script }, |_| String::new())?;
    } else {
        screen.own(&script)?;
    }
    Ok(Ending::Done)
}
