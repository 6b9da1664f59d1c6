//! `trim`: from measured ramps what to cut at which end of the fibre.

use std::path::PathBuf;

use super::pattern_asked::pattern_asked;
use super::records::RecordArguments;
use super::screen::Screen;
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::json::trim::TrimJson;
use crate::io::read::model_file::read_model;
use crate::task::trim::{Request, run as trim};

/// Effective asymmetric length of a wound coil from measured ramps: what to cut, at which end, and what is then left
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  coilwright trim coil.toml ramp.csv")]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// Records (CSV) with at least one ramp
    #[arg(required = true)]
    records: Vec<PathBuf>,
    /// A winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Option<String>,
    #[command(flatten)]
    reading: RecordArguments,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let pattern = pattern_asked(&file, arguments.pattern.as_deref())?;
    let records = arguments.reading.read(&arguments.records, Some(&file))?;
    let request = Request { model: &file, pattern: pattern.as_ref(), records: &records };
    let body = trim(&request, &Watching::quiet(screen))?;
    screen.answer(body, text)?;
    Ok(Ending::Done)
}

fn text(body: &TrimJson) -> String {
    let error = |e: Option<f64>, digits: usize| e.map_or_else(String::new, |e| format!(" ± {e:.digits$}"));
    let length = &body.asymmetric_length_m;
    let doubt = if body.is_significant {
        ""
    } else {
        "; no more than its error allows: measure a steeper or longer ramp first"
    };
    let larger = if body.predicted_rate_deg_per_h > body.present_rate_deg_per_h {
        ": it grows, because what is left is the winding's own, which the surplus had balanced in part"
    } else {
        ""
    };
    let least = body.least.as_ref().map_or_else(String::new, |least| {
        format!(
            "smallest error     {:.4} °/h with {:.4} m cut at end {}, or {:.3} turns more at the other end: as far as one length balances the winding's own\n",
            least.rate_deg_per_h, least.cut_m, least.end, least.turns_at_other_end
        )
    });
    format!(
        "{} with {}\nasymmetric length  {:.4}{} m (surplus at end A where positive){doubt}\ncut                {:.4}{} m at end {}, or wind {:.3}{} turns more at the other end\n\
         largest rate error {:.4} °/h now, {:.4}{} °/h after the cut, under the same temperatures{larger}\n{least}",
        body.model,
        body.pattern,
        length.value,
        error(length.standard_error, 4),
        body.cut_m,
        error(length.standard_error, 4),
        body.end,
        body.turns_at_other_end,
        error(body.turns_at_other_end_standard_error, 3),
        body.present_rate_deg_per_h,
        body.predicted_rate_deg_per_h,
        error(body.predicted_rate_standard_error_deg_per_h, 4),
    )
}
