//! Which piece of physics a model lacks, judged by records.

use std::path::Path;

use crate::compare::suspicion;
use crate::diagnose::discover::Allowed;
use crate::diagnose::experiment::{ChamberCapability, Experiment, ModelComparison, design};
use crate::diagnose::{self, Diagnosis, Terms, Verdict};
use crate::effect;
use crate::io::json::diagnosis::{DiagnosisJson, DiagnosisRow};
use crate::io::json::inputs::InputsJson;
use crate::io::json::schedule::{RATE_DECIMALS, rounded};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::profile_file::print_profile;
use crate::io::write::boundary_edit::with_boundary;
use crate::io::write::measurement_folder::{DIAGNOSIS_FILE, MeasurementFiles, PROPOSED_FILE, before_and_after_name};
use crate::io::write::model_edit::with_effect;
use crate::pattern::Pattern;
use crate::predict::{Boundary, noise_floor_rad_per_s, predict_from};
use crate::rate::CoilModel;
use crate::record::Record;
use crate::report::diagnosis::{before_and_after_chart, before_and_after_name as picture_name};
use crate::report::ladder::ladder_chart;
use crate::report::noise::noise_chart;
use crate::text::sink::TomlComment;
use crate::units::deg_per_h_from_rad_per_s;

use super::measurement::Measurement;
use super::page::{REPORT_FILE, write_report};
use super::remarks::{remarks, term_remarks};
use super::{Observer, TaskError, pattern_or_own};

/// What is to be diagnosed.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil, its settings and how its records are read.
    pub model: &'a ModelFile,
    /// None for the model's own.
    pub pattern: Option<&'a NamedPattern>,
    /// To fit to.
    pub measurements: &'a [Measurement],
    /// Only judged by.
    pub holdout: &'a [Measurement],
    /// Whether to plan the experiment that would tell the candidates apart, and the seed it is drawn by.
    pub experiment_seed: Option<u64>,
    /// Whether formulas are sought for what no listed effect explains, and among which.
    pub terms: Terms<'a>,
}

impl<'a> Request<'a> {
    /// With the model's own pattern; no hold-out and no experiment.
    pub fn new(model: &'a ModelFile, measurements: &'a [Measurement]) -> Self {
        Self { model, pattern: None, measurements, holdout: &[], experiment_seed: None, terms: Terms::default() }
    }
}

/// What was found.
#[derive(Debug)]
pub struct Answer {
    /// As the program prints it.
    pub document: DiagnosisJson,
    pub(crate) diagnosis: Diagnosis,
    /// None where it was not asked for or there is nothing to tell apart.
    pub(crate) experiment: Option<Experiment>,
    pub(crate) pattern: Pattern,
    records: Vec<Record>,
    holdout: Vec<Record>,
}

/// Diagnoses. Gross errors are left out by the diagnosis itself, which says so.
///
/// # Errors
/// No pattern; records that cannot be fitted.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Answer, TaskError> {
    let file = request.model;
    let pattern = pattern_or_own(file, request.pattern)?.pattern;
    let taken = |measurements: &[Measurement]| -> Vec<Record> {
        let said = measurements.iter().inspect(|m| m.say(Some(file), observer));
        said.map(|m| m.record.clone()).collect()
    };
    let (records, holdout) = (taken(request.measurements), taken(request.holdout));
    if let Terms::Among(words) = request.terms {
        check_terms(words, &records)?;
    }
    let asked = diagnose::Request {
        model: &file.model,
        pattern: &pattern,
        records: &records,
        holdout: &holdout,
        terms: request.terms,
    };
    let diagnosed = diagnose::diagnosed(&asked, &|share| observer.at(share, ""))?;
    let all: Vec<&Record> = records.iter().chain(&holdout).collect();
    let seed = request.experiment_seed.filter(|_| !diagnosed.diagnosis.effects.is_empty());
    let experiment = match ChamberCapability::of(&all).zip(seed) {
        Some((chamber, seed)) => match ModelComparison::new(&asked, &diagnosed) {
            Ok(comparison) => design(&comparison, &chamber, seed),
            // What was found holds without it.
            Err(error) => {
                observer.note(&format!("no experiment could be planned: {error}"));
                None
            }
        },
        None => None,
    };
    let diagnosis = diagnosed.diagnosis;
    let holdout_noise = (!holdout.is_empty()).then(|| noise_of(&holdout));
    let fitted = request.measurements.iter().map(|m| m.input("fitted"));
    let inputs = fitted.chain(request.holdout.iter().map(|m| m.input("held out"))).collect();
    let inputs = InputsJson::new(Some(file), inputs);
    let mut document = DiagnosisJson::new(&file.model.name, &diagnosis, holdout_noise, experiment.as_ref(), inputs);
    document.cautions.extend(suspicions(&file.model, &all, &diagnosis));
    Ok(Answer { document, diagnosis, experiment, pattern, records, holdout })
}

/// Words that are neither a form nor a variable of these records.
fn check_terms(words: &[String], records: &[Record]) -> Result<(), TaskError> {
    let names: Vec<String> = records.iter().flat_map(|r| r.channels().iter().map(|c| c.name.clone())).collect();
    let known = Allowed::known(&names);
    match words.iter().find(|word| !known.contains(word)) {
        Some(word) => {
            let message = format!("expected forms or variables among {}, found \"{word}\"", known.join(", "));
            Err(TaskError::Option { option: "--terms", message })
        }
        None => Ok(()),
    }
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

impl Answer {
    pub(crate) fn is_adequate(&self) -> bool {
        self.diagnosis.verdict == Verdict::Adequate
    }

    /// The model file with the effects that were found and with what the records showed of film, offset and chamber; none
    /// where they showed neither.
    ///
    /// # Errors
    /// A text that is no model file.
    pub fn extended_source(&self, model: &ModelFile) -> Result<Option<String>, TaskError> {
        let learned = &self.diagnosis.boundary;
        if self.document.effects.is_empty() && learned.film_w_per_m2_k.is_none() && learned.numbers.is_empty() {
            return Ok(None);
        }
        let mut source = model.source.clone();
        let name = model.path.display().to_string();
        for (finding, shown) in self.diagnosis.effects.iter().zip(&self.document.effects) {
            source = with_effect(&name, &source, &finding.effect, &remarks(shown))?;
        }
        Ok(Some(with_boundary(&name, &source, learned)?))
    }

    /// The model file with the listed effects and the proposed terms; none where nothing is proposed.
    ///
    /// # Errors
    /// A text that is no model file.
    pub(crate) fn proposed_source(&self, model: &ModelFile) -> Result<Option<String>, TaskError> {
        let Some((proposal, shown)) = self.diagnosis.proposals.first().zip(self.document.proposals.first()) else {
            return Ok(None);
        };
        let mut source = self.extended_source(model)?.unwrap_or_else(|| model.source.clone());
        let name = model.path.display().to_string();
        for (term, shown) in proposal.terms.iter().zip(&shown.terms) {
            source = with_effect(&name, &source, &term.effect, &term_remarks(shown))?;
        }
        Ok(Some(source))
    }

    /// The experiment as a file of profiles; none where there is none.
    pub fn experiment_source(&self, model: &ModelFile) -> Option<String> {
        let (found, shown) = self.experiment.as_ref().zip(self.document.experiment.as_ref())?;
        let first = format!("For {}: the chamber's air.", model.model.name);
        let words = [&first, &shown.statement].into_iter().chain(&shown.expectations);
        Some(print_profile(&found.profile, &words.map(TomlComment::of).collect::<Vec<_>>()))
    }

    /// Everything about the diagnosis, and the page.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(&self, folder: &Path, model: &ModelFile) -> Result<(), TaskError> {
        let mut files = MeasurementFiles::new(folder, Some(model))?;
        files.add("ladder.svg", ladder_chart(&self.document).svg().as_bytes())?;
        files.add("noise.svg", noise_chart(&self.document).svg().as_bytes())?;
        if let Some(source) = self.extended_source(model)? {
            files.add("extended.toml", source.as_bytes())?;
        }
        if let Some(source) = self.proposed_source(model)? {
            files.add(PROPOSED_FILE, source.as_bytes())?;
        }
        if let Some(after) = self.after() {
            let records = self.records.iter().chain(&self.holdout).zip(&self.diagnosis.driven);
            for (index, (record, driven)) in records.enumerate() {
                let rows = self.before_and_after([&model.model, after], record, driven)?;
                let noise = deg_per_h_from_rad_per_s(noise_floor_rad_per_s(record));
                let chart = before_and_after_chart(&format!("Residual of {}", record.name()), &rows, noise);
                files.table(&before_and_after_name(index + 1), &rows)?;
                files.add(&picture_name(index + 1), chart.svg().as_bytes())?;
            }
        }
        files.document(DIAGNOSIS_FILE, &self.document)?;
        files.commit(DIAGNOSIS_FILE)?;
        write_report(folder, &folder.join(REPORT_FILE))?;
        Ok(())
    }

    /// The model with everything that was found; none where nothing was.
    fn after(&self) -> Option<&CoilModel> {
        let extended = Some(&self.diagnosis.extended).filter(|_| !self.document.effects.is_empty());
        self.diagnosis.proposals.first().map(|p| &p.proposed).or(extended)
    }

    /// What the declared model and the one with everything that was found leave of a record.
    fn before_and_after(
        &self,
        models: [&CoilModel; 2],
        record: &Record,
        driven: &[Boundary; 2],
    ) -> Result<Vec<DiagnosisRow>, TaskError> {
        let left = |place: usize| -> Result<Vec<f64>, TaskError> {
            let predicted = predict_from(models[place], &self.pattern, record, &driven[place])?.rate_rad_per_s;
            let residuals = record.rate_rad_per_s().iter().zip(predicted);
            Ok(residuals.map(|(m, p)| rounded(deg_per_h_from_rad_per_s(m - p), RATE_DECIMALS)).collect())
        };
        let (declared, extended) = (left(0)?, left(1)?);
        let rows = record.times_s().iter().zip(declared).zip(extended);
        Ok(rows
            .map(|((&time_s, residual_declared_deg_per_h), residual_extended_deg_per_h)| DiagnosisRow {
                time_s,
                residual_declared_deg_per_h,
                residual_extended_deg_per_h,
            })
            .collect())
    }
}
