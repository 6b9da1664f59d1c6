//! Campaigns that are no searches: built coils in blocks and gyros of a fleet say what the single commands say, however they are split.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{code, root, run, stderr, stdout};

fn answered(arguments: &[&str], expected: i32) -> Value {
    let output = run(&[arguments, &["--format", "json", "--quiet"]].concat());
    assert_eq!(code(&output), expected, "{arguments:?}: {}", stderr(&output));
    serde_json::from_str(stdout(&output)).expect("a document")
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a temporary file can be written");
    path.display().to_string()
}

fn shown(path: PathBuf) -> String {
    path.display().to_string()
}

#[test]
fn blocks_of_built_coils_are_what_tolerance_draws_and_their_split_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let spreads = "\n[tolerance]\nturns_per_layer_sd = 0.3\nmidpoint_offset_mm_sd = 20.0\nmismatch_sd = 0.001\nsamples = 5\n\
                   seed = 7\nlimit_deg_per_h = 0.05\n";
    let example = std::fs::read_to_string(root().join("examples/paper-200m.toml")).unwrap();
    let model = write(folder.path(), "paper.toml", &(example.replace("layers = 12", "layers = 8") + spreads));
    let pattern = "name = \"own\"\nlayers = 8\nsegments = [1, 2, 3, 4, 5, 6, 7, 8]\n";
    let own = write(folder.path(), "own.toml", pattern);
    let of = |size: usize| {
        let text = format!(
            "kind = \"tolerance\"\nname = \"built\"\nmodels = [\"paper.toml\"]\npatterns = [\"own.toml\", \"dip\"]\nsamples = 1500\n\
             coils_per_cell = {size}\n"
        );
        (write(folder.path(), &format!("{size}.toml"), &text), shown(folder.path().join(format!("out-{size}"))))
    };
    let (whole, into) = of(1500);
    let first = answered(&["campaign", &whole, "-o", &into], 0);
    let (split, parts) = of(400);
    let listed = answered(&["campaign", &split, "--list"], 0);
    let coils: Vec<&Value> = listed["cells"].as_array().unwrap().iter().map(|cell| &cell["coils"]).collect();
    assert_eq!(coils.len(), 4);
    assert_eq!((coils[0], coils[3]), (&serde_json::json!([1, 400]), &serde_json::json!([1201, 1500])));
    assert_eq!(listed["cells"][1]["kind"], "tolerance");
    for part in ["2/3", "1/3", "3/3"] {
        answered(&["campaign", &split, "-o", &parts, "--shard", part, "--threads", "1"], 0);
    }
    let second = answered(&["campaign", &split, "-o", &parts, "--merge"], 0);
    assert_eq!(first["built_coils"], second["built_coils"]);
    let read = |folder: &str, name: &str| std::fs::read(Path::new(folder).join(name)).unwrap();
    assert_eq!(read(&into, "summary.csv"), read(&parts, "summary.csv"));
    assert!(String::from_utf8(read(&parts, "report.html")).unwrap().contains("one in a thousand is worse"));

    // The command draws the same coils; its quantiles are exact everywhere.
    let studied = answered(&["tolerance", &model, "--pattern", &own, "--pattern", "dip", "--samples", "1500"], 0);
    let patterns = second["built_coils"][0]["patterns"].as_array().unwrap();
    assert_eq!(patterns.len(), 3);
    for (found, expected) in patterns.iter().zip(studied["patterns"].as_array().unwrap()) {
        for key in ["name", "nominal_deg_per_h", "yield"] {
            assert_eq!(found[key], expected[key], "{key}");
        }
        let quantile = |place: usize| &found["quantiles"][place]["value_deg_per_h"];
        assert_eq!(*quantile(2), expected["p99_deg_per_h"]);
        for (place, key) in [(0, "median_deg_per_h"), (1, "p95_deg_per_h")] {
            let (own, exact) = (quantile(place).as_f64().unwrap(), expected[key].as_f64().unwrap());
            assert!((own / exact - 1.0).abs() < 1e-3, "{key}: {own} {exact}");
        }
        let (low, value) = (&found["quantiles"][3]["low_deg_per_h"], quantile(3));
        assert!(low.as_f64() <= value.as_f64());
        // Of 1500 coils none bounds the worst thousandth from above.
        assert!(found["quantiles"][3]["high_deg_per_h"].is_null());
    }
    // More coils leave the blocks that are there as they are.
    let more = std::fs::read_to_string(&split).unwrap().replace("samples = 1500", "samples = 1900");
    let more = write(folder.path(), "more.toml", &more);
    // Only the last one, which was cut short, and the next are new.
    assert_eq!(answered(&["campaign", &more, "-o", &parts], 0)["searched"], 2);
}

/// A gyro at rest: white noise about a bias.
fn rest(bias: f64, seed: u64) -> String {
    let mut text = "time_s,temperature_c,rate_deg_per_h\n".to_owned();
    let mut state = seed * 2_654_435_769 + 1;
    for row in 0..400 {
        let mut noise = 0.0;
        for _ in 0..4 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            noise += (state >> 33) as f64 / f64::from(1u32 << 31) - 0.5;
        }
        text += &format!("{row},{:.3},{:.5}\n", 20.0 + 0.01 * f64::from(row), bias + 0.1 * noise);
    }
    text
}

#[test]
fn a_fleet_s_data_sheets_are_those_of_metrics_and_who_stands_apart_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut campaign = "kind = \"metrics\"\nname = \"batch\"\naverage_s = 20.0\n".to_owned();
    for number in 0..10u64 {
        // All have about one bias but the fifth.
        let bias = if number == 4 { 9.0 } else { 2.0 + 0.01 * number as f64 };
        write(folder.path(), &format!("{number}.csv"), &rest(bias, number));
        campaign += &format!("[[gyro]]\nname = \"sn-{number}\"\nrecords = [\"{number}.csv\"]\n");
    }
    write(folder.path(), "short.csv", "time_s,temperature_c,rate_deg_per_h\n0,20,1\n");
    campaign += "[[gyro]]\nname = \"sn-short\"\nrecords = [\"short.csv\"]\n";
    let path = write(folder.path(), "fleet.toml", &campaign);
    let out = shown(folder.path().join("out"));
    for part in ["1/2", "2/2"] {
        answered(&["campaign", &path, "-o", &out, "--shard", part], 0);
    }
    let answer = answered(&["campaign", &path, "-o", &out, "--merge"], 0);
    let fleet = &answer["fleet"];
    assert_eq!((&fleet["gyros"], answer["failed"].as_array().unwrap().len()), (&10.into(), 1));
    let measure = |key: &str| -> Value {
        let all = fleet["measures"].as_array().unwrap();
        all.iter().find(|m| m["key"] == key).unwrap_or_else(|| panic!("{key}: {fleet}")).clone()
    };
    let single: Vec<Value> = measure("bias_deg_per_h")["values"].as_array().unwrap().clone();
    let single: Vec<&str> = single.iter().filter(|v| v["single"] == true).filter_map(|v| v["gyro"].as_str()).collect();
    assert_eq!(single, ["sn-4"]);
    assert!(fleet["sentences"].to_string().contains("single: sn-4: bias_deg_per_h = 8.99"), "{fleet}");
    // The cell's document is the command's but for the name of the file.
    let alone = answered(&["metrics", &shown(folder.path().join("3.csv")), "--average", "20"], 0);
    let id = answer["cells"][3]["id"].as_str().unwrap();
    let cell = Path::new(&out).join("cells").join(&id[..2]).join(format!("{id}.json"));
    let cell: Value = serde_json::from_str(&std::fs::read_to_string(cell).unwrap()).unwrap();
    assert_eq!(cell["metrics"]["records"][0]["file"], "3.csv");
    for key in ["bias_deg_per_h", "bias_stability_deg_per_h", "noise", "peak_to_peak_deg_per_h", "drift_angle_deg"] {
        assert_eq!(cell["metrics"][key], alone[key], "{key}");
    }
    let page = std::fs::read_to_string(Path::new(&out).join("report.html")).unwrap();
    assert!(page.contains("What the batch has in common") && page.contains("sn-short"));
    // A record that has changed is measured again, and no other.
    write(folder.path(), "2.csv", &rest(2.5, 2));
    assert_eq!(answered(&["campaign", &path, "-o", &out], 0)["searched"], 1);
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_fleet_s_diagnoses_are_those_of_diagnose_and_a_record_that_says_nothing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let own = root().join("tests/data/records/c-spool");
    // Every sixteenth row is enough to tell that the pack's heat goes elsewhere.
    let text = std::fs::read_to_string(own.join("calibration.csv")).unwrap();
    let rows: Vec<&str> = text.lines().skip(1).step_by(16).collect();
    let header = text.lines().next().unwrap();
    write(folder.path(), "a.csv", &format!("{header}\n{}\n", rows.join("\n")));
    write(folder.path(), "b.csv", &format!("{header}\n{}\n", rows[..4].join("\n")));
    std::fs::copy(own.join("coil.toml"), folder.path().join("coil.toml")).unwrap();
    let campaign = "kind = \"diagnose\"\nname = \"batch\"\nmodel = \"coil.toml\"\nterms = [\"none\"]\n\
                    [[gyro]]\nname = \"A\"\nrecords = [\"a.csv\"]\n[[gyro]]\nname = \"B\"\nrecords = [\"b.csv\"]\n";
    let path = write(folder.path(), "fleet.toml", campaign);
    let out = shown(folder.path().join("out"));
    let answer = answered(&["campaign", &path, "-o", &out], 0);
    let fleet = &answer["fleet"];
    assert_eq!((&fleet["gyros"], &answer["failed"][0]), (&1.into(), &answer["cells"][1]["id"]), "{answer}");
    let inside = |name: &str| shown(folder.path().join(name));
    let alone = answered(&["diagnose", &inside("coil.toml"), &inside("a.csv"), "--no-discovery"], 0);
    let id = answer["cells"][0]["id"].as_str().unwrap();
    let cell = Path::new(&out).join("cells").join(&id[..2]).join(format!("{id}.json"));
    let cell: Value = serde_json::from_str(&std::fs::read_to_string(cell).unwrap()).unwrap();
    for key in ["verdict", "effects", "ladder", "posterior", "candidates", "noise_floor_deg_per_h"] {
        assert_eq!(cell["diagnosis"][key], alone[key], "{key}");
    }
    assert_eq!(fleet["effects"][0]["kind"], alone["effects"][0]["kind"]);
    assert_eq!(fleet["effects"][0]["found_in"][0], "A");
    let page = std::fs::read_to_string(Path::new(&out).join("report.html")).unwrap();
    assert!(page.contains(alone["effects"][0]["kind"].as_str().unwrap()) && page.contains("What failed"));
}

#[test]
fn campaign_files_of_every_kind_name_their_faults() {
    let folder = tempfile::tempdir().unwrap();
    for (text, expected) in [
        ("kind = \"metric\"\nname = \"x\"\n", "did you mean \"metrics\"?"),
        ("kind = \"metrics\"\nname = \"x\"\n", "at least one [[gyro]]"),
        (
            "kind = \"metrics\"\nname = \"x\"\ncolumns = \"speed=x\"\n[[gyro]]\nname = \"a\"\nrecords = [\"a.csv\"]\n",
            "columns: ",
        ),
        (
            "kind = \"diagnose\"\nname = \"x\"\n[[gyro]]\nname = \"a\"\nrecords = [\"a.csv\"]\n",
            "a diagnosis needs a model",
        ),
        (
            "kind = \"metrics\"\nname = \"x\"\n[[gyro]]\nname = \"a\"\nrecords = [\"a.csv\"]\n[[gyro]]\nname = \"a\"\nrecords = [\"b.csv\"]\n",
            "two gyros called \"a\"",
        ),
        ("kind = \"tolerance\"\nname = \"x\"\nmodels = [\"m.toml\"]\nclasses = [\"any\"]\n", "unknown key classes"),
        ("kind = \"metrics\"\nname = \"x\"\n[[gyro]]\nname = \"a\"\nrecords = [\"nowhere.csv\"]\n", "nowhere.csv"),
    ] {
        let path = write(folder.path(), "c.toml", text);
        let output = run(&["campaign", &path, "--list"]);
        assert_eq!(code(&output), 2, "{text}");
        assert!(stderr(&output).contains(expected), "{expected}: {}", stderr(&output));
    }
}
