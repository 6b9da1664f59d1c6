//! `compensate`: lines in, lines out.

use super::{code, folder_with, json, root, run, run_in, stderr, stdout};

const COIL: &str = "tests/data/records/a-control/coil.toml";
const RECORD: &str = "tests/data/records/a-control/calibration.csv";

#[test]
fn every_line_comes_out_in_order_with_the_compensated_rate_behind_it() {
    let output = run(&["compensate", COIL, RECORD, "-q"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let mut lines = stdout(&output).lines();
    let header = lines.next().unwrap_or_default();
    assert!(header.starts_with("time_s,temperature_c,rate_deg_per_h"), "{header}");
    assert!(header.contains("rate_compensated_deg_per_h"), "{header}");
    let times: Vec<f64> = lines.map(|l| l.split(',').next().unwrap().parse().unwrap()).collect();
    assert_eq!(times.len(), 2041);
    assert!(times.windows(2).all(|w| w[0] < w[1]));
}

#[test]
fn lines_that_are_no_rows_are_flagged_and_none_is_lost() {
    let text = "time_s,temperature_c,rate_deg_per_h\n0,20,0.1\n10,20,0.2\nnonsense\n20,nan,0.1\n15,20,0.1\n30,20,0.1\n";
    let (folder, _) = folder_with("odd.csv", text);
    let coil = root().join(COIL).display().to_string();
    let output = run_in(folder.path(), &["compensate", &coil, "odd.csv", "-q"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let lines: Vec<&str> = stdout(&output).lines().collect();
    assert_eq!(lines.len(), 7, "{lines:?}");
    assert!(lines[3].contains("malformed") && lines[4].contains("temperature_held"), "{lines:?}");
    assert!(lines[5].contains("clock_back"), "{lines:?}");
}

#[test]
fn the_document_has_the_keys_that_scripts_read() {
    let answer = json(&["compensate", COIL, RECORD, "-q"]);
    assert_eq!(answer["schema_version"], 1);
    assert_eq!(answer["method"], "physical");
    assert_eq!(answer["summary"]["rows"], 2041);
}

#[test]
fn requests_that_cannot_be_carried_out_are_refused() {
    let cases: [(&[&str], &str); 4] = [
        (&["compensate", COIL, "absent.csv"], "absent.csv"),
        (&["compensate", "absent.toml", RECORD], "absent.toml"),
        (&["compensate", COIL, RECORD, "--all-methods"], "--fit"),
        (&["compensate", COIL, COIL], "coil.toml"),
    ];
    for (arguments, expected) in cases {
        let output = run(arguments);
        assert_eq!((code(&output), stdout(&output)), (2, ""), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(expected), "{expected}: {}", stderr(&output));
    }
}

/// A day whose rate follows the temperature by a line, with the offset of its own start-up and a little noise.
fn day_with_offset(offset_deg_per_h: f64) -> String {
    let rows = (0..2000).map(|i| {
        let temperature_c = 20.0 + 0.01 * f64::from((i - 700).max(0));
        let noise = 0.02 * f64::from((7 * i) % 5 - 2);
        format!("{i},{temperature_c},{}\n", 0.5 * temperature_c + offset_deg_per_h + noise)
    });
    "time_s,temperature_c,rate_deg_per_h\n".to_owned() + &rows.collect::<String>()
}

#[test]
fn the_offset_of_another_start_up_stays_without_turn_on_and_goes_with_it() {
    let (folder, first) = folder_with("first.csv", day_with_offset(0.0));
    let other = folder.path().join("other.csv");
    std::fs::write(&other, day_with_offset(1.0)).unwrap();
    let coil = "tests/data/records/a-control/coil.toml";
    let (first, other) = (first.display().to_string(), other.display().to_string());
    let common = ["compensate", coil, &other, "--fit", &first, "--method", "regression"];
    let late = |output: &std::process::Output| -> f64 {
        assert_eq!(code(output), 0, "{}", stderr(output));
        let rates: Vec<f64> =
            stdout(output).lines().skip(1001).map(|l| l.split(',').nth(3).unwrap().parse().unwrap()).collect();
        rates.iter().sum::<f64>() / rates.len() as f64
    };
    assert!((late(&run(&common)) - 1.0).abs() < 0.01);
    let with = run(&[&common[..], &["--turn-on", "600"]].concat());
    assert!(late(&with).abs() < 0.01, "{}", late(&with));
    assert!(stderr(&with).contains("offset of this start-up, taken off: 1.0"), "{}", stderr(&with));
    let flagged = stdout(&with).lines().filter(|l| l.ends_with(",turn_on")).count();
    assert_eq!(flagged, 600);
    let document = json(&[&common[..], &["--turn-on", "600"]].concat());
    assert!((document["summary"]["turn_on_offset_deg_per_h"].as_f64().unwrap() - 1.0).abs() < 0.01, "{document}");
    let refused = run(&[&common[..], &["--turn-on", "0"]].concat());
    assert!(code(&refused) == 2 && stderr(&refused).contains("above zero"), "{}", stderr(&refused));
}
