//! Eigenvalues of a symmetric matrix, with its eigenvectors seen through given rows only.
//!
//! ```text
//! S = Q T Qᵀ,   T = V diag(λ) Vᵀ,   wanted: λ and R Q V for a few rows R
//! ```
//!
//! A general symmetric solver rotates all n rows of Q V. Here reflections and rotations act on the wanted rows only, which
//! takes a little more than half the time (see `benches/thermal.rs`); a test compares the result with the general solver
//! of nalgebra.
//!
//! # Source
//! Reflections: Householder, after Golub and Van Loan, Matrix Computations, section 8.3. Implicit QL with Wilkinson's
//! shift: Bowdler, Martin, Reinsch, Wilkinson, Numer. Math. 11 (1968) 293 (`tql2`).

use crate::numeric::order::sort_descending;
use nalgebra::DMatrix;
use pulp::Arch;

/// A matrix so ill-scaled that the iteration does not end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotConverged;

/// Sweeps for one eigenvalue before giving up; two are usual.
const MAX_SWEEPS: usize = 60;

/// The eigenvalues of a full symmetric matrix, in no particular order; `rows` becomes `rows · Q V`.
///
/// # Shapes
/// `matrix` is n × n and symmetric, `rows` has n columns.
///
/// # Errors
/// As [`diagonalise`].
pub(crate) fn diagonalise_full(matrix: DMatrix<f64>, rows: &mut DMatrix<f64>) -> Result<Vec<f64>, NotConverged> {
    Arch::new().dispatch(|| full(matrix, rows))
}

#[inline(always)]
fn full(matrix: DMatrix<f64>, rows: &mut DMatrix<f64>) -> Result<Vec<f64>, NotConverged> {
    let n = matrix.nrows();
    // Reflections from the largest entries on, then rotations from the smallest: so small eigenvalues of a matrix whose scales
    // differ keep their own digits, and not only those that the largest one leaves.
    let mut order: Vec<usize> = (0..n).collect();
    sort_descending(&mut order, |item| matrix[(*item, *item)]);
    let sorted = DMatrix::from_fn(n, n, |i, j| matrix[(order[i], order[j])]);
    *rows = DMatrix::from_fn(rows.nrows(), n, |row, i| rows[(row, order[i])]);
    let (mut diagonal, mut off) = reduced(sorted, rows);
    diagonal.reverse();
    off.reverse();
    (0..n / 2).for_each(|i| rows.swap_columns(i, n - 1 - i));
    rotated(&mut diagonal, &off, rows)?;
    Ok(diagonal)
}

/// The diagonal and off-diagonal of Qᵀ S Q; `rows` becomes `rows · Q`.
#[inline(always)]
fn reduced(matrix: DMatrix<f64>, rows: &mut DMatrix<f64>) -> (Vec<f64>, Vec<f64>) {
    let n = matrix.nrows();
    let height = rows.nrows();
    let mut data: Vec<f64> = matrix.data.into();
    let seen = rows.as_mut_slice();
    let (mut diagonal, mut off) = (Vec::with_capacity(n), Vec::with_capacity(n.saturating_sub(1)));
    let (mut mirror, mut image, mut through) = (vec![0.0; n], vec![0.0; n], vec![0.0; height]);
    for k in 0..n.saturating_sub(2) {
        diagonal.push(data[k * n + k]);
        let size = data[k * n + k + 1..(k + 1) * n].iter().map(|v| v * v).sum::<f64>().sqrt();
        let first = data[k * n + k + 1];
        let below = &mut mirror[k + 1..];
        below.copy_from_slice(&data[k * n + k + 1..(k + 1) * n]);
        off.push(-size.copysign(first));
        // A column that is tridiagonal already needs no reflection.
        if data[k * n + k + 2..(k + 1) * n].iter().all(|v| *v == 0.0) {
            off[k] = first;
            continue;
        }
        below[0] += size.copysign(first);
        let twice_over_square = 2.0 / below.iter().map(|v| v * v).sum::<f64>();
        // p = 2 S v/(vᵀv), then S ← S − v wᵀ − w vᵀ with w = p − (pᵀv/vᵀv) v.
        image[k + 1..].fill(0.0);
        for (j, v) in (k + 1..n).zip(below.iter()) {
            let factor = twice_over_square * v;
            let column = &data[j * n + k + 1..(j + 1) * n];
            image[k + 1..].iter_mut().zip(column).for_each(|(p, s)| *p += factor * s);
        }
        let along = image[k + 1..].iter().zip(below.iter()).map(|(p, v)| p * v).sum::<f64>();
        let share = 0.5 * twice_over_square * along;
        image[k + 1..].iter_mut().zip(below.iter()).for_each(|(p, v)| *p -= share * v);
        for j in k + 1..n {
            let (v, w) = (mirror[j], image[j]);
            let column = &mut data[j * n + k + 1..(j + 1) * n];
            for ((s, a), b) in column.iter_mut().zip(&mirror[k + 1..]).zip(&image[k + 1..]) {
                *s -= a * w + b * v;
            }
        }
        through.fill(0.0);
        for j in k + 1..n {
            let column = &seen[j * height..(j + 1) * height];
            through.iter_mut().zip(column).for_each(|(t, r)| *t += mirror[j] * r);
        }
        for j in k + 1..n {
            let factor = twice_over_square * mirror[j];
            let column = &mut seen[j * height..(j + 1) * height];
            column.iter_mut().zip(&through).for_each(|(r, t)| *r -= factor * t);
        }
    }
    for k in n.saturating_sub(2)..n {
        diagonal.push(data[k * n + k]);
        if k + 1 < n {
            off.push(data[k * n + k + 1]);
        }
    }
    (diagonal, off)
}

/// Replaces `diagonal` by the eigenvalues and `rows` by `rows · V`, both in the same (no particular) order.
///
/// # Shapes
/// `diagonal` has n entries, `off_diagonal` n − 1, `rows` n columns.
///
/// # Errors
/// Entries that are not finite; an iteration that does not end.
pub fn diagonalise(diagonal: &mut [f64], off_diagonal: &[f64], rows: &mut DMatrix<f64>) -> Result<(), NotConverged> {
    Arch::new().dispatch(|| rotated(diagonal, off_diagonal, rows))
}

#[inline(always)]
fn rotated(diagonal: &mut [f64], off_diagonal: &[f64], rows: &mut DMatrix<f64>) -> Result<(), NotConverged> {
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
    fn a_full_matrix_is_rebuilt_from_its_eigenvalues_and_rows() {
        for n in [1, 2, 3, 8, 41] {
            let half = DMatrix::from_fn(n, n, |i, j| ((3 * i + 7 * j) % 11) as f64 - 4.0 + 10f64.powi((i % 3) as i32));
            let mut full = &half + half.transpose();
            // A band, as of spectral elements, beside what couples everything.
            if n == 41 {
                full =
                    DMatrix::from_fn(n, n, |i, j| if i / 8 == j / 8 || i.abs_diff(j) < 2 { full[(i, j)] } else { 0.0 });
            }
            let mut rows = DMatrix::identity(n, n);
            let values = diagonalise_full(full.clone(), &mut rows).unwrap();
            let rebuilt = &rows * DMatrix::from_diagonal(&nalgebra::DVector::from_vec(values)) * rows.transpose();
            assert!((rebuilt - &full).amax() < 1e-13 * full.amax(), "{n}");
            assert!((&rows * rows.transpose() - DMatrix::identity(n, n)).amax() < 1e-13, "{n}");
        }
    }

    #[test]
    fn small_eigenvalues_of_a_graded_matrix_keep_their_digits() {
        // A chain of conductances and heat capacities that grow and shrink along it, as elements towards a surface do, and joined
        // beyond neighbours as these are; its slow decays from the fast ones of its inverse, which has them largest.
        let n = 40;
        let conductance = |i: usize| 10f64.powf(i as f64 / 10.0);
        let capacity = |i: usize| 10f64.powf(-(i as f64) / 10.0);
        let mut full = DMatrix::<f64>::zeros(n, n);
        let mut join = |a: usize, b: usize, g: f64| {
            full[(a, a)] += g;
            full[(b, b)] += g;
            full[(a, b)] -= g;
            full[(b, a)] -= g;
        };
        for i in 0..n {
            (1..4).filter(|d| i + d < n).for_each(|d| join(i, i + d, conductance(i) / d as f64));
        }
        full[(n - 1, n - 1)] += 0.01;
        let scaled = DMatrix::from_fn(n, n, |i, j| full[(i, j)] / (capacity(i) * capacity(j)).sqrt());
        let inverse = nalgebra::Cholesky::new(scaled.clone()).unwrap().inverse();
        let mut slow: Vec<f64> = SymmetricEigen::new(inverse).eigenvalues.iter().map(|l| 1.0 / l).collect();
        slow.sort_by(f64::total_cmp);
        for turned in [false, true] {
            let matrix =
                if turned { DMatrix::from_fn(n, n, |i, j| scaled[(n - 1 - i, n - 1 - j)]) } else { scaled.clone() };
            let mut values = diagonalise_full(matrix, &mut DMatrix::identity(n, n)).unwrap();
            values.sort_by(f64::total_cmp);
            let spread = values[n - 1] / values[0];
            let off = values.iter().zip(&slow).take(5).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
            println!("slowest of a spread of {spread:.1e}: off by {off:.1e}");
            // Rounding of the largest would leave 1e−16 of the spread, 1e−5.
            assert!(spread > 1e9 && off < 1e-8, "{off}");
        }
    }

    #[test]
    fn numbers_that_are_not_finite_end_in_an_error() {
        let mut rows = DMatrix::identity(2, 2);
        assert_eq!(diagonalise(&mut [f64::NAN, 1.0], &[0.5], &mut rows), Err(NotConverged));
    }
}
