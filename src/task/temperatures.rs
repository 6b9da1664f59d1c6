//! What the layers do under a profile or a record.

use crate::io::json::temperatures::TemperaturesJson;
use crate::io::model::ModelFile;
use crate::pattern::classic::Classic;
use crate::predict::estimate_boundary;
use crate::profile::Profile;
use crate::search::cost::worst_case::{SearchError, SolvedProfiles};
use crate::thermal::{Drive, Instant, ThermalHistory, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

use super::measurement::{GrossErrors, Measurement};
use super::{Observer, TaskError, advise, own_and_classics};

/// What drives the pack.
#[derive(Debug, Clone, Copy)]
pub enum Driver<'a> {
    /// A profile of the model by its name, or its first; so many rows, evenly spaced.
    Profile {
        /// None for the model's first.
        name: Option<&'a str>,
        /// From the profile's start to its end.
        rows: u32,
    },
    /// The same at the instants at which windings are judged: close behind every kink, on both sides of it, and where the error of
    /// the model's own pattern and of each classic is largest.
    Judged {
        /// None for the model's first.
        name: Option<&'a str>,
    },
    /// A record; its rows are its own.
    Measurement(&'a Measurement),
}

/// What is asked.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil and its profiles.
    pub model: &'a ModelFile,
    /// What warms it.
    pub driver: Driver<'a>,
}

/// The field in the layers.
#[derive(Debug)]
pub struct Answer {
    /// Its name.
    pub model: String,
    /// The profile's or the record's name.
    pub drive: String,
    /// Of every layer.
    pub history: ThermalHistory,
}

impl Answer {
    /// As the program prints it.
    pub fn document(&self) -> TemperaturesJson {
        TemperaturesJson::new(&self.model, &self.drive, &self.history)
    }
}

/// Solves the heat.
///
/// # Errors
/// A profile that is not there, a model that cannot be solved.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Answer, TaskError> {
    let file = request.model;
    advise(file, observer);
    let (drive, history) = match request.driver {
        Driver::Profile { name, rows } => of_profile(&file.clone().for_search(), name, rows)?,
        Driver::Judged { name } => as_judged(&file.clone().for_search(), name)?,
        Driver::Measurement(measurement) => {
            let noticed = measurement.noticed(GrossErrors::Keep, Some(file), observer)?;
            let own = file.pattern.as_ref().map(|named| named.pattern.clone());
            // Temperatures don't depend on the pattern; effects may weigh the layers by it.
            let pattern = own.or_else(|| Classic::Zyl.pattern(file.model.coil.layers()).ok());
            let pattern = pattern.expect("every even layer count has a cylindrical winding");
            let record = &noticed.record;
            let boundary = estimate_boundary(&file.model, &pattern, record)?;
            (record.name().to_owned(), boundary.history(record, 0..record.rows(), file.model.rate_mean_s))
        }
    };
    Ok(Answer { model: file.model.name.clone(), drive, history })
}

fn chosen(file: &ModelFile, name: Option<&str>) -> Result<Profile, TaskError> {
    let profiles = file.profiles.profiles();
    let chosen = match name {
        None => profiles.first(),
        Some(name) => profiles.iter().find(|p| p.name() == name),
    };
    chosen.cloned().ok_or_else(|| {
        let stated = name.unwrap_or_default().to_owned();
        let known = profiles.iter().take(8).map(|p| p.name().to_owned()).collect::<Vec<_>>().join(", ");
        TaskError::UnknownProfile { stated, known }
    })
}

fn as_judged(file: &ModelFile, name: Option<&str>) -> Result<(String, ThermalHistory), TaskError> {
    let profile = chosen(file, name)?;
    let solved = SolvedProfiles::new(&file.model, std::slice::from_ref(&profile))?;
    let of_profile = &solved.profiles()[0];
    let sampled = &of_profile.history;
    let mut peaks_s = Vec::new();
    for named in own_and_classics(file) {
        peaks_s.push(solved.worst_case(&file.model, &named.pattern)?.time_s);
    }
    peaks_s.sort_by(f64::total_cmp);
    peaks_s.dedup();
    // Each peak by itself, as it was found: sums over many instants at once round otherwise.
    let peaks: Vec<ThermalHistory> = peaks_s.iter().map(|t| of_profile.field.at(&[Instant::after(*t)])).collect();
    let mut peaks = peaks.iter().filter(|peak| !sampled.times_s.contains(&peak.times_s[0])).peekable();
    let mut history = ThermalHistory::with_capacity(sampled.layers, sampled.len() + peaks_s.len());
    for row in 0..sampled.len() {
        while let Some(peak) = peaks.next_if(|peak| peak.times_s[0] < sampled.times_s[row]) {
            history.push_row_of(peak, 0);
        }
        history.push_row_of(sampled, row);
    }
    Ok((profile.name().to_owned(), history))
}

fn of_profile(file: &ModelFile, name: Option<&str>, rows: u32) -> Result<(String, ThermalHistory), TaskError> {
    let profile = chosen(file, name)?;
    let path = file.model.heat_path().map_err(SearchError::from)?;
    let drive = Drive::boundary(profile.temperature(REFERENCE_TEMPERATURE_K));
    let field = solve(&path, &drive).map_err(SearchError::from)?;
    let last = f64::from(rows - 1);
    let instants: Vec<Instant> =
        (0..rows).map(|i| Instant::after(profile.duration_s() * f64::from(i) / last)).collect();
    Ok((profile.name().to_owned(), field.at(&instants)))
}
