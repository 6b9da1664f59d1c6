//! Campaigns: shards together equal the whole, and what is done is not done again. The front's points are patterns
//! that `schedule` takes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn coilwright(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_coilwright")).args(arguments).output().unwrap()
}

fn example() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("examples/paper-200m.toml")
}

fn campaign_file(folder: &Path) -> String {
    let spreads = "\n[tolerance]\nturns_per_layer_sd = 0.3\nmismatch_sd = 0.001\nsamples = 8\n";
    std::fs::write(folder.join("paper.toml"), std::fs::read_to_string(example()).unwrap() + spreads).unwrap();
    let path = folder.join("grid.toml");
    let text = "name = \"grid\"\nmodels = [\"paper.toml\"]\nlayers = [8, 12]\nclasses = [\"standard\", \"any\"]\n\
                objectives = [\"worst-rate\", \"p95\"]\nrounds = 1\nmoves_per_restart = 500\n";
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        if entry.path().is_dir() {
            found.extend(files(&entry.path()).into_iter().map(|(p, b)| (PathBuf::from(entry.file_name()).join(p), b)));
        } else {
            found.insert(PathBuf::from(entry.file_name()), std::fs::read(entry.path()).unwrap());
        }
    }
    found
}

#[test]
fn shards_together_are_the_whole_and_what_is_done_is_skipped() {
    let root = tempfile::tempdir().unwrap();
    let campaign = campaign_file(root.path());
    let (whole, shards) = (root.path().join("whole"), root.path().join("shards"));
    let run = |folder: &Path, more: &[&str]| {
        let folder = folder.display().to_string();
        let output = coilwright(&[&["campaign", &campaign, "-o", &folder, "--format", "json"], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let first = run(&whole, &[]);
    assert_eq!((&first["cells"], &first["searched"], &first["missing"]), (&8.into(), &8.into(), &0.into()));
    assert_eq!(run(&whole, &[])["searched"], 0);
    assert_eq!(run(&shards, &["--shard", "2/3"])["missing"], 5);
    assert_eq!(run(&shards, &["--shard", "1/3"])["missing"], 2);
    assert_eq!(run(&shards, &["--shard", "3/3"])["missing"], 0);
    let found = files(&whole);
    assert!(found.contains_key(Path::new("summary.csv")) && found.contains_key(Path::new("summary.svg")));
    assert_eq!(found, files(&shards));
}

#[test]
fn a_campaign_file_with_faults_names_them_all() {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("grid.toml");
    std::fs::write(
        &path,
        "name = \"x\"\nmodels = \"m.toml\"\nclasses = [\"easy\", 3]\nobjectives = [\"speed\"]\nseed = [1]\n",
    )
    .unwrap();
    let output = coilwright(&["campaign", &path.display().to_string(), "-o", &root.path().display().to_string()]);
    assert_eq!(output.status.code(), Some(2));
    let words = String::from_utf8_lossy(&output.stderr);
    for part in ["an array of model files", "classes[1]", "speed", "unknown key seed: did you mean seeds?"] {
        assert!(words.contains(part), "{part}: {words}");
    }
}

#[test]
fn every_point_of_the_front_is_a_pattern_that_schedule_takes_and_none_is_beaten_in_every_respect() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("front");
    let eight = std::fs::read_to_string(example()).unwrap().replace("layers = 12", "layers = 8");
    let spreads = "\n[tolerance]\nturns_per_layer_sd = 0.3\nmismatch_sd = 0.001\nsamples = 8\n";
    let path = root.path().join("eight.toml");
    std::fs::write(&path, eight + spreads).unwrap();
    let (model, shown) = (path.display().to_string(), folder.display().to_string());
    let output =
        coilwright(&["pareto", &model, "-o", &shown, "--rounds", "1", "--most-captive", "1", "--format", "json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let points = answer["points"].as_array().unwrap();
    assert!(points.len() >= 3, "{points:?}");
    let weighed = |point: &serde_json::Value| {
        let windability = &point["windability"];
        let efforts = [&windability["captive"], &windability["max_climb"], &point["long_crossovers"]];
        let mut of: Vec<f64> = efforts.map(|e| e.as_f64().unwrap()).to_vec();
        of.extend(["worst_rate_deg_per_h", "p95_rate_deg_per_h"].map(|key| point[key].as_f64().unwrap()));
        of
    };
    for point in points {
        let file = folder.join(point["file"].as_str().unwrap()).display().to_string();
        assert!(coilwright(&["schedule", &model, "--pattern", &file]).status.success(), "{file}");
        let own = weighed(point);
        let beaten = points.iter().any(|other| {
            let other = weighed(other);
            other != own && other.iter().zip(&own).all(|(a, b)| *a <= *b * (1.0 - 1e-5) || a == b)
        });
        assert!(!beaten, "{own:?}");
    }
    // Climbs are searched for: the easiest winding and easier ones than the best of all are there.
    let climbs: Vec<u64> = points.iter().map(|p| p["windability"]["max_climb"].as_u64().unwrap()).collect();
    assert!(climbs.contains(&1) && climbs.contains(&2), "{climbs:?}");
    for file in ["pareto.csv", "pareto.svg", "pareto-p95.svg"] {
        assert!(folder.join(file).exists(), "{file}");
    }

    // Taken up again: parts that are there stay as they are, the others are searched, and the front is the same.
    let parts = folder.join("parts");
    let count = std::fs::read_dir(&parts).unwrap().count();
    let before = std::fs::read(folder.join("pareto.csv")).unwrap();
    let written =
        |number: usize| std::fs::metadata(parts.join(format!("{number:03}.json"))).unwrap().modified().unwrap();
    let first = written(1);
    for number in count / 2..=count {
        std::fs::remove_file(parts.join(format!("{number:03}.json"))).unwrap();
    }
    std::fs::remove_file(folder.join("pareto.csv")).unwrap();
    let again = ["pareto", &model, "-o", &shown, "--rounds", "1", "--most-captive", "1", "--quiet"];
    assert!(coilwright(&again).status.success());
    assert_eq!(std::fs::read(folder.join("pareto.csv")).unwrap(), before);
    assert_eq!(std::fs::read_dir(&parts).unwrap().count(), count);
    assert_eq!(written(1), first, "a part that was there was searched again");
    // A part of another request is not taken for one of this.
    assert!(coilwright(&[&again[..], &["--seed", "9"]].concat()).status.success());
    assert_ne!(written(1), first, "a part of another seed was taken");
}
