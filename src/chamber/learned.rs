//! What a fit says of film, offset and chamber, where the records determine it.

use super::backward::{Visited, backward};
use super::fit::Fit;
use super::layout::Layout;
use super::parameter::Place;
use super::prior::{PRIORS, Quantity};
use super::{Chamber, ChamberError};

/// A number with its standard error, both in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimate {
    pub(crate) value: f64,
    pub(crate) standard_error: f64,
}

/// What records say of what surrounds the coil, sensor and gyro included.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Learned {
    /// Film between air and pack \[W/(m²K)\]; None where the model states it or the records don't determine it.
    pub(crate) film_w_per_m2_k: Option<Estimate>,
    /// Mean offset of the rates \[rad/s\]; its error counts how records differ.
    pub(crate) offset_rad_per_s: Option<Estimate>,
    /// Of the chamber, sensor and gyro: geometric mean over the records and its error.
    pub(crate) numbers: Vec<(Quantity, Estimate)>,
    /// How many records it was learned from.
    pub(crate) records: usize,
}

/// Records determine a number whose error is at most this share of what was known of it before.
const DETERMINED: f64 = 0.5;

impl Chamber<'_> {
    /// What a fit's records say of what surrounds the coil.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn learned(&self, fit: &Fit) -> Result<Learned, ChamberError> {
        let determined = |quantity: Quantity, relative: f64| relative < DETERMINED * quantity.prior().deviation;
        let film = fit.value(Place::Quantity { quantity: Quantity::Film, record: None });
        let film_w_per_m2_k = film
            .filter(|(value, error)| determined(Quantity::Film, error / value))
            .map(|(value, standard_error)| Estimate { value, standard_error });
        let mut numbers = Vec::new();
        for quantity in PRIORS.iter().map(|p| p.quantity).filter(|q| q.is_learned()) {
            let found: Vec<(f64, f64)> = fit
                .records
                .iter()
                .filter_map(|&r| fit.value(Place::Quantity { quantity, record: Some(r) }))
                .map(|(value, error)| (value.ln(), error / value))
                .filter(|(_, relative)| determined(quantity, *relative))
                .collect();
            if found.len() == fit.records.len()
                && let Some(mean) = combined(&found)
            {
                let value = mean.value.exp();
                numbers.push((quantity, Estimate { value, standard_error: value * mean.standard_error }));
            }
        }
        let offsets: Result<Vec<(f64, f64)>, ChamberError> =
            fit.records.iter().map(|&r| self.offset(fit, r).map(|e| (e.value, e.standard_error))).collect();
        let offset_rad_per_s = combined(&offsets?);
        Ok(Learned { film_w_per_m2_k, offset_rad_per_s, numbers, records: fit.records.len() })
    }

    /// A record's offset.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn offset(&self, fit: &Fit, record: usize) -> Result<Estimate, ChamberError> {
        let (side, system, trace) = self.traced(fit, record)?;
        let series = &self.observed[record].series;
        let place = Layout::new(&side.parts(&fit.assumed), series).offset();
        let n = system.size;
        let mut found = Estimate { value: f64::NAN, standard_error: f64::NAN };
        backward(&system, &series.rows, &trace, &mut |visited| {
            let Visited::Row { row: 0, r, information } = visited else { return };
            let covariance = &trace.gains[trace.gains_of[0] as usize].covariance;
            let own = &covariance[place * n..(place + 1) * n];
            let correction: f64 = own.iter().zip(r).map(|(p, r)| p * r).sum();
            found.value = trace.means[place] + correction;
            found.standard_error = (own[place] - information.of(own)).max(0.0).sqrt();
        });
        Ok(found)
    }
}

/// Weighted mean; where values differ by more than their errors, the error counts that.
fn combined(values: &[(f64, f64)]) -> Option<Estimate> {
    let weights: Vec<f64> = values.iter().map(|(_, error)| error.powi(-2)).collect();
    let whole: f64 = weights.iter().sum();
    if !(whole > 0.0 && whole.is_finite()) {
        return None;
    }
    let value = values.iter().zip(&weights).map(|((v, _), w)| w * v).sum::<f64>() / whole;
    let spread = values.iter().zip(&weights).map(|((v, _), w)| w * (v - value).powi(2)).sum::<f64>();
    let freedom = (values.len().saturating_sub(1)).max(1) as f64;
    Some(Estimate { value, standard_error: ((spread / freedom).max(1.0) / whole).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_that_differ_widen_the_error_of_their_mean() {
        let same = combined(&[(1.0, 0.1), (1.1, 0.1)]).unwrap();
        assert!((same.value - 1.05).abs() < 1e-12 && (same.standard_error - 0.1 / 2f64.sqrt()).abs() < 1e-12);
        // Half the difference, which is the standard error of the mean of two.
        let apart = combined(&[(1.0, 0.1), (3.0, 0.1)]).unwrap();
        assert!((apart.standard_error - 1.0).abs() < 1e-12, "{apart:?}");
        assert_eq!(combined(&[]), None);
        assert_eq!(combined(&[(1.0, f64::NAN)]), None);
    }
}
