//! Records made ready for many models: their boundaries, the whitening of their residuals, their noise.

use std::sync::{Arc, Mutex, OnceLock};

use rayon::prelude::*;

use super::DiagnoseError;
use super::anchor::{
    Anchor, BRACKET_SHARE, Bracket, LEAST_BRACKET_S, difference, heat_values, is_near, moves_sensor, way_of,
};
use super::conductivity::SlopeResponse;
use super::field::{DrivenAnchor, Solved};
use crate::boundary::{Boundary, Start};
use crate::pattern::Pattern;
use crate::predict::{estimate_boundary, noise_floor_rad_per_s, rates_rad_per_s, refine_boundary};
use crate::rate::CoilModel;
use crate::record::Record;

/// What a record is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Fit,
    Holdout,
}

/// All records, and how a model's residuals over them are weighed.
pub(super) struct Evidence<'a> {
    pub pattern: &'a Pattern,
    pub cases: Vec<Case>,
}

/// One record.
pub(super) struct Case {
    pub record: Record,
    pub role: Role,
    pub noise_rad_per_s: f64,
    pub(super) anchors: Vec<Anchor>,
    /// Anchors in threes, between which the pack is interpolated.
    pub(super) brackets: Vec<Bracket>,
    /// Solved when it is first asked for, under the first boundary: what a slope does to the pack hardly depends on how the
    /// sensor is connected to it. None where it cannot be solved.
    pub(super) slope_response: OnceLock<Option<SlopeResponse>>,
    /// Fields asked for lately.
    pub(super) recent: Mutex<Vec<Arc<Solved>>>,
    /// What the drives of anchors leave behind, those asked for lately.
    pub(super) driven: Mutex<Vec<Arc<DrivenAnchor>>>,
}

/// How a boundary's estimate begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Begin {
    Anew,
    /// With what was found for the nearest sensor.
    Nearby,
    /// … which is hardly another.
    Beside,
}

impl<'a> Evidence<'a> {
    /// Cleans the records and estimates their boundaries under the declared model.
    ///
    /// # Errors
    /// Records that say nothing about the model, models that cannot be solved.
    pub fn new(
        model: &CoilModel,
        pattern: &'a Pattern,
        records: &[Record],
        holdout: &[Record],
    ) -> Result<Self, DiagnoseError> {
        let with_role = |records: &[Record], role| records.iter().map(|r| Case::new(r, role)).collect::<Vec<_>>();
        let mut cases = with_role(records, Role::Fit);
        cases.extend(with_role(holdout, Role::Holdout));
        let mut evidence = Self { pattern, cases };
        evidence.anchor(model, Begin::Anew)?;
        for case in &evidence.cases {
            case.check()?;
        }
        Ok(evidence)
    }

    /// Estimates every record's boundary under a model; replaces an estimate for the same sensor and the same effects.
    ///
    /// # Errors
    /// As [`Evidence::new`].
    pub fn anchor(&mut self, model: &CoilModel, begin: Begin) -> Result<(), DiagnoseError> {
        let pattern = self.pattern;
        let anchors = self
            .cases
            .par_iter()
            .map(|case| case.estimate(model, pattern, begin))
            .collect::<Result<Vec<_>, DiagnoseError>>()?;
        for (case, anchor) in self.cases.iter_mut().zip(anchors) {
            case.take_in(anchor);
        }
        Ok(())
    }

    /// Whether boundaries were estimated for just the effects of a model and nearly their values.
    pub fn is_anchored(&self, model: &CoilModel) -> bool {
        let way = way_of(model);
        let near = |case: &Case| case.anchors.iter().any(|a| a.way == way && is_near(&a.values, model));
        self.cases.iter().all(near) && (!moves_sensor(model) || self.is_bracketed(model))
    }

    /// Estimates every record's boundary under a model and for a lag a little shorter and longer, so that between them
    /// the fitted lag moves the boundary as a new estimate would.
    ///
    /// # Errors
    /// As [`Evidence::new`].
    pub fn bracket(&mut self, model: &CoilModel, begin: Begin) -> Result<(), DiagnoseError> {
        let lag_s = model.sensor_lag_s();
        let half_width_s = (BRACKET_SHARE * lag_s).max(LEAST_BRACKET_S).min(0.5 * lag_s);
        self.anchor(model, begin)?;
        let pattern = self.pattern;
        let sides = self
            .cases
            .par_iter()
            .map(|case| {
                let beside = |lag_s: f64| case.estimate_at(model, pattern, Begin::Beside, lag_s);
                let sides = rayon::join(|| beside(lag_s - half_width_s), || beside(lag_s + half_width_s));
                Ok([sides.0?, sides.1?])
            })
            .collect::<Result<Vec<_>, DiagnoseError>>()?;
        for (case, sides) in self.cases.iter_mut().zip(sides) {
            let (location, way) = (sides[0].location, sides[0].way.clone());
            let new = Bracket { location, way, middle_s: lag_s, half_width_s };
            if let Some(place) = case.brackets.iter().position(|b| b.location == location && b.way == new.way) {
                let old = case.brackets.remove(place);
                let outdated = |a: &Anchor| {
                    a.location == location && a.way == old.way && a.lag_s != lag_s && old.lags_s().contains(&a.lag_s)
                };
                case.anchors.retain(|a| !outdated(a));
                (case.recent, case.driven) = Default::default();
            }
            case.brackets.push(new);
            for side in sides {
                case.take_in(side);
            }
        }
        Ok(())
    }

    /// Whether boundaries were estimated on both sides of a model's lag.
    pub fn is_bracketed(&self, model: &CoilModel) -> bool {
        self.bracketed_within(model, 1.0)
    }

    fn bracketed_within(&self, model: &CoilModel, share: f64) -> bool {
        let Ok(path) = model.heat_path() else { return false };
        let (way, lag_s) = (way_of(model), model.sensor_lag_s());
        self.cases.iter().all(|case| case.brackets.iter().any(|b| b.holds(path.location, &way, lag_s, share)))
    }

    /// Number of rows in the records of a role.
    pub fn rows(&self, role: Role) -> usize {
        self.cases.iter().filter(|c| c.role == role).map(|c| c.record.rows()).sum()
    }

    pub fn of(&self, role: Role) -> impl Iterator<Item = &Case> {
        self.cases.iter().filter(move |c| c.role == role)
    }

    /// Whitened residuals of a model, each record's offset taken out; None where the model cannot be solved.
    pub fn residuals(&self, model: &CoilModel, role: Role) -> Option<Vec<f64>> {
        self.residuals_of(model, role)
    }

    fn residuals_of(&self, model: &CoilModel, role: Role) -> Option<Vec<f64>> {
        let mut all = Vec::new();
        for case in self.of(role) {
            all.extend(case.residuals(model, self.pattern)?);
        }
        Some(all)
    }
}

pub(super) fn sum_of_squares(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum()
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Case {
    fn new(record: &Record, role: Role) -> Self {
        let mut rows: Vec<usize> = record.gross_errors().iter().map(|e| e.row).collect();
        rows.dedup();
        let record = record.without_rows(&rows).unwrap_or_else(|_| record.clone());
        let noise_rad_per_s = noise_floor_rad_per_s(&record);
        Self {
            record,
            role,
            noise_rad_per_s,
            anchors: Vec::new(),
            brackets: Vec::new(),
            slope_response: OnceLock::new(),
            recent: Mutex::default(),
            driven: Mutex::default(),
        }
    }

    /// Whether anything can be learnt from the record.
    fn check(&self) -> Result<(), DiagnoseError> {
        let name = || self.record.name().to_owned();
        if self.noise_rad_per_s <= 0.0 {
            return Err(DiagnoseError::NoNoise { record: name() });
        }
        let temperatures = self.record.temperature_k();
        let low = temperatures.iter().copied().fold(f64::INFINITY, f64::min);
        let high = temperatures.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let noise_k = self.anchors.last().map_or(0.0, |a| a.boundary.air().noise_k);
        let needed_k = (LEAST_RANGE_NOISES * noise_k).max(LEAST_RANGE_K);
        if high - low < needed_k {
            return Err(DiagnoseError::TemperatureConstant { record: name(), range_k: high - low, needed_k });
        }
        Ok(())
    }

    fn estimate(&self, model: &CoilModel, pattern: &Pattern, begin: Begin) -> Result<Anchor, DiagnoseError> {
        self.estimate_at(model, pattern, begin, model.sensor_lag_s())
    }

    /// The boundary as if the sensor lagged by `lag_s`.
    pub(super) fn boundary_at(
        &self,
        model: &CoilModel,
        pattern: &Pattern,
        begin: Begin,
        lag_s: f64,
    ) -> Result<Boundary, DiagnoseError> {
        let way = way_of(model);
        let far = |a: &Anchor| (difference(&a.way, &way), (a.lag_s - lag_s).abs());
        let known = (begin != Begin::Anew).then(|| {
            self.anchors.iter().min_by(|a, b| {
                let (a, b) = (far(a), far(b));
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
            })
        });
        let boundary = match known.flatten() {
            Some(near) => {
                let start = match begin {
                    Begin::Beside => Start::Beside,
                    _ if near.is_nearly(model, lag_s) => Start::Nearby,
                    _ => Start::Elsewhere,
                };
                refine_boundary(model, pattern, &self.record, lag_s, near.boundary.air(), start)
            }
            None => estimate_boundary(model, pattern, &self.record),
        };
        boundary.map_err(|source| DiagnoseError::Record { record: self.record.name().to_owned(), source })
    }

    /// As if the sensor lagged by `lag_s`.
    fn estimate_at(
        &self,
        model: &CoilModel,
        pattern: &Pattern,
        begin: Begin,
        lag_s: f64,
    ) -> Result<Anchor, DiagnoseError> {
        let boundary = self.boundary_at(model, pattern, begin, lag_s)?;
        if self.noise_rad_per_s <= 0.0 {
            return Err(DiagnoseError::NoNoise { record: self.record.name().to_owned() });
        }
        let whitener = boundary
            .rate_whitener(self.noise_rad_per_s)
            .map_err(|e| DiagnoseError::Record { record: self.record.name().to_owned(), source: e.into() })?;
        let measured = whitener.whiten(self.record.rate_rad_per_s());
        let mut one = whitener.whiten(&vec![self.noise_rad_per_s; self.record.rows()]);
        let length = sum_of_squares(&one).sqrt();
        one.iter_mut().for_each(|v| *v /= length);
        let path = model.heat_path()?;
        let location = path.location;
        let values = heat_values(model);
        Ok(Anchor {
            location,
            way: way_of(model),
            values,
            lag_s,
            boundary,
            path,
            whitener,
            measured,
            one,
            flange_response: OnceLock::new(),
        })
    }

    /// Keeps an anchor in the place of one for the same sensor and the same effects.
    fn take_in(&mut self, anchor: Anchor) {
        let same = |a: &Anchor| a.location == anchor.location && a.way == anchor.way && a.lag_s == anchor.lag_s;
        match self.anchors.iter().position(same) {
            Some(place) => self.anchors[place] = anchor,
            None => self.anchors.push(anchor),
        }
        (self.recent, self.driven) = Default::default();
    }

    pub fn residuals(&self, model: &CoilModel, pattern: &Pattern) -> Option<Vec<f64>> {
        let solved = self.solved(model)?;
        let predicted = rates_rad_per_s(model, pattern, &self.record, &solved.history).ok()?;
        let anchor = &self.anchors[solved.anchor];
        let mut residuals = anchor.whitener.whiten(&predicted);
        for (r, m) in residuals.iter_mut().zip(&anchor.measured) {
            *r = m - *r;
        }
        let offset = dot(&residuals, &anchor.one);
        for (r, one) in residuals.iter_mut().zip(&anchor.one) {
            *r -= offset * one;
        }
        Some(residuals)
    }
}

/// A record whose temperature moves less than this many noises of its sensor says nothing about heat.
const LEAST_RANGE_NOISES: f64 = 50.0;
/// … and so does one that moves by less than this, however quiet the sensor [K].
const LEAST_RANGE_K: f64 = 0.1;
