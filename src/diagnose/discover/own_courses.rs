//! Terms once more with the variables of their own set.
//!
//! Layers are what the readings imply by a model: of a pack on a spool they run otherwise than of a bare one. The search takes them
//! from what stood before it; a set that does without that model's effects, or with others, has another course, and amplitudes
//! and inner numbers that belong to it.

use rayon::prelude::*;

use super::NEAR;
use super::grammar::Allowed;
use super::search::{Set, Tools};
use super::tools;
use crate::chamber::ChamberError;

/// Variables that differ by less than this share of their range are the same: a tenth of the best stated error of an amplitude.
const SAME: f64 = 1e-3;
/// Sets that are looked at: those beside the best that the records hardly tell from it, and no more.
const MOST: usize = 6;

/// The best of the sets, each with its own variables, best first; and what the first of them is worked on with, None where that is
/// what it was.
///
/// # Errors
/// A set whose model cannot be solved.
pub(super) fn with_own_courses<'q, 'a>(
    tools: &Tools<'q, 'a>,
    mut sets: Vec<Set>,
    allowed: &Allowed,
) -> Result<(Vec<Set>, Option<Tools<'q, 'a>>), ChamberError> {
    let Some(least) = sets.first().map(|best| best.total() - NEAR) else { return Ok((sets, None)) };
    let near = sets.iter().take(MOST).take_while(|s| s.total() > least && !s.terms.is_empty()).count();
    let behind = sets.split_off(near);
    let mut own: Vec<Set> = sets.into_par_iter().map(|set| again(tools, set, allowed)).collect();
    own.extend(behind);
    own.sort_by(|a, b| b.total().total_cmp(&a.total()));
    let of_best = of(tools, &own[0], allowed)?.filter(|there| there.courses.apart(&tools.courses) > SAME);
    Ok((own, of_best))
}

/// A set with its own variables; as it was where they are the same, or where it cannot be fitted with them.
fn again(tools: &Tools, set: Set, allowed: &Allowed) -> Set {
    let Ok(Some(there)) = of(tools, &set, allowed) else { return set };
    if there.courses.apart(&tools.courses) <= SAME {
        return set;
    }
    let Some(found) = there.refitted(&set) else { return set };
    let found = there.judged(found);
    // Whether its last member helped the held-out records was asked beside a set with the same variables.
    Set { held_out_gain: set.held_out_gain, ..found }
}

fn of<'q, 'a>(tools: &Tools<'q, 'a>, set: &Set, allowed: &Allowed) -> Result<Option<Tools<'q, 'a>>, ChamberError> {
    self::tools(tools.question, tools.windings, &set.explanation.fit, allowed)
}
