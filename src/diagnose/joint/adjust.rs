//! What of a difference between sets is evidence: less than it seems where the records' air is not quite what a chamber's is taken for.

use super::{Explanation, Outcome, Question};
use crate::chamber::DifferenceVariance;
use crate::parallel::InParallel;

/// Divides the difference in log likelihood of each set from the first by as much as it varies beyond what it should; what priors and
/// prices make of their difference stays.
///
/// # Errors
/// A set that cannot be solved.
pub(super) fn adjust(question: &Question, explanations: &mut [Explanation]) -> Outcome<()> {
    let Some((best, others)) = explanations.split_first_mut() else { return Ok(()) };
    best.understated = 0.0;
    let best = &*best;
    others.iter_mut().in_parallel().try_for_each(|other| {
        let behind = best.log_likelihood() - other.log_likelihood();
        let divisor = variance(question, best, other)?.divisor();
        other.understated = if behind.is_finite() { behind * (1.0 - 1.0 / divisor) } else { 0.0 };
        Ok(())
    })
}

/// How the difference varies over all records.
fn variance(question: &Question, best: &Explanation, other: &Explanation) -> Outcome<DifferenceVariance> {
    let fitted = question.fitted.iter().map(|&r| question.chamber.difference_variance(&best.fit, &other.fit, r));
    let days = best.fit.days.iter().zip(&*other.fit.days);
    let held_out = question.held_out.iter().zip(days);
    let held_out = held_out.map(|(&r, (a, b))| question.chamber.difference_variance(a, b, r));
    fitted.chain(held_out).try_fold(DifferenceVariance::default(), |sum, own| Ok(sum.and(own?)))
}
