//! Every command on files that were damaged with an eye for their structure: an answer or one error, within bounds.
//!
//! A number becomes absurd, a row or a key is lost, repeated or moved, a quote or a bracket stands where none belongs. A
//! panic, a NaN or infinity in an output, a run of more than [`LONGEST`] or a control character on the terminal fails.
//! `COILWRIGHT_MANGLED_RUNS=10000 cargo test --test cli mangled` is the long form.

use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use coilwright::text::is_unseen;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::root;

/// Of one run; a debugging build on a busy machine is ten times slower than what is shipped.
const LONGEST: Duration = Duration::from_secs(120);
const RUNS: usize = 60;

const NUMBERS: &[&str] = &[
    "nan",
    "inf",
    "-1.513e+299",
    "1e308",
    "-1e308",
    "1e-308",
    "0",
    "-0.0",
    "-1",
    "4e-11",
    "9223372036854775808",
    "1e18",
    "99999999",
    "1_000",
];
const SIGNS: &[&str] = &[
    "\"",
    "'",
    "[",
    "]",
    "{",
    "}",
    "=",
    ",",
    "\n",
    "\r",
    "#",
    ";",
    "\u{1b}[2J",
    "\u{202e}",
    "\u{feff}",
    "\0",
    "<",
    "\\",
];

fn mangled(text: &str, random: &mut ChaCha8Rng) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..random.random_range(1..4) {
        if lines.is_empty() {
            break;
        }
        let at = random.random_range(0..lines.len());
        let other = random.random_range(0..lines.len());
        match random.random_range(0..8) {
            0 => drop(lines.remove(at)),
            1 => lines.insert(other, lines[at].clone()),
            2 => lines.swap(at, other),
            3 | 4 => lines[at] = with_number(&lines[at], NUMBERS[random.random_range(0..NUMBERS.len())], random),
            5 => {
                let mut line: Vec<char> = lines[at].chars().collect();
                let place = random.random_range(0..=line.len());
                let sign = SIGNS[random.random_range(0..SIGNS.len())];
                line.splice(place..place, sign.chars());
                lines[at] = line.into_iter().collect();
            }
            6 => lines.truncate(at),
            _ => lines[at] = with_number(&lines[at], &random.random_range(-1e6..1e6).to_string(), random),
        }
    }
    lines.join("\n") + "\n"
}

/// The line with one of its numbers replaced.
fn with_number(line: &str, new: &str, random: &mut ChaCha8Rng) -> String {
    let mut spans: Vec<std::ops::Range<usize>> = Vec::new();
    for (i, c) in line.char_indices().filter(|(_, c)| c.is_ascii_digit() || ".-+e".contains(*c)) {
        match spans.last_mut() {
            Some(last) if last.end == i => last.end = i + c.len_utf8(),
            _ => spans.push(i..i + c.len_utf8()),
        }
    }
    spans.retain(|span| line[span.clone()].contains(|c: char| c.is_ascii_digit()));
    if spans.is_empty() {
        return line.to_owned();
    }
    let span = spans[random.random_range(0..spans.len())].clone();
    format!("{}{new}{}", &line[..span.start], &line[span.end..])
}

const MODEL: &str = "tests/data/records/c-spool/coil.toml";

/// A command, with `@` where the damaged file goes.
const WAYS: &[(&str, &[&str])] = &[
    ("examples/paper-200m.toml", &["check", "@"]),
    ("examples/paper-200m.toml", &["evaluate", "@", "--format", "json"]),
    ("examples/paper-200m.toml", &["schedule", "@", "--pattern", "qua", "-o", "out"]),
    ("examples/paper-200m.toml", &["temperatures", "@", "--profile", "worst"]),
    ("examples/paper-200m.toml", &["tolerance", "@"]),
    ("examples/paper-200m.toml", &["optimise", "@", "--rounds", "1", "--moves-per-restart", "20", "-o", "out"]),
    ("patterns/qua-12.toml", &["evaluate", "examples/paper-200m.toml", "--pattern", "@"]),
    ("record", &["metrics", "@", "--format", "json", "-o", "out"]),
    ("record", &["metrics", "@"]),
    ("record", &["compensate", MODEL, "@"]),
    ("record", &["compare", MODEL, "@", "--format", "json"]),
    ("schedule.csv", &["verify", "examples/paper-200m.toml", "@"]),
    ("schedule.json", &["verify", "examples/paper-200m.toml", "@"]),
    ("traveller.html", &["verify", "examples/paper-200m.toml", "@"]),
    ("program.gcode", &["verify", "examples/paper-200m.toml", "@"]),
];

fn seed_text(name: &str, emitted: &Path) -> String {
    match name {
        "record" => {
            let text = std::fs::read_to_string(root().join("tests/data/records/c-spool/validation.csv")).unwrap();
            text.lines().take(120).map(|line| format!("{line}\n")).collect()
        }
        name if root().join(name).exists() => std::fs::read_to_string(root().join(name)).unwrap(),
        name => std::fs::read_to_string(emitted.join(name)).unwrap(),
    }
}

#[test]
fn no_damaged_file_makes_a_command_panic_hang_or_answer_with_what_is_no_number() {
    let runs = std::env::var("COILWRIGHT_MANGLED_RUNS").ok().and_then(|n| n.parse().ok()).unwrap_or(RUNS);
    let folder = tempfile::tempdir().unwrap();
    let emitted = folder.path().join("emitted");
    let out = emitted.to_str().unwrap();
    let made = crate::run(&["schedule", "examples/paper-200m.toml", "--pattern", "qua", "-q", "-o", out]);
    assert_eq!(crate::code(&made), 0);
    let mut random = ChaCha8Rng::seed_from_u64(24);
    let mut codes = std::collections::BTreeMap::new();
    let mut longest = Duration::ZERO;
    for run in 0..runs {
        let (seed, way) = WAYS[run % WAYS.len()];
        let text = mangled(&seed_text(seed, &emitted), &mut random);
        let damaged = folder.path().join("damaged");
        let output = folder.path().join("out");
        let _ = std::fs::remove_dir_all(&output);
        std::fs::write(&damaged, &text).unwrap();
        let arguments: Vec<&str> = way
            .iter()
            .map(|a| match *a {
                "@" => damaged.to_str().unwrap(),
                "out" => output.to_str().unwrap(),
                a => a,
            })
            .collect();
        let (code, said, took) = bounded(&arguments);
        let what = || format!("run {run}: {arguments:?}\n{said:.2000}\nof\n{text:.4000}");
        longest = longest.max(took);
        assert!([Some(0), Some(1), Some(2)].contains(&code), "{code:?} after {took:?}, {}", what());
        assert!(!said.contains("panicked"), "{}", what());
        // A quoted cell of the damaged file may hold anything; an answer may not.
        if code == Some(0) {
            let words = said.split(|c: char| !c.is_ascii_alphanumeric()).map(str::to_ascii_lowercase);
            let not_numbers = words.filter(|w| ["nan", "inf", "infinity"].contains(&w.as_str())).count();
            assert!(not_numbers == 0 || ["nan", "inf"].iter().any(|w| text.contains(w)), "{}", what());
        }
        assert!(!said.contains(|c| is_unseen(c) && c != '\n'), "{}", what());
        *codes.entry(code).or_insert(0) += 1;
    }
    println!("{runs} damaged files: exit codes {codes:?}, longest run {longest:.1?}");
}

/// Runs the program for so long at most: its exit code (none if it had to be ended) and all that it wrote.
fn bounded(arguments: &[&str]) -> (Option<i32>, String, Duration) {
    let started = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_coilwright"))
        .args(arguments)
        .current_dir(root())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let drain = |mut pipe: Box<dyn Read + Send>| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            let _ = pipe.read_to_end(&mut bytes);
            String::from_utf8_lossy(&bytes).into_owned()
        })
    };
    let (out, err) = (drain(Box::new(child.stdout.take().unwrap())), drain(Box::new(child.stderr.take().unwrap())));
    let code = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status.code();
        }
        if started.elapsed() > LONGEST {
            child.kill().unwrap();
            child.wait().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    (code, out.join().unwrap() + &err.join().unwrap(), started.elapsed())
}
