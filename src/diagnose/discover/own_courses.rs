//! Terms once more with the variables of their own set, held-out records included.
//!
//! Film, and the chambers of records that were not fitted, are those of what the search began with until a set stands.

use std::sync::Arc;

use super::NEAR;
use super::grounds::{Grounds, SAME};
use super::search::{Set, Tools};
use crate::chamber::{ChamberError, Fit};
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;

/// Sets that are looked at: those beside the best that the records hardly tell from it, and no more.
const MOST: usize = 6;

/// The best of the sets, each with its own variables, best first.
pub(super) fn with_own_courses(tools: &Tools, mut sets: Vec<Set>) -> Vec<Set> {
    let Some(least) = sets.first().map(|best| best.total() - NEAR) else { return sets };
    let near = sets.iter().take(MOST).take_while(|s| s.total() > least && !s.terms.is_empty()).count();
    let behind = sets.split_off(near);
    let mut own: Vec<Set> = sets.in_parallel().map(|set| again(tools, set)).collect();
    own.extend(behind);
    sort_descending(&mut own, |item| item.total());
    own
}

/// A set with its own variables; as it was where they are the same, or where it cannot be fitted with them.
fn again(tools: &Tools, set: Set) -> Set {
    let Ok(grounds) = own(tools, &set) else { return set };
    if grounds.courses.apart(&set.grounds.courses) <= SAME {
        return set;
    }
    let held_out_gain = set.held_out_gain;
    let Some(found) = tools.refitted(&Set { grounds: Arc::new(grounds), ..set.clone() }) else { return set };
    // Whether its last member helped the held-out records was asked beside a set with the same variables.
    Set { held_out_gain, ..tools.judged(found) }
}

fn own(tools: &Tools, set: &Set) -> Result<Grounds, ChamberError> {
    let fit = &set.explanation.fit;
    let day = |&r: &usize| tools.question.chamber.held_out(fit, r);
    let days: Result<Vec<Fit>, ChamberError> = tools.question.held_out.iter().map(day).collect();
    Grounds::new(tools.question, fit, &days?)
}
