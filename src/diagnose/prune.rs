//! What a set of effects must be to stay: needed, confirmed, and of a practical size.

use super::candidate::{Candidate, is_declared_number};
use super::confirm::confirmation;
use super::evidence::{Evidence, Role};
use super::hypothesis::{Hypothesis, Trial};
use super::plain::compete;
use super::search::{settled, without};
use super::verdict::{EQUAL, MOST_ROUNDS};
use super::{Caution, DiagnoseError, Refusal};
use crate::rate::CoilModel;

/// An effect must lower χ² by this share of the rows: a root mean square of a tenth of the noise.
const LEAST_SHARE_OF_ROWS: f64 = 0.01;
/// … and by this share of the coil's own signal: no model is more accurate. (Complete models leave 0.05 % in records of an
/// independent simulator; a real coil's numbers are not known as well.)
const LEAST_SHARE_OF_SIGNAL: f64 = 0.003;
/// A factor this close to one is the model's accuracy, not physics.
const LEAST_FACTOR: f64 = 0.02;
/// χ² of unseen data must fall by this.
const CONFIRMED: f64 = 4.0;

/// What effects are measured against.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bar<'a> {
    /// The model as declared.
    pub base: &'a Hypothesis,
    /// Of one whitened residual of a model that explains the records.
    pub variance: f64,
    /// χ² of a constant in the place of what the declared model predicts, without noise.
    pub signal: f64,
    /// Reduced χ² beyond 1 that is no excess.
    pub tolerated: f64,
}

impl Bar<'_> {
    /// χ² that may be the model's own inaccuracy.
    pub fn accuracy(&self) -> f64 {
        LEAST_SHARE_OF_SIGNAL.powi(2) * self.signal
    }
}

/// Boundaries for what is left, and what is left on them, until nothing goes any more.
pub(super) fn settled_and_pruned(
    evidence: &mut Evidence,
    model: &CoilModel,
    candidates: &[Candidate],
    mut best: Hypothesis,
    bar: &Bar,
    cautions: &mut Vec<Caution>,
) -> Result<Hypothesis, DiagnoseError> {
    for _ in 0..MOST_ROUNDS {
        best = settled(evidence, model, candidates, best)?;
        let members = best.members.len();
        best = prune(&Trial { evidence, model, candidates }, best, bar, cautions);
        if best.members.len() == members {
            break;
        }
    }
    Ok(best)
}

/// What is not needed, not confirmed or not of a practical size goes, the least significant first; so does what explains
/// less than what is left over, or than a plain function of time: it may be that thing's shadow.
pub(super) fn prune(trial: &Trial, mut best: Hypothesis, bar: &Bar, cautions: &mut Vec<Caution>) -> Hypothesis {
    let Bar { base, tolerated, .. } = *bar;
    let rows = trial.evidence.rows(Role::Fit);
    let kind = |h: &Hypothesis, place: usize| trial.candidates[h.members[place].candidate].kind();
    while let Some((out, kind, reason)) = refusal(trial, &best, rows, bar) {
        cautions.push(Caution::Refused { kind, reason });
        match without(trial, &best, out) {
            Some(smaller) => best = smaller,
            None => break,
        }
    }
    let plain = compete(trial.evidence, trial.model, &base.residuals);
    let plain = plain.iter().map(|p| p.gain - p.parameters.saturating_sub(best.parameters) as f64 * (rows as f64).ln());
    let plain_gain = plain.fold(0.0, f64::max);
    if !best.members.is_empty() && plain_gain > base.chi_square - best.chi_square - EQUAL {
        let kinds = (0..best.members.len()).map(|place| kind(&best, place));
        cautions.extend(kinds.map(|kind| Caution::Refused { kind, reason: Refusal::Outdone }));
        return base.clone();
    }
    let excess = |h: &Hypothesis| h.chi_square - rows as f64;
    while excess(&best) > tolerated * rows as f64 {
        let rests = (0..best.members.len()).filter_map(|out| Some((out, without(trial, &best, out)?)));
        let weakest = rests.min_by(|a, b| a.1.chi_square.total_cmp(&b.1.chi_square));
        match weakest {
            Some((out, rest)) if rest.chi_square - best.chi_square < excess(&best) => {
                cautions.push(Caution::Refused { kind: kind(&best, out), reason: Refusal::Outdone });
                best = rest;
            }
            _ => break,
        }
    }
    best
}

/// The first member that cannot stay, and why; the least significant first.
fn refusal(trial: &Trial, best: &Hypothesis, rows: usize, bar: &Bar) -> Option<(usize, String, Refusal)> {
    let Bar { variance, .. } = *bar;
    let mut order: Vec<(usize, Hypothesis)> =
        (0..best.members.len()).filter_map(|out| Some((out, without(trial, best, out)?))).collect();
    order.sort_by(|a, b| a.1.chi_square.total_cmp(&b.1.chi_square));
    let least = (LEAST_SHARE_OF_ROWS * rows as f64).max(bar.accuracy());
    order.into_iter().find_map(|(out, rest)| {
        let member = &best.members[out];
        let candidate = &trial.candidates[member.candidate];
        let reason = if is_declared_number(&candidate.effect) && (member.values[0] - 1.0).abs() < LEAST_FACTOR {
            Refusal::FactorNearOne
        } else if rest.chi_square - best.chi_square < least * variance {
            Refusal::Small
        } else if confirmation(trial, best, &rest).is_none_or(|less| less < CONFIRMED * variance) {
            Refusal::Unconfirmed
        } else {
            return None;
        };
        Some((out, candidate.kind(), reason))
    })
}
