//! A record that only the hold-out explains.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

use super::experiment::fixtures::{effect, model, pattern};
use super::*;
use crate::numeric::piecewise::PiecewiseLinear;
use crate::rate::RateModel;
use crate::thermal::exposure::expose;
use crate::thermal::{Instant, Location, solve};
use crate::units::REFERENCE_TEMPERATURE_K;

/// What is asked of a chamber whose first record is fitted and whose others are held out.
pub(crate) fn of_first_record<'a>(
    chamber: &'a Chamber<'a>,
    model: &'a CoilModel,
    pattern: &'a Pattern,
    candidates: &'a [candidate::Candidate],
    depth: usize,
) -> Question<'a> {
    let held_out = (1..chamber.records()).collect();
    Question { chamber, model, pattern, candidates, fitted: vec![0], held_out, depth }
}

fn gaussian(seed: u64) -> impl FnMut(f64) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).unwrap();
    move |deviation| deviation * normal.inverse_cdf(random.random::<f64>())
}

/// A day in a chamber that goes up and down by `swing_k`.
fn day(model: &CoilModel, swing_k: f64, seed: u64) -> Record {
    let mut noise = gaussian(seed);
    let times_s: Vec<f64> = (1..=600).map(|i| 10.0 * f64::from(i)).collect();
    let knots_s = vec![0.0, 905.0, 1703.0, 2412.0, 4011.0, 6000.0];
    let air_k = [0.0, 0.0, 1.0, 1.0, -1.0, -1.0].map(|t| REFERENCE_TEMPERATURE_K + swing_k * t).to_vec();
    let air = PiecewiseLinear::new(knots_s, air_k).unwrap();
    let lag_s = model.sensor_lag_s();
    let exposed = expose(&model.heat_path().unwrap(), Some(25.0), lag_s, &air, &times_s).unwrap();
    let field = solve(&exposed.path, &exposed.drive).unwrap();
    let history = field.means(&times_s, model.rate_mean_s);
    let rates = RateModel::new(model, &pattern(), &[]).unwrap().series_rad_per_s(&history);
    let rates = rates.into_iter().map(|r| r + noise(1e-7)).collect();
    let temperature_k = exposed.shown_k.into_iter().map(|t| t + noise(0.002)).collect();
    let innermost = field.at(&times_s.iter().map(|t| Instant::before(*t)).collect::<Vec<_>>());
    let inner_k = (0..times_s.len()).map(|row| innermost.temperatures_k(row)[0] + noise(0.002)).collect();
    Record::new("day", times_s, temperature_k, rates).unwrap().with_inner_k(inner_k).unwrap()
}

/// The same without the thermometer at the bore.
pub(in crate::diagnose) fn bare_day(model: &CoilModel, swing_k: f64, seed: u64) -> Record {
    let day = day(model, swing_k, seed);
    let columns = [day.times_s(), day.temperature_k(), day.rate_rad_per_s()].map(<[f64]>::to_vec);
    let [times_s, temperature_k, rates] = columns;
    Record::new("day", times_s, temperature_k, rates).unwrap()
}

#[test]
#[ignore = "long: --include-ignored"]
fn what_only_the_hold_out_shows_is_found() {
    let complete = model(vec![effect("strain_mismatch", &[0.004])]);
    let (gentle, wild) = ([bare_day(&complete, 0.6, 1)], [bare_day(&complete, 20.0, 2)]);
    let (declared, pattern) = (model(Vec::new()), pattern());
    let asked = |records, holdout| {
        let terms = Terms::None;
        let request = Request { model: &declared, pattern: &pattern, records, holdout, terms };
        diagnose(&request, &|_| ()).unwrap()
    };
    let says = |d: &Diagnosis| d.cautions.contains(&Caution::FittedToHoldout);
    let found = asked(&gentle, &wild);
    println!("{:?}: {:?}", found.verdict, found.ladder);
    for share in &found.posterior {
        println!("{:.4} {:?}", share.probability, share.effects);
    }
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

#[test]
#[ignore = "long: --include-ignored"]
fn a_declared_film_that_is_wrong_is_said_with_what_it_is() {
    let behind = |film: f64| {
        let effects = vec![effect("surface_film", &[film])];
        CoilModel { location: Location::Ambient, ..model(effects) }
    };
    let (records, holdout) = ([bare_day(&behind(25.0), 20.0, 1)], [bare_day(&behind(25.0), 15.0, 2)]);
    let (declared, pattern) = (behind(16.0), pattern());
    let terms = Terms::None;
    let request = Request { model: &declared, pattern: &pattern, records: &records, holdout: &holdout, terms };
    let found = diagnose(&request, &|_| ()).unwrap();
    println!("{:?} {:?}", found.verdict, found.refitted);
    assert_eq!((found.verdict, found.effects.len(), found.refitted.len()), (Verdict::Missing, 0, 1));
    let film = &found.refitted[0];
    assert_eq!((film.kind.as_str(), film.declared), ("surface_film", 16.0));
    // 23.9 ± 0.4, by a chamber whose kinks are known to a row.
    assert!((film.value / 25.0 - 1.0).abs() < 0.1, "{}", film.value);
    assert!(film.value - film.declared > 5.0 * film.standard_error.unwrap());
}

/// A day whose rate wanders by 6e-7 rad/s rms, forgotten after `time_constant_s`.
fn wandering_day(model: &CoilModel, time_constant_s: f64, seed: u64) -> Record {
    let record = bare_day(model, 2.0, seed);
    let mut noise = gaussian(seed + 100);
    let kept = (-10.0 / time_constant_s).exp();
    let mut wander = noise(6e-7);
    let wandering = record.rate_rad_per_s().iter().map(|rate| {
        wander = kept * wander + noise(6e-7 * (1.0 - kept * kept).sqrt());
        rate + wander
    });
    let rates = wandering.collect();
    Record::new("wandering", record.times_s().to_vec(), record.temperature_k().to_vec(), rates).unwrap()
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_wander_that_nothing_explains_is_told_with_its_size_and_its_time_constant() {
    let (declared, pattern) = (model(Vec::new()), pattern());
    let records = [wandering_day(&declared, 300.0, 3), wandering_day(&declared, 300.0, 4)];
    let request = Request { model: &declared, pattern: &pattern, records: &records, holdout: &[], terms: Terms::None };
    let found = diagnose(&request, &|_| ()).unwrap();
    println!("{:?}: {:?}", found.verdict, found.unexplained);
    assert_eq!(found.verdict, Verdict::Unexplained);
    let plain = found.unexplained.unwrap().plain;
    // Two records of twenty time constants: a time constant is known to a third, a size to a sixth.
    let [Plain { shape: ResidualShape::Drift { time_constant_s }, rms_rad_per_s, .. }] = plain[..] else {
        panic!("{plain:?}");
    };
    assert!((time_constant_s / 300.0).ln().abs() < 0.6, "{time_constant_s}");
    assert!((rms_rad_per_s / 6e-7).ln().abs() < 0.35, "{rms_rad_per_s}");
}

#[test]
#[ignore = "long: --include-ignored"]
fn two_thermometers_show_a_lag_that_the_rate_does_not() {
    let pattern = pattern();
    let declared = model(Vec::new());
    let asked = |model: &CoilModel| {
        let records = [day(model, 3.0, 5), day(model, 3.0, 6)];
        let request =
            Request { model: &declared, pattern: &pattern, records: &records, holdout: &[], terms: Terms::None };
        diagnose(&request, &|_| ()).unwrap()
    };
    let found = asked(&model(vec![effect("sensor_lag", &[45.0])]));
    let kinds: Vec<String> = found.effects.iter().map(|f| f.effect.kind()).collect();
    println!("{:?}: {kinds:?}", found.verdict);
    assert_eq!((found.verdict, &kinds[..]), (Verdict::Missing, &["sensor_lag".to_owned()][..]));
    let lag_s = found.effects[0].parameters[0].value;
    assert!((lag_s / 45.0 - 1.0).abs() < 0.1, "{lag_s}");
    // Nothing is named where nothing lags.
    assert_eq!(asked(&declared).verdict, Verdict::Adequate);
}
