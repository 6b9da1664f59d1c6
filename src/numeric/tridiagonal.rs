//! Eigenvalues of a symmetric tridiagonal matrix, with its eigenvectors seen through given rows only.
//!
//! ```text
//! T = V diag(λ) Vᵀ,   wanted: λ and R V for a few rows R
//! ```
//!
//! A general symmetric solver first reduces a full matrix and then rotates all n rows of V. Here the matrix is
//! tridiagonal already and the rotations act on the wanted rows only, which takes a little more than half the time (see
//! `benches/thermal.rs`); a test compares the result with the general solver of nalgebra.
//!
//! # Source
//! Implicit QL with Wilkinson's shift: Bowdler, Martin, Reinsch, Wilkinson, Numer. Math. 11 (1968) 293 (`tql2`).

use nalgebra::DMatrix;

/// A matrix so ill-scaled that the iteration does not end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotConverged;

/// Sweeps for one eigenvalue before giving up; two are usual.
const MAX_SWEEPS: usize = 60;

/// Replaces `diagonal` by the eigenvalues and `rows` by `rows · V`, both in the same (no particular) order.
///
/// # Shapes
/// `diagonal` has n entries, `off_diagonal` n − 1, `rows` n columns.
///
/// # Errors
/// Entries that are not finite; an iteration that does not end.
pub fn diagonalise(diagonal: &mut [f64], off_diagonal: &[f64], rows: &mut DMatrix<f64>) -> Result<(), NotConverged> {
    let n = diagonal.len();
    if diagonal.iter().chain(off_diagonal).any(|v| !v.is_finite()) {
        return Err(NotConverged);
    }
    let mut off = off_diagonal.to_vec();
    off.push(0.0);
    let height = rows.nrows();
    let data = rows.as_mut_slice();
    for low in 0..n {
        let mut sweeps = 0;
        loop {
            // The block from `low` ends where an off-diagonal element is negligible.
            let end = (low..n - 1)
                .find(|&i| off[i].abs() <= f64::EPSILON * (diagonal[i].abs() + diagonal[i + 1].abs()))
                .unwrap_or(n - 1);
            if end == low {
                break;
            }
            sweeps += 1;
            if sweeps > MAX_SWEEPS {
                return Err(NotConverged);
            }
            let half_gap = (diagonal[low + 1] - diagonal[low]) / (2.0 * off[low]);
            let root = half_gap.hypot(1.0);
            let mut g = diagonal[end] - diagonal[low] + off[low] / (half_gap + root.copysign(half_gap));
            let (mut sine, mut cosine, mut shift) = (1.0, 1.0, 0.0);
            let mut split = false;
            for i in (low..end).rev() {
                let f = sine * off[i];
                let b = cosine * off[i];
                let radius = f.hypot(g);
                off[i + 1] = radius;
                if radius == 0.0 {
                    // An element vanished by itself: the block falls into two.
                    diagonal[i + 1] -= shift;
                    off[end] = 0.0;
                    split = true;
                    break;
                }
                sine = f / radius;
                cosine = g / radius;
                let gap = diagonal[i + 1] - shift;
                let r = (diagonal[i] - gap) * sine + 2.0 * cosine * b;
                shift = sine * r;
                diagonal[i + 1] = gap + shift;
                g = cosine * r - b;
                let (left, right) = data[i * height..(i + 2) * height].split_at_mut(height);
                for (a, b) in left.iter_mut().zip(right) {
                    let kept = *b;
                    *b = sine * *a + cosine * kept;
                    *a = cosine * *a - sine * kept;
                }
            }
            if split {
                continue;
            }
            diagonal[low] -= shift;
            off[low] = g;
            off[end] = 0.0;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SymmetricEigen;

    #[test]
    fn eigenvalues_and_rows_are_those_of_the_general_solver() {
        for n in [1, 2, 3, 17, 48] {
            // Stiffness as in a pack: conductances that differ by powers of ten, and a loose end.
            let off: Vec<f64> = (1..n).map(|i| -((i % 5) as f64 + 0.3) * 10f64.powi((i % 4) as i32 - 2)).collect();
            let diagonal: Vec<f64> = (0..n)
                .map(|i| {
                    let before = if i > 0 { off[i - 1].abs() } else { 1e-6 };
                    before + off.get(i).map_or(0.0, |o: &f64| o.abs())
                })
                .collect();
            let mut full = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(diagonal.clone()));
            for (i, o) in off.iter().enumerate() {
                full[(i, i + 1)] = *o;
                full[(i + 1, i)] = *o;
            }
            let general = SymmetricEigen::new(full.clone());
            let mut rows = DMatrix::identity(n, n);
            let mut values = diagonal;
            diagonalise(&mut values, &off, &mut rows).unwrap();
            let rebuilt =
                &rows * DMatrix::from_diagonal(&nalgebra::DVector::from_vec(values.clone())) * rows.transpose();
            let scale = full.amax();
            assert!((rebuilt - &full).amax() < 1e-13 * scale, "{n}");
            let mut expected: Vec<f64> = general.eigenvalues.iter().copied().collect();
            expected.sort_by(f64::total_cmp);
            values.sort_by(f64::total_cmp);
            for (found, expected) in values.iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-13 * scale, "{n}: {found} {expected}");
            }
        }
    }

    #[test]
    fn numbers_that_are_not_finite_end_in_an_error() {
        let mut rows = DMatrix::identity(2, 2);
        assert_eq!(diagonalise(&mut [f64::NAN, 1.0], &[0.5], &mut rows), Err(NotConverged));
    }
}
