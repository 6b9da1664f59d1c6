//! Which piece of physics a model lacks, judged by records.
//!
//! Every effect of the catalogue, the numbers that the model file states, other windings, a step of the offset, and wander
//! or a cycle that nothing explains are members of sets; each set is a joint model of chamber, pack, sensor and gyro
//! ([`crate::chamber`]) with an evidence. A score test says what is worth a fit; the search goes forward and back; the
//! verdict is drawn from posterior masses.
//!
//! ```text
//! M(set) = ln E(fitted records) + ln E(held-out records | the coil as fitted) + Σ ln p(member),   p(set) ∝ e^M
//! ```
//!
//! # Source
//! Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773 (evidence); Rao, Proc. Camb. Phil. Soc. 44 (1948) 50 (score test);
//! Madigan and Raftery, J. Am. Stat. Assoc. 89 (1994) 1535 (a set that holds a smaller one as good is that one).

mod answer;
mod candidate;
mod caution;
mod describe;
pub(crate) mod discover;
pub(crate) mod experiment;
mod joint;
pub(crate) mod plain;
mod standing;
mod switched_film;
mod terms;
#[cfg(test)]
mod tests;
mod together;
pub(crate) mod trim;

use thiserror::Error;

use crate::chamber::{Assumption, Chamber, ChamberError, EffectEstimates, Films, Fit, Learned, Noise};
use crate::coil::CoilError;
use crate::effect::DeclaredEffect;
use crate::numeric::noise::white_noise;
use crate::pattern::Pattern;
use crate::predict::{Boundary, PredictError};
use crate::rate::CoilModel;
use crate::record::Record;
use crate::units::Unit;

pub use crate::chamber::FilmSwitches;
pub use caution::{Caution, Refusal};
use discover::Beyond;
use joint::Question;
pub(crate) use plain::{Plain, ResidualShape};
pub(crate) use standing::{Standing, standing};
pub use terms::Terms;
pub(crate) use together::{declared_with, extend_together};

/// What is asked.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// As declared.
    pub model: &'a CoilModel,
    /// The winding that was measured.
    pub pattern: &'a Pattern,
    /// Fitted to.
    pub records: &'a [Record],
    /// Only judged by.
    pub holdout: &'a [Record],
    /// Whether formulas are sought for what no listed effect explains, and among which.
    pub terms: Terms<'a>,
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
    /// As in the model file; ends in the unit.
    pub key: String,
    pub(crate) unit: Unit,
    /// In the unit.
    pub value: f64,
    /// With the residuals' autocorrelation; None at a bound or where the records do not determine it.
    pub standard_error: Option<f64>,
    pub(crate) at_bound: bool,
    /// Whether it was fitted at all.
    pub(crate) fitted: bool,
}

/// Another effect that would do in the place of an accepted one.
#[derive(Debug, Clone)]
pub struct Equivalent {
    /// With its fitted parameters.
    pub effect: DeclaredEffect,
    /// By how much χ² is larger with it, over all records, hold-out included.
    pub(crate) chi_square_more: f64,
    /// Cosine of the angle between the two responses in these records.
    pub(crate) correlation: f64,
    /// The declared model with it and with the other effects as fitted beside it.
    pub(crate) extended: CoilModel,
}

/// An accepted effect.
#[derive(Debug, Clone)]
pub struct Finding {
    /// With its fitted parameters.
    pub effect: DeclaredEffect,
    /// As fitted, or as declared where they are fixed.
    pub parameters: Vec<FittedParameter>,
    /// Other effects that would do in its place.
    pub equivalents: Vec<Equivalent>,
    /// By how much χ² rises without it.
    pub(crate) chi_square_less: f64,
    /// By how much χ² of data that it was not fitted to rises without it.
    pub(crate) confirmed_by: f64,
}

impl Finding {
    /// An effect at values that no record was asked about.
    pub(crate) fn unfitted(effect: DeclaredEffect) -> Self {
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
    pub(crate) effects: Vec<String>,
    pub(crate) rmse_rad_per_s: f64,
    /// None without a record that was held out.
    pub holdout_rmse_rad_per_s: Option<f64>,
    pub(crate) reduced_chi_square: f64,
    /// Of the records that were held out, nothing being fitted to them but their offsets.
    pub(crate) holdout_reduced_chi_square: Option<f64>,
    pub(crate) bic: f64,
}

/// One candidate by itself.
#[derive(Debug, Clone)]
pub(crate) struct Contender {
    pub(crate) effect: DeclaredEffect,
    pub(crate) reduced_chi_square: f64,
    pub(crate) bic: f64,
    /// By how much χ² falls with it alone.
    pub(crate) chi_square_less: f64,
}

/// What is left over.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Unexplained {
    /// Root mean square beyond the noise [rad/s].
    pub(crate) excess_rad_per_s: f64,
    /// Share of the declared model's excess that is left.
    pub(crate) share_of_excess: f64,
    /// Correlations with t, T, dT/dt, d(T_out − T_in)/dt and further columns; strongest first.
    pub(crate) correlations: Vec<(String, f64)>,
    /// Plain functions of time that fit it best.
    pub(crate) plain: Vec<Plain>,
}

/// The whole answer.
#[derive(Debug, Clone)]
pub struct Diagnosis {
    /// Whether the declared model is adequate, and if not, whether that is explained.
    pub verdict: Verdict,
    /// Those accepted.
    pub effects: Vec<Finding>,
    /// From the declared model to the accepted one.
    pub ladder: Vec<Rung>,
    pub(crate) candidates: Vec<Contender>,
    /// Over all records that were fitted.
    pub(crate) noise_floor_rad_per_s: f64,
    pub(crate) unexplained: Option<Unexplained>,
    pub(crate) suggested_experiment: Option<String>,
    /// What a reader should know besides.
    pub cautions: Vec<Caution>,
    /// The declared model with the accepted effects.
    pub(crate) extended: CoilModel,
    /// Sets of explanations and what they hold, largest first.
    pub(crate) posterior: Vec<Share>,
    /// Numbers that the model file states and the records contradict.
    pub(crate) refitted: Vec<Refitted>,
    /// What is no effect and yet explains the records.
    pub(crate) hypothesis: Option<Hypothesis>,
    /// Of records whose film is switched.
    pub(crate) film_switches: Vec<FilmSwitches>,
    /// Fitted records first, then those held out.
    pub(crate) noise: Vec<RecordNoise>,
    /// Formulas that explain what no listed effect does, best first.
    pub proposals: Vec<discover::FormulaProposal>,
    /// What the fitted records say of film, offset and chamber, with the accepted effects.
    pub(crate) boundary: Learned,
    /// What drove each record, those held out last, as the declared model has it and as all that was found has it.
    pub(crate) driven: Vec<[Boundary; 2]>,
}

/// What one set of explanations holds of the posterior mass.
#[derive(Debug, Clone)]
pub(crate) struct Share {
    pub(crate) effects: Vec<String>,
    pub(crate) probability: f64,
    /// What of it is no effect: of sets with the same effects, the likeliest's.
    pub(crate) hypothesis: Option<Hypothesis>,
    /// All effects of the model that the set makes of the declared one, the declared ones first.
    pub(crate) members: Vec<DeclaredEffect>,
    /// Of the members' parameters.
    pub(crate) estimates: EffectEstimates,
}

/// A stated number that the records contradict; SI.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Refitted {
    pub(crate) kind: String,
    pub(crate) parameter: String,
    pub(crate) unit: Unit,
    pub(crate) declared: f64,
    pub(crate) value: f64,
    pub(crate) standard_error: Option<f64>,
}

/// What is no effect of the catalogue.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Hypothesis {
    /// The classic that the coil seems to be wound as.
    pub(crate) winding: Option<&'static str>,
    /// Connected the other way round.
    pub(crate) reversed: bool,
    /// Two layers that changed places, counted from 1 innermost.
    pub(crate) exchanged: Option<(usize, usize)>,
    pub(crate) offset_steps: Vec<OffsetStep>,
}

/// A step of the offset.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OffsetStep {
    pub(crate) record: String,
    pub(crate) time_s: f64,
    pub(crate) size_rad_per_s: f64,
}

/// Noise told apart, of one record.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RecordNoise {
    pub(crate) record: String,
    pub(crate) noise: Noise,
}

/// Why records cannot be diagnosed.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum DiagnoseError {
    #[error("a diagnosis needs at least one record")]
    NoRecord,
    #[error("{record}: {source}")]
    Record { record: String, source: Box<PredictError> },
    #[error(transparent)]
    Coil(#[from] CoilError),
    #[error(transparent)]
    Chamber(ChamberError),
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

/// Effects that a model may lack at once.
const MOST_MEMBERS: usize = 4;
/// Fewer rows than this determine no effect.
const LEAST_ROWS: usize = 100;

/// An effect that was asked for, fitted to records.
#[derive(Debug, Clone)]
pub(crate) struct Extension {
    pub(crate) finding: Finding,
    /// The declared model with the effect; an effect of the same kind that it had is replaced.
    pub(crate) extended: CoilModel,
    pub(crate) boundary: Learned,
}

/// Fits one kind of effect, whatever the evidence says about it; a custom effect starts from the values given.
///
/// # Errors
/// As [`diagnose`]; an effect that cannot be fitted to these records.
pub(crate) fn extend(request: &Request, effect: &DeclaredEffect) -> Result<Extension, DiagnoseError> {
    let mut without = request.model.clone();
    without.effects.retain(|e| e.kind() != effect.kind());
    let records = checked(request)?;
    let fitted: Vec<usize> = (0..request.records.len()).collect();
    let declared = Assumption::new(without.clone(), request.pattern.clone());
    let (chamber, base) = Chamber::new(&without, &records)?.with_shocks(&declared, &fitted)?;
    let all = candidate::of_kind(&without, &records, effect);
    let question = Question {
        chamber: &chamber,
        model: &without,
        pattern: request.pattern,
        candidates: &all,
        fitted,
        held_out: Vec::new(),
        depth: 1,
    };
    let best = joint::fit_one(&question, &base).ok_or_else(|| DiagnoseError::NoFit { kind: effect.kind() })?;
    Ok(Extension {
        finding: describe::alone(&question, &best, &base),
        extended: best.fit.assumed.model.clone(),
        boundary: chamber.learned(&best.fit)?,
    })
}

/// The least change of temperature that says anything: of the sensor's noise, and at all [K].
const LEAST_RANGE_NOISES: f64 = 50.0;
const LEAST_RANGE_K: f64 = 0.1;

fn checked<'a>(request: &Request<'a>) -> Result<Vec<&'a Record>, DiagnoseError> {
    if request.records.is_empty() {
        return Err(DiagnoseError::NoRecord);
    }
    let records: Vec<&Record> = request.records.iter().chain(request.holdout).collect();
    for record in &records {
        if record.rows() < LEAST_ROWS {
            let (record, found) = (record.name().to_owned(), record.rows());
            return Err(DiagnoseError::TooShort { record, found, needed: LEAST_ROWS });
        }
        let values = record.temperature_k();
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
        let needed_k = (LEAST_RANGE_NOISES * white_noise(record.times_s(), values).deviation).max(LEAST_RANGE_K);
        if high > low && high - low < needed_k {
            return Err(DiagnoseError::TemperatureConstant {
                record: record.name().to_owned(),
                range_k: high - low,
                needed_k,
            });
        }
    }
    Ok(records)
}

/// Finds what a model lacks; `progress` is told the share that is done.
///
/// # Errors
/// No records, records that say nothing, a model that cannot be solved.
pub fn diagnose(request: &Request, progress: &(dyn Fn(f64) + Sync)) -> Result<Diagnosis, DiagnoseError> {
    Ok(diagnosed(request, progress)?.diagnosis)
}

/// A diagnosis, with the chamber that it began in and the declared model's fit there.
pub(crate) struct Diagnosed<'a> {
    pub(crate) diagnosis: Diagnosis,
    chamber: Chamber<'a>,
    declared: Fit,
}

/// As [`diagnose`], for what is asked of the same records afterwards.
pub(crate) fn diagnosed<'a>(
    request: &Request<'a>,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Diagnosed<'a>, DiagnoseError> {
    let records = checked(request)?;
    progress(0.0);
    let given = request.records.len();
    let declared = Assumption::new(request.model.clone(), request.pattern.clone());
    let fitted: Vec<usize> = (0..given).collect();
    let (chamber, null) = Chamber::new(request.model, &records)?.with_shocks(&declared, &fitted)?;
    let candidates = candidate::candidates(request.model, &records);
    let question = Question {
        chamber: &chamber,
        model: request.model,
        pattern: request.pattern,
        candidates: &candidates,
        fitted,
        held_out: (given..records.len()).collect(),
        depth: MOST_MEMBERS,
    };
    let found = joint::ranked(&question, null.clone(), &|share| progress(0.4 * share))?;
    let (switched, found) = switched_film::in_turns(&question, &records, found)?;
    let switched = switched.unwrap_or_else(|| chamber.clone());
    progress(0.5);
    let question = Question { chamber: &switched, ..question };
    let again = looked_through_again(request, &records, &question, &found)?;
    let question = match &again {
        Some(chamber) => Question { chamber, ..question },
        None => question,
    };
    let found = if again.is_some() { joint::again(&question, found)? } else { joint::judged(&question, found)? };
    progress(0.6);
    let timed = match &again {
        Some(chamber) => chamber.clone(),
        None => in_time(question.chamber, &found)?,
    };
    let mut diagnosis = said(request, &question, &records, &timed, &found, &|share| progress(0.6 + 0.2 * share))?;
    // Where what is to be fitted shows nothing, the other records may; the former then confirm it.
    if let (Verdict::Adequate, Some(declared), false) =
        (diagnosis.verdict, found.declared(), request.holdout.is_empty())
    {
        let other = Question { fitted: question.held_out.clone(), held_out: question.fitted.clone(), ..question };
        let found = joint::search_if_it_promises(&other, &declared.fit, &|share| progress(0.8 + 0.2 * share))?;
        if let Some(found) = found {
            let timed = in_time(other.chamber, &found)?;
            let mut elsewhere = said(request, &other, &records, &timed, &found, &|_| ())?;
            if elsewhere.verdict != Verdict::Adequate {
                // Columns stay those of the records as they were given.
                elsewhere.ladder.iter_mut().for_each(Rung::exchange);
                diagnosis = elsewhere;
                diagnosis.cautions.insert(0, Caution::FittedToHoldout);
            }
        }
    }
    progress(1.0);
    Ok(Diagnosed { diagnosis, chamber, declared: null })
}

/// The chamber looked through by the best set: gross errors and kinks were those of the declared model. None where that is the best; if
/// it was found among the kinks of another, they are those that it has by what it was found to be there.
fn looked_through_again<'a>(
    request: &Request,
    records: &[&'a Record],
    question: &Question,
    found: &joint::Found,
) -> Result<Option<Chamber<'a>>, DiagnoseError> {
    let best = found.explanations.first().filter(|e| !e.members.is_empty() || found.is_elsewhere);
    let Some(best) = best else { return Ok(None) };
    let whole = Chamber::new(request.model, records)?.switched_like(question.chamber, Films::Same);
    Ok(Some(whole.with_timed_shocks_by(best.fit.clone(), &question.fitted)?))
}

/// The chamber with its kinks at the times that the likeliest set has them at.
fn in_time<'a>(chamber: &Chamber<'a>, found: &joint::Found) -> Result<Chamber<'a>, DiagnoseError> {
    let chamber = chamber.clone();
    Ok(match found.likeliest() {
        Some(fit) => chamber.with_timed_kinks(fit)?,
        None => chamber,
    })
}

/// What a search found, with formulas for what no listed effect explains; what is left of records is said by the `timed` chamber.
fn said(
    request: &Request,
    question: &Question,
    records: &[&Record],
    timed: &Chamber,
    found: &joint::Found,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Diagnosis, DiagnoseError> {
    let mut diagnosis = answer::answer(question, timed, found, records)?;
    let allowed = match request.terms {
        Terms::All => discover::Allowed::default(),
        Terms::Among(words) => discover::Allowed { words: words.to_vec() },
        Terms::None => return Ok(diagnosis),
    };
    let (discovered, elsewhere) = match discover::discover(question, found, &allowed, progress)? {
        Beyond::Nothing => return Ok(diagnosis),
        Beyond::Alike(alike) => {
            discover::share_with(question, found, &alike, &mut diagnosis);
            return Ok(diagnosis);
        }
        Beyond::Found(discovered, elsewhere) => (discovered, elsewhere),
    };
    let timed = elsewhere.as_ref().unwrap_or(timed);
    discover::amend(&Question { chamber: timed, ..question.clone() }, found, &discovered, &mut diagnosis)?;
    Ok(diagnosis)
}

impl From<ChamberError> for DiagnoseError {
    fn from(error: ChamberError) -> Self {
        match error {
            ChamberError::NoNoise { record } => Self::NoNoise { record },
            ChamberError::Unsolvable => Self::Unsolvable,
            other => Self::Chamber(other),
        }
    }
}
