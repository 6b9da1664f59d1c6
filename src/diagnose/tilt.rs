//! How a record's boundary, as it is estimated, follows the values of what moves heat.
//!
//! ```text
//! H(p) = H[p; B(p₀)] + Σ_k (p_k − p₀_k) (H[p₀ + h e_k; B(p₀ + h e_k)] − H[p₀ + h e_k; B(p₀)]) / h
//! ```
//!
//! H is the pack's history and B(p) the boundary that is estimated under the values p. With the second term a fit of p is
//! joint with the boundary's estimate to first order: fitting on a boundary for p₀ and estimating it again in turn gets
//! there too, but in small steps, and the standard errors would be those of a boundary that is known.

use rayon::prelude::*;

use super::DiagnoseError;
use super::anchor::{name_of, way_of};
use super::evidence::{Begin, Case, Evidence};
use super::field::Keep;
use crate::rate::CoilModel;
use crate::thermal::{Driven, ThermalHistory};

/// How a boundary follows one value of what moves heat.
pub(super) struct Tilt {
    effect: String,
    parameter: usize,
    /// Of the value, where the boundary was estimated.
    from: f64,
    /// The pack's change a unit of the value, in SI, that comes from the boundary alone.
    per_unit: ThermalHistory,
}

/// Step of the difference, as a share of the value.
const STEP: f64 = 0.05;
/// Beyond this share of the value the boundary is not taken to go on in a straight line.
const STRAIGHT: f64 = 0.5;

impl Evidence<'_> {
    /// Finds how the boundaries that were estimated for a model follow values of its effects: of the effect's place in
    /// the model and the parameter's in the effect.
    ///
    /// # Errors
    /// As [`Evidence::new`].
    pub fn tilt(&mut self, model: &CoilModel, values: &[(usize, usize)]) -> Result<(), DiagnoseError> {
        let pattern = self.pattern;
        self.cases.par_iter_mut().try_for_each(|case| {
            let Some(anchor) = case.anchor_of(model) else { return Ok(()) };
            case.anchors[anchor].tilts.clear();
            let tilts = values
                .par_iter()
                .filter_map(|&(effect, parameter)| {
                    let (step, moved) = moved(model, effect, parameter)?;
                    let boundary = case.boundary_at(&moved, pattern, Begin::Beside, moved.sensor_lag_s());
                    Some(boundary.map(|boundary| {
                        let path = moved.heat_path().ok()?;
                        let at = case.solved(&moved, Keep::Recent)?;
                        let (driven, drive) = boundary.driving(&path, 0.0);
                        let drive = Driven::new(case.drive(drive), case.record.times_s(), model.rate_mean_s);
                        let mut per_unit = case.history(&driven, &drive)?;
                        per_unit.mix(1.0 / step, &at.history, -1.0 / step);
                        let from = model.effects[effect].values()[parameter];
                        Some(Tilt { effect: name_of(&model.effects[effect]), parameter, from, per_unit })
                    }))
                })
                .collect::<Result<Vec<_>, DiagnoseError>>()?;
            case.anchors[anchor].tilts = tilts.into_iter().flatten().collect();
            Ok(())
        })
    }
}

/// By how much a value is moved, and the model with it moved; None where it is zero.
fn moved(model: &CoilModel, effect: usize, parameter: usize) -> Option<(f64, CoilModel)> {
    let declared = &model.effects[effect];
    let value = declared.values()[parameter];
    let room = declared.parameters()[parameter].upper - value;
    let step = if STEP * value.abs() < room { STEP * value.abs() } else { -STEP * value.abs() };
    if step == 0.0 {
        return None;
    }
    let mut values = declared.values().to_vec();
    values[parameter] += step;
    let mut moved = model.clone();
    moved.effects[effect] = declared.with_values(values).ok()?;
    Some((step, moved))
}

impl Case {
    fn anchor_of(&self, model: &CoilModel) -> Option<usize> {
        self.anchor_for(model.heat_path().ok()?.location, &way_of(model), model.sensor_lag_s())
    }

    /// What the boundary would add to the pack under a model if it were estimated for the model's own values.
    pub(super) fn follow(&self, anchor: usize, model: &CoilModel, history: &mut ThermalHistory) {
        for tilt in &self.anchors[anchor].tilts {
            let Some(effect) = model.effects.iter().find(|e| name_of(e) == tilt.effect) else { continue };
            let furthest = STRAIGHT * tilt.from.abs();
            let by = (effect.values()[tilt.parameter] - tilt.from).clamp(-furthest, furthest);
            history.mix(1.0, &tilt.per_unit, by);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::super::experiment::fixtures::{effect, model, pattern};
    use super::*;
    use crate::boundary::expose;
    use crate::numeric::piecewise::PiecewiseLinear;
    use crate::record::Record;
    use crate::units::REFERENCE_TEMPERATURE_K;

    /// A day in a chamber that ramps up and down at 1.5 K/min.
    fn record(model: &CoilModel) -> Record {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let mut noise = |deviation: f64| deviation * normal.inverse_cdf(random.random::<f64>());
        let times_s: Vec<f64> = (0..600).map(|i| 10.0 * f64::from(i)).collect();
        let knots_s = vec![0.0, 905.0, 1703.0, 2412.0, 4011.0, 6000.0];
        let air_k = [0.0, 0.0, 20.0, 20.0, -20.0, -20.0].map(|t| REFERENCE_TEMPERATURE_K + t).to_vec();
        let air = PiecewiseLinear::new(knots_s, air_k).unwrap();
        let shown = expose(&model.heat_path().unwrap(), Some(25.0), 0.0, &air, &times_s).unwrap().shown_k;
        let temperature_k = shown.into_iter().map(|t| t + noise(0.002)).collect();
        let rates = times_s.iter().map(|_| noise(1e-7)).collect();
        Record::new("day", times_s, temperature_k, rates).unwrap()
    }

    #[test]
    fn a_boundary_follows_a_value_as_if_it_were_estimated_anew() {
        let flange = |film: f64| model(vec![effect("axial_gradient", &[film])]);
        let (pattern, records) = (pattern(), [record(&flange(60.0))]);
        let mut evidence = Evidence::new(&flange(50.0), &pattern, &records, &[]).unwrap();
        evidence.anchor(&flange(50.0), Begin::Nearby).unwrap();
        let rates = |evidence: &Evidence, film: f64| -> Vec<f64> {
            evidence.cases[0].solved(&flange(film), Keep::Recent).unwrap().history.axial_moment_k_per_s.clone()
        };
        let fixed = rates(&evidence, 60.0);
        evidence.tilt(&flange(50.0), &[(0, 0)]).unwrap();
        let following = rates(&evidence, 60.0);
        evidence.anchor(&flange(60.0), Begin::Nearby).unwrap();
        let anew = rates(&evidence, 60.0);
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        let (without, with) = (apart(&fixed, &anew), apart(&following, &anew));
        println!(
            "axial moments {without:.3e} K/s from a new estimate on a boundary that stays, {with:.3e} on one that follows"
        );
        assert!(with < 0.1 * without);
    }
}
