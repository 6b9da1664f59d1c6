//! `verify`: whether a schedule, a traveller or a machine program is right for a coil.

use std::path::PathBuf;

use super::screen::Screen;
use super::{CliError, Ending};
use crate::io::read::model_file::read_design;
use crate::io::read::schedule_reader::read_claim;
use crate::task::verify::{Answer, Request, run as verify};
use crate::text::sink::Line;

/// Checks an emitted file against the coil with code of its own: all violations at once
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  coilwright verify examples/paper-200m.toml results/paper-200m/schedule.csv\n\nThe answer ends with what was worked out again and what was taken as given. Exit code 1 if anything is violated."
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// A schedule, traveller or machine program, as JSON, CSV, HTML or G-code
    schedule: PathBuf,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_design(&arguments.model)?;
    let claim = read_claim(&arguments.schedule)?;
    let claim_name = arguments.schedule.display().to_string();
    let Answer { document: body, profiles } = verify(&Request { model: &file, claim: &claim, claim_name: &claim_name });
    let clean = body.violations.is_empty();
    screen.answer(body, |body| {
        let mut text: String = body.violations.iter().map(|v| format!("{}\n", Line::of(&v.message))).collect();
        let rate = match body.independent_worst_rate_deg_per_h {
            Some(rate) => format!("; an independent solution finds a worst rate error of {rate:.4} °/h"),
            None => format!("; rate error: {}", body.rate_check),
        };
        let count = match body.violations.len() {
            0 => "no violations".to_owned(),
            1 => "1 violation".to_owned(),
            n => format!("{n} violations"),
        };
        text.push_str(&format!("{}: {count} in {} checks{rate}\n", Line::of(&body.schedule), body.checks));
        let listed = |items: &[&str]| items.iter().map(|item| format!("  {item}\n")).collect::<String>();
        text.push_str(&format!("worked out again:\n{}", listed(&body.recomputed)));
        if let Some(tolerance) = body.rate_tolerance_deg_per_h {
            let of_profiles = if profiles == 1 { "1 profile".to_owned() } else { format!("{profiles} profiles") };
            text.push_str(&format!("  (over {of_profiles}, compared to ±{tolerance:.1e} °/h)\n"));
        }
        text.push_str(&format!("taken as given:\n{}", listed(&body.taken_as_given)));
        text
    })?;
    Ok(if clean { Ending::Done } else { Ending::No })
}
