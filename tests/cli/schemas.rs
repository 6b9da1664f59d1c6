//! Every example and every emitted file is valid under the JSON Schema that the program prints for it.

use std::path::{Path, PathBuf};

use jsonschema::Validator;
use serde_json::Value;

use super::{code, root, run, stderr, stdout};

const COIL: &str = "examples/paper-200m.toml";

fn validator(kind: &str) -> Validator {
    let answer = run(&["schema", kind]);
    assert_eq!(code(&answer), 0, "{}", stderr(&answer));
    let schema: Value = serde_json::from_str(stdout(&answer)).unwrap();
    assert!(jsonschema::meta::is_valid(&schema), "{kind}: the schema itself");
    jsonschema::validator_for(&schema).unwrap_or_else(|e| panic!("{kind}: {e}"))
}

fn assert_valid(validator: &Validator, name: &str, document: &Value) {
    let faults: Vec<String> = validator.iter_errors(document).map(|e| format!("{}: {e}", e.instance_path())).collect();
    assert!(faults.is_empty(), "{name}\n{}", faults.join("\n"));
}

fn toml(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap();
    toml_edit::de::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// All files below a folder whose name ends so.
fn files(folder: &Path, end: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
        if entry.is_dir() {
            found.extend(files(&entry, end));
        } else if entry.to_string_lossy().ends_with(end) {
            found.push(entry);
        }
    }
    found
}

#[test]
fn every_shipped_model_and_pattern_file_is_valid() {
    let (model, pattern) = (validator("model"), validator("pattern"));
    let (mut models, mut patterns) = (0, 0);
    for folder in ["examples", "patterns", "results", "tests/data"] {
        for path in files(&root().join(folder), ".toml") {
            let document = toml(&path);
            let name = path.display().to_string();
            if document.get("segments").is_some() {
                assert_valid(&pattern, &name, &document);
                patterns += 1;
            } else if document.get("fibre").is_some() {
                assert_valid(&model, &name, &document);
                models += 1;
            }
        }
    }
    println!("{models} models, {patterns} patterns");
    assert!(models >= 10 && patterns >= 60, "{models} {patterns}");
    let mut wrong = toml(&root().join(COIL));
    wrong["fibre"]["refractive_idex"] = 1.45.into();
    assert!(!model.is_valid(&wrong));
}

#[test]
fn what_new_schedule_and_a_search_write_is_valid() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name);
    let done = |arguments: &[&str]| {
        let answer = run(arguments);
        assert_eq!(code(&answer), 0, "{arguments:?}: {}", stderr(&answer));
    };
    let shown = |name: &str| inside(name).display().to_string();
    done(&["new", &shown("new.toml"), "-q"]);
    assert_valid(&validator("model"), "new.toml", &toml(&inside("new.toml")));
    done(&["schedule", COIL, "--pattern", "sym", "-q", "-o", &shown("out")]);
    let schedule = validator("schedule");
    for name in ["schedule.json", "traveller.json"] {
        assert_valid(&schedule, name, &json(&inside("out").join(name)));
    }
    let program = std::fs::read_to_string(inside("out/program.gcode")).unwrap();
    let head = program.lines().find_map(|line| line.strip_prefix("; head ")).unwrap();
    let mut document: Value = serde_json::from_str(head).unwrap();
    document["steps"] = Value::Array(Vec::new());
    assert_valid(&schedule, "the head of program.gcode", &document);
    let short = ["--rounds", "1", "--moves-per-restart", "300", "--restarts", "2", "-q"];
    done(&[&["optimise", COIL, "-o", &shown("run")][..], &short].concat());
    assert_valid(&validator("pattern"), "best.toml", &toml(&inside("run/best.toml")));
    assert_valid(&validator("model"), "model.toml", &toml(&inside("run/model.toml")));
    assert_valid(&schedule, "schedule.json of a run", &json(&inside("run/schedule.json")));
}

#[test]
fn rows_of_the_shipped_records_are_valid() {
    let row = validator("record");
    for name in ["examples/chamber-day-1.csv", "tests/data/records/c-spool/calibration.csv"] {
        let text = std::fs::read_to_string(root().join(name)).unwrap();
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let header: Vec<&str> = lines.next().unwrap().split(',').collect();
        for line in lines.take(50) {
            let cells = line.split(',').map(|cell| Value::from(cell.parse::<f64>().unwrap()));
            let document: Value =
                header.iter().map(ToString::to_string).zip(cells).collect::<serde_json::Map<_, _>>().into();
            assert_valid(&row, name, &document);
        }
    }
    assert!(!row.is_valid(&serde_json::json!({ "time_s": 0.0 })));
}

#[test]
fn the_campaign_file_of_the_book_is_valid_and_what_its_reader_refuses_is_not() {
    let campaign = validator("campaign");
    let chapter = std::fs::read_to_string(root().join("docs/src/formats.md")).unwrap();
    let (_, rest) = chapter.split_once("```toml\nname = \"two coils\"").expect("the chapter shows a campaign file");
    let text = format!("name = \"two coils\"{}", rest.split_once("```").unwrap().0);
    assert_valid(&campaign, "the book's campaign file", &toml_edit::de::from_str(&text).unwrap());
    for wrong in [
        "models = \"m.toml\"",
        "models = []",
        "models = [\"m.toml\"]\nseed = [1]",
        "models = [\"m.toml\"]\nclasses = [\"easy\"]",
    ] {
        let document: Value = toml_edit::de::from_str(&format!("name = \"x\"\n{wrong}\n")).unwrap();
        assert!(!campaign.is_valid(&document), "{wrong}");
    }
}

#[test]
fn an_exported_compensator_is_valid() {
    let folder = tempfile::tempdir().unwrap();
    let prefix = folder.path().join("embedded").display().to_string();
    let (coil, record) = ("tests/data/records/a-control/coil.toml", "tests/data/records/a-control/calibration.csv");
    let answer = run(&["compensate", coil, "--fit", record, "--export", &prefix, "-q"]);
    assert_eq!(code(&answer), 0, "{}", stderr(&answer));
    let mut document = json(&folder.path().join("embedded.json"));
    let compensation = validator("compensation");
    assert_valid(&compensation, "embedded.json", &document);
    document["gains"] = Value::Array(Vec::new());
    assert!(!compensation.is_valid(&document));
}

#[test]
fn exported_compensators_that_know_no_coil_are_valid() {
    let folder = tempfile::tempdir().unwrap();
    let (coil, record) = ("tests/data/records/a-control/coil.toml", "tests/data/records/a-control/calibration.csv");
    let compensation = validator("compensation");
    for method in ["piecewise", "regression", "learned"] {
        let prefix = folder.path().join(method).display().to_string();
        let answer = run(&["compensate", coil, "--fit", record, "--method", method, "--export", &prefix, "-q"]);
        assert_eq!(code(&answer), 0, "{}", stderr(&answer));
        let mut document = json(&folder.path().join(format!("{method}.json")));
        assert_valid(&compensation, method, &document);
        assert_eq!(document["method"], method);
        document["method"] = Value::from("other");
        assert!(!compensation.is_valid(&document), "{method}");
        let header = std::fs::read_to_string(folder.path().join(format!("{method}.h"))).unwrap();
        assert!(header.contains("coilwright_step") && !header.contains('@'), "{header}");
    }
}
