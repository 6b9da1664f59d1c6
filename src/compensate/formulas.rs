//! The model's formulas, row by row, beside the difference equation: their temperatures are those that the filter knows.
//!
//! ```text
//! T_j = h_j·x,  dT_j/dt = h_j·F_c x                     x the states by all readings until the row
//! Ω_k = Ω_coil + Σ formula(t_k, T, dT/dt, Ω_coil, columns; what was before)
//! ```
//!
//! A formula's own memory begins at rest with the stream and anew after a gap that the filter does not bridge.

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

use crate::coil::Coil;
use crate::effect::{DeclaredEffect, Effect, Memory, PackState, Subject};
use crate::rate::CoilModel;

/// Further columns that formulas may read.
pub(crate) const MOST_COLUMNS: usize = 8;

/// A row's values of them; None where there is none.
pub type FormulaColumns = [Option<f64>; MOST_COLUMNS];

/// What a rate sees of a column: its mean over the time that the rate is a mean over, at most that since the row before, by a
/// straight line from there.
pub(crate) fn seen(now: f64, before: f64, since_s: f64, rate_mean_s: f64) -> f64 {
    if before.is_finite() && since_s > 0.0 {
        now - (now - before) * 0.5 * rate_mean_s.min(since_s) / since_s
    } else {
        now
    }
}

/// [`seen`] of each column; one that is missing stays so.
pub(crate) fn columns_seen(
    now: &FormulaColumns,
    before: &FormulaColumns,
    since_s: f64,
    rate_mean_s: f64,
) -> FormulaColumns {
    std::array::from_fn(|i| now[i].map(|value| seen(value, before[i].unwrap_or(f64::NAN), since_s, rate_mean_s)))
}

/// The formulas of a model and what they need of the pack.
#[derive(Debug, Clone)]
pub(crate) struct Formulas {
    effects: Vec<DeclaredEffect>,
    coil: Coil,
    columns: Vec<String>,
}

impl Formulas {
    /// The model without its formulas, and those.
    pub(crate) fn split(model: &CoilModel) -> (CoilModel, Vec<DeclaredEffect>) {
        let is_formula = |e: &DeclaredEffect| matches!(e.subject(), Subject::Formula(_));
        let (formulas, rest) = model.effects.iter().cloned().partition(is_formula);
        (CoilModel { effects: rest, ..model.clone() }, formulas)
    }

    /// None where there are no formulas.
    pub(crate) fn new(coil: &Coil, effects: Vec<DeclaredEffect>) -> Option<Self> {
        let mut columns: Vec<String> = Vec::new();
        for name in effects.iter().flat_map(DeclaredEffect::channels) {
            if !columns.contains(&name) {
                columns.push(name);
            }
        }
        (!effects.is_empty()).then(|| Self { effects, coil: coil.clone(), columns })
    }

    /// At most [`MOST_COLUMNS`] of them are read.
    pub(crate) fn columns(&self) -> &[String] {
        &self.columns
    }

    pub(crate) fn effects(&self) -> &[DeclaredEffect] {
        &self.effects
    }

    /// `temperatures`: layers × states; `dynamics` states × states; places of the air and its slope among the states.
    pub(crate) fn at_work(&self, temperatures: DMatrix<f64>, dynamics: &DMatrix<f64>, air: (usize, usize)) -> AtWork {
        let rates = &temperatures * dynamics;
        AtWork {
            bound: self.effects.iter().map(|e| e.bind(&self.coil, &self.columns)).collect(),
            memories: vec![Memory::default(); self.effects.len()],
            lengths_m: self.coil.layer_lengths_m().to_vec(),
            temperatures,
            rates,
            air,
            seen: VecDeque::new(),
            columns: self.columns.len(),
        }
    }
}

/// The pack as one row found it.
#[derive(Debug, Clone)]
struct Seen {
    temperatures_k: Vec<f64>,
    rates_k_per_s: Vec<f64>,
    air: (f64, f64),
}

/// Formulas on their way through a stream.
#[derive(Debug)]
pub(crate) struct AtWork {
    bound: Vec<Box<dyn Effect>>,
    memories: Vec<Memory>,
    lengths_m: Vec<f64>,
    temperatures: DMatrix<f64>,
    rates: DMatrix<f64>,
    air: (usize, usize),
    /// The newest row first.
    seen: VecDeque<Option<Seen>>,
    columns: usize,
}

impl AtWork {
    /// Layers × states: the rows of temperatures and of their rates.
    pub(crate) fn rows(&self) -> (&DMatrix<f64>, &DMatrix<f64>) {
        (&self.temperatures, &self.rates)
    }

    /// Each layer's share of the fibre.
    pub(crate) fn shares(&self) -> Vec<f64> {
        let whole_m: f64 = self.lengths_m.iter().sum();
        self.lengths_m.iter().map(|l| l / whole_m).collect()
    }

    /// Places of the air's temperature and its slope among the states.
    pub(crate) fn air(&self) -> (usize, usize) {
        self.air
    }

    /// Takes in the states after one more row; none before the first reading. `kept` rows are remembered.
    pub(crate) fn see(&mut self, state: &[f64], kept: usize) {
        let seen = (state.len() == self.temperatures.ncols()).then(|| {
            let x = DVector::from_column_slice(state);
            Seen {
                temperatures_k: (&self.temperatures * &x).data.into(),
                rates_k_per_s: (&self.rates * &x).data.into(),
                air: (x[self.air.0], x[self.air.1]),
            }
        });
        self.seen.push_front(seen);
        self.seen.truncate(kept + 1);
    }

    /// Forgets everything.
    pub(crate) fn restart(&mut self) {
        self.seen.clear();
        self.memories.iter_mut().for_each(|m| *m = Memory::default());
    }

    /// What the formulas add to the rate of the row `lag` rows ago; rows must be asked for in their order. A formula without a
    /// value (a column that is missing) adds nothing.
    pub(crate) fn rate_rad_per_s(
        &mut self,
        lag: usize,
        time_s: f64,
        thermal_rate_rad_per_s: f64,
        columns: &FormulaColumns,
    ) -> f64 {
        let Some(Some(seen)) = self.seen.get(lag) else { return 0.0 };
        let whole_m: f64 = self.lengths_m.iter().sum();
        let mean = |values: &[f64]| values.iter().zip(&self.lengths_m).map(|(v, l)| v * l).sum::<f64>() / whole_m;
        let values: Vec<f64> = columns.iter().take(self.columns).map(|c| c.unwrap_or(f64::NAN)).collect();
        let state = PackState {
            time_s,
            temperatures_k: &seen.temperatures_k,
            rates_k_per_s: &seen.rates_k_per_s,
            axial_moments_k_per_s: &[],
            mean_temperature_k: mean(&seen.temperatures_k),
            mean_rate_k_per_s: mean(&seen.rates_k_per_s),
            ambient_k: seen.air.0,
            ambient_rate_k_per_s: seen.air.1,
            channels: &values,
            thermal_rate_rad_per_s,
        };
        let each = self.bound.iter().zip(&mut self.memories);
        each.map(|(effect, memory)| effect.outside_rate_after(&state, memory)).filter(|v| v.is_finite()).sum()
    }
}
