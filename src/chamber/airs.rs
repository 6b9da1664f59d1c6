//! What each record's air is likeliest to be: a curve, straight but for kinks, or both; whether it approaches set points, and whether it follows
//! one as a controlled chamber does.

use rayon::prelude::*;

use super::ascent::Effort;
use super::coil_side::CoilSide;
use super::fit::Fit;
use super::layout::Numbers;
use super::prior::Quantity;
use super::series::Series;
use super::{Assumption, Chamber, ChamberError, Free};

/// A chamber with another air, the fit there, and what the kinks that each record has more cost in log prior.
pub(crate) type OwnAir<'a> = (Chamber<'a>, Fit, Vec<f64>);

impl<'a> Chamber<'a> {
    /// The records as they were taken in, less what a chamber of them leaves out, with the air that each is likeliest to have by what is assumed; the
    /// fit there, and what the kinks that each has more than in that chamber cost in log prior.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn with_own_airs(
        mut self,
        like: &Self,
        assumed: &Assumption,
        free: &[Free],
        records: &[usize],
    ) -> Result<OwnAir<'a>, ChamberError> {
        for (own, other) in self.observed.iter_mut().zip(&like.observed) {
            own.series.take_values_of(&other.series);
        }
        let whole: Vec<Series> = self.observed.iter().map(|o| o.series.clone()).collect();
        let curved = self.fit_anew(assumed, free, records)?;
        let look = |chamber: &mut Self, day: Fit, other: usize| chamber.take_airs(day, &[other], &whole);
        let days = self.days_of_others(&curved, records, &look)?;
        let fit = self.take_airs(curved, records, &whole)?;
        self.take_days(days);
        let fit = self.fit(assumed, free, records, Some(&fit), Effort::QUICK)?;
        let prices = self.prices_of_kinks(like);
        Ok((self, fit, prices))
    }
}

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
        // switched does; a curve may be that of a controlled chamber. The record itself says which, by itself.
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
        let (worth, series, numbers) = best;
        let bends = series.rows.iter().any(|row| row.bend > 0.0);
        let controlled = if bends { self.controlled(fit, r, worth)? } else { None };
        match controlled {
            Some(controlled) => Ok(controlled),
            None if series.approaches => self.delayed(fit, r, series, numbers),
            None => Ok((series, numbers)),
        }
    }

    /// A record in air that approaches set points, with a delay if that is worth more. What a delay does within a row or two is seen with
    /// kinks at their times only.
    fn delayed(
        &self,
        fit: &Fit,
        r: usize,
        series: Series,
        numbers: Numbers,
    ) -> Result<(Series, Numbers), ChamberError> {
        let mut at_once = self.clone();
        at_once.observed[r].series = series;
        let mut delayed = at_once.clone();
        delayed.observed[r].series.delays = true;
        let timed = |chamber: &Self| {
            let mut chamber = chamber.clone();
            let mut there = fit.clone();
            there.numbers[r] = numbers;
            there = chamber.fit(&fit.assumed, &[], &[r], Some(&there), Effort::QUICK)?;
            chamber.time_kinks(&there, r)?;
            let there = chamber.fit(&fit.assumed, &[], &[r], Some(&there), Effort::QUICK)?;
            Ok::<_, ChamberError>((there.posterior(), there.numbers[r]))
        };
        let (own, other) = rayon::join(|| timed(&at_once), || timed(&delayed));
        let ((own, _), (other, found)) = (own?, other?);
        // One number more, which might have been anything.
        let price = 0.5 * (delayed.observed[r].series.times_s.len() as f64).ln();
        if other > own + price {
            return Ok((delayed.observed.swap_remove(r).series, found));
        }
        Ok((at_once.observed.swap_remove(r).series, numbers))
    }

    /// A record in the air of a controlled chamber, if that is worth more.
    fn controlled(&self, fit: &Fit, r: usize, worth: f64) -> Result<Option<(Series, Numbers)>, ChamberError> {
        let mut chamber = self.clone();
        chamber.observed[r].series.controlled = true;
        let there = chamber.fit(&fit.assumed, &[], &[r], Some(fit), Effort::QUICK)?;
        // Its time and its damping ratio cost what a kink's place and height do.
        let price = (chamber.observed[r].series.times_s.len() as f64).ln();
        let is_better = there.posterior() > worth + price;
        Ok(is_better.then(|| (chamber.observed.swap_remove(r).series, there.numbers[r])))
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

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::super::Assumption;
    use super::super::dense::tests::model;
    use super::super::kinks::tests::{in_air, kinked};
    use super::*;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::pattern::classic::Classic;

    /// A set point's ramps as a controller of this time and damping ratio makes them, with turbulence of 0.02 K; in lines of two seconds.
    fn followed(control_s: f64, damping: f64) -> PiecewiseLinear {
        let knots_s = vec![0.0, 904.3, 1707.7, 2312.9, 2871.4, 4003.6, 6000.0];
        let set_point = PiecewiseLinear::new(knots_s, vec![293.0, 293.0, 313.0, 313.0, 299.0, 299.0, 293.0]).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let (mut air, mut slope, mut turbulence) = (293.0, 0.0, 0.0);
        let (mut times_s, mut values) = (vec![0.0], vec![air]);
        for line in 1..=3000 {
            let end_s = 2.0 * f64::from(line);
            for part in 0..40 {
                let step_s = 0.05;
                let aim = set_point.value(end_s - 2.0 + step_s * f64::from(part));
                slope += step_s * ((aim - air) / control_s - 2.0 * damping * slope) / control_s;
                air += step_s * slope;
            }
            let kept = (-2.0_f64 / 50.0).exp();
            let kick = normal.inverse_cdf(random.random::<f64>());
            turbulence = kept * turbulence + 0.02 * (1.0 - kept * kept).sqrt() * kick;
            times_s.push(end_s);
            values.push(air + turbulence);
        }
        PiecewiseLinear::new(times_s, values).unwrap()
    }

    #[test]
    #[ignore = "long: --include-ignored"]
    fn a_controlled_chambers_air_is_told_by_its_time_and_its_damping_and_a_straight_one_is_none() {
        let (bare, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let declared = Assumption::new(bare.clone(), pattern.clone());
        for (control_s, damping) in [(110.0, 0.45), (90.0, 0.8)] {
            let record = in_air(&bare, &pattern, &followed(control_s, damping));
            let (chamber, fit) = Chamber::new(&bare, &[&record]).unwrap().with_shocks(&declared, &[0]).unwrap();
            let [found_s, found, film] =
                [Quantity::ControlTime, Quantity::ControlDamping, Quantity::Film].map(|q| fit.number(q, 0));
            println!("{control_s} s, {damping}: {found_s:.1} s, {found:.3}, film {film:.2}");
            assert!(chamber.observed[0].series.controlled);
            // Well damped, it is told from a pack behind its film by the whole delay more than by either number.
            assert!((found_s * found / (control_s * damping)).ln().abs() < 0.35, "{found_s} {found}");
            assert!(damping > 0.5 || (found / damping).ln().abs() < 0.1, "{found}");
            assert!((film / 25.0).ln().abs() < 0.25, "{film}");
        }
        let ramps = kinked(&bare, &pattern);
        let (chamber, _) = Chamber::new(&bare, &[&ramps]).unwrap().with_shocks(&declared, &[0]).unwrap();
        assert!(!chamber.observed[0].series.controlled);
    }
}
