//! How bounds are kept: the optimiser moves freely in u, the parameter stays within its limits.

use super::Parameter;

/// A start at a bound is moved inside by this share of the range, where the derivative does not vanish.
const INSIDE: f64 = 1e-3;

/// From the optimiser's unbounded u to a bounded p and back.
#[derive(Debug, Clone, Copy)]
pub(super) enum Map {
    Free,
    Above { lower: f64 },
    Below { upper: f64 },
    Between { lower: f64, upper: f64 },
    Decades { lower: f64, upper: f64 },
}

impl Map {
    pub fn new(parameter: &Parameter) -> Self {
        let Parameter { lower, upper, .. } = *parameter;
        match (lower.is_finite(), upper.is_finite()) {
            (false, false) => Map::Free,
            (true, false) => Map::Above { lower },
            (false, true) => Map::Below { upper },
            (true, true) if Self::is_logarithmic(parameter) => Map::Decades { lower: lower.ln(), upper: upper.ln() },
            (true, true) => Map::Between { lower, upper },
        }
    }

    pub fn is_logarithmic(parameter: &Parameter) -> bool {
        parameter.lower > 0.0 && parameter.upper.is_finite() && parameter.upper / parameter.lower >= 100.0
    }

    /// The value itself, or one a little inside where it is at a bound.
    pub fn inside(&self, p: f64) -> f64 {
        match *self {
            Map::Free => p,
            Map::Above { lower } => p.max(lower + INSIDE * p.abs().max(1.0)),
            Map::Below { upper } => p.min(upper - INSIDE * p.abs().max(1.0)),
            Map::Between { lower, upper } => {
                let inset = INSIDE * (upper - lower);
                // The middle of a narrow start is kept: only what is at a bound moves.
                if p - lower < 1e-9 * (upper - lower) {
                    lower + inset
                } else if upper - p < 1e-9 * (upper - lower) {
                    upper - inset
                } else {
                    p
                }
            }
            Map::Decades { lower, upper } => {
                let inset = INSIDE * (upper - lower);
                p.ln().clamp(lower + inset, upper - inset).exp()
            }
        }
    }

    pub fn outer(&self, u: f64) -> f64 {
        match *self {
            Map::Free => u,
            Map::Above { lower } => lower + (u * u + 1.0).sqrt() - 1.0,
            Map::Below { upper } => upper - (u * u + 1.0).sqrt() + 1.0,
            Map::Between { lower, upper } => 0.5 * (lower + upper) + 0.5 * (upper - lower) * u.sin(),
            Map::Decades { lower, upper } => (0.5 * (lower + upper) + 0.5 * (upper - lower) * u.sin()).exp(),
        }
    }

    pub fn inner(&self, p: f64) -> f64 {
        match *self {
            Map::Free => p,
            Map::Above { lower } => ((p - lower + 1.0).powi(2) - 1.0).max(0.0).sqrt(),
            Map::Below { upper } => ((upper - p + 1.0).powi(2) - 1.0).max(0.0).sqrt(),
            Map::Between { lower, upper } => (2.0 * (p - lower) / (upper - lower) - 1.0).clamp(-1.0, 1.0).asin(),
            Map::Decades { lower, upper } => (2.0 * (p.ln() - lower) / (upper - lower) - 1.0).clamp(-1.0, 1.0).asin(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_in_and_out_again_gives_the_parameter_back_and_never_leaves_the_bounds() {
        let infinite = f64::INFINITY;
        for (lower, upper) in [(-infinite, infinite), (2.0, infinite), (-infinite, 9.0), (2.0, 9.0), (1e-3, 1e3)] {
            let map = Map::new(&Parameter { start: 3.0, lower, upper });
            for p in [2.5, 3.0, 8.75] {
                assert!((map.outer(map.inner(p)) - p).abs() < 1e-12 * p, "{lower} … {upper}: {p}");
            }
            for u in [-40.0, -1.0, 0.0, 0.3, 25.0] {
                let p = map.outer(u);
                assert!(p >= lower * (1.0 - 1e-12) && p <= upper * (1.0 + 1e-12), "{lower} … {upper}: {p}");
            }
        }
    }
}
