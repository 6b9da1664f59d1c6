//! What does not belong to a record: measurements, and changes of the air's slope, beyond what all others say of them.
//!
//! e and D of the backward pass ([`super::backward`]) say of a measurement what all others make of it: e/D is what it is more than that, e/√D its
//! standardised value. u·r/√(uᵀNu) likewise says whether the slope changed at a row, u: what comes of a change by one.
//!
//! # Source
//! de Jong and Penzer, J. Am. Stat. Assoc. 93 (1998) 796 (values and shocks that do not belong to a record).

use super::backward::{Visited, backward};
use super::filter::{Row, System, Trace};

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

/// What does not belong to a record, by a trace that kept its gains.
pub(super) fn doubts(system: &System, rows: &[Row], trace: &Trace) -> Doubts {
    let none = vec![0.0; trace.innovations.len()];
    let mut found = Doubts { values: none.clone(), precisions: none, kinks: vec![(0.0, 0.0); rows.len()] };
    backward(system, rows, trace, &mut |visited| match visited {
        Visited::Measurement { place, error, precision } => {
            found.values[place] = error / precision.sqrt();
            found.precisions[place] = precision;
        }
        // Of the places within a row the likeliest.
        Visited::Kink { row, along, own } if own > 0.0 && (along / own.sqrt()).abs() > found.kinks[row].0.abs() => {
            found.kinks[row] = (along / own.sqrt(), along / own);
        }
        Visited::Kink { .. } | Visited::Row { .. } => {}
    });
    found
}
