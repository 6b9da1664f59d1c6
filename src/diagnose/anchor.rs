//! Boundaries estimated for one way in which heat may flow and the sensor may be connected to the pack.

use std::sync::OnceLock;

use crate::boundary::{Boundary, RateWhitener};
use crate::effect::{Acts, DeclaredEffect};
use crate::rate::CoilModel;
use crate::thermal::{HeatPath, Location, ThermalHistory};

/// A boundary, and what it makes of a record.
pub(super) struct Anchor {
    pub location: Location,
    /// What it was estimated with.
    pub way: Vec<String>,
    /// Of what moves heat in it.
    pub values: Vec<f64>,
    pub lag_s: f64,
    pub boundary: Boundary,
    /// Under which it was estimated.
    pub path: HeatPath,
    pub whitener: RateWhitener,
    /// The measured rates and a constant of one noise, whitened; the latter of unit length.
    pub measured: Vec<f64>,
    pub one: Vec<f64>,
    /// None without a flange.
    pub flange_response: OnceLock<Option<[ThermalHistory; 2]>>,
}

impl Anchor {
    /// Whether it was estimated for the effects of a model at values, and for a lag, from which no kink is far.
    pub fn is_nearly(&self, model: &CoilModel, lag_s: f64) -> bool {
        let within = |a: f64, b: f64| (a - b).abs() <= NEARLY * a.abs().max(b.abs());
        self.way == way_of(model)
            && within(self.lag_s, lag_s)
            && self.values.iter().zip(heat_values(model)).all(|(a, b)| within(*a, b))
    }
}

/// The effects that move heat or the sensor: what a boundary's estimate depends on. Sorted.
pub(super) fn way_of(model: &CoilModel) -> Vec<String> {
    moving(model).map(name_of).collect()
}

fn name_of(effect: &DeclaredEffect) -> String {
    format!("{} {:?}", effect.kind(), effect.choices())
}

fn moving(model: &CoilModel) -> impl Iterator<Item = &DeclaredEffect> {
    let mut moving: Vec<&DeclaredEffect> =
        model.effects.iter().filter(|e| matches!(e.spec().acts, Acts::HeatPath | Acts::Sensor)).collect();
    moving.sort_by_key(|e| name_of(e));
    moving.into_iter()
}

/// The values of a model's effects that move heat.
pub(super) fn heat_values(model: &CoilModel) -> Vec<f64> {
    moving(model).filter(|e| e.spec().acts == Acts::HeatPath).flat_map(|e| e.values().iter().copied()).collect()
}

/// Whether a model has an effect that moves the sensor.
pub(super) fn moves_sensor(model: &CoilModel) -> bool {
    moving(model).any(|e| e.spec().acts == Acts::Sensor)
}

/// Whether the values of what moves heat are those that a boundary was estimated for, or nearly.
pub(super) fn is_near(estimated: &[f64], model: &CoilModel) -> bool {
    estimated.iter().zip(heat_values(model)).all(|(a, b)| (a - b).abs() <= NEAR * a.abs().max(b.abs()))
}

/// Effects that only one of two ways has.
pub(super) fn difference(a: &[String], b: &[String]) -> usize {
    a.iter().filter(|k| !b.contains(k)).count() + b.iter().filter(|k| !a.contains(k)).count()
}

/// Three estimates for one sensor: at a lag, and at a shorter and a longer one.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bracket {
    pub location: Location,
    pub way: Vec<String>,
    pub middle_s: f64,
    pub half_width_s: f64,
}

impl Bracket {
    pub fn lags_s(&self) -> [f64; 3] {
        [self.middle_s - self.half_width_s, self.middle_s, self.middle_s + self.half_width_s]
    }

    /// Whether a sensor's lag is within a share of the half width about the middle.
    pub fn holds(&self, location: Location, way: &[String], lag_s: f64, share: f64) -> bool {
        location == self.location && way == self.way && (lag_s - self.middle_s).abs() <= share * self.half_width_s
    }

    /// Of the three estimates, at a lag between the outer two: those of the parabola through them.
    pub fn weights(&self, lag_s: f64) -> [f64; 3] {
        let x = (lag_s - self.middle_s) / self.half_width_s;
        [0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0)]
    }
}

/// Half width of a bracket, as a share of the lag, and the least \[s\]: much more than a standard error, and so little
/// that no kink moves by more than a reading.
pub(super) const BRACKET_SHARE: f64 = 0.04;
pub(super) const LEAST_BRACKET_S: f64 = 1.0;

/// Share by which a value may differ from that for which a boundary was estimated.
const NEAR: f64 = 0.05;
/// … and for the estimate to begin with what was found then.
const NEARLY: f64 = 0.25;

#[cfg(test)]
mod tests {
    use super::*;

    fn bracket() -> Bracket {
        Bracket {
            location: Location::OuterLayer,
            way: vec!["sensor_lag []".to_owned()],
            middle_s: 40.0,
            half_width_s: 2.0,
        }
    }

    #[test]
    fn a_parabola_is_the_same_between_the_three_lags_of_a_bracket() {
        let bracket = bracket();
        let parabola = |lag_s: f64| 3.0 - 0.7 * lag_s + 0.02 * lag_s * lag_s;
        for lag_s in [38.0, 39.1, 40.0, 40.6, 42.0] {
            let weights = bracket.weights(lag_s);
            let between: f64 = bracket.lags_s().iter().zip(weights).map(|(at, w)| w * parabola(*at)).sum();
            assert!((between - parabola(lag_s)).abs() < 1e-12);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn a_bracket_holds_for_its_own_sensor_and_effects_only() {
        let bracket = bracket();
        let way = bracket.way.clone();
        assert!(bracket.holds(Location::OuterLayer, &way, 41.9, 1.0));
        assert!(!bracket.holds(Location::OuterLayer, &way, 42.1, 1.0));
        assert!(!bracket.holds(Location::OuterLayer, &way, 41.9, 0.4));
        assert!(!bracket.holds(Location::Ambient, &way, 40.0, 1.0));
        assert!(!bracket.holds(Location::OuterLayer, &[], 40.0, 1.0));
    }

    #[test]
    fn effects_that_only_one_of_two_ways_has_are_counted() {
        let way = |kinds: &[&str]| kinds.iter().map(|k| (*k).to_owned()).collect::<Vec<_>>();
        assert_eq!(difference(&way(&["a", "b"]), &way(&["b"])), 1);
        assert_eq!(difference(&way(&["a"]), &way(&["b"])), 2);
        assert_eq!(difference(&way(&[]), &way(&[])), 0);
    }
}
