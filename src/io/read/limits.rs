//! What a number in a file may be.

/// What a number may be.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    pub lower: f64,
    pub upper: f64,
}

impl Limits {
    pub const fn between(lower: f64, upper: f64) -> Self {
        Self { lower, upper }
    }
}
