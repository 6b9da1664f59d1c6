//! By how much one chamber of records explains one of them better than another chamber of the same records does.
//!
//! ```text
//! ln p(what both keep | one) − ln p(what both keep | other) − Δ(what kinks of the air and switches of the film cost)
//! ```
//!
//! A chamber may leave out as a gross error what the other explains. A density of fewer values is no density of all of them, so that what
//! either leaves out is left out of both here.

use super::ascent::Effort;
use super::fit::Fit;
use super::prior::KINKS_PER_ROW;
use super::{Chamber, ChamberError};

impl Chamber<'_> {
    /// The rise of the log posterior of a record \[nat\] over that by another chamber, and over that by this one with the film of the
    /// other: air, noises and the film's ratio are fitted in each, the coil is that of the chamber's fit.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn gain_over(&self, fit: &Fit, other: (&Self, &Fit), record: usize) -> Result<f64, ChamberError> {
        let (other, other_fit) = other;
        // An ascent ends at a maximum near its start: each chamber is given both.
        let starts = [self.completed(fit, &[record])[record], other.completed(other_fit, &[record])[record]];
        let worth = |chamber: &Self, fit: &Fit, beside: &Self| -> Result<f64, ChamberError> {
            let mut chamber = chamber.clone();
            chamber.leave_out_as(beside, record);
            let mut most = f64::NEG_INFINITY;
            for numbers in starts {
                let mut day = fit.clone();
                day.numbers[record] = numbers;
                day.records = vec![record];
                let day = chamber.fit(&fit.assumed, &[], &[record], Some(&day), Effort::QUICK)?;
                most = most.max(day.posterior());
            }
            let kinks = chamber.observed[record].series.kinks as f64;
            Ok(most + kinks * KINKS_PER_ROW.ln() - chamber.film_price(&[record]))
        };
        // With kinks at other places a record may be explained better whatever the film is.
        let mut same_air = self.clone();
        let switches_s = other.film_switches_s(record);
        same_air.observed[record].series = same_air.observed[record].series.with_film_switches(switches_s);
        let (here, there) = crate::parallel::join(|| worth(self, fit, other), || worth(other, other_fit, self));
        Ok(here? - there?.max(worth(&same_air, fit, other)?))
    }

    /// The rise of the log posterior of some records \[nat\] over that by another chamber, with the kinks of each paid for: what either leaves out
    /// is left out of both.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(super) fn posterior_over(
        &self,
        fit: &Fit,
        other: (&Self, &Fit),
        records: &[usize],
    ) -> Result<f64, ChamberError> {
        let worth = |chamber: &Self, fit: &Fit, beside: &Self| -> Result<f64, ChamberError> {
            let mut chamber = chamber.clone();
            records.iter().for_each(|&r| chamber.leave_out_as(beside, r));
            let fit = chamber.fit(&fit.assumed.clone(), &fit.free.clone(), records, Some(fit), Effort::QUICK)?;
            let kinks: usize = records.iter().map(|&r| chamber.observed[r].series.kinks).sum();
            Ok(fit.posterior() + kinks as f64 * KINKS_PER_ROW.ln())
        };
        let (other, other_fit) = other;
        let (here, there) = crate::parallel::join(|| worth(self, fit, other), || worth(other, other_fit, self));
        Ok(here? - there?)
    }

    /// Leaves out of a record what another chamber leaves out of it as well.
    fn leave_out_as(&mut self, other: &Self, record: usize) {
        let there = &other.observed[record].series;
        let here = &mut self.observed[record].series;
        for (row, (kept, other)) in here.rows.iter_mut().zip(&there.rows).enumerate() {
            for (m, (kept, other)) in kept.measured.iter_mut().zip(&other.measured).enumerate() {
                if kept.is_some() && other.is_none() {
                    *kept = None;
                    here.values[m][row] = f64::NAN;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dense::tests::model;
    use super::super::filter::RATE;
    use super::super::kinks::tests::kinked;
    use super::*;
    use crate::chamber::Assumption;
    use crate::pattern::classic::Classic;

    #[test]
    fn a_chamber_gains_nothing_by_what_it_leaves_out_and_pays_for_a_switch_that_is_not_there() {
        let (model, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let record = kinked(&model, &pattern);
        let chamber = Chamber::new(&model, &[&record]).unwrap();
        let assumed = Assumption::new(model.clone(), pattern);
        let fit = chamber.fit(&assumed, &[], &[0], None, Effort::FULL).unwrap();

        let mut fewer = chamber.clone();
        [40, 90].into_iter().for_each(|row| fewer.observed[0].series.leave_out(row, RATE));
        let other = fewer.fit(&assumed, &[], &[0], Some(&fit), Effort::FULL).unwrap();
        let difference = other.posterior() - fit.posterior();
        assert!(difference.abs() > 5.0, "two values fewer are another density: {difference}");
        let gain = fewer.gain_over(&other, (&chamber, &fit), 0).unwrap();
        assert!(gain.abs() < 0.5, "{gain}");
        // Kinks that are not there are paid for.
        let gain = fewer.posterior_over(&other, (&chamber, &fit), &[0]).unwrap();
        assert!(gain.abs() < 0.5, "{gain}");
        fewer.observed[0].series.kinks += 2;
        let with_kinks = fewer.posterior_over(&other, (&chamber, &fit), &[0]).unwrap();
        assert!((with_kinks - gain - 2.0 * KINKS_PER_ROW.ln()).abs() < 1e-9, "{with_kinks}");

        let mut switched = chamber.clone();
        let middle_s = record.times_s()[record.times_s().len() / 2] + 1.0;
        switched.observed[0].series = switched.observed[0].series.with_film_switches(&[middle_s]);
        let there = switched.fit(&assumed, &[], &[0], Some(&fit), Effort::FULL).unwrap();
        let gain = switched.gain_over(&there, (&chamber, &fit), 0).unwrap();
        assert!(gain < 0.0, "{gain}");
    }
}
