//! Plain functions of time that compete with the catalogue: what they explain better is outside it.
//!
//! ```text
//! drift a t,   exponential a e^{−t/τ},   sinusoid a cos ωt + b sin ωt
//! ```
//!
//! Amplitudes are fitted for each record by itself, τ and ω for all records together, on a logarithmic grid.

use rayon::prelude::*;

use super::evidence::{Case, Evidence, Role, dot, sum_of_squares};
use super::hypothesis::Hypothesis;
use crate::rate::CoilModel;

/// A shape in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    Drift,
    Exponential { time_constant_s: f64 },
    Sinusoid { period_s: f64 },
}

/// How well a shape explains residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plain {
    pub shape: Shape,
    /// By how much χ² falls.
    pub gain: f64,
    pub parameters: usize,
    /// Root mean square over the rows [rad/s].
    pub rms_rad_per_s: f64,
}

const TIME_CONSTANTS: usize = 12;
const PERIODS: usize = 160;
/// The shortest period, in intervals.
const SHORTEST_PERIOD_INTERVALS: f64 = 4.0;

/// The best of each shape for the residuals of a model, best first.
pub(super) fn compete(evidence: &Evidence, model: &CoilModel, residuals: &[f64]) -> Vec<Plain> {
    let cases: Vec<&Case> = evidence.of(Role::Fit).collect();
    let duration_s = cases.iter().map(|c| duration_s(c)).fold(0.0, f64::max);
    let interval_s = cases.iter().map(|c| c.record.interval_s()).fold(f64::INFINITY, f64::min);
    let grid = |low: f64, high: f64, count: usize| -> Vec<f64> {
        (0..count).map(|i| low * (high / low).powf(i as f64 / (count - 1) as f64)).collect()
    };
    let drift = vec![Shape::Drift];
    let exponentials = grid(10.0 * interval_s, 0.5 * duration_s, TIME_CONSTANTS)
        .into_iter()
        .map(|time_constant_s| Shape::Exponential { time_constant_s })
        .collect();
    let sinusoids = grid(SHORTEST_PERIOD_INTERVALS * interval_s, duration_s, PERIODS)
        .into_iter()
        .map(|period_s| Shape::Sinusoid { period_s })
        .collect();
    let mut best: Vec<Plain> = [drift, exponentials, sinusoids]
        .into_iter()
        .filter_map(|shapes: Vec<Shape>| {
            let tried: Vec<Plain> =
                shapes.into_par_iter().filter_map(|shape| explain(&cases, model, residuals, shape)).collect();
            tried.into_iter().max_by(|a, b| a.gain.total_cmp(&b.gain))
        })
        .map(|plain| refine(&cases, model, residuals, plain))
        .collect();
    best.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    best
}

/// By how much χ² of a hypothesis falls with the best plain function of time.
pub(super) fn best_gain(evidence: &Evidence, model: &CoilModel, hypothesis: &Hypothesis) -> f64 {
    compete(evidence, model, &hypothesis.residuals).first().map_or(0.0, |plain| plain.gain)
}

fn duration_s(case: &Case) -> f64 {
    let times_s = case.record.times_s();
    times_s[times_s.len() - 1] - times_s[0]
}

/// A sinusoid's period between the points of the grid: the resolution of a long record is finer.
fn refine(cases: &[&Case], model: &CoilModel, residuals: &[f64], coarse: Plain) -> Plain {
    let Shape::Sinusoid { period_s } = coarse.shape else { return coarse };
    (-6..=6)
        .filter_map(|i| {
            let period_s = period_s * (1.0 + 0.006 * f64::from(i));
            explain(cases, model, residuals, Shape::Sinusoid { period_s })
        })
        .fold(coarse, |best, plain| if plain.gain > best.gain { plain } else { best })
}

/// The columns of a shape over a record's rows, of the size of one noise.
fn columns(case: &Case, shape: Shape) -> Vec<Vec<f64>> {
    let start_s = case.record.times_s()[0];
    let duration_s = duration_s(case);
    let over = |f: &dyn Fn(f64) -> f64| {
        case.record.times_s().iter().map(|t| case.noise_rad_per_s * f(t - start_s)).collect::<Vec<f64>>()
    };
    match shape {
        Shape::Drift => vec![over(&|t| t / duration_s)],
        Shape::Exponential { time_constant_s } => vec![over(&|t| (-t / time_constant_s).exp())],
        Shape::Sinusoid { period_s } => {
            let omega = std::f64::consts::TAU / period_s;
            vec![over(&|t| (omega * t).cos()), over(&|t| (omega * t).sin())]
        }
    }
}

fn explain(cases: &[&Case], model: &CoilModel, residuals: &[f64], shape: Shape) -> Option<Plain> {
    let (mut gain, mut parameters, mut squares, mut rows) = (0.0, 0, 0.0, 0);
    let mut from = 0;
    for case in cases {
        let plain = columns(case, shape);
        let whitened = case.whiten_columns(model, &plain)?;
        let length = whitened[0].len();
        let own = residuals.get(from..from + length)?;
        from += length;
        let amplitudes = match &whitened[..] {
            [a] => vec![dot(a, own) / sum_of_squares(a).max(f64::MIN_POSITIVE)],
            [a, b] => {
                let (aa, bb, ab) = (sum_of_squares(a), sum_of_squares(b), dot(a, b));
                let (ra, rb) = (dot(a, own), dot(b, own));
                let determinant = (aa * bb - ab * ab).max(f64::MIN_POSITIVE);
                vec![(ra * bb - rb * ab) / determinant, (rb * aa - ra * ab) / determinant]
            }
            _ => return None,
        };
        gain += amplitudes.iter().zip(&whitened).map(|(x, w)| x * dot(w, own)).sum::<f64>();
        parameters += amplitudes.len();
        rows += case.record.rows();
        for row in 0..case.record.rows() {
            squares += amplitudes.iter().zip(&plain).map(|(x, c)| x * c[row]).sum::<f64>().powi(2);
        }
    }
    parameters += usize::from(shape != Shape::Drift);
    Some(Plain { shape, gain, parameters, rms_rad_per_s: (squares / rows.max(1) as f64).sqrt() })
}
