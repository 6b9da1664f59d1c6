//! Leave-one-out validation of compensators: each record in turn is compensated by what was fitted to the others.

use super::metrics::DEFAULT_AVERAGE_S;
use super::{Observer, TaskError};
use crate::compensate::learned::ONLY_FITS;
use crate::compensate::{CompensateError, Compensator, Day, Method};
use crate::io::write::leave_one_out::{LeaveOneOutJson, LeftOutJson, LeftOutMethodJson, LeftOutRecordJson};
use crate::io::write::measures::MeasuresJson;
use crate::metrics::Metrics;
use crate::numeric::statistics::{mean, rms, standard_deviation};
use crate::pattern::Pattern;
use crate::rate::CoilModel;
use crate::record::Record;
use crate::units::deg_per_h_from_rad_per_s;

/// A rate before compensation, and what each method leaves of it, row by row.
pub(crate) type Curves = Vec<(&'static str, Vec<f64>)>;

/// What is left of a record, measured.
pub(super) fn measures(record: &Record, rates: Vec<f64>) -> Result<MeasuresJson, TaskError> {
    let left = Record::new("left", record.times_s().to_vec(), record.temperature_k().to_vec(), rates)?;
    Ok(MeasuresJson::new(&Metrics::of(&left, DEFAULT_AVERAGE_S)?))
}

/// Records that methods are fitted to, of one gyro.
pub(super) struct Trial<'t> {
    pub model: &'t CoilModel,
    pub pattern: &'t Pattern,
    pub days: Vec<Day<'t>>,
    /// Their names.
    pub files: Vec<&'t str>,
}

impl Trial<'_> {
    /// Fitted to all records, but for one where it is said which.
    pub(super) fn fit(&self, method: Method, without: Option<usize>) -> Result<Compensator, CompensateError> {
        let others = self.days.iter().enumerate().filter(|(place, _)| Some(*place) != without);
        Compensator::fit_to(method, self.model, self.pattern, &others.map(|(_, day)| day).collect::<Vec<_>>())
    }

    /// What a compensator leaves of a record.
    pub(super) fn tried(&self, compensator: &Compensator, record: &Record) -> Result<Vec<f64>, CompensateError> {
        let has = |name: &str| record.channels().iter().any(|c| c.name == name);
        match compensator.channel_names().into_iter().find(|name| !has(name)) {
            Some(name) => Err(CompensateError::MissingChannel { name: name.to_owned() }),
            None => Ok(compensator.batch(record)),
        }
    }
}

/// What leave-one-out validation found.
pub(super) struct LeftOut {
    pub document: LeaveOneOutJson,
    /// All records one behind the other, each as the others leave it; methods that could be fitted without any of them.
    pub curves: Curves,
    pub times_s: Vec<f64>,
}

/// Between records in the picture: this part of them all.
const PAUSE: f64 = 0.02;

/// Every method on every record, fitted to the others.
///
/// # Errors
/// Records that cannot be measured.
pub(super) fn leave_one_out(trial: &Trial, observer: &dyn Observer) -> Result<LeftOut, TaskError> {
    let rates = |record: &Record| record.rate_rad_per_s().to_vec();
    let records: Vec<&Record> = trial.days.iter().map(|day| day.record).collect();
    let shown = deg_per_h_from_rad_per_s;
    // What is left where only the others' offset is known: a method that does no better is worth nothing.
    let mut without = Vec::new();
    let mut listed = Vec::new();
    for (place, record) in records.iter().enumerate() {
        let others: Vec<f64> =
            records.iter().enumerate().filter(|(i, _)| *i != place).flat_map(|(_, other)| rates(other)).collect();
        let offset = mean(&others);
        let left: Vec<f64> = record.rate_rad_per_s().iter().map(|rate| rate - offset).collect();
        listed.push(LeftOutRecordJson {
            file: trial.files[place].to_owned(),
            before: measures(record, rates(record))?,
            by_offset_rms_deg_per_h: shown(rms(&left)),
        });
        without.extend(left);
    }
    let by_offset_rms_deg_per_h = shown(rms(&without));
    let mut curves = vec![("before", records.iter().flat_map(|record| rates(record)).collect())];
    let mut methods = Vec::new();
    let steps = (Method::ALL.len() * records.len()) as f64;
    for (number, method) in Method::ALL.into_iter().enumerate() {
        let at = |place: usize| {
            let words = format!("{}, fitted without {}", method.key(), trial.files[place]);
            observer.at((number * records.len() + place) as f64 / steps, &words);
        };
        let (row, all) = of_method(trial, method, by_offset_rms_deg_per_h, at)?;
        curves.extend(all.map(|all| (method.key(), all)));
        methods.push(row);
    }
    let document = LeaveOneOutJson { by_offset_rms_deg_per_h, records: listed, methods };
    Ok(LeftOut { document, curves, times_s: one_behind_the_other(&records) })
}

/// One method on every record, fitted to the others, and what it leaves of all of them where it could always be fitted.
fn of_method(
    trial: &Trial,
    method: Method,
    by_offset_rms_deg_per_h: f64,
    at: impl Fn(usize),
) -> Result<(LeftOutMethodJson, Option<Vec<f64>>), TaskError> {
    let records: Vec<&Record> = trial.days.iter().map(|day| day.record).collect();
    let shown = deg_per_h_from_rad_per_s;
    let mut all = Vec::new();
    let mut found = Vec::new();
    for (place, record) in records.iter().enumerate() {
        at(place);
        let file = trial.files[place].to_owned();
        let fitted = trial.fit(method, Some(place));
        found.push(match fitted.and_then(|compensator| Ok((trial.tried(&compensator, record)?, compensator))) {
            Ok((left, compensator)) => {
                all.extend_from_slice(&left);
                LeftOutJson {
                    file,
                    rms_deg_per_h: Some(shown(rms(&left))),
                    deviation_deg_per_h: Some(shown(standard_deviation(&left))),
                    delay_rows: Some(compensator.delay_rows(record.interval_s())),
                    measures: Some(measures(record, left)?),
                    reason: None,
                }
            }
            Err(error) => LeftOutJson::failed(file, error.to_string()),
        });
    }
    let is_whole = found.iter().all(|one| one.reason.is_none());
    let fitted = trial.fit(method, None).and_then(|compensator| {
        let left: Result<Vec<Vec<f64>>, _> = records.iter().map(|record| trial.tried(&compensator, record)).collect();
        Ok(shown(rms(&left?.concat())))
    });
    let fitted_rms = fitted.as_ref().ok().copied();
    let left_out_rms = is_whole.then(|| shown(rms(&all)));
    let only_fits = matches!((fitted_rms, left_out_rms), (Some(own), Some(other)) if other > ONLY_FITS * own);
    let reason = match (fitted_rms, left_out_rms) {
        (Some(own), Some(other)) if only_fits => Some(format!(
            "leaves {own:.5} °/h of records that it was fitted to, {other:.5} °/h of those that it was not shown: it only fits"
        )),
        (_, Some(other)) if other >= by_offset_rms_deg_per_h => Some(format!(
            "no better on a record that it was not shown than the mean rate of the others, which leaves {by_offset_rms_deg_per_h:.5} °/h"
        )),
        (_, None) => found.iter().find_map(|one| Some(format!("{}: {}", one.file, one.reason.as_ref()?))),
        _ => fitted.err().map(|error| format!("cannot be fitted to all records together: {error}")),
    };
    let row = LeftOutMethodJson {
        method: method.key(),
        fitted_rms_deg_per_h: fitted_rms,
        left_out_rms_deg_per_h: left_out_rms,
        only_fits,
        reason,
        records: found,
    };
    Ok((row, is_whole.then_some(all)))
}

fn one_behind_the_other(records: &[&Record]) -> Vec<f64> {
    let long_s = |record: &Record| record.times_s()[record.rows() - 1] - record.times_s()[0];
    let pause_s = PAUSE * records.iter().map(|record| long_s(record)).sum::<f64>();
    let mut begin_s = 0.0;
    let mut times_s = Vec::new();
    for record in records {
        times_s.extend(record.times_s().iter().map(|t| begin_s + t - record.times_s()[0]));
        begin_s += long_s(record) + pause_s;
    }
    times_s
}
