//! Takes the predictable part out of a gyro's rate: a compensator as it was asked for, and all methods beside each other.

use std::path::PathBuf;

use crate::compensate::learned::LearnedCoefficients;
use crate::compensate::stream::{Compensated, Flag, Stream};
use crate::compensate::{CompensateError, Compensator, Day, Method};
use crate::effect::{Acts, DeclaredEffect};
use crate::io::files::{WriteError, folder_of};
use crate::io::folder::Replacement;
use crate::io::json::Document;
use crate::io::model::{ModelFile, NamedPattern};
use crate::io::write::compensation_file::{BiasLineJson, CompensateJson, MethodJson};
use crate::io::write::difference_equation::DifferenceEquation;
use crate::io::write::empirical_export::EmpiricalExport;
use crate::io::write::stream_summary::{StreamSummary, scatters_more};
use crate::numeric::statistics::{RunningDeviation, rms, standard_deviation};
use crate::predict::noise_floor_rad_per_s;
use crate::record::Record;
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s, percent_from_fraction};

use super::leave_one_out::{Curves, Trial, leave_one_out, measures};
use super::measurement::{GrossErrors, Measurement};
use super::{Observer, TaskError, pattern_or_own};

/// How to compensate.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil, its settings and how its records are read.
    pub model: &'a ModelFile,
    /// None for the model's own.
    pub pattern: Option<&'a NamedPattern>,
    /// What the compensator is made from.
    pub method: Method,
    /// What film, noise, delay and offset (or the lines, or the regression) are fitted to: records of one gyro.
    pub fit: &'a [Measurement],
    /// One difference equation of fixed gains, without hypotheses about breaks of the air's slope.
    pub linear: bool,
    /// Looks so far ahead; none for as far as the fitted record says is worth it.
    pub delay_s: Option<f64>,
}

impl<'a> Request<'a> {
    /// The model's own physics and pattern, as declared.
    pub fn new(model: &'a ModelFile) -> Self {
        Self { model, pattern: None, method: Method::Physical, fit: &[], linear: false, delay_s: None }
    }
}

/// A compensator, and what belongs to it.
#[derive(Debug)]
pub struct Answer {
    /// To run over rows or to write to a file.
    pub compensator: Compensator,
    /// The fitted records, without their gross errors.
    pub(crate) fitted: Vec<Record>,
    model: String,
    /// The model's effects on the scale factor, which no compensator holds.
    on_scale_factor: Vec<String>,
}

/// Makes the compensator.
///
/// # Errors
/// No pattern; a model that no compensator can hold; a record that says nothing.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Answer, TaskError> {
    let named = pattern_or_own(request.model, request.pattern)?;
    let model = &request.model.model;
    let fitted = fitted(request, observer)?;
    let turning = model.effects.iter().filter(|e| e.spec().acts == Acts::ScaleFactor).map(DeclaredEffect::kind);
    let turning: Vec<String> = turning.collect();
    if !turning.is_empty() {
        observer.note(&format!("what depends on a table's rate is not compensated: {}", turning.join(", ")));
    }
    let days: Vec<Day> = fitted.iter().map(Day::new).collect();
    let mut compensator = match &request.model.learned {
        _ if !days.is_empty() => {
            Compensator::fit_to(request.method, model, &named.pattern, &days.iter().collect::<Vec<_>>())?
        }
        Some(learned) if request.method == Method::Physical => {
            observer.note("film, chamber and offset are those that the model file states as [boundary]");
            Compensator::in_known_surroundings(model, &named.pattern, learned)?
        }
        _ => Compensator::declared(request.method, model, &named.pattern)?,
    };
    if let Compensator::Physical(physical) = &mut compensator {
        if request.linear {
            physical.hypotheses = 1;
            physical.tune(&fitted.iter().collect::<Vec<_>>());
        }
        if let Some(delay_s) = request.delay_s.filter(|d| *d >= 0.0) {
            physical.delay_s = delay_s;
        }
        if let Some(linearised) = physical.linearised() {
            observer.note(&format!(
                "the conductivity is taken at {:.1} °C; over what was fitted it differs by up to {:.1} %",
                celsius_from_kelvin(linearised.at_k),
                percent_from_fraction(linearised.conductivity_error)
            ));
        }
    }
    Ok(Answer { compensator, fitted, model: model.name.clone(), on_scale_factor: turning })
}

pub(super) fn fitted(request: &Request, observer: &dyn Observer) -> Result<Vec<Record>, TaskError> {
    let sound = |m: &Measurement| Ok(m.noticed(GrossErrors::Drop, Some(request.model), observer)?.record);
    request.fit.iter().map(sound).collect()
}

impl Answer {
    /// As the program prints it.
    pub fn document(&self, summary: Option<StreamSummary>) -> CompensateJson {
        CompensateJson {
            model: self.model.clone(),
            method: self.compensator.method().key(),
            summary,
            noise_floor_deg_per_h: None,
            before: None,
            methods: Vec::new(),
            leave_one_out: None,
            lines: BiasLineJson::all(&self.compensator),
        }
    }

    /// As asked for, or that of the fitted records where they agree.
    fn interval_s(&self, asked_s: Option<f64>) -> Option<f64> {
        let first_s = self.fitted.first().map(Record::interval_s);
        let agreed_s = first_s.filter(|s| self.fitted.iter().all(|r| (r.interval_s() / s - 1.0).abs() < SAME_INTERVAL));
        asked_s.or(agreed_s).filter(|i| *i > 0.0 && i.is_finite())
    }

    /// The compensator for an embedded target, as JSON and as a C header, for this interval or that of the fitted record; none where
    /// no such program holds it or the interval is not known.
    ///
    /// # Errors
    /// A model whose scale factor would be lost.
    pub fn exported(&self, interval_s: Option<f64>) -> Result<Option<[String; 2]>, TaskError> {
        self.check_whole()?;
        let pretty = |text: String| text + "\n";
        if let Some(equation) = self.difference_equation(interval_s) {
            let header = equation.c_header();
            return Ok(Some([pretty(serde_json::to_string_pretty(&Document::new(equation))?), header]));
        }
        let interval_s = self.interval_s(interval_s);
        let Some(empirical) = interval_s.and_then(|s| EmpiricalExport::new(&self.model, &self.compensator, s)) else {
            return Ok(None);
        };
        let header = empirical.c_header();
        Ok(Some([pretty(serde_json::to_string_pretty(&Document::new(empirical))?), header]))
    }

    /// Whether the compensator is the whole of what the model says of a rate.
    ///
    /// # Errors
    /// A physical one whose model has a scale factor's error too.
    pub fn check_whole(&self) -> Result<(), CompensateError> {
        let is_physical = self.compensator.method() == Method::Physical;
        if is_physical && !self.on_scale_factor.is_empty() {
            return Err(CompensateError::ScaleFactorLost { effects: self.on_scale_factor.clone() });
        }
        Ok(())
    }

    /// The compensator as a difference equation, for this interval or that of the fitted record; none where no such equation
    /// holds it or the interval is not known.
    pub fn difference_equation(&self, interval_s: Option<f64>) -> Option<DifferenceEquation> {
        let interval_s = self.interval_s(interval_s)?;
        let Compensator::Physical(physical) = &self.compensator else { return None };
        DifferenceEquation::new(&self.model, physical, interval_s, self.compensator.delay_rows(interval_s))
    }
}

/// Intervals of records that differ by less, relatively, are one.
const SAME_INTERVAL: f64 = 0.01;
/// No coil remembers longer: an interval or a delay beyond is none.
pub const LONGEST_S: f64 = 1e5;

/// Writes the two files of an export in place of what an earlier one left: both are of one run.
///
/// # Errors
/// Files that cannot be written.
pub fn write_exported(paths: &[PathBuf; 2], texts: [String; 2]) -> Result<(), WriteError> {
    let folder = folder_of(&paths[0]);
    let mut replacement = Replacement::of(&folder);
    let names = paths.each_ref().map(|path| path.file_name().unwrap_or_default());
    names.iter().zip(texts).try_for_each(|(name, text)| replacement.add(name, text.as_bytes()))?;
    // Of the two files none stays that is another run's.
    let kinds = names.map(|name| name.to_string_lossy().into_owned());
    replacement.commit(&kinds.each_ref().map(String::as_str))
}

/// A record, compensated row by row.
#[derive(Debug)]
#[non_exhaustive]
pub struct CompensatedRecord {
    /// Where nothing is known yet, NaN.
    pub rate_rad_per_s: Vec<f64>,
    /// The rows to which something happened, and what.
    pub flags: Vec<(usize, Vec<Flag>)>,
    /// How many rows met what.
    pub summary: StreamSummary,
}

/// Compensates a record as a stream does.
///
/// # Errors
/// A record that lacks what the compensator reads.
pub fn compensate_record(compensator: &Compensator, record: &Record) -> Result<CompensatedRecord, TaskError> {
    let has = |name: &&str| record.channels().iter().any(|c| c.name == **name);
    if let Some(name) = compensator.channel_names().into_iter().find(|name| !has(name)) {
        return Err(CompensateError::MissingChannel { name: name.to_owned() }.into());
    }
    let (mut before, mut after) = (RunningDeviation::default(), RunningDeviation::default());
    let mut found = CompensatedRecord {
        rate_rad_per_s: Vec::with_capacity(record.rows()),
        flags: Vec::new(),
        summary: StreamSummary::default(),
    };
    let mut take = |row: Compensated<f64>| {
        if row.flags.is_empty() {
            if let Some(rate) = row.rate_rad_per_s {
                before.push(row.tag);
                after.push(rate);
            }
        } else {
            row.flags.iter().for_each(|flag| found.summary.count(*flag));
            found.flags.push((found.rate_rad_per_s.len(), row.flags));
        }
        found.rate_rad_per_s.push(row.rate_rad_per_s.unwrap_or(f64::NAN));
    };
    let mut stream = Stream::new(compensator);
    for row in 0..record.rows() {
        stream.push(record.rate_rad_per_s()[row], Some(compensator.reading(record, row)), &mut take);
    }
    let delay_rows = stream.delay_rows();
    stream.finish(take);
    found.summary.rows = found.rate_rad_per_s.len();
    found.summary.delay_rows = delay_rows;
    found.summary.judge(&before, &after);
    Ok(found)
}

/// Every method, fitted to some records and tried on others.
#[derive(Debug)]
pub struct AllMethods {
    /// As the program prints it.
    pub document: CompensateJson,
    /// In rad/s.
    pub curves: Curves,
    /// Of the curves' rows: those of the record that was not fitted, or of the fitted ones, each left out in turn, one behind the other.
    pub(crate) times_s: Vec<f64>,
}

/// Fits every method to the request's records and tries it on another record where one is given; and, where there are several to fit
/// to, to all but each of them in turn, and tries it on that one.
///
/// # Errors
/// No pattern, no record to fit to or none to try on; records that cannot be measured.
pub fn all_methods(
    request: &Request,
    holdout: Option<&Measurement>,
    observer: &dyn Observer,
) -> Result<AllMethods, TaskError> {
    let file = request.model;
    let named = pattern_or_own(file, request.pattern)?;
    let fitted = fitted(request, observer)?;
    if fitted.is_empty() {
        return Err(CompensateError::NeedsRecord { method: Method::Piecewise }.into());
    }
    let files: Vec<&str> = request.fit.iter().map(|m| m.file.as_str()).collect();
    let trial =
        Trial { model: &file.model, pattern: &named.pattern, days: fitted.iter().map(Day::new).collect(), files };
    let left_out = (fitted.len() > 1).then(|| leave_one_out(&trial, observer)).transpose()?;
    let mut document = CompensateJson {
        model: file.model.name.clone(),
        method: "all",
        summary: None,
        noise_floor_deg_per_h: None,
        before: None,
        methods: Vec::new(),
        leave_one_out: None,
        lines: Vec::new(),
    };
    let (mut curves, mut times_s) = left_out.map_or_else(Default::default, |found| {
        document.leave_one_out = Some(found.document);
        (found.curves, found.times_s)
    });
    if let Some(holdout) = holdout {
        let record = holdout.noticed(GrossErrors::Keep, Some(file), observer)?.record;
        document.noise_floor_deg_per_h = Some(deg_per_h_from_rad_per_s(noise_floor_rad_per_s(&record)));
        document.before = Some(measures(&record, record.rate_rad_per_s().to_vec())?);
        curves = vec![("before", record.rate_rad_per_s().to_vec())];
        for method in Method::ALL {
            let tried =
                trial.fit(method, None).and_then(|compensator| Ok((trial.tried(&compensator, &record)?, compensator)));
            document.methods.push(match tried {
                Ok((left, compensator)) => {
                    curves.push((method.key(), left.clone()));
                    MethodJson {
                        method: method.key(),
                        rms_deg_per_h: Some(deg_per_h_from_rad_per_s(rms(&left))),
                        delay_rows: Some(compensator.delay_rows(record.interval_s())),
                        reason: worth(&compensator).or_else(|| worse(record.rate_rad_per_s(), &left)),
                        measures: Some(measures(&record, left)?),
                    }
                }
                Err(error) => MethodJson {
                    method: method.key(),
                    rms_deg_per_h: None,
                    delay_rows: None,
                    reason: Some(error.to_string()),
                    measures: None,
                },
            });
        }
        times_s = record.times_s().to_vec();
    } else if document.leave_one_out.is_none() {
        return Err(TaskError::NoHoldout);
    }
    Ok(AllMethods { document, curves, times_s })
}

/// That a method leaves more than there was.
fn worse(before_rad_per_s: &[f64], after_rad_per_s: &[f64]) -> Option<String> {
    let [before, after] = [before_rad_per_s, after_rad_per_s].map(standard_deviation).map(deg_per_h_from_rad_per_s);
    scatters_more(before, after)
}

/// What a learned compensator leaves of days that it was not shown, where that is not what it leaves of its own.
fn worth(compensator: &Compensator) -> Option<String> {
    let Compensator::Learned(learned) = compensator else { return None };
    let LearnedCoefficients { left_rad_per_s, cross_validated_rad_per_s, .. } = learned;
    learned.only_fits().then(|| {
        format!(
            "leaves {:.5} °/h of the record it was fitted to, {:.5} °/h of the parts of it that it was not shown: it only fits",
            deg_per_h_from_rad_per_s(*left_rad_per_s),
            deg_per_h_from_rad_per_s(*cross_validated_rad_per_s)
        )
    })
}
