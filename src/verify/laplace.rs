//! The response of a linear heat network to a unit ramp, by inverting its Laplace transform.
//!
//! ```text
//! (s C + G) T̂ = b û,   û = 1/s²          f(t) = (1/2πi) ∫ e^{st} f̂(s) ds
//! s(u) = μ (1 + iu)²,   u = (k + ½) h,   h = √(8Λ + 1)/N,   μ = π N/(4 √(8Λ + 1) t₁)     for t₁/Λ ≤ t ≤ t₁
//! ```
//!
//! The trapezoidal rule on the parabola converges as e^{−2πN/√(8Λ+1)}; all singularities of a conducting network lie on
//! the negative real axis, which the parabola encloses. There is no time step and no eigenmode of the pack.
//!
//! # Source
//! J. A. C. Weideman, L. N. Trefethen, Math. Comp. 76 (2007) 1341, section 4 (parabola, a window of times).

use nalgebra::Complex;

use super::network::Network;
use super::physics::BoreHeat;

/// Λ: the latest time of a window over its earliest.
const WINDOW: f64 = 4.0;
/// N: rates are off by 1e−14 of the drive's, temperatures by 1e−13 of its rise.
const NODES: usize = 34;
/// Before this no heat has come anywhere.
const EARLIEST_S: f64 = 1e-9;

#[derive(Debug, Clone)]
struct Node {
    s: Complex<f64>,
    weight: Complex<f64>,
    /// Transforms of the layers' rates, then of their first axial moments' rates.
    ramp: Vec<Complex<f64>>,
    heated: Option<Vec<Complex<f64>>>,
}

/// Rates and temperatures of the layers at any time after a unit ramp began, and of the bore's heat alone.
#[derive(Debug, Clone)]
pub(super) struct Response {
    layers: usize,
    outermost_is_drive: bool,
    has_moments: bool,
    /// The last time of each window, ascending.
    ends_s: Vec<f64>,
    windows: Vec<Vec<Node>>,
}

impl Response {
    pub fn new(network: &Network, heat: Option<BoreHeat>, longest_s: f64) -> Self {
        let root = (8.0 * WINDOW + 1.0).sqrt();
        let step = root / NODES as f64;
        let modes = network.axis.as_ref().map(|axis| axis.modes(network.conductivity_w_per_m_k));
        let (mut ends_s, mut windows) = (Vec::new(), Vec::new());
        let mut end_s = EARLIEST_S;
        while ends_s.last().is_none_or(|last| *last < longest_s) {
            end_s *= WINDOW;
            let scale = std::f64::consts::PI * NODES as f64 / (4.0 * root * end_s);
            let node = |k: usize| {
                let along = Complex::new(1.0, (k as f64 + 0.5) * step);
                let s = scale * along * along;
                // f(t) = (h/π) Σ Im(e^{st} f̂ ds/du) over the upper half.
                let weight = Complex::new(0.0, 1.0) * along * (2.0 * scale * step / std::f64::consts::PI);
                let (ramp, heated) = transform(network, modes.as_deref(), heat, s);
                Node { s, weight, ramp, heated }
            };
            windows.push((0..NODES).map(node).collect());
            ends_s.push(end_s);
        }
        Self {
            layers: network.layers,
            outermost_is_drive: network.outermost_is_drive,
            has_moments: modes.is_some(),
            ends_s,
            windows,
        }
    }

    /// What two cuts, the finer with half the coarser's widths, tend to: their errors are of second order.
    pub fn extrapolated(mut finer: Self, coarser: &Self) -> Self {
        let mix = |fine: &mut Vec<Complex<f64>>, coarse: &[Complex<f64>]| {
            for (f, c) in fine.iter_mut().zip(coarse) {
                *f = (*f * 4.0 - c) / 3.0;
            }
        };
        for (fine, coarse) in finer.windows.iter_mut().flatten().zip(coarser.windows.iter().flatten()) {
            mix(&mut fine.ramp, &coarse.ramp);
            if let (Some(fine), Some(coarse)) = (&mut fine.heated, &coarse.heated) {
                mix(fine, coarse);
            }
        }
        finer
    }

    pub fn has_moments(&self) -> bool {
        self.has_moments
    }

    /// Adds `factor` times the response to a unit ramp that has lasted for a while (a moment, at 0) to rates,
    /// temperatures (unless there is no place for them) and moments' rates.
    pub fn add_ramp(&self, factor: f64, lasted_s: f64, rate: &mut [f64], rise: &mut [f64], moment: &mut [f64]) {
        self.add(factor, lasted_s, |node| Some(&node.ramp), rate, rise, moment);
        if self.outermost_is_drive {
            rate[self.layers - 1] += factor;
            if let Some(rise) = rise.get_mut(self.layers - 1) {
                *rise += factor * lasted_s;
            }
        }
    }

    /// Adds what the bore's heat has done since it began.
    pub fn add_heat(&self, lasted_s: f64, rate: &mut [f64], rise: &mut [f64], moment: &mut [f64]) {
        self.add(1.0, lasted_s, |node| node.heated.as_ref(), rate, rise, moment);
    }

    fn add<'a>(
        &'a self,
        factor: f64,
        lasted_s: f64,
        of: impl Fn(&'a Node) -> Option<&'a Vec<Complex<f64>>>,
        rate: &mut [f64],
        rise: &mut [f64],
        moment: &mut [f64],
    ) {
        if lasted_s < EARLIEST_S {
            return;
        }
        let window = self.ends_s.partition_point(|end| *end < lasted_s).min(self.windows.len() - 1);
        for node in &self.windows[window] {
            let Some(values) = of(node) else { return };
            let of_rate = node.weight * (node.s * lasted_s).exp() * factor;
            let of_rise = of_rate / node.s;
            let (of_means, of_moments) = values.split_at(self.layers);
            for (sum, factor, values) in
                [(&mut *rate, of_rate, of_means), (&mut *rise, of_rise, of_means), (&mut *moment, of_rate, of_moments)]
            {
                for (sum, value) in sum.iter_mut().zip(values) {
                    *sum += factor.re * value.im + factor.im * value.re;
                }
            }
        }
    }
}

type Transforms = (Vec<Complex<f64>>, Option<Vec<Complex<f64>>>);

/// s T̂ of every layer (and of its moment) under a unit ramp, and under the bore's heat.
fn transform(
    network: &Network,
    modes: Option<&[super::network::AxialMode]>,
    heat: Option<BoreHeat>,
    s: Complex<f64>,
) -> Transforms {
    let (n, layers) = (network.nodes(), network.layers);
    let k = network.conductivity_w_per_m_k;
    let links: Vec<f64> = network.links.iter().map(|l| l.conductance(k)).collect();
    let outputs = layers * if modes.is_some() { 2 } else { 1 };
    let mut ramp = vec![Complex::new(0.0, 0.0); outputs];
    let mut heated = heat.map(|_| vec![Complex::new(0.0, 0.0); outputs]);
    let uniform = super::network::AxialMode { decay_per_s: 0.0, sum: 1.0, from_air_per_s: 0.0, moment: 0.0 };
    let slices = modes.map_or(1.0, |modes| modes.len() as f64);
    let (mut diagonal, mut driven, mut warmed) = (vec![s; n], vec![s; n], vec![s; n]);
    for mode in modes.unwrap_or(&[uniform]) {
        for i in 0..n {
            let inner = if i > 0 { links[i - 1] } else { network.mount };
            let from_air = if i < network.spool { 0.0 } else { network.capacity[i] };
            diagonal[i] = s * network.capacity[i] + inner + links[i] + from_air * mode.decay_per_s;
            let outside = if i == 0 { network.mount } else { 0.0 } + if i + 1 == n { links[i] } else { 0.0 };
            driven[i] = (outside * mode.sum + from_air * mode.from_air_per_s).into();
            warmed[i] = if i == 0 { (network.bore_radius_m * mode.sum).into() } else { 0.0.into() };
        }
        for i in 1..n {
            let share = links[i - 1] / diagonal[i - 1];
            let (before, before_warmed) = (driven[i - 1], warmed[i - 1]);
            diagonal[i] -= share * links[i - 1];
            driven[i] += share * before;
            warmed[i] += share * before_warmed;
        }
        for right in [&mut driven, &mut warmed] {
            for i in (0..n).rev() {
                let after = if i + 1 < n { links[i] * right[i + 1] } else { 0.0.into() };
                right[i] = (right[i] + after) / diagonal[i];
            }
        }
        // s û = 1/s; s q̂ = q∞/(1 + s τ).
        let by_heat = heat.map(|h| h.power_w_per_m2 / (s * h.time_constant_s + 1.0));
        for layer in 0..network.solved_layers() {
            let mean =
                |of: &[Complex<f64>]| network.shares(layer).map(|(i, share)| of[i] * share).sum::<Complex<f64>>();
            let put = |out: &mut [Complex<f64>], value: Complex<f64>| {
                out[layer] += value * (mode.sum / slices);
                if modes.is_some() {
                    out[layers + layer] += value * mode.moment;
                }
            };
            put(&mut ramp, mean(&driven) / s);
            if let (Some(heated), Some(factor)) = (&mut heated, by_heat) {
                put(heated, mean(&warmed) * factor);
            }
        }
    }
    (ramp, heated)
}

#[cfg(test)]
mod tests {
    use super::super::network::Link;
    use super::*;

    /// One node behind a film: θ' = 1 − e^{−t/T}.
    #[test]
    fn one_node_follows_its_exponential_over_thirteen_decades() {
        let constant_s = 30.0;
        let network = Network {
            layers: 1,
            cells_per_layer: 1,
            spool: 0,
            capacity: vec![constant_s],
            links: vec![Link::film(1.0)],
            mount: 0.0,
            bore_radius_m: 1.0,
            outermost_is_drive: false,
            conductivity_w_per_m_k: 1.0,
            slope_per_k: 0.0,
            axis: None,
        };
        let response = Response::new(&network, None, 1e5);
        let mut worst = 0.0_f64;
        for i in 0..400 {
            let t = 1e-8 * 10f64.powf(13.0 * f64::from(i) / 399.0);
            let (mut rate, mut rise) = ([0.0], [0.0]);
            response.add_ramp(1.0, t, &mut rate, &mut rise, &mut []);
            let exact = -(-t / constant_s).exp_m1();
            worst = worst.max((rate[0] - exact).abs()).max((rise[0] - (t - constant_s * exact)).abs() / t);
        }
        println!("largest error {worst:.1e}");
        assert!(worst < 1e-12);
    }
}
