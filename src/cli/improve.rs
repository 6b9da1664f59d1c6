//! `improve`: from measurements to the next coil, in one command.
//!
//! Each step is a command of its own and leaves its own folder, so that any of them can be looked at, changed and run
//! again: compare, diagnose, extend, optimise, schedule.

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use statrs::distribution::{ContinuousCDF, Normal};

use super::schedule::pattern_of;
use super::screen::Screen;
use super::{CliError, Ending, silently};
use crate::effect::DeclaredEffect;
use crate::io::files::{read_text, write_atomically};
use crate::io::json::improve::{GainJson, ImproveJson, PredictedRow, StepJson};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::model_file::read_model;
use crate::io::read::pattern_file::print_pattern;
use crate::io::read::record_file::read_record;
use crate::io::write::measurement_folder::write_table;
use crate::io::write::model_edit::{Remark, with_effect, with_sensor_and_pattern};
use crate::pattern::Pattern;
use crate::predict::predict;
use crate::rate::CoilModel;
use crate::report::improvement::improvement_page;
use crate::search::gain::predicted_gain;
use crate::text::sink::TomlComment;
use crate::thermal::Location;
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s};

/// The whole loop: compares and diagnoses records, extends the model, searches the next winding and writes its schedule
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The folder then holds before/ and after/ (comparisons), diagnosis/, design.toml (the model that was searched), search/,\n\
    recommended.toml, schedule/, predicted-record.csv (what the first record should look like with the new coil),\n\
    next-experiment.toml and index.html.\n\n\
    Example:\n  coilwright improve coil.toml monday.csv tuesday.csv --holdout friday.csv -o results/next-coil"
)]
pub struct Arguments {
    /// The model file
    model: PathBuf,
    /// Records of the coil as it is (CSV)
    #[arg(required = true, value_name = "RECORD")]
    records: Vec<PathBuf>,
    /// A record that is only judged by; may be repeated
    #[arg(long, value_name = "RECORD")]
    holdout: Vec<PathBuf>,
    /// The winding that was measured: a winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN")]
    pattern: Option<String>,
    /// Everything goes into this folder
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Seed of the search; without it, the model's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

/// Models that are drawn within the errors of the parameters.
const DRAWN_MODELS: usize = 24;

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let old = pattern_of(&file, arguments.pattern.as_deref())?;
    let folder = arguments.output.as_path();
    let old_path = folder.join("measured-pattern.toml");
    let comment = TomlComment::of("the winding that was measured");
    write_atomically(&old_path, print_pattern(&old, &[comment]).as_bytes())?;
    let (before, diagnosis) = (folder.join("before"), folder.join("diagnosis"));
    let all: Vec<&Path> = arguments.records.iter().chain(&arguments.holdout).map(PathBuf::as_path).collect();
    compare(&arguments.model, &all, &old_path, &before)?;
    screen.note("compared; now diagnosing");
    let next_experiment = folder.join("next-experiment.toml");
    let mut request = vec!["diagnose".to_owned(), shown(&arguments.model)];
    request.extend(arguments.records.iter().map(|path| shown(path)));
    request.extend(arguments.holdout.iter().flat_map(|path| ["--holdout".to_owned(), shown(path)]));
    request.extend(["--pattern".to_owned(), shown(&old_path), "-o".to_owned(), shown(&diagnosis)]);
    request.extend(["--experiment".to_owned(), shown(&next_experiment)]);
    silently(&request)?;
    let found = read_json(&diagnosis.join("diagnosis.json"))?;

    let extended_path = folder.join("extended.toml");
    let stated = diagnosis.join("extended.toml");
    let source = if stated.is_file() { read_text(&stated)? } else { file.source.clone() };
    let source = with_sensor_and_pattern(&shown(&arguments.model), &source, None, "measured-pattern.toml")?;
    write_atomically(&extended_path, source.as_bytes())?;
    let after = folder.join("after");
    compare(&extended_path, &all, &old_path, &after)?;
    let extended = read_model(&extended_path)?;
    let film = learned_film(&extended, &read_json(&after.join("comparison.json"))?);
    let design_path = folder.join("design.toml");
    let source = match &film {
        None => source,
        Some(film) => {
            let remark = Remark { key: "film_w_per_m2_k".to_owned(), text: TomlComment::of(film.words()) };
            let effect = DeclaredEffect::film(film.value_w_per_m2_k);
            let source = with_effect(&shown(&extended_path), &source, &effect, &[remark])?;
            with_sensor_and_pattern(&shown(&extended_path), &source, Some("ambient"), "measured-pattern.toml")?
        }
    };
    write_atomically(&design_path, source.as_bytes())?;
    let design = read_model(&design_path)?;

    screen.note("diagnosed; now searching");
    let search = folder.join("search");
    let mut request = vec!["optimise".to_owned(), shown(&design_path), "-o".to_owned(), shown(&search)];
    request.extend(["--fresh".to_owned(), "--compare-with".to_owned(), shown(&old_path)]);
    request.extend(arguments.seed.iter().flat_map(|seed| ["--seed".to_owned(), seed.to_string()]));
    silently(&request)?;
    let summary = read_json(&search.join("summary.json"))?;
    let new = recommended(&summary, &old);
    let new_path = folder.join("recommended.toml");
    let comments = [TomlComment::of(summary["recommendation"]["sentence"].as_str().unwrap_or_default())];
    write_atomically(&new_path, print_pattern(&new, &comments).as_bytes())?;
    let schedule = folder.join("schedule");
    silently(&["schedule", &shown(&design_path), "--pattern", &shown(&new_path), "-o", &shown(&schedule)])?;

    let predicted_path = folder.join(PREDICTED);
    let rows = predicted_rows(&extended, &new.pattern, &arguments.records[0])?;
    write_table(folder, PREDICTED, &rows)?;
    let drawn = drawn_models(&design, &found, film.as_ref());
    let gain = predicted_gain(&design.model, &drawn, &design.profiles, &old.pattern, &new.pattern)?;
    let experiment = next_experiment.is_file().then(|| shown(&next_experiment));
    let body = ImproveJson {
        model: file.model.name.clone(),
        measured_pattern: old.name.clone(),
        verdict: found["verdict"].clone(),
        effects: found["effects"].clone(),
        film_w_per_m2_k: film.as_ref().map(|f| f.value_w_per_m2_k),
        recommendation: summary["recommendation"].clone(),
        validation: summary["validation"].clone(),
        measured_pattern_under_new_model: summary["compared_with"].clone(),
        predicted_gain: GainJson::of(&gain),
        predicted_record: shown(&predicted_path),
        next_experiment: experiment,
        suggested_experiment: found["suggested_experiment"].clone(),
        steps: steps(&[&before, &diagnosis, &after, &search, &schedule]),
        page: shown(&folder.join("index.html")),
    };
    write_atomically(&folder.join("index.html"), improvement_page(&body, &rows).as_bytes())?;
    screen.answer(body, text)?;
    Ok(Ending::Done)
}

/// The name of the predicted record in the folder.
const PREDICTED: &str = "predicted-record.csv";

fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn compare(model: &Path, records: &[&Path], pattern: &Path, folder: &Path) -> Result<(), CliError> {
    let mut request = vec!["compare".to_owned(), shown(model)];
    request.extend(records.iter().map(|path| shown(path)));
    request.extend(["--pattern".to_owned(), shown(pattern), "-o".to_owned(), shown(folder)]);
    silently(&request).map(|_| ())
}

fn read_json(path: &Path) -> Result<Value, CliError> {
    let text = read_text(path)?;
    serde_json::from_str(&text).map_err(|error| {
        let message = format!("line {}: cannot be understood: {error}", error.line());
        crate::io::fault::Faults::of_file(shown(path), message).into()
    })
}

/// The film that the records showed.
struct LearnedFilm {
    value_w_per_m2_k: f64,
    /// Of the mean, from how the records differ; none for a single record.
    standard_error: Option<f64>,
    records: usize,
}

impl LearnedFilm {
    fn words(&self) -> String {
        let error = self.standard_error.map_or_else(String::new, |error| format!("± {error:.2}, "));
        format!("{error}learned from {} records", self.records)
    }
}

/// The film of the comparisons, where the model does not declare one and its sensor lies on the pack.
fn learned_film(file: &ModelFile, comparison: &Value) -> Option<LearnedFilm> {
    let has_film = file.model.heat_path().is_ok_and(|path| path.film_w_per_m2_k.is_some());
    if has_film || file.model.location == Location::Ambient {
        return None;
    }
    let records = comparison["records"].as_array()?;
    let films: Vec<f64> = records.iter().filter_map(|r| r["estimated_film_w_per_m2_k"].as_f64()).collect();
    let count = films.len();
    let mean = films.iter().sum::<f64>() / count.max(1) as f64;
    let square = films.iter().map(|f| (f - mean).powi(2)).sum::<f64>();
    (count > 0 && mean.is_finite()).then(|| LearnedFilm {
        value_w_per_m2_k: mean,
        standard_error: (count > 1).then(|| (square / (count * (count - 1)) as f64).sqrt()),
        records: count,
    })
}

/// The recommended pattern, or the measured one where the search was too short for any.
fn recommended(summary: &Value, old: &NamedPattern) -> NamedPattern {
    let recommendation = &summary["recommendation"];
    let segments: Option<Vec<usize>> = recommendation["segments"]
        .as_array()
        .and_then(|segments| segments.iter().map(|s| s.as_u64().map(|s| s as usize)).collect());
    match segments.and_then(|segments| Pattern::new(segments).ok()) {
        Some(pattern) => {
            let name = recommendation["pattern"].as_str().unwrap_or("recommended").to_owned();
            NamedPattern { name, pattern }
        }
        None => old.clone(),
    }
}

/// What the record should have been with the new winding, with the band in which 95 % of its rows lie.
fn predicted_rows(file: &ModelFile, pattern: &Pattern, record: &Path) -> Result<Vec<PredictedRow>, CliError> {
    let record = read_record(record)?;
    let predicted = predict(&file.model, pattern, &record)?;
    let noise = predicted.noise_rad_per_s.powi(2);
    let rows = record.times_s().iter().zip(record.temperature_k()).zip(&predicted.rate_rad_per_s);
    let rows = rows.zip(&predicted.boundary_variance_rad2_per_s2);
    Ok(rows
        .map(|(((&time_s, &temperature_k), &rate), variance)| {
            let half = TWO_SIGMA * (noise + variance).sqrt();
            PredictedRow {
                time_s,
                temperature_c: celsius_from_kelvin(temperature_k),
                rate_deg_per_h: deg_per_h_from_rad_per_s(rate),
                low_deg_per_h: deg_per_h_from_rad_per_s(rate - half),
                high_deg_per_h: deg_per_h_from_rad_per_s(rate + half),
            }
        })
        .collect())
}

/// 95 % of a normal distribution lie within so many standard deviations.
const TWO_SIGMA: f64 = 1.96;

/// Models with the fitted parameters and the film drawn within their errors.
fn drawn_models(design: &ModelFile, found: &Value, film: Option<&LearnedFilm>) -> Vec<CoilModel> {
    let error_of = |kind: &str, key: &str| -> Option<f64> {
        let effects = found["effects"].as_array()?;
        let effect = effects.iter().find(|e| e["kind"].as_str() == Some(kind))?;
        effect["parameters"][key]["standard_error"].as_f64()
    };
    let film_kind = DeclaredEffect::film(1.0).kind();
    let mut random = ChaCha8Rng::seed_from_u64(design.search.seed);
    let normal = Normal::standard();
    let mut has_errors = false;
    let mut drawn = Vec::with_capacity(DRAWN_MODELS);
    for _ in 0..DRAWN_MODELS {
        let effects = design.model.effects.iter().map(|effect| {
            let parameters = effect.parameters();
            let values = parameters.iter().zip(effect.values()).map(|(parameter, &value)| {
                let z = normal.inverse_cdf(random.random::<f64>().clamp(f64::MIN_POSITIVE, 1.0 - f64::EPSILON));
                let learned = film.and_then(|f| f.standard_error).filter(|_| effect.kind() == film_kind);
                match learned.or_else(|| error_of(&effect.kind(), &parameter.key)) {
                    None => value,
                    Some(error) => {
                        has_errors = true;
                        (value + z * parameter.unit.to_si(error)).clamp(parameter.lower, parameter.upper)
                    }
                }
            });
            effect.with_values(values.collect()).unwrap_or_else(|_| effect.clone())
        });
        let effects = effects.collect();
        drawn.push(CoilModel { effects, ..design.model.clone() });
    }
    if has_errors { drawn } else { Vec::new() }
}

fn steps(folders: &[&PathBuf]) -> Vec<StepJson> {
    folders
        .iter()
        .map(|folder| StepJson {
            step: folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            folder: shown(folder),
        })
        .collect()
}

fn text(body: &ImproveJson) -> String {
    let words = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let mut text = format!("{}\n", words(&body.recommendation["sentence"]));
    for reason in body.recommendation["reasons"].as_array().into_iter().flatten() {
        text += &format!("  {}\n", words(reason));
    }
    text += &format!("\n{}: {}\n", body.model, words(&body.verdict));
    for effect in body.effects.as_array().into_iter().flatten() {
        text += &format!("  {}\n", words(&effect["kind"]));
    }
    if let Some(film) = body.film_w_per_m2_k {
        text += &format!("film learned from the records: {film:.2} W/(m²K)\n");
    }
    text += &format!("{}\n", words(&body.measured_pattern_under_new_model["statement"]));
    text += &format!("{}\n", body.predicted_gain.words());
    text += &format!("what the first record should show with the new coil: {}\n", body.predicted_record);
    text += &format!("next experiment: {}\n", words(&body.suggested_experiment));
    text + &format!("wrote {}\n", body.page)
}
