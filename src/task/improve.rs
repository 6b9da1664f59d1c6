//! From measurements to the next coil: compare, diagnose, extend, search, schedule.
//!
//! Each step leaves the folder that the command of its name leaves, so that any of them can be looked at, changed and run again.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::effect::DeclaredEffect;
use crate::io::files::{WriteError, write_atomically};
use crate::io::json::improve::{GainJson, ImproveJson, PredictedRow, StepJson};
use crate::io::json::search::OptimiseJson;
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::model_file::read_model;
use crate::io::read::pattern_file::print_pattern;
use crate::io::write::checkpoint::write_checkpoint;
use crate::io::write::measurement_folder::{check_free, write_table};
use crate::io::write::model_edit::{Remark, with_effect, with_sensor_and_pattern};
use crate::io::write::run_directory::{self, write_request};
use crate::pattern::Pattern;
use crate::predict::predict;
use crate::rate::CoilModel;
use crate::record::Record;
use crate::report::improvement::improvement_page;
use crate::search;
use crate::search::anneal::rounds::Rounds;
use crate::search::gain::predicted_gain;
use crate::search::run::Halt;
use crate::text::sink::TomlComment;
use crate::thermal::Location;
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s};

use super::measurement::{GrossErrors, Measurement};
use super::optimise::Wishes;
use super::{Observer, TaskError, compare, diagnose, optimise, pattern_or_own, schedule};

/// What was measured, and where everything goes.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    pub model: &'a ModelFile,
    /// The winding that was measured; none for the model's own.
    pub pattern: Option<&'a NamedPattern>,
    /// Of the coil as it is; the first is the one that is predicted for the new coil.
    pub measurements: &'a [Measurement],
    /// Only judged by.
    pub holdout: &'a [Measurement],
    pub folder: &'a Path,
    /// Of the search; none for the model's own.
    pub seed: Option<u64>,
}

/// Models that are drawn within the errors of the parameters.
const DRAWN_MODELS: usize = 24;

/// Of the profiles that the next experiment is chosen from.
const EXPERIMENT_SEED: u64 = 1;

/// The steps' own notes would come three times.
struct Quietly<'a>(&'a dyn Observer);

impl Observer for Quietly<'_> {
    fn goes_on(&self) -> bool {
        self.0.goes_on()
    }
}

/// Goes the whole way; `None` if the observer ended it.
///
/// # Errors
/// As its steps.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Option<ImproveJson>, TaskError> {
    let (file, folder) = (request.model, request.folder);
    let quietly = Quietly(observer);
    let old = pattern_or_own(file, request.pattern)?;
    let old_path = folder.join("measured-pattern.toml");
    let comment = TomlComment::of("the winding that was measured");
    write_atomically(&old_path, print_pattern(&old, &[comment]).as_bytes())?;
    let (before, diagnosis) = (folder.join("before"), folder.join("diagnosis"));
    let all: Vec<Measurement> = request.measurements.iter().chain(request.holdout).cloned().collect();
    compared(file, &all, &old, &before, &quietly)?;
    observer.note("compared; now diagnosing");
    observer.at(0.1, "compared; now diagnosing");
    let next_experiment = folder.join("next-experiment.toml");
    check_free(&diagnosis)?;
    let found = diagnose::run(
        &diagnose::Request {
            model: file,
            pattern: Some(&old),
            measurements: request.measurements,
            holdout: request.holdout,
            experiment_seed: Some(EXPERIMENT_SEED),
        },
        &quietly,
    )?;
    let experiment = found.experiment_source(file);
    if let Some(experiment) = &experiment {
        write_atomically(&next_experiment, experiment.as_bytes())?;
    }
    found.write(&diagnosis, file)?;
    if !observer.goes_on() {
        return Ok(None);
    }

    let extended_path = folder.join("extended.toml");
    let source = found.extended_source(file)?.unwrap_or_else(|| file.source.clone());
    let found = serde_json::to_value(&found.document)?;
    let source = with_sensor_and_pattern(&shown(&file.path), &source, None, "measured-pattern.toml")?;
    write_atomically(&extended_path, source.as_bytes())?;
    let extended = read_model(&extended_path)?;
    let after = folder.join("after");
    let comparison = compared(&extended, &all, &old, &after, &quietly)?;
    let film = learned_film(&extended, &comparison);
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

    observer.note("diagnosed; now searching");
    observer.at(0.5, "diagnosed; now searching");
    let search = folder.join("search");
    let Some(summary) = searched(&design, &old, request.seed, &search, observer)? else { return Ok(None) };
    let new = recommended(&summary, &old);
    let new_path = folder.join("recommended.toml");
    let comments = [TomlComment::of(summary["recommendation"]["sentence"].as_str().unwrap_or_default())];
    write_atomically(&new_path, print_pattern(&new, &comments).as_bytes())?;
    let schedule_folder = folder.join("schedule");
    let wound = schedule::run(&schedule::Request { model: &design, pattern: Some(&new) })?;
    for (name, text) in wound.files(&design)? {
        write_atomically(&schedule_folder.join(name), text.as_bytes())?;
    }

    let predicted_path = folder.join(PREDICTED);
    let rows = predicted_rows(&extended, &new.pattern, &request.measurements[0].record)?;
    write_table(folder, PREDICTED, &rows)?;
    let drawn = drawn_models(&design, &found, film.as_ref());
    let gain = predicted_gain(&design.model, &drawn, &design.profiles, &old.pattern, &new.pattern)?;
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
        next_experiment: experiment.map(|_| shown(&next_experiment)),
        suggested_experiment: found["suggested_experiment"].clone(),
        steps: steps(&[&before, &diagnosis, &after, &search, &schedule_folder]),
        page: shown(&folder.join("index.html")),
    };
    write_atomically(&folder.join("index.html"), improvement_page(&body, &rows).as_bytes())?;
    Ok(Some(body))
}

/// The name of the predicted record in the folder.
const PREDICTED: &str = "predicted-record.csv";

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// The comparison as a document; its folder is written.
fn compared(
    model: &ModelFile,
    measurements: &[Measurement],
    pattern: &NamedPattern,
    folder: &Path,
    observer: &dyn Observer,
) -> Result<Value, TaskError> {
    check_free(folder)?;
    let pattern = Some(pattern);
    let request = compare::Request { model, pattern, measurements, gross_errors: GrossErrors::Keep };
    let answer = compare::run(&request, observer)?;
    answer.write(folder, model)?;
    Ok(serde_json::to_value(&answer.document)?)
}

/// What a search for the next winding found; its folder is written. None if the observer ended it.
fn searched(
    design: &ModelFile,
    old: &NamedPattern,
    seed: Option<u64>,
    folder: &Path,
    observer: &dyn Observer,
) -> Result<Option<Value>, TaskError> {
    let wishes = Wishes { seed, ..Wishes::default() };
    let request = wishes.request(design, false, Some(old.clone()))?;
    let written = run_directory::Request {
        file: design,
        class: request.class,
        objective: request.objective,
        plan: &request.plan,
        budget: None,
    };
    let mut kept = Kept { folder, request: &written, observer, fault: None };
    let answer = search::run(&request, &mut kept)?;
    kept.fault.map_or(Ok(()), Err)?;
    let Some(answer) = answer.filter(|_| observer.goes_on()) else { return Ok(None) };
    let document = OptimiseJson::of(&design.model.name, &request, &answer, 0.0, 0.0);
    optimise::write(folder, design, &document, &answer)?;
    Ok(Some(serde_json::to_value(&document)?))
}

/// Writes a search's request and checkpoint where they belong.
struct Kept<'a> {
    folder: &'a Path,
    request: &'a run_directory::Request<'a>,
    observer: &'a dyn Observer,
    fault: Option<WriteError>,
}

impl Kept<'_> {
    fn write(&mut self, search: &dyn Rounds) {
        let written = write_checkpoint(self.folder, &self.request.fingerprint(), search.state());
        self.keep(written);
    }

    fn keep(&mut self, written: Result<(), WriteError>) {
        if let Err(error) = written {
            self.fault.get_or_insert(error);
        }
    }
}

impl search::Observer for Kept<'_> {
    fn begun(&mut self, search: &dyn Rounds) {
        let written = write_request(self.folder, self.request);
        self.keep(written);
        self.write(search);
    }

    fn advanced(&mut self, _search: &dyn Rounds) -> ControlFlow<Halt> {
        let goes_on = self.observer.goes_on() && self.fault.is_none();
        if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(Halt::Signal) }
    }

    fn ended(&mut self, search: &dyn Rounds) {
        self.write(search);
    }

    fn goes_on(&self) -> bool {
        self.observer.goes_on()
    }
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
fn predicted_rows(file: &ModelFile, pattern: &Pattern, record: &Record) -> Result<Vec<PredictedRow>, TaskError> {
    let predicted = predict(&file.model, pattern, record)?;
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
