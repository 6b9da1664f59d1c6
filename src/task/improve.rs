//! From measurements to the next coil: compare, diagnose, extend, search, schedule.
//!
//! Each step leaves the folder that the command of its name leaves, so that any of them can be looked at, changed and run again.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::diagnose::Terms;
use crate::effect::{DeclaredEffect, FILM};
use crate::io::fault::Faults;
use crate::io::files::{WriteError, read_text, write_atomically};
use crate::io::folder::{Replacement, remove_kinds};
use crate::io::json::diagnosis::{DiagnosisJson, RefittedJson};
use crate::io::json::improve::{ImproveJson, ImproveStepJson, PredictedRow};
use crate::io::json::search::{GainJson, OptimiseJson};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::model_file::read_model;
use crate::io::read::pattern_file::print_pattern;
use crate::io::read::posterior::drawn_models;
use crate::io::write::checkpoint::{read_checkpoint, write_checkpoint};
use crate::io::write::measurement_folder::{self, PROPOSED_FILE, check_free, write_table};
use crate::io::write::model_edit::{Remark, with_effect, with_sensor_and_pattern};
use crate::io::write::run_directory::{self, write_request};
use crate::pattern::Pattern;
use crate::predict::predict;
use crate::rate::CoilModel;
use crate::record::Record;
use crate::report::improvement::improvement_page;
use crate::search;
use crate::search::anneal::rounds::Rounds;
use crate::search::prospect::predicted_gain;
use crate::search::run::Halt;
use crate::text::sink::TomlComment;
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s};

use super::measurement::{GrossErrors, Measurement};
use super::optimise::{DRAWN_MODELS, Wishes};
use super::steps::{Steps, made_of, name_of};
use super::{Observer, TaskError, compare, diagnose, optimise, pattern_or_own, schedule};

/// What was measured, and where everything goes.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil, its settings and how its records are read.
    pub model: &'a ModelFile,
    /// The winding that was measured; none for the model's own.
    pub pattern: Option<&'a NamedPattern>,
    /// Of the coil as it is; the first is the one that is predicted for the new coil.
    pub measurements: &'a [Measurement],
    /// Only judged by.
    pub holdout: &'a [Measurement],
    /// Where everything goes.
    pub folder: &'a Path,
    /// Of the search; none for the model's own.
    pub seed: Option<u64>,
    /// Whether formulas are sought for what no listed effect explains, and among which.
    pub terms: Terms<'a>,
}

/// Of the profiles that the next experiment is chosen from.
const EXPERIMENT_SEED: u64 = 1;

/// The steps' own notes would come three times.
struct Quietly<'a>(&'a dyn Observer);

impl Observer for Quietly<'_> {
    fn goes_on(&self) -> bool {
        self.0.goes_on()
    }
}

/// Goes the whole way; `None` if the observer ended it. The same request goes on from the steps that are done.
///
/// # Errors
/// As its steps.
#[expect(
    clippy::too_many_lines,
    reason = "the whole way in its order; each step is a call, and the page names them all"
)]
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Option<ImproveJson>, TaskError> {
    let (file, folder) = (request.model, request.folder);
    let old = pattern_or_own(file, request.pattern)?;
    let old_path = folder.join("measured-pattern.toml");
    let comment = TomlComment::of("the winding that was measured");
    let old_source = print_pattern(&old, &[comment]);
    let mut way = ImproveRun { request, old: &old, old_source: &old_source, steps: Steps::of(folder), observer };
    let (before, after) = (folder.join("before"), folder.join("after"));
    if !way.of_records(file).is_some_and(|made_of| way.steps.is_taken(&before, &made_of, &[COMPARISON])) {
        clear(folder)?;
    }
    write_atomically(&old_path, old_source.as_bytes())?;
    way.compared(file, &before)?;
    observer.at(0.1, "compared; now diagnosing");
    let diagnosis = folder.join("diagnosis");
    way.diagnosed(&diagnosis)?;
    if !observer.goes_on() {
        return Ok(None);
    }
    let diagnosed = diagnosis.join(DIAGNOSIS);
    let found = read_json(&diagnosed)?;

    let extended_path = folder.join("extended.toml");
    let stated = diagnosis.join(EXTENDED);
    let source = if stated.is_file() { read_text(&stated)? } else { file.source.clone() };
    let source = with_sensor_and_pattern(&shown(&file.path), &source, None, "measured-pattern.toml")?;
    write_atomically(&extended_path, source.as_bytes())?;
    let extended = read_model(&extended_path)?;
    let document: DiagnosisJson = serde_json::from_value(found.clone())?;
    let explained = with_proposal(&document, &diagnosis.join(PROPOSED_FILE), &folder.join(PROPOSED_FILE))?;
    let explained = explained.as_ref().unwrap_or(&extended);
    way.compared(explained, &after)?;
    let film = learned_film(&extended);
    let design_path = folder.join("design.toml");
    let source = match &film {
        None => source,
        Some(film) => {
            let remark = Remark {
                key: FILM.spec.parameters[FILM.parameter].key.to_owned(),
                text: TomlComment::of(film.words()),
            };
            let effect = DeclaredEffect::film(film.value_w_per_m2_k);
            let source = with_effect(&shown(&extended_path), &source, &effect, &[remark])?;
            with_sensor_and_pattern(&shown(&extended_path), &source, Some("ambient"), "measured-pattern.toml")?
        }
    };
    write_atomically(&design_path, source.as_bytes())?;
    let design = read_model(&design_path)?;

    observer.at(0.5, "diagnosed; now searching");
    let search = folder.join("search");
    let seed = request.seed.unwrap_or(design.search.seed);
    let refitted: Vec<RefittedJson> =
        document.refitted.iter().cloned().chain(film.as_ref().map(LearnedFilm::as_refitted)).collect();
    let drawn = drawn_models(&design.model, &document.posterior, &refitted, DRAWN_MODELS, seed);
    let Some(summary) = way.searched(&design, &drawn, &search)? else { return Ok(None) };
    let new = recommended(&summary, &old);
    let new_path = folder.join("recommended.toml");
    let comments = [TomlComment::of(summary["recommendation"]["sentence"].as_str().unwrap_or_default())];
    write_atomically(&new_path, print_pattern(&new, &comments).as_bytes())?;
    let schedule_folder = folder.join("schedule");
    way.scheduled(&design, &new, &schedule_folder)?;

    let predicted_path = folder.join(PREDICTED);
    let rows = predicted_rows(explained, &new.pattern, &request.measurements[0].record)?;
    write_table(folder, PREDICTED, &rows)?;
    let gain = match serde_json::from_value::<GainJson>(summary["predicted_gain"].clone()) {
        Ok(gain) => gain,
        // Nothing in the model is uncertain.
        Err(_) => GainJson::of(&predicted_gain(&design.model, &[], &design.profiles, &old.pattern, &new.pattern)?),
    };
    let next_experiment = folder.join(EXPERIMENT);
    let body = ImproveJson {
        model: file.model.name.clone(),
        measured_pattern: old.name.clone(),
        verdict: found["verdict"].clone(),
        effects: found["effects"].clone(),
        proposals: document.proposals,
        film_w_per_m2_k: film.as_ref().map(|f| f.value_w_per_m2_k),
        recommendation: summary["recommendation"].clone(),
        validation: summary["validation"].clone(),
        uncertainty: summary["uncertainty"].clone(),
        measured_pattern_under_new_model: summary["compared_with"].clone(),
        predicted_gain: gain,
        predicted_record: shown(&predicted_path),
        next_experiment: next_experiment.is_file().then(|| shown(&next_experiment)),
        suggested_experiment: found["suggested_experiment"].clone(),
        steps: steps(&[&before, &diagnosis, &after, &search, &schedule_folder]),
        page: shown(&folder.join("index.html")),
    };
    write_atomically(&folder.join("index.html"), improvement_page(&body, &rows).as_bytes())?;
    Ok(Some(body))
}

/// Takes away what another request left, before the first file of this one comes: a folder holds one run's. The page goes first:
/// while it is there, the rest is of its run.
fn clear(folder: &Path) -> Result<(), WriteError> {
    clear_behind_search(folder)?;
    run_directory::clear(&folder.join("search"))?;
    for step in ["after", "diagnosis", "before"] {
        measurement_folder::clear(&folder.join(step))?;
    }
    remove_kinds(folder, &FILES)
}

/// What follows from the search.
fn clear_behind_search(folder: &Path) -> Result<(), WriteError> {
    remove_kinds(folder, &["index.html", PREDICTED, "recommended.toml"])?;
    remove_kinds(&folder.join("schedule"), &schedule::FILES)
}

/// What the steps have in common.
struct ImproveRun<'a> {
    request: &'a Request<'a>,
    /// The winding that was measured, and as a file.
    old: &'a NamedPattern,
    old_source: &'a str,
    steps: Steps,
    observer: &'a dyn Observer,
}

impl ImproveRun<'_> {
    fn all(&self) -> Vec<&Measurement> {
        self.request.measurements.iter().chain(self.request.holdout).collect()
    }

    /// What a step that judges records is made of; `None` where nobody can say.
    fn of_records(&self, model: &ModelFile) -> Option<String> {
        let roles = format!("{} fitted, {:?}", self.request.measurements.len(), self.request.terms);
        made_of(&[&model.source, self.old_source, &roles], &self.all())
    }

    /// Whether a step need not be taken.
    fn is_done(&self, into: &Path, made_of: Option<&str>, results: &[&str]) -> bool {
        let is_done = made_of.is_some_and(|made_of| self.steps.is_taken(into, made_of, results));
        let step = name_of(into);
        self.observer.note(&if is_done { format!("{step}: done before") } else { format!("{step} …") });
        is_done
    }

    /// Writes what the winding machine and the shop floor get.
    fn scheduled(&mut self, design: &ModelFile, new: &NamedPattern, folder: &Path) -> Result<(), TaskError> {
        let made_of = made_of(&[&design.source, &print_pattern(new, &[])], &[]);
        let wound = schedule::run(&schedule::Request { model: design, pattern: Some(new) })?;
        let files = wound.files(design)?;
        let names: Vec<&str> = files.iter().map(|(name, _)| name.as_ref()).collect();
        if !self.is_done(folder, made_of.as_deref(), &names) {
            Replacement::all(folder, &files)?;
            self.note_done(folder, made_of.as_deref(), &names)?;
        }
        Ok(())
    }

    fn note_done(&mut self, into: &Path, made_of: Option<&str>, results: &[&str]) -> Result<(), TaskError> {
        made_of.map_or(Ok(()), |made_of| self.steps.take(into, made_of, results))
    }

    /// The comparison as a document; its folder is written.
    fn compared(&mut self, model: &ModelFile, folder: &Path) -> Result<(), TaskError> {
        let made_of = self.of_records(model);
        if !self.is_done(folder, made_of.as_deref(), &[COMPARISON]) {
            check_free(folder)?;
            let measurements: Vec<Measurement> = self.all().into_iter().cloned().collect();
            let request = compare::Request {
                model,
                pattern: Some(self.old),
                measurements: &measurements,
                gross_errors: GrossErrors::Keep,
                fields: &[],
            };
            compare::run(&request, &Quietly(self.observer))?.write(folder, model)?;
            self.note_done(folder, made_of.as_deref(), &[COMPARISON])?;
        }
        Ok(())
    }

    /// Writes the folder of the diagnosis, and the next experiment beside it.
    fn diagnosed(&mut self, folder: &Path) -> Result<(), TaskError> {
        let file = self.request.model;
        let made_of = self.of_records(file);
        if self.is_done(folder, made_of.as_deref(), &[DIAGNOSIS]) {
            return Ok(());
        }
        check_free(folder)?;
        // What an earlier diagnosis left is not this one's.
        for stale in [folder.join(EXTENDED), self.request.folder.join(EXPERIMENT)] {
            match std::fs::remove_file(&stale) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    return Err(WriteError::File { path: stale, source }.into());
                }
                _ => {}
            }
        }
        let request = diagnose::Request {
            model: file,
            pattern: Some(self.old),
            measurements: self.request.measurements,
            holdout: self.request.holdout,
            experiment_seed: Some(EXPERIMENT_SEED),
            terms: self.request.terms,
        };
        let found = diagnose::run(&request, &Quietly(self.observer))?;
        if let Some(experiment) = found.experiment_source(file) {
            write_atomically(&self.request.folder.join(EXPERIMENT), experiment.as_bytes())?;
        }
        found.write(folder, file)?;
        self.note_done(folder, made_of.as_deref(), &[DIAGNOSIS])
    }

    /// What a search for the next winding found; its folder is written. None if the observer ended it.
    fn searched(&mut self, design: &ModelFile, drawn: &[CoilModel], folder: &Path) -> Result<Option<Value>, TaskError> {
        let seed = self.request.seed;
        // The drawn models follow from the diagnosis, which follows from the records.
        let stated = format!("{seed:?}\n{:?}", self.of_records(self.request.model));
        let made_of = made_of(&[&design.source, self.old_source, &stated], &[]);
        if self.is_done(folder, made_of.as_deref(), &[SUMMARY]) {
            return read_json(&folder.join(SUMMARY)).map(Some);
        }
        clear_behind_search(self.request.folder)?;
        let wishes = Wishes { seed, ..Wishes::default() };
        let mut request = wishes.request(design, false, Some(self.old.clone()))?;
        request.uncertain = drawn;
        let plan = request.plan.clone();
        let written = run_directory::Request {
            file: design,
            class: request.class,
            objective: request.objective,
            plan: &plan,
            budget: None,
            cutting_planes: false,
            fields: &[],
        };
        request.saved = read_checkpoint(folder, &written.fingerprint()).unwrap_or_else(|_| {
            let step = name_of(folder);
            self.observer.note(&format!("{step}: its checkpoint is damaged or of another search, which begins anew"));
            None
        });
        let mut kept = Kept { folder, request: &written, observer: self.observer, fault: None };
        let answer = search::run(&request, &mut kept)?;
        kept.fault.map_or(Ok(()), Err)?;
        let Some(answer) = answer.filter(|_| self.observer.goes_on()) else { return Ok(None) };
        let document = OptimiseJson::of(&design.model.name, &request, &answer, 0.0, 0.0);
        optimise::write(folder, design, &document, &answer)?;
        self.note_done(folder, made_of.as_deref(), &[SUMMARY])?;
        read_json(&folder.join(SUMMARY)).map(Some)
    }
}

/// The model with the formula that was proposed, where that predicts; written into the folder. No winding changes it: the search
/// is for what a winding can change, and goes without it.
fn with_proposal(document: &DiagnosisJson, stated: &Path, path: &Path) -> Result<Option<ModelFile>, TaskError> {
    if !document.proposals.first().is_some_and(|proposal| proposal.predicts) {
        return Ok(None);
    }
    let source = with_sensor_and_pattern(&shown(stated), &read_text(stated)?, None, "measured-pattern.toml")?;
    write_atomically(path, source.as_bytes())?;
    Ok(Some(read_model(path)?))
}

/// What the steps leave in their folders.
const COMPARISON: &str = "comparison.json";
const DIAGNOSIS: &str = "diagnosis.json";
const SUMMARY: &str = "summary.json";
const EXTENDED: &str = "extended.toml";
const EXPERIMENT: &str = "next-experiment.toml";

fn read_json(path: &Path) -> Result<Value, TaskError> {
    let text = read_text(path)?;
    serde_json::from_str(&text).map_err(|error| {
        let message = format!("line {}: cannot be understood: {error}; remove it to have it made again", error.line());
        Faults::of_file(shown(path), message).into()
    })
}

/// The name of the predicted record in the folder.
const PREDICTED: &str = "predicted-record.csv";

/// What is written into the folder itself, and taken away where it is another request's.
pub const FILES: [&str; 8] = [
    "index.html",
    PREDICTED,
    "recommended.toml",
    "design.toml",
    EXTENDED,
    PROPOSED_FILE,
    EXPERIMENT,
    "measured-pattern.toml",
];

fn shown(path: &Path) -> String {
    path.display().to_string()
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
    standard_error: Option<f64>,
    records: usize,
}

impl LearnedFilm {
    fn words(&self) -> String {
        let error = self.standard_error.map_or_else(String::new, |error| format!("± {error:.2}, "));
        format!("{error}learned from {} records", self.records)
    }

    /// As a diagnosis says what it learned of a number.
    fn as_refitted(&self) -> RefittedJson {
        let parameter = &FILM.spec.parameters[FILM.parameter];
        RefittedJson {
            kind: FILM.spec.kind.to_owned(),
            parameter: parameter.key.to_owned(),
            declared: self.value_w_per_m2_k,
            value: self.value_w_per_m2_k,
            standard_error: self.standard_error,
            unit: parameter.unit.symbol().to_owned(),
        }
    }
}

/// The film that the diagnosis stated, where the model does not declare one and its sensor lies on the pack.
fn learned_film(file: &ModelFile) -> Option<LearnedFilm> {
    let (film, learned) = file.learned_film().zip(file.learned.as_ref())?;
    Some(LearnedFilm {
        value_w_per_m2_k: film.value,
        standard_error: Some(film.standard_error).filter(|e| e.is_finite()),
        records: learned.records,
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

fn steps(folders: &[&PathBuf]) -> Vec<ImproveStepJson> {
    folders
        .iter()
        .map(|folder| ImproveStepJson {
            step: folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            folder: shown(folder),
        })
        .collect()
}
