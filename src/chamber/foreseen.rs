//! What a record would say of a coil in a chamber of which everything is known: nothing is fitted but the coil.

use nalgebra::{DMatrix, DVector};

use super::coil_side::{CoilSide, smoothed};
use super::filter::Innovation;
use super::fit::Fit;
use super::kinked_rows::Bend;
use super::layout::Numbers;
use super::parameter::{Parameter, Place, write};
use super::prior::Quantity;
use super::series::Origin;
use super::{Assumption, Chamber, ChamberError};
use crate::rate::CoilModel;
use crate::record::Record;

/// How firmly records at hand hold the coil's numbers: −2 ln L rises by δᵀ H δ.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Hold {
    pub(crate) information: DMatrix<f64>,
}

/// Steps of a fit to what is foreseen: it begins where the records left it.
const MOST_STEPS: usize = 4;
/// A fit ends where a step gains less.
const LEAST_GAIN: f64 = 1e-3;
const HALVINGS: usize = 4;

impl Fit {
    /// The coil's free numbers and the film, in the order of [`Chamber::foresee`].
    pub(crate) fn hold(&self) -> Option<Hold> {
        let places: Vec<usize> = (0..self.parameters.len()).filter(|&i| is_coil(&self.parameters[i])).collect();
        let covariance = self.information.clone().cholesky()?.inverse();
        let block = DMatrix::from_fn(places.len(), places.len(), |i, k| covariance[(places[i], places[k])]);
        Some(Hold { information: block.cholesky().map_or_else(|| DMatrix::zeros(0, 0), |c| c.inverse()) })
    }
}

impl Fit {
    /// A fit to nothing: what is assumed, in a chamber as likely as any, with this white noise of a rate.
    #[cfg(test)]
    pub(crate) fn to_nothing(assumed: Assumption, free: Vec<super::parameter::Free>, noise_rad_per_s: f64) -> Self {
        let mut numbers = Numbers([f64::NAN; super::prior::PRIORS.len()]);
        for prior in &super::prior::PRIORS {
            numbers.set(prior.quantity, prior.median * if prior.relative { noise_rad_per_s } else { 1.0 });
        }
        Self {
            assumed,
            free,
            records: vec![0],
            parameters: Vec::new(),
            coordinates: Vec::new(),
            standard_errors: Vec::new(),
            log_likelihood: 0.0,
            log_prior: 0.0,
            evidence: 0.0,
            information: DMatrix::zeros(0, 0),
            is_full: false,
            known_derivatives: None,
            days: std::sync::Arc::default(),
            numbers: vec![numbers],
            courses: vec![None],
        }
    }

    /// The chamber's numbers of one of its records, as those of the only record.
    pub(crate) fn of_record(&self, record: usize) -> Self {
        Self { records: vec![0], numbers: vec![self.numbers[record]], courses: vec![None], ..self.clone() }
    }
}

impl<'a> Chamber<'a> {
    /// A record that was never measured: values without noise, among which nothing stands alone, of an air that is straight
    /// but for its bends. `noise_rad_per_s` is that of one rate.
    ///
    /// # Errors
    /// As [`Chamber::new`].
    pub(crate) fn planned(
        model: &CoilModel,
        record: &'a Record,
        bends: &[Bend],
        noise_rad_per_s: f64,
    ) -> Result<Self, ChamberError> {
        let mut chamber = Self::made(model, &[record], Origin::Planned)?;
        chamber.observed[0].series.noise_floor_rad_per_s = noise_rad_per_s;
        chamber.bend_at(bends, 0);
        Ok(chamber)
    }
}

fn is_coil(parameter: &Parameter) -> bool {
    !matches!(parameter.place, Place::Quantity { quantity, .. } if quantity != Quantity::Film)
}

/// One point of a fit to what is foreseen.
struct Point {
    deviance: f64,
    coordinates: DVector<f64>,
    assumed: Assumption,
    numbers: Vec<Numbers>,
}

impl Chamber<'_> {
    /// χ² of a planned record under an assumption whose free numbers and film are fitted to it, from where `from`
    /// left them and, with a hold, against what that says; all numbers of chamber and gyro are those of `air`.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn foresee(
        &self,
        from: &Fit,
        air: &Fit,
        hold: Option<&Hold>,
        record: usize,
        steps: usize,
    ) -> Result<f64, ChamberError> {
        let (film, own) = (from.numbers[from.records[0]].get(Quantity::Film), air.numbers[air.records[0]]);
        let mut numbers = vec![own; self.records()];
        numbers.iter_mut().for_each(|n| n.set(Quantity::Film, film));
        let parameters: Vec<Parameter> =
            self.parameters(&from.assumed, &from.free, &[record])?.into_iter().filter(is_coil).collect();
        let start = DVector::from_iterator(
            parameters.len(),
            parameters.iter().map(|p| p.read(&from.assumed, &numbers, record).clamp(p.lower, p.upper)),
        );
        let held = |at: &DVector<f64>| match hold {
            Some(hold) if hold.information.nrows() == at.len() => {
                let moved = at - &start;
                moved.dot(&(&hold.information * &moved))
            }
            _ => 0.0,
        };
        let mut best = self.point(&from.assumed, &numbers, &parameters, start.clone(), record)?;
        best.deviance += held(&best.coordinates);
        for _ in 0..steps.min(MOST_STEPS) {
            if parameters.is_empty() {
                break;
            }
            let (mut score, mut information) = self.slope_at(&best, &parameters, record)?;
            if let Some(hold) = hold.filter(|h| h.information.nrows() == parameters.len()) {
                score -= &hold.information * (&best.coordinates - &start);
                information += &hold.information;
            }
            // What the record says nothing of stays where it is.
            for i in 0..parameters.len() {
                information[(i, i)] += parameters[i].deviation.powi(-2) * f64::EPSILON.sqrt();
            }
            let Some(factor) = information.cholesky() else { break };
            let mut change = factor.solve(&score);
            let mut gain = 0.0;
            for _ in 0..HALVINGS {
                let mut next = &best.coordinates + &change;
                next.iter_mut().zip(&parameters).for_each(|(x, p)| *x = x.clamp(p.lower, p.upper));
                if let Ok(mut there) = self.point(&best.assumed, &best.numbers, &parameters, next, record) {
                    there.deviance += held(&there.coordinates);
                    if there.deviance < best.deviance {
                        gain = best.deviance - there.deviance;
                        best = there;
                        break;
                    }
                }
                change *= 0.5;
            }
            if gain < LEAST_GAIN {
                break;
            }
        }
        Ok(best.deviance)
    }

    fn point(
        &self,
        assumed: &Assumption,
        numbers: &[Numbers],
        parameters: &[Parameter],
        coordinates: DVector<f64>,
        record: usize,
    ) -> Result<Point, ChamberError> {
        let (mut assumed, mut numbers) = (assumed.clone(), numbers.to_vec());
        if !write(parameters, coordinates.as_slice(), &mut assumed, &mut numbers) {
            return Err(ChamberError::Unsolvable);
        }
        let courses = self.course_of(&assumed, &numbers, record)?;
        let model_point = self.model_point(assumed, numbers, &[record], &courses)?;
        let deviance = self.innovations(&model_point, record)?.iter().map(misfit).sum::<f64>();
        let (assumed, numbers) = (model_point.assumed, model_point.numbers);
        if deviance.is_finite() {
            Ok(Point { deviance, coordinates, assumed, numbers })
        } else {
            Err(ChamberError::Unsolvable)
        }
    }

    fn course_of(
        &self,
        assumed: &Assumption,
        numbers: &[Numbers],
        record: usize,
    ) -> Result<Vec<Option<super::Reference>>, ChamberError> {
        let observed = &self.observed[record];
        let mut courses = vec![None; self.records()];
        let side = CoilSide::new(assumed, numbers[record].get(Quantity::Film), self.modes, observed)?;
        if side.needs_reference() {
            for _ in 0..2 {
                let before = courses[record].take();
                courses[record] = Some(smoothed(&side, assumed, &numbers[record], observed, record, before.as_ref())?);
            }
        }
        Ok(courses)
    }

    fn slope_at(
        &self,
        point: &Point,
        parameters: &[Parameter],
        record: usize,
    ) -> Result<(DVector<f64>, DMatrix<f64>), ChamberError> {
        let courses = self.course_of(&point.assumed, &point.numbers, record)?;
        let model_point = self.model_point(point.assumed.clone(), point.numbers.clone(), &[record], &courses)?;
        let base = vec![self.innovations(&model_point, record)?];
        let derivatives = self.derivatives(&model_point, parameters, point.coordinates.as_slice(), &[record], &base)?;
        let mut score = DVector::zeros(parameters.len());
        let mut information = DMatrix::zeros(parameters.len(), parameters.len());
        derivatives[0].add_values_to(&base[0], &mut score, &mut information);
        Ok((score, information))
    }
}

/// What a value without noise that is not as expected adds to χ²: noise would add the same for every candidate.
fn misfit(innovation: &Innovation) -> f64 {
    innovation.value * innovation.value / innovation.variance
}
