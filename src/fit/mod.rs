//! Bounded nonlinear least squares with standard errors.
//!
//! ```text
//! minimise S(p) = Σ r_i(p)²,   lower ≤ p ≤ upper
//! cov(p) = s² (JᵀJ)⁻¹,   s² = S/(n − p),   J = ∂r/∂p by central differences
//! ```
//!
//! Two finite bounds are kept by p = middle + half·sin u (in ln p where a positive range spans two decades or more), one
//! bound by p = bound ± (√(u² + 1) − 1); the optimiser sees only u. A parameter that ends at a bound is reported as such
//! and left out of the covariance.
//!
//! Holds for residuals that are smooth in p; of several minima, the one that the start leads to is found.
//!
//! # Source
//! Levenberg–Marquardt after Moré (1978) as in MINPACK, from the crate `levenberg-marquardt`; the transformations of the
//! bounds are those of MINUIT (James and Roos, Comput. Phys. Commun. 10 (1975) 343).

mod bounds;

use std::cell::{Cell, RefCell};

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt, TerminationReason};
use nalgebra::{DMatrix, DVector, Dyn, Owned};
use thiserror::Error;

use bounds::Map;

/// One parameter to fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    pub start: f64,
    /// May be −∞.
    pub lower: f64,
    /// May be +∞.
    pub upper: f64,
}

impl Parameter {
    pub fn free(start: f64) -> Self {
        Self { start, lower: f64::NEG_INFINITY, upper: f64::INFINITY }
    }

    pub fn bounded(start: f64, lower: f64, upper: f64) -> Self {
        Self { start, lower, upper }
    }
}

/// How hard to try.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Relative change of the sum of squares and of the parameters at which to stop.
    pub tolerance: f64,
    /// Evaluations of the residuals that the optimiser may spend, per parameter (derivatives not counted).
    pub evaluations_per_parameter: usize,
    pub differences: Differences,
    /// Whether the covariance is wanted too; it costs two evaluations a parameter.
    pub standard_errors: bool,
}

/// How derivatives are taken while searching; those of the covariance are always central.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Differences {
    Forward,
    Central,
}

impl Effort {
    /// As exact as double precision allows.
    pub const EXACT: Self = Self {
        tolerance: 1e-14,
        evaluations_per_parameter: 2000,
        differences: Differences::Central,
        standard_errors: true,
    };
    /// Enough to see a standard error's tenth.
    pub const QUICK: Self = Self {
        tolerance: 1e-5,
        evaluations_per_parameter: 15,
        differences: Differences::Forward,
        standard_errors: false,
    };
}

/// Why a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    Converged,
    /// The evaluations were used up.
    OutOfEvaluations,
    /// No further progress in double precision.
    NoProgress,
}

/// A fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    pub parameters: Vec<f64>,
    /// None where a parameter is at a bound, where the residuals do not depend on it, or where none were asked for.
    pub standard_errors: Vec<Option<f64>>,
    pub at_bound: Vec<bool>,
    /// Row-major; zero in rows and columns of parameters without a standard error.
    pub covariance: Vec<f64>,
    pub residuals: Vec<f64>,
    pub sum_of_squares: f64,
    /// n − p, at least 1.
    pub degrees_of_freedom: usize,
    pub ending: Ending,
    /// Of the residuals, derivatives included.
    pub evaluations: usize,
}

impl Fit {
    /// s = √(S/(n − p)).
    pub fn residual_standard_deviation(&self) -> f64 {
        (self.sum_of_squares / self.degrees_of_freedom as f64).sqrt()
    }
}

#[derive(Debug, Error, Clone, PartialEq)]
pub enum FitError {
    #[error("there is nothing to fit: {parameters} parameters and {residuals} residuals")]
    Empty { parameters: usize, residuals: usize },
    #[error("parameter {index} must start between its bounds {lower} and {upper}, found {start}")]
    Start { index: usize, lower: f64, upper: f64, start: f64 },
    #[error("the residuals are not finite at the start")]
    NotFinite,
}

/// A parameter this close to a bound [share of the range, or of its own size] is at it.
const AT_BOUND: f64 = 1e-6;
/// Singular values below this share of the largest do not determine anything.
const RANK: f64 = 1e-12;

/// The first step's length, in units of the scaled start. MINPACK's 100 leaps over the minimum of a curve that is flat
/// far away (NIST's BoxBOD from its first start); 1 finds all of NIST's 27 from both starts.
const FIRST_STEP: f64 = 1.0;
/// … and a variable counts as this share of its start at least when a derivative's step is chosen: a first step of just the
/// start's length may end at zero but for rounding, where a step of a share of the variable would change nothing.
const LEAST_SIZE: f64 = 1e-4;
/// A residual that is worse than any; its square is finite.
const HUGE: f64 = 1e140;

/// Minimises the sum of squares of what `residuals` returns; `None` from it means: not there.
///
/// # Errors
/// No parameters or residuals, a start outside its bounds, residuals that are not finite at the start.
pub fn least_squares(
    parameters: &[Parameter],
    residuals: impl Fn(&[f64]) -> Option<Vec<f64>>,
    effort: Effort,
) -> Result<Fit, FitError> {
    for (index, p) in parameters.iter().enumerate() {
        if !(p.start.is_finite() && p.start >= p.lower && p.start <= p.upper && p.lower < p.upper) {
            return Err(FitError::Start { index, lower: p.lower, upper: p.upper, start: p.start });
        }
    }
    let evaluations = Cell::new(0);
    let counted = |p: &[f64]| {
        evaluations.set(evaluations.get() + 1);
        residuals(p).filter(|r| r.iter().all(|v| v.is_finite()))
    };
    let (mut found, mut ending) = search(parameters, &counted, effort)?;
    let stuck: Vec<bool> = found.iter().zip(parameters).map(|(v, p)| is_at_bound(*v, p)).collect();
    if stuck.contains(&true) && stuck.contains(&false) {
        // The flat end of a bounded parameter slows the others down: hold it there and let them finish.
        for (value, (p, _)) in found.iter_mut().zip(parameters.iter().zip(&stuck)).filter(|(_, (_, stuck))| **stuck) {
            *value = if *value - p.lower < p.upper - *value { p.lower } else { p.upper };
        }
        let held = found.clone();
        let free: Vec<usize> = (0..found.len()).filter(|&i| !stuck[i]).collect();
        let rest: Vec<Parameter> = free.iter().map(|&i| Parameter { start: found[i], ..parameters[i] }).collect();
        let whole = |p: &[f64]| {
            let mut all = held.clone();
            for (&i, value) in free.iter().zip(p) {
                all[i] = *value;
            }
            all
        };
        let (finished, second) = search(&rest, &|p: &[f64]| counted(&whole(p)), effort)?;
        found = whole(&finished);
        ending = second;
    }
    let at_minimum = counted(&found).ok_or(FitError::NotFinite)?;
    let at_bound: Vec<bool> = found.iter().zip(parameters).map(|(v, p)| is_at_bound(*v, p)).collect();
    let (covariance, standard_errors) = if effort.standard_errors {
        covariance(&found, parameters, &at_bound, &at_minimum, &counted)
    } else {
        (vec![0.0; found.len() * found.len()], vec![None; found.len()])
    };
    let sum_of_squares = at_minimum.iter().map(|r| r * r).sum();
    let degrees_of_freedom = at_minimum.len().saturating_sub(parameters.len()).max(1);
    Ok(Fit {
        parameters: found,
        standard_errors,
        at_bound,
        covariance,
        residuals: at_minimum,
        sum_of_squares,
        degrees_of_freedom,
        ending,
        evaluations: evaluations.get(),
    })
}

/// The optimiser in its own variables: the minimum and why it stopped there.
fn search(
    parameters: &[Parameter],
    residuals: &impl Fn(&[f64]) -> Option<Vec<f64>>,
    effort: Effort,
) -> Result<(Vec<f64>, Ending), FitError> {
    let maps: Vec<Map> = parameters.iter().map(Map::new).collect();
    let start: Vec<f64> = parameters.iter().zip(&maps).map(|(p, m)| m.inner(m.inside(p.start))).collect();
    let outer = |u: &[f64]| -> Vec<f64> { u.iter().zip(&maps).map(|(u, m)| m.outer(*u)).collect() };
    let first = residuals(&outer(&start)).ok_or(FitError::NotFinite)?;
    if parameters.is_empty() || first.is_empty() {
        return Err(FitError::Empty { parameters: parameters.len(), residuals: first.len() });
    }
    let problem = Inner {
        count: first.len(),
        start: DVector::from_column_slice(&start),
        at: DVector::from_vec(start),
        residuals: |u: &[f64]| residuals(&outer(u)),
        differences: effort.differences,
        current: RefCell::new(Some(first)),
    };
    let (problem, report) = LevenbergMarquardt::new()
        .with_stepbound(FIRST_STEP)
        .with_ftol(effort.tolerance)
        .with_xtol(effort.tolerance)
        .with_gtol(f64::EPSILON)
        .with_patience(effort.evaluations_per_parameter)
        .minimize(problem);
    let ending = match report.termination {
        TerminationReason::LostPatience => Ending::OutOfEvaluations,
        TerminationReason::NoImprovementPossible(_)
        | TerminationReason::User(_)
        | TerminationReason::Numerical(_)
        | TerminationReason::WrongDimensions(_) => Ending::NoProgress,
        _ => Ending::Converged,
    };
    Ok((outer(problem.at.as_slice()), ending))
}

fn is_at_bound(value: f64, parameter: &Parameter) -> bool {
    let range = parameter.upper - parameter.lower;
    let slack = if range.is_finite() { AT_BOUND * range } else { AT_BOUND * value.abs() };
    // Positive ranges of decades are searched in the logarithm: there a share of the range means nothing.
    let near_lower = if Map::is_logarithmic(parameter) {
        value <= parameter.lower * (1.0 + 1e3 * AT_BOUND)
    } else {
        value - parameter.lower <= slack
    };
    near_lower || parameter.upper - value <= slack
}

/// s² (JᵀJ)⁻¹ over the parameters that are free; and its diagonal's roots.
fn covariance(
    found: &[f64],
    parameters: &[Parameter],
    at_bound: &[bool],
    residuals: &[f64],
    at: &impl Fn(&[f64]) -> Option<Vec<f64>>,
) -> (Vec<f64>, Vec<Option<f64>>) {
    let count = found.len();
    let mut columns: Vec<(usize, DVector<f64>)> = Vec::new();
    for index in (0..count).filter(|i| !at_bound[*i]) {
        let (low, high) = (parameters[index].lower, parameters[index].upper);
        let scale = if found[index] != 0.0 { found[index].abs() } else { 1.0 };
        let step = (f64::EPSILON.cbrt() * scale).min(found[index] - low).min(high - found[index]);
        let moved = |sign: f64| {
            let mut p = found.to_vec();
            p[index] += sign * step;
            at(&p)
        };
        if let (Some(above), Some(below)) = (moved(1.0), moved(-1.0)) {
            let column =
                DVector::from_iterator(residuals.len(), above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * step)));
            if column.norm() > 0.0 {
                columns.push((index, column));
            }
        }
    }
    let mut matrix = vec![0.0; count * count];
    let mut errors = vec![None; count];
    if columns.is_empty() {
        return (matrix, errors);
    }
    // Columns of unit length: the rank then does not depend on the parameters' units.
    let norms: Vec<f64> = columns.iter().map(|(_, c)| c.norm()).collect();
    let jacobian = DMatrix::from_columns(&columns.iter().zip(&norms).map(|((_, c), n)| c / *n).collect::<Vec<_>>());
    let freedom = residuals.len().saturating_sub(count).max(1) as f64;
    let variance = residuals.iter().map(|r| r * r).sum::<f64>() / freedom;
    let r = jacobian.qr().r();
    let svd = r.svd(false, true);
    let Some(vt) = svd.v_t else { return (matrix, errors) };
    let largest = svd.singular_values.max();
    let determined = svd.singular_values.iter().all(|s| *s > RANK * largest);
    for (a, (i, _)) in columns.iter().enumerate() {
        for (b, (j, _)) in columns.iter().enumerate() {
            let inverse: f64 = (0..columns.len())
                .filter(|&k| svd.singular_values[k] > RANK * largest)
                .map(|k| vt[(k, a)] * vt[(k, b)] / svd.singular_values[k].powi(2))
                .sum();
            matrix[i * count + j] = variance * inverse / (norms[a] * norms[b]);
        }
        if determined {
            errors[*i] = Some(matrix[i * count + i].sqrt());
        }
    }
    (matrix, errors)
}

/// The problem as the optimiser sees it.
struct Inner<R> {
    start: DVector<f64>,
    at: DVector<f64>,
    residuals: R,
    differences: Differences,
    /// The residuals at `at`, if they are known.
    current: RefCell<Option<Vec<f64>>>,
    /// Of the residuals.
    count: usize,
}

impl<R: Fn(&[f64]) -> Option<Vec<f64>>> Inner<R> {
    fn here(&self) -> Option<Vec<f64>> {
        let mut current = self.current.borrow_mut();
        if current.is_none() {
            *current = (self.residuals)(self.at.as_slice());
        }
        current.clone()
    }
}

impl<R: Fn(&[f64]) -> Option<Vec<f64>>> LeastSquaresProblem<f64, Dyn, Dyn> for Inner<R> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        if *x != self.at {
            self.at.copy_from(x);
            *self.current.borrow_mut() = None;
        }
    }

    fn params(&self) -> DVector<f64> {
        self.at.clone()
    }

    /// Where there are no residuals they count as huge: the step is then shortened instead of the search ended.
    fn residuals(&self) -> Option<DVector<f64>> {
        Some(self.here().map_or_else(|| DVector::from_element(self.count, HUGE), DVector::from_vec))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let here = self.here()?;
        let mut jacobian = DMatrix::zeros(here.len(), self.at.len());
        for index in 0..self.at.len() {
            let size = self.at[index].abs().max(LEAST_SIZE * self.start[index].abs());
            let scale = if size > 0.0 { size } else { 1.0 };
            let moved = |step: f64| {
                let mut u = self.at.clone();
                u[index] += step;
                (self.residuals)(u.as_slice())
            };
            let (above, below, width) = match self.differences {
                Differences::Forward => {
                    let step = 1e-5 * scale;
                    (moved(step)?, None, step)
                }
                Differences::Central => {
                    let step = f64::EPSILON.cbrt() * scale;
                    (moved(step)?, Some(moved(-step)?), 2.0 * step)
                }
            };
            let below = below.as_ref().unwrap_or(&here);
            for (row, (a, b)) in above.iter().zip(below).enumerate() {
                jacobian[(row, index)] = (a - b) / width;
            }
        }
        Some(jacobian)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_has_the_textbook_coefficients_and_standard_errors() {
        // y = 1, 3, 2, 5 at x = 0, 1, 2, 3: slope 1.1, intercept 1.1, S = 2.7, s² = 1.35.
        let y = [1.0, 3.0, 2.0, 5.0];
        let fit = least_squares(
            &[Parameter::free(0.0), Parameter::free(0.0)],
            |p| Some(y.iter().enumerate().map(|(x, y)| y - p[0] - p[1] * x as f64).collect()),
            Effort::EXACT,
        )
        .unwrap();
        assert!((fit.parameters[0] - 1.1).abs() < 1e-8 && (fit.parameters[1] - 1.1).abs() < 1e-8);
        assert!((fit.sum_of_squares - 2.7).abs() < 1e-10);
        // var(slope) = s²/Σ(x − x̄)² = 1.35/5; var(intercept) = s² (1/4 + 1.5²/5).
        assert!((fit.standard_errors[1].unwrap() - 0.27_f64.sqrt()).abs() < 1e-7);
        assert!((fit.standard_errors[0].unwrap() - (1.35 * 0.7_f64).sqrt()).abs() < 1e-7);
    }

    #[test]
    fn a_parameter_that_wants_to_leave_its_bounds_ends_at_the_bound_without_a_standard_error() {
        let residuals = |p: &[f64]| Some(vec![p[0] - 5.0, p[1] - 1.0, p[1] - 1.5]);
        for lower in [0.0, 1e-3] {
            let parameters = [Parameter::bounded(1.0, lower, 2.0), Parameter::free(0.0)];
            let fit = least_squares(&parameters, residuals, Effort::EXACT).unwrap();
            assert!((fit.parameters[0] - 2.0).abs() < 1e-6);
            assert_eq!((fit.at_bound[0], fit.standard_errors[0]), (true, None));
            assert!((fit.parameters[1] - 1.25).abs() < 1e-8);
            assert!(fit.standard_errors[1].is_some());
        }
    }

    #[test]
    fn a_parameter_on_which_nothing_depends_has_no_standard_error() {
        let fit = least_squares(
            &[Parameter::free(1.0), Parameter::free(1.0)],
            |p| Some(vec![p[0] - 2.0, p[0] - 3.0]),
            Effort::EXACT,
        )
        .unwrap();
        assert!((fit.parameters[0] - 2.5).abs() < 1e-8);
        assert!(fit.standard_errors[0].is_some() && fit.standard_errors[1].is_none());
    }

    #[test]
    fn misra1a_is_certified_from_both_starts() {
        // NIST StRD Misra1a: y = b1 (1 − e^{−b2 x}), lower difficulty.
        let y = [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78];
        let x = [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0];
        for start in [[500.0, 0.0001], [250.0, 0.0005]] {
            let fit = least_squares(
                &start.map(Parameter::free),
                |p| Some(y.iter().zip(x).map(|(y, x)| y - p[0] * (1.0 - (-p[1] * x).exp())).collect()),
                Effort::EXACT,
            )
            .unwrap();
            let certified = [(238.942_129_18, 2.707_007_534_1), (5.501_564_318_1e-4, 7.266_868_811_6e-6)];
            for (i, (value, error)) in certified.into_iter().enumerate() {
                let achieved = (fit.parameters[i] / value - 1.0, fit.standard_errors[i].unwrap() / error - 1.0);
                println!("b{}: relative {:.1e}, of its error {:.1e}", i + 1, achieved.0, achieved.1);
                assert!(achieved.0.abs() < 1e-8 && achieved.1.abs() < 1e-7);
            }
        }
    }

    #[test]
    fn a_factor_is_found_on_the_other_side_of_one_from_wherever_the_fit_starts() {
        let signal: Vec<f64> = (0..200).map(|i| (0.1 * f64::from(i)).sin()).collect();
        for start in [0.22, 0.9, 1.05, 1.1, 5.5] {
            for factor in [0.3, 0.75, 1.3, 4.0] {
                let parameters = [Parameter::bounded(start, 0.1, 10.0)];
                let residuals = |p: &[f64]| Some(signal.iter().map(|s| (factor - p[0]) * s).collect());
                let fit = least_squares(&parameters, residuals, Effort::QUICK).unwrap();
                assert!((fit.parameters[0] / factor - 1.0).abs() < 1e-3, "{start}: {} of {factor}", fit.parameters[0]);
            }
        }
    }

    #[test]
    fn a_start_outside_its_bounds_is_refused() {
        let error = least_squares(&[Parameter::bounded(3.0, 0.0, 2.0)], |_| Some(vec![0.0]), Effort::EXACT);
        assert_eq!(error, Err(FitError::Start { index: 0, lower: 0.0, upper: 2.0, start: 3.0 }));
    }
}
