//! `compare`: what it says, writes and refuses.

use super::{code, folder_with, json, root, run, run_in, stderr, stdout};

const COIL: &str = "tests/data/records/c-spool/coil.toml";
const RECORD: &str = "tests/data/records/c-spool/calibration.csv";

#[test]
#[ignore = "long: --include-ignored"]
fn the_words_name_the_regime_in_which_a_hidden_spool_acts() {
    let output = run(&["compare", COIL, RECORD]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.starts_with("c-spool with dip: missing — the model lacks something\n"), "{text}");
    // How many seconds follows from the film that was found.
    let words = ["of the squared error lies in the 8", " s after each change of ramp"];
    assert!(text.lines().any(|l| l.trim_start().starts_with("74 %") && words.iter().all(|w| l.contains(w))), "{text}");
    assert_eq!(code(&run(&["compare", COIL, RECORD, "--strict", "-q"])), 1);
}

#[test]
#[ignore = "long: --include-ignored"]
fn the_words_name_the_dependence_through_which_a_mismatch_of_the_halves_acts() {
    let folder = "tests/data/records/d-mismatch";
    let output = run(&["compare", &format!("{folder}/coil.toml"), &format!("{folder}/calibration.csv")]);
    let first = stdout(&output).lines().find(|l| l.contains("the residual follows")).unwrap_or_default();
    assert_eq!(first.trim(), "the residual follows dT/dt (correlation 0.99)");
}

#[test]
#[ignore = "long: --include-ignored"]
fn the_document_has_the_keys_that_scripts_read() {
    let answer = json(&["compare", COIL, RECORD]);
    assert_eq!(answer["schema_version"], 1);
    assert_eq!(answer["verdict"], "missing");
    let record = &answer["records"][0];
    assert_eq!(record["file"], RECORD);
    assert_eq!(record["rows"], 2041);
    for key in
        ["rmse_deg_per_h", "nrmse_fit_percent", "noise_floor_deg_per_h", "reduced_chi_square", "offset_deg_per_h"]
    {
        assert!(record[key].as_f64().is_some_and(f64::is_finite), "{key}");
    }
    let noise = &record["noise"];
    for key in ["white_deg_per_h", "white_standard_error_deg_per_h", "wander_deg_per_h", "unresolved_air_deg_per_h"] {
        assert!(noise[key].as_f64().is_some_and(|v| v.is_finite() && v >= 0.0), "{key}: {noise}");
    }
    let regimes = record["regimes"].as_array().unwrap();
    let sum = |key: &str| regimes.iter().map(|r| r[key].as_f64().unwrap()).sum::<f64>();
    assert!((sum("share_of_squared_error") - 1.0).abs() < 1e-9);
    assert_eq!(sum("rows"), 2041.0);
    assert!(regimes.iter().all(|r| r["name"].is_string() && r["rmse_deg_per_h"].is_number()));
    let inputs = &answer["inputs"];
    assert_eq!(inputs["model_file"], COIL);
    assert_eq!(inputs["records"][0]["sha256"].as_str().map(str::len), Some(64));
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_folder_gets_document_tables_pictures_and_a_page_that_report_makes_again() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("day").display().to_string();
    let written = run(&["compare", COIL, RECORD, "-o", &out, "-q"]);
    assert_eq!(code(&written), 0, "{}", stderr(&written));
    let file = |name: &str| std::fs::read_to_string(folder.path().join("day").join(name)).unwrap();
    for picture in ["prediction", "residual", "temperature", "shares", "states", "autocorrelation"] {
        assert!(file(&format!("record-1-{picture}.svg")).starts_with("<svg"), "{picture}");
    }
    assert_eq!(file("record-1.csv").lines().count(), 2042);
    let page = file("report.html");
    for needed in ["74 % of the squared error", "°/h", "SHA-256", "coilwright 0.1.0", "Ljung", "</svg>", "heating ramp"]
    {
        assert!(page.contains(needed), "{needed}");
    }
    let again = run(&["report", &out]);
    assert_eq!(code(&again), 0, "{}", stderr(&again));
    assert_eq!(page, file("report.html"));
}

#[test]
fn a_folder_of_a_search_and_damaged_documents_are_refused() {
    let (folder, run_toml) = folder_with("run.toml", "command = \"optimise\"\n");
    let shown = folder.path().display().to_string();
    let output = run(&["compare", COIL, RECORD, "-o", &shown]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("holds a search"), "{}", stderr(&output));
    std::fs::remove_file(run_toml).unwrap();
    std::fs::write(folder.path().join("comparison.json"), "{ \"model\": 3 }").unwrap();
    let output = run(&["report", &shown]);
    assert_eq!((code(&output), stdout(&output)), (2, ""));
    assert!(stderr(&output).contains("cannot be understood as a comparison"), "{}", stderr(&output));
}

#[test]
fn records_that_are_none_are_refused_with_line_and_remedy() {
    let header = "time_s,temperature_c,rate_deg_per_h\n";
    let cases = [
        ("", "the file is empty"),
        (header, "at least 3 rows"),
        ("time_s,temp,rate_deg_per_h\n0,20,1\n", "column temperature_c is missing"),
        (&format!("{header}0,20,1\n0,20,1\n20,20,1\n"), "time"),
        (&format!("{header}0,20,1\n10,nan,1\n20,20,1\n"), "NaN"),
        ("time_s;temperature_c;rate_deg_per_h\n0;20;1\n", "at least 3 rows"),
    ];
    for (text, expected) in cases {
        let (folder, _) = folder_with("record.csv", text);
        let coil = root().join(COIL).display().to_string();
        let output = run_in(folder.path(), &["compare", &coil, "record.csv"]);
        assert_eq!((code(&output), stdout(&output)), (2, ""), "{text}");
        let found = stderr(&output).to_lowercase();
        assert!(found.contains(&expected.to_lowercase()) && found.contains("record.csv"), "{expected}: {found}");
    }
    let output = run(&["compare", COIL, "absent.csv"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("absent.csv"), "{}", stderr(&output));
}

/// The chamber's first day with further thermometers: at the outermost layer as the sensor itself, in kelvin; five kelvin above it at the
/// innermost; and on the spool, in °F.
fn with_thermometers() -> (tempfile::TempDir, String) {
    let plain = std::fs::read_to_string(root().join("examples/chamber-day-1.csv")).unwrap();
    let mut text = String::new();
    for line in plain.lines().filter(|line| !line.starts_with('#')).take(160) {
        let cells: Vec<&str> = line.split(',').collect();
        text += &match cells[1].parse::<f64>() {
            Ok(c) => format!("{line},{},{},{}\n", c + 273.15, c + 5.0, 1.8 * c + 32.0),
            Err(_) => format!("{line},Tk,temperature_layer_1_c,Ts\n"),
        };
    }
    let (folder, path) = folder_with("record.csv", text);
    (folder, path.display().to_string())
}

#[test]
#[ignore = "long: --include-ignored"]
fn further_thermometers_are_set_beside_their_layers_and_none_is_dropped_unsaid() {
    let (_folder, record) = with_thermometers();
    let columns = "--columns=layer_12=Tk:k,spool=Ts:f";
    let model = "examples/chamber-coil.toml";
    let output = run(&["compare", model, &record, columns, "--format", "json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let found: serde_json::Value = serde_json::from_str(stdout(&output)).unwrap();
    let sensors = found["records"][0]["sensors"].as_array().unwrap();
    let number = |sensor: &serde_json::Value, key: &str| sensor[key].as_f64().unwrap();
    let outer = sensors.iter().find(|s| s["layer"] == 12).unwrap();
    assert_eq!(outer["column"], "temperature_layer_12_c");
    // A layer's temperature is that of the middle of the time that a rate is a mean over: 5 s of a ramp before the reading.
    assert!(number(outer, "mean_difference_c").abs() < 0.05 && number(outer, "rms_difference_c") < 0.5, "{outer}");
    let inner = sensors.iter().find(|s| s["layer"] == 1).unwrap();
    // The innermost layer of a half space lags behind the outermost in a ramp: as what the record's readings drive says.
    let table = run(&["temperatures", model, &record, columns]);
    let layer_1 = |line: &str| line.split(',').nth(2).and_then(|cell| cell.parse::<f64>().ok());
    let layers: Vec<f64> = stdout(&table).lines().filter_map(layer_1).collect();
    let readings = std::fs::read_to_string(&record).unwrap();
    let reading = |line: &str| line.split(',').nth(1).and_then(|cell| cell.parse::<f64>().ok());
    let readings: Vec<f64> = readings.lines().filter_map(reading).collect();
    assert_eq!(layers.len(), readings.len());
    let lag = readings.iter().zip(&layers).map(|(r, l)| r - l).sum::<f64>() / layers.len() as f64;
    assert!(lag > 1.0 && (number(inner, "mean_difference_c") - 5.0 - lag).abs() < 0.05, "{inner} beside {lag}");
    let with: Vec<&str> =
        found["records"][0]["correlations"].as_array().unwrap().iter().filter_map(|c| c["with"].as_str()).collect();
    assert!(with.contains(&"temperature_spool_c"), "{with:?}");
    let said = stderr(&output);
    for words in ["column Tk is a further thermometer, temperature_layer_12_c", "column Ts is a further thermometer"] {
        assert!(said.contains(words), "{said}");
    }
    let words = run(&["compare", model, &record, columns]);
    assert!(stdout(&words).contains("thermometer"), "{}", stdout(&words));
    let beyond = run(&["compare", model, &record, "--columns=layer_13=Tk:k"]);
    assert!(code(&beyond) == 2 && stderr(&beyond).contains("expected a layer of the coil, 1 (innermost) to 12"));
    let unknown = run(&["compare", model, &record, "--columns=layer_0=Tk:k"]);
    assert!(
        code(&unknown) == 2 && stderr(&unknown).contains("layer_1, layer_2 and so on, flange"),
        "{}",
        stderr(&unknown)
    );
}

#[test]
fn thermometers_of_a_model_file_are_columns_that_effects_read() {
    let (folder, record) = with_thermometers();
    let model = std::fs::read_to_string(root().join("examples/chamber-coil.toml")).unwrap();
    let mapped = model
        + "\n[record]\nlayer_12 = \"Tk:k\"\nspool = \"Ts:f\"\n[[effect]]\nkind = \"channel:temperature_spool_c\"\n"
        + "gain_deg_per_h_per_unit = 0.001\n";
    let path = folder.path().join("coil.toml");
    std::fs::write(&path, mapped).unwrap();
    let model = path.display().to_string();
    let checked = run(&["check", &model]);
    assert_eq!(code(&checked), 0, "{}", stderr(&checked));
    // The effect reads °C, whatever the file has: the offset moves by as much as the mean temperature says.
    let offset = |model: &str| {
        let found = json(&["compare", model, &record]);
        found["records"][0]["offset_deg_per_h"].as_f64().unwrap()
    };
    let without = std::fs::read_to_string(&path).unwrap().replace("= 0.001", "= 0.0");
    let still = folder.path().join("still.toml");
    std::fs::write(&still, without).unwrap();
    let moved = offset(&model) - offset(&still.display().to_string());
    let text = std::fs::read_to_string(&record).unwrap();
    let temperatures: Vec<f64> = text.lines().filter_map(|l| l.split(',').nth(1)?.parse().ok()).collect();
    let mean_c = temperatures.iter().sum::<f64>() / temperatures.len() as f64;
    assert!((moved + 0.001 * mean_c).abs() < 0.005, "{moved} {mean_c}");
    let passed = run(&["compensate", &model, &record]);
    assert_eq!(code(&passed), 0, "{}", stderr(&passed));
}
