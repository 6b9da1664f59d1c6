//! What is taken to be likely of a chamber, a sensor and a gyro before any record is read: one table, a reason each.
//!
//! All are positive and have a log-normal prior: a median and the standard deviation of the logarithm.

/// A number that describes the chamber, the sensor or the gyro, not the coil.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Quantity {
    /// Film between air and pack \[W/(m²K)\].
    Film,
    /// White noise of one reading of the sensor, besides its resolution \[K\].
    ReadingNoise,
    /// … of a thermometer at the bore, and of one in the air \[K\].
    InnerNoise,
    AmbientNoise,
    /// White noise of one rate \[rad/s\].
    RateNoise,
    /// Density of the noise that drives the air's slope, at rest and where the readings bend \[K²/s³\].
    RestNoise,
    BendNoise,
    /// Turbulence: an Ornstein–Uhlenbeck process's size \[K\] and time \[s\].
    TurbulenceSize,
    TurbulenceTime,
    /// A compressor's ripple: a damped stochastic oscillator's size \[K\], period and coherence time \[s\].
    RippleSize,
    RipplePeriod,
    RippleCoherence,
    /// Slow wander of the gyro itself: its size over that of the white noise of one rate, and its time \[s\].
    WanderShare,
    WanderTime,
    /// Wander that no gyro of this noise should have: its size \[rad/s\] and time \[s\].
    DriftSize,
    DriftTime,
    /// A cycle that no part of the model makes: its size \[rad/s\] and period \[s\].
    CycleSize,
    CyclePeriod,
    /// Deviation of the air's slope where a record begins \[K/s\]; what pack and sensor lag behind it follows.
    StartSlope,
    /// One over the angular frequency with which a controlled chamber's air follows its set point \[s\]; only where it does.
    ControlTime,
    /// The damping ratio with which it does.
    ControlDamping,
    /// Time in which the air of a stage approaches its set point, its slope dying away \[s\]; only where the air does.
    ApproachTime,
    /// Time in which the air of a stage takes on the slope that a step asks for \[s\]; only where it does so with a delay.
    OnsetTime,
    /// The film while it is switched over the usual one; only where it is.
    FilmRatio,
}

/// One line of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Prior {
    pub(crate) quantity: Quantity,
    /// In SI; relative to the record's own noise floor where `relative`.
    pub(crate) median: f64,
    /// Of the natural logarithm.
    pub(crate) deviation: f64,
    pub(crate) relative: bool,
    /// What is smaller, or larger, is not this any more; multiples of the noise where it is one.
    pub(crate) least: f64,
    pub(crate) most: f64,
    pub(crate) reason: &'static str,
}

/// Every prior of the chamber.
pub(crate) const PRIORS: [Prior; 24] = [
    line(Quantity::Film, 25.0, 0.8, "free to moderately forced convection in a chamber: 8 … 80 W/(m²K)"),
    line(Quantity::ReadingNoise, 0.005, 1.0, "platinum sensors and their bridges read to a few millikelvin"),
    line(Quantity::InnerNoise, 0.005, 1.0, "as the sensor"),
    line(Quantity::AmbientNoise, 0.05, 1.2, "air at one place is not the air everywhere"),
    relative(
        Quantity::RateNoise,
        1.0,
        1.2,
        "the floor of short windows, from above: a ripple that the coil sees adds to it",
    ),
    line(Quantity::RestNoise, 1e-9, 3.0, "a controlled chamber between changes of its set point"),
    line(Quantity::BendNoise, 2e-7, 2.0, "ramps of 1 K/min that begin and end within a minute"),
    line(Quantity::TurbulenceSize, 0.04, 1.2, "hundredths of a kelvin where a fan blows"),
    line(Quantity::TurbulenceTime, 40.0, 0.8, "eddies of the size of the chamber, tens of seconds"),
    line(Quantity::RippleSize, 0.08, 1.2, "a tenth of a kelvin from a compressor or a valve"),
    line(Quantity::RipplePeriod, 200.0, 0.6, "switching periods of one to ten minutes"),
    line(Quantity::RippleCoherence, 600.0, 1.0, "a few periods: switching depends on the load"),
    Prior {
        most: 1.0,
        ..line(Quantity::WanderShare, 0.15, 0.8, "flicker of gyros lies under the white noise of a row of seconds")
    },
    line(Quantity::WanderTime, 1500.0, 1.2, "flicker is nearly even over the decades that a record sees"),
    Prior {
        least: 0.5,
        ..relative(
            Quantity::DriftSize,
            1.0,
            1.2,
            "of the size of the noise: up to half of it is a gyro's flicker, larger would be seen by eye",
        )
    },
    Prior {
        least: 100.0,
        ..line(
            Quantity::DriftTime,
            1500.0,
            1.2,
            "as the gyro's wander; what is faster is air that readings do not show",
        )
    },
    relative(Quantity::CycleSize, 2.0, 1.2, "as the drift"),
    line(Quantity::CyclePeriod, 5000.0, 0.8, "below a record's length, above what an air conditioning makes"),
    line(Quantity::StartSlope, 2e-4, 2.0, "a record begins at rest, or in a ramp of up to a kelvin or two a minute"),
    Prior {
        least: 5.0,
        ..line(
            Quantity::ControlTime,
            80.0,
            0.8,
            "controllers of chambers settle within half a minute to several minutes",
        )
    },
    Prior {
        least: 0.1,
        most: 3.0,
        ..line(Quantity::ControlDamping, 0.7, 0.4, "controllers are tuned to overshoot a little")
    },
    line(Quantity::ApproachTime, 90.0, 0.8, "thermoelectric stages settle within half a minute to several minutes"),
    Prior {
        least: 0.5,
        ..line(Quantity::OnsetTime, 4.0, 1.0, "plates between a thermoelectric element and the air, seconds")
    },
    line(Quantity::FilmRatio, 1.0, 0.7, "a fan makes twice or thrice of still air's film, or stops doing so"),
];

const fn line(quantity: Quantity, median: f64, deviation: f64, reason: &'static str) -> Prior {
    Prior { quantity, median, deviation, relative: false, least: 0.0, most: f64::INFINITY, reason }
}

const fn relative(quantity: Quantity, median: f64, deviation: f64, reason: &'static str) -> Prior {
    Prior { quantity, median, deviation, relative: true, least: 0.0, most: f64::INFINITY, reason }
}

impl Quantity {
    /// Its key in files, unit and all.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Film => "surface_film_w_per_m2_k",
            Self::ReadingNoise => "reading_noise_k",
            Self::InnerNoise => "inner_noise_k",
            Self::AmbientNoise => "ambient_noise_k",
            Self::RateNoise => "rate_noise_deg_per_h",
            Self::RestNoise => "rest_noise_k2_per_s3",
            Self::BendNoise => "bend_noise_k2_per_s3",
            Self::TurbulenceSize => "turbulence_k",
            Self::TurbulenceTime => "turbulence_s",
            Self::RippleSize => "ripple_k",
            Self::RipplePeriod => "ripple_period_s",
            Self::RippleCoherence => "ripple_coherence_s",
            Self::WanderShare => "wander_per_white_noise",
            Self::WanderTime => "wander_s",
            Self::DriftSize => "drift_deg_per_h",
            Self::DriftTime => "drift_s",
            Self::CycleSize => "cycle_deg_per_h",
            Self::CyclePeriod => "cycle_period_s",
            Self::StartSlope => "start_slope_k_per_s",
            Self::ControlTime => "control_s",
            Self::ControlDamping => "control_damping",
            Self::ApproachTime => "approach_s",
            Self::OnsetTime => "approach_onset_s",
            Self::FilmRatio => "switched_film_over_usual",
        }
    }

    /// What the air of one day is.
    pub(super) const AIR: [Self; 13] = [
        Self::RestNoise,
        Self::BendNoise,
        Self::TurbulenceSize,
        Self::TurbulenceTime,
        Self::RippleSize,
        Self::RipplePeriod,
        Self::RippleCoherence,
        Self::StartSlope,
        Self::ControlTime,
        Self::ControlDamping,
        Self::ApproachTime,
        Self::OnsetTime,
        Self::FilmRatio,
    ];

    /// Whether it is an angular rate, in SI rad/s.
    pub(crate) fn is_rate(self) -> bool {
        matches!(self, Self::RateNoise | Self::DriftSize | Self::CycleSize)
    }

    pub(crate) fn prior(self) -> &'static Prior {
        let found = PRIORS.iter().find(|p| p.quantity == self);
        found.unwrap_or(&PRIORS[0])
    }

    /// Whether it may be learned from one record for the next. What a stage does behind a step, or a fan, is of one record's day, as its kinks are;
    /// what all records share is learned by itself.
    pub(crate) fn is_learned(self) -> bool {
        !self.is_shared()
            && !matches!(
                self,
                Self::ControlTime | Self::ControlDamping | Self::ApproachTime | Self::OnsetTime | Self::FilmRatio
            )
    }

    /// Whether it is one number for all records.
    pub(crate) fn is_shared(self) -> bool {
        self == Quantity::Film
    }
}

/// How often a chamber's air breaks from one ramp into another, and the mean square of the change of its slope
/// \[(K/s)²\]: every fifty minutes by 2 K/min, so much wider than one record shows that the next one breaks within it.
pub(crate) const BREAKS_PER_S: f64 = 1.0 / 3000.0;
pub(crate) const BREAK_K2_PER_S2: f64 = 1e-3;

/// Standard deviation of the pack's first temperature about the first reading \[K\].
pub(super) const START_K: f64 = 1.0;
/// … of what pack and sensor differ from the air at the start, besides what a slope makes \[K\]; with a slope they differ by
/// what it does in a time such as a pack behind a film has \[s\], each mode by this share of it of its own.
pub(super) const START_APART_K: f64 = 0.1;
pub(super) const START_APART_S: f64 = 150.0;
pub(super) const START_APART_MODES: f64 = 0.1;
/// … of the rate's offset about the record's median [rad/s]: the earth's rate is 7.3e-5.
pub(super) const OFFSET_RAD_PER_S: f64 = 2.5e-5;

/// One chamber in fifty has a fan that is switched while a record runs: natural logarithm.
pub(super) const SWITCHED_LOG: f64 = -3.912;

/// One measurement in a thousand is a gross error, of tens of deviations.
pub(super) const GROSS_SHARE: f64 = 1e-3;
pub(super) const GROSS_FACTOR: f64 = 30.0;
/// An air of straight lines turns some ten times in a record of 1500 rows.
pub(super) const KINKS_PER_ROW: f64 = 1.0 / 150.0;

/// What a controller costs a record of so many rows in log prior: its time and its damping ratio cost what a kink's place and height do.
pub(super) fn price_of_controller(rows: usize) -> f64 {
    (rows as f64).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantity_has_one_prior_and_a_reason() {
        for (place, prior) in PRIORS.iter().enumerate() {
            assert!(std::ptr::eq(prior.quantity.prior(), &PRIORS[place]) || *prior.quantity.prior() == *prior);
            assert_eq!(PRIORS.iter().filter(|p| p.quantity == prior.quantity).count(), 1);
            assert!(prior.least < prior.median && prior.median < prior.most);
            assert!(prior.median > 0.0 && prior.deviation > 0.0 && prior.reason.len() > 10);
        }
        assert!((SWITCHED_LOG - 0.02_f64.ln()).abs() < 1e-3);
    }
}
