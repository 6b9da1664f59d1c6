//! What a number in a file may be.

/// What a number may be.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) lower: f64,
    pub(crate) upper: f64,
}

impl Limits {
    pub(crate) const fn between(lower: f64, upper: f64) -> Self {
        Self { lower, upper }
    }
}
