//! Chamber, pack, sensor and gyro in one model with one likelihood.
//!
//! Readings **and** rates are measurements of one latent state; the gyro itself sees what the sensor is too slow or too
//! coarse for. Everything that is said about a record — how well a model does, which effect is missing, what the layers'
//! temperatures were, how much of the rate is noise — comes from the likelihood of this one system (`system` has its
//! equations, `prior` what is taken to be likely of a chamber).
//!
//! ```text
//! ln E = Σ_k −½ (v_k²/S_k + ln 2πS_k) + ln p(θ̂) + (p/2) ln 2π − ½ ln |I|             evidence at the maximum (Laplace)
//! g = Σ −v'v/S − S'/2S + S'v²/2S²,   I = Σ v'v'ᵀ/S + S'S'ᵀ/2S²                        Fisher scoring
//! ```
//!
//! # How to use it
//! 1. [`Chamber::new`] takes records: gross errors are left out and counted, fast rows are averaged to the pack's own time.
//! 2. An [`Assumption`] says what is assumed: a coil model with its effects, a pattern, and what else may be there (drift,
//!    cycle, further known inputs to the rate with unknown amplitudes).
//! 3. [`Chamber::fit`] maximises over the chamber's numbers and whatever of the effects is [`Free`]; the [`Fit`] has the
//!    evidence, each number with its error, and a smoothed course of every record: layers and air (`Fit::courses`).
//! 4. [`Chamber::held_out`] scores records that were not fitted with everything frozen; [`Chamber::noise`] tells white
//!    noise, wander and unresolved air apart; [`Chamber::prediction`] is the rate that readings alone, or all, imply.
//! 5. [`Chamber::score`] says what any further output of the rate would gain, cleared of all that was fitted, without a
//!    fit: one filter pass a column; [`Chamber::scorer`] keeps the gains for many of them, and [`Chamber::states`] has the
//!    courses that they may be made of. To keep one, give it to an assumption as an [`Input`] and fit again.
//!
//! Rows of the chamber are not always rows of the record ([`Chamber::times_s`], [`Chamber::span`]): several may be averaged.
//!
//! # Source
//! Durbin and Koopman, Time Series Analysis by State Space Methods (2012), chapters 4 and 7 (filter, smoother, score); Kass
//! and Raftery, J. Am. Stat. Assoc. 90 (1995) 773 (Laplace's evidence); Rao, Proc. Camb. Phil. Soc. 44 (1948) 50 (score test).

mod abreast;
mod adjustment;
mod airs;
mod arithmetic;
mod ascent;
mod backward;
mod causal;
mod coil_side;
mod course;
mod decoupled;
#[cfg(test)]
mod dense;
mod derivative;
mod discretise;
mod doubts;
mod elsewhere;
mod film;
mod film_step;
mod filter;
mod fit;
mod fitted;
mod foreseen;
mod gain;
mod grid;
mod kinked_rows;
mod kinks;
mod known;
mod layout;
mod learned;
mod long;
mod model_point;
mod noise;
mod parameter;
pub(crate) mod prior;
mod readings;
mod responses;
mod ripple;
mod rounding;
mod row;
mod score;
mod scorer;
mod series;
mod shocks;
mod shows;
mod solved;
mod sparse;
mod start;
mod states;
mod stationary;
mod switches;
mod system;

use thiserror::Error;

use crate::coil::CoilError;
use crate::pattern::Pattern;
use crate::rate::{CoilModel, RateError};
use crate::record::Record;
use crate::thermal::ThermalError;
use coil_side::Observed;
use series::{Origin, Series};
use solved::Solved;
use system::driven_by_air;

pub(crate) use adjustment::DifferenceVariance;
pub(crate) use airs::{Controllers, OwnAir};
pub(crate) use ascent::Effort;
pub(crate) use causal::{Causal, Surroundings};
pub(crate) use filter::Innovation;
pub(crate) use fit::Fit;
pub(crate) use fitted::{EffectEstimate, EffectEstimates};
pub(crate) use foreseen::{Hold, Refit};
pub(crate) use kinked_rows::Bend;
pub(crate) use known::Reference;
pub(crate) use learned::{Estimate, Learned};
pub(crate) use long::MOST_ROWS_FITTED;
pub(crate) use noise::{Noise, Remedy};
#[cfg(test)]
pub(crate) use parameter::Tails;
pub(crate) use parameter::{Free, Parameter, Place, Scale, StatedNumber, is_factor};
pub(crate) use prior::{BREAK_K2_PER_S2, BREAKS_PER_S, PRIORS, Quantity};
pub(crate) use readings::Told;
pub(crate) use score::Column;
pub(crate) use scorer::{Scored, Scorer};
pub(crate) use states::RowStates;
pub use switches::FilmSwitches;
pub(crate) use switches::Films;

/// What is assumed of coil, sensor and gyro; the numbers of chamber and noise are fitted with it.
#[derive(Debug, Clone)]
pub(crate) struct Assumption {
    pub(crate) model: CoilModel,
    pub(crate) pattern: Pattern,
    /// Wander beyond what a gyro of this noise should have.
    pub(crate) drift: bool,
    /// A cycle that nothing in the model makes.
    pub(crate) cycle: bool,
    pub(crate) inputs: Vec<Input>,
}

impl Assumption {
    pub(crate) fn new(model: CoilModel, pattern: Pattern) -> Self {
        Self { model, pattern, drift: false, cycle: false, inputs: Vec::new() }
    }
}

/// A known course that adds to the rate with an unknown amplitude.
///
/// # Shapes
/// One course a record of the chamber, with one entry a row of the chamber.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Input {
    pub(crate) name: String,
    pub(crate) rate_rad_per_s: Vec<Vec<f64>>,
    pub(crate) amplitude: f64,
    /// Prior standard deviation of the amplitude about zero; 0: the amplitude is known, and no fit moves it.
    pub(crate) deviation: f64,
    /// Where the course goes with numbers of the model.
    pub(crate) follows: Vec<Follow>,
}

/// How a course at unit amplitude moves with a parameter of one of the model's effects, to first order about where it was made.
///
/// # Shapes
/// As the input's own course; empty for records in which it is held.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Follow {
    pub(crate) effect: usize,
    pub(crate) parameter: usize,
    /// The parameter's value that the course was made with; SI.
    pub(crate) about: f64,
    /// Per unit of the parameter.
    pub(crate) slope_rad_per_s: Vec<Vec<f64>>,
}

impl Input {
    /// What it adds to a record's rates with a model's numbers; None where it says nothing of the record.
    pub(crate) fn added_rad_per_s(&self, model: &CoilModel, place: usize) -> Option<Vec<f64>> {
        let course = self.rate_rad_per_s.get(place)?;
        let mut added: Vec<f64> = course.iter().map(|c| self.amplitude * c).collect();
        for follow in &self.follows {
            let Some(slope) = follow.slope_rad_per_s.get(place).filter(|s| !s.is_empty()) else { continue };
            // A model without that effect has the course as it was made.
            let value = model.effects.get(follow.effect).and_then(|e| e.values().get(follow.parameter));
            let Some(value) = value else { continue };
            let moved = self.amplitude * (value - follow.about);
            added.iter_mut().zip(slope).for_each(|(a, s)| *a += moved * s);
        }
        Some(added)
    }
}

/// Records, ready to be explained.
#[derive(Debug, Clone)]
pub(crate) struct Chamber<'a> {
    observed: Vec<Observed<'a>>,
    modes: usize,
}

#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum ChamberError {
    #[error(transparent)]
    Thermal(#[from] ThermalError),
    #[error(transparent)]
    Rate(#[from] RateError),
    #[error(transparent)]
    Coil(#[from] CoilError),
    #[error("{record}: the temperature moves by {range_k:.3} K only: the record says nothing about the model")]
    Constant { record: String, range_k: f64 },
    #[error(
        "{record}: averaged over {row_s} s, as the pack and the record's length ask for, {found} rows are left, expected at least {LEAST_ROWS}: the record is too short, or its rows come in bursts with gaps between"
    )]
    TooFew { record: String, row_s: f64, found: usize },
    #[error("{record}: the rate has no noise at all: is this a measurement?")]
    NoNoise { record: String },
    #[error("the model's likelihood cannot be computed for these records")]
    Unsolvable,
}

/// Fewer rows hold less than there is to find: the film, the lag, the noises and the air's course.
const LEAST_ROWS: usize = 8;
/// Modes of the pack that are states: those that are slower than so many per row, and one for all others, within these counts. With 8 in
/// the place of 30 what was left out showed in coils of 48 and 64 layers whose air steps: a coil in which nothing was missing seemed
/// to conduct 0.15 % better; with 60 nothing changes any more. Without the one for all others, turbulence showed the same in a
/// coil whose winding cancels its slow modes.
const MODES_PER_ROW: f64 = 30.0;
const FEWEST_MODES: usize = 4;
const MOST_MODES: usize = 9;
const HALF_SPACE_MODES: usize = 8;

/// States that a pack takes in rows of this length: its slow modes, and one for all others.
fn modes_of_pack(driven: &crate::thermal::HeatPath, row_s: f64) -> Result<usize, ThermalError> {
    let pack = crate::thermal::pack::Pack::new(driven)?;
    let slow = pack.decays_per_s().iter().filter(|l| *l * row_s < MODES_PER_ROW).count();
    Ok((slow + 1).clamp(FEWEST_MODES, MOST_MODES))
}

/// The film and the modes that say how fine rows must be are those of a usual chamber [W/(m²K)].
const USUAL_FILM_W_PER_M2_K: f64 = 25.0;

impl<'a> Chamber<'a> {
    /// `model` says how rates are averaged and how fast the pack is; effects may be added later.
    ///
    /// # Errors
    /// A model that cannot be solved; records whose temperature does not change or whose rate has no noise.
    pub(crate) fn new(model: &CoilModel, records: &[&'a Record]) -> Result<Self, ChamberError> {
        let chamber = Self::made(model, records, Origin::Measured)?;
        chamber.checked()?;
        Ok(chamber)
    }

    /// Rates without noise are no measurements.
    fn checked(&self) -> Result<(), ChamberError> {
        match self.observed.iter().find(|o| !(o.series.noise_floor_rad_per_s > 0.0)) {
            Some(silent) => Err(ChamberError::NoNoise { record: silent.record.name().to_owned() }),
            None => Ok(()),
        }
    }

    fn made(model: &CoilModel, records: &[&'a Record], origin: Origin) -> Result<Self, ChamberError> {
        let path = model.heat_path()?;
        let (driven, _) = driven_by_air(&path, USUAL_FILM_W_PER_M2_K);
        let thickness_m = path.shape.layers as f64 * path.shape.radial_pitch_m;
        let pack_s = (thickness_m / std::f64::consts::PI).powi(2) / path.material.diffusivity_m2_per_s();
        let solved = Solved::default();
        let mut observed: Vec<Observed> = Vec::with_capacity(records.len());
        for &record in records {
            let (low, high) = record
                .temperature_k()
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
            if !(high > low) {
                return Err(ChamberError::Constant { record: record.name().to_owned(), range_k: high - low });
            }
            let series = Series::new(record, model.rate_mean_s, pack_s, origin);
            if series.rows.len() < LEAST_ROWS {
                let (row_s, found) = (series.averaged as f64 * record.interval_s(), series.rows.len());
                return Err(ChamberError::TooFew { record: record.name().to_owned(), row_s, found });
            }
            let mean_k = series.mean_k();
            observed.push(Observed::new(record, series, mean_k, solved.clone()));
        }
        let modes = if path.extent == crate::thermal::Extent::HalfSpace {
            HALF_SPACE_MODES
        } else {
            let row_s = observed.iter().map(|o| o.series.shortest_s()).fold(f64::INFINITY, f64::min);
            modes_of_pack(&driven, row_s)?
        };
        Ok(Self { observed, modes })
    }

    pub(crate) fn records(&self) -> usize {
        self.observed.len()
    }

    pub(crate) fn record(&self, record: usize) -> &'a Record {
        self.observed[record].record
    }

    /// Ends of the chamber's rows of one record.
    pub(crate) fn times_s(&self, record: usize) -> &[f64] {
        &self.observed[record].series.times_s
    }

    /// Whether a record's air is that of a controlled chamber.
    pub(crate) fn is_controlled(&self, record: usize) -> bool {
        self.observed[record].series.controlled
    }

    /// The first and last of a record's rows that are in one of the chamber's.
    pub(crate) fn span(&self, record: usize, row: usize) -> (usize, usize) {
        self.observed[record].series.spans[row]
    }

    /// What courses count their temperatures from.
    pub(crate) fn reference_k(&self, record: usize) -> f64 {
        self.observed[record].series.reference_k
    }

    /// Readings and rates left out as gross errors.
    pub(crate) fn spikes(&self, record: usize) -> usize {
        self.observed[record].series.spikes
    }

    /// Rows of a record in one row of the chamber.
    pub(crate) fn averaged(&self, record: usize) -> usize {
        self.observed[record].series.averaged
    }

    /// The sensor's resolution; 0 where readings lie on no grid.
    pub(crate) fn resolution_k(&self, record: usize) -> f64 {
        self.observed[record].series.resolution_k
    }

    /// The record's noise by windows too short for anything else.
    pub(crate) fn noise_floor_rad_per_s(&self, record: usize) -> f64 {
        self.observed[record].series.noise_floor_rad_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::dense::tests::model;
    use super::*;

    #[test]
    fn an_input_adds_its_course_to_a_model_without_the_effect_that_it_follows() {
        let follow = Follow { effect: 0, parameter: 0, about: 3.0, slope_rad_per_s: vec![vec![1.0, 1.0]] };
        let input = Input {
            name: "t".to_owned(),
            rate_rad_per_s: vec![vec![1.0, 2.0]],
            amplitude: 0.5,
            deviation: 1.0,
            follows: vec![follow],
        };
        assert_eq!(input.added_rad_per_s(&model(Vec::new()), 0), Some(vec![0.5, 1.0]));
        assert_eq!(input.added_rad_per_s(&model(Vec::new()), 1), None);
    }
}
