//! A temperature field that was computed elsewhere, by finite elements say.
//!
//! Where only temperatures were given, they count as straight between their times. The rate is then constant from one time to
//! the next, and [`GivenField::states`] are these stretches: rate T(t_i) − T(t_{i−1}) over t_i − t_{i−1}, and the mean temperature.

use super::ThermalHistory;

/// Layers' temperatures at times, with their rates where those were given too.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenField {
    /// What a reader calls it.
    pub name: String,
    /// As it was given; without rates, those columns are empty. Two rows of one time are what a kink is approached by from
    /// either side.
    pub history: ThermalHistory,
    pub has_rates: bool,
}

impl GivenField {
    /// The field as states of the pack, each with temperatures and rates; a stretch stands at its end.
    pub fn states(&self) -> ThermalHistory {
        if self.has_rates {
            return self.history.clone();
        }
        let given = &self.history;
        let mut states = ThermalHistory::with_capacity(given.layers, given.len().saturating_sub(1));
        for row in 1..given.len() {
            let length_s = given.times_s[row] - given.times_s[row - 1];
            let over = |values: &[f64], columns: usize, means: &mut Vec<f64>, rates: &mut Vec<f64>| {
                let (before, after) = values[(row - 1) * columns..(row + 1) * columns].split_at(columns);
                means.extend(before.iter().zip(after).map(|(a, b)| 0.5 * (a + b)));
                rates.extend(before.iter().zip(after).map(|(a, b)| (b - a) / length_s));
            };
            states.times_s.push(given.times_s[row]);
            over(&given.temperature_k, given.layers, &mut states.temperature_k, &mut states.rate_k_per_s);
            if !given.axial_moment_k.is_empty() {
                let (means, rates) = (&mut states.axial_moment_k, &mut states.axial_moment_k_per_s);
                over(&given.axial_moment_k, given.layers, means, rates);
            }
            over(&given.ambient_k, 1, &mut states.ambient_k, &mut states.ambient_rate_k_per_s);
        }
        states
    }

    /// From its first time to its last \[s\].
    pub fn span_s(&self) -> (f64, f64) {
        let times = &self.history.times_s;
        (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn temperatures_without_rates_are_stretches_of_constant_rate() {
        let history = ThermalHistory {
            layers: 2,
            times_s: vec![0.0, 10.0, 30.0],
            temperature_k: vec![290.0, 291.0, 291.0, 293.0, 291.0, 297.0],
            rate_k_per_s: vec![],
            axial_moment_k: vec![],
            axial_moment_k_per_s: vec![],
            ambient_k: vec![291.0, 293.0, 297.0],
            ambient_rate_k_per_s: vec![],
        };
        let states = GivenField { name: "fe".into(), history, has_rates: false }.states();
        assert_eq!(states.times_s, [10.0, 30.0]);
        assert_eq!(states.rate_k_per_s, [0.1, 0.2, 0.0, 0.2]);
        assert_eq!(states.temperature_k, [290.5, 292.0, 291.0, 295.0]);
        assert_eq!(states.ambient_rate_k_per_s, [0.2, 0.2]);
    }
}
