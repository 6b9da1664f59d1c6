//! What a rate may follow of a temperature, as columns: lagged temperatures, powers of it, how fast it changes, and warming up.
//!
//! ```text
//! T − T_0,   T − x_1,   x_k − x_{k+1},   e^(−t/τ_k),   u², u³, u⁴,   |v_k|, v_k |v_k|, u v_k;   τ ẋ = T − x,   u = (T − T_0)/U
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | x_k | temperature behind a lag of τ_k, from twice a row's interval to eight hours | `lags` |
//! | v_k | T behind a short lag less T behind a long one: a rate of change | `slopes` |
//! | T_0, U | the first temperature; 50 K | `first_k`, `USUAL_K` |
//!
//! Any linear thermal system whose response is smooth over its time constants is a sum of the lags; what is curved or unlike on
//! warming and cooling is met by the powers. Nothing is fitted here.
//!
//! # Source
//! The form of a linear thermal response, a sum of exponentials, is that of the modal solution in [`crate::thermal`].

use crate::record::RecordRow;

/// Number of lags.
pub(crate) const LAGS: usize = 10;
const LONGEST_LAG_S: f64 = 3e4;
const SHORTEST_LAG_ROWS: f64 = 2.0;
/// Shorter lags than this have no thermal meaning in a coil.
const SHORTEST_LAG_S: f64 = 2.0;
/// So that powers stay near one.
pub(crate) const USUAL_K: f64 = 50.0;
/// Which lags make the two slopes.
pub(crate) const SLOPES: [(usize, usize); 2] = [(2, 4), (4, 6)];
/// Lags whose decay from the record's begin counts as warming up.
pub(crate) const WARM_UPS: [usize; 4] = [3, 5, 6, 8];

/// Sizes of the groups: what follows linearly, what is curved, warming up.
pub(crate) const GROUPS: [usize; 3] = [LAGS + 1, 3 + 3 * SLOPES.len(), WARM_UPS.len()];
/// Columns altogether.
pub(crate) const COLUMNS: usize = GROUPS[0] + GROUPS[1] + GROUPS[2];

/// Follows one temperature row by row.
#[derive(Debug, Clone)]
pub(crate) struct ThermalColumns {
    lags_s: [f64; LAGS],
    behind_k: [f64; LAGS],
    first_k: f64,
    first_s: f64,
    last_s: f64,
    temperature_k: f64,
    /// Of the last step: its length, and what it leaves of each lag.
    step_s: f64,
    keeps: [f64; LAGS],
}

/// τ_k for rows of an interval \[s\].
pub(crate) fn lags_s(interval_s: f64) -> [f64; LAGS] {
    let shortest_s = (SHORTEST_LAG_ROWS * interval_s).max(SHORTEST_LAG_S);
    let ratio = (LONGEST_LAG_S / shortest_s).max(2.0).powf(1.0 / (LAGS - 1) as f64);
    std::array::from_fn(|k| shortest_s * ratio.powi(k as i32))
}

impl ThermalColumns {
    /// At rest at the first row's temperature.
    pub(crate) fn new(first: RecordRow, interval_s: f64) -> Self {
        Self {
            lags_s: lags_s(interval_s),
            behind_k: [first.temperature_k; LAGS],
            first_k: first.temperature_k,
            first_s: first.time_s,
            last_s: first.time_s,
            temperature_k: first.temperature_k,
            step_s: 0.0,
            keeps: [1.0; LAGS],
        }
    }

    pub(crate) fn advance(&mut self, row: RecordRow) {
        let step_s = row.time_s - self.last_s;
        // Steps of equal length differ by rounding.
        if (step_s - self.step_s).abs() > 1e-9 * step_s.abs() {
            self.step_s = step_s;
            self.keeps = self.lags_s.map(|lag_s| (-step_s / lag_s).exp());
        }
        for (behind, keep) in self.behind_k.iter_mut().zip(self.keeps) {
            *behind = row.temperature_k + keep * (*behind - row.temperature_k);
        }
        self.last_s = row.time_s;
        self.temperature_k = row.temperature_k;
    }

    /// # Shapes
    /// `into` has [`COLUMNS`] places.
    pub(crate) fn write(&self, into: &mut [f64]) {
        let from_first = self.temperature_k - self.first_k;
        let u = from_first / USUAL_K;
        // Neighbouring lags differ in one band of frequencies each: columns that are nearly independent.
        let bands = self.behind_k.windows(2).map(|pair| pair[0] - pair[1]);
        let linear = [from_first, self.temperature_k - self.behind_k[0]].into_iter().chain(bands);
        let slopes = SLOPES.map(|(short, long)| self.behind_k[short] - self.behind_k[long]);
        let curved = [u * u, u * u * u, u.powi(4)]
            .into_iter()
            .chain(slopes.into_iter().flat_map(|v| [v.abs(), v * v.abs(), u * v]));
        let warm = WARM_UPS.iter().map(|k| (-(self.last_s - self.first_s) / self.lags_s[*k]).exp());
        into.iter_mut().zip(linear.chain(curved).chain(warm)).for_each(|(place, value)| *place = value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_leaves_each_lag_behind_by_its_own_exponential_and_rest_leaves_nothing() {
        let row = |time_s: f64, temperature_k: f64| RecordRow {
            time_s,
            temperature_k,
            rate_rad_per_s: 0.0,
            table_rad_per_s: None,
        };
        let mut columns = ThermalColumns::new(row(0.0, 300.0), 10.0);
        let mut found = vec![f64::NAN; COLUMNS];
        columns.write(&mut found);
        assert!(found[..COLUMNS - WARM_UPS.len()].iter().all(|v| *v == 0.0), "{found:?}");
        for i in 1..=50 {
            columns.advance(row(10.0 * f64::from(i), 310.0));
        }
        columns.write(&mut found);
        let behind = columns.lags_s.map(|lag_s| 310.0 - 10.0 * (-500.0 / lag_s).exp());
        assert!((found[1] - (310.0 - behind[0])).abs() < 1e-9);
        for k in 1..LAGS {
            assert!((found[1 + k] - (behind[k - 1] - behind[k])).abs() < 1e-9);
        }
        assert!((found[GROUPS[0]] - 0.04).abs() < 1e-12);
    }
}
