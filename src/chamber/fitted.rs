//! What a fit says: its numbers with their errors, and what it is worth beside other fits.

use nalgebra::DMatrix;

use super::fit::Fit;
use super::known::Reference;
use super::parameter::{Parameter, Place, Scale};
use super::prior::Quantity;

/// A parameter of an effect that a fit moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EffectEstimate {
    /// Place among the fitted model's effects, and among that effect's parameters.
    pub(crate) effect: usize,
    pub(crate) parameter: usize,
    /// Whether the logarithm of the value is what is normal.
    pub(crate) is_logarithmic: bool,
    /// The value, or its logarithm; SI.
    pub(crate) coordinate: f64,
}

/// The parameters of effects that a fit moved, and the joint covariance of their coordinates, whatever the chamber was.
///
/// # Shapes
/// `covariance` is row-major, one row an estimate.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct EffectEstimates {
    pub(crate) of: Vec<EffectEstimate>,
    pub(crate) covariance: Vec<f64>,
}

impl Fit {
    /// What the records say of the effects' parameters together; empty where they determine nothing.
    pub(crate) fn effect_estimates(&self) -> EffectEstimates {
        let places: Vec<(usize, EffectEstimate)> = self
            .parameters
            .iter()
            .enumerate()
            .filter_map(|(i, p)| match p.place {
                Place::Effect { effect, parameter } => {
                    let is_logarithmic = p.scale == Scale::Logarithm;
                    Some((i, EffectEstimate { effect, parameter, is_logarithmic, coordinate: self.coordinates[i] }))
                }
                _ => None,
            })
            .collect();
        let Some(factor) = self.information.clone().cholesky().filter(|_| !places.is_empty()) else {
            return EffectEstimates::default();
        };
        let inverse = factor.inverse();
        let covariance = places.iter().flat_map(|&(i, _)| places.iter().map(move |&(k, _)| (i, k)));
        EffectEstimates {
            covariance: covariance.map(|at| inverse[at]).collect(),
            of: places.iter().map(|&(_, estimate)| estimate).collect(),
        }
    }

    /// The parameter's value and its standard error, both in SI; that of a logarithm is relative.
    pub(crate) fn value(&self, place: Place) -> Option<(f64, f64)> {
        let at = self.parameters.iter().position(|p| p.place == place)?;
        let value = self.parameters[at].value(self.coordinates[at]);
        let error = match self.parameters[at].scale {
            Scale::Logarithm => value * self.standard_errors[at],
            Scale::Linear => self.standard_errors[at],
        };
        Some((value, error))
    }

    /// A number of the chamber, of one of its records.
    pub(crate) fn number(&self, quantity: Quantity, record: usize) -> f64 {
        self.numbers[record].get(quantity)
    }

    /// The smoothed course of a fitted record.
    pub(crate) fn course(&self, record: usize) -> Option<&Reference> {
        self.courses.get(record)?.as_ref()
    }

    /// Begins again with a gyro whose wander is the prior's and whose white noise makes up for it.
    pub(crate) fn calm(&mut self, records: &[usize]) {
        self.is_full = false;
        for &r in records {
            let numbers = &mut self.numbers[r];
            let white = numbers.get(Quantity::RateNoise);
            let wander = white * numbers.get(Quantity::WanderShare);
            numbers.set(Quantity::RateNoise, white.hypot(wander));
            numbers.set(Quantity::WanderShare, Quantity::WanderShare.prior().median);
            numbers.set(Quantity::WanderTime, Quantity::WanderTime.prior().median);
        }
    }

    /// Begins where another fit of these records ended, with what was known there; what is assumed of the coil stays.
    pub(crate) fn begin_beside(&mut self, other: &Fit) {
        self.is_full = false;
        self.known_derivatives.clone_from(&other.known_derivatives);
        self.days.clone_from(&other.days);
    }

    /// For a fit in another chamber to begin with: the days of records that are held out were days of this one. From them an ascent may end
    /// on a maximum that lies hundreds below the one where the other chamber was looked through.
    pub(crate) fn to_another_chamber(&self) -> Fit {
        Fit { days: std::sync::Arc::default(), ..self.clone() }
    }

    /// Another value of a number of the chamber, for a fit to begin with.
    pub(crate) fn set_number(&mut self, quantity: Quantity, value: f64) {
        self.is_full = false;
        self.numbers.iter_mut().for_each(|n| n.set(quantity, value));
    }
}

impl Fit {
    /// Log evidence with as much said beforehand of an effect's parameters as one row says: what the description of an
    /// effect holds likely of its size does not decide between two that do the same.
    ///
    /// ```text
    /// ln E = ln L + ln p(chamber) − Σ_e c_e + (c/2) ln 2π − ½ ln |I_cc| − (e/2) ln n
    /// ```
    ///
    /// c_e: what an effect's prior falls by from its mean ([`Parameter::cost`]); c, e: numbers of the chamber and of effects; n: `rows`.
    pub(crate) fn merit(&self, rows: usize) -> f64 {
        let effects = self.parameters.iter().zip(&self.coordinates).filter(|(p, _)| !p.is_of_chamber());
        let cost = |p: &Parameter, x: f64| p.cost(x) + 0.5 * (rows as f64).ln();
        self.merit_of_chamber() - effects.map(|(p, &x)| cost(p, x)).sum::<f64>()
    }

    /// As [`Fit::merit`], without what parameters of effects cost.
    pub(crate) fn merit_of_chamber(&self) -> f64 {
        let of_chamber: Vec<usize> =
            (0..self.parameters.len()).filter(|&i| self.parameters[i].is_of_chamber()).collect();
        let count = of_chamber.len();
        let block = DMatrix::from_fn(count, count, |i, k| self.information[(of_chamber[i], of_chamber[k])]);
        let Some(factor) = block.cholesky() else { return f64::NEG_INFINITY };
        let log_determinant = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let log_prior: f64 = of_chamber.iter().map(|&i| self.parameters[i].log_prior(self.coordinates[i])).sum();
        self.log_likelihood + log_prior + 0.5 * count as f64 * std::f64::consts::TAU.ln() - 0.5 * log_determinant
    }

    /// Whether it was made with [`super::Effort::FULL`]: the same again from there gains less than that effort's tolerance, unless the
    /// ascent ended at its last iteration.
    pub(crate) fn is_full(&self) -> bool {
        self.is_full
    }

    /// Logarithm of likelihood times prior.
    pub(crate) fn posterior(&self) -> f64 {
        self.log_likelihood + self.log_prior
    }
}
