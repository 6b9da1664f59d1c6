//! The only place where units are converted; everything else in the crate holds SI.
//!
//! Files and screens speak °/h, °C, mm, µm, nm and °C/h, because coil designers do. A number is converted once
//! when it is read and once when it is shown, and its name ends in its unit on both sides.

/// Speed of light in vacuum [m/s], exact by definition of the metre.
pub const LIGHT_SPEED_M_PER_S: f64 = 299_792_458.0;

pub(crate) const SECONDS_PER_HOUR: f64 = 3600.0;
const HOURS_PER_DAY: f64 = 24.0;
const SECONDS_PER_MINUTE: f64 = 60.0;
const DEGREES_PER_RADIAN: f64 = 180.0 / std::f64::consts::PI;
const ZERO_CELSIUS_K: f64 = 273.15;
const MILLI: f64 = 1e-3;
const MICRO: f64 = 1e-6;
const NANO: f64 = 1e-9;

/// The temperature at which the temperature-dependent effects are zero: 20 °C, in kelvin.
pub const REFERENCE_TEMPERATURE_K: f64 = ZERO_CELSIUS_K + 20.0;

/// Converts °/h to rad/s.
pub fn rad_per_s_from_deg_per_h(rate_deg_per_h: f64) -> f64 {
    rate_deg_per_h / DEGREES_PER_RADIAN / SECONDS_PER_HOUR
}

/// Converts rad/s to °/h.
pub fn deg_per_h_from_rad_per_s(rate_rad_per_s: f64) -> f64 {
    rate_rad_per_s * DEGREES_PER_RADIAN * SECONDS_PER_HOUR
}

/// A rate of rotation, held in rad/s and shown in °/h.
///
/// ```
/// use coilwright::units::{RotationRate, rad_per_s_from_deg_per_h};
///
/// let rate = RotationRate { rad_per_s: rad_per_s_from_deg_per_h(1.0862) };
/// assert_eq!(format!("{rate:.3}"), "1.086 °/h");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct RotationRate {
    /// As it is held.
    pub rad_per_s: f64,
}

impl std::fmt::Display for RotationRate {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        deg_per_h_from_rad_per_s(self.rad_per_s).fmt(f)?;
        f.write_str(" °/h")
    }
}

/// Converts °/s to rad/s.
pub fn rad_per_s_from_deg_per_s(rate_deg_per_s: f64) -> f64 {
    rate_deg_per_s / DEGREES_PER_RADIAN
}

/// Converts rad/s to °/s.
pub fn deg_per_s_from_rad_per_s(rate_rad_per_s: f64) -> f64 {
    rate_rad_per_s * DEGREES_PER_RADIAN
}

/// Angle random walk: rad/√s to °/√h.
pub(crate) fn deg_per_sqrt_h_from_rad_per_sqrt_s(walk_rad_per_sqrt_s: f64) -> f64 {
    walk_rad_per_sqrt_s * DEGREES_PER_RADIAN * SECONDS_PER_HOUR.sqrt()
}

/// Rate random walk: rad/s/√s to °/h/√h.
pub(crate) fn deg_per_h_per_sqrt_h_from_rad_per_s_per_sqrt_s(walk_rad_per_s_per_sqrt_s: f64) -> f64 {
    deg_per_h_from_rad_per_s(walk_rad_per_s_per_sqrt_s) * SECONDS_PER_HOUR.sqrt()
}

/// Ramp of the rate: rad/s² to °/h/h.
pub(crate) fn deg_per_h_per_h_from_rad_per_s2(ramp_rad_per_s2: f64) -> f64 {
    deg_per_h_from_rad_per_s(ramp_rad_per_s2) * SECONDS_PER_HOUR
}

pub(crate) fn deg_from_rad(angle_rad: f64) -> f64 {
    angle_rad * DEGREES_PER_RADIAN
}

pub(crate) fn arcsec_from_rad(angle_rad: f64) -> f64 {
    angle_rad * DEGREES_PER_RADIAN * SECONDS_PER_HOUR
}

/// Converts °C to K.
pub fn kelvin_from_celsius(temperature_c: f64) -> f64 {
    temperature_c + ZERO_CELSIUS_K
}

/// Converts K to °C.
pub fn celsius_from_kelvin(temperature_k: f64) -> f64 {
    temperature_k - ZERO_CELSIUS_K
}

/// Converts a ramp from °C/h to K/s.
pub fn k_per_s_from_c_per_h(ramp_c_per_h: f64) -> f64 {
    ramp_c_per_h / SECONDS_PER_HOUR
}

pub(crate) fn c_per_h_from_k_per_s(ramp_k_per_s: f64) -> f64 {
    ramp_k_per_s * SECONDS_PER_HOUR
}

/// Converts a ramp from °C/min to K/s.
pub fn k_per_s_from_c_per_min(ramp_c_per_min: f64) -> f64 {
    ramp_c_per_min / SECONDS_PER_MINUTE
}

pub(crate) fn c_per_min_from_k_per_s(ramp_k_per_s: f64) -> f64 {
    ramp_k_per_s * SECONDS_PER_MINUTE
}

pub(crate) fn h_from_s(duration_s: f64) -> f64 {
    duration_s / SECONDS_PER_HOUR
}

/// Converts s to min.
pub fn min_from_s(duration_s: f64) -> f64 {
    duration_s / SECONDS_PER_MINUTE
}

/// Converts min to s.
pub fn s_from_min(duration_min: f64) -> f64 {
    duration_min * SECONDS_PER_MINUTE
}

pub(crate) fn s_from_days(duration_d: f64) -> f64 {
    s_from_h(duration_d * HOURS_PER_DAY)
}

pub(crate) fn s_from_ms(duration_ms: f64) -> f64 {
    duration_ms / 1e3
}

pub(crate) fn s_from_us(duration_us: f64) -> f64 {
    duration_us / 1e6
}

pub(crate) fn s_from_ns(duration_ns: f64) -> f64 {
    duration_ns / 1e9
}

pub(crate) fn rad_per_s_from_arcsec_per_s(rate_arcsec_per_s: f64) -> f64 {
    rate_arcsec_per_s / DEGREES_PER_RADIAN / SECONDS_PER_HOUR
}

pub(crate) fn celsius_from_fahrenheit(temperature_f: f64) -> f64 {
    (temperature_f - 32.0) / 1.8
}

pub(crate) fn s_from_h(duration_h: f64) -> f64 {
    duration_h * SECONDS_PER_HOUR
}

pub(crate) fn m_from_mm(length_mm: f64) -> f64 {
    length_mm * MILLI
}

pub(crate) fn mm_from_m(length_m: f64) -> f64 {
    length_m / MILLI
}

pub(crate) fn m_from_um(length_um: f64) -> f64 {
    length_um * MICRO
}

pub(crate) fn um_from_m(length_m: f64) -> f64 {
    length_m / MICRO
}

pub(crate) fn m_from_nm(length_nm: f64) -> f64 {
    length_nm * NANO
}

pub(crate) fn nm_from_m(length_m: f64) -> f64 {
    length_m / NANO
}

/// \[Pa\].
pub(crate) fn pa_from_mpa(stress_mpa: f64) -> f64 {
    stress_mpa / MICRO
}

/// \[MPa\].
pub(crate) fn mpa_from_pa(stress_pa: f64) -> f64 {
    stress_pa * MICRO
}

/// Converts a fraction to %.
pub fn percent_from_fraction(fraction: f64) -> f64 {
    fraction * 100.0
}

pub(crate) fn ppm_from_fraction(fraction: f64) -> f64 {
    fraction * 1e6
}

pub(crate) fn fraction_from_ppm(ppm: f64) -> f64 {
    ppm / 1e6
}

pub(crate) fn rad_from_deg(angle_deg: f64) -> f64 {
    angle_deg / DEGREES_PER_RADIAN
}

pub(crate) fn fraction_from_percent(percent: f64) -> f64 {
    percent / 100.0
}

/// The unit in which a user states an effect's parameter; the key's name ends in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// A ratio or a count.
    One,
    /// The number of a layer, counted from 1 innermost.
    Layer,
    /// 1/K.
    PerKelvin,
    /// s.
    Second,
    /// m.
    Metre,
    /// mm.
    Millimetre,
    /// °C.
    Celsius,
    /// K, of a difference.
    Kelvin,
    /// W/m².
    WattPerSquareMetre,
    /// W/(m² K).
    WattPerSquareMetreKelvin,
    /// W/(m K).
    WattPerMetreKelvin,
    /// J/(m² K).
    JoulePerSquareMetreKelvin,
    /// °/h.
    DegPerHour,
    /// (°/h)/K.
    DegPerHourPerKelvin,
    /// (°/h)/K².
    DegPerHourPerSquareKelvin,
    /// (°/h)/(K/s).
    DegPerHourSecondPerKelvin,
    /// °/h for each unit of a further column.
    DegPerHourPerUnit,
    /// °C/h.
    CelsiusPerHour,
    /// ppm.
    PartsPerMillion,
    /// ppm/K.
    PartsPerMillionPerKelvin,
}

impl Unit {
    /// As shown behind a number.
    pub(crate) fn symbol(self) -> &'static str {
        match self {
            Unit::One | Unit::Layer => "1",
            Unit::PerKelvin => "1/K",
            Unit::Second => "s",
            Unit::Metre => "m",
            Unit::Millimetre => "mm",
            Unit::Celsius => "°C",
            Unit::Kelvin => "K",
            Unit::WattPerSquareMetre => "W/m²",
            Unit::WattPerSquareMetreKelvin => "W/(m²K)",
            Unit::WattPerMetreKelvin => "W/(m K)",
            Unit::JoulePerSquareMetreKelvin => "J/(m²K)",
            Unit::DegPerHour => "°/h",
            Unit::DegPerHourPerKelvin => "°/h/K",
            Unit::DegPerHourPerSquareKelvin => "°/h/K²",
            Unit::DegPerHourSecondPerKelvin => "°/h per K/s",
            Unit::DegPerHourPerUnit => "°/h per unit",
            Unit::CelsiusPerHour => "°C/h",
            Unit::PartsPerMillion => "ppm",
            Unit::PartsPerMillionPerKelvin => "ppm/K",
        }
    }

    /// A value as stated by the user, in SI.
    pub fn to_si(self, stated: f64) -> f64 {
        match self {
            Unit::Celsius => kelvin_from_celsius(stated),
            _ => stated * self.scale(),
        }
    }

    /// A value in SI, as stated to the user.
    pub fn from_si(self, si: f64) -> f64 {
        match self {
            Unit::Celsius => celsius_from_kelvin(si),
            _ => si / self.scale(),
        }
    }

    /// A difference or a standard error in SI, as stated to the user (no zero point).
    pub(crate) fn difference_from_si(self, si: f64) -> f64 {
        si / self.scale()
    }

    fn scale(self) -> f64 {
        match self {
            Unit::DegPerHour
            | Unit::DegPerHourPerKelvin
            | Unit::DegPerHourPerSquareKelvin
            | Unit::DegPerHourSecondPerKelvin
            | Unit::DegPerHourPerUnit => rad_per_s_from_deg_per_h(1.0),
            Unit::Millimetre => MILLI,
            Unit::CelsiusPerHour => k_per_s_from_c_per_h(1.0),
            Unit::PartsPerMillion | Unit::PartsPerMillionPerKelvin => fraction_from_ppm(1.0),
            _ => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_earth_rate_survives_the_round_trip() {
        let earth_rad_per_s = 7.292_115e-5;
        let shown_deg_per_h = deg_per_h_from_rad_per_s(earth_rad_per_s);
        assert!((shown_deg_per_h - 15.041_067).abs() < 1e-6);
        assert!((rad_per_s_from_deg_per_h(shown_deg_per_h) - earth_rad_per_s).abs() < 1e-19);
    }

    #[test]
    fn a_stated_parameter_survives_the_round_trip_in_every_unit() {
        for unit in [
            Unit::One,
            Unit::Celsius,
            Unit::Kelvin,
            Unit::DegPerHourSecondPerKelvin,
            Unit::WattPerSquareMetre,
            Unit::Millimetre,
            Unit::CelsiusPerHour,
        ] {
            let stated = -12.5;
            assert!((unit.from_si(unit.to_si(stated)) - stated).abs() < 1e-12, "{unit:?}");
        }
    }
}
