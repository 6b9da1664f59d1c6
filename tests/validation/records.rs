//! Reference: seven records from an independent simulator (two-dimensional axisymmetric finite volumes, four cells a layer,
//! steps of 1 s), copied to `tests/data/records`; two of them hide nothing, five hide an effect that the declared model
//! lacks (`tests/data/records/*/coil.toml` is what the user believes).
//! Tolerance: reduced chi-square between 0.9 and 1.15 where the model is complete, with nothing but the offset fitted; for
//! the others the regime or dependence in which the hidden effect acts must be named.

use std::path::{Path, PathBuf};

use coilwright::compare::regimes::Regime;
use coilwright::compare::verdict::{Finding, Verdict};
use coilwright::compare::{Comparison, Quantity, compare};
use coilwright::io::model_file::{ModelFile, read_model};
use coilwright::io::record_file::read_record;
use coilwright::predict::noise_floor;
use coilwright::record::Record;
use coilwright::units::deg_per_h_from_rad_per_s;

pub fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/records").join(name)
}

pub fn model(name: &str) -> ModelFile {
    read_model(&folder(name).join("coil.toml")).unwrap()
}

pub fn record(name: &str, part: &str) -> Record {
    read_record(&folder(name).join(part)).unwrap()
}

fn compared(name: &str) -> Comparison {
    let file = model(name);
    let found = compare(&file.model, &file.pattern.unwrap().pattern, &record(name, "validation.csv")).unwrap();
    println!(
        "{name}: reduced chi-square {:.3}, of it from the boundary {:.3}, whitened {:.3}",
        found.reduced_chi_square, found.boundary_chi_square, found.whitened_chi_square
    );
    for finding in &found.findings {
        println!("  {finding}");
    }
    let shares: f64 = found.regimes.iter().map(|r| r.share_of_squared_error).sum();
    assert!((shares - 1.0).abs() < 1e-9);
    found
}

/// The simulator's white noise of one rate [°/h].
const NOISE_DEG_PER_H: [(&str, f64); 7] = [
    ("a-control", 0.037947),
    ("b-half-space", 0.189737),
    ("c-spool", 0.037947),
    ("d-mismatch", 0.037947),
    ("e-sensor", 0.075895),
    ("f-two", 0.037947),
    ("g-control-zyl", 0.037947),
];

#[test]
fn the_noise_floor_is_the_simulators_within_its_own_standard_error() {
    let mut squares = 0.0;
    let mut sum = 0.0;
    for (name, expected) in NOISE_DEG_PER_H {
        for part in ["calibration.csv", "validation.csv"] {
            let found = noise_floor(&record(name, part));
            let excess = deg_per_h_from_rad_per_s(found.deviation) / expected - 1.0;
            let in_errors = excess * found.deviation / found.standard_error;
            println!("{name}/{part}: {:+.2} %, {in_errors:+.2} standard errors", 100.0 * excess);
            assert!(excess.abs() < 0.05, "{name}/{part}");
            squares += in_errors * in_errors;
            sum += excess;
        }
    }
    println!("mean {:+.2} %, squares {squares:.1} of 14", 100.0 * sum / 14.0);
    assert!((sum / 14.0).abs() < 0.015);
    // The 99.9 % point of chi-square with 14 degrees of freedom.
    assert!(squares < 36.1);
}

fn names_transients(found: &Comparison) -> bool {
    found.findings.iter().any(|f| matches!(f, Finding::Regime { regime: Regime::Transient, .. }))
}

fn names(found: &Comparison, wanted: &Quantity) -> bool {
    found.findings.iter().any(|f| matches!(f, Finding::Follows { quantity, .. } if quantity == wanted))
}

#[test]
fn a_complete_model_is_adequate_and_no_regime_stands_out() {
    for name in ["a-control", "g-control-zyl"] {
        let found = compared(name);
        assert_eq!(found.verdict, Verdict::Adequate, "{name}");
        assert!((0.9..=1.15).contains(&found.reduced_chi_square), "{name}");
        assert!(found.regimes.iter().all(|r| r.chi_square_per_row < 1.35), "{name}");
    }
}

#[test]
fn a_hidden_spool_and_a_lagging_sensor_show_after_each_change_of_ramp() {
    for name in ["c-spool", "e-sensor"] {
        let found = compared(name);
        assert_eq!(found.verdict, Verdict::Missing, "{name}");
        assert!(names_transients(&found), "{name}");
    }
}

#[test]
fn a_hidden_mismatch_of_the_halves_shows_as_a_dependence_on_the_rate_of_temperature() {
    let found = compared("d-mismatch");
    assert_eq!(found.verdict, Verdict::Missing);
    assert!(names(&found, &Quantity::TemperatureRate));
}

#[test]
fn stress_and_a_temperature_bias_show_as_dependences_on_rate_and_temperature() {
    let found = compared("f-two");
    assert_eq!(found.verdict, Verdict::Missing);
    assert!(names(&found, &Quantity::TemperatureRate) && names(&found, &Quantity::Temperature));
}

#[test]
fn a_half_space_for_a_pack_that_ends_shows_as_a_wrong_prediction() {
    let found = compared("b-half-space");
    assert_eq!(found.verdict, Verdict::Missing);
    assert!(names(&found, &Quantity::Prediction) && names(&found, &Quantity::GradientRate));
}
