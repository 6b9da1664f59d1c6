//! `extend`: a model file with one more effect, fitted to records.

use std::path::{Path, PathBuf};

use super::pattern_asked::pattern_asked;
use super::records::RecordArguments;
use super::screen::{Screen, table};
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::folder::check_file;
use crate::io::json::comparison::{PartJson, RecordComparisonJson};
use crate::io::json::extend::ExtendJson;
use crate::io::json::proposals::ProposalExtendJson;
use crate::io::read::model_file::read_model;
use crate::report::diagnosis::value_in_words;
use crate::task::extend::{Request, effect_of, run as extend};
use crate::task::proposal;
use crate::text::sink::Line;

/// Adds an effect to a model file, fitted to records; comments and layout of the file are kept
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright extend coil.toml --effect spool_mass --fit calibration.csv -o coil-2.toml\n  coilwright extend coil.toml --effect custom --formula \"a * dT_dt^2\" --parameter a=0.1 --fit calibration.csv -o coil-2.toml\n  coilwright extend coil.toml --proposal results/coil/diagnosis.json -o coil-2.toml"
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// The effect's name in files, such as strain_mismatch or channel:supply_v; `custom` takes --formula
    #[arg(long, value_name = "KIND", value_parser = offered::effects(), hide_possible_values = true, required_unless_present = "proposal")]
    effect: Option<String>,
    /// A diagnosis (JSON) whose listed effects and proposed terms are added, the latter as custom effects; with --fit they
    /// are fitted anew
    #[arg(long, value_name = "DIAGNOSIS", conflicts_with_all = ["effect", "formula", "parameter"])]
    proposal: Option<PathBuf>,
    /// A record to fit the effect to; may be repeated. Without it, the effect gets its start values
    #[arg(long, value_name = "RECORD")]
    fit: Vec<PathBuf>,
    /// A record to show before and after without fitting to it; may be repeated
    #[arg(long, value_name = "RECORD")]
    holdout: Vec<PathBuf>,
    /// The new model file
    #[arg(long, short, value_name = "NEW")]
    output: PathBuf,
    /// The formula of a custom effect [°/h]
    #[arg(long, value_name = "FORMULA")]
    formula: Option<String>,
    /// A parameter of the formula with its start value, NAME=VALUE; may be repeated
    #[arg(long, value_name = "NAME=VALUE", value_parser = named_value)]
    parameter: Vec<(String, f64)>,
    /// A winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Option<String>,
    #[command(flatten)]
    reading: RecordArguments,
}

fn named_value(stated: &str) -> Result<(String, f64), String> {
    let (name, value) = stated.split_once('=').ok_or("expected NAME=VALUE")?;
    let value: f64 = value.trim().parse().map_err(|_| format!("{value:?} is no number"))?;
    if value.is_finite() { Ok((name.trim().to_owned(), value)) } else { Err(format!("{value} is not finite")) }
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let further = arguments.fit.iter().chain(&arguments.holdout).chain(&arguments.proposal).map(PathBuf::as_path);
    check_file(&arguments.output, file.files().chain(further).chain(arguments.pattern.iter().map(Path::new)))?;
    let pattern = pattern_asked(&file, arguments.pattern.as_deref())?;
    let fit = arguments.reading.read(&arguments.fit, Some(&file))?;
    let holdout = arguments.reading.read(&arguments.holdout, Some(&file))?;
    if let Some(path) = &arguments.proposal {
        let proposed = proposal::read_proposal(path, &file)?;
        let (pattern, proposed) = (pattern.as_ref(), proposed.as_slice());
        let request = proposal::Request { model: &file, pattern, proposed, fit: &fit, holdout: &holdout };
        let answer = proposal::run(&request, &Watching::quiet(screen))?;
        answer.write(&arguments.output)?;
        screen.answer(answer.document(&arguments.output), text_of_proposal)?;
        return Ok(Ending::Done);
    }
    let kind = arguments.effect.as_deref().unwrap_or_default();
    let effect = effect_of(kind, arguments.formula.as_deref(), &arguments.parameter, &file)?;
    let request = Request { model: &file, pattern: pattern.as_ref(), effect, fit: &fit, holdout: &holdout };
    let answer = extend(&request, &Watching::quiet(screen))?;
    answer.write(&arguments.output)?;
    screen.answer(answer.document(&arguments.output), text)?;
    Ok(Ending::Done)
}

fn text_of_proposal(body: &ProposalExtendJson) -> String {
    let mut text = format!("wrote {}\n", Line::of(&body.written));
    for effect in &body.effects {
        text += &format!("{}\n", effect.kind);
        for (key, parameter) in &effect.parameters {
            text += &format!("  {key} = {}\n", value_in_words(parameter));
        }
    }
    let compared = body.before.records.iter().zip(&body.after.records);
    let rows = body.before.inputs.records.iter().zip(compared).map(|(input, (before, after))| {
        let mut row = vec![Line::of(&before.file).to_string(), input.role.clone()];
        row.extend(
            [before.rmse_deg_per_h, after.rmse_deg_per_h, after.noise_floor_deg_per_h].map(|v| format!("{v:.4}")),
        );
        row
    });
    text + &table(&["record", "role", "before °/h", "after °/h", "noise °/h"], rows)
}

fn text(body: &ExtendJson) -> String {
    let mut text = format!("wrote {}\n{}\n", Line::of(&body.written), body.effect.kind);
    for (key, parameter) in &body.effect.parameters {
        text += &format!("  {key} = {}\n", value_in_words(parameter));
    }
    if let Some(boundary) = &body.boundary {
        text += &format!("{}\n", boundary.words());
    }
    if body.before.inputs.records.iter().all(|r| r.role != "fitted") {
        text += "no record to fit to was given: the values are start values, not fitted ones\n";
    }
    for (input, (before, after)) in
        body.before.inputs.records.iter().zip(body.before.records.iter().zip(&body.after.records))
    {
        text += &format!(
            "\n{} ({}): error {:.4} -> {:.4} °/h, reduced chi-square {:.3} -> {:.3}, noise floor {:.4} °/h, {} -> {}\n",
            Line::of(&before.file),
            input.role,
            before.rmse_deg_per_h,
            after.rmse_deg_per_h,
            before.reduced_chi_square,
            after.reduced_chi_square,
            after.noise_floor_deg_per_h,
            before.verdict,
            after.verdict
        );
        text += &table(
            &["regime", "rows", "before °/h", "after °/h", "share before", "share after"],
            regimes(before, after),
        );
    }
    text
}

/// Both sides' regimes; which row belongs where may differ a little, as the boundary is estimated with the model.
fn regimes(before: &RecordComparisonJson, after: &RecordComparisonJson) -> Vec<Vec<String>> {
    let row = |part: &PartJson| {
        let other = after.regimes.iter().find(|p| p.name == part.name);
        let shown = |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
        vec![
            part.name.clone(),
            part.rows.to_string(),
            format!("{:.4}", part.rmse_deg_per_h),
            shown(other.map(|p| p.rmse_deg_per_h), 4),
            format!("{:.3}", part.share_of_squared_error),
            shown(other.map(|p| p.share_of_squared_error), 3),
        ]
    };
    before.regimes.iter().map(row).collect()
}
