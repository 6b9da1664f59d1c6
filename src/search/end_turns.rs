//! Turns at the ends of the fibre as design variables, beside the order of whole layers.
//!
//! Ω is affine in the length of fibre that is added or left off at an end, but for its share of the fibre's whole length: an
//! objective that is a norm of Ω is then all but convex in turns, and one minimum along a line of them is the smallest. Each pattern
//! is tried along two lines, turns left off at either end and turns moved from one end to the other on the outermost layer; from the
//! smallest on them neighbours in both ends' turns are followed downhill. All values are the reference's.
//!
//! # Source
//! Turns that are added to or left off the ends of a coil against its thermal error: Goettsche and Bergh, US 5 506 923 (1996);
//! Goettsche, EP 0 866 946 B1 (2006), "negative trimming".

use std::collections::HashMap;

use super::cost::objective::Objective;
use super::evaluator::{EQUALLY_GOOD, Evaluator, JudgeError, Judged};
use crate::pattern::windability::WindabilityClass;
use crate::pattern::{EndTurns, Half, Pattern};
use crate::rate::RateError;
use crate::search::cost::worst_case::SearchError;
use crate::units::{deg_per_h_from_rad_per_s, percent_from_fraction};

/// Which turns a search may choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EndChoice {
    /// At most so many turns are left off at an end.
    pub most_left_off: u32,
    /// Whether turns of the outermost layer may be given to the other end of the fibre.
    pub shares_outermost: bool,
}

/// The best pattern with turns of its own at the ends.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BestEndTurns {
    pub(crate) choice: EndChoice,
    /// Without such turns where none make it better.
    pub(crate) judged: Judged,
    /// The same order of whole layers, by its name and objective.
    pub(crate) whole: (String, f64),
    pub(crate) statement: String,
}

/// Patterns that are tried: the best of the search, the classics, and what else it found; fewer where each is judged on many coils.
const PATTERNS: usize = 12;
const PATTERNS_OVER_COILS: usize = 3;

impl EndChoice {
    pub(crate) fn is_any(self) -> bool {
        self.shares_outermost || self.most_left_off > 0
    }

    /// Whether a pattern may have such turns, as far as the choice says.
    fn admits(self, EndTurns { a, b }: EndTurns) -> bool {
        let most = i64::from(self.most_left_off);
        let (a, b) = (i64::from(a), i64::from(b));
        if a > 0 || b > 0 { self.shares_outermost && -(a + b) <= most } else { a.min(b) >= -most }
    }
}

impl Evaluator<'_> {
    /// The best that turns at the ends make of what a search came to and of `others`, likeliest first; `goes_on` is asked between patterns.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(crate) fn best_with_end_turns(
        &self,
        choice: EndChoice,
        class: WindabilityClass,
        of_search: &Judged,
        others: impl Iterator<Item = (String, Pattern)>,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<BestEndTurns, JudgeError> {
        let most = if self.objective == Objective::P95 { PATTERNS_OVER_COILS } else { PATTERNS };
        let mut known: Vec<(String, Pattern)> = vec![(of_search.name.clone(), of_search.pattern.clone())];
        for (name, pattern) in others {
            if known.len() < most && class.admits(&pattern) && known.iter().all(|(_, other)| *other != pattern) {
                known.push((name, pattern));
            }
        }
        let mut best: Option<(Judged, (String, f64))> = None;
        for (name, pattern) in known {
            if best.is_some() && !goes_on() {
                break;
            }
            let (judged, whole_rad_per_s) = self.best_end_turns(choice, class, &name, &pattern)?;
            let is_better = best
                .as_ref()
                .is_none_or(|(best, _)| judged.objective_rad_per_s < best.objective_rad_per_s * (1.0 - EQUALLY_GOOD));
            if is_better {
                best = Some((judged, (name, whole_rad_per_s)));
            }
        }
        let (judged, whole) = best.expect("the best pattern of the search is tried first");
        let statement = self.words_on_end_turns(&judged, of_search);
        Ok(BestEndTurns { choice, judged, whole, statement })
    }

    /// The best turns at the ends of one pattern, and its objective with whole layers.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(crate) fn best_end_turns(
        &self,
        choice: EndChoice,
        class: WindabilityClass,
        name: &str,
        pattern: &Pattern,
    ) -> Result<(Judged, f64), JudgeError> {
        let mut tried = Tried { evaluator: self, choice, class, name, pattern, judged: HashMap::new() };
        let whole = EndTurns::default();
        let mut best = whole;
        let whole_rad_per_s = tried.value(whole)?;
        let most = i32::try_from(choice.most_left_off).unwrap_or(i32::MAX);
        let fewer = |end: Half| {
            move |k: i32| match end {
                Half::A => EndTurns { a: -k, b: 0 },
                Half::B => EndTurns { a: 0, b: -k },
            }
        };
        let turns = self.model.wound_coil().map_err(SearchError::from)?.turns().to_vec();
        let layers = pattern.layers_by_segment();
        let room = |layer: usize| (turns[layer].ceil() as i32 - 1).max(0);
        let outermost = turns.len() - 1;
        let (of_a, of_b) = (layers[0], layers[outermost]);
        let signed = |k: i32| if k < 0 { fewer(Half::A)(-k) } else { fewer(Half::B)(k) };
        let on_line = tried.least(&signed, -room(of_a).min(most), room(of_b).min(most))?;
        if tried.value(on_line)? < tried.value(best)? {
            best = on_line;
        }
        if let Some(owner) = pattern.end_on_outermost_layer().filter(|_| choice.shares_outermost) {
            let moved = |k: i32| match owner {
                Half::A => EndTurns { a: -k, b: k },
                Half::B => EndTurns { a: k, b: -k },
            };
            let on_line = tried.least(&moved, 0, room(outermost))?;
            if tried.value(on_line)? < tried.value(best)? {
                best = on_line;
            }
        }
        best = tried.downhill(best)?;
        let judged = tried.judged.remove(&best).flatten().expect("the best was judged");
        Ok((judged, whole_rad_per_s))
    }

    fn words_on_end_turns(&self, judged: &Judged, best: &Judged) -> String {
        let (what, unit) = (self.objective.title(), self.objective.unit());
        let shown = |judged: &Judged| format!("{:.4} {unit}", deg_per_h_from_rad_per_s(judged.objective_rad_per_s));
        let ends = judged.pattern.end_turns();
        if ends.is_none() || best.objective_rad_per_s <= 0.0 {
            return format!("No turns at the ends make the {what} smaller than {} of whole layers.", shown(best));
        }
        let less = percent_from_fraction(1.0 - judged.objective_rad_per_s / best.objective_rad_per_s);
        format!(
            "With {ends}, {} has a {what} of {}, {less:.1} % less than the {} of the best of whole layers, {}.",
            judged.name,
            shown(judged),
            shown(best),
            best.name
        )
    }
}

/// One pattern with the turns that were tried at its ends; none where it cannot be wound so.
struct Tried<'a> {
    evaluator: &'a Evaluator<'a>,
    choice: EndChoice,
    class: WindabilityClass,
    name: &'a str,
    pattern: &'a Pattern,
    judged: HashMap<EndTurns, Option<Judged>>,
}

impl Tried<'_> {
    /// The objective; infinite for what cannot be wound or may not be.
    fn value(&mut self, ends: EndTurns) -> Result<f64, JudgeError> {
        if !self.judged.contains_key(&ends) {
            let judged = self.judge(ends)?;
            self.judged.insert(ends, judged);
        }
        Ok(self.judged[&ends].as_ref().map_or(f64::INFINITY, |judged| judged.objective_rad_per_s))
    }

    fn judge(&self, ends: EndTurns) -> Result<Option<Judged>, JudgeError> {
        if !self.choice.admits(ends) {
            return Ok(None);
        }
        let Ok(pattern) = self.pattern.clone().with_end_turns(ends) else { return Ok(None) };
        if !self.class.admits(&pattern) {
            return Ok(None);
        }
        let name = if ends.is_none() { self.name.to_owned() } else { format!("{}{:+}{:+}", self.name, ends.a, ends.b) };
        match self.evaluator.judge(&name, &pattern) {
            Ok(judged) => Ok(Some(judged)),
            Err(JudgeError::Search(SearchError::Rate(RateError::EndTurns { .. }))) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The smallest along a line of turns, by thirds.
    fn least(&mut self, at: &dyn Fn(i32) -> EndTurns, mut low: i32, mut high: i32) -> Result<EndTurns, JudgeError> {
        while high - low > 3 {
            let third = (high - low) / 3;
            let (left, right) = (low + third, high - third);
            if self.value(at(left))? <= self.value(at(right))? {
                high = right;
            } else {
                low = left;
            }
        }
        let mut best = at(low);
        for k in low + 1..=high {
            if self.value(at(k))? < self.value(best)? {
                best = at(k);
            }
        }
        Ok(best)
    }

    /// Neighbours in the turns of both ends, as long as one is better.
    fn downhill(&mut self, mut best: EndTurns) -> Result<EndTurns, JudgeError> {
        loop {
            let from = best;
            for (a, b) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, -1), (-1, 1), (1, 1), (-1, -1)] {
                let there = EndTurns { a: from.a + a, b: from.b + b };
                if self.value(there)? < self.value(best)? * (1.0 - EQUALLY_GOOD) {
                    best = there;
                }
            }
            if best == from {
                return Ok(best);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::classic::Classic;
    use crate::profile::ProfileSpec;
    use crate::search::cost::guaranteed::UnitStep;
    use crate::search::cost::samples::tests::{model, profiles};
    use crate::search::cost::worst_case::SolvedProfiles;

    #[test]
    fn the_turns_found_are_the_best_of_all_that_the_choice_admits() {
        for (objective, effects) in [
            (Objective::WorstRate, &["surface_film"][..]),
            (Objective::GuaranteedRate, &["surface_film", "strain_mismatch"]),
        ] {
            let model = model(6, LayerLength::Actual, effects);
            let listed = profiles();
            let spec =
                ProfileSpec { max_rate_k_per_s: 0.003, count: 2, segments: 3, duration_s: 400.0, seed: 1, listed };
            let solved = SolvedProfiles::new(&model, &spec.profiles()).unwrap();
            let step = UnitStep::new(&model, spec.max_rate_k_per_s).unwrap();
            let evaluator = Evaluator {
                model: &model,
                solved: &solved,
                objective,
                unit_step: Some(&step),
                profiles: &spec,
                tolerance: None,
            };
            let class = WindabilityClass::Standard;
            let mut is_better = false;
            for segments in [vec![3, 4, 2, 5, 1, 6], vec![1, 2, 3, 4, 5, 6], vec![3, 4, 5, 2, 6, 1]] {
                let pattern = Pattern::new(segments).unwrap();
                for choice in [
                    EndChoice { most_left_off: 4, shares_outermost: false },
                    EndChoice { most_left_off: 0, shares_outermost: true },
                    EndChoice { most_left_off: 2, shares_outermost: true },
                ] {
                    let (found, whole) = evaluator.best_end_turns(choice, class, "x", &pattern).unwrap();
                    let most = model.coil.turns()[0].ceil() as i32;
                    let mut least = f64::INFINITY;
                    for (a, b) in (-most..=most).flat_map(|a| (-most..=most).map(move |b| (a, b))) {
                        let ends = EndTurns { a, b };
                        let Ok(built) = pattern.clone().with_end_turns(ends) else { continue };
                        if !choice.admits(ends) {
                            continue;
                        }
                        if let Ok(judged) = evaluator.judge("x", &built) {
                            least = least.min(judged.objective_rad_per_s);
                        }
                    }
                    let found = found.objective_rad_per_s;
                    assert!((found / least - 1.0).abs() < 1e-9, "{objective:?} {pattern} {choice:?}: {found} {least}");
                    assert!(found <= whole);
                    is_better |= found < 0.9 * whole;
                }
            }
            assert!(is_better, "{objective:?}: no turns at the ends change anything here");
        }
    }

    #[test]
    fn only_what_was_asked_for_is_chosen() {
        let choice = EndChoice { most_left_off: 2, shares_outermost: false };
        let admitted = |a, b| choice.admits(EndTurns { a, b });
        assert!(admitted(-2, 0) && admitted(-1, -2) && !admitted(-3, 0) && !admitted(1, -1));
        let choice = EndChoice { most_left_off: 1, shares_outermost: true };
        let admitted = |a, b| choice.admits(EndTurns { a, b });
        assert!(admitted(7, -7) && admitted(7, -8) && !admitted(7, -9) && !admitted(-2, 0));
        assert!(Classic::Qua.pattern(8).unwrap().end_on_outermost_layer().is_some());
    }
}
