//! The cubic through two values with given slopes.

/// Value and slope of the cubic at x, which goes from 0 at the first end to 1 at the second; slopes are per unit of x.
///
/// # Source
/// Hermite interpolation: Stoer and Bulirsch, Introduction to Numerical Analysis (2002), section 2.1.5.
pub(crate) fn hermite((a, b): (f64, f64), (p, q): (f64, f64), x: f64) -> (f64, f64) {
    let (c, d) = (3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q);
    (a + x * (p + x * (c + d * x)), p + x * (2.0 * c + 3.0 * d * x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_itself() {
        let value = |x: f64| 0.3 - x + 2.0 * x * x - 0.7 * x.powi(3);
        let slope = |x: f64| -1.0 + 4.0 * x - 2.1 * x * x;
        for x in [0.0, 0.25, 0.75, 1.0] {
            let (found, rising) = hermite((value(0.0), value(1.0)), (slope(0.0), slope(1.0)), x);
            assert!((found - value(x)).abs() < 1e-14 && (rising - slope(x)).abs() < 1e-13, "{x}: {found}, {rising}");
        }
    }
}
