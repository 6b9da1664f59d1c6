//! The guaranteed worst case: the largest rate error over *all* profiles of any length within a rate.
//!
//! ```text
//! Ω(t) = G(0+) k(t) + ∫_0^∞ G'(τ) k(t−τ) dτ
//! max |Ω| = k_max ( |G(0+)| + ∫_0^∞ |G'(τ)| dτ )            over all |k| ≤ k_max
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | k | rate of the drive | K/s | slope of the profile |
//! | G | rate error after a unit step of k at τ = 0 | rad/s per K/s | `UnitStep::error_rad_per_s` (times k_max) |
//!
//! ∫|G'| is the total variation of G: the sum of the differences between its extremes, which are found on a grid and
//! refined on the exact field. The profile that attains the bound is bang-bang, ±k_max with the sign of G' reversed in
//! time, and ends on the sign of G(0+).
//!
//! Holds for models in which Ω is linear in the rates of temperature. Effects that make it depend on the temperature
//! itself, on a sign, or on heat from elsewhere have no such bound; [`GuaranteedError::Effect`] names them.
//!
//! # Source
//! The L1 norm of an impulse response is the gain between bounded signals: Boyd and Barratt, Linear Controller Design
//! (1991), section 5.2.

use thiserror::Error;

use super::samples::{SampleMatrix, any_rate_model};
use super::worst_case::SearchError;
use crate::numeric::maximise::golden_section;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::pattern::Pattern;
use crate::profile::{Piece, Profile};
use crate::rate::{CoilModel, RateModel, WeightResponse};
use crate::thermal::{Drive, Field, Instant, StepResponse, ThermalHistory, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

#[derive(Debug, Error, Clone, PartialEq)]
pub enum GuaranteedError {
    #[error(
        "there is no guaranteed worst case with {kind}: the rate error then depends on more than the rates of the drive"
    )]
    Effect { kind: String },
    #[error(transparent)]
    Search(#[from] SearchError),
}

/// The coil's response to one step of the drive's rate, of any pattern.
#[derive(Debug)]
pub struct UnitStep {
    max_rate_k_per_s: f64,
    field: Field,
    /// Just after each of `times_s`, and last the limit at infinity.
    history: ThermalHistory,
    times_s: Vec<f64>,
}

/// The guaranteed worst case of one pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct Guaranteed {
    pub rate_rad_per_s: f64,
    max_rate_k_per_s: f64,
    /// Times and values at which G turns, from (0, G(0+)) to where the rest no longer matters.
    turns: Vec<(f64, f64)>,
    limit: f64,
}

/// Ratio of successive times of the grid on which extremes of G are looked for.
const GRID_RATIO: f64 = 1.03;

/// A smaller change of G than this share of its size is rounding.
const SETTLED_SHARE: f64 = 1e-10;

/// The share of the bound that the bang-bang profile may miss because it is finite.
const MISSED_SHARE: f64 = 1e-3;

/// One endless ramp: only its rate counts, so its end may lie anywhere behind the grid's last time.
const BEHIND_THE_GRID: f64 = 1000.0;

impl UnitStep {
    /// # Errors
    /// Models that are not linear, by the effect that makes them so; heat paths that cannot be solved.
    pub fn new(model: &CoilModel, max_rate_k_per_s: f64) -> Result<Self, GuaranteedError> {
        let coil = model.wound_coil().map_err(SearchError::from)?;
        if let Some(effect) = model.effects.iter().find(|e| !e.bind(&coil, &[]).is_linear()) {
            return Err(GuaranteedError::Effect { kind: effect.kind() });
        }
        let path = model.heat_path().map_err(SearchError::from)?;
        let response = StepResponse::of(&path).map_err(SearchError::from)?;
        let (first_s, last_s) = (1e-2 * response.shortest_s(), response.settling_s());
        let count = ((last_s / first_s).ln() / GRID_RATIO.ln()).ceil() as usize;
        let times_s: Vec<f64> = std::iter::once(0.0)
            .chain((0..=count).map(|i| first_s * (last_s / first_s).powf(i as f64 / count as f64)))
            .collect();
        let end_s = BEHIND_THE_GRID * last_s;
        let ramp = PiecewiseLinear::new(vec![0.0, end_s], vec![0.0, max_rate_k_per_s * end_s])
            .map_err(|_| SearchError::Thermal(crate::thermal::ThermalError::Eigen))?;
        let field = solve(&path, &Drive::boundary(ramp)).map_err(SearchError::from)?;
        let mut history = rates_at(&field, &times_s);
        append_limit(&mut history, max_rate_k_per_s);
        Ok(Self { max_rate_k_per_s, field, history, times_s })
    }

    /// # Errors
    /// A pattern of another layer count.
    pub fn guaranteed(&self, model: &CoilModel, pattern: &Pattern) -> Result<Guaranteed, GuaranteedError> {
        let rate_model = RateModel::new(model, pattern, &[]).map_err(SearchError::from)?;
        let mut series = rate_model.series_rad_per_s(&self.history);
        let limit = series.pop().expect("the limit was appended");
        let error_at = |time_s: f64| {
            let history = rates_at(&self.field, &[time_s]);
            rate_model.rate_error_rad_per_s(&rate_model.state(&history, 0, &[]))
        };
        let last = series.len() - 1;
        let largest = series.iter().map(|g| g.abs()).fold(limit.abs(), f64::max);
        let mut turns = vec![(0.0, series[0])];
        for i in 1..last {
            let (before, here, after) = (series[i - 1], series[i], series[i + 1]);
            let turned = (here - before) * (after - here) < 0.0;
            // Where G has settled, only rounding turns.
            if turned && (here - turns[turns.len() - 1].1).abs() > SETTLED_SHARE * largest {
                let sign = (here - before).signum();
                let peak = golden_section(|t| sign * error_at(t), self.times_s[i - 1], self.times_s[i + 1]);
                turns.push((peak.at, sign * peak.value.max(sign * here)));
            }
        }
        turns.push((self.times_s[last], series[last]));
        let variation: f64 = turns.windows(2).map(|w| (w[1].1 - w[0].1).abs()).sum();
        let rate_rad_per_s = series[0].abs() + variation + (limit - series[last]).abs();
        let mut found = Guaranteed { rate_rad_per_s, max_rate_k_per_s: self.max_rate_k_per_s, turns, limit };
        found.shorten(&self.times_s, &series);
        Ok(found)
    }

    /// The bound as a sum of sizes over samples, for any pattern: minimise it with [`super::columns::Norm::Sum`]. It falls
    /// short of the bound only by what the grid's extremes miss.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub fn samples(&self, model: &CoilModel) -> Result<SampleMatrix, GuaranteedError> {
        let rate_model = any_rate_model(model)?;
        let steps: Vec<WeightResponse> = (0..self.history.len())
            .map(|row| rate_model.weight_response(&rate_model.state(&self.history, row, &[])))
            .collect();
        let mut responses = vec![steps[0].clone()];
        responses.extend(steps.windows(2).map(|pair| difference(&pair[1], &pair[0])));
        Ok(SampleMatrix::new(model, &responses).map_err(SearchError::from)?)
    }
}

impl Guaranteed {
    /// Ends the last stretch where what is left of G's way to its limit no longer matters.
    fn shorten(&mut self, times_s: &[f64], series: &[f64]) {
        let allowed = MISSED_SHARE * self.rate_rad_per_s;
        let count = self.turns.len();
        let (last_s, last) = self.turns[count - 1];
        let after_s = self.turns[count - 2].0;
        let left = (self.limit - last).abs();
        self.turns[count - 1] = if left > allowed {
            // A half space's tail falls as 1/√τ.
            (last_s * (left / allowed).powi(2), self.limit)
        } else {
            let enough = (0..times_s.len())
                .find(|&i| times_s[i] > after_s && (series[i] - self.limit).abs() <= allowed)
                .unwrap_or(times_s.len() - 1);
            (times_s[enough], series[enough])
        };
    }

    /// The bang-bang profile that attains the bound just after its last switch.
    pub fn profile(&self, name: &str) -> Profile {
        let toward = |sign_of: f64| self.max_rate_k_per_s.copysign(sign_of);
        let mut pieces: Vec<Piece> = self
            .turns
            .windows(2)
            .rev()
            .map(|w| Piece { rate_k_per_s: toward(w[1].1 - w[0].1), duration_s: w[1].0 - w[0].0 })
            .collect();
        // The drive's present rate acts through G(0+) at once: the switch itself is what counts.
        let duration_s = self.turns[1].0.min(1.0);
        pieces.push(Piece { rate_k_per_s: toward(self.turns[0].1), duration_s });
        Profile::new(name, pieces).expect("times at which G turns increase")
    }
}

/// Rates alone, at a temperature that linear models don't look at.
fn rates_at(field: &Field, times_s: &[f64]) -> ThermalHistory {
    let instants: Vec<Instant> = times_s.iter().map(|&t| Instant::after(t)).collect();
    let mut history = field.rates_at(&instants);
    history.temperature_k = vec![REFERENCE_TEMPERATURE_K; times_s.len() * history.layers];
    history
}

/// Behind everything that settles, all layers and the ambient follow the drive.
fn append_limit(history: &mut ThermalHistory, rate_k_per_s: f64) {
    let layers = history.layers;
    let moments = if history.axial_moment_k_per_s.is_empty() { 0 } else { layers };
    history.times_s.push(f64::INFINITY);
    history.temperature_k.extend(std::iter::repeat_n(REFERENCE_TEMPERATURE_K, layers));
    history.rate_k_per_s.extend(std::iter::repeat_n(rate_k_per_s, layers));
    history.axial_moment_k_per_s.extend(std::iter::repeat_n(0.0, moments));
    history.ambient_k.push(REFERENCE_TEMPERATURE_K);
    history.ambient_rate_k_per_s.push(rate_k_per_s);
}

fn difference(later: &WeightResponse, earlier: &WeightResponse) -> WeightResponse {
    let of = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
    WeightResponse {
        half_a_rad_per_s_m2: of(&later.half_a_rad_per_s_m2, &earlier.half_a_rad_per_s_m2),
        half_b_rad_per_s_m2: of(&later.half_b_rad_per_s_m2, &earlier.half_b_rad_per_s_m2),
        axial_rad_per_s_m2: of(&later.axial_rad_per_s_m2, &earlier.axial_rad_per_s_m2),
        constant_rad_per_s: later.constant_rad_per_s - earlier.constant_rad_per_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coil::LayerLength;
    use crate::pattern::classic::Classic;
    use crate::search::columns::Norm;
    use crate::search::samples::tests::model;
    use crate::search::worst_case::SolvedProfiles;
    use crate::thermal::Extent;

    const RATE_K_PER_S: f64 = 10.0 / 3600.0;

    #[test]
    fn the_bang_bang_profile_attains_the_bound_and_nothing_exceeds_it() {
        let effect_sets: [&[&str]; 5] = [
            &[],
            &["surface_film"],
            &["strain_mismatch", "midpoint_offset", "surface_film"],
            &["axial_gradient", "spool_mass"],
            &["bias_gradient_rate", "turn_mismatch"],
        ];
        for effects in effect_sets {
            let mut model = model(8, LayerLength::Actual, effects);
            for extent in [Extent::Pack, Extent::HalfSpace] {
                if extent == Extent::HalfSpace
                    && effects.iter().any(|e| *e != "bias_gradient_rate" && *e != "turn_mismatch")
                {
                    continue;
                }
                model.extent = extent;
                let step = UnitStep::new(&model, RATE_K_PER_S).unwrap();
                let samples = step.samples(&model).unwrap();
                for classic in [Classic::Zyl, Classic::Dip, Classic::Qua] {
                    let pattern = classic.pattern(8).unwrap();
                    let bound = step.guaranteed(&model, &pattern).unwrap();
                    let profile = bound.profile("bang-bang");
                    let solved = SolvedProfiles::new(&model, &[profile]).unwrap();
                    let attained = solved.worst_case(&model, &pattern).unwrap().rate_rad_per_s.abs();
                    let share = attained / bound.rate_rad_per_s;
                    assert!((0.995..=1.0 + 1e-9).contains(&share), "{effects:?} {extent:?} {classic:?}: {share}");
                    let cost = samples.cost(&model, &pattern, Norm::Sum).unwrap() / bound.rate_rad_per_s;
                    assert!((0.998..=1.0 + 1e-12).contains(&cost), "{effects:?} {extent:?} {classic:?}: {cost}");
                }
            }
        }
    }

    #[test]
    fn a_model_without_a_bound_names_the_effect() {
        for kind in ["glass_transition", "thermo_optic_temperature", "bias_temperature", "heating_cooling_asymmetry"] {
            let error = UnitStep::new(&model(8, LayerLength::Equal, &["spool_mass", kind]), 1e-3).unwrap_err();
            assert_eq!(error, GuaranteedError::Effect { kind: kind.into() });
        }
    }
}
