//! A continuous piecewise-linear function of one variable.

use thiserror::Error;

/// Continuous, piecewise linear, constant before its first and after its last knot.
///
/// # Shapes
/// `knots` and `values` have the same length of at least one; `knots` increase strictly.
#[derive(Debug, Clone, PartialEq)]
pub struct PiecewiseLinear {
    knots: Vec<f64>,
    values: Vec<f64>,
}

/// Why knots and values make no function.
#[derive(Debug, Error, Clone, Copy, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum PiecewiseError {
    #[error(
        "a piecewise-linear function needs at least one knot and a value at each, found {knots} knots and {values} values"
    )]
    Shape { knots: usize, values: usize },
    #[error("knots must increase strictly, knot {index} ({found}) does not")]
    NotIncreasing { index: usize, found: f64 },
    #[error("knot {index} or its value is not a finite number")]
    NotFinite { index: usize },
}

impl PiecewiseLinear {
    /// # Errors
    /// Unequal or zero lengths, knots that do not increase, numbers that are not finite.
    pub fn new(knots: Vec<f64>, values: Vec<f64>) -> Result<Self, PiecewiseError> {
        if knots.is_empty() || knots.len() != values.len() {
            return Err(PiecewiseError::Shape { knots: knots.len(), values: values.len() });
        }
        if let Some(index) = (0..knots.len()).find(|&i| !knots[i].is_finite() || !values[i].is_finite()) {
            return Err(PiecewiseError::NotFinite { index });
        }
        if let Some(index) = (1..knots.len()).find(|&i| knots[i] <= knots[i - 1]) {
            return Err(PiecewiseError::NotIncreasing { index, found: knots[index] });
        }
        Ok(Self { knots, values })
    }

    /// The same everywhere.
    pub fn constant(value: f64) -> Self {
        Self { knots: vec![0.0], values: vec![value] }
    }

    /// Where straight pieces meet; increasing.
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    pub(crate) fn first_value(&self) -> f64 {
        self.values[0]
    }

    /// The index of the last knot at or before `x`, if there is one.
    fn piece(&self, x: f64) -> Option<usize> {
        self.knots.partition_point(|&k| k <= x).checked_sub(1)
    }

    /// Constant before the first knot and behind the last.
    pub fn value(&self, x: f64) -> f64 {
        match self.piece(x) {
            None => self.values[0],
            Some(i) if i + 1 == self.knots.len() => self.values[i],
            Some(i) => self.values[i] + self.slope_of(i) * (x - self.knots[i]),
        }
    }

    /// The slope of the piece that begins at knot `i`; zero behind the last knot.
    pub(crate) fn slope_of(&self, i: usize) -> f64 {
        if i + 1 >= self.knots.len() {
            return 0.0;
        }
        (self.values[i + 1] - self.values[i]) / (self.knots[i + 1] - self.knots[i])
    }

    /// The slope just after `x`.
    pub(crate) fn slope_after(&self, x: f64) -> f64 {
        self.piece(x).map_or(0.0, |i| self.slope_of(i))
    }

    /// The slope just before `x`.
    pub(crate) fn slope_before(&self, x: f64) -> f64 {
        match self.knots.partition_point(|&k| k < x).checked_sub(1) {
            None => 0.0,
            Some(i) => self.slope_of(i),
        }
    }
}

/// Means over the time `over` until each place, of straight lines between values; constant before the first. `places`
/// increase strictly. A value that is no number has no mean, and the next one stands for it in means that reach back to it.
///
/// ```text
/// y_k = (1/τ) ∫_{x_k − τ}^{x_k} y dx;   for τ no longer than the step h:  y_k − (y_k − y_{k−1}) τ / (2 h)
/// ```
pub(crate) fn trailing_means(places: &[f64], values: &[f64], over: f64) -> Vec<f64> {
    if !(over > 0.0) {
        return values.to_vec();
    }
    let mut held = values.to_vec();
    for k in (1..held.len()).rev() {
        if !held[k - 1].is_finite() {
            held[k - 1] = held[k];
        }
    }
    let mean = |k: usize| {
        let mut left = over;
        let mut sum = 0.0;
        let mut at = k;
        while left > 0.0 && at > 0 {
            let step = places[at] - places[at - 1];
            let taken = step.min(left);
            sum += taken * (held[at] - (held[at] - held[at - 1]) * 0.5 * taken / step);
            left -= taken;
            at -= 1;
        }
        (sum + left.max(0.0) * held[at]) / over
    };
    (0..values.len()).map(|k| if values[k].is_finite() { mean(k) } else { values[k] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trailing_means_are_the_integrals_of_straight_lines() {
        // y = 2 x on rows that are not evenly apart, from x = 1 on.
        let places = [1.0, 2.0, 2.5, 5.0, 6.0];
        let values = places.map(|x| 2.0 * x);
        assert_eq!(trailing_means(&places, &values, 0.0), values);
        let short = trailing_means(&places, &values, 0.5);
        assert_eq!(short, [2.0, 3.5, 4.5, 9.5, 11.5]);
        // Over three steps and before the beginning, where it is constant.
        let long = trailing_means(&places, &values, 4.0);
        assert!((long[4] - 2.0 * 4.0).abs() < 1e-12);
        assert!((long[1] - (3.0 * 2.0 + 1.0 * 3.0) / 4.0).abs() < 1e-12);
        let gaps = trailing_means(&[0.0, 1.0, 2.0], &[1.0, f64::NAN, 3.0], 1.0);
        assert!(gaps[1].is_nan() && (gaps[0], gaps[2]) == (1.0, 3.0));
    }

    #[test]
    fn values_and_one_sided_slopes_are_those_of_a_ramp_and_a_soak() {
        let f = PiecewiseLinear::new(vec![0.0, 2.0, 5.0], vec![1.0, 5.0, 5.0]).unwrap();
        assert_eq!((f.value(-1.0), f.value(1.0), f.value(9.0)), (1.0, 3.0, 5.0));
        assert_eq!((f.slope_before(0.0), f.slope_after(0.0)), (0.0, 2.0));
        assert_eq!((f.slope_before(2.0), f.slope_after(2.0), f.slope_after(5.0)), (2.0, 0.0, 0.0));
    }

    #[test]
    fn knots_that_step_back_are_named() {
        let error = PiecewiseLinear::new(vec![0.0, 2.0, 1.0], vec![0.0; 3]).unwrap_err();
        assert_eq!(error, PiecewiseError::NotIncreasing { index: 2, found: 1.0 });
    }
}
