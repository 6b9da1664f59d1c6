//! Sets of explanations, each with its own kinks of the air.
//!
//! Where the air is straight but for kinks, readings place them ([`crate::chamber::Chamber::with_shocks`]), by what a set makes of the
//! coil and the sensor. Placed by one set they favour it: another sees the air turn at other times and has to bend it there. So
//! the foremost sets are compared with the kinks that each would have placed,
//!
//! ```text
//! M(set, its kinks) − n ln(1/p)         n: kinks that it needs more than there were; p: how often a row has one
//! ```
//!
//! and the search goes on in the chamber of the best. A set that is wrong needs kinks that the truth does without.

use rayon::prelude::*;

use super::{Explanation, Question, Winding};
use crate::chamber::{Chamber, Effort};

/// Sets that are looked at with kinks of their own after each score test: more are behind by what no kinks make up for.
const LOOKED_AT: usize = 4;

/// A set in a chamber with its own kinks.
pub(super) struct OwnKinks<'a> {
    pub(crate) chamber: Chamber<'a>,
    pub(crate) explanation: Explanation,
    /// With what its kinks cost more than those of the common chamber.
    pub(crate) merit: f64,
}

/// The best of the foremost sets, each with its own kinks; None where no air is straight. `found` is in order.
pub(super) fn best_by_own_kinks<'a>(
    chamber: &Chamber<'a>,
    question: &Question,
    windings: &[Winding],
    found: &[Explanation],
) -> Option<OwnKinks<'a>> {
    let foremost: Vec<&Explanation> = found.iter().filter(|e| !e.is_beyond_physical()).take(LOOKED_AT).collect();
    let own = foremost.into_par_iter().filter_map(|e| {
        let (chamber, fit, prices) = chamber.with_own_kinks(&e.fit, Effort::QUICK).ok()??;
        let price: f64 = question.fitted.iter().map(|&r| prices[r]).sum();
        let there = Question { chamber: &chamber, ..question.clone() };
        let explanation = Explanation::new(&there, windings, e.members.clone(), fit);
        let merit = explanation.merit - price;
        Some(OwnKinks { chamber, explanation, merit })
    });
    let own: Vec<OwnKinks> = own.collect();
    own.into_iter().filter(|o| !o.explanation.is_beyond_physical()).max_by(|a, b| a.merit.total_cmp(&b.merit))
}
