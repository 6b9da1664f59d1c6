//! A heat path as a few states: its slowest modes behind the film, and one for all faster ones together.
//!
//! ```text
//! dx_i/dt = λ_i (u − x_i),   T_j = Σ_i a_ji x_i + ρ_j u + T_j^heat(t),   Σ_i a_ji + ρ_j = steady response (1 for a layer)
//! the last:  a_jf/λ_f = Σ_fast a_ji/λ_i in every row,   λ_f = Σ_j |Σ_fast a_ji/λ_i| / Σ_j |Σ_fast a_ji/λ_i²|
//! ```
//!
//! So each row lags behind a slow drive by exactly what all modes make, and behind a turbulent one by what the fast modes do on
//! the whole: a coil whose winding cancels its slow modes is left with the fast ones.
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | u | the drive: the air outside the film, or a half space's outermost layer | K | – |
//! | x_i, λ_i | state of mode i, 1 per kelvin of the drive in equilibrium; its decay | K, 1/s | `decay_per_s` |
//! | a_ji, ρ_j | share of a mode, and of the drive itself, in an output | 1 | `amplitude`, `residue` |
//! | T^heat | what the bore's heat and an unsteady start add, over all modes | K | [`Reduced::own_k`] |
//!
//! A half space has no modes; a sum of exponentials with decays spaced evenly in the logarithm is fitted to its response
//! over the times that a record knows.
//!
//! # Source
//! Modal truncation with static residue, as in any text on structural dynamics; moments of what is truncated: Antoulas, Approximation of
//! Large-Scale Dynamical Systems (2005), chapter 11; the exponentials as in `thermal::half_space_memory`.

use nalgebra::{DMatrix, DVector};

use super::half_space::HalfSpace;
use super::modal::heated_mode;
use super::pack::Pack;
use super::{BoreHeat, Extent, HeatPath, Location, ThermalError};
use crate::numeric::order::sort_descending;

/// A heat path's slow part.
///
/// # Shapes
/// Outputs: the layers' means, innermost first, then (with a heated flange) their first axial moments. Rows: these, and the part that
/// carries the sensor, where it is one. `amplitude` is row-major rows × modes.
#[derive(Debug, Clone)]
pub(crate) struct Reduced {
    pub(crate) layers: usize,
    pub(crate) outputs: usize,
    /// The row of the part that carries the sensor.
    pub(crate) part: Option<usize>,
    /// Ascending.
    pub(crate) decay_per_s: Vec<f64>,
    pub(crate) amplitude: Vec<f64>,
    pub(crate) residue: Vec<f64>,
    own: Option<OwnCourse>,
}

/// What changes by itself, over all modes.
#[derive(Debug, Clone)]
struct OwnCourse {
    decay_per_s: Vec<f64>,
    heat: Option<(BoreHeat, DMatrix<f64>)>,
    start: Option<DMatrix<f64>>,
}

/// Points in time at which a half space's response is fitted.
const FIT_POINTS: usize = 80;

impl Reduced {
    /// At most `modes` states, and the temperature of a part around the coil that carries the sensor; a half space is fitted between `shortest_s` and `longest_s`.
    ///
    /// # Errors
    /// As [`Pack::new`]; a half space whose fit is singular; a part that is not there.
    pub(crate) fn new(
        path: &HeatPath,
        part: Option<Location>,
        modes: usize,
        shortest_s: f64,
        longest_s: f64,
    ) -> Result<Self, ThermalError> {
        match path.extent {
            Extent::Pack => Ok(Self::of_pack(&Pack::with_part(path, part)?, part.is_some(), modes)),
            Extent::HalfSpace => Self::of_half_space(path, modes, shortest_s, longest_s),
        }
    }

    fn of_pack(pack: &Pack, has_part: bool, modes: usize) -> Self {
        let joint = pack.joint();
        let rows = pack.outputs;
        let outputs = rows - usize::from(has_part);
        // What a mode takes away while the drive ramps; where a flange is heated the slowest modes need not matter most.
        let lag = |i: usize| joint.amplitude.column(i).iter().map(|a| a.abs()).sum::<f64>() / pack.decay_per_s[i];
        let mut all: Vec<usize> = (0..pack.modes()).collect();
        sort_descending(&mut all, |item| lag(*item));
        let (mut kept, fast) = match pack.modes() > modes {
            true => (all[..modes - 1].to_vec(), all[modes - 1..].to_vec()),
            false => (all, Vec::new()),
        };
        kept.sort_unstable();
        // Σ_fast a_ji/λ_i^power of each row.
        let moment = |power: i32| {
            let of = |j: usize| fast.iter().map(|&i| joint.amplitude[(j, i)] / pack.decay_per_s[i].powi(power)).sum();
            (0..rows).map(of).collect::<Vec<f64>>()
        };
        let delays_s = moment(1);
        let size = |moments: &[f64]| moments.iter().map(|m| m.abs()).sum::<f64>();
        let together_per_s = size(&delays_s) / size(&moment(2));
        let mut reduced = Self {
            layers: pack.layers,
            outputs,
            part: has_part.then_some(outputs),
            decay_per_s: kept.iter().map(|&i| pack.decay_per_s[i]).collect(),
            amplitude: Vec::new(),
            residue: joint.steady.as_slice().to_vec(),
            own: (pack.heat.is_some() || pack.start.is_some()).then(|| OwnCourse {
                decay_per_s: pack.decay_per_s.clone(),
                heat: pack.heat.clone(),
                start: pack.start.as_ref().map(|start| start.content.clone()),
            }),
        };
        reduced.decay_per_s.extend((!fast.is_empty()).then_some(together_per_s));
        for (j, delay_s) in delays_s.iter().enumerate() {
            let own = kept.iter().map(|&i| joint.amplitude[(j, i)]);
            let own = own.chain((!fast.is_empty()).then_some(together_per_s * delay_s));
            for a in own {
                reduced.amplitude.push(a);
                reduced.residue[j] -= a;
            }
        }
        reduced
    }

    fn of_half_space(path: &HeatPath, modes: usize, shortest_s: f64, longest_s: f64) -> Result<Self, ThermalError> {
        let half_space = HalfSpace::new(path);
        let layers = path.shape.layers;
        let over = |i: usize, count: usize, low: f64, high: f64| low * (high / low).powf(i as f64 / (count - 1) as f64);
        let (slowest, fastest) = (0.5 / longest_s, 1.0 / shortest_s);
        let decay_per_s: Vec<f64> = (0..modes).map(|i| over(i, modes, slowest, fastest)).collect();
        let times: Vec<f64> = (0..FIT_POINTS).map(|i| over(i, FIT_POINTS, 0.25 * shortest_s, longest_s)).collect();
        let design = DMatrix::from_fn(FIT_POINTS, modes, |t, i| (-decay_per_s[i] * times[t]).exp());
        let mut wanted = DMatrix::zeros(FIT_POINTS, layers);
        let mut rates = vec![0.0; layers];
        for (t, &time_s) in times.iter().enumerate() {
            half_space.step_rates(time_s, &mut rates);
            for (j, rate) in rates.iter().enumerate() {
                wanted[(t, j)] = 1.0 - rate;
            }
        }
        let found = design.svd(true, true).solve(&wanted, 1e-9).map_err(|_| ThermalError::Eigen)?;
        let amplitude: Vec<f64> =
            (0..layers).flat_map(|j| found.column(j).iter().copied().collect::<Vec<_>>()).collect();
        let residue = amplitude.chunks_exact(modes).map(|row| 1.0 - row.iter().sum::<f64>()).collect();
        let own = path.start.map(|start| OwnCourse {
            heat: None,
            start: Some(DMatrix::from_fn(layers, modes, |j, i| {
                let behind_s = -(-decay_per_s[i] * start.lasted_s).exp_m1() / decay_per_s[i];
                -start.rate_k_per_s * found[(i, j)] * behind_s
            })),
            decay_per_s: decay_per_s.clone(),
        });
        Ok(Self { layers, outputs: layers, part: None, decay_per_s, amplitude, residue, own })
    }

    pub(crate) fn modes(&self) -> usize {
        self.decay_per_s.len()
    }

    /// a_ji of one output.
    pub(crate) fn row(&self, output: usize) -> &[f64] {
        &self.amplitude[output * self.modes()..(output + 1) * self.modes()]
    }

    /// The temperatures of all rows while an air drives the pack that was in equilibrium with its first value; the air is straight
    /// between times.
    pub(crate) fn driven(&self, times_s: &[f64], air_k: &[f64]) -> Vec<f64> {
        let mut modes = vec![air_k[0]; self.modes()];
        let mut out = Vec::with_capacity(air_k.len() * self.residue.len());
        for k in 0..air_k.len() {
            if k > 0 {
                let step_s = times_s[k] - times_s[k - 1];
                let slope = (air_k[k] - air_k[k - 1]) / step_s;
                for (x, l) in modes.iter_mut().zip(&self.decay_per_s) {
                    let lag = slope / l;
                    *x = air_k[k] - lag + (*x - air_k[k - 1] + lag) * (-l * step_s).exp();
                }
            }
            for (j, residue) in self.residue.iter().enumerate() {
                let sum: f64 = self.row(j).iter().zip(&modes).map(|(a, x)| a * x).sum();
                out.push(sum + residue * air_k[k]);
            }
        }
        out
    }

    /// What the bore's heat, and a start that was not steady, add to each row so long after power-on; None without either.
    pub(crate) fn own_k(&self, since_s: f64) -> Option<Vec<f64>> {
        let own = self.own.as_ref()?;
        let left = DVector::from_iterator(
            own.decay_per_s.len(),
            own.decay_per_s.iter().map(|&l| (-l * since_s.max(0.0)).exp()),
        );
        let mut sum = own.start.as_ref().map_or_else(|| DVector::zeros(self.residue.len()), |start| start * &left);
        if let Some((heat, content)) = &own.heat {
            let building = (-since_s / heat.time_constant_s).exp();
            let contents = own.decay_per_s.iter().zip(left.iter());
            let contents = contents.map(|(&l, &left)| heated_mode(heat, l, since_s, left, building).0);
            sum += content * DVector::from_iterator(own.decay_per_s.len(), contents);
        }
        Some(sum.as_slice().to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::thermal::{Drive, Instant, Location, PackMaterial, PackShape, solve};

    fn path(extent: Extent) -> HeatPath {
        let shape = PackShape { layers: 24, bore_radius_m: 0.04, radial_pitch_m: 165e-6, height_m: 8e-3 };
        let material = PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
        HeatPath::new(shape, extent, material, Location::Ambient)
    }

    /// Outputs after a ramp of one kelvin a second has lasted so long, from rest.
    fn ramped(reduced: &Reduced, time_s: f64) -> Vec<f64> {
        (0..reduced.outputs)
            .map(|j| {
                let steady = reduced.row(j).iter().sum::<f64>() + reduced.residue[j];
                let lag = |(a, l): (&f64, &f64)| a * (1.0 - (-l * time_s).exp()) / l;
                steady * time_s - reduced.row(j).iter().zip(&reduced.decay_per_s).map(lag).sum::<f64>()
            })
            .collect()
    }

    #[test]
    fn five_modes_of_a_pack_behind_a_film_are_the_pack_to_a_few_millikelvin() {
        let mut path = path(Extent::Pack);
        path.film_w_per_m2_k = Some(25.0);
        path.bore_heat = Some(BoreHeat { power_w_per_m2: 100.0, time_constant_s: 500.0 });
        let reduced = Reduced::new(&path, None, 5, 10.0, 1e4).unwrap();
        let drive = Drive::boundary(PiecewiseLinear::new(vec![0.0, 900.0], vec![0.0, 15.0]).unwrap());
        let field = solve(&path, &drive).unwrap();
        for time_s in [10.0, 60.0, 300.0, 900.0] {
            let exact = field.at(&[Instant::after(time_s)]);
            let heat = reduced.own_k(time_s).unwrap();
            for (j, ramp) in ramped(&reduced, time_s).iter().enumerate() {
                let found = ramp * 15.0 / 900.0 + heat[j];
                assert!((found - exact.temperatures_k(0)[j]).abs() < 1e-4, "{time_s} {j}");
            }
        }
    }

    #[test]
    fn each_row_lags_behind_a_slow_drive_as_with_all_modes() {
        let mut path = path(Extent::Pack);
        path.film_w_per_m2_k = Some(25.0);
        let reduced = |modes: usize| Reduced::new(&path, None, modes, 10.0, 1e4).unwrap();
        let delays_s = |reduced: &Reduced| -> Vec<f64> {
            let of = |j: usize| reduced.row(j).iter().zip(&reduced.decay_per_s).map(|(a, l)| a / l).sum();
            (0..reduced.outputs).map(of).collect()
        };
        let all = reduced(usize::MAX);
        for modes in [3, 6] {
            let few = reduced(modes);
            assert_eq!(few.modes(), modes);
            for (found, exact) in delays_s(&few).iter().zip(delays_s(&all)) {
                assert!((found / exact - 1.0).abs() < 1e-9, "{found} s for {exact} s");
            }
            let steady = |reduced: &Reduced| reduced.row(5).iter().sum::<f64>() + reduced.residue[5];
            assert!((steady(&few) - steady(&all)).abs() < 1e-12);
        }
    }

    #[test]
    fn eight_exponentials_are_a_half_space_within_a_sixtieth() {
        let mut path = path(Extent::HalfSpace);
        path.location = Location::OuterLayer;
        let reduced = Reduced::new(&path, None, 8, 10.0, 15_000.0).unwrap();
        let half_space = HalfSpace::new(&path);
        let mut exact = vec![0.0; 24];
        for time_s in [10.0_f64, 40.0, 200.0, 1000.0, 6000.0, 14_000.0] {
            half_space.step_rates(time_s, &mut exact);
            for (j, exact) in exact.iter().enumerate() {
                let left = reduced.row(j).iter().zip(&reduced.decay_per_s);
                let found = 1.0 - left.map(|(a, l)| a * (-l * time_s).exp()).sum::<f64>();
                assert!((found - exact).abs() < 1.0 / 60.0, "{time_s} s, layer {j}: {found} for {exact}");
            }
        }
    }
}
