//! How far what is computed on a model's grid can be from what the continuum gives.
//!
//! ```text
//! E(τ) = G_fine(τ) − G(τ),   |Ω_fine − Ω| ≤ k_max ( |E(t₀)| + ∫_{t₀}^∞ |E'(τ)| dτ )         for every profile with |k| ≤ k_max
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | G, G_fine | rate error after a unit step of the drive's rate, on the model's grid and on a finer one | rad/s per K/s | – |
//! | t₀ | until then only the layer at the drive has moved, and that in one direction | s | `first_s` |
//!
//! The right side is the guaranteed rate of the difference, so one number holds for the worst rate over any profiles and
//! for the guaranteed rate alike. What the finer grid itself is off is a small part of it: [`SAFETY`] covers that, and tests
//! compare with grids that are finer still. Before t₀ the layer at the drive rises steadily on both grids, and a steady
//! rise adds to |G(0)| + ∫|G'| what it ends at, wherever a grid begins it.
//!
//! Where the rate error is not linear in the drive, the profiles that come close to the worst one are solved again on the
//! finer grid.
//!
//! # Source
//! As [`super::guaranteed`]: the L1 norm of an impulse response is the gain between bounded signals.

use std::sync::OnceLock;

use super::guaranteed::is_linear;
use super::samples::any_rate_model;
use super::worst_case::{PEAK_SHARE, SearchError, SolvedProfile, SolvedProfiles};
use crate::numeric::piecewise::PiecewiseLinear;
use crate::parallel::InParallel;
use crate::pattern::Pattern;
use crate::profile::Profile;
use crate::rate::{CoilModel, RateModel};
use crate::thermal::{Drive, Extent, HeatPath, Instant, Solver, StepResponse, ThermalHistory, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

/// Of the change from the model's grid to the finer one: what that leaves of the continuum's is a fraction of it (tests).
pub(crate) const SAFETY: f64 = 2.0;

/// The finer grid has so many times as many cells a layer, and elements of a higher order with them.
const FINER: usize = 2;

/// t₀, in units of the time in which heat crosses from the drive to the next layer; erfc(5) is left of it there.
const UNTOUCHED: f64 = 0.01;
/// Ratio of successive times at which E is sampled.
const RATIO: f64 = 1.03;

/// Profiles whose own worst is below this share of the worst are not the worst on any grid.
const CONTENDER: f64 = 0.8;

/// A bound on the error that the grid makes, for any pattern.
#[derive(Debug)]
pub struct GridMargin {
    kind: Kind,
}

#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one of it in a search")]
enum Kind {
    /// A closed form: no grid.
    None,
    Linear(Linear),
    Compared(Compared),
}

#[derive(Debug)]
struct Linear {
    model: CoilModel,
    /// E of the layers at one kelvin a second, from t₀ on.
    ramp: ThermalHistory,
    /// What the bore's heat alone is off.
    heat: Option<ThermalHistory>,
}

#[derive(Debug)]
struct Compared {
    finer: CoilModel,
    profiles: Vec<Profile>,
    solved: Vec<OnceLock<Result<SolvedProfile, SearchError>>>,
    /// Of what is linear in the model.
    linear: Option<Linear>,
}

impl GridMargin {
    /// For a model whose profiles are solved already.
    ///
    /// # Errors
    /// Heat paths that cannot be solved.
    pub fn new(model: &CoilModel, solved: &SolvedProfiles) -> Result<Self, SearchError> {
        if model.heat_path()?.extent == Extent::HalfSpace {
            return Ok(Self { kind: Kind::None });
        }
        if is_linear(model)? {
            return Ok(Self { kind: Kind::Linear(Linear::new(model.clone())?) });
        }
        let profiles: Vec<Profile> = solved.profiles().iter().map(|p| p.profile.clone()).collect();
        let coil = model.wound_coil()?;
        let mut linear = model.clone();
        linear.effects.retain(|effect| effect.bind(&coil, &[]).is_linear());
        let finer = CoilModel { cells_per_layer: FINER * model.cells_per_layer, ..model.clone() };
        Ok(Self {
            kind: Kind::Compared(Compared {
                finer,
                solved: profiles.iter().map(|_| OnceLock::new()).collect(),
                profiles,
                linear: Linear::new(linear).ok(),
            }),
        })
    }

    /// By how much a pattern's largest rate error under profiles of at most this rate may be off: over the profiles that
    /// were given, and where the model is linear over all others.
    ///
    /// # Errors
    /// A pattern of another layer count; heat paths that cannot be solved.
    pub fn of(&self, solved: &SolvedProfiles, pattern: &Pattern, max_rate_k_per_s: f64) -> Result<f64, SearchError> {
        match &self.kind {
            Kind::None => Ok(0.0),
            Kind::Linear(linear) => linear.of(pattern, max_rate_k_per_s),
            Kind::Compared(compared) => compared.of(solved, pattern),
        }
    }

    /// The largest margin that any pattern can have: what a proof that goes through all of them must allow for.
    ///
    /// # Errors
    /// None that a model which could be solved would cause.
    pub fn of_any(&self, max_rate_k_per_s: f64) -> Result<f64, SearchError> {
        match &self.kind {
            Kind::None => Ok(0.0),
            Kind::Linear(linear) => linear.of_any(max_rate_k_per_s),
            Kind::Compared(Compared { linear, .. }) => {
                linear.as_ref().map_or(Ok(f64::INFINITY), |l| l.of_any(max_rate_k_per_s))
            }
        }
    }
}

impl Linear {
    fn new(model: CoilModel) -> Result<Self, SearchError> {
        let coarse = model.heat_path()?;
        let fine = HeatPath { cells_per_layer: FINER * coarse.cells_per_layer, ..coarse.clone() };
        let heat_s = 20.0 * coarse.own_course_s();
        let last_s = StepResponse::of(&coarse.driven_only())?.settling_s().max(heat_s);
        let first_s = UNTOUCHED * coarse.untouched_m().powi(2) / coarse.material.diffusivity_m2_per_s();
        let count = ((last_s / first_s).ln() / RATIO.ln()).ceil().max(1.0) as i32;
        let times: Vec<Instant> = (0..=count)
            .map(|i| Instant::after(first_s * (last_s / first_s).powf(f64::from(i) / f64::from(count))))
            .collect();
        let difference = |drive: &Drive, fine: &HeatPath, coarse: &HeatPath| -> Result<ThermalHistory, SearchError> {
            let mut history = solve(fine, drive)?.rates_at(&times);
            history.mix(1.0, &solve(coarse, drive)?.rates_at(&times), -1.0);
            history.temperature_k = vec![REFERENCE_TEMPERATURE_K; times.len() * history.layers];
            Ok(history)
        };
        let end_s = 10.0 * last_s;
        let ramp = PiecewiseLinear::new(vec![0.0, end_s], vec![0.0, end_s])
            .map_err(|_| SearchError::Thermal(crate::thermal::ThermalError::Eigen))?;
        let still = Drive::boundary(PiecewiseLinear::constant(REFERENCE_TEMPERATURE_K));
        let heat = coarse.has_own_course().then(|| difference(&still, &fine, &coarse)).transpose()?;
        let ramp = difference(&Drive::boundary(ramp), &fine.driven_only(), &coarse.driven_only())?;
        Ok(Self { model, ramp, heat })
    }

    fn of(&self, pattern: &Pattern, max_rate_k_per_s: f64) -> Result<f64, SearchError> {
        let rate_model = RateModel::new(&self.model, pattern, &[])?;
        let series = rate_model.series_rad_per_s(&self.ramp);
        let variation = series[0].abs() + series.windows(2).map(|e| (e[1] - e[0]).abs()).sum::<f64>();
        let of_heat = self
            .heat
            .as_ref()
            .map_or(0.0, |heat| rate_model.series_rad_per_s(heat).iter().map(|e| e.abs()).fold(0.0, f64::max));
        Ok(SAFETY * (variation * max_rate_k_per_s + of_heat))
    }

    /// No layer weighs more than its length times what is left of the fibre's.
    fn of_any(&self, max_rate_k_per_s: f64) -> Result<f64, SearchError> {
        let rate_model = any_rate_model(&self.model)?;
        let lengths_m = rate_model.coil().layer_lengths_m();
        let length_m = rate_model.coil().length_m();
        let responses = |history: &ThermalHistory| -> Vec<Vec<f64>> {
            (0..history.len())
                .map(|row| {
                    let response = rate_model.weight_response(&rate_model.state(history, row, &[]));
                    let of_layer = |j: usize| {
                        let larger = response.half_a_rad_per_s_m2[j].abs().max(response.half_b_rad_per_s_m2[j].abs());
                        let signed = larger.copysign(response.half_a_rad_per_s_m2[j]);
                        signed * lengths_m[j] * (length_m - lengths_m[j])
                    };
                    let along =
                        |j: usize| response.axial_rad_per_s_m2.get(j).map_or(0.0, |x| x * 2.0 * lengths_m[j].powi(2));
                    (0..lengths_m.len()).map(of_layer).chain((0..lengths_m.len()).map(along)).collect()
                })
                .collect()
        };
        let ramp = responses(&self.ramp);
        let columns = ramp[0].len();
        let variation: f64 = (0..columns)
            .map(|c| ramp[0][c].abs() + ramp.windows(2).map(|e| (e[1][c] - e[0][c]).abs()).sum::<f64>())
            .sum();
        let of_heat = self.heat.as_ref().map_or(0.0, |heat| {
            responses(heat).iter().map(|row| row.iter().map(|e| e.abs()).sum::<f64>()).fold(0.0, f64::max)
        });
        Ok(SAFETY * (variation * max_rate_k_per_s + of_heat))
    }
}

impl Compared {
    fn of(&self, solved: &SolvedProfiles, pattern: &Pattern) -> Result<f64, SearchError> {
        let path = self.finer.heat_path()?;
        let rate_model = RateModel::new(&self.finer, pattern, &[])?;
        // What is near enough by its samples may still fall behind between them.
        let worst: Vec<(usize, f64)> = solved
            .contenders(&rate_model, CONTENDER * PEAK_SHARE)
            .into_iter()
            .map(|(index, (rate_rad_per_s, _))| (index, rate_rad_per_s.abs()))
            .collect();
        let largest = worst.iter().map(|(_, worst)| *worst).fold(0.0, f64::max);
        let changes: Vec<f64> = worst
            .iter()
            .filter(|(_, worst)| *worst >= CONTENDER * largest)
            .in_parallel()
            .map(|&(index, worst)| {
                let again = self.solved[index].get_or_init(|| {
                    Solver::new(&path)
                        .and_then(|solver| {
                            SolvedProfile::new(self.profiles[index].clone(), 0, &solver, rate_model.remembers())
                        })
                        .map_err(SearchError::from)
                });
                let again = again.as_ref().map_err(Clone::clone)?;
                Ok((again.worst(&rate_model).0.abs() - worst).abs())
            })
            .collect::<Result<_, SearchError>>()?;
        Ok(SAFETY * changes.into_iter().fold(0.0, f64::max))
    }
}
