//! What a fitted model says of a record: its rate, and its score where nothing is fitted.

use std::sync::Arc;

use super::ascent::Effort;
use super::coil_side::{BLIND_RAD2_PER_S2, CoilSide, smoothed};
use super::filter::{Innovation, RATE};
use super::fit::Fit;
use super::known::Reference;
use super::layout::Numbers;
use super::noise::Remedy;
use super::prior::Quantity;
use super::readings::Told;
use super::{Chamber, ChamberError};

/// What a model says a record's rate was, from its readings alone.
///
/// # Shapes
/// One entry a row of the chamber; NaN where a row has no rate.
#[derive(Debug, Clone)]
pub(crate) struct Prediction {
    pub(crate) rate_rad_per_s: Vec<f64>,
    /// Variance that the model expects of measured less predicted, white noise and wander included.
    pub(crate) variance_rad2_per_s2: Vec<f64>,
    /// Measured less predicted.
    pub(crate) residual_rad_per_s: Vec<f64>,
    /// The layers and the air that the readings imply.
    pub(crate) course: Reference,
}

impl Chamber<'_> {
    /// Log evidence of a record that was not fitted: the coil's numbers stay as they were found, the chamber's on that day
    /// are its own.
    ///
    /// # Errors
    /// A model that cannot be solved for this record.
    pub(crate) fn held_out(&self, fit: &Fit, record: usize) -> Result<Fit, ChamberError> {
        let mut start = Fit { days: Arc::default(), ..fit.clone() };
        let Some(day) = fit.days.iter().find(|day| day.records == [record]) else {
            let day = self.fit(&fit.assumed, &[], &[record], Some(&start), Effort::FULL)?;
            return self.in_better_order(day, Effort::FULL);
        };
        // With the day as a fit like this one found it.
        start.records = vec![record];
        start.numbers.clone_from(&day.numbers);
        start.courses[record].clone_from(&day.courses[record]);
        start.known_derivatives.clone_from(&day.known_derivatives);
        self.fit(&fit.assumed, &[], &[record], Some(&start), Effort::FULL)
    }

    /// The rate that a record's readings imply, smoothed over the whole record, the gyro's own rates being only compared
    /// with it; the offset is fitted. Its variance is that of a filter, which knows the readings so far.
    ///
    /// # Errors
    /// As [`Chamber::held_out`].
    pub(crate) fn prediction(&self, fit: &Fit, record: usize) -> Result<Prediction, ChamberError> {
        let observed = &self.observed[record];
        let numbers = self.numbers_for(fit, record);
        let assumed = &fit.assumed;
        let side = CoilSide::new(assumed, numbers.get(Quantity::Film), self.modes, observed)?;
        let Told { course, .. } = self.told(fit, record)?;
        let rows = self.times_s(record).len();
        let mut prediction = Prediction {
            rate_rad_per_s: side.rates(assumed, observed, record, &course)?,
            variance_rad2_per_s2: vec![f64::NAN; rows],
            residual_rad_per_s: vec![f64::NAN; rows],
            course,
        };
        let (places, innovations) = self.pass(fit, &numbers, record, false, None)?;
        for ((row, measurement), i) in places.into_iter().zip(innovations) {
            if measurement == RATE {
                let measured = observed.series.values[RATE][row];
                prediction.variance_rad2_per_s2[row] = i.variance;
                prediction.residual_rad_per_s[row] = measured - prediction.rate_rad_per_s[row];
            }
        }
        prediction.fit_offset();
        Ok(prediction)
    }

    /// The air and the layers of a record as its readings alone imply them, by what a fit assumes.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn course_by_readings(&self, fit: &Fit, record: usize) -> Result<Reference, ChamberError> {
        let observed = &self.observed[record];
        let numbers = self.numbers_for(fit, record);
        let side = CoilSide::new(&fit.assumed, numbers.get(Quantity::Film), self.modes, observed)?;
        let course = |before| smoothed(&side, &fit.assumed, &numbers, observed, record, before);
        let first = course(None)?;
        if side.needs_reference() { course(Some(&first)) } else { Ok(first) }
    }

    /// The numbers for a record: its own where it was fitted, the first fitted record's elsewhere.
    pub(super) fn numbers_for(&self, fit: &Fit, record: usize) -> Numbers {
        let first = fit.records.first().copied().unwrap_or(record);
        fit.numbers[if fit.records.contains(&record) { record } else { first }]
    }

    /// The innovations of a record, and of each its row and which measurement it is.
    pub(super) fn pass(
        &self,
        fit: &Fit,
        numbers: &Numbers,
        record: usize,
        with_rates: bool,
        otherwise: Option<Remedy>,
    ) -> Result<Pass, ChamberError> {
        let observed = &self.observed[record];
        let (assumed, film) = (&fit.assumed, numbers.get(Quantity::Film));
        let side = CoilSide::new(assumed, film, self.modes, observed)?;
        let mut course = fit.courses[record].clone();
        if course.is_none() && side.needs_reference() {
            for _ in 0..2 {
                course = Some(smoothed(&side, assumed, numbers, observed, record, course.as_ref())?);
            }
        }
        let values = side.values(assumed, observed, record, course.as_ref().filter(|_| side.needs_reference()))?;
        let rows = &observed.series.rows;
        let mut parts = side.parts(assumed);
        let mut numbers = *numbers;
        if let Some(remedy) = otherwise {
            remedy.apply(&mut parts, &mut numbers);
        }
        let mut system = super::system::decoupled_system(&parts, &numbers, &observed.series);
        if let Some(Remedy::FinerResolution) = otherwise {
            system.grids[0] = 0.0;
        }
        if !with_rates {
            // Rates are looked at, not taken in: their gain is as good as zero.
            system.variances[RATE] += BLIND_RAD2_PER_S2;
            system.forget_offset(&parts, &observed.series);
        }
        let trace = super::filter::forward(&system, rows, &values, false);
        let mut places = Vec::with_capacity(trace.innovations.len());
        for (k, row) in rows.iter().enumerate() {
            places.extend(row.measured.iter().enumerate().filter(|(_, m)| m.is_some()).map(|(m, _)| (k, m)));
        }
        let mut innovations = trace.innovations;
        if !with_rates {
            for ((_, measurement), i) in places.iter().zip(&mut innovations) {
                if *measurement == RATE {
                    i.variance -= BLIND_RAD2_PER_S2 / observed.series.averaged as f64;
                }
            }
        }
        Ok((places, innovations))
    }
}

/// Of each innovation its row and which measurement it is; and the innovations.
pub(super) type Pass = (Vec<(usize, usize)>, Vec<Innovation>);

impl Prediction {
    /// Moves the prediction by the offset that leaves the least.
    fn fit_offset(&mut self) {
        let (mut weights, mut sum) = (0.0, 0.0);
        for (residual, variance) in self.residual_rad_per_s.iter().zip(&self.variance_rad2_per_s2) {
            if residual.is_finite() && *variance > 0.0 {
                weights += 1.0 / variance;
                sum += residual / variance;
            }
        }
        if weights > 0.0 {
            let offset = sum / weights;
            self.rate_rad_per_s.iter_mut().for_each(|r| *r += offset);
            self.residual_rad_per_s.iter_mut().for_each(|r| *r -= offset);
        }
    }
}
