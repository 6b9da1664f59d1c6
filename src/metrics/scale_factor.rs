//! The scale factor of a gyro on a rate table, from the stretches in which the table turns evenly.
//!
//! ```text
//! F/S0 = (1 + ε) (I + E + D),   r = F/S0 − I
//! r_p = ε0 I_p + ε1 (T_p − T0) I_p + ½ h s_p I_p + b0 + b1 (T_p − T0) + ½ b_h s_p
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | F, S0 | output, and the scale factor by which the record was read | – |
//! | I | the table's rate about the sensitive axis, a mean over each even stretch p | `table_rad_per_s` |
//! | ε0, ε1 | error of the scale factor at T0, the mean temperature, and its slope | `error`, `per_k` |
//! | h | hysteresis: warming less cooling at one temperature; s = ±1 as it got warmer or cooler last | `hysteresis` |
//! | b | offset: the earth's rate E and the drift D | `offset_rad_per_s` |
//!
//! Stretches count by their rows. Linearity is the largest residual over the largest rate; asymmetry what turning forwards has more
//! than turning backwards; repeatability the deviation, with Q − 1, of the scale factor over Q runs through the rates.
//!
//! Holds for even stretches of at least five rows. The products of ε with E and D are left out: they are a millionth of what counts here.
//!
//! # Source
//! IEEE Std 952-1997, 12.9 (scale-factor tests); GJB 2426A-2004, 5.3.3 to 5.3.5.

use nalgebra::{DMatrix, DVector};

use crate::numeric::statistics::standard_deviation;
use crate::record::RecordRow;

/// A table that is told to turn evenly does so within this share …
const EVEN: f64 = 0.01;
/// … and stands still below this \[rad/s\]: twenty degrees an hour.
const STILL_RAD_PER_S: f64 = 1e-4;
/// A stretch that has got warmer by more goes on as another one.
const STRETCH_K: f64 = 1.0;
/// Without the first and the last row, which the table's acceleration may reach into.
const LEAST_ROWS: usize = 3;
/// Below it a slope over temperature says nothing.
const LEAST_RANGE_K: f64 = 2.0;
/// What counts as getting warmer or cooler from one stretch to the next.
const TURN_K: f64 = 0.2;
/// Stretches beyond these are counted, not kept: memory does not grow with a record.
const MOST_STRETCHES: usize = 100_000;

/// A stretch in which the table turned evenly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stretch {
    pub(crate) table_rad_per_s: f64,
    /// What the gyro showed beside the table's rate.
    pub(crate) beside_rad_per_s: f64,
    pub(crate) temperature_k: f64,
    pub(crate) rows: usize,
    /// +1 where it got warmer last, −1 cooler, 0 before either.
    direction: f64,
}

/// A value with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ScaleFactorEstimate {
    pub(crate) value: f64,
    pub(crate) standard_error: f64,
}

/// What a record on a rate table says of the scale factor. Ratios are of one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ScaleFactor {
    pub(crate) error: ScaleFactorEstimate,
    /// At which temperature that is.
    pub(crate) at_k: f64,
    pub(crate) offset_rad_per_s: f64,
    /// None where the temperature did not change.
    pub(crate) per_k: Option<ScaleFactorEstimate>,
    /// None where it did not get both warmer and cooler.
    pub(crate) hysteresis: Option<ScaleFactorEstimate>,
    pub(crate) nonlinearity: f64,
    /// None where the table turned one way only.
    pub(crate) asymmetry: Option<ScaleFactorEstimate>,
    /// None where the rates were gone through once.
    pub(crate) repeatability: Option<f64>,
    pub(crate) runs: usize,
    pub(crate) stretches: Vec<Stretch>,
    /// One a stretch.
    pub(crate) residual_rad_per_s: Vec<f64>,
    /// Stretches beyond those that were kept.
    pub(crate) left_out: usize,
}

/// Takes rows in the order of their times.
#[derive(Debug, Default)]
pub(super) struct Stretches {
    current: Option<Current>,
    done: Vec<Stretch>,
    left_out: usize,
    last_k: Option<f64>,
    direction: f64,
}

#[derive(Debug)]
struct Current {
    level_rad_per_s: f64,
    first_k: f64,
    /// Counted when the next one shows that it was not the last.
    waiting: Option<(f64, RecordRow)>,
    sums: [f64; 3],
    rows: usize,
}

impl Stretches {
    pub(crate) fn push(&mut self, row: RecordRow) {
        let Some(table) = row.table_rad_per_s else { return };
        let goes_on = |c: &Current| {
            (table - c.level_rad_per_s).abs() <= EVEN * c.level_rad_per_s.abs() + STILL_RAD_PER_S
                && (row.temperature_k - c.first_k).abs() <= STRETCH_K
        };
        match &mut self.current {
            Some(current) if goes_on(current) => {
                if let Some((table, row)) = current.waiting.replace((table, row)) {
                    for (sum, value) in current.sums.iter_mut().zip([table, row.rate_rad_per_s, row.temperature_k]) {
                        *sum += value;
                    }
                    current.rows += 1;
                }
            }
            _ => {
                self.end();
                self.current = Some(Current {
                    level_rad_per_s: table,
                    first_k: row.temperature_k,
                    waiting: None,
                    sums: [0.0; 3],
                    rows: 0,
                });
            }
        }
    }

    fn end(&mut self) {
        let Some(Current { sums, rows, .. }) = self.current.take().filter(|c| c.rows >= LEAST_ROWS) else { return };
        if self.done.len() == MOST_STRETCHES {
            self.left_out += 1;
            return;
        }
        let [table_rad_per_s, beside_rad_per_s, temperature_k] = sums.map(|sum| sum / rows as f64);
        let moved_k = self.last_k.map_or(0.0, |last| temperature_k - last);
        if moved_k.abs() > TURN_K {
            self.direction = moved_k.signum();
        }
        if moved_k.abs() > TURN_K || self.last_k.is_none() {
            self.last_k = Some(temperature_k);
        }
        let direction = self.direction;
        self.done.push(Stretch { table_rad_per_s, beside_rad_per_s, temperature_k, rows, direction });
    }

    /// None where the table turned at one rate only.
    pub(crate) fn finish(mut self) -> Option<ScaleFactor> {
        self.end();
        scale_factor(self.done, self.left_out)
    }
}

/// The least squares over stretches: values, standard errors, residuals.
fn fitted(stretches: &[Stretch], columns: &[&dyn Fn(&Stretch) -> f64]) -> Option<(Vec<ScaleFactorEstimate>, Vec<f64>)> {
    let (rows, count) = (stretches.len(), columns.len());
    if rows < count {
        return None;
    }
    let root = |s: &Stretch| (s.rows as f64).sqrt();
    let plain = DMatrix::from_fn(rows, count, |i, k| columns[k](&stretches[i]));
    // Columns of like size, so that what depends on others is seen as that.
    let sizes: Vec<f64> = (0..count).map(|k| plain.column(k).amax().max(f64::MIN_POSITIVE)).collect();
    let design = DMatrix::from_fn(rows, count, |i, k| root(&stretches[i]) * plain[(i, k)] / sizes[k]);
    let wanted = DVector::from_iterator(rows, stretches.iter().map(|s| root(s) * s.beside_rad_per_s));
    let decomposed = design.clone().svd(true, true);
    if decomposed.rank(1e-9 * decomposed.singular_values.amax()) < count {
        return None;
    }
    let solution = decomposed.solve(&wanted, 0.0).ok()?;
    let inverse = (design.transpose() * &design).try_inverse()?;
    let left = &wanted - &design * &solution;
    let variance = left.norm_squared() / (rows - count).max(1) as f64;
    let estimates = (0..count).map(|k| ScaleFactorEstimate {
        value: solution[k] / sizes[k],
        standard_error: if rows > count { (variance * inverse[(k, k)]).sqrt() / sizes[k] } else { f64::INFINITY },
    });
    let residuals = left.iter().zip(stretches).map(|(r, s)| r / root(s)).collect();
    Some((estimates.collect(), residuals))
}

fn scale_factor(stretches: Vec<Stretch>, left_out: usize) -> Option<ScaleFactor> {
    let rates = stretches.iter().map(|s| s.table_rad_per_s);
    let (low, high) = rates.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), r| (l.min(r), h.max(r)));
    if !(high - low > 10.0 * STILL_RAD_PER_S) {
        return None;
    }
    let weight: f64 = stretches.iter().map(|s| s.rows as f64).sum();
    let at_k = stretches.iter().map(|s| s.rows as f64 * s.temperature_k).sum::<f64>() / weight;
    let temperatures = || stretches.iter().map(|s| s.temperature_k);
    let range_k = temperatures().fold(f64::NEG_INFINITY, f64::max) - temperatures().fold(f64::INFINITY, f64::min);
    let turns = |s: &Stretch| s.table_rad_per_s.abs() > 10.0 * STILL_RAD_PER_S;
    let count = |f: &dyn Fn(&Stretch) -> bool| stretches.iter().filter(|s| turns(s) && f(s)).count();
    let rate = |s: &Stretch| s.table_rad_per_s;
    let one = |_: &Stretch| 1.0;
    let rate_by_k = |s: &Stretch| s.table_rad_per_s * (s.temperature_k - at_k);
    let by_k = |s: &Stretch| s.temperature_k - at_k;
    let rate_by_direction = |s: &Stretch| 0.5 * s.table_rad_per_s * s.direction;
    let by_direction = |s: &Stretch| 0.5 * s.direction;
    let size = |s: &Stretch| 0.5 * s.table_rad_per_s.abs();
    let base: [&dyn Fn(&Stretch) -> f64; 2] = [&rate, &one];
    let warm: [&dyn Fn(&Stretch) -> f64; 2] = [&rate_by_k, &by_k];
    let turned: [&dyn Fn(&Stretch) -> f64; 2] = [&rate_by_direction, &by_direction];
    let goes_both_ways = count(&|s| s.direction > 0.0) >= 2 && count(&|s| s.direction < 0.0) >= 2;
    // The fullest set of terms that the stretches determine, with something left to judge it by.
    let mut sets = vec![base.to_vec()];
    if range_k > LEAST_RANGE_K {
        sets.push([base, warm].concat());
        if goes_both_ways {
            sets.push([base, warm, turned].concat());
        }
    }
    let (columns, (estimates, residual_rad_per_s)) = sets.into_iter().rev().find_map(|columns| {
        let is_last = columns.len() == base.len();
        let enough = stretches.len() > columns.len() || is_last;
        enough.then(|| fitted(&stretches, &columns)).flatten().map(|found| (columns, found))
    })?;
    let is_asymmetric = count(&|s| s.table_rad_per_s > 0.0) >= 1 && count(&|s| s.table_rad_per_s < 0.0) >= 1;
    let with_size = [columns.as_slice(), &[&size as &dyn Fn(&Stretch) -> f64]].concat();
    let asymmetry = (is_asymmetric && stretches.len() > with_size.len())
        .then(|| fitted(&stretches, &with_size))
        .flatten()
        .and_then(|(estimates, _)| estimates.last().copied());
    let per_k = estimates.get(2).copied();
    let runs = runs(&stretches, at_k, per_k.map_or(0.0, |e| e.value));
    let largest = residual_rad_per_s.iter().map(|r| r.abs()).fold(0.0, f64::max);
    Some(ScaleFactor {
        error: estimates[0],
        at_k,
        offset_rad_per_s: estimates[1].value,
        per_k,
        hysteresis: estimates.get(4).copied(),
        nonlinearity: largest / low.abs().max(high.abs()),
        asymmetry,
        repeatability: Some(standard_deviation(&runs)).filter(|sd| runs.len() > 1 && sd.is_finite()),
        runs: runs.len(),
        stretches,
        residual_rad_per_s,
        left_out,
    })
}

/// The scale factor's error in each run through the rates, at one temperature: a run ends before a rate that it had already.
fn runs(stretches: &[Stretch], at_k: f64, per_k: f64) -> Vec<f64> {
    let is_same = |a: f64, b: f64| (a - b).abs() <= EVEN * b.abs() + STILL_RAD_PER_S;
    let mut found: Vec<Vec<Stretch>> = vec![Vec::new()];
    for (i, stretch) in stretches.iter().enumerate() {
        // One that goes on at the same rate is the same stretch, split by temperature.
        let goes_on = i > 0 && is_same(stretches[i - 1].table_rad_per_s, stretch.table_rad_per_s);
        let run = found.last_mut().expect("there is always a run");
        if !goes_on && run.iter().any(|s| is_same(s.table_rad_per_s, stretch.table_rad_per_s)) {
            found.push(Vec::new());
        }
        let warmth = per_k * (stretch.temperature_k - at_k) * stretch.table_rad_per_s;
        let level = Stretch { beside_rad_per_s: stretch.beside_rad_per_s - warmth, ..*stretch };
        found.last_mut().expect("there is always a run").push(level);
    }
    let slope = |run: &Vec<Stretch>| {
        let (estimates, _) = fitted(run, &[&|s: &Stretch| s.table_rad_per_s, &|_: &Stretch| 1.0])?;
        Some(estimates[0].value)
    };
    found.iter().filter_map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::rad_per_s_from_deg_per_s;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    const RATES_DEG_PER_S: [f64; 7] = [-60.0, -30.0, -10.0, 0.0, 10.0, 30.0, 60.0];

    /// Runs at temperatures, with the scale factor's error as given; noise in rad/s of a row.
    fn record(runs: &[(f64, f64)], noise: f64, error: impl Fn(f64, f64, f64) -> f64) -> Stretches {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let normal = Normal::new(0.0, noise.max(1e-300)).unwrap();
        let mut stretches = Stretches::default();
        let mut time_s = 0.0;
        for &(temperature_k, direction) in runs {
            for rate in RATES_DEG_PER_S {
                let table = rad_per_s_from_deg_per_s(rate);
                for row in 0..60 {
                    // The table is on its way in the first rows.
                    let table = table * (0.2 * f64::from(row + 1)).min(1.0);
                    let white = normal.inverse_cdf(random.random::<f64>());
                    let rate_rad_per_s = error(temperature_k, direction, table) * table + 7e-5 + white;
                    stretches.push(RecordRow { time_s, temperature_k, rate_rad_per_s, table_rad_per_s: Some(table) });
                    time_s += 1.0;
                }
            }
        }
        stretches
    }

    #[test]
    fn error_slope_and_hysteresis_come_back_within_their_errors() {
        let runs: Vec<(f64, f64)> = [253.0, 273.0, 293.0, 313.0, 333.0, 313.0, 293.0, 273.0, 253.0]
            .iter()
            .enumerate()
            .map(|(i, t)| {
                (
                    *t,
                    match i {
                        0 => 0.0,
                        1..=4 => 1.0,
                        _ => -1.0,
                    },
                )
            })
            .collect();
        let true_error = |t: f64, d: f64, _: f64| 120e-6 + 3e-6 * (t - 293.0) + 0.5 * 40e-6 * d;
        let found = record(&runs, 1e-5, true_error).finish().unwrap();
        println!("{:?} {:?} {:?}", found.error, found.per_k, found.hysteresis);
        let at = 120e-6 + 3e-6 * (found.at_k - 293.0);
        let within = |e: ScaleFactorEstimate, truth: f64| {
            (e.value - truth).abs() < 4.0 * e.standard_error && e.standard_error < 0.05 * truth
        };
        assert!(
            within(found.error, at) && within(found.per_k.unwrap(), 3e-6) && within(found.hysteresis.unwrap(), 40e-6)
        );
        assert!((found.offset_rad_per_s / 7e-5 - 1.0).abs() < 0.02);
        assert_eq!((found.stretches.len(), found.runs), (63, 9));
        assert!(found.asymmetry.unwrap().value.abs() < 4.0 * found.asymmetry.unwrap().standard_error);
    }

    #[test]
    fn linearity_asymmetry_and_repeatability_are_those_of_the_definition() {
        let runs = [(300.0, 0.0), (300.0, 0.0), (300.0, 0.0)];
        let bent = record(&runs, 0.0, |_, _, table| 1e-4 * table * table).finish().unwrap();
        // Of r = c I³ the line leaves at most this much.
        let rates: Vec<f64> = RATES_DEG_PER_S.iter().map(|r| rad_per_s_from_deg_per_s(*r)).collect();
        let slope = rates.iter().map(|r| r.powi(4)).sum::<f64>() / rates.iter().map(|r| r * r).sum::<f64>();
        let left = rates.iter().map(|r| 1e-4 * r * (r * r - slope)).map(f64::abs).fold(0.0, f64::max);
        assert!(
            (bent.nonlinearity / (left / rates[6]) - 1.0).abs() < 1e-6,
            "{} {}",
            bent.nonlinearity,
            left / rates[6]
        );
        let lopsided = record(&runs, 0.0, |_, _, table| if table > 0.0 { 2e-4 } else { 1e-4 }).finish().unwrap();
        assert!((lopsided.asymmetry.unwrap().value / 1e-4 - 1.0).abs() < 1e-9);
        let mut wandering = record(&runs[..1], 0.0, |_, _, _| 1e-4);
        for error in [2e-4, 4e-4] {
            let other = record(&runs[..1], 0.0, |_, _, _| error);
            wandering.end();
            wandering.done.extend(other.done);
        }
        wandering.end();
        let (done, left_out) = (wandering.done, wandering.left_out);
        // The last stretch of each is ended by what follows; six of seven rates are enough for a run.
        let sd = scale_factor(done, left_out).unwrap().repeatability.unwrap();
        assert!((sd / (7.0f64 / 3.0).sqrt() / 1e-4 - 1.0).abs() < 1e-6, "{sd}");
    }

    #[test]
    fn a_table_that_stands_still_says_nothing_of_the_scale_factor() {
        let mut stretches = Stretches::default();
        for i in 0..100 {
            let (time_s, temperature_k, rate_rad_per_s) = (f64::from(i), 300.0, 1e-6);
            stretches.push(RecordRow { time_s, temperature_k, rate_rad_per_s, table_rad_per_s: Some(0.0) });
        }
        assert_eq!(stretches.finish(), None);
    }
}
