//! Coils as they leave the workshop, compiled for a search: the worst case of every drawn coil, for any pattern.
//!
//! ```text
//! W_b(P) = |v_b0| + Σ_i |v_bi|,   v_b = c_b + Σ_j D_bj ( w_bj^A + ρ_bj w_bj^B )          guaranteed worst case of coil b
//! P95(P) = 95 % quantile of W_b(P) over the coils b
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | D_bj | what G(0+) and each change of G owe to a unit weight of layer j in half A | `Part::columns` |
//! | ρ_bj | half B's response over half A's | `Part::half_b_over_a` |
//! | w_bj | the layer weights of coil b, whose lengths are its own | `SampledCoil::lengths_m` |
//!
//! Where electronics heat the bore, W is the largest of all partial sums plus the size of the heat's error at their
//! ends. Where the model has no guaranteed worst case, W is the largest |v| over the instants at which probing patterns
//! were seen to be worst under the declared profiles.
//!
//! Every coil is solved once. W falls short of the coil's true worst case only by what lies between the times that were
//! compiled, so it is never above it; what is reported is judged by [`crate::search::cost::tolerance`] on the same coils.
//!
//! # Source
//! The same random numbers for every candidate: Law, Simulation Modeling and Analysis (2015), section 11.2.

use std::collections::BTreeSet;

use super::coil_worst::{Arrangement, Part, Scratch, Worst};
use crate::numeric::statistics::quantile;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::profile::ProfileSpec;
use crate::rate::CoilModel;
use crate::search::cost::guaranteed::{GuaranteedError, UnitStep};
use crate::search::cost::samples::{SampleMatrix, any_rate_model};
use crate::search::cost::tolerance::{Coils, Measure, SHARE, ToleranceError};
use crate::search::cost::worst_case::{SearchError, SolvedProfiles};
use crate::thermal::{Drive, Instant, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

/// Every so many-th time of a unit step's grid is compiled: neighbours are then 9 % apart, and the quantile falls short by
/// at most 0.04 % (all 128 standard patterns of eight layers under a film, a test allows 0.2 %).
const STRIDE: usize = 3;

/// Of sums of rows, generously.
const ROUNDING: f64 = 1e-9;

/// Coils next to the quantile that are looked at first: a pattern that is above the limit in all of them is refused. To be certain of it takes
/// a twentieth of all coils; of 200 patterns none that is better is refused so (a test allows one in twenty).
const NEAR: usize = 4;

/// A pattern is refused by the first of them alone where that is seen to be so many times above the limit. Of 7 million proposals of descents on
/// 40 layers 68 000 passed, five of them with 1.3 times and more there and none with 1.45; 5.4 million were above twice. In rounds as many passed with it as
/// without.
const FAR: f64 = 1.5;

/// Coils that are looked at before any is judged in full, over those that are above the quantile: others are seldom seen above the limit.
const LOOKED_AT: usize = 2;

/// Coils that are the worst with a pattern, over those that are above the quantile. With four patterns that are alike these were 46 of 400, and a
/// descent came to what is small in them alone; it is asked again with what it came to among the patterns.
const WORST_OVER_QUANTILE: usize = 2;

/// The most instants of profiles that are compiled for models without a guaranteed worst case.
const MOST_INSTANTS: usize = 256;

/// Every drawn coil, ready to be judged with any pattern.
#[derive(Debug, Clone)]
pub struct SampledCoils {
    layers: usize,
    share: f64,
    coils: Vec<SampledCoil>,
}

#[derive(Debug, Clone)]
struct SampledCoil {
    lengths_m: Vec<f64>,
    length_m: f64,
    asks_axial: bool,
    worst: Worst,
    /// Never above `worst`, and a fraction of the work: enough to refuse most patterns.
    at_least: Worst,
}

impl SampledCoil {
    fn new(lengths_m: &[f64], worst: Worst) -> Self {
        let length_m = lengths_m.iter().sum();
        let asks_axial = worst.asks_axial();
        Self { lengths_m: lengths_m.to_vec(), length_m, asks_axial, at_least: worst.at_least(), worst }
    }

    fn worst(&self, pattern: &Arrangement, scratch: &mut Scratch) -> f64 {
        pattern.weigh(&self.lengths_m, self.length_m, self.asks_axial, scratch);
        self.worst.of(scratch)
    }

    /// What a look is enough to see that its worst case is above; rounding refuses nothing.
    fn seen_above(&self, pattern: &Arrangement, scratch: &mut Scratch) -> f64 {
        pattern.weigh(&self.lengths_m, self.length_m, self.asks_axial, scratch);
        self.at_least.of(scratch) * (1.0 - ROUNDING)
    }
}

impl SampledCoils {
    /// Solves every coil of a study; `probes` are patterns that show when coils without a guaranteed worst case err most.
    ///
    /// # Errors
    /// As [`crate::search::cost::tolerance::study`].
    pub(crate) fn new(coils: &Coils, probes: &[Pattern]) -> Result<Self, ToleranceError> {
        let layers = coils.model().coil.layers();
        let coils: Vec<Result<SampledCoil, ToleranceError>> = match coils.measure() {
            Measure::Guaranteed => {
                let compile = |model: CoilModel| -> Result<SampledCoil, ToleranceError> {
                    let step = UnitStep::new(&model, coils.profiles().max_rate_k_per_s)?;
                    SampledCoil::guaranteed(&model, &step, STRIDE)
                };
                coils.of_built(|model| compile(model?))
            }
            Measure::Sampled => {
                let instants = binding_instants(coils.model(), coils.profiles(), probes)?;
                coils.of_built(|model| Ok(SampledCoil::sampled(&model?, coils.profiles(), &instants)?))
            }
        };
        let coils = coils.into_iter().collect::<Result<Vec<SampledCoil>, ToleranceError>>()?;
        Ok(Self { layers, share: SHARE, coils })
    }

    /// Models that are all as likely: each coil's guaranteed worst case where it has one, else that over the profiles.
    ///
    /// # Errors
    /// Models that cannot be solved.
    pub(crate) fn of_models(
        models: &[CoilModel],
        profiles: &ProfileSpec,
        probes: &[Pattern],
    ) -> Result<Self, ToleranceError> {
        let compile = |model: &CoilModel| -> Result<SampledCoil, ToleranceError> {
            match UnitStep::new(model, profiles.max_rate_k_per_s) {
                Ok(step) => SampledCoil::guaranteed(model, &step, STRIDE),
                Err(GuaranteedError::Search(error)) => Err(error.into()),
                Err(GuaranteedError::Effect { .. }) => {
                    let instants = binding_instants(model, profiles, probes)?;
                    Ok(SampledCoil::sampled(model, profiles, &instants)?)
                }
            }
        };
        let coils = models.iter().in_parallel().map(compile).collect::<Result<Vec<SampledCoil>, ToleranceError>>()?;
        let layers = models.first().map_or(0, |model| model.coil.layers());
        Ok(Self { layers, share: SHARE, coils })
    }

    /// The coil as declared and nothing else: its guaranteed worst case, the bore's heat included.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub fn nominal(model: &CoilModel, step: &UnitStep) -> Result<Self, ToleranceError> {
        Ok(Self { layers: model.coil.layers(), share: SHARE, coils: vec![SampledCoil::guaranteed(model, step, 1)?] })
    }

    /// The coil as declared and nothing else: its sampled worst case.
    ///
    /// # Errors
    /// Models that cannot be solved.
    pub(crate) fn declared(model: &CoilModel, profiles: &ProfileSpec, probes: &[Pattern]) -> Result<Self, SearchError> {
        let instants = binding_instants(model, profiles, probes)?;
        let coils = vec![SampledCoil::sampled(model, profiles, &instants)?];
        Ok(Self { layers: model.coil.layers(), share: SHARE, coils })
    }

    pub(crate) fn layers(&self) -> usize {
        self.layers
    }

    /// Coils.
    pub(crate) fn count(&self) -> usize {
        self.coils.len()
    }

    /// Some of the coils, each looked at with half the work and in single precision.
    pub(crate) fn telling(&self, coils: &[usize]) -> Self {
        let coarser = |&i: &usize| {
            let coil = &self.coils[i];
            SampledCoil { worst: coil.worst.coarser(), at_least: coil.at_least.single(), ..coil.clone() }
        };
        Self { coils: coils.iter().map(coarser).collect(), ..*self }
    }

    /// Those coils that are among the worst with one of the given patterns, each looked at with half the work: their quantile is that of all as
    /// long as the others stay below it. None where there are too few coils for that.
    pub(crate) fn worst_with(&self, near: &[Vec<usize>]) -> Option<Self> {
        let above = (1.0 - self.share) * (self.count() - 1) as f64;
        if above < 1.0 {
            return None;
        }
        let asked = WORST_OVER_QUANTILE * above.ceil() as usize;
        let worst: BTreeSet<usize> =
            near.iter().flat_map(|segments| self.by_worst(segments).into_iter().take(asked)).collect();
        let worst: Vec<usize> = worst.into_iter().collect();
        // As many are above it as of all.
        let share = 1.0 - above / worst.len().saturating_sub(1) as f64;
        (share > 0.0).then(|| Self { share, ..self.telling(&worst) })
    }

    /// The coils in the order of their worst cases with a pattern, largest first.
    pub(crate) fn by_worst(&self, segments: &[usize]) -> Vec<usize> {
        QuantileWorst::new(self, segments).order
    }

    /// The quantile of the worst cases with a pattern P(j), innermost layer first.
    pub fn cost(&self, segments: &[usize]) -> f64 {
        QuantileWorst::new(self, segments).cost
    }
}

impl SampledCoil {
    fn guaranteed(model: &CoilModel, step: &UnitStep, stride: usize) -> Result<Self, ToleranceError> {
        let coil = model.wound_coil().map_err(SearchError::from)?;
        let parts = step.parts(model, stride)?;
        let changes = Part::new(coil.layers(), &parts.changes);
        let worst = if parts.heat.is_empty() {
            Worst::Variation(changes)
        } else {
            Worst::Heated(changes, Part::new(coil.layers(), &parts.heat))
        };
        Ok(Self::new(coil.layer_lengths_m(), worst))
    }

    fn sampled(model: &CoilModel, profiles: &ProfileSpec, instants: &[Vec<Instant>]) -> Result<Self, SearchError> {
        let coil = model.wound_coil()?;
        let rate_model = any_rate_model(model)?;
        let path = model.heat_path()?;
        let mut responses = Vec::new();
        for (profile, instants) in profiles.profiles().iter().zip(instants) {
            if model.remembers() && !instants.is_empty() {
                let solved = SolvedProfiles::new(model, std::slice::from_ref(profile))?;
                responses.extend(instants.iter().map(|&i| solved.profiles()[0].response_at(&rate_model, i)));
            } else if !instants.is_empty() {
                let history =
                    solve(&path, &Drive::boundary(profile.temperature(REFERENCE_TEMPERATURE_K)))?.at(instants);
                let rows = 0..history.len();
                responses.extend(rows.map(|row| rate_model.weight_response(&rate_model.state(&history, row, &[]))));
            }
        }
        Ok(Self::new(coil.layer_lengths_m(), Worst::Largest(Part::new(coil.layers(), &responses))))
    }
}

/// The instants of each profile at which the probing patterns' errors peak; those that come nearest to a worst case first.
fn binding_instants(
    model: &CoilModel,
    profiles: &ProfileSpec,
    probes: &[Pattern],
) -> Result<Vec<Vec<Instant>>, SearchError> {
    let listed = profiles.profiles();
    let solved = SolvedProfiles::new(model, &listed)?;
    let (matrix, origins) = SampleMatrix::of_profiles(model, &solved)?;
    let mut scores = vec![0.0_f64; origins.len()];
    for pattern in probes {
        let values = matrix.rates_rad_per_s(model, pattern)?;
        let size = |i: usize| values[i].abs();
        let largest = values.iter().map(|v| v.abs()).fold(0.0, f64::max);
        for (i, score) in scores.iter_mut().enumerate() {
            let is_peak = (i == 0 || size(i) >= size(i - 1)) && (i + 1 == values.len() || size(i) >= size(i + 1));
            if is_peak && largest > 0.0 {
                *score += (size(i) / largest).powi(8);
            }
        }
    }
    let mut order: Vec<usize> = (0..origins.len()).filter(|&i| scores[i] > 0.0).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]).then(a.cmp(&b)));
    order.truncate(MOST_INSTANTS);
    order.sort_unstable();
    let mut instants = vec![Vec::new(); listed.len()];
    for i in order {
        instants[origins[i].profile].push(origins[i].instant);
    }
    Ok(instants)
}

/// The worst case of every coil with the present pattern, and room for a proposal.
#[derive(Debug, Clone)]
pub(crate) struct QuantileWorst {
    worst: Vec<f64>,
    proposed: Vec<f64>,
    /// Coils with the largest worst cases first: they are the ones that refuse a move.
    order: Vec<usize>,
    cost: f64,
    proposed_cost: f64,
    scratch: Scratch,
    /// Coils of the proposal that are not yet judged: seen to be above the limit, and others.
    above: Vec<usize>,
    unknown: Vec<usize>,
    /// Coils judged since the last reading.
    pub(crate) judged: u64,
}

impl QuantileWorst {
    pub(crate) fn new(coils: &SampledCoils, segments: &[usize]) -> Self {
        let mut scratch = Scratch::default();
        let pattern = Arrangement::new(segments);
        let worst: Vec<f64> = coils.coils.iter().map(|build| build.worst(&pattern, &mut scratch)).collect();
        let cost = quantile_of(&worst, coils.share);
        let mut state = Self {
            proposed: worst.clone(),
            order: (0..worst.len()).collect(),
            worst,
            cost,
            proposed_cost: cost,
            scratch,
            above: Vec::new(),
            unknown: Vec::new(),
            judged: coils.coils.len() as u64,
        };
        state.sort();
        state
    }

    pub(crate) fn cost(&self) -> f64 {
        self.cost
    }

    /// The quantile with another pattern, or `None` as soon as so many coils are above `limit` that it must be too.
    pub(crate) fn propose(&mut self, coils: &SampledCoils, segments: &[usize], limit: f64) -> Option<f64> {
        let pattern = Arrangement::new(segments);
        let count = coils.coils.len();
        let scratch = &mut self.scratch;
        let seen_above = |index: usize, scratch: &mut Scratch| coils.coils[index].seen_above(&pattern, scratch);
        let mut left = count - (coils.share * (count - 1) as f64).floor() as usize;
        let near = &self.order[left - left.min(NEAR / 2)..count.min(left + NEAR / 2)];
        let first = seen_above(near[0], scratch);
        self.judged += 1;
        if first > FAR * limit {
            return None;
        }
        if left > NEAR && first > limit {
            self.judged += near.len() as u64 - 1;
            if near[1..].iter().all(|&index| seen_above(index, scratch) > limit) {
                return None;
            }
        }
        self.above.clear();
        self.unknown.clear();
        let (doubtful, others) = self.order.split_at(count.min(LOOKED_AT * left));
        for &index in doubtful {
            self.judged += 1;
            if seen_above(index, scratch) > limit {
                self.above.push(index);
                left -= 1;
                if left == 0 {
                    return None;
                }
            } else {
                self.unknown.push(index);
            }
        }
        for &index in self.unknown.iter().chain(others) {
            self.judged += 1;
            self.proposed[index] = coils.coils[index].worst(&pattern, scratch);
            if self.proposed[index] > limit {
                left -= 1;
                if left == 0 {
                    return None;
                }
            }
        }
        for &index in &self.above {
            self.proposed[index] = coils.coils[index].worst(&pattern, scratch);
        }
        self.proposed_cost = quantile_of(&self.proposed, coils.share);
        (self.proposed_cost <= limit).then_some(self.proposed_cost)
    }

    /// Makes the last proposal, which must have passed, the present state.
    pub(crate) fn accept(&mut self) {
        std::mem::swap(&mut self.worst, &mut self.proposed);
        self.cost = self.proposed_cost;
        self.sort();
    }

    fn sort(&mut self) {
        let worst = &self.worst;
        self.order.sort_by(|&a, &b| worst[b].total_cmp(&worst[a]).then(a.cmp(&b)));
    }
}

fn quantile_of(worst: &[f64], share: f64) -> f64 {
    let mut sorted = worst.to_vec();
    sorted.sort_by(f64::total_cmp);
    quantile(&sorted, share)
}
