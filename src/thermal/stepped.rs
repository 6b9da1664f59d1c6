//! A pack whose conductivity depends on temperature: the linear pack's modes, driven by what the dependence adds.
//!
//! ```text
//! k = k_m (1 + a θ),   θ = T − T_m,   k ∇T = k_m ∇(θ + ν),   ν = a θ²/2
//! T = T_linear + V c,   dc_i/dt = −λ_i c_i + g_i,   g = −V^T K ν,   e_i = dc_i/dt:   de_i/dt = −λ_i e_i + dg_i/dt
//! e_i(t) = e_i(0) e^{−λ_i t} + ∫_0^t e^{−λ_i (t−s)} g_i'(s) ds,   c_i = (g_i − e_i)/λ_i
//! ```
//!
//! | symbol | meaning | unit | in code |
//! |---|---|---|---|
//! | T_m | near the middle of the drive's range: there the modes are those of the pack itself | K | `middle_k` |
//! | ν | Kirchhoff's transform less the temperature | K | `bent` |
//! | λ_i, V | decay rates and modes of the linear pack at T_m | 1/s, – | `Modes` |
//! | g, c, e | what bends a mode, by how much, and at which rate | – | `bent`, `contents`, `rate` |
//!
//! T_linear is the exact solution of [`super::pack`] at T_m. For the rest time is cut into panels that grow behind every knot
//! of the drive, as long as ν is smooth in them (a drive with many knots was sampled: there panels span several). On a panel g is a polynomial through
//! Lobatto's nodes, under which every mode has a closed form however fast it is; g and the temperatures it makes are
//! found by repeated substitution, which gains a factor a θ/2 or so each time. What the outputs gain is a polynomial
//! through the same nodes.
//!
//! Holds for any drive under which the conductivity stays positive. With a = 0 it is the solution of [`super::pack`]; a
//! test compares the two.
//!
//! # Source
//! Kirchhoff's transformation: Carslaw and Jaeger (1959), section 1.6. Exponential collocation: Hochbruck and Ostermann,
//! Acta Numerica 19 (2010) 209, section 2.2.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::DMatrix;

use super::bending::{LinearisedPack, Track};
use super::modal::PackField;
use super::panel::{DEGREE, Panel, PanelWeights};
use super::varying::{Shared, Varying, conducting};
use super::{Drive, HeatPath, Instant, PackMaterial, Side, ThermalError, ThermalHistory, WantedColumns};
use crate::numeric::lobatto::Lobatto;
use crate::numeric::piecewise::PiecewiseLinear;

/// The first panel behind a knot that is tried, and the shortest, in units of the time in which heat crosses half a layer.
const FIRST: f64 = 128.0;
const SHORTEST: f64 = 0.5;
/// The next one is so many times as long, or the square of that where much less would do; one that bends too much is tried again
/// as much shorter.
const GROWTH: f64 = 4.0;
const EASY: f64 = 1e-3;
/// What the last term of ν changes at, as a share of the drive's rate: what is left out is a fraction of it.
const BENDING: f64 = 3e-6;
/// With so many knots the drive was sampled; a panel then spans some of them.
const SAMPLED_KNOTS: usize = 100;
const KNOTS_A_PANEL: usize = 4;
/// Substitution ends where temperatures change by less than this share of what they do in a panel …
const TOLERANCE: f64 = 1e-6;
/// … or of the drive's span.
const ROUNDING: f64 = 1e-12;
const MOST_SUBSTITUTIONS: usize = 200;
/// Lengths of panels whose weights are kept.
const MOST_KNOWN_LENGTHS: usize = 64;
/// What a solved panel leaves behind.
#[derive(Debug, Clone)]
struct Piece {
    from_s: f64,
    length_s: f64,
    /// Outputs × nodes: what they gain over the linear pack.
    value: DMatrix<f64>,
    rate: DMatrix<f64>,
}

/// A pack with variable conductivity under one drive.
#[derive(Debug, Clone)]
pub struct SteppedField {
    layers: usize,
    linear: PackField,
    pieces: Vec<Piece>,
    lobatto: Lobatto,
}

impl SteppedField {
    /// # Errors
    /// Values so extreme that nothing converges; a conductivity that does not stay positive.
    #[expect(clippy::too_many_lines, reason = "what is worked out once of a drive, then one loop over its panels")]
    pub(super) fn new(path: &HeatPath, varying: &Varying, drive: &Drive) -> Result<Self, ThermalError> {
        let (given, drive) = (drive, &path.start.map_or_else(|| drive.clone(), |start| drive.after(&start)));
        let values = || drive.boundary_k.values().iter().chain(drive.ambient_k().values()).copied();
        let (lowest_k, highest_k) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        let slope_per_k = path.conductivity_slope_per_k;
        let factor = |temperature_k: f64| conducting(path, temperature_k);
        for temperature_k in [lowest_k, highest_k] {
            if !(factor(temperature_k) > 0.0) {
                return Err(ThermalError::ConductivityNotPositive { temperature_k, slope_per_k });
            }
        }
        let shared = varying.about(path, 0.5 * (lowest_k + highest_k))?;
        let (system, middle_k) = (&shared.system, shared.middle_k);
        let settling_s = shared.settling_s * factor(middle_k) / factor(lowest_k).min(factor(highest_k));
        let warming_s = path.bore_heat.map_or(0.0, |heat| 40.0 * heat.time_constant_s);
        let mut knots: Vec<f64> = drive.boundary_k.knots().iter().chain(drive.ambient_k().knots()).copied().collect();
        knots.retain(|k| *k >= drive.start_s());
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        let last_s = knots[knots.len() - 1];
        let is_sampled = knots.len() > SAMPLED_KNOTS;
        if is_sampled {
            let mut index = 0;
            knots.retain(|knot| {
                index += 1;
                (index - 1) % KNOTS_A_PANEL == 0 || *knot == last_s
            });
        }
        knots.push(last_s + settling_s + warming_s);
        let panel = Panel::new()?;
        let ambient = drive.ambient_k();
        let mut march = March {
            shared: &shared,
            system,
            heated_s: given.start_s(),
            tracks: [(&drive.boundary_k, &system.by_boundary), (ambient, &system.by_ambient)]
                .into_iter()
                .filter(|(_, by_input)| by_input.iter().any(|b| *b != 0.0))
                .map(|(input, by_input)| Track::new(input, by_input))
                .collect(),
            drive,
            panel: &panel,
            span_k: 2.0 * (highest_k - middle_k).abs().max((lowest_k - middle_k).abs()),
            scale_k_per_s: scale_k_per_s(path, drive),
            shortest_s: 0.0,
            first_s: FIRST * shared.shortest_s,
            pieces: Vec::new(),
            weights: HashMap::new(),
        };
        let mut rate = vec![0.0; system.decay_per_s.len()];
        let mut bent = march.still()?;
        for pair in knots.windows(2) {
            let is_one = is_sampled && pair[1] <= last_s;
            let first_s = if is_one { pair[1] - pair[0] } else { march.first_s };
            march.shortest_s = if is_one { first_s } else { SHORTEST * shared.shortest_s };
            (rate, bent) = march.through(pair[0], pair[1], first_s, rate, bent)?;
        }
        let pieces = march.pieces;
        Ok(Self {
            layers: path.shape.layers,
            linear: PackField::new(Arc::clone(&shared.linear), given),
            pieces,
            lobatto: panel.lobatto,
        })
    }

    pub(super) fn at(&self, instants: &[Instant], wanted: WantedColumns) -> ThermalHistory {
        let mut history = self.linear.at(instants, wanted);
        let (layers, first) = (self.layers, &self.pieces[0]);
        for (row, &instant) in instants.iter().enumerate() {
            let before = instant.side == Side::Before;
            let is_past = |p: &Piece| if before { p.from_s < instant.time_s } else { p.from_s <= instant.time_s };
            let piece = &self.pieces[self.pieces.partition_point(is_past).saturating_sub(1)];
            let place = ((instant.time_s - piece.from_s) / piece.length_s).clamp(0.0, 1.0);
            let is_outside = instant.time_s < first.from_s || instant.time_s > piece.from_s + piece.length_s;
            let basis = nalgebra::DVector::from_vec(self.lobatto.basis(2.0 * place - 1.0));
            let add = |to: &mut [f64], from: &[f64]| {
                let width = from.len();
                to[row * width..(row + 1) * width].iter_mut().zip(from).for_each(|(to, from)| *to += from);
            };
            if wanted.temperatures() {
                let value = &piece.value * &basis;
                add(&mut history.temperature_k, &value.as_slice()[..layers]);
                add(&mut history.axial_moment_k, &value.as_slice()[layers..]);
            }
            if wanted.rates() && !is_outside {
                let rate = &piece.rate * &basis;
                add(&mut history.rate_k_per_s, &rate.as_slice()[..layers]);
                add(&mut history.axial_moment_k_per_s, &rate.as_slice()[layers..]);
            }
        }
        history
    }
}

/// What bends each mode at a time, and how it changes.
#[derive(Debug)]
struct Bent {
    value: Vec<f64>,
    slope_per_s: Vec<f64>,
}

/// What became of a panel.
enum Step {
    Done {
        rate: Vec<f64>,
        bent: Bent,
        /// ν is so smooth that the next one may be much longer.
        is_easy: bool,
    },
    TooLong,
}

/// The steepest slope of the drive, or what the bore's heat alone would make of the pack.
fn scale_k_per_s(path: &HeatPath, drive: &Drive) -> f64 {
    let steepest =
        |input: &PiecewiseLinear| (0..input.knots().len()).map(|i| input.slope_of(i).abs()).fold(0.0, f64::max);
    let thickness_m = path.shape.layers as f64 * path.shape.radial_pitch_m;
    let by_heat = match (path.bore_heat, path.material) {
        (Some(heat), PackMaterial::Conductivity { heat_capacity_j_per_m3_k, .. }) => {
            heat.power_w_per_m2.abs() / (heat_capacity_j_per_m3_k * thickness_m)
        }
        _ => 0.0,
    };
    steepest(&drive.boundary_k).max(steepest(drive.ambient_k())).max(by_heat)
}

/// On the way through a drive.
struct March<'a> {
    shared: &'a Shared,
    system: &'a LinearisedPack,
    /// When the bore's heat begins.
    heated_s: f64,
    tracks: Vec<Track<'a>>,
    drive: &'a Drive,
    panel: &'a Panel,
    span_k: f64,
    /// How fast the pack is made to warm.
    scale_k_per_s: f64,
    /// A panel of this length is not cut.
    shortest_s: f64,
    /// The first length that is tried; others are this times powers of [`GROWTH`], but for a last one.
    first_s: f64,
    pieces: Vec<Piece>,
    /// By the length's bits.
    weights: HashMap<u64, Arc<PanelWeights>>,
}

impl March<'_> {
    /// What ν drives in the steady state before the start.
    fn still(&self) -> Result<Bent, ThermalError> {
        let system = self.system;
        let start_s = self.drive.start_s();
        let above = |input: &PiecewiseLinear| input.value(start_s) - system.middle_k;
        let (boundary_k, ambient_k) = (above(&self.drive.boundary_k), above(self.drive.ambient_k()));
        let driven = system.by_boundary.iter().zip(&system.by_ambient).map(|(b, a)| b * boundary_k + a * ambient_k);
        let driven: Vec<f64> = driven.collect();
        let mut bent = vec![0.0; driven.len()];
        let mut before = DMatrix::zeros(0, 0);
        for _ in 0..MOST_SUBSTITUTIONS {
            let contents = driven.iter().zip(&bent).zip(&system.decay_per_s).map(|((g, n), l)| (g + n) / l);
            let temperatures = system.temperatures(&DMatrix::from_iterator(driven.len(), 1, contents));
            system.is_conducting(&temperatures)?;
            bent = system.bent(&temperatures, &[boundary_k]).as_slice().to_vec();
            let scale = temperatures.amax();
            if before.nrows() > 0 && (&temperatures - &before).amax() <= 10.0 * ROUNDING * scale {
                let slope_per_s = vec![0.0; bent.len()];
                return Ok(Bent { value: bent, slope_per_s });
            }
            before = temperatures;
        }
        Err(ThermalError::Eigen)
    }

    /// From one knot to the next; `rate` and `bent` as they are at its start and then at its end.
    fn through(
        &mut self,
        from_s: f64,
        to_s: f64,
        first_s: f64,
        mut rate: Vec<f64>,
        mut bent: Bent,
    ) -> Result<(Vec<f64>, Bent), ThermalError> {
        let (mut time_s, mut length_s) = (from_s, first_s);
        while time_s < to_s {
            // No sliver is left for a last panel.
            let left_s = to_s - time_s;
            let step_s = if length_s * 1.5 >= left_s { left_s } else { length_s };
            let before = self.tracks.clone();
            let end_s = if step_s == left_s { to_s } else { time_s + step_s };
            match self.step(time_s, end_s, step_s, &rate, &bent)? {
                Step::Done { rate: next, bent: at_end, is_easy } => {
                    (rate, bent) = (next, at_end);
                    time_s = end_s;
                    length_s *= if is_easy { GROWTH * GROWTH } else { GROWTH };
                }
                Step::TooLong => {
                    self.tracks = before;
                    while 2.0 * length_s > step_s {
                        length_s /= GROWTH;
                    }
                    length_s = length_s.max(self.shortest_s);
                }
            }
        }
        Ok((rate, bent))
    }

    /// Of panels of a length. Those that begin behind a knot come again under every drive.
    fn weights(&mut self, length_s: f64) -> Arc<PanelWeights> {
        let key = length_s.to_bits();
        if let Some(known) = self.weights.get(&key) {
            return Arc::clone(known);
        }
        let growths = (length_s / self.first_s).log2() / GROWTH.log2();
        let weights = if growths.fract() == 0.0 {
            self.shared.weights(self.panel, length_s)
        } else {
            Arc::new(self.panel.weights(&self.system.decay_per_s, length_s))
        };
        if self.weights.len() < MOST_KNOWN_LENGTHS {
            self.weights.insert(key, Arc::clone(&weights));
        }
        weights
    }

    /// How fast the last term of ν's polynomials changes, in units of what may be.
    fn bending(&self, temperatures: &DMatrix<f64>, length_s: f64) -> f64 {
        let half = 0.5 * self.system.slope_per_k;
        let last = temperatures
            .row_iter()
            .map(|row| row.iter().zip(&self.panel.last_term).map(|(t, w)| w * half * t * t).sum::<f64>().abs());
        let per_s = (DEGREE as f64 + 1.0) * 2.0 / length_s;
        let rounding = ROUNDING * half.abs() * self.span_k.max(1.0).powi(2);
        (last.fold(0.0, f64::max) - rounding).max(0.0) * per_s / (BENDING * self.scale_k_per_s).max(f64::MIN_POSITIVE)
    }

    /// `end_s`: the panel's end, where rounding would put a node behind a knot.
    fn step(
        &mut self,
        from_s: f64,
        end_s: f64,
        length_s: f64,
        rate: &[f64],
        bent: &Bent,
    ) -> Result<Step, ThermalError> {
        let system = self.system;
        let (modes, nodes) = (rate.len(), DEGREE + 1);
        let times_s = self.panel.places.iter().map(|x| (from_s + x * length_s).min(end_s));
        let mut linear = DMatrix::zeros(modes, nodes);
        for (mut column, time_s) in linear.column_iter_mut().zip(times_s.clone()) {
            for track in &mut self.tracks {
                track.add_to(time_s, system.middle_k, &system.decay_per_s, column.as_mut_slice());
            }
            system.add_heat(time_s - self.heated_s, column.as_mut_slice());
        }
        let drive_k: Vec<f64> = times_s.map(|t| self.drive.boundary_k.value(t) - system.middle_k).collect();
        let weights = self.weights(length_s);
        // The first guess: what bends the pack goes on as it did.
        let places = &self.panel.places;
        let mut from_bent =
            DMatrix::from_fn(modes, nodes, |i, j| bent.value[i] + bent.slope_per_s[i] * places[j] * length_s);
        let (mut rates, mut contents) = (DMatrix::zeros(modes, nodes), DMatrix::zeros(modes, nodes));
        let mut before = DMatrix::zeros(0, 0);
        for _ in 0..MOST_SUBSTITUTIONS {
            for (i, decay_per_s) in system.decay_per_s.iter().enumerate() {
                let mut driving = [0.0; DEGREE + 1];
                for (k, driving) in driving.iter_mut().enumerate() {
                    *driving = from_bent[(i, k)];
                }
                for j in 0..nodes {
                    let place = i * nodes + j;
                    let made = &weights.made[place * nodes..(place + 1) * nodes];
                    let made: f64 = made.iter().zip(&driving).map(|(w, g)| w * g).sum();
                    rates[(i, j)] = weights.left[place] * rate[i] + made;
                    contents[(i, j)] = (driving[j] - rates[(i, j)]) / decay_per_s;
                }
            }
            let temperatures = system.temperatures(&(&linear + &contents));
            system.is_conducting(&temperatures)?;
            from_bent = system.bent(&temperatures, &drive_k);
            let moved_k = (temperatures.column(DEGREE) - temperatures.column(0)).amax();
            let enough_k = TOLERANCE * moved_k + ROUNDING * self.span_k.max(1.0);
            if before.nrows() == 0 && length_s > 1.5 * self.shortest_s && self.bending(&temperatures, length_s) > 1.0 {
                return Ok(Step::TooLong);
            }
            let is_done = before.nrows() > 0 && (&temperatures - &before).amax() <= enough_k;
            before = temperatures;
            if is_done || system.slope_per_k == 0.0 {
                let (value, rate) = (&system.seen * &contents, &system.seen * &rates);
                self.pieces.push(Piece { from_s, length_s, value, rate });
                let ends = self.panel.lobatto.derivative.row(DEGREE).transpose() * (2.0 / length_s);
                let bent = Bent {
                    value: from_bent.column(DEGREE).as_slice().to_vec(),
                    slope_per_s: (&from_bent * ends).as_slice().to_vec(),
                };
                let is_easy = self.bending(&before, length_s) < EASY;
                return Ok(Step::Done { rate: rates.column(DEGREE).as_slice().to_vec(), bent, is_easy });
            }
        }
        Err(ThermalError::Eigen)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::thermal::modal::{PackField, Prepared};
    use crate::thermal::pack::Pack;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use crate::thermal::{BoreHeat, Extent, Flange, FlangeFilm, Location, PackMaterial, PackShape, Spool};

    fn path(location: Location) -> HeatPath {
        let shape = PackShape { layers: 8, bore_radius_m: 0.04, radial_pitch_m: 165e-6, height_m: 0.0085 };
        let material = PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
        HeatPath::new(shape, Extent::Pack, material, location)
    }

    fn drive() -> Drive {
        let boundary = PiecewiseLinear::new(vec![0.0, 200.0, 600.0, 900.0], vec![290.0, 296.0, 296.0, 291.0]).unwrap();
        let ambient = PiecewiseLinear::new(vec![0.0, 150.0, 700.0], vec![291.0, 296.0, 288.0]).unwrap();
        Drive { boundary_k: boundary, ambient_k: Some(ambient) }
    }

    /// The largest differences of temperatures, rates, moments and their rates, each as a share of its largest value.
    fn differences(path: &HeatPath) -> [f64; 4] {
        let instants: Vec<Instant> = (0..240).map(|i| Instant::after(1.0 + 4.9 * i as f64)).collect();
        let exact = PackField::new(Arc::new(Prepared::new(Pack::new(path).unwrap())), &drive())
            .at(&instants, WantedColumns::All);
        let stepped = SteppedField::new(path, &Varying::default(), &drive()).unwrap().at(&instants, WantedColumns::All);
        let share =
            |a: &[f64], b: &[f64], scale: f64| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / scale;
        let largest = |a: &[f64]| a.iter().map(|v| v.abs()).fold(1e-300, f64::max);
        [
            share(&exact.temperature_k, &stepped.temperature_k, 6.0),
            share(&exact.rate_k_per_s, &stepped.rate_k_per_s, largest(&exact.rate_k_per_s)),
            share(&exact.axial_moment_k, &stepped.axial_moment_k, largest(&exact.axial_moment_k)),
            share(&exact.axial_moment_k_per_s, &stepped.axial_moment_k_per_s, largest(&exact.axial_moment_k_per_s)),
        ]
    }

    #[test]
    fn with_constant_conductivity_the_steps_follow_the_exact_modes() {
        let spool = Spool { heat_capacity_j_per_m2_k: 4000.0, contact_w_per_m2_k: 300.0, mount_w_per_m2_k: 20.0 };
        let heat = BoreHeat { power_w_per_m2: 50.0, time_constant_s: 300.0 };
        let flange = FlangeFilm { flange: Flange::Second, film_w_per_m2_k: 50.0 };
        let plain = path(Location::OuterLayer);
        let film = HeatPath { film_w_per_m2_k: Some(20.0), ..path(Location::Ambient) };
        let full = HeatPath { spool: Some(spool), bore_heat: Some(heat), ..film.clone() };
        let flanged = HeatPath { flange: Some(flange), ..full.clone() };
        for (name, path) in [("plain", plain), ("film", film), ("spool and heat", full), ("flange", flanged)] {
            let found = differences(&path);
            println!("{name}: temperatures, rates, moments, their rates {found:?}");
            assert!(found[0] < 1e-6 && found[1] < 2e-4 && found[2] < 1e-5 && found[3] < 1e-3, "{name}: {found:?}");
        }
    }

    #[test]
    fn temperatures_are_continuous_at_knots_wherever_these_lie() {
        let mut random = ChaCha8Rng::seed_from_u64(20);
        let varying = Varying::default();
        let path = HeatPath { conductivity_slope_per_k: 0.002, film_w_per_m2_k: Some(20.0), ..path(Location::Ambient) };
        let mut largest_k = 0.0_f64;
        for _ in 0..60 {
            let mut knots = vec![0.0];
            let mut values = vec![293.15];
            for i in 0..4 {
                knots.push(knots[i] + random.random_range(100.0..2000.0));
                values.push(293.15 + random.random_range(-20.0..20.0));
            }
            let drive = Drive::boundary(PiecewiseLinear::new(knots.clone(), values).unwrap());
            let field = SteppedField::new(&path, &varying, &drive).unwrap();
            let sides: Vec<Instant> =
                knots[1..].iter().flat_map(|&t| [Instant::before(t), Instant::after(t)]).collect();
            let found = field.at(&sides, WantedColumns::All);
            for pair in found.temperature_k.chunks_exact(2 * path.shape.layers) {
                let (before, after) = pair.split_at(path.shape.layers);
                largest_k = before.iter().zip(after).map(|(b, a)| (b - a).abs()).fold(largest_k, f64::max);
            }
        }
        println!("temperatures jump by {largest_k:.1e} K at most");
        assert!(largest_k < 1e-4);
    }

    #[test]
    fn a_steep_slope_of_the_conductivity_is_refused_and_a_small_one_changes_the_field_in_proportion() {
        let mut steep = path(Location::OuterLayer);
        steep.conductivity_slope_per_k = -0.5;
        assert!(matches!(
            SteppedField::new(&steep, &Varying::default(), &drive()),
            Err(ThermalError::ConductivityNotPositive { .. })
        ));
        let instants: Vec<Instant> = (0..50).map(|i| Instant::after(20.0 * i as f64)).collect();
        let with_slope = |slope_per_k: f64| {
            let path = HeatPath { conductivity_slope_per_k: slope_per_k, ..path(Location::OuterLayer) };
            SteppedField::new(&path, &Varying::default(), &drive())
                .unwrap()
                .at(&instants, WantedColumns::All)
                .temperature_k
        };
        let (none, one, two) = (with_slope(0.0), with_slope(1e-3), with_slope(2e-3));
        let change = |a: &[f64]| a.iter().zip(&none).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let ratio = change(&two) / change(&one);
        println!("doubling the slope changes temperatures {ratio:.4} times as much");
        assert!((ratio - 2.0).abs() < 0.02);
    }
}
