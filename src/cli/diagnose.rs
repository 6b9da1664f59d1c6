//! `diagnose`: which effect a model lacks, judged by records.

use std::path::{Path, PathBuf};

use super::pattern_asked::pattern_asked;
use super::records::RecordArguments;
use super::screen::{Screen, held, table};
use super::terms::TermArguments;
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::files::write_atomically;
use crate::io::folder::check_file;
use crate::io::json::diagnosis::{DiagnosisJson, FindingJson};
use crate::io::read::model_file::read_model;
use crate::io::write::measurement_folder::{DIAGNOSIS_FILE, check_free, check_kept};
use crate::report::diagnosis::{
    explanations, posterior_in_words, refitted_in_words, rest_in_words, value_in_words, verdict_in_words,
};
use crate::report::noise::noise_in_words;
use crate::report::proposal::proposal_in_words;
use crate::task::diagnose::{Request, run as diagnose};
use crate::task::page::REPORT_FILE;

/// Which piece of physics a model lacks: fits every known effect to records and says what is missing, and how sure
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright diagnose coil.toml calibration.csv --holdout validation.csv\n  coilwright diagnose coil.toml monday.csv tuesday.csv --format json --strict\n  coilwright diagnose coil.toml calibration.csv --holdout validation.csv -o results/coil --experiment next.toml\n\nExit code 1 with --strict if the model is not adequate."
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// Records to fit (CSV)
    #[arg(required = true, value_name = "RECORD")]
    records: Vec<PathBuf>,
    /// A record that is only judged by; may be repeated
    #[arg(long, value_name = "RECORD")]
    holdout: Vec<PathBuf>,
    /// A winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
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
    terms: TermArguments,
    #[command(flatten)]
    reading: RecordArguments,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    if let Some(folder) = &arguments.output {
        check_kept(folder, DIAGNOSIS_FILE, screen.named().chain(file.files()))?;
    }
    if let Some(written) = &arguments.experiment {
        let records = arguments.records.iter().chain(&arguments.holdout).map(PathBuf::as_path);
        check_file(written, file.files().chain(records).chain(arguments.pattern.iter().map(Path::new)))?;
    }
    let _held = arguments.output.as_deref().map(|folder| held(folder, "diagnose")).transpose()?;
    if let Some(folder) = &arguments.output {
        check_free(folder)?;
    }
    let pattern = pattern_asked(&file, arguments.pattern.as_deref())?;
    let measurements = arguments.reading.read(&arguments.records, Some(&file))?;
    let holdout = arguments.reading.read(&arguments.holdout, Some(&file))?;
    let wants_experiment = arguments.output.is_some() || arguments.experiment.is_some();
    let request = Request {
        pattern: pattern.as_ref(),
        holdout: &holdout,
        experiment_seed: wants_experiment.then_some(arguments.seed),
        terms: arguments.terms.asked(),
        ..Request::new(&file, &measurements)
    };
    let watching = Watching::new(screen, "diagnose");
    let answer = diagnose(&request, &watching)?;
    watching.finish();
    if let Some(path) = &arguments.experiment {
        match answer.experiment_source(&file) {
            Some(source) => {
                write_atomically(path, source.as_bytes())?;
                screen.note(&format!("wrote {}", path.display()));
            }
            None => screen.note("there is nothing to tell apart: no experiment was written"),
        }
    }
    if let Some(folder) = &arguments.output {
        answer.write(folder, &file)?;
        screen.note(&format!("wrote {}", folder.join(REPORT_FILE).display()));
    }
    let adequate = answer.is_adequate();
    screen.answer(answer.document, text)?;
    Ok(if arguments.strict && !adequate { Ending::No } else { Ending::Done })
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
    for proposal in &body.proposals {
        text += &format!("\n{}\n", proposal_in_words(proposal).join("\n"));
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
