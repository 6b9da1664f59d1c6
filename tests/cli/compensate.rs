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

/// A short day: the temperature goes through a cycle of its own, and the rate follows its value.
fn day_that_follows(start_c: f64, bias_deg_per_h: f64, slope: f64, seed: u32) -> String {
    let rows = (0..1500_u32).map(|i| {
        let temperature_c = start_c + 8.0 * (f64::from(i) / 150.0).sin();
        let noise = 0.02 * (f64::from((i * 7919 + seed * 104_729) % 101) - 50.0) / 29.2;
        format!("{},{temperature_c},{}\n", 10 * i, slope * temperature_c + bias_deg_per_h + noise)
    });
    "time_s,temperature_c,rate_deg_per_h\n".to_owned() + &rows.collect::<String>()
}

#[test]
#[ignore = "long: --include-ignored"]
fn each_of_several_records_is_left_out_in_turn_and_what_only_fits_is_said() {
    let (folder, _) = folder_with("1.csv", day_that_follows(20.0, 0.3, 0.5, 1));
    let place = |name: &str| folder.path().join(name).display().to_string();
    for (name, start_c, seed) in [("2.csv", 30.0, 2), ("3.csv", 25.0, 3)] {
        std::fs::write(place(name), day_that_follows(start_c, 0.3, 0.5, seed)).unwrap();
    }
    let (first, second, third) = (place("1.csv"), place("2.csv"), place("3.csv"));
    let picture = place("left.svg");
    let fits = ["--fit", &first, "--fit", &second, "--fit", &third, "--all-methods"];
    let found = json(&[&["compensate", COIL][..], &fits, &["-o", &picture]].concat());
    assert_eq!(
        (found["method"].as_str(), found["methods"].as_array().map(Vec::len)),
        (Some("all"), Some(0)),
        "{found}"
    );
    let left_out = &found["leave_one_out"];
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let method = |name: &str| left_out["methods"].as_array().unwrap().iter().find(|m| m["method"] == name).unwrap();
    // A line is a line on every day: what is left is the noise, 0.02 °/h.
    let regression = method("regression");
    assert!(number(&regression["left_out_rms_deg_per_h"]) < 0.022, "{regression}");
    assert_eq!((regression["only_fits"].as_bool(), regression["reason"].is_null()), (Some(false), true));
    for (place, file) in [&first, &second, &third].into_iter().enumerate() {
        assert_eq!(regression["records"][place]["file"], **file);
        assert!(number(&regression["records"][place]["measures"]["peak_to_peak_deg_per_h"]) < 0.1, "{regression}");
    }
    // The mean of the others knows nothing of a slope: days at 20, 30 and 25 °C with a cycle of ±8 °C.
    assert!(number(&left_out["by_offset_rms_deg_per_h"]) > 3.0, "{left_out}");
    assert!(std::fs::read_to_string(&picture).unwrap().contains("regression"));
    // The one record that was left out is what a fit to the two others leaves of it.
    let two = ["compensate", COIL, &third, "--fit", &first, "--fit", &second, "--all-methods"];
    let by_others = json(&two);
    let of_third = by_others["methods"].as_array().unwrap().iter().find(|m| m["method"] == "regression").unwrap();
    assert_eq!(of_third["rms_deg_per_h"], regression["records"][2]["rms_deg_per_h"]);
    assert_eq!(by_others["leave_one_out"]["records"].as_array().map(Vec::len), Some(2));
    let words = run(&[&["compensate", COIL][..], &fits].concat());
    let said = stdout(&words);
    assert!(said.contains("3 records, each compensated by what was fitted to the others"), "{said}");
    assert!(said.contains(&format!("{second} left out")) && said.contains("peak to peak"), "{said}");
    // Where the line is another one every day, a method that follows it is worth nothing on a day it was not shown.
    std::fs::write(place("2.csv"), day_that_follows(30.0, 0.3, -0.5, 2)).unwrap();
    let found = json(&["compensate", COIL, "--fit", &first, "--fit", &second, "--all-methods"]);
    let learned =
        found["leave_one_out"]["methods"].as_array().unwrap().iter().find(|m| m["method"] == "learned").unwrap();
    assert_eq!(learned["only_fits"], true, "{learned}");
    assert!(learned["reason"].as_str().unwrap().contains("it only fits"), "{learned}");
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_physical_compensator_is_fitted_to_several_records_at_once() {
    let validation = "tests/data/records/a-control/validation.csv";
    let rms = |fits: &[&str]| {
        let answer = json(&[&["compensate", COIL, validation][..], fits].concat());
        answer["summary"]["compensated_deviation_deg_per_h"].as_f64().unwrap()
    };
    let one = rms(&["--fit", RECORD]);
    let both = rms(&["--fit", RECORD, "--fit", validation]);
    // Two days of one chamber say the same: knowing both is no worse on either.
    assert!(both < 1.02 * one, "{both} {one}");
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_compensator_that_makes_a_record_worse_says_so() {
    let at = |name: &str| format!("examples/{name}");
    let (coil, first, second) = (at("chamber-coil.toml"), at("chamber-day-1.csv"), at("chamber-day-2.csv"));
    // The model as its designer believes it to be: heat goes into a half space, where a bore ends the pack.
    let ran = run(&["compensate", &coil, &second, "--fit", &first]);
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(said.contains("caution: the compensated rate scatters by 4.89") && said.contains("own by 1.28"), "{said}");
    let answer = json(&["compensate", &coil, &second, "--fit", &first]);
    assert!(answer["summary"]["caution"].as_str().unwrap().contains("worse"), "{}", answer["summary"]);
    let all = json(&["compensate", &coil, &second, "--fit", &first, "--all-methods"]);
    let reason =
        |name: &str| all["methods"].as_array().unwrap().iter().find(|m| m["method"] == name).unwrap()["reason"].clone();
    assert!(reason("physical").as_str().unwrap().contains("worse"), "{all}");
    assert!(reason("regression").is_null(), "{all}");
    // One that helps has none.
    let helped = json(&["compensate", COIL, "tests/data/records/a-control/validation.csv", "--fit", RECORD]);
    assert!(helped["summary"].get("caution").is_none(), "{}", helped["summary"]);
}

#[test]
fn a_model_with_a_scale_factors_error_is_not_exported_as_a_physical_compensator() {
    let text = std::fs::read_to_string(root().join(COIL)).unwrap();
    let text = text + "\n[[effect]]\nkind = \"scale_factor_error\"\nerror_ppm = 300.0\n";
    let (folder, coil) = folder_with("coil.toml", text);
    let (coil, prefix) = (coil.display().to_string(), folder.path().join("embedded").display().to_string());
    let refused = run(&["compensate", &coil, "--export", &prefix, "--interval", "10"]);
    assert_eq!(code(&refused), 2, "{}", stderr(&refused));
    assert!(stderr(&refused).contains("scale_factor_error would be lost"), "{}", stderr(&refused));
    assert!(!folder.path().join("embedded.h").exists());
    // The others know nothing of the model.
    let lines = run(&["compensate", &coil, "--fit", RECORD, "--method", "piecewise", "--export", &prefix]);
    assert_eq!(code(&lines), 0, "{}", stderr(&lines));
    assert!(folder.path().join("embedded.h").exists());
}
