//! Commands that do what they are asked for.

use super::{code, json, run, run_in, stderr, stdout};

#[test]
fn evaluate_answers_with_the_keys_that_scripts_read() {
    let answer = json(&["evaluate", "examples/paper-200m.toml", "--pattern", "zyl", "--pattern", "qua"]);
    assert_eq!(answer["schema_version"], 1);
    let patterns = answer["patterns"].as_array().unwrap();
    let names: Vec<&str> = patterns.iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["zyl", "qua"]);
    for pattern in patterns {
        for key in ["worst_rate_deg_per_h", "worst_phase_rad", "worst_time_s", "guaranteed_worst_rate_deg_per_h"] {
            assert!(pattern.get(key).is_some(), "{key}");
        }
        assert!(pattern["worst_profile"].is_string());
        for key in ["class", "reels", "captive", "max_climb"] {
            assert!(pattern["windability"].get(key).is_some(), "{key}");
        }
        assert_eq!(pattern["segments"].as_array().unwrap().len(), 12);
    }
}

#[test]
fn a_new_model_file_has_no_faults_and_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let written = run_in(folder.path(), &["new", "my coil"]);
    assert_eq!(code(&written), 0, "{}", stderr(&written));
    let checked = run_in(folder.path(), &["check", "my coil.toml"]);
    assert_eq!((code(&checked), stdout(&checked)), (0, "my coil.toml: no faults\n"));
    assert_eq!(code(&run_in(folder.path(), &["new", "my coil"])), 2);
}

#[test]
fn the_symmetric_winding_is_said_to_be_hard_to_make_and_why() {
    let output = run(&["patterns", "--layers", "12"]);
    assert_eq!(code(&output), 0);
    let reason =
        "after layer 7 the fibre of segments 7 to 11 is held at both its ends, by segments 6 and 12 on the coil";
    assert!(stderr(&output).contains(reason), "{}", stderr(&output));
    assert_eq!(stderr(&run(&["patterns", "--layers", "12", "--quiet"])), "");
}

#[test]
fn every_example_has_no_faults_and_can_be_evaluated() {
    let mut files: Vec<_> =
        std::fs::read_dir(super::root().join("examples")).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    assert!(files.len() >= 3);
    for file in files {
        let shown = file.display().to_string();
        let checked = run(&["check", &shown]);
        assert_eq!(code(&checked), 0, "{}", stderr(&checked));
        let answer = json(&["evaluate", &shown, "--pattern", "zyl"]);
        assert!(answer["patterns"][0]["worst_rate_deg_per_h"].as_f64().unwrap() > 0.0);
    }
}
