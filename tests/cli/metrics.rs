//! `metrics`: what it says, writes and refuses.

use serde_json::Value;

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
bias                                 °/h           3
bias stability, means over 10 s      °/h     2.64575
bias instability (Allan minimum)     °/h           -
at averaging time                      s           -
angle random walk                   °/√h           -
rate random walk                  °/h/√h           -
flicker                              °/h           -
quantisation                      arcsec           -
temperature sensitivity           °/h/°C           -
peak to peak                         °/h           5
peak to peak of the means            °/h           5
drift angle                            °       0.025
duration                               s          20

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
#[ignore = "long: --include-ignored"]
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

#[test]
fn text_has_the_digits_that_mean_something_and_stamps_of_seconds_since_1970_are_a_second_apart() {
    let rows = white_record(4000, 1.0, 1.0);
    let epoch: String = rows
        .lines()
        .map(|line| match line.split_once(',') {
            Some((time, rest)) if time != "time_s" => {
                format!("{:.2},{rest}\n", 1.7e9 + 0.1 * time.parse::<f64>().unwrap())
            }
            _ => line.to_owned() + "\n",
        })
        .collect();
    let (_folder, path) = folder_with("epoch.csv", epoch);
    let file = path.display().to_string();
    let found = json(&["metrics", &file]);
    assert_eq!(found["bias_stability_average_s"], 10.0, "{found}");
    for noise in found["records"][0]["noise"].as_array().unwrap() {
        // What may be absent is 0, not a number that no octave shows.
        let [value, low, high] = ["value", "low", "high"].map(|key| noise[key].as_f64().unwrap());
        assert!(value == 0.0 || value > 1e-3 * high, "{noise}");
        assert!(low <= value && value <= high, "{noise}");
    }
    let said = run(&["metrics", &file]);
    let text = stdout(&said);
    assert!(text.contains("not seen") && text.contains("at most"), "{text}");
    assert!(!text.contains("0.000000") && !text.contains("9.9999"), "{text}");
}

/// A gyro on a table at latitude 30°, its axis upright: counts, with an error of 500 ppm that grows by 10 ppm a kelvin.
fn on_a_table(temperatures_c: &[f64], sign: f64) -> String {
    let mut text = "t;T1;F;Table\n".to_owned();
    let mut time_s = 0;
    for temperature_c in temperatures_c {
        for rate_deg_per_s in [-50.0, -20.0, 0.0, 20.0, 50.0] {
            for row in 0..30 {
                let table = rate_deg_per_s * (0.25 * f64::from(row + 1)).min(1.0);
                let error = 500e-6 + 10e-6 * (temperature_c - 20.0);
                // Twelve and a half counts are a degree an hour; the earth adds 7.520534, the gyro itself 0.3.
                let rate_deg_per_h = (1.0 + error) * (table * 3600.0 + sign * 7.520_534) + 0.3;
                let wiggle = 0.02 * f64::from((7 * row) % 5 - 2);
                let cells =
                    [temperature_c.to_string(), (12.5 * (rate_deg_per_h + wiggle)).to_string(), table.to_string()];
                text += &format!("{time_s};{}\n", cells.join(";").replace('.', ","));
                time_s += 1;
            }
        }
    }
    text
}

#[test]
fn a_record_on_a_rate_table_gives_the_scale_factor_from_raw_counts() {
    let warm: Vec<f64> = vec![10.0, 30.0, 50.0, 30.0, 10.0];
    let (_folder, path) = folder_with("table.csv", on_a_table(&warm, 1.0));
    let columns = "--columns=time=t:s,temperature=T1:c,rate=F:counts,scale=12.5,table=Table:deg_per_s";
    let file = path.display().to_string();
    let found = json(&["metrics", &file, columns, "--latitude", "30", "--elevation", "90"]);
    let scale = &found["records"][0]["scale_factor"];
    let number = |value: &Value| value.as_f64().unwrap();
    let at_c = number(&scale["at_temperature_c"]);
    assert!((number(&scale["error_ppm"]["value"]) - 500.0 - 10.0 * (at_c - 20.0)).abs() < 0.5, "{scale}");
    assert!((number(&scale["temperature_coefficient_ppm_per_k"]["value"]) - 10.0).abs() < 0.05, "{scale}");
    assert!(
        number(&scale["hysteresis_ppm"]["value"]).abs() < 1.0 && number(&scale["nonlinearity_ppm"]) < 1.0,
        "{scale}"
    );
    assert!(
        (number(&scale["raw_units_per_deg_per_h"]) / 12.5 / (1.0 + 1e-6 * number(&scale["error_ppm"]["value"])) - 1.0)
            .abs()
            < 1e-12
    );
    assert_eq!((scale["runs"].as_u64(), scale["stretches"].as_array().map(Vec::len)), (Some(5), Some(25)));
    assert_eq!(found["scale_factor"], *scale);
    assert!((number(&found["records"][0]["earth_rate_deg_per_h"]) - 7.520_534).abs() < 1e-5);
    assert!((number(&found["records"][0]["bias_without_earth_deg_per_h"]) - 0.3).abs() < 0.02, "{found}");
    let words = run(&["metrics", &file, columns]);
    let said = stdout(&words);
    assert!(said.contains("25 even stretches of the table in 5 runs") && said.contains("ppm/K"), "{said}");
    assert!(stderr(&words).contains("is the table's rate and is taken off"), "{}", stderr(&words));
}

#[test]
fn steps_of_the_offset_between_attitudes_give_the_gyros_own_bias() {
    let record = |offset: f64| {
        let rows = (0..400).map(|i| format!("{i},20,{}\n", offset + 0.01 * f64::from((7 * i) % 5 - 2)));
        "time_s,temperature_c,rate_deg_per_h\n".to_owned() + &rows.collect::<String>()
    };
    let (folder, up) = folder_with("up.csv", record(1.01 * 7.520_534 + 0.3));
    let down = folder.path().join("down.csv");
    std::fs::write(&down, record(-1.01 * 7.520_534 + 0.3)).unwrap();
    let (up, down) = (up.display().to_string(), down.display().to_string());
    let found = json(&["metrics", &up, &down, "--latitude", "30", "--elevation", "90,-90"]);
    let positions = &found["positions"];
    assert!((positions["scale_error_ppm"]["value"].as_f64().unwrap() - 10_000.0).abs() < 1.0, "{positions}");
    assert!((positions["bias_deg_per_h"].as_f64().unwrap() - 0.3).abs() < 1e-6, "{positions}");
    for (arguments, wanted) in [
        (["--latitude", "100", "--elevation", "90"], "--latitude: expected -90 to 90 °, found 100"),
        (["--latitude", "30", "--elevation", "0"], "--azimuth: is needed where the axis is not upright"),
        (["--latitude", "30", "--elevation", "1,2,3"], "one for each of the 2, found 3"),
    ] {
        let refused = run(&[&["metrics", &up, &down][..], &arguments[..]].concat());
        assert!(code(&refused) == 2 && stderr(&refused).contains(wanted), "{}", stderr(&refused));
    }
}
