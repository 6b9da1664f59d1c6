//! `improve` from records to the next coil, its steps taken once, and searches against the worst admissible profiles.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{code, root, run_in, stderr, stdout};

/// A small coil and two of its days, under the names that the help's example has.
pub(super) fn prepare(folder: &Path) {
    let read = |name: &str| std::fs::read_to_string(root().join("tests/data/records/d-mismatch").join(name)).unwrap();
    let profiles = "\n[profiles]\nmax_rate_c_per_h = 60.0\ncount = 4\nsegments = 3\nduration_s = 3000.0\nseed = 1\n";
    std::fs::write(folder.join("coil.toml"), read("coil.toml") + profiles).unwrap();
    let rows = |name: &str, from: usize, count: usize| -> String {
        let text = read(name);
        let lines: Vec<&str> = text.lines().collect();
        let rows = lines[1..].iter().skip(from).take(count);
        std::iter::once(&lines[0]).chain(rows).map(|line| format!("{line}\n")).collect()
    };
    std::fs::write(folder.join("monday.csv"), rows("calibration.csv", 0, 600)).unwrap();
    std::fs::write(folder.join("tuesday.csv"), rows("validation.csv", 0, 500)).unwrap();
    std::fs::write(folder.join("friday.csv"), rows("validation.csv", 0, 700)).unwrap();
}

#[test]
#[ignore = "long: --include-ignored"]
fn the_example_of_improve_runs_from_records_to_a_schedule_and_takes_no_step_twice() {
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let help = run_in(folder.path(), &["improve", "--help"]);
    let example = stdout(&help).lines().find_map(|line| line.trim().strip_prefix("coilwright ")).unwrap().to_owned();
    let mut words: Vec<&str> = example.split_whitespace().collect();
    words.extend(["--format", "json"]);
    let first = run_in(folder.path(), &words);
    assert_eq!(code(&first), 0, "{}", stderr(&first));
    let answer: Value = serde_json::from_str(stdout(&first)).unwrap();
    for key in ["verdict", "effects", "recommendation", "predicted_record", "next_experiment", "predicted_gain"] {
        assert!(answer.get(key).is_some(), "{key}");
    }
    let gain = &answer["predicted_gain"];
    assert!(gain["low"].as_f64().unwrap() <= gain["value"].as_f64().unwrap());
    assert!(gain["value"].as_f64().unwrap() <= gain["high"].as_f64().unwrap());
    let written = folder.path().join("results/next-coil");
    for name in ["index.html", "schedule/schedule.csv", "recommended.toml", "design.toml", "predicted-record.csv"] {
        assert!(written.join(name).is_file(), "{name}");
    }
    let schedule = written.join("schedule/schedule.csv").display().to_string();
    let design = written.join("design.toml").display().to_string();
    let checked = run_in(folder.path(), &["verify", &design, &schedule]);
    assert_eq!(code(&checked), 0, "{}{}", stdout(&checked), stderr(&checked));

    let again = run_in(folder.path(), &words);
    assert_eq!(stdout(&again), stdout(&first));
    let notes = stderr(&again);
    for step in ["before", "diagnosis", "after", "search", "schedule"] {
        assert!(notes.contains(&format!("{step}: done before")), "{step}: {notes}");
    }

    // A step whose result was changed since is taken again.
    let compared = written.join("after/comparison.json");
    let whole = std::fs::read_to_string(&compared).unwrap();
    std::fs::write(&compared, whole.replacen("\"rmse_deg_per_h\": 0.", "\"rmse_deg_per_h\": 1.", 1)).unwrap();
    let again = run_in(folder.path(), &words);
    assert_eq!(stdout(&again), stdout(&first));
    assert!(stderr(&again).contains("after …") && stderr(&again).contains("search: done before"), "{}", stderr(&again));
    assert_eq!(std::fs::read_to_string(&compared).unwrap(), whole);

    // Another request takes all of this away before its own first file comes; here it gets no further.
    std::fs::write(written.join("notes.txt"), "mine").unwrap();
    std::fs::write(written.join("before/run.toml"), "").unwrap();
    let coil = std::fs::read_to_string(folder.path().join("coil.toml")).unwrap();
    std::fs::write(folder.path().join("coil.toml"), coil + "\n# another\n").unwrap();
    assert_eq!(code(&run_in(folder.path(), &words)), 2);
    let mut left = Vec::new();
    files_below(&written, &mut left);
    left.sort();
    let left: Vec<&Path> = left.iter().map(|path| path.strip_prefix(&written).unwrap()).collect();
    assert_eq!(left, ["before/run.toml", "measured-pattern.toml", "notes.txt", "steps.json"].map(Path::new));
}

fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.is_dir() { files_below(&path, found) } else { found.push(path) }
    }
}

#[test]
fn improve_says_at_once_which_record_cannot_be_read() {
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let answer = run_in(folder.path(), &["improve", "coil.toml", "monday.csv", "sunday.csv", "-o", "next"]);
    assert_eq!(code(&answer), 2);
    assert!(stderr(&answer).contains("sunday.csv"), "{}", stderr(&answer));
}

#[test]
fn cutting_planes_list_the_profiles_that_joined_and_are_refused_where_they_mean_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let coil =
        std::fs::read_to_string(root().join("examples/paper-200m.toml")).unwrap().replace("count = 64", "count = 4");
    std::fs::write(folder.path().join("coil.toml"), coil).unwrap();
    let small = ["--rounds", "1", "--moves-per-restart", "400", "--cutting-planes"];
    let searched = |rest: &[&str]| run_in(folder.path(), &[&["optimise", "coil.toml"], &small[..], rest].concat());
    let answer = searched(&["-o", "run", "--format", "json"]);
    assert_eq!(code(&answer), 0, "{}", stderr(&answer));
    let found: Value = serde_json::from_str(stdout(&answer)).unwrap();
    let cuts = &found["cutting_planes"];
    assert_eq!(cuts["agree"], true, "{cuts}");
    let (sampled, admissible) = (&cuts["sampled_worst_rate_deg_per_h"], &cuts["admissible_worst_rate_deg_per_h"]);
    assert!(admissible.as_f64().unwrap() <= 1.01 * sampled.as_f64().unwrap());
    assert_eq!(admissible, &found["best"]["guaranteed_worst_rate_deg_per_h"]);
    let model = std::fs::read_to_string(folder.path().join("run/model.toml")).unwrap();
    for joined in cuts["joined"].as_array().unwrap() {
        assert!(model.contains(joined["name"].as_str().unwrap()), "{joined}");
    }
    let refused = searched(&["--objective", "rms"]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("--cutting-planes"), "{}", stderr(&refused));
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_formula_that_predicts_is_in_what_the_next_coil_should_show_and_not_in_the_search() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| std::fs::read_to_string(root().join("examples").join(name)).unwrap();
    let profiles = "\n[profiles]\nmax_rate_c_per_h = 60.0\ncount = 4\nsegments = 3\nduration_s = 3000.0\nseed = 1\n";
    std::fs::write(folder.path().join("coil.toml"), read("fan-coil.toml") + profiles).unwrap();
    for day in ["fan-day-1.csv", "fan-day-2.csv"] {
        std::fs::write(folder.path().join(day), read(day)).unwrap();
    }
    let words =
        ["improve", "coil.toml", "fan-day-1.csv", "--holdout", "fan-day-2.csv", "-o", "next", "--format", "json"];
    let restricted = [&words[..], &["--terms", "lagged_size,fan_a"]].concat();
    let found = run_in(folder.path(), &restricted);
    assert_eq!(code(&found), 0, "{}", stderr(&found));
    let answer: Value = serde_json::from_str(stdout(&found)).unwrap();
    let proposal = &answer["proposals"][0];
    assert_eq!(proposal["predicts"], true, "{proposal}");
    assert!(proposal["formula"].as_str().unwrap().contains("lag(abs(fan_a)"), "{proposal}");
    let next = folder.path().join("next");
    let holds_formula = |name: &str| std::fs::read_to_string(next.join(name)).unwrap().contains("lag(abs(fan_a)");
    assert_eq!(["proposed.toml", "extended.toml", "design.toml"].map(holds_formula), [true, false, false]);
    assert!(holds_formula("index.html"));
    let rmse = |step: &str| -> f64 {
        let text = std::fs::read_to_string(next.join(step).join("comparison.json")).unwrap();
        let document: Value = serde_json::from_str(&text).unwrap();
        document["records"][1]["rmse_deg_per_h"].as_f64().unwrap()
    };
    let (before, after) = (rmse("before"), rmse("after"));
    assert!(after < 0.5 * before, "held out: {before} °/h before, {after} after");

    // Not sought: another request, whose folder keeps no formula.
    let plain = run_in(folder.path(), &[&words[..], &["--no-discovery"]].concat());
    assert_eq!(code(&plain), 0, "{}", stderr(&plain));
    let answer: Value = serde_json::from_str(stdout(&plain)).unwrap();
    assert_eq!(answer["proposals"].as_array().unwrap().len(), 0);
    assert!(!next.join("proposed.toml").exists());
    assert!((rmse("after") / before - 1.0).abs() < 0.2);
}
