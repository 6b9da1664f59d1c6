//! What may be there beside a fit of the declared model: one round of the search, without looking further.

use std::cell::OnceCell;

use super::explanation::{fitted, with};
use super::odds::{CERTAIN, EFFECT};
use super::readings::take_off;
use super::screen::{Proposal, proposals};
use super::{Explanation, Member, Outcome, Question};
use crate::chamber::{Effort, Fit};
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;

/// Something that may be there beside a fit of the declared model.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beside {
    /// None: wander that no gyro of this noise has.
    pub(crate) candidate: Option<usize>,
    /// Of the log likelihood, and with what its parameters and its prior cost.
    pub(crate) gain: f64,
    pub(crate) merit: f64,
}

/// Candidates that are fitted where the score test promises that they are better.
const CONFIRMED: usize = 3;

/// What is worth more than it costs beside a fit of the declared model: a wander, and where there is none, candidates that
/// promise it, as fitted.
///
/// # Errors
/// A model that cannot be solved for these records.
pub(crate) fn beside(question: &Question, null: &Fit, wandering: &Fit) -> Outcome<Vec<Beside>> {
    let null = Explanation::new(question, &[], Vec::new(), null.clone());
    let wandering = Explanation::new(question, &[], vec![Member::Drift], wandering.clone());
    let merit = wandering.merit - null.merit;
    if merit > CERTAIN.log {
        let gain = wandering.fit.log_likelihood - null.fit.log_likelihood;
        return Ok(vec![Beside { candidate: None, gain, merit }]);
    }
    let rows = (super::rates(question.chamber, &null.fit) as f64).ln();
    let merit = |p: &Proposal| match p.member {
        Member::Effect(place) => p.gain - 0.5 * question.candidates[place].free.len() as f64 * rows + EFFECT.log,
        _ => f64::NEG_INFINITY,
    };
    let mut promising = proposals(question, &null)?;
    promising.retain(|p| merit(p) > CERTAIN.log);
    sort_descending(&mut promising, merit);
    let mut seen = Vec::new();
    promising.retain(|p| {
        !seen.contains(&p.member) && {
            seen.push(p.member);
            true
        }
    });
    promising.truncate(CONFIRMED);
    let fits = promising.in_parallel().filter_map(|Proposal { member, values, .. }| {
        let begin = with(question, &[], &null.fit, member, values)?;
        fitted(question, &[], vec![member], &begin, &null.fit, Effort::QUICK)
    });
    let mut fits: Vec<Explanation> = fits.collect();
    fits.retain(|there| there.members.iter().any(|m| !there.is_no_news(question.model.effects.len(), *m)));
    take_off(question, &OnceCell::new(), &null.fit, &mut fits);
    let found = fits.into_iter().map(|there| {
        let candidate = match there.members[..] {
            [Member::Effect(place)] => Some(place),
            _ => None,
        };
        let gain = there.fit.log_likelihood - null.fit.log_likelihood;
        Beside { candidate, gain, merit: there.total() - null.total() }
    });
    Ok(found.filter(|b| b.merit > CERTAIN.log).collect())
}
