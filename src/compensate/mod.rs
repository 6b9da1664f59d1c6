//! Takes the predictable part out of a gyro's rate, from one thermometer, row by row.
//!
//! Four compensators: the physical model ([`physical`]), straight lines over temperature, a regression on temperature
//! and its rates ([`empirical`]), and a ridge regression on lagged temperatures ([`learned`]). All run as a [`stream::Stream`], in batch too, so that both agree to the last digit.
//!
//! What remains is the inertial rate, the noise, and what the compensator does not know. An offset that a record was
//! fitted with is taken out too.

pub mod empirical;
pub(crate) mod filter;
pub mod formulas;
mod heating;
pub mod learned;
pub mod physical;
pub mod stream;

use std::sync::OnceLock;

use thiserror::Error;

use crate::chamber::{self, Assumption, Chamber, ChamberError, MOST_ROWS_FITTED, Surroundings};
use crate::coil::CoilError;
use crate::pattern::Pattern;
use crate::predict::PredictError;
use crate::rate::{CoilModel, RateError};
use crate::record::{Record, RecordError};
use crate::thermal::ThermalError;
use empirical::{PiecewiseBias, Regression};
use formulas::FormulaColumns;
use learned::LearnedCoefficients;
use physical::{MOST_DELAY_ROWS, Physical};
use stream::{Compensated, Reading, Stream};

/// Ways to compensate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// The coil's own model, driven by the thermometers.
    Physical,
    /// Straight lines over temperature.
    Piecewise,
    /// A regression on temperature and its rates.
    Regression,
    /// A ridge regression on lagged temperatures.
    Learned,
}

impl Method {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Method; 4] = [Method::Physical, Method::Piecewise, Method::Regression, Method::Learned];

    /// As in files and on the command line.
    pub fn key(self) -> &'static str {
        match self {
            Method::Physical => "physical",
            Method::Piecewise => "piecewise",
            Method::Regression => "regression",
            Method::Learned => "learned",
        }
    }
}

/// A compensator, ready for any record of the same gyro.
#[derive(Debug, Clone)]
pub enum Compensator {
    /// See [`Method::Physical`].
    Physical(Box<Physical>),
    /// See [`Method::Piecewise`].
    Piecewise(PiecewiseBias),
    /// See [`Method::Regression`].
    Regression(Regression),
    /// See [`Method::Learned`].
    Learned(LearnedCoefficients),
}

/// Why nothing can be compensated.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum CompensateError {
    #[error(
        "no difference equation holds {}: leave {} out of the model, or compensate with piecewise or regression",
        listed(.effects),
        if .effects.len() == 1 { "it" } else { "them" }
    )]
    NotLinear { effects: Vec<String> },
    #[error("the model reads the column {name}, which the record lacks")]
    MissingChannel { name: String },
    #[error("a fit needs at least {needed} rows, found {found}")]
    TooFew { needed: usize, found: usize },
    #[error("{method} needs a record to be fitted to: give one with --fit", method = .method.key())]
    NeedsRecord { method: Method },
    #[error(
        "an export gives the rate error of a gyro at rest and holds no scale factor: {} would be lost; export a model without {}, and divide the compensated rate by 1 + ε(T)",
        .effects.join(", "),
        if .effects.len() == 1 { "it" } else { "them" }
    )]
    ScaleFactorLost { effects: Vec<String> },
    #[error(transparent)]
    Predict(#[from] PredictError),
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error(transparent)]
    Chamber(#[from] ChamberError),
    #[error(transparent)]
    Thermal(#[from] ThermalError),
    #[error(transparent)]
    Rate(#[from] RateError),
    #[error(transparent)]
    Coil(#[from] CoilError),
}

/// Fewer rows than this hold no ramp.
const LEAST_ROWS: usize = 16;

/// A record to fit to, and what it says of its surroundings once that is asked: each is asked once, however many fits it is part of.
#[derive(Debug)]
pub(crate) struct Day<'r> {
    pub record: &'r Record,
    seen: OnceLock<Result<Seen, CompensateError>>,
}

/// Surroundings, and the relative error of the film.
type Seen = (Surroundings, f64);

impl<'r> Day<'r> {
    pub(crate) fn new(record: &'r Record) -> Self {
        Self { record, seen: OnceLock::new() }
    }

    fn seen(&self, model: &CoilModel, pattern: &Pattern) -> Result<Seen, CompensateError> {
        self.seen.get_or_init(|| surroundings(model, pattern, self.record)).clone()
    }
}

/// What readings and rates of a record say of chamber, film and sensor; of a long one, those of the stretch that moves most.
fn surroundings(model: &CoilModel, pattern: &Pattern, record: &Record) -> Result<Seen, CompensateError> {
    if record.rows() < LEAST_ROWS {
        return Err(CompensateError::TooFew { needed: LEAST_ROWS, found: record.rows() });
    }
    let assumed = Assumption::new(model.clone(), pattern.clone());
    let busiest = Chamber::of_any(model, &[record])?.busiest(0, MOST_ROWS_FITTED);
    let stretch = record.stretch(busiest)?;
    let (chamber, fit) = Chamber::of_any(model, &[&stretch])?.with_shocks(&assumed, &[0])?;
    Ok((chamber.surroundings(&fit, 0), Chamber::film_error(&fit)))
}

fn listed(effects: &[String]) -> String {
    if effects.is_empty() {
        "an effect that is not linear in the temperatures' rates".to_owned()
    } else {
        effects.join(", ")
    }
}

/// The model's own physics within what the records show of their surroundings.
fn physical_in(
    model: &CoilModel,
    pattern: &Pattern,
    days: &[&Day],
    records: &[&Record],
) -> Result<Physical, CompensateError> {
    let declared = Physical::new(model, pattern)?;
    let needed = || declared.channel_names().chain(declared.formula_columns());
    let has = |record: &Record, name: &str| record.channels().iter().any(|c| c.name == name);
    if let Some(name) = records.iter().find_map(|record| needed().find(|name| !has(record, name))) {
        return Err(CompensateError::MissingChannel { name: name.to_owned() });
    }
    let seen = days.iter().map(|day| day.seen(model, pattern)).collect::<Result<Vec<_>, _>>()?;
    let method = Method::Physical;
    let surroundings = Surroundings::together(&seen).ok_or(CompensateError::NeedsRecord { method })?;
    let range_k = records
        .iter()
        .flat_map(|record| record.temperature_k())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(*t), high.max(*t)));
    let mut physical = Physical::within(model, pattern, surroundings, Some(range_k))?;
    physical.tune(records);
    Ok(physical)
}

impl Compensator {
    /// Fitted to a record; the physical one's physics stays as declared: film, noise, delay and offset are fitted.
    ///
    /// # Errors
    /// A model that is not linear, a record that is too short or whose temperature says nothing.
    pub fn fit(method: Method, model: &CoilModel, pattern: &Pattern, record: &Record) -> Result<Self, CompensateError> {
        Self::fit_to(method, model, pattern, &[&Day::new(record)])
    }

    /// Fitted to several records of one gyro.
    ///
    /// # Errors
    /// As [`Compensator::fit`], for any of them; no record.
    pub(crate) fn fit_to(
        method: Method,
        model: &CoilModel,
        pattern: &Pattern,
        days: &[&Day],
    ) -> Result<Self, CompensateError> {
        let records: Vec<&Record> = days.iter().map(|day| day.record).collect();
        Ok(match method {
            Method::Physical => Compensator::Physical(Box::new(physical_in(model, pattern, days, &records)?)),
            Method::Piecewise => Compensator::Piecewise(PiecewiseBias::fit(&records)?),
            Method::Regression => Compensator::Regression(Regression::fit(&records)?),
            Method::Learned => Compensator::Learned(LearnedCoefficients::fit(&records)?),
        })
    }

    /// Without a record: the physical one, with usual values for film, noise and delay and without an offset.
    ///
    /// # Errors
    /// A model that is not linear; a method that needs a record.
    pub fn declared(method: Method, model: &CoilModel, pattern: &Pattern) -> Result<Self, CompensateError> {
        match method {
            Method::Physical => Ok(Compensator::Physical(Box::new(Physical::new(model, pattern)?))),
            Method::Piecewise | Method::Regression | Method::Learned => Err(CompensateError::NeedsRecord { method }),
        }
    }

    /// The physical one without a record, in the surroundings and with the offset that earlier records showed.
    ///
    /// # Errors
    /// A model that is not linear.
    pub(crate) fn in_known_surroundings(
        model: &CoilModel,
        pattern: &Pattern,
        learned: &chamber::Learned,
    ) -> Result<Self, CompensateError> {
        let mut physical = Physical::within(model, pattern, Surroundings::learned(learned), None)?;
        physical.offset_rad_per_s = learned.offset_rad_per_s.map_or(0.0, |offset| offset.value);
        Ok(Compensator::Physical(Box::new(physical)))
    }

    /// Which of the methods it is.
    pub fn method(&self) -> Method {
        match self {
            Compensator::Physical(_) => Method::Physical,
            Compensator::Piecewise(_) => Method::Piecewise,
            Compensator::Regression(_) => Method::Regression,
            Compensator::Learned(_) => Method::Learned,
        }
    }

    /// By how many rows of this interval the output follows the input; at least 1.
    pub fn delay_rows(&self, interval_s: f64) -> usize {
        let delay_s = match self {
            Compensator::Physical(physical) => physical.delay_s,
            Compensator::Piecewise(_) | Compensator::Learned(_) => 0.0,
            Compensator::Regression(regression) => regression.window_s,
        };
        ((delay_s / interval_s).round() as usize).clamp(1, MOST_DELAY_ROWS)
    }

    /// Further columns that are needed.
    pub fn channel_names(&self) -> Vec<&str> {
        match self {
            Compensator::Physical(physical) => physical.channel_names().chain(physical.formula_columns()).collect(),
            Compensator::Piecewise(_) | Compensator::Regression(_) | Compensator::Learned(_) => Vec::new(),
        }
    }

    fn channel_bias_of(&self, record: &Record, row: usize) -> Option<f64> {
        match self {
            Compensator::Physical(physical) => physical.channel_bias_of(record, row),
            Compensator::Piecewise(_) | Compensator::Regression(_) | Compensator::Learned(_) => Some(0.0),
        }
    }

    fn columns_of(&self, record: &Record, row: usize) -> FormulaColumns {
        match self {
            Compensator::Physical(physical) => physical.columns_of(record, row),
            Compensator::Piecewise(_) | Compensator::Regression(_) | Compensator::Learned(_) => {
                FormulaColumns::default()
            }
        }
    }

    /// What a row of a record holds for a stream.
    pub fn reading(&self, record: &Record, row: usize) -> Reading {
        Reading {
            time_s: record.times_s()[row],
            temperature_k: Some(record.temperature_k()[row]),
            inner_k: record.inner_k().map(|k| k[row]),
            channel_rad_per_s: self.channel_bias_of(record, row),
            columns: self.columns_of(record, row),
            rate_rad_per_s: Some(record.rate_rad_per_s()[row]),
        }
    }

    /// The compensated rate of every row of a record [rad/s].
    pub fn batch(&self, record: &Record) -> Vec<f64> {
        let mut found = Vec::with_capacity(record.rows());
        let mut stream = Stream::new(self);
        let keep = |row: Compensated<f64>| row.rate_rad_per_s.unwrap_or(row.tag);
        for row in 0..record.rows() {
            let rate = record.rate_rad_per_s()[row];
            stream.push(rate, Some(self.reading(record, row)), |row| found.push(keep(row)));
        }
        stream.finish(|row| found.push(keep(row)));
        found
    }
}
