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
use super::{Assumption, Chamber, ChamberError, Reference};
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

/// How far an assumption's free numbers follow a planned record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refit {
    /// They stay where records at hand left them.
    None,
    /// To where the model linearised there leads, by what that foretells of χ².
    Linear,
    /// Step by step, as long as it gets better.
    Full,
}

/// One point of a fit to what is foreseen.
struct Point {
    deviance: f64,
    coordinates: DVector<f64>,
    assumed: Assumption,
    numbers: Vec<Numbers>,
    /// Where the model is not linear, the courses that it is linearised about.
    courses: Vec<Option<Reference>>,
    innovations: Vec<Innovation>,
}

/// Slope and information of a planned record by the coordinates, at a point.
type Slope = (DVector<f64>, DMatrix<f64>);

/// A fit to a planned record, from where records at hand left it.
struct Refitting<'f> {
    parameters: &'f [Parameter],
    record: usize,
    start: &'f Point,
    hold: Option<&'f Hold>,
}

impl Refitting<'_> {
    /// What the hold adds at other coordinates.
    fn held(&self, at: &DVector<f64>) -> f64 {
        self.hold.map_or(0.0, |hold| {
            let moved = at - &self.start.coordinates;
            moved.dot(&(&hold.information * &moved))
        })
    }

    /// Where a step from a point leads: slope and information there are those of the record, those of the hold are added.
    fn step(&self, at: &Point, (score, information): &Slope) -> Option<DVector<f64>> {
        let (mut score, mut information) = (score.clone(), information.clone());
        if let Some(hold) = self.hold {
            score -= &hold.information * (&at.coordinates - &self.start.coordinates);
            information += &hold.information;
        }
        // What the record says nothing of stays where it is.
        for (i, parameter) in self.parameters.iter().enumerate() {
            information[(i, i)] += parameter.deviation.powi(-2) * f64::EPSILON.sqrt();
        }
        Some(information.cholesky()?.solve(&score))
    }

    /// Coordinates a change away, within bounds.
    fn moved(&self, at: &Point, change: &DVector<f64>) -> DVector<f64> {
        let mut next = &at.coordinates + change;
        next.iter_mut().zip(self.parameters).for_each(|(x, p)| *x = x.clamp(p.lower, p.upper));
        next
    }

    /// χ² where the model, linearised where the fit begins, is best.
    fn foretold(&self, slope: &Slope) -> f64 {
        let Some(change) = self.step(self.start, slope) else { return self.start.deviance };
        let there = self.moved(self.start, &change);
        let (change, (score, information)) = (&there - &self.start.coordinates, slope);
        let gain = 2.0 * score.dot(&change) - change.dot(&(information * &change)) - self.held(&there);
        self.start.deviance - gain.max(0.0)
    }
}

impl Chamber<'_> {
    /// χ² of a planned record under an assumption whose free numbers and film are fitted to it, from where `from`
    /// left them: alone, and against what each hold says; all numbers of chamber and gyro are those of `air`.
    ///
    /// # Errors
    /// A model that cannot be solved.
    pub(crate) fn foresee<const N: usize>(
        &self,
        from: &Fit,
        air: &Fit,
        holds: [Option<&Hold>; N],
        record: usize,
        refit: Refit,
    ) -> Result<[f64; N], ChamberError> {
        let (film, own) = (from.numbers[from.records[0]].get(Quantity::Film), air.numbers[air.records[0]]);
        let mut numbers = vec![own; self.records()];
        numbers.iter_mut().for_each(|n| n.set(Quantity::Film, film));
        let parameters: Vec<Parameter> =
            self.parameters(&from.assumed, &from.free, &[record])?.into_iter().filter(is_coil).collect();
        let start = DVector::from_iterator(
            parameters.len(),
            parameters.iter().map(|p| p.read(&from.assumed, &numbers, record).clamp(p.lower, p.upper)),
        );
        let start = self.point((&from.assumed, &numbers), &parameters, start, record, None)?;
        let mut deviances = [start.deviance; N];
        if refit != Refit::None && !parameters.is_empty() {
            let slope = self.slope_at(&start, &parameters, record)?;
            for (deviance, hold) in deviances.iter_mut().zip(holds) {
                let hold = hold.filter(|hold| hold.information.nrows() == parameters.len());
                let refitting = Refitting { parameters: &parameters, record, start: &start, hold };
                *deviance = match refit {
                    Refit::Full => self.refitted(&refitting, &slope)?,
                    _ => refitting.foretold(&slope),
                };
            }
        }
        Ok(deviances)
    }

    /// χ² where a fit ends.
    fn refitted(&self, refitting: &Refitting, first: &Slope) -> Result<f64, ChamberError> {
        let mut best: Option<Point> = None;
        for step in 0..MOST_STEPS {
            let at = best.as_ref().unwrap_or(refitting.start);
            let slope =
                if step == 0 { first.clone() } else { self.slope_at(at, refitting.parameters, refitting.record)? };
            let Some(better) = self.better(refitting, at, &slope) else { break };
            let gain = at.deviance - better.deviance;
            best = Some(better);
            if gain < LEAST_GAIN {
                break;
            }
        }
        Ok(best.as_ref().unwrap_or(refitting.start).deviance)
    }

    /// The point that one step leads to, halved as long as it is no better.
    fn better(&self, refitting: &Refitting, at: &Point, slope: &Slope) -> Option<Point> {
        let mut change = refitting.step(at, slope)?;
        for _ in 0..HALVINGS {
            let next = refitting.moved(at, &change);
            let there = self.point((&at.assumed, &at.numbers), refitting.parameters, next, refitting.record, Some(at));
            if let Ok(mut there) = there {
                there.deviance += refitting.held(&there.coordinates);
                if there.deviance < at.deviance {
                    return Some(there);
                }
            }
            change *= 0.5;
        }
        None
    }

    /// A point, from the courses of another `beside` it.
    fn point(
        &self,
        (assumed, numbers): (&Assumption, &[Numbers]),
        parameters: &[Parameter],
        coordinates: DVector<f64>,
        record: usize,
        beside: Option<&Point>,
    ) -> Result<Point, ChamberError> {
        let (mut assumed, mut numbers) = (assumed.clone(), numbers.to_vec());
        if !write(parameters, coordinates.as_slice(), &mut assumed, &mut numbers) {
            return Err(ChamberError::Unsolvable);
        }
        let courses = self.course_of(&assumed, &numbers, record, beside)?;
        let model_point = self.model_point(assumed, numbers, &[record], &courses)?;
        let innovations = self.innovations(&model_point, record)?;
        let deviance = innovations.iter().map(misfit).sum::<f64>();
        let (assumed, numbers) = (model_point.assumed, model_point.numbers);
        if deviance.is_finite() {
            Ok(Point { deviance, coordinates, assumed, numbers, courses, innovations })
        } else {
            Err(ChamberError::Unsolvable)
        }
    }

    /// The course of a record where the model is not linear: smoothed once more about that of a point `beside`, or twice from none.
    fn course_of(
        &self,
        assumed: &Assumption,
        numbers: &[Numbers],
        record: usize,
        beside: Option<&Point>,
    ) -> Result<Vec<Option<Reference>>, ChamberError> {
        let observed = &self.observed[record];
        let mut courses = vec![None; self.records()];
        let side = CoilSide::new(assumed, numbers[record].get(Quantity::Film), self.modes, observed)?;
        if side.needs_reference() {
            let smoothed = |before| smoothed(&side, assumed, &numbers[record], observed, record, before);
            courses[record] = Some(match beside.and_then(|point| point.courses[record].as_ref()) {
                Some(before) => smoothed(Some(before))?,
                None => smoothed(Some(&smoothed(None)?))?,
            });
        }
        Ok(courses)
    }

    fn slope_at(&self, point: &Point, parameters: &[Parameter], record: usize) -> Result<Slope, ChamberError> {
        let Point { assumed, numbers, courses, innovations, .. } = point;
        let model_point = self.model_point(assumed.clone(), numbers.clone(), &[record], courses)?;
        let (coordinates, base) = (point.coordinates.as_slice(), std::slice::from_ref(innovations));
        let derivatives = self.derivatives(&model_point, parameters, coordinates, &[record], base)?;
        let mut score = DVector::zeros(parameters.len());
        let mut information = DMatrix::zeros(parameters.len(), parameters.len());
        derivatives[0].add_values_to(innovations, &mut score, &mut information);
        Ok((score, information))
    }
}

/// What a value without noise that is not as expected adds to χ²: noise would add the same for every candidate.
fn misfit(innovation: &Innovation) -> f64 {
    innovation.value * innovation.value / innovation.variance
}
