//! The book under docs/: every command in it runs, and its command-line reference is what the program
//! prints.

/// The example that writes the chapter of effects.
#[allow(dead_code)]
#[path = "../../examples/effect_signatures.rs"]
mod effect_signatures;

/// The example that draws the pictures of the chapter on the physics.
#[allow(dead_code)]
#[path = "../../examples/physics_pictures.rs"]
mod physics_pictures;

use std::path::Path;
use std::process::{Command, Output};

fn coilwright(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_coilwright")).args(arguments).current_dir(folder).output().unwrap()
}

#[test]
#[ignore = "long: --include-ignored"]
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
        for examples in ["examples", "examples/campaigns"] {
            std::fs::create_dir(folder.path().join(examples)).unwrap();
            for example in std::fs::read_dir(examples).unwrap() {
                let example = example.unwrap().path();
                if example.is_dir() {
                    continue;
                }
                std::fs::copy(&example, folder.path().join(examples).join(example.file_name().unwrap())).unwrap();
            }
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

#[test]
fn the_pictures_of_the_physics_are_what_their_example_writes() {
    let folder = tempfile::tempdir().unwrap();
    physics_pictures::write_pictures(folder.path()).unwrap();
    let chapter = std::fs::read_to_string("docs/src/physics.md").unwrap();
    for picture in std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().path()) {
        let name = picture.file_name().unwrap().to_str().unwrap().to_owned();
        assert!(chapter.contains(&format!("(physics/{name})")), "{name} is not shown");
        let shipped = format!("docs/src/physics/{name}");
        let now = std::fs::read_to_string(&picture).unwrap();
        compared(&shipped, &now, "cargo run --release --example physics_pictures");
    }
}

/// Campaign files are read by `tests/cli`; everything else in TOML is part of a model file.
#[test]
fn every_piece_of_a_model_file_in_the_book_is_understood() {
    let coil = std::fs::read_to_string("examples/paper-200m.toml").unwrap();
    // What needs a pack with a conductivity stands behind a coil that has one, up to its sensor.
    let modern = std::fs::read_to_string("examples/coil-998m.toml").unwrap();
    let modern = modern.split("[sensor]").next().unwrap();
    let parsed = |coil: &str, block: &str| {
        coilwright::io::read::model_file::parse_model(Path::new("examples/model.toml"), &format!("{coil}\n{block}"))
    };
    let mut read = 0;
    for entry in std::fs::read_dir("docs/src").unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_file()) {
        let text = std::fs::read_to_string(&entry).unwrap();
        for block in text.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()) {
            if block.contains("models = ") || block.contains("[[gyro]]") {
                continue;
            }
            if let Err(faults) = parsed(&coil, block).or_else(|_| parsed(modern, block)) {
                panic!("{}: {faults}\n{block}", entry.display());
            }
            read += 1;
        }
    }
    assert!(read > 0);
}

#[test]
fn every_chapter_is_in_the_summary_and_every_link_leads_somewhere() {
    let summary = std::fs::read_to_string("docs/src/SUMMARY.md").unwrap();
    for entry in std::fs::read_dir("docs/src").unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_file()) {
        let name = entry.file_name().unwrap().to_str().unwrap().to_owned();
        assert!(name == "SUMMARY.md" || summary.contains(&format!("]({name})")), "{name} is not in the summary");
        let text = std::fs::read_to_string(&entry).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let outside = target.starts_with("http") || target.starts_with('#');
            assert!(outside || Path::new("docs/src").join(target).exists(), "{name} points to {target}");
        }
    }
}
