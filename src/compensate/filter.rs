//! The physical compensator at work: a difference equation with several hypotheses about when the air's slope last broke.
//!
//! ```text
//! x⁻ = F x,  o_0 = ω·x,  o_j = o_{j−1};   e = T − h·x⁻,  x = x⁻ + k_a e,  o_j = o_j + κ_aj e          each hypothesis
//! ℓ = ℓ + ln(1 − p) − ½ ln f_a − e²/(2 f_a)                                                        its logarithm of likelihood
//! Ω = Σ w o_j,  w ∝ exp ℓ
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | x | the chamber's states: modes of the pack, the air's trend, turbulence and ripple, the sensor where it lags ([`crate::chamber`]) | `Hypothesis::state` |
//! | o_j | rate error of the row j rows ago, given all readings until now | `Hypothesis::chain` |
//! | a | rows since the air's slope broke; the last entry: long ago | `Hypothesis::age` |
//! | k_a, κ_a, f_a | Kalman gains of the states and of the fixed-lag smoother, variance of e | `Gains` |
//! | p | probability of a break in a row | `break_probability` |
//!
//! A chamber's air runs along straight lines and breaks between them: with one fixed gain a filter either follows breaks too
//! late or noise all the time. Covariances depend on no reading, so all gains are known beforehand, row by row after a
//! break. Every row each hypothesis branches into "no break" and "a break within this row"; of hypotheses of one age
//! the likelier is kept, of all at most [`Tuning::hypotheses`]. With one hypothesis, without breaks, it is the plain
//! difference equation of the stationary Kalman filter.
//!
//! # Source
//! Kalman, J. Basic Eng. 82 (1960) 35; fixed-lag smoothing by augmented states: Anderson and Moore, Optimal Filtering
//! (1979), section 7.3; banks of hypotheses that branch and are pruned: Willsky and Jones, IEEE Trans. Autom. Control 21
//! (1976) 108; Andersson, Int. J. Control 41 (1985) 1221.

use nalgebra::DMatrix;

use crate::chamber::Causal;
use crate::numeric::order::sort_descending;

/// A hypothesis so much less likely than the best is dropped (natural logarithm).
pub(crate) const LEAST_LOG_WEIGHT: f64 = -10.0;
/// Gains this near to those of long ago are those of long ago.
const NEAR: f64 = 0.01;
const MOST_AGES: usize = 256;
/// Places within a row at which noise of the slope comes in.
const PLACES: usize = 16;
/// Without a reading for so many rows the next one begins anew.
pub(crate) const FORGOTTEN_ROWS: usize = 300;

/// What the pack and the sensor do from row to row.
#[derive(Debug, Clone)]
pub(crate) struct Dynamics {
    /// F.
    pub(crate) transition: DMatrix<f64>,
    /// ω.
    pub(crate) rate: DMatrix<f64>,
    /// h.
    pub(crate) reading: DMatrix<f64>,
    /// Where the air's temperature and, if there is one, the sensor's are.
    pub(crate) level_states: Vec<usize>,
    /// Covariance of states and newest rate error for a unit shock of the slope somewhere within the row; and for all other
    /// noise of the air in a row.
    shock: DMatrix<f64>,
    noise: DMatrix<f64>,
}

impl Dynamics {
    /// Of a chamber's system; the rate error is the change of its functional over the last `window_s` of each row, per second.
    pub(crate) fn new(causal: &Causal, interval_s: f64, window_s: f64) -> Self {
        let n = causal.states;
        let dynamics = DMatrix::from_row_slice(n, n, &causal.dynamics);
        let functional = DMatrix::from_row_slice(1, n, &causal.functional);
        let after = |time_s: f64| (&dynamics * time_s).exp();
        let transition = after(interval_s);
        let is_mean = window_s > 0.0;
        let rate = if is_mean {
            (&functional * (&transition - after(interval_s - window_s))) / window_s
        } else {
            &functional * &dynamics * &transition
        };
        let mut shock = DMatrix::zeros(n + 1, n + 1);
        let mut noise = DMatrix::zeros(n + 1, n + 1);
        for place in 0..PLACES {
            let at_s = (place as f64 + 0.5) / PLACES as f64 * interval_s;
            let (responses, before_s) = (after(interval_s - at_s), interval_s - window_s - at_s);
            let before = (is_mean && before_s > 0.0).then(|| &functional * after(before_s));
            let rates = if is_mean { &functional * &responses } else { &functional * &dynamics * &responses };
            let add = |state: usize, size: f64, sum: &mut DMatrix<f64>| {
                let mut newest = rates[(0, state)];
                if is_mean {
                    newest = (newest - before.as_ref().map_or(0.0, |b| b[(0, state)])) / window_s;
                }
                let all = responses.column(state).into_owned().push(newest);
                *sum += &all * all.transpose() * (size / PLACES as f64);
            };
            add(causal.slope, 1.0, &mut shock);
            for (state, &density) in causal.noise.iter().enumerate().filter(|(_, d)| **d > 0.0) {
                add(state, density * interval_s, &mut noise);
            }
        }
        let reading = DMatrix::from_row_slice(1, n, &causal.reading);
        Self { transition, rate, reading, level_states: causal.level_states.clone(), shock, noise }
    }

    fn states(&self) -> usize {
        self.transition.nrows()
    }
}

/// What the gains depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tuning {
    /// How much the air's slope wanders between breaks, in a row [(K/s)²].
    pub(crate) slope_variance: f64,
    /// That the slope breaks in a row, and by how much [(K/s)²].
    pub(crate) break_probability: f64,
    pub(crate) break_variance: f64,
    pub(crate) noise_k: f64,
    pub(crate) delay_rows: usize,
    /// At least 1; with 1 there are no breaks.
    pub(crate) hypotheses: usize,
}

/// Gains so many rows after a break.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FilterGains {
    /// k, then κ: states, then the row itself and the rows of delay.
    pub(crate) gain: Vec<f64>,
    /// f.
    pub(crate) variance: f64,
}

#[derive(Debug, Clone)]
struct Hypothesis {
    log_weight: f64,
    age: usize,
    /// States, then the chain.
    values: Vec<f64>,
    weight: f64,
}

/// A matrix whose rows are multiplied side by side, so that no sum waits for the one before it.
#[derive(Debug, Clone)]
struct Rows {
    count: usize,
    /// So many rows at a time, of these column after column; rows that are not there are zero.
    blocks: Vec<Vec<[f64; Rows::ABREAST]>>,
}

impl Rows {
    const ABREAST: usize = 8;

    /// Each row as long as the others.
    fn new(rows: &[&[f64]]) -> Self {
        let block = |rows: &[&[f64]]| {
            let column = |j: usize| std::array::from_fn(|k| rows.get(k).map_or(0.0, |row| row[j]));
            (0..rows[0].len()).map(column).collect()
        };
        Self { count: rows.len(), blocks: rows.chunks(Self::ABREAST).map(block).collect() }
    }

    /// Appends the products; each is summed from its first column to its last.
    fn times(&self, vector: &[f64], products: &mut Vec<f64>) {
        let end = products.len() + self.count;
        for block in &self.blocks {
            let mut sums = [0.0; Self::ABREAST];
            for (column, value) in block.iter().zip(vector) {
                sums.iter_mut().zip(column).for_each(|(sum, entry)| *sum += entry * value);
            }
            products.extend_from_slice(&sums);
        }
        products.truncate(end);
    }
}

/// The bank of filters.
#[derive(Debug, Clone)]
pub struct Filter {
    n: usize,
    /// Row-major.
    pub(crate) transition: Vec<f64>,
    pub(crate) rate: Vec<f64>,
    pub(crate) reading: Vec<f64>,
    pub(crate) level_states: Vec<usize>,
    pub(crate) most_hypotheses: usize,
    pub(crate) break_probability: f64,
    /// F, and below it ω.
    forwards: Rows,
    /// Logarithms of no break in a row and of a break.
    log_priors: (f64, f64),
    /// By age; the last one is for long ago.
    pub(crate) gains: Vec<FilterGains>,
    /// −½ ln f by age.
    log_factors: Vec<f64>,
    hypotheses: Vec<Hypothesis>,
    /// Those of the row before, whose memory is used again.
    former: Vec<Hypothesis>,
    /// The first reading, from which all temperatures of the states count: what is the same everywhere makes no rate.
    origin_k: f64,
    /// Log-weight, index of the parent, age.
    branches: Vec<(f64, usize, usize)>,
    errors: Vec<f64>,
    spare: Vec<Vec<f64>>,
    missing_rows: usize,
}

/// The covariance recursion.
struct Covariance<'a> {
    dynamics: &'a Dynamics,
    /// Fᵀ and hᵀ.
    back: DMatrix<f64>,
    seen: DMatrix<f64>,
    noise_variance: f64,
    p: DMatrix<f64>,
    /// Of each row of the chain with the states, one behind the other; none while only the states are followed.
    cross: Vec<f64>,
    former: Vec<f64>,
}

impl<'a> Covariance<'a> {
    fn new(dynamics: &'a Dynamics, noise_k: f64) -> Self {
        let n = dynamics.states();
        Self {
            dynamics,
            back: dynamics.transition.transpose(),
            seen: dynamics.reading.transpose(),
            noise_variance: noise_k * noise_k,
            p: DMatrix::identity(n, n) * 1e-6,
            cross: Vec::new(),
            former: Vec::new(),
        }
    }

    /// From now on with a chain of so many rows, of which nothing is known yet.
    fn with_chain(&mut self, rows: usize) {
        self.cross = vec![0.0; rows * self.dynamics.states()];
        self.former = self.cross.clone();
    }

    /// One row further, the slope shaken with this variance somewhere within it.
    fn step(&mut self, slope_variance: f64) -> FilterGains {
        let Dynamics { transition, rate, reading, shock, noise, .. } = self.dynamics;
        let n = transition.nrows();
        let shaken = shock * slope_variance + noise;
        if !self.cross.is_empty() {
            std::mem::swap(&mut self.cross, &mut self.former);
            for (row, before) in self.cross.chunks_exact_mut(n).skip(1).zip(self.former.chunks_exact(n)) {
                for (entry, forwards) in row.iter_mut().zip(self.back.column_iter()) {
                    *entry = before.iter().zip(forwards.iter()).map(|(c, f)| c * f).sum();
                }
            }
            let newest = rate * &self.p * &self.back + shaken.view((n, 0), (1, n));
            self.cross[..n].copy_from_slice(newest.as_slice());
        }
        self.p = transition * &self.p * &self.back + shaken.view((0, 0), (n, n));
        let seen = &self.p * &self.seen;
        let variance = (reading * &seen)[(0, 0)] + self.noise_variance;
        let gain = &seen / variance;
        self.p -= &gain * gain.transpose() * variance;
        self.p = 0.5 * (&self.p + self.p.transpose());
        let mut all = gain.as_slice().to_vec();
        for cross in self.cross.chunks_exact_mut(n) {
            let shown: f64 = cross.iter().zip(self.seen.iter()).map(|(c, h)| c * h).sum();
            let entry = shown / variance;
            cross.iter_mut().zip(gain.iter()).for_each(|(c, k)| *c -= k * (entry * variance));
            all.push(entry);
        }
        FilterGains { gain: all, variance }
    }
}

/// The largest change of a gain, as a share of the largest one of its kind.
fn difference(a: &FilterGains, b: &FilterGains, states: usize) -> f64 {
    let part = |from: usize, to: usize| {
        let pairs = || a.gain[from..to].iter().zip(&b.gain[from..to]);
        let size = pairs().map(|(_, b)| b.abs()).fold(f64::MIN_POSITIVE, f64::max);
        pairs().map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size
    };
    part(0, states).max(part(states, a.gain.len()))
}

/// Gains of long ago, and those by age after a break before them.
fn schedule(dynamics: &Dynamics, tuning: &Tuning) -> Vec<FilterGains> {
    const MOST_ROUNDS: usize = 20_000;
    const STILL: f64 = 1e-12;
    let n = dynamics.states();
    let mut covariance = Covariance::new(dynamics, tuning.noise_k);
    let mut long_ago = covariance.step(tuning.slope_variance);
    // The chain follows the states and settles as many rows later as it is long.
    for _ in 0..MOST_ROUNDS {
        let next = covariance.step(tuning.slope_variance);
        let is_still = difference(&next, &long_ago, n) <= STILL;
        long_ago = next;
        if is_still {
            break;
        }
    }
    covariance.with_chain(tuning.delay_rows + 1);
    let mut settled = 0;
    for _ in 0..2 * (tuning.delay_rows + 2) {
        let next = covariance.step(tuning.slope_variance);
        let is_first = next.gain.len() != long_ago.gain.len();
        settled = if !is_first && difference(&next, &long_ago, n) <= STILL { settled + 1 } else { 0 };
        long_ago = next;
        if settled > tuning.delay_rows + 1 {
            break;
        }
    }
    let mut gains = Vec::new();
    if tuning.hypotheses > 1 {
        gains.push(covariance.step(tuning.slope_variance + tuning.break_variance));
        while gains.len() < MOST_AGES {
            let next = covariance.step(tuning.slope_variance);
            let is_near = gains.len() > tuning.delay_rows && difference(&next, &long_ago, n) < NEAR;
            gains.push(next);
            if is_near {
                break;
            }
        }
    }
    gains.push(long_ago);
    gains
}

impl Filter {
    pub(crate) fn new(dynamics: &Dynamics, tuning: &Tuning) -> Self {
        let gains = schedule(dynamics, tuning);
        let n = dynamics.states();
        let transition = dynamics.transition.transpose().as_slice().to_vec();
        let rate = dynamics.rate.as_slice().to_vec();
        Self {
            n,
            forwards: Rows::new(&transition.chunks_exact(n).chain([&rate[..]]).collect::<Vec<_>>()),
            log_priors: ((-tuning.break_probability).ln_1p(), tuning.break_probability.ln()),
            transition,
            rate,
            reading: dynamics.reading.as_slice().to_vec(),
            level_states: dynamics.level_states.clone(),
            most_hypotheses: tuning.hypotheses.max(1),
            break_probability: tuning.break_probability,
            log_factors: gains.iter().map(|g| -0.5 * g.variance.ln()).collect(),
            gains,
            hypotheses: Vec::new(),
            former: Vec::new(),
            origin_k: 0.0,
            branches: Vec::new(),
            errors: Vec::new(),
            spare: Vec::new(),
            missing_rows: 0,
        }
    }

    /// Forgets every reading.
    pub(crate) fn restart(&mut self) {
        self.hypotheses.clear();
    }

    /// Rate error of the row `lag` rows ago, given all readings until now [rad/s]; 0 before the first reading.
    pub fn rate_error_rad_per_s(&self, lag: usize) -> f64 {
        self.hypotheses.iter().map(|h| h.weight * h.values[self.n + lag]).sum()
    }

    /// The states, given all readings until now; empty before the first.
    pub(crate) fn state(&self) -> Vec<f64> {
        if self.hypotheses.is_empty() {
            return Vec::new();
        }
        let mut state: Vec<f64> =
            (0..self.n).map(|i| self.hypotheses.iter().map(|h| h.weight * h.values[i]).sum()).collect();
        self.level_states.iter().for_each(|&level| state[level] += self.origin_k);
        state
    }

    fn start(&mut self, temperature_k: f64) {
        self.origin_k = temperature_k;
        let values = vec![0.0; self.gains[0].gain.len()];
        // As if a break had just been: the slope is not known.
        self.hypotheses = vec![Hypothesis { log_weight: 0.0, age: 0, values, weight: 1.0 }];
    }

    /// One row further; without a reading the model goes on by itself.
    pub fn step(&mut self, temperature_k: Option<f64>) {
        self.missing_rows = if temperature_k.is_some() { 0 } else { self.missing_rows + 1 };
        if self.missing_rows > FORGOTTEN_ROWS {
            self.restart();
        }
        if self.hypotheses.is_empty() {
            if let Some(temperature_k) = temperature_k {
                self.start(temperature_k);
            }
            return;
        }
        for hypothesis in &mut self.hypotheses {
            let mut next = self.spare.pop().unwrap_or_default();
            next.clear();
            let (state, chain) = hypothesis.values.split_at(self.n);
            self.forwards.times(state, &mut next);
            next.extend_from_slice(&chain[..chain.len() - 1]);
            self.spare.push(std::mem::replace(&mut hypothesis.values, next));
        }
        if let Some(temperature_k) = temperature_k {
            self.branch(temperature_k);
        }
    }

    /// Branches every hypothesis, keeps the best and corrects them by the reading.
    fn branch(&mut self, temperature_k: f64) {
        let long_ago = self.gains.len() - 1;
        let has_breaks = self.most_hypotheses > 1;
        self.branches.clear();
        self.errors.clear();
        for (parent, hypothesis) in self.hypotheses.iter().enumerate() {
            let error = temperature_k - self.origin_k - dot(&self.reading, &hypothesis.values[..self.n]);
            self.errors.push(error);
            let mut add = |age: usize, prior: f64| {
                let fit = self.log_factors[age] - 0.5 * error * error / self.gains[age].variance;
                self.branches.push((hypothesis.log_weight + prior + fit, parent, age));
            };
            add((hypothesis.age + 1).min(long_ago), self.log_priors.0);
            if has_breaks {
                add(0, self.log_priors.1);
            }
        }
        // Stable: of equals the one of the likelier parent comes first.
        sort_descending(&mut self.branches, |item| item.0);
        let best = self.branches[0].0;
        let mut kept = std::mem::take(&mut self.former);
        for &(log_weight, parent, age) in &self.branches {
            if log_weight < best + LEAST_LOG_WEIGHT || kept.len() == self.most_hypotheses {
                break;
            }
            if kept.iter().any(|h| h.age == age) {
                continue;
            }
            let mut values = self.spare.pop().unwrap_or_default();
            values.clear();
            let error = self.errors[parent];
            let before = &self.hypotheses[parent].values;
            values.extend(before.iter().zip(&self.gains[age].gain).map(|(v, gain)| v + gain * error));
            let log_weight = log_weight - best;
            kept.push(Hypothesis { log_weight, age, values, weight: log_weight.exp() });
        }
        let sum: f64 = kept.iter().map(|h| h.weight).sum();
        kept.iter_mut().for_each(|h| h.weight /= sum);
        self.former = std::mem::replace(&mut self.hypotheses, kept);
        self.spare.extend(self.former.drain(..).map(|old| old.values));
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
