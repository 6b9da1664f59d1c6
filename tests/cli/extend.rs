//! `extend`: what it writes, shows and refuses.

use super::{code, run, stderr, stdout};

const COIL: &str = "examples/chamber-coil.toml";
const RECORD: &str = "examples/chamber-day-1.csv";

fn extend(arguments: &[&str]) -> (i32, String, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let new = folder.path().join("new.toml").display().to_string();
    let output = run(&[&["extend", COIL, "-o", &new][..], arguments].concat());
    let written = std::fs::read_to_string(&new).unwrap_or_default();
    (code(&output), stdout(&output).to_owned(), stderr(&output).to_owned(), written)
}

#[test]
#[ignore = "long: --include-ignored"]
fn an_effect_is_fitted_with_its_error_and_the_rest_of_the_file_stays_as_it_was() {
    let formula = ["--effect", "custom", "--formula", "a * dT_dt", "--parameter", "a=1"];
    let (code, text, errors, written) = extend(&[&formula[..], &["--fit", RECORD]].concat());
    assert_eq!(code, 0, "{errors}");
    let source = std::fs::read_to_string(super::root().join(COIL)).unwrap();
    let added = written.strip_prefix(&source).unwrap_or_else(|| panic!("{written}"));
    assert!(
        added.starts_with("\n[[effect]]\nkind = \"custom\"\nformula = \"a * dT_dt\"\nparameters = { a = "),
        "{added}"
    );
    assert!(added.contains(" ± "), "{added}");
    for needed in ["examples/chamber-day-1.csv (fitted): error ", "before °/h", "heating_ramp", "transient", " ± "] {
        assert!(text.contains(needed), "{needed}: {text}");
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn before_and_after_are_comparisons_of_every_record_given() {
    let (code, text, errors, written) = extend(&["--effect", "finite_pack", "--fit", RECORD, "--format", "json"]);
    assert_eq!(code, 0, "{errors}");
    let answer: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(answer["schema_version"], 1);
    let rmse = |side: &str| answer[side]["records"][0]["rmse_deg_per_h"].as_f64().unwrap();
    assert!(rmse("before") > 2.5 && rmse("after") < 0.22, "{} {}", rmse("before"), rmse("after"));
    for side in ["before", "after"] {
        assert_eq!(answer[side]["inputs"]["records"][0]["role"], "fitted");
        assert!(answer[side]["records"][0]["regimes"].as_array().is_some_and(|r| r.len() >= 4));
    }
    assert!(written.contains("\n[[effect]]\nkind = \"finite_pack\"\n\n# Learned from a record."), "{written}");
}

/// A record in which nothing is hidden, as counts of a gyro on a table whose scale factor is 300 ppm off and drifts by so much a kelvin.
fn counts_on_a_table(drift_ppm_per_k: f64) -> String {
    let plain = std::fs::read_to_string(super::root().join(CONTROL).join("calibration.csv")).unwrap();
    let mut text = "t,T1,F,Table\n".to_owned();
    for (row, line) in plain.lines().skip(1).enumerate() {
        let cells: Vec<f64> = line.split(',').take(3).map(|cell| cell.parse().unwrap()).collect();
        let [time_s, temperature_c, rate_deg_per_h] = cells[..] else { panic!("{line}") };
        let table_deg_per_s = [0.0, 1.0, -1.0][row / 40 % 3];
        let error = 300e-6 + 1e-6 * drift_ppm_per_k * (temperature_c - 20.0);
        let counts = 12.5 * (1.0 + error) * (3600.0 * table_deg_per_s + rate_deg_per_h);
        text += &format!("{time_s},{temperature_c},{counts:.4},{table_deg_per_s}\n");
    }
    text
}

const CONTROL: &str = "tests/data/records/g-control-zyl";

/// From raw output and table rate to a model that holds: what is hidden is the scale factor's error, which is named with its size
/// and, once declared, leaves hardly more than the record without it: the rows in which the table starts, one in forty, are
/// means over both of its rates.
#[test]
#[ignore = "long: --include-ignored"]
fn a_hidden_error_of_the_scale_factor_is_named_and_goes_with_the_model_that_declares_it() {
    let (folder, path) = super::folder_with("table.csv", counts_on_a_table(0.0));
    let (model, record) = (format!("{CONTROL}/coil.toml"), path.display().to_string());
    let columns = "--columns=time=t:s,temperature=T1:c,rate=F:counts,scale=12.5,table=Table:deg_per_s";
    let rmse = |found: &serde_json::Value| found["records"][0]["rmse_deg_per_h"].as_f64().unwrap();
    let plain = rmse(&super::json(&["compare", &model, &format!("{CONTROL}/calibration.csv"), "-q"]));

    let found = super::json(&["diagnose", &model, &record, columns, "-q"]);
    let named: Vec<&str> = found["effects"].as_array().unwrap().iter().filter_map(|e| e["kind"].as_str()).collect();
    assert_eq!((found["verdict"].as_str(), named.as_slice()), (Some("missing"), &["scale_factor_error"][..]));
    let error = &found["effects"][0]["parameters"]["error_ppm"];
    let [value, deviation] = ["value", "standard_error"].map(|key| error[key].as_f64().unwrap());
    assert!((value - 300.0).abs() < 4.0 * deviation && deviation < 3.0, "{error}");

    let new = folder.path().join("extended.toml").display().to_string();
    let answer =
        super::json(&["extend", &model, "--effect", "scale_factor_error", "--fit", &record, columns, "-o", &new]);
    let (before, after) = (rmse(&answer["before"]), rmse(&answer["after"]));
    assert!(before > 6.0 * plain && after < 1.2 * plain, "{before} to {after}, without it {plain}");
    let again = rmse(&super::json(&["compare", &new, &record, columns, "-q"]));
    assert!((again / after - 1.0).abs() < 0.01, "{again} {after}");
}

/// The same of one that follows the temperature, by two effects one after the other; each takes its part.
#[test]
#[ignore = "long: --include-ignored"]
fn a_scale_factor_that_follows_the_temperature_is_fitted_from_counts_and_table() {
    let (folder, path) = super::folder_with("table.csv", counts_on_a_table(20.0));
    let (model, record) = (format!("{CONTROL}/coil.toml"), path.display().to_string());
    let columns = "--columns=time=t:s,temperature=T1:c,rate=F:counts,scale=12.5,table=Table:deg_per_s";
    let rmse = |found: &serde_json::Value| found["records"][0]["rmse_deg_per_h"].as_f64().unwrap();
    let [first, both] = ["error.toml", "both.toml"].map(|name| folder.path().join(name).display().to_string());
    let extended = |model: &str, effect: &str, new: &str| {
        super::json(&["extend", model, "--effect", effect, "--fit", &record, columns, "-o", new])
    };
    let answer = extended(&model, "scale_factor_error", &first);
    let before = rmse(&answer["before"]);
    let between = rmse(&answer["after"]);
    let after = rmse(&extended(&first, "scale_factor_temperature", &both)["after"]);
    assert!(between < before && after < before / 6.0, "{before} to {between} to {after}");
}

/// What a search makes of the extended model is what it makes of a model that declares the learned film, and not what it
/// makes of a prescribed outermost layer.
#[test]
#[ignore = "long: --include-ignored"]
fn the_film_that_the_records_showed_drives_searches_and_leaves_records_their_sensor() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (complete, declared, prescribed) = (path("complete.toml"), path("declared.toml"), path("prescribed.toml"));
    let answer = super::json(&[
        "extend",
        COIL,
        "--effect",
        "finite_pack",
        "--fit",
        RECORD,
        "--holdout",
        "examples/chamber-day-2.csv",
        "-o",
        &complete,
    ]);
    let film = &answer["boundary"]["surface_film_w_per_m2_k"];
    let (value, error) = (film["value"].as_f64().unwrap(), film["standard_error"].as_f64().unwrap());
    println!("film {value} ± {error}");
    assert!(error > 0.0 && error < 0.2 * value);
    assert!(answer["boundary"]["offset_deg_per_h"]["standard_error"].as_f64().is_some_and(|e| e > 0.0));
    let written = std::fs::read_to_string(&complete).unwrap();
    let without = &written[..written.find("\n# Learned from").unwrap()];
    std::fs::write(&prescribed, without).unwrap();
    let stated = basic_toml::from_str::<serde_json::Value>(&written).unwrap()["boundary"]["surface_film_w_per_m2_k"]
        .as_f64()
        .unwrap();
    let film = format!("\n[[effect]]\nkind = \"surface_film\"\nfilm_w_per_m2_k = {stated:?}\n");
    std::fs::write(&declared, format!("{without}{film}")).unwrap();
    let worst = |model: &str| {
        let answer = super::json(&["evaluate", model, "--pattern", "qua", "--pattern", "dip"]);
        [0, 1].map(|i| answer["patterns"][i]["guaranteed_worst_rate_deg_per_h"].as_f64().unwrap())
    };
    let (learned, declared, prescribed) = (worst(&complete), worst(&declared), worst(&prescribed));
    println!("learned {learned:?}, declared {declared:?}, prescribed {prescribed:?}");
    for (a, b) in learned.iter().zip(&declared) {
        assert!((a / b - 1.0).abs() < 1e-9);
    }
    assert!(learned.iter().zip(&prescribed).all(|(a, b)| a < b));
    let said = run(&["evaluate", &complete, "--pattern", "qua"]);
    assert!(stderr(&said).contains("profiles are courses of the air"), "{}", stderr(&said));
    assert_eq!(code(&run(&["compare", &complete, RECORD, "--strict", "-q"])), 0);
}

#[test]
fn without_a_record_the_values_are_said_to_be_no_fitted_ones() {
    let (code, text, _, written) = extend(&["--effect", "strain_mismatch"]);
    assert_eq!(code, 0);
    assert!(text.contains("the values are start values, not fitted ones"), "{text}");
    assert!(written.contains("kind = \"strain_mismatch\"\nmismatch = "), "{written}");
}

#[test]
fn errors_of_a_formula_point_at_the_character() {
    for (formula, mark) in
        [("a * (dT_dt", "--formula:1:10"), ("a * dT_dt ! 2", "--formula:1:11"), ("sin(", "--formula:1:4")]
    {
        let arguments = ["--effect", "custom", "--formula", formula, "--parameter", "a=1"];
        let (code, text, errors, written) = extend(&arguments);
        assert_eq!((code, text.as_str(), written.as_str()), (2, "", ""), "{formula}");
        assert!(errors.contains(mark), "{formula}: {errors}");
    }
}

#[test]
fn effects_and_columns_that_are_not_there_are_refused() {
    let cases: [(&[&str], &str); 5] = [
        (&["--effect", "strain_mismach"], "did you mean strain_mismatch?"),
        (&["--effect", "film"], "the effect surface_film puts one between air and coil"),
        (&["--effect", "custom"], "needs --formula"),
        (&["--effect", "channel:pressure_pa", "--fit", RECORD], "pressure_pa"),
        (&["--effect", "finite_pack", "--fit", "absent.csv"], "absent.csv"),
    ];
    for (arguments, expected) in cases {
        let (code, text, errors, written) = extend(arguments);
        assert_eq!((code, text.as_str(), written.as_str()), (2, "", ""), "{arguments:?}");
        assert!(errors.contains(expected), "{expected}: {errors}");
    }
}
