//! What electronics that heat the bore do by themselves: known from the time since power-on, so it is taken off the
//! reading and put onto the rate error; what is left is the air's.
//!
//! ```text
//! T_seen(t) = T(t) − T_h(t − τ),   Ω(t) = Ω_air(t) + Ω_h(t)
//! ```
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | T_h | outermost layer's warming by the heat alone, the air at rest | `outer_k` |
//! | Ω_h | rate error by the heat alone | `rate_rad_per_s` |
//! | τ | lag of the sensor | `lag_s` |
//!
//! Holds as the pack is linear; a lag that is short beside the warm-up delays what the sensor shows of it.
//!
//! # Source
//! Superposition, as in [`crate::thermal::pack`].

use super::CompensateError;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::thermal::{self, Drive, HeatPath, Instant};
use crate::units::REFERENCE_TEMPERATURE_K;

/// Warm-up is followed for so many of its time constants and of the pack's.
const SETTLED: f64 = 14.0;
const POINTS: usize = 2000;

#[derive(Debug, Clone)]
pub(super) struct Heating {
    outer_k: PiecewiseLinear,
    rate_rad_per_s: PiecewiseLinear,
    lag_s: f64,
}

impl Heating {
    /// `path` has its boundary in the air; `gains` is dΩ/dṪ_j, `slowest_per_s` the pack's slowest decay.
    pub(super) fn of(
        path: &HeatPath,
        gains: &[f64],
        slowest_per_s: f64,
        window_s: f64,
        lag_s: f64,
    ) -> Result<Option<Self>, CompensateError> {
        if !path.has_own_course() {
            return Ok(None);
        }
        let end_s = SETTLED * (path.own_course_s() + 1.0 / slowest_per_s);
        let times_s: Vec<f64> = (1..=POINTS).map(|i| i as f64 / POINTS as f64 * end_s).collect();
        let field = thermal::solve(path, &Drive::boundary(PiecewiseLinear::constant(REFERENCE_TEMPERATURE_K)))?;
        let instants: Vec<Instant> = times_s.iter().map(|t| Instant::after(*t)).collect();
        let (now, means) = (field.at(&instants), field.means(&times_s, window_s));
        let (mut knots, mut outer, mut rate) = (vec![0.0], vec![0.0], vec![0.0]);
        for (row, time_s) in times_s.into_iter().enumerate() {
            knots.push(time_s);
            outer.push(now.temperatures_k(row)[now.layers - 1] - REFERENCE_TEMPERATURE_K);
            rate.push(means.rates_k_per_s(row).iter().zip(gains).map(|(r, g)| r * g).sum());
        }
        let (Ok(outer_k), Ok(rate_rad_per_s)) =
            (PiecewiseLinear::new(knots.clone(), outer), PiecewiseLinear::new(knots, rate))
        else {
            return Ok(None);
        };
        Ok(Some(Self { outer_k, rate_rad_per_s, lag_s }))
    }

    /// For a sensor in the air.
    pub(super) fn unseen(self) -> Self {
        Self { outer_k: PiecewiseLinear::constant(0.0), ..self }
    }

    /// How much of a reading it is.
    pub(super) fn reading_k(&self, time_s: f64) -> f64 {
        self.outer_k.value(time_s - self.lag_s)
    }

    pub(super) fn rate_rad_per_s(&self, time_s: f64) -> f64 {
        self.rate_rad_per_s.value(time_s)
    }
}
