//! The largest value of a smooth function between two points.

/// The place and the value of a maximum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Maximum {
    pub(crate) at: f64,
    pub(crate) value: f64,
}

/// Golden-section search for a maximum of `f` in [`low`, `high`], where `f` is unimodal.
///
/// Stops when the bracket is shorter than 1e-10 of its own start, or than rounding at its place lets it become; a
/// maximum's value is then off by the square of that, so by rounding only. Returns the best point that was evaluated.
pub(crate) fn golden_section(f: impl FnMut(f64) -> f64, low: f64, high: f64) -> Maximum {
    golden_section_within(f, low, high, 1e-10)
}

/// The same until the bracket is shorter than a share of its start.
pub(crate) fn golden_section_within(mut f: impl FnMut(f64) -> f64, low: f64, high: f64, share: f64) -> Maximum {
    let ratio = (5.0_f64.sqrt() - 1.0) / 2.0;
    let (mut a, mut b) = (low, high);
    let mut left = Maximum { at: b - ratio * (b - a), value: 0.0 };
    let mut right = Maximum { at: a + ratio * (b - a), value: 0.0 };
    left.value = f(left.at);
    right.value = f(right.at);
    // A short bracket far from zero cannot shrink below the spacing of the numbers there.
    let tolerance = ((high - low) * share).max(8.0 * f64::EPSILON * low.abs().max(high.abs()));
    while b - a > tolerance {
        if left.value >= right.value {
            b = right.at;
            right = left;
            left.at = b - ratio * (b - a);
            left.value = f(left.at);
        } else {
            a = left.at;
            left = right;
            right.at = a + ratio * (b - a);
            right.value = f(right.at);
        }
    }
    if left.value >= right.value { left } else { right }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_bracket_far_from_zero_comes_to_an_end() {
        let found = golden_section(|x| -(x - 6000.001).powi(2), 6000.0, 6000.002);
        assert!((found.at - 6000.001).abs() < 1e-6);
    }

    #[test]
    fn a_search_to_a_share_ends_within_it() {
        let mut calls = 0;
        let f = |x: f64| {
            calls += 1;
            -(x - 1.3).powi(2)
        };
        let found = golden_section_within(f, 0.0, 2.0, 0.02);
        assert!((found.at - 1.3).abs() < 0.02 * 2.0 && calls < 12, "{} in {calls}", found.at);
    }

    #[test]
    fn the_maximum_of_x_exp_minus_x_is_found_at_one() {
        let found = golden_section(|x| x * (-x).exp(), 0.0, 5.0);
        assert!((found.at - 1.0).abs() < 1e-6);
        assert!((found.value - (-1.0_f64).exp()).abs() < 1e-15);
    }
}
