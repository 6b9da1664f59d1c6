//! Windings under temperature fields from files: what they err by, and the search for the best of them.
//!
//! A field is a case of its own: it begins at rest, and the worst is taken over all rows of all fields. Nothing is guaranteed or
//! proved beyond them: a proof is that no pattern of the class is better over these rows.

use std::path::Path;

use crate::io::json::field::{FieldJson, FieldSearchJson};
use crate::io::json::inputs::RecordInputJson;
use crate::io::json::{EvaluateJson, PatternJson, ProofJson};
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::read::field_file::read_field;
use crate::io::write::field_rates::{FieldRates, PatternRates};
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindabilityClass;
use crate::rate::RateModel;
use crate::search;
use crate::search::anneal::rounds::{Plan, RoundRecord, State};
use crate::search::anneal::sample_cost::SampleCost;
use crate::search::answer::Ended;
use crate::search::aside::PointingError;
use crate::search::cost::objective::Objective;
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::worst_case::WorstCase;
use crate::search::custom::{self, CustomAnswer};
use crate::search::evaluator::name_of;
use crate::search::optimality::Proof;
use crate::search::proof::{Certificate, Status, prove_samples, quickly_found};
use crate::search::run::RunError;
use crate::thermal::{GivenField, ThermalHistory};
use crate::units::deg_per_h_from_rad_per_s;

use super::field::{check, matrix_of, series_rad_per_s};
use super::{Observer, TaskError, exact, own_and_classics};

/// A field with its origin.
#[derive(Debug, Clone)]
pub struct FieldFile {
    pub(crate) field: GivenField,
    pub(crate) file: String,
    pub(crate) sha256: Option<String>,
    /// What was assumed or left out, in words.
    pub(crate) remarks: Vec<String>,
}

impl FieldFile {
    /// Reads a field.
    ///
    /// # Errors
    /// All faults of the file at once.
    pub(crate) fn read(path: &Path) -> Result<Self, TaskError> {
        let read = read_field(path)?;
        let RecordInputJson { file, sha256, .. } = RecordInputJson::new(path, "")?;
        Ok(Self { field: read.field, file, sha256, remarks: read.remarks })
    }

    /// Says what was assumed.
    pub(crate) fn say(&self, observer: &dyn Observer) {
        for remark in &self.remarks {
            observer.note(&format!("note: {}: {remark}", self.file));
        }
    }

    /// What a document about measurements says of it.
    pub(crate) fn input(&self) -> RecordInputJson {
        RecordInputJson { file: self.file.clone(), sha256: self.sha256.clone(), role: "temperatures".to_owned() }
    }

    pub(crate) fn shown(&self) -> FieldJson {
        let (from_s, to_s) = self.field.span_s();
        FieldJson {
            file: self.file.clone(),
            sha256: self.sha256.clone(),
            layers: self.field.history.layers,
            rows: self.field.history.len(),
            from_s,
            to_s,
            rates: if self.field.has_rates { "given" } else { "straight between times" },
        }
    }
}

/// A field as states of the pack, checked against a coil.
struct Case<'a> {
    given: &'a GivenField,
    states: ThermalHistory,
}

fn cases<'a>(model: &ModelFile, fields: &'a [FieldFile], observer: &dyn Observer) -> Result<Vec<Case<'a>>, TaskError> {
    let mut cases = Vec::with_capacity(fields.len());
    for file in fields {
        file.say(observer);
        let states = file.field.states();
        check(model, &states).map_err(|error| match error {
            TaskError::Field { message } => TaskError::Field { message: format!("{}: {message}", file.file) },
            other => other,
        })?;
        cases.push(Case { given: &file.field, states });
    }
    Ok(cases)
}

impl Case<'_> {
    /// ∫ Ω dt up to the time at which its size is largest \[rad\].
    fn pointing_rad(&self, rates_rad_per_s: &[f64]) -> f64 {
        let times = &self.given.history.times_s;
        let (mut angle, mut worst) = (0.0, 0.0_f64);
        for row in 1..times.len() {
            // Rates that were given are taken as straight between their times.
            let mean = if self.given.has_rates {
                0.5 * (rates_rad_per_s[row - 1] + rates_rad_per_s[row])
            } else {
                rates_rad_per_s[row - 1]
            };
            angle += mean * (times[row] - times[row - 1]);
            if f64::abs(angle) > worst.abs() {
                worst = angle;
            }
        }
        worst
    }
}

/// A winding over all cases.
fn judged(
    model: &ModelFile,
    cases: &[Case],
    objective: Objective,
    NamedPattern { name, pattern }: &NamedPattern,
) -> Result<(PatternJson, f64), TaskError> {
    let rate_model = RateModel::new(&model.model, pattern, &[])?;
    let mut worst: Option<WorstCase> = None;
    let (mut pointing_rad, mut squares, mut count) = (0.0_f64, 0.0, 0);
    for (index, case) in cases.iter().enumerate() {
        let rates = series_rad_per_s(&rate_model, &case.states)?;
        for (rate, time_s) in rates.iter().zip(&case.states.times_s) {
            if worst.as_ref().is_none_or(|w| rate.abs() > w.rate_rad_per_s.abs()) {
                let (profile, profile_index) = (case.given.name.clone(), index);
                worst = Some(WorstCase { rate_rad_per_s: *rate, profile, profile_index, time_s: *time_s });
            }
        }
        let angle = case.pointing_rad(&rates);
        if angle.abs() > pointing_rad.abs() {
            pointing_rad = angle;
        }
        squares += rates.iter().map(|r| r * r).sum::<f64>();
        count += rates.len();
    }
    let worst =
        worst.ok_or_else(|| TaskError::Field { message: "expected at least one field, found none".to_owned() })?;
    let phase_rad = rate_model.phase_rad(worst.rate_rad_per_s);
    let cost = match objective {
        Objective::RootMeanSquare => (squares / count as f64).sqrt(),
        _ => worst.rate_rad_per_s.abs(),
    };
    let body = PatternJson::new(name, pattern, &worst, phase_rad, None);
    Ok((body.with_pointing(&PointingError { worst_rad: pointing_rad, guaranteed_rad: None }), cost))
}

/// Evaluates windings; without any, the model's own and all classics that fit.
///
/// # Errors
/// Fields that do not fit the coil; a formula without a value.
pub(crate) fn evaluate(
    model: &ModelFile,
    fields: &[FieldFile],
    patterns: &[NamedPattern],
    observer: &dyn Observer,
) -> Result<EvaluateJson, TaskError> {
    let cases = cases(model, fields, observer)?;
    let all = if patterns.is_empty() { own_and_classics(model) } else { patterns.to_vec() };
    let patterns = all.iter().map(|named| Ok(judged(model, &cases, Objective::WorstRate, named)?.0));
    Ok(EvaluateJson {
        model: model.model.name.clone(),
        patterns: patterns.collect::<Result<_, TaskError>>()?,
        other_boundary: None,
        guaranteed_beside: Vec::new(),
        fields: fields.iter().map(FieldFile::shown).collect(),
    })
}

/// A search under fields.
#[derive(Debug, Clone)]
pub(crate) struct FieldSearch<'a> {
    pub(crate) model: &'a ModelFile,
    pub(crate) fields: &'a [FieldFile],
    pub(crate) class: WindabilityClass,
    pub(crate) objective: Objective,
    pub(crate) plan: Plan,
    /// Whether to prove that the best pattern is the best of its class over these rows.
    pub(crate) prove: bool,
    /// The state to go on from; everything else must be as it was when it was saved.
    pub(crate) saved: Option<State>,
}

/// The document, and the pattern that it names.
#[derive(Debug)]
pub(crate) struct FieldSearchFound {
    pub(crate) document: FieldSearchJson,
    pub(crate) best: NamedPattern,
    pub(crate) ended: Ended,
    /// What the page shows beside the document.
    pub(crate) history: Vec<RoundRecord>,
    pub(crate) rates: Vec<FieldRates>,
}

/// What a search under fields can make small: of a model that asks for something else, the worst rate.
///
/// # Errors
/// An objective that was asked for on purpose and is about all profiles, or about built coils.
pub(crate) fn objective(model: &ModelFile, stated: Option<Objective>) -> Result<Objective, TaskError> {
    let is_of_rows =
        |o: Objective| matches!(o, Objective::WorstRate | Objective::WorstPhase | Objective::RootMeanSquare);
    match stated {
        Some(objective) if !is_of_rows(objective) => {
            let message = format!(
                "{} is not defined for a temperature field: expected worst-rate, worst-phase or rms",
                objective.key()
            );
            Err(TaskError::Option { option: "--objective", message })
        }
        Some(objective) => Ok(objective),
        None => Ok(Some(model.search.objective).filter(|o| is_of_rows(*o)).unwrap_or(Objective::WorstRate)),
    }
}

/// Searches; None if it was ended before anything was found.
///
/// # Errors
/// Fields that do not fit the coil; a formula without a value, or one that patterns cannot be searched with; a saved state that
/// no such search can have been in.
pub(crate) fn search(
    request: &FieldSearch,
    observer: &dyn Observer,
    watch: &mut dyn search::Observer,
) -> Result<Option<FieldSearchFound>, TaskError> {
    let FieldSearch { model, fields, class, objective, .. } = *request;
    let cases = cases(model, fields, observer)?;
    let matrix = matrix_of(model, cases.iter().map(|case| &case.states))?;
    let Some(answer) = annealed(request, matrix.clone(), watch)? else { return Ok(None) };
    let judge = |named: &NamedPattern| judged(model, &cases, objective, named);
    let classics = own_and_classics(model).into_iter().filter(|named| Classic::from_key(&named.name).is_ok());
    let mut baselines = Vec::new();
    let mut best: Option<(NamedPattern, PatternJson, f64)> = None;
    let mut consider = |named: &NamedPattern, shown: &PatternJson, cost: f64| {
        if best.as_ref().is_none_or(|(_, _, least)| cost < *least) {
            best = Some((named.clone(), shown.clone(), cost));
        }
    };
    let mut qua = None;
    for named in classics {
        let (shown, cost) = judge(&named)?;
        qua = qua.or((named.name == Classic::Qua.key()).then_some(cost));
        if class.admits(&named.pattern) {
            consider(&named, &shown, cost);
        }
        baselines.push(shown);
    }
    for found in &answer.found {
        let Ok(pattern) = Pattern::new(found.segments.clone()) else { continue };
        let named = NamedPattern { name: name_of(&pattern), pattern };
        let (shown, cost) = judge(&named)?;
        consider(&named, &shown, cost);
    }
    let Some((mut named, mut best, mut cost)) = best else { return Ok(None) };
    let mut proof = Proof::NONE;
    if request.prove && answer.ended != Ended::Signal {
        let others = answer.found.iter().filter_map(|found| Pattern::new(found.segments.clone()).ok());
        let certificate = proved(request, matrix, &named.pattern, others, watch)?;
        proof = Proof::of(&certificate);
        if certificate.pattern != named.pattern {
            named = NamedPattern { name: name_of(&certificate.pattern), pattern: certificate.pattern };
            (best, cost) = judge(&named)?;
        }
    }
    let rates = over_time(model, &cases, &baselines, &best)?;
    let document = FieldSearchJson {
        model: model.model.name.clone(),
        fields: fields.iter().map(FieldFile::shown).collect(),
        objective: objective.key().to_owned(),
        windability: class.to_string(),
        seed: request.plan.seed,
        best,
        baselines,
        improvement_over_qua: qua.filter(|_| cost > 0.0).map(|qua| qua / cost),
        statement: statement(request, cost, qua) + &proof_words(&proof, objective),
        proof: ProofJson::of(&proof),
        evaluations: answer.evaluations,
        evaluations_per_s: None,
        seconds: None,
        rounds: answer.rounds,
        stopped_by: answer.ended.key().to_owned(),
        reproducible: matches!(answer.ended, Ended::Rule(_)) && !proof.was_cut_short,
    };
    Ok(Some(FieldSearchFound { document, best: named, ended: answer.ended, history: answer.history, rates }))
}

fn annealed(
    request: &FieldSearch,
    samples: SampleMatrix,
    watch: &mut dyn search::Observer,
) -> Result<Option<CustomAnswer>, RunError> {
    let (cost, plan) = (SampleCost::new(samples, request.class, request.objective.norm()), request.plan.clone());
    Ok(match request.saved.clone() {
        None => custom::search(cost, plan, watch),
        Some(state) => custom::resume(cost, plan, state, watch).ok_or(RunError::Resume)?,
    })
}

/// Begins with the best pattern, classics and what else was found.
fn proved(
    request: &FieldSearch,
    samples: SampleMatrix,
    best: &Pattern,
    others: impl Iterator<Item = Pattern>,
    observer: &dyn search::Observer,
) -> Result<Certificate, TaskError> {
    let FieldSearch { model, class, objective, .. } = *request;
    let classics = own_and_classics(model).into_iter().map(|named| named.pattern);
    let starts: Vec<Pattern> = std::iter::once(best.clone()).chain(classics).chain(others).collect();
    let watcher = |at| observer.proving(at);
    Ok(prove_samples(&model.model, samples, objective.norm(), class, &starts, &watcher)?)
}

/// What every pattern errs by in every row.
fn over_time(
    model: &ModelFile,
    cases: &[Case],
    baselines: &[PatternJson],
    best: &PatternJson,
) -> Result<Vec<FieldRates>, TaskError> {
    let mut fields: Vec<FieldRates> = cases.iter().map(|case| FieldRates::of(&case.states)).collect();
    let others = baselines.iter().filter(|shown| shown.segments != best.segments);
    for shown in others.chain(std::iter::once(best)) {
        let Ok(pattern) = Pattern::new(shown.segments.clone()) else { continue };
        let rate_model = RateModel::new(&model.model, &pattern, &[])?;
        for (field, case) in fields.iter_mut().zip(cases) {
            let rates = series_rad_per_s(&rate_model, &case.states)?.into_iter().map(deg_per_h_from_rad_per_s);
            field.patterns.push(PatternRates { name: shown.name.clone(), rates_deg_per_h: rates.collect() });
        }
    }
    Ok(fields)
}

/// What a proof says of a pattern over the rows of its fields.
fn proof_words(proof: &Proof, objective: Objective) -> String {
    let (what, unit) = (objective.title(), objective.unit());
    match proof.status {
        Status::Optimal => format!(" Proved: no pattern of the class has a smaller {what} over them."),
        Status::Gap => {
            let bound = deg_per_h_from_rad_per_s(proof.lower_bound_rad_per_s);
            format!(" Proved: no pattern of the class has a {what} below {bound:.4} {unit} over them.")
        }
        Status::None => String::new(),
    }
}

/// The best pattern of a class over the rows of fields, with a proof.
///
/// # Errors
/// As [`search`].
pub(crate) fn prove(
    request: &exact::Request,
    fields: &[FieldFile],
    observer: &dyn Observer,
) -> Result<exact::Answer, TaskError> {
    let (model, class) = (request.model, request.class);
    let objective = objective(model, Some(request.objective))?;
    let cases = cases(model, fields, observer)?;
    let matrix = matrix_of(model, cases.iter().map(|case| &case.states))?;
    let norm = objective.norm();
    let own = model.pattern.iter().map(|named| named.pattern.clone());
    let mut starts: Vec<Pattern> = own.chain(request.starts.iter().cloned()).collect();
    starts.extend(quickly_found(matrix.clone(), norm, class, request.seed));
    let certificate = exact::watched(objective, observer, |watcher| {
        prove_samples(&model.model, matrix, norm, class, &starts, watcher)
    })?;
    let named = NamedPattern { name: exact::name_of(&certificate.pattern), pattern: certificate.pattern.clone() };
    let (best, _) = judged(model, &cases, objective, &named)?;
    Ok(exact::Answer::under_fields(request, certificate, best, fields.len()))
}

fn statement(request: &FieldSearch, cost: f64, qua: Option<f64>) -> String {
    let FieldSearch { fields, class, objective, .. } = *request;
    let over = if fields.len() == 1 { "the field".to_owned() } else { format!("{} fields", fields.len()) };
    let shown = |cost: f64| format!("{:.4} {}", deg_per_h_from_rad_per_s(cost), objective.unit());
    let against = qua.map_or_else(String::new, |qua| format!("; QUA has {}", shown(qua)));
    format!(
        "The best pattern found has a {} of {} in the class {class}, over {over}{against}. It holds for these temperatures only.",
        objective.title(),
        shown(cost)
    )
}
