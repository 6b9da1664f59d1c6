//! A pack whose axis meets parts of one temperature each: a spool that conducts along it, its flanges, housings around all.
//!
//! ```text
//! dq/dt = −Λ q + P e + b_q u,   de/dt = −E e + Pᵀ q + b_e u           y = (q, e),   dy/dt = −M y + b u
//! y ≈ V z,   V: (M + σ_k)⁻¹ b,   σ_k = 0 and evenly spaced in the logarithm;   dz/dt = −(VᵀMV) z + Vᵀb u
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | q, Λ | contents and decays of the pack's modes, products of radial and axial ones, while the parts stand still | –, 1/s | `decay_per_s` |
//! | e, E | the parts: the spool in the axial modes, flanges, housings | –, 1/s | `own` |
//! | P | what joins them | 1/s | `couplings` |
//! | u, b | drive, ambient, the bore's heat, and what each drives | K, W/m² | `inputs` |
//! | σ_k | shifts | 1/s | `shifts` |
//!
//! All are scaled by the root of their heat capacity, so that M is symmetric. A few dozen directions V hold what thousands of
//! modes do: what M makes of b is found to about e^{−2π²/ln ρ} where the shifts are a factor ρ apart. σ = 0 keeps the steady
//! state exact. A flange or a housing has one temperature; the spool's wall has one across its thickness.
//!
//! # Source
//! Component modes with fixed interfaces: Craig and Bampton, AIAA J. 6 (1968) 1313. Rational Krylov spaces: Druskin,
//! Knizhnerman, Zaslavsky, SIAM J. Sci. Comput. 31 (2009) 3760.

use nalgebra::{DMatrix, DVector};

use super::network::{AxialElements, Network};
use super::pack::{AxialModes, Mode, part_node};
use super::{HeatPath, Location, ThermalError};
use crate::numeric::tridiagonal::diagonalise_full;

/// ρ.
const SHIFT_RATIO: f64 = 1.7;
/// A direction that others hold up to this share is left out.
const HELD: f64 = 1e-9;
/// Steps of the inverse iteration for the slowest decay, which only places the shifts.
const SLOWEST_STEPS: usize = 12;

/// A coupling of a pack's mode with a part.
#[derive(Debug, Clone, Copy)]
struct Coupling {
    part: usize,
    per_s: f64,
}

/// M, and what drives it.
struct Joined {
    decay_per_s: Vec<f64>,
    /// Of each of the pack's modes.
    couplings: Vec<Vec<Coupling>>,
    /// E.
    own: DMatrix<f64>,
    /// Drive, ambient, heat, start; modes first, then parts.
    inputs: [Vec<f64>; 4],
    /// Outputs × modes of the pack.
    seen: DMatrix<f64>,
    /// Of the parts, what the temperature of the one that is asked for is made of; empty without one.
    part: Vec<(usize, f64)>,
}

/// The parts' places among the unknowns.
struct Places {
    /// First of the spool's axial modes, if there is a spool.
    spool: Option<usize>,
    /// Of each of the path's flanges; None: it is the drive.
    flanges: Vec<Option<usize>>,
    /// First housing, and how many.
    housings: (usize, usize),
    count: usize,
}

impl Places {
    fn new(path: &HeatPath, network: &Network, axial_modes: usize) -> Self {
        let mut count = 0;
        let mut take = |n: usize| {
            count += n;
            count - n
        };
        let spool = (network.spool_nodes > 0).then(|| take(axial_modes));
        let flanges = path
            .spool_flanges
            .iter()
            .map(|flange| (path.location != Location::Flange(flange.flange)).then(|| take(1)))
            .collect();
        let housing_count = network.nodes() - network.pack().end;
        let housings = (take(housing_count), housing_count);
        Self { spool, flanges, housings, count }
    }

    /// What a part inside the housings faces: the innermost of them, or the ambient.
    fn around(&self) -> Option<usize> {
        (self.housings.1 > 0).then_some(self.housings.0)
    }
}

/// The modes of everything together.
pub(super) fn modes(
    path: &HeatPath,
    network: &Network,
    axial: &AxialModes,
    part: Option<Location>,
) -> Result<Vec<Mode>, ThermalError> {
    let joined = Joined::new(path, network, axial, part)?;
    let basis = joined.basis()?;
    joined.projected(&basis)
}

impl Joined {
    #[expect(clippy::too_many_lines, reason = "one assembly: every coupling is taken from the same rows")]
    fn new(
        path: &HeatPath,
        network: &Network,
        axial: &AxialModes,
        part: Option<Location>,
    ) -> Result<Self, ThermalError> {
        let axis = AxialElements::new(path).ok_or(ThermalError::Eigen)?;
        let places = Places::new(path, network, axial.mean.len());
        let (pack, layers) = (network.pack(), network.layers);
        let n = network.pack_nodes;
        let operator = network.operator();
        let roots: Vec<f64> = network.capacity[pack.clone()].iter().map(|c| c.sqrt()).collect();
        let matrix = DMatrix::from_fn(n, n, |i, j| operator[(pack.start + i, pack.start + j)] / (roots[i] * roots[j]));
        let boundary = network.boundary();
        let (mut rows, base) = (DMatrix::zeros(layers + 6, n), layers);
        for i in 0..n {
            let (node, root) = (pack.start + i, roots[i]);
            for layer in 0..layers {
                rows[(layer, i)] = network.shares[(layer, node)] / root;
            }
            rows[(base, i)] = boundary[node] / root;
            rows[(base + 1, i)] = network.to_ambient[node] / root;
            rows[(base + 2, i)] = if places.spool.is_none() && i == 0 { network.heated / root } else { 0.0 };
            // A uniform field, and what the spool and the innermost housing warm.
            rows[(base + 3, i)] = root;
            rows[(base + 4, i)] = if places.spool.is_some() { -operator[(node, 0)] / root } else { 0.0 };
            rows[(base + 5, i)] = if places.housings.1 > 0 { -operator[(node, pack.end)] / root } else { 0.0 };
        }
        let radial_per_s = diagonalise_full(matrix, &mut rows).map_err(|_| ThermalError::Eigen)?;

        // Per radian and height, as the network: heat capacity and area of the pack's face.
        let heat_capacity = network.conductivity_w_per_m_k / path.material.diffusivity_m2_per_s();
        let face = network.capacity[pack.clone()].iter().sum::<f64>() / heat_capacity / path.shape.height_m;
        let area_per_uniform = 1.0 / heat_capacity / path.shape.height_m;
        let start = path.start;
        let mut joined = Self {
            decay_per_s: Vec::new(),
            couplings: Vec::new(),
            own: DMatrix::zeros(places.count, places.count),
            inputs: [(); 4].map(|()| Vec::new()),
            seen: DMatrix::zeros(2 * layers, n * axial.mean.len()),
            part: Vec::new(),
        };
        let ends: Vec<(usize, f64)> = axis.flanges.clone();
        let plain = ends.len() - path.spool_flanges.len();
        let capacities = joined.fill_parts(path, network, axial, &axis, &places, face);
        if let Some(part) = part {
            let own = match part {
                Location::Spool => {
                    places.spool.map(|first| (0..axial.mean.len()).map(|m| (first + m, axial.mean[m])).collect())
                }
                Location::Flange(flange) => {
                    let index = path.spool_flanges.iter().position(|own| own.flange == flange);
                    index.and_then(|index| places.flanges[index]).map(|place| vec![(place, 1.0)])
                }
                other => part_node(path, network, other).map(|node| vec![(places.housings.0 + node - pack.end, 1.0)]),
            };
            let own: Vec<(usize, f64)> = own.ok_or(ThermalError::Eigen)?;
            joined.part = own.into_iter().map(|(place, share)| (place, share / capacities[place].sqrt())).collect();
        }
        let around = places.around();
        let mut of_modes = [(); 4].map(|()| Vec::new());
        for m in 0..axial.mean.len() {
            for i in 0..n {
                let mode = m * n + i;
                joined.decay_per_s.push(radial_per_s[i] + axial.diffusivity_m2_per_s * axial.decay_per_m2[m]);
                let mut couplings = Vec::new();
                let mut couple = |part: usize, per_s: f64| {
                    if per_s != 0.0 {
                        couplings.push(Coupling { part, per_s: per_s / capacities[part].sqrt() });
                    }
                };
                let (mut drive, mut ambient) =
                    (rows[(base, i)] * axial.uniform[m], rows[(base + 1, i)] * axial.uniform[m]);
                if let Some(first) = places.spool {
                    couple(first + m, rows[(base + 4, i)]);
                }
                let mut from_housing = rows[(base + 5, i)] * axial.uniform[m];
                for (index, &(place, _)) in ends.iter().enumerate() {
                    // Of the face, by what a uniform field has of it.
                    let at_end = rows[(base + 3, i)] * area_per_uniform * axial.places[(place, m)];
                    if index < plain {
                        let films = [path.flange, path.opposite_flange];
                        let film = films.into_iter().flatten().nth(index).map_or(0.0, |f| f.film_w_per_m2_k);
                        match around {
                            Some(_) => from_housing += film * at_end,
                            None => ambient += film * at_end,
                        }
                    } else {
                        let contact = path.spool_flanges[index - plain].contact_w_per_m2_k;
                        match places.flanges[index - plain] {
                            Some(part) => couple(part, contact * at_end),
                            None => drive += contact * at_end,
                        }
                    }
                }
                if let Some(part) = around {
                    couple(part, from_housing);
                }
                joined.couplings.push(couplings);
                let warm = start.map_or(0.0, |s| s.pack_above_k) * rows[(base + 3, i)] * axial.uniform[m];
                let heat = rows[(base + 2, i)] * axial.uniform[m];
                for (input, value) in of_modes.iter_mut().zip([drive, ambient, heat, warm]) {
                    input.push(value);
                }
                for layer in 0..layers {
                    joined.seen[(layer, mode)] = axial.mean[m] * rows[(layer, i)];
                    joined.seen[(layers + layer, mode)] = axial.moment[m] * rows[(layer, i)];
                }
            }
        }
        for (input, of_modes) in joined.inputs.iter_mut().zip(of_modes) {
            input.splice(0..0, of_modes);
        }
        Ok(joined)
    }

    /// E and what drives the parts; their heat capacities.
    #[expect(clippy::too_many_lines, reason = "one assembly: every part adds to the same matrix and inputs")]
    fn fill_parts(
        &mut self,
        path: &HeatPath,
        network: &Network,
        axial: &AxialModes,
        axis: &AxialElements,
        places: &Places,
        face: f64,
    ) -> Vec<f64> {
        let (count, start) = (places.count, path.start);
        let mut capacities = vec![1.0; count];
        let mut own = DMatrix::zeros(count, count);
        let mut inputs = [(); 4].map(|()| vec![0.0; count]);
        let join = |own: &mut DMatrix<f64>, a: usize, b: usize, conductance: f64| {
            own[(a, a)] += conductance;
            own[(b, b)] += conductance;
            own[(a, b)] -= conductance;
            own[(b, a)] -= conductance;
        };
        let operator = network.operator();
        let (first_housing, housings) = places.housings;
        for i in 0..housings {
            let node = network.pack().end + i;
            capacities[first_housing + i] = network.capacity[node];
            inputs[0][first_housing + i] = network.to_drive[node];
            inputs[1][first_housing + i] = network.to_ambient[node];
            inputs[3][first_housing + i] = start.map_or(0.0, |s| s.housing_above_k);
            for j in 0..housings {
                own[(first_housing + i, first_housing + j)] = operator[(node, network.pack().end + j)];
            }
        }
        if let (Some(first), Some(spool)) = (places.spool, path.spool) {
            let along = path
                .spool_wall
                .map_or(0.0, |wall| wall.conductivity_w_per_m_k * wall.thickness_m * path.shape.bore_radius_m);
            let stiffness = axial.places.tr_mul(&(&axis.stiffness_per_m2 * &axial.places)) * along;
            for m in 0..axial.mean.len() {
                capacities[first + m] = network.capacity[0];
                own[(first + m, first + m)] += operator[(0, 0)];
                inputs[0][first + m] = network.to_drive[0] * axial.uniform[m];
                inputs[1][first + m] = network.to_ambient[0] * axial.uniform[m];
                inputs[2][first + m] = network.heated * axial.uniform[m];
                inputs[3][first + m] = start.map_or(0.0, |s| s.spool_above_k) * axial.uniform[m];
                for other in 0..axial.mean.len() {
                    own[(first + m, first + other)] += stiffness[(m, other)];
                }
                if let Some(housing) = places.around() {
                    // The mount: its diagonals are in the operator already.
                    let mount = spool.mount_w_per_m2_k * path.shape.bore_radius_m * axial.uniform[m];
                    own[(first + m, housing)] -= mount;
                    own[(housing, first + m)] -= mount;
                }
            }
        }
        // Films of the pack's own faces warm the housing too.
        if let Some(housing) = places.around() {
            let films = path.flange.into_iter().chain(path.opposite_flange);
            own[(housing, housing)] += films.map(|f| f.film_w_per_m2_k * face).sum::<f64>();
        }
        let plain = axis.flanges.len() - path.spool_flanges.len();
        for (index, (flange, part)) in path.spool_flanges.iter().zip(&places.flanges).enumerate() {
            let film = flange.film_w_per_m2_k * face;
            // From the wall's end to the middle of the flange, through metal as thick as the wall.
            let depth_m = 0.5 * path.shape.layers as f64 * path.shape.radial_pitch_m;
            let joint = path.spool_wall.filter(|_| places.spool.is_some()).map_or(0.0, |wall| {
                wall.conductivity_w_per_m_k * wall.thickness_m * path.shape.bore_radius_m
                    / (depth_m * path.shape.height_m)
            });
            let end = axial.places.row(axis.flanges[plain + index].0);
            if let Some(part) = *part {
                capacities[part] = flange.heat_capacity_j_per_m2_k * face;
                own[(part, part)] += flange.contact_w_per_m2_k * face + joint;
                inputs[3][part] = start.map_or(0.0, |s| s.spool_above_k);
                match places.around() {
                    Some(housing) => join(&mut own, part, housing, film),
                    None => {
                        own[(part, part)] += film;
                        inputs[1][part] += film;
                    }
                }
            } else if let Some(housing) = places.around() {
                own[(housing, housing)] += film;
                inputs[0][housing] += film;
            }
            let Some(first) = places.spool.filter(|_| joint > 0.0) else { continue };
            for (m, at_end) in end.iter().enumerate() {
                for (other, there) in end.iter().enumerate() {
                    own[(first + m, first + other)] += joint * at_end * there;
                }
                match *part {
                    Some(part) => {
                        own[(first + m, part)] -= joint * at_end;
                        own[(part, first + m)] -= joint * at_end;
                    }
                    None => inputs[0][first + m] += joint * at_end,
                }
            }
        }
        let roots: Vec<f64> = capacities.iter().map(|c| c.sqrt()).collect();
        self.own = DMatrix::from_fn(count, count, |a, b| own[(a, b)] / (roots[a] * roots[b]));
        for (kind, input) in inputs.iter_mut().enumerate() {
            // Drive, ambient and heat are flows, the start is a temperature.
            input.iter_mut().zip(&roots).for_each(|(v, root)| *v *= if kind < 3 { 1.0 / root } else { *root });
        }
        self.inputs = inputs;
        capacities
    }

    fn size(&self) -> usize {
        self.decay_per_s.len() + self.own.nrows()
    }

    /// M y.
    fn times(&self, y: &[f64]) -> Vec<f64> {
        let (q, e) = y.split_at(self.decay_per_s.len());
        let mut out: Vec<f64> = self.decay_per_s.iter().zip(q).map(|(l, q)| l * q).collect();
        let mut parts: Vec<f64> = (&self.own * DVector::from_column_slice(e)).as_slice().to_vec();
        for ((out, q), couplings) in out.iter_mut().zip(q).zip(&self.couplings) {
            for c in couplings {
                *out -= c.per_s * e[c.part];
                parts[c.part] -= c.per_s * q;
            }
        }
        out.extend(parts);
        out
    }

    /// (M + σ)⁻¹ of each right side: the pack's modes are eliminated.
    fn solve(&self, shift_per_s: f64, rights: &[Vec<f64>]) -> Result<Vec<Vec<f64>>, ThermalError> {
        let mut schur = self.own.clone();
        for i in 0..schur.nrows() {
            schur[(i, i)] += shift_per_s;
        }
        for (l, couplings) in self.decay_per_s.iter().zip(&self.couplings) {
            for a in couplings {
                for b in couplings {
                    schur[(a.part, b.part)] -= a.per_s * b.per_s / (l + shift_per_s);
                }
            }
        }
        let factors = schur.cholesky().ok_or(ThermalError::Eigen)?;
        let solved = rights.iter().map(|right| {
            let (q, e) = right.split_at(self.decay_per_s.len());
            let mut parts = DVector::from_column_slice(e);
            for ((l, q), couplings) in self.decay_per_s.iter().zip(q).zip(&self.couplings) {
                couplings.iter().for_each(|c| parts[c.part] += c.per_s * q / (l + shift_per_s));
            }
            let parts = factors.solve(&parts);
            let mut out = Vec::with_capacity(right.len());
            for ((l, q), couplings) in self.decay_per_s.iter().zip(q).zip(&self.couplings) {
                let from_parts: f64 = couplings.iter().map(|c| c.per_s * parts[c.part]).sum();
                out.push((q + from_parts) / (l + shift_per_s));
            }
            out.extend(parts.iter());
            out
        });
        Ok(solved.collect())
    }

    /// σ_k: zero, then from the slowest decay to the fastest.
    fn shifts(&self, rights: &[Vec<f64>]) -> Result<Vec<f64>, ThermalError> {
        let mut slow: Vec<f64> = (0..self.size()).map(|i| rights.iter().map(|r| r[i]).sum::<f64>()).collect();
        let mut slowest_per_s = f64::INFINITY;
        for _ in 0..SLOWEST_STEPS {
            let norm = slow.iter().map(|v| v * v).sum::<f64>().sqrt();
            slow.iter_mut().for_each(|v| *v /= norm);
            let next = self.solve(0.0, std::slice::from_ref(&slow))?.swap_remove(0);
            let along: f64 = next.iter().zip(&slow).map(|(a, b)| a * b).sum();
            slowest_per_s = 1.0 / along;
            slow = next;
        }
        let fastest_per_s = self.decay_per_s.iter().copied().fold(self.own.diagonal().amax(), f64::max);
        if !(slowest_per_s > 0.0 && fastest_per_s.is_finite() && fastest_per_s >= slowest_per_s) {
            return Err(ThermalError::Eigen);
        }
        let count = ((fastest_per_s / slowest_per_s).ln() / SHIFT_RATIO.ln()).ceil() as i32;
        Ok(std::iter::once(0.0).chain((0..=count).map(|k| slowest_per_s * SHIFT_RATIO.powi(k))).collect())
    }

    /// V, orthonormal, one direction a row.
    fn basis(&self) -> Result<Vec<Vec<f64>>, ThermalError> {
        let rights: Vec<Vec<f64>> = self.inputs.iter().filter(|b| b.iter().any(|v| *v != 0.0)).cloned().collect();
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for shift_per_s in self.shifts(&rights)? {
            for mut direction in self.solve(shift_per_s, &rights)? {
                let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                let before = dot(&direction, &direction).sqrt();
                // Twice: once leaves what rounding puts back.
                for _ in 0..2 {
                    for held in &basis {
                        let along = dot(held, &direction);
                        direction.iter_mut().zip(held).for_each(|(d, h)| *d -= along * h);
                    }
                }
                let left = dot(&direction, &direction).sqrt();
                if left > HELD * before {
                    direction.iter_mut().for_each(|d| *d /= left);
                    basis.push(direction);
                }
            }
        }
        Ok(basis)
    }

    /// The modes of VᵀMV.
    fn projected(&self, basis: &[Vec<f64>]) -> Result<Vec<Mode>, ThermalError> {
        let count = basis.len();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let images: Vec<Vec<f64>> = basis.iter().map(|v| self.times(v)).collect();
        let matrix =
            DMatrix::from_fn(count, count, |a, b| 0.5 * (dot(&basis[a], &images[b]) + dot(&basis[b], &images[a])));
        let outputs = self.seen.nrows() + usize::from(!self.part.is_empty());
        let mut rows = DMatrix::zeros(outputs + self.inputs.len(), count);
        for (v, direction) in basis.iter().enumerate() {
            let q = DVector::from_column_slice(&direction[..self.decay_per_s.len()]);
            rows.view_mut((0, v), (self.seen.nrows(), 1)).copy_from(&(&self.seen * q));
            if !self.part.is_empty() {
                let parts = &direction[self.decay_per_s.len()..];
                rows[(outputs - 1, v)] = self.part.iter().map(|(place, share)| share * parts[*place]).sum();
            }
            for (kind, input) in self.inputs.iter().enumerate() {
                rows[(outputs + kind, v)] = dot(input, direction);
            }
        }
        let decay_per_s = diagonalise_full(matrix, &mut rows).map_err(|_| ThermalError::Eigen)?;
        let mode = |i: usize| Mode {
            decay_per_s: decay_per_s[i],
            seen: rows.column(i).rows(0, outputs).iter().copied().collect(),
            boundary: rows[(outputs, i)],
            ambient: rows[(outputs + 1, i)],
            heat: rows[(outputs + 2, i)],
            start: rows[(outputs + 3, i)],
        };
        Ok((0..count).map(mode).collect())
    }
}
