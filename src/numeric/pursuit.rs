//! The few columns of a matrix that leave least of a vector, taken one after another.
//!
//! # Source
//! Orthogonal matching pursuit: Tropp and Gilbert, IEEE Trans. Inf. Theory 53 (2007) 4655.

use nalgebra::{DMatrix, DVector};

/// A column of which so small a share is at a right angle to others says nothing of its own.
const SAME_DIRECTION: f64 = 1e-4;

/// A pursuit so far.
#[derive(Debug, Clone)]
pub(crate) struct Pursuit {
    columns: DMatrix<f64>,
    values: DVector<f64>,
    /// Of each column its square, and what is left of it beside those taken.
    squares: DVector<f64>,
    left: DVector<f64>,
    rest: DVector<f64>,
    /// Directions of the columns taken, each at a right angle to those before.
    directions: Vec<DVector<f64>>,
    /// Places of the columns taken.
    pub(crate) taken: Vec<usize>,
}

impl Pursuit {
    /// All in units of the values' deviations.
    pub(crate) fn new(columns: DMatrix<f64>, values: DVector<f64>) -> Self {
        let squares = DVector::from_iterator(columns.ncols(), columns.column_iter().map(|c| c.norm_squared()));
        let (left, rest) = (squares.clone(), values.clone());
        Self { columns, values, squares, left, rest, directions: Vec::new(), taken: Vec::new() }
    }

    /// The column that leaves least of the rest, and by how much the log likelihood rises with it.
    pub(crate) fn best(&self) -> Option<(usize, f64)> {
        let along = self.columns.tr_mul(&self.rest);
        let says_something = |i: &usize| self.left[*i] > SAME_DIRECTION * self.squares[*i];
        let gains = (0..along.len()).filter(says_something).map(|i| (i, 0.5 * along[i] * along[i] / self.left[i]));
        gains.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    pub(crate) fn take(&mut self, place: usize) {
        self.taken.push(place);
        let mut direction = self.columns.column(place).clone_owned();
        for other in &self.directions {
            let along = direction.dot(other);
            direction.axpy(-along, other, 1.0);
        }
        let Some(direction) = direction.try_normalize(0.0) else { return };
        let along = self.rest.dot(&direction);
        self.rest.axpy(-along, &direction, 1.0);
        let shares = self.columns.tr_mul(&direction);
        self.left.iter_mut().zip(shares.iter()).for_each(|(left, share)| *left -= share * share);
        self.directions.push(direction);
    }

    /// Each column taken with its multiple where all together leave the least; none where two are the same.
    pub(crate) fn coefficients(&self) -> Vec<(usize, f64)> {
        let own = self.columns.select_columns(&self.taken);
        let Some(factor) = own.tr_mul(&own).cholesky() else { return Vec::new() };
        let found = factor.solve(&own.tr_mul(&self.values));
        self.taken.iter().copied().zip(found.iter().copied()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_a_course_are_found_with_their_sizes() {
        let rows = 200;
        let columns = DMatrix::from_fn(rows, rows, |k, j| f64::from(k >= j));
        let course = |k: usize| 3.0 * f64::from(k >= 40) - 5.0 * f64::from(k >= 120) + 0.1 * (k as f64 * 1.7).sin();
        let mut pursuit = Pursuit::new(columns, DVector::from_fn(rows, |k, _| course(k)));
        while let Some((place, gain)) = pursuit.best() {
            if gain < 8.0 {
                break;
            }
            pursuit.take(place);
        }
        let mut found = pursuit.coefficients();
        found.sort_by_key(|c| c.0);
        assert_eq!(found.iter().map(|c| c.0).collect::<Vec<_>>(), [40, 120], "{found:?}");
        assert!((found[0].1 - 3.0).abs() < 0.05 && (found[1].1 + 5.0).abs() < 0.05, "{found:?}");
    }
}
