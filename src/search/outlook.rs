//! What lies beside a recommendation: one more captive reel, the workshop's spreads, the other boundary.

use super::anneal::rounds::{DEFAULT_RESTARTS_PER_ROUND, Plan, Rules};
use super::cost::guaranteed::UnitStep;
use super::cost::objective::Objective;
use super::cost::tolerance::{Measure, ToleranceSpec, measure, study};
use super::cost::worst_case::{SearchError, SolvedProfiles};
use super::evaluator::{Evaluator, JudgeError, Judged, name_of};
use super::proof::permutation_tree::MOST_LAYERS;
use super::proof::{Goal, ProofEffort, Task, improve};
use super::prospect::worst_rates_rad_per_s;
use super::weighed_pointing::PointingFigures;
use super::weighing::{TIE, Weighed};
use crate::effect::DeclaredEffect;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::profile::ProfileSpec;
use crate::rate::CoilModel;
use crate::thermal::{Extent, Location};
use crate::units::{deg_per_h_from_rad_per_s, percent_from_fraction};

/// Below this a look at another class is not worth its words.
const WORTH_A_REEL: f64 = 0.5;

/// Coils that are drawn to see which spread matters most: shares need fewer than quantiles.
const COILS_FOR_SHARES: usize = 48;

/// A quantile this much above the declared coil's worst case is the workshop's doing.
const MOSTLY_SPREAD: f64 = 1.5;

/// The search for what the other boundary would have takes this part of a search's own moves.
const SHORTENED: u64 = 4;

/// Still air in a gyro's housing, for models that prescribe the outermost layer \[W/(m²K)\].
const STILL_AIR_W_PER_M2_K: f64 = 20.0;

impl Evaluator<'_> {
    /// What one captive reel would buy.
    pub(super) fn captive_reason(
        &self,
        class: WindabilityClass,
        recommended: &Weighed,
    ) -> Result<Option<String>, JudgeError> {
        let layers = self.model.coil.layers();
        if class != WindabilityClass::Standard || !(4..=MOST_LAYERS).contains(&layers) {
            return Ok(None);
        }
        let is_for_pointing = self.objective == Objective::Pointing;
        let (goal, what) = match self.unit_step {
            _ if is_for_pointing => (Goal::Pointing, "worst pointing error over the searched profiles"),
            Some(step) => (Goal::Guaranteed(step), "guaranteed worst rate error"),
            None => (Goal::WorstRate, "worst rate error"),
        };
        let task = Task { model: self.model, solved: self.solved, class: WindabilityClass::Captive(1), goal };
        let effort = ProofEffort { most_nodes: 0, beam_width: 0, good_enough_rad_per_s: 0.0 };
        let pattern = improve(&task, std::slice::from_ref(&recommended.judged.pattern), effort)?.pattern;
        let under = if is_for_pointing { Objective::Pointing } else { Objective::WorstRate };
        let judged = self.under(under).judge("captive-1", &pattern)?;
        let of = |judged: &Judged| match judged.guaranteed_rad_per_s {
            _ if is_for_pointing => judged.objective_rad_per_s,
            Some(guaranteed) => guaranteed,
            None => judged.worst.rate_rad_per_s.abs(),
        };
        let (now, then) = (of(&recommended.judged), of(&judged));
        let is_worth_it = then < WORTH_A_REEL * now - recommended.same_rad_per_s();
        Ok(is_worth_it.then(|| {
            let value = deg_per_h_from_rad_per_s(now);
            let now = if is_for_pointing { under.shown(now) } else { format!("{value:.4}") };
            let then = under.shown(then);
            format!("one captive reel (--windability captive:1) would bring the {what} from {now} to {then} or less")
        }))
    }

    /// That a spread and not the pattern is what to work on next.
    pub(super) fn spread_reason(&self, recommended: &Weighed) -> Result<Option<String>, JudgeError> {
        if let Some(pointing) = recommended.pointing {
            return Ok(spread_of_pointing(&pointing));
        }
        let (Some(declared), Some(p95)) = (self.tolerance, recommended.p95_rad_per_s) else { return Ok(None) };
        let spec = ToleranceSpec { samples: declared.samples.min(COILS_FOR_SHARES), ..declared.clone() };
        let pattern = recommended.judged.pattern.clone();
        let found = study(self.model, self.profiles, &spec, &[pattern])?;
        let Some(distribution) = found.first().filter(|d| p95 > MOSTLY_SPREAD * d.nominal_rad_per_s) else {
            return Ok(None);
        };
        let which = match measure(self.model, self.profiles.max_rate_k_per_s)? {
            Measure::Guaranteed => "guaranteed ",
            Measure::Sampled => "",
        };
        let shares = distribution.variance_shares.iter().take(2);
        let shares: Vec<String> =
            shares.map(|(s, share)| format!("{} {:.0} %", s.key(), percent_from_fraction(*share))).collect();
        Ok(Some(format!(
            "a spread and not the pattern is what to work on next: as built 95 % of coils stay below {:.4} °/h, as declared \
             the {which}worst is {:.4}; of the variance {}",
            deg_per_h_from_rad_per_s(p95),
            deg_per_h_from_rad_per_s(distribution.nominal_rad_per_s),
            shares.join(", ")
        )))
    }

    /// What the coil's own part of the error is, where effects add a rate that no winding changes: the search makes use of
    /// both, and whoever compensates that rate is left with the coil's part.
    pub(super) fn beside_coil_reason(
        &self,
        recommended: &Weighed,
        qua: Option<&Weighed>,
    ) -> Result<Option<String>, JudgeError> {
        let (beside, of_coil): (Vec<DeclaredEffect>, Vec<DeclaredEffect>) =
            self.model.effects.iter().cloned().partition(|e| e.bind(&self.model.coil, &[]).is_beside_coil());
        if beside.is_empty() {
            return Ok(None);
        }
        let coil_alone = CoilModel { effects: of_coil, ..self.model.clone() };
        let own_rad_per_s = |weighed: &Weighed| -> Result<f64, SearchError> {
            Ok(self.solved.worst_case(&coil_alone, &weighed.judged.pattern)?.rate_rad_per_s.abs())
        };
        let shown = deg_per_h_from_rad_per_s;
        let kinds: Vec<String> = beside.iter().map(|e| e.kind()).collect();
        let kinds = kinds.join(", ");
        let own = own_rad_per_s(recommended)?;
        let mut words = format!(
            "no winding changes the rate that {kinds} adds: without it {} has {:.4} °/h on the searched profiles",
            recommended.judged.name,
            shown(own)
        );
        if let Some(qua) = qua.filter(|qua| qua.judged.pattern != recommended.judged.pattern) {
            let other = own_rad_per_s(qua)?;
            words += &format!(", qua {:.4}", shown(other));
            if own > (1.0 + TIE) * other {
                words += &format!("; whoever compensates {kinds} should search with a model without it");
            }
        }
        Ok(Some(words))
    }

    /// What the candidates, and what a short search for it finds, would cost with the other boundary.
    pub(super) fn other_boundary(
        &self,
        class: WindabilityClass,
        weighed: &[Weighed],
        seed: u64,
    ) -> Result<Option<OtherBoundary>, JudgeError> {
        let Some((model, words)) = other_boundary(self.model)? else { return Ok(None) };
        let mut named: Vec<(String, Pattern)> =
            weighed.iter().map(|w| (w.judged.name.clone(), w.judged.pattern.clone())).collect();
        // In the other classes a search takes longer than its answer is worth here.
        if class == WindabilityClass::Standard {
            let solved = SolvedProfiles::new(&model, &self.profiles.profiles())?;
            let step = UnitStep::new(&model, self.profiles.max_rate_k_per_s).ok();
            let objective = if step.is_some() { Objective::GuaranteedRate } else { Objective::WorstRate };
            let there = Evaluator { model: &model, solved: &solved, objective, unit_step: step.as_ref(), ..*self };
            let plan = Plan {
                seed,
                restarts_per_round: DEFAULT_RESTARTS_PER_ROUND,
                moves_per_restart: objective.default_moves_per_restart(model.coil.layers()) / SHORTENED,
                rules: Rules { rounds: 1, patience: 1, moves: None, target: None },
                starts: Vec::new(),
            };
            let found = there.short(class, &plan, &|| true)?;
            let is_new = |p: &Pattern| !named.iter().any(|(_, known)| known == p);
            if let Some(pattern) = found.into_iter().next().filter(is_new) {
                named.push((name_of(&pattern), pattern));
            }
        }
        Ok(Some(OtherBoundary::of(&model, words, self.profiles, &named)?))
    }
}

/// That a spread and not the pattern makes the pointing error.
fn spread_of_pointing(pointing: &PointingFigures) -> Option<String> {
    let (p95, coils) = pointing.built.filter(|(p95, _)| *p95 > MOSTLY_SPREAD * pointing.searched_rad_per_s)?;
    let shown = |value: f64| Objective::Pointing.shown(value);
    Some(format!(
        "a spread and not the pattern is what to work on next: as built 95 % of {coils} coils stay below {}, as declared the \
         worst is {}",
        shown(p95),
        shown(pointing.searched_rad_per_s)
    ))
}

/// The worst rates of patterns with the boundary that the model has not.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OtherBoundary {
    /// Which boundary that is.
    pub(crate) words: String,
    /// By the patterns' names: guaranteed where the model has that, else over the profiles.
    pub(crate) worst_rad_per_s: Vec<(String, f64)>,
}

impl OtherBoundary {
    /// What patterns would cost with the boundary that the model has not; `None` for a half space.
    ///
    /// # Errors
    /// Models that cannot be solved.
    pub(crate) fn under(
        model: &CoilModel,
        profiles: &ProfileSpec,
        named: &[(String, Pattern)],
    ) -> Result<Option<Self>, SearchError> {
        let Some((model, words)) = other_boundary(model)? else { return Ok(None) };
        Ok(Some(Self::of(&model, words, profiles, named)?))
    }

    fn of(
        model: &CoilModel,
        words: String,
        profiles: &ProfileSpec,
        named: &[(String, Pattern)],
    ) -> Result<Self, SearchError> {
        let patterns: Vec<Pattern> = named.iter().map(|(_, pattern)| pattern.clone()).collect();
        let rates = worst_rates_rad_per_s(model, profiles, &patterns)?;
        let worst_rad_per_s = named.iter().zip(rates).map(|((name, _), rate)| (name.clone(), rate)).collect();
        Ok(Self { words, worst_rad_per_s })
    }

    /// The pattern that would be best there, and its worst rate.
    pub(crate) fn best(&self) -> Option<&(String, f64)> {
        self.worst_rad_per_s.iter().min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Whether a pattern that is wound for the model's own boundary is as good as any here.
    pub(crate) fn sentence(&self, name: &str) -> Option<String> {
        let mine = self.worst_rad_per_s.iter().find(|(own, _)| own == name)?.1;
        let (best, least) = self.best()?;
        let (words, shown) = (&self.words, deg_per_h_from_rad_per_s);
        Some(if mine > least * (1.0 + TIE) {
            format!(
                "the answer hangs on the boundary: {words} {name} would cost {:.4} °/h and {best} {:.4}",
                shown(mine),
                shown(*least)
            )
        } else {
            format!(
                "{words} {name} would cost {:.4} °/h, and none of these patterns less by more than {:.0} %",
                shown(mine),
                percent_from_fraction(TIE)
            )
        })
    }
}

/// The model with the boundary that it has not, and how to say so; `None` for a half space.
fn other_boundary(model: &CoilModel) -> Result<Option<(CoilModel, String)>, SearchError> {
    if model.extent == Extent::HalfSpace {
        return Ok(None);
    }
    let path = model.heat_path()?;
    // What drives a housing, a spool or a flange has no other side to be driven from.
    if !path.housings.is_empty() || !matches!(path.location, Location::OuterLayer | Location::Ambient) {
        return Ok(None);
    }
    if path.film_w_per_m2_k.is_none() {
        if model.location != Location::OuterLayer {
            return Ok(None);
        }
        let behind = model.with_effect(DeclaredEffect::film(STILL_AIR_W_PER_M2_K));
        let behind = CoilModel { location: Location::Ambient, ..behind };
        return Ok(Some((behind, format!("behind a film of {STILL_AIR_W_PER_M2_K:.0} W/(m²K)"))));
    }
    let coil = model.wound_coil()?;
    let makes_a_film = |effect: &DeclaredEffect| {
        let mut bare = path.clone();
        bare.film_w_per_m2_k = None;
        effect.bind(&coil, &[]).change_heat_path(&mut bare);
        bare.film_w_per_m2_k.is_some()
    };
    let effects = model.effects.iter().filter(|e| !makes_a_film(e)).cloned().collect();
    let prescribed = CoilModel { effects, location: Location::OuterLayer, ..model.clone() };
    Ok(Some((prescribed, "with the outermost layer's temperature prescribed".to_owned())))
}
