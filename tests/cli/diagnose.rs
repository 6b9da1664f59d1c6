//! Records that say nothing, or nothing about this coil: a clear statement instead of a verdict, and never a panic.

use std::path::PathBuf;

use super::{code, root, run, stderr, stdout};

type Row = [String; 3];

fn record(name: &str) -> PathBuf {
    root().join("tests/data/records").join(name)
}

/// Header and rows of a calibration cycle in which nothing is missing.
fn cycle() -> Vec<Row> {
    let text = std::fs::read_to_string(record("g-control-zyl").join("calibration.csv")).expect("the record is there");
    let fields = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    text.lines().skip(1).map(|line| fields(line)[..3].to_vec().try_into().expect("three columns")).collect()
}

/// Diagnoses rows with the coil of `coil`, and gives exit code, answer and errors.
fn diagnose_with(coil: &str, rows: &[Row], further: Option<&str>) -> (i32, String, String) {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let mut text = "time_s,temperature_c,rate_deg_per_h".to_owned() + if further.is_some() { ",dead_v" } else { "" };
    for row in rows {
        text += &format!("\n{}", row.join(","));
        text += &further.map(|value| format!(",{value}")).unwrap_or_default();
    }
    let path = folder.path().join("odd.csv");
    std::fs::write(&path, text).expect("a temporary file can be written");
    let model = record(coil).join("coil.toml");
    let output = run(&["diagnose", &model.display().to_string(), &path.display().to_string()]);
    assert!(!stderr(&output).contains("panicked"), "{}", stderr(&output));
    (code(&output), stdout(&output).to_owned(), stderr(&output).to_owned())
}

fn assert_refused(rows: &[Row], expected: &str) {
    let (code, answer, errors) = diagnose_with("g-control-zyl", rows, None);
    assert_eq!((code, answer.as_str()), (2, ""), "{errors}");
    assert!(errors.contains(expected), "expected {expected:?} in {errors}");
}

fn changed(rows: &[Row], change: impl Fn(usize, &mut Row)) -> Vec<Row> {
    let mut rows = rows.to_vec();
    rows.iter_mut().enumerate().for_each(|(i, row)| change(i, row));
    rows
}

#[test]
fn a_record_at_a_constant_temperature_gets_no_verdict() {
    let rows = cycle();
    let noise_only = changed(&rows, |i, row| row[1] = format!("{:.3}", 20.0 + 0.004 * ((i * 7919 % 13) as f64 - 6.0)));
    assert_refused(&noise_only, "the temperature moves by 0.048 K only, less than");
    assert_refused(&changed(&rows, |_, row| row[1] = "20.000".to_owned()), "says nothing about the model");
    // The first 1 500 s of the cycle are a soak.
    assert_refused(&rows[..150], "no verdict can be drawn from it");
}

#[test]
fn a_record_that_is_too_short_gets_no_verdict() {
    let rows = cycle();
    assert_refused(&rows[250..310], "has 60 rows: a diagnosis needs at least 100");
    assert_refused(&rows[..2], "expected at least 3 rows of numbers, found 2");
}

#[test]
fn a_rate_without_noise_is_no_measurement() {
    assert_refused(&changed(&cycle(), |_, row| row[2] = "0.0".to_owned()), "the rate has no noise at all");
}

#[test]
fn rows_out_of_order_and_rows_that_are_there_twice_are_named() {
    let rows = cycle();
    let mut swapped = rows.clone();
    swapped.swap(10, 11);
    assert_refused(&swapped, "line 13, column time_s: times must increase strictly, found 100.0 after 110 s");
    let mut doubled = rows;
    doubled.insert(100, doubled[99].clone());
    assert_refused(&doubled, "line 102, column time_s: times must increase strictly, found 990.0 after 990 s");
}

#[test]
fn a_channel_without_a_single_number_is_one_fault() {
    for nothing in ["nan", ""] {
        let (code, answer, errors) = diagnose_with("g-control-zyl", &cycle(), Some(nothing));
        assert_eq!((code, answer.as_str()), (2, ""), "{errors}");
        assert!(errors.contains("column dead_v holds no finite number in any of its 2041 rows"), "{errors}");
        assert!(errors.contains("leave the column out"), "{errors}");
        assert_eq!(errors.matches("error:").count(), 1, "{errors}");
    }
    let (_, _, errors) = diagnose_with("g-control-zyl", &changed(&cycle(), |_, row| row[2] = "nan".to_owned()), None);
    assert!(errors.contains("column rate_deg_per_h holds no finite number"), "{errors}");
}
