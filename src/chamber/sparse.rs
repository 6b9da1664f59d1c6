//! Matrices of which most entries are zero, times the few columns that a filter carries.

// Loops over an index that the compiler knows the end of: iterators stay calls in functions as large as these.
#![allow(clippy::needless_range_loop)]

use super::arithmetic::Arithmetic;

/// Calls a function with the least number of states that has room.
macro_rules! dispatch {
    ($size:expr, $function:ident($($argument:expr),*)) => {
        match $size {
            0..=12 => $function::<12>($($argument),*),
            13..=16 => $function::<16>($($argument),*),
            17..=20 => $function::<20>($($argument),*),
            21..=24 => $function::<24>($($argument),*),
            size => {
                assert!(size <= MOST_STATES, "a model has at most {MOST_STATES} states");
                $function::<MOST_STATES>($($argument),*)
            }
        }
    };
}
pub(super) use dispatch;

/// States for which there is room.
pub(super) const MOST_STATES: usize = 32;

/// A square block of states; lanes beyond the model's states stay zero.
pub(super) type Square<const N: usize> = [[f64; N]; N];

/// Entries of a row that there is room for before any is written: behind a film that stays, a mode's row of Φ has three.
const USUAL: usize = 4;

/// The entries of a matrix that are not zero, row by row.
#[derive(Debug, Clone, Default)]
pub(super) struct Sparse {
    /// Where each row's entries begin; one more than there are rows.
    starts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl Sparse {
    /// # Shapes
    /// `matrix` row-major with `columns` columns.
    pub(crate) fn new(matrix: &[f64], columns: usize) -> Self {
        Self::of_rows(matrix.chunks_exact(columns), columns)
    }

    fn of_rows<'a>(rows: impl Iterator<Item = &'a [f64]>, columns: usize) -> Self {
        let mut sparse = Self { starts: Vec::with_capacity(columns + 1), entries: Vec::with_capacity(USUAL * columns) };
        sparse.starts.push(0);
        for row in rows {
            for (column, &value) in row.iter().enumerate() {
                if value != 0.0 {
                    sparse.entries.push((column, value));
                }
            }
            sparse.starts.push(sparse.entries.len());
        }
        sparse
    }

    /// Its rows as columns, of which there are so many.
    pub(crate) fn transposed(&self, columns: usize) -> Self {
        // Where the next entry of each column goes: behind all of those before it.
        let mut ends = vec![0; columns + 1];
        self.entries.iter().for_each(|(column, _)| ends[column + 1] += 1);
        (0..columns).for_each(|column| ends[column + 1] += ends[column]);
        let starts = ends.clone();
        let mut entries = vec![(0, 0.0); self.entries.len()];
        for row in 0..self.rows() {
            for &(column, value) in self.row(row) {
                entries[ends[column]] = (row, value);
                ends[column] += 1;
            }
        }
        Self { starts, entries }
    }

    /// Of what is zero beyond n × n.
    pub(crate) fn of_square<const N: usize>(square: &Square<N>, n: usize) -> Self {
        Self::of_rows(square[..n].iter().map(|row| &row[..n]), n)
    }

    #[inline(always)]
    pub(crate) fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Columns and values of one row's entries.
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }

    /// One row times a vector.
    #[inline(always)]
    pub(crate) fn dot(&self, arithmetic: impl Arithmetic, row: usize, vector: &[f64]) -> f64 {
        let mut sum = 0.0;
        for &(k, v) in self.row(row) {
            sum = arithmetic.add_product(v, vector[k], sum);
        }
        sum
    }

    /// Adds a multiple of one row to a vector.
    #[inline(always)]
    pub(crate) fn add_to(&self, row: usize, factor: f64, vector: &mut [f64]) {
        for &(k, v) in self.row(row) {
            vector[k] += factor * v;
        }
    }

    /// M x.
    #[inline(always)]
    pub(crate) fn times<const N: usize>(&self, arithmetic: impl Arithmetic, vector: &[f64; N]) -> [f64; N] {
        let mut out = [0.0; N];
        for row in 0..self.rows() {
            out[row] = self.dot(arithmetic, row, vector);
        }
        out
    }

    /// Σ_k m_k X_k over one row of M: that row times X.
    #[inline(always)]
    pub(crate) fn combine<const N: usize>(&self, arithmetic: impl Arithmetic, row: usize, x: &Square<N>) -> [f64; N] {
        self.combine_onto(arithmetic, row, x, &[0.0; N])
    }

    /// As [`Self::combine`], and a line.
    #[inline(always)]
    pub(crate) fn combine_onto<const N: usize>(
        &self,
        arithmetic: impl Arithmetic,
        row: usize,
        x: &Square<N>,
        onto: &[f64; N],
    ) -> [f64; N] {
        let mut sum = *onto;
        for &(k, v) in self.row(row) {
            let line = &x[k];
            for j in 0..N {
                sum[j] = arithmetic.add_product(v, line[j], sum[j]);
            }
        }
        sum
    }

    /// M X.
    #[inline(always)]
    pub(crate) fn times_square<const N: usize>(&self, arithmetic: impl Arithmetic, x: &Square<N>) -> Square<N> {
        let mut product = [[0.0; N]; N];
        for row in 0..self.rows() {
            product[row] = self.combine(arithmetic, row, x);
        }
        product
    }

    /// M S Mᵀ for a symmetric S.
    #[inline(always)]
    pub(crate) fn surround<const N: usize>(&self, arithmetic: impl Arithmetic, square: &Square<N>) -> Square<N> {
        self.times_square(arithmetic, &turned(&self.times_square(arithmetic, square)))
    }
}

#[inline(always)]
pub(super) fn turned<const N: usize>(square: &Square<N>) -> Square<N> {
    let mut turned = [[0.0; N]; N];
    turn(square, &mut turned);
    turned
}

#[inline(always)]
pub(super) fn turn<const N: usize>(square: &Square<N>, turned: &mut Square<N>) {
    for i in 0..N {
        for j in 0..N {
            turned[i][j] = square[j][i];
        }
    }
}

#[inline(always)]
pub(super) fn wide<const N: usize>(vector: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| vector.get(i).copied().unwrap_or(0.0))
}

#[inline(always)]
pub(super) fn wide_square<const N: usize>(matrix: &[f64], n: usize) -> Square<N> {
    std::array::from_fn(|i| if i < n { wide(&matrix[i * n..(i + 1) * n]) } else { [0.0; N] })
}
