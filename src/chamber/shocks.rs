//! Shocks: gross errors, which do not belong to a record, and kinks, where the slope of its air changes.
//!
//! Both are asked of the model itself, by what all other measurements make of each one ([`super::filter::doubts`]): a steep
//! signal is no gross error to a model that has its slope, and a spike on it is none the less one.

use super::airs::OwnAir;
use super::ascent::Effort;
use super::coil_side::{BLIND_RAD2_PER_S2, CoilSide, run_kept};
use super::doubts::doubts;
use super::filter::{self, RATE};
use super::fit::Fit;
use super::kinked_rows::Bend;
use super::layout::Numbers;
use super::prior::{GROSS_FACTOR, GROSS_SHARE, KINKS_PER_ROW, Quantity, price_of_controller};
use super::series::Series;
use crate::effect::Acts;
use crate::parallel::InParallel;

use super::system::system;
use super::{Assumption, Chamber, ChamberError, Free};

/// Times that a record is looked through for gross errors, and for kinks.
pub(super) const GROSS_ROUNDS: usize = 5;
const KINK_ROUNDS: usize = 3;
const KINK_PASSES: usize = 3;
/// A value so many rows beside a worse one waits for the next round: the worse one may be why it seems one.
const BESIDE_ROWS: usize = 4;
/// … and a kink so many seconds beside a larger one.
const BESIDE_S: f64 = 250.0;
/// A record with more kinks than one in so many rows has no kinks but a curve.
const FEWEST_ROWS_A_KINK: usize = 30;

/// A record that is not fitted, and what its day was.
pub(super) struct OtherDay {
    record: usize,
    series: Series,
    numbers: Numbers,
}

impl<'a> Chamber<'a> {
    /// The chamber without what the model says are gross errors and with the kinks of each record's air, and the fit of
    /// the assumption to `records`; the others are looked through with what was found for the first.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn with_shocks(self, assumed: &Assumption, records: &[usize]) -> Result<(Self, Fit), ChamberError> {
        let fit = self.best_start(assumed, &[], records)?;
        self.with_shocks_about(fit, &[], records)
    }

    /// The same chamber by a fit that is there already, what is free of its effects included: where a model shows the air at other
    /// times than the declared one did, its kinks are elsewhere. By a model that may be the coil's own they are timed, too.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn with_timed_shocks_by(self, fit: Fit, records: &[usize]) -> Result<Self, ChamberError> {
        let effects = &fit.assumed.model.effects;
        let is_seen = |f: &&Free| matches!(effects[f.effect].spec().acts, Acts::HeatPath | Acts::Sensor);
        let (seen, of_rates): (Vec<Free>, Vec<Free>) = fit.free.iter().partition(is_seen);
        let (chamber, there) = self.clone().with_shocks_by(fit.clone(), records)?;
        let is_kinked = |&r: &usize| chamber.observed[r].series.kinks > 0;
        if seen.is_empty() || !records.iter().any(is_kinked) {
            return chamber.with_timed_kinks(&there);
        }
        // In air that bends where it should have a kink, heat paths and sensors make up for that: kinks may be better placed by what they
        // were found to be before.
        let curved = self.curved(&fit, &of_rates, records)?;
        let (held, by_held) = self.with_shocks_about(curved, &fit.free, records)?;
        let is_better = held.posterior_over(&by_held, (&chamber, &there), records)? > 0.0;
        if is_better { held.with_timed_kinks(&by_held) } else { chamber.with_timed_kinks(&there) }
    }

    /// As [`Chamber::with_timed_shocks_by`], with the fit there and kinks near which rows they are, found while all that is free stays so.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn with_shocks_by(self, fit: Fit, records: &[usize]) -> Result<(Self, Fit), ChamberError> {
        let curved = self.curved(&fit, &fit.free, records)?;
        self.with_shocks_about(curved, &fit.free, records)
    }

    /// A fit in an air that bends wherever readings do, whatever the air was.
    pub(super) fn curved(&self, fit: &Fit, free: &[Free], records: &[usize]) -> Result<Fit, ChamberError> {
        let mut fit = fit.clone();
        for &r in records {
            let medians = Numbers::medians(&self.observed[r].series);
            Quantity::AIR.iter().for_each(|&quantity| fit.numbers[r].set(quantity, medians.get(quantity)));
        }
        self.fit(&fit.assumed.clone(), free, records, Some(&fit), Effort::QUICK)
    }

    /// By a fit whose air bends wherever readings do: to one that is straight but for its kinks, what does not know them yet is full of
    /// gross errors. `free`: what of its effects is fitted at last.
    fn with_shocks_about(mut self, curved: Fit, free: &[Free], records: &[usize]) -> Result<(Self, Fit), ChamberError> {
        let whole = self.observed.iter().map(|o| o.series.clone()).collect::<Vec<_>>();
        let curved = self.without_gross_errors(curved, records)?;
        let own = || -> Result<(Self, Fit), ChamberError> {
            let mut chamber = self.clone();
            let fit = chamber.take_airs(curved.clone(), records, &whole)?;
            let fit = chamber.between_steps(fit, records)?;
            Ok((chamber, fit))
        };
        let look = |chamber: &mut Self, day: Fit, other: usize| chamber.looked_through(day, &[other]);
        let (own, days) = crate::parallel::join(own, || self.days_of_others(&curved, records, &look));
        let (mut chamber, fit) = own?;
        chamber.take_days(days?);
        let fit = chamber.fit(&fit.assumed.clone(), free, records, Some(&fit), Effort::FULL)?;
        Ok((chamber, fit))
    }

    /// Records that are not fitted, each as `look` finds it from a day by a fit to the others.
    pub(super) fn days_of_others(
        &self,
        fit: &Fit,
        records: &[usize],
        look: &(dyn Fn(&mut Self, Fit, usize) -> Result<Fit, ChamberError> + Sync),
    ) -> Result<Vec<OtherDay>, ChamberError> {
        let others: Vec<usize> = (0..self.records()).filter(|r| !records.contains(r)).collect();
        let of = |record: usize| {
            let mut chamber = self.clone();
            let day = chamber.fit(&fit.assumed, &[], &[record], Some(fit), Effort::SHORT)?;
            let day = look(&mut chamber, day, record)?;
            Ok(OtherDay { record, series: chamber.observed.swap_remove(record).series, numbers: day.numbers[record] })
        };
        others.in_parallel().map(of).collect()
    }

    pub(super) fn take_days(&mut self, days: Vec<OtherDay>) {
        for day in days {
            let observed = &mut self.observed[day.record];
            (observed.series, observed.day) = (day.series, Some(day.numbers));
        }
    }

    /// Records without gross errors, each with its air as it is likeliest.
    pub(super) fn looked_through(&mut self, fit: Fit, records: &[usize]) -> Result<Fit, ChamberError> {
        let whole = self.observed.iter().map(|o| o.series.clone()).collect::<Vec<_>>();
        let curved = self.without_gross_errors(fit, records)?;
        let fit = self.take_airs(curved, records, &whole)?;
        self.between_steps(fit, records)
    }

    /// A fit to records without what it says are gross errors.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn without_gross_errors(&mut self, mut fit: Fit, records: &[usize]) -> Result<Fit, ChamberError> {
        for _ in 0..GROSS_ROUNDS {
            let mut found = 0;
            for &r in records {
                let gross = self.gross(&fit, r)?;
                found += gross.len();
                gross.iter().for_each(|&(row, m)| self.observed[r].series.leave_out(row, m));
            }
            if found == 0 {
                break;
            }
            fit = self.fit(&fit.assumed.clone(), &fit.free.clone(), records, Some(&fit), Effort::SHORT)?;
        }
        Ok(fit)
    }

    /// Rows and measurements that are gross errors beside what all others say.
    pub(super) fn gross(&self, fit: &Fit, record: usize) -> Result<Vec<(usize, usize)>, ChamberError> {
        let point = self.model_point(fit.assumed.clone(), fit.numbers.clone(), &[record], &fit.courses)?;
        let (Some(side), Some(values)) = (&point.sides[record], &point.values[record]) else {
            return Err(ChamberError::Unsolvable);
        };
        let observed = &self.observed[record];
        let rows = &observed.series.rows;
        let (system, trace) = run_kept(side, &point.assumed, &point.numbers[record], observed, values);
        let doubts = doubts(&system, rows, &trace);
        let mut by_measurement: Vec<Vec<f64>> = vec![vec![0.0; rows.len()]; filter::MEASURED];
        let mut next = 0;
        for (k, row) in rows.iter().enumerate() {
            for (m, _) in row.measured.iter().enumerate().filter(|(_, h)| h.is_some()) {
                by_measurement[m][k] = doubts.values[next].abs();
                next += 1;
            }
        }
        // Where a normal value is as likely as one of the few that are so much wider.
        let limit = (2.0 * (GROSS_FACTOR * (1.0 - GROSS_SHARE) / GROSS_SHARE).ln()).sqrt();
        let mut found = Vec::new();
        for (m, doubts) in by_measurement.iter().enumerate() {
            found.extend(peaks(doubts, BESIDE_ROWS).filter(|&k| doubts[k] > limit).map(|k| (k, m)));
        }
        Ok(found)
    }

    /// Finds the kinks that a record's air has beside what bends in it, the fit with them, and its log posterior less what they cost; None
    /// where there are so many that it is all curves.
    pub(super) fn kinked(&mut self, fit: &Fit, record: usize) -> Result<Option<(Fit, f64)>, ChamberError> {
        // Numbers that were fitted to a straight air without its kinks take kinks for noise; those of an air that bends take, where the
        // coil is not that of the model, what the coil does for kinks.
        let before = self.observed[record].series.clone();
        let price = (before.times_s.len() as f64).ln();
        let mut best: Option<(Fit, f64, Series)> = None;
        for day in [fit.clone(), self.fit(&fit.assumed, &[], &[record], Some(fit), Effort::SHORT)?] {
            self.observed[record].series = before.clone();
            let Some((kinked, kinks)) = self.kinked_from(day, record)? else { continue };
            let worth = kinked.posterior() - price * kinks as f64;
            if best.as_ref().is_none_or(|b| worth > b.1) {
                best = Some((kinked, worth, self.observed[record].series.clone()));
            }
        }
        Ok(best.map(|(fit, worth, series)| {
            self.observed[record].series = series;
            (fit, worth)
        }))
    }

    /// The same by the numbers of one day.
    fn kinked_from(&mut self, mut day: Fit, record: usize) -> Result<Option<(Fit, usize)>, ChamberError> {
        let rows = self.times_s(record).len();
        let mut count = 0;
        for _ in 0..KINK_ROUNDS {
            // With numbers as they are until nothing is found, and again once they have been fitted to that.
            let found = self.pass_for_kinks(&day, record)?;
            count += found;
            if count > rows / FEWEST_ROWS_A_KINK {
                return Ok(None);
            }
            day = self.fit(&day.assumed.clone(), &[], &[record], Some(&day), Effort::SHORT)?;
            if found == 0 {
                break;
            }
        }
        let day = self.fit(&day.assumed.clone(), &[], &[record], Some(&day), Effort::QUICK)?;
        Ok(Some((day, count)))
    }

    /// Places the kinks of a record's readings by numbers that are known, if it has any and is not all curves; `bends`: air may bend
    /// behind them.
    pub(super) fn place_kinks(&mut self, fit: &Fit, record: usize, bends: bool) -> Result<(), ChamberError> {
        let before = self.observed[record].series.clone();
        let rows = before.rows.len();
        if !bends {
            self.observed[record].series.take_out_bends();
        }
        let mut count = 0;
        for _ in 0..KINK_ROUNDS * KINK_PASSES {
            let new = self.kinks(fit, record)?;
            self.spread_kinks(&new, record);
            count += new.len();
            if new.is_empty() || count > rows / FEWEST_ROWS_A_KINK {
                break;
            }
        }
        if count == 0 || count > rows / FEWEST_ROWS_A_KINK {
            self.observed[record].series = before;
        }
        Ok(())
    }

    /// The same chamber with the kinks of its straight air where the readings have them by this fit, the fit there, and what
    /// the kinks that each record has more cost in log prior; None where no air has any.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn with_own_kinks(&self, fit: &Fit, effort: Effort) -> Result<Option<OwnAir<'a>>, ChamberError> {
        let straight: Vec<usize> = (0..self.records()).filter(|&r| self.observed[r].series.kinks > 0).collect();
        if straight.is_empty() {
            return Ok(None);
        }
        let (mut chamber, mut fit) = (self.clone(), fit.clone());
        // A stage's kinks are at their times already (`airs::staged`): they move to those that this fit has them at.
        let is_timed = |r: usize| self.observed[r].series.approaches;
        for &r in straight.iter().filter(|&&r| !is_timed(r)) {
            chamber.observed[r].series.straighten();
        }
        let own = |fit: &Fit, r: usize| Fit { numbers: self.completed(fit, &[r]), ..fit.clone() };
        for &r in straight.iter().filter(|&&r| is_timed(r)) {
            chamber.observed[r].series.kinks = chamber.time_kinks(&own(&fit, r), r)?.len();
        }
        // By numbers that were fitted to others, and by those that were fitted to these.
        for effort in [Effort::SHORT, effort] {
            for &r in straight.iter().filter(|&&r| !is_timed(r)) {
                chamber.pass_for_kinks(&own(&fit, r), r)?;
            }
            fit = chamber.fit(&fit.assumed.clone(), &fit.free.clone(), &fit.records.clone(), Some(&fit), effort)?;
        }
        let prices = chamber.prices_of_air(self);
        Ok(Some((chamber, fit, prices)))
    }

    /// What the kinks and the controllers that each record has more than in another chamber cost in log prior.
    pub(super) fn prices_of_air(&self, other: &Self) -> Vec<f64> {
        let price = |chamber: &Self, r: usize| {
            let series = &chamber.observed[r].series;
            let controller = if series.controlled { price_of_controller(series.times_s.len()) } else { 0.0 };
            controller - KINKS_PER_ROW.ln() * series.kinks as f64
        };
        (0..self.records()).map(|r| price(self, r) - price(other, r)).collect()
    }

    /// Places kinks until no more are found with numbers as they are; how many.
    fn pass_for_kinks(&mut self, fit: &Fit, record: usize) -> Result<usize, ChamberError> {
        let mut found = 0;
        for _ in 0..KINK_PASSES {
            let new = self.kinks(fit, record)?;
            self.spread_kinks(&new, record);
            found += new.len();
            if new.is_empty() {
                break;
            }
        }
        Ok(found)
    }

    /// Straight but for these bends.
    pub(super) fn bend_at(&mut self, bends: &[Bend], record: usize) {
        let series = &mut self.observed[record].series;
        series.take_out_bends();
        let row = |bend: &Bend| series.times_s.partition_point(|t| *t <= bend.time_s);
        let kinks: Vec<(usize, f64)> = bends.iter().map(|bend| (row(bend), bend.slope_change_k_per_s)).collect();
        self.spread_kinks(&kinks, record);
    }

    /// Between two rows a kink is one at either.
    fn spread_kinks(&mut self, kinks: &[(usize, f64)], record: usize) {
        let series = &mut self.observed[record].series;
        series.kinks += kinks.len();
        for &(row, size_k_per_s) in kinks {
            let near = row.saturating_sub(1)..(row + KINK_ROWS - 1).min(series.rows.len());
            series.kink_within(near, size_k_per_s);
        }
    }

    /// Rows before which the air has a kink by the readings, and how large it seems [K/s].
    fn kinks(&self, fit: &Fit, record: usize) -> Result<Vec<(usize, f64)>, ChamberError> {
        let observed = &self.observed[record];
        let numbers = &fit.numbers[record];
        let side = CoilSide::new(&fit.assumed, numbers.get(Quantity::Film), self.modes, observed)?;
        let reference = fit.courses.get(record).and_then(Option::as_ref).filter(|_| side.needs_reference());
        let values = side.values(&fit.assumed, observed, record, reference)?;
        let series = &observed.series;
        let mut system = system(&side.parts(&fit.assumed), numbers, series);
        system.variances[RATE] += BLIND_RAD2_PER_S2;
        let trace = filter::forward(&system, &series.rows, &values, true);
        let doubts = doubts(&system, &series.rows, &trace);
        let sizes: Vec<f64> = doubts.kinks.iter().map(|(z, _)| z.abs()).collect();
        let beside = (BESIDE_S / series.shortest_s()).ceil() as usize;
        // The gain must be worth a place that might have been anywhere, and the uncertainty of its size.
        let worth = |z: f64| 0.5 * z * z > z.max(1.0).ln() - KINKS_PER_ROW.ln();
        Ok(peaks(&sizes, beside).filter(|&k| worth(sizes[k])).map(|k| (k, doubts.kinks[k].1)).collect())
    }

    /// The best of several chambers: without a ripple, and with those that each record seems to have beside it.
    pub(super) fn best_start(
        &self,
        assumed: &Assumption,
        free: &[Free],
        records: &[usize],
    ) -> Result<Fit, ChamberError> {
        let mut base = self.fit(assumed, free, records, None, Effort::NONE)?;
        base.courses = vec![None; self.records()];
        let begin_at = |starts: Vec<Fit>| {
            let fit = |start: Fit| self.fit(assumed, free, records, Some(&start), Effort::QUICK);
            let fits: Vec<Result<Fit, ChamberError>> = starts.in_parallel().map(fit).collect();
            fits.into_iter().flatten().reduce(|best, fit| if fit.posterior() > best.posterior() { fit } else { best })
        };
        let with_noise = |noise: &f64| {
            let mut start = base.clone();
            for numbers in &mut start.numbers {
                numbers.set(Quantity::RippleSize, SMALL_RIPPLE_K);
                numbers.set(Quantity::RateNoise, noise * numbers.get(Quantity::RateNoise));
            }
            start
        };
        let still = begin_at(RATE_NOISES.iter().map(with_noise).collect()).ok_or(ChamberError::Unsolvable)?;
        let ripples: Result<Vec<_>, ChamberError> = records.iter().map(|&r| self.ripples(&still, r)).collect();
        let ripples = ripples?;
        let with_ripple = |rank: usize| {
            let mut start = still.clone();
            for (&r, own) in records.iter().zip(&ripples) {
                let Some(ripple) = own.get(rank).or(own.first()) else { continue };
                start.numbers[r].set(Quantity::RipplePeriod, ripple.period_s);
                start.numbers[r].set(Quantity::RippleSize, ripple.size_k);
                start.numbers[r].set(Quantity::RippleCoherence, Quantity::RippleCoherence.prior().median);
            }
            start
        };
        let most = ripples.iter().map(Vec::len).max().unwrap_or(0).min(RIPPLES);
        let rippled = begin_at((0..most).map(with_ripple).collect());
        Ok(rippled.filter(|fit| fit.posterior() > still.posterior()).unwrap_or(still))
    }

    /// As [`Chamber::fit`] from several chambers that differ in their ripple, and in the order of a stage's lag and the pack's; the best goes on.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn fit_anew(&self, assumed: &Assumption, free: &[Free], records: &[usize]) -> Result<Fit, ChamberError> {
        let best = self.best_start(assumed, free, records)?;
        let fit = self.fit(&best.assumed.clone(), free, records, Some(&best), Effort::FULL)?;
        self.in_better_order(fit, Effort::FULL)
    }
}

/// Shares of the noise floor that a fit may begin with, and a ripple that does not lead it [K]; and how many of a record's are tried.
const RATE_NOISES: [f64; 2] = [1.0, 0.2];
const SMALL_RIPPLE_K: f64 = 0.005;
const RIPPLES: usize = 3;
/// Rows over which one kink may be spread.
const KINK_ROWS: usize = 3;

/// Places that no other within reach exceeds, from the first on.
fn peaks(values: &[f64], reach: usize) -> impl Iterator<Item = usize> {
    let count = values.len();
    (0..count).filter(move |&k| {
        let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(count));
        values[k] > 0.0 && (from..to).all(|j| j == k || values[j] < values[k] || (values[j] <= values[k] && j > k))
    })
}

#[cfg(test)]
mod tests {
    use super::super::dense::tests::{effect, model};
    use super::super::kinks::tests::{KINKS_S, kinked};
    use super::*;
    use crate::pattern::classic::Classic;

    #[test]
    fn a_coil_on_a_spool_needs_fewer_kinks_by_its_own_model_than_by_another() {
        let (bare, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let spool = model(vec![effect("spool_mass", &[8000.0, 50.0, 0.0])]);
        let record = kinked(&spool, &pattern);
        let declared = Assumption::new(bare.clone(), pattern.clone());
        let mut chamber = Chamber::new(&bare, &[&record]).unwrap();
        let base = chamber.best_start(&declared, &[], &[0]).unwrap();
        // By itself the record would rather have its air bend than be straight by a model that is not its own.
        chamber.observed[0].series.take_out_bends();
        chamber.pass_for_kinks(&base, 0).unwrap();
        let base = chamber.fit(&declared, &[], &[0], Some(&base), Effort::QUICK).unwrap();
        let own = Assumption::new(spool, pattern);
        let there = chamber.fit(&own, &[], &[0], Some(&base), Effort::QUICK).unwrap();
        let (with_own, fit, prices) = chamber.with_own_kinks(&there, Effort::QUICK).unwrap().unwrap();
        let kinks = |chamber: &Chamber| chamber.observed[0].series.kinks;
        let (by_another, by_own) = (kinks(&chamber), kinks(&with_own));
        assert!(KINKS_S.len() <= by_own && by_own < by_another, "{by_own} kinks, {by_another} before");
        assert!((prices[0] + (by_another - by_own) as f64 * 150.0_f64.ln()).abs() < 1e-9);
        let gain = fit.posterior() - prices[0] - there.posterior();
        assert!(gain > 50.0, "{gain}");
    }
}
