//! The program as its users meet it: exact output, exit codes, every kind of wrong request.

mod answers;
mod bad_input;
mod browser;
mod campaign;
mod campaign_kinds;
mod commands;
mod compare;
mod compensate;
mod damage;
mod diagnose;
mod exact;
mod examples;
mod experiment;
mod explorer;
mod extend;
mod fields;
mod heat_paths;
mod help;
mod improve;
mod loggers;
mod mangled;
mod metrics;
mod names;
mod once_broken;
mod own_files;
mod readme;
mod remote;
mod reproduce;
mod resume;
mod schemas;
mod sinks;
mod snapshots;
mod stress;
mod tables;
mod terminal;
mod ways;

use std::path::{Path, PathBuf};
use std::process::Output;

/// The repository's root: commands run there, so that paths are as in the README.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Runs the program in a folder. Whatever it answers as JSON is held against the schema of its answer.
fn run_in(folder: &Path, arguments: &[&str]) -> Output {
    let output = assert_cmd::Command::cargo_bin("coilwright")
        .expect("cargo builds the program before its tests")
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("the program can be started");
    answers::assert_as_promised(arguments, &output);
    output
}

fn run(arguments: &[&str]) -> Output {
    run_in(root(), arguments)
}

fn stdout(output: &Output) -> &str {
    std::str::from_utf8(&output.stdout).expect("the program writes UTF-8")
}

fn stderr(output: &Output) -> &str {
    std::str::from_utf8(&output.stderr).expect("the program writes UTF-8")
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap_or_else(|| panic!("ended by a signal: {:?}\n{}", output.status, stderr(output)))
}

/// Runs a command that must succeed and gives its JSON document.
fn json(arguments: &[&str]) -> serde_json::Value {
    let output = run(&[arguments, &["--format", "json"]].concat());
    assert_eq!(code(&output), 0, "{arguments:?}\n{}", stderr(&output));
    serde_json::from_str(stdout(&output)).unwrap_or_else(|e| panic!("{arguments:?}: {e}\n{}", stdout(&output)))
}

/// A folder that goes when the test ends, with one file in it.
fn folder_with(name: &str, contents: impl AsRef<[u8]>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let path = folder.path().join(name);
    std::fs::write(&path, contents).expect("a temporary file can be written");
    (folder, path)
}
