//! What a half space remembers of a long record, as a sum of exponentials.
//!
//! ```text
//! erfc(x/√(4Kt)) = 1 − (2/π) ∫_0^∞ e^{−s²t} sin(s x/√K)/s ds ≈ 1 − Σ_i a_i(x) e^{−s_i² t},   a_i = (2/π) h sin(s_i x/√K)
//! ```
//!
//! with s_i equidistant in ln s (step h), where the trapezium rule converges exponentially. Changes of the boundary's
//! rate that are older than [`RECENT_S`] are carried in the s_i, so a record costs its rows times the number of s_i
//! instead of the square of its rows. Younger changes keep the closed form, in which nothing is oscillating.
//!
//! # Source
//! Carslaw and Jaeger, Conduction of Heat in Solids (1959), section 2.4; the trapezium rule: Trefethen and Weideman, SIAM
//! Rev. 56 (2014) 385.

/// Changes of rate younger than this are superposed in closed form [s].
pub(super) const RECENT_S: f64 = 100.0;
/// Step in ln s.
const STEP: f64 = 0.05;
/// Below this s [1/√s] nothing decays within any record: √(1/10¹⁶ s).
const LEAST_S: f64 = 1e-8;
/// e^{−s² RECENT_S} at the largest s.
const LARGEST_EXPONENT: f64 = 42.0;

/// The old changes of rate of one drive, at one time.
#[derive(Debug, Clone)]
pub(super) struct HalfSpaceMemory {
    /// s_i² [1/s].
    decay_per_s: Vec<f64>,
    /// Row-major, layers × decays: a_i(x_j).
    amplitude: Vec<f64>,
    /// What the decays beyond the largest, long over, took away from a layer's rise per unit of slope [s].
    settled_s: Vec<f64>,
    time_s: f64,
    /// Σ Δk and Σ Δk (t − t_q).
    slope: f64,
    rise: f64,
    /// Σ Δk e^{−s²(t−t_q)} and its integral over t.
    content: Vec<f64>,
    integral: Vec<f64>,
    /// e^{−s² dt} and (1 − e^{−s² dt})/s² of the last step.
    step_s: f64,
    left: Vec<f64>,
    gone: Vec<f64>,
}

impl HalfSpaceMemory {
    /// `rise_s` is each layer's exact rise [`RECENT_S`] after a unit change of rate.
    pub(crate) fn new(depths_m: &[f64], rise_s: &[f64], diffusivity_m2_per_s: f64, start_s: f64) -> Self {
        let largest = (LARGEST_EXPONENT / RECENT_S).sqrt();
        let count = ((largest / LEAST_S).ln() / STEP).ceil() as usize;
        let nodes: Vec<f64> = (0..count).map(|i| LEAST_S * (STEP * i as f64).exp()).collect();
        let amplitude = depths_m
            .iter()
            .flat_map(|x| {
                let delay = x / diffusivity_m2_per_s.sqrt();
                nodes.iter().map(move |s| std::f64::consts::FRAC_2_PI * STEP * (s * delay).sin())
            })
            .collect();
        let mut memory = Self {
            decay_per_s: nodes.iter().map(|s| s * s).collect(),
            amplitude,
            settled_s: vec![0.0; depths_m.len()],
            time_s: start_s,
            slope: 0.0,
            rise: 0.0,
            content: vec![0.0; count],
            integral: vec![0.0; count],
            step_s: 0.0,
            left: vec![1.0; count],
            gone: vec![0.0; count],
        };
        let mut one = memory.clone();
        one.absorb(1.0, RECENT_S);
        memory.settled_s = rise_s.iter().enumerate().map(|(j, exact_s)| one.rate_and_rise(j).1 - exact_s).collect();
        memory
    }

    /// Moves on to a later time.
    pub(crate) fn advance(&mut self, time_s: f64) {
        let step_s = time_s - self.time_s;
        self.time_s = time_s;
        self.rise += self.slope * step_s;
        self.step(step_s);
        for i in 0..self.content.len() {
            self.integral[i] += self.content[i] * self.gone[i];
            self.content[i] *= self.left[i];
        }
    }

    /// Takes in a change of rate that happened some time ago.
    pub(crate) fn absorb(&mut self, change: f64, elapsed_s: f64) {
        self.slope += change;
        self.rise += change * elapsed_s;
        self.step(elapsed_s);
        for i in 0..self.content.len() {
            self.integral[i] += change * self.gone[i];
            self.content[i] += change * self.left[i];
        }
    }

    fn step(&mut self, step_s: f64) {
        if step_s != self.step_s {
            self.step_s = step_s;
            for ((left, gone), decay) in self.left.iter_mut().zip(&mut self.gone).zip(&self.decay_per_s) {
                *left = (-decay * step_s).exp();
                *gone = -(-decay * step_s).exp_m1() / decay;
            }
        }
    }

    /// What the old changes contribute to a layer's rate and to its temperature.
    pub(crate) fn rate_and_rise(&self, layer: usize) -> (f64, f64) {
        let row = &self.amplitude[layer * self.content.len()..(layer + 1) * self.content.len()];
        let (mut rate, mut rise) = (self.slope, self.rise - self.slope * self.settled_s[layer]);
        for ((a, content), integral) in row.iter().zip(&self.content).zip(&self.integral) {
            rate -= a * content;
            rise -= a * integral;
        }
        (rate, rise)
    }
}
