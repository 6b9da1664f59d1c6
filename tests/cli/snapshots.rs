//! What commands print for people, kept as text beside this file: a change of a word or a column is seen in the file that changes.
//!
//! Where a change is meant, `UPDATE_EXPECT=1 cargo test --test cli snapshots` writes the files anew. All help texts are kept as the
//! book's reference of the command line (`tests/book`), and every command of the README is compared with what it says (`readme`).

use expect_test::expect_file;

use super::{code, run_in, stderr, stdout};

/// A name for each, and the words behind the program's name. The files lie in the folder that they run in.
const SHOWN: &[(&str, &[&str])] = &[
    ("check-faults", &["check", "broken.toml"]),
    ("check", &["check", "coil.toml"]),
    ("effects-one", &["effects", "surface_film"]),
    ("evaluate", &["evaluate", "coil.toml"]),
    ("exact", &["exact", "coil.toml"]),
    ("fibres", &["fibres"]),
    ("metrics", &["metrics", "day.csv"]),
    ("metrics-no-file", &["metrics", "nothing.csv"]),
    ("patterns", &["patterns", "--layers", "8"]),
    ("potting", &["potting", "stress.toml"]),
    ("schedule", &["schedule", "coil.toml"]),
    ("short-help", &["evaluate", "-h"]),
    ("stress", &["stress", "stress.toml"]),
    ("unknown-command", &["evalute", "coil.toml"]),
];

const FILES: &[(&str, &str)] = &[
    ("coil.toml", include_str!("../../examples/paper-200m.toml")),
    ("stress.toml", include_str!("../../examples/stress-coil.toml")),
    ("day.csv", include_str!("../../examples/fan-day-1.csv")),
];

#[test]
fn what_commands_print_is_what_was_looked_at() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in FILES {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let broken = FILES[0].1.replace("layers = 12", "layers = 13\nlayrs = 12").replace("[fibre]", "[fiber]");
    std::fs::write(folder.path().join("broken.toml"), broken).unwrap();
    for (name, words) in SHOWN {
        let output = run_in(folder.path(), words);
        let mut text = format!("$ coilwright {}\n", words.join(" "));
        for line in stdout(&output).lines() {
            // Seconds are the machine's.
            let line = line.split_once(" judged in full, ").map_or(line, |(of_any_machine, _)| of_any_machine);
            text += &format!("{line}\n");
        }
        if !stderr(&output).is_empty() {
            text += &format!("--- standard error\n{}", stderr(&output));
        }
        text += &format!("--- exit code {}\n", code(&output));
        expect_file![format!("snapshots/{name}.txt")].assert_eq(&text);
    }
}
