//! What is proved about the best pattern, as it is said and written.

use super::cost::objective::Objective;
use super::proof::{Certificate, Status};

/// What is proved about the best pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Proof {
    pub(crate) status: Status,
    /// No pattern of the class is below this; zero where nothing is proved.
    pub(crate) lower_bound_rad_per_s: f64,
    /// By how much the grid may put the best pattern's rate, and that of any other, off the continuum's.
    pub(crate) grid_margin_rad_per_s: f64,
    /// The time was over before the proof was.
    pub(crate) was_cut_short: bool,
}

impl Proof {
    pub(crate) const NONE: Proof =
        Proof { status: Status::None, lower_bound_rad_per_s: 0.0, grid_margin_rad_per_s: 0.0, was_cut_short: false };

    pub(crate) fn of(certificate: &Certificate) -> Self {
        let Certificate { status, lower_bound_rad_per_s, .. } = *certificate;
        Self { status, lower_bound_rad_per_s, grid_margin_rad_per_s: 0.0, was_cut_short: status != Status::Optimal }
    }

    /// With what the grid may be off for any pattern: the lower bound then holds for the continuum.
    pub(crate) fn beside_grid(self, grid_margin_rad_per_s: f64) -> Self {
        let lower_bound_rad_per_s = (self.lower_bound_rad_per_s - grid_margin_rad_per_s).max(0.0);
        Self { lower_bound_rad_per_s, grid_margin_rad_per_s, ..self }
    }

    /// To be said after how good the best pattern is under the objective.
    pub(crate) fn words(&self, objective: Objective) -> String {
        let what = objective.title();
        match self.status {
            Status::Optimal => format!(" Proved: no pattern of the class has a smaller {what} at any time."),
            Status::Gap => format!(
                " Proved: no pattern of the class has a {what} below {}.",
                objective.shown(self.lower_bound_rad_per_s)
            ),
            Status::None => String::new(),
        }
    }
}
