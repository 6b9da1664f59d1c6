//! What each record's air is likeliest to be: a curve, straight but for kinks, or both; whether it approaches set points, and whether it follows
//! one as a controlled chamber does.

use super::ascent::Effort;
use super::coil_side::CoilSide;
use super::fit::Fit;
use super::layout::Numbers;
use super::prior::{Quantity, price_of_controller};
use super::series::Series;
use super::{Assumption, Chamber, ChamberError, Free};
use crate::parallel::InParallel;

/// Between which films the one is sought that makes a pack as slow as its air \[W/(m²K)\]; halvings of its logarithm.
const LEAST_FILM: f64 = 0.1;
const MOST_FILM: f64 = 1e5;
const FILM_HALVES: usize = 16;

/// Whether air may be taken for that of a controlled chamber.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Controllers {
    MayBe,
    None,
}

/// A chamber with another air, the fit there, and what each record's kinks and controller cost more in log prior.
pub(crate) type OwnAir<'a> = (Chamber<'a>, Fit, Vec<f64>);

impl<'a> Chamber<'a> {
    /// The records as they were taken in, less what a chamber of them leaves out, with the air that each is likeliest to have by what is assumed; the
    /// fit there, and what the kinks and the controller that each has more than in that chamber cost in log prior.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn with_own_airs(
        mut self,
        like: &Self,
        assumed: &Assumption,
        free: &[Free],
        records: &[usize],
        controllers: Controllers,
    ) -> Result<OwnAir<'a>, ChamberError> {
        for (own, other) in self.observed.iter_mut().zip(&like.observed) {
            own.series.take_values_of(&other.series);
            own.series.may_be_controlled = controllers == Controllers::MayBe;
        }
        let whole: Vec<Series> = self.observed.iter().map(|o| o.series.clone()).collect();
        let curved = self.fit_anew(assumed, free, records)?;
        let look = |chamber: &mut Self, day: Fit, other: usize| chamber.take_airs(day, &[other], &whole);
        let days = self.days_of_others(&curved, records, &look)?;
        let fit = self.take_airs(curved, records, &whole)?;
        self.take_days(days);
        let fit = self.fit(assumed, free, records, Some(&fit), Effort::QUICK)?;
        let prices = self.prices_of_air(like);
        Ok((self, fit, prices))
    }
}

/// A record with kinks at their times.
struct Timed<'a> {
    chamber: Chamber<'a>,
    fit: Fit,
    /// Log posterior less what its kinks cost, which might have been in any row.
    worth: f64,
}

impl Timed<'_> {
    /// Times and numbers once more, from these kinks or from those that readings have by this fit: by numbers of another air they were too many,
    /// or elsewhere.
    fn again(self, r: usize) -> Result<Self, ChamberError> {
        let mut anew = self.chamber.clone();
        anew.place_kinks_anew(&self.fit, r)?;
        let (these, anew) =
            crate::parallel::join(|| self.chamber.clone().timed(&self.fit, r), || anew.timed(&self.fit, r));
        Ok(self.or_better(Some(these?)).or_better(Some(anew?)))
    }

    /// These steps in air that does not bend beside them, from these numbers on.
    fn without_bends(&self, from: &Fit, r: usize) -> Result<Self, ChamberError> {
        let mut chamber = self.chamber.clone();
        chamber.observed[r].series.take_out_bends();
        chamber.timed(from, r)?.again(r)
    }

    fn or_better(self, other: Option<Self>) -> Self {
        other.filter(|other| other.worth > self.worth).unwrap_or(self)
    }
}

impl<'a> Chamber<'a> {
    /// Gives each record the air that it is likeliest to have; the fit there. `whole`: all records before gross errors were left out.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(super) fn take_airs(&mut self, mut fit: Fit, records: &[usize], whole: &[Series]) -> Result<Fit, ChamberError> {
        let found: Result<Vec<_>, ChamberError> =
            records.iter().in_parallel().map(|&r| self.likeliest_air(&fit, r)).collect();
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
        let approaching = || {
            let mut approaching = self.clone();
            approaching.observed[r].series.approaches = true;
            let approached = approaching.fit(&fit.assumed, &[], &[r], Some(&curved), Effort::QUICK)?;
            // A stage whose lag is taken for the pack's looks like none.
            let approached = approaching.in_better_order(approached, Effort::QUICK)?;
            if approached.posterior() > curved.posterior() {
                approaching.kinked_airs(&approached, r)
            } else {
                Ok(Vec::new())
            }
        };
        let (found, approaching) = crate::parallel::join(|| self.kinked_airs(&curved, r), approaching);
        let mut best = (curved.posterior(), self.observed[r].series.clone(), curved.numbers[r]);
        for there in found?.into_iter().chain(approaching?) {
            if there.0 > best.0 {
                best = there;
            }
        }
        let (worth, series, numbers) = best;
        let bends = series.rows.iter().any(|row| row.bend > 0.0);
        let controlled = if bends && series.may_be_controlled { self.controlled(fit, r, worth)? } else { None };
        match controlled {
            Some(controlled) => Ok(controlled),
            None if series.approaches => self.staged(fit, r, series, numbers),
            None => Ok((series, numbers)),
        }
    }

    /// What a record is worth with kinks in air that is straight beside them, and in air that bends, if it has any; its series and its numbers there.
    fn kinked_airs(&self, from: &Fit, r: usize) -> Result<Vec<(f64, Series, Numbers)>, ChamberError> {
        let kinked = |bends: bool| {
            let mut chamber = self.clone();
            if !bends {
                chamber.observed[r].series.take_out_bends();
            }
            let Ok(Some((kinked, worth))) = chamber.kinked(from, r) else { return Ok(None) };
            Ok(Some((worth, chamber.observed.swap_remove(r).series, kinked.numbers[r])))
        };
        let found: Result<Vec<_>, ChamberError> = [false, true].in_parallel().map(kinked).collect();
        Ok(found?.into_iter().flatten().collect())
    }

    /// A record in air that approaches set points, as a stage's does: in that order of its own time and the pack's, bending beside its kinks or
    /// not, and with a delay if that is worth more. What each does within a row or two is seen with kinks at their times only.
    fn staged(&self, fit: &Fit, r: usize, series: Series, numbers: Numbers) -> Result<(Series, Numbers), ChamberError> {
        let mut usual = self.clone();
        usual.observed[r].series = series;
        let mut there = fit.clone();
        there.numbers[r] = numbers;
        let usual = usual.timed(&there, r)?;
        // Noises are those of an air that had not been taken for that of one order yet.
        let turned = usual.chamber.in_other_order(&usual.fit, fit, r)?;
        let other = usual.chamber.clone();
        let in_other_order = || {
            let (Some(turned), mut other) = (turned, other) else { return Ok(None) };
            other.place_kinks_anew(&turned, r)?;
            other.timed(&turned, r)?.again(r).map(Some)
        };
        let (again, other) = crate::parallel::join(|| usual.again(r), in_other_order);
        let found = again?.or_better(other?);
        // What bends beside steps stood for steps at other times; it would still do so for those of the other order.
        let turned = found.chamber.in_other_order(&found.fit, &found.fit, r)?;
        let (straight, turned) = crate::parallel::join(
            || found.without_bends(&found.fit, r),
            || turned.map(|turned| found.without_bends(&turned, r)).transpose(),
        );
        let at_once = found.or_better(Some(straight?)).or_better(turned?);
        let mut delayed = at_once.chamber.clone();
        delayed.observed[r].series.delays = true;
        let delayed = delayed.timed(&at_once.fit, r)?;
        // One number more, which might have been anything.
        let price = 0.5 * (self.times_s(r).len() as f64).ln();
        let is_delayed = delayed.worth > at_once.worth + price;
        let Timed { mut chamber, fit: there, .. } = if is_delayed { delayed } else { at_once };
        Ok((chamber.observed.swap_remove(r).series, there.numbers[r]))
    }

    /// With a record's kinks at their times by a fit, and the fit there.
    fn timed(mut self, from: &Fit, r: usize) -> Result<Timed<'a>, ChamberError> {
        let kinks = self.time_kinks(from, r)?.len();
        let series = &mut self.observed[r].series;
        series.kinks = kinks;
        let price = (series.times_s.len() as f64).ln();
        let fit = self.fit(&from.assumed, &[], &[r], Some(from), Effort::QUICK)?;
        let worth = fit.posterior() - price * kinks as f64;
        Ok(Timed { chamber: self, fit, worth })
    }

    /// Places the kinks of a record's readings anew, in air that bends as it did.
    fn place_kinks_anew(&mut self, fit: &Fit, r: usize) -> Result<(), ChamberError> {
        let series = &mut self.observed[r].series;
        let bends = series.rows.iter().any(|row| row.bend > 0.0);
        series.straighten();
        self.place_kinks(fit, r, bends)
    }

    /// A record in the air of a controlled chamber, if that is worth more.
    fn controlled(&self, fit: &Fit, r: usize, worth: f64) -> Result<Option<(Series, Numbers)>, ChamberError> {
        let mut chamber = self.clone();
        chamber.observed[r].series.controlled = true;
        let there = chamber.fit(&fit.assumed, &[], &[r], Some(fit), Effort::QUICK)?;
        let is_better = there.posterior() > worth + price_of_controller(self.times_s(r).len());
        Ok(is_better.then(|| (chamber.observed.swap_remove(r).series, there.numbers[r])))
    }

    /// Air that approaches a set point, and a pack that follows the air behind its film, are two lags in a row: a sensor on the pack shows
    /// nearly the same whichever is the longer. `from` with a record's times by `found` exchanged; None where the film is known.
    fn in_other_order(&self, found: &Fit, from: &Fit, record: usize) -> Result<Option<Fit>, ChamberError> {
        let numbers = &found.numbers[record];
        let side = |film: f64| CoilSide::new(&found.assumed, film, self.modes, &self.observed[record]);
        let now = side(numbers.get(Quantity::Film))?;
        if !now.path.film_is_unknown() {
            return Ok(None);
        }
        let approach_s = numbers.get(Quantity::ApproachTime);
        // The film behind which the pack takes what the air does, by halves of its logarithm.
        let (mut least, mut most) = (LEAST_FILM, MOST_FILM);
        for _ in 0..FILM_HALVES {
            let middle = (least * most).sqrt();
            if side(middle)?.slowest_s() > approach_s { least = middle } else { most = middle }
        }
        let mut other = from.clone();
        other.numbers[record].set(Quantity::ApproachTime, now.slowest_s());
        other.numbers.iter_mut().for_each(|n| n.set(Quantity::Film, least));
        Ok(Some(other))
    }

    /// A fit with the times of all of its staged records and the pack's exchanged; None where there is no such record or the film is known.
    ///
    /// # Errors
    /// A heat path that cannot be solved.
    pub(crate) fn with_lags_exchanged(&self, fit: &Fit) -> Result<Option<Fit>, ChamberError> {
        let staged: Vec<usize> = fit.records.iter().copied().filter(|&r| self.observed[r].series.approaches).collect();
        let Some((&first, others)) = staged.split_first() else { return Ok(None) };
        let Some(mut other) = self.in_other_order(fit, fit, first)? else { return Ok(None) };
        let approach_s = other.numbers[first].get(Quantity::ApproachTime);
        others.iter().for_each(|&r| other.numbers[r].set(Quantity::ApproachTime, approach_s));
        other.is_full = false;
        Ok(Some(other))
    }

    /// A fit, or the one that is led to with the lags of a stage and of the pack in the other order, if that is better.
    ///
    /// # Errors
    /// As [`Chamber::fit`].
    pub(crate) fn in_better_order(&self, fit: Fit, effort: Effort) -> Result<Fit, ChamberError> {
        let Some(other) = self.with_lags_exchanged(&fit)? else { return Ok(fit) };
        let other = self.fit(&fit.assumed, &fit.free, &fit.records, Some(&other), effort)?;
        Ok(if other.posterior() > fit.posterior() { other } else { fit })
    }
}

impl CoilSide {
    /// In which the slowest mode of the pack follows its air \[s\].
    fn slowest_s(&self) -> f64 {
        self.reduced.decay_per_s.iter().fold(f64::INFINITY, |least, decay| least.min(*decay)).recip()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::super::Assumption;
    use super::super::dense::tests::{effect, model};
    use super::super::kinks::tests::{in_air, kinked};
    use super::*;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::pattern::classic::Classic;
    use crate::record::Record;

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
            // Where no controller may be, it is air that bends by itself, which costs no time and no damping ratio, and is worth less.
            let whole = Chamber::new(&bare, &[&record]).unwrap();
            let (own, bending, prices) =
                whole.with_own_airs(&chamber, &declared, &[], &[0], Controllers::None).unwrap();
            let kinks = own.observed[0].series.kinks as f64 - chamber.observed[0].series.kinks as f64;
            println!("without a controller {:.1} of {:.1}", bending.posterior() - prices[0], fit.posterior());
            assert!(!own.observed[0].series.controlled);
            let least = -(chamber.times_s(0).len() as f64).ln();
            assert!(if kinks == 0.0 { (prices[0] - least).abs() < 1e-9 } else { prices[0] > least }, "{prices:?}");
            assert!(bending.posterior() - prices[0] < fit.posterior());
        }
        let ramps = kinked(&bare, &pattern);
        let (chamber, _) = Chamber::new(&bare, &[&ramps]).unwrap().with_shocks(&declared, &[0]).unwrap();
        assert!(!chamber.observed[0].series.controlled);
    }

    /// Air that approaches each of its set points with a time, from instants that are no rows', and takes another one to begin with; in
    /// straight lines of two seconds.
    pub(in crate::chamber) fn staged(approach_s: f64, onset_s: f64) -> PiecewiseLinear {
        let steps = [(904.3, 311.0), (1707.7, 302.0), (2612.9, 318.0), (3571.4, 289.0), (4703.6, 296.0)];
        let times_s: Vec<f64> = (0..=3000).map(|i| 2.0 * f64::from(i)).collect();
        let air = |t: f64| {
            let mut before = 293.0;
            let mut air = 293.0;
            for (at_s, aim) in steps.into_iter().filter(|(at_s, _)| *at_s < t) {
                let left = |lag_s: f64| lag_s * (-(t - at_s) / lag_s.max(1e-9)).exp();
                air += (aim - before) * (1.0 - (left(approach_s) - left(onset_s)) / (approach_s - onset_s));
                before = aim;
            }
            air
        };
        let values = times_s.iter().map(|t| air(*t)).collect();
        PiecewiseLinear::new(times_s, values).unwrap()
    }

    #[test]
    #[ignore = "long: --include-ignored"]
    fn a_stages_air_is_told_by_the_time_of_its_approach_and_nothing_in_it_is_a_gross_error() {
        let (bare, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let declared = Assumption::new(bare.clone(), pattern.clone());
        for (approach_s, onset_s) in [(40.0, 0.0), (220.0, 0.0), (60.0, 8.0)] {
            let record = in_air(&bare, &pattern, &staged(approach_s, onset_s));
            let (_, fit) = Chamber::new(&bare, &[&record]).unwrap().with_shocks(&declared, &[0]).unwrap();
            // Looked through again by numbers of air whose kinks are known, a chamber that does not know them leaves nothing out.
            let chamber = Chamber::new(&bare, &[&record]).unwrap().with_timed_shocks_by(fit, &[0]).unwrap();
            let fit = chamber.fit_anew(&declared, &[], &[0]).unwrap();
            let series = &chamber.observed[0].series;
            let (found_s, film) = (fit.number(Quantity::ApproachTime, 0), fit.number(Quantity::Film, 0));
            let found_onset_s = if series.delays { fit.number(Quantity::OnsetTime, 0) } else { 0.0 };
            println!(
                "{approach_s} s behind {onset_s} s: {found_s:.1} s behind {found_onset_s:.2} s, film {film:.2}, {} kinks, {} left out",
                series.kinks, series.spikes
            );
            assert!(series.approaches);
            assert!(series.delays || onset_s == 0.0);
            assert_eq!(series.spikes, 0);
            // An approach as long as the pack takes to follow may as well be the pack's: no worse than where the truth leads.
            let mut truth = fit.clone();
            truth.numbers[0].set(Quantity::ApproachTime, approach_s);
            truth.numbers[0].set(Quantity::OnsetTime, onset_s.max(1.0));
            truth.numbers[0].set(Quantity::Film, 25.0);
            let truth = chamber.fit(&declared, &[], &[0], Some(&truth), Effort::FULL).unwrap();
            let less = truth.posterior() - fit.posterior();
            assert!(less < 0.5, "{less}");
            if approach_s < 100.0 {
                assert!(onset_s > 0.0 || (found_s / approach_s - 1.0).abs() < 0.03, "{found_s}");
                // Both times together are told better than either, and lines of two seconds set in with a delay of their own.
                let together = (found_s + found_onset_s) / (approach_s + onset_s);
                assert!((together - 1.0).abs() < 0.06, "{found_s} and {found_onset_s}");
                assert!((film / 25.0 - 1.0).abs() < 0.03, "{film}");
            }
        }
        let ramps = kinked(&bare, &pattern);
        let (chamber, _) = Chamber::new(&bare, &[&ramps]).unwrap().with_shocks(&declared, &[0]).unwrap();
        assert!(!chamber.observed[0].series.approaches);
    }

    #[test]
    fn lags_that_are_exchanged_twice_are_as_they_were_and_a_film_that_is_stated_has_none_to_exchange() {
        let (bare, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let record = in_air(&bare, &pattern, &staged(48.0, 0.0));
        let mut chamber = Chamber::new(&bare, &[&record, &record]).unwrap();
        let declared = Assumption::new(bare.clone(), pattern.clone());
        let both = [0, 1];
        let bending = chamber.fit(&declared, &[], &both, None, Effort::NONE).unwrap();
        assert!(chamber.with_lags_exchanged(&bending).unwrap().is_none(), "no stage");
        chamber.observed.iter_mut().for_each(|o| o.series.approaches = true);
        let mut fit = chamber.fit(&declared, &[], &both, None, Effort::NONE).unwrap();
        fit.set_number(Quantity::Film, 25.0);
        fit.set_number(Quantity::ApproachTime, 48.0);
        let other = chamber.with_lags_exchanged(&fit).unwrap().unwrap();
        let of = |fit: &Fit, r: usize| [Quantity::Film, Quantity::ApproachTime].map(|q| fit.number(q, r));
        assert_eq!(of(&other, 0), of(&other, 1));
        assert!(of(&other, 0)[0] > 40.0 && of(&other, 0)[1] > 60.0, "{:?}", of(&other, 0));
        let back = chamber.with_lags_exchanged(&other).unwrap().unwrap();
        for (found, before) in of(&back, 0).into_iter().zip(of(&fit, 0)) {
            assert!((found / before - 1.0).abs() < 1e-3, "{found} for {before}");
        }
        let stated = Assumption::new(model(vec![effect("surface_film", &[25.0])]), pattern);
        let known = chamber.fit(&stated, &[], &both, None, Effort::NONE).unwrap();
        assert!(chamber.with_lags_exchanged(&known).unwrap().is_none());
    }

    #[test]
    #[ignore = "long: --include-ignored"]
    fn a_stages_lag_and_the_packs_behind_its_film_are_told_apart_by_a_coarse_sensor_too() {
        let (bare, pattern) = (model(Vec::new()), Classic::Zyl.pattern(8).unwrap());
        let declared = Assumption::new(bare.clone(), pattern.clone());
        for (approach_s, step_k) in [(30.0, 0.01), (48.0, 0.1), (76.0, 0.0625)] {
            let fine = in_air(&bare, &pattern, &staged(approach_s, 0.0));
            let rounded = fine.temperature_k().iter().map(|t| (t / step_k).round() * step_k).collect();
            let (times_s, rates) = (fine.times_s().to_vec(), fine.rate_rad_per_s().to_vec());
            let coarse = Record::new("coarse", times_s, rounded, rates).unwrap();
            let (chamber, fit) = Chamber::new(&bare, &[&coarse]).unwrap().with_shocks(&declared, &[0]).unwrap();
            let (found_s, film) = (fit.number(Quantity::ApproachTime, 0), fit.number(Quantity::Film, 0));
            println!("{approach_s} s by steps of {step_k} K: {found_s:.1} s, film {film:.2}");
            assert!((found_s / approach_s - 1.0).abs() < 0.1, "{found_s} for {approach_s}");
            assert!((film / 25.0 - 1.0).abs() < 0.05, "{film}");
            // From the other order on a fit ends at another maximum, and exchanged again near the one where it was.
            let ascended = |from: &Fit| chamber.fit(&declared, &[], &[0], Some(from), Effort::FULL).unwrap();
            let wrong = ascended(&chamber.with_lags_exchanged(&fit).unwrap().unwrap());
            let again = ascended(&chamber.with_lags_exchanged(&wrong).unwrap().unwrap());
            let [best, wrong, again] = [&fit, &wrong, &again].map(Fit::posterior);
            println!("posterior {best:.1}, in the other order {wrong:.1}, exchanged again {again:.1}");
            assert!(wrong < best - 3.0 && again > wrong + 0.9 * (best - wrong));
        }
    }
}
