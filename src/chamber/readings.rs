//! What the readings alone say of a record's layers, in a chamber whose numbers readings and rates have shown together.
//!
//! ```text
//! Var(c·x | all readings) = c P cᵀ − c P N P cᵀ         N: what the backward pass ([`super::backward`]) has of them at a row
//! ```
//!
//! # Source
//! de Jong, J. Am. Stat. Assoc. 84 (1989) 1085.

use super::backward::{Visited, backward};
use super::coil_side::{CoilSide, run_kept};
use super::filter::{self, Innovation, MEASURED, RATE, Row, System, Trace, Values};
use super::fit::Fit;
use super::kinked_rows::Bend;
use super::known::Reference;
use super::layout::{Layout, Numbers};
use super::prior::Quantity;
use super::series::{Origin, Series};

use super::system::{decoupled_system, system};
use super::{Chamber, ChamberError};
use crate::rate::CoilModel;
use crate::record::Record;

/// What readings imply.
///
/// # Shapes
/// One entry a row of the chamber.
#[derive(Debug, Clone)]
pub(crate) struct Told {
    /// Layers and air, with their slopes.
    pub(crate) course: Reference,
    /// Variance that what the readings leave open gives each row's rate \[(rad/s)²\].
    pub(crate) rate_variance_rad2_per_s2: Vec<f64>,
    pub(crate) bends: Vec<Bend>,
}

impl<'a> Chamber<'a> {
    /// As [`Chamber::new`]; fits do not see rates without noise. Those are a simulation's: what they weigh beside readings cannot
    /// be told.
    ///
    /// # Errors
    /// A model that cannot be solved; records whose temperature does not change.
    pub(crate) fn of_any(model: &CoilModel, records: &[&'a Record]) -> Result<Self, ChamberError> {
        match Self::new(model, records) {
            Err(ChamberError::NoNoise { .. }) => Self::of_readings(model, records),
            chamber => chamber,
        }
    }

    /// A chamber whose fits do not see the rates.
    fn of_readings(model: &CoilModel, records: &[&'a Record]) -> Result<Self, ChamberError> {
        Ok(Self::made(model, records, Origin::Measured)?.without_rates())
    }

    /// The same chamber; its fits do not see the rates.
    pub(crate) fn without_rates(&self) -> Self {
        let mut chamber = self.clone();
        for observed in &mut chamber.observed {
            observed.blind = true;
            observed.series.rows = without_rates(&observed.series);
        }
        chamber
    }

    /// The pass over a record with everything kept, and what it was made with.
    pub(super) fn traced(&self, fit: &Fit, record: usize) -> Result<(CoilSide, System, Trace), ChamberError> {
        let numbers = self.numbers_for(fit, record);
        let (side, values) = self.side_and_values(fit, record, &numbers)?;
        let (system, trace) = run_kept(&side, &fit.assumed, &numbers, &self.observed[record], &values);
        Ok((side, system, trace))
    }

    pub(super) fn side_and_values(
        &self,
        fit: &Fit,
        record: usize,
        numbers: &Numbers,
    ) -> Result<(CoilSide, Values), ChamberError> {
        let observed = &self.observed[record];
        let side = CoilSide::new(&fit.assumed, numbers.get(Quantity::Film), self.modes, observed)?;
        let course = fit.courses[record].as_ref().filter(|c| side.needs_reference() && side.fits(c));
        let values = side.values(&fit.assumed, observed, record, course)?;
        Ok((side, values))
    }

    /// What a record's readings imply in the chamber of a fit; which rates there are does not count.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn told(&self, fit: &Fit, record: usize) -> Result<Told, ChamberError> {
        let observed = &self.observed[record];
        let numbers = self.numbers_for(fit, record);
        let (side, values) = self.side_and_values(fit, record, &numbers)?;
        let system = system(&side.parts(&fit.assumed), &numbers, &observed.series);
        let series = &observed.series;
        let rows = without_rates(series);
        let trace = filter::forward(&system, &rows, &values, true);
        let layout = Layout::new(&side.parts(&fit.assumed), series);
        let n = system.size;
        let mut variance = vec![0.0; series.rows.len()];
        let mut along = vec![0.0; n];
        let mut row = vec![0.0; n];
        backward(&system, &rows, &trace, &mut |visited| {
            let Visited::Row { row: k, information, .. } = visited else { return };
            let covariance = &trace.gains[trace.gains_of[k] as usize].covariance;
            row.iter_mut().for_each(|v| *v = 0.0);
            system.rows.add_to(series.shape_of(k) * MEASURED + RATE, 1.0, &mut row);
            // Offset and wander are the gyro's.
            layout.gyro().for_each(|state| row[state] = 0.0);
            for (a, line) in along.iter_mut().zip(covariance.chunks_exact(n)) {
                *a = line.iter().zip(&row).map(|(p, h)| p * h).sum();
            }
            let before: f64 = row.iter().zip(&along).map(|(h, a)| h * a).sum();
            variance[k] = (before - information.of(&along)).max(0.0);
        });
        let states = filter::smooth(&system, &rows, &trace);
        let bends = self.bends(record, |k| states[k * n + layout.trend + 1]);
        let before = fit.courses[record].as_ref().filter(|c| side.fits(c));
        let mut course = side.reference(&fit.assumed, &numbers, &self.observed[record], &states, before)?;
        course.slopes_k_per_s = side.slopes(&layout, series, &states, &course);
        Ok(Told { course, rate_variance_rad2_per_s2: variance, bends })
    }
}

impl CoilSide {
    /// Slopes of a course at its rows: of the modes as they follow the air, of all else those of the parabola through a row and
    /// its neighbours.
    ///
    /// # Shapes
    /// Row-major rows × (outputs + 1), those of the air last \[K/s\].
    pub(super) fn slopes(&self, layout: &Layout, series: &Series, states: &[f64], course: &Reference) -> Vec<f64> {
        let (reduced, columns) = (&self.reduced, course.outputs + 1);
        let times_s = &series.times_s;
        let (mut rest, mut slopes) = (course.air_k.clone(), vec![0.0; course.air_k.len() * columns]);
        add_parabolas(times_s, &rest, columns, course.outputs, &mut slopes);
        for j in 0..course.outputs {
            let shares = &reduced.row(j)[..layout.modes];
            for (k, x) in states.chunks_exact(layout.size).enumerate() {
                rest[k] = course.row(k)[j];
                for ((share, x), decay) in shares.iter().zip(x).zip(&reduced.decay_per_s) {
                    rest[k] -= share * x;
                    slopes[k * columns + j] += share * decay * (course.drive_k[k] - x);
                }
            }
            add_parabolas(times_s, &rest, columns, j, &mut slopes);
        }
        slopes
    }
}

/// Adds the slope of the parabola through each row's value and its neighbours'; at the ends, that of the last piece.
fn add_parabolas(times_s: &[f64], values: &[f64], columns: usize, column: usize, slopes: &mut [f64]) {
    let last = values.len() - 1;
    let secant = |right: usize| (values[right] - values[right - 1]) / (times_s[right] - times_s[right - 1]);
    for k in 0..=last {
        slopes[k * columns + column] += if k == 0 || k == last {
            secant(k.max(1))
        } else {
            let (before_s, after_s) = (times_s[k] - times_s[k - 1], times_s[k + 1] - times_s[k]);
            (after_s * secant(k) + before_s * secant(k + 1)) / (before_s + after_s)
        };
    }
}

impl Chamber<'_> {
    /// χ² a rate of what the readings leave of the rates, their offset fitted: rᵀ C⁻¹ r/(n − 1), C the covariance of white
    /// noise of this deviation and of what the readings leave open.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn chi_square_beyond_readings(
        &self,
        fit: &Fit,
        record: usize,
        noise_rad_per_s: f64,
    ) -> Result<f64, ChamberError> {
        let mut numbers = self.numbers_for(fit, record);
        numbers.set(Quantity::RateNoise, noise_rad_per_s);
        numbers.set(Quantity::WanderShare, NO_WANDER);
        let (side, values) = self.side_and_values(fit, record, &numbers)?;
        let series = &self.observed[record].series;
        let system = decoupled_system(&side.parts(&fit.assumed), &numbers, series);
        // ln p(rates | readings) = ln p(both) − ln p(readings), squares and all.
        let squares = |rows: &[Row]| {
            let innovations = filter::forward(&system, rows, &values, false).innovations;
            let sum = innovations.iter().map(|i: &Innovation| i.value * i.value / i.variance).sum::<f64>();
            (sum, innovations.len())
        };
        let (both, all) = squares(&series.rows);
        let (readings, some) = squares(&without_rates(series));
        Ok((both - readings) / (all - some).saturating_sub(1).max(1) as f64)
    }
}

/// The share of wander in a gyro that has none.
const NO_WANDER: f64 = 1e-6;

/// Its rows with readings alone.
fn without_rates(series: &Series) -> Vec<Row> {
    let mut rows = series.rows.clone();
    rows.iter_mut().for_each(|row| row.measured[RATE] = None);
    rows
}
