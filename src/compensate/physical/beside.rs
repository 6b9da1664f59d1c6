//! The model's formulas beside the difference equation: what they need of its states and of a record.

use nalgebra::DMatrix;

use super::{MOST_DELAY_ROWS, Physical};
use crate::compensate::formulas::{AtWork, FormulaColumns, Formulas, MOST_COLUMNS, columns_seen};
use crate::record::Record;

impl Physical {
    /// What the formulas add to each row of a record.
    pub(super) fn formulas_over(&self, record: &Record) -> Vec<f64> {
        let interval_s = record.interval_s();
        let Some(mut formulas) = self.formulas_at_work(interval_s) else { return vec![0.0; record.rows()] };
        let mut filter = self.filter(interval_s, 0);
        let mut last_s = record.times_s()[0];
        record
            .times_s()
            .iter()
            .zip(record.temperature_k())
            .enumerate()
            .map(|(row, (&time_s, &temperature_k))| {
                for _ in 1..(((time_s - last_s) / interval_s).round() as usize).min(MOST_DELAY_ROWS) {
                    filter.step(None);
                }
                filter.step(Some(self.of_the_air_k(time_s, temperature_k)));
                last_s = time_s;
                formulas.see(&filter.state(), 0);
                let air = filter.rate_error_rad_per_s(0);
                let thermal = self.thermal_rate_rad_per_s(air, time_s, Some(temperature_k));
                formulas.rate_rad_per_s(0, time_s, thermal, &self.columns_seen(record, row))
            })
            .collect()
    }

    /// The formulas, ready for rows of one interval.
    pub(in crate::compensate) fn formulas_at_work(&self, interval_s: f64) -> Option<AtWork> {
        let formulas = self.formulas.as_ref()?;
        let causal = self.causal(interval_s).ok()?;
        let n = causal.states;
        let temperatures = DMatrix::from_row_slice(causal.layers.len() / n, n, &causal.layers);
        let dynamics = DMatrix::from_row_slice(n, n, &causal.dynamics);
        Some(formulas.at_work(temperatures, &dynamics, (causal.slope - 1, causal.slope)))
    }

    /// What formulas read of a record's row.
    pub(in crate::compensate) fn columns_of(&self, record: &Record, row: usize) -> FormulaColumns {
        let mut columns = FormulaColumns::default();
        for (value, name) in columns.iter_mut().zip(self.formula_columns()) {
            *value = record.channels().iter().find(|c| c.name == name).map(|c| c.values[row]);
        }
        columns
    }

    /// As a rate sees them.
    fn columns_seen(&self, record: &Record, row: usize) -> FormulaColumns {
        let Some(last) = row.checked_sub(1) else { return self.columns_of(record, row) };
        let since_s = record.times_s()[row] - record.times_s()[last];
        columns_seen(&self.columns_of(record, row), &self.columns_of(record, last), since_s, self.rate_mean_s)
    }

    /// Columns that formulas read, at most as many as a row holds for them.
    pub(crate) fn formula_columns(&self) -> impl Iterator<Item = &str> {
        self.formulas.iter().flat_map(|f| f.columns().iter().take(MOST_COLUMNS).map(String::as_str))
    }

    /// The coil's own error of a row, `air_rad_per_s` being what the air's temperature makes in it.
    pub(in crate::compensate) fn thermal_rate_rad_per_s(
        &self,
        air_rad_per_s: f64,
        time_s: f64,
        temperature_k: Option<f64>,
    ) -> f64 {
        self.error_rad_per_s(air_rad_per_s, time_s, temperature_k, 0.0)
    }

    /// The formulas beside the difference equation, with their rows for one interval; None where there are none.
    pub(crate) fn formulas(&self, interval_s: f64) -> Option<(&Formulas, AtWork)> {
        Some((self.formulas.as_ref()?, self.formulas_at_work(interval_s)?))
    }
}
