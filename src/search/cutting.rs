//! Cutting planes: the worst admissible profile joins the searched ones until sampled and guaranteed agree.
//!
//! A search makes small what its profiles show. The profile under which its best pattern is worst of all that the largest
//! rate admits is usually not among them; it joins, and the search goes on. Every set of profiles is a relaxation of all of
//! them, so what is best at the end is best for the guaranteed worst rate as nearly as the two agree.
//!
//! Where a model has no guaranteed worst case, the worst of many profiles that were drawn for this takes its place.
//!
//! # Source
//! Kelley, J. SIAM 8, 703 (1960); Blankenship, Falk, J. Optim. Theory Appl. 19, 261 (1976), adaptive discretisation.

use std::ops::ControlFlow;

use super::anneal::rounds::Rounds;
use super::answer::{AGREE, Answer, Cuts, Ended};
use super::cost::guaranteed::UnitStep;
use super::cost::worst_case::SolvedProfiles;
use super::evaluator::{Evaluator, JudgeError};
use super::request::{Halt, Observer, Request, RunError};
use super::validation::Draw;
use crate::numeric::order::sort_ascending;
use crate::pattern::Pattern;
use crate::profile::{Profile, ProfileSpec};
use crate::units::{deg_per_h_from_rad_per_s, percent_from_fraction};

/// Short searches, each of which lets the worst profiles of what it found join.
const SHORT_SEARCHES: usize = 12;

/// Whole searches, if the short ones were not enough.
const WHOLE_SEARCHES: usize = 3;

/// Patterns of a search whose worst profiles join.
const PATTERNS: usize = 3;

/// Sets of profiles that stand for all where nothing is guaranteed.
const SETS: usize = 8;

/// The worst of all admissible profiles for a pattern.
enum Adversary {
    Guaranteed(Box<UnitStep>),
    Drawn(SolvedProfiles),
}

impl Adversary {
    /// The largest rate error, and the profile that makes it.
    fn worst(&self, evaluator: &Evaluator, pattern: &Pattern, name: &str) -> Result<(f64, Profile), JudgeError> {
        match self {
            Adversary::Guaranteed(step) => {
                let found = step.guaranteed(evaluator.model, pattern)?;
                Ok((found.rate_rad_per_s, found.profile(name)))
            }
            Adversary::Drawn(solved) => {
                let worst = solved.worst_case(evaluator.model, pattern)?;
                let pieces = solved.profiles()[worst.profile_index].profile.pieces().to_vec();
                let profile = Profile::new(name, pieces).expect("a profile that could be solved");
                Ok((worst.rate_rad_per_s.abs(), profile))
            }
        }
    }
}

/// Lets a search after the first one be stopped, and tells of nothing else: what is saved is the first one's state.
struct Quiet<'a>(&'a dyn Observer);

impl Observer for Quiet<'_> {
    fn advanced(&mut self, _search: &dyn Rounds) -> ControlFlow<Halt> {
        if self.0.goes_on() { ControlFlow::Continue(()) } else { ControlFlow::Break(Halt::Clock) }
    }

    fn goes_on(&self) -> bool {
        self.0.goes_on()
    }
}

/// A whole search over the profiles that its request states.
type Search = fn(&Request, &mut dyn Observer) -> Result<Option<Answer>, RunError>;

/// As the search itself, over profiles that are joined by the worst admissible ones.
///
/// # Errors
/// As the search's.
pub(crate) fn run_with_cuts(
    request: &Request,
    observer: &mut dyn Observer,
    search: Search,
) -> Result<Option<Answer>, RunError> {
    let mut spec = request.profiles.clone();
    let own = spec.listed.len();
    let adversary = adversary(request)?;
    // By the plan alone, so that a search that is taken up again has the same profiles.
    for _ in 0..SHORT_SEARCHES {
        if !joins(request, &adversary, &mut spec, own, &[])? {
            break;
        }
    }
    let mut whole: Option<Answer> = None;
    for _ in 0..WHOLE_SEARCHES {
        let mut plan = request.plan.clone();
        let is_first = whole.is_none();
        if let Some(answer) = &whole {
            plan.starts = answer.state.found.iter().take(PATTERNS).map(|f| f.segments.clone()).collect();
            plan.starts.insert(0, answer.best.pattern.segments().to_vec());
        }
        let saved = request.saved.clone().filter(|_| is_first);
        let within = Request { profiles: &spec, plan, saved, cuts: false, ..request.clone() };
        let answer = if is_first { search(&within, observer)? } else { search(&within, &mut Quiet(observer))? };
        let Some(mut answer) = answer else { return Ok(whole) };
        if let Some(first) = whole.take() {
            answer.evaluations += first.evaluations;
            answer.evaluations_now += first.evaluations_now;
            answer.state = first.state;
        }
        let solved = SolvedProfiles::new(request.model, &spec.profiles())?;
        let evaluator = within.evaluator(&solved, None);
        let (worst_rad_per_s, _) = adversary.worst(&evaluator, &answer.best.pattern, "")?;
        let cuts = Cuts {
            joined: spec.listed[own..].to_vec(),
            sampled_rad_per_s: answer.best.worst.rate_rad_per_s.abs(),
            worst_rad_per_s,
            is_guaranteed: matches!(adversary, Adversary::Guaranteed(_)),
        };
        let is_over = cuts.agree() || answer.ended == Ended::Signal || !observer.goes_on();
        let best = answer.best.pattern.clone();
        answer.statement += &words(&cuts);
        answer.cuts = Some(cuts);
        whole = Some(answer);
        if is_over {
            break;
        }
        joins(request, &adversary, &mut spec, own, &[best])?;
    }
    Ok(whole)
}

fn adversary(request: &Request) -> Result<Adversary, RunError> {
    if let Ok(step) = UnitStep::new(request.model, request.profiles.max_rate_k_per_s) {
        return Ok(Adversary::Guaranteed(Box::new(step)));
    }
    let solved = SolvedProfiles::new(request.model, &request.profiles.profiles())?;
    let spec = request.evaluator(&solved, None).drawn_spec(SETS, Draw::Rehearsal);
    Ok(Adversary::Drawn(SolvedProfiles::new(request.model, &spec.profiles())?))
}

/// Searches shortly, and lets the worst profiles of given patterns and of what it found join; false where the best one's
/// worst rate is that over the profiles already.
fn joins(
    request: &Request,
    adversary: &Adversary,
    spec: &mut ProfileSpec,
    own: usize,
    given: &[Pattern],
) -> Result<bool, RunError> {
    let profiles = spec.clone();
    let solved = SolvedProfiles::new(request.model, &profiles.profiles())?;
    let step = match adversary {
        Adversary::Guaranteed(step) => Some(step.as_ref()),
        Adversary::Drawn(_) => None,
    };
    let within = Request { profiles: &profiles, ..request.clone() };
    let evaluator = within.evaluator(&solved, step);
    let mut patterns = given.to_vec();
    patterns.extend(evaluator.short(request.class, &request.plan, &|| true)?);
    let named: Vec<(String, Pattern)> = patterns.into_iter().map(|pattern| (String::new(), pattern)).collect();
    let mut judged = evaluator.judge_all(&named)?;
    sort_ascending(&mut judged, |item| item.objective_rad_per_s);
    let mut is_apart = false;
    for (place, judged) in judged.iter().take(PATTERNS.max(given.len())).enumerate() {
        let name = format!("worst-admissible-{}", spec.listed.len() - own + 1);
        let (worst, profile) = adversary.worst(&evaluator, &judged.pattern, &name)?;
        let is_worse = worst > judged.worst.rate_rad_per_s.abs() * (1.0 + AGREE);
        is_apart |= is_worse && place == 0;
        if is_worse && !spec.listed[own..].iter().any(|known| known.pieces() == profile.pieces()) {
            spec.listed.push(profile);
        }
    }
    Ok(is_apart)
}

/// To be said after how good the best pattern is.
fn words(cuts: &Cuts) -> String {
    let shown = deg_per_h_from_rad_per_s;
    let over = if cuts.is_guaranteed { "all admissible profiles" } else { "many profiles drawn besides" };
    let agree = if cuts.agree() {
        format!("the two agree to {:.0} %", percent_from_fraction(AGREE))
    } else {
        "the two do not agree yet: search longer".to_owned()
    };
    format!(
        " With {} worst admissible profiles beside the declared ones its worst rate error is {:.4} °/h, over {over} {:.4}: \
         {agree}.",
        cuts.joined.len(),
        shown(cuts.sampled_rad_per_s),
        shown(cuts.worst_rad_per_s)
    )
}
