//! Plain functions of time: what is left over may be one of them.

/// A shape in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    Drift,
    Exponential { time_constant_s: f64 },
    Sinusoid { period_s: f64 },
}

/// A shape that goes along with what is left over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plain {
    pub shape: Shape,
    /// By how much χ² falls.
    pub gain: f64,
    pub parameters: usize,
    /// Root mean square over the rows [rad/s].
    pub rms_rad_per_s: f64,
}
