//! The maximum of the posterior over the numbers of chamber, gyro and effects ([`super::ascent`]), and what it is worth.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::ascent::{AscentEnd, Beginning, Effort, KnownDerivatives};
use super::coil_side::{CoilSide, quantities, smoothed};
use super::known::Reference;
use super::layout::Numbers;
use super::parameter::{Free, Parameter};
use super::prior::Quantity;
use super::{Assumption, Chamber, ChamberError};
use crate::parallel::InParallel;

/// Which courses are smoothed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// Those that the model is linear about.
    WhereNeeded,
    Everywhere,
}

/// A model fitted to records.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub(crate) assumed: Assumption,
    pub(crate) free: Vec<Free>,
    /// Places of the fitted records in the chamber.
    pub(crate) records: Vec<usize>,
    pub parameters: Vec<Parameter>,
    /// In the order of the parameters.
    pub(crate) coordinates: Vec<f64>,
    /// Of the coordinates, from the information at the maximum.
    pub standard_errors: Vec<f64>,
    pub(crate) log_likelihood: f64,
    pub(crate) log_prior: f64,
    /// Natural logarithm of the evidence.
    pub(crate) evidence: f64,
    /// Information of data and prior.
    pub(super) information: DMatrix<f64>,
    /// Whether its ascent was that of [`Effort::FULL`], from whatever start.
    pub(super) is_full: bool,
    /// At its end, for fits that begin there.
    pub(super) known_derivatives: Option<Arc<KnownDerivatives>>,
    /// Records that were not fitted, as this fit or one that it began with found them: where [`Chamber::held_out`] begins.
    pub(crate) days: Arc<Vec<Fit>>,
    /// Of every record of the chamber.
    pub(super) numbers: Vec<Numbers>,
    /// The smoothed course of every fitted record; None elsewhere.
    pub(super) courses: Vec<Option<Reference>>,
}

impl Chamber<'_> {
    /// Fits an assumption to records of the chamber; what is `free` of its effects, all amplitudes of inputs and all
    /// numbers of the chamber are fitted. Numbers begin with those of `from`, if there is one.
    ///
    /// # Errors
    /// A model that cannot be solved where the fit begins.
    pub(crate) fn fit(
        &self,
        assumed: &Assumption,
        free: &[Free],
        records: &[usize],
        from: Option<&Fit>,
        effort: Effort,
    ) -> Result<Fit, ChamberError> {
        let numbers = match from {
            Some(fit) => self.completed(fit, records),
            None => self.observed.iter().map(|o| Numbers::medians(&o.series)).collect(),
        };
        let mut courses = from.map_or_else(|| vec![None; self.records()], |f| f.courses.clone());
        courses.resize(self.records(), None);
        let parameters = self.parameters(assumed, free, records)?;
        self.smooth_courses(assumed, &numbers, records, &mut courses, Wanted::WhereNeeded)?;
        let known = from.and_then(|f| f.known_derivatives.as_deref());
        let begin = Beginning { assumed, numbers: &numbers, parameters: &parameters, records, courses: &courses };
        let mut state = self.ascended(&begin, effort, known)?;
        let curved = records.iter().any(|&r| state.point.sides[r].as_ref().is_some_and(CoilSide::needs_reference));
        for _ in 1..if curved { effort.rounds.max(1) } else { 1 } {
            let (assumed, numbers) = (state.point.assumed.clone(), state.point.numbers.clone());
            let known = state.known_derivatives.take();
            self.smooth_courses(&assumed, &numbers, records, &mut courses, Wanted::WhereNeeded)?;
            let (assumed, numbers, parameters, courses) = (&assumed, &numbers, &parameters, &courses);
            let begin = Beginning { assumed, numbers, parameters, records, courses };
            state = self.ascended(&begin, effort, known.as_ref())?;
        }
        let end = AscentEnd::from(state);
        let wanted = if effort.is_for_ranking() { Wanted::WhereNeeded } else { Wanted::Everywhere };
        self.smooth_courses(&end.assumed, &end.numbers, records, &mut courses, wanted)?;
        let is_full = effort == Effort::FULL;
        let days = from.map_or_else(Arc::default, |f| f.days.clone());
        Ok(Fit { is_full, days, ..finished(end, free, records, parameters, courses) })
    }

    /// Numbers for all records: those that were not fitted take the first fitted one's, their air as it was found to be where
    /// it was looked at, because an ascent from another day's air is long.
    pub(super) fn completed(&self, fit: &Fit, records: &[usize]) -> Vec<Numbers> {
        let first = fit.records.first().copied().unwrap_or(0);
        (0..self.records())
            .map(|r| {
                if fit.records.contains(&r) || !records.contains(&r) || fit.records.is_empty() {
                    return fit.numbers.get(r).copied().unwrap_or(fit.numbers[first]);
                }
                let mut numbers = fit.numbers[first];
                if let Some(day) = &self.observed[r].day {
                    Quantity::AIR.iter().for_each(|&quantity| numbers.set(quantity, day.get(quantity)));
                }
                numbers
            })
            .collect()
    }

    pub(super) fn parameters(
        &self,
        assumed: &Assumption,
        free: &[Free],
        records: &[usize],
    ) -> Result<Vec<Parameter>, ChamberError> {
        let mut all: Vec<Parameter> = Vec::new();
        for &record in records {
            let medians = Numbers::medians(&self.observed[record].series);
            for quantity in quantities(assumed, &self.observed[record])? {
                let owner = (!quantity.is_shared()).then_some(record);
                let parameter = Parameter::of_quantity(quantity, owner, &medians);
                if !all.iter().any(|p| p.place == parameter.place) {
                    all.push(parameter);
                }
            }
        }
        all.extend(free.iter().map(|f| Parameter::of_effect(&assumed.model.effects[f.effect], f)));
        let unknown = assumed.inputs.iter().enumerate().filter(|(_, input)| input.deviation > 0.0);
        all.extend(unknown.map(|(i, input)| Parameter::of_input(i, input.deviation)));
        Ok(all)
    }

    /// Smooths the courses of records; only of those for which the model needs one, if no other is wanted.
    pub(super) fn smooth_courses(
        &self,
        assumed: &Assumption,
        numbers: &[Numbers],
        records: &[usize],
        courses: &mut [Option<Reference>],
        wanted: Wanted,
    ) -> Result<(), ChamberError> {
        let of = |r: usize| -> Result<Option<Reference>, ChamberError> {
            let observed = &self.observed[r];
            let side = CoilSide::new(assumed, numbers[r].get(Quantity::Film), self.modes, observed)?;
            let course = |before| smoothed(&side, assumed, &numbers[r], observed, r, before);
            if !side.needs_reference() {
                return if wanted == Wanted::Everywhere { course(None).map(Some) } else { Ok(None) };
            }
            // A course of another number of outputs (a heated flange) is no beginning for this one.
            match courses[r].as_ref().filter(|c| c.outputs == side.reduced.outputs) {
                Some(before) => course(Some(before)),
                None => course(Some(&course(None)?)),
            }
            .map(Some)
        };
        let found: Vec<(usize, Result<Option<Reference>, ChamberError>)> =
            records.iter().in_parallel().map(|&r| (r, of(r))).collect();
        for (r, course) in found {
            courses[r] = course?.or(courses[r].take());
        }
        Ok(())
    }
}

/// A fit by where its ascent ended.
fn finished(
    end: AscentEnd,
    free: &[Free],
    records: &[usize],
    parameters: Vec<Parameter>,
    courses: Vec<Option<Reference>>,
) -> Fit {
    let AscentEnd { assumed, numbers, coordinates, log_likelihood, information, known_derivatives } = end;
    let log_prior: f64 = parameters.iter().zip(&coordinates).map(|(p, &c)| p.log_prior(c)).sum();
    let (standard_errors, log_determinant) = match information.clone().cholesky() {
        Some(factor) => {
            let inverse = factor.inverse();
            let log_determinant = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
            ((0..parameters.len()).map(|i| inverse[(i, i)].sqrt()).collect(), log_determinant)
        }
        None => (vec![f64::NAN; parameters.len()], f64::INFINITY),
    };
    let evidence =
        log_likelihood + log_prior + 0.5 * parameters.len() as f64 * std::f64::consts::TAU.ln() - 0.5 * log_determinant;
    Fit {
        assumed,
        free: free.to_vec(),
        records: records.to_vec(),
        parameters,
        coordinates,
        standard_errors,
        log_likelihood,
        log_prior,
        evidence,
        information,
        is_full: false,
        known_derivatives: known_derivatives.map(Arc::new),
        days: Arc::default(),
        numbers,
        courses,
    }
}
