//! The book under docs/: every command in it runs, and its command-line reference is what the program
//! prints.

use std::path::Path;
use std::process::{Command, Output};

fn coilwright(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_coilwright")).args(arguments).current_dir(folder).output().unwrap()
}

#[test]
fn every_command_of_the_book_runs() {
    let mut ran = 0;
    for entry in std::fs::read_dir("docs/src").unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        // Each chapter begins in a folder of its own with the examples in it.
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("examples")).unwrap();
        for example in std::fs::read_dir("examples").unwrap() {
            let example = example.unwrap().path();
            std::fs::copy(&example, folder.path().join("examples").join(example.file_name().unwrap())).unwrap();
        }
        for line in text.lines().filter_map(|line| line.strip_prefix("$ coilwright ")) {
            let arguments: Vec<&str> = line.split_whitespace().collect();
            let out = coilwright(folder.path(), &arguments);
            assert!(out.status.success(), "{}: {line}\n{}", path.display(), String::from_utf8_lossy(&out.stderr));
            ran += 1;
        }
    }
    assert!(ran > 12, "{ran}");
}

#[test]
fn the_command_line_reference_is_what_the_program_prints() {
    let text = std::fs::read_to_string("docs/src/cli.md").unwrap();
    for name in ["schedule", "verify", "report"] {
        let out = coilwright(Path::new("."), &[name, "--help"]);
        let help: String =
            String::from_utf8_lossy(&out.stdout).lines().map(|line| line.trim_end().to_owned() + "\n").collect();
        // What follows belongs to all commands alike.
        let help = help.split("      --format").next().unwrap().to_owned();
        assert!(text.contains(&help), "docs/src/cli.md must hold what `coilwright {name} --help` prints:\n{help}");
    }
}
