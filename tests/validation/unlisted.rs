//! Reference: two records with a term that no list has, from an independent simulator, copied to `tests/data/records-beyond`:
//! b1 hides 0.012 °/h (T_m − lag(T_m, 900 s)), b3 hides 0.016 °/h · dT_m/dt [K/min] · (T_m − 20 °C); `test.csv` (steps of a
//! thermoelectric stage) is for judging only. The others are drawn formula trials (`results/formula-trials`): a one-sided relaxation of the
//! layers' mean, and −3.563e-6 °/h (T_m − 20 °C)³ beside a `stress_gradient` of −0.186; `ageing` is `term-08-ageing` of
//! `python benches/peers/simulator/laboratory_cases.py DIR beyond 45101`.
//! Tolerance: the form, its numbers within 10 %, and the third record within 1.15 of its noise, or of what the truth leaves of it.

use std::path::{Path, PathBuf};

use coilwright::compare::compare;
use coilwright::diagnose::{Diagnosis, Request, Terms, diagnose};
use coilwright::io::read::model_file::read_model;
use coilwright::io::read::record_file::read_record;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/records-beyond").join(name)
}

fn diagnosed(name: &str) -> Diagnosis {
    let file = read_model(&folder(name).join("coil.toml")).unwrap();
    let pattern = file.pattern.unwrap().pattern;
    let record = |part: &str| read_record(&folder(name).join(part)).unwrap();
    let (records, holdout) = ([record("calibration.csv")], [record("validation.csv")]);
    let terms = Terms::default();
    let request = Request { model: &file.model, pattern: &pattern, records: &records, holdout: &holdout, terms };
    diagnose(&request, &|_| ()).unwrap()
}

fn assert_found(name: &str, form: &str, numbers: &[(&str, f64)], noise_deg_per_h: f64) -> Diagnosis {
    let found = diagnosed(name);
    let best = &found.proposals[0];
    println!("{name}: {} {:?}", best.formula, best.alternatives);
    assert_eq!((best.terms.len(), best.terms[0].form, best.predicts), (1, form, true), "{name}");
    for (key, truth) in numbers {
        let found = best.terms[0].parameters.iter().find(|p| p.key == *key).unwrap().value;
        assert!((found / truth - 1.0).abs() < 0.1, "{name}: {key} {found}, true {truth}");
    }
    let pattern = read_model(&folder(name).join("coil.toml")).unwrap().pattern.unwrap().pattern;
    let record = read_record(&folder(name).join("test.csv")).unwrap();
    let judged = compare(&best.proposed, &pattern, &record).unwrap();
    let noises = coilwright::units::deg_per_h_from_rad_per_s(judged.rmse_rad_per_s) / noise_deg_per_h;
    println!("{name}: the third record within {noises:.3} noises");
    assert!(noises < 1.15, "{name}: {noises}");
    found
}

fn listed(found: &Diagnosis) -> Vec<String> {
    found.effects.iter().map(|f| f.effect.kind()).collect()
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_relaxation_is_found_though_a_listed_effect_with_a_wander_looked_better() {
    assert_found("b1-relaxation", "relaxation", &[("a", 0.012), ("tau_s", 900.0)], 0.03794733192202055);
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_rate_times_a_temperature_is_told_from_a_gradient_times_a_temperature() {
    // 0.016 per K/min and K, per K/s.
    assert_found("b3-product", "product", &[("a", 0.96)], 0.03794733192202055);
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_terms_numbers_are_those_of_the_pack_that_it_is_found_in() {
    // A spool stood in the place of the term at first, and its layers' mean in the term: a was −0.0743.
    let numbers = [("a", -0.0652), ("tau_s", 289.0)];
    assert_found("one-sided-relaxation", "one_sided_relaxation", &numbers, 0.024);
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_bend_is_found_where_a_straight_line_with_a_wander_stood_in_its_place_beside_another_effect() {
    // The truth leaves 0.0284 °/h of the third record: noise of 0.024 and air that the sensor does not see.
    let found = assert_found("cubic-beside-stress-gradient", "cubic", &[("a", -3.563e-6)], 0.0284);
    assert_eq!(listed(&found), ["stress_gradient"]);
}

/// The best listed effect, `self_heating`, changes temperatures, and courses are made beside it: formulas beside the declared model are
/// judged by them none the less (they added nothing there once, and `self_heating` had 100 %).
#[test]
#[ignore = "long: --include-ignored"]
fn an_ageing_is_told_from_a_heat_source_that_is_switched_on() {
    // 0.13 ln(1 + t/959 s) °/h.
    let found = diagnosed("ageing");
    let best = &found.proposals[0];
    println!("ageing: {} {:?}", best.formula, best.alternatives);
    assert_eq!((best.terms.len(), best.terms[0].form), (1, "settling"));
    assert!(listed(&found).is_empty(), "{:?}", listed(&found));
    for (key, truth, within) in [("a", 0.13, 0.1), ("tau_s", 959.0, 0.25)] {
        let found = best.terms[0].parameters.iter().find(|p| p.key == key).unwrap().value;
        assert!((found / truth - 1.0).abs() < within, "{key} {found}, true {truth}");
    }
}
