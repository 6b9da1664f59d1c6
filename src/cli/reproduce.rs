//! `reproduce`: a publication's results, as printed beside as computed.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

use super::screen::{Screen, held, table};
use super::{CliError, Ending};
use crate::report::thesis2021 as thesis;
use crate::report::yan1998::{PaperReproductionJson, ReproductionFile, TABLE_HEAD, files, table_rows};
use crate::reproduce::{thesis2021, yan1998};
use crate::task;
use crate::text::sink::Line;

/// A publication's results, as printed beside as computed, with every discrepancy named
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright reproduce yan1998        writes results/yan1998/\n  coilwright reproduce thesis2021     writes results/thesis2021/"
)]
pub(crate) struct Arguments {
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
    /// A thesis (2021), chapter 3: drift over temperature and its compensation, on a record simulated from its numbers
    Thesis2021,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let folder = |name: &str| arguments.output.clone().unwrap_or_else(|| Path::new("results").join(name));
    match arguments.publication {
        Publication::Yan1998 => of_paper(&folder("yan1998"), screen),
        Publication::Thesis2021 => of_thesis(&folder("thesis2021"), screen),
    }
}

fn write(folder: &Path, files: &[ReproductionFile]) -> Result<Vec<String>, CliError> {
    let _held = held(folder, "reproduce")?;
    Ok(task::reproduce::write(folder, files)?)
}

fn of_thesis(folder: &Path, screen: &Screen) -> Result<Ending, CliError> {
    let reproduction = thesis2021::reproduce()?;
    let written = write(folder, &thesis::files(&reproduction, "coilwright reproduce thesis2021"))?;
    screen.answer(thesis::ThesisReproductionJson::new(&reproduction, written), |body| {
        let mut text = format!("{}\n\nThe record is {}.\n\n", thesis2021::TITLE, body.record);
        text += &table(&thesis::TABLE_HEAD, thesis::table_rows(&reproduction));
        text += "\nErrata: what is printed and what is used\n";
        text.extend(body.errata.iter().map(|e| format!("- {}: {}. Used: {}.\n", e.place, e.printed, e.used)));
        text += "\nWritten\n";
        text.extend(body.files.iter().map(|f| format!("  {f}\n")));
        text
    })?;
    Ok(Ending::Done)
}

fn of_paper(folder: &Path, screen: &Screen) -> Result<Ending, CliError> {
    let reproduction = yan1998::reproduce()?;
    let written = write(folder, &files(&reproduction, "coilwright reproduce yan1998"))?;
    screen.answer(PaperReproductionJson::new(&reproduction, written), |body| {
        let mut text = format!("{}\n\nTable 2, published beside computed\n", yan1998::TITLE);
        text += &table(&TABLE_HEAD, table_rows(&reproduction));
        text += "\nsym is Eq. (14), sym-text the winding that the text describes\n\nTable and equations\n";
        text.extend(body.discrepancies.iter().map(|d| format!("- {d}\n")));
        text += "\nErrata: what is printed and what is used\n";
        text.extend(body.errata.iter().map(|e| format!("- {}: {}. Used: {}.\n", e.place, e.printed, e.used)));
        text += "\nWritten\n";
        text.extend(body.files.iter().map(|f| format!("  {}\n", Line::of(f))));
        text
    })?;
    Ok(Ending::Done)
}
