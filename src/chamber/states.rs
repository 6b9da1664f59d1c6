//! The pack over each row of a record along a smoothed course: what effects that depend on more than rates would see.

use super::fit::Fit;
use super::known::Reference;
use super::{Chamber, ChamberError};

/// The layers and the air over the rows' windows.
///
/// # Shapes
/// One entry a row of the chamber; rates are zero at the first row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RowStates {
    pub(crate) times_s: Vec<f64>,
    /// Layers × rows, innermost layer first.
    pub(crate) temperatures_k: Vec<Vec<f64>>,
    pub(crate) rates_k_per_s: Vec<Vec<f64>>,
    pub(crate) ambient_k: Vec<f64>,
    pub(crate) ambient_rate_k_per_s: Vec<f64>,
    /// What of them the layer gains of the fit's own model make.
    pub(crate) thermal_rate_rad_per_s: Vec<f64>,
    /// Further columns of the record by name, on average over each row.
    pub(crate) channels: Vec<(String, Vec<f64>)>,
}

impl Chamber<'_> {
    /// Along a course of one of its records, such as that of [`Chamber::prediction`].
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn states(&self, fit: &Fit, record: usize, course: &Reference) -> Result<RowStates, ChamberError> {
        let series = &self.observed[record].series;
        let rows = series.times_s.len();
        let mut temperatures_k = vec![vec![0.0; rows]; course.layers];
        let mut rates_k_per_s = vec![vec![0.0; rows]; course.layers];
        let (mut ambient_k, mut ambient_rate_k_per_s) = (vec![0.0; rows], vec![0.0; rows]);
        let mut start = Vec::new();
        for k in 0..rows {
            let end = course.row(k);
            let air = if k == 0 {
                start.clear();
                start.extend_from_slice(end);
                course.air_k[0]
            } else {
                course.at_window_start(series, k, &mut start)
            };
            let window_s = series.shapes[series.shape_of(k)].window_s;
            let before_s = if k > 0 { series.times_s[k] - series.times_s[k - 1] } else { 1.0 };
            let window_s = if window_s > 0.0 { window_s } else { before_s };
            for layer in 0..course.layers {
                temperatures_k[layer][k] = series.reference_k + 0.5 * (start[layer] + end[layer]);
                rates_k_per_s[layer][k] = (end[layer] - start[layer]) / window_s;
            }
            ambient_k[k] = series.reference_k + 0.5 * (air + course.air_k[k]);
            ambient_rate_k_per_s[k] = (course.air_k[k] - air) / window_s;
        }
        let gains = self.layer_gains(fit)?;
        let thermal = |k: usize| gains.iter().zip(&rates_k_per_s).map(|(g, r)| g * r[k]).sum();
        let thermal_rate_rad_per_s = (0..rows).map(thermal).collect();
        let names = self.observed[record].channels.iter().cloned();
        let channels = names.zip(series.columns.iter().cloned()).collect();
        Ok(RowStates {
            times_s: series.times_s.clone(),
            temperatures_k,
            rates_k_per_s,
            ambient_k,
            ambient_rate_k_per_s,
            thermal_rate_rad_per_s,
            channels,
        })
    }

    /// dΩ/dṪ_j of the coil.
    fn layer_gains(&self, fit: &Fit) -> Result<Vec<f64>, ChamberError> {
        let rate = crate::rate::RateModel::new(&fit.assumed.model, &fit.assumed.pattern, &[])?;
        let scale = rate.scale_per_m2() * rate.coil().fibre().path_per_k();
        Ok(rate.weights().total_m2().iter().map(|w| w * scale).collect())
    }
}
