//! A measurement: time, the sensor's temperature, the gyro's rate, and whatever else was logged.

use std::collections::{BTreeSet, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};

use thiserror::Error;

use crate::numeric::piecewise::trailing_means;
use crate::numeric::statistics::{gross_errors, robust_deviation};
use crate::units::rad_per_s_from_deg_per_h;

/// A further column of a record, by its name.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// The column's title.
    pub name: String,
    /// One value a row, in the file's own unit.
    pub values: Vec<f64>,
}

/// The channel of the table's rate, which a record's rates are without [°/h]: of each row the mean over the same time as the gyro's
/// rate in it.
pub const TABLE_RATE: &str = "table_rate_deg_per_h";

const LAYER_CHANNEL: (&str, &str) = ("temperature_layer_", "_c");

/// The channel of a thermometer at a layer [°C], counted from 1 innermost.
pub(crate) fn layer_channel(layer: usize) -> String {
    format!("{}{layer}{}", LAYER_CHANNEL.0, LAYER_CHANNEL.1)
}

/// One row of what every record has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordRow {
    pub(crate) time_s: f64,
    pub(crate) temperature_k: f64,
    /// Beside the table's, where the gyro stood on one.
    pub(crate) rate_rad_per_s: f64,
    pub(crate) table_rad_per_s: Option<f64>,
}

/// A value that stands alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct GrossError {
    /// Index 0 is the first.
    pub row: usize,
    /// "temperature" or "rate".
    pub column: &'static str,
}

/// Rows to each side that a value is compared with.
const NEIGHBOURS: usize = 3;
/// A gross error is this many spreads of its neighbours away from their median,
const SPREAD_FACTOR: f64 = 8.0;
/// and this many times the usual change from row to row.
const FLOOR_FACTOR: f64 = 8.0;

/// One record of a gyro at rest in a temperature chamber.
///
/// # Shapes
/// All columns have the length of `times_s`, which increases strictly. Gaps are gaps in time; every stored number
/// is finite except in optional columns and channels, where NaN marks a missing value.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    name: String,
    times_s: Vec<f64>,
    temperature_k: Vec<f64>,
    rate_rad_per_s: Vec<f64>,
    inner_k: Option<Vec<f64>>,
    ambient_k: Option<Vec<f64>>,
    channels: Vec<Channel>,
}

/// Why columns make no record.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum RecordError {
    #[error("a record needs at least {needed} rows, found {found}")]
    TooShort { needed: usize, found: usize },
    #[error("column {column} has {found} values where time_s has {expected}")]
    Shape { column: String, expected: usize, found: usize },
    #[error("time_s must increase strictly, row {row} ({found_s} s) does not")]
    Time { row: usize, found_s: f64 },
    #[error("column {column} holds no finite number in row {row}")]
    NotFinite { column: &'static str, row: usize },
    #[error("rows are {found_s:e} s apart, expected at least {LEAST_INTERVAL_S:e} s: check the unit of time_s")]
    Interval { found_s: f64 },
}

/// Fewer rows than this describe no record.
pub(crate) const MIN_ROWS: usize = 3;
/// Rows that are usually closer are no record: no gyro gives a million rates a second.
pub const LEAST_INTERVAL_S: f64 = 1e-6;

impl Record {
    /// A record of columns of one entry a row: times, the driving thermometer, and the gyro's rate error.
    ///
    /// # Example
    /// ```
    /// use coilwright::{Record, units::rad_per_s_from_deg_per_h};
    ///
    /// let rate = rad_per_s_from_deg_per_h(0.02);
    /// let record = Record::new("bench", vec![0.0, 1.0, 2.0], vec![293.15, 293.16, 293.17], vec![rate; 3])?;
    /// assert_eq!((record.rows(), record.interval_s()), (3, 1.0));
    /// assert!(Record::new("back in time", vec![0.0, 2.0, 1.0], vec![293.15; 3], vec![rate; 3]).is_err());
    /// # Ok::<(), coilwright::record::RecordError>(())
    /// ```
    ///
    /// # Errors
    /// Too few rows, columns of unequal length, times that do not increase or are too close, needed numbers that are not finite.
    pub fn new(
        name: impl Into<String>,
        times_s: Vec<f64>,
        temperature_k: Vec<f64>,
        rate_rad_per_s: Vec<f64>,
    ) -> Result<Self, RecordError> {
        let rows = times_s.len();
        if rows < MIN_ROWS {
            return Err(RecordError::TooShort { needed: MIN_ROWS, found: rows });
        }
        for (column, values) in [("temperature_c", &temperature_k), ("rate_deg_per_h", &rate_rad_per_s)] {
            if values.len() != rows {
                return Err(RecordError::Shape { column: column.to_owned(), expected: rows, found: values.len() });
            }
        }
        for (column, values) in
            [("time_s", &times_s), ("temperature_c", &temperature_k), ("rate_deg_per_h", &rate_rad_per_s)]
        {
            if let Some(row) = values.iter().position(|v| !v.is_finite()) {
                return Err(RecordError::NotFinite { column, row: row + 1 });
            }
        }
        if let Some(row) = (1..rows).find(|&i| times_s[i] <= times_s[i - 1]) {
            return Err(RecordError::Time { row: row + 1, found_s: times_s[row] });
        }
        let found_s = usual_interval_s(&times_s);
        if found_s < LEAST_INTERVAL_S {
            return Err(RecordError::Interval { found_s });
        }
        Ok(Self {
            name: name.into(),
            times_s,
            temperature_k,
            rate_rad_per_s,
            inner_k: None,
            ambient_k: None,
            channels: Vec::new(),
        })
    }

    /// Adds the temperature of the bore.
    ///
    /// # Errors
    /// A column of another length.
    pub fn with_inner_k(mut self, inner_k: Vec<f64>) -> Result<Self, RecordError> {
        self.check_length("temperature_inner_c", inner_k.len())?;
        self.inner_k = Some(inner_k);
        Ok(self)
    }

    /// Adds the temperature of the air.
    ///
    /// # Errors
    /// A column of another length.
    pub fn with_ambient_k(mut self, ambient_k: Vec<f64>) -> Result<Self, RecordError> {
        self.check_length("temperature_ambient_c", ambient_k.len())?;
        self.ambient_k = Some(ambient_k);
        Ok(self)
    }

    /// Adds a further channel.
    ///
    /// # Errors
    /// A column of another length.
    pub fn with_channel(mut self, channel: Channel) -> Result<Self, RecordError> {
        self.check_length(&channel.name, channel.values.len())?;
        self.channels.push(channel);
        Ok(self)
    }

    fn check_length(&self, column: &str, found: usize) -> Result<(), RecordError> {
        let expected = self.rows();
        if found == expected { Ok(()) } else { Err(RecordError::Shape { column: column.to_owned(), expected, found }) }
    }

    /// As it is shown; a file's stem.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How many there are.
    pub fn rows(&self) -> usize {
        self.times_s.len()
    }

    /// Increasing; one entry a row.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// What the sensor showed.
    pub fn temperature_k(&self) -> &[f64] {
        &self.temperature_k
    }

    /// What the gyro showed.
    pub fn rate_rad_per_s(&self) -> &[f64] {
        &self.rate_rad_per_s
    }

    /// Of a second thermometer at the bore; None without one.
    pub fn inner_k(&self) -> Option<&[f64]> {
        self.inner_k.as_deref()
    }

    /// Of the air outside the film; None without a thermometer there.
    pub fn ambient_k(&self) -> Option<&[f64]> {
        self.ambient_k.as_deref()
    }

    /// Of each further column the means over the time that a rate is a mean over: what a rate sees of it. The table's rate is such a
    /// mean already: the rates are without it, row by row.
    ///
    /// # Shapes
    /// Columns × rows.
    pub(crate) fn channel_means(&self, rate_mean_s: f64) -> Vec<Vec<f64>> {
        let mean = |channel: &Channel| {
            if channel.name == TABLE_RATE {
                channel.values.clone()
            } else {
                trailing_means(&self.times_s, &channel.values, rate_mean_s)
            }
        };
        self.channels.iter().map(mean).collect()
    }

    /// Further columns, in the file's order.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Thermometers at layers, counted from 1 innermost, with what they showed [°C].
    pub(crate) fn layer_sensors(&self) -> impl Iterator<Item = (usize, &Channel)> {
        let of = |channel: &Channel| {
            channel.name.strip_prefix(LAYER_CHANNEL.0)?.strip_suffix(LAYER_CHANNEL.1)?.parse::<usize>().ok()
        };
        self.channels.iter().filter_map(move |channel| Some((of(channel)?, channel)))
    }

    /// Single values of temperature and rate that do not belong to their neighbours.
    pub fn gross_errors(&self) -> Vec<GrossError> {
        gross_errors_of(&self.temperature_k, &self.rate_rad_per_s)
    }

    /// Row by row what every record has.
    pub(crate) fn each_row(&self) -> impl Iterator<Item = RecordRow> {
        let table = self.channels.iter().find(|c| c.name == TABLE_RATE).map(|c| c.values.as_slice());
        (0..self.rows()).map(move |i| RecordRow {
            time_s: self.times_s[i],
            temperature_k: self.temperature_k[i],
            rate_rad_per_s: self.rate_rad_per_s[i],
            table_rad_per_s: table.map(|t| rad_per_s_from_deg_per_h(t[i])),
        })
    }

    /// The same record without some of its rows; they become gaps.
    ///
    /// # Errors
    /// Too few rows left.
    pub fn without_rows(&self, rows: &[usize]) -> Result<Self, RecordError> {
        let mut kept = vec![true; self.rows()];
        for &row in rows {
            if let Some(keep) = kept.get_mut(row) {
                *keep = false;
            }
        }
        self.each_column(|values| values.iter().zip(&kept).filter(|(_, keep)| **keep).map(|(v, _)| *v).collect())
    }

    /// Some rows in a row.
    ///
    /// # Errors
    /// Too few rows left.
    pub(crate) fn stretch(&self, rows: std::ops::Range<usize>) -> Result<Self, RecordError> {
        self.each_column(|values| values[rows.clone()].to_vec())
    }

    /// With every column cut in the same way.
    fn each_column(&self, keep: impl Fn(&[f64]) -> Vec<f64>) -> Result<Self, RecordError> {
        let mut record =
            Self::new(self.name.clone(), keep(&self.times_s), keep(&self.temperature_k), keep(&self.rate_rad_per_s))?;
        record.inner_k = self.inner_k.as_deref().map(&keep);
        record.ambient_k = self.ambient_k.as_deref().map(&keep);
        record.channels =
            self.channels.iter().map(|c| Channel { name: c.name.clone(), values: keep(&c.values) }).collect();
        Ok(record)
    }

    /// Intervals between rows that are at least twice the usual one: the row after the gap and its length.
    pub fn gaps(&self) -> Vec<(usize, f64)> {
        let usual_s = self.interval_s();
        let steps = self.times_s.windows(2).enumerate().map(|(i, w)| (i + 1, w[1] - w[0]));
        steps.filter(|(_, step_s)| *step_s >= 2.0 * usual_s).collect()
    }

    /// Rows that are another record's as well, none where no stretch of rows is the same: noise does not repeat.
    pub(crate) fn shared_with(&self, other: &Self) -> Option<SharedRows> {
        let theirs: HashSet<u64> = other.stretches().flatten().collect();
        let begins: Vec<usize> =
            self.stretches().enumerate().filter(|(_, s)| s.is_some_and(|s| theirs.contains(&s))).map(|s| s.0).collect();
        let first = *begins.first()?;
        // Stretches overlap: each adds what it has before the next one begins.
        let rows = begins.windows(2).map(|b| STRETCH.min(b[1] - b[0])).sum::<usize>() + STRETCH;
        Some(SharedRows { from_s: self.times_s[first], rows })
    }

    /// What readings and rates of each stretch of rows are, as one number; none where rates take too few values to be told from others.
    fn stretches(&self) -> impl Iterator<Item = Option<u64>> {
        self.temperature_k.windows(STRETCH).zip(self.rate_rad_per_s.windows(STRETCH)).map(|(readings, rates)| {
            let values: BTreeSet<u64> =
                rates.iter().filter(|rate| rate.is_finite()).map(|rate| rate.to_bits()).collect();
            let mut all = DefaultHasher::new();
            readings.iter().chain(rates).for_each(|value| value.to_bits().hash(&mut all));
            (values.len() >= TELLING).then(|| all.finish())
        })
    }

    /// The usual interval between rows: the median.
    pub fn interval_s(&self) -> f64 {
        usual_interval_s(&self.times_s)
    }
}

/// Rows that two records share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SharedRows {
    /// Where they begin in the first record.
    pub(crate) from_s: f64,
    pub(crate) rows: usize,
}

/// Rows in a row whose equality is no chance, and values that rates take in them at least: of six values, as one in 10¹⁸.
const STRETCH: usize = 24;
const TELLING: usize = 6;

/// The median of the intervals between at least two times.
pub(crate) fn usual_interval_s(times_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps[steps.len() / 2]
}

/// As [`Record::gross_errors`], of a stretch of rows.
pub(crate) fn gross_errors_of(temperature_k: &[f64], rate_rad_per_s: &[f64]) -> Vec<GrossError> {
    let find = |values: &[f64], column: &'static str| -> Vec<GrossError> {
        let changes: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).collect();
        let floor = FLOOR_FACTOR * robust_deviation(&changes);
        let rows = gross_errors(values, NEIGHBOURS, SPREAD_FACTOR, floor);
        rows.into_iter().map(|row| GrossError { row, column }).collect()
    };
    let mut found = find(temperature_k, "temperature");
    found.extend(find(rate_rad_per_s, "rate"));
    found.sort_by_key(|e| e.row);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_sees_the_mean_of_a_column_but_of_the_table_what_was_taken_off_it() {
        let times_s: Vec<f64> = (0..6).map(|i| 10.0 * f64::from(i)).collect();
        let values = vec![0.0, 0.0, 100.0, 100.0, 0.0, 0.0];
        let record = Record::new("x", times_s, vec![300.0; 6], vec![0.0; 6]).unwrap();
        let channel = |name: &str| Channel { name: name.to_owned(), values: values.clone() };
        let record = record.with_channel(channel("supply_v")).unwrap().with_channel(channel(TABLE_RATE)).unwrap();
        let means = record.channel_means(10.0);
        assert_eq!(means[0], [0.0, 0.0, 50.0, 100.0, 50.0, 0.0]);
        assert_eq!(means[1], values);
    }

    #[test]
    fn gross_errors_of_a_ramp_are_found_and_can_be_left_out() {
        let times_s: Vec<f64> = (0..200).map(f64::from).collect();
        let temperature_k: Vec<f64> = times_s.iter().map(|t| 290.0 + 0.02 * t.min(100.0)).collect();
        let mut rate: Vec<f64> = (0..200).map(|i| 1e-6 * f64::from(i % 7)).collect();
        rate[50] = 1.0;
        let mut spoilt = temperature_k.clone();
        spoilt[120] = 0.0;
        let record = Record::new("x", times_s, spoilt, rate).unwrap();
        let found = record.gross_errors();
        assert_eq!(found, [GrossError { row: 50, column: "rate" }, GrossError { row: 120, column: "temperature" }]);
        let rows: Vec<usize> = found.iter().map(|e| e.row).collect();
        let clean = record.without_rows(&rows).unwrap();
        assert_eq!(clean.rows(), 198);
        assert_eq!(clean.gaps(), [(50, 2.0), (119, 2.0)]);
    }

    #[test]
    fn rows_of_another_record_are_found_wherever_they_stand() {
        // Rates of two digits, as a coarse logger has them.
        let record = |name: &str, rows: std::ops::Range<u64>| {
            let noise = |i: u64| ((i * 2_654_435_761) % 97) as f64;
            let times_s = rows.clone().map(|i| 10.0 * (i - rows.start) as f64).collect();
            let temperature_k = rows.clone().map(|i| 290.0 + (i / 50) as f64).collect();
            Record::new(name, times_s, temperature_k, rows.map(|i| 1e-7 * noise(i)).collect()).unwrap()
        };
        let (whole, other) = (record("whole", 0..400), record("other", 1000..1400));
        assert_eq!(whole.shared_with(&other), None);
        assert_eq!(whole.shared_with(&whole.clone()), Some(SharedRows { from_s: 0.0, rows: 400 }));
        // A cut of it, with a clock of its own, and one that overlaps.
        let cut = record("cut", 150..260);
        assert_eq!(cut.shared_with(&whole), Some(SharedRows { from_s: 0.0, rows: 110 }));
        assert_eq!(whole.shared_with(&cut), Some(SharedRows { from_s: 1500.0, rows: 110 }));
        let after = record("after", 370..700);
        assert_eq!(whole.shared_with(&after), Some(SharedRows { from_s: 3700.0, rows: 30 }));
        // What does not change is the same everywhere and says nothing.
        let still = Record::new("still", whole.times_s.clone(), vec![290.0; 400], vec![0.0; 400]).unwrap();
        assert_eq!(still.shared_with(&still.clone()), None);
    }
}
