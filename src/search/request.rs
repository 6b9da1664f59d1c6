//! What is asked of a search, who watches it, and why it cannot run.

use std::ops::ControlFlow;

use thiserror::Error;

use super::anneal::rounds::{Plan, Rounds, State};
use super::cost::guaranteed::UnitStep;
use super::cost::objective::Objective;
use super::cost::tolerance::ToleranceSpec;
use super::cost::worst_case::{SearchError, SolvedProfiles};
use super::end_turns::EndChoice;
use super::evaluator::{Evaluator, JudgeError};
use super::proof::Progress;
use crate::pattern::Pattern;
use crate::pattern::windability::WindabilityClass;
use crate::profile::ProfileSpec;
use crate::rate::CoilModel;

/// What is to be searched.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The coil.
    pub model: &'a CoilModel,
    /// The temperature profiles that windings are judged on.
    pub profiles: &'a ProfileSpec,
    /// How much what is built spreads; needed for the objective P95.
    pub tolerance: Option<&'a ToleranceSpec>,
    /// What is made small.
    pub objective: Objective,
    /// What the winding shop can wind.
    pub class: WindabilityClass,
    /// How it is searched.
    pub plan: Plan,
    /// Where an interrupted search of the same request was.
    pub saved: Option<State>,
    /// A pattern to compare with, by its name.
    pub former: Option<(String, Pattern)>,
    /// Whether to prove that the best pattern is the best of its class, for as long as the observer lets it.
    pub prove: bool,
    /// Whether to judge what was found on unseen profiles and say what to wind.
    pub recommend: bool,
    /// Whether worst admissible profiles join the searched ones ([`super::cutting`]).
    pub cuts: bool,
    /// Models that may be the true one, all as likely; empty: the model is known.
    pub uncertain: &'a [CoilModel],
    /// Turns at the ends of the fibre that may be chosen beside the order of whole layers.
    pub ends: EndChoice,
}

/// Why an observer ends a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Halt {
    /// Its time is over.
    Clock,
    /// Someone asked for it.
    Signal,
}

/// Told how a search goes; the only one who knows the time. Every method's default is to let it go on.
pub trait Observer: Sync {
    /// Before the first slice.
    fn begun(&mut self, _search: &dyn Rounds) {}

    /// After each slice.
    fn advanced(&mut self, _search: &dyn Rounds) -> ControlFlow<Halt> {
        ControlFlow::Continue(())
    }

    /// After the last slice; the state is then what a later run goes on from.
    fn ended(&mut self, _search: &dyn Rounds) {}

    /// Whether work besides the search's own slices may go on.
    fn goes_on(&self) -> bool {
        true
    }

    /// From time to time during the proof.
    fn proving(&self, _at: Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Lets everything go on to its end.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl Observer for Unobserved {}

/// Why a search cannot run.
#[derive(Debug, Error, Clone, PartialEq)]
#[allow(missing_docs, reason = "its messages say what each means")]
#[non_exhaustive]
pub enum RunError {
    #[error(transparent)]
    Judge(#[from] JudgeError),
    #[error("the saved state is of another search: begin anew")]
    Resume,
}

impl From<SearchError> for RunError {
    fn from(error: SearchError) -> Self {
        Self::Judge(error.into())
    }
}

impl<'a> Request<'a> {
    /// As the program searches where nothing else is asked for: the smallest worst rate that needs no captive reel, by the usual effort,
    /// with the seed 1; nothing proved, nothing judged on unseen profiles.
    pub fn new(model: &'a CoilModel, profiles: &'a ProfileSpec) -> Self {
        Self {
            model,
            profiles,
            tolerance: None,
            objective: Objective::WorstRate,
            class: WindabilityClass::Standard,
            plan: Plan::usual(model.coil.layers(), 1),
            saved: None,
            former: None,
            prove: false,
            recommend: false,
            cuts: false,
            uncertain: &[],
            ends: EndChoice::default(),
        }
    }

    /// What the request's patterns are judged by.
    pub fn evaluator(&self, solved: &'a SolvedProfiles, unit_step: Option<&'a UnitStep>) -> Evaluator<'a> {
        let Request { model, profiles, tolerance, objective, .. } = *self;
        Evaluator { model, solved, objective, unit_step, profiles, tolerance }
    }
}
