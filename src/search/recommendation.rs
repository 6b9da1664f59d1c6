//! What to wind, in one sentence with its reasons.
//!
//! Candidates are the classics of the class and the best patterns that were found under any objective. They are weighed
//! by the first of these that the model has:
//!
//! | figure | why |
//! |---|---|
//! | 95 % quantile over built coils | what leaves the workshop |
//! | guaranteed worst rate | holds for every profile within the largest rate, searched or not |
//! | worst rate on unseen profiles | what is left of a gain on the searched ones |
//!
//! A pattern that was found takes the place of the best classic only if it is better by more than [`TIE`] in that figure
//! and no worse in any of them, on any set of unseen profiles. Of what is equally good to [`TIE`] the pattern is taken
//! that is easiest to wind: fewest captive runs, then the smallest climb, then the fewest long crossovers.

use std::cmp::Ordering;

use super::anneal::rounds::Found;
use super::answer::Proof;
use super::cost::objective::Objective;
use super::cost::tolerance::ToleranceError;
use super::evaluator::{Evaluator, JudgeError, Judged};
use super::proof::Status;
use super::validation::{Unseen, Validation};
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::{Windability, WindabilityClass, WindingGraph};
use crate::units::{deg_per_h_from_rad_per_s, percent_from_fraction};

/// Two figures closer than this count as equal: less than what a coil's own material values are known to.
pub const TIE: f64 = 0.02;

/// Found patterns that are weighed besides the best: the best of each figure.
const MOST_FOUND: usize = 3;

/// Why windings tie where the outermost layer's temperature is prescribed.
const TIED_BY_THE_BOUNDARY: &str = " (with the outermost layer's temperature prescribed the first instant of a ramp heats \
    that layer alone, so that windings which end alike tie; behind a film they do not)";

/// What to wind.
#[derive(Debug, Clone, PartialEq)]
pub struct Recommendation {
    pub name: String,
    pub pattern: Pattern,
    pub sentence: String,
    pub reasons: Vec<String>,
}

/// What a search has come to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Context<'a> {
    pub class: WindabilityClass,
    pub best: &'a Judged,
    pub baselines: &'a [Judged],
    pub proof: &'a Proof,
}

/// A pattern with all that it is weighed by.
#[derive(Debug, Clone)]
pub(super) struct Weighed {
    pub judged: Judged,
    pub windability: Windability,
    pub is_classic: bool,
    pub unseen_rad_per_s: f64,
    pub p95_rad_per_s: Option<f64>,
    pub yield_share: Option<f64>,
    /// Over the best classic of the class, the worst of all sets of unseen profiles.
    over_classics: Option<f64>,
}

impl Weighed {
    pub(super) fn figure(&self) -> f64 {
        self.p95_rad_per_s.or(self.judged.guaranteed_rad_per_s).unwrap_or(self.unseen_rad_per_s)
    }

    pub(super) fn figure_words(&self) -> &'static str {
        match (self.p95_rad_per_s, self.judged.guaranteed_rad_per_s) {
            (Some(_), _) => "95 % quantile over built coils",
            (None, Some(_)) => "guaranteed worst rate error",
            (None, None) => "worst rate error on unseen profiles",
        }
    }

    /// Nowhere worse than a classic: in no figure, and on no set of unseen profiles.
    fn is_no_worse(&self, classic: &Weighed, tolerated: f64) -> bool {
        let within = |mine: Option<f64>, its: Option<f64>| mine.zip(its).is_none_or(|(m, i)| m <= i * tolerated);
        within(self.judged.guaranteed_rad_per_s, classic.judged.guaranteed_rad_per_s)
            && within(self.p95_rad_per_s, classic.p95_rad_per_s)
            && self.yield_share.zip(classic.yield_share).is_none_or(|(m, i)| m + (tolerated - 1.0) >= i)
            && self.over_classics.is_none_or(|ratio| ratio <= tolerated)
    }

    fn easier(&self, other: &Self) -> Ordering {
        let effort =
            |w: &Self| (w.windability.captive, w.windability.max_climb, w.windability.long_crossovers, !w.is_classic);
        effort(self).cmp(&effort(other)).then(self.figure().total_cmp(&other.figure()))
    }
}

/// The one to wind, and the best classic where there is one.
fn chosen(weighed: &[Weighed]) -> (usize, Option<usize>) {
    let by_figure = |a: &usize, b: &usize| weighed[*a].figure().total_cmp(&weighed[*b].figure());
    let all = || 0..weighed.len();
    let least_figure = all().filter(|&i| weighed[i].is_classic).min_by(by_figure).map_or(0.0, |i| weighed[i].figure());
    // The classic that is furthest behind the best one nowhere: neither in the figure nor on any set of unseen profiles.
    let regret = |i: usize| (weighed[i].figure() / least_figure).max(weighed[i].over_classics.unwrap_or(1.0));
    let best_classic = all().filter(|&i| weighed[i].is_classic).min_by(|&a, &b| regret(a).total_cmp(&regret(b)));
    let eligible: Vec<usize> = match best_classic {
        None => all().collect(),
        Some(classic) => all()
            .filter(|&i| {
                let (mine, its) = (&weighed[i], &weighed[classic]);
                i == classic
                    || if mine.is_classic {
                        regret(i) <= regret(classic) * (1.0 + TIE)
                    } else {
                        mine.is_no_worse(its, 1.0) && mine.figure() < its.figure() * (1.0 - TIE)
                    }
            })
            .collect(),
    };
    let least = eligible.iter().map(|&i| weighed[i].figure()).fold(f64::INFINITY, f64::min);
    let equal = eligible.iter().copied().filter(|&i| weighed[i].figure() <= least * (1.0 + TIE));
    let easiest = equal.min_by(|&a, &b| weighed[a].easier(&weighed[b]));
    (easiest.or(best_classic).unwrap_or(0), best_classic)
}

impl Evaluator<'_> {
    /// Judges what was found on unseen profiles and says what to wind.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(super) fn recommended(
        &self,
        context: &Context,
        found: &[Found],
        shared: &[Pattern],
    ) -> Result<(Validation, Recommendation), JudgeError> {
        let candidates = self.candidates(context, found, shared)?;
        let (weighed, unseen) = self.weighed(context.class, candidates)?;
        let (choice, best_classic) = chosen(&weighed);
        let of = |pattern: &Pattern| weighed.iter().find(|w| w.judged.pattern == *pattern);
        let qua = context.baselines.iter().find(|b| b.name == Classic::Qua.key());
        let validation = Validation {
            profiles: unseen.profiles,
            seed: unseen.seed,
            best_rad_per_s: of(&context.best.pattern).map_or(f64::INFINITY, |w| w.unseen_rad_per_s),
            qua_rad_per_s: qua.and_then(|qua| of(&qua.pattern)).map(|w| w.unseen_rad_per_s),
        };
        let recommended = &weighed[choice];
        let classic = best_classic.map(|i| &weighed[i]);
        let recommendation = Recommendation {
            name: recommended.judged.name.clone(),
            pattern: recommended.judged.pattern.clone(),
            sentence: sentence(recommended, classic, unseen.profiles),
            reasons: self.reasons(context, recommended, &weighed, &validation)?,
        };
        Ok((validation, recommendation))
    }

    /// The classics, the best pattern, and of what was found the best in each figure.
    fn candidates(&self, context: &Context, found: &[Found], shared: &[Pattern]) -> Result<Vec<Judged>, JudgeError> {
        let plain = self.under(Objective::WorstRate);
        let mut candidates: Vec<Judged> = context.baselines.to_vec();
        let is_new = |pattern: &Pattern, among: &[Judged]| !among.iter().any(|j| j.pattern == *pattern);
        if is_new(&context.best.pattern, &candidates) {
            candidates.push(context.best.clone());
        }
        let of_found = found.iter().filter_map(|f| Pattern::new(f.segments.clone()).ok());
        let mut others = Vec::new();
        for pattern in of_found.chain(shared.iter().cloned()) {
            if context.class.admits(&pattern) && is_new(&pattern, &candidates) && is_new(&pattern, &others) {
                others.push(plain.judge(&format!("searched-{}", pattern.layers()), &pattern)?);
            }
        }
        let bound = |j: &Judged| j.guaranteed_rad_per_s.unwrap_or(f64::INFINITY);
        others
            .sort_by(|a, b| bound(a).total_cmp(&bound(b)).then_with(|| a.pattern.segments().cmp(b.pattern.segments())));
        let rest = others.split_off(others.len().min(MOST_FOUND));
        let least =
            rest.into_iter().min_by(|a, b| a.worst.rate_rad_per_s.abs().total_cmp(&b.worst.rate_rad_per_s.abs()));
        candidates.extend(others.into_iter().chain(least));
        let mut number = 1;
        for judged in candidates.iter_mut().skip(context.baselines.len()) {
            if judged.pattern != context.best.pattern {
                number += 1;
                judged.name = format!("{}-{number}", judged.name);
            }
        }
        Ok(candidates)
    }

    fn weighed(&self, class: WindabilityClass, candidates: Vec<Judged>) -> Result<(Vec<Weighed>, Unseen), JudgeError> {
        let patterns: Vec<Pattern> = candidates.iter().map(|j| j.pattern.clone()).collect();
        let unseen = self.unseen(&patterns)?;
        let layers = self.model.coil.layers();
        let classics: Vec<Pattern> = Classic::ALL.into_iter().filter_map(|c| c.pattern(layers).ok()).collect();
        let in_class: Vec<usize> =
            (0..patterns.len()).filter(|&i| classics.contains(&patterns[i]) && class.admits(&patterns[i])).collect();
        type Built = Option<(f64, Option<f64>)>;
        let built: Vec<Built> = match self.coils() {
            Ok(coils) => coils.p95_and_yield(&patterns)?.into_iter().map(Some).collect(),
            Err(ToleranceError::NoTolerance | ToleranceError::NoSpread) => vec![None; patterns.len()],
            Err(error) => return Err(error.into()),
        };
        let weigh = |(i, (judged, built)): (usize, (Judged, Built))| Weighed {
            windability: WindingGraph::new(&judged.pattern).windability(),
            is_classic: in_class.contains(&i),
            unseen_rad_per_s: unseen.worst_rad_per_s(i),
            p95_rad_per_s: built.map(|(p95, _)| p95),
            yield_share: built.and_then(|(_, share)| share),
            over_classics: unseen.largest_ratio(i, &in_class),
            judged,
        };
        let weighed: Vec<Weighed> = candidates.into_iter().zip(built).enumerate().map(weigh).collect();
        // Classics of a wider class can be compared with, not recommended.
        let weighed =
            weighed.into_iter().filter(|w| class.admits(&w.judged.pattern) || w.judged.name == Classic::Qua.key());
        Ok((weighed.collect(), unseen))
    }

    /// What to say on unseen profiles after how good the best pattern is on the searched ones.
    pub(super) fn words_on_unseen(&self, validation: &Validation, best: &Judged, baselines: &[Judged]) -> String {
        let Validation { profiles, best_rad_per_s, qua_rad_per_s, .. } = *validation;
        let shown = deg_per_h_from_rad_per_s;
        let Some(qua_rad_per_s) = qua_rad_per_s else {
            return format!(" On {profiles} unseen profiles its worst rate error is {:.4} °/h.", shown(best_rad_per_s));
        };
        let qua = baselines.iter().find(|b| b.name == Classic::Qua.key());
        if qua.is_some_and(|qua| qua.pattern == best.pattern) {
            return format!(" On {profiles} unseen profiles its worst rate error is {:.4} °/h.", shown(qua_rad_per_s));
        }
        let bound = qua.and_then(|qua| qua.guaranteed_rad_per_s).zip(best.guaranteed_rad_per_s);
        let guaranteed = bound.map_or_else(String::new, |(qua, best)| {
            format!(", guaranteed for all {:.4} against {:.4}", shown(best), shown(qua))
        });
        format!(
            " On {profiles} unseen profiles its worst rate error is {:.4} °/h against QUA's {:.4}{guaranteed}{}",
            shown(best_rad_per_s),
            shown(qua_rad_per_s),
            if best_rad_per_s > qua_rad_per_s {
                ": it wins only on what it was searched on."
            } else if bound.is_some_and(|(qua, best)| best > qua) {
                ": it wins only on profiles like those that it was searched on."
            } else {
                "."
            }
        )
    }

    fn reasons(
        &self,
        context: &Context,
        recommended: &Weighed,
        weighed: &[Weighed],
        validation: &Validation,
    ) -> Result<Vec<String>, JudgeError> {
        let shown = deg_per_h_from_rad_per_s;
        let mut reasons = vec![facts(recommended, validation.profiles)];
        let named = |name: &str| weighed.iter().find(|w| w.judged.name == name);
        for other in [named(Classic::Qua.key()), named(&context.best.name)].into_iter().flatten() {
            if other.judged.pattern != recommended.judged.pattern {
                reasons.push(facts(other, validation.profiles));
            }
        }
        let best = named(&context.best.name);
        if let Some(best) = best.filter(|b| !b.is_classic && b.judged.pattern != recommended.judged.pattern) {
            reasons.push(format!(
                "{} is best in the {} over the searched profiles, but not by more than {:.0} % in all that counts",
                best.judged.name,
                self.objective.title(),
                percent_from_fraction(TIE)
            ));
        }
        let ties: Vec<&str> = weighed
            .iter()
            .filter(|w| w.is_classic && w.judged.pattern != recommended.judged.pattern)
            .filter(|w| (w.figure() / recommended.figure() - 1.0).abs() <= TIE)
            .map(|w| w.judged.name.as_str())
            .collect();
        if !ties.is_empty() {
            reasons.push(format!(
                "{} is as good to {:.0} %; of equals the one is taken that is easiest to wind{}",
                ties.join(", "),
                percent_from_fraction(TIE),
                if self.model.prescribes_outermost_layer() { TIED_BY_THE_BOUNDARY } else { "" }
            ));
        }
        reasons.extend(self.captive_reason(context.class, recommended)?);
        reasons.extend(self.spread_reason(recommended)?);
        reasons.extend(self.boundary_reason(recommended, weighed)?);
        if context.proof.status != Status::Optimal && !recommended.is_classic {
            reasons.push(match context.proof.status {
                Status::Gap => format!(
                    "best found, not proved: nothing of the class is below {:.4} °/h",
                    shown(context.proof.lower_bound_rad_per_s)
                ),
                _ => "best found, not proved to be the best".to_owned(),
            });
        }
        Ok(reasons)
    }
}

fn sentence(recommended: &Weighed, classic: Option<&Weighed>, profiles: usize) -> String {
    let shown = |w: &Weighed| deg_per_h_from_rad_per_s(w.figure());
    let name = &recommended.judged.name;
    let what = recommended.figure_words();
    match classic {
        Some(classic) if !recommended.is_classic => format!(
            "Wind {name}: its {what} of {:.4} °/h is {:.0} % less than that of the best classic, {} with {:.4} °/h, and it is \
             no worse on any set of {profiles} unseen profiles.",
            shown(recommended),
            percent_from_fraction(1.0 - recommended.figure() / classic.figure()),
            classic.judged.name,
            shown(classic),
        ),
        Some(_) => format!(
            "Wind {name}: with a {what} of {:.4} °/h nothing that was found beats it by more than {:.0} % on what it was not \
             searched on.",
            shown(recommended),
            percent_from_fraction(TIE),
        ),
        None => format!("Wind {name}: its {what} of {:.4} °/h is the smallest found.", shown(recommended)),
    }
}

fn facts(weighed: &Weighed, profiles: usize) -> String {
    let shown = deg_per_h_from_rad_per_s;
    let mut parts = vec![
        format!("{:.4} °/h on the searched profiles", shown(weighed.judged.worst.rate_rad_per_s.abs())),
        format!("{:.4} on {profiles} unseen ones", shown(weighed.unseen_rad_per_s)),
    ];
    parts.extend(weighed.judged.guaranteed_rad_per_s.map(|g| format!("{:.4} guaranteed", shown(g))));
    parts.extend(weighed.p95_rad_per_s.map(|p| format!("{:.4} for 95 % of built coils", shown(p))));
    parts.extend(weighed.yield_share.map(|y| format!("yield {:.1} %", percent_from_fraction(y))));
    let Windability { captive, max_climb, long_crossovers, .. } = weighed.windability;
    parts.push(format!("captive runs {captive}, climb {max_climb}, long crossovers {long_crossovers}"));
    format!("{}: {}", weighed.judged.name, parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::cost::worst_case::WorstCase;

    fn weighed(segments: &[usize], is_classic: bool, guaranteed_rad_per_s: f64, over_classics: f64) -> Weighed {
        let pattern = Pattern::new(segments.to_vec()).unwrap();
        let judged = Judged {
            name: "test".into(),
            pattern: pattern.clone(),
            worst: WorstCase { rate_rad_per_s: 1.0, profile: "p".into(), profile_index: 0, time_s: 0.0 },
            phase_rad: 0.0,
            guaranteed_rad_per_s: Some(guaranteed_rad_per_s),
            p95_rad_per_s: None,
            objective_rad_per_s: 1.0,
        };
        let windability = WindingGraph::new(&pattern).windability();
        let over_classics = Some(over_classics);
        let unseen_rad_per_s = 1.0;
        Weighed {
            judged,
            windability,
            is_classic,
            unseen_rad_per_s,
            p95_rad_per_s: None,
            yield_share: None,
            over_classics,
        }
    }

    #[test]
    fn the_classic_stays_unless_something_beats_it_everywhere_by_more_than_a_tie() {
        let qua = weighed(&[2, 3, 4, 1], true, 1.0, 1.0);
        let of = |found: Weighed| chosen(&[qua.clone(), found]).0;
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 0.9, 0.99)), 1);
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 0.985, 0.9)), 0, "a tie");
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 0.5, 1.01)), 0, "worse on a set of unseen profiles");
        assert_eq!(of(weighed(&[3, 2, 4, 1], false, 1.2, 0.5)), 0, "wins only on what it was searched on");
    }

    #[test]
    fn of_equals_the_one_that_is_easier_to_wind_is_taken() {
        let quadrupole = weighed(&[2, 3, 4, 1], true, 1.0, 1.0);
        let cylinder = weighed(&[1, 2, 3, 4], true, 1.01, 1.01);
        let worse = weighed(&[1, 2, 3, 4], true, 1.05, 1.05);
        assert_eq!(chosen(&[quadrupole.clone(), cylinder]).0, 1);
        assert_eq!(chosen(&[quadrupole, worse]).0, 0);
    }
}
