//! Which piece of physics a model lacks, judged by records.
//!
//! Every effect of the catalogue that the model lacks is fitted to the records as an addition: alone, in pairs, as a
//! further step and in exchange. Residuals are whitened with the covariance of noise and boundary, so that sums of
//! squares are χ². An effect stays if the information criterion pays for it and for the search, if it explains data
//! that it was not fitted to, and if its size is practical. Plain functions of time compete, so that something outside
//! the catalogue is recognised.
//!
//! ```text
//! χ² = Σ_records (Ω − Ω̂ − Ω_0)ᵀ (σ² 1 + J C Jᵀ)⁻¹ (Ω − Ω̂ − Ω_0)
//! merit = χ²/s² + p ln n + 6 m,   s² = max(1, χ²_best/n)        p parameters, m effects
//! ```
//!
//! # Source
//! Schwarz, Ann. Stat. 6 (1978) 461 (the criterion); Golub and Pereyra, Inverse Problems 19 (2003) R1 (linear parameters
//! projected out); Bartlett, J. R. Stat. Soc. Suppl. 8 (1946) 27 (standard errors under autocorrelation).

mod anchor;
mod candidate;
mod conductivity;
mod confirm;
mod evidence;
pub mod experiment;
mod field;
mod hypothesis;
pub mod plain;
mod prune;
mod search;
mod stranger;
mod tilt;
mod verdict;

use thiserror::Error;

use crate::coil::CoilError;
use crate::effect::DeclaredEffect;
use crate::pattern::Pattern;
use crate::predict::PredictError;
use crate::rate::CoilModel;
use crate::record::Record;
use crate::units::Unit;

use experiment::Contest;

pub use candidate::{is_declared_number, is_empirical};
pub use plain::{Plain, Shape};

/// What is asked.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    pub model: &'a CoilModel,
    pub pattern: &'a Pattern,
    /// Fitted to.
    pub records: &'a [Record],
    /// Only judged by.
    pub holdout: &'a [Record],
}

/// The answer in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing is missing that these records could show.
    Adequate,
    /// These effects are missing.
    Missing,
    /// Several effects explain the records equally well.
    Indistinguishable,
    /// Something is there that no combination of known effects explains.
    Unexplained,
}

/// A fitted parameter; value and error in SI.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedParameter {
    pub key: String,
    pub unit: Unit,
    pub value: f64,
    /// With the residuals' autocorrelation; None at a bound or where the records do not determine it.
    pub standard_error: Option<f64>,
    pub at_bound: bool,
    /// Whether it was fitted at all.
    pub fitted: bool,
}

/// Another effect that would do in the place of an accepted one.
#[derive(Debug, Clone)]
pub struct Equivalent {
    pub effect: DeclaredEffect,
    /// By how much χ² is larger with it, over all records, hold-out included.
    pub chi_square_more: f64,
    /// Cosine of the angle between the two responses in these records.
    pub correlation: f64,
    /// The declared model with it and with the other effects as fitted beside it.
    pub extended: CoilModel,
}

/// An accepted effect.
#[derive(Debug, Clone)]
pub struct Finding {
    pub effect: DeclaredEffect,
    pub parameters: Vec<FittedParameter>,
    pub equivalents: Vec<Equivalent>,
    /// By how much χ² rises without it.
    pub chi_square_less: f64,
    /// By how much χ² of data that it was not fitted to rises without it.
    pub confirmed_by: f64,
}

/// A value counts as determined that is so many standard errors from where it would do nothing.
const DETERMINED: f64 = 3.0;

impl Finding {
    /// Whether the records hold any of what was fitted away from where the effect would do nothing.
    fn is_determined(&self) -> bool {
        let idle = if is_declared_number(&self.effect) { 1.0 } else { 0.0 };
        let far = |p: &FittedParameter| p.standard_error.is_some_and(|e| (p.value - idle).abs() > DETERMINED * e);
        let mut fitted = self.parameters.iter().filter(|p| p.fitted).peekable();
        fitted.peek().is_none() || fitted.any(far)
    }

    /// An effect at values that no record was asked about.
    pub fn unfitted(effect: DeclaredEffect) -> Self {
        let parameters = effect
            .parameters()
            .into_iter()
            .zip(effect.values())
            .map(|(declared, &value)| FittedParameter {
                key: declared.key,
                unit: declared.unit,
                value,
                standard_error: None,
                at_bound: false,
                fitted: false,
            })
            .collect();
        Self { effect, parameters, equivalents: Vec::new(), chi_square_less: 0.0, confirmed_by: 0.0 }
    }
}

/// One step of the ladder.
#[derive(Debug, Clone, PartialEq)]
pub struct Rung {
    pub effects: Vec<String>,
    pub rmse_rad_per_s: f64,
    pub holdout_rmse_rad_per_s: Option<f64>,
    pub reduced_chi_square: f64,
    /// Of the records that were held out, nothing being fitted to them but their offsets.
    pub holdout_reduced_chi_square: Option<f64>,
    pub bic: f64,
}

/// One candidate by itself.
#[derive(Debug, Clone)]
pub struct Contender {
    pub effect: DeclaredEffect,
    pub reduced_chi_square: f64,
    pub bic: f64,
    /// By how much χ² falls with it alone.
    pub chi_square_less: f64,
}

/// What is left over.
#[derive(Debug, Clone, PartialEq)]
pub struct Unexplained {
    /// Root mean square beyond the noise [rad/s].
    pub excess_rad_per_s: f64,
    /// Share of the declared model's excess that is left.
    pub share_of_excess: f64,
    /// Correlations with t, T, dT/dt, d(T_out − T_in)/dt and further columns; strongest first.
    pub correlations: Vec<(String, f64)>,
    /// Plain functions of time that fit it best.
    pub plain: Vec<Plain>,
}

/// Something that a reader of the answer should know.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Caution {
    #[error("{record}: {rows} rows were left out because of gross errors")]
    Outliers { record: String, rows: usize },
    #[error("{record}: column {channel} lacks values and was not considered")]
    ChannelIncomplete { record: String, channel: String },
    #[error(
        "{record}: the declared coil predicts its rate no better than a constant does: does the model file belong to this coil?"
    )]
    WrongCoil { record: String },
    #[error("the winding {winding} explains the records without any effect: is the declared pattern the coil's?")]
    OtherWinding { winding: &'static str },
    #[error("no hold-out record: effects were confirmed on blocks in time that they were not fitted to")]
    NoHoldout,
    #[error(
        "the records to fit show nothing that the model lacks, the hold-out does: what is said was fitted to the hold-out and confirmed on the records to fit"
    )]
    FittedToHoldout,
    #[error("{kind} was not accepted: {reason}")]
    Refused { kind: String, reason: Refusal },
}

/// Why an effect that fits was refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum Refusal {
    #[error("it does not explain data that it was not fitted to")]
    Unconfirmed,
    #[error("it is too small to matter beside the model's own accuracy")]
    Small,
    #[error("the factor is within 2 % of one")]
    FactorNearOne,
    #[error("what is left over, or a plain function of time, is larger than what it explains")]
    Outdone,
}

/// The whole answer.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    pub verdict: Verdict,
    pub effects: Vec<Finding>,
    pub ladder: Vec<Rung>,
    pub candidates: Vec<Contender>,
    /// Over all records that were fitted.
    pub noise_floor_rad_per_s: f64,
    pub unexplained: Option<Unexplained>,
    pub suggested_experiment: Option<String>,
    pub cautions: Vec<Caution>,
    /// The declared model with the accepted effects.
    pub extended: CoilModel,
}

#[derive(Debug, Error, Clone, PartialEq)]
pub enum DiagnoseError {
    #[error("a diagnosis needs at least one record")]
    NoRecord,
    #[error("{record}: {source}")]
    Record { record: String, source: PredictError },
    #[error(transparent)]
    Coil(#[from] CoilError),
    #[error("{record}: the rate has no noise at all: is this a measurement?")]
    NoNoise { record: String },
    #[error(
        "{record}: the temperature moves by {range_k:.3} K only, less than the {needed_k:.3} K that a diagnosis with this sensor needs: no verdict can be drawn from it"
    )]
    TemperatureConstant { record: String, range_k: f64, needed_k: f64 },
    #[error("{record} has {found} rows: a diagnosis needs at least {needed}")]
    TooShort { record: String, found: usize, needed: usize },
    #[error(
        "{kind} cannot be fitted to these records: it changes nothing in them, or the model cannot be solved with it"
    )]
    NoFit { kind: String },
    #[error("the declared model cannot be solved for these records")]
    Unsolvable,
}

/// Fewer rows than this determine no effect.
const LEAST_ROWS: usize = 100;

/// An effect that was asked for, fitted to records.
#[derive(Debug, Clone)]
pub struct Extension {
    pub finding: Finding,
    /// The declared model with the effect; an effect of the same kind that it had is replaced.
    pub extended: CoilModel,
    pub reduced_chi_square_before: f64,
    pub reduced_chi_square_after: f64,
}

/// Fits one kind of effect, whatever the evidence says about it; a custom effect starts from the values given.
///
/// # Errors
/// As [`diagnose`]; an effect that cannot be fitted to these records.
pub fn extend(request: &Request, effect: &DeclaredEffect) -> Result<Extension, DiagnoseError> {
    let mut without = request.model.clone();
    without.effects.retain(|e| e.kind() != effect.kind());
    check_lengths(request)?;
    let mut evidence = evidence::Evidence::new(&without, request.pattern, request.records, request.holdout)?;
    let records: Vec<&Record> = request.records.iter().chain(request.holdout).collect();
    let candidates = candidate::of_kind(&without, &records, effect);
    verdict::settle_one(&mut evidence, &without, &candidates)?
        .ok_or_else(|| DiagnoseError::NoFit { kind: effect.kind() })
}

fn check_lengths(request: &Request) -> Result<(), DiagnoseError> {
    if request.records.is_empty() {
        return Err(DiagnoseError::NoRecord);
    }
    for record in request.records.iter().chain(request.holdout) {
        if record.rows() < LEAST_ROWS {
            let (record, found) = (record.name().to_owned(), record.rows());
            return Err(DiagnoseError::TooShort { record, found, needed: LEAST_ROWS });
        }
    }
    Ok(())
}

/// Finds what a model lacks; `progress` is told the share that is done.
///
/// # Errors
/// No records, records that say nothing, a model that cannot be solved.
pub fn diagnose(request: &Request, progress: &(dyn Fn(f64) + Sync)) -> Result<Diagnosis, DiagnoseError> {
    Ok(diagnose_and(request, progress, |_, _| ())?.0)
}

/// As [`diagnose`], and what is left to be told apart by an experiment.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_with_contest(
    request: &Request,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(Diagnosis, Contest), DiagnoseError> {
    diagnose_and(request, progress, |evidence, found| Contest::new(evidence, request.model, found))
}

/// Also what else is made of the evidence.
fn diagnose_and<T>(
    request: &Request,
    progress: &(dyn Fn(f64) + Sync),
    further: impl FnOnce(&evidence::Evidence, &Diagnosis) -> T,
) -> Result<(Diagnosis, T), DiagnoseError> {
    check_lengths(request)?;
    progress(0.0);
    let mut evidence = evidence::Evidence::new(request.model, request.pattern, request.records, request.holdout)?;
    progress(0.15);
    let records: Vec<&Record> = request.records.iter().chain(request.holdout).collect();
    let candidates = candidate::candidates(request.model, &records);
    let answer = |evidence: &mut evidence::Evidence, most_effects: usize, progress: &(dyn Fn(f64) + Sync)| {
        let found = search::search(evidence, request.model, &candidates, most_effects, progress)?;
        progress(0.9);
        verdict::judge(evidence, request.model, &candidates, found)
    };
    let mut diagnosis = answer(&mut evidence, search::MAX_EFFECTS, progress)?;
    // Where what is to be fitted shows nothing, the other records may; the former then confirm it. Of several effects they
    // could confirm none.
    if diagnosis.verdict == Verdict::Adequate && !request.holdout.is_empty() {
        evidence.exchange();
        let other = answer(&mut evidence, 1, &|share| progress(0.9 + 0.1 * share))?;
        if other.verdict == Verdict::Adequate || !other.effects.iter().all(Finding::is_determined) {
            evidence.exchange();
        } else {
            diagnosis = other;
            diagnosis.cautions.insert(0, Caution::FittedToHoldout);
        }
    }
    let further = further(&evidence, &diagnosis);
    progress(1.0);
    Ok((diagnosis, further))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::experiment::fixtures::{effect, model, pattern};
    use super::*;
    use crate::boundary::expose;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::rate::RateModel;
    use crate::thermal::solve;
    use crate::units::REFERENCE_TEMPERATURE_K;

    /// A day in a chamber that goes up and down by `swing_k`.
    fn day(model: &CoilModel, swing_k: f64, seed: u64) -> Record {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let mut noise = |deviation: f64| deviation * normal.inverse_cdf(random.random::<f64>());
        let times_s: Vec<f64> = (1..=600).map(|i| 10.0 * f64::from(i)).collect();
        let knots_s = vec![0.0, 905.0, 1703.0, 2412.0, 4011.0, 6000.0];
        let air_k = [0.0, 0.0, 1.0, 1.0, -1.0, -1.0].map(|t| REFERENCE_TEMPERATURE_K + swing_k * t).to_vec();
        let air = PiecewiseLinear::new(knots_s, air_k).unwrap();
        let exposed = expose(&model.heat_path().unwrap(), Some(25.0), 0.0, &air, &times_s).unwrap();
        let history = solve(&exposed.path, &exposed.drive).unwrap().means(&times_s, model.rate_mean_s);
        let rates = RateModel::new(model, &pattern(), &[]).unwrap().series_rad_per_s(&history);
        let rates = rates.into_iter().map(|r| r + noise(1e-7)).collect();
        let temperature_k = exposed.shown_k.into_iter().map(|t| t + noise(0.002)).collect();
        Record::new("day", times_s, temperature_k, rates).unwrap()
    }

    #[test]
    fn what_only_the_hold_out_shows_is_found_there_and_confirmed_by_the_rest() {
        let complete = model(vec![effect("strain_mismatch", &[0.004])]);
        let (gentle, wild) = ([day(&complete, 0.6, 1)], [day(&complete, 20.0, 2)]);
        let (declared, pattern) = (model(Vec::new()), pattern());
        let asked = |records, holdout| {
            let request = Request { model: &declared, pattern: &pattern, records, holdout };
            diagnose(&request, &|_| ()).unwrap()
        };
        let says = |d: &Diagnosis| d.cautions.contains(&Caution::FittedToHoldout);
        let found = asked(&gentle, &wild);
        println!("{:?}: {:?}", found.verdict, found.ladder);
        assert!(says(&found) && found.verdict != Verdict::Adequate);
        let kinds = found
            .effects
            .iter()
            .flat_map(|f| std::iter::once(f.effect.kind()).chain(f.equivalents.iter().map(|e| e.effect.kind())));
        assert!(kinds.collect::<Vec<_>>().contains(&"strain_mismatch".to_owned()));
        // The ladder's columns stay those of the records as they were given.
        let (first, last) = (&found.ladder[0], &found.ladder[1]);
        assert!(first.holdout_rmse_rad_per_s.unwrap() > 1.2 * last.holdout_rmse_rad_per_s.unwrap());
        assert!(first.rmse_rad_per_s < 1.1 * last.rmse_rad_per_s);
        assert!(!says(&asked(&wild, &gentle)));
    }
}
