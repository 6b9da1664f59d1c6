//! The programs in examples/ run, and what they write is what the repository ships.

use std::path::Path;
use std::process::{Command, Output};

use super::{code, root, run, stderr, stdout};

/// Runs an example as the README says, without asking the network for anything.
fn run_example(name: &str, arguments: &[&str]) -> Output {
    let output = Command::new(env!("CARGO"))
        .current_dir(root())
        .args(["run", "--quiet", "--offline", "--example", name, "--"])
        .args(arguments)
        .output()
        .expect("cargo runs these tests, so it can run an example");
    assert_eq!(code(&output), 0, "{name}: {}", stderr(&output));
    output
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn the_shipped_classic_patterns_are_the_programs_own() {
    let folder = tempfile::tempdir().unwrap();
    run_example("classic_patterns", &[&folder.path().display().to_string()]);
    let own = names(folder.path());
    assert!(own.len() > 60);
    let shipped = names(&root().join("patterns"));
    for name in own {
        assert!(shipped.contains(&name), "{name}");
        let read = |folder: &Path| std::fs::read_to_string(folder.join(&name)).unwrap();
        assert_eq!(read(folder.path()), read(&root().join("patterns")), "{name}");
    }
}

#[test]
fn every_shipped_pattern_can_be_wound_on_a_coil_and_names_where_it_is_from() {
    for name in names(&root().join("patterns")) {
        let text = std::fs::read_to_string(root().join("patterns").join(&name)).unwrap();
        for word in ["coil", "objective", "seed", "value"] {
            assert!(text.lines().any(|l| l.starts_with('#') && l.contains(word)), "{name} does not name its {word}");
        }
        let named = coilwright::io::read::pattern_file::parse_pattern(&name, &text).unwrap();
        assert_eq!(format!("{}.toml", named.name), name);
    }
    let answer =
        run(&["evaluate", "examples/paper-200m.toml", "--pattern", "patterns/qua-12.toml", "--pattern", "qua"]);
    let values: Vec<&str> =
        stdout(&answer).lines().skip(1).map(|l| l.split_whitespace().nth(1).unwrap_or_default()).collect();
    assert_eq!(values.len(), 2);
    assert_eq!(values[0], values[1]);
}

#[test]
fn the_first_coil_prints_what_it_is_said_to_print() {
    let expected = "\
paper 200 m: 200 m in 12 layers
zyl   9.6566 °/h after 5124.5 s of sampled-49; standard
sym   4.9007 °/h after 5125.1 s of sampled-49; captive:1
dip   4.3011 °/h after 5122.0 s of sampled-49; standard
qua   4.3366 °/h after 5122.0 s of sampled-49; standard
";
    assert_eq!(stdout(&run_example("first_coil", &[])), expected);
}
