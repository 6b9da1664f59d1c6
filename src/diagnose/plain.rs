//! Plain functions of time: what is left over may be one of them.

/// A shape in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ResidualShape {
    /// Slow wander, and the time after which it has forgotten itself.
    Drift {
        time_constant_s: f64,
    },
    Sinusoid {
        period_s: f64,
    },
}

/// A shape that goes along with what is left over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plain {
    pub(crate) shape: ResidualShape,
    /// By how much χ² falls.
    pub(crate) gain: f64,
    pub(crate) parameters: usize,
    /// Root mean square over the rows [rad/s].
    pub(crate) rms_rad_per_s: f64,
}
