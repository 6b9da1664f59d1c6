//! What many known inputs to the measurements make of the innovations: as [`super::filter::respond`], some at a time.

use nalgebra::DMatrix;
use pulp::Arch;

use super::filter::{Move, Row, System, Trace, Values};
use super::sparse::Sparse;
use crate::parallel::InParallel;

/// Inputs at a time.
const LANES: usize = 8;

/// A number of each input.
type Lanes = [f64; LANES];

/// The responses to inputs that each begin at a row, ascending; `input` makes the one that begins at a row.
///
/// # Shapes
/// Innovations × inputs.
pub(super) fn responses(
    system: &System,
    rows: &[Row],
    trace: &Trace,
    begins: &[usize],
    input: impl Fn(usize) -> Values + Sync,
) -> DMatrix<f64> {
    let count = trace.innovations.len();
    // The innovation that each row begins with.
    let mut first = Vec::with_capacity(rows.len());
    rows.iter().fold(0, |next, row| {
        first.push(next);
        next + row.measured.iter().flatten().count()
    });
    let some = |begins: &[usize]| {
        let inputs: Vec<Values> = begins.iter().map(|&row| input(row)).collect();
        let mut out = vec![0.0; count * begins.len()];
        Arch::new().dispatch(|| respond(system, rows, trace, &inputs, (begins[0], &first), &mut out));
        out
    };
    let columns: Vec<Vec<f64>> = begins.chunks(LANES).in_parallel().map(some).collect();
    DMatrix::from_vec(count, begins.len(), columns.concat())
}

/// From a row on; `first`: the innovation that each row begins with; `out` holds a column an input.
#[inline(always)]
fn respond(
    system: &System,
    rows: &[Row],
    trace: &Trace,
    inputs: &[Values],
    (from, first): (usize, &[usize]),
    out: &mut [f64],
) {
    let (n, count) = (system.size, trace.innovations.len());
    let mut mean = vec![[0.0; LANES]; n];
    let mut next = mean.clone();
    for (k, row) in rows.iter().enumerate().skip(from) {
        for &movement in &row.moves {
            match movement {
                Move::Step(step) => {
                    let phi = &system.steps[step as usize].phi;
                    next.iter_mut().enumerate().for_each(|(i, line)| *line = dot(phi, i, &mean));
                    std::mem::swap(&mut mean, &mut next);
                }
                Move::Keep(slot) => {
                    for &(state, kept) in &system.keeps[slot as usize] {
                        mean[state] = dot(&system.kept, kept, &mean);
                    }
                }
                Move::Kink(_) => {}
            }
        }
        let gains = trace.gains[trace.gains_of[k] as usize].gain.chunks_exact(n + 1);
        let measured = row.measured.iter().enumerate().filter_map(|(m, h)| Some((m, (*h)? as usize)));
        for ((place, (m, h)), gain) in measured.enumerate().zip(gains) {
            let mut value = dot(&system.rows, h, &mean);
            for (lane, input) in inputs.iter().enumerate() {
                value[lane] = input.of[m].get(k).copied().unwrap_or(0.0) - value[lane];
                out[lane * count + first[k] + place] = value[lane];
            }
            for (line, gain) in mean.iter_mut().zip(gain) {
                for l in 0..LANES {
                    line[l] += gain * value[l];
                }
            }
        }
    }
}

/// One row times the states.
#[inline(always)]
fn dot(matrix: &Sparse, row: usize, mean: &[Lanes]) -> Lanes {
    let mut sum = [0.0; LANES];
    for &(column, value) in matrix.row(row) {
        for l in 0..LANES {
            sum[l] += value * mean[column][l];
        }
    }
    sum
}
