//! Campaigns: parts together equal the whole, what is done is not done again, and what is missing is named. The front's points are patterns
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

type Document = serde_json::Value;

fn answered(arguments: &[&str], code: i32) -> Document {
    let output = coilwright(&[arguments, &["--format", "json", "--quiet"]].concat());
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn ids(found: &Document) -> Vec<String> {
    found.as_array().unwrap().iter().map(|id| id["id"].as_str().or(id.as_str()).unwrap().to_owned()).collect()
}

#[test]
#[ignore = "long: --include-ignored"]
fn parts_and_single_cells_together_are_the_whole_and_what_is_done_is_skipped() {
    let root = tempfile::tempdir().unwrap();
    let campaign = campaign_file(root.path());
    let (whole, parts) =
        (root.path().join("whole").display().to_string(), root.path().join("parts").display().to_string());
    let run = |folder: &str, more: &[&str], code: i32| {
        answered(&[&["campaign", &campaign, "-o", folder], more].concat(), code)
    };
    let first = run(&whole, &[], 0);
    assert_eq!((ids(&first["cells"]).len(), &first["searched"], ids(&first["missing"]).len()), (8, &8.into(), 0));
    assert_eq!(run(&whole, &[], 0)["searched"], 0);

    // Before anything is done: a list without a folder, and a table that would be incomplete.
    let listed = answered(&["campaign", &campaign, "--list"], 0);
    let all = ids(&listed["cells"]);
    assert_eq!((all.len(), ids(&listed["missing"])), (8, all.clone()));
    for cell in listed["cells"].as_array().unwrap() {
        for key in ["id", "kind", "model", "layers", "class", "objective", "seed", "done"] {
            assert!(!cell[key].is_null(), "{key}: {cell}");
        }
        assert_eq!((&cell["done"], &cell["kind"]), (&false.into(), &"search".into()));
    }
    assert_eq!(ids(&run(&parts, &["--merge"], 1)["missing"]), all);
    assert!(!Path::new(&parts).join("summary.csv").exists());

    let second = run(&parts, &["--shard", "2/3"], 0);
    assert_eq!((ids(&second["cells"]).len(), ids(&second["missing"]).len(), &second["searched"]), (3, 0, &3.into()));
    let third = ids(&run(&parts, &["--shard", "3/3", "--threads", "1"], 0)["cells"]);
    let left = ids(&run(&parts, &["--merge"], 1)["missing"]);
    assert!(left.len() == 3 && left.iter().all(|id| !third.contains(id)));
    let one = run(&parts, &["--cell", &left[0], "--cell", &left[2]], 0);
    assert_eq!(one["searched"], 2);
    let words = coilwright(&["campaign", &campaign, "-o", &parts, "--merge"]);
    let words = String::from_utf8_lossy(&words.stderr).into_owned();
    assert!(words.contains(&format!("1 of 8 cells are missing: {}", left[1])), "{words}");
    run(&parts, &["--cell", &left[1]], 0);
    assert_eq!(run(&parts, &["--merge"], 0)["searched"], 0);
    let found = files(Path::new(&whole));
    for file in ["summary.csv", "summary-worst-rate.svg", "summary-p95.svg", "report.html"] {
        assert!(found.contains_key(Path::new(file)), "{file}");
    }
    assert_eq!(found, files(Path::new(&parts)));

    let unknown = coilwright(&["campaign", &campaign, "-o", &parts, "--cell", "0123456789abcdef"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("--list"));
}

#[test]
fn only_what_a_change_reaches_is_computed_again_and_a_damaged_cell_is_missing() {
    let root = tempfile::tempdir().unwrap();
    let example = std::fs::read_to_string(example()).unwrap();
    let write = |name: &str, text: &str| std::fs::write(root.path().join(name), text).unwrap();
    let (path, folder) =
        (root.path().join("grid.toml").display().to_string(), root.path().join("out").display().to_string());
    let grid = |models: &str| {
        format!(
            "name = \"grid\"\nmodels = {models}\nlayers = [8]\nseeds = [1, 2]\nrounds = 1\nmoves_per_restart = 20\n"
        )
    };
    write("a.toml", &example);
    write("b.toml", &example.replace("paper 200 m", "another"));
    write("grid.toml", &grid("[\"a.toml\", \"b.toml\"]"));
    let run = |more: &[&str], code: i32| answered(&[&["campaign", &path, "-o", &folder], more].concat(), code);
    let before = ids(&run(&[], 0)["cells"]);
    assert_eq!(before.len(), 4);
    // Words for people change nothing; another order, another model in front and another seed add what they add.
    write("a.toml", &("# a comment\n".to_owned() + &example + "\n[production]\nspool = \"x\"\n"));
    write("c.toml", &example.replace("paper 200 m", "third"));
    write("grid.toml", &grid("[\"c.toml\", \"b.toml\", \"a.toml\"]").replace("[1, 2]", "[2, 1]"));
    assert_eq!(run(&[], 0)["searched"], 2);
    // The same search twice is one cell.
    write("c.toml", &example);
    assert_eq!(ids(&run(&["--list"], 0)["cells"]).len(), 4);
    write(
        "b.toml",
        &example.replace("paper 200 m", "another").replace("max_rate_c_per_h = 10.0", "max_rate_c_per_h = 11.0"),
    );
    let changed = run(&["--list"], 0);
    assert_eq!(ids(&changed["missing"]).len(), 2, "{changed}");
    assert_eq!(run(&[], 0)["searched"], 2);
    // What is not whole is not done.
    let cell = Path::new(&folder).join("cells").join(&before[0][..2]).join(format!("{}.json", before[0]));
    let text = std::fs::read_to_string(&cell).unwrap();
    std::fs::write(&cell, &text[..text.len() / 2]).unwrap();
    assert_eq!(ids(&run(&["--merge"], 1)["missing"]), before[..1]);
    assert_eq!(run(&[], 0)["searched"], 1);
    assert_eq!(std::fs::read_to_string(&cell).unwrap(), text);
    // Nor is what holds another number than the search found.
    let mut changed: serde_json::Value = serde_json::from_str(&text).unwrap();
    changed["worst_rate_deg_per_h"] = 0.0123.into();
    std::fs::write(&cell, serde_json::to_string_pretty(&changed).unwrap()).unwrap();
    assert_eq!(ids(&run(&["--merge"], 1)["missing"]), before[..1]);
    assert_eq!(run(&[], 0)["searched"], 1);
    assert_eq!(std::fs::read_to_string(&cell).unwrap(), text);
}

#[test]
fn a_long_cell_that_is_killed_goes_on_from_its_checkpoint_and_ends_the_same() {
    let root = tempfile::tempdir().unwrap();
    std::fs::copy(example(), root.path().join("paper.toml")).unwrap();
    let path = root.path().join("grid.toml").display().to_string();
    let text = "name = \"long\"\nmodels = [\"paper.toml\"]\nlayers = [14]\nrounds = 3\nmoves_per_restart = 60000\n";
    std::fs::write(&path, text).unwrap();
    let (killed, whole) = (root.path().join("killed"), root.path().join("whole"));
    let start = || {
        let arguments =
            ["campaign", &path, "-o", &killed.display().to_string(), "--checkpoint-every", "1ms", "--quiet"];
        Command::new(env!("CARGO_BIN_EXE_coilwright")).args(arguments).spawn().unwrap()
    };
    let mut child = start();
    let unfinished = killed.join("unfinished");
    let has_checkpoint = || {
        let folders = std::fs::read_dir(&unfinished).into_iter().flatten().flatten();
        folders.into_iter().any(|folder| folder.path().join("checkpoint.json").exists())
    };
    while !has_checkpoint() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(start().wait().unwrap().success());
    assert!(!unfinished.exists());
    answered(&["campaign", &path, "-o", &whole.display().to_string()], 0);
    assert_eq!(files(&killed), files(&whole));
}

#[test]
fn the_same_cell_twice_at_once_is_one_result() {
    let root = tempfile::tempdir().unwrap();
    std::fs::copy(example(), root.path().join("paper.toml")).unwrap();
    let path = root.path().join("grid.toml").display().to_string();
    std::fs::write(&path, "name = \"twice\"\nmodels = [\"paper.toml\"]\nrounds = 1\nmoves_per_restart = 2000\n")
        .unwrap();
    let (both, alone) = (root.path().join("both"), root.path().join("alone"));
    let id = ids(&answered(&["campaign", &path, "--list"], 0)["cells"]).remove(0);
    let shown = both.display().to_string();
    let start = || {
        let arguments = ["campaign", &path, "-o", &shown, "--cell", &id, "--checkpoint-every", "1ms", "--quiet"];
        Command::new(env!("CARGO_BIN_EXE_coilwright"))
            .args(arguments)
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap()
    };
    let mut runs: Vec<std::process::Child> = (0..3).map(|_| start()).collect();
    assert!(runs.iter_mut().all(|run| run.wait().unwrap().success()));
    answered(&["campaign", &path, "-o", &shown, "--merge"], 0);
    answered(&["campaign", &path, "-o", &alone.display().to_string()], 0);
    let mut found = files(&both);
    // What a run kept of a cell that another one ended first.
    found.retain(|path, _| !path.starts_with("unfinished"));
    assert_eq!(found, files(&alone));
}

#[test]
fn a_workflow_names_its_jobs_and_a_hostile_path_stays_a_path() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("it's $(touch x) {wild} \"b\"");
    std::fs::create_dir(&folder).unwrap();
    let campaign = campaign_file(&folder);
    for (engine, file) in [("snakemake", "config.json"), ("slurm", "campaign.conf")] {
        let out = root.path().join(engine);
        let shown = out.display().to_string();
        let answer = answered(&["campaign", &campaign, "--emit", engine, "-o", &shown, "--job-time", "1ms"], 0);
        assert_eq!((&answer["parts"], &answer["engine"]), (&8.into(), &engine.into()));
        assert_eq!(ids(&answer["missing"]).len(), 8);
        let text = std::fs::read_to_string(out.join(file)).unwrap();
        if engine == "snakemake" {
            let config: Document = serde_json::from_str(&text).unwrap();
            assert_eq!(config["campaign"], campaign.as_str());
        } else {
            let script = format!("{text}printf %s \"$campaign\"");
            let said = Command::new("bash").args(["-c", &script]).current_dir(root.path()).output().unwrap();
            assert_eq!(String::from_utf8_lossy(&said.stdout), campaign);
        }
    }
    assert!(!root.path().join("x").exists());
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
#[ignore = "long: --include-ignored"]
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
    // A part that holds another pattern than was found is searched again.
    let part = parts.join("001.json");
    let found = std::fs::read_to_string(&part).unwrap();
    let mut changed: serde_json::Value = serde_json::from_str(&found).unwrap();
    changed["found"][0].as_array_mut().unwrap().reverse();
    std::fs::write(&part, changed.to_string()).unwrap();
    assert!(coilwright(&again).status.success());
    assert_eq!(std::fs::read_to_string(&part).unwrap(), found);
    // And what a killed run left of a part that another one has written since goes.
    let half = parts.join(".001.json.0.coilwright");
    std::fs::write(&half, "half").unwrap();
    assert!(coilwright(&again).status.success());
    assert!(!half.exists());
    assert_eq!(std::fs::read(folder.join("pareto.csv")).unwrap(), before);
    let first = written(1);
    // A part of another request is not taken for one of this.
    assert!(coilwright(&[&again[..], &["--seed", "9"]].concat()).status.success());
    assert_ne!(written(1), first, "a part of another seed was taken");
}
