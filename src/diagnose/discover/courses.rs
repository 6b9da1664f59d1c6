//! The variables of formulas along the records: layers and air as the readings alone imply them, columns as they were logged.
//!
//! The gyro's rates are not taken in: what is unexplained in them would bend the layers that it is to be explained by.

use crate::chamber::{Chamber, ChamberError, Column, Fit, RowStates};
use crate::effect::custom::THERMAL_RATE;
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s, rad_per_s_from_deg_per_h};

use super::grammar::Term;

/// One record's variables by name.
#[derive(Debug, Clone, Default)]
struct Course {
    times_s: Vec<f64>,
    of: Vec<(String, Vec<f64>)>,
}

/// The variables of all records of a chamber.
#[derive(Debug, Clone)]
pub(crate) struct Courses {
    records: Vec<Course>,
    /// Of those that were fitted.
    fitted: Vec<usize>,
    columns: Vec<(String, f64)>,
}

impl Courses {
    /// `days`: for each record that was held out, a fit that has its course.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn new(chamber: &Chamber, fit: &Fit, days: &[Fit], lengths_m: &[f64]) -> Result<Self, ChamberError> {
        let mut records = Vec::new();
        for record in 0..chamber.records() {
            let of = std::iter::once(fit).chain(days).find(|f| f.records.contains(&record));
            let Some(of) = of else {
                records.push(Course::default());
                continue;
            };
            let course = chamber.course_by_readings(of, record)?;
            records.push(Course::new(&chamber.states(of, record, &course)?, lengths_m));
        }
        let fitted = fit.records.clone();
        let mut all = Self { records, fitted, columns: Vec::new() };
        all.columns = all.shared_columns(chamber);
        Ok(all)
    }

    /// Further columns that every record has whole and that vary, each with its mean over the fitted records.
    fn shared_columns(&self, chamber: &Chamber) -> Vec<(String, f64)> {
        let Some(&first) = self.fitted.first() else { return Vec::new() };
        let names = chamber.record(first).channels().iter().map(|c| c.name.clone());
        names
            .filter(|name| {
                let whole = |r: usize| {
                    let values = self.of(name, r);
                    !values.is_empty() && values.iter().all(|v| v.is_finite())
                };
                (0..self.records.len()).filter(|&r| !self.records[r].times_s.is_empty()).all(whole)
            })
            .map(|name| {
                let values = self.of(&name, first);
                let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
                (name, mean)
            })
            .collect()
    }

    pub(crate) fn columns(&self) -> Vec<(String, f64)> {
        self.columns.clone()
    }

    pub(crate) fn times_s(&self, record: usize) -> &[f64] {
        &self.records[record].times_s
    }

    /// Empty where there is no such name.
    pub(crate) fn of(&self, name: &str, record: usize) -> &[f64] {
        self.records[record].of.iter().find(|(n, _)| n == name).map_or(&[], |(_, values)| values)
    }

    /// Least and largest value over the fitted records; of a difference too.
    pub(crate) fn range(&self, name: &str) -> Option<(f64, f64)> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut see = |v: f64| (low, high) = (low.min(v), high.max(v));
        for &r in &self.fitted {
            match name.split_once(" - ") {
                Some((a, b)) => self.of(a, r).iter().zip(self.of(b, r)).for_each(|(a, b)| see(a - b)),
                None => self.of(name, r).iter().copied().for_each(&mut see),
            }
        }
        (low.is_finite() && high.is_finite()).then_some((low, high))
    }

    /// The largest difference from others of the same records, as a share of its variable's range over the fitted ones.
    pub(crate) fn apart(&self, others: &Self) -> f64 {
        let mut largest: f64 = 0.0;
        for (record, course) in self.records.iter().enumerate() {
            for (name, values) in &course.of {
                let Some((low, high)) = self.range(name).filter(|(low, high)| high > low) else { continue };
                let differences = values.iter().zip(others.of(name, record)).map(|(a, b)| (a - b).abs());
                largest = differences.fold(largest, |most, apart| most.max(apart / (high - low)));
            }
        }
        largest
    }

    /// The longest fitted record [s].
    pub(crate) fn longest_s(&self) -> f64 {
        let span = |r: &usize| {
            let times = self.times_s(*r);
            times.last().zip(times.first()).map_or(0.0, |(b, a)| b - a)
        };
        self.fitted.iter().map(span).fold(0.0, f64::max)
    }

    /// A term as a column of the chamber: its amplitude is then that of the formula, in °/h.
    pub(crate) fn column(&self, term: &Term) -> Column {
        let of = |r: usize| {
            let values = term.course(self, r);
            let first = values.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
            // What it is at the start belongs to the offset: numbers stay small.
            values.into_iter().map(|v| rad_per_s_from_deg_per_h(v - first)).collect()
        };
        Column { rate_rad_per_s: (0..self.records.len()).map(of).collect() }
    }
}

impl Course {
    fn new(states: &RowStates, lengths_m: &[f64]) -> Self {
        let layers = states.temperatures_k.len();
        let whole_m: f64 = lengths_m.iter().sum();
        let rows = states.times_s.len();
        let mean = |of: &[Vec<f64>]| -> Vec<f64> {
            (0..rows).map(|k| of.iter().zip(lengths_m).map(|(v, l)| v[k] * l).sum::<f64>() / whole_m).collect()
        };
        let celsius = |values: &[f64]| values.iter().map(|t| celsius_from_kelvin(*t)).collect::<Vec<f64>>();
        let mut of = vec![
            ("t".to_owned(), states.times_s.clone()),
            ("T".to_owned(), celsius(&states.temperatures_k[layers - 1])),
            ("T_in".to_owned(), celsius(&states.temperatures_k[0])),
            ("T_mean".to_owned(), celsius(&mean(&states.temperatures_k))),
            ("dT_dt".to_owned(), states.rates_k_per_s[layers - 1].clone()),
            ("mean_rate".to_owned(), mean(&states.rates_k_per_s)),
            (
                THERMAL_RATE.to_owned(),
                states.thermal_rate_rad_per_s.iter().map(|r| deg_per_h_from_rad_per_s(*r)).collect(),
            ),
        ];
        of.extend(states.channels.iter().cloned());
        Self { times_s: states.times_s.clone(), of }
    }
}
