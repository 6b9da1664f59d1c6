//! Every command in README.md is run, in its order and in one folder, and what it prints is compared.
//!
//! A line that holds only `…` stands for any number of lines. `cargo test` and `.ci/run` cannot be run from inside the
//! tests: for them the gate is looked at.

use std::path::Path;

use super::{code, root, run_in, stderr, stdout};

struct Example {
    line: usize,
    command: String,
    expected: String,
}

/// The `$ ` lines of the README's console blocks, each with what follows it.
fn examples(page: &str) -> Vec<Example> {
    let (mut found, mut inside): (Vec<Example>, bool) = (Vec::new(), false);
    for (index, line) in page.lines().enumerate() {
        if line.starts_with("```") {
            inside = line == "```console";
        } else if !inside {
            continue;
        } else if let Some(command) = line.strip_prefix("$ ") {
            found.push(Example { line: index + 1, command: command.to_owned(), expected: String::new() });
        } else if let Some(example) = found.last_mut() {
            example.expected += &format!("{}\n", line.trim_end());
        }
    }
    found
}

/// Whether the lines are those expected, where `…` stands for any number of them.
fn agrees(found: &[&str], expected: &[&str]) -> bool {
    match expected.split_first() {
        None => found.is_empty(),
        Some((&"…", rest)) => (0..=found.len()).any(|skipped| agrees(&found[skipped..], rest)),
        Some((first, rest)) => found.first().is_some_and(|f| f.trim_end() == *first) && agrees(&found[1..], rest),
    }
}

fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn every_command_of_the_readme_prints_what_the_readme_says() {
    let page = std::fs::read_to_string(root().join("README.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for shipped in ["examples", "patterns", "results/coil-998m-tolerance"] {
        copy_folder(&root().join(shipped), &folder.path().join(shipped));
    }
    let mut run_count = 0;
    for example in examples(&page) {
        let Example { line, command, expected } = example;
        let program = ["cargo run --release -- ", "coilwright "];
        let Some(arguments) = program.iter().find_map(|p| command.strip_prefix(p)) else {
            assert_is_known_outside_the_program(line, &command);
            continue;
        };
        let arguments: Vec<&str> = arguments.split_whitespace().collect();
        let output = run_in(folder.path(), &arguments);
        assert_eq!(code(&output), 0, "README.md:{line}: {command}\n{}", stderr(&output));
        let found: Vec<&str> = stdout(&output).lines().collect();
        let wanted: Vec<&str> = expected.lines().collect();
        assert!(
            agrees(&found, &wanted),
            "README.md:{line}: {command}\nprinted\n{}\nREADME.md says\n{expected}",
            stdout(&output)
        );
        run_count += 1;
    }
    assert!(run_count >= 2, "the README shows no command of the program");
}

/// The gate runs what the README tells a newcomer to run, and ends with the tests.
fn assert_is_known_outside_the_program(line: usize, command: &str) {
    let gate = std::fs::read_to_string(root().join(".ci/run")).unwrap();
    match command {
        "cargo test -- --include-ignored" => {
            assert_eq!(gate.lines().last(), Some("step cargo test -- --include-ignored"));
        }
        ".ci/run" => assert!(gate.starts_with("#!/usr/bin/env bash\n")),
        "pip install \"./python[test]\" && pytest python/tests" => {
            assert!(gate.contains("-m pip install") && gate.contains("\"./python[test"), "the gate installs it");
            assert!(gate.contains("-m pytest -q python/tests"), "the gate tests it");
        }
        other => panic!("README.md:{line}: no test knows how to run `{other}`"),
    }
}

#[test]
fn pictures_and_files_that_the_readme_points_to_exist() {
    let page = std::fs::read_to_string(root().join("README.md")).unwrap();
    let targets: Vec<&str> = page
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next())
        .filter(|target| !target.starts_with("http") && !target.starts_with('#'))
        .collect();
    assert!(targets.iter().any(|t| t.ends_with(".svg")), "the README has no picture");
    for target in targets {
        assert!(root().join(target).exists(), "{target}");
    }
}

#[test]
fn elisions_stand_for_any_number_of_lines() {
    assert!(agrees(&["a", "b", "c"], &["a", "…"]));
    assert!(agrees(&["a", "b", "c"], &["a", "…", "c"]));
    assert!(agrees(&["a"], &["a", "…"]));
    assert!(!agrees(&["a", "b"], &["a"]));
    assert!(!agrees(&["a", "b"], &["…", "c"]));
}
