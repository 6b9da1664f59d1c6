//! The book under docs/: every command in it runs, and its command-line reference is what the program
//! prints.

/// The example that writes the chapter of effects.
#[allow(dead_code)]
#[path = "../examples/effect_signatures.rs"]
mod effect_signatures;

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
        if path.is_dir() {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        // Each chapter begins in a folder of its own with the examples in it.
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("examples")).unwrap();
        for example in std::fs::read_dir("examples").unwrap() {
            let example = example.unwrap().path();
            if example.is_dir() {
                continue;
            }
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

/// The reference as the program prints it now.
fn reference() -> String {
    let help = |arguments: &[&str]| -> String {
        let out = coilwright(Path::new("."), arguments);
        assert!(out.status.success(), "{arguments:?}");
        String::from_utf8_lossy(&out.stdout).lines().map(|line| line.trim_end().to_owned() + "\n").collect()
    };
    let root = help(&["--help"]);
    let commands = root.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    // A command's name begins two columns in; what follows further right is its description.
    let names =
        commands.filter(|l| l.starts_with("  ") && !l.starts_with("   ")).filter_map(|l| l.split_whitespace().next());
    let mut page = String::from(
        "# Command-line reference\n\nWhat `coilwright --help` and `coilwright COMMAND --help` print. Written by\n\
         `COILWRIGHT_WRITE_BOOK=1 cargo test --test book`; without that, the test compares. `coilwright man -o DIR` writes\n\
         manual pages, `coilwright completions SHELL` completions.\n",
    );
    page += &format!("\n## coilwright\n\n```text\n{root}```\n");
    for name in names.filter(|name| *name != "help") {
        let text = help(&[name, "--help"]);
        assert!(text.contains("Example"), "{name} --help has no example");
        page += &format!("\n## {name}\n\n```text\n{text}```\n");
    }
    page
}

fn compared(path: &str, now: &str, again: &str) {
    let shipped = std::fs::read_to_string(path).unwrap_or_default();
    let line = shipped.lines().zip(now.lines()).position(|(a, b)| a != b).unwrap_or(shipped.lines().count());
    assert!(shipped == now, "{path} differs from line {} on: write it again with {again}", line + 1);
}

#[test]
fn the_command_line_reference_is_what_the_program_prints() {
    let path = "docs/src/cli.md";
    let now = reference();
    assert!(now.matches("\n## ").count() > 20);
    if std::env::var_os("COILWRIGHT_WRITE_BOOK").is_some() {
        std::fs::write(path, &now).unwrap();
    }
    compared(path, &now, "COILWRIGHT_WRITE_BOOK=1 cargo test --test book");
}

#[test]
fn the_chapter_of_effects_and_its_pictures_are_what_their_example_writes() {
    let folder = tempfile::tempdir().unwrap();
    effect_signatures::write_chapter(folder.path()).unwrap();
    let again = "cargo run --release --example effect_signatures";
    let read = |path: std::path::PathBuf| std::fs::read_to_string(path).unwrap();
    compared("docs/src/effects.md", &read(folder.path().join("effects.md")), again);
    for picture in std::fs::read_dir(folder.path().join("effects")).unwrap().map(|e| e.unwrap().path()) {
        let shipped = Path::new("docs/src/effects").join(picture.file_name().unwrap());
        compared(shipped.to_str().unwrap(), &read(picture), again);
    }
}
