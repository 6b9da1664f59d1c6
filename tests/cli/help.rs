//! Every example that a command's help shows is run as it stands, in a shell, in a folder with the files it names.
//!
//! Long searches and diagnoses, which other tests run, are only parsed here: where no file is, they must complain of
//! the file and of nothing else.

use std::path::Path;
use std::process::{Command, Output};

use super::{code, root, run, run_in, stderr, stdout};

/// What takes seconds: only parsed.
const LONG: &[&str] = &[
    // It reads what an earlier diagnosis with --terms wrote.
    "extend coil.toml --proposal",
    "trim",
    "optimise examples/paper-200m.toml --windability any",
    "optimise my-coil.toml",
    "optimise extended.toml",
    "pareto",
    "campaign",
    "diagnose",
    "improve",
    "reproduce",
    "exact examples/paper-200m.toml --windability any",
];

/// Names of all commands, from the program's own help.
pub fn commands() -> Vec<String> {
    let help = run(&["--help"]);
    let lines = stdout(&help).lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    let names =
        lines.filter(|l| l.starts_with("  ") && !l.starts_with("   ")).filter_map(|l| l.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

/// The command lines under "Example(s):", wrapped lines joined, words of explanation left out.
fn examples(help: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    let mut explained = false;
    let block = help.lines().skip_while(|l| !l.starts_with("Example")).skip(1).take_while(|l| l.starts_with("  "));
    for line in block.map(str::trim) {
        let (command, words) = line.split_once("   ").map_or((line, None), |(c, words)| (c, Some(words)));
        if command.starts_with("coilwright ") || command.contains("| coilwright ") {
            found.push(command.to_owned());
            explained = words.is_some();
        } else if let (Some(last), false) = (found.last_mut(), explained) {
            *last = format!("{last} {line}");
        }
    }
    found
}

fn write(folder: &Path, name: &str, text: &str) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
}

/// The files that the examples name, small enough to be quick.
fn prepare(folder: &Path) {
    let read = |name: &str| std::fs::read_to_string(root().join(name)).unwrap();
    let coil = read("examples/paper-200m.toml").replace("count = 64", "count = 2");
    write(folder, "examples/paper-200m.toml", &coil);
    let spread = "\n[tolerance]\nturns_per_layer_sd = 0.3\nsamples = 5\n";
    write(folder, "potted.toml", &read("examples/stress-coil.toml").replace("count = 16", "count = 2"));
    write(folder, "my-coil.toml", &(coil.replace("\"paper\"", "\"warm-up\"") + spread));
    write(folder, "patterns/qua-12.toml", &read("patterns/qua-12.toml"));
    write(folder, "results/my-coil/best.toml", &read("patterns/searched-standard-12.toml"));
    write(folder, "coil.toml", &read("tests/data/records/a-control/coil.toml"));
    let record = |name: &str| -> String {
        let text = read(&format!("tests/data/records/a-control/{name}.csv"));
        text.lines().take(400).map(|line| format!("{line}\n")).collect()
    };
    for name in ["calibration", "day-1", "monday", "record", "rest"] {
        write(folder, &format!("{name}.csv"), &record("calibration"));
    }
    for name in ["validation", "day-2", "tuesday"] {
        write(folder, &format!("{name}.csv"), &record("validation"));
    }
    for name in ["up", "down"] {
        write(folder, &format!("{name}.csv"), &record("calibration"));
    }
    let field = |layers: usize| -> String {
        let names: String = (1..=layers).map(|j| format!(",layer_{j}_c")).collect();
        let row = |i: i32| {
            let cells: String = (1..=layers).map(|j| format!(",{}", 20.0 + 1e-4 * j as f64 * f64::from(i))).collect();
            format!("{}{cells}\n", 10 * i - 10)
        };
        format!("time_s{names}\n") + &(0..402).map(row).collect::<String>()
    };
    for name in ["warm-up", "sun-side"] {
        write(folder, &format!("{name}.csv"), &field(12));
    }
    let layers = coilwright::io::read::model_file::read_model(&folder.join("coil.toml")).unwrap().model.coil.layers();
    write(folder, "layers.csv", &field(layers));
    let turned = (0..200).map(|i| {
        let table = [0.0, 30.0, -30.0][i / 20 % 3];
        format!("{i},25,{},{table}\n", 12.5 * 3600.0 * table * 1.0001 + (i % 7) as f64)
    });
    write(folder, "table.csv", &("t,T,F,Table\n".to_owned() + &turned.collect::<String>()));
    for made in [".local/share/bash-completion/completions", "embedded"] {
        std::fs::create_dir_all(folder.join(made)).unwrap();
    }
}

/// In a shell that finds the program, with the folder as its home.
fn shell(folder: &Path, line: &str) -> Output {
    let program = Path::new(env!("CARGO_BIN_EXE_coilwright"));
    let path = format!("{}:{}", program.parent().unwrap().display(), std::env::var("PATH").unwrap_or_default());
    // What logs the gyro on the reader's machine is a file here.
    let line = line.replace("logger |", "cat day-2.csv |");
    let mut shell = Command::new("bash");
    shell.args(["-o", "pipefail", "-c", &line]).current_dir(folder).env("PATH", path).env("HOME", folder);
    shell.output().expect("bash runs the examples")
}

#[test]
#[ignore = "long: --include-ignored"]
fn every_example_of_every_help_text_runs() {
    let (mut ran, mut parsed) = (0, 0);
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let empty = tempfile::tempdir().unwrap();
    let names = commands();
    let pages = std::iter::once(run(&["--help"])).chain(names.iter().map(|name| run(&[name, "--help"])));
    for page in pages {
        let examples = examples(stdout(&page));
        assert!(!examples.is_empty(), "{}", stdout(&page));
        for example in examples {
            let arguments = example.strip_prefix("coilwright ").unwrap_or(&example);
            if LONG.iter().any(|long| arguments.starts_with(long)) {
                let words: Vec<&str> = arguments.split_whitespace().collect();
                if words[0] == "reproduce" {
                    continue;
                }
                let answer = run_in(empty.path(), &words);
                assert_eq!(code(&answer), 2, "{example}");
                assert!(stderr(&answer).contains("cannot be read"), "{example}: {}", stderr(&answer));
                parsed += 1;
                continue;
            }
            for written in ["coil-2.toml", "my-coil.toml"] {
                let writes = example.ends_with(written) && example.contains("-o ") || example.contains(" new ");
                if writes && folder.path().join(written).exists() {
                    std::fs::remove_file(folder.path().join(written)).unwrap();
                }
            }
            let answer = shell(folder.path(), &example);
            let may_say_no = example.contains("--strict");
            assert!(code(&answer) == 0 || (may_say_no && code(&answer) == 1), "{example}: {}", stderr(&answer));
            if example.contains(" new ") {
                prepare(folder.path());
            }
            ran += 1;
        }
    }
    println!("{ran} examples run, {parsed} parsed");
    assert!(ran >= 30 && parsed >= 8, "{ran} {parsed}");
}
