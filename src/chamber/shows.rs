//! What a coil's own sensor sits on.

use crate::thermal::Location;

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
}
