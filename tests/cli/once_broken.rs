//! What once made a command panic, run on or say NaN: each ends in numbers or one error, within the bounds of the damaged files.

use std::path::Path;

use super::mangled::{Ran, bench, bounded, fault};

const ROWS: usize = 160;

/// Times and rates of a record.
fn record(time_s: impl Fn(usize) -> f64, rate_deg_per_h: impl Fn(usize) -> f64) -> String {
    let row = |i: usize| {
        let celsius = 20.0 + 0.05 * (i as f64).min(90.0) + 0.001 * ((i * 7919) % 13) as f64;
        format!("{:?},{celsius:.4},{:?}\n", time_s(i), rate_deg_per_h(i))
    };
    let rows: String = (0..ROWS).map(row).collect();
    format!("time_s,temperature_c,rate_deg_per_h\n{rows}")
}

fn noise(row: usize) -> f64 {
    0.01 * ((row * 104_729) % 17) as f64 + 0.1 * (row as f64 / 30.0).sin()
}

#[test]
#[ignore = "long: --include-ignored"]
fn gaps_close_stamps_and_a_constant_rate_end_in_numbers_or_one_error() {
    let folder = tempfile::tempdir().unwrap();
    bench(folder.path());
    let with_gap = |at: usize, gap_s: f64| move |i: usize| 10.0 * i as f64 + if i >= at { gap_s } else { 0.0 };
    let mut records = Vec::new();
    for (at, gap_s) in [(1, 1e9), (70, 1e4), (159, 1e6), (70, 4e-11 - 10.0), (1, 4e-11 - 10.0)] {
        records.push((format!("a step of {:e} s before row {at}", gap_s + 10.0), record(with_gap(at, gap_s), noise)));
    }
    for step_s in [2e-6, 1e8] {
        records.push((format!("rows {step_s:e} s apart"), record(|i| step_s * i as f64, noise)));
    }
    // The usual interval is learned where most rows are close.
    let mostly_close = |i: usize| if i < 100 { 2e-6 * i as f64 } else { 10.0 * i as f64 };
    records.push(("rows 2e-6 s, then 10 s apart".to_owned(), record(mostly_close, noise)));
    let every_third = |i: usize| 10.0 * i as f64 + 1e5 * (i / 3) as f64;
    records.push(("a gap behind every third row".to_owned(), record(every_third, noise)));
    records.push(("a constant rate and a gap".to_owned(), record(with_gap(10, 1e9 - 10.0), |_| 3.538_76)));
    records.push(("a rate with one step".to_owned(), record(|i| 10.0 * i as f64, |i| if i < 64 { 1.0 } else { 2.0 })));
    let commands: [&[&str]; 3] = [
        &["metrics", "odd.csv", "--format", "json"],
        &["compensate", "model.toml", "odd.csv"],
        &["compensate", "model.toml", "day.csv", "--fit", "odd.csv"],
    ];
    let mut failures = Vec::new();
    for (name, text) in &records {
        std::fs::write(folder.path().join("odd.csv"), text).unwrap();
        for arguments in commands {
            let ran = bounded(folder.path(), arguments);
            failures.extend(
                fault(&ran, text, &folder.path().join("out")).map(|what| format!("{name}: {arguments:?}: {what}")),
            );
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

/// Runs a command on a file that was written before, and says what is wrong with that.
fn tried(folder: &Path, file: &str, arguments: &[&str], failures: &mut Vec<String>) -> Ran {
    let given = std::fs::read_to_string(folder.join(file)).unwrap();
    let ran = bounded(folder, arguments);
    failures.extend(
        fault(&ran, &given, &folder.join("out")).map(|what| format!("{arguments:?}: {what}: {:.300}", ran.said)),
    );
    ran
}

#[test]
fn numbers_beyond_what_is_physical_are_refused_by_line_and_never_come_out_as_nan() {
    let folder = tempfile::tempdir().unwrap();
    bench(folder.path());
    let whole = std::fs::read_to_string(folder.path().join("record.csv")).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let mut failures = Vec::new();
    for (column, number) in [(2, "-1.513e+299"), (2, "1e308"), (1, "1e300"), (0, "1e308"), (3, "-1e305")] {
        let mut cells: Vec<&str> = lines[161].split(',').collect();
        cells[column] = number;
        let text = [&lines[..161], &[cells.join(",").as_str()]].concat().join("\n") + "\n";
        std::fs::write(folder.path().join("record.csv"), text).unwrap();
        for arguments in [
            &["metrics", "record.csv", "--format", "json", "-o", "out"][..],
            &["compensate", "model.toml", "day.csv", "--fit", "record.csv"],
            &["compare", "model.toml", "record.csv", "--format", "json"],
            &["diagnose", "model.toml", "record.csv", "--format", "json"],
        ] {
            // A stream of rates does not look at further columns.
            let is_looked_at = column < 3 || arguments[0] != "metrics";
            let ran = tried(folder.path(), "record.csv", arguments, &mut failures);
            if is_looked_at && !(ran.code == Some(2) && ran.said.contains("line 162") && ran.said.contains("beyond")) {
                failures.push(format!("{arguments:?} with {number}: {:?}: {:.300}", ran.code, ran.said));
            }
        }
        // A stream goes on behind a row that it cannot read.
        tried(folder.path(), "record.csv", &["compensate", "model.toml", "record.csv"], &mut failures);
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn a_schedule_over_profiles_of_a_thousand_ramps_is_verified_within_bounds() {
    let folder = tempfile::tempdir().unwrap();
    bench(folder.path());
    let model = std::fs::read_to_string(folder.path().join("model.toml")).unwrap();
    std::fs::write(folder.path().join("model.toml"), model.replace("segments = 3", "segments = 1_000")).unwrap();
    let mut failures = Vec::new();
    for arguments in [&["schedule", "model.toml", "-o", "out"][..], &["verify", "model.toml", "out/schedule.csv"]] {
        let ran = tried(folder.path(), "model.toml", arguments, &mut failures);
        assert!(ran.code == Some(0) || !failures.is_empty(), "{arguments:?}: {}", ran.said);
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
