//! A record that only the hold-out explains.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

use super::experiment::fixtures::{effect, model, pattern};
use super::*;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::rate::RateModel;
use crate::thermal::exposure::expose;
use crate::thermal::solve;
use crate::units::REFERENCE_TEMPERATURE_K;

/// A day in a chamber that goes up and down by `swing_k`.
fn day(model: &CoilModel, swing_k: f64, seed: u64) -> Record {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).unwrap();
    let mut noise = |deviation: f64| deviation * normal.inverse_cdf(random.random::<f64>());
    let times_s: Vec<f64> = (1..=600).map(|i| 10.0 * f64::from(i)).collect();
    let knots_s = vec![0.0, 905.0, 1703.0, 2412.0, 4011.0, 6000.0];
    let air_k = [0.0, 0.0, 1.0, 1.0, -1.0, -1.0].map(|t| REFERENCE_TEMPERATURE_K + swing_k * t).to_vec();
    let air = PiecewiseLinear::new(knots_s, air_k).unwrap();
    let exposed = expose(&model.heat_path().unwrap(), Some(25.0), 0.0, &air, &times_s).unwrap();
    let history = solve(&exposed.path, &exposed.drive).unwrap().means(&times_s, model.rate_mean_s);
    let rates = RateModel::new(model, &pattern(), &[]).unwrap().series_rad_per_s(&history);
    let rates = rates.into_iter().map(|r| r + noise(1e-7)).collect();
    let temperature_k = exposed.shown_k.into_iter().map(|t| t + noise(0.002)).collect();
    Record::new("day", times_s, temperature_k, rates).unwrap()
}

#[test]
fn what_only_the_hold_out_shows_is_found() {
    let complete = model(vec![effect("strain_mismatch", &[0.004])]);
    let (gentle, wild) = ([day(&complete, 0.6, 1)], [day(&complete, 20.0, 2)]);
    let (declared, pattern) = (model(Vec::new()), pattern());
    let asked = |records, holdout| {
        let terms = Terms::None;
        let request = Request { model: &declared, pattern: &pattern, records, holdout, terms };
        diagnose(&request, &|_| ()).unwrap()
    };
    let says = |d: &Diagnosis| d.cautions.contains(&Caution::FittedToHoldout);
    let found = asked(&gentle, &wild);
    println!("{:?}: {:?}", found.verdict, found.ladder);
    assert!(found.verdict != Verdict::Adequate);
    let kinds = found
        .effects
        .iter()
        .flat_map(|f| std::iter::once(f.effect.kind()).chain(f.equivalents.iter().map(|e| e.effect.kind())));
    assert!(kinds.collect::<Vec<_>>().contains(&"strain_mismatch".to_owned()));
    // The ladder's columns stay those of the records as they were given.
    let (first, last) = (&found.ladder[0], &found.ladder[1]);
    assert!(first.holdout_rmse_rad_per_s.unwrap() > 1.2 * last.holdout_rmse_rad_per_s.unwrap());
    assert!(first.rmse_rad_per_s < 1.1 * last.rmse_rad_per_s);
    assert!(!says(&asked(&wild, &gentle)));
}
