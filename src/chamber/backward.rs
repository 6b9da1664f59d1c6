//! The backward pass: what all measurements from a row on say of its states, by a trace that kept its gains.
//!
//! ```text
//! e = v/S − K·r,  D = 1/S + Kᵀ N K,  r ← h e + r,  N ← h hᵀ D + N − h (N K)ᵀ − (N K) hᵀ      a measurement
//! r ← Φᵀ r,  N ← Φᵀ N Φ                                                                      a step
//! ```
//!
//! # Source
//! de Jong, J. Am. Stat. Assoc. 84 (1989) 1085; de Jong and Penzer, J. Am. Stat. Assoc. 93 (1998) 796.

// Loops over an index that the compiler knows the end of: iterators stay calls in functions as large as these.
#![allow(clippy::needless_range_loop)]

use super::arithmetic::{Arithmetic, Pass, dispatched};
use super::filter::{Innovation, Move, Row, System, Trace, retreat};
use super::sparse::{MOST_STATES, Square, dispatch, wide};

/// What the pass comes by, last rows first.
pub(super) enum Visited<'a> {
    /// A measurement, by its place among the innovations: e and D.
    Measurement { place: usize, error: f64, precision: f64 },
    /// A row whose own measurements have been taken in: r and N.
    Row { row: usize, r: &'a [f64], information: Information<'a> },
    /// Where the air of a row may have a kink: u·r and uᵀ N u, u what comes of a slope that changes by one.
    Kink { row: usize, along: f64, own: f64 },
}

/// N at one row.
#[derive(Clone, Copy)]
pub(super) struct Information<'a> {
    /// Row-major, `width` columns of which the first `size` are states.
    entries: &'a [f64],
    width: usize,
    size: usize,
}

impl Information<'_> {
    /// Row-major, states × states.
    pub(super) fn lines(&self) -> impl Iterator<Item = &[f64]> {
        self.entries.chunks_exact(self.width).take(self.size).map(|line| &line[..self.size])
    }

    /// xᵀ N x.
    pub(super) fn of(&self, x: &[f64]) -> f64 {
        self.lines().zip(x).map(|(line, x_i)| x_i * line.iter().zip(x).map(|(n, x_j)| n * x_j).sum::<f64>()).sum()
    }
}

/// Goes back over the rows, and tells `visit` what it comes by.
pub(super) fn backward(system: &System, rows: &[Row], trace: &Trace, visit: &mut dyn FnMut(Visited)) {
    dispatched(Backward { system, rows, trace, visit });
}

struct Backward<'a, 'v> {
    system: &'a System,
    rows: &'a [Row],
    trace: &'a Trace,
    visit: &'v mut dyn FnMut(Visited),
}

impl Pass for Backward<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self, arithmetic: impl Arithmetic) {
        dispatch!(self.system.size, backward_of(arithmetic, self.system, self.rows, self.trace, self.visit))
    }
}

#[inline(always)]
fn backward_of<const N: usize>(
    arithmetic: impl Arithmetic,
    system: &System,
    rows: &[Row],
    trace: &Trace,
    visit: &mut dyn FnMut(Visited),
) {
    let n = system.size;
    let mut r = [0.0; N];
    let mut information: Square<N> = [[0.0; N]; N];
    let mut taken = trace.innovations.len();
    for (k, row) in rows.iter().enumerate().rev() {
        let gains = &trace.gains[trace.gains_of[k] as usize].gain;
        let mut place = row.measured.iter().flatten().count();
        for &h in row.measured.iter().flatten().rev() {
            (taken, place) = (taken - 1, place - 1);
            let gain: [f64; N] = wide(&gains[place * (n + 1)..place * (n + 1) + n]);
            let line = wide_row::<N>(system, h as usize);
            let (error, precision) =
                take_in(arithmetic, trace.innovations[taken], &gain, &line, &mut r, &mut information);
            visit(Visited::Measurement { place: taken, error, precision });
        }
        let known = Information { entries: information.as_flattened(), width: N, size: n };
        visit(Visited::Row { row: k, r: &r[..n], information: known });
        for &movement in row.moves.iter().rev() {
            retreat(arithmetic, system, movement, &mut r);
            match movement {
                Move::Step(step) => {
                    information = system.steps[step as usize].phi_turned.surround(arithmetic, &information)
                }
                Move::Keep(slot) => forget_window(system, slot, &mut information),
                Move::Kink(place) => {
                    let change: [f64; N] = wide(&system.kinks[place as usize]);
                    let dot = |line: &[f64; N]| line.iter().zip(&change).map(|(a, u)| a * u).sum::<f64>();
                    let own = information.iter().zip(&change).map(|(line, u)| u * dot(line)).sum();
                    visit(Visited::Kink { row: k, along: dot(&r), own });
                }
            }
        }
        if !row.is_kinked_within() {
            visit(Visited::Kink { row: k, along: r[system.slope], own: information[system.slope][system.slope] });
        }
    }
}

#[inline(always)]
fn wide_row<const N: usize>(system: &System, h: usize) -> [f64; N] {
    let mut line = [0.0; N];
    system.rows.add_to(h, 1.0, &mut line);
    line
}

/// One measurement; its e and D.
#[inline(always)]
fn take_in<const N: usize>(
    arithmetic: impl Arithmetic,
    innovation: Innovation,
    gain: &[f64; N],
    line: &[f64; N],
    r: &mut [f64; N],
    information: &mut Square<N>,
) -> (f64, f64) {
    let Innovation { value, variance } = innovation;
    // N is symmetric: its rows, each times its gain, add up to N K.
    let mut along = [0.0; N];
    let (mut error, mut precision) = (value / variance, 1.0 / variance);
    for i in 0..N {
        for j in 0..N {
            along[j] = arithmetic.add_product(gain[i], information[i][j], along[j]);
        }
        error -= gain[i] * r[i];
    }
    for i in 0..N {
        precision += gain[i] * along[i];
        r[i] += error * line[i];
    }
    for i in 0..N {
        for j in 0..N {
            information[i][j] += precision * line[i] * line[j] - line[i] * along[j] - along[i] * line[j];
        }
    }
    (error, precision)
}

/// N ← Mᵀ N M where a window begins: columns and then rows.
#[inline(always)]
fn forget_window<const N: usize>(system: &System, slot: u8, information: &mut Square<N>) {
    for &(state, kept) in system.keeps[slot as usize].iter().rev() {
        for i in 0..N {
            let weight = std::mem::take(&mut information[i][state]);
            system.kept.add_to(kept, weight, &mut information[i]);
        }
        let lost = std::mem::replace(&mut information[state], [0.0; N]);
        let mut line = [0.0; N];
        system.kept.add_to(kept, 1.0, &mut line);
        for i in 0..N {
            for j in 0..N {
                information[i][j] += line[i] * lost[j];
            }
        }
    }
}
