//! The pack under a record's boundaries, solved for one model after another and remembered where it is asked for again.

use std::sync::{Arc, OnceLock};

use super::anchor::{Anchor, difference, way_of};
use super::conductivity::SlopeResponse;
use super::evidence::Case;
use crate::rate::CoilModel;
use crate::thermal::{self, Drive, Driven, HeatPath, Location, Memory, ThermalHistory};

/// The drive of an anchor, ready for any heat path.
pub(super) struct DrivenAnchor {
    anchor: usize,
    driven: Driven,
    /// Of the slope of what the sensor shows.
    sensor: OnceLock<Memory>,
}

/// A field that was solved lately.
pub(super) struct Solved {
    path: HeatPath,
    pub anchor: usize,
    lag_s: f64,
    pub history: ThermalHistory,
}

/// Fields kept for models that differ only in what is done with them …
const KEPT_FIELDS: usize = 8;

/// Drives kept ready: a bracket's three and a few more.
const KEPT_DRIVES: usize = 6;

impl Case {
    /// The anchor for a sensor: that of its place which was estimated for the most nearly same effects, and then for the
    /// nearest lag.
    pub(super) fn anchor_for(&self, location: Location, way: &[String], lag_s: f64) -> Option<usize> {
        let far = |i: usize| (difference(&self.anchors[i].way, way), (self.anchors[i].lag_s - lag_s).abs());
        (0..self.anchors.len()).filter(|&i| self.anchors[i].location == location).min_by(|&a, &b| {
            let (a, b) = (far(a), far(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        })
    }

    /// The pack over each averaging interval under a model.
    pub(super) fn solved(&self, model: &CoilModel) -> Option<Arc<Solved>> {
        let path = model.heat_path().ok()?;
        let (way, lag_s) = (way_of(model), model.sensor_lag_s());
        if let Some(bracket) = self.brackets.iter().find(|b| b.holds(path.location, &way, lag_s, 1.0)) {
            let anchors = bracket.lags_s().map(|at_s| {
                let nearest = self.anchor_for(path.location, &way, at_s)?;
                self.solved_at(path.clone(), nearest, self.anchors[nearest].lag_s, model.rate_mean_s)
            });
            let [Some(shorter), Some(middle), Some(longer)] = anchors else { return None };
            let history = mixed([&shorter.history, &middle.history, &longer.history], bracket.weights(lag_s));
            return Some(Arc::new(Solved { path, anchor: middle.anchor, lag_s, history }));
        }
        let anchor = self.anchor_for(path.location, &way, lag_s)?;
        self.solved_at(path, anchor, lag_s, model.rate_mean_s)
    }

    /// The pack under one anchor's boundary, remembered if it was asked for lately.
    fn solved_at(&self, path: HeatPath, anchor: usize, lag_s: f64, rate_mean_s: f64) -> Option<Arc<Solved>> {
        if let Ok(fields) = self.recent.lock()
            && let Some(known) = fields.iter().find(|s| s.anchor == anchor && s.lag_s == lag_s && s.path == path)
        {
            return Some(known.clone());
        }
        let from = &self.anchors[anchor];
        let kept = self.driven(anchor, rate_mean_s);
        let further_lag_s = lag_s - from.lag_s;
        let mut history = if further_lag_s == 0.0 {
            self.history(&path, &kept.driven)?
        } else {
            let sensor =
                kept.sensor.get_or_init(|| kept.driven.memory_of(&from.boundary.sensor_slope_k_per_s(from.location)));
            let drive = self.drive(from.boundary.delayed_drive(from.location, further_lag_s));
            self.history(&path, &kept.driven.with(further_lag_s, sensor, drive))?
        };
        if path.flange.is_some()
            && let Some(response) = from.flange_response.get_or_init(|| self.flange_response(from, rate_mean_s))
        {
            history = mixed([&history, &response[0], &response[1]], [1.0, 1.0, -1.0]);
        }
        let solved = Arc::new(Solved { path, anchor, lag_s, history });
        if let Ok(mut recent) = self.recent.lock() {
            if recent.len() >= KEPT_FIELDS {
                // The first is that of the declared model, which is asked for most.
                recent.remove(1);
            }
            recent.push(solved.clone());
        }
        Some(solved)
    }

    /// The pack of an anchor that has a flange, driven by the air, and by the outermost layer. The second is what is solved
    /// for other values, so that they too agree with the sensor; the difference is what it leaves out.
    fn flange_response(&self, anchor: &Anchor, rate_mean_s: f64) -> Option<[ThermalHistory; 2]> {
        let path = HeatPath { conductivity_slope_per_k: 0.0, ..anchor.path.clone() };
        path.flange.filter(|_| path.location == Location::OuterLayer)?;
        let (driven, by_air) = anchor.boundary.driving(&path, 0.0);
        let by_layer = anchor.boundary.drive(path.location);
        let means = |path: &HeatPath, drive: Drive| {
            Driven::new(self.drive(drive), self.record.times_s(), rate_mean_s).means(path).ok()
        };
        Some([means(&driven, by_air)?, means(&path, by_layer)?])
    }

    /// With the measured ambient, if there is one.
    pub(super) fn drive(&self, drive: Drive) -> Drive {
        Drive { ambient_k: crate::predict::measured_ambient(&self.record).or(drive.ambient_k), ..drive }
    }

    /// An anchor's drive, remembered if it was asked for lately.
    fn driven(&self, anchor: usize, rate_mean_s: f64) -> Arc<DrivenAnchor> {
        let found = |kept: &[Arc<DrivenAnchor>]| kept.iter().find(|d| d.anchor == anchor).cloned();
        if let Ok(kept) = self.driven.lock()
            && let Some(known) = found(&kept)
        {
            return known;
        }
        let from = &self.anchors[anchor];
        let driven = Driven::new(self.drive(from.boundary.drive(from.location)), self.record.times_s(), rate_mean_s);
        let new = Arc::new(DrivenAnchor { anchor, driven, sensor: OnceLock::new() });
        if let Ok(mut kept) = self.driven.lock() {
            if let Some(known) = found(&kept) {
                return known;
            }
            if kept.len() >= KEPT_DRIVES {
                kept.remove(0);
            }
            kept.push(new.clone());
        }
        new
    }

    /// The pack under a drive; the effect of a conductivity's slope is taken from a series worked out before.
    pub(super) fn history(&self, path: &HeatPath, driven: &Driven) -> Option<ThermalHistory> {
        let slope_per_k = path.conductivity_slope_per_k;
        let linear = HeatPath { conductivity_slope_per_k: 0.0, ..path.clone() };
        let mut history = driven.means(&linear).ok()?;
        if slope_per_k != 0.0 {
            thermal::check(path).ok()?;
            let response = self.slope_response.get_or_init(|| {
                let first = self.anchors.first()?;
                let drive = first.boundary.drive(first.location);
                SlopeResponse::new(&first.path, &drive, self.record.times_s(), driven.window_s())
            });
            response.as_ref()?.add_to(&mut history, slope_per_k);
        }
        Some(history)
    }
}

/// Σ_i w_i H_i.
fn mixed([first, second, third]: [&ThermalHistory; 3], weights: [f64; 3]) -> ThermalHistory {
    let mut sum = first.clone();
    sum.mix(weights[0], second, weights[1]);
    sum.mix(1.0, third, weights[2]);
    sum
}
