//! What stands beside a pattern's rates: by how much the grid may put them off, the check on a finer one, the pointing error.

use crate::pattern::Pattern;
use crate::rate::CoilModel;
use crate::search::cost::grid_margin::GridMargin;
use crate::search::cost::objective::Objective;
use crate::search::cost::pointing::{EndlessRamp, POINTING_S, largest_change_rad, worst_pointing};
use crate::search::cost::tolerance::with_middle_moved;
use crate::search::cost::worst_case::{SearchError, SolvedProfiles};
use crate::units::{mm_from_m, percent_from_fraction};

/// A worst rate that a finer grid changes by more than this is not to be relied upon.
const GRID_CAUTION: f64 = 0.005;

/// What the grid is checked by: what the search was for, as far as one profile after the other shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum GridFigure {
    WorstRate,
    GuaranteedRate,
    /// As the rate that makes it in one hour.
    Pointing,
}

/// A rate on the model's grid and on one twice as fine.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GridChecked {
    pub(crate) name: String,
    pub(crate) rate_rad_per_s: f64,
    pub(crate) finer_rad_per_s: f64,
}

impl GridChecked {
    /// By how much the finer grid changes the rate, over the rate.
    pub(crate) fn change(&self) -> f64 {
        if self.rate_rad_per_s == 0.0 { 0.0 } else { self.finer_rad_per_s / self.rate_rad_per_s - 1.0 }
    }
}

/// The rates of a search's best pattern, first, and of QUA on two grids: a search makes use of whatever a coarse grid
/// hides, so its best gains most from the grid's error.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GridCheck {
    pub(crate) of: GridFigure,
    pub(crate) cells_per_layer: usize,
    pub(crate) finer_cells_per_layer: usize,
    pub(crate) patterns: Vec<GridChecked>,
}

impl GridCheck {
    /// What to say where the grid matters.
    pub(crate) fn caution(&self) -> Option<String> {
        let best = self.patterns.first().filter(|best| best.change().abs() > GRID_CAUTION)?;
        let objective = match self.of {
            GridFigure::WorstRate => Objective::WorstRate,
            GridFigure::GuaranteedRate => Objective::GuaranteedRate,
            GridFigure::Pointing => Objective::Pointing,
        };
        Some(format!(
            "Caution: with {} instead of {} cells a layer its {} is {}, {:.1} % {}. \
             Set thermal.cells_per_layer = {} and search again.",
            self.finer_cells_per_layer,
            self.cells_per_layer,
            objective.title(),
            objective.shown(best.finer_rad_per_s),
            percent_from_fraction(best.change().abs()),
            if best.change() > 0.0 { "more" } else { "less" },
            self.finer_cells_per_layer,
        ))
    }
}

/// What the rate error of a pattern adds up to.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PointingError {
    /// The largest over all profiles and times, with its sign.
    pub(crate) worst_rad: f64,
    /// None for models that have no bound over all profiles.
    pub(crate) guaranteed_rad: Option<f64>,
}

/// By how much the objective of two patterns must differ to be different in a coil that is wound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resolution {
    /// Between the middle of the fibre and that of the coil: the fibre's diameter \[m\].
    pub(crate) offset_m: f64,
    /// What that changes at most over all profiles and times: the best pattern's rate error, or its pointing error as the rate
    /// that makes it in one hour; of the rms error, the rms of that change.
    pub(crate) change_rad_per_s: f64,
}

impl Resolution {
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn of(
        objective: Objective,
        model: &CoilModel,
        solved: &SolvedProfiles,
        pattern: &Pattern,
    ) -> Result<Self, SearchError> {
        let offset_m = model.coil.fibre().outer_diameter_m;
        let moved = with_middle_moved(model, offset_m);
        let change_rad_per_s = if objective == Objective::Pointing {
            largest_change_rad(model, &moved, solved, pattern)? / POINTING_S
        } else {
            objective.change_rad_per_s([model, &moved], solved, pattern)?
        };
        Ok(Self { offset_m, change_rad_per_s })
    }

    /// In words.
    pub(crate) fn words(self, objective: Objective) -> String {
        let figures = if objective == Objective::Pointing { "pointing errors" } else { "rate errors" };
        format!(
            "A middle of the fibre that is off by no more than its diameter, {:.3} mm, changes up to {}: {figures} that are \
             closer together than that are the same in a coil that is wound.",
            mm_from_m(self.offset_m),
            objective.shown_finely(self.change_rad_per_s)
        )
    }
}

/// What is worked out once a model for what stands beside rates.
#[derive(Debug)]
pub(crate) struct Aside {
    pub(crate) margin: GridMargin,
    pub(crate) ramp: Option<EndlessRamp>,
}

impl Aside {
    /// # Errors
    /// Heat paths that cannot be solved.
    pub(crate) fn new(model: &CoilModel, solved: &SolvedProfiles) -> Result<Self, SearchError> {
        Ok(Self { margin: GridMargin::new(model, solved)?, ramp: EndlessRamp::new(model)? })
    }

    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn pointing(
        &self,
        model: &CoilModel,
        solved: &SolvedProfiles,
        pattern: &Pattern,
        max_rate_k_per_s: f64,
    ) -> Result<PointingError, SearchError> {
        let guaranteed = self.ramp.as_ref().map(|ramp| ramp.guaranteed_rad(pattern, max_rate_k_per_s)).transpose()?;
        let worst_rad = worst_pointing(model, solved, pattern)?.rate_rad_per_s;
        Ok(PointingError { worst_rad, guaranteed_rad: guaranteed.flatten() })
    }
}
