//! `verify`: whether a schedule, a traveller or a machine program is right for a coil.

use std::path::PathBuf;

use super::screen::Screen;
use super::{CliError, Ending};
use crate::io::files::sha256_hex;
use crate::io::json::{VerifyJson, ViolationJson};
use crate::io::read::model_file::read_model;
use crate::io::read::schedule_reader::{read_claim, shop_of};
use crate::report::page::assets;
use crate::text::sink::Line;
use crate::units::deg_per_h_from_rad_per_s;
use crate::verify::{RateCheck, Truth, verify};

/// Checks an emitted file against the coil with code of its own: all violations at once
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  coilwright verify examples/paper-200m.toml results/paper-200m/schedule.csv\n\nThe answer ends with what was worked out again and what was taken as given. Exit code 1 if anything is violated."
)]
pub struct Arguments {
    /// The model file
    model: PathBuf,
    /// A schedule, traveller or machine program, as JSON, CSV, HTML or G-code
    schedule: PathBuf,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let claim = read_claim(&arguments.schedule)?;
    let truth = Truth {
        model: &file.model,
        profiles: &file.profiles,
        model_sha256: &sha256_hex(&file.source),
        shop: &shop_of(&file.production),
        assets: &assets(),
    };
    let found = verify(&truth, &claim);
    let clean = found.violations.is_empty();
    let deg_per_h = deg_per_h_from_rad_per_s;
    let (rate_check, worst, tolerance, finer, profiles) = match found.rate_check {
        RateCheck::None => ("not claimed or not possible", None, None, None, 0),
        RateCheck::Independent { worst_rad_per_s, tolerance_rad_per_s, finer_rad_per_s, profiles } => (
            "independent solution",
            Some(deg_per_h(worst_rad_per_s)),
            Some(deg_per_h(tolerance_rad_per_s)),
            finer_rad_per_s.map(deg_per_h),
            profiles,
        ),
    };
    let body = VerifyJson {
        model: arguments.model.display().to_string(),
        schedule: arguments.schedule.display().to_string(),
        checks: found.checks,
        rate_check: rate_check.to_owned(),
        independent_worst_rate_deg_per_h: worst,
        rate_tolerance_deg_per_h: tolerance,
        finer_worst_rate_deg_per_h: finer,
        recomputed: found.recomputed,
        taken_as_given: found.taken_as_given,
        violations: found
            .violations
            .iter()
            .map(|v| ViolationJson {
                row: v.row,
                field: v.field.clone(),
                expected: v.expected.clone(),
                found: v.found.clone(),
                remedy: v.remedy.to_owned(),
                message: v.to_string(),
            })
            .collect(),
    };
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
            let finer = body.finer_worst_rate_deg_per_h.map_or(String::new(), |finer| {
                format!("; a finer heat network gives {finer:.4} °/h for the same winding")
            });
            text.push_str(&format!("  (over {of_profiles}, compared to ±{tolerance:.1e} °/h{finer})\n"));
        }
        text.push_str(&format!("taken as given:\n{}", listed(&body.taken_as_given)));
        text
    })?;
    Ok(if clean { Ending::Done } else { Ending::No })
}
