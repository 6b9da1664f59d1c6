//! The response of a linear pack to a unit ramp, by inverting its Laplace transform ([`super::parts`]).
//!
//! ```text
//! û = 1/s²          f(t) = (1/2πi) ∫ e^{st} f̂(s) ds
//! s(u) = μ (1 + iu)²,   u = (k + ½) h,   h = √(8Λ + 1)/N,   μ = π N/(4 √(8Λ + 1) t₁)     for t₁/Λ ≤ t ≤ t₁
//! ```
//!
//! The trapezoidal rule on the parabola converges as e^{−2πN/√(8Λ+1)}; all singularities of a conducting pack lie on
//! the negative real axis, which the parabola encloses. There is no time step and no eigenmode of the pack.
//!
//! # Source
//! J. A. C. Weideman, L. N. Trefethen, Math. Comp. 76 (2007) 1341, section 4 (parabola, a window of times).

use nalgebra::Complex;

use super::parts::{Parts, Transforms};
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
    of: Transforms,
}

/// Rates and temperatures of the layers at any time after a unit ramp began, and of the bore's heat alone.
#[derive(Debug, Clone)]
pub(super) struct Response {
    layers: usize,
    outermost_is_drive: bool,
    has_moments: bool,
    /// By how much the layers begin warmer than the drive, those that are not the drive.
    above_k: f64,
    /// The last time of each window, ascending.
    ends_s: Vec<f64>,
    windows: Vec<Vec<Node>>,
}

impl Response {
    pub(crate) fn new(parts: &Parts, heat: Option<BoreHeat>, longest_s: f64) -> Self {
        let pack = &parts.pack;
        Self {
            has_moments: parts.has_moments(),
            above_k: parts.pack_above_k,
            ..Self::of(pack.layers, pack.outermost_is_drive, longest_s, |s| parts.transform(heat, s))
        }
    }

    /// Of layers at so many depths below the boundary of a half space, the outermost at it: 1/s e^{−x√(s/K)}.
    pub(crate) fn half_space(depths_m: &[f64], diffusivity_m2_per_s: f64, longest_s: f64) -> Self {
        let transform = |s: Complex<f64>| {
            let q = (s / diffusivity_m2_per_s).sqrt();
            let at = |depth_m: &f64| match *depth_m {
                0.0 => Complex::new(0.0, 0.0),
                depth_m => (-q * depth_m).exp() / s,
            };
            Transforms { ramp: depths_m.iter().map(at).collect(), heated: None, started: None }
        };
        Self::of(depths_m.len(), true, longest_s, transform)
    }

    /// `transform`: s T̂ of every layer, but of an outermost one that is the drive.
    fn of(
        layers: usize,
        outermost_is_drive: bool,
        longest_s: f64,
        transform: impl Fn(Complex<f64>) -> Transforms,
    ) -> Self {
        let root = (8.0 * WINDOW + 1.0).sqrt();
        let step = root / NODES as f64;
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
                Node { s, weight, of: transform(s) }
            };
            windows.push((0..NODES).map(node).collect());
            ends_s.push(end_s);
        }
        Self { layers, outermost_is_drive, has_moments: false, above_k: 0.0, ends_s, windows }
    }

    pub(crate) fn has_moments(&self) -> bool {
        self.has_moments
    }

    /// Adds `factor` times the response to a unit ramp that has lasted for a while (a moment, at 0) to rates,
    /// temperatures (unless there is no place for them) and moments' rates.
    pub(crate) fn add_ramp(&self, factor: f64, lasted_s: f64, rate: &mut [f64], rise: &mut [f64], moment: &mut [f64]) {
        self.add(factor, lasted_s, |node| Some(&node.of.ramp), rate, rise, moment);
        if self.outermost_is_drive {
            rate[self.layers - 1] += factor;
            if let Some(rise) = rise.get_mut(self.layers - 1) {
                *rise += factor * lasted_s;
            }
        }
    }

    /// The first and the last time of each window, ascending.
    pub(crate) fn windows_s(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let starts_s = std::iter::once(EARLIEST_S).chain(self.ends_s.iter().copied());
        starts_s.zip(self.ends_s.iter().copied())
    }

    /// Lets time pass over what ramps have added up to at the nodes of a window.
    pub(crate) fn pass(&self, window: usize, sums: &mut [Complex<f64>], time_s: f64) {
        self.windows[window].iter().zip(sums).for_each(|(node, sum)| *sum *= (node.s * time_s).exp());
    }

    /// Adds a ramp that has lasted for a while to what stands at the nodes of a window.
    pub(crate) fn gather(&self, window: usize, sums: &mut Vec<Complex<f64>>, factor: f64, lasted_s: f64) {
        sums.resize(NODES, Complex::new(0.0, 0.0));
        for (node, sum) in self.windows[window].iter().zip(sums) {
            *sum += (node.s * lasted_s).exp() * factor;
        }
    }

    /// As [`Response::add_ramp`] for all ramps that were gathered at a window's nodes, so much later; without what an outermost
    /// layer that is the drive itself does.
    pub(crate) fn add_gathered(
        &self,
        window: usize,
        sums: &[Complex<f64>],
        later_s: f64,
        rate: &mut [f64],
        rise: &mut [f64],
        moment: &mut [f64],
    ) {
        for (node, sum) in self.windows[window].iter().zip(sums) {
            self.add_node(node, &node.of.ramp, (node.s * later_s).exp() * sum, rate, rise, moment);
        }
    }

    pub(crate) fn outermost_is_drive(&self) -> bool {
        self.outermost_is_drive
    }

    /// Adds what the bore's heat has done since the beginning, and what is left of an uneven start.
    pub(crate) fn add_own(&self, lasted_s: f64, rate: &mut [f64], rise: &mut [f64], moment: &mut [f64]) {
        // Parts that differ are at work from the first instant on.
        let lasted_s = lasted_s.max(EARLIEST_S);
        self.add(1.0, lasted_s, |node| node.of.heated.as_ref(), rate, rise, moment);
        self.add(1.0, lasted_s, |node| node.of.started.as_ref(), rate, rise, moment);
        let solved = self.layers - usize::from(self.outermost_is_drive);
        rise.iter_mut().take(solved).for_each(|rise| *rise += self.above_k);
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
            self.add_node(node, values, (node.s * lasted_s).exp() * factor, rate, rise, moment);
        }
    }

    fn add_node(
        &self,
        node: &Node,
        values: &[Complex<f64>],
        factor: Complex<f64>,
        rate: &mut [f64],
        rise: &mut [f64],
        moment: &mut [f64],
    ) {
        let of_rate = node.weight * factor;
        let of_rise = of_rate / node.s;
        let (of_means, of_moments) = values.split_at(self.layers);
        for (sum, factor, values) in
            [(rate, of_rate, of_means), (rise, of_rise, of_means), (moment, of_rate, of_moments)]
        {
            for (sum, value) in sum.iter_mut().zip(values) {
                *sum += factor.re * value.im + factor.im * value.re;
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::coil::{Coil, CoilSpec, Fibre, LayerLength};
    use crate::rate::CoilModel;
    use crate::thermal::{Extent, Location, PackMaterial};
    use crate::verify::physics::Physics;

    pub(crate) fn model() -> CoilModel {
        let fibre = Fibre {
            refractive_index: 1.45,
            thermo_optic_per_k: 1e-5,
            group_index: None,
            thermal_expansion_per_k: 0.0,
            wavelength_m: 1.55e-6,
            outer_diameter_m: 165e-6,
        };
        let spec = CoilSpec {
            fibre,
            layers: 4,
            turns_per_layer: Some(50.0),
            bore_radius_m: 0.04,
            radial_pitch_m: 165e-6,
            axial_pitch_m: 170e-6,
            layer_length: LayerLength::Actual,
            length_m: None,
        };
        CoilModel {
            name: "four".into(),
            coil: Coil::new(spec).unwrap(),
            extent: Extent::Pack,
            material: PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 },
            location: Location::Ambient,
            rate_mean_s: 0.0,
            cells_per_layer: 1,
            effects: vec![],
        }
    }

    /// A pack that conducts so well that it is one capacity behind its film: θ' = 1 − e^{−t/T}.
    #[test]
    fn a_well_conducting_pack_follows_its_exponential_over_ten_decades() {
        let model = model();
        let mut physics = Physics::read(&model).unwrap();
        (physics.conductivity_w_per_m_k, physics.film_w_per_m2_k) = (1e6, Some(20.0));
        let (inner_m, outer_m) =
            (model.coil.bore_radius_m(), model.coil.bore_radius_m() + 4.0 * model.coil.radial_pitch_m());
        let constant_s =
            physics.heat_capacity_j_per_m3_k * (outer_m.powi(2) - inner_m.powi(2)) / (2.0 * 20.0 * outer_m);
        let response = Response::new(&Parts::new(&model, &physics, 0.01), None, 1e5);
        let mut worst = 0.0_f64;
        for i in 0..400 {
            let t = 1e-5 * 10f64.powf(10.0 * f64::from(i) / 399.0);
            let (mut rate, mut rise) = (vec![0.0; 4], vec![0.0; 4]);
            response.add_ramp(1.0, t, &mut rate, &mut rise, &mut []);
            let exact = -(-t / constant_s).exp_m1();
            worst = worst.max((rate[1] - exact).abs()).max((rise[1] - (t - constant_s * exact)).abs() / t);
        }
        println!("largest error {worst:.1e}");
        assert!(worst < 2e-6);
    }
}
