//! Layer temperatures and rates as CSV and as a JSON document.

use serde::Serialize;

use crate::thermal::ThermalHistory;
use crate::units::{c_per_h_from_k_per_s, celsius_from_kelvin};

/// # Shapes
/// One row a time, one column a layer, innermost first; moments are empty where nothing varies along the axis.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct TemperaturesJson {
    pub(crate) model: String,
    /// The profile's or the record's name.
    pub(crate) drive: String,
    pub(crate) times_s: Vec<f64>,
    pub(crate) ambient_c: Vec<f64>,
    pub(crate) temperatures_c: Vec<Vec<f64>>,
    pub(crate) rates_c_per_h: Vec<Vec<f64>>,
    pub(crate) axial_moment_rates_c_per_h: Vec<Vec<f64>>,
}

impl TemperaturesJson {
    pub(crate) fn new(model: &str, drive: &str, history: &ThermalHistory) -> Self {
        let rows = |row: fn(&ThermalHistory, usize) -> &[f64], convert: fn(f64) -> f64| -> Vec<Vec<f64>> {
            (0..history.len()).map(|i| row(history, i).iter().map(|v| convert(*v)).collect()).collect()
        };
        let has_moments = !history.axial_moment_k_per_s.is_empty();
        Self {
            model: model.to_owned(),
            drive: drive.to_owned(),
            times_s: history.times_s.clone(),
            ambient_c: history.ambient_k.iter().map(|k| celsius_from_kelvin(*k)).collect(),
            temperatures_c: rows(ThermalHistory::temperatures_k, celsius_from_kelvin),
            rates_c_per_h: rows(ThermalHistory::rates_k_per_s, c_per_h_from_k_per_s),
            axial_moment_rates_c_per_h: if has_moments {
                rows(ThermalHistory::axial_moments_k_per_s, c_per_h_from_k_per_s)
            } else {
                Vec::new()
            },
        }
    }

    /// One line a time; layers are counted from the spool.
    pub(crate) fn csv(&self) -> String {
        let layers = self.temperatures_c.first().map_or(0, Vec::len);
        let mut header = vec!["time_s".to_owned(), "ambient_c".to_owned()];
        header.extend((1..=layers).map(|j| format!("layer_{j}_c")));
        header.extend((1..=layers).map(|j| format!("layer_{j}_c_per_h")));
        if !self.axial_moment_rates_c_per_h.is_empty() {
            header.extend((1..=layers).map(|j| format!("moment_{j}_c_per_h")));
        }
        let mut text = header.join(",") + "\n";
        for (i, time_s) in self.times_s.iter().enumerate() {
            let temperatures = std::iter::once(&self.ambient_c[i]).chain(&self.temperatures_c[i]);
            let moments = self.axial_moment_rates_c_per_h.get(i).into_iter().flatten();
            let mut cells = vec![format!("{time_s}")];
            cells.extend(temperatures.map(|v| format!("{v:.6}")));
            cells.extend(self.rates_c_per_h[i].iter().chain(moments).map(|v| format!("{v:.6}")));
            text += &(cells.join(",") + "\n");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_history_of_two_layers_is_written_in_celsius_and_celsius_per_hour() {
        let history = ThermalHistory {
            layers: 2,
            times_s: vec![10.0],
            temperature_k: vec![293.15, 294.15],
            rate_k_per_s: vec![0.001, 0.002],
            axial_moment_k_per_s: vec![],
            axial_moment_k: vec![],
            ambient_k: vec![295.15],
            ambient_rate_k_per_s: vec![0.0],
        };
        let csv = TemperaturesJson::new("coil", "ramp", &history).csv();
        let expected = "time_s,ambient_c,layer_1_c,layer_2_c,layer_1_c_per_h,layer_2_c_per_h\n\
                        10,22.000000,20.000000,21.000000,3.600000,7.200000\n";
        assert_eq!(csv, expected);
    }
}
