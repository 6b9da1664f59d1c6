//! The innovations at one point of numbers and effects, and their derivatives there: all that a likelihood is computed from.

use super::abreast;
use super::coil_side::{CoilSide, run};
use super::derivative::{DerivativeColumn, Derivatives};
use super::filter::{self, Innovation, System, Values};
use super::known::Reference;
use super::layout::Numbers;
use super::parameter::{Parameter, write};
use super::prior::Quantity;
use super::system::{decoupled_system, decoupled_system_beside};
use super::{Assumption, Chamber, ChamberError};
use crate::parallel::InParallel;

/// All that a likelihood is computed from.
pub(super) struct ModelPoint<'a> {
    pub(crate) assumed: Assumption,
    pub(crate) numbers: Vec<Numbers>,
    pub(crate) sides: Vec<Option<CoilSide>>,
    pub(crate) values: Vec<Option<Values>>,
    pub(crate) courses: &'a [Option<Reference>],
}

impl Chamber<'_> {
    /// Everything at one point; only the `records` are computed.
    pub(super) fn model_point<'c>(
        &self,
        assumed: Assumption,
        numbers: Vec<Numbers>,
        records: &[usize],
        courses: &'c [Option<Reference>],
    ) -> Result<ModelPoint<'c>, ChamberError> {
        let mut sides: Vec<Option<CoilSide>> = (0..self.records()).map(|_| None).collect();
        let mut values: Vec<Option<Values>> = (0..self.records()).map(|_| None).collect();
        for &r in records {
            // One after another: records behind one film share their heat path.
            let film = numbers[r].get(Quantity::Film);
            sides[r] = Some(CoilSide::new(&assumed, film, self.modes, &self.observed[r])?);
        }
        let taken_off = |&r: &usize| -> Result<Option<Values>, ChamberError> {
            let Some(side) = &sides[r] else { return Ok(None) };
            let course = courses[r].as_ref().filter(|c| side.needs_reference() && c.outputs == side.reduced.outputs);
            side.values(&assumed, &self.observed[r], r, course).map(Some)
        };
        let found: Result<Vec<_>, ChamberError> = records.iter().in_parallel().map(taken_off).collect();
        records.iter().zip(found?).for_each(|(&r, own)| values[r] = own);
        Ok(ModelPoint { assumed, numbers, sides, values, courses })
    }

    /// Of one record that the point was computed for.
    pub(super) fn innovations(&self, point: &ModelPoint, record: usize) -> Result<Vec<Innovation>, ChamberError> {
        let (Some(side), Some(values)) = (&point.sides[record], &point.values[record]) else {
            return Err(ChamberError::Unsolvable);
        };
        Ok(run(side, &point.assumed, &point.numbers[record], &self.observed[record], values))
    }

    /// One record with one coordinate moved.
    fn moved(
        &self,
        point: &ModelPoint,
        parameter: &Parameter,
        coordinate: f64,
        record: usize,
        unmoved: &System,
    ) -> Result<MovedRecord, ChamberError> {
        let mut numbers = point.numbers.clone();
        let mut assumed = point.assumed.clone();
        if !write(std::slice::from_ref(parameter), &[coordinate], &mut assumed, &mut numbers) {
            return Err(ChamberError::Unsolvable);
        }
        let series = &self.observed[record].series;
        if parameter.leaves_coil() {
            let Some(side) = &point.sides[record] else { return Err(ChamberError::Unsolvable) };
            let system = decoupled_system_beside(unmoved, &side.parts(&point.assumed), &numbers[record], series);
            return Ok(MovedRecord { system, values: None });
        }
        let mut there = self.model_point(assumed, numbers, &[record], point.courses)?;
        let (Some(side), values) = (&there.sides[record], there.values[record].take()) else {
            return Err(ChamberError::Unsolvable);
        };
        let system = decoupled_system_beside(unmoved, &side.parts(&there.assumed), &there.numbers[record], series);
        Ok(MovedRecord { system, values })
    }

    /// Derivatives of each record's innovations by its coordinates, at a point whose innovations (`base`) are known.
    pub(super) fn derivatives(
        &self,
        point: &ModelPoint,
        parameters: &[Parameter],
        coordinates: &[f64],
        records: &[usize],
        base: &[Vec<Innovation>],
    ) -> Result<Vec<Derivatives>, ChamberError> {
        let mut tasks: Vec<(usize, Vec<usize>)> = Vec::new();
        for (i, &record) in records.iter().enumerate() {
            // What moves the coil takes longer to work out, and may have another number of states.
            let mut own: Vec<usize> = (0..parameters.len()).filter(|&p| parameters[p].concerns(record)).collect();
            own.sort_by_key(|&p| parameters[p].leaves_coil());
            tasks.extend(own.chunks(abreast::LANES).map(|chunk| (i, chunk.to_vec())));
        }
        let unmoved = |record: &usize| -> Result<System, ChamberError> {
            let Some(side) = &point.sides[*record] else { return Err(ChamberError::Unsolvable) };
            let series = &self.observed[*record].series;
            Ok(decoupled_system(&side.parts(&point.assumed), &point.numbers[*record], series))
        };
        let unmoved = records.iter().map(unmoved).collect::<Result<Vec<System>, ChamberError>>()?;
        let columns: Vec<Result<Vec<DerivativeColumn>, ChamberError>> = tasks
            .iter()
            .in_parallel()
            .map(|(i, own)| {
                let moved: Result<Vec<(f64, MovedRecord)>, ChamberError> = own
                    .iter()
                    .map(|&p| self.moved_a_step(point, &parameters[p], coordinates[p], records[*i], &unmoved[*i]))
                    .collect();
                let (steps, moved): (Vec<f64>, Vec<MovedRecord>) = moved?.into_iter().unzip();
                let there = self.innovations_abreast(point, moved, records[*i])?;
                Ok(there.iter().zip(steps).map(|(t, step)| DerivativeColumn::new(&base[*i], t, step)).collect())
            })
            .collect();
        let mut all: Vec<Derivatives> = (0..records.len()).map(|_| Derivatives::default()).collect();
        for ((i, own), columns) in tasks.into_iter().zip(columns) {
            all[i].parameters.extend(own);
            all[i].columns.extend(columns?);
        }
        Ok(all)
    }

    /// One record with one coordinate moved by a step, up or, where that is out of bounds, down; and the step.
    fn moved_a_step(
        &self,
        point: &ModelPoint,
        parameter: &Parameter,
        coordinate: f64,
        record: usize,
        unmoved: &System,
    ) -> Result<(f64, MovedRecord), ChamberError> {
        let step = if coordinate + parameter.step() > parameter.upper { -parameter.step() } else { parameter.step() };
        let by = |step: f64| Ok((step, self.moved(point, parameter, coordinate + step, record, unmoved)?));
        by(step).or_else(|_| by(-step))
    }

    /// The innovations of one record by several systems, those of one structure at once.
    pub(super) fn innovations_abreast(
        &self,
        point: &ModelPoint,
        moved: Vec<MovedRecord>,
        record: usize,
    ) -> Result<Vec<Vec<Innovation>>, ChamberError> {
        let Some(unmoved) = &point.values[record] else { return Err(ChamberError::Unsolvable) };
        let rows = &self.observed[record].series.rows;
        let (systems, values): (Vec<System>, Vec<Option<Values>>) =
            moved.into_iter().map(|m| (m.system, m.values)).unzip();
        let values: Vec<&Values> = values.iter().map(|v| v.as_ref().unwrap_or(unmoved)).collect();
        let mut found = Vec::with_capacity(systems.len());
        while found.len() < systems.len() {
            let from = found.len();
            let alike =
                systems[from..].iter().take(abreast::LANES).take_while(|s| s.size == systems[from].size).count();
            // Lanes of which three are empty take more than twice as long as one pass.
            if alike == 1 {
                found.push(filter::forward(&systems[from], rows, values[from], false).innovations);
            } else {
                found.extend(abreast::forward(&systems[from..from + alike], rows, &values[from..from + alike]));
            }
        }
        Ok(found)
    }
}

/// A record's system somewhere beside a point, and its values where they are others there.
pub(super) struct MovedRecord {
    pub(super) system: System,
    pub(super) values: Option<Values>,
}

pub(super) fn log_likelihood(innovations: &[Innovation]) -> f64 {
    let sum: f64 =
        innovations.iter().map(|i| i.value * i.value / i.variance + (std::f64::consts::TAU * i.variance).ln()).sum();
    -0.5 * sum
}
