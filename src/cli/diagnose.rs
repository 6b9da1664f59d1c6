//! `diagnose`: which effect a model lacks, judged by records.

use std::path::PathBuf;

use super::schedule::pattern_of;
use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::diagnose::{self, Request};
use crate::io::diagnosis_json::{DiagnosisJson, FindingJson, ParameterJson};
use crate::io::model_file::read_model;
use crate::io::record_file::read_record;

/// Which piece of physics a model lacks: fits every known effect to records and says what is missing, and how sure
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright diagnose coil.toml calibration.csv --holdout validation.csv\n  coilwright diagnose coil.toml monday.csv tuesday.csv --format json --strict\n\nExit code 1 with --strict if the model is not adequate."
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
}

/// The diagnosis reports its progress in this many parts.
const PARTS: f64 = 100.0;

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let pattern = pattern_of(&file, arguments.pattern.as_deref())?.pattern;
    // Gross errors are left out by the diagnosis itself, which says so.
    let read =
        |paths: &[PathBuf]| -> Result<Vec<_>, CliError> { paths.iter().map(|path| Ok(read_record(path)?)).collect() };
    let (records, holdout) = (read(&arguments.records)?, read(&arguments.holdout)?);
    let progress = screen.progress("diagnose", Some(PARTS as u64));
    let request = Request { model: &file.model, pattern: &pattern, records: &records, holdout: &holdout };
    let diagnosis = diagnose::diagnose(&request, &|share| progress.at((share * PARTS) as u64, ""))?;
    progress.finish();
    let body = DiagnosisJson::new(&file.model.name, &diagnosis);
    let adequate = diagnosis.verdict == diagnose::Verdict::Adequate;
    screen.answer(body, text)?;
    Ok(if arguments.strict && !adequate { Ending::No } else { Ending::Done })
}

fn text(body: &DiagnosisJson) -> String {
    let mut text = format!("{}: {}\n", body.model, verdict_in_words(body));
    for effect in &body.effects {
        text += &format!("\n{}\n", effect_in_words(effect));
    }
    if let Some(rest) = &body.unexplained {
        text += &format!("\nleft over: {:.4} °/h beyond the noise", rest.excess_deg_per_h);
        if let Some(strongest) = rest.correlations.first() {
            text += &format!("; goes with {} (correlation {:+.2})", strongest.with, strongest.correlation);
        }
        text += "\n";
        for plain in &rest.plain {
            let scale = match (plain.period_s, plain.time_constant_s) {
                (Some(period_s), _) => format!(" of period {period_s:.0} s"),
                (_, Some(time_constant_s)) => format!(" of time constant {time_constant_s:.0} s"),
                _ => String::new(),
            };
            text += &format!("  as a {}{scale}: {:.4} °/h rms\n", plain.shape, plain.rms_deg_per_h);
        }
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
    text += &format!("noise floor {:.4} °/h\n", body.noise_floor_deg_per_h);
    if let Some(experiment) = &body.suggested_experiment {
        text += &format!("next experiment: {experiment}\n");
    }
    for caution in &body.cautions {
        text += &format!("note: {caution}\n");
    }
    text
}

fn verdict_in_words(body: &DiagnosisJson) -> String {
    let kinds = || body.effects.iter().map(|e| e.kind.as_str()).collect::<Vec<_>>().join(" and ");
    match body.verdict {
        "adequate" => "adequate — these records show nothing that the model lacks".to_owned(),
        "missing" => format!("missing — the model lacks {}", kinds()),
        "indistinguishable" => format!("indistinguishable — {} or an equivalent is missing", kinds()),
        _ if body.effects.is_empty() => {
            "unexplained — something is there that no combination of known effects explains".to_owned()
        }
        _ => format!("unexplained — {} explains a part only", kinds()),
    }
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

/// With its error, and whether a bound holds it.
pub(super) fn value_in_words(parameter: &ParameterJson) -> String {
    let mut text = format!("{:.5e}", parameter.value);
    if let Some(error) = parameter.standard_error {
        text += &format!(" ± {error:.1e}");
    }
    if parameter.unit != "1" {
        text += &format!(" {}", parameter.unit);
    }
    if parameter.at_bound {
        text += " (at its bound)";
    }
    text
}
