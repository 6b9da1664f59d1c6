//! `metrics`: what it says, writes and refuses.

use super::{code, folder_with, json, run, run_in, stderr, stdout};

const RECORD: &str = "tests/data/records/a-control/calibration.csv";

#[test]
fn the_document_has_the_keys_that_scripts_read() {
    let answer = json(&["metrics", RECORD, RECORD]);
    assert_eq!(answer["schema_version"], 1);
    for key in [
        "bias_deg_per_h",
        "bias_stability_deg_per_h",
        "bias_instability_deg_per_h",
        "repeatability_deg_per_h",
        "temperature_sensitivity_deg_per_h_per_c",
        "angle_random_walk_deg_per_sqrt_h",
        "peak_to_peak_deg_per_h",
    ] {
        assert!(answer[key].is_number(), "{key}");
    }
    assert_eq!(answer["repeatability_deg_per_h"], 0.0);
    let slopes: Vec<f64> = answer["records"][0]["allan_noises"]
        .as_array()
        .unwrap()
        .iter()
        .map(|noise| noise["slope"].as_f64().unwrap())
        .collect();
    assert!(slopes.contains(&-0.5), "{slopes:?}");
}

#[test]
fn a_record_of_three_rows_gives_what_can_be_worked_out_by_hand() {
    let text = "time_s,temperature_c,rate_deg_per_h\n0,20,1\n10,20,2\n20,20,6\n";
    let (folder, _) = folder_with("record.csv", text);
    let output = run_in(folder.path(), &["metrics", "record.csv"]);
    let expected = "\
measure                             unit  record.csv
bias                                 °/h    3.000000
bias stability, means over 10 s      °/h    2.645751
bias instability (Allan minimum)     °/h           -
at averaging time                      s           -
angle random walk                   °/√h           -
rate random walk                  °/h/√h           -
flicker                              °/h           -
quantisation                      arcsec           -
temperature sensitivity           °/h/°C           -
peak to peak                         °/h    5.000000
peak to peak of the means            °/h    5.000000
drift angle                            °    0.025000
duration                               s   20.000000

caution: record.csv: too short or too irregular to tell noises apart: no noise coefficients
";
    assert_eq!((code(&output), stdout(&output)), (0, expected), "{}", stderr(&output));
}

#[test]
fn a_folder_gets_document_picture_and_a_page_that_report_makes_again() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    assert_eq!(code(&run(&["metrics", RECORD, "-o", &out, "-q"])), 0);
    let picture = std::fs::read_to_string(folder.path().join("allan-1.svg")).unwrap();
    assert!(picture.contains("angle random walk") && picture.contains("slope −½"));
    let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(page.contains("°/√h") && page.contains("SHA-256"));
    assert_eq!(code(&run(&["report", &out])), 0);
    assert_eq!(page, std::fs::read_to_string(folder.path().join("report.html")).unwrap());
}

#[test]
fn averaging_times_that_are_none_are_refused() {
    for average in ["0", "-1", "nan"] {
        let output = run(&["metrics", RECORD, &format!("--average={average}")]);
        assert_eq!((code(&output), stdout(&output)), (2, ""), "{average}");
        assert!(stderr(&output).contains("must be positive"), "{}", stderr(&output));
    }
}

/// White noise of a known strength, from a generator that needs no library.
fn white_record(rows: usize, interval_s: f64, deviation_deg_per_h: f64) -> String {
    let mut state = 1u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut text = "time_s,temperature_c,rate_deg_per_h\n".to_owned();
    for i in 0..rows {
        let gauss: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        text += &format!("{},20,{:.9}\n", interval_s * i as f64, 0.5 + deviation_deg_per_h * gauss);
    }
    text
}

#[test]
fn the_angle_random_walk_of_white_noise_lies_within_its_interval_and_nothing_else_is_seen() {
    let (folder, _) = folder_with("white.csv", white_record(6000, 2.0, 0.3));
    let path = folder.path().join("white.csv").display().to_string();
    let answer = json(&["metrics", &path]);
    // N = σ √τ0, in degrees an hour and seconds; an hour is sixty times sixty of them.
    let truth = 0.3 * 2f64.sqrt() / 60.0;
    let noise = answer["records"][0]["noise"].as_array().unwrap();
    let kinds: Vec<&str> = noise.iter().map(|n| n["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["white", "flicker", "rate_random_walk", "quantisation", "ramp"]);
    let number = |kind: usize, key: &str| noise[kind][key].as_f64().unwrap();
    assert!(number(0, "low") <= truth && truth <= number(0, "high"), "{answer}");
    assert!((number(0, "value") / truth - 1.0).abs() < 0.05);
    assert!((1..5).all(|kind| number(kind, "low") == 0.0), "{answer}");
    assert_eq!(answer["noise"], answer["records"][0]["noise"]);
    assert!(answer["drift_angle_deg"].as_f64().unwrap() > 1.0);
}

#[test]
fn what_compensate_writes_is_measured_by_its_compensated_rate() {
    let coil = "tests/data/records/a-control/coil.toml";
    let compensated = run(&["compensate", coil, RECORD, "-q"]);
    let (folder, _) = folder_with("compensated.csv", stdout(&compensated));
    let path = folder.path().join("compensated.csv").display().to_string();
    let (before, after) = (json(&["metrics", RECORD]), json(&["metrics", &path]));
    let spread = |answer: &serde_json::Value| answer["peak_to_peak_deg_per_h"].as_f64().unwrap();
    assert!(spread(&after) < 0.9 * spread(&before), "{} {}", spread(&before), spread(&after));
    let raw = json(&["metrics", &path, "--columns", "rate=rate_deg_per_h"]);
    assert_eq!(raw["peak_to_peak_deg_per_h"], before["peak_to_peak_deg_per_h"]);
    assert_eq!(code(&run(&["compare", coil, &path, "-q"])), 0);
}

#[test]
fn a_mapped_file_with_semicolons_decimal_commas_and_bad_rows_gives_the_plain_files_answer() {
    let plain = white_record(400, 60.0, 0.3);
    let mut other = "Status;Zeit;T1;Omega\n".to_owned();
    for (i, line) in plain.lines().skip(1).enumerate() {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        let row = format!("OK;{};{};{:.12}", cells[0] / 60.0, cells[1] + 273.15, cells[2] / 3600.0);
        other += &(row.replace('.', ",") + "\n");
        if i == 7 {
            other += "AUS;;;\nOK;3;293,15;0\n";
        }
    }
    let (folder, _) = folder_with("plain.csv", &plain);
    std::fs::write(folder.path().join("other.csv"), other).unwrap();
    let expected = json(&["metrics", &folder.path().join("plain.csv").display().to_string()]);
    let path = folder.path().join("other.csv").display().to_string();
    let mapping = ["--columns", "time=Zeit:min,temperature=T1:k,rate=Omega:deg_per_s"];
    let refused = run(&["metrics", &path, mapping[0], mapping[1]]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("--bad-rows skip"), "{}", stderr(&refused));
    let read = run(&["metrics", &path, mapping[0], mapping[1], "--bad-rows", "skip", "--format", "json"]);
    assert!(stderr(&read).contains("2 rows skipped"), "{}", stderr(&read));
    let found: serde_json::Value = serde_json::from_str(stdout(&read)).unwrap();
    for key in ["bias_deg_per_h", "peak_to_peak_deg_per_h", "angle_random_walk_deg_per_sqrt_h"] {
        let (a, b) = (found[key].as_f64().unwrap(), expected[key].as_f64().unwrap());
        assert!((a - b).abs() < 1e-6 * b.abs(), "{key}: {a} {b}");
    }
    let wrong = run(&["metrics", &path, "--columns", "time=Zeit:fortnights"]);
    assert!(stderr(&wrong).contains("expected a unit of s, ms"), "{}", stderr(&wrong));
}
