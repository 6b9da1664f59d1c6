//! Noise told apart: what the gyro makes, what the air does unseen, what the model is wrong by; and what would help.
//!
//! ```text
//! rate − predicted from readings = white + wander + unresolved air + model error
//! unresolved air² = ⟨S⟩ − white² − wander²,   model error² = ⟨(v − v̄)²⟩ − ⟨S⟩,   v, S: innovations of the unseen rate
//! ```

use super::filter::RATE;
use super::fit::Fit;
use super::layout::{Numbers, Parts};
use super::prior::Quantity;
use crate::numeric::order::sort_ascending;

use super::shows::Shows;
use super::{Chamber, ChamberError, Place};

/// What the rate of a record consists of beside the coil [rad/s].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Noise {
    /// Of one value as logged.
    pub(crate) white_rad_per_s: f64,
    /// As the fit has it, which takes its model to be right.
    pub(crate) white_fit_error_rad_per_s: f64,
    /// Slow wander of the gyro, drift and cycle included.
    pub(crate) wander_rad_per_s: f64,
    /// What the air does that the sensor cannot see, on a row of the chamber.
    pub(crate) unresolved_air_rad_per_s: f64,
    /// What is beyond all that; 0 where the rate differs from the prediction by no more than is expected.
    pub(crate) model_error_rad_per_s: f64,
    /// Root mean square of the innovations of the rate in units of their expected deviation: 1 for a right model.
    pub(crate) whiteness: f64,
    /// What each change of the measurement would leave of the unresolved air, most helpful first.
    pub(crate) remedies: Vec<(Remedy, f64)>,
}

impl Noise {
    /// Standard error of the white noise: that of the fit, and as much of the model's error as the fit may have taken for white noise.
    pub(crate) fn white_standard_error_rad_per_s(&self) -> f64 {
        let taken = self.model_error_rad_per_s.min(self.white_rad_per_s).powi(2) / (2.0 * self.white_rad_per_s);
        self.white_fit_error_rad_per_s.hypot(taken)
    }
}

/// A change of the measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Remedy {
    /// A sensor of a tenth of the noise.
    QuieterSensor,
    /// Readings that are not rounded.
    FinerResolution,
    /// A sensor without lag in the air, before the film.
    SensorInAir,
    /// A chamber whose air ripples and is turbulent half as much.
    CalmerAir,
}

impl Remedy {
    pub(crate) const ALL: [Remedy; 4] =
        [Remedy::QuieterSensor, Remedy::FinerResolution, Remedy::SensorInAir, Remedy::CalmerAir];

    pub(super) fn apply(self, parts: &mut Parts, numbers: &mut Numbers) {
        let mut scale = |quantity: Quantity, factor: f64| numbers.set(quantity, factor * numbers.get(quantity));
        match self {
            Remedy::QuieterSensor => scale(Quantity::ReadingNoise, 0.1),
            Remedy::FinerResolution => {}
            Remedy::SensorInAir => {
                parts.shows = Shows::Air;
                parts.lag_s = 0.0;
            }
            Remedy::CalmerAir => {
                scale(Quantity::TurbulenceSize, 0.5);
                scale(Quantity::RippleSize, 0.5);
            }
        }
    }
}

/// Rows after which the start is forgotten.
const SETTLING_ROWS: usize = 30;

impl Chamber<'_> {
    /// White noise, wander, unresolved air and model error of a fitted record.
    ///
    /// # Errors
    /// As [`Chamber::held_out`].
    pub(crate) fn noise(&self, fit: &Fit, record: usize) -> Result<Noise, ChamberError> {
        let numbers = self.numbers_for(fit, record);
        let white = numbers.get(Quantity::RateNoise);
        let place = Place::Quantity { quantity: Quantity::RateNoise, record: Some(record) };
        let error = fit.value(place).map_or(f64::NAN, |(_, error)| error);
        let mut wander = (white * numbers.get(Quantity::WanderShare)).powi(2);
        if fit.assumed.drift {
            wander += numbers.get(Quantity::DriftSize).powi(2);
        }
        if fit.assumed.cycle {
            wander += numbers.get(Quantity::CycleSize).powi(2);
        }
        let own = white * white / self.averaged(record) as f64 + wander;
        let unseen = self.unseen(fit, &numbers, record, None)?;
        let (rows, innovations) = self.pass(fit, &numbers, record, true, None)?;
        let (mut squares, mut rates) = (0.0, 0);
        for ((_, measurement), i) in rows.iter().zip(&innovations) {
            if *measurement == RATE {
                squares += i.value * i.value / i.variance;
                rates += 1;
            }
        }
        let air = |variance: f64| (variance - own).max(0.0).sqrt();
        let mut remedies = Vec::new();
        for remedy in Remedy::ALL {
            remedies.push((remedy, air(self.unseen(fit, &numbers, record, Some(remedy))?.expected)));
        }
        sort_ascending(&mut remedies, |item| item.1);
        Ok(Noise {
            white_rad_per_s: white,
            white_fit_error_rad_per_s: error,
            wander_rad_per_s: wander.sqrt(),
            unresolved_air_rad_per_s: air(unseen.expected),
            model_error_rad_per_s: (unseen.found - unseen.expected).max(0.0).sqrt(),
            whiteness: (squares / f64::from(rates.max(1))).sqrt(),
            remedies,
        })
    }

    /// Variance of the rate about what readings so far make of it, as expected and as found.
    fn unseen(
        &self,
        fit: &Fit,
        numbers: &Numbers,
        record: usize,
        otherwise: Option<Remedy>,
    ) -> Result<Unseen, ChamberError> {
        let (places, innovations) = self.pass(fit, numbers, record, false, otherwise)?;
        let (mut expected, mut sum, mut squares, mut count) = (0.0, 0.0, 0.0, 0);
        for ((row, measurement), i) in places.into_iter().zip(innovations) {
            if measurement == RATE && row >= SETTLING_ROWS {
                expected += i.variance;
                sum += i.value;
                squares += i.value * i.value;
                count += 1;
            }
        }
        let count = f64::from(count.max(1));
        Ok(Unseen { expected: expected / count, found: (squares - sum * sum / count) / count })
    }
}

struct Unseen {
    expected: f64,
    found: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_noise_is_as_uncertain_as_its_fit_and_what_the_model_is_wrong_by() {
        let noise = |model_error_rad_per_s: f64| Noise {
            white_rad_per_s: 2e-7,
            white_fit_error_rad_per_s: 3e-8,
            wander_rad_per_s: 0.0,
            unresolved_air_rad_per_s: 0.0,
            model_error_rad_per_s,
            whiteness: 1.0,
            remedies: Vec::new(),
        };
        let error = |model_error: f64| noise(model_error).white_standard_error_rad_per_s();
        assert_eq!(error(0.0), 3e-8);
        // (1.6e-7)²/(2 · 2e-7) = 6.4e-8.
        assert!((error(1.6e-7) - 3e-8_f64.hypot(6.4e-8)).abs() < 1e-20);
        // No more can be taken for white noise than there is: half of it is the error then.
        assert!((error(9e-7) - 3e-8_f64.hypot(1e-7)).abs() < 1e-20);
    }
}
