//! What a step of the film between air and pack makes of readings and rates, to first order.

use super::coil_side::CoilSide;
use super::filter::{RATE, Values};
use super::known::lagged;
use super::series::Series;

/// Steps of the film's logarithm by one from some row on, as the pack follows.
pub(super) struct FilmStep<'a> {
    series: &'a Series,
    lag_s: f64,
    /// What drives the pack beyond its outermost layer, on average over each row [K].
    apart_k: Vec<f64>,
    /// Row-major rows × modes: what a row leaves of each mode.
    left: Vec<f64>,
    /// Of the sensor, the bore and the rate's integral; None: the air itself.
    shown: Option<Shares>,
    bore: Shares,
    rate: Shares,
}

/// Shares of the modes, and that of the drive.
struct Shares {
    of_modes: Vec<f64>,
    of_drive: f64,
}

impl Shares {
    fn of(&self, modes: &[f64], drive_k: f64) -> f64 {
        self.of_modes.iter().zip(modes).map(|(a, x)| a * x).sum::<f64>() + self.of_drive * drive_k
    }
}

impl<'a> FilmStep<'a> {
    /// `apart_k`: what drives the pack beyond its outermost layer, one entry a row.
    pub(super) fn new(side: &CoilSide, series: &'a Series, apart_k: &[f64]) -> Self {
        let reduced = &side.reduced;
        let of_output = |j: usize| Shares { of_modes: reduced.row(j).to_vec(), of_drive: reduced.residue[j] };
        let mut rate = Shares { of_modes: vec![0.0; reduced.modes()], of_drive: 0.0 };
        for (output, gain) in side.gains.outputs.iter().enumerate().filter(|(_, g)| **g != 0.0) {
            rate.of_modes.iter_mut().zip(reduced.row(output)).for_each(|(sum, a)| *sum += gain * a);
            rate.of_drive += gain * reduced.residue[output];
        }
        let before = |k: usize| k.max(1) - 1;
        let step_s = |k: usize| series.times_s[k] - series.times_s[before(k)];
        let left = |k: usize| reduced.decay_per_s.iter().map(move |decay| (-decay * step_s(k)).exp());
        Self {
            series,
            lag_s: side.lag_s(),
            apart_k: (0..apart_k.len()).map(|k| 0.5 * (apart_k[k] + apart_k[before(k)])).collect(),
            left: (0..apart_k.len()).flat_map(left).collect(),
            shown: side.shown().map(of_output),
            bore: of_output(0),
            rate,
        }
    }

    /// What a step before a row adds to readings [K] and rates [rad/s], per unit of the film's logarithm.
    ///
    /// # Shapes
    /// One entry a row in each column; zero before the step.
    pub(super) fn before(&self, row: usize) -> Values {
        let rows = self.apart_k.len();
        let modes = self.bore.of_modes.len();
        let mut values = Values { of: std::array::from_fn(|_| vec![0.0; rows]) };
        let mut x = vec![0.0; modes];
        let mut rate_before = 0.0;
        for k in row.max(1)..rows {
            let drive_k = self.apart_k[k];
            let left = &self.left[k * modes..(k + 1) * modes];
            x.iter_mut().zip(left).for_each(|(x, left)| *x = drive_k + (*x - drive_k) * left);
            if let Some(shown) = &self.shown {
                values.of[0][k] = shown.of(&x, drive_k);
            }
            values.of[1][k] = self.bore.of(&x, drive_k);
            let now = self.rate.of(&x, drive_k);
            values.of[RATE][k] = (now - rate_before) / (self.series.times_s[k] - self.series.times_s[k - 1]);
            rate_before = now;
        }
        values.of[0] = lagged(&values.of[0], &self.series.times_s, self.lag_s);
        values
    }
}
