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
//! Electronics that heat the bore from power-on add a known error g(t) that no profile changes. A profile that begins at
//! power-on has had the time t to act, and may have either sign, so that
//!
//! ```text
//! max |Ω| = sup_t { k_max ( |G(0+)| + ∫_0^t |G'(τ)| dτ ) + |g(t)| }          over all |k| ≤ k_max from power-on
//! ```
//!
//! which a bang-bang profile of the length t with the sign of g(t) attains.
//!
//! Holds for models in which Ω is linear in the rates of temperature. Effects that make it depend on the temperature
//! itself or on a sign have no such bound; [`GuaranteedError::Effect`] names them.
//!
//! # Source
//! The L1 norm of an impulse response is the gain between bounded signals: Boyd and Barratt, Linear Controller Design
//! (1991), section 5.2.

use thiserror::Error;

use crate::numeric::maximise::golden_section;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::pattern::Pattern;
use crate::profile::{Piece, Profile};
use crate::rate::{CoilModel, RateModel, WeightResponse};
use crate::search::cost::samples::{SampleMatrix, any_rate_model};
use crate::search::cost::worst_case::SearchError;
use crate::thermal::{Drive, Field, Instant, StepResponse, ThermalHistory, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

/// Why a model has no guaranteed worst case.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
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
    heat: Option<HeatAlone>,
}

/// The field of the bore's heat while the drive stands still.
#[derive(Debug)]
struct HeatAlone {
    field: Field,
    /// At each of the unit step's times.
    history: ThermalHistory,
}

/// What a guaranteed worst case is made of, for any pattern.
#[derive(Debug, Clone)]
pub(crate) struct BoundParts {
    /// G(0+), and then what it changes by from one time of the grid to the next.
    pub(crate) changes: Vec<WeightResponse>,
    /// g at the same times; empty where nothing heats the bore.
    pub(crate) heat: Vec<WeightResponse>,
}

/// The guaranteed worst case of one pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct Guaranteed {
    /// No profile within the largest rate of temperature makes a larger error.
    pub rate_rad_per_s: f64,
    max_rate_k_per_s: f64,
    /// Times and values at which G turns, from (0, G(0+)) to where the rest no longer matters.
    turns: Vec<(f64, f64)>,
    limit: f64,
    /// Of the heat's error when the worst case occurs; 1 without heat.
    sign: f64,
}

/// Ratio of successive times of the grid on which extremes of G are looked for.
const GRID_RATIO: f64 = 1.03;

/// A smaller change of G than this share of its size is rounding.
const SETTLED_SHARE: f64 = 1e-10;

/// The share of the bound that the bang-bang profile may miss because it is finite.
const MISSED_SHARE: f64 = 1e-3;

/// The bore's heat is settled after so many of its time constants.
const HEAT_SETTLED: f64 = 20.0;

/// One endless ramp: only its rate counts, so its end may lie anywhere behind the grid's last time.
const BEHIND_THE_GRID: f64 = 1000.0;

/// The first effect that makes the rate error depend on more than the rates of the drive.
fn nonlinear_effect(model: &CoilModel) -> Result<Option<String>, SearchError> {
    let coil = model.wound_coil()?;
    Ok(model.effects.iter().find(|e| !e.bind(&coil, &[]).is_linear()).map(|e| e.kind()))
}

/// Whether a model has a guaranteed worst case.
pub(super) fn is_linear(model: &CoilModel) -> Result<bool, SearchError> {
    Ok(nonlinear_effect(model)?.is_none())
}

impl UnitStep {
    /// # Errors
    /// Models that are not linear, by the effect that makes them so; heat paths that cannot be solved.
    pub fn new(model: &CoilModel, max_rate_k_per_s: f64) -> Result<Self, GuaranteedError> {
        if let Some(kind) = nonlinear_effect(model)? {
            return Err(GuaranteedError::Effect { kind });
        }
        let whole = model.heat_path().map_err(SearchError::from)?;
        let path = whole.driven_only();
        let heat_settled_s = HEAT_SETTLED * whole.own_course_s();
        let heated_path = whole.has_own_course().then_some(whole);
        let response = StepResponse::of(&path).map_err(SearchError::from)?;
        let (first_s, last_s) = (1e-2 * response.shortest_s(), response.settling_s().max(heat_settled_s));
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
        let heat = match heated_path {
            None => None,
            Some(path) => {
                let still = Drive::boundary(PiecewiseLinear::constant(REFERENCE_TEMPERATURE_K));
                let field = solve(&path, &still).map_err(SearchError::from)?;
                let history = rates_at(&field, &times_s);
                Some(HeatAlone { field, history })
            }
        };
        Ok(Self { max_rate_k_per_s, field, history, times_s, heat })
    }

    /// Whether something besides the drive heats the pack.
    pub fn is_heated(&self) -> bool {
        self.heat.is_some()
    }

    /// # Errors
    /// A pattern of another layer count.
    pub fn guaranteed(&self, model: &CoilModel, pattern: &Pattern) -> Result<Guaranteed, GuaranteedError> {
        let rate_model = RateModel::new(model, pattern, &[]).map_err(SearchError::from)?;
        let mut series = rate_model.series_rad_per_s(&self.history);
        let limit = series.pop().expect("the limit was appended");
        let error_of = |field: &Field, time_s: f64| {
            let history = rates_at(field, &[time_s]);
            rate_model.rate_error_rad_per_s(&rate_model.state(&history, 0, &[]))
        };
        let error_at = |time_s: f64| error_of(&self.field, time_s);
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
        let mut found = Guaranteed { rate_rad_per_s, max_rate_k_per_s: self.max_rate_k_per_s, turns, limit, sign: 1.0 };
        let heat_at = |time_s: f64| self.heat.as_ref().map_or(0.0, |heat| error_of(&heat.field, time_s));
        if let Some(heat) = &self.heat {
            let with_heat = |time_s: f64, error: f64, heat: f64| found.variation_until(time_s, error) + heat.abs();
            let heats = rate_model.series_rad_per_s(&heat.history);
            let worst = (1..last)
                .map(|i| (i, with_heat(self.times_s[i], series[i], heats[i])))
                .fold((0, 0.0), |best, here| if here.1 > best.1 { here } else { best });
            if worst.1 > rate_rad_per_s {
                let (from_s, to_s) = (self.times_s[worst.0 - 1], self.times_s[worst.0 + 1]);
                let peak = golden_section(|t| with_heat(t, error_at(t), heat_at(t)), from_s, to_s);
                let peak_s = if peak.value > worst.1 { peak.at } else { self.times_s[worst.0] };
                let rate_rad_per_s = peak.value.max(worst.1);
                found.turns.retain(|turn| turn.0 < peak_s);
                found.turns.push((peak_s, error_at(peak_s)));
                return Ok(Guaranteed { rate_rad_per_s, sign: heat_at(peak_s).signum(), ..found });
            }
        }
        found.shorten(&self.times_s, &series);
        if self.heat.is_some() {
            found.sign = heat_at(found.turns[found.turns.len() - 1].0).signum();
        }
        Ok(found)
    }

    /// The bound as a sum of sizes over samples, for any pattern: minimise it with [`crate::search::cost::columns::Norm::Sum`]. It falls
    /// short of the bound only by what the grid's extremes miss, and by the bore's heat where there is any.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub fn samples(&self, model: &CoilModel) -> Result<SampleMatrix, GuaranteedError> {
        Ok(SampleMatrix::new(model, &self.parts(model, 1)?.changes).map_err(SearchError::from)?)
    }

    /// What the bound is made of, at every `stride`-th time of the grid, the first and the limit included.
    ///
    /// # Errors
    /// Effects that leave a layer no turns.
    pub(crate) fn parts(&self, model: &CoilModel, stride: usize) -> Result<BoundParts, SearchError> {
        let rate_model = any_rate_model(model)?;
        let limit = self.times_s.len();
        let rows: Vec<usize> = (0..limit).step_by(stride).chain([limit]).collect();
        let of = |history: &ThermalHistory, rows: &[usize]| -> Vec<WeightResponse> {
            rows.iter().map(|&row| rate_model.weight_response(&rate_model.state(history, row, &[]))).collect()
        };
        let steps = of(&self.history, &rows);
        let mut changes = vec![steps[0].clone()];
        changes.extend(steps.windows(2).map(|pair| difference(&pair[1], &pair[0])));
        let heat = self.heat.as_ref().map_or_else(Vec::new, |heat| {
            let mut errors = of(&heat.history, &rows[..rows.len() - 1]);
            // Nothing is left of the heat's error in the limit.
            errors.push(difference(&errors[0], &errors[0]));
            errors
        });
        Ok(BoundParts { changes, heat })
    }
}

impl Guaranteed {
    /// |G(0+)| + ∫_0^t |G'| dτ, G(t) being `error`.
    fn variation_until(&self, time_s: f64, error: f64) -> f64 {
        let before = self.turns.partition_point(|turn| turn.0 < time_s).max(1);
        let full: f64 = self.turns[..before].windows(2).map(|w| (w[1].1 - w[0].1).abs()).sum();
        self.turns[0].1.abs() + full + (error - self.turns[before - 1].1).abs()
    }

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
        let toward = |sign_of: f64| self.sign * self.max_rate_k_per_s.copysign(sign_of);
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
    use crate::effect::{self, DeclaredEffect};
    use crate::pattern::classic::Classic;
    use crate::profile::ProfileSpec;
    use crate::search::cost::columns::Norm;
    use crate::search::cost::samples::tests::model;
    use crate::search::cost::worst_case::SolvedProfiles;
    use crate::thermal::Extent;

    const RATE_K_PER_S: f64 = 10.0 / 3600.0;

    /// Extrema of the step's response are found to this share of the bound; the margin of its grid is larger.
    const EXTREMA: f64 = 1e-5;

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
                    assert!((0.995..=1.0 + EXTREMA).contains(&share), "{effects:?} {extent:?} {classic:?}: {share}");
                    let cost = samples.cost(&model, &pattern, Norm::Sum).unwrap() / bound.rate_rad_per_s;
                    assert!((0.998..=1.0 + 1e-12).contains(&cost), "{effects:?} {extent:?} {classic:?}: {cost}");
                }
            }
        }
    }

    #[test]
    fn with_a_heated_bore_the_bang_bang_profile_attains_the_bound_and_no_sampled_profile_exceeds_it() {
        let parameters = |power: f64, time_constant_s: f64| {
            let mut model = model(8, LayerLength::Actual, &["surface_film", "spool_mass"]);
            let spec = effect::find("self_heating").unwrap();
            model.effects.push(DeclaredEffect::new(spec, vec![power, time_constant_s], vec![]).unwrap());
            model
        };
        for (power, time_constant_s) in [(50.0, 600.0), (-50.0, 30.0), (1500.0, 5.0), (2.0, 20000.0)] {
            let model = parameters(power, time_constant_s);
            let step = UnitStep::new(&model, RATE_K_PER_S).unwrap();
            for classic in [Classic::Zyl, Classic::Dip, Classic::Qua] {
                let pattern = classic.pattern(8).unwrap();
                let bound = step.guaranteed(&model, &pattern).unwrap();
                let worst = |profiles: &[Profile]| {
                    let solved = SolvedProfiles::new(&model, profiles).unwrap();
                    solved.worst_case(&model, &pattern).unwrap().rate_rad_per_s.abs() / bound.rate_rad_per_s
                };
                let attained = worst(&[bound.profile("bang-bang")]);
                assert!(
                    (0.995..=1.0 + EXTREMA).contains(&attained),
                    "{power} {time_constant_s} {classic:?}: {attained}"
                );
                let spec = ProfileSpec {
                    max_rate_k_per_s: RATE_K_PER_S,
                    count: 20,
                    segments: 4,
                    duration_s: 3000.0,
                    seed: 2,
                    listed: vec![],
                };
                assert!(worst(&spec.profiles()) <= 1.0 + 1e-9, "{power} {time_constant_s} {classic:?}");
            }
        }
    }

    #[test]
    fn without_a_drive_that_matters_the_bound_is_the_largest_error_of_the_heat() {
        let model = model(8, LayerLength::Actual, &["surface_film", "self_heating"]);
        let pattern = Classic::Dip.pattern(8).unwrap();
        let bound = UnitStep::new(&model, 1e-12).unwrap().guaranteed(&model, &pattern).unwrap().rate_rad_per_s;
        let rate_model = RateModel::new(&model, &pattern, &[]).unwrap();
        let still = Drive::boundary(PiecewiseLinear::constant(REFERENCE_TEMPERATURE_K));
        let field = solve(&model.heat_path().unwrap(), &still).unwrap();
        let times: Vec<Instant> = (0..20000).map(|i| Instant::after(0.2 * f64::from(i))).collect();
        let alone = rate_model.series_rad_per_s(&field.at(&times)).iter().map(|g| g.abs()).fold(0.0, f64::max);
        assert!((bound / alone - 1.0).abs() < 1e-6, "{bound} {alone}");
    }

    #[test]
    fn a_model_without_a_bound_names_the_effect() {
        for kind in ["glass_transition", "thermo_optic_temperature", "bias_temperature", "heating_cooling_asymmetry"] {
            let error = UnitStep::new(&model(8, LayerLength::Equal, &["spool_mass", kind]), 1e-3).unwrap_err();
            assert_eq!(error, GuaranteedError::Effect { kind: kind.into() });
        }
    }
}
