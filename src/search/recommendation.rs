//! What to wind, in one sentence with its reasons.
//!
//! Candidates are the classics of the class and the best patterns that were found under any objective. They are weighed
//! by the first of these that the model has:
//!
//! | figure | why |
//! |---|---|
//! | 95 % quantile over models that may be the true one | where records leave the model uncertain |
//! | 95 % quantile over built coils | what leaves the workshop |
//! | guaranteed worst rate | holds for every profile within the largest rate, searched or not |
//! | worst rate on unseen profiles | what is left of a gain on the searched ones |
//!
//! A search for the pointing error is weighed by the same figures of the pointing error
//! ([`weighed_pointing`](super::weighed_pointing)), and what is closer together than a coil can be wound to is equal.
//!
//! How far a pattern is behind the best classic where it is furthest behind, in any of these figures, on any set of
//! unseen profiles or, where nothing is guaranteed, on the profiles that provoke patterns most
//! ([`provoked`](super::provoked)), is its regret. The classic with the least regret stays unless a pattern that was found is better by
//! more than `TIE` in the figure and has no more regret than that classic or none at all; or unless every classic is
//! behind another one by more than `TIE` somewhere and a found pattern is not (`rehearsal` searches
//! such). Of what is equally good to `TIE` the pattern is taken that is easiest to wind: fewest captive runs, then the
//! smallest climb, then the fewest long crossovers.

use super::anneal::rounds::FoundPattern;
use super::cost::objective::Objective;
use super::cost::tolerance::ToleranceError;
use super::evaluator::{Evaluator, JudgeError, Judged, name_of};
use super::optimality::Proof;
use super::outlook::OtherBoundary;
use super::proof::Status;
use super::prospect::{Outlook, Prospect, predicted_gain, prospects};
use super::validation::{Unseen, UnseenPointing, Validation};
use super::weighed_pointing::PointingFigures;
use super::weighing::{TIE, Weighed, chosen, over_least};
use crate::numeric::order::sort_ascending;
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::pattern::windability::{Windability, WindabilityClass, WindingGraph};
use crate::rate::CoilModel;
use crate::units::{deg_per_h_from_rad_per_s, percent_from_fraction};

/// Found patterns that are weighed besides the best: the best of each figure.
const MOST_FOUND: usize = 3;

/// Why windings tie where the outermost layer's temperature is prescribed.
const TIED_BY_THE_BOUNDARY: &str = " (with the outermost layer's temperature prescribed the first instant of a ramp heats \
    that layer alone, so that windings which end alike tie; behind a film they do not)";

/// What to wind.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Recommendation {
    pub(crate) name: String,
    pub(crate) pattern: Pattern,
    pub(crate) sentence: String,
    /// What decided.
    pub(crate) weighed_by: &'static str,
    pub(crate) reasons: Vec<String>,
}

/// What a search has come to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Context<'a> {
    pub(crate) class: WindabilityClass,
    pub(crate) best: &'a Judged,
    pub(crate) baselines: &'a [Judged],
    pub(crate) proof: &'a Proof,
    /// The pattern that was wound so far, by its name.
    pub(crate) former: Option<&'a (String, Pattern)>,
    /// Models that may be the true one.
    pub(crate) uncertain: &'a [CoilModel],
    pub(crate) seed: u64,
}

/// What a search has to say on what it was not searched on.
#[derive(Debug)]
pub(super) struct Advised {
    pub(crate) validation: Validation,
    pub(crate) recommendation: Recommendation,
    pub(crate) outlook: Option<Outlook>,
    pub(crate) boundary: Option<OtherBoundary>,
}

impl Evaluator<'_> {
    /// Judges what was found on unseen profiles and says what to wind.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub(super) fn advised(
        &self,
        context: &Context,
        found: &[FoundPattern],
        shared: &[Pattern],
    ) -> Result<Advised, JudgeError> {
        let candidates = self.candidates(context, found, shared)?;
        let (weighed, unseen) = self.weighed(context, candidates)?;
        let pointing_of = |w: &Weighed| w.pointing.map(|pointing| pointing.unseen_rad_per_s);
        let (choice, best_classic) = chosen(&weighed);
        let of = |pattern: &Pattern| weighed.iter().find(|w| w.judged.pattern == *pattern);
        let qua = context.baselines.iter().find(|b| b.name == Classic::Qua.key());
        let validation = Validation {
            profiles: unseen.profiles,
            seed: unseen.seed,
            best_rad_per_s: of(&context.best.pattern).map_or(f64::INFINITY, |w| w.unseen_rad_per_s),
            qua_rad_per_s: qua.and_then(|qua| of(&qua.pattern)).map(|w| w.unseen_rad_per_s),
            pointing: of(&context.best.pattern).and_then(pointing_of).map(|best_rad_per_s| UnseenPointing {
                best_rad_per_s,
                qua_rad_per_s: qua.and_then(|qua| of(&qua.pattern)).and_then(pointing_of),
            }),
        };
        let recommended = &weighed[choice];
        let classic = best_classic.map(|i| &weighed[i]);
        let boundary = self.other_boundary(context.class, &weighed, context.seed)?;
        let recommendation = Recommendation {
            name: recommended.judged.name.clone(),
            pattern: recommended.judged.pattern.clone(),
            sentence: sentence(recommended, classic, unseen.profiles),
            weighed_by: recommended.figure_words(),
            reasons: self.reasons(context, recommended, &weighed, &validation, boundary.as_ref())?,
        };
        let outlook = self.outlook(context, recommended, &weighed)?;
        Ok(Advised { validation, recommendation, outlook, boundary })
    }

    /// What the candidates promise over the models that may be the true one.
    fn outlook(
        &self,
        context: &Context,
        recommended: &Weighed,
        weighed: &[Weighed],
    ) -> Result<Option<Outlook>, JudgeError> {
        if context.uncertain.is_empty() {
            return Ok(None);
        }
        let mut prospects: Vec<(String, Prospect)> =
            weighed.iter().filter_map(|w| Some((w.judged.name.clone(), w.prospect?))).collect();
        sort_ascending(&mut prospects, |item| item.1.p95_rad_per_s);
        let qua = context.baselines.iter().find(|b| b.name == Classic::Qua.key()).map(|b| &b.pattern);
        let old = context.former.map(|(_, pattern)| pattern).or(qua);
        let new = &recommended.judged.pattern;
        let gain = old.map(|old| predicted_gain(self.model, context.uncertain, self.profiles, old, new)).transpose()?;
        Ok(Some(Outlook { models: context.uncertain.len(), prospects, gain }))
    }

    /// The classics, the best pattern, and of what was found the best in each figure.
    fn candidates(
        &self,
        context: &Context,
        found: &[FoundPattern],
        shared: &[Pattern],
    ) -> Result<Vec<Judged>, JudgeError> {
        let is_for_pointing = self.objective == Objective::Pointing;
        let plain = if is_for_pointing { *self } else { self.under(Objective::WorstRate) };
        let mut candidates: Vec<Judged> = context.baselines.to_vec();
        let is_new = |pattern: &Pattern, among: &[Judged]| !among.iter().any(|j| j.pattern == *pattern);
        if is_new(&context.best.pattern, &candidates) {
            candidates.push(context.best.clone());
        }
        let of_found = found.iter().filter_map(|f| Pattern::new(f.segments.clone()).ok());
        let mut others = Vec::new();
        for pattern in of_found.chain(shared.iter().cloned()) {
            if context.class.admits(&pattern) && is_new(&pattern, &candidates) && is_new(&pattern, &others) {
                others.push(plain.judge(&name_of(&pattern), &pattern)?);
            }
        }
        let bound = |j: &Judged| {
            if is_for_pointing { j.objective_rad_per_s } else { j.guaranteed_rad_per_s.unwrap_or(f64::INFINITY) }
        };
        others
            .sort_by(|a, b| bound(a).total_cmp(&bound(b)).then_with(|| a.pattern.segments().cmp(b.pattern.segments())));
        let rest = others.split_off(others.len().min(MOST_FOUND));
        let least =
            rest.into_iter().min_by(|a, b| a.worst.rate_rad_per_s.abs().total_cmp(&b.worst.rate_rad_per_s.abs()));
        candidates.extend(others.into_iter().chain(least));
        let classics = self.classics_of(context.class);
        let starts: Vec<Pattern> = candidates.iter().map(|j| j.pattern.clone()).collect();
        // It is about rates.
        let rehearsed =
            if is_for_pointing { Vec::new() } else { self.rehearsed(context.class, &classics, &starts, context.seed)? };
        let hedged = self.hedged(context.class, context.uncertain, &starts, context.seed)?;
        for pattern in rehearsed.into_iter().take(MOST_FOUND).chain(hedged) {
            if is_new(&pattern, &candidates) {
                candidates.push(plain.judge(&name_of(&pattern), &pattern)?);
            }
        }
        if let Some((name, pattern)) = context.former.filter(|(_, p)| context.class.admits(p) && is_new(p, &candidates))
        {
            candidates.push(plain.judge(name, pattern)?);
        }
        Ok(candidates)
    }

    fn classics_of(&self, class: WindabilityClass) -> Vec<Pattern> {
        let layers = self.model.coil.layers();
        Classic::ALL.into_iter().filter_map(|c| c.pattern(layers).ok()).filter(|p| class.admits(p)).collect()
    }

    fn weighed(&self, context: &Context, candidates: Vec<Judged>) -> Result<(Vec<Weighed>, Unseen), JudgeError> {
        let class = context.class;
        let patterns: Vec<Pattern> = candidates.iter().map(|j| j.pattern.clone()).collect();
        let (unseen, unseen_pointing) = self.unseen(&patterns)?;
        let pointing = match &unseen_pointing {
            Some(unseen) => {
                let worst: Vec<f64> = (0..patterns.len()).map(|i| unseen.worst_rad_per_s(i)).collect();
                self.pointing_figures(&patterns, &worst, context.uncertain)?
            }
            None => Vec::new(),
        };
        let classics = self.classics_of(class);
        let in_class: Vec<usize> = (0..patterns.len()).filter(|&i| classics.contains(&patterns[i])).collect();
        type Built = Option<(f64, Option<f64>)>;
        let built: Vec<Built> = match self.coils() {
            Ok(coils) => coils.p95_and_yield(&patterns)?.into_iter().map(Some).collect(),
            Err(ToleranceError::NoTolerance | ToleranceError::NoSpread) => vec![None; patterns.len()],
            Err(error) => return Err(error.into()),
        };
        let guaranteed: Vec<Option<f64>> = candidates.iter().map(|j| j.guaranteed_rad_per_s).collect();
        let p95: Vec<Option<f64>> = built.iter().map(|b| b.map(|(p95, _)| p95)).collect();
        let prospects = prospects(context.uncertain, self.profiles, &patterns)?;
        let expected: Vec<Option<f64>> =
            (0..patterns.len()).map(|i| prospects.get(i).map(|p| p.expected_rad_per_s)).collect();
        let likely: Vec<Option<f64>> = (0..patterns.len()).map(|i| prospects.get(i).map(|p| p.p95_rad_per_s)).collect();
        let scrap: Vec<Option<f64>> = built.iter().map(|b| b.and_then(|(_, share)| share).map(|y| 2.0 - y)).collect();
        let of_pointing =
            |figure: fn(&PointingFigures) -> Option<f64>| -> Vec<Option<f64>> { pointing.iter().map(figure).collect() };
        let provoked =
            if pointing.is_empty() { self.provoked_rad_per_s(&patterns)? } else { vec![None; patterns.len()] };
        let figures = if pointing.is_empty() {
            vec![guaranteed, provoked.clone(), p95, scrap, expected, likely]
        } else {
            let built = of_pointing(|p| p.built.map(|(p95, _)| p95));
            vec![of_pointing(|p| p.guaranteed_rad_per_s), built, of_pointing(|p| p.likely_rad_per_s)]
        };
        let weighed_unseen = unseen_pointing.as_ref().unwrap_or(&unseen);
        let regret = |i: usize| {
            let same = pointing.get(i).map_or(0.0, |p| p.resolution_rad_per_s);
            let ratios = figures.iter().map(|figures| over_least(figures, i, &in_class, same));
            ratios.chain([weighed_unseen.largest_ratio(i, &in_class, same)]).flatten().fold(0.0, f64::max)
        };
        let regrets: Vec<f64> = (0..patterns.len()).map(regret).collect();
        let weigh = |(i, (judged, built)): (usize, (Judged, Built))| Weighed {
            windability: WindingGraph::new(&judged.pattern).windability(),
            is_classic: in_class.contains(&i),
            unseen_rad_per_s: unseen.worst_rad_per_s(i),
            provoked_rad_per_s: provoked[i],
            p95_rad_per_s: built.map(|(p95, _)| p95),
            yield_share: built.and_then(|(_, share)| share),
            prospect: prospects.get(i).copied(),
            pointing: pointing.get(i).copied(),
            regret: regrets[i],
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
        if let Some(UnseenPointing { best_rad_per_s, qua_rad_per_s }) = validation.pointing {
            let shown = |value: f64| self.objective.shown(value);
            let is_qua = baselines.iter().any(|b| b.name == Classic::Qua.key() && b.pattern == best.pattern);
            let against = match qua_rad_per_s.filter(|_| !is_qua) {
                Some(qua) if best_rad_per_s > qua => {
                    format!(" against QUA's {}: it wins only on what it was searched on", shown(qua))
                }
                Some(qua) => format!(" against QUA's {}", shown(qua)),
                None => String::new(),
            };
            let profiles = validation.profiles;
            return format!(
                " On {profiles} unseen profiles its worst pointing error is {}{against}.",
                shown(best_rad_per_s)
            );
        }
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
        boundary: Option<&OtherBoundary>,
    ) -> Result<Vec<String>, JudgeError> {
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
            .filter(|w| w.ties_with(recommended))
            .map(|w| w.judged.name.as_str())
            .collect();
        if !ties.is_empty() {
            reasons.push(format!(
                "{} is as good to {}; of equals the one is taken that is easiest to wind{}",
                ties.join(", "),
                tie_words(recommended),
                if self.model.prescribes_outermost_layer() { TIED_BY_THE_BOUNDARY } else { "" }
            ));
        }
        reasons.extend(self.captive_reason(context.class, recommended)?);
        reasons.extend(self.spread_reason(recommended)?);
        reasons.extend(self.beside_coil_reason(recommended, named(Classic::Qua.key()))?);
        // It compares rates.
        let boundary = boundary.filter(|_| recommended.pointing.is_none());
        reasons.extend(boundary.and_then(|b| b.sentence(&recommended.judged.name)));
        if context.proof.status != Status::Optimal && !recommended.is_classic {
            reasons.push(match context.proof.status {
                Status::Gap => format!(
                    "best found, not proved: nothing of the class is below {}",
                    self.objective.shown(context.proof.lower_bound_rad_per_s)
                ),
                _ => "best found, not proved to be the best".to_owned(),
            });
        }
        Ok(reasons)
    }
}

/// To what figures count as equal.
fn tie_words(weighed: &Weighed) -> String {
    let share = format!("{:.0} %", percent_from_fraction(TIE));
    match weighed.pointing {
        Some(pointing) => {
            let same = Objective::Pointing.shown(pointing.resolution_rad_per_s);
            format!("{share} and the {same} that a middle off by the fibre's diameter adds")
        }
        None => share,
    }
}

fn sentence(recommended: &Weighed, classic: Option<&Weighed>, profiles: usize) -> String {
    let shown = Weighed::shown;
    let name = &recommended.judged.name;
    let what = recommended.figure_words();
    let behind = |w: &Weighed| format!("{:.1} %", percent_from_fraction(w.regret - 1.0));
    match classic {
        Some(classic) if !recommended.is_classic => {
            let change = percent_from_fraction((recommended.figure() / classic.figure() - 1.0).abs());
            let than = if recommended.figure() <= classic.figure() { "less" } else { "more" };
            let nowhere = if recommended.regret <= 1.0 {
                format!("it is no worse on any set of {profiles} unseen profiles")
            } else {
                format!(
                    "it is nowhere further than {} behind the best classic, {} up to {}",
                    behind(recommended),
                    classic.judged.name,
                    behind(classic)
                )
            };
            format!(
                "Wind {name}: its {what} of {} is {change:.0} % {than} than that of the best classic, {} with {}, \
                 and {nowhere}.",
                shown(recommended),
                classic.judged.name,
                shown(classic),
            )
        }
        Some(_) if recommended.regret > 1.0 + TIE => format!(
            "Wind {name}: its {what} is {}; the classics change places by up to {} between sets of unseen profiles, \
             and nothing that was found is ahead everywhere.",
            shown(recommended),
            behind(recommended),
        ),
        Some(_) => format!(
            "Wind {name}: with a {what} of {} nothing that was found beats it by more than {} on what it was not searched on.",
            shown(recommended),
            tie_words(recommended),
        ),
        None => format!("Wind {name}: its {what} of {} is the smallest found.", shown(recommended)),
    }
}

fn facts(weighed: &Weighed, profiles: usize) -> String {
    let shown = deg_per_h_from_rad_per_s;
    let mut parts = weighed.pointing.map_or_else(Vec::new, |pointing| pointing.facts(profiles));
    let what = if weighed.pointing.is_some() { "worst rate " } else { "" };
    parts.extend([
        format!("{what}{:.4} °/h on the searched profiles", shown(weighed.judged.worst.rate_rad_per_s.abs())),
        format!("{:.4} on {profiles} unseen ones", shown(weighed.unseen_rad_per_s)),
    ]);
    parts.extend(weighed.judged.guaranteed_rad_per_s.map(|g| format!("{:.4} guaranteed", shown(g))));
    parts.extend(weighed.provoked_rad_per_s.map(|p| format!("{:.4} on profiles that provoke windings most", shown(p))));
    parts.extend(weighed.p95_rad_per_s.map(|p| format!("{:.4} for 95 % of built coils", shown(p))));
    parts.extend(weighed.yield_share.map(|y| format!("yield {:.1} %", percent_from_fraction(y))));
    parts.extend(weighed.prospect.map(|p| {
        let (expected, p95) = (shown(p.expected_rad_per_s), shown(p.p95_rad_per_s));
        format!("{expected:.4} expected and {p95:.4} for 95 % of the models that the records allow")
    }));
    let Windability { captive, max_climb, long_crossovers, .. } = weighed.windability;
    parts.push(format!("captive runs {captive}, climb {max_climb}, long crossovers {long_crossovers}"));
    format!("{}: {}", weighed.judged.name, parts.join(", "))
}
