//! What a reader sees: charts, drawings and pages.

pub mod plot;
pub mod yan1998;
