//! What a coil's own sensor sits on.

use crate::thermal::Location;
use crate::thermal::reduced::Reduced;

/// What the sensor shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shows {
    Air,
    /// A housing, the spool or a flange.
    Part,
    OuterLayer,
}

impl Shows {
    pub(crate) fn of(location: Location) -> Self {
        match location {
            Location::Ambient => Shows::Air,
            Location::OuterLayer => Shows::OuterLayer,
            Location::Housing(_) | Location::Spool | Location::Flange(_) => Shows::Part,
        }
    }

    /// The row of the heat path that it is; None: the air.
    pub(super) fn row_of(self, reduced: &Reduced) -> Option<usize> {
        match self {
            Shows::Air => None,
            // What carries the sensor is the last row.
            Shows::Part => Some(reduced.part.unwrap_or(reduced.layers - 1)),
            Shows::OuterLayer => Some(reduced.layers - 1),
        }
    }
}
