//! `diagnose`: which effect a model lacks, judged by records.

use std::path::{Path, PathBuf};

use super::records::{RecordArguments, read_remarked};
use super::report::{REPORT_FILE, write_report};
use super::schedule::pattern_of;
use super::screen::{Screen, held, table};
use super::{CliError, Ending};
use crate::compare::suspicion;
use crate::diagnose::experiment::{Chamber, design};
use crate::diagnose::{self, Diagnosis, Request};
use crate::effect;
use crate::io::files::write_atomically;
use crate::io::json::diagnosis::{DiagnosisJson, DiagnosisRow, FindingJson};
use crate::io::json::inputs::{InputsJson, RecordInputJson};
use crate::io::json::schedule::{RATE_DECIMALS, rounded};
use crate::io::model::ModelFile;
use crate::io::read::model_file::read_model;
use crate::io::read::profile_file::print_profile;
use crate::io::write::measurement_folder::{
    DIAGNOSIS_FILE, MODEL_FILE, before_and_after_name, check_free, write_document, write_table,
};
use crate::io::write::model_edit::{Remark, with_effect};
use crate::pattern::Pattern;
use crate::predict::{noise_floor_rad_per_s, predict};
use crate::rate::CoilModel;
use crate::record::Record;
use crate::report::diagnosis::{
    self, before_and_after_chart, explanations, noise_in_words, posterior_in_words, refitted_in_words, rest_in_words,
    value_in_words, verdict_in_words,
};
use crate::report::ladder::ladder_chart;
use crate::text::sink::TomlComment;
use crate::units::deg_per_h_from_rad_per_s;

/// Which piece of physics a model lacks: fits every known effect to records and says what is missing, and how sure
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright diagnose coil.toml calibration.csv --holdout validation.csv\n  coilwright diagnose coil.toml monday.csv tuesday.csv --format json --strict\n  coilwright diagnose coil.toml calibration.csv --holdout validation.csv -o results/coil --experiment next.toml\n\nExit code 1 with --strict if the model is not adequate."
)]
pub struct Arguments {
    /// The model file
    model: PathBuf,
    /// Records to fit (CSV)
    #[arg(required = true, value_name = "RECORD")]
    records: Vec<PathBuf>,
    /// A record that is only judged by; may be repeated
    #[arg(long, value_name = "RECORD")]
    holdout: Vec<PathBuf>,
    /// A winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN")]
    pattern: Option<String>,
    /// Ends with exit code 1 unless the model is adequate
    #[arg(long)]
    strict: bool,
    /// Writes diagnosis.json, the ladder, the extended model, residuals before and after, and report.html into this folder
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Writes the course of the chamber's air that would tell the candidates apart, and says how surely; for `evaluate
    /// --profiles` and `temperatures --profiles`
    #[arg(long, value_name = "FILE")]
    experiment: Option<PathBuf>,
    /// Seed of the profiles that the experiment is chosen from
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    reading: RecordArguments,
}

/// What was asked and found.
struct Found<'a> {
    pattern: &'a Pattern,
    records: &'a [Record],
    holdout: &'a [Record],
    diagnosis: &'a Diagnosis,
}

/// The diagnosis reports its progress in this many parts.
const PARTS: f64 = 100.0;

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let _held = arguments.output.as_deref().map(|folder| held(folder, "diagnose")).transpose()?;
    if let Some(folder) = &arguments.output {
        check_free(folder)?;
    }
    let format = arguments.reading.format(Some(&file))?;
    let pattern = pattern_of(&file, arguments.pattern.as_deref())?.pattern;
    // Gross errors are left out by the diagnosis itself, which says so.
    let read = |paths: &[PathBuf]| -> Result<Vec<_>, CliError> {
        paths.iter().map(|path| read_remarked(path, &format, Some(&file), screen)).collect()
    };
    let (records, holdout) = (read(&arguments.records)?, read(&arguments.holdout)?);
    let progress = screen.progress("diagnose", Some(PARTS as u64));
    let request = Request { model: &file.model, pattern: &pattern, records: &records, holdout: &holdout };
    let diagnosis = diagnose::diagnose(&request, &|share| progress.at((share * PARTS) as u64, ""))?;
    progress.finish();
    let mut inputs = Vec::new();
    for (paths, role) in [(&arguments.records, "fitted"), (&arguments.holdout, "held out")] {
        for path in paths {
            inputs.push(RecordInputJson::new(path, role)?);
        }
    }
    let wanted = arguments.output.is_some() || arguments.experiment.is_some();
    let all: Vec<&Record> = records.iter().chain(&holdout).collect();
    let experiment = match Chamber::of(&all).filter(|_| wanted && !diagnosis.effects.is_empty()) {
        Some(chamber) => design(&diagnose::contest(&request, &diagnosis)?, &pattern, &chamber, arguments.seed),
        None => None,
    };
    let holdout_noise = (!holdout.is_empty()).then(|| noise_of(&holdout));
    let inputs = InputsJson::new(Some(&file), inputs);
    let mut body = DiagnosisJson::new(&file.model.name, &diagnosis, holdout_noise, experiment.as_ref(), inputs);
    body.cautions.extend(suspicions(&file.model, &all, &diagnosis));
    if let Some(path) = &arguments.experiment {
        match (&experiment, &body.experiment) {
            (Some(found), Some(shown)) => {
                let first = format!("For {}: the chamber's air.", file.model.name);
                let remarks: Vec<TomlComment> =
                    [&first, &shown.statement].into_iter().chain(&shown.expectations).map(TomlComment::of).collect();
                write_atomically(path, print_profile(&found.profile, &remarks).as_bytes())?;
                screen.note(&format!("wrote {}", path.display()));
            }
            _ => screen.note("there is nothing to tell apart: no experiment was written"),
        }
    }
    if let Some(folder) = &arguments.output {
        let found = Found { pattern: &pattern, records: &records, holdout: &holdout, diagnosis: &diagnosis };
        write_folder(folder, &file, &body, &found)?;
        screen.note(&format!("wrote {}", folder.join(REPORT_FILE).display()));
    }
    let adequate = diagnosis.verdict == diagnose::Verdict::Adequate;
    screen.answer(body, text)?;
    Ok(if arguments.strict && !adequate { Ending::No } else { Ending::Done })
}

/// What the records and the fitted factors make one suspect.
fn suspicions(model: &CoilModel, records: &[&Record], diagnosis: &Diagnosis) -> Vec<String> {
    let factors = diagnosis.effects.iter().filter(|f| f.effect.is_at(effect::THERMO_OPTIC_FACTOR));
    let of_factors = factors.filter_map(|f| suspicion::of_factor(f.effect.values()[0]));
    let of_records = records.iter().flat_map(|record| suspicion::of_record(record, model.rate_mean_s));
    of_factors.chain(of_records).map(|s| s.to_string()).collect()
}

/// Root mean square of the records' noises, each by its rows.
fn noise_of(records: &[Record]) -> f64 {
    let square = |r: &Record| noise_floor_rad_per_s(r).powi(2) * r.rows() as f64;
    let rows: usize = records.iter().map(Record::rows).sum();
    (records.iter().map(square).sum::<f64>() / rows as f64).sqrt()
}

/// Everything about the diagnosis, and the page.
fn write_folder(folder: &Path, file: &ModelFile, body: &DiagnosisJson, found: &Found) -> Result<(), CliError> {
    write_atomically(&folder.join("ladder.svg"), ladder_chart(body).svg().as_bytes())?;
    write_atomically(&folder.join(MODEL_FILE), file.source.as_bytes())?;
    if !body.effects.is_empty() {
        let mut source = file.source.clone();
        for (finding, shown) in found.diagnosis.effects.iter().zip(&body.effects) {
            let name = file.path.display().to_string();
            source = with_effect(&name, &source, &finding.effect, &remarks(shown))?;
        }
        write_atomically(&folder.join("extended.toml"), source.as_bytes())?;
        for (index, record) in found.records.iter().chain(found.holdout).enumerate() {
            let rows = before_and_after(file, found, record)?;
            let noise = deg_per_h_from_rad_per_s(noise_floor_rad_per_s(record));
            let chart = before_and_after_chart(&format!("Residual of {}", record.name()), &rows, noise);
            write_table(folder, &before_and_after_name(index + 1), &rows)?;
            let picture = diagnosis::before_and_after_name(index + 1);
            write_atomically(&folder.join(picture), chart.svg().as_bytes())?;
        }
    }
    write_document(folder, DIAGNOSIS_FILE, body)?;
    write_report(folder, &folder.join(REPORT_FILE))?;
    Ok(())
}

/// What the declared and the extended model leave of a record.
fn before_and_after(file: &ModelFile, found: &Found, record: &Record) -> Result<Vec<DiagnosisRow>, CliError> {
    let left = |model: &CoilModel| -> Result<Vec<f64>, CliError> {
        let predicted = predict(model, found.pattern, record)?.rate_rad_per_s;
        let residuals = record.rate_rad_per_s().iter().zip(predicted);
        Ok(residuals.map(|(m, p)| rounded(deg_per_h_from_rad_per_s(m - p), RATE_DECIMALS)).collect())
    };
    let (declared, extended) = (left(&file.model)?, left(&found.diagnosis.extended)?);
    let rows = record.times_s().iter().zip(declared).zip(extended);
    Ok(rows
        .map(|((&time_s, residual_declared_deg_per_h), residual_extended_deg_per_h)| DiagnosisRow {
            time_s,
            residual_declared_deg_per_h,
            residual_extended_deg_per_h,
        })
        .collect())
}

/// What stands behind an effect's values in a model file.
pub(super) fn remarks(effect: &FindingJson) -> Vec<Remark> {
    let fitted = effect.parameters.iter().filter(|(_, p)| p.fitted);
    fitted.map(|(key, p)| Remark { key: key.clone(), text: TomlComment::of(value_in_words(p)) }).collect()
}

fn text(body: &DiagnosisJson) -> String {
    let mut text = format!("{}: {}\n", body.model, verdict_in_words(body));
    for effect in &body.effects {
        text += &format!("\n{}\n", effect_in_words(effect));
    }
    for (kind, words) in explanations(&body.effects) {
        text += &format!("\n{kind}: {words}\n");
    }
    for line in refitted_in_words(body) {
        text += &format!("\n{line}\n");
    }
    let rest = rest_in_words(body);
    if !rest.is_empty() {
        text += &format!("\n{}\n", rest.join("\n"));
    }
    text += "\n";
    let number = |v: f64| format!("{v:.4}");
    let rows = body.ladder.iter().map(|rung| {
        vec![
            if rung.effects.is_empty() { "as declared".to_owned() } else { rung.effects.join(" + ") },
            number(rung.rmse_deg_per_h),
            rung.holdout_rmse_deg_per_h.map_or_else(|| "-".to_owned(), number),
            format!("{:.3}", rung.reduced_chi_square),
            format!("{:.1}", rung.bic),
        ]
    });
    text += &table(&["model", "error °/h", "hold-out °/h", "reduced χ²", "BIC"], rows);
    text += &format!("noise floor {:.4} °/h\n\n", body.noise_floor_deg_per_h);
    for line in noise_in_words(body) {
        text += &format!("{line}\n");
    }
    text += &format!("posterior: {}\n\n", posterior_in_words(body).join(", "));
    for step in &body.ladder_in_words {
        text += &format!("{step}\n");
    }
    if let Some(experiment) = &body.suggested_experiment {
        text += &format!("next experiment: {experiment}\n");
    }
    if let Some(experiment) = &body.experiment {
        text += &format!("{}\n", experiment.statement);
        for pair in &experiment.expectations {
            text += &format!("  {pair}\n");
        }
    }
    for caution in &body.cautions {
        text += &format!("note: {caution}\n");
    }
    text
}

fn effect_in_words(effect: &FindingJson) -> String {
    let mut text = effect.kind.clone();
    for (key, option) in &effect.choices {
        text += &format!(", {key} = {option}");
    }
    for (key, parameter) in effect.parameters.iter().filter(|(_, p)| p.fitted) {
        text += &format!("\n  {key} = {}", value_in_words(parameter));
    }
    text += &format!(
        "\n  χ² rises by {:.0} without it, by {:.0} on unseen data",
        effect.chi_square_less, effect.confirmed_by
    );
    for other in &effect.equivalents_in_detail {
        text += &format!(
            "\n  {} does as well: χ² differs by {:.1}, the responses' correlation is {:+.4}",
            other.kind, other.chi_square_more, other.correlation
        );
    }
    text
}
