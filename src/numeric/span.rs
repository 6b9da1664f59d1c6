//! What a few columns can make up for of another, and what they cannot.
//!
//! # Source
//! Gram and Schmidt with every projection done twice: Giraud, Langou and Rozložník, Comput. Math. Appl. 50 (2005) 1069.

/// An orthonormal basis of columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Span(Vec<Vec<f64>>);

/// A column that others make up for but for this share of its length is theirs.
const DEPENDENT: f64 = 1e-6;

impl Span {
    /// # Shapes
    /// Columns of one length; any number of them, dependent ones too.
    pub fn of(columns: &[Vec<f64>]) -> Self {
        let mut span = Self(Vec::new());
        for column in columns {
            let mut rest = span.complement(&span.complement(column));
            let left = length(&rest);
            if left > DEPENDENT * length(column) && left.is_finite() {
                rest.iter_mut().for_each(|v| *v /= left);
                span.0.push(rest);
            }
        }
        span
    }

    /// What of a column no combination of the basis makes up for.
    pub fn complement(&self, column: &[f64]) -> Vec<f64> {
        let mut rest = column.to_vec();
        for unit in &self.0 {
            let along: f64 = unit.iter().zip(&rest).map(|(u, r)| u * r).sum();
            rest.iter_mut().zip(unit).for_each(|(r, u)| *r -= along * u);
        }
        rest
    }
}

fn length(column: &[f64]) -> f64 {
    column.iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_columns_cannot_explain_is_left_over_however_often_they_are_given() {
        let span = Span::of(&[vec![2.0, 0.0, 0.0], vec![1.0, 1.0, 0.0], vec![0.0, 5.0, 0.0]]);
        assert!((length(&span.complement(&[3.0, 4.0, 12.0])) - 12.0).abs() < 1e-12);
        assert_eq!(Span::of(&[vec![0.0; 3]]).complement(&[3.0, 4.0, 12.0]), [3.0, 4.0, 12.0]);
    }
}
