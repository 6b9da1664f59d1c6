//! A measurement: time, the sensor's temperature, the gyro's rate, and whatever else was logged.

use thiserror::Error;

/// A further column of a record, by its name.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    pub name: String,
    pub values: Vec<f64>,
}

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

#[derive(Debug, Error, Clone, PartialEq)]
pub enum RecordError {
    #[error("a record needs at least {needed} rows, found {found}")]
    TooShort { needed: usize, found: usize },
    #[error("column {column} has {found} values where time_s has {expected}")]
    Shape { column: String, expected: usize, found: usize },
    #[error("time_s must increase strictly, row {row} ({found_s} s) does not")]
    Time { row: usize, found_s: f64 },
    #[error("column {column} holds no finite number in row {row}")]
    NotFinite { column: &'static str, row: usize },
}

/// Fewer rows than this describe no record.
pub const MIN_ROWS: usize = 3;

impl Record {
    /// # Errors
    /// Too few rows, columns of unequal length, times that do not increase, needed numbers that are not finite.
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

    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn rows(&self) -> usize {
        self.times_s.len()
    }

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

    pub fn inner_k(&self) -> Option<&[f64]> {
        self.inner_k.as_deref()
    }

    pub fn ambient_k(&self) -> Option<&[f64]> {
        self.ambient_k.as_deref()
    }

    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The usual interval between rows: the median.
    pub fn interval_s(&self) -> f64 {
        let mut steps: Vec<f64> = self.times_s.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        steps[steps.len() / 2]
    }
}
