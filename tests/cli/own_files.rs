//! Files that are a user's own: a command with `-o FOLDER` writes neither over what it reads nor over a model that no run left.

use std::collections::BTreeMap;
use std::path::Path;

use super::mangled::bench;
use super::{code, run_in, stderr};

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap).filter(|entry| entry.path().is_file());
    entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap())).collect()
}

const SHORT: [&str; 4] = ["--rounds", "1", "--moves-per-restart", "20"];

#[test]
fn no_result_takes_the_place_of_what_the_command_reads() {
    let folder = tempfile::tempdir().unwrap();
    bench(folder.path());
    let copy = |from: &str, to: &str| {
        std::fs::copy(folder.path().join(from), folder.path().join(to)).unwrap();
    };
    copy("record.csv", "record-1.csv");
    copy("record.csv", "temperatures.csv");
    copy("record.csv", "allan-1.svg");
    copy("pattern.toml", "best.toml");
    copy("model.toml", "extended.toml");
    copy("model.toml", "schedule.csv");
    copy("model.toml", "qua.toml");
    copy("record.csv", "summary.csv");
    let fleet = "kind = \"metrics\"\nname = \"f\"\n[[gyro]]\nname = \"1\"\nrecords = [\"summary.csv\"]\n";
    std::fs::write(folder.path().join("fleet.toml"), fleet).unwrap();
    std::fs::create_dir(folder.path().join("named")).unwrap();
    copy("pattern.toml", "named/best.toml");
    let model = std::fs::read_to_string(folder.path().join("model.toml")).unwrap();
    let named = model.replace("pattern = \"qua\"", "pattern = \"best.toml\"");
    std::fs::write(folder.path().join("named/coil.toml"), named).unwrap();
    let same_model = "shop/../model.toml";
    let before = files(folder.path());
    let optimise = [&["optimise", "model.toml"][..], &SHORT, &["-o", "."]].concat();
    let (same, absolute) = ("shop/../record-1.csv", folder.path().display().to_string());
    let fit = ["diagnose", "extended.toml", "record.csv", "--no-discovery", "-o", "."];
    for (arguments, named) in [
        (&["compare", "model.toml", "day.csv", "record-1.csv", "-o", "."][..], "model.toml"),
        (&["compare", "compared/model.toml", "day.csv", same, "-o", &absolute], "record-1.csv"),
        (&["compare", "extended.toml", "day.csv", "-o", "."], "extended.toml"),
        (&fit, "extended.toml"),
        (&["metrics", "allan-1.svg", "-o", "."], "allan-1.svg"),
        (&["temperatures", "model.toml", "temperatures.csv", "-o", "."], "temperatures.csv"),
        (&["improve", "extended.toml", "record.csv", "-o", "."], "extended.toml"),
        (&["schedule", "schedule.csv", "-o", "."], "schedule.csv"),
        (&["pareto", "qua.toml", "-o", "."], "qua.toml"),
        (&["campaign", "fleet.toml", "-o", "."], "summary.csv"),
        (&["exact", "model.toml", "-o", "model.toml"], "model.toml"),
        (&["exact", "model.toml", "-p", "best.toml", "--samples", "./best.toml"], "best.toml"),
        (&["explore", "model.toml", "-o", same_model], "model.toml"),
        (&["extend", "model.toml", "--effect", "layer_gap", "-o", "model.toml"], "model.toml"),
        (&["extend", "model.toml", "--effect", "layer_gap", "--fit", "record.csv", "-o", "record.csv"], "record.csv"),
        (&["evaluate", "model.toml", "--bang-bang", "model.toml"], "model.toml"),
        (&["compensate", "model.toml", "day.csv", "-o", "day.csv"], "day.csv"),
        (&["compensate", "model.toml", "day.csv", "--fit", "record.csv", "-o", "record.csv"], "record.csv"),
        (&["diagnose", "model.toml", "record.csv", "--experiment", "record.csv"], "record.csv"),
        (&["report", "run", "-o", "run/summary.json"], "summary.json"),
        // The model names the pattern that it reads.
        (&[&["optimise", "named/coil.toml"][..], &SHORT, &["-o", "named"]].concat(), "best.toml"),
        (&[&optimise[..], &["--init=best.toml"]].concat(), "model.toml"),
        (&[&optimise[..], &["--field", "field.csv"]].concat(), "model.toml"),
    ] {
        let out = run_in(folder.path(), arguments);
        let said = stderr(&out);
        assert!(code(&out) == 2 && said.contains("is read here") && said.contains(named), "{arguments:?}: {said}");
        assert_eq!(files(folder.path()), before, "{arguments:?}");
    }
    // From a folder of its own a run may read the model that it left there.
    let again = [&["optimise", "run/model.toml"][..], &SHORT, &["-o", "run"]].concat();
    let out = run_in(folder.path(), &again);
    assert_eq!(code(&out), 0, "{}", stderr(&out));
}

#[test]
fn a_model_file_that_no_run_left_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    bench(folder.path());
    std::fs::rename(folder.path().join("model.toml"), folder.path().join("coil.toml")).unwrap();
    std::fs::write(folder.path().join("model.toml"), "mine").unwrap();
    let before = files(folder.path());
    for arguments in [
        &[&["optimise", "coil.toml"][..], &SHORT, &["-o", "."]].concat()[..],
        &["compare", "coil.toml", "record.csv", "-o", "."],
        &["diagnose", "coil.toml", "record.csv", "--no-discovery", "-o", "."],
    ] {
        let out = run_in(folder.path(), arguments);
        assert!(code(&out) == 2 && stderr(&out).contains("left there by no run"), "{arguments:?}: {}", stderr(&out));
        assert_eq!(files(folder.path()), before, "{arguments:?}");
    }
    // Measures ask about no model and leave it alone.
    assert_eq!(code(&run_in(folder.path(), &["metrics", "record.csv", "-o", "."])), 0);
    assert_eq!(std::fs::read_to_string(folder.path().join("model.toml")).unwrap(), "mine");
}
