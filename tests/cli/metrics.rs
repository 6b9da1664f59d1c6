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
duration                               s   20.000000
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
