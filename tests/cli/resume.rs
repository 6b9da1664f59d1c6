//! Interrupted searches: killed at any moment and resumed, they end as the unbroken one did, byte for byte; so do
//! searches at one and two threads.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

const REQUEST: [&str; 6] = ["--windability", "any", "--checkpoint-every", "20ms", "--patience", "6"];
const SHORT: [&str; 4] = ["--rounds", "6", "--seed", "5"];
/// Of an objective that is not proved, so that all rounds are searched.
const UNPROVED: [&str; 2] = ["--objective", "rms"];
const OTHER_SEED: [&str; 4] = ["--rounds", "6", "--seed", "6"];

fn optimise(folder: &Path, length: [&str; 4], more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_coilwright"));
    let model = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("examples/paper-200m.toml");
    command.arg("optimise").arg(model).args(REQUEST).args(length).arg("-o").arg(folder).args(more);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries.map(|e| (e.file_name().into_string().unwrap(), std::fs::read(e.path()).unwrap())).collect()
}

#[test]
fn one_and_two_threads_write_the_same_bytes() {
    let root = tempfile::tempdir().unwrap();
    let (one, two) = (root.path().join("one"), root.path().join("two"));
    assert!(optimise(&one, SHORT, &["--threads", "1"]).status().unwrap().success());
    assert!(optimise(&two, SHORT, &["--threads", "2"]).status().unwrap().success());
    let found = files(&one);
    assert!(found.contains_key("summary.json") && found.contains_key("best.toml"), "{:?}", found.keys());
    assert_eq!(found, files(&two));
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_search_that_is_killed_again_and_again_ends_as_the_unbroken_one() {
    for objective in [&UNPROVED[..], &[]] {
        let root = tempfile::tempdir().unwrap();
        let (unbroken, broken) = (root.path().join("unbroken"), root.path().join("broken"));
        assert!(optimise(&unbroken, SHORT, objective).status().unwrap().success());
        let resuming = [objective, &["--resume"]].concat();
        for after_ms in [30, 300, 110, 450, 200] {
            let mut child = optimise(&broken, SHORT, &resuming).spawn().unwrap();
            std::thread::sleep(Duration::from_millis(after_ms));
            child.kill().unwrap();
            child.wait().unwrap();
        }
        assert!(optimise(&broken, SHORT, &resuming).status().unwrap().success());
        let mut found = files(&broken);
        // What a killed process was just writing under a temporary name may be left behind.
        found.retain(|name, _| !name.starts_with(".coilwright-"));
        assert_eq!(found, files(&unbroken));
    }
}

#[test]
fn an_unfinished_run_is_not_written_over_unasked_and_a_spoilt_checkpoint_is_refused() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("run");
    let mut child = optimise(&folder, SHORT, &UNPROVED).spawn().unwrap();
    while !folder.join("checkpoint.json").exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(optimise(&folder, SHORT, &UNPROVED).status().unwrap().code(), Some(2));
    assert_eq!(
        optimise(&folder, OTHER_SEED, &[&UNPROVED[..], &["--resume"]].concat()).status().unwrap().code(),
        Some(2)
    );
    // A number that a search could have, too: the search would go on from it and end elsewhere.
    let whole = std::fs::read_to_string(folder.join("checkpoint.json")).unwrap();
    let changed = |pointer: &str| {
        let mut document: serde_json::Value = serde_json::from_str(&whole).unwrap();
        let number = document.pointer_mut(pointer).unwrap();
        *number = (number.as_u64().unwrap() + 1).into();
        document.to_string()
    };
    let changed = ["/round", "/work/moves", "/restarts/0/moves", "/restarts/0/generator/stream"].map(changed);
    let spoilt = changed.iter().map(String::as_str).chain(["", "{", "{\"schema_version\": 1}", "\u{0}\u{1}"]);
    for spoilt in spoilt {
        std::fs::write(folder.join("checkpoint.json"), spoilt).unwrap();
        assert_eq!(
            optimise(&folder, SHORT, &[&UNPROVED[..], &["--resume"]].concat()).status().unwrap().code(),
            Some(2),
            "{spoilt:?}"
        );
    }
    assert!(optimise(&folder, SHORT, &[&UNPROVED[..], &["--fresh"]].concat()).status().unwrap().success());
    assert_eq!(std::fs::read_to_string(folder.join("checkpoint.broken.json")).unwrap(), "\u{0}\u{1}");
}
