//! One profile carried out in thought: what each candidate would show, and how well the others could imitate it.
//!
//! ```text
//! d_ij(p) = W_j (Ω_i − Ω_j(p; boundary from the readings that i would give))
//! alone: χ²_ij = min_p |d_ij(p)|² − min_p |d_ii(p)|²,    with the records: |R_j (p − p̂_j)|² beside |d_ij|², + χ²_j − χ²_i
//! ```
//!
//! W whitens with the covariance of noise and of the boundary's error, as the diagnosis does, and takes the offset out;
//! R_j is what the records at hand hold j's parameters with.

use nalgebra::DVector;
use rayon::prelude::*;

use super::super::conductivity::SlopeResponse;
use super::super::evidence::{dot, sum_of_squares};
use super::contest::{Contest, Rival};
use crate::boundary::{Air, Boundary, Kink, Observation, RateWhitener, expose, planned_whitener, seen_by_another};
use crate::fit::{Effort, Fit, Parameter, least_squares};
use crate::numeric::piecewise::PiecewiseLinear;
use crate::numeric::span::Span;
use crate::numeric::statistics::standard_deviation;
use crate::pattern::Pattern;
use crate::predict::layer_gains_rad_per_k;
use crate::profile::Profile;
use crate::rate::{CoilModel, RateModel};
use crate::thermal::{Drive, Driven, HeatPath, ThermalHistory};

/// A profile as the chamber's air.
pub(super) struct Plan<'a> {
    contest: &'a Contest,
    pattern: &'a Pattern,
    air_k: PiecewiseLinear,
    kinks: Vec<Kink>,
    times_s: Vec<f64>,
}

/// What is measured if one candidate is true.
struct Shown {
    path: HeatPath,
    lag_s: f64,
    /// What those see who see heat and sensor as they are: true in a first look, made of the readings in a full one.
    history: ThermalHistory,
    readings_k: Vec<f64>,
    rate_rad_per_s: Vec<f64>,
}

/// How residuals under one candidate are weighed.
struct Weighing {
    air: Air,
    gains_rad_per_k: Vec<f64>,
    whitener: RateWhitener,
    one: Vec<f64>,
}

/// By how much χ² one candidate is expected to be refused if another one is true.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refusal {
    /// Places among the candidates.
    pub truth: usize,
    pub refused: usize,
    /// By the experiment alone, all of the refused candidate's parameters fitted to it.
    pub chi_square_alone: f64,
    /// By the experiment and the records at hand, fitted together.
    pub chi_square_with_records: f64,
    /// The part that the records have said already.
    pub chi_square_of_records: f64,
    /// χ² that the candidates explain of the experiment, and of the records.
    pub explained_alone: f64,
    pub explained_of_records: f64,
}

/// What is foreseen of one profile.
pub(super) struct Foreseen {
    pub refusals: Vec<Refusal>,
    /// Each pair's.
    pub differences: Vec<Difference>,
}

/// Root mean square of the difference of two candidates' rates, the mean taken out, nothing fitted again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Difference {
    pub first: usize,
    pub second: usize,
    pub rms_rad_per_s: f64,
}

/// How thoroughly: how parameters are fitted again, and on which boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refit {
    /// To first order.
    Linear,
    Full,
}

impl<'a> Plan<'a> {
    /// Readings every `step_s` over the whole profile.
    pub fn new(contest: &'a Contest, pattern: &'a Pattern, profile: &Profile, start_k: f64, step_s: f64) -> Self {
        let air_k = profile.temperature(start_k);
        let slopes = profile.pieces().windows(2).zip(&air_k.knots()[1..]);
        let kinks = slopes
            .map(|(pieces, &time_s)| Kink {
                time_s,
                slope_change_k_per_s: pieces[1].rate_k_per_s - pieces[0].rate_k_per_s,
            })
            .filter(|kink| kink.slope_change_k_per_s != 0.0)
            .collect();
        let rows = (profile.duration_s() / step_s) as usize;
        let times_s = (0..=rows).map(|i| step_s * i as f64).collect();
        Self { contest, pattern, air_k, kinks, times_s }
    }

    /// Every candidate refused by every other one, and how far they are apart.
    pub fn judge(&self, refit: Refit) -> Option<Foreseen> {
        let rivals = &self.contest.rivals;
        let shown: Vec<Shown> = rivals.iter().map(|r| self.shown(r, refit)).collect::<Option<_>>()?;
        let weighings: Vec<Weighing> =
            rivals.iter().map(|r| self.weighing(r, &shown[0].readings_k)).collect::<Option<_>>()?;
        let without = self.contest.without.as_ref();
        let without = without.and_then(|w| Some((w, self.weighing(w, &shown[0].readings_k)?)));
        let give = |rival: usize, truth: usize| {
            let (rivals, weighings, shown) = (&rivals, &weighings, &shown);
            move |model: &CoilModel| self.residuals(&rivals[rival], model, &weighings[rival], &shown[truth])
        };
        // Of each truth: what its own candidate leaves, and what the candidates explain.
        let own = (0..rivals.len()).into_par_iter().map(|truth| {
            let left = match refit {
                // Driven by the true boundary, what is true leaves nothing.
                Refit::Linear => [0.0; 2],
                Refit::Full => expected(&rivals[truth], give(truth, truth), refit)?,
            };
            let explained = match &without {
                Some((without, weighing)) => {
                    sum_of_squares(&self.residuals(without, &without.model, weighing, &shown[truth])?)
                }
                None => 0.0,
            };
            Some((left, explained))
        });
        let own: Vec<([f64; 2], f64)> = own.collect::<Option<_>>()?;
        let all = (0..rivals.len()).flat_map(|truth| (0..rivals.len()).map(move |refused| (truth, refused)));
        let directions: Vec<(usize, usize)> =
            all.filter(|&(truth, refused)| truth != refused && !self.contest.is_within(truth, refused)).collect();
        let refusals = directions.into_par_iter().map(|(truth, refused)| {
            let [alone, together] = match refit {
                Refit::Linear => expected(&rivals[refused], give(refused, truth), refit)?,
                Refit::Full => self.left_by(&rivals[refused], &weighings[refused], &shown[truth])?,
            };
            let (left, explained_alone) = own[truth];
            let chi_square_of_records = rivals[refused].chi_square - rivals[truth].chi_square;
            let explained = without.as_ref().map_or(0.0, |(w, _)| w.chi_square - rivals[truth].chi_square);
            Some(Refusal {
                truth,
                refused,
                chi_square_alone: alone - left[0],
                chi_square_with_records: together - left[1] + chi_square_of_records,
                chi_square_of_records,
                explained_alone,
                explained_of_records: explained.max(0.0),
            })
        });
        let refusals: Vec<Refusal> = refusals.collect::<Option<_>>()?;
        let mut differences = Vec::new();
        for first in 0..shown.len() {
            for second in first + 1..shown.len() {
                let rates = shown[first].rate_rad_per_s.iter().zip(&shown[second].rate_rad_per_s);
                let difference: Vec<f64> = rates.map(|(a, b)| a - b).collect();
                differences.push(Difference { first, second, rms_rad_per_s: standard_deviation(&difference) });
            }
        }
        let finite = refusals.iter().all(|r| r.chi_square_alone.is_finite() && r.chi_square_with_records.is_finite());
        finite.then_some(Foreseen { refusals, differences })
    }

    /// χ² that a candidate leaves in the full look. If it sees heat or sensor otherwise than what is true, it also makes
    /// another film and other kinks of the readings, and once more when it has been fitted.
    fn left_by(&self, rival: &Rival, weighing: &Weighing, shown: &Shown) -> Option<[f64; 2]> {
        let give = |seen: &Weighing, model: &CoilModel| self.residuals(rival, model, seen, shown);
        let path = rival.model.heat_path().ok()?;
        if thermally(&path) == thermally(&shown.path) && rival.model.sensor_lag_s() == shown.lag_s {
            return expected(rival, |model| give(weighing, model), Refit::Full);
        }
        let mut seen = self.seen(rival, &rival.model, weighing, shown)?;
        if rival.moves_boundary() {
            let fit = fitted(rival, &|model: &CoilModel| give(&seen, model), false)?;
            seen = self.seen(rival, &rival.with(&fit.parameters)?, &seen, shown)?;
        }
        expected(rival, |model| give(&seen, model), Refit::Full)
    }

    /// With the film and the kinks that suit a model best.
    fn seen(&self, rival: &Rival, model: &CoilModel, weighing: &Weighing, shown: &Shown) -> Option<Weighing> {
        let path = model.heat_path().ok()?;
        let observation = self.observation(model, &path, &shown.readings_k, &weighing.gains_rad_per_k);
        let air = seen_by_another(&observation, &weighing.air).ok()?;
        self.weighing_in(rival, air, &shown.readings_k)
    }

    /// What is measured if a candidate is true, without noise.
    fn shown(&self, rival: &Rival, refit: Refit) -> Option<Shown> {
        let path = rival.model.heat_path().ok()?;
        let lag_s = rival.model.sensor_lag_s();
        let exposed = expose(&path, rival.air.film_w_per_m2_k, lag_s, &self.air_k, &self.times_s).ok()?;
        let history = self.history(&exposed.path, exposed.drive, rival.model.rate_mean_s)?;
        let rate_rad_per_s = RateModel::new(&rival.model, self.pattern, &[]).ok()?.series_rad_per_s(&history);
        let mut shown = Shown { path, lag_s, history, readings_k: exposed.shown_k, rate_rad_per_s };
        if refit == Refit::Full {
            // Nobody knows the boundary but by the readings.
            shown.history =
                self.reconstructed(&rival.model, &self.weighing(rival, &shown.readings_k)?, &shown.readings_k)?;
        }
        Some(shown)
    }

    fn history(&self, path: &HeatPath, drive: Drive, rate_mean_s: f64) -> Option<ThermalHistory> {
        let linear = HeatPath { conductivity_slope_per_k: 0.0, ..path.clone() };
        let driven = Driven::new(drive.clone(), &self.times_s, rate_mean_s);
        let mut history = driven.means(&linear).ok()?;
        if path.conductivity_slope_per_k != 0.0 {
            let response = SlopeResponse::new(&linear, &drive, &self.times_s, driven.window_s())?;
            response.add_to(&mut history, path.conductivity_slope_per_k);
        }
        Some(history)
    }

    /// The pack as it follows from readings.
    fn reconstructed(&self, model: &CoilModel, weighing: &Weighing, readings_k: &[f64]) -> Option<ThermalHistory> {
        let path = model.heat_path().ok()?;
        let observation = self.observation(model, &path, readings_k, &weighing.gains_rad_per_k);
        let boundary = Boundary::in_known_chamber(&observation, &weighing.air).ok()?;
        let (driven, drive) = boundary.driving(&path, 0.0);
        self.history(&driven, drive, model.rate_mean_s)
    }

    fn weighing(&self, rival: &Rival, readings_k: &[f64]) -> Option<Weighing> {
        self.weighing_in(rival, Air { kinks: self.kinks.clone(), ..rival.air.clone() }, readings_k)
    }

    fn weighing_in(&self, rival: &Rival, air: Air, readings_k: &[f64]) -> Option<Weighing> {
        let gains_rad_per_k = layer_gains_rad_per_k(&rival.model, self.pattern).ok()?;
        let path = rival.model.heat_path().ok()?;
        let observation = self.observation(&rival.model, &path, readings_k, &gains_rad_per_k);
        let noise_rad_per_s = self.contest.noise_rad_per_s;
        let whitener = planned_whitener(&observation, &air, noise_rad_per_s).ok()?;
        let mut one = whitener.whiten(&vec![noise_rad_per_s; self.times_s.len()]);
        let length = sum_of_squares(&one).sqrt();
        one.iter_mut().for_each(|v| *v /= length);
        Some(Weighing { air, gains_rad_per_k, whitener, one })
    }

    fn observation<'b>(
        &'b self,
        model: &CoilModel,
        path: &'b HeatPath,
        temperature_k: &'b [f64],
        gains_rad_per_k: &'b [f64],
    ) -> Observation<'b> {
        Observation {
            times_s: &self.times_s,
            temperature_k,
            path,
            lag_s: model.sensor_lag_s(),
            layer_gain_rad_per_k: gains_rad_per_k,
            rate_mean_s: model.rate_mean_s,
        }
    }

    /// What a candidate, at whatever values `model` has, leaves of what is shown: whitened, the offset taken out. Where it
    /// sees heat or sensor otherwise than what is true, it makes a boundary of its own of the readings.
    fn residuals(&self, rival: &Rival, model: &CoilModel, weighing: &Weighing, shown: &Shown) -> Option<Vec<f64>> {
        let (path, lag_s) = (model.heat_path().ok()?, model.sensor_lag_s());
        // What may move must not jump between the true boundary and one that is made of readings.
        let own = if !rival.moves_boundary() && thermally(&path) == thermally(&shown.path) && lag_s == shown.lag_s {
            None
        } else {
            Some(self.reconstructed(model, weighing, &shown.readings_k)?)
        };
        let rate = RateModel::new(model, self.pattern, &[]).ok()?;
        let predicted = rate.series_rad_per_s(own.as_ref().unwrap_or(&shown.history));
        let left: Vec<f64> = shown.rate_rad_per_s.iter().zip(&predicted).map(|(s, p)| s - p).collect();
        let mut whitened = weighing.whitener.whiten(&left);
        let offset = dot(&whitened, &weighing.one);
        whitened.iter_mut().zip(&weighing.one).for_each(|(w, one)| *w -= offset * one);
        Some(whitened)
    }
}

/// A path without what heat does not feel: the height of a pack that loses none along its axis.
fn thermally(path: &HeatPath) -> HeatPath {
    let mut path = path.clone();
    if path.flange.is_none() {
        path.shape.height_m = 0.0;
    }
    path
}

/// χ² that is left of an experiment after a candidate's parameters are fitted to it: alone, and held by the records too.
fn expected(rival: &Rival, give: impl Fn(&CoilModel) -> Option<Vec<f64>>, refit: Refit) -> Option<[f64; 2]> {
    let values = rival.values();
    let at_values = give(&rival.model)?;
    if values.is_empty() {
        let chi_square = sum_of_squares(&at_values);
        return Some([chi_square; 2]);
    }
    if refit == Refit::Full {
        return [false, true]
            .map(|held| Some(fitted(rival, &give, held)?.sum_of_squares))
            .into_iter()
            .collect::<Option<Vec<f64>>>()
            .and_then(|both| <[f64; 2]>::try_from(both).ok());
    }
    let columns = rival.derivatives(&at_values, &give)?;
    let alone = left_over(&at_values, &columns);
    let mut held = at_values;
    held.extend(std::iter::repeat_n(0.0, rival.hold.nrows()));
    let with_hold = |(place, mut column): (usize, Vec<f64>)| {
        column.extend(rival.hold.column(place).iter());
        column
    };
    let together = left_over(&held, &columns.into_iter().enumerate().map(with_hold).collect::<Vec<_>>());
    Some([alone, together])
}

fn fitted(rival: &Rival, give: &impl Fn(&CoilModel) -> Option<Vec<f64>>, held: bool) -> Option<Fit> {
    let values = rival.values();
    let parameter =
        |(&value, (lower, upper)): (&f64, (f64, f64))| Parameter::bounded(value.clamp(lower, upper), lower, upper);
    let parameters: Vec<Parameter> = values.iter().zip(rival.bounds()).map(parameter).collect();
    let residuals = |p: &[f64]| -> Option<Vec<f64>> {
        let mut residuals = give(&rival.with(p)?)?;
        if held {
            let moved = DVector::from_iterator(p.len(), p.iter().zip(&values).map(|(p, v)| p - v));
            residuals.extend((&rival.hold * moved).iter());
        }
        Some(residuals)
    };
    least_squares(&parameters, residuals, Effort::QUICK).ok()
}

/// Sum of squares of what columns leave of a vector.
pub(super) fn left_over(of: &[f64], columns: &[Vec<f64>]) -> f64 {
    sum_of_squares(&Span::of(columns).complement(of))
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::super::contest::tests::{contest, effect, model, pattern, rival};
    use super::*;
    use crate::profile::Piece;
    use crate::units::REFERENCE_TEMPERATURE_K;

    /// Ramps of 1.5 K/min up and down, 5 min each.
    fn profile() -> Profile {
        let piece = |sign: f64, duration_s: f64| Piece { rate_k_per_s: sign * 0.025, duration_s };
        let mut pieces = vec![piece(0.0, 400.0), piece(1.0, 150.0)];
        pieces.extend([piece(-1.0, 300.0), piece(1.0, 300.0)].repeat(5));
        Profile::new("swings", pieces).unwrap()
    }

    fn plan(contest: &Contest) -> Plan<'_> {
        let pattern = Box::leak(Box::new(pattern()));
        Plan::new(contest, pattern, &profile(), REFERENCE_TEMPERATURE_K, 10.0)
    }

    fn refusal(refusals: &[Refusal], truth: usize, refused: usize) -> Refusal {
        *refusals.iter().find(|r| r.truth == truth && r.refused == refused).unwrap()
    }

    #[test]
    fn a_rival_of_another_size_is_fitted_again_and_is_refused_only_as_far_as_the_records_hold_it() {
        let of_gain = |gain: f64| rival("mismatch", model(vec![effect("strain_mismatch", &[gain])]));
        let mut free = contest(vec![of_gain(0.004), of_gain(0.006)]);
        for refit in [Refit::Linear, Refit::Full] {
            let found = refusal(&plan(&free).judge(refit).unwrap().refusals, 0, 1);
            assert!(found.chi_square_alone < 1e-3, "{refit:?}: {found:?}");
            assert!(found.chi_square_with_records < 1e-3);
        }
        // Held by the records with a standard error of one part in a thousand: a² b²/(a² + b²) of the difference.
        let hold_per_unit = 1.0 / 4e-6;
        free.rivals[1].hold = DMatrix::from_element(1, 1, hold_per_unit);
        free.rivals[1].chi_square = 5.0;
        let given = contest(vec![of_gain(0.004), rival("nothing", model(Vec::new()))]);
        let whole = refusal(&plan(&given).judge(Refit::Linear).unwrap().refusals, 0, 1).chi_square_alone;
        let squares = [whole / 0.004_f64.powi(2), hold_per_unit.powi(2)];
        let expected = squares[0] * squares[1] / (squares[0] + squares[1]) * 0.002_f64.powi(2) + 5.0;
        let found = refusal(&plan(&free).judge(Refit::Linear).unwrap().refusals, 0, 1);
        assert!((found.chi_square_with_records / expected - 1.0).abs() < 1e-6);
        assert_eq!(found.chi_square_of_records, 5.0);
    }

    #[test]
    fn the_model_without_an_effect_is_refused_by_the_one_with_it_but_never_the_other_way_round() {
        let given = vec![
            rival("declared", model(Vec::new())),
            rival("with it", model(vec![effect("strain_mismatch", &[0.004])])),
        ];
        let contest = contest(given);
        let refusals = plan(&contest).judge(Refit::Linear).unwrap().refusals;
        assert_eq!(refusals.len(), 1);
        assert!(refusals[0].truth == 1 && refusals[0].chi_square_alone > 100.0);
    }

    /// Whether film and kinks are known in simulated experiments.
    #[derive(Clone, Copy, PartialEq)]
    enum KnownAir {
        Yes,
        No,
    }

    /// Mean of what is found in simulated experiments, its standard error, and what is expected.
    fn carried_out(contest: &Contest, air: KnownAir, draws: usize) -> (f64, f64, f64) {
        let plan = plan(contest);
        let foreseen = refusal(&plan.judge(Refit::Full).unwrap().refusals, 0, 1).chi_square_alone;
        let truth = plan.shown(&contest.rivals[0], Refit::Full).unwrap();
        let weighings = [0, 1].map(|i| plan.weighing(&contest.rivals[i], &truth.readings_k).unwrap());
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let mut noisy = |values: &[f64], deviation: f64| -> Vec<f64> {
            values.iter().map(|v| v + deviation * normal.inverse_cdf(random.random::<f64>())).collect()
        };
        let found: Vec<f64> = (0..draws)
            .map(|_| {
                let shown = Shown {
                    readings_k: noisy(&truth.readings_k, contest.rivals[0].air.noise_k),
                    rate_rad_per_s: noisy(&truth.rate_rad_per_s, contest.noise_rad_per_s),
                    // Each makes a boundary of these readings.
                    lag_s: f64::NAN,
                    path: truth.path.clone(),
                    history: truth.history.clone(),
                };
                let [own, other] = [0, 1].map(|i| {
                    let rival = &contest.rivals[i];
                    if air == KnownAir::No {
                        return plan.left_by(rival, &weighings[i], &shown).unwrap()[0];
                    }
                    let give = |model: &CoilModel| plan.residuals(rival, model, &weighings[i], &shown);
                    expected(rival, give, Refit::Linear).unwrap()[0]
                });
                other - own
            })
            .collect();
        let mean = crate::numeric::statistics::mean(&found);
        let deviation = crate::numeric::statistics::standard_deviation(&found);
        println!("expected {foreseen:.2} ± {:.2}, found {mean:.2} ± {deviation:.2}", 2.0 * foreseen.sqrt());
        (mean, deviation / (draws as f64).sqrt(), foreseen)
    }

    #[test]
    fn a_rival_is_refused_in_simulated_experiments_by_as_much_as_expected() {
        let given = vec![
            rival("mismatch", model(vec![effect("strain_mismatch", &[0.008])])),
            rival("by rate", model(vec![effect("bias_temperature_rate", &[5e-5])])),
        ];
        let (mean, error, expected) =
            carried_out(&Contest { noise_rad_per_s: 3e-8, ..contest(given) }, KnownAir::Yes, 40);
        assert!(expected > 10.0 && (mean - expected).abs() < 3.0 * error + 0.02 * expected);
    }

    #[test]
    fn a_rival_that_moves_heat_otherwise_is_refused_by_what_another_film_and_boundary_leave() {
        let given = vec![
            rival("spool", model(vec![effect("spool_mass", &[150.0, 200.0, 0.0])])),
            rival("diffusivity", model(vec![effect("diffusivity", &[0.9])])),
        ];
        let (mean, error, expected) = carried_out(&contest(given), KnownAir::No, 8);
        // A film that suited the rival takes most of it: with the true film four times as much would be expected.
        assert!(expected > 10.0 && (mean - expected).abs() < 3.0 * error + 0.5 * expected);
    }
}
