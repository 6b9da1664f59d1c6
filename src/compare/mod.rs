//! A model's prediction beside a measurement: how well it does, and where it fails.
//!
//! ```text
//! r_k = Ω_k − Ω̂_k                                  residual, the offset fitted
//! fit = 100 (1 − ‖Ω − Ω̂‖/‖Ω − mean Ω‖) %            NRMSE fit
//! R² = 1 − Σ r²/Σ (Ω − mean Ω)²
//! χ²_red = Σ r²/σ²/(n − 1)                          against the noise floor alone
//! χ²_b = Σ var_k/σ²/(n − 1)                         expected share of what the readings leave open in it
//! χ²_w = rᵀ C⁻¹ r/(n − 1),  C = σ² I + C_readings   what neither of them explains shows as an excess over 1
//! ```
//!
//! The prediction has seen no rate. What is noise, and whether anything is missing, is asked of readings and rates
//! together ([`crate::chamber`], [`crate::diagnose::standing`]).
//!
//! | symbol | meaning | in code |
//! |---|---|---|
//! | σ | the record's white noise, with its standard error: [`crate::numeric::noise`] | `noise_rad_per_s`, `noise_standard_error_rad_per_s` |
//! | var_k, C_readings | variance and covariance that what the readings leave open gives the prediction | `boundary_chi_square`, `whitened_chi_square` |
//!
//! Holds for records with more than a few dozen rows. The white noise of a record whose signal jumps from row to row is
//! overestimated.
//!
//! # Source
//! NRMSE fit as in Ljung, System Identification (1999), section 16.4; whiteness after Ljung and Box (1978); noise floor as
//! in [`crate::predict`].

pub mod adequacy;
pub mod regimes;
pub(crate) mod sensors;
pub(crate) mod suspicion;

use crate::chamber::FilmSwitches;
use crate::diagnose::{Standing, standing};
use crate::numeric::statistics::{LjungBox, autocorrelation, autocorrelation_band_99, correlation, rms};
use crate::pattern::Pattern;
use crate::predict::{self, Boundary, PredictError, RecordPrediction};
use crate::rate::CoilModel;
use crate::record::Record;
use crate::thermal::GivenField;
use crate::units::percent_from_fraction;
use adequacy::{Adequacy, ResidualFinding};
use regimes::{RecordPart, Regime, Regimes};
use sensors::SensorMisfit;

/// Everything that was found out about one record and one model.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// Rows that were compared.
    pub rows: usize,
    pub(crate) offset_rad_per_s: f64,
    pub(crate) noise_rad_per_s: f64,
    pub(crate) noise_standard_error_rad_per_s: f64,
    /// Root mean square of the residual, the offset taken out.
    pub rmse_rad_per_s: f64,
    pub(crate) nrmse_fit_percent: f64,
    /// None where the record does not vary.
    pub(crate) r_squared: Option<f64>,
    /// Σ r²/σ² over the degrees of freedom, σ the record's noise alone; 1 where the prediction is exact.
    pub reduced_chi_square: f64,
    /// What of it the uncertainty of the estimated boundary makes.
    pub boundary_chi_square: f64,
    /// The residual against noise and boundary together; 1 where the model is complete.
    pub whitened_chi_square: f64,
    pub(crate) largest: LargestError,
    /// At lags 0, 1, …, of the residual in units of its expected deviation.
    pub(crate) autocorrelation: Vec<f64>,
    pub(crate) autocorrelation_band: f64,
    pub(crate) ljung_box: LjungBox,
    pub(crate) correlations: Vec<Correlation>,
    /// The record by what the drive does; see [`Regime`].
    pub regimes: Vec<RecordPart>,
    /// One entry a row.
    pub(crate) regime_of_row: Vec<Regime>,
    pub(crate) temperature_bands: Vec<RecordPart>,
    pub(crate) rate_bands: Vec<RecordPart>,
    /// Where the error lies, what matters most first.
    pub findings: Vec<ResidualFinding>,
    /// Whether the model is adequate for the record.
    pub verdict: Adequacy,
    /// One entry a row.
    pub prediction: RecordPrediction,
    pub(crate) residual_rad_per_s: Vec<f64>,
    /// With its standard error; None where the model's own film counts.
    pub(crate) film_w_per_m2_k: Option<(f64, f64)>,
    /// Where the air's slope changed.
    pub(crate) bends_s: Vec<f64>,
    /// None where the film between air and pack is one.
    pub(crate) film_switches: Option<FilmSwitches>,
    /// What readings and rates together say of model and noise; None where the rates have none.
    pub(crate) standing: Option<Standing>,
    /// Readings and rates that are none of the coil's; the residual has them all the same.
    pub(crate) gross_errors: usize,
    /// Thermometers at layers.
    pub(crate) sensors: Vec<SensorMisfit>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LargestError {
    pub(crate) time_s: f64,
    pub(crate) residual_rad_per_s: f64,
}

/// What the residual may go along with.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Covariate {
    /// T of the pack's mean.
    Temperature,
    /// dT/dt of the pack's mean.
    TemperatureRate,
    /// Outermost less innermost layer.
    Gradient,
    /// Its rate of change.
    GradientRate,
    /// The model's own prediction: a scale error.
    Prediction,
    /// The prediction where it gets warmer less where it gets cooler.
    PredictionByDirection,
    /// A further column of the record, by its name.
    Channel(String),
}

impl std::fmt::Display for Covariate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Covariate::Temperature => f.write_str("T"),
            Covariate::TemperatureRate => f.write_str("dT/dt"),
            Covariate::Gradient => f.write_str("T_out - T_in"),
            Covariate::GradientRate => f.write_str("d(T_out - T_in)/dt"),
            Covariate::Prediction => f.write_str("the prediction"),
            Covariate::PredictionByDirection => f.write_str("the prediction times the sign of dT/dt"),
            Covariate::Channel(name) => f.write_str(name),
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Correlation {
    pub(crate) with: Covariate,
    /// None where the quantity does not vary.
    pub(crate) value: Option<f64>,
}

/// Lags of the autocorrelation: at most this many, and a quarter of the rows.
const MAX_LAGS: usize = 60;

/// Compares a model with a record.
///
/// # Errors
/// A pattern of another layer count, a heat path that cannot be solved, a record whose temperature says nothing.
pub fn compare(model: &CoilModel, pattern: &Pattern, record: &Record) -> Result<Comparison, PredictError> {
    let read = predict::read(model, pattern, record)?;
    let mut together =
        Together { whitened_chi_square: Some(0.0), standing: None, gross_errors: read.chamber.spikes(0) };
    let noise = predict::noise_floor_rad_per_s(record);
    if noise > 0.0 {
        let declared = read.declared(|chamber, fit, wandering| {
            let beyond = chamber.chi_square_beyond_readings(fit, 0, noise)?;
            Ok((beyond, standing(model, pattern, chamber, fit, wandering, None)?))
        })?;
        (together.whitened_chi_square, together.standing) = (Some(declared.0), Some(declared.1));
    }
    judged(model, pattern, record, &read.boundary, together)
}

/// Compares a model with a record whose layers' temperatures are known.
///
/// # Errors
/// A pattern of another layer count, a field that does not fit coil or record.
pub(crate) fn compare_under(
    model: &CoilModel,
    pattern: &Pattern,
    record: &Record,
    field: &GivenField,
) -> Result<Comparison, PredictError> {
    judged(model, pattern, record, &Boundary::given(model, field, record)?, Together::default())
}

/// What readings and rates say together.
#[derive(Default)]
struct Together {
    /// Against noise and boundary; None where the noise is all that there is.
    whitened_chi_square: Option<f64>,
    standing: Option<Standing>,
    gross_errors: usize,
}

fn judged(
    model: &CoilModel,
    pattern: &Pattern,
    record: &Record,
    boundary: &Boundary,
    together: Together,
) -> Result<Comparison, PredictError> {
    let prediction = predict::predict_from(model, pattern, record, boundary)?;
    let measured = record.rate_rad_per_s();
    let residual: Vec<f64> = measured.iter().zip(&prediction.rate_rad_per_s).map(|(m, p)| m - p).collect();
    let rows = residual.len();
    let freedom = (rows - 1) as f64;
    let noise = prediction.noise_rad_per_s;
    let variances = &prediction.boundary_variance_rad2_per_s2;
    let square: f64 = residual.iter().map(|r| r * r).sum();
    let mean = measured.iter().sum::<f64>() / rows as f64;
    let spread: f64 = measured.iter().map(|m| (m - mean).powi(2)).sum();
    let explained = (spread > 0.0).then(|| square / spread);
    let scaled: Vec<f64> =
        residual.iter().zip(variances).map(|(r, v)| r / (noise * noise + v).sqrt().max(f64::MIN_POSITIVE)).collect();
    let autocorrelation = autocorrelation(&scaled, MAX_LAGS.min(rows / 4));
    let (largest_row, _) =
        residual.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap_or((0, &0.0));
    let cut = Regimes::new(model, record, boundary, &prediction)?;
    let Boundary { film_w_per_m2_k, bends, film_switches, .. } = boundary.clone();
    let reduced_chi_square = square / (noise * noise) / freedom;
    let mut found = Comparison {
        rows,
        offset_rad_per_s: prediction.offset_rad_per_s,
        noise_rad_per_s: noise,
        noise_standard_error_rad_per_s: predict::noise_floor(record).standard_error,
        rmse_rad_per_s: rms(&residual),
        nrmse_fit_percent: explained.map_or(f64::NEG_INFINITY, |e| percent_from_fraction(1.0 - e.sqrt())),
        r_squared: explained.map(|e| 1.0 - e),
        reduced_chi_square,
        boundary_chi_square: variances.iter().sum::<f64>() / (noise * noise) / freedom,
        whitened_chi_square: together.whitened_chi_square.unwrap_or(reduced_chi_square),
        largest: LargestError { time_s: record.times_s()[largest_row], residual_rad_per_s: residual[largest_row] },
        ljung_box: LjungBox::new(&autocorrelation, rows),
        autocorrelation_band: autocorrelation_band_99(rows),
        autocorrelation,
        correlations: correlations(&residual, record, &prediction),
        regimes: cut.regimes(&residual, &scaled),
        regime_of_row: cut.regime_of_row(),
        temperature_bands: cut.temperature_bands(&residual, &scaled),
        rate_bands: cut.rate_bands(&residual, &scaled),
        findings: Vec::new(),
        verdict: Adequacy::Adequate,
        residual_rad_per_s: residual,
        film_w_per_m2_k,
        bends_s: bends.iter().map(|b| b.time_s).collect(),
        film_switches,
        standing: together.standing,
        gross_errors: together.gross_errors,
        sensors: sensors::misfits(model, record, boundary)?,
        prediction,
    };
    (found.verdict, found.findings) = adequacy::judge(&found, cut.transient_s);
    Ok(found)
}

fn correlations(residual: &[f64], record: &Record, prediction: &RecordPrediction) -> Vec<Correlation> {
    let of = |f: fn(&predict::PackRow) -> f64| prediction.pack.iter().map(f).collect::<Vec<f64>>();
    let coil: Vec<f64> = prediction.rate_rad_per_s.iter().map(|r| r - prediction.offset_rad_per_s).collect();
    let directed: Vec<f64> = coil.iter().zip(&prediction.pack).map(|(c, p)| c * p.mean_rate_k_per_s.signum()).collect();
    let own = [
        (Covariate::Temperature, of(|p| p.mean_k)),
        (Covariate::TemperatureRate, of(|p| p.mean_rate_k_per_s)),
        (Covariate::Gradient, of(|p| p.gradient_k)),
        (Covariate::GradientRate, of(|p| p.gradient_rate_k_per_s)),
        (Covariate::Prediction, coil),
        (Covariate::PredictionByDirection, directed),
    ];
    let own = own.into_iter().map(|(with, values)| Correlation { with, value: correlation(residual, &values) });
    let channels = record
        .channels()
        .iter()
        .map(|c| Correlation { with: Covariate::Channel(c.name.clone()), value: correlation(residual, &c.values) });
    own.chain(channels).collect()
}
