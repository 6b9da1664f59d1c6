//! What a search makes small.

use crate::pattern::Pattern;
use crate::rate::{CoilModel, RateModel};
use crate::search::cost::columns::Norm;
use crate::search::cost::pointing::{POINTING_S, pointing_samples};
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::worst_case::{SearchError, SolvedProfiles};
use crate::units::deg_per_h_from_rad_per_s;

/// Digits after the point of a figure that is not small.
const USUAL_DECIMALS: usize = 4;

/// What a search makes small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Objective {
    /// The largest |Ω| over all profiles and times.
    WorstRate,
    /// The largest |Δφ|: a fixed multiple of the rate for a given coil, so the same patterns are best.
    WorstPhase,
    /// √(mean Ω²) over time and profiles.
    RootMeanSquare,
    /// The largest |Ω| over all profiles of any length within the largest rate.
    GuaranteedRate,
    /// The 95 % quantile of the worst case over coils built with the stated tolerances.
    P95,
    /// The largest |∫ Ω dt| over all profiles and times. Its value is that of the rate that makes it in one hour, so that
    /// what is a degree an hour of the others is a degree here.
    Pointing,
}

impl Objective {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Objective; 6] = [
        Objective::WorstRate,
        Objective::WorstPhase,
        Objective::RootMeanSquare,
        Objective::GuaranteedRate,
        Objective::P95,
        Objective::Pointing,
    ];

    /// As written on the command line and in files.
    pub fn key(self) -> &'static str {
        match self {
            Objective::WorstRate => "worst-rate",
            Objective::WorstPhase => "worst-phase",
            Objective::RootMeanSquare => "rms",
            Objective::GuaranteedRate => "guaranteed-rate",
            Objective::P95 => "p95",
            Objective::Pointing => "pointing",
        }
    }

    /// `guaranteed` is short for `guaranteed-rate`.
    pub fn from_key(key: &str) -> Option<Self> {
        let key = if key == "guaranteed" { Objective::GuaranteedRate.key() } else { key };
        Self::ALL.into_iter().find(|o| o.key() == key)
    }

    /// In words.
    pub(crate) fn title(self) -> &'static str {
        match self {
            Objective::WorstRate => "worst rate error",
            Objective::WorstPhase => "worst phase error",
            Objective::RootMeanSquare => "rms rate error",
            Objective::GuaranteedRate => "guaranteed worst rate error",
            Objective::P95 => "95 % quantile of the worst rate error over built coils",
            Objective::Pointing => "worst pointing error",
        }
    }

    /// Of its value as it is shown.
    pub(crate) fn unit(self) -> &'static str {
        if self == Objective::Pointing { "°" } else { "°/h" }
    }

    /// A value in its unit, with enough digits to be told from its like: pointing errors are small numbers of degrees, and a
    /// search makes the rms smaller than any largest value.
    pub(crate) fn shown(self, value_rad_per_s: f64) -> String {
        if matches!(self, Objective::Pointing | Objective::RootMeanSquare) {
            return self.shown_finely(value_rad_per_s);
        }
        format!("{:.USUAL_DECIMALS$} {}", deg_per_h_from_rad_per_s(value_rad_per_s), self.unit())
    }

    /// A value in its unit with three significant digits at least.
    pub(crate) fn shown_finely(self, value_rad_per_s: f64) -> String {
        const MOST: usize = 12;
        let value = deg_per_h_from_rad_per_s(value_rad_per_s);
        let mut decimals = USUAL_DECIMALS;
        let mut scaled = value.abs() * 1e4;
        while scaled > 0.0 && scaled < 100.0 && decimals < MOST {
            decimals += 1;
            scaled *= 10.0;
        }
        format!("{value:.decimals$} {}", self.unit())
    }

    /// By how much a pattern's rate error differs between two models over the profiles: at most, or its rms where that is
    /// the objective. Their objectives differ by no more.
    ///
    /// # Errors
    /// A pattern of another layer count.
    pub(crate) fn change_rad_per_s(
        self,
        models: [&CoilModel; 2],
        solved: &SolvedProfiles,
        pattern: &Pattern,
    ) -> Result<f64, SearchError> {
        let of = |model: &CoilModel| Ok(series_rad_per_s(&RateModel::new(model, pattern, &[])?, solved));
        let [one, other]: [Result<Vec<f64>, SearchError>; 2] = models.map(of);
        let change: Vec<f64> = one?.iter().zip(other?).map(|(a, b)| a - b).collect();
        Ok(match self {
            Objective::RootMeanSquare => rms_of(&change, solved),
            _ => change.iter().fold(0.0, |most: f64, v| v.abs().max(most)),
        })
    }

    /// How the samples of a plain search make one cost; a search over built coils has its own.
    pub fn norm(self) -> Norm {
        match self {
            Objective::WorstRate | Objective::WorstPhase | Objective::P95 | Objective::Pointing => Norm::Largest,
            Objective::RootMeanSquare => Norm::RootMeanSquare,
            Objective::GuaranteedRate => Norm::Sum,
        }
    }

    /// The samples of the declared profiles whose norm is the objective, in rad/s; for the rms no more of them than
    /// columns.
    ///
    /// # Errors
    /// Rates that are not finite.
    pub fn of_profiles(self, model: &CoilModel, solved: &SolvedProfiles) -> Result<SampleMatrix, SearchError> {
        if self == Objective::Pointing {
            let matrix = pointing_samples(model, solved)?;
            let per_hour = vec![1.0 / POINTING_S; matrix.columns.samples()];
            return Ok(matrix.scaled(&per_hour));
        }
        let (matrix, origins) = SampleMatrix::of_profiles(model, solved)?;
        if self != Objective::RootMeanSquare {
            return Ok(matrix);
        }
        let samples = origins.len() as f64;
        let factors: Vec<f64> = time_shares(solved).iter().map(|share| (share * samples).sqrt()).collect();
        Ok(matrix.scaled(&factors).of_same_mean_square())
    }
}

/// √(mean Ω²) over all profiles' time, by the reference.
pub(crate) fn rms_rad_per_s(rate_model: &RateModel, solved: &SolvedProfiles) -> f64 {
    rms_of(&series_rad_per_s(rate_model, solved), solved)
}

/// Over all profiles, one after the other.
fn series_rad_per_s(rate_model: &RateModel, solved: &SolvedProfiles) -> Vec<f64> {
    solved.profiles().iter().flat_map(|p| rate_model.series_rad_per_s(&p.history)).collect()
}

fn rms_of(series_rad_per_s: &[f64], solved: &SolvedProfiles) -> f64 {
    let weighed = series_rad_per_s.iter().zip(time_shares(solved)).map(|(rate, share)| share * rate * rate);
    weighed.sum::<f64>().sqrt()
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
