//! `new`: a commented model file to start from.

use std::path::PathBuf;

use super::screen::Screen;
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::json::WrittenJson;
use crate::io::write::model_template::template;

/// Write a commented model file to start from
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  coilwright new my-coil        writes my-coil.toml")]
pub(crate) struct Arguments {
    /// The coil's name, or the file's (with .toml)
    name: String,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let mut path = PathBuf::from(&arguments.name);
    if path.extension().is_none_or(|e| e != "toml") {
        path = PathBuf::from(format!("{}.toml", arguments.name));
    }
    if path.exists() {
        return Err(CliError::Exists { path: path.display().to_string() });
    }
    let coil = path.file_stem().map_or_else(|| "coil".to_owned(), |s| s.to_string_lossy().into_owned());
    write_atomically(&path, template(&coil).as_bytes())?;
    screen.note(&format!("wrote {}; next: coilwright check {0}", path.display()));
    screen.answer(WrittenJson { files: vec![path.display().to_string()] }, |_| String::new())?;
    Ok(Ending::Done)
}
