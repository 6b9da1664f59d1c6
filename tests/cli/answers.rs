//! Every document that any of these tests is answered with is valid under the JSON Schema of its command's answers, and holds no key
//! that the schema does not.

use std::collections::BTreeMap;
use std::process::Output;
use std::sync::{Arc, Mutex};

use jsonschema::Validator;
use serde_json::{Value, json};

use super::help::commands;
use super::{code, root, run, stderr, stdout};

/// The schema that the program prints.
fn schema(command: &str) -> Value {
    let output = assert_cmd::Command::cargo_bin("coilwright")
        .expect("cargo builds the program before its tests")
        .args(["schema", "--answer", command])
        .output()
        .expect("the program can be started");
    assert_eq!(code(&output), 0, "{command}: {}", stderr(&output));
    serde_json::from_str(stdout(&output)).unwrap_or_else(|e| panic!("{command}: {e}"))
}

/// A schema lets readers meet keys that later versions add; here every key must be one of its own. `is_part`: of an object that has
/// keys beside these, which closes over both.
fn closed(schema: &mut Value, is_part: bool) {
    match schema {
        Value::Object(map) => {
            let has_keys = map.contains_key("properties");
            for (key, inner) in map.iter_mut() {
                match inner {
                    Value::Array(parts) if has_keys && ["allOf", "anyOf", "oneOf"].contains(&key.as_str()) => {
                        parts.iter_mut().for_each(|part| closed(part, true));
                    }
                    inner => closed(inner, false),
                }
            }
            if has_keys && !is_part && !map.contains_key("additionalProperties") {
                map.insert("unevaluatedProperties".to_owned(), false.into());
            }
        }
        Value::Array(list) => list.iter_mut().for_each(|inner| closed(inner, false)),
        _ => {}
    }
}

/// Each made once.
fn validator(command: &str) -> Arc<Validator> {
    static MADE: Mutex<BTreeMap<String, Arc<Validator>>> = Mutex::new(BTreeMap::new());
    let mut made = MADE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let new = || {
        let mut schema = schema(command);
        closed(&mut schema, false);
        Arc::new(jsonschema::validator_for(&schema).unwrap_or_else(|e| panic!("{command}: {e}")))
    };
    Arc::clone(made.entry(command.to_owned()).or_insert_with(new))
}

fn faults(command: &str, document: &Value) -> Vec<String> {
    let mut faults: Vec<String> =
        validator(command).iter_errors(document).map(|e| format!("{}: {e}", e.instance_path())).collect();
    faults.iter_mut().for_each(|fault| fault.truncate(fault.floor_char_boundary(500)));
    faults
}

/// Holds an answer against its schema, where one was asked for and given.
pub fn assert_as_promised(arguments: &[&str], output: &Output) {
    let is_json = arguments.windows(2).any(|pair| pair == ["--format", "json"]) || arguments.contains(&"--format=json");
    let (true, Some(command)) = (is_json && !output.stdout.is_empty(), arguments.first()) else { return };
    if command.starts_with('-') || arguments.contains(&"--help") {
        return;
    }
    let document = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{arguments:?}: {e}"));
    let faults = faults(command, &document);
    assert!(faults.is_empty(), "{arguments:?}: not as its schema says\n{}", faults.join("\n"));
}

#[test]
fn every_command_that_answers_has_a_schema_of_its_answer() {
    for command in commands() {
        let schema = schema(&command);
        assert!(jsonschema::meta::is_valid(&schema), "{command}: the schema itself");
        assert!(!validator(&command).is_valid(&json!({})), "{command}: nothing is promised");
    }
}

#[test]
fn a_schema_of_an_answer_refuses_what_is_not_promised() {
    let output = run(&["patterns", "--format", "json"]);
    let document: Value = serde_json::from_str(stdout(&output)).unwrap();
    assert_eq!(faults("patterns", &document), Vec::<String>::new());
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut document = document.clone();
        change(&mut document);
        faults("patterns", &document).len()
    };
    assert_ne!(changed(&|d| d["further"] = 1.into()), 0);
    assert_ne!(changed(&|d| d["patterns"][0]["further"] = 1.into()), 0);
    assert_ne!(changed(&|d| d["schema_version"] = "1".into()), 0);
    assert_ne!(changed(&|d| drop(d.as_object_mut().unwrap().remove("patterns"))), 0);
    let open = jsonschema::validator_for(&schema("patterns")).unwrap();
    assert!(open.is_valid(&{
        let mut later = document.clone();
        later["further"] = 1.into();
        later
    }));
}

/// What no other test asks for as JSON; the others are asked for by the tests of their commands.
#[test]
fn small_answers_are_as_their_schemas_say() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name).display().to_string();
    let coil = root().join("examples/paper-200m.toml").display().to_string();
    let ask = |words: &[&str]| {
        let output = run(&[words, &["--format", "json", "-q"]].concat());
        assert!(code(&output) < 2 && !output.stdout.is_empty(), "{words:?}: {}", stderr(&output));
    };
    for words in [&["fibres"][..], &["materials"], &["effects"], &["schema", "model"], &["completions", "bash"]] {
        ask(words);
    }
    ask(&["new", &inside("new.toml")]);
    ask(&["man", "-o", &inside("man")]);
    ask(&["check", &coil]);
    ask(&["evaluate", &coil]);
    ask(&["schedule", &coil, "--pattern", "sym", "-o", &inside("schedule")]);
    ask(&["verify", &coil, &inside("schedule/schedule.json")]);
    ask(&["temperatures", &coil]);
    ask(&["explore", &coil, "-o", &inside("page.html")]);
    ask(&["reproduce", "thesis2021", "-o", &inside("thesis")]);
}

#[test]
#[ignore = "long: --include-ignored"]
fn files_that_hold_an_answer_are_as_its_schema_says() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name).display().to_string();
    let (coil, record) = ("tests/data/records/a-control/coil.toml", "tests/data/records/a-control/calibration.csv");
    let compared = run(&["compare", coil, record, "-o", &inside("compared"), "-q"]);
    assert!(code(&compared) < 2, "{}", stderr(&compared));
    let short = ["--rounds", "1", "--moves-per-restart", "300", "--restarts", "2", "-q"];
    let found = run(&[&["optimise", "examples/paper-200m.toml", "-o", &inside("found")][..], &short].concat());
    assert_eq!(code(&found), 0, "{}", stderr(&found));
    for (command, file) in [("compare", "compared/comparison.json"), ("optimise", "found/summary.json")] {
        let document = serde_json::from_str(&std::fs::read_to_string(inside(file)).unwrap()).unwrap();
        assert_eq!(faults(command, &document), Vec::<String>::new(), "{file}");
    }
}
