//! Two compensators that know no coil: straight lines over temperature, and a regression on temperature and its rates.
//!
//! ```text
//! R_c = K_l T + R_l  (T ≤ T_1),   K_m T + R_m  (T_1 < T < T_2),   K_h T + R_h  (T ≥ T_2)            piecewise
//! R_c = β_0 + β_1 T + β_2 dT/dt + β_3 d(T_out − T_in)/dt                                             regression
//! ```
//!
//! The lines are fitted apart from each other, each to its own rows, and the break points are those of all pairs of
//! tenths of a kelvin that leave the least squares, then moved row by row. Where lines are not joined, a break's place has
//! no standard error in the usual sense (the likelihood has jumps there); its interval is that of the likelihood ratio:
//! all places that leave less than σ² 7.35 more. dT/dt is the slope of a straight line through the rows
//! around; the last term is there only if the record has the inner temperature.
//!
//! # Source
//! Intervals of break points: Hansen, Econometrica 68 (2000) 575. Thesis chapter on FOG drift compensation (2021), sections 3.2 and 3.3, Eqs. (3-8) to (3-11). The digits of its text
//! are scrambled: "82.40" is 40.82 and "−11490.2" is −1149.2 (sub 0 belongs to the symbol), as Eq. (3-11) shows.

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

use super::CompensateError;
use crate::numeric::order::sort_ascending;
use crate::numeric::statistics::line;
use crate::record::Record;
use crate::units::REFERENCE_TEMPERATURE_K;

/// One straight piece of the bias over temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasLine {
    /// The piece ends here; infinite for the last.
    pub until_k: f64,
    /// Where the end may lie, with 95 % confidence; None for the last.
    pub until_within_k: Option<(f64, f64)>,
    /// At 20 °C.
    pub(crate) at_reference_rad_per_s: f64,
    pub(crate) slope_rad_per_s_k: f64,
}

/// Bias over temperature, in up to three straight lines.
#[derive(Debug, Clone, PartialEq)]
pub struct PiecewiseBias {
    /// Its straight pieces, in order of temperature.
    pub lines: Vec<BiasLine>,
}

/// Width of the classes between which break points are sought.
const CLASS_K: f64 = 0.1;
const MOST_CLASSES: usize = 600;
/// Rounds in which breaks are moved row by row.
const REFINEMENTS: usize = 8;
/// 95 % of −2 ln(1 − √(1 − x)): the likelihood ratio of a break's place.
const LIKELIHOOD_RATIO_95: f64 = 7.352;
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

/// Rows in the order of temperature, summed up.
struct Cumulated {
    temperature_k: Vec<f64>,
    /// Of the rows before each place, one more than there are rows.
    sums: Vec<Sums>,
}

impl Cumulated {
    fn new(records: &[&Record]) -> Self {
        let rows_of = |record: &&Record| {
            let rates = record.rate_rad_per_s().iter().copied();
            record.temperature_k().iter().copied().zip(rates).collect::<Vec<(f64, f64)>>()
        };
        let mut rows: Vec<(f64, f64)> = records.iter().flat_map(rows_of).collect();
        sort_ascending(&mut rows, |item| item.0);
        let mut sums = vec![Sums::default()];
        let mut all = Sums::default();
        for &(temperature_k, rate) in &rows {
            all.add(temperature_k - REFERENCE_TEMPERATURE_K, rate);
            sums.push(all);
        }
        Self { temperature_k: rows.into_iter().map(|r| r.0).collect(), sums }
    }

    fn rows(&self) -> usize {
        self.temperature_k.len()
    }

    /// Value at 20 °C and slope of the line through some rows, and what is left.
    fn piece(&self, from: usize, to: usize) -> Option<(f64, f64, f64)> {
        self.sums[to].between(&self.sums[from]).fit()
    }

    fn left(&self, from: usize, to: usize) -> Option<f64> {
        Some(self.piece(from, to)?.2)
    }

    fn left_by(&self, breaks: &[usize]) -> Option<f64> {
        let mut from = 0;
        let mut sum = 0.0;
        for &to in breaks.iter().chain([&self.rows()]) {
            sum += self.left(from, to)?;
            from = to;
        }
        Some(sum)
    }

    /// Between the row before a place and the one at it.
    fn border_k(&self, place: usize) -> f64 {
        0.5 * (self.temperature_k[place - 1] + self.temperature_k[place])
    }

    /// A place is a border only where the temperature changes.
    fn is_border(&self, place: usize) -> bool {
        place > 0 && place < self.rows() && self.temperature_k[place] > self.temperature_k[place - 1]
    }

    /// Places between classes of temperature.
    fn borders(&self) -> Vec<usize> {
        let (low, high) = (self.temperature_k[0], self.temperature_k[self.rows() - 1]);
        let width = CLASS_K.max((high - low) / MOST_CLASSES as f64);
        let classes = ((high - low) / width).ceil() as usize;
        let mut places: Vec<usize> =
            (1..classes).map(|c| self.temperature_k.partition_point(|t| *t < low + width * c as f64)).collect();
        places.dedup();
        places.retain(|p| self.is_border(*p));
        places
    }

    /// Each break in turn at the best row of the classes around it.
    fn refined(&self, mut breaks: Vec<usize>) -> Vec<usize> {
        for _ in 0..REFINEMENTS {
            let before = breaks.clone();
            for i in 0..breaks.len() {
                let near = |k: f64| self.temperature_k.partition_point(|t| *t < self.border_k(before[i]) + k);
                let mut best = (self.left_by(&breaks).unwrap_or(f64::INFINITY), breaks[i]);
                for place in (near(-CLASS_K)..near(CLASS_K)).filter(|p| self.is_border(*p)) {
                    let mut trial = breaks.clone();
                    trial[i] = place;
                    if let Some(left) = self.left_by(&trial).filter(|left| *left < best.0) {
                        best = (left, place);
                    }
                }
                breaks[i] = best.1;
            }
            if breaks == before {
                break;
            }
        }
        breaks
    }

    /// Where a break may lie: as far as moving it leaves no more than noise explains, the other at its best.
    fn interval_k(&self, breaks: &[usize], which: usize, variance: f64) -> (f64, f64) {
        let borders = self.borders();
        let limit = self.left_by(breaks).unwrap_or(0.0) + LIKELIHOOD_RATIO_95 * variance;
        let at_k = self.border_k(breaks[which]);
        let possible = |place: &&usize| {
            let others = borders.iter().filter(|other| match which {
                0 => *other > place,
                _ => other < place,
            });
            let pair = |other: usize| if which == 0 { [**place, other] } else { [other, **place] };
            others.filter_map(|other| self.left_by(&pair(*other))).any(|left| left <= limit)
        };
        let is_possible: Vec<bool> = borders.iter().map(|place| possible(&place)).collect();
        // From the last border that is not possible to the next one: what lies between was not tried.
        let below = is_possible.iter().position(|p| *p).map(|i| i.checked_sub(1).map_or(0, |b| borders[b]));
        let above = is_possible.iter().rposition(|p| *p).map(|i| borders.get(i + 1).copied().unwrap_or(self.rows()));
        let border_k = |place: usize| match place {
            0 => self.temperature_k[0],
            _ if place == self.rows() => self.temperature_k[place - 1],
            _ => self.border_k(place),
        };
        (below.map_or(at_k, |p| border_k(p).min(at_k)), above.map_or(at_k, |p| border_k(p).max(at_k)))
    }
}

impl PiecewiseBias {
    /// To all rows of some records together.
    ///
    /// # Errors
    /// Records too short for one line.
    pub fn fit(records: &[&Record]) -> Result<Self, CompensateError> {
        let cumulated = Cumulated::new(records);
        let rows = cumulated.rows();
        let whole =
            cumulated.left(0, rows).ok_or(CompensateError::TooFew { needed: LEAST_ROWS as usize, found: rows })?;
        let borders = cumulated.borders();
        let tails: Vec<Option<f64>> = borders.iter().map(|&i| cumulated.left(i, rows)).collect();
        let mut best = (whole, Vec::new());
        for (i, &first) in borders.iter().enumerate() {
            let Some(head) = cumulated.left(0, first) else { continue };
            for (&second, tail) in borders.iter().zip(&tails).skip(i + 1) {
                let (Some(middle), Some(tail)) = (cumulated.left(first, second), tail) else { continue };
                let left = head + middle + tail;
                if left < best.0 {
                    best = (left, vec![first, second]);
                }
            }
        }
        let breaks = cumulated.refined(best.1);
        let free = (rows as f64 - 2.0 * (breaks.len() + 1) as f64).max(1.0);
        let variance = cumulated.left_by(&breaks).unwrap_or(whole) / free;
        let mut ends: Vec<usize> = vec![0];
        ends.extend(&breaks);
        ends.push(rows);
        let lines = ends
            .windows(2)
            .enumerate()
            .filter_map(|(i, w)| {
                let (at, slope, _) = cumulated.piece(w[0], w[1])?;
                let is_last = w[1] == rows;
                Some(BiasLine {
                    until_k: if is_last { f64::INFINITY } else { cumulated.border_k(w[1]) },
                    until_within_k: (!is_last).then(|| cumulated.interval_k(&breaks, i, variance)),
                    at_reference_rad_per_s: at,
                    slope_rad_per_s_k: slope,
                })
            })
            .collect();
        Ok(Self { lines })
    }

    pub(crate) fn bias_rad_per_s(&self, temperature_k: f64) -> f64 {
        let line = self.lines.iter().find(|l| temperature_k < l.until_k).or(self.lines.last());
        line.map_or(0.0, |l| l.at_reference_rad_per_s + l.slope_rad_per_s_k * (temperature_k - REFERENCE_TEMPERATURE_K))
    }
}

/// Linear in temperature, its rate, and the rate of the difference to the bore.
#[derive(Debug, Clone, PartialEq)]
pub struct Regression {
    /// β_0 at 20 °C, β_1, β_2, β_3.
    pub(crate) coefficients: [f64; 4],
    pub(crate) has_inner: bool,
    /// To each side of a row.
    pub(crate) window_s: f64,
}

/// Rows to each side of which the slope is taken, tried in turn.
const WINDOWS: [usize; 7] = [1, 2, 3, 5, 8, 12, 20];

impl Regression {
    /// To all rows of some records together. Windows are as many rows of the one whose rows are furthest apart; those of the others
    /// are as long.
    ///
    /// # Errors
    /// A record too short, or none.
    pub fn fit(records: &[&Record]) -> Result<Self, CompensateError> {
        let interval_s = records.iter().map(|record| record.interval_s()).fold(0.0, f64::max);
        let has_inner = records.iter().all(|record| record.inner_k().is_some());
        let mut best: Option<(f64, Self)> = None;
        for half in WINDOWS {
            let window_s = half as f64 * interval_s;
            let (mut rows, mut rates) = (Vec::new(), Vec::new());
            let mut is_long_enough = true;
            for record in records {
                let half = (window_s / record.interval_s()).round().max(1.0) as usize;
                is_long_enough &= record.rows() > 2 * half + LEAST_ROWS as usize;
                let mut window = Window::new(half);
                for row in 0..record.rows() {
                    window.push(Some(record.temperature_k()[row]), record.inner_k().map(|k| k[row]));
                    if row >= half {
                        rows.push(window.regressors(half, record.interval_s()));
                        rates.push(record.rate_rad_per_s()[row - half]);
                    }
                }
            }
            if !is_long_enough || rows.is_empty() {
                continue;
            }
            let columns = if has_inner { 4 } else { 3 };
            let matrix = DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j]);
            let target = DVector::from_column_slice(&rates);
            let scales: Vec<f64> = matrix.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
            let scaled = DMatrix::from_fn(rows.len(), columns, |i, j| matrix[(i, j)] / scales[j]);
            let Ok(found) = scaled.clone().svd(true, true).solve(&target, 1e-12) else { continue };
            let left = (&scaled * &found - &target).norm_squared() / rows.len() as f64;
            if best.as_ref().is_none_or(|(least, _)| left < *least) {
                let mut coefficients = [0.0; 4];
                for (place, value) in coefficients.iter_mut().zip(found.iter().zip(&scales)) {
                    *place = value.0 / value.1;
                }
                best = Some((left, Self { coefficients, has_inner, window_s }));
            }
        }
        let found = records.iter().map(|record| record.rows()).min().unwrap_or(0);
        best.map(|(_, best)| best).ok_or(CompensateError::TooFew { needed: 2 + LEAST_ROWS as usize + 1, found })
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
