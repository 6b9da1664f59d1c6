//! A linear Gaussian state-space model: likelihood, smoothed states, and the whitening of its measurement errors.
//!
//! ```text
//! z_k = h x_k + v,  v ~ N(0, r)         any number of scalar measurements at stage k
//! x_{k+1} = F_k (x_k + Σ_d u_d w_kd),  w_kd ~ N(0, q_kd)      u_d: the directions of the disturbances
//! ```
//!
//! Measurements are taken in one at a time (their errors are independent), so there is no matrix to invert. Smoothing
//! is by the backward recursion of scores: with the innovation v, its variance f and the gain K of each measurement,
//!
//! ```text
//! r ← h v/f + (I − K h)ᵀ r,   N ← h hᵀ/f + (I − K h)ᵀ N (I − K h),   r ← Fᵀ r,   N ← Fᵀ N F
//! x̂ = x + P r,   var(d x) = d P dᵀ − d P N P dᵀ
//! ```
//!
//! and u·r, u N u at a stage are also score and information of a further disturbance there: (u·r)²/(u N u) is χ² with
//! one degree of freedom where there is none.
//!
//! # Source
//! Kalman, J. Basic Eng. 82 (1960) 35; de Jong, J. Am. Stat. Assoc. 84 (1989) 1085 (smoothing without inverses); de Jong
//! and Penzer, J. Am. Stat. Assoc. 93 (1998) 796 (shocks); de Jong, Ann. Stat. 19 (1991) 1073 (regression columns).

use super::kalman::{Keep, Sparse, forward, smooth};

/// One scalar measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Index into [`StateSpace::rows`].
    pub row: usize,
    pub value: f64,
    pub variance: f64,
}

/// What happens at one instant, and how the state moves on to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Stage {
    pub measurements: Vec<Measurement>,
    /// Direction and variance of each disturbance that enters after the measurements.
    pub disturbances: Vec<(usize, f64)>,
    /// Index into [`StateSpace::transitions`]; unused at the last stage.
    pub transition: usize,
}

/// # Shapes
/// `size` states; each of `rows` and `directions`, and `mean`, of that length; `transitions` and `covariance` row-major `size` × `size`.
#[derive(Debug, Clone)]
pub struct StateSpace {
    pub size: usize,
    pub rows: Vec<Vec<f64>>,
    /// In which disturbances enter.
    pub directions: Vec<Vec<f64>>,
    pub transitions: Vec<Vec<f64>>,
    pub stages: Vec<Stage>,
    pub mean: Vec<f64>,
    pub covariance: Vec<f64>,
}

/// The states given all measurements.
#[derive(Debug, Clone)]
pub struct Smoothed {
    pub log_likelihood: f64,
    /// Σ v²/f over all measurements, and their number.
    pub squared_innovations: f64,
    pub measurements: usize,
    /// Row-major stages × states.
    pub states: Vec<f64>,
    /// Score of a disturbance in each direction at each stage, and its information; row-major stages × directions.
    pub score: Vec<f64>,
    pub information: Vec<f64>,
    /// Variance of the functional asked for, at each stage.
    pub functional_variance: Vec<f64>,
}

/// The gains of a filter, ready to be run over other measurements.
#[derive(Debug, Clone)]
pub struct Whitener {
    size: usize,
    rows: Sparse,
    transitions: Vec<Sparse>,
    /// For each stage: the transition, and of each measurement the row and the place of its gain.
    steps: Vec<(usize, Vec<(usize, usize)>)>,
    gains: Vec<f64>,
    /// 1/√f of each measurement.
    weights: Vec<f64>,
}

impl StateSpace {
    /// # Panics
    /// With more than 64 states, as do all the passes.
    pub fn log_likelihood(&self) -> f64 {
        forward(self, Keep::Nothing).0
    }

    /// The states given all measurements, and the variance of the functional `functional` · x of each.
    pub fn smooth(&self, functional: &[f64]) -> Smoothed {
        smooth(self, Some(functional))
    }

    /// As [`Self::smooth`] without states and functional, which stay empty: much less work.
    pub fn scores(&self) -> Smoothed {
        smooth(self, None)
    }

    /// The gains of this model's filter.
    pub fn whitener(&self) -> Whitener {
        let trace = forward(self, Keep::Gains).2;
        let mut taken = 0;
        let steps = self
            .stages
            .iter()
            .map(|stage| {
                let measured = stage
                    .measurements
                    .iter()
                    .map(|m| {
                        taken += 1;
                        (m.row, taken - 1)
                    })
                    .collect();
                (stage.transition, measured)
            })
            .collect();
        Whitener {
            size: self.size,
            rows: Sparse::new(&self.rows.concat(), self.size),
            transitions: self.transitions.iter().map(|t| Sparse::new(t, self.size)).collect(),
            steps,
            gains: trace.gains,
            weights: trace.innovations.iter().map(|(_, variance)| variance.sqrt().recip()).collect(),
        }
    }
}

impl Whitener {
    /// Number of measurements, in the order of the stages.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    pub fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }

    /// The innovations, divided by their standard deviations, of measurements whose prior mean is zero: inner products
    /// of whitened columns are those of the columns with the inverse of the measurements' joint covariance.
    ///
    /// # Panics
    /// If `measurements` has another length than [`Self::len`].
    pub fn whiten(&self, measurements: &[f64]) -> Vec<f64> {
        assert_eq!(measurements.len(), self.len());
        let n = self.size;
        let mut state = vec![0.0; n];
        let mut next = vec![0.0; n];
        let mut whitened = Vec::with_capacity(measurements.len());
        for (transition, measured) in &self.steps {
            for &(row, taken) in measured {
                let innovation = measurements[taken] - self.rows.dot(row, &state);
                whitened.push(innovation * self.weights[taken]);
                for (s, g) in state.iter_mut().zip(&self.gains[taken * n..(taken + 1) * n]) {
                    *s += g * innovation;
                }
            }
            if let Some(transition) = self.transitions.get(*transition) {
                transition.times(&state, &mut next);
                std::mem::swap(&mut state, &mut next);
            }
        }
        whitened
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    /// A random walk with a drift, seen with noise; 6 stages.
    fn walk() -> StateSpace {
        let values = [0.3, 0.1, 0.7, 1.9, 2.4, 2.0];
        StateSpace {
            size: 2,
            rows: vec![vec![1.0, 0.0]],
            directions: vec![vec![1.0, 0.0], vec![0.0, 1.0]],
            transitions: vec![vec![1.0, 1.0, 0.0, 1.0]],
            stages: values
                .iter()
                .map(|&value| Stage {
                    measurements: vec![Measurement { row: 0, value, variance: 0.04 }],
                    disturbances: vec![(1, 0.01)],
                    transition: 0,
                })
                .collect(),
            mean: vec![0.0, 0.0],
            covariance: vec![1.0, 0.0, 0.0, 0.25],
        }
    }

    /// Covariance of the measurements of [`walk`], and of each with the position at stage 3, written out by hand.
    fn joint_covariance() -> nalgebra::DMatrix<f64> {
        nalgebra::DMatrix::from_fn(6, 6, |i, k| {
            let (a, b) = (i.min(k) as f64, i.max(k) as f64);
            let drift = 0.25 * a * b;
            // Σ over disturbances q entering at stage s < a of (a − s)(b − s).
            let walk: f64 = (0..i.min(k)).map(|s| 0.01 * (a - s as f64) * (b - s as f64)).sum();
            1.0 + drift + walk + if i == k { 0.04 } else { 0.0 }
        })
    }

    #[test]
    fn likelihood_and_whitening_are_those_of_the_joint_gaussian() {
        let model = walk();
        let covariance = joint_covariance();
        let z = nalgebra::DVector::from_iterator(6, model.stages.iter().map(|s| s.measurements[0].value));
        let inverse = covariance.clone().try_inverse().unwrap();
        let quadratic = (z.transpose() * &inverse * &z)[0];
        let expected = -0.5 * (quadratic + covariance.determinant().ln() + 6.0 * std::f64::consts::TAU.ln());
        assert!((model.log_likelihood() - expected).abs() < 1e-10);
        let other = nalgebra::DVector::from_vec(vec![1.0, -2.0, 0.5, 0.0, 3.0, 1.0]);
        let whitener = model.whitener();
        let inner = dot(&whitener.whiten(z.as_slice()), &whitener.whiten(other.as_slice()));
        assert!((inner - (z.transpose() * &inverse * &other)[0]).abs() < 1e-9);
    }

    #[test]
    fn smoothed_states_and_their_variance_are_the_conditional_gaussian() {
        let model = walk();
        let covariance = joint_covariance();
        let z = nalgebra::DVector::from_iterator(6, model.stages.iter().map(|s| s.measurements[0].value));
        let smoothed = model.smooth(&[1.0, 0.0]);
        let with_position = nalgebra::DVector::from_fn(6, |i, _| covariance[(3, i)] - if i == 3 { 0.04 } else { 0.0 });
        let weights = covariance.clone().try_inverse().unwrap() * &with_position;
        assert!((smoothed.states[3 * 2] - weights.dot(&z)).abs() < 1e-9);
        let variance = covariance[(3, 3)] - 0.04 - weights.dot(&with_position);
        assert!((smoothed.functional_variance[3] - variance).abs() < 1e-9);
    }

    #[test]
    fn the_score_of_a_shock_is_the_slope_of_the_likelihood() {
        let model = walk();
        let smoothed = model.smooth(&[1.0, 0.0]);
        // A shock s to the drift after stage 2 moves later measurements by s (k − 2).
        let shocked = |s: f64| {
            let mut moved = model.clone();
            for (k, stage) in moved.stages.iter_mut().enumerate().skip(3) {
                stage.measurements[0].value -= s * (k as f64 - 2.0);
            }
            moved.log_likelihood()
        };
        let slope = (shocked(1e-4) - shocked(-1e-4)) / 2e-4;
        let curvature = (shocked(1e-2) - 2.0 * shocked(0.0) + shocked(-1e-2)) / 1e-4;
        assert!((smoothed.score[2 * 2 + 1] - slope).abs() < 1e-6);
        assert!((smoothed.information[2 * 2 + 1] + curvature).abs() < 1e-4);
    }
}
