//! What the effects of the scale factor share: the rate that a table turned the gyro by.
//!
//! ```text
//! F/S0 = (1 + ε) (I + E + D),   Ω_b = F/S0 − I − E − D ≈ ε I
//! ```
//!
//! ε (E + D) is left out: with some degrees an hour and some hundred ppm it is a thousandth of a degree an hour.

use super::{Binding, PackState};
use crate::record::TABLE_RATE;
use crate::units::rad_per_s_from_deg_per_h;

/// Where a record has the table's rate; a profile has none, and there nothing turns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turning {
    column: Option<usize>,
}

impl Turning {
    pub(super) fn of(binding: &Binding) -> Self {
        Self { column: binding.channels.iter().position(|name| name == TABLE_RATE) }
    }

    /// Whether there is a table at all.
    pub(super) fn is_there(self) -> bool {
        self.column.is_some()
    }

    /// I; 0 where the row does not say.
    pub(super) fn rad_per_s(self, state: &PackState) -> f64 {
        let rate = self.column.and_then(|c| state.channels.get(c)).copied().filter(|rate| rate.is_finite());
        rate.map_or(0.0, rad_per_s_from_deg_per_h)
    }
}
