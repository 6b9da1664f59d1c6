//! What each record's air is likeliest to be: a curve, straight but for kinks, or both; and whether it approaches set points.

use rayon::prelude::*;

use super::ascent::Effort;
use super::coil_side::CoilSide;
use super::fit::Fit;
use super::layout::Numbers;
use super::prior::Quantity;
use super::series::Series;
use super::{Chamber, ChamberError};

impl Chamber<'_> {
    /// Gives each record the air that it is likeliest to have; the fit there. `whole`: all records before gross errors were left out.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(super) fn take_airs(&mut self, mut fit: Fit, records: &[usize], whole: &[Series]) -> Result<Fit, ChamberError> {
        let found: Result<Vec<_>, ChamberError> = records.par_iter().map(|&r| self.likeliest_air(&fit, r)).collect();
        // To a curve the rows behind a kink are gross errors.
        let mut again = Vec::new();
        for (&r, (series, numbers)) in records.iter().zip(found?) {
            fit.numbers[r] = numbers;
            let own = &mut self.observed[r].series;
            *own = series;
            if own.kinks > 0 && own.spikes > whole[r].spikes {
                own.take_in_again(&whole[r]);
                again.push(r);
            }
        }
        if !again.is_empty() {
            let there = self.without_gross_errors(fit.clone(), &again)?;
            again.iter().for_each(|&r| fit.numbers[r] = there.numbers[r]);
        }
        Ok(fit)
    }

    /// One record with its likeliest air, and its numbers there.
    fn likeliest_air(&self, fit: &Fit, r: usize) -> Result<(Series, Numbers), ChamberError> {
        // Either the air bends wherever readings do, or it is straight but for its kinks, or it bends from kinks on as a stage that is
        // switched does. Kinks must be worth being looked for: the record itself says which, by itself.
        let curved = self.fit(&fit.assumed, &[], &[r], Some(fit), Effort::QUICK)?;
        let mut approaching = self.clone();
        approaching.observed[r].series.approaches = true;
        let approached = approaching.fit(&fit.assumed, &[], &[r], Some(&curved), Effort::QUICK)?;
        let mut asked = vec![(self, &curved, false), (self, &curved, true)];
        if approached.posterior() > curved.posterior() {
            asked.extend([(&approaching, &approached, false), (&approaching, &approached, true)]);
        }
        let kinked = |(chamber, from, bends): (&Self, &Fit, bool)| {
            let mut chamber = chamber.clone();
            let series = &mut chamber.observed[r].series;
            let approaches = series.approaches;
            if !bends {
                series.rows.iter_mut().for_each(|row| row.bend = 0.0);
            }
            let Ok(Some((kinked, worth))) = chamber.kinked(from, r) else { return Ok(None) };
            let other = if approaches { chamber.in_other_order(&kinked, r)? } else { None };
            let gain = other.as_ref().map_or(0.0, |other| other.posterior() - kinked.posterior());
            let kinked = other.unwrap_or(kinked);
            Ok(Some((worth + gain, chamber.observed.swap_remove(r).series, kinked.numbers[r])))
        };
        let found: Result<Vec<_>, ChamberError> = asked.into_par_iter().map(kinked).collect();
        let mut best = (curved.posterior(), self.observed[r].series.clone(), curved.numbers[r]);
        for there in found?.into_iter().flatten() {
            if there.0 > best.0 {
                best = there;
            }
        }
        Ok((best.1, best.2))
    }

    /// Air that approaches a set point, and a pack that follows the air behind its film, are two lags in a row: a sensor on the pack shows
    /// nearly the same whichever is the longer. The fit with their times exchanged, if it is better.
    fn in_other_order(&self, kinked: &Fit, record: usize) -> Result<Option<Fit>, ChamberError> {
        let numbers = &kinked.numbers[record];
        let film = numbers.get(Quantity::Film);
        let side = CoilSide::new(&kinked.assumed, film, self.modes, &self.observed[record])?;
        let pack_s = side.reduced.decay_per_s.iter().fold(f64::INFINITY, |least, decay| least.min(*decay)).recip();
        let mut other = kinked.clone();
        other.numbers[record].set(Quantity::ApproachTime, pack_s);
        let film = film * pack_s / numbers.get(Quantity::ApproachTime);
        other.numbers.iter_mut().for_each(|n| n.set(Quantity::Film, film));
        let other = self.fit(&kinked.assumed, &[], &[record], Some(&other), Effort::QUICK)?;
        Ok((other.posterior() > kinked.posterior()).then_some(other))
    }
}
