//! `extend`: a model file with one more effect, fitted to records.

use std::path::PathBuf;

use super::diagnose::remarks;
use super::records::{GrossErrors, Noticed, RecordArguments, read_noticed};
use super::schedule::pattern_of;
use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::compare::compare;
use crate::diagnose::{self, Finding, Request};
use crate::effect::custom::{Formula, FormulaError};
use crate::effect::{CUSTOM, DeclaredEffect};
use crate::io::fault::{Fault, Faults};
use crate::io::files::write_atomically;
use crate::io::json::comparison::{CompareJson, PartJson, RecordComparisonJson};
use crate::io::json::diagnosis::{ExtendJson, FindingJson};
use crate::io::json::inputs::{InputsJson, RecordInputJson};
use crate::io::model::ModelFile;
use crate::io::read::effect_tables::channel_fault;
use crate::io::read::model_file::read_model;
use crate::io::write::model_edit::with_effect;
use crate::rate::CoilModel;
use crate::record::Record;
use crate::report::diagnosis::value_in_words;
use crate::text::sink::Line;

/// Adds an effect to a model file, fitted to records; comments and layout of the file are kept
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright extend coil.toml --effect spool_mass --fit calibration.csv -o coil-2.toml\n  coilwright extend coil.toml --effect custom --formula \"a * dT_dt^2\" --parameter a=0.1 --fit calibration.csv -o coil-2.toml"
)]
pub struct Arguments {
    /// The model file
    model: PathBuf,
    /// The effect's name in files, such as strain_mismatch or channel:supply_v; `custom` takes --formula
    #[arg(long, value_name = "KIND")]
    effect: String,
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
    #[arg(long, short, value_name = "PATTERN")]
    pattern: Option<String>,
    #[command(flatten)]
    reading: RecordArguments,
}

fn named_value(stated: &str) -> Result<(String, f64), String> {
    let (name, value) = stated.split_once('=').ok_or("expected NAME=VALUE")?;
    let value: f64 = value.trim().parse().map_err(|_| format!("{value:?} is no number"))?;
    if value.is_finite() { Ok((name.trim().to_owned(), value)) } else { Err(format!("{value} is not finite")) }
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let format = arguments.reading.format(Some(&file))?;
    let named = pattern_of(&file, arguments.pattern.as_deref())?;
    let wanted = wanted(arguments, &file)?;
    let mut given: Vec<(Noticed, RecordInputJson)> = Vec::new();
    for (paths, role) in [(&arguments.fit, "fitted"), (&arguments.holdout, "held out")] {
        for path in paths {
            let noticed = read_noticed(path, GrossErrors::Drop, &format, Some(&file), screen)?;
            let names: Vec<String> = noticed.record.channels().iter().map(|c| c.name.clone()).collect();
            let mut columns = file.model.missing_channels(&names);
            columns.extend(wanted.channels().into_iter().filter(|c| !names.contains(c)));
            if !columns.is_empty() {
                return Err(CliError::ColumnsMissing { file: path.display().to_string(), columns });
            }
            given.push((noticed, RecordInputJson::new(path, role)?));
        }
    }
    let records: Vec<Record> = given[..arguments.fit.len()].iter().map(|(n, _)| n.record.clone()).collect();
    let (finding, extended) = if records.is_empty() {
        let mut model = file.model.clone();
        model.effects.retain(|e| e.kind() != wanted.kind());
        model.effects.push(wanted.clone());
        (Finding::unfitted(wanted), model)
    } else {
        let request = Request { model: &file.model, pattern: &named.pattern, records: &records, holdout: &[] };
        let extension = diagnose::extend(&request, &wanted)?;
        (extension.finding, extension.extended)
    };
    let compared = |model: &CoilModel| -> Result<CompareJson, CliError> {
        let mut shown = Vec::with_capacity(given.len());
        for (noticed, input) in &given {
            let record = &noticed.record;
            let found = compare(model, &named.pattern, record)?;
            let gross_errors = noticed.gross_errors.clone();
            shown.push(RecordComparisonJson::new(&input.file, &found, gross_errors, noticed.gaps));
        }
        let inputs = given.iter().map(|(_, input)| input.clone()).collect();
        Ok(CompareJson::new(&model.name, &named.name, shown, InputsJson::new(Some(&file), inputs)))
    };
    let (before, after) = (compared(&file.model)?, compared(&extended)?);
    let effect = FindingJson::new(&finding);
    let remarks = remarks(&effect);
    let source = with_effect(&arguments.model.display().to_string(), &file.source, &finding.effect, &remarks)?;
    write_atomically(&arguments.output, source.as_bytes())?;
    let body = ExtendJson { written: arguments.output.display().to_string(), effect, before, after };
    screen.answer(body, text)?;
    Ok(Ending::Done)
}

/// The effect that was asked for, at its start.
fn wanted(arguments: &Arguments, file: &ModelFile) -> Result<DeclaredEffect, CliError> {
    if arguments.effect == CUSTOM.kind {
        let Some(formula) = &arguments.formula else { return Err(CliError::FormulaMissing) };
        let names = arguments.parameter.iter().map(|(name, _)| name.clone()).collect();
        let formula = Formula::new(formula, names).map_err(|error| {
            let at = match &error {
                FormulaError::Expression(error) => error.at(),
                _ => None,
            };
            // At the end of the text there is no character to mark: the last one is.
            let at = at.map(|at| at.start.min(formula.len().saturating_sub(1))..at.end.min(formula.len()));
            Faults::one("--formula", formula.as_str(), Fault::new(error.to_string(), at))
        })?;
        let values = arguments.parameter.iter().map(|(_, value)| *value).collect();
        return Ok(DeclaredEffect::custom(formula, values)?);
    }
    if let Some(channel) = arguments.effect.strip_prefix("channel:") {
        return match channel_fault(channel) {
            Some(message) => Err(CliError::Option { option: "--effect", message }),
            None => Ok(DeclaredEffect::channel(channel, 0.0)),
        };
    }
    let declared = file.model.effects.iter().find(|e| e.kind() == arguments.effect);
    match (crate::effect::find(&arguments.effect), declared) {
        (Some(_), Some(declared)) => Ok(declared.clone()),
        (Some(spec), None) => Ok(DeclaredEffect::at_start(spec)),
        (None, _) => Err(super::effects::unknown(&arguments.effect)),
    }
}

fn text(body: &ExtendJson) -> String {
    let mut text = format!("wrote {}\n{}\n", Line::of(&body.written), body.effect.kind);
    for (key, parameter) in &body.effect.parameters {
        text += &format!("  {key} = {}\n", value_in_words(parameter));
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
