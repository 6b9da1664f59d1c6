//! Every command on files that were damaged with an eye for their structure: an answer or one error, within bounds.
//!
//! A number becomes absurd, a row or a key is lost, repeated or moved, a stamp comes 4e-11 s after the one before, a quote or a
//! bracket stands where none belongs. A panic, a NaN or infinity in an answer or in a file that is written, a run of more than
//! [`bounds`], a control character on the terminal, another result from a damaged checkpoint, an answer from rows that are closer
//! than any clock's fails; all failures come at the end. CONTRIBUTING says how to run it for long.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use coilwright::record::LEAST_INTERVAL_S;
use coilwright::text::is_unseen;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::damage::damaged;
use super::ways::{COMMANDS, Way};

/// So long in every run of the tests.
const USUAL: Duration = Duration::from_secs(25);
/// Files that are tried at least, whatever the time: each way twice.
const LEAST_ROUNDS: usize = 1;
const MOST_FAILURES: usize = 20;

struct Bounds {
    processor_s: f64,
    memory_kib: u64,
}

/// What is shipped has 30 s and 1 GB; a debugging build is several times slower.
fn bounds() -> Bounds {
    let processor_s = if std::env::var_os("COILWRIGHT_PROGRAM").is_some() { 30.0 } else { 120.0 };
    Bounds { processor_s, memory_kib: 1_000_000 }
}

fn program() -> PathBuf {
    let named = std::env::var_os("COILWRIGHT_PROGRAM");
    // It is started in other folders.
    named.map_or_else(|| env!("CARGO_BIN_EXE_coilwright").into(), |path| std::fs::canonicalize(path).unwrap())
}

/// A file that is damaged, and a command that reads it, run in a folder of its own.
const WAYS: &[(&str, &[&str])] = &[
    ("model.toml", &["check", "model.toml"]),
    ("model.toml", &["evaluate", "model.toml", "--format", "json", "--bang-bang", "out/listed.toml"]),
    ("model.toml", &["exact", "model.toml", "--budget", "2s", "-o", "out/exact.toml", "--samples", "out/samples.csv"]),
    ("model.toml", &["schedule", "model.toml", "-o", "out"]),
    ("model.toml", &["verify", "model.toml", "shop/schedule.csv"]),
    ("model.toml", &["temperatures", "model.toml", "-o", "out"]),
    ("model.toml", &["tolerance", "model.toml"]),
    ("model.toml", &["optimise", "model.toml", "--rounds", "1", "--moves-per-restart", "20", "-o", "out"]),
    ("model.toml", &["pareto", "model.toml", "--rounds", "1", "--most-captive", "0", "-o", "out"]),
    ("model.toml", &["compare", "model.toml", "record.csv", "--format", "json", "-o", "out"]),
    ("model.toml", &["compensate", "model.toml", "record.csv", "--fit", "record.csv", "--export", "out/embedded"]),
    ("model.toml", &["diagnose", "model.toml", "record.csv", "--format", "json", "-o", "out"]),
    ("model.toml", &["extend", "model.toml", "--effect", "spool_mass", "-o", "out/extended.toml"]),
    ("model.toml", &["explore", "model.toml", "-o", "out/explorer.html"]),
    ("pattern.toml", &["explore", "model.toml", "pattern.toml", "-o", "out/explorer.html"]),
    ("stressed.toml", &["stress", "stressed.toml", "--at", "-40", "--format", "json"]),
    ("stressed.toml", &["potting", "stressed.toml", "--pattern", "qua", "--format", "json"]),
    ("model.toml", &["report", "run"]),
    ("model.toml", &["trim", "model.toml", "record.csv", "--format", "json"]),
    ("record.csv", &["trim", "model.toml", "record.csv"]),
    ("pattern.toml", &["evaluate", "model.toml", "--pattern", "pattern.toml"]),
    ("pattern.toml", &["schedule", "model.toml", "--pattern", "pattern.toml", "-o", "out"]),
    ("profiles.toml", &["temperatures", "model.toml", "--profiles", "profiles.toml", "-o", "out"]),
    ("profiles.toml", &["evaluate", "model.toml", "--profiles", "profiles.toml", "--format", "json"]),
    ("campaign.toml", &["campaign", "campaign.toml", "-o", "out"]),
    ("record.csv", &["metrics", "record.csv", "--format", "json", "-o", "out"]),
    ("record.csv", &["metrics", "record.csv", "--bad-rows", "skip", "--gross-errors", "drop"]),
    (
        "mapped.csv",
        &["metrics", "mapped.csv", "--columns", "time=Zeit:min,temperature=T1:c,rate=Omega:counts,scale=12.5"],
    ),
    ("packed.mat", &["metrics", "packed.mat", "--format", "json", "-o", "out"]),
    ("seven-three.mat", &["metrics", "seven-three.mat"]),
    ("structure.mat", &["compare", "model.toml", "structure.mat", "--format", "json"]),
    ("compound.h5", &["metrics", "compound.h5", "--format", "json"]),
    ("table.csv", &["metrics", "table.csv", "--format", "json", "--latitude", "48", "--elevation", "90"]),
    ("field.csv", &["evaluate", "model.toml", "--field", "field.csv", "--format", "json"]),
    ("long.csv", &["evaluate", "model.toml", "--field", "long.csv", "--field", "field.csv"]),
    (
        "field.csv",
        &["optimise", "model.toml", "--field", "field.csv", "--rounds", "1", "--moves-per-restart", "20", "-o", "out"],
    ),
    ("field.csv", &["compare", "model.toml", "day.csv", "--field", "field.csv", "--format", "json"]),
    ("record.csv", &["compensate", "model.toml", "record.csv"]),
    ("record.csv", &["compensate", "model.toml", "day.csv", "--fit", "record.csv"]),
    (
        "record.csv",
        &["compensate", "model.toml", "record.csv", "--fit", "day.csv", "--all-methods", "-o", "out/all.svg"],
    ),
    ("record.csv", &["temperatures", "model.toml", "record.csv", "-o", "out"]),
    ("record.csv", &["compare", "model.toml", "record.csv", "--format", "json", "-o", "out"]),
    (
        "record.csv",
        &["diagnose", "model.toml", "record.csv", "--format", "json", "-o", "out", "--experiment", "out/next.toml"],
    ),
    (
        "record.csv",
        &["extend", "model.toml", "--effect", "channel:supply_v", "--fit", "record.csv", "-o", "out/extended.toml"],
    ),
    ("record.csv", &["improve", "model.toml", "record.csv", "-o", "out"]),
    ("shop/schedule.csv", &["verify", "model.toml", "shop/schedule.csv"]),
    ("shop/schedule.json", &["verify", "model.toml", "shop/schedule.json"]),
    ("shop/traveller.html", &["verify", "model.toml", "shop/traveller.html"]),
    ("shop/traveller.csv", &["verify", "model.toml", "shop/traveller.csv"]),
    ("shop/traveller.json", &["verify", "model.toml", "shop/traveller.json"]),
    ("shop/program.gcode", &["verify", "model.toml", "shop/program.gcode"]),
    ("shop/program.csv", &["verify", "model.toml", "shop/program.csv"]),
    ("run/checkpoint.json", RESUMED),
    // Some more of them: few changes lead elsewhere.
    ("run/checkpoint.json", RESUMED),
    ("run/checkpoint.json", RESUMED),
    ("run/checkpoint.json", RESUMED),
    ("run/summary.json", &["report", "run"]),
    ("run/history.csv", &["report", "run"]),
    ("compared/comparison.json", &["report", "compared"]),
    ("compared/record-1.csv", &["report", "compared"]),
    ("compared/metrics.json", &["report", "compared"]),
    (
        "run/summary.json",
        &["optimise", "model.toml", "--rounds", "1", "--moves-per-restart", "20", "--compare-with", "run"],
    ),
];

const MATERIALS: &str = r#"
[materials]
adhesive = "mine"
spool = "invar"
spool_thickness_mm = 2.0
[materials.fibre]
glass = "silica-over-temperature"
glass_diameter_um = 80.0
coatings = [{ material = "acrylate-soft", outer_diameter_um = 125.0 }, { material = "acrylate-hard", outer_diameter_um = 165.0 }]
[[materials.own]]
name = "mine"
youngs_modulus_mpa = { glassy = 2100.0, rubbery = 12.0, transition_c = 18.0, width_k = 6.0 }
bulk_modulus_mpa = 3000.0
expansion_per_k = [[-40.0, 7.0e-5], [30.0, 1.9e-4]]
"#;
const RESUMED: &[&str] =
    &["optimise", "model.toml", "--rounds", "2", "--moves-per-restart", "20", "-o", "run", "--resume"];

const MODEL: &str = r#"
name = "small coil"
[fibre]
refractive_index = 1.45
thermo_optic_per_k = 1e-5
wavelength_nm = 1550.0
outer_diameter_um = 165.0
[winding]
layers = 4
turns_per_layer = 20
inner_diameter_mm = 60.0
layer_length = "actual"
pattern = "qua"
[thermal]
model = "pack"
conductivity_w_per_m_k = 0.35
volumetric_heat_capacity_j_per_m3_k = 1.7e6
[sensor]
location = "outer_layer"
rate_mean_s = 10.0
[[effect]]
kind = "spool_mass"
heat_capacity_j_per_m2_k = 4000.0
contact_w_per_m2_k = 300.0
[profiles]
max_rate_c_per_h = 60.0
count = 2
segments = 3
duration_s = 6000.0
seed = 1
[[profiles.ramp]]
name = "warm-up"
pieces = [{ rate_c_per_h = 30.0, duration_s = 600.0 }, { rate_c_per_h = 0.0, duration_s = 600.0 }]
[production]
part_number = "X-1"
tension_n = 0.1
potting_every_layers = 2
[tolerance]
turns_per_layer_sd = 0.1
samples = 3
[record]
bad_rows = "refuse"
"#;

/// Files of every kind that is read, most of them written by the program itself.
pub(super) fn bench(folder: &Path) {
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("model.toml", MODEL);
    write("stressed.toml", &format!("{MODEL}{MATERIALS}"));
    write("pattern.toml", "name = \"p\"\nlayers = 4\nsegments = [2, 3, 4, 1]\n");
    write(
        "campaign.toml",
        "name = \"c\"\nmodels = [\"model.toml\"]\nseeds = [1, 2]\nlayers = [4]\nclasses = [\"any\"]\nrounds = 1\nmoves_per_restart = 20\n",
    );
    write(
        "profiles.toml",
        "[profiles]\nmax_rate_c_per_h = 10.0\ncount = 1\nsegments = 2\nduration_s = 600.0\n[[profiles.ramp]]\nname = \"x\"\npieces = [{ rate_c_per_h = 10.0, duration_s = 100.0 }]\n",
    );
    let row = |i: usize| {
        let t = 10.0 * i as f64;
        let temperature = 20.0 + 0.005 * t.min(900.0) + 0.001 * ((i * 7919) % 13) as f64;
        (t, temperature, 0.01 * ((i * 104_729) % 17) as f64 + 0.1 * (t / 300.0).sin(), 5.0 + 0.01 * (i % 5) as f64)
    };
    let rows = |from: usize| -> String {
        let line =
            |(t, temperature, rate, volts): (f64, f64, f64, f64)| format!("{t},{temperature:.4},{rate:.5},{volts}\n");
        let rows: String = (from..from + 160).map(|i| line(row(i))).collect();
        format!("# made for a test\ntime_s,temperature_c,rate_deg_per_h,supply_v\n{rows}")
    };
    write("record.csv", &rows(0));
    write("day.csv", &rows(40));
    let mapped = |(t, temperature, rate, _): (f64, f64, f64, f64)| {
        format!("OK;{};{temperature:.3};{:.2}\n", t / 60.0, 12.5 * rate).replace('.', ",")
    };
    write("mapped.csv", &("Status;Zeit;T1;Omega\n".to_owned() + &(0..160).map(|i| mapped(row(i))).collect::<String>()));
    let field = |i: usize| format!("{},20,{},{},{}\n", 10 * i, 20.0 + 0.01 * i as f64, 20.0 + 0.02 * i as f64, 21.0);
    let field: String = (0..240).map(field).collect();
    write("field.csv", &format!("time_s,layer_1_c,layer_2_c,layer_3_c,layer_4_c\n{field}"));
    let long = |i: usize| {
        let turn = |j: usize| format!("{},{},{},{},0.1\n", 10 * (i / 4), i % 4 + 1, j, 20.0 + 0.01 * (i * j) as f64);
        turn(1) + &turn(2)
    };
    write(
        "long.csv",
        &("time_s,layer,turn,temperature_c,rate_c_per_h\n".to_owned() + &(0..80).map(long).collect::<String>()),
    );
    let turned = |i: usize| {
        let table = [0.0, 20.0, -20.0][i / 20 % 3];
        format!("{i},{},{},{table}\n", 20 + i / 60, 3600.0 * table * 1.001 + (i % 5) as f64)
    };
    let turned: String = (0..240).map(turned).collect();
    for logged in ["packed.mat", "seven-three.mat", "structure.mat", "compound.h5"] {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/record-files").join(logged);
        std::fs::copy(shipped, folder.join(logged)).unwrap();
    }
    write("table.csv", &format!("time_s,temperature_c,rate_deg_per_h,table_rate_deg_per_s\n{turned}"));
    for arguments in [
        &["schedule", "model.toml", "-o", "shop"][..],
        &["optimise", "model.toml", "--rounds", "2", "--moves-per-restart", "20", "-o", "run"],
        &["compare", "model.toml", "record.csv", "-o", "compared"],
        &["metrics", "record.csv", "-o", "compared"],
    ] {
        let out = crate::run_in(folder, arguments);
        assert_eq!(crate::code(&out), 0, "{arguments:?} {}", crate::stderr(&out));
    }
}

fn copied(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copied(&entry.path(), &target)
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Text of all files below a folder.
fn written(folder: &Path, texts: &mut Vec<(PathBuf, String)>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().map(Result::unwrap) {
        if entry.path().is_dir() {
            written(&entry.path(), texts);
        } else {
            texts.push((entry.path(), String::from_utf8_lossy(&std::fs::read(entry.path()).unwrap()).into_owned()));
        }
    }
}

fn has_no_number(text: &str) -> bool {
    let words =
        text.split(|c: char| !c.is_alphanumeric() && c != '_' && c != '-').map(|word| word.trim_start_matches('-'));
    words.map(str::to_ascii_lowercase).any(|word| ["nan", "inf", "infinity"].contains(&word.as_str()))
}

/// Moves of a search beyond which it takes longer than any bound here: damage that asks for more work gets it.
const MANY_MOVES: f64 = 1e6;

fn asks_for_more(given: &str) -> bool {
    let moves =
        given.lines().filter_map(|line| line.trim().strip_prefix("moves_per_restart")?.trim().strip_prefix('='));
    moves.filter_map(|n| n.trim().replace('_', "").parse::<f64>().ok()).any(|n| n > MANY_MOVES)
}

/// What is wrong with a run, if anything is.
pub(super) fn fault(ran: &Ran, given: &str, out: &Path) -> Option<String> {
    let bounds = bounds();
    if ran.said.contains("panicked") {
        return Some("a panic".to_owned());
    }
    if ran.was_ended && asks_for_more(given) {
        return None;
    }
    if ran.was_ended || ran.processor_s > bounds.processor_s {
        return Some(format!("{:.1} s of processor time", ran.processor_s));
    }
    if ran.memory_kib > bounds.memory_kib {
        return Some(format!("{} KiB of memory", ran.memory_kib));
    }
    if ![Some(0), Some(1), Some(2)].contains(&ran.code) {
        return Some(format!("ended with {:?}", ran.code));
    }
    // A stream's rows are passed on as they stand, white space about a number too: what only moves a terminal's cursor on.
    if ran.said.contains(|c| is_unseen(c) && !['\n', '\t', '\u{85}', '\u{2028}', '\u{2029}'].contains(&c)) {
        return Some("a control character on the terminal".to_owned());
    }
    if ran.code == Some(2) && !ran.said.contains("error") {
        return Some("refused without a word".to_owned());
    }
    // What a damaged file says, an answer may repeat.
    if ran.code != Some(0) || has_no_number(given) {
        return None;
    }
    if has_no_number(&ran.said) {
        return Some("an answer with what is no number".to_owned());
    }
    let mut texts = Vec::new();
    written(out, &mut texts);
    let bad = texts.iter().find(|(_, text)| has_no_number(text));
    bad.map(|(path, _)| format!("what is no number in {}", path.file_name().unwrap_or_default().display()))
}

#[test]
fn every_command_that_takes_a_file_gets_damaged_ones() {
    for (command, way) in COMMANDS {
        // `new` takes a name only.
        let tried = *command == "new" || WAYS.iter().any(|(_, arguments)| arguments[0] == *command);
        assert!(matches!(way, Way::None) || tried, "{command}");
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn no_damaged_file_makes_a_command_panic_hang_or_answer_with_what_is_no_number() {
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<usize>().ok());
    let runs = number("COILWRIGHT_MANGLED_RUNS");
    let seed = number("COILWRIGHT_MANGLED_SEED").unwrap_or(24);
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    std::fs::create_dir(&whole).unwrap();
    bench(&whole);
    let only = std::env::var("COILWRIGHT_MANGLED_ONLY").unwrap_or_default();
    let ways: Vec<_> =
        WAYS.iter().filter(|(file, arguments)| file.contains(&only) || arguments[0].contains(&only)).collect();
    assert!(!ways.is_empty(), "no command and no file is called {only}");
    let started = Instant::now();
    let (mut codes, mut failures) = (BTreeMap::new(), Vec::new());
    let (mut slowest, mut largest) = ((0.0, String::new()), (0, String::new()));
    let mut run = 0;
    loop {
        let is_over = match runs {
            Some(runs) => run >= runs,
            None => run >= LEAST_ROUNDS * ways.len() && started.elapsed() > USUAL,
        };
        if is_over || failures.len() >= MOST_FAILURES {
            break;
        }
        let mut random = ChaCha8Rng::seed_from_u64((seed * 1_000_000 + run) as u64);
        let &(file, arguments) = ways[if run < ways.len() { run } else { random.random_range(0..ways.len()) }];
        let place = folder.path().join("tried");
        let _ = std::fs::remove_dir_all(&place);
        copied(&whole, &place);
        let bytes = damaged(file, &std::fs::read(whole.join(file)).unwrap(), &mut random);
        std::fs::write(place.join(file), &bytes).unwrap();
        std::fs::create_dir(place.join("out")).unwrap();
        let ran = bounded(&place, arguments);
        let given = String::from_utf8_lossy(&bytes);
        if ran.processor_s > slowest.0 {
            slowest = (ran.processor_s, arguments.join(" "));
        }
        if ran.memory_kib > largest.0 {
            largest = (ran.memory_kib, arguments.join(" "));
        }
        let other = || arguments.contains(&"--resume").then(|| goes_on_elsewhere(&ran, &whole, &place)).flatten();
        let believed = || believes_close_stamps(&ran, file, arguments, &given);
        if let Some(what) = fault(&ran, &given, &place.join("out")).or_else(other).or_else(believed) {
            failures.push(format!(
                "run {run}: {what}: {arguments:?}\n{:.600}\n{}",
                ran.said,
                changes(&whole.join(file), &given)
            ));
        }
        *codes.entry(ran.code).or_insert(0) += 1;
        run += 1;
    }
    println!("{run} damaged files, exit codes {codes:?}, {:.0} s", started.elapsed().as_secs_f64());
    println!("longest {:.1} s of processor time: {}", slowest.0, slowest.1);
    println!("largest {} MiB: {}", largest.0 / 1024, largest.1);
    assert!(failures.is_empty(), "{} failures\n\n{}", failures.len(), failures.join("\n\n"));
}

/// An answer from a record whose rows are closer than any clock's: it is in another unit than its header says.
fn believes_close_stamps(ran: &Ran, file: &str, arguments: &[&str], given: &str) -> Option<String> {
    // A stream has no usual interval before its rows have passed by.
    let is_held = arguments[0] != "compensate" || arguments.windows(2).any(|pair| pair == ["--fit", file]);
    if file != "record.csv" || ran.code != Some(0) || !is_held {
        return None;
    }
    let rows = given.lines().filter(|line| !line.starts_with('#')).skip(1);
    let times: Vec<f64> = rows.map(|row| row.split(',').next()?.parse().ok()).collect::<Option<_>>()?;
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    // With all of them in order none is skipped; half of what is refused leaves room for rounding.
    let is_close = *steps.first()? > 0.0 && steps[steps.len() / 2] < 0.5 * LEAST_INTERVAL_S;
    is_close.then(|| format!("an answer from rows {:e} s apart", steps[steps.len() / 2]))
}

/// A search that was taken up from a damaged checkpoint is refused, or ends as from the whole one.
fn goes_on_elsewhere(ran: &Ran, whole: &Path, place: &Path) -> Option<String> {
    let results = ["summary.json", "best.toml", "history.csv"];
    let read = |folder: &Path, name: &str| std::fs::read(folder.join("run").join(name)).ok();
    let other = results.iter().find(|name| read(whole, name) != read(place, name));
    other.filter(|_| ran.code == Some(0)).map(|name| format!("another {name} from a damaged checkpoint"))
}

/// The lines that the damaged file has and the whole one has not.
fn changes(whole: &Path, damaged: &str) -> String {
    let whole = String::from_utf8_lossy(&std::fs::read(whole).unwrap()).into_owned();
    let known: std::collections::HashSet<&str> = whole.lines().collect();
    let new = damaged.lines().enumerate().filter(|(_, line)| !known.contains(line));
    let shown: Vec<String> = new.take(6).map(|(i, line)| format!("  line {}: {line:.200?}", i + 1)).collect();
    format!("{} lines of {}, new:\n{}", damaged.lines().count(), whole.lines().count(), shown.join("\n"))
}

pub(super) struct Ran {
    pub code: Option<i32>,
    pub said: String,
    processor_s: f64,
    memory_kib: u64,
    was_ended: bool,
}

/// Runs the program within bounds; processor time and memory are looked up as it runs, where the system has /proc.
pub(super) fn bounded(folder: &Path, arguments: &[&str]) -> Ran {
    let (started, bounds) = (Instant::now(), bounds());
    let mut child = Command::new(program())
        .args(arguments)
        .current_dir(folder)
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
    let (mut processor_s, mut memory_kib, mut was_ended) = (0.0_f64, 0, false);
    let code = loop {
        if let Some((seconds, kib)) = used(child.id()) {
            (processor_s, memory_kib) = (processor_s.max(seconds), memory_kib.max(kib));
        }
        if let Some(status) = child.try_wait().unwrap() {
            break status.code();
        }
        // A busy machine gives less than a processor.
        let waited_s = started.elapsed().as_secs_f64();
        if processor_s > bounds.processor_s || waited_s > 10.0 * bounds.processor_s || memory_kib > bounds.memory_kib {
            child.kill().unwrap();
            child.wait().unwrap();
            was_ended = true;
            break None;
        }
        std::thread::sleep(Duration::from_millis(if waited_s < 1.0 { 2 } else { 20 }));
    };
    Ran { code, said: out.join().unwrap() + &err.join().unwrap(), processor_s, memory_kib, was_ended }
}

/// Seconds of processor time and the most memory of a process so far.
fn used(process: u32) -> Option<(f64, u64)> {
    /// Of Linux on every architecture that it is built for.
    const TICKS_PER_S: f64 = 100.0;
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = peak.and_then(|line| line.trim().trim_end_matches(" kB").trim().parse().ok()).unwrap_or(0);
    Some((ticks / TICKS_PER_S, kib))
}
