//! The best winding with a proof.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::io::json::{ExactJson, PatternJson, ProofJson};
use crate::io::model::ModelFile;
use crate::io::write::sample_table::print_samples;
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindabilityClass;
use crate::rate::{RateError, RateModel};
use crate::search::aside::Aside;
use crate::search::cost::guaranteed::UnitStep;
use crate::search::cost::objective::Objective;
use crate::search::cost::worst_case::SolvedProfiles;
use crate::search::evaluator::{Evaluator, JudgeError};
use crate::search::optimality::Proof;
use crate::search::proof::{Certificate, Goal, Progress, Status, Task, prove, starting_patterns};
use crate::units::deg_per_h_from_rad_per_s;

use super::{Observer, TaskError, advise};

/// What is to be proved.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The coil and its profiles.
    pub model: &'a ModelFile,
    /// The patterns among which the best is sought.
    pub class: WindabilityClass,
    /// What is made small.
    pub objective: Objective,
    /// Patterns to begin with, besides the model's own, the classics and what a short search finds.
    pub starts: Vec<Pattern>,
    /// Of the short search.
    pub seed: u64,
}

impl<'a> Request<'a> {
    /// The model's own objective, in its own class.
    pub fn new(model: &'a ModelFile) -> Self {
        let (class, seed) = (model.search.windability, model.search.seed);
        Self { model, class, objective: model.search.objective, starts: Vec::new(), seed }
    }
}

/// What was proved.
#[derive(Debug)]
pub struct Answer {
    pub(crate) certificate: Certificate,
    /// A classic winding's own, else one made of the layer count.
    pub(crate) name: String,
    /// What the proof is over: so many profiles, or fields.
    pub(crate) over: String,
    proof: Proof,
    best: PatternJson,
    model: String,
    class: WindabilityClass,
    objective: Objective,
}

impl Answer {
    /// Of a proof over the rows of so many fields, which no grid stands behind.
    pub(super) fn under_fields(request: &Request, certificate: Certificate, best: PatternJson, fields: usize) -> Self {
        Self {
            proof: Proof::of(&certificate),
            name: name_of(&certificate.pattern),
            over: counted(fields, "temperature field"),
            best,
            model: request.model.model.name.clone(),
            class: request.class,
            objective: request.objective,
            certificate,
        }
    }

    /// As the program prints it; `seconds` is how long it took.
    pub fn document(&self, seconds: f64) -> ExactJson {
        let certificate = &self.certificate;
        ExactJson {
            model: self.model.clone(),
            windability: self.class.to_string(),
            objective: self.objective.key().to_owned(),
            best: self.best.clone(),
            best_objective_deg_per_h: deg_per_h_from_rad_per_s(certificate.best_rad_per_s),
            proof: ProofJson::of(&self.proof),
            nodes: certificate.nodes,
            judged: certificate.judged,
            rows: certificate.rows.len(),
            seconds,
        }
    }

    pub(crate) fn is_optimal(&self) -> bool {
        self.certificate.status == Status::Optimal
    }

    /// The samples that the proof ran on as a table; none where the error is not linear in the segments.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub(crate) fn samples(&self, model: &ModelFile) -> Result<Option<String>, TaskError> {
        let coil = model.model.wound_coil().map_err(RateError::from)?;
        Ok(print_samples(&self.certificate.rows, coil.layer_lengths_m()))
    }
}

/// A pass is shown in so many steps.
const PROGRESS_STEPS: u64 = 1000;

/// Proves, for as long as the observer lets it.
///
/// # Errors
/// A model that cannot be solved, an objective that nothing is proved about.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Answer, TaskError> {
    let file = &request.model.clone().for_search();
    advise(file, observer);
    let model = &file.model;
    let solved = SolvedProfiles::new(model, &file.profiles.profiles())?;
    let step = UnitStep::new(model, file.profiles.max_rate_k_per_s);
    let goal = match request.objective {
        Objective::WorstRate | Objective::WorstPhase => Goal::WorstRate,
        Objective::RootMeanSquare => Goal::RootMeanSquare,
        Objective::GuaranteedRate => Goal::Guaranteed(step.as_ref().map_err(|error| JudgeError::from(error.clone()))?),
        Objective::Pointing => Goal::Pointing,
        Objective::P95 => {
            let message = format!(
                "there is no proof of \"{}\": state worst-rate, rms, guaranteed-rate or pointing, or use optimise",
                request.objective.key()
            );
            return Err(TaskError::Option { option: "--objective", message });
        }
    };
    let task = Task { model, solved: &solved, class: request.class, goal };
    let own = file.pattern.iter().map(|named| named.pattern.clone());
    let mut starts: Vec<Pattern> = own.chain(request.starts.iter().cloned()).collect();
    starts.extend(starting_patterns(&task, request.seed)?);
    let evaluator = Evaluator {
        model,
        solved: &solved,
        objective: request.objective,
        unit_step: step.as_ref().ok(),
        profiles: &file.profiles,
        tolerance: None,
    };
    starts.extend(evaluator.best_companions(request.class, &|| observer.goes_on())?);

    let certificate = watched(request.objective, observer, |watcher| prove(&task, &starts, watcher))?;

    let pattern = &certificate.pattern;
    let worst = solved.worst_case(model, pattern)?;
    let phase_rad = RateModel::new(model, pattern, &[])?.phase_rad(worst.rate_rad_per_s);
    let bound = evaluator.unit_step.and_then(|step| step.guaranteed(model, pattern).ok());
    let name = name_of(pattern);
    let aside = Aside::new(model, &solved)?;
    let best = PatternJson::new(&name, pattern, &worst, phase_rad, bound.map(|b| b.rate_rad_per_s))
        .with_margin(aside.margin.of(&solved, pattern, evaluator.steepest_k_per_s())?)
        .with_pointing(&aside.pointing(model, &solved, pattern, file.profiles.max_rate_k_per_s)?);
    Ok(Answer {
        proof: Proof::of(&certificate).beside_grid(evaluator.margin_of_any(&aside)?),
        best,
        name,
        over: counted(solved.profiles().len(), "profile"),
        model: model.name.clone(),
        class: request.class,
        objective: request.objective,
        certificate,
    })
}

/// A proof that an observer watches and may end.
pub(super) fn watched<T>(
    objective: Objective,
    observer: &dyn Observer,
    work: impl FnOnce(&(dyn Fn(Progress) -> ControlFlow<()> + Sync)) -> T,
) -> T {
    let shown = AtomicU64::new(u64::MAX);
    work(&|at: Progress| {
        let step = (at.share_done * PROGRESS_STEPS as f64) as u64;
        // Pieces of work report far more often than anything changes.
        let seen = ((at.pass * PROGRESS_STEPS as f64) as u64) << 32 | step;
        if shown.swap(seen, Ordering::Relaxed) != seen {
            observer.at(at.share_done, &words(&at, objective.unit()));
        }
        if observer.goes_on() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    })
}

fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

fn words(at: &Progress, unit: &str) -> String {
    let shown = deg_per_h_from_rad_per_s;
    format!(
        "best {:.5} {unit}, none below {:.5}, now up to {:.0} %",
        shown(at.best_rad_per_s),
        shown(at.lower_bound_rad_per_s),
        100.0 * at.pass
    )
}

/// A classic winding's own name.
pub(super) fn name_of(pattern: &Pattern) -> String {
    let layers = pattern.layers();
    let classic = Classic::ALL.into_iter().find(|c| c.pattern(layers).is_ok_and(|p| p == *pattern));
    classic.map_or_else(|| format!("exact-{layers}"), |c| c.key().to_owned())
}
