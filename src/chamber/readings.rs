//! What the readings alone say of a record: nothing here has seen its rates.
//!
//! ```text
//! r ← h v/S + (I − K h)ᵀ r,  N ← h hᵀ/S + (I − K h)ᵀ N (I − K h)         backwards over the readings
//! Var(c·x | all readings) = c P cᵀ − c P N P cᵀ
//! ```
//!
//! # Source
//! de Jong, J. Am. Stat. Assoc. 84 (1989) 1085.

use super::filter::{self, Innovation, MEASURED, Move, RATE, Row, System, Trace};
use super::fit::Fit;
use super::known::Reference;
use super::point::{CoilSide, run_kept};
use super::prior::Quantity;
use super::series::{Origin, Series};
use super::system::{Layout, system};
use super::{Chamber, ChamberError};
use crate::rate::CoilModel;
use crate::record::Record;

/// What readings imply.
///
/// # Shapes
/// One entry a row of the chamber.
#[derive(Debug, Clone)]
pub struct Told {
    /// Layers and air.
    pub course: Reference,
    /// Variance that what the readings leave open gives each row's rate \[(rad/s)²\].
    pub rate_variance_rad2_per_s2: Vec<f64>,
    pub bends: Vec<Bend>,
}

/// A change of the air's slope that stands out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    pub time_s: f64,
    pub slope_change_k_per_s: f64,
}

/// Updates of the kinks' densities, and the share of the largest below which one is none.
const SHARPENED: usize = 16;
const LEAST_KINK: f64 = 1e-5;

impl<'a> Chamber<'a> {
    /// A chamber whose fits do not see the rates, until [`Chamber::see_rates`].
    ///
    /// # Errors
    /// As [`Chamber::new`], but that rates may be without noise.
    pub fn of_readings(model: &CoilModel, records: &[&'a Record]) -> Result<Self, ChamberError> {
        let mut chamber = Self::made(model, records, Origin::Measured)?;
        for observed in &mut chamber.observed {
            observed.blind = true;
            observed.series.rows.iter_mut().for_each(|row| row.measured[RATE] = None);
        }
        Ok(chamber)
    }

    /// From here on rates are measurements too.
    ///
    /// # Errors
    /// Rates without noise.
    pub fn see_rates(&mut self) -> Result<(), ChamberError> {
        for observed in &mut self.observed {
            observed.blind = false;
            observed.series.rows = with_rates(&observed.series);
        }
        self.checked()
    }

    /// Moves what a record's kinks were spread over to where the readings have them: the densities at the likelihood's maximum,
    /// where the shock that the readings imply is as large as its density lets expect, by the root's update, which goes there
    /// monotonously (Wipf and Nagarajan, NIPS 20 (2008) 1625).
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub fn sharpen(&mut self, fit: &Fit, record: usize) -> Result<(), ChamberError> {
        for _ in 0..SHARPENED {
            let (_, system, trace) = self.traced(fit, record)?;
            let rows = &mut self.observed[record].series.rows;
            let doubts = filter::doubts(&system, rows, &trace);
            let largest = rows.iter().map(|row| row.kink).fold(0.0, f64::max);
            for (row, (ratio, _)) in rows.iter_mut().zip(&doubts.kinks).filter(|(row, _)| row.kink > 0.0) {
                row.kink *= ratio.abs();
                if row.kink < LEAST_KINK * largest {
                    row.kink = 0.0;
                }
            }
        }
        Ok(())
    }

    /// The pass over a record with everything kept, and what it was made with.
    pub(super) fn traced(&self, fit: &Fit, record: usize) -> Result<(CoilSide, System, Trace), ChamberError> {
        let observed = &self.observed[record];
        let numbers = self.numbers_for(fit, record);
        let side = CoilSide::new(&fit.assumed, numbers.get(Quantity::Film), self.modes, observed)?;
        let course = fit.courses[record].as_ref().filter(|c| side.needs_reference() && side.fits(c));
        let values = side.values(&fit.assumed, observed, record, course)?;
        let (system, trace) = run_kept(&side, &fit.assumed, &numbers, observed, &values);
        Ok((side, system, trace))
    }

    /// What a record's readings imply; of a chamber that does not see rates.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub fn told(&self, fit: &Fit, record: usize) -> Result<Told, ChamberError> {
        let (side, system, trace) = self.traced(fit, record)?;
        let series = &self.observed[record].series;
        let layout = Layout::new(&side.parts(&fit.assumed), series);
        let n = system.size;
        let mut variance = vec![0.0; series.rows.len()];
        let mut along = vec![0.0; n];
        let mut row = vec![0.0; n];
        backward(&system, &series.rows, &trace, |k, _, information| {
            let covariance = &trace.gains[trace.gains_of[k] as usize].covariance;
            row.iter_mut().for_each(|v| *v = 0.0);
            system.rows.add_to(series.shape_of(k) * MEASURED + RATE, 1.0, &mut row);
            // Offset and wander are the gyro's.
            layout.gyro().for_each(|state| row[state] = 0.0);
            for (a, line) in along.iter_mut().zip(covariance.chunks_exact(n)) {
                *a = line.iter().zip(&row).map(|(p, h)| p * h).sum();
            }
            let before: f64 = row.iter().zip(&along).map(|(h, a)| h * a).sum();
            let known: f64 = information
                .chunks_exact(n)
                .zip(&along)
                .map(|(line, a)| a * line.iter().zip(&along).map(|(i, b)| i * b).sum::<f64>())
                .sum();
            variance[k] = (before - known).max(0.0);
        });
        let states = filter::smooth(&system, &series.rows, &trace);
        let slope = |k: usize| states[k * n + layout.trend + 1];
        let kinked = series.rows.iter().any(|row| row.kink > 0.0);
        let bent =
            |k: usize| series.rows.get(k).is_some_and(|row| if kinked { row.kink > 0.0 } else { row.bend > 0.0 });
        let mut bends = Vec::new();
        let mut k = 1;
        while k < series.rows.len() {
            if !bent(k) {
                k += 1;
                continue;
            }
            let from = k - 1;
            while bent(k) {
                k += 1;
            }
            // A kink is where its row begins; what bends does so all along. Each by how much it bends.
            let steps: Vec<f64> = (from + 1..k).map(|i| (slope(i) - slope(i - 1)).abs()).collect();
            let whole: f64 = steps.iter().sum();
            let at_s = |i: usize| {
                if kinked { series.times_s[i - 1] } else { 0.5 * (series.times_s[i] + series.times_s[i - 1]) }
            };
            let time_s = steps.iter().zip(from + 1..k).map(|(s, i)| s * at_s(i)).sum::<f64>() / whole;
            if whole > 0.0 {
                bends.push(Bend { time_s, slope_change_k_per_s: slope(k - 1) - slope(from) });
            }
        }
        let before = fit.courses[record].as_ref().filter(|c| side.fits(c));
        let course = side.reference(&fit.assumed, &self.observed[record], &states, before)?;
        Ok(Told { course, rate_variance_rad2_per_s2: variance, bends })
    }
}

impl Chamber<'_> {
    /// χ² a rate of what the readings leave of the rates, their offset fitted: rᵀ C⁻¹ r/(n − 1), C the covariance of white
    /// noise of this deviation and of what the readings leave open; of a chamber that does not see rates.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub fn chi_square_beyond_readings(
        &self,
        fit: &Fit,
        record: usize,
        noise_rad_per_s: f64,
    ) -> Result<f64, ChamberError> {
        let observed = &self.observed[record];
        let mut numbers = self.numbers_for(fit, record);
        numbers.set(Quantity::RateNoise, noise_rad_per_s);
        numbers.set(Quantity::WanderShare, NO_WANDER);
        let side = CoilSide::new(&fit.assumed, numbers.get(Quantity::Film), self.modes, observed)?;
        let course = fit.courses[record].as_ref().filter(|c| side.needs_reference() && side.fits(c));
        let values = side.values(&fit.assumed, observed, record, course)?;
        let system = system(&side.parts(&fit.assumed), &numbers, &observed.series);
        // ln p(rates | readings) = ln p(both) − ln p(readings), squares and all.
        let squares = |rows: &[Row]| {
            let innovations = filter::forward(&system, rows, &values, false).innovations;
            let sum = innovations.iter().map(|i: &Innovation| i.value * i.value / i.variance).sum::<f64>();
            (sum, innovations.len())
        };
        let (both, all) = squares(&with_rates(&observed.series));
        let (readings, some) = squares(&observed.series.rows);
        Ok((both - readings) / (all - some).saturating_sub(1).max(1) as f64)
    }
}

/// The share of wander in a gyro that has none.
const NO_WANDER: f64 = 1e-6;

/// Its rows with all rates that there are.
fn with_rates(series: &Series) -> Vec<Row> {
    let mut rows = series.rows.clone();
    for (k, row) in rows.iter_mut().enumerate().skip(1) {
        if series.values[RATE][k].is_finite() {
            row.measured[RATE] = Some((series.shape_of(k) * MEASURED + RATE) as u16);
        }
    }
    rows
}

/// Walks back over the rows; at each, `visit` is told its place, r and N (row-major) with the row's own measurements.
pub(super) fn backward(system: &System, rows: &[Row], trace: &Trace, mut visit: impl FnMut(usize, &[f64], &[f64])) {
    let n = system.size;
    let mut r = vec![0.0; n];
    let mut information = vec![0.0; n * n];
    let mut taken = trace.innovations.len();
    let mut h = vec![0.0; n];
    for (k, row) in rows.iter().enumerate().rev() {
        let gains = &trace.gains[trace.gains_of[k] as usize];
        let present: Vec<usize> = row.measured.iter().flatten().map(|&h| h as usize).collect();
        for (place, &index) in present.iter().enumerate().rev() {
            taken -= 1;
            let innovation = trace.innovations[taken];
            let gain = &gains.gain[place * (n + 1)..place * (n + 1) + n];
            h.iter_mut().for_each(|v| *v = 0.0);
            system.rows.add_to(index, 1.0, &mut h);
            let along: f64 = gain.iter().zip(&r).map(|(g, r)| g * r).sum();
            r.iter_mut().zip(&h).for_each(|(r, h)| *r += h * (innovation.value / innovation.variance - along));
            let u: Vec<f64> = information.chunks_exact(n).map(|line| dot(line, gain)).collect();
            let own = dot(&u, gain) + 1.0 / innovation.variance;
            for i in 0..n {
                for j in 0..n {
                    information[i * n + j] += h[i] * h[j] * own - h[i] * u[j] - u[i] * h[j];
                }
            }
        }
        visit(k, &r, &information);
        for &movement in row.moves.iter().rev() {
            match movement {
                Move::Step(step) => {
                    let phi = &system.steps[step as usize].phi_turned;
                    r = phi.times_matrix(&r, 1);
                    let half = turned(&phi.times_matrix(&information, n), n);
                    information = phi.times_matrix(&half, n);
                }
                Move::Keep(slot) => {
                    for &(state, kept) in system.keeps[slot as usize].iter().rev() {
                        let weight = std::mem::take(&mut r[state]);
                        system.kept.add_to(kept, weight, &mut r);
                        for _ in 0..2 {
                            for line in information.chunks_exact_mut(n) {
                                let weight = std::mem::take(&mut line[state]);
                                system.kept.add_to(kept, weight, line);
                            }
                            information = turned(&information, n);
                        }
                    }
                }
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn turned(matrix: &[f64], n: usize) -> Vec<f64> {
    (0..n * n).map(|i| matrix[i % n * n + i / n]).collect()
}
