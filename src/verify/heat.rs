//! The pack's temperatures, worked out again.
//!
//! ```text
//! half space:  θ_j' = erfc(x_j/√(4Kτ)) after a unit step of the boundary's rate
//! pack:        ρc ∂T/∂t = (1/r) ∂/∂r (k r ∂T/∂r) + k ∂²T/∂z²,   k = k0 (1 + a (T − 20 °C))
//! bore:        adiabatic, or heated by q, or in contact with a spool;   boundary: T given, or behind a film
//! ```
//!
//! What is linear in the drive is superposed from the response to a unit ramp, in closed form or by inverting its
//! Laplace transform ([`super::laplace`]), at any time and without a step. A pack whose conductivity depends on
//! temperature is stepped through every profile ([`super::stepping`]).

use super::laplace::Response;
use super::network::{Cut, Network};
use super::parts::Parts;
use super::physics::{BoreHeat, Physics};
use super::stepping::Drive;
use crate::profile::Profile;
use crate::rate::CoilModel;

/// Times a piece of a profile, where each profile is stepped, and so many times more for one stated moment …
const STEPS: usize = 240;
const CLOSER: usize = 5;
/// … and so few where it is only asked which profiles are worth all of them, …
const FEW_STEPS: usize = 40;
/// … and where it is superposed: closer to its start, and evenly.
const SPACED_TIMES: usize = 90;
const EVEN_TIMES: usize = 40;
/// … and so far apart where it is only asked which pieces are worth all of them: the response to a change of ramp takes a decade of
/// time to rise, so what stands between two of these is less than twice as large as both.
const FEW_TIMES_RATIO: f64 = 3.0;

/// Two cuts of a pack that is stepped …
const CUTS: [Cut; 2] = [Cut { cells_per_layer: 8, slices: 1 }, Cut { cells_per_layer: 16, slices: 1 }];
/// … and of one with a heated flange.
const CUTS_BESIDE_FLANGE: [Cut; 2] = [Cut { cells_per_layer: 4, slices: 24 }, Cut { cells_per_layer: 8, slices: 48 }];

/// The pack at one time, relative to where the profile starts.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct State {
    pub(crate) time_s: f64,
    pub(crate) rise_k: Vec<f64>,
    pub(crate) rate_k_per_s: Vec<f64>,
    /// First axial moment of the rate, from −½ at the first flange to ½; empty without a heated flange.
    pub(crate) moment_k_per_s: Vec<f64>,
    pub(crate) ambient_rise_k: f64,
    pub(crate) ambient_rate_k_per_s: f64,
}

/// A time, and whether a change of ramp at that very time has happened yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moment {
    pub(crate) time_s: f64,
    pub(crate) after: bool,
}

fn heat_at(heat: Option<BoreHeat>, time_s: f64) -> f64 {
    heat.map_or(0.0, |h| h.power_w_per_m2 * -(-time_s.max(0.0) / h.time_constant_s).exp_m1())
}

/// What solves the pack.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one of it in a verification")]
enum Solution {
    HalfSpace {
        depths_m: Vec<f64>,
        diffusivity_m2_per_s: f64,
        /// For ramps that are summed up.
        gathered: Response,
    },
    Linear(Response),
    /// On two networks, the second twice as fine as the first.
    Stepped {
        networks: [Network; 2],
        heat: Option<BoreHeat>,
    },
}

/// The pack's temperatures under any of a model's profiles.
#[derive(Debug)]
pub(super) struct Heat {
    layers: usize,
    /// Whether anything depends on more than the rates; temperatures stay zero otherwise.
    wants_rise: bool,
    solution: Solution,
    /// Rate of the drive before the start, and for how long.
    ramp_before: Option<[f64; 2]>,
    /// A layer's own time.
    first_s: f64,
}

impl Heat {
    pub(crate) fn new(model: &CoilModel, physics: &Physics, height_m: f64, longest_s: f64) -> Self {
        let coil = &model.coil;
        let (layers, pitch_m) = (coil.layers(), coil.radial_pitch_m());
        let diffusivity_m2_per_s = physics.diffusivity_m2_per_s();
        let heat = physics.bore_heat;
        let longest_s = longest_s + physics.ramp_before.map_or(0.0, |[_, lasted_s]| lasted_s);
        let solution = if !physics.is_pack {
            let depths_m: Vec<f64> = (0..layers).map(|j| (layers - 1 - j) as f64 * pitch_m).collect();
            let gathered = Response::half_space(&depths_m, diffusivity_m2_per_s, longest_s);
            Solution::HalfSpace { depths_m, diffusivity_m2_per_s, gathered }
        } else if physics.conductivity_slope_per_k != 0.0 {
            let cuts = if !physics.flanges.is_empty() { CUTS_BESIDE_FLANGE } else { CUTS };
            Solution::Stepped { networks: cuts.map(|cut| Network::new(model, physics, height_m, cut)), heat }
        } else {
            Solution::Linear(Response::new(&Parts::new(model, physics, height_m), heat, longest_s))
        };
        let first_s = 0.02 * pitch_m * pitch_m / (4.0 * diffusivity_m2_per_s);
        Self {
            layers,
            wants_rise: physics.depends_on_temperature(),
            solution,
            ramp_before: physics.ramp_before,
            first_s,
        }
    }

    /// Whether any time can be asked for, free of steps.
    pub(crate) fn is_exact_in_time(&self) -> bool {
        !matches!(self.solution, Solution::Stepped { .. })
    }

    /// The state at a moment of a profile, where [`Heat::is_exact_in_time`]; by steps otherwise.
    pub(crate) fn at(&self, profile: &Profile, moment: Moment) -> State {
        if let Solution::Stepped { networks, heat } = &self.solution {
            return self.extrapolated(profile, networks, *heat, Some(moment)).pop().unwrap_or_default();
        }
        let mut state = self.still(moment.time_s);
        let (mut start_s, mut rate) = (0.0, 0.0);
        let ends = profile.pieces().iter().map(|piece| (piece.rate_k_per_s, piece.duration_s));
        for (next_rate, duration_s) in ends.chain([(0.0, 0.0)]) {
            let lasted_s = moment.time_s - start_s;
            if lasted_s < 0.0 || (lasted_s == 0.0 && !moment.after) {
                break;
            }
            self.add(&mut state, next_rate - rate, lasted_s);
            (start_s, rate) = (start_s + duration_s, next_rate);
        }
        self.finish(&mut state);
        state
    }

    /// Before anything happened.
    pub(super) fn still(&self, time_s: f64) -> State {
        let solved = if self.wants_rise { self.layers } else { 0 };
        let has_moments = matches!(&self.solution, Solution::Linear(response) if response.has_moments());
        State {
            time_s,
            rise_k: vec![0.0; solved],
            rate_k_per_s: vec![0.0; self.layers],
            moment_k_per_s: vec![0.0; if has_moments { self.layers } else { 0 }],
            ..State::default()
        }
    }

    /// Adds what the profile's ramps have no part in.
    pub(super) fn finish(&self, state: &mut State) {
        if let Some([rate_k_per_s, lasted_s]) = self.ramp_before {
            self.add(state, rate_k_per_s, state.time_s + lasted_s);
            self.add(state, -rate_k_per_s, state.time_s);
            // Rises are counted from where the profile starts.
            let risen_k = rate_k_per_s * lasted_s;
            state.rise_k.iter_mut().for_each(|rise| *rise -= risen_k);
            state.ambient_rise_k -= risen_k;
        }
        if let Solution::Linear(response) = &self.solution {
            let State { rise_k, rate_k_per_s, moment_k_per_s, .. } = state;
            response.add_own(state.time_s, rate_k_per_s, rise_k, moment_k_per_s);
        }
        state.rise_k.resize(self.layers, 0.0);
    }

    /// What sums up ramps of long ago, where the state is a sum over ramps.
    pub(super) fn gathered(&self) -> Option<&Response> {
        match &self.solution {
            Solution::HalfSpace { gathered, .. } => Some(gathered),
            Solution::Linear(response) => Some(response),
            Solution::Stepped { .. } => None,
        }
    }

    /// Adds a change of ramp that happened a while ago.
    pub(super) fn add(&self, state: &mut State, change: f64, lasted_s: f64) {
        let State { rise_k, rate_k_per_s, moment_k_per_s, .. } = state;
        match &self.solution {
            Solution::HalfSpace { depths_m, diffusivity_m2_per_s, .. } => {
                for (j, depth_m) in depths_m.iter().enumerate() {
                    let (rate, rise_s) = half_space(*depth_m, *diffusivity_m2_per_s, lasted_s);
                    rate_k_per_s[j] += change * rate;
                    if let Some(rise_k) = rise_k.get_mut(j) {
                        *rise_k += change * rise_s;
                    }
                }
            }
            Solution::Linear(response) => {
                response.add_ramp(change, lasted_s, rate_k_per_s, rise_k, moment_k_per_s);
            }
            Solution::Stepped { .. } => {}
        }
        state.ambient_rise_k += change * lasted_s;
        state.ambient_rate_k_per_s += change;
    }

    /// The times since its beginning at which a piece is looked at, but its end: close after its start, and evenly.
    pub(super) fn times_s(&self, duration_s: f64) -> Vec<f64> {
        let spaced = geometric(self.first_s.min(0.01 * duration_s), duration_s, SPACED_TIMES);
        let even = (1..EVEN_TIMES).map(|i| duration_s * i as f64 / EVEN_TIMES as f64);
        let mut times_s: Vec<f64> = spaced.into_iter().chain(even).filter(|t| *t < duration_s).collect();
        times_s.sort_by(f64::total_cmp);
        times_s
    }

    /// The same, so few that they only show how large a rate error can become in it.
    pub(super) fn few_times_s(&self, duration_s: f64) -> Vec<f64> {
        let first_s = self.first_s.min(0.01 * duration_s);
        let count = 2 + ((duration_s / first_s).ln() / FEW_TIMES_RATIO.ln()).ceil() as usize;
        geometric(first_s, duration_s, count).into_iter().filter(|t| *t < duration_s).collect()
    }

    /// The states that a profile leads through where it is stepped.
    pub(crate) fn steps(&self, profile: &Profile) -> Vec<State> {
        match &self.solution {
            Solution::Stepped { networks, heat } => self.extrapolated(profile, networks, *heat, None),
            Solution::HalfSpace { .. } | Solution::Linear(_) => Vec::new(),
        }
    }

    /// The same by few steps and on the coarser network only, to see which profiles can hold the worst rate error.
    pub(crate) fn few_steps(&self, profile: &Profile) -> Vec<State> {
        match &self.solution {
            Solution::Stepped { networks, heat } => self.stepped(profile, &networks[0], *heat, None, FEW_STEPS),
            Solution::HalfSpace { .. } | Solution::Linear(_) => Vec::new(),
        }
    }

    /// What both networks tend to: their errors are of second order in the cells' width.
    fn extrapolated(
        &self,
        profile: &Profile,
        [coarse, fine]: &[Network; 2],
        heat: Option<BoreHeat>,
        until: Option<Moment>,
    ) -> Vec<State> {
        let steps = if until.is_some() { STEPS * CLOSER } else { STEPS };
        let coarse = self.stepped(profile, coarse, heat, until, steps);
        let mut states = self.stepped(profile, fine, heat, until, steps);
        let mix = |fine: &mut Vec<f64>, coarse: &[f64]| {
            fine.iter_mut().zip(coarse).for_each(|(f, c)| *f = (4.0 * *f - c) / 3.0);
        };
        for (state, coarse) in states.iter_mut().zip(&coarse) {
            mix(&mut state.rise_k, &coarse.rise_k);
            mix(&mut state.rate_k_per_s, &coarse.rate_k_per_s);
            mix(&mut state.moment_k_per_s, &coarse.moment_k_per_s);
        }
        states
    }

    /// All states up to a moment, or to the profile's end; in so many steps a piece.
    fn stepped(
        &self,
        profile: &Profile,
        network: &Network,
        heat: Option<BoreHeat>,
        until: Option<Moment>,
        steps: usize,
    ) -> Vec<State> {
        let closer = if until.is_some() { CLOSER } else { 1 };
        let until = until.unwrap_or(Moment { time_s: f64::INFINITY, after: true });
        let mut states = Vec::new();
        let mut nodes = network.still();
        let (mut start_s, mut start_k) = (0.0, 0.0);
        let mut last = Drive { heat_w_per_m2: heat_at(heat, 0.0), ..Drive::default() };
        let state = |nodes: &[f64], time_s: f64, drive: Drive| {
            let (rise_k, rate_k_per_s, moment_k_per_s) = network.means(nodes, drive);
            State {
                time_s,
                rise_k,
                rate_k_per_s,
                moment_k_per_s,
                ambient_rise_k: drive.rise_k,
                ambient_rate_k_per_s: drive.rate_k_per_s,
            }
        };
        if until.time_s == 0.0 && !until.after {
            return vec![state(&nodes, 0.0, last)];
        }
        for piece in profile.pieces() {
            let drive = move |t: f64| Drive {
                rise_k: start_k + piece.rate_k_per_s * (t - start_s),
                rate_k_per_s: piece.rate_k_per_s,
                heat_w_per_m2: heat_at(heat, t),
            };
            let end_s = piece.duration_s.min(until.time_s - start_s);
            let first_s = self.first_s.min(0.1 * piece.duration_s);
            let mut times_s = geometric(first_s, piece.duration_s, steps);
            times_s.retain(|t| *t < end_s);
            times_s.push(end_s.max(0.0));
            states.push(state(&nodes, start_s, drive(start_s)));
            for times in times_s.windows(2).filter(|times| times[1] > times[0]) {
                network.advance(&mut nodes, start_s + times[0], start_s + times[1], closer, &drive);
                states.push(state(&nodes, start_s + times[1], drive(start_s + times[1])));
            }
            start_k += piece.rate_k_per_s * piece.duration_s;
            start_s += piece.duration_s;
            last = Drive { rate_k_per_s: 0.0, ..drive(start_s) };
            if until.time_s < start_s || (until.time_s == start_s && !until.after) {
                return states;
            }
        }
        states.push(state(&nodes, start_s, Drive { rise_k: start_k, ..last }));
        states
    }
}

/// From 0, then spaced geometrically from the first to the last.
fn geometric(first_s: f64, last_s: f64, count: usize) -> Vec<f64> {
    let ratio = (last_s / first_s).max(2.0).powf(1.0 / (count - 1) as f64);
    std::iter::once(0.0).chain((0..count).map(|i| first_s * ratio.powi(i as i32))).collect()
}

/// Rate, and its integral over time, at a depth below the boundary of a half space after a unit ramp began.
fn half_space(depth_m: f64, diffusivity: f64, lasted_s: f64) -> (f64, f64) {
    if depth_m == 0.0 {
        return (1.0, lasted_s);
    }
    if lasted_s == 0.0 {
        return (0.0, 0.0);
    }
    let eta = depth_m / (2.0 * (diffusivity * lasted_s).sqrt());
    let rate = libm::erfc(eta);
    let rise_s =
        lasted_s * ((1.0 + 2.0 * eta * eta) * rate - std::f64::consts::FRAC_2_SQRT_PI * eta * (-eta * eta).exp());
    (rate, rise_s)
}
