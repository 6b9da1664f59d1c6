//! Names that break out of files elsewhere, in every place that a format accepts and through every command: each is
//! refused, or is the same text in every file that is written, and nothing else.
//!
//! Reference: other readers than the program's own: a second TOML parser, the CSV, JSON and XML libraries, a C compiler with
//! all warnings as errors, and, for what goes to the winding machine, `verify`. A file without an entry in [`SINKS`] and a
//! command without one in [`COMMANDS`] fail.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Output;

use coilwright::text::sink::Cell;
use coilwright::text::{is_unseen, name_fault};
use serde_json::Value;

use crate::{code, root, run, run_in, stderr, stdout};

const NAMES: &[&str] = &[
    "plain coil",
    "Spule Ä 24 × 50 µ",
    "'single' \"double\"",
    "back\\slash\\n\\u0041",
    "</script><script>alert(1)</script>",
    "<!--<script>",
    "--><img src=x onerror=alert(1)>",
    "]]>",
    "<![CDATA[",
    "&amp;&lt;&#49;",
    "\" onload=\"x()",
    "javascript:alert(1)",
    "*/ int broken; /*",
    "/* // */",
    "??/ ??= trigraph",
    "@rate@ @name@ @states@",
    "#define X \\",
    "%s %n %d",
    "% M30 %",
    "; M30",
    "(MSG, stop) M30",
    "=1+1",
    "=HYPERLINK(\"http://x\")",
    "+cmd|' /C calc'!A0",
    "-2+3",
    "@SUM(1)",
    "'=quoted already",
    "''-twice",
    "a,b;c\td\u{0}", /* refused */
    "comma, and \"quote\"",
    "semi;colon",
    "# comment",
    "[profiles]",
    "x = 1",
    "'''",
    "\"\"\"",
    "{\"json\": 1}",
    "${HOME} $(id) `id`",
    "../../etc/passwd",
    "C:\\con\\aux",
    "verify: no violations",
    "a\nverify: no violations",
    "a\r\nb",
    "a\rb",
    "\u{1b}[2J\u{1b}]0;title\u{7}",
    "\u{9b}31m",
    "del\u{7f}",
    "bidi \u{202e}txt.exe",
    "isolate \u{2066}x\u{2069}",
    "nel\u{85}ls\u{2028}ps\u{2029}",
    "bom\u{feff}",
    "non\u{fffe}character\u{ffff}",
    "zero\u{200b}width",
    " outer space ",
    "   ",
    "",
    "खगोल 漢字 👩\u{200d}🔬",
];

/// Every command, and why names do not go through it where they don't.
const COMMANDS: &[(&str, &str)] = &[
    ("evaluate", "tried"),
    ("exact", "tried"),
    ("improve", "runs compare, diagnose, optimise and schedule, which are tried"),
    ("effects", "takes no file"),
    ("temperatures", "tried"),
    ("tolerance", "tried"),
    ("patterns", "takes no file"),
    ("check", "tried"),
    ("new", "tried"),
    ("reproduce", "takes no file"),
    ("optimise", "tried"),
    ("campaign", "tried"),
    ("pareto", "tried"),
    ("schedule", "tried"),
    ("compare", "tried"),
    ("compensate", "tried"),
    ("metrics", "tried"),
    ("diagnose", "tried"),
    ("extend", "tried"),
    ("schema", "takes no file"),
    ("completions", "takes no file"),
    ("man", "takes no file"),
    ("verify", "tried"),
    ("report", "tried"),
];

/// What reads a file that a command wrote.
type Reader = fn(&Path, &str);

/// By the file's last name.
const SINKS: &[(&str, Reader)] = &[
    ("toml", |_, text| drop(toml(text))),
    ("json", |_, text| drop(serde_json::from_str::<Value>(text).unwrap())),
    ("csv", |_, text| drop(table(text))),
    ("svg", |_, text| drop(roxmltree::Document::parse(text).unwrap())),
    ("html", page),
    ("h", |path, _| compiles(path)),
    ("gcode", |_, text| assert!(text.is_ascii() && !text.contains(|c| is_unseen(c) && c != '\n'))),
];

/// A second parser, which shares nothing with the program's own.
fn toml(text: &str) -> Value {
    basic_toml::from_str(text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Rectangular, and without a formula.
fn table(text: &str) -> Vec<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_bytes());
    let rows: Vec<Vec<String>> = reader.records().map(|r| r.unwrap().iter().map(str::to_owned).collect()).collect();
    for cell in rows.iter().flatten().filter(|cell| cell.parse::<f64>().is_err()) {
        assert!(!cell.starts_with(['=', '+', '-', '@', '\t', '\r']), "{cell:?} is a formula");
        assert!(!cell.contains(is_unseen), "{cell:?}");
    }
    rows
}

/// One script that runs, no other element that could, and a policy.
fn page(_: &Path, text: &str) {
    let lower = text.to_lowercase();
    let data = lower.matches("<script type=\"application/json\"").count();
    assert_eq!(lower.matches("<script").count(), 1 + data);
    // What stands between angle brackets is markup; a name's own brackets are quoted.
    for tag in lower.split('<').skip(1).filter_map(|rest| rest.split('>').next()) {
        let name = tag.split([' ', '/']).next().unwrap_or_default();
        assert!(!["img", "iframe", "object", "embed", "base", "form"].contains(&name), "<{tag}>");
        assert!(![" onerror=", " onload=", " onclick="].iter().any(|attribute| tag.contains(attribute)), "<{tag}>");
    }
    assert!(lower.contains("http-equiv=\"content-security-policy\" content=\"default-src 'none'"));
    assert!(!text.contains(|c| is_unseen(c) && c != '\n'));
}

fn compiles(header: &Path) {
    let source = header.with_extension("c");
    let include = format!("#include {:?}\n", header.file_name().unwrap().to_str().unwrap());
    std::fs::write(&source, include).unwrap();
    let mut compiler = std::process::Command::new("cc");
    compiler.args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-fsyntax-only"]).arg(&source);
    match compiler.output() {
        Ok(out) => assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr)),
        Err(_) => println!("skipped: there is no C compiler"),
    }
    std::fs::remove_file(source).unwrap();
}

/// Reads every file below a folder again; how many there were.
fn read_again(folder: &Path) -> usize {
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            count += read_again(&path);
            continue;
        }
        let last = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let (_, reader) = SINKS
            .iter()
            .find(|(extension, _)| *extension == last)
            .unwrap_or_else(|| panic!("{} is a sink without an entry", path.display()));
        reader(&path, &std::fs::read_to_string(&path).unwrap());
        count += 1;
    }
    count
}

/// Nothing that acts on a terminal, no forged line, no panic.
fn is_clean(out: &Output, what: &str) {
    for text in [stdout(out), stderr(out)] {
        assert!(!text.contains(|c| is_unseen(c) && c != '\n'), "{what}: {text:?}");
        assert!(!text.contains("panicked"), "{what}: {text}");
        assert!(!text.lines().any(|line| line == "verify: no violations"), "{what}: {text}");
    }
}

fn quoted(name: &str) -> String {
    // JSON's escapes are TOML's but for `\/`, and TOML refuses a raw DEL.
    serde_json::to_string(name).unwrap().replace('\u{7f}', "\\u007f")
}

fn model(name: &str) -> String {
    let q = quoted(name);
    format!(
        "name = {q}\n[fibre]\nrefractive_index = 1.45\nthermo_optic_per_k = 1e-5\nwavelength_nm = 1550.0\nouter_diameter_um = 165.0\n\
         [winding]\nlayers = 4\nturns_per_layer = 20\ninner_diameter_mm = 60.0\nlayer_length = \"actual\"\npattern = \"pattern.toml\"\n\
         [thermal]\nmodel = \"pack\"\nconductivity_w_per_m_k = 0.35\nvolumetric_heat_capacity_j_per_m3_k = 1.7e6\n\
         [profiles]\nmax_rate_c_per_h = 60.0\ncount = 0\n[[profiles.ramp]]\nname = {q}\n\
         pieces = [{{ rate_c_per_h = 60.0, duration_s = 600.0 }}]\n\
         [production]\npart_number = {q}\nrevision = {q}\nspool = {q}\nadhesive = {q}\ncure = {q}\n\
         [tolerance]\nturns_per_layer_sd = 0.1\nsamples = 3\n"
    )
}

fn pattern(name: &str) -> String {
    format!("name = {}\nlayers = 4\nsegments = [2, 3, 4, 1]\n", quoted(name))
}

fn record(column: &str, rows: usize) -> String {
    let quoted = format!("\"{}\"", column.replace('"', "\"\""));
    let mut text = format!("time_s,temperature_c,rate_deg_per_h,{quoted}\n");
    for i in 0..rows {
        let t = i as f64 * 10.0;
        text += &format!("{t},{:.3},{:.4},{}\n", 20.0 + 0.01 * t, ((i * 37) % 11) as f64 * 0.01, i % 3);
    }
    text
}

struct Bench {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl Bench {
    fn new(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().to_owned();
        let write = |file: &str, text: String| std::fs::write(path.join(file), text).unwrap();
        write("model.toml", model(name));
        write("pattern.toml", pattern(name));
        write("record.csv", record(name, 60));
        write(
            "campaign.toml",
            format!("name = {}\nmodels = [\"model.toml\"]\nrounds = 1\nmoves_per_restart = 20\n", quoted(name)),
        );
        Self { _folder: folder, path }
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let out = run_in(&self.path, arguments);
        is_clean(&out, &format!("{arguments:?}"));
        out
    }

    /// Must succeed.
    fn done(&self, arguments: &[&str]) -> Output {
        let out = self.run(arguments);
        assert_eq!(code(&out), 0, "{arguments:?}\n{}", stderr(&out));
        out
    }

    fn read(&self, file: &str) -> String {
        std::fs::read_to_string(self.path.join(file)).unwrap()
    }
}

#[test]
fn every_command_is_in_the_list_of_those_that_names_go_through() {
    let help = run(&["--help"]);
    let listed: BTreeSet<&str> = stdout(&help)
        .lines()
        .skip_while(|line| !line.starts_with("Commands:"))
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    let known: BTreeSet<&str> = COMMANDS.iter().map(|(name, _)| *name).collect();
    assert!(listed.is_subset(&known), "without an entry: {:?}", listed.difference(&known).collect::<Vec<_>>());
    assert!(NAMES.len() >= 50);
}

#[test]
fn a_name_that_cannot_be_seen_as_it_is_is_refused_wherever_it_stands_and_the_answer_shows_it() {
    let long = "x".repeat(1_000_000);
    for name in NAMES.iter().copied().filter(|name| name_fault(name).is_some()).chain([long.as_str()]) {
        let bench = Bench::new("plain");
        std::fs::write(bench.path.join("model.toml"), model("plain").replacen("\"plain\"", &quoted(name), 1)).unwrap();
        std::fs::write(bench.path.join("other.toml"), pattern(name)).unwrap();
        for arguments in [&["check", "model.toml"][..], &["evaluate", "model.toml", "--format", "json"]] {
            let out = bench.run(arguments);
            assert_eq!(code(&out), 2, "{name:.40?}: {}", stderr(&out));
            assert!(stderr(&out).len() < 20_000 && stdout(&out).len() < 20_000);
        }
        std::fs::write(bench.path.join("model.toml"), model("plain")).unwrap();
        let out = bench.run(&["schedule", "model.toml", "--pattern", "other.toml"]);
        assert_eq!(code(&out), 2, "{name:.40?}");
        std::fs::write(bench.path.join("record.csv"), record(name, 60)).unwrap();
        // A cell's outer white space is no part of a column's name.
        if name.trim().is_empty() || name_fault(name.trim()).is_some() {
            let out = bench.run(&["metrics", "record.csv"]);
            assert_eq!(code(&out), 2, "{name:.40?}: {}", stdout(&out));
        }
    }
}

#[test]
fn every_other_name_is_the_same_in_every_file_that_is_written_for_the_shop_floor() {
    for name in NAMES.iter().copied().filter(|name| name_fault(name).is_none()) {
        let bench = Bench::new(name);
        bench.done(&["check", "model.toml"]);
        bench.done(&["evaluate", "model.toml"]);
        bench.done(&["temperatures", "model.toml", &format!("--profile={name}")]);
        let out = bench.done(&["schedule", "model.toml", "-o", "out", "--format", "json"]);
        let document: Value = serde_json::from_str(stdout(&out)).unwrap();
        assert_eq!((&document["model"], &document["pattern"]), (&Value::from(name), &Value::from(name)));
        bench.done(&["exact", "model.toml", "-o", "out/exact.toml"]);
        bench.done(&["compensate", "model.toml", "--export", "out/embedded", "--interval", "10"]);
        let kind = format!("channel:{name}");
        bench.done(&["extend", "model.toml", "--effect", &kind, "-o", "out/extended.toml"]);
        assert!(read_again(&bench.path.join("out")) >= 11, "{name}");

        let again = |file: &str| serde_json::from_str::<Value>(&bench.read(file)).unwrap();
        for file in ["out/schedule.json", "out/traveller.json"] {
            assert_eq!((&again(file)["model"], &again(file)["pattern"]), (&Value::from(name), &Value::from(name)));
        }
        for file in ["schedule.csv", "traveller.csv", "program.csv"] {
            let rows = table(&bench.read(&format!("out/{file}")));
            let column = rows[0].iter().position(|c| c == "pattern").unwrap();
            assert!(rows.len() == 5 && rows[1..].iter().all(|row| Cell::read(&row[column]) == name), "{file} {name}");
        }
        let program = bench.read("out/program.gcode");
        let head = program.lines().find_map(|line| line.strip_prefix("; head ")).unwrap();
        assert_eq!(serde_json::from_str::<Value>(head).unwrap()["model"], name);
        let drawing = bench.read("out/cross-section.svg");
        let drawing = roxmltree::Document::parse(&drawing).unwrap();
        let title = drawing.descendants().find(|n| n.has_tag_name(("http://www.w3.org/2000/svg", "title"))).unwrap();
        assert_eq!(title.text().unwrap(), format!("{name}, {name}"));
        let extended = toml(&bench.read("out/extended.toml"));
        assert_eq!((&extended["name"], &extended["effect"][0]["kind"]), (&Value::from(name), &Value::from(kind)));
        bench.done(&["check", "out/extended.toml"]);
        bench.done(&["schedule", "model.toml", "--pattern", "out/exact.toml"]);
        for file in [
            "schedule.csv",
            "schedule.json",
            "traveller.html",
            "traveller.csv",
            "traveller.json",
            "program.gcode",
            "program.csv",
        ] {
            let out = bench.done(&["verify", "model.toml", &format!("out/{file}")]);
            assert!(stdout(&out).contains("no violations"), "{file} {name}: {}", stdout(&out));
        }
    }
}

/// The commands that take longer, with what is worst in each kind of file.
#[test]
fn searches_and_measurements_keep_names_as_they_are() {
    for name in ["</script><!--<script>\" ; M30 */ =1+1", "=HYPERLINK(\"http://x\")", "@rate@, '''\"\"\" # [profiles]"]
    {
        let bench = Bench::new(name);
        let short = ["--rounds", "1"];
        bench.done(&[&["optimise", "model.toml", "--moves-per-restart", "50", "-o", "out/run"][..], &short].concat());
        bench.done(&["report", "out/run"]);
        bench.done(&[&["pareto", "model.toml", "--most-captive", "0", "-o", "out/front"][..], &short].concat());
        bench.done(&["campaign", "campaign.toml", "-o", "out/campaign"]);
        bench.done(&["tolerance", "model.toml"]);
        bench.done(&["metrics", "record.csv", "-o", "out/metrics"]);
        bench.done(&["compare", "model.toml", "record.csv", "-o", "out/compare"]);
        bench.run(&["diagnose", "model.toml", "record.csv", "-o", "out/diagnose"]);
        bench.run(&["new", name]);
        assert!(read_again(&bench.path.join("out")) > 20);
        assert_eq!(toml(&bench.read("out/run/run.toml"))["model_name"], name);
        let summary: Value = serde_json::from_str(&bench.read("out/run/summary.json")).unwrap();
        assert_eq!(summary["model"], name);
    }
}

#[test]
fn a_path_and_an_argument_are_shown_and_not_obeyed() {
    for name in NAMES.iter().copied().filter(|name| !name.contains('\0')) {
        for arguments in [
            &["check", name][..],
            &["evaluate", "examples/paper-200m.toml", "--pattern", name],
            &["evaluate", "examples/paper-200m.toml", name],
            &["verify", "examples/paper-200m.toml", name],
            &["metrics", name],
            &[name],
            &["optimise", "examples/paper-200m.toml", "--budget", name],
            &["extend", "examples/paper-200m.toml", "--effect", name, "-o", "x"],
        ] {
            let out = run_in(root(), arguments);
            is_clean(&out, &format!("{arguments:?}"));
            assert_ne!(code(&out), 0, "{arguments:?}");
        }
    }
}

#[test]
fn a_file_of_another_kind_is_named_and_not_shown() {
    let secret = "root:x:0:0:secret\n";
    let bench = Bench::new("plain");
    std::fs::write(bench.path.join("passwd"), secret).unwrap();
    std::fs::write(bench.path.join("model.toml"), model("plain").replace("pattern.toml", "./passwd")).unwrap();
    std::fs::write(bench.path.join("campaign.toml"), "name = \"c\"\nmodels = [\"passwd\"]\n").unwrap();
    for arguments in [&["check", "model.toml"][..], &["campaign", "campaign.toml", "-o", "out"]] {
        let out = bench.run(arguments);
        assert_ne!(code(&out), 0);
        let said = format!("{}{}", stdout(&out), stderr(&out));
        assert!(said.contains("passwd") && !said.contains("secret"), "{said}");
    }
    let out = bench.run(&["extend", "pattern.toml", "--effect", "channel:", "-o", "x.toml"]);
    assert_eq!(code(&out), 2);
}
