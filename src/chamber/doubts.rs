//! What does not belong to a record: measurements, and changes of the air's slope, beyond what all others say of them.
//!
//! ```text
//! e = v/S − K·r,  D = 1/S + Kᵀ N K,  r ← h e + r,  N ← h hᵀ D + N − h (N K)ᵀ − (N K) hᵀ,  N ← Φᵀ N Φ       backwards
//! e/D is a measurement less what all others make of it, e/√D its standardised value; u·r/√(uᵀNu) likewise says whether the slope changed here, u: what comes of that
//! ```
//!
//! # Source
//! de Jong and Penzer, J. Am. Stat. Assoc. 93 (1998) 796 (values and shocks that do not belong to a record).

// Loops over an index that the compiler knows the end of: iterators stay calls in functions as large as these.
#![allow(clippy::needless_range_loop)]

use super::arithmetic::{Arithmetic, Pass, dispatched};
use super::filter::{Innovation, Move, Row, System, Trace, retreat};
use super::sparse::{MOST_STATES, Square, dispatch, wide};

/// What does not belong to a record, by a trace that kept its gains.
pub(super) fn doubts(system: &System, rows: &[Row], trace: &Trace) -> Doubts {
    dispatched(Doubt { system, rows, trace })
}

/// Standardised values of what every measurement, and every row's change of the slope, is beyond what all others say.
#[derive(Debug, Clone, Default)]
pub(super) struct Doubts {
    /// In the order of the innovations.
    pub(crate) values: Vec<f64>,
    /// D, in the same order: one over the variance of a measurement beside what all others say.
    pub(crate) precisions: Vec<f64>,
    /// One entry a row: standardised, and the change of slope that it stands for [K/s].
    pub(crate) kinks: Vec<(f64, f64)>,
}

struct Doubt<'a> {
    system: &'a System,
    rows: &'a [Row],
    trace: &'a Trace,
}

impl Pass for Doubt<'_> {
    type Output = Doubts;

    #[inline(always)]
    fn run(self, arithmetic: impl Arithmetic) -> Doubts {
        dispatch!(self.system.size, doubts_of(arithmetic, self.system, self.rows, self.trace))
    }
}

#[inline(always)]
fn doubts_of<const N: usize>(arithmetic: impl Arithmetic, system: &System, rows: &[Row], trace: &Trace) -> Doubts {
    let n = system.size;
    let none = vec![0.0; trace.innovations.len()];
    let mut found = Doubts { values: none.clone(), precisions: none, kinks: vec![(0.0, 0.0); rows.len()] };
    let mut r = [0.0; N];
    let mut spread: Square<N> = [[0.0; N]; N];
    let mut taken = trace.innovations.len();
    for (k, row) in rows.iter().enumerate().rev() {
        let gains = &trace.gains[trace.gains_of[k] as usize].gain;
        let present: Vec<usize> = row.measured.iter().flatten().map(|&h| h as usize).collect();
        for (place, &h) in present.iter().enumerate().rev() {
            taken -= 1;
            let Innovation { value, variance } = trace.innovations[taken];
            let gain: [f64; N] = wide(&gains[place * (n + 1)..place * (n + 1) + n]);
            let mut along = [0.0; N];
            let (mut error, mut precision) = (value / variance, 1.0 / variance);
            for i in 0..N {
                for j in 0..N {
                    along[i] += spread[i][j] * gain[j];
                }
                error -= gain[i] * r[i];
            }
            for i in 0..N {
                precision += gain[i] * along[i];
            }
            found.values[taken] = error / precision.sqrt();
            found.precisions[taken] = precision;
            system.rows.add_to(h, error, &mut r);
            let mut line = [0.0; N];
            system.rows.add_to(h, 1.0, &mut line);
            for i in 0..N {
                for j in 0..N {
                    spread[i][j] += precision * line[i] * line[j] - line[i] * along[j] - along[i] * line[j];
                }
            }
        }
        let kink = |along: f64, own: f64| if own > 0.0 { (along / own.sqrt(), along / own) } else { (0.0, 0.0) };
        for &movement in row.moves.iter().rev() {
            retreat(arithmetic, system, movement, &mut r);
            match movement {
                Move::Step(step) => spread = system.steps[step as usize].phi_turned.surround(arithmetic, &spread),
                Move::Keep(slot) => forget_window(system, slot, &mut spread),
                Move::Kink(place) => {
                    let change: [f64; N] = wide(&system.kinks[place as usize]);
                    let dot = |line: &[f64; N]| line.iter().zip(&change).map(|(a, u)| a * u).sum::<f64>();
                    let own = spread.iter().zip(&change).map(|(line, u)| u * dot(line)).sum();
                    let here = kink(dot(&r), own);
                    if here.0.abs() > found.kinks[k].0.abs() {
                        found.kinks[k] = here;
                    }
                }
            }
        }
        if !row.is_kinked_within() {
            found.kinks[k] = kink(r[system.slope], spread[system.slope][system.slope]);
        }
    }
    found
}

/// N ← Mᵀ N M where a window begins: columns and then rows.
#[inline(always)]
fn forget_window<const N: usize>(system: &System, slot: u8, spread: &mut Square<N>) {
    for &(state, kept) in system.keeps[slot as usize].iter().rev() {
        for i in 0..N {
            let weight = std::mem::take(&mut spread[i][state]);
            system.kept.add_to(kept, weight, &mut spread[i]);
        }
        let lost = std::mem::replace(&mut spread[state], [0.0; N]);
        let mut line = [0.0; N];
        system.kept.add_to(kept, 1.0, &mut line);
        for i in 0..N {
            for j in 0..N {
                spread[i][j] += line[i] * lost[j];
            }
        }
    }
}
