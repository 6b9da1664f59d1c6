//! The pack's temperatures, worked out again.
//!
//! ```text
//! half space:  θ_j' = erfc(x_j/√(4Kτ)) after a unit step of the boundary's rate
//! pack:        ρc ∂T/∂t = (1/r) ∂/∂r (k r ∂T/∂r) + k ∂²T/∂z²,   k = k0 (1 + a (T − 20 °C))
//! bore:        adiabatic, or heated by q, or in contact with a spool;   boundary: T given, or behind a film
//! ```
//!
//! The pack is solved on a grid of its own ([`super::grid`]). What is linear in the drive is solved once, for a unit ramp, and superposed; a pack whose conductivity depends on
//! temperature is stepped through every profile.

use super::grid::{Drive, Grid};
use super::physics::{BoreHeat, Physics};
use crate::profile::Profile;
use crate::rate::CoilModel;

/// Times of the response to a unit ramp, spaced geometrically.
const RESPONSE_TIMES: usize = 700;
/// Times a piece of a profile, where each profile is stepped.
const PIECE_TIMES: usize = 240;
/// Even times a piece at which a superposition is looked at, besides every second one of the response.
const EVEN_TIMES: usize = 100;

/// The pack at one time, relative to where the profile starts.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct State {
    pub time_s: f64,
    pub rise_k: Vec<f64>,
    pub rate_k_per_s: Vec<f64>,
    /// First axial moment of the rate, from −½ at the first flange to ½; empty without a heated flange.
    pub moment_k_per_s: Vec<f64>,
    pub ambient_rise_k: f64,
    pub ambient_rate_k_per_s: f64,
}

fn heat_at(heat: Option<BoreHeat>, time_s: f64) -> f64 {
    heat.map_or(0.0, |h| h.power_w_per_m2 * -(-time_s.max(0.0) / h.time_constant_s).exp_m1())
}

/// The pack's temperatures under any of a model's profiles.
#[derive(Debug)]
pub(super) enum Heat {
    /// After a unit ramp began, and of the bore's heat alone.
    Linear {
        ramp: Vec<State>,
        heated: Option<Vec<State>>,
    },
    Stepped {
        grid: Box<Grid>,
        heat: Option<BoreHeat>,
        first_s: f64,
    },
}

impl Heat {
    /// Whether the temperatures can be worked out here: not those of a pack with a heated flange whose conductivity
    /// depends on temperature, where the factorised steps would have to be too many.
    pub fn knows(physics: &Physics) -> bool {
        physics.flange.is_none() || physics.conductivity_slope_per_k == 0.0
    }

    pub fn new(model: &CoilModel, physics: &Physics, height_m: f64, longest_s: f64) -> Self {
        let coil = &model.coil;
        let (layers, pitch_m) = (coil.layers(), coil.radial_pitch_m());
        let diffusivity = physics.diffusivity_m2_per_s();
        let first_s = 0.02 * pitch_m * pitch_m / (4.0 * diffusivity);
        let times_s = geometric(first_s, longest_s, RESPONSE_TIMES);
        let unit = |t: f64| Drive { rise_k: t, rate_k_per_s: 1.0, heat_w_per_m2: 0.0 };
        if !physics.is_pack {
            let depths_m: Vec<f64> = (0..layers).map(|j| (layers - 1 - j) as f64 * pitch_m).collect();
            let ramp = times_s.iter().map(|&t| half_space(&depths_m, diffusivity, t)).collect();
            return Heat::Linear { ramp, heated: None };
        }
        let grid = Grid::new(model, physics, height_m);
        if physics.conductivity_slope_per_k != 0.0 {
            return Heat::Stepped { grid: Box::new(grid), heat: physics.bore_heat, first_s };
        }
        let heated = physics
            .bore_heat
            .map(|heat| grid.march(&times_s, &|t| Drive { heat_w_per_m2: heat_at(Some(heat), t), ..Drive::default() }));
        Heat::Linear { ramp: grid.march(&times_s, &unit), heated }
    }

    /// The states that a profile leads through, both one-sided limits at its break points included.
    pub fn states(&self, profile: &Profile) -> Vec<State> {
        match self {
            Heat::Linear { ramp, heated } => superposed(profile, ramp, heated.as_deref()),
            Heat::Stepped { grid, heat, first_s } => stepped(profile, grid, *heat, *first_s),
        }
    }
}

fn geometric(first_s: f64, last_s: f64, count: usize) -> Vec<f64> {
    let ratio = (last_s / first_s).max(2.0).powf(1.0 / (count - 1) as f64);
    std::iter::once(0.0).chain((0..count).map(|i| first_s * ratio.powi(i as i32))).collect()
}

/// A ramp that has lasted for a while, at depths below the boundary of a half space.
fn half_space(depths_m: &[f64], diffusivity: f64, time_s: f64) -> State {
    let eta = |x: f64| x / (2.0 * (diffusivity * time_s).sqrt());
    let rate = |x: f64| match (x, time_s) {
        (0.0, _) => 1.0,
        (_, 0.0) => 0.0,
        (x, _) => libm::erfc(eta(x)),
    };
    // The integral of the rate over time.
    let rise = |x: f64| match (x, time_s) {
        (_, 0.0) => 0.0,
        (0.0, t) => t,
        (x, t) => {
            let e = eta(x);
            t * ((1.0 + 2.0 * e * e) * libm::erfc(e) - std::f64::consts::FRAC_2_SQRT_PI * e * (-e * e).exp())
        }
    };
    State {
        time_s,
        rise_k: depths_m.iter().map(|x| rise(*x)).collect(),
        rate_k_per_s: depths_m.iter().map(|x| rate(*x)).collect(),
        moment_k_per_s: Vec::new(),
        ambient_rise_k: time_s,
        ambient_rate_k_per_s: 1.0,
    }
}

impl State {
    /// Adds `factor` times what lies between two neighbours of a list of states, at a time.
    fn add(&mut self, factor: f64, states: &[State], at_s: f64) {
        let after = states.partition_point(|s| s.time_s <= at_s).clamp(1, states.len() - 1);
        let (a, b) = (&states[after - 1], &states[after]);
        let share = ((at_s - a.time_s) / (b.time_s - a.time_s)).min(1.0);
        let mix = |into: &mut Vec<f64>, a: &[f64], b: &[f64]| {
            into.resize(a.len(), 0.0);
            for ((sum, a), b) in into.iter_mut().zip(a).zip(b) {
                *sum += factor * (a + (b - a) * share);
            }
        };
        mix(&mut self.rise_k, &a.rise_k, &b.rise_k);
        mix(&mut self.rate_k_per_s, &a.rate_k_per_s, &b.rate_k_per_s);
        mix(&mut self.moment_k_per_s, &a.moment_k_per_s, &b.moment_k_per_s);
        self.ambient_rise_k += factor * (a.ambient_rise_k + (b.ambient_rise_k - a.ambient_rise_k) * share);
        self.ambient_rate_k_per_s += factor * a.ambient_rate_k_per_s;
    }
}

fn superposed(profile: &Profile, ramp: &[State], heated: Option<&[State]>) -> Vec<State> {
    let mut states = Vec::new();
    let mut changes: Vec<(f64, f64)> = Vec::new();
    let state_at = |changes: &[(f64, f64)], time_s: f64| {
        let mut state = State { time_s, ..State::default() };
        for (from_s, change) in changes {
            state.add(*change, ramp, time_s - from_s);
        }
        if let Some(heated) = heated {
            state.add(1.0, heated, time_s);
        }
        state
    };
    let (mut start_s, mut rate) = (0.0, 0.0);
    for piece in profile.pieces() {
        let end_s = start_s + piece.duration_s;
        changes.push((start_s, piece.rate_k_per_s - rate));
        rate = piece.rate_k_per_s;
        let spaced = ramp.iter().step_by(2).map(|s| start_s + s.time_s).take_while(|t| *t < end_s);
        let even = (1..=EVEN_TIMES).map(|i| start_s + piece.duration_s * i as f64 / EVEN_TIMES as f64);
        states.extend(spaced.chain(even).map(|t| state_at(&changes, t)));
        start_s = end_s;
    }
    changes.push((start_s, -rate));
    states.push(state_at(&changes, start_s));
    states
}

fn stepped(profile: &Profile, grid: &Grid, heat: Option<BoreHeat>, first_s: f64) -> Vec<State> {
    let mut states = Vec::new();
    let mut nodes = grid.still();
    let (mut start_s, mut start_k) = (0.0, 0.0);
    let mut last = Drive::default();
    for piece in profile.pieces() {
        let drive = move |t: f64| Drive {
            rise_k: start_k + piece.rate_k_per_s * (t - start_s),
            rate_k_per_s: piece.rate_k_per_s,
            heat_w_per_m2: heat_at(heat, t),
        };
        let times_s = geometric(first_s.min(0.1 * piece.duration_s), piece.duration_s, PIECE_TIMES);
        states.push(grid.state(&nodes, start_s, drive(start_s)));
        for times in times_s.windows(2) {
            grid.advance(&mut nodes, start_s + times[0], start_s + times[1], &drive);
            states.push(grid.state(&nodes, start_s + times[1], drive(start_s + times[1])));
        }
        start_k += piece.rate_k_per_s * piece.duration_s;
        start_s += piece.duration_s;
        last = Drive { rate_k_per_s: 0.0, ..drive(start_s) };
    }
    states.push(grid.state(&nodes, start_s, Drive { rise_k: start_k, ..last }));
    states
}
