//! What the gyros of a fleet have in common, and what is single.

use serde::Serialize;

#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FleetJson {
    /// "metrics" or "diagnose".
    pub(crate) kind: String,
    /// Those with a result.
    pub(crate) gyros: usize,
    /// What a reader should know first.
    pub(crate) sentences: Vec<String>,
    /// Numbers of the data sheets.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) measures: Vec<MeasureJson>,
    /// How the bias goes with temperature in all gyros; null where fewer than two share temperatures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) thermal_curve: Option<ThermalCurveJson>,
    /// Verdict of each diagnosis, in the gyros' order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) verdicts: Vec<VerdictJson>,
    /// Effects that were found in any gyro; what most have first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) effects: Vec<FleetEffectJson>,
}

/// One number over the fleet.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct MeasureJson {
    pub(crate) key: String,
    pub(crate) unit: String,
    pub(crate) median: f64,
    /// From gyro to gyro, by the median absolute deviation, as a Gaussian's standard deviation; of positive numbers as a factor.
    pub(crate) spread: f64,
    pub(crate) spread_is_factor: bool,
    /// For numbers with a sign: the share of their mean square that one number for the whole batch would take away.
    pub(crate) common_share: Option<f64>,
    pub(crate) values: Vec<GyroValueJson>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct GyroValueJson {
    pub(crate) gyro: String,
    pub(crate) value: f64,
    /// Null for numbers that were not fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) standard_error: Option<f64>,
    /// Further from the others than chance explains: in one batch of twenty any gyro would be, in any measure.
    pub(crate) single: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ThermalCurveJson {
    /// Bias about each gyro's own mean.
    pub(crate) points: Vec<ThermalPointJson>,
    /// The share of the gyros' thermal mean square that the curve of the others takes away.
    pub(crate) common_share: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct ThermalPointJson {
    pub(crate) temperature_c: f64,
    pub(crate) bias_deg_per_h: f64,
    pub(crate) gyros: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct VerdictJson {
    pub(crate) gyro: String,
    pub(crate) verdict: String,
    pub(crate) effects: Vec<String>,
    pub(crate) noise_floor_deg_per_h: f64,
}

/// An effect over the fleet.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FleetEffectJson {
    pub(crate) kind: String,
    /// Gyros whose diagnosis found it.
    pub(crate) found_in: Vec<String>,
    /// Gyros in which another effect was found that this one explains as well.
    pub(crate) equivalent_in: Vec<String>,
    /// Whether at least half of the gyros have it, found or as an equivalent.
    pub(crate) common: bool,
    pub(crate) parameters: Vec<FleetParameterJson>,
}

/// A fitted parameter of an effect over the gyros that have it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct FleetParameterJson {
    pub(crate) parameter: String,
    pub(crate) unit: String,
    /// Weighted by the gyros' errors and their spread.
    pub(crate) mean: f64,
    pub(crate) standard_error: f64,
    /// From gyro to gyro beyond their errors, as a standard deviation.
    pub(crate) spread: f64,
    pub(crate) values: Vec<GyroValueJson>,
}

impl FleetParameterJson {
    /// The mean to two digits of its error, and what the gyros spread beyond that.
    pub(crate) fn in_words(&self) -> String {
        let decimals = |error: f64| {
            let exponent = if error > 0.0 && error.is_finite() { error.log10().floor() } else { -3.0 };
            (1.0 - exponent).clamp(0.0, 12.0) as usize
        };
        let places = decimals(self.standard_error);
        let unit = if self.unit == "1" { String::new() } else { format!(" {}", self.unit) };
        let spread = if self.spread > 0.0 {
            format!(", from gyro to gyro ± {:.*}", decimals(self.spread), self.spread)
        } else {
            ", the same in all of them within their errors".to_owned()
        };
        format!("{} = {:.places$} ± {:.places$}{unit}{spread}", self.parameter, self.mean, self.standard_error)
    }
}

/// Four significant digits.
pub(crate) fn four_digits(value: f64) -> String {
    let exponent = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
    if (-5.0..7.0).contains(&exponent) {
        format!("{value:.*}", (3.0 - exponent).clamp(0.0, 12.0) as usize)
    } else {
        format!("{value:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_mean_something() {
        assert_eq!(
            [0.0, 9.006_991, -0.022_945, 20_400.0, 1e-7].map(four_digits),
            ["0.000", "9.007", "-0.02295", "20400", "1.000e-7"]
        );
        let mut found = FleetParameterJson {
            parameter: "mismatch".into(),
            unit: "1".into(),
            mean: 0.004_012_3,
            standard_error: 0.000_123,
            spread: 0.0,
            values: Vec::new(),
        };
        assert_eq!(found.in_words(), "mismatch = 0.00401 ± 0.00012, the same in all of them within their errors");
        (found.unit, found.mean, found.standard_error, found.spread) = ("K".into(), 1234.0, 34.0, 5.0);
        assert_eq!(found.in_words(), "mismatch = 1234 ± 34 K, from gyro to gyro ± 5.0");
    }
}
