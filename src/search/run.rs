//! The use case: search, early conclusion, proof, check on a finer grid, unseen profiles, recommendation.

use std::ops::ControlFlow;

use super::anneal::rounds::{Rounds, State, Stop};
use super::answer::{Answer, Ended, Former, FoundBy};
use super::aside::{Aside, Resolution};
use super::cost::guaranteed::UnitStep;
use super::cost::objective::Objective;
use super::cost::worst_case::SolvedProfiles;
use super::cutting::run_with_cuts;
use super::end_turns::BestEndTurns;
use super::evaluator::{EQUALLY_GOOD, Evaluator, Judged, improvement_over_qua};
use super::optimality::Proof;
use super::proof::{self, Status, prove};
use super::recommendation::{Advised, Context};
pub use super::request::{Halt, Observer, Request, RunError, Unobserved};
use super::weighing::TIE;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;

/// Searches; `None` if the observer ended it before anything was found.
///
/// # Example
/// ```
/// use coilwright::search::{Objective, Request, Unobserved, run};
/// use coilwright::{CoilModel, ProfileSpec};
///
/// let model = CoilModel::builder("eight layers", 8).mean_diameter_m(0.08).turns_per_layer(98.0).build()?;
/// let profiles = ProfileSpec { count: 2, ..ProfileSpec::default() };
/// let request = Request { objective: Objective::GuaranteedRate, prove: true, ..Request::new(&model, &profiles) };
/// let answer = run(&request, &mut Unobserved)?.expect("nobody ends it");
/// // No pattern is better than the best, QUA among them, but for rounding.
/// let qua = answer.baselines.iter().find(|judged| judged.name == "qua").expect("eight layers have one");
/// assert!(answer.best.objective_rad_per_s <= qua.objective_rad_per_s * (1.0 + 1e-9));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A model that cannot be solved, an objective that it has not; a saved state of another search.
#[expect(clippy::too_many_lines, reason = "the steps of a search in their order, each one call")]
pub fn run(request: &Request, observer: &mut dyn Observer) -> Result<Option<Answer>, RunError> {
    if request.cuts {
        return run_with_cuts(request, observer, run);
    }
    let solved = SolvedProfiles::new(request.model, &request.profiles.profiles())?;
    let unit_step = UnitStep::new(request.model, request.profiles.max_rate_k_per_s).ok();
    let evaluator = request.evaluator(&solved, unit_step.as_ref());
    let (class, target) = (request.class, request.plan.rules.target);
    let baselines = evaluator.baselines()?;
    let mut search = evaluator.search(class, request.plan.clone(), request.saved.clone())?.ok_or(RunError::Resume)?;
    observer.begun(search.as_ref());
    let before = search.evaluations();
    // Where the best can be proved at once, nothing needs to be shared.
    let shared = if evaluator.is_provable(class) {
        Vec::new()
    } else {
        evaluator.companions(class, &request.plan, &|| observer.goes_on())?
    };
    let Annealed { ended, concluded } = anneal(&evaluator, class, &baselines, search.as_mut(), observer)?;
    observer.ended(search.as_ref());
    search.gather();
    let is_over = ended == Ended::Signal;
    let is_refined = matches!(ended, Ended::Rule(_))
        && concluded.is_none()
        && target.is_none()
        && (request.is_refined() || search.is_approximated());
    let found = evaluator.gathered(search.as_ref(), class, &shared, is_refined, &|| observer.goes_on());
    let Some(best) = evaluator.best(class, &found, &baselines)? else { return Ok(None) };
    let is_good_enough = |judged: &Judged| target.is_some_and(|target| judged.objective_rad_per_s <= target);
    let annealed = best.pattern.clone();
    // A target may have been reached at the samples and not between them.
    let is_unhurried = matches!(ended, Ended::Rule(_)) && !is_good_enough(&best);
    let best = match concluded {
        Some(concluded) => concluded,
        None if is_unhurried => evaluator.improved_beyond(&shared, class, best, &found, target)?,
        None => best,
    };
    let found_by = found_by(&best, &annealed, &baselines, search.state(), &shared);
    let (best, proof) = match evaluator.task(class).filter(|_| request.prove && !is_over) {
        Some(task) => proved(&evaluator, &task, best, &baselines, observer)?,
        None => (best, Proof::NONE),
    };
    let grid_check = if is_over { None } else { evaluator.grid_check(&best, &baselines)? };
    let compared_with =
        request.former.as_ref().map(|f| compare_with_former(&evaluator, class, &best, f)).transpose()?;
    let advised = if is_over || !request.recommend {
        None
    } else {
        let (seed, uncertain) = (request.plan.seed, request.uncertain);
        let former = request.former.as_ref();
        let context = Context { class, best: &best, baselines: &baselines, proof: &proof, former, uncertain, seed };
        Some(evaluator.advised(&context, &found, &shared)?)
    };
    let (validation, recommendation, outlook, boundary) = match advised {
        Some(Advised { validation, recommendation, outlook, boundary }) => {
            (Some(validation), Some(recommendation), outlook, boundary)
        }
        None => (None, None, None, None),
    };
    let resolution =
        (!is_over).then(|| Resolution::of(request.objective, request.model, &solved, &best.pattern)).transpose()?;
    // What is less counts as equal anyway.
    let told = resolution.filter(|r| r.change_rad_per_s > TIE * best.objective_rad_per_s);
    let caution = grid_check.as_ref().and_then(|check| check.caution()).map(|words| format!(" {words}"));
    let on_unseen = validation.as_ref().map(|v| evaluator.words_on_unseen(v, &best, &baselines));
    let statement = evaluator.statement(&best, &baselines, class)
        + &on_unseen.unwrap_or_default()
        + &proof.words(request.objective)
        + &told.map(|r| format!(" {}", r.words(request.objective))).unwrap_or_default()
        + &caution.unwrap_or_default();
    let aside = Aside::new(request.model, &solved)?;
    let best = evaluator.completed(&aside, best)?;
    let baselines =
        baselines.into_iter().map(|b| evaluator.completed(&aside, b)).collect::<Result<Vec<Judged>, _>>()?;
    let proof = if proof.status == Status::None { proof } else { proof.beside_grid(evaluator.margin_of_any(&aside)?) };
    let first = search.state().first_with_best().map_or(0, |record| record.evaluations);
    let mut answer = Answer {
        improvement_over_qua: improvement_over_qua(&best, &baselines),
        statement,
        grid_check,
        resolution,
        compared_with,
        proof,
        evaluations_when_found: match found_by {
            FoundBy::Classic => 0,
            FoundBy::Annealing => first,
            FoundBy::Shared | FoundBy::Bounds => search.evaluations(),
        },
        found_by,
        evaluations: search.evaluations(),
        evaluations_now: search.evaluations() - before,
        state: search.state().clone(),
        ended,
        validation,
        recommendation,
        outlook,
        boundary,
        cuts: None,
        ends: None,
        best,
        baselines,
    };
    if request.ends.is_any() && !is_over {
        let ends = evaluator
            .best_with_end_turns(request.ends, class, &answer.best, answer.others(), &|| observer.goes_on())?;
        answer.ends = Some(BestEndTurns { judged: evaluator.completed(&aside, ends.judged)?, ..ends });
    }
    Ok(Some(answer))
}

impl Request<'_> {
    /// A largest value over samples has its working set instead, and bounds where the class has them.
    fn is_refined(&self) -> bool {
        !matches!(self.objective, Objective::WorstRate | Objective::WorstPhase)
    }
}

/// How the rounds came to their end.
struct Annealed {
    ended: Ended,
    /// A pattern that was proved to be the best, or made good enough, after the first round.
    concluded: Option<Judged>,
}

/// Advances a search to its end. After its first round what was found is tried by bounds, where those can be expected to
/// settle the search.
fn anneal(
    evaluator: &Evaluator,
    class: WindabilityClass,
    baselines: &[Judged],
    search: &mut dyn Rounds,
    observer: &mut dyn Observer,
) -> Result<Annealed, RunError> {
    let mut concluded = None;
    let mut asked = false;
    let mut halt = ControlFlow::Continue(());
    let ended = loop {
        // Before the next advance: a search that goes on from a checkpoint may stand right behind its first round. Where that was
        // its last one too, it was not asked before the checkpoint either.
        let is_over = matches!(search.state().stop, Some(Stop::Rounds | Stop::Moves | Stop::Patience));
        if search.state().round == 1 && !is_over && !std::mem::replace(&mut asked, true) {
            concluded = conclusion(evaluator, class, baselines, search)?;
            if concluded.is_some() {
                break Ended::Rule(search.state().stop);
            }
        }
        match halt {
            ControlFlow::Break(Halt::Clock) => break Ended::Clock,
            ControlFlow::Break(Halt::Signal) => break Ended::Signal,
            ControlFlow::Continue(()) => {}
        }
        let goes_on = search.advance();
        halt = observer.advanced(search);
        if !goes_on {
            break Ended::Rule(search.state().stop);
        }
    };
    Ok(Annealed { ended, concluded })
}

/// The pattern that needs no further search, if bounds show one.
fn conclusion(
    evaluator: &Evaluator,
    class: WindabilityClass,
    baselines: &[Judged],
    search: &mut dyn Rounds,
) -> Result<Option<Judged>, RunError> {
    if !evaluator.is_provable(class) {
        return Ok(None);
    }
    let found = search.state().found.clone();
    let Some(best) = evaluator.best(class, &found, baselines)? else { return Ok(None) };
    let target = search.plan().rules.target;
    let (best, is_optimal) = evaluator.improved(class, best, &found, target)?;
    let is_good_enough = target.is_some_and(|target| best.objective_rad_per_s <= target);
    let stop = if is_optimal { Some(Stop::Proved) } else { is_good_enough.then_some(Stop::Target) };
    Ok(stop.map(|stop| {
        search.conclude(stop);
        best
    }))
}

fn found_by(best: &Judged, annealed: &Pattern, baselines: &[Judged], state: &State, shared: &[Pattern]) -> FoundBy {
    let was_annealed = state.found.iter().any(|f| f.segments == best.pattern.segments());
    if best.pattern != *annealed {
        FoundBy::Bounds
    } else if baselines.iter().any(|b| b.pattern == best.pattern) {
        FoundBy::Classic
    } else if !was_annealed && !shared.is_empty() {
        FoundBy::Shared
    } else {
        FoundBy::Annealing
    }
}

/// Tries to prove that the best pattern is the best of its class; a better one that the proof comes upon takes its place.
fn proved(
    evaluator: &Evaluator,
    task: &proof::Task,
    best: Judged,
    others: &[Judged],
    observer: &dyn Observer,
) -> Result<(Judged, Proof), RunError> {
    let starts: Vec<Pattern> = std::iter::once(&best).chain(others).map(|judged| judged.pattern.clone()).collect();
    let certificate = prove(task, &starts, &|at| observer.proving(at))?;
    let best = if certificate.best_rad_per_s < best.objective_rad_per_s {
        evaluator.judge(&best.name, &certificate.pattern)?
    } else {
        best
    };
    Ok((best, Proof::of(&certificate)))
}

/// The former pattern judged under the model of the search, beside the best one found.
fn compare_with_former(
    evaluator: &Evaluator,
    class: WindabilityClass,
    best: &Judged,
    (name, pattern): &(String, Pattern),
) -> Result<Former, RunError> {
    let old = evaluator.judge(name, pattern)?;
    let (new_cost, old_cost) = (best.objective_rad_per_s, old.objective_rad_per_s);
    let best_changed = new_cost < old_cost * (1.0 - EQUALLY_GOOD);
    let what = evaluator.objective.key();
    let shown = |cost: f64| evaluator.objective.shown(cost);
    let (old_shown, new_shown) = (shown(old_cost), shown(new_cost));
    let statement = if best_changed {
        format!(
            "The best pattern changed: under this model the former one, {name}, costs {old_shown} ({what}), {:.2} times the {new_shown} of the new one, {}.",
            old_cost / new_cost,
            best.name
        )
    } else if old_cost < new_cost * (1.0 - EQUALLY_GOOD) {
        let why = if class.admits(pattern) {
            "search longer, or begin with it (--init)".to_owned()
        } else {
            format!("it is not of the class {class}")
        };
        format!(
            "The former pattern, {name}, is better than what was found: it costs {old_shown} ({what}) under this model, the new one {new_shown}; {why}."
        )
    } else {
        format!(
            "The best pattern did not change: under this model the former one, {name}, costs {old_shown} ({what}), and nothing better was found."
        )
    };
    Ok(Former { judged: old, best_changed, statement })
}

#[cfg(test)]
mod tests;
