//! Two compensators that know no coil: straight lines over temperature, and a regression on temperature and its rates.
//!
//! ```text
//! R_c = K_l T + R_l  (T ≤ T_1),   K_m T + R_m  (T_1 < T < T_2),   K_h T + R_h  (T ≥ T_2)            piecewise
//! R_c = β_0 + β_1 T + β_2 dT/dt + β_3 d(T_out − T_in)/dt                                             regression
//! ```
//!
//! The lines are fitted apart from each other, each to its own rows, and the break points are those of all pairs of
//! half-kelvin borders that leave the least squares. dT/dt is the slope of a straight line through the rows
//! around; the last term is there only if the record has the inner temperature.
//!
//! # Source
//! Thesis chapter on FOG drift compensation (2021), sections 3.2 and 3.3, Eqs. (3-8) to (3-11). The digits of its text
//! are scrambled: "82.40" is 40.82 and "−11490.2" is −1149.2 (sub 0 belongs to the symbol), as Eq. (3-11) shows.

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

use super::CompensateError;
use crate::numeric::statistics::line;
use crate::record::Record;
use crate::units::REFERENCE_TEMPERATURE_K;

/// One straight piece of the bias over temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasLine {
    /// The piece ends here; infinite for the last.
    pub until_k: f64,
    /// At 20 °C.
    pub at_reference_rad_per_s: f64,
    pub slope_rad_per_s_k: f64,
}

/// Bias over temperature, in up to three straight lines.
#[derive(Debug, Clone, PartialEq)]
pub struct PiecewiseBias {
    pub lines: Vec<BiasLine>,
}

/// Width of the classes between which break points are sought.
const CLASS_K: f64 = 0.1;
const MOST_CLASSES: usize = 600;
/// A line needs this many rows.
const LEAST_ROWS: f64 = 8.0;

#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Sums {
    fn add(&mut self, x: f64, y: f64) {
        self.n += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
    }

    fn between(&self, before: &Sums) -> Sums {
        Sums {
            n: self.n - before.n,
            x: self.x - before.x,
            y: self.y - before.y,
            xx: self.xx - before.xx,
            xy: self.xy - before.xy,
            yy: self.yy - before.yy,
        }
    }

    /// Value at 0, slope, and what is left; None for too few rows.
    fn fit(&self) -> Option<(f64, f64, f64)> {
        if self.n < LEAST_ROWS {
            return None;
        }
        let (xx, xy) = (self.xx - self.x * self.x / self.n, self.xy - self.x * self.y / self.n);
        let yy = self.yy - self.y * self.y / self.n;
        let slope = if xx > 1e-9 * self.n { xy / xx } else { 0.0 };
        Some(((self.y - slope * self.x) / self.n, slope, (yy - slope * xy).max(0.0)))
    }
}

impl PiecewiseBias {
    /// # Errors
    /// A record too short for one line.
    pub fn fit(record: &Record) -> Result<Self, CompensateError> {
        let temperatures = record.temperature_k();
        let (low, high) =
            temperatures.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(*t), high.max(*t)));
        let width = CLASS_K.max((high - low) / MOST_CLASSES as f64);
        let classes = ((high - low) / width).ceil().max(1.0) as usize;
        let mut cumulated = vec![Sums::default(); classes + 1];
        for (t, y) in temperatures.iter().zip(record.rate_rad_per_s()) {
            let class = (((t - low) / width) as usize).min(classes - 1);
            cumulated[class + 1].add(t - REFERENCE_TEMPERATURE_K, *y);
        }
        for i in 1..=classes {
            let before = cumulated[i - 1];
            let own = cumulated[i];
            let all = &mut cumulated[i];
            *all = Sums {
                n: own.n + before.n,
                x: own.x + before.x,
                y: own.y + before.y,
                xx: own.xx + before.xx,
                xy: own.xy + before.xy,
                yy: own.yy + before.yy,
            };
        }
        let piece = |from: usize, to: usize| cumulated[to].between(&cumulated[from]).fit();
        let whole =
            piece(0, classes).ok_or(CompensateError::TooFew { needed: LEAST_ROWS as usize, found: record.rows() })?;
        let mut best = (whole.2, vec![0, classes]);
        let tails: Vec<Option<f64>> = (0..=classes).map(|i| piece(i, classes).map(|p| p.2)).collect();
        for first in 1..classes {
            let Some((_, _, head)) = piece(0, first) else { continue };
            for (second, tail) in tails.iter().enumerate().take(classes).skip(first + 1) {
                let (Some((_, _, middle)), Some(tail)) = (piece(first, second), tail) else { continue };
                let left = head + middle + tail;
                if left < best.0 {
                    best = (left, vec![0, first, second, classes]);
                }
            }
        }
        let lines = best
            .1
            .windows(2)
            .filter_map(|w| {
                let (at, slope, _) = piece(w[0], w[1])?;
                let until_k = if w[1] == classes { f64::INFINITY } else { low + width * w[1] as f64 };
                Some(BiasLine { until_k, at_reference_rad_per_s: at, slope_rad_per_s_k: slope })
            })
            .collect();
        Ok(Self { lines })
    }

    pub fn bias_rad_per_s(&self, temperature_k: f64) -> f64 {
        let line = self.lines.iter().find(|l| temperature_k < l.until_k).or(self.lines.last());
        line.map_or(0.0, |l| l.at_reference_rad_per_s + l.slope_rad_per_s_k * (temperature_k - REFERENCE_TEMPERATURE_K))
    }
}

/// Linear in temperature, its rate, and the rate of the difference to the bore.
#[derive(Debug, Clone, PartialEq)]
pub struct Regression {
    /// β_0 at 20 °C, β_1, β_2, β_3.
    pub coefficients: [f64; 4],
    pub has_inner: bool,
    /// To each side of a row.
    pub window_s: f64,
}

/// Rows to each side of which the slope is taken, tried in turn.
const WINDOWS: [usize; 7] = [1, 2, 3, 5, 8, 12, 20];

impl Regression {
    /// # Errors
    /// A record too short.
    pub fn fit(record: &Record) -> Result<Self, CompensateError> {
        let interval_s = record.interval_s();
        let mut best: Option<(f64, Self)> = None;
        for half in WINDOWS {
            if record.rows() <= 2 * half + LEAST_ROWS as usize {
                continue;
            }
            let has_inner = record.inner_k().is_some();
            let mut window = Window::new(half);
            let mut rows = Vec::new();
            for row in 0..record.rows() {
                window.push(Some(record.temperature_k()[row]), record.inner_k().map(|k| k[row]));
                if row >= half {
                    rows.push(window.regressors(half, interval_s));
                }
            }
            let columns = if has_inner { 4 } else { 3 };
            let matrix = DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j]);
            let target = DVector::from_column_slice(&record.rate_rad_per_s()[..rows.len()]);
            let scales: Vec<f64> = matrix.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
            let scaled = DMatrix::from_fn(rows.len(), columns, |i, j| matrix[(i, j)] / scales[j]);
            let Ok(found) = scaled.clone().svd(true, true).solve(&target, 1e-12) else { continue };
            let left = (&scaled * &found - &target).norm_squared() / rows.len() as f64;
            if best.as_ref().is_none_or(|(least, _)| left < *least) {
                let mut coefficients = [0.0; 4];
                for (place, value) in coefficients.iter_mut().zip(found.iter().zip(&scales)) {
                    *place = value.0 / value.1;
                }
                best = Some((left, Self { coefficients, has_inner, window_s: half as f64 * interval_s }));
            }
        }
        best.map(|(_, found)| found)
            .ok_or(CompensateError::TooFew { needed: 2 + LEAST_ROWS as usize + 1, found: record.rows() })
    }

    pub(super) fn bias_rad_per_s(&self, regressors: &[f64; 4]) -> f64 {
        self.coefficients.iter().zip(regressors).map(|(c, r)| c * r).sum()
    }
}

/// The readings around a row.
#[derive(Debug, Clone)]
pub(super) struct Window {
    half: usize,
    outer: VecDeque<f64>,
    difference: VecDeque<f64>,
}

impl Window {
    pub(super) fn new(half: usize) -> Self {
        Self { half, outer: VecDeque::new(), difference: VecDeque::new() }
    }

    /// A reading that is missing is held.
    pub(super) fn push(&mut self, temperature_k: Option<f64>, inner_k: Option<f64>) {
        let Some(temperature_k) = temperature_k.or(self.outer.back().copied()) else { return };
        let difference = inner_k.map(|inner| temperature_k - inner).or(self.difference.back().copied()).unwrap_or(0.0);
        self.outer.push_back(temperature_k);
        self.difference.push_back(difference);
        if self.outer.len() > 3 * self.half + 1 {
            self.outer.pop_front();
            self.difference.pop_front();
        }
    }

    /// 1, T − 20 °C, dT/dt, d(T_out − T_in)/dt of the row `lag` rows ago.
    pub(super) fn regressors(&self, lag: usize, interval_s: f64) -> [f64; 4] {
        let Some(newest) = self.outer.len().checked_sub(1) else { return [1.0, 0.0, 0.0, 0.0] };
        let row = newest.saturating_sub(lag);
        let around = row.saturating_sub(self.half)..=(row + self.half).min(newest);
        let slope = |of: &VecDeque<f64>| {
            line(around.clone().map(|i| (i as f64 * interval_s, of[i]))).map_or(0.0, |(_, slope)| slope)
        };
        [1.0, self.outer[row] - REFERENCE_TEMPERATURE_K, slope(&self.outer), slope(&self.difference)]
    }
}
