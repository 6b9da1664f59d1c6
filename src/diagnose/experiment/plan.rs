//! One profile carried out in thought: what each candidate would show, and how well the others could imitate it.
//!
//! ```text
//! alone: χ²_ij = min_p D_j(p; shown by i) − min_p D_i(p; shown by i),   with the records: D + δpᵀ H δp, + χ²_j − χ²_i
//! ```
//!
//! D is the sum of squares of the innovations, each over its variance, in the joint model of chamber, pack, sensor and gyro
//! with the numbers that the records showed, of what the sensor and the gyro would show on average; H is what the records at hand hold the candidate's numbers and the film with.

use super::alternatives::{FittedAlternative, ModelComparison};
use crate::chamber::{Bend, Chamber, Fit, Quantity, Refit};
use crate::numeric::piecewise::PiecewiseLinear;
use crate::numeric::statistics::standard_deviation;
use crate::parallel::InParallel;
use crate::profile::Profile;
use crate::rate::RateModel;
use crate::record::Record;
use crate::thermal::exposure::expose;
use crate::thermal::solve;

/// A profile as the chamber's air.
pub(super) struct ExperimentPlan<'a> {
    comparison: &'a ModelComparison,
    air_k: PiecewiseLinear,
    times_s: Vec<f64>,
}

/// By how much χ² one candidate is expected to be refused if another one is true.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ExpectedRefusal {
    /// Places among the candidates.
    pub(crate) truth: usize,
    pub(crate) refused: usize,
    /// By the experiment alone, all of the refused candidate's parameters fitted to it.
    pub(crate) chi_square_alone: f64,
    /// By the experiment and the records at hand, fitted together.
    pub(crate) chi_square_with_records: f64,
    /// The part that the records have said already.
    pub(crate) chi_square_of_records: f64,
    /// χ² that the candidates explain of the experiment, and of the records.
    pub(crate) explained_alone: f64,
    pub(crate) explained_of_records: f64,
}

/// What is foreseen of one profile.
pub(super) struct Foreseen {
    pub(crate) refusals: Vec<ExpectedRefusal>,
    /// Each pair's.
    pub(crate) differences: Vec<Difference>,
}

/// Root mean square of the difference of two candidates' rates, the mean taken out, nothing fitted again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Difference {
    pub(crate) first: usize,
    pub(crate) second: usize,
    pub(crate) rms_rad_per_s: f64,
}

impl<'a> ExperimentPlan<'a> {
    /// Readings every `step_s` over the whole profile.
    pub(crate) fn new(comparison: &'a ModelComparison, profile: &Profile, start_k: f64, step_s: f64) -> Self {
        let rows = (profile.duration_s() / step_s) as usize;
        let times_s = (0..=rows).map(|i| step_s * i as f64).collect();
        Self { comparison, air_k: profile.temperature(start_k), times_s }
    }

    /// Every candidate refused by every other one, and how far they are apart.
    pub(crate) fn judge(&self, refit: Refit) -> Option<Foreseen> {
        let alternatives = &self.comparison.alternatives;
        let air = self.comparison.air.as_ref()?;
        let shown: Vec<Record> = alternatives.iter().map(|r| self.shown(r, air)).collect::<Option<_>>()?;
        let refusals: Vec<Vec<ExpectedRefusal>> = (0..alternatives.len())
            .in_parallel()
            .map(|truth| self.refusals(&shown[truth], truth, air, refit))
            .collect::<Option<_>>()?;
        let refusals = refusals.concat();
        let mut differences = Vec::new();
        for first in 0..shown.len() {
            for second in first + 1..shown.len() {
                let rates = shown[first].rate_rad_per_s().iter().zip(shown[second].rate_rad_per_s());
                let difference: Vec<f64> = rates.map(|(a, b)| a - b).collect();
                differences.push(Difference { first, second, rms_rad_per_s: standard_deviation(&difference) });
            }
        }
        let finite = refusals.iter().all(|r| r.chi_square_alone.is_finite() && r.chi_square_with_records.is_finite());
        finite.then_some(Foreseen { refusals, differences })
    }

    /// Every other candidate refused by what one truth shows; one that holds the truth as a special case never is.
    fn refusals(&self, shown: &Record, truth: usize, air: &Fit, refit: Refit) -> Option<Vec<ExpectedRefusal>> {
        let alternatives = &self.comparison.alternatives;
        let is_refused = |&other: &usize| other != truth && !self.comparison.is_within(truth, other);
        let refused: Vec<usize> = (0..alternatives.len()).filter(is_refused).collect();
        if refused.is_empty() {
            return Some(Vec::new());
        }
        let noise = self.comparison.noise_rad_per_s;
        let chamber = Chamber::planned(alternatives[truth].model(), shown, &self.bends(), noise).ok()?;
        // Alone, and held by the records.
        let left = |place: usize| -> Option<[f64; 2]> {
            let alternative = &alternatives[place];
            chamber.foresee(&alternative.fit, air, [None, alternative.hold.as_ref()], 0, refit).ok()
        };
        let own = left(truth)?;
        let (explained_alone, explained_of_records) = match &self.comparison.without {
            Some(without) => {
                let [left] = chamber.foresee(&without.fit, air, [None], 0, Refit::None).ok()?;
                ((left - own[0]).max(0.0), (without.deviance - alternatives[truth].deviance).max(0.0))
            }
            None => (0.0, 0.0),
        };
        let refusal = |refused: usize| {
            let other = left(refused)?;
            let chi_square_of_records = alternatives[refused].deviance - alternatives[truth].deviance;
            Some(ExpectedRefusal {
                truth,
                refused,
                chi_square_alone: other[0] - own[0],
                chi_square_with_records: other[1] - own[1] + chi_square_of_records,
                chi_square_of_records,
                explained_alone,
                explained_of_records,
            })
        };
        refused.into_iter().map(refusal).collect()
    }

    /// Where the air's slope changes, which whoever drives the chamber knows.
    fn bends(&self) -> Vec<Bend> {
        let change = |&time_s: &f64| {
            let slope_change_k_per_s = self.air_k.slope_after(time_s) - self.air_k.slope_before(time_s);
            Bend { time_s, slope_change_k_per_s }
        };
        self.air_k.knots().iter().map(change).filter(|bend| bend.slope_change_k_per_s != 0.0).collect()
    }

    /// What is measured if a candidate is true, without noise.
    fn shown(&self, alternative: &FittedAlternative, air: &Fit) -> Option<Record> {
        let model = alternative.model();
        let path = model.heat_path().ok()?;
        let film = alternative.fit.number(Quantity::Film, alternative.fit.records.first().copied().unwrap_or(0));
        let film = if film.is_finite() { film } else { air.number(Quantity::Film, air.records[0]) };
        let exposed = expose(&path, Some(film), model.sensor_lag_s(), &self.air_k, &self.times_s).ok()?;
        let history = solve(&exposed.path, &exposed.drive).ok()?.means(&self.times_s, model.rate_mean_s);
        let rates = RateModel::new(model, &alternative.fit.assumed.pattern, &[]).ok()?.series_rad_per_s(&history);
        Record::new("planned", self.times_s.clone(), exposed.shown_k, rates).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::super::alternatives::tests::{alternative, comparison, effect, model};
    use super::*;
    use nalgebra::DMatrix;

    use crate::chamber::Hold;
    use crate::profile::Piece;
    use crate::units::REFERENCE_TEMPERATURE_K;

    /// Ramps of 1.5 K/min up and down, 5 min each.
    fn profile() -> Profile {
        let piece = |sign: f64, duration_s: f64| Piece { rate_k_per_s: sign * 0.025, duration_s };
        let mut pieces = vec![piece(0.0, 400.0), piece(1.0, 150.0)];
        pieces.extend([piece(-1.0, 300.0), piece(1.0, 300.0)].repeat(5));
        Profile::new("swings", pieces).unwrap()
    }

    fn plan(comparison: &ModelComparison) -> ExperimentPlan<'_> {
        ExperimentPlan::new(comparison, &profile(), REFERENCE_TEMPERATURE_K, 10.0)
    }

    fn refusal(refusals: &[ExpectedRefusal], truth: usize, refused: usize) -> ExpectedRefusal {
        *refusals.iter().find(|r| r.truth == truth && r.refused == refused).unwrap()
    }

    #[test]
    fn a_rival_of_another_size_is_fitted_again_and_is_refused_only_as_far_as_the_records_hold_it() {
        let of_gain = |gain: f64| alternative("mismatch", model(vec![effect("strain_mismatch", &[gain])]));
        let mut free = comparison(vec![of_gain(0.004), of_gain(0.006)]);
        for refit in [Refit::Linear, Refit::Full] {
            let found = refusal(&plan(&free).judge(refit).unwrap().refusals, 0, 1);
            println!("{refit:?}: {found:?}");
            assert!(found.chi_square_alone.abs() < 0.05, "{refit:?}: {found:?}");
        }
        // Held by the records at its own size, far more firmly than by the experiment: the whole difference is left.
        // The film is held too.
        free.alternatives[1].hold = Some(Hold { information: DMatrix::identity(2, 2) * 1e12 });
        free.alternatives[1].deviance = 5.0;
        let found = refusal(&plan(&free).judge(Refit::Full).unwrap().refusals, 0, 1);
        let given = comparison(vec![of_gain(0.004), alternative("nothing", model(Vec::new()))]);
        let whole = refusal(&plan(&given).judge(Refit::Full).unwrap().refusals, 0, 1).chi_square_alone;
        println!("{found:?}, whole {whole}");
        // By half the size that it is wrong by, a quarter of what the whole effect is worth; air takes some of both.
        assert!(((found.chi_square_with_records - 5.0) / (0.25 * whole) - 1.0).abs() < 0.3);
        assert_eq!(found.chi_square_of_records, 5.0);
    }

    #[test]
    fn the_model_without_an_effect_is_refused_by_the_one_with_it_but_never_the_other_way_round() {
        let given = vec![
            alternative("declared", model(Vec::new())),
            alternative("with it", model(vec![effect("strain_mismatch", &[0.004])])),
        ];
        let comparison = comparison(given);
        let refusals = plan(&comparison).judge(Refit::Linear).unwrap().refusals;
        assert_eq!(refusals.len(), 1);
        assert!(refusals[0].truth == 1 && refusals[0].chi_square_alone > 100.0);
    }
}
