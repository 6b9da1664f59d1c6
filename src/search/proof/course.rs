//! Goals that are the largest of something over all times: the rate error, and the pointing error that it adds up to.
//!
//! Both are linear in the layers' weights at every instant, so one proof serves both; what differs is what the weights are
//! multiplied by, and how a peak between samples is found.

use super::Task;
use crate::pattern::Pattern;
use crate::rate::{RateModel, WeightResponse};
use crate::search::cost::objective::Objective;
use crate::search::cost::pointing::{Pointing, PointingResponses};
use crate::search::cost::samples::{SampleMatrix, any_rate_model};
use crate::search::cost::worst_case::{SearchError, SolvedProfile};
use crate::thermal::Instant;

/// What is largest at some time, for any pattern.
#[derive(Debug)]
pub(super) enum Course {
    Rate(Box<RateModel>),
    Pointing(Box<PointingResponses>),
}

/// The same for one pattern.
pub(super) enum CourseOf {
    Rate(Box<RateModel>),
    Pointing(Box<Pointing>),
}

impl Course {
    /// # Errors
    /// Effects that leave a layer no turns; formulas that no search can run on.
    pub(super) fn of_rate(task: &Task) -> Result<Self, SearchError> {
        Ok(Self::Rate(Box::new(any_rate_model(task.model)?)))
    }

    /// # Errors
    /// As [`Course::of_rate`].
    pub(super) fn of_pointing(task: &Task) -> Result<Self, SearchError> {
        Ok(Self::Pointing(Box::new(PointingResponses::new(task.model)?)))
    }

    /// All samples of the solved profiles, and the profile of each.
    ///
    /// # Errors
    /// Rates that are not finite.
    pub(super) fn samples(&self, task: &Task) -> Result<(SampleMatrix, Vec<usize>), SearchError> {
        let objective = match self {
            Self::Rate(_) => Objective::WorstRate,
            Self::Pointing(_) => Objective::Pointing,
        };
        let profiles = task.solved.profiles().iter().enumerate();
        let profile_of = profiles.flat_map(|(index, solved)| vec![index; solved.history.len()]).collect();
        Ok((objective.of_profiles(task.model, task.solved)?, profile_of))
    }

    /// The sample at a time of a profile.
    pub(super) fn response_at(&self, solved: &SolvedProfile, time_s: f64) -> WeightResponse {
        match self {
            Self::Rate(model) => solved.response_at(model, Instant::after(time_s)),
            Self::Pointing(responses) => responses.at(solved, time_s),
        }
    }

    /// # Errors
    /// A pattern of another layer count.
    pub(super) fn of(&self, task: &Task, pattern: &Pattern) -> Result<CourseOf, SearchError> {
        Ok(match self {
            Self::Rate(_) => CourseOf::Rate(Box::new(RateModel::new(task.model, pattern, &[])?)),
            Self::Pointing(_) => CourseOf::Pointing(Box::new(Pointing::new(task.model, pattern)?)),
        })
    }
}

impl CourseOf {
    /// The largest over a profile, between samples too, with its sign; and the time of it.
    pub(super) fn worst(&self, solved: &SolvedProfile) -> (f64, f64) {
        match self {
            Self::Rate(model) => solved.worst(model),
            Self::Pointing(pointing) => pointing.worst(solved),
        }
    }
}
