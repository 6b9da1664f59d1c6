//! What further outputs of the rate would gain, cleared of everything that was fitted: one filter pass a column.
//!
//! ```text
//! v → v − β V,  V the column's own innovations:   g = Σ V v/S,  J = Σ V V/S,  C = Σ V v'/S
//! g̃ = g + C I⁻¹ s,  J̃ = J − C I⁻¹ Cᵀ,   gain of any combination β: β·g̃ − ½ βᵀ J̃ β, at best ½ g̃ᵀ J̃⁻¹ g̃
//! ```
//!
//! | symbol | meaning |
//! |---|---|
//! | v, S, v' | innovations of the fit, their variances and derivatives by the fitted coordinates |
//! | I, s | information and slope of the fitted posterior; s is zero at the maximum |
//!
//! # Source
//! Rao, Proc. Camb. Phil. Soc. 44 (1948) 50; Rosenberg, Ann. Econ. Soc. Meas. 2 (1973) 399 (columns through a filter).

use nalgebra::{DMatrix, DVector};

use super::coil_side::run_kept;
use super::derivative::{DerivativeColumn, Derivatives};
use super::filter::{RATE, Values, respond};
use super::fit::Fit;
use super::parameter::add_priors;
use super::{Assumption, Chamber, ChamberError};
use crate::parallel::InParallel;

/// A course that might add to the rate [rad/s at unit amplitude].
///
/// # Shapes
/// One course a record of the chamber, one entry a row of the chamber; those of records that were not fitted may be empty.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Column {
    pub(crate) rate_rad_per_s: Vec<Vec<f64>>,
}

impl Column {
    /// One from a row of a record on.
    pub(crate) fn step(chamber: &Chamber, record: usize, row: usize) -> Self {
        let course = |r: usize| {
            let rows = chamber.times_s(r).len();
            (0..rows).map(|k| f64::from(r == record && k >= row)).collect()
        };
        Self { rate_rad_per_s: (0..chamber.records()).map(course).collect() }
    }
}

/// A change of the model as a direction from a fit, cleared of what was fitted; the whole change is one unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Direction {
    pub(crate) score: f64,
    pub(crate) information: f64,
}

impl Direction {
    /// By how much the log likelihood would rise at most between these multiples of the change, and at which.
    pub(crate) fn gain(&self, least: f64, most: f64) -> (f64, f64) {
        let amplitude = (self.score / self.information).clamp(least, most);
        (amplitude * self.score - 0.5 * amplitude * amplitude * self.information, amplitude)
    }
}

/// Score and information of columns, cleared of what was fitted.
#[derive(Debug, Clone)]
pub(crate) struct Scores {
    /// g̃ of each column.
    pub(crate) score: DVector<f64>,
    /// J̃ between columns.
    pub(crate) information: DMatrix<f64>,
}

impl Scores {
    /// By how much the log likelihood would rise with a column at its best amplitude, and that amplitude.
    pub(crate) fn gain(&self, column: usize) -> (f64, f64) {
        let information = self.information[(column, column)];
        if !(information > 0.0) {
            return (0.0, 0.0);
        }
        let amplitude = self.score[column] / information;
        (0.5 * self.score[column] * amplitude, amplitude)
    }

    /// By how much it would rise with given amplitudes of all columns.
    pub(crate) fn gain_of(&self, amplitudes: &DVector<f64>) -> f64 {
        amplitudes.dot(&self.score) - 0.5 * amplitudes.dot(&(&self.information * amplitudes))
    }
}

impl Chamber<'_> {
    /// Scores columns against a fit.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn score(&self, fit: &Fit, columns: &[Column]) -> Result<Scores, ChamberError> {
        let point = self.model_point(fit.assumed.clone(), fit.numbers.clone(), &fit.records, &fit.courses)?;
        let (count, fitted) = (columns.len(), fit.parameters.len());
        let mut score = DVector::zeros(count);
        let mut information = DMatrix::zeros(count, count);
        let mut cross = DMatrix::zeros(count, fitted);
        let mut slope = DVector::zeros(fitted);
        let mut own_information = DMatrix::zeros(fitted, fitted);
        for &record in &fit.records {
            let (Some(side), Some(values)) = (&point.sides[record], &point.values[record]) else {
                return Err(ChamberError::Unsolvable);
            };
            let observed = &self.observed[record];
            let (system, trace) = run_kept(side, &point.assumed, &point.numbers[record], observed, values);
            let base = vec![trace.innovations.clone()];
            let derivatives = self.derivatives(&point, &fit.parameters, &fit.coordinates, &[record], &base)?;
            let responses: Vec<Vec<f64>> = columns
                .iter()
                .in_parallel()
                .map(|column| {
                    let mut inputs = Values { of: std::array::from_fn(|_| Vec::new()) };
                    inputs.of[RATE] = column.rate_rad_per_s.get(record).cloned().unwrap_or_default();
                    let mut out = respond(&system, &observed.series.rows, &trace, &inputs);
                    // In units of the innovations' deviations.
                    out.iter_mut().zip(&trace.innovations).for_each(|(o, i)| *o /= i.variance.sqrt());
                    out
                })
                .collect();
            let rows = trace.innovations.len();
            let v = DVector::from_iterator(rows, trace.innovations.iter().map(|i| i.value / i.variance.sqrt()));
            let flat: Vec<f64> = responses.concat();
            let responses = DMatrix::from_vec(rows, count, flat);
            score += responses.tr_mul(&v);
            information += responses.tr_mul(&responses);
            let own = &derivatives[0];
            own.add_to(&trace.innovations, &mut slope, &mut own_information);
            add_cross(own, &trace.innovations, &responses, &mut cross);
        }
        add_priors(&fit.parameters, &fit.coordinates, &mut slope, &mut own_information);
        if let Some(factor) = own_information.cholesky() {
            // The innovations fall by V per unit of amplitude: their derivative is −V.
            let weights = factor.solve(&cross.transpose());
            score += weights.transpose() * slope;
            information -= &cross * weights;
        }
        Ok(Scores { score, information })
    }

    /// What changes of the whole model would gain, each computed at one other point and taken as a direction from the fit:
    /// one evaluation a record and change. None where the changed model cannot be solved.
    ///
    /// # Errors
    /// A fit whose own model cannot be solved.
    pub(crate) fn score_models(
        &self,
        fit: &Fit,
        changed: &[&Assumption],
    ) -> Result<Vec<Option<Direction>>, ChamberError> {
        let point = self.model_point(fit.assumed.clone(), fit.numbers.clone(), &fit.records, &fit.courses)?;
        let base: Result<Vec<_>, _> = fit.records.iter().map(|&r| self.innovations(&point, r)).collect();
        let base = base?;
        let derivatives = self.derivatives(&point, &fit.parameters, &fit.coordinates, &fit.records, &base)?;
        let fitted = fit.parameters.len();
        let mut slope = DVector::zeros(fitted);
        let mut own = DMatrix::zeros(fitted, fitted);
        derivatives.iter().zip(&base).for_each(|(d, b)| d.add_to(b, &mut slope, &mut own));
        add_priors(&fit.parameters, &fit.coordinates, &mut slope, &mut own);
        let Some(factor) = own.cholesky() else { return Err(ChamberError::Unsolvable) };
        let found = changed
            .iter()
            .in_parallel()
            .map(|assumed| {
                let mut score = 0.0;
                let mut information = 0.0;
                let mut cross = DVector::zeros(fitted);
                let there =
                    self.model_point((*assumed).clone(), fit.numbers.clone(), &fit.records, &fit.courses).ok()?;
                for (i, &record) in fit.records.iter().enumerate() {
                    let moved = self.innovations(&there, record).ok()?;
                    let column = DerivativeColumn::new(&base[i], &moved, 1.0);
                    score += column.score(&base[i]);
                    information += derivatives[i].beside(&column, &base[i], &mut cross);
                }
                let weights = factor.solve(&cross);
                let (score, information) = (score - weights.dot(&slope), information - weights.dot(&cross));
                (information > 0.0 && score.is_finite()).then_some(Direction { score, information })
            })
            .collect();
        Ok(found)
    }

    /// The rates of each output of the layers' smoothed course over each row's window, as columns: what a change of one
    /// layer's gain would add to the rate, per unit of gain.
    ///
    /// # Shapes
    /// One column an output: the layers, innermost first, then axial moments.
    pub(crate) fn layer_columns(&self, fit: &Fit) -> Vec<Column> {
        let outputs = fit.courses.iter().flatten().map(|c| c.outputs).next().unwrap_or(0);
        (0..outputs)
            .map(|j| Column {
                rate_rad_per_s: (0..self.records())
                    .map(|r| {
                        fit.courses[r]
                            .as_ref()
                            .map_or_else(Vec::new, |c| c.window_rates(&self.observed[r].series, Some(j)))
                    })
                    .collect(),
            })
            .collect()
    }
}

fn add_cross(own: &Derivatives, base: &[super::Innovation], responses: &DMatrix<f64>, cross: &mut DMatrix<f64>) {
    for (place, &p) in own.parameters.iter().enumerate() {
        let scaled = DVector::from_iterator(
            base.len(),
            own.columns[place].value.iter().zip(base).map(|(d, i)| d / i.variance.sqrt()),
        );
        let mut column = cross.column_mut(p);
        column += responses.tr_mul(&scaled);
    }
}
