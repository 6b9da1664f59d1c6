//! A modal system under piecewise-linear inputs: exact at any instant, without time steps.
//!
//! All instants of a request are gathered into one matrix of mode contents, so that outputs are one matrix product.
//!
//! ```text
//! c_i(t) = Σ_q Δk_q e^{−λ_i (t−t_q)},   Ṫ = s k − A c,   T = s u − (A Λ⁻¹ 1) k + A Λ⁻¹ c
//! ```

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::pack::{OwnStart, Pack};
use super::{BoreHeat, Drive, Instant, Side, ThermalHistory, WantedColumns};
use crate::numeric::piecewise::PiecewiseLinear;

/// How one input acts: the outputs' steady response to it and what each mode takes away from that.
#[derive(Debug, Clone)]
pub(super) struct Response {
    pub(crate) steady: DVector<f64>,
    /// A, outputs × modes.
    pub(crate) amplitude: DMatrix<f64>,
    /// A Λ⁻¹.
    lag: DMatrix<f64>,
    /// A Λ⁻¹ 1.
    lag_sum: DVector<f64>,
    /// What the grid follows the input with at once, though heat takes its time: the share of the surface's own node.
    at_once: DVector<f64>,
}

impl Response {
    /// `at_once`: of the outputs, what a change of the input's rate shows in them before any time has passed, by the grid alone.
    pub(crate) fn new(
        steady: DVector<f64>,
        amplitude: DMatrix<f64>,
        decay_per_s: &[f64],
        at_once: DVector<f64>,
    ) -> Self {
        let mut lag = amplitude.clone();
        for (mut column, l) in lag.column_iter_mut().zip(decay_per_s) {
            column /= *l;
        }
        let lag_sum = lag.column_sum();
        Self { steady, amplitude, lag, lag_sum, at_once }
    }

    pub(crate) fn plus(&self, other: &Self) -> Self {
        Self {
            steady: &self.steady + &other.steady,
            amplitude: &self.amplitude + &other.amplitude,
            lag: &self.lag + &other.lag,
            lag_sum: &self.lag_sum + &other.lag_sum,
            at_once: &self.at_once + &other.at_once,
        }
    }
}

/// Instants that are turned into one matrix product; more would leave the cache.
const BATCH: usize = 256;

/// Behind this many time constants a mode's content is zero: e^−100 is below any rounding.
const FORGOTTEN: f64 = 100.0;

/// e^{−λ_i t} for a time that is often the same as the last one.
pub(super) struct Decay<'a> {
    decay_per_s: &'a [f64],
    elapsed_s: f64,
    left: Vec<f64>,
    /// Modes from here on have nothing left.
    remembered: usize,
}

impl<'a> Decay<'a> {
    pub(crate) fn new(decay_per_s: &'a [f64]) -> Self {
        Self { decay_per_s, elapsed_s: 0.0, left: vec![1.0; decay_per_s.len()], remembered: decay_per_s.len() }
    }

    fn after(&mut self, elapsed_s: f64) -> &[f64] {
        if elapsed_s != self.elapsed_s {
            self.elapsed_s = elapsed_s;
            // Decays ascend, so what is behind a forgotten mode is forgotten too.
            let remembered = self.decay_per_s.partition_point(|l| l * elapsed_s < FORGOTTEN);
            for (left, l) in self.left[..remembered].iter_mut().zip(self.decay_per_s) {
                *left = (-l * elapsed_s).exp();
            }
            self.left[remembered..].fill(0.0);
            self.remembered = remembered;
        }
        &self.left
    }
}

/// The contents of the modes that one piecewise-linear input excites, at each of its knots.
#[derive(Debug, Clone)]
pub(super) struct Contents {
    input: PiecewiseLinear,
    /// Row-major knots × modes, just after each knot: Σ_q Δk_q e^{−λ_i (t−t_q)}.
    content: Vec<f64>,
}

/// An input at one instant.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct InputAt {
    pub(crate) value: f64,
    pub(crate) slope: f64,
    /// By how much the slope has changed in this very instant.
    pub(crate) kink: f64,
}

/// A pack that any number of drives share.
#[derive(Debug)]
pub(crate) struct Prepared {
    pack: Pack,
    joint: Response,
}

impl Prepared {
    pub(super) fn new(pack: Pack) -> Self {
        let joint = pack.joint();
        Self { pack, joint }
    }

    fn response(&self, through: Through) -> &Response {
        match (through, &self.pack.ambient) {
            (Through::Boundary, _) => &self.pack.boundary,
            (Through::Ambient, Some(ambient)) => ambient,
            _ => &self.joint,
        }
    }
}

/// Where an input reaches the pack.
#[derive(Debug, Clone, Copy)]
enum Through {
    Boundary,
    Ambient,
    Both,
}

/// One input and how it acts.
#[derive(Debug, Clone)]
struct Track {
    contents: Contents,
    through: Through,
}

impl Track {
    fn new(input: &PiecewiseLinear, through: Through, decay_per_s: &[f64]) -> Self {
        Self { contents: Contents::new(input, decay_per_s), through }
    }
}

impl Contents {
    /// For modes of ascending decays.
    pub(crate) fn new(input: &PiecewiseLinear, decay_per_s: &[f64]) -> Self {
        let knots = input.knots();
        let mut content = Vec::with_capacity(knots.len() * decay_per_s.len());
        let mut state = vec![0.0; decay_per_s.len()];
        let mut decay = Decay::new(decay_per_s);
        let mut slope = 0.0;
        for (i, &time_s) in knots.iter().enumerate() {
            let change = input.slope_of(i) - slope;
            slope = input.slope_of(i);
            let left = decay.after(if i > 0 { time_s - knots[i - 1] } else { 0.0 });
            for (s, left) in state.iter_mut().zip(left) {
                *s = *s * left + change;
            }
            content.extend_from_slice(&state);
        }
        Self { input: input.clone(), content }
    }

    /// Writes the modes' contents at an instant; returns the input there.
    pub(crate) fn at(&self, instant: Instant, decay: &mut Decay, state: &mut [f64]) -> InputAt {
        let modes = state.len();
        let knots = self.input.knots();
        let past = match instant.side {
            Side::After => knots.partition_point(|&k| k <= instant.time_s),
            Side::Before => knots.partition_point(|&k| k < instant.time_s),
        };
        let Some(knot) = past.checked_sub(1) else {
            state.fill(0.0);
            return InputAt { value: self.input.first_value(), ..InputAt::default() };
        };
        let elapsed_s = instant.time_s - knots[knot];
        let stored = &self.content[knot * modes..(knot + 1) * modes];
        for ((s, stored), left) in state.iter_mut().zip(stored).zip(decay.after(elapsed_s)) {
            *s = stored * left;
        }
        let slope = self.input.slope_of(knot);
        let before = knot.checked_sub(1).map_or(0.0, |k| self.input.slope_of(k));
        InputAt {
            value: self.input.values()[knot] + slope * elapsed_s,
            slope,
            kink: if elapsed_s == 0.0 { slope - before } else { 0.0 },
        }
    }
}

/// A pack under one drive.
#[derive(Debug, Clone)]
pub struct PackField {
    prepared: Arc<Prepared>,
    drive: Drive,
    tracks: Vec<Track>,
}

impl PackField {
    pub(crate) fn new(prepared: Arc<Prepared>, drive: &Drive) -> Self {
        let decay_per_s = &prepared.pack.decay_per_s;
        let tracks = match (&prepared.pack.ambient, &drive.ambient_k) {
            (Some(_), Some(ambient_k)) => vec![
                Track::new(&drive.boundary_k, Through::Boundary, decay_per_s),
                Track::new(ambient_k, Through::Ambient, decay_per_s),
            ],
            _ => vec![Track::new(&drive.boundary_k, Through::Both, decay_per_s)],
        };
        Self { prepared, tracks, drive: drive.clone() }
    }

    fn pack(&self) -> &Pack {
        &self.prepared.pack
    }

    pub(super) fn at(&self, instants: &[Instant], wanted: WantedColumns) -> ThermalHistory {
        let mut history = ThermalHistory::with_capacity(self.pack().layers, instants.len());
        for batch in instants.chunks(BATCH) {
            self.add_batch(batch, wanted, &mut history);
        }
        for &instant in instants {
            history.times_s.push(instant.time_s);
            super::push_ambient(&mut history, &self.drive, instant);
        }
        history
    }

    fn add_batch(&self, batch: &[Instant], wanted: WantedColumns, history: &mut ThermalHistory) {
        let modes = self.pack().decay_per_s.len();
        let mut state = DMatrix::zeros(modes, batch.len());
        let mut temperature = wanted.temperatures().then(|| DMatrix::zeros(self.pack().outputs, batch.len()));
        let mut rate = wanted.rates().then(|| DMatrix::zeros(self.pack().outputs, batch.len()));
        let mut decay = Decay::new(&self.pack().decay_per_s);
        let mut inputs = vec![InputAt::default(); batch.len()];
        for track in &self.tracks {
            let mut remembered = 0;
            for ((&instant, column), input) in
                batch.iter().zip(state.as_mut_slice().chunks_exact_mut(modes)).zip(&mut inputs)
            {
                *input = track.contents.at(instant, &mut decay, column);
                remembered = remembered.max(decay.remembered);
            }
            let response = self.prepared.response(track.through);
            let contents = state.rows(0, remembered);
            if let Some(temperature) = &mut temperature {
                temperature.gemm(1.0, &response.lag.columns(0, remembered), &contents, 1.0);
                for (mut column, input) in temperature.column_iter_mut().zip(&inputs) {
                    column.axpy(input.value, &response.steady, 1.0);
                    column.axpy(-input.slope, &response.lag_sum, 1.0);
                }
            }
            if let Some(rate) = &mut rate {
                rate.gemm(-1.0, &response.amplitude.columns(0, remembered), &contents, 1.0);
                for (mut column, input) in rate.column_iter_mut().zip(&inputs) {
                    column.axpy(input.slope, &response.steady, 1.0);
                    if input.kink != 0.0 {
                        column.axpy(-input.kink, &response.at_once, 1.0);
                    }
                }
            }
        }
        if let Some((heat, content)) = &self.pack().heat {
            let mut warming = DMatrix::zeros(modes, batch.len());
            for (c, instant) in batch.iter().enumerate() {
                for (i, &l) in self.pack().decay_per_s.iter().enumerate() {
                    let since_s = instant.time_s - self.drive.start_s();
                    let (left, building) = ((-l * since_s).exp(), (-since_s / heat.time_constant_s).exp());
                    (state[(i, c)], warming[(i, c)]) = heated_mode(heat, l, since_s, left, building);
                }
            }
            if let Some(temperature) = &mut temperature {
                temperature.gemm(1.0, content, &state, 1.0);
            }
            if let Some(rate) = &mut rate {
                rate.gemm(1.0, content, &warming, 1.0);
            }
        }
        if let Some(start) = &self.pack().start {
            self.add_start(start, batch, &mut temperature, &mut rate);
        }
        let share = |block: Option<DMatrix<f64>>, means: &mut Vec<f64>, moments: &mut Vec<f64>| {
            for column in block.iter().flat_map(|b| b.as_slice().chunks_exact(self.pack().outputs)) {
                means.extend_from_slice(&column[..self.pack().layers]);
                moments.extend_from_slice(&column[self.pack().layers..]);
            }
        };
        share(temperature, &mut history.temperature_k, &mut history.axial_moment_k);
        share(rate, &mut history.rate_k_per_s, &mut history.axial_moment_k_per_s);
    }
}

impl PackField {
    /// What a start that was not steady leaves.
    fn add_start(
        &self,
        start: &OwnStart,
        batch: &[Instant],
        temperature: &mut Option<DMatrix<f64>>,
        rate: &mut Option<DMatrix<f64>>,
    ) {
        let modes = self.pack().decay_per_s.len();
        let (mut left, mut change) = (DMatrix::zeros(modes, batch.len()), DMatrix::zeros(modes, batch.len()));
        for (c, instant) in batch.iter().enumerate() {
            let since_s = instant.time_s - self.drive.start_s();
            // Before the start the ramp goes on steadily.
            let is_before = since_s < 0.0 || (since_s == 0.0 && instant.side == Side::Before);
            for (i, &l) in self.pack().decay_per_s.iter().enumerate() {
                left[(i, c)] = (-l * since_s.max(0.0)).exp();
                change[(i, c)] = if is_before { 0.0 } else { -l * left[(i, c)] };
            }
            if is_before {
                if let Some(temperature) = temperature {
                    temperature.column_mut(c).axpy(since_s, &start.before_k_per_s, 1.0);
                }
                if let Some(rate) = rate {
                    rate.column_mut(c).axpy(1.0, &start.before_k_per_s, 1.0);
                }
            }
        }
        if let Some(temperature) = temperature {
            temperature.gemm(1.0, &start.content, &left, 1.0);
        }
        if let Some(rate) = rate {
            rate.gemm(1.0, &start.content, &change, 1.0);
        }
    }
}

/// c and dc/dt of c' = −λ c + q∞ (1 − e^{−t/τ}), c(0) = 0, from e^{−λt} and e^{−t/τ}.
pub(super) fn heated_mode(heat: &BoreHeat, decay_per_s: f64, time_s: f64, el: f64, em: f64) -> (f64, f64) {
    if time_s <= 0.0 {
        return (0.0, 0.0);
    }
    let (l, m) = (decay_per_s, 1.0 / heat.time_constant_s);
    // (e^{−mt} − e^{−lt})/(l − m) without cancellation where l ≈ m.
    let difference = if ((l - m) * time_s).abs() < 1e-8 {
        time_s * em
    } else if (l - m).abs() * time_s < 1.0 {
        em * -(-(l - m) * time_s).exp_m1() / (l - m)
    } else {
        (em - el) / (l - m)
    };
    let content = (1.0 - el) / l - difference;
    let rate = m * difference;
    (heat.power_w_per_m2 * content, heat.power_w_per_m2 * rate)
}
