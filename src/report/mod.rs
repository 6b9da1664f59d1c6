//! What a reader sees: charts, drawings and pages.

pub mod plot;
