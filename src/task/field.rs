//! Rate errors and searches under a temperature field that was computed elsewhere, by finite elements say.

use crate::io::json::WindabilityJson;
use crate::io::model::{ModelFile, NamedPattern};
use crate::rate::{Past, RateModel, WeightResponse};
use crate::search::cost::samples::{SampleMatrix, any_rate_model};
use crate::thermal::ThermalHistory;
use crate::units::deg_per_h_from_rad_per_s;

use super::{Observer, TaskError, advise, own_and_classics};

/// Windings under a field.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The coil.
    pub model: &'a ModelFile,
    /// Of as many layers as the coil.
    pub field: &'a ThermalHistory,
    /// Empty for the model's own and all classics that fit.
    pub patterns: &'a [NamedPattern],
}

/// A winding under a field.
#[derive(Debug, Clone)]
pub struct PatternUnderField {
    /// The winding and its name.
    pub named: NamedPattern,
    /// At the field's times.
    pub rate_rad_per_s: Vec<f64>,
    /// The row of the largest size.
    pub worst_row: usize,
    /// Of the light there, with its sign.
    pub worst_phase_rad: f64,
    /// What it takes to wind it.
    pub windability: WindabilityJson,
}

impl PatternUnderField {
    /// The largest size of the rate error.
    pub fn worst_rate_deg_per_h(&self) -> f64 {
        deg_per_h_from_rad_per_s(self.rate_rad_per_s[self.worst_row].abs())
    }
}

/// Checks a field.
///
/// # Errors
/// Another layer count than the coil's, no rows, times that do not increase, numbers that are not finite.
pub(crate) fn check(model: &ModelFile, field: &ThermalHistory) -> Result<(), TaskError> {
    let fault = |message: String| Err(TaskError::Field { message });
    let layers = model.model.coil.layers();
    if field.layers != layers {
        return fault(format!("expected a column for each of the coil's {layers} layers, found {}", field.layers));
    }
    if field.is_empty() {
        return fault("expected at least one time, found none".to_owned());
    }
    let (rows, values) = (field.len(), field.temperature_k.len());
    if values != rows * layers || field.rate_k_per_s.len() != values {
        return fault(format!(
            "expected temperatures and rates of {rows} times {layers} layers, found {values} values"
        ));
    }
    // Both sides of a kink share a time.
    let is_behind = |i: usize| field.times_s[i] > field.times_s[i - 1];
    let is_kink = |i: usize| field.times_s[i] == field.times_s[i - 1] && (i < 2 || is_behind(i - 1));
    if let Some(row) = (1..rows).find(|&i| !is_behind(i) && !is_kink(i)) {
        return fault(format!("times must increase, row {row} ({} s) does not", field.times_s[row]));
    }
    let moments = [field.axial_moment_k.len(), field.axial_moment_k_per_s.len()];
    if let Some(found) = moments.into_iter().find(|count| *count != 0 && *count != values) {
        return fault(format!("expected axial moments of {rows} times {layers} layers, found {found} values"));
    }
    let columns =
        [&field.times_s, &field.temperature_k, &field.rate_k_per_s, &field.ambient_k, &field.ambient_rate_k_per_s];
    if columns.into_iter().chain([&field.axial_moment_k, &field.axial_moment_k_per_s]).flatten().any(|v| !v.is_finite())
    {
        return fault("expected finite numbers, found NaN or infinity".to_owned());
    }
    Ok(())
}

/// Evaluates windings under a field.
///
/// # Errors
/// A field that does not fit; effects that read a record's columns.
pub fn run(request: &Request, observer: &dyn Observer) -> Result<Vec<PatternUnderField>, TaskError> {
    let file = request.model;
    advise(file, observer);
    check(file, request.field)?;
    let all = if request.patterns.is_empty() { own_and_classics(file) } else { request.patterns.to_vec() };
    let mut found = Vec::with_capacity(all.len());
    for named in all {
        let rate_model = RateModel::new(&file.model, &named.pattern, &[])?;
        let rate_rad_per_s = series_rad_per_s(&rate_model, request.field)?;
        let mut worst_row = 0;
        for (row, rate) in rate_rad_per_s.iter().enumerate() {
            if rate.abs() > rate_rad_per_s[worst_row].abs() {
                worst_row = row;
            }
        }
        found.push(PatternUnderField {
            worst_phase_rad: rate_model.phase_rad(rate_rad_per_s[worst_row]).abs(),
            windability: WindabilityJson::of(&named.pattern),
            named,
            rate_rad_per_s,
            worst_row,
        });
    }
    Ok(found)
}

/// The field as what a search runs on.
///
/// # Errors
/// A field that does not fit; effects that leave a layer no turns.
pub fn matrix(model: &ModelFile, field: &ThermalHistory) -> Result<SampleMatrix, TaskError> {
    check(model, field)?;
    matrix_of(model, [field])
}

/// The same of several fields, each of which begins at rest.
pub(super) fn matrix_of<'f>(
    model: &ModelFile,
    fields: impl IntoIterator<Item = &'f ThermalHistory>,
) -> Result<SampleMatrix, TaskError> {
    let rate_model = any_rate_model(&model.model)?;
    let mut responses: Vec<WeightResponse> = Vec::new();
    for field in fields {
        series_rad_per_s(&rate_model, field)?;
        let mut past = Past::default();
        let state = |row: usize| rate_model.state(field, row, &[]);
        responses.extend((0..field.len()).map(|row| rate_model.weight_response_after(&state(row), &mut past)));
    }
    Ok(SampleMatrix::new(&model.model, &responses)?)
}

/// The rate error at every row, what remembers included.
pub(super) fn series_rad_per_s(rate_model: &RateModel, field: &ThermalHistory) -> Result<Vec<f64>, TaskError> {
    let mut past = Past::default();
    let rate = |row: usize| rate_model.checked_after(&rate_model.state(field, row, &[]), &mut past);
    Ok((0..field.len()).map(rate).collect::<Result<_, _>>()?)
}

/// Ω = c_s + Σ_j a_sj (2 P(j) − 1 − N).
#[derive(Debug, Clone, PartialEq)]
pub struct Sensitivities {
    /// Row-major, samples × layers.
    pub layers_deg_per_h: Vec<f64>,
    /// One a sample.
    pub constant_deg_per_h: Vec<f64>,
}

/// The sensitivities of the rate error under a field to where each layer's fibre comes from; none where the error is not of that
/// form: layers of unequal length, halves that respond differently, axial moments.
///
/// # Errors
/// As [`matrix`].
pub fn sensitivities(model: &ModelFile, field: &ThermalHistory) -> Result<Option<Sensitivities>, TaskError> {
    let matrix = matrix(model, field)?;
    if !matrix.equal_lengths() || !matrix.layout.halves_alike || matrix.layout.axial {
        return Ok(None);
    }
    let area_m2 = matrix.lengths_m()[0] * matrix.lengths_m()[0];
    let (samples, layers) = (matrix.samples(), matrix.layers());
    let of = |s: usize, j: usize| deg_per_h_from_rad_per_s(matrix.columns.column(j)[s] * area_m2);
    let shown = |rates: &[f64]| rates[..samples].iter().map(|r| deg_per_h_from_rad_per_s(*r)).collect();
    Ok(Some(Sensitivities {
        layers_deg_per_h: (0..samples).flat_map(|s| (0..layers).map(move |j| (s, j))).map(|(s, j)| of(s, j)).collect(),
        constant_deg_per_h: shown(matrix.columns.constant()),
    }))
}
