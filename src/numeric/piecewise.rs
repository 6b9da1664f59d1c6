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

#[derive(Debug, Error, Clone, Copy, PartialEq)]
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

    pub fn constant(value: f64) -> Self {
        Self { knots: vec![0.0], values: vec![value] }
    }

    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    pub fn values(&self) -> &[f64] {
        &self.values
    }

    pub fn first_value(&self) -> f64 {
        self.values[0]
    }

    /// The index of the last knot at or before `x`, if there is one.
    fn piece(&self, x: f64) -> Option<usize> {
        self.knots.partition_point(|&k| k <= x).checked_sub(1)
    }

    pub fn value(&self, x: f64) -> f64 {
        match self.piece(x) {
            None => self.values[0],
            Some(i) if i + 1 == self.knots.len() => self.values[i],
            Some(i) => self.values[i] + self.slope_of(i) * (x - self.knots[i]),
        }
    }

    /// The slope of the piece that begins at knot `i`; zero behind the last knot.
    pub fn slope_of(&self, i: usize) -> f64 {
        if i + 1 >= self.knots.len() {
            return 0.0;
        }
        (self.values[i + 1] - self.values[i]) / (self.knots[i + 1] - self.knots[i])
    }

    /// The slope just after `x`.
    pub fn slope_after(&self, x: f64) -> f64 {
        self.piece(x).map_or(0.0, |i| self.slope_of(i))
    }

    /// The slope just before `x`.
    pub fn slope_before(&self, x: f64) -> f64 {
        match self.knots.partition_point(|&k| k < x).checked_sub(1) {
            None => 0.0,
            Some(i) => self.slope_of(i),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
