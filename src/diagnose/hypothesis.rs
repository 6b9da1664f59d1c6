//! Sets of effects, fitted together; and how well small changes of a set would do.

use rayon::prelude::*;

use super::candidate::Candidate;
use super::evidence::{Evidence, Role, dot, sum_of_squares};
use crate::effect::Acts;
use crate::fit::{Effort, Fit, Parameter, least_squares};
use crate::numeric::span::Span;
use crate::rate::CoilModel;

/// A candidate with values for its parameters.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Member {
    pub candidate: usize,
    /// SI, all parameters.
    pub values: Vec<f64>,
}

/// A set of effects that was fitted to the records.
#[derive(Debug, Clone)]
pub(super) struct Hypothesis {
    pub members: Vec<Member>,
    /// Of the whitened residuals, in units of the noise.
    pub chi_square: f64,
    /// χ² of the records that were held out, only their offsets being fitted; 0 without any.
    pub unseen: f64,
    pub parameters: usize,
    pub residuals: Vec<f64>,
    pub fit: Option<Fit>,
}

/// How a candidate's response, at one of its starts, would change the residuals of a hypothesis.
pub(super) struct Response {
    pub member: Member,
    pub column: Vec<f64>,
    square: f64,
    /// With the residuals.
    along: f64,
}

/// Responses beside a hypothesis.
pub(super) struct Responses {
    pub list: Vec<Response>,
    /// χ² that the hypothesis's own parameters would leave.
    pub chi_square: f64,
}

/// Everything that a fit needs.
pub(super) struct Trial<'a> {
    pub evidence: &'a Evidence<'a>,
    pub model: &'a CoilModel,
    pub candidates: &'a [Candidate],
}

/// What an effect costs besides its parameters: it was picked from some thirty.
const EFFECT_COST: f64 = 6.0;

impl Hypothesis {
    /// χ² of all records, whether they were fitted or not.
    pub fn total(&self) -> f64 {
        self.chi_square + self.unseen
    }

    /// Bayesian information criterion with a price for having searched; χ² in units of `variance`. What was held out counts
    /// too: sets that the fitted records do not tell apart often predict others differently.
    pub fn merit(&self, rows: usize, variance: f64) -> f64 {
        self.total() / variance + self.parameters as f64 * (rows as f64).ln() + EFFECT_COST * self.members.len() as f64
    }
}

impl Trial<'_> {
    /// The declared model with members added.
    pub fn model_of(&self, members: &[Member]) -> Option<CoilModel> {
        let mut model = self.model.clone();
        for member in members {
            let effect = self.candidates[member.candidate].effect.with_values(member.values.clone()).ok()?;
            model.effects.push(effect);
        }
        Some(model)
    }

    /// Whether a candidate may join members: no effect twice.
    pub fn may_join(&self, candidate: usize, members: &[Member]) -> bool {
        let kind = self.candidates[candidate].kind();
        members.iter().all(|m| self.candidates[m.candidate].kind() != kind)
    }

    /// The fitted values of members that move heat: the effect's place in the model with them, and the parameter's in it.
    pub fn heat_parameters(&self, members: &[Member]) -> Vec<(usize, usize)> {
        let declared = self.model.effects.len();
        let moving = members.iter().enumerate().filter(|(_, m)| self.candidates[m.candidate].moves_heat());
        moving.flat_map(|(at, m)| self.candidates[m.candidate].free.iter().map(move |&i| (declared + at, i))).collect()
    }

    fn residuals(&self, members: &[Member]) -> Option<Vec<f64>> {
        self.evidence.residuals(&self.model_of(members)?, Role::Fit)
    }

    /// χ² of the records that were held out.
    fn unseen(&self, members: &[Member]) -> Option<f64> {
        Some(sum_of_squares(&self.evidence.residuals(&self.model_of(members)?, Role::Holdout)?))
    }

    /// A set at the values that its members have.
    pub fn at(&self, members: &[Member]) -> Option<Hypothesis> {
        let residuals = self.residuals(members)?;
        let parameters = members.iter().map(|m| self.candidates[m.candidate].free.len()).sum();
        Some(Hypothesis {
            members: members.to_vec(),
            chi_square: sum_of_squares(&residuals),
            unseen: self.unseen(members)?,
            parameters,
            residuals,
            fit: None,
        })
    }

    /// Fits the free parameters of all members together, from the values that they have.
    pub fn fit(&self, members: &[Member], effort: Effort) -> Option<Hypothesis> {
        let parameters: Vec<Parameter> = members
            .iter()
            .flat_map(|member| {
                let candidate = &self.candidates[member.candidate];
                let declared = candidate.effect.parameters();
                candidate.free.iter().map(move |&i| {
                    let start = member.values[i].clamp(declared[i].lower, declared[i].upper);
                    Parameter::bounded(start, declared[i].lower, declared[i].upper)
                })
            })
            .collect();
        if parameters.is_empty() {
            return self.at(members);
        }
        let with = |p: &[f64]| -> Vec<Member> {
            let mut values = p.iter();
            members
                .iter()
                .map(|member| {
                    let mut member = member.clone();
                    for &i in &self.candidates[member.candidate].free {
                        if let Some(value) = values.next() {
                            member.values[i] = *value;
                        }
                    }
                    member
                })
                .collect()
        };
        let mut fit = least_squares(&parameters, |p| self.residuals(&with(p)), effort).ok()?;
        let residuals = std::mem::take(&mut fit.residuals);
        let members = with(&fit.parameters);
        Some(Hypothesis {
            unseen: self.unseen(&members)?,
            members,
            chi_square: fit.sum_of_squares,
            parameters: parameters.len(),
            residuals,
            fit: Some(fit),
        })
    }

    /// ∂residuals/∂ of every free parameter, in units of the parameter's size.
    pub fn derivatives(&self, hypothesis: &Hypothesis) -> Option<Vec<Vec<f64>>> {
        let mut columns = Vec::new();
        for (place, member) in hypothesis.members.iter().enumerate() {
            let candidate = &self.candidates[member.candidate];
            let declared = candidate.effect.parameters();
            for &i in &candidate.free {
                let size = if member.values[i] != 0.0 { member.values[i].abs() } else { candidate.starts[0][i].abs() };
                let step = if member.values[i] + STEP * size > declared[i].upper { -STEP * size } else { STEP * size };
                let mut moved = hypothesis.members.clone();
                moved[place].values[i] += step;
                let residuals = self.residuals(&moved)?;
                columns.push(residuals.iter().zip(&hypothesis.residuals).map(|(a, b)| (a - b) / STEP).collect());
            }
        }
        Some(columns)
    }

    /// The responses of all candidates that may join a hypothesis, at each of their starts, and its residuals: of both only
    /// what its own parameters cannot make up for. An effect that resembles one of its members changes the residuals by
    /// little until both are fitted together.
    pub fn responses(&self, hypothesis: &Hypothesis) -> Responses {
        let own = Span::of(&self.derivatives(hypothesis).unwrap_or_default());
        let rest = own.complement(&hypothesis.residuals);
        let starts: Vec<Member> = (0..self.candidates.len())
            .filter(|&candidate| self.may_join(candidate, &hypothesis.members))
            .flat_map(|candidate| {
                self.candidates[candidate].starts.iter().map(move |v| Member { candidate, values: v.clone() })
            })
            .collect();
        // Without an effect that moves heat the candidates' fields are the same whatever else the hypothesis holds.
        let moved =
            |m: &Member| self.candidates[m.candidate].moves_heat() || self.candidates[m.candidate].moves_sensor();
        let often = !hypothesis.members.iter().any(moved);
        let list = starts
            .into_par_iter()
            .filter_map(|member| {
                let mut members = hypothesis.members.clone();
                members.push(member.clone());
                let model = self.model_of(&members)?;
                let moved = if often {
                    self.evidence.residuals_often(&model)?
                } else {
                    self.evidence.residuals(&model, Role::Fit)?
                };
                if moved.len() != hypothesis.residuals.len() {
                    return None;
                }
                let whole: Vec<f64> = hypothesis.residuals.iter().zip(&moved).map(|(a, b)| a - b).collect();
                let column = own.complement(&whole);
                let square = sum_of_squares(&column);
                let along = dot(&column, &rest);
                let least = LEAST_RESPONSE.max(LEAST_OWN_SHARE * sum_of_squares(&whole));
                (square > least && square.is_finite()).then_some(Response { member, column, square, along })
            })
            .collect();
        Responses { list, chi_square: sum_of_squares(&rest) }
    }

    /// Whether a member's response is proportional to its first free parameter.
    fn is_proportional(&self, member: &Member) -> bool {
        let candidate = &self.candidates[member.candidate];
        let Some(&first) = candidate.free.first() else { return false };
        let declared = &candidate.effect.parameters()[first];
        matches!(candidate.effect.spec().acts, Acts::Outside | Acts::Response | Acts::HeatPath)
            && declared.lower < 0.0
            && declared.upper > 0.0
    }

    /// A member scaled to where its response would fit best.
    pub fn scaled(&self, member: &Member, by: f64) -> Member {
        let mut scaled = member.clone();
        if self.is_proportional(member) {
            let first = self.candidates[member.candidate].free[0];
            let declared = &self.candidates[member.candidate].effect.parameters()[first];
            scaled.values[first] = (member.values[first] * by).clamp(0.9 * declared.lower, 0.9 * declared.upper);
        }
        scaled
    }
}

/// Responses below this sum of squares, at a start of visible size, are none.
const LEAST_RESPONSE: f64 = 1e-9;
/// Share of a response beyond which a hypothesis's own parameters cannot be told from it.
const LEAST_OWN_SHARE: f64 = 1e-6;
/// Step of a derivative, as a share of the parameter's size.
const STEP: f64 = 1e-4;

impl Response {
    /// By how much χ² falls with the best amplitude.
    pub fn gain(&self) -> f64 {
        self.along * self.along / self.square
    }

    pub fn amplitude(&self) -> f64 {
        self.along / self.square
    }
}

/// Two responses together: which, by how much χ² falls, and the amplitudes.
pub(super) struct Pair {
    pub first: usize,
    pub second: usize,
    pub gain: f64,
    pub amplitudes: (f64, f64),
}

/// The most promising pairs of different candidates, each at its best starts; at most `count`.
pub(super) fn pairs(trial: &Trial, responses: &[Response], count: usize) -> Vec<Pair> {
    let mut found: Vec<Pair> = (0..responses.len())
        .into_par_iter()
        .flat_map_iter(|first| {
            (first + 1..responses.len()).filter_map(move |second| {
                let (a, b) = (&responses[first], &responses[second]);
                if !trial.may_join(b.member.candidate, std::slice::from_ref(&a.member)) {
                    return None;
                }
                let cross = dot(&a.column, &b.column);
                let determinant = a.square * b.square - cross * cross;
                if determinant <= 1e-6 * a.square * b.square {
                    return None;
                }
                let x = (a.along * b.square - b.along * cross) / determinant;
                let y = (b.along * a.square - a.along * cross) / determinant;
                Some(Pair { first, second, gain: x * a.along + y * b.along, amplitudes: (x, y) })
            })
        })
        .collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut seen: Vec<(usize, usize)> = Vec::new();
    found.retain(|pair| {
        let key = (responses[pair.first].member.candidate, responses[pair.second].member.candidate);
        let new = seen.len() < count && !seen.contains(&key);
        if new {
            seen.push(key);
        }
        new
    });
    found
}
