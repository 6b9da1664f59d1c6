//! What happens up to and at one row of a record.

/// Thermometers that a record may have: the sensor, one at the bore, one in the air.
const THERMOMETERS: usize = 3;
/// The thermometer in the air among a row's measurements.
pub(super) const AMBIENT: usize = 2;
/// Measurements of a row: the thermometers and the rate.
pub(super) const MEASURED: usize = THERMOMETERS + 1;
/// The rate among a row's measurements.
pub(super) const RATE: usize = THERMOMETERS;

/// What happens between two rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Move {
    /// One of [`super::filter::System::steps`] passes.
    Step(u16),
    /// A window begins, which this slot remembers.
    Keep(u8),
    /// The air's slope had its kink within the step that has just passed: what one of [`super::filter::System::kinks`] says came of it.
    Kink(u16),
}

/// What happens up to and at one row of a record.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row {
    /// From the row before to this one.
    pub(crate) moves: Vec<Move>,
    /// Of how much the readings bend here: 0 at rest to 1.
    pub(crate) bend: f64,
    /// Variance of a kink of the air's slope where this row's steps begin, or at each [`Move::Kink`] [K²/s²].
    pub(crate) kink: f64,
    /// Rows of [`super::filter::System::rows`] to measure with; None where there is no value.
    pub(crate) measured: [Option<u16>; MEASURED],
    /// Values that were averaged into this one: variances are divided by it.
    pub(crate) averaged: f64,
    /// Variance of what stands for a reading beside that of even rounding: readings in a row that are one value of the sensor's grid, and
    /// so know of each other's error, or what [`super::rounding`] makes of them; by measurement.
    pub(crate) rounding: [f64; MEASURED],
}

impl Row {
    /// Whether its kink is between its steps, not where they begin.
    pub(crate) fn is_kinked_within(&self) -> bool {
        self.kink > 0.0 && self.moves.iter().any(|m| matches!(m, Move::Kink(_)))
    }
}

/// Which of its two films a pack is behind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Film {
    /// The one that the model is of.
    Usual,
    Switched,
}

impl Film {
    pub(super) const BOTH: [Self; 2] = [Self::Usual, Self::Switched];

    pub(super) fn other(self) -> Self {
        match self {
            Self::Usual => Self::Switched,
            Self::Switched => Self::Usual,
        }
    }
}
