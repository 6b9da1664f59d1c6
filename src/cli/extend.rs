//! `extend`: a model file with one more effect, fitted to records.

use std::path::PathBuf;

use super::diagnose::value_in_words;
use super::records::{GrossErrors, read_noticed};
use super::schedule::pattern_of;
use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::diagnose::{self, Finding, Request};
use crate::effect::custom::Formula;
use crate::effect::{CUSTOM, DeclaredEffect};
use crate::io::diagnosis_json::{AgreementJson, ExtendJson, FindingJson};
use crate::io::files::write_atomically;
use crate::io::model_edit::{Remark, with_effect};
use crate::io::model_file::{ModelFile, read_model};
use crate::predict::predict;
use crate::rate::CoilModel;
use crate::record::Record;

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
}

fn named_value(stated: &str) -> Result<(String, f64), String> {
    let (name, value) = stated.split_once('=').ok_or("expected NAME=VALUE")?;
    let value: f64 = value.trim().parse().map_err(|_| format!("{value:?} is no number"))?;
    if value.is_finite() { Ok((name.trim().to_owned(), value)) } else { Err(format!("{value} is not finite")) }
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let pattern = pattern_of(&file, arguments.pattern.as_deref())?.pattern;
    let wanted = wanted(arguments, &file)?;
    let records: Vec<Record> = arguments
        .fit
        .iter()
        .map(|path| Ok(read_noticed(path, GrossErrors::Drop, screen)?.record))
        .collect::<Result<_, CliError>>()?;
    let (finding, extended) = if records.is_empty() {
        let mut model = file.model.clone();
        model.effects.retain(|e| e.kind() != wanted.kind());
        model.effects.push(wanted.clone());
        (Finding::unfitted(wanted), model)
    } else {
        let request = Request { model: &file.model, pattern: &pattern, records: &records, holdout: &[] };
        let extension = diagnose::extend(&request, &wanted)?;
        (extension.finding, extension.extended)
    };
    let agreements = |model: &CoilModel| -> Result<Vec<AgreementJson>, CliError> {
        let of = |record: &Record| Ok(AgreementJson::new(record, &predict(model, &pattern, record)?));
        records.iter().map(of).collect()
    };
    let (before, after) = (agreements(&file.model)?, agreements(&extended)?);
    let effect = FindingJson::new(&finding);
    let remarks: Vec<Remark> = effect
        .parameters
        .iter()
        .filter(|(_, p)| p.fitted)
        .map(|(key, p)| Remark { key: key.clone(), text: value_in_words(p) })
        .collect();
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
        let formula = Formula::new(formula, names)?;
        let values = arguments.parameter.iter().map(|(_, value)| *value).collect();
        return Ok(DeclaredEffect::custom(formula, values)?);
    }
    if let Some(channel) = arguments.effect.strip_prefix("channel:") {
        return Ok(DeclaredEffect::channel(channel, 0.0));
    }
    let declared = file.model.effects.iter().find(|e| e.kind() == arguments.effect);
    match (crate::effect::find(&arguments.effect), declared) {
        (Some(_), Some(declared)) => Ok(declared.clone()),
        (Some(spec), None) => Ok(DeclaredEffect::at_start(spec)),
        (None, _) => Err(super::effects::unknown(&arguments.effect)),
    }
}

fn text(body: &ExtendJson) -> String {
    let mut text = format!("wrote {}\n{}\n", body.written, body.effect.kind);
    for (key, parameter) in &body.effect.parameters {
        text += &format!("  {key} = {}\n", value_in_words(parameter));
    }
    if body.before.is_empty() {
        return text + "no record was given: the values are start values, not fitted ones\n";
    }
    let rows = body.before.iter().zip(&body.after).map(|(before, after)| {
        vec![
            before.file.clone(),
            format!("{:.4}", before.rmse_deg_per_h),
            format!("{:.4}", after.rmse_deg_per_h),
            format!("{:.3}", before.reduced_chi_square),
            format!("{:.3}", after.reduced_chi_square),
            format!("{:.4}", before.noise_floor_deg_per_h),
        ]
    });
    text + &table(&["record", "before °/h", "after °/h", "χ² before", "χ² after", "noise °/h"], rows)
}
