//! The innovations at one point of numbers and effects, and their derivatives there: all that a likelihood is computed from.

use rayon::prelude::*;

use super::derivative::{DerivativeColumn, Derivatives};
use super::filter::{Innovation, Values};
use super::known::Reference;
use super::parameter::{Parameter, write};
use super::point::{CoilSide, run};
use super::prior::Quantity;
use super::system::Numbers;
use super::{Assumption, Chamber, ChamberError};

/// All that a likelihood is computed from.
pub(super) struct Place0<'a> {
    pub(crate) assumed: Assumption,
    pub(crate) numbers: Vec<Numbers>,
    pub(crate) sides: Vec<Option<CoilSide>>,
    pub(crate) values: Vec<Option<Values>>,
    pub(crate) courses: &'a [Option<Reference>],
}

impl Chamber<'_> {
    /// Everything at one point; only the `records` are computed.
    pub(super) fn place<'c>(
        &self,
        assumed: Assumption,
        numbers: Vec<Numbers>,
        records: &[usize],
        courses: &'c [Option<Reference>],
    ) -> Result<Place0<'c>, ChamberError> {
        let mut sides: Vec<Option<CoilSide>> = (0..self.records()).map(|_| None).collect();
        let mut values: Vec<Option<Values>> = (0..self.records()).map(|_| None).collect();
        for &r in records {
            let observed = &self.observed[r];
            let side = CoilSide::new(&assumed, numbers[r].get(Quantity::Film), self.modes, observed)?;
            let reference = if side.needs_reference() {
                courses[r].as_ref().filter(|c| c.outputs == side.reduced.outputs)
            } else {
                None
            };
            values[r] = Some(side.values(&assumed, observed, r, reference)?);
            sides[r] = Some(side);
        }
        Ok(Place0 { assumed, numbers, sides, values, courses })
    }

    /// Of one record that was computed for the place.
    pub(super) fn innovations(&self, place: &Place0, record: usize) -> Result<Vec<Innovation>, ChamberError> {
        let (Some(side), Some(values)) = (&place.sides[record], &place.values[record]) else {
            return Err(ChamberError::Unsolvable);
        };
        Ok(run(side, &place.assumed, &place.numbers[record], &self.observed[record], values))
    }

    /// The innovations of one record with one coordinate moved.
    fn moved(
        &self,
        place: &Place0,
        parameter: &Parameter,
        coordinate: f64,
        record: usize,
    ) -> Result<Vec<Innovation>, ChamberError> {
        let mut numbers = place.numbers.clone();
        let mut assumed = place.assumed.clone();
        if !write(std::slice::from_ref(parameter), &[coordinate], &mut assumed, &mut numbers) {
            return Err(ChamberError::Unsolvable);
        }
        if parameter.leaves_coil() {
            let (Some(side), Some(values)) = (&place.sides[record], &place.values[record]) else {
                return Err(ChamberError::Unsolvable);
            };
            return Ok(run(side, &place.assumed, &numbers[record], &self.observed[record], values));
        }
        let there = self.place(assumed, numbers, &[record], place.courses)?;
        self.innovations(&there, record)
    }

    /// Derivatives of each record's innovations by its coordinates, at a place whose innovations (`base`) are known.
    pub(super) fn derivatives(
        &self,
        place: &Place0,
        parameters: &[Parameter],
        coordinates: &[f64],
        records: &[usize],
        base: &[Vec<Innovation>],
    ) -> Result<Vec<Derivatives>, ChamberError> {
        let tasks: Vec<(usize, usize)> = (0..records.len())
            .flat_map(|i| (0..parameters.len()).map(move |p| (i, p)))
            .filter(|&(i, p)| parameters[p].concerns(records[i]))
            .collect();
        let columns: Vec<Result<(usize, usize, DerivativeColumn), ChamberError>> = tasks
            .into_par_iter()
            .map(|(i, p)| {
                let parameter = &parameters[p];
                let mut step = parameter.step();
                if coordinates[p] + step > parameter.upper {
                    step = -step;
                }
                let there = self.moved(place, parameter, coordinates[p] + step, records[i]).or_else(|_| {
                    step = -step;
                    self.moved(place, parameter, coordinates[p] + step, records[i])
                })?;
                Ok((i, p, DerivativeColumn::new(&base[i], &there, step)))
            })
            .collect();
        let mut all: Vec<Derivatives> = (0..records.len()).map(|_| Derivatives::default()).collect();
        for column in columns {
            let (i, p, column) = column?;
            all[i].parameters.push(p);
            all[i].columns.push(column);
        }
        Ok(all)
    }
}

pub(super) fn log_likelihood(innovations: &[Innovation]) -> f64 {
    let sum: f64 =
        innovations.iter().map(|i| i.value * i.value / i.variance + (std::f64::consts::TAU * i.variance).ln()).sum();
    -0.5 * sum
}
