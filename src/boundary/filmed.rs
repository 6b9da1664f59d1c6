//! The pack behind one film: which of its modes count, and how they move on.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use nalgebra::DMatrix;

use super::air::SAME_TIME_S;
use super::layout::Layout;
use crate::numeric::exponential::exponential;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::thermal::pack::Pack;
use crate::thermal::{HeatPath, ThermalError};

/// Modes faster than this share of the sampling interval follow without delay.
const FASTEST_MODE_PER_INTERVAL: f64 = 0.1;
const MAX_MODES: usize = 8;
/// What the largest amplitude of a mode must be to count, if there are more than those along the radius.
const LEAST_AMPLITUDE: f64 = 1e-3;
/// Steps whose transitions are kept; those beside a kink change whenever it moves.
const MOST_EXPONENTIALS: usize = 64;

/// What depends on nothing but the film.
#[derive(Debug)]
pub(super) struct Filmed {
    pub film_w_per_m2_k: Option<f64>,
    pub pack: Pack,
    /// Modes that count, slowest first, and how many of them are states.
    pub order: Vec<usize>,
    pub kept: usize,
    /// What the linear path to the air leaves out of the outermost layer.
    pub added_k: Option<PiecewiseLinear>,
    /// e^{A dt} for steps met so far.
    exponentials: Mutex<HashMap<u64, Arc<DMatrix<f64>>>>,
}

impl Filmed {
    /// `path` with the film; `interval_s` between readings.
    ///
    /// # Errors
    /// A heat path that cannot be solved.
    pub fn new(
        film_w_per_m2_k: Option<f64>,
        path: &HeatPath,
        added_k: Option<PiecewiseLinear>,
        interval_s: f64,
    ) -> Result<Self, ThermalError> {
        let pack = Pack::new(path)?;
        let layers = path.shape.layers;
        let largest = |mode: usize| (0..layers).map(|layer| pack.amplitude(layer, mode).abs()).fold(0.0, f64::max);
        // A flange makes many modes that hardly any layer's mean sees.
        let least = if path.flange.is_some() { LEAST_AMPLITUDE } else { 0.0 };
        let mut order: Vec<usize> = (0..pack.decays_per_s().len()).filter(|&mode| largest(mode) >= least).collect();
        order.sort_by(|&a, &b| pack.decays_per_s()[a].total_cmp(&pack.decays_per_s()[b]));
        let fastest_per_s = 1.0 / (FASTEST_MODE_PER_INTERVAL * interval_s);
        let kept = order.iter().take_while(|&&m| pack.decays_per_s()[m] < fastest_per_s).count().clamp(1, MAX_MODES);
        let kept = kept.min(order.len());
        Ok(Self { film_w_per_m2_k, pack, order, kept, added_k, exponentials: Mutex::default() })
    }

    /// e^{A dt}: most steps are one sampling interval.
    pub fn exponential(&self, dynamics: &DMatrix<f64>, step_s: f64) -> Arc<DMatrix<f64>> {
        let key = (step_s / SAME_TIME_S).round() as u64;
        if let Ok(known) = self.exponentials.lock()
            && let Some(exponential) = known.get(&key)
        {
            return exponential.clone();
        }
        let exponential = Arc::new(exponential(&(dynamics * step_s)));
        if let Ok(mut known) = self.exponentials.lock()
            && known.len() < MOST_EXPONENTIALS
        {
            known.insert(key, exponential.clone());
        }
        exponential
    }
}

/// e^{A dt}; where a window begins, the rate functional is copied before the state moves on.
pub(super) fn transition(exponential: &DMatrix<f64>, layout: Layout, copied: Option<&[f64]>) -> Vec<f64> {
    let n = layout.size();
    let moving = layout.moving();
    let mut matrix = vec![0.0; n * n];
    for i in 0..moving {
        for j in 0..moving {
            matrix[i * n + j] = exponential[(i, j)];
        }
    }
    if layout.with_rate {
        let start = layout.window_start();
        match copied {
            Some(functional) => matrix[start * n..start * n + start].copy_from_slice(&functional[..start]),
            None => matrix[start * n + start] = 1.0,
        }
    }
    matrix
}
