//! What drove a coil along a record: its layers and its air between the rows of a chamber.

use std::ops::Range;

use super::PredictError;
use crate::chamber::{Bend, Chamber, ChamberError, FilmSwitches, Fit, Place, Quantity, Told};
use crate::numeric::hermite::hermite;
use crate::rate::CoilModel;
use crate::record::Record;
use crate::thermal::{GivenField, ThermalHistory};

/// What drove a record, as its readings tell.
#[derive(Debug, Clone)]
pub struct Boundary {
    /// Film between air and pack with its standard error [W/(m²K)]; None where the model's own counts.
    pub(crate) film_w_per_m2_k: Option<(f64, f64)>,
    /// Where the air's slope changed.
    pub(crate) bends: Vec<Bend>,
    /// None where the film is one.
    pub(crate) film_switches: Option<FilmSwitches>,
    course: Course,
    /// One entry a row of the chamber.
    rate_variance_rad2_per_s2: Vec<f64>,
}

/// Layers and air between the rows of a chamber.
#[derive(Debug, Clone)]
struct Course {
    layers: usize,
    /// Layers, axial moments, air.
    columns: usize,
    times_s: Vec<f64>,
    /// Row-major rows × columns.
    values: Vec<f64>,
    /// Empty where values count as straight between the times.
    slopes_per_s: Vec<f64>,
}

impl Boundary {
    /// What one record's readings imply in a chamber, by a fit there.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn told(chamber: &Chamber, fit: &Fit, record: usize) -> Result<Self, ChamberError> {
        let Told { course, rate_variance_rad2_per_s2, bends } = chamber.told(fit, record)?;
        let film_w_per_m2_k = fit.value(Place::Quantity { quantity: Quantity::Film, record: None });
        let reference_k = chamber.reference_k(record);
        let columns = course.outputs + 1;
        let mut values = Vec::with_capacity(course.air_k.len() * columns);
        for (row, air_k) in course.air_k.iter().enumerate() {
            let (layers, moments) = course.row(row).split_at(course.layers);
            values.extend(layers.iter().map(|t| reference_k + t));
            values.extend_from_slice(moments);
            values.push(reference_k + air_k);
        }
        let times_s = chamber.times_s(record).to_vec();
        let course = Course { layers: course.layers, columns, times_s, values, slopes_per_s: course.slopes_k_per_s };
        let film_switches = chamber.film_switches(record, Some(fit));
        Ok(Self { film_w_per_m2_k, bends, film_switches, course, rate_variance_rad2_per_s2 })
    }

    /// Of layers' temperatures that are known; nothing is left open then.
    ///
    /// # Errors
    /// A field of other layers than the coil's, or that does not span the record's averaging intervals.
    pub(crate) fn given(model: &CoilModel, field: &GivenField, record: &Record) -> Result<Self, PredictError> {
        let fault = |message: String| Err(PredictError::Field { message });
        let (history, layers) = (&field.history, model.coil.layers());
        if history.layers != layers {
            return fault(format!("expected the coil's {layers} layers, found {}", history.layers));
        }
        let (from_s, to_s) = (record.times_s()[0] - model.rate_mean_s, record.times_s()[record.rows() - 1]);
        let (first_s, last_s) = field.span_s();
        if from_s < first_s - SAME_S || to_s > last_s + SAME_S {
            return fault(format!(
                "the record's averaging intervals go from {from_s} to {to_s} s, the field from {first_s} to {last_s} s: it must span them"
            ));
        }
        let has_moments = !(history.axial_moment_k.is_empty() && history.axial_moment_k_per_s.is_empty());
        // Of moments only the changes count: where they are not given, their rates' integral stands for them.
        let moments_k = match has_moments && history.axial_moment_k.is_empty() {
            true => integral(&history.times_s, &history.axial_moment_k_per_s),
            false => history.axial_moment_k.clone(),
        };
        if history.len() < 2 {
            return fault("expected at least two times, found one".to_owned());
        }
        let columns = if has_moments { 2 * layers + 1 } else { layers + 1 };
        let gathered = |of_layers: &[f64], moments: &[f64], air: &[f64]| -> Vec<f64> {
            let rows = (0..history.len()).flat_map(|row| {
                let here = row * layers..(row + 1) * layers;
                let moments = if has_moments { &moments[here.clone()] } else { &[] };
                of_layers[here].iter().chain(moments).chain(&air[row..=row])
            });
            rows.copied().collect()
        };
        let slopes_per_s = match field.has_rates {
            true => gathered(&history.rate_k_per_s, &history.axial_moment_k_per_s, &history.ambient_rate_k_per_s),
            false => Vec::new(),
        };
        let values = gathered(&history.temperature_k, &moments_k, &history.ambient_k);
        let times_s = history.times_s.clone();
        let rate_variance_rad2_per_s2 = vec![0.0; times_s.len()];
        let course = Course { layers, columns, times_s, values, slopes_per_s };
        Ok(Self { film_w_per_m2_k: None, bends: Vec::new(), film_switches: None, course, rate_variance_rad2_per_s2 })
    }

    /// The pack over the averaging intervals of some of a record's rows.
    pub(crate) fn history(&self, record: &Record, rows: Range<usize>, rate_mean_s: f64) -> ThermalHistory {
        let course = &self.course;
        let count = rows.len();
        let mut history = ThermalHistory::with_capacity(course.layers, count);
        history.times_s.extend_from_slice(&record.times_s()[rows.clone()]);
        let (mut end, mut start) = (vec![0.0; course.columns], vec![0.0; course.columns]);
        let mut rates = vec![0.0; course.columns];
        let air = course.columns - 1;
        for row in rows {
            let time_s = record.times_s()[row];
            course.at(time_s, &mut end, Some(&mut rates));
            if rate_mean_s > 0.0 {
                course.at(time_s - rate_mean_s, &mut start, None);
                for ((rate, end), start) in rates.iter_mut().zip(&mut end).zip(&start) {
                    *rate = (*end - start) / rate_mean_s;
                    *end = 0.5 * (*end + start);
                }
            }
            history.temperature_k.extend_from_slice(&end[..course.layers]);
            history.rate_k_per_s.extend_from_slice(&rates[..course.layers]);
            history.axial_moment_k.extend_from_slice(&end[course.layers..air]);
            history.axial_moment_k_per_s.extend_from_slice(&rates[course.layers..air]);
            history.ambient_k.push(end[air]);
            history.ambient_rate_k_per_s.push(rates[air]);
        }
        history
    }

    /// Variance that what the readings leave open gives the rates at some times [(rad/s)²].
    pub(super) fn rate_variances_rad2_per_s2(&self, times_s: &[f64]) -> Vec<f64> {
        let last = self.course.times_s.len() - 1;
        let row = |t: &f64| self.course.times_s.partition_point(|end| *end < t - SAME_S).clamp(1, last);
        times_s.iter().map(|t| self.rate_variance_rad2_per_s2[row(t)]).collect()
    }
}

/// Of rates that are straight between times, row-major as they are.
fn integral(times_s: &[f64], rates: &[f64]) -> Vec<f64> {
    let columns = rates.len() / times_s.len().max(1);
    let mut sums = vec![0.0; rates.len()];
    for row in 1..times_s.len() {
        let step_s = times_s[row] - times_s[row - 1];
        for j in row * columns..(row + 1) * columns {
            sums[j] = sums[j - columns] + 0.5 * step_s * (rates[j - columns] + rates[j]);
        }
    }
    sums
}

/// Two times that differ by less are one [s].
const SAME_S: f64 = 1e-6;

impl Course {
    /// Value and, if asked for, slope at a time; behind the last row straight on, before the first with the slope of the first interval:
    /// what dies away in it need not have been there before.
    fn at(&self, time_s: f64, values: &mut [f64], slopes: Option<&mut [f64]>) {
        let last = self.times_s.len() - 1;
        let right = self.times_s.partition_point(|&t| t < time_s).clamp(1, last);
        let (t0, t1) = (self.times_s[right - 1], self.times_s[right]);
        let length_s = t1 - t0;
        let x = (time_s - t0) / length_s;
        let inside = x.clamp(0.0, 1.0);
        let (beyond_s, out) = ((x - inside) * length_s, x != inside);
        let mut slopes = slopes;
        for (j, value) in values.iter_mut().enumerate() {
            let (a, b) = (self.value(right - 1, j), self.value(right, j));
            if self.slopes_per_s.is_empty() {
                *value = a + x * (b - a);
                if let Some(slopes) = slopes.as_deref_mut() {
                    slopes[j] = (b - a) / length_s;
                }
                continue;
            }
            let (p, q) = (length_s * self.slope(right - 1, j), length_s * self.slope(right, j));
            let (within, rising) = hermite((a, b), (p, q), inside);
            let slope = if x < 0.0 { b - a } else { rising } / length_s;
            *value = within + if out { beyond_s * slope } else { 0.0 };
            if let Some(slopes) = slopes.as_deref_mut() {
                slopes[j] = slope;
            }
        }
    }

    fn value(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    fn slope(&self, row: usize, column: usize) -> f64 {
        self.slopes_per_s[row * self.columns + column]
    }
}
