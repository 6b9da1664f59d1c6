//! Where a record's ripple may be: the score test of an oscillator of each period beside a chamber that has none.
//!
//! A likelihood has a maximum for every period that an oscillator may lock on to, hundreds of units apart, and none leads to the
//! next. The score of a ripple's variance where there is none says of all periods at once which are worth a fit.

use nalgebra::{DMatrix, DVector};

use super::abreast;
use super::derivative::DerivativeColumn;
use super::fit::Fit;
use super::model_point::MovedRecord;
use super::prior::Quantity;
use super::system::decoupled_system;
use super::{Chamber, ChamberError};
use crate::numeric::order::sort_descending;
use crate::parallel::InParallel;

/// Periods that are looked at: so many to a factor of e, as far as the prior reaches both ways in its deviations.
const PERIODS_PER_E: f64 = 12.0;
const REACH_DEVIATIONS: f64 = 2.5;
/// Size of a ripple that is as good as none, and of the one whose score is asked for [K].
const NONE_K: f64 = 1e-4;
const TESTED_K: f64 = 3e-3;
/// Sizes that a fit may begin with [K].
const SMALLEST_K: f64 = 0.03;
const LARGEST_K: f64 = 0.5;

/// A ripple that a fit may begin with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ripple {
    pub(super) period_s: f64,
    pub(super) size_k: f64,
    /// What the score test promises in log likelihood.
    gain: f64,
}

impl Chamber<'_> {
    /// Ripples that a record may have beside what a fit found without one, most promising first: each better than its neighbours.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(super) fn ripples(&self, fit: &Fit, record: usize) -> Result<Vec<Ripple>, ChamberError> {
        let mut numbers = fit.numbers.clone();
        numbers[record].set(Quantity::RippleSize, NONE_K);
        numbers[record].set(Quantity::RippleCoherence, Quantity::RippleCoherence.prior().median);
        let point = self.model_point(fit.assumed.clone(), numbers, &[record], &fit.courses)?;
        let base = vec![self.innovations(&point, record)?];
        let of_ripple = [Quantity::RippleSize, Quantity::RipplePeriod, Quantity::RippleCoherence];
        let (parameters, coordinates): (Vec<_>, Vec<_>) = (fit.parameters.iter().zip(&fit.coordinates))
            .filter(|(p, _)| p.concerns(record) && !of_ripple.iter().any(|q| p.is_quantity(*q)))
            .map(|(p, x)| (*p, *x))
            .unzip();
        let derivatives = self.derivatives(&point, &parameters, &coordinates, &[record], &base)?;
        let count = parameters.len();
        // A prior of one deviation on each, so that what the record says nothing of is no matter.
        let (mut slope, mut own) = (DVector::zeros(count), DMatrix::identity(count, count));
        derivatives[0].add_to(&base[0], &mut slope, &mut own);
        let Some(factor) = own.cholesky() else { return Err(ChamberError::Unsolvable) };
        let Some(side) = &point.sides[record] else { return Err(ChamberError::Unsolvable) };
        let series = &self.observed[record].series;
        let periods = periods_s(series.shortest_s());
        let columns: Vec<Result<Vec<DerivativeColumn>, ChamberError>> = periods
            .chunks(abreast::LANES)
            .in_parallel()
            .map(|periods| {
                let with = |period_s: &f64| {
                    let mut numbers = point.numbers[record];
                    numbers.set(Quantity::RippleSize, TESTED_K);
                    numbers.set(Quantity::RipplePeriod, *period_s);
                    MovedRecord {
                        system: decoupled_system(&side.parts(&point.assumed), &numbers, series),
                        values: None,
                    }
                };
                let there = self.innovations_abreast(&point, periods.iter().map(with).collect(), record)?;
                Ok(there.iter().map(|there| DerivativeColumn::new(&base[0], there, 1.0)).collect())
            })
            .collect();
        let columns: Result<Vec<Vec<DerivativeColumn>>, ChamberError> = columns.into_iter().collect();
        let ripple = |(column, &period_s): (&DerivativeColumn, &f64)| {
            let mut cross = DVector::zeros(count);
            let information = derivatives[0].beside(column, &base[0], &mut cross);
            let weights = factor.solve(&cross);
            let score = column.score(&base[0]) - weights.dot(&slope);
            let information = information - weights.dot(&cross);
            // A variance is not negative.
            let share = if information > 0.0 { (score / information).max(0.0) } else { 0.0 };
            let size_k = (TESTED_K * share.sqrt()).clamp(SMALLEST_K, LARGEST_K);
            Ripple { period_s, size_k, gain: 0.5 * share * score }
        };
        let all: Vec<Ripple> = columns?.concat().iter().zip(&periods).map(ripple).collect();
        let is_peak = |i: usize| {
            let beside = [i.wrapping_sub(1), i + 1];
            all[i].gain > 0.0 && beside.iter().filter_map(|j| all.get(*j)).all(|other| other.gain <= all[i].gain)
        };
        let mut peaks: Vec<Ripple> = (0..all.len()).filter(|&i| is_peak(i)).map(|i| all[i]).collect();
        sort_descending(&mut peaks, |item| item.gain);
        Ok(peaks)
    }
}

/// Periods to look at in rows of this length: each needs more than two rows.
fn periods_s(row_s: f64) -> Vec<f64> {
    let prior = Quantity::RipplePeriod.prior();
    let count = (REACH_DEVIATIONS * prior.deviation * PERIODS_PER_E).round() as i32;
    let period = |i: i32| prior.median * (f64::from(i) / PERIODS_PER_E).exp();
    (-count..=count).map(period).filter(|period_s| *period_s > 2.0 * row_s).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Assumption;
    use super::super::dense::tests::model;
    use super::*;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::pattern::classic::Classic;
    use crate::rate::RateModel;
    use crate::record::Record;
    use crate::thermal::{exposure::expose, solve};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    #[test]
    fn a_ripple_far_from_the_usual_period_is_found_where_it_is() {
        let (model, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        for period_s in [71.0, 113.0, 460.0] {
            let air = |t: f64| {
                293.0
                    + 15.0 * ((t - 900.0) / 1500.0).clamp(0.0, 1.0)
                    + 0.2 * (std::f64::consts::TAU * t / period_s).sin()
            };
            let knots: Vec<f64> = (0..=1600).map(|i| 3.0 * f64::from(i)).collect();
            let air = PiecewiseLinear::new(knots.clone(), knots.iter().map(|t| air(*t)).collect()).unwrap();
            let times_s: Vec<f64> = (1..=480).map(|i| 10.0 * f64::from(i)).collect();
            let exposed = expose(&model.heat_path().unwrap(), Some(25.0), 0.0, &air, &times_s).unwrap();
            let history = solve(&exposed.path, &exposed.drive).unwrap().means(&times_s, 10.0);
            let rates = RateModel::new(&model, &pattern, &[]).unwrap().series_rad_per_s(&history);
            let mut random = ChaCha8Rng::seed_from_u64(5);
            let normal = Normal::new(0.0, 1.0).unwrap();
            let mut noise = |deviation: f64| deviation * normal.inverse_cdf(random.random::<f64>());
            let rates = rates.into_iter().map(|r| r + noise(2e-7)).collect();
            let shown_k = exposed.shown_k.into_iter().map(|t| t + noise(0.004)).collect();
            let record = Record::new("rippled", times_s, shown_k, rates).unwrap();
            let chamber = Chamber::new(&model, &[&record]).unwrap();
            let fit = chamber.best_start(&Assumption::new(model.clone(), pattern.clone()), &[], &[0]).unwrap();
            let found_s = fit.numbers[0].get(Quantity::RipplePeriod);
            assert!((found_s / period_s - 1.0).abs() < 0.03, "{found_s} s for {period_s} s");
        }
    }
}
