//! What a search makes small.

use thiserror::Error;

use super::columns::Norm;
use super::guaranteed::{GuaranteedError, UnitStep};
use super::samples::SampleMatrix;
use super::worst_case::{SearchError, SolvedProfiles};
use crate::rate::{CoilModel, RateModel};

#[derive(Debug, Error, Clone, PartialEq)]
pub enum ObjectiveError {
    #[error(transparent)]
    Search(#[from] SearchError),
    #[error(transparent)]
    Guaranteed(#[from] GuaranteedError),
}

/// What a search makes small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Objective {
    /// The largest |Ω| over all profiles and times.
    WorstRate,
    /// The largest |Δφ|: a fixed multiple of the rate for a given coil, so the same patterns are best.
    WorstPhase,
    /// √(mean Ω²) over time and profiles.
    RootMeanSquare,
    /// The largest |Ω| over all profiles of any length within the largest rate.
    GuaranteedRate,
}

impl Objective {
    pub const ALL: [Objective; 4] =
        [Objective::WorstRate, Objective::WorstPhase, Objective::RootMeanSquare, Objective::GuaranteedRate];

    /// As written on the command line and in campaign files.
    pub fn key(self) -> &'static str {
        match self {
            Objective::WorstRate => "worst-rate",
            Objective::WorstPhase => "worst-phase",
            Objective::RootMeanSquare => "rms",
            Objective::GuaranteedRate => "guaranteed-rate",
        }
    }

    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|o| o.key() == key)
    }

    pub fn norm(self) -> Norm {
        match self {
            Objective::WorstRate | Objective::WorstPhase => Norm::Largest,
            Objective::RootMeanSquare => Norm::RootMeanSquare,
            Objective::GuaranteedRate => Norm::Sum,
        }
    }

    /// The samples whose norm is the objective, in rad/s.
    ///
    /// # Errors
    /// Rates that are not finite; the guaranteed worst case of a model that has none.
    pub fn compile(
        self,
        model: &CoilModel,
        solved: &SolvedProfiles,
        max_rate_k_per_s: f64,
    ) -> Result<SampleMatrix, ObjectiveError> {
        if self == Objective::GuaranteedRate {
            return Ok(UnitStep::new(model, max_rate_k_per_s)?.samples(model)?);
        }
        let (matrix, origins) = SampleMatrix::of_profiles(model, solved)?;
        Ok(match self {
            Objective::WorstRate | Objective::WorstPhase | Objective::GuaranteedRate => matrix,
            Objective::RootMeanSquare => {
                let samples = origins.len() as f64;
                let factors: Vec<f64> = time_shares(solved).iter().map(|share| (share * samples).sqrt()).collect();
                matrix.scaled(&factors)
            }
        })
    }
}

/// √(mean Ω²) over all profiles' time, by the reference.
pub fn rms_rad_per_s(rate_model: &RateModel, solved: &SolvedProfiles) -> f64 {
    let series = solved.profiles().iter().flat_map(|p| rate_model.series_rad_per_s(&p.history));
    series.zip(time_shares(solved)).map(|(rate, share)| share * rate * rate).sum::<f64>().sqrt()
}

/// The share of each sample in an integral over all profiles' time by the trapezium rule; they add up to one.
fn time_shares(solved: &SolvedProfiles) -> Vec<f64> {
    let mut shares = Vec::new();
    let whole_s: f64 = solved.profiles().iter().map(|p| p.profile.duration_s()).sum();
    for piece in solved.profiles().iter().flat_map(|p| &p.pieces) {
        let at = |i: usize| piece[i].time_s;
        let last = piece.len() - 1;
        shares.extend((0..=last).map(|i| 0.5 * (at((i + 1).min(last)) - at(i.saturating_sub(1))) / whole_s));
    }
    shares
}
