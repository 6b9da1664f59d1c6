//! `reproduce`: a publication's results, as printed beside as computed.

use std::path::PathBuf;

use clap::ValueEnum;

use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::report::yan1998::{ReproductionJson, TABLE_HEAD, files, table_rows};
use crate::reproduce::yan1998::{TITLE, reproduce};

/// A publication's results, as printed beside as computed, with every discrepancy named
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  coilwright reproduce yan1998        writes results/yan1998/")]
pub struct Arguments {
    /// Which publication
    publication: Publication,
    /// Folder for tables and pictures [default: results/PUBLICATION]
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Publication {
    /// Yan, Lan, Jian, Acta Optica Sinica (1998): Table 2, Figs. 2 and 3
    Yan1998,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let Publication::Yan1998 = arguments.publication;
    let folder = arguments.output.clone().unwrap_or_else(|| PathBuf::from("results/yan1998"));
    let reproduction = reproduce()?;
    let mut written = Vec::new();
    for file in files(&reproduction, "coilwright reproduce yan1998") {
        let path = folder.join(&file.name);
        write_atomically(&path, file.contents.as_bytes())?;
        written.push(path.display().to_string());
    }
    screen.answer(ReproductionJson::new(&reproduction, written), |body| {
        let mut text = format!("{TITLE}\n\nTable 2, published beside computed\n");
        text += &table(&TABLE_HEAD, table_rows(&reproduction));
        text += "\nsym is Eq. (14), sym-text the winding that the text describes\n\nTable and equations\n";
        text.extend(body.discrepancies.iter().map(|d| format!("- {d}\n")));
        text += "\nErrata: what is printed and what is used\n";
        text.extend(body.errata.iter().map(|e| format!("- {}: {}. Used: {}.\n", e.place, e.printed, e.used)));
        text += "\nWritten\n";
        text.extend(body.files.iter().map(|f| format!("  {f}\n")));
        text
    })?;
    Ok(Ending::Done)
}
