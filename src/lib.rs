//! coilwright designs winding patterns of fibre-optic-gyroscope coils.
//!
//! When the temperature changes, points that mirror each other about the fibre's middle warm at different rates and
//! the gyro reports a rotation that is not there (the Shupe effect). Which piece of fibre lies in which layer decides
//! how much. `ARCHITECTURE.md` shows the floors; each module imports only from the floors below its own.

// Floor 0: units and mathematics without domain words.
pub mod numeric;
pub mod units;
// Floor 1: what a coil, a pattern, a profile and a record are.
pub mod coil;
pub mod pattern;
pub mod profile;
pub mod record;
// Floor 2: heat and effects.
pub mod effect;
pub mod thermal;
// Floor 3: the readable reference of the rate error.
pub mod rate;
// Floor 4: what is done with it.
pub mod boundary;
pub mod chamber;
pub mod compare;
pub mod compensate;
pub mod diagnose;
pub mod fit;
pub mod metrics;
pub mod predict;
pub mod reproduce;
pub mod schedule;
pub mod search;
pub mod verify;
// Floor 5: files and pages.
pub mod io;
#[cfg(feature = "report")]
pub mod report;
// Floor 6: the command line.
#[cfg(feature = "cli")]
pub mod cli;
