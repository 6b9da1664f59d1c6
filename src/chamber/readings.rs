//! What the readings alone say of a record: nothing here has seen its rates.

use super::filter::RATE;
use super::series::Origin;
use super::{Chamber, ChamberError};
use crate::rate::CoilModel;
use crate::record::Record;

/// A change of the air's slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    pub time_s: f64,
    pub slope_change_k_per_s: f64,
}

impl<'a> Chamber<'a> {
    /// A chamber whose fits do not see the rates.
    ///
    /// # Errors
    /// As [`Chamber::new`], but that rates may be without noise.
    pub fn of_readings(model: &CoilModel, records: &[&'a Record]) -> Result<Self, ChamberError> {
        let mut chamber = Self::made(model, records, Origin::Measured)?;
        for observed in &mut chamber.observed {
            observed.blind = true;
            observed.series.rows.iter_mut().for_each(|row| row.measured[RATE] = None);
        }
        Ok(chamber)
    }
}
