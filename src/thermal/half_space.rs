//! The paper's temperature model: the outermost layer in front of a half space.
//!
//! ```text
//! Ṫ_j(t) = Σ_q k_q { erfc( x_j/√(4K(t−t_{q−1})) ) − erfc( x_j/√(4K(t−t_q)) ) },   x_j = (N−j)·pitch
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | K | thermal diffusivity | m²/s | `diffusivity_m2_per_s` |
//! | x_j | depth below the outermost layer | m | `depth_m` |
//! | k_q | rate of the boundary on piece q | K/s | slope of `Drive::boundary_k` |
//!
//! Holds for times short against (pack thickness)²/K; leaves out the bore, curvature and everything behind it.
//!
//! # Source
//! Yan, Lan, Jian, Acta Optica Sinica (1998), Eqs. (9)–(12), with these corrections: (7) must divide by t√π; (9) has
//! a spurious minus under the root; in the third line of (12) k3 belongs with t−t2 and t−t1−t2 is t−t2.

use std::collections::HashMap;

use libm::erfc;

use super::half_space_memory::{HalfSpaceMemory, RECENT_S};
use super::{Drive, HeatPath, Instant, Side, ThermalHistory, WantedColumns};

/// With so many changes of rate, superposing all of them at every instant is too slow.
const MANY_KINKS: usize = 100;
/// Times since a change that differ by less are one [s].
const SAME_TIME_S: f64 = 1e-6;

#[derive(Debug, Clone)]
pub struct HalfSpace {
    diffusivity_m2_per_s: f64,
    depths_m: Vec<f64>,
}

impl HalfSpace {
    pub(crate) fn new(path: &HeatPath) -> Self {
        let layers = path.shape.layers;
        Self {
            diffusivity_m2_per_s: path.material.diffusivity_m2_per_s(),
            depths_m: (0..layers).map(|j| (layers - 1 - j) as f64 * path.shape.radial_pitch_m).collect(),
        }
    }

    /// erfc(x/√(4Kt)), its right limit at t = 0, and 0 before.
    fn step_rate(&self, depth_m: f64, time_s: f64) -> f64 {
        if time_s < 0.0 {
            0.0
        } else if depth_m == 0.0 {
            1.0
        } else if time_s == 0.0 {
            0.0
        } else {
            erfc(depth_m / (4.0 * self.diffusivity_m2_per_s * time_s).sqrt())
        }
    }

    /// ∫_0^t of the step response: (t + x²/2K) erfc(x/√(4Kt)) − x √(t/πK) e^{−x²/4Kt}.
    fn ramp_temperature(&self, depth_m: f64, time_s: f64) -> f64 {
        if time_s <= 0.0 {
            return 0.0;
        }
        let k = self.diffusivity_m2_per_s;
        let u = depth_m / (4.0 * k * time_s).sqrt();
        (time_s + depth_m * depth_m / (2.0 * k)) * erfc(u)
            - depth_m * (time_s / (std::f64::consts::PI * k)).sqrt() * (-u * u).exp()
    }

    pub(crate) fn step_rates(&self, time_s: f64, layers: &mut [f64]) {
        for (rate, &depth_m) in layers.iter_mut().zip(&self.depths_m) {
            *rate = self.step_rate(depth_m, time_s);
        }
    }

    /// The tail is x/√(πKt); behind this time it is smooth and monotonic.
    pub(crate) fn settling_s(&self) -> f64 {
        let depth_m = self.depths_m[0];
        1e4 * depth_m * depth_m / self.diffusivity_m2_per_s
    }

    pub(crate) fn shortest_s(&self) -> f64 {
        let pitch_m = self.depths_m[self.depths_m.len() - 2];
        pitch_m * pitch_m / (4.0 * self.diffusivity_m2_per_s)
    }
}

/// A half space under one drive, by superposition of the responses to each change of the boundary's rate.
#[derive(Debug, Clone)]
pub struct HalfSpaceField {
    half_space: HalfSpace,
    drive: Drive,
    /// Time and size of each change of rate.
    kinks: Vec<(f64, f64)>,
}

impl HalfSpaceField {
    pub(crate) fn new(half_space: HalfSpace, drive: &Drive) -> Self {
        let boundary = &drive.boundary_k;
        let mut previous = 0.0;
        let kinks = boundary
            .knots()
            .iter()
            .enumerate()
            .map(|(i, &time_s)| {
                let slope = boundary.slope_of(i);
                let change = slope - previous;
                previous = slope;
                (time_s, change)
            })
            .filter(|&(_, change)| change != 0.0)
            .collect();
        Self { half_space, drive: drive.clone(), kinks }
    }

    /// A drive with many kinks, asked for in the order of time, is remembered in exponentials; see `half_space_memory`.
    pub(super) fn at(&self, instants: &[Instant], wanted: WantedColumns) -> ThermalHistory {
        if self.kinks.len() > MANY_KINKS && instants.is_sorted_by(|a, b| a.time_s <= b.time_s) {
            self.at_by_memory(instants, wanted)
        } else {
            self.at_by_superposition(instants, wanted)
        }
    }

    fn acting(&self, instant: Instant) -> usize {
        match instant.side {
            Side::After => self.kinks.partition_point(|k| k.0 <= instant.time_s),
            Side::Before => self.kinks.partition_point(|k| k.0 < instant.time_s),
        }
    }

    fn at_by_memory(&self, instants: &[Instant], wanted: WantedColumns) -> ThermalHistory {
        let layers = self.half_space.depths_m.len();
        let mut history = ThermalHistory::with_capacity(layers, instants.len());
        let start_k = self.drive.boundary_k.first_value();
        let start_s = instants.first().map_or(0.0, |i| i.time_s).min(self.drive.start_s());
        let depths_m = &self.half_space.depths_m;
        let rise_s: Vec<f64> = depths_m.iter().map(|x| self.half_space.ramp_temperature(*x, RECENT_S)).collect();
        let mut memory = HalfSpaceMemory::new(depths_m, &rise_s, self.half_space.diffusivity_m2_per_s, start_s);
        // Knots mostly lie on a grid, so the same few times since a change come again and again.
        let mut known: HashMap<u64, Vec<(f64, f64)>> = HashMap::new();
        let mut absorbed = 0;
        for &instant in instants {
            memory.advance(instant.time_s);
            let acting = self.acting(instant);
            while absorbed < acting && instant.time_s - self.kinks[absorbed].0 > RECENT_S {
                memory.absorb(self.kinks[absorbed].1, instant.time_s - self.kinks[absorbed].0);
                absorbed += 1;
            }
            let mut layer_values: Vec<(f64, f64)> = (0..layers).map(|j| memory.rate_and_rise(j)).collect();
            for &(time_s, change) in &self.kinks[absorbed..acting] {
                let elapsed_s = instant.time_s - time_s;
                let responses = known.entry((elapsed_s / SAME_TIME_S).round() as u64).or_insert_with(|| {
                    let of = |x: &f64| {
                        (self.half_space.step_rate(*x, elapsed_s), self.half_space.ramp_temperature(*x, elapsed_s))
                    };
                    self.half_space.depths_m.iter().map(of).collect()
                });
                for (value, response) in layer_values.iter_mut().zip(responses) {
                    value.0 += change * response.0;
                    value.1 += change * response.1;
                }
            }
            history.times_s.push(instant.time_s);
            if wanted.rates() {
                history.rate_k_per_s.extend(layer_values.iter().map(|v| v.0));
            }
            if wanted.temperatures() {
                history.temperature_k.extend(layer_values.iter().map(|v| start_k + v.1));
            }
            super::push_ambient(&mut history, &self.drive, instant);
        }
        history
    }

    fn at_by_superposition(&self, instants: &[Instant], wanted: WantedColumns) -> ThermalHistory {
        let layers = self.half_space.depths_m.len();
        let mut history = ThermalHistory::with_capacity(layers, instants.len());
        let start_k = self.drive.boundary_k.first_value();
        for instant in instants {
            history.times_s.push(instant.time_s);
            let kinks = &self.kinks[..self.acting(*instant)];
            for &depth_m in &self.half_space.depths_m {
                let superposed = |response: fn(&HalfSpace, f64, f64) -> f64| -> f64 {
                    kinks
                        .iter()
                        .map(|&(time_s, change)| change * response(&self.half_space, depth_m, instant.time_s - time_s))
                        .sum()
                };
                if wanted.rates() {
                    history.rate_k_per_s.push(superposed(HalfSpace::step_rate));
                }
                if wanted.temperatures() {
                    history.temperature_k.push(start_k + superposed(HalfSpace::ramp_temperature));
                }
            }
            super::push_ambient(&mut history, &self.drive, *instant);
        }
        history
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::thermal::{Extent, Location, PackMaterial, PackShape};

    #[test]
    fn the_temperature_is_the_integral_of_the_rate() {
        let shape = PackShape { layers: 12, bore_radius_m: 0.036, radial_pitch_m: 250e-6, height_m: 0.018 };
        let path = HeatPath::new(
            shape,
            Extent::HalfSpace,
            PackMaterial::Diffusivity { m2_per_s: 2.7e-7 },
            Location::OuterLayer,
        );
        let drive = Drive::boundary(PiecewiseLinear::new(vec![0.0, 20.0, 50.0], vec![290.0, 294.0, 291.0]).unwrap());
        let field = HalfSpaceField::new(HalfSpace::new(&path), &drive);
        let steps = 40_000;
        let times: Vec<Instant> = (0..=steps).map(|i| Instant::after(60.0 * i as f64 / steps as f64)).collect();
        let history = field.at(&times, WantedColumns::All);
        for layer in 0..12 {
            let trapezium: f64 = (0..steps)
                .map(|i| {
                    0.5 * (history.rates_k_per_s(i)[layer] + history.rates_k_per_s(i + 1)[layer]) * 60.0 / steps as f64
                })
                .sum();
            assert!((history.temperatures_k(steps)[layer] - 290.0 - trapezium).abs() < 1e-3, "layer {layer}");
        }
    }

    #[test]
    fn the_memory_of_a_long_record_is_the_superposition_of_all_its_changes() {
        let shape = PackShape { layers: 12, bore_radius_m: 0.036, radial_pitch_m: 250e-6, height_m: 0.018 };
        let path = HeatPath::new(
            shape,
            Extent::HalfSpace,
            PackMaterial::Diffusivity { m2_per_s: 2.7e-7 },
            Location::OuterLayer,
        );
        let knots: Vec<f64> = (0..2000).map(|i| 5.0 * f64::from(i)).collect();
        let values = knots.iter().map(|t| 293.0 + 20.0 * (t / 900.0).sin() + 0.005 * (t - 4000.0).max(0.0)).collect();
        let drive = Drive::boundary(PiecewiseLinear::new(knots, values).unwrap());
        let field = HalfSpaceField::new(HalfSpace::new(&path), &drive);
        let times: Vec<Instant> = (0..300).map(|i| Instant::before(33.0 * f64::from(i) - 10.0)).collect();
        let fast = field.at_by_memory(&times, WantedColumns::All);
        let slow = field.at_by_superposition(&times, WantedColumns::All);
        let worst = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let (rate, temperature) =
            (worst(&fast.rate_k_per_s, &slow.rate_k_per_s), worst(&fast.temperature_k, &slow.temperature_k));
        println!("largest difference: {rate:.1e} K/s, {temperature:.1e} K");
        assert!(rate < 1e-8 && temperature < 1e-5);
    }
}
