//! Thermometers at layers beside what the model says of those layers.

use crate::predict::{Boundary, PredictError};
use crate::rate::CoilModel;
use crate::record::Record;
use crate::units::kelvin_from_celsius;

/// Reading less model of one thermometer.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SensorMisfit {
    pub(crate) column: String,
    /// Counted from 1 innermost.
    pub(crate) layer: usize,
    /// With a reading.
    pub(crate) rows: usize,
    pub(crate) mean_k: f64,
    pub(crate) rms_k: f64,
    /// With its sign.
    pub(crate) largest_k: f64,
    pub(crate) largest_time_s: f64,
}

/// Rows that are worked out at a time.
const ROWS_AT_A_TIME: usize = 4096;

/// Each thermometer against its layer over the rows' intervals.
///
/// # Errors
/// A layer that the coil lacks.
pub(super) fn misfits(
    model: &CoilModel,
    record: &Record,
    boundary: &Boundary,
) -> Result<Vec<SensorMisfit>, PredictError> {
    let layers = model.coil.layers();
    let sensors: Vec<_> = record.layer_sensors().collect();
    if let Some((layer, channel)) = sensors.iter().find(|(layer, _)| !(1..=layers).contains(layer)) {
        return Err(PredictError::NoSuchLayer { column: channel.name.clone(), layer: *layer, layers });
    }
    let nothing = |(layer, channel): &(usize, &crate::record::Channel)| SensorMisfit {
        column: channel.name.clone(),
        layer: *layer,
        rows: 0,
        mean_k: 0.0,
        rms_k: 0.0,
        largest_k: 0.0,
        largest_time_s: 0.0,
    };
    let mut found: Vec<SensorMisfit> = sensors.iter().map(nothing).collect();
    let mut from = 0;
    while from < record.rows() && !sensors.is_empty() {
        let to = (from + ROWS_AT_A_TIME).min(record.rows());
        let history = boundary.history(record, from..to, model.rate_mean_s);
        for row in 0..history.len() {
            for ((layer, channel), sum) in sensors.iter().zip(&mut found) {
                let off_k = kelvin_from_celsius(channel.values[from + row]) - history.temperatures_k(row)[layer - 1];
                if !off_k.is_finite() {
                    continue;
                }
                (sum.rows, sum.mean_k, sum.rms_k) = (sum.rows + 1, sum.mean_k + off_k, sum.rms_k + off_k * off_k);
                if off_k.abs() > sum.largest_k.abs() {
                    (sum.largest_k, sum.largest_time_s) = (off_k, record.times_s()[from + row]);
                }
            }
        }
        from = to;
    }
    for sum in &mut found {
        let rows = sum.rows.max(1) as f64;
        (sum.mean_k, sum.rms_k) = (sum.mean_k / rows, (sum.rms_k / rows).sqrt());
    }
    Ok(found)
}
