//! How a name goes through each command: in every place that the command's files accept, and compared where it comes out.

use std::path::PathBuf;
use std::process::Output;

use coilwright::text::is_unseen;
use coilwright::text::sink::Cell;
use serde_json::Value;

use super::sinks::{table, toml};
use crate::{code, run_in, stderr, stdout};

/// How names go through a command.
pub enum Way {
    /// It takes no file and no text from outside.
    None,
    Quick(fn(&Bench)),
    /// Takes seconds: with the worst names in every run, with all of them where `COILWRIGHT_ALL_NAMES` is set.
    Slow(fn(&Bench)),
}

pub const COMMANDS: &[(&str, Way)] = &[
    ("check", Way::Quick(|b| drop(b.done(&["check", "model.toml"])))),
    ("evaluate", Way::Quick(evaluate)),
    ("exact", Way::Quick(exact)),
    ("explore", Way::Quick(explore)),
    ("schedule", Way::Quick(schedule)),
    ("verify", Way::Quick(verify)),
    ("temperatures", Way::Quick(temperatures)),
    ("tolerance", Way::Quick(|b| drop(b.done(&["tolerance", "model.toml"])))),
    ("extend", Way::Quick(extend)),
    ("extend", Way::Slow(extend_and_fit)),
    ("compensate", Way::Quick(compensate)),
    ("compensate", Way::Slow(compensate_by_all_methods)),
    ("metrics", Way::Quick(metrics)),
    ("new", Way::Quick(new)),
    ("optimise", Way::Slow(optimise)),
    ("report", Way::Slow(report)),
    ("pareto", Way::Slow(pareto)),
    ("campaign", Way::Slow(campaign)),
    ("compare", Way::Slow(compare)),
    ("diagnose", Way::Slow(diagnose)),
    ("improve", Way::Slow(improve)),
    ("trim", Way::Slow(|b| drop(b.run(&["trim", "model.toml", "record.csv", "--format", "json"])))),
    ("stress", Way::Quick(stress)),
    ("potting", Way::Quick(potting)),
    ("effects", Way::None),
    ("materials", Way::None),
    ("fibres", Way::None),
    ("patterns", Way::None),
    ("reproduce", Way::None),
    ("schema", Way::None),
    ("completions", Way::None),
    ("man", Way::None),
];

/// Nothing that acts on a terminal, no forged line, no panic.
pub fn is_clean(out: &Output, what: &str) {
    for text in [stdout(out), stderr(out)] {
        assert!(!text.contains(|c| is_unseen(c) && c != '\n'), "{what}: {text:?}");
        assert!(!text.contains("panicked"), "{what}: {text}");
        assert!(!text.lines().any(|line| line == "verify: no violations"), "{what}: {text}");
    }
}

pub fn quoted(name: &str) -> String {
    // JSON's escapes are TOML's but for `\/`, and TOML refuses a raw DEL.
    serde_json::to_string(name).unwrap().replace('\u{7f}', "\\u007f")
}

pub fn model(name: &str) -> String {
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

pub fn pattern(name: &str) -> String {
    format!("name = {}\nlayers = 4\nsegments = [2, 3, 4, 1]\n", quoted(name))
}

/// As `write` of a CSV library quotes it.
fn csv_cell(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// A rate that follows the column of that name, which stands there as in the program's own tables.
pub fn record(column: &str, rows: usize) -> String {
    record_as_it_stands(Cell::text(column).as_str(), rows)
}

/// The same with a column's name that no sink has made harmless.
pub fn record_as_it_stands(column: &str, rows: usize) -> String {
    let mut text = format!("time_s,temperature_c,rate_deg_per_h,{}\n", csv_cell(column));
    for i in 0..rows {
        let (t, further) = (i as f64 * 10.0, ((i / 7) % 5) as f64);
        let rate = ((i * 37) % 11) as f64 * 0.01 + 0.5 * further;
        text += &format!("{t},{:.3},{rate:.4},{further}\n", 20.0 + 0.01 * t);
    }
    text
}

/// Rows that are enough to find the column that is missing.
const ROWS: usize = 120;

pub struct Bench {
    _folder: tempfile::TempDir,
    pub path: PathBuf,
    name: String,
}

impl Bench {
    pub fn new(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let bench = Self { path: folder.path().to_owned(), _folder: folder, name: name.to_owned() };
        bench.write("model.toml", &model(name));
        bench.write("pattern.toml", &pattern(name));
        bench.write("record.csv", &record(name, ROWS));
        let models = "models = [\"model.toml\"]\nrounds = 1\nmoves_per_restart = 20\n";
        bench.write("campaign.toml", &format!("name = {}\n{models}", quoted(name)));
        bench
    }

    pub fn write(&self, file: &str, text: &str) {
        std::fs::write(self.path.join(file), text).unwrap();
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        let out = run_in(&self.path, arguments);
        is_clean(&out, &format!("{arguments:?}"));
        out
    }

    /// Must succeed.
    pub fn done(&self, arguments: &[&str]) -> Output {
        let out = self.run(arguments);
        assert_eq!(code(&out), 0, "{arguments:?}\n{}", stderr(&out));
        out
    }

    /// Must succeed; its JSON document.
    fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(stdout(&self.done(&[arguments, &["--format", "json", "-q"]].concat()))).unwrap()
    }

    fn read(&self, file: &str) -> String {
        std::fs::read_to_string(self.path.join(file)).unwrap()
    }

    fn read_json(&self, file: &str) -> Value {
        serde_json::from_str(&self.read(file)).unwrap()
    }

    /// A value is the name.
    fn is_name(&self, value: &Value) {
        assert_eq!(value.as_str(), Some(self.name.as_str()), "{value}");
    }
}

fn evaluate(b: &Bench) {
    b.done(&["evaluate", "model.toml"]);
    let found = b.json(&["evaluate", "model.toml", "--pattern", "pattern.toml", "--bang-bang", "out/bang-bang.toml"]);
    b.is_name(&found["patterns"][0]["name"]);
    b.is_name(&found["patterns"][0]["worst_profile"]);
    let ramps = toml(&b.read("out/bang-bang.toml"))["profiles"]["ramp"].clone();
    b.is_name(&ramps[0]["name"]);
}

/// The model with a material of its own by that name.
fn stressed(b: &Bench) {
    let q = quoted(&b.name);
    let materials = format!(
        "[materials]\nadhesive = {q}\n[materials.fibre]\nglass = \"silica\"\nglass_diameter_um = 80.0\n\
         coatings = [{{ material = \"acrylate-hard-glassy\", outer_diameter_um = 165.0 }}]\n[[materials.own]]\nname = {q}\n\
         youngs_modulus_mpa = 3000.0\npoisson_ratio = 0.35\nexpansion_per_k = 6e-5\nsource = {q}\n"
    );
    b.write("stressed.toml", &(model(&b.name) + &materials));
}

fn stress(b: &Bench) {
    stressed(b);
    b.done(&["stress", "stressed.toml"]);
    let found = b.json(&["stress", "stressed.toml", "--pattern", "pattern.toml"]);
    b.is_name(&found["model"]);
    b.is_name(&found["temperatures"][0]["patterns"][0]["name"]);
}

fn potting(b: &Bench) {
    stressed(b);
    b.done(&["potting", "stressed.toml"]);
    let found = b.json(&["potting", "stressed.toml", "--pattern", "pattern.toml"]);
    let choices = found["choices"].as_array().unwrap();
    b.is_name(&choices.iter().find(|c| c["is_declared"] == true).unwrap()["adhesive"]);
    b.is_name(&choices[0]["best_pattern"]);
    b.is_name(&choices[0]["worst_profile"]);
}

fn exact(b: &Bench) {
    b.done(&["exact", "model.toml", "-o", "out/exact.toml", "--samples", "out/samples.csv"]);
    b.done(&["schedule", "model.toml", "--pattern", "out/exact.toml"]);
}

fn explore(b: &Bench) {
    b.done(&["explore", "model.toml", "pattern.toml", "-o", "out/explorer.html"]);
    let page = b.read("out/explorer.html");
    let held = page.split("id=\"data\">").nth(1).and_then(|rest| rest.split("</script>").next()).unwrap();
    let held: Value = serde_json::from_str(held).unwrap();
    b.is_name(&held["patterns"][0]["name"]);
    assert_eq!(held["patterns"].as_array().map(Vec::len), Some(1), "the same pattern is listed once");
    let source = toml(held["source"].as_str().unwrap());
    b.is_name(&source["name"]);
    assert!(source["winding"].get("pattern").is_none(), "the page has no other file at hand");
}

fn schedule(b: &Bench) {
    let document = b.json(&["schedule", "model.toml", "-o", "out"]);
    for found in [document, b.read_json("out/schedule.json"), b.read_json("out/traveller.json")] {
        b.is_name(&found["model"]);
        b.is_name(&found["pattern"]);
    }
    for file in ["schedule.csv", "traveller.csv", "program.csv"] {
        let rows = table(&b.read(&format!("out/{file}")));
        for wanted in ["model", "pattern"] {
            let column = rows[0].iter().position(|c| c == wanted).unwrap();
            assert!(rows.len() == 5 && rows[1..].iter().all(|row| row[column] == b.name), "{file}");
        }
    }
    let program = b.read("out/program.gcode");
    let head = program.lines().find_map(|line| line.strip_prefix("; head ")).unwrap();
    b.is_name(&serde_json::from_str::<Value>(head).unwrap()["model"]);
    let drawing = b.read("out/cross-section.svg");
    let drawing = roxmltree::Document::parse(&drawing).unwrap();
    let title = drawing.descendants().find(|n| n.has_tag_name(("http://www.w3.org/2000/svg", "title"))).unwrap();
    assert_eq!(title.text().unwrap(), format!("{}, {}", b.name, b.name));
}

/// Its own output always passes.
fn verify(b: &Bench) {
    b.done(&["schedule", "model.toml", "-o", "out/checked", "-q"]);
    for file in [
        "schedule.csv",
        "schedule.json",
        "traveller.html",
        "traveller.csv",
        "traveller.json",
        "program.gcode",
        "program.csv",
    ] {
        let out = b.done(&["verify", "model.toml", &format!("out/checked/{file}")]);
        assert!(stdout(&out).contains("no violations"), "{file} {}: {}", b.name, stdout(&out));
    }
}

fn temperatures(b: &Bench) {
    let found =
        b.json(&["temperatures", "model.toml", &format!("--profile={}", b.name), "--rows", "3", "-o", "out/layers"]);
    b.is_name(&found["model"]);
    b.is_name(&found["drive"]);
}

fn extend(b: &Bench) {
    extended(b, "out/extended.toml", &[]);
    // A formula names columns, too.
    let formula = format!("a * {}", b.name);
    let out = b.run(&[
        "extend",
        "model.toml",
        "--effect",
        "custom",
        "--formula",
        &formula,
        "--parameter",
        "a=1",
        "-o",
        "out/formula.toml",
    ]);
    if code(&out) == 0 {
        assert_eq!(toml(&b.read("out/formula.toml"))["effect"][0]["formula"], formula.as_str());
        b.done(&["check", "out/formula.toml"]);
    }
}

fn extend_and_fit(b: &Bench) {
    extended(b, "out/fitted.toml", &["--fit", "record.csv", "--pattern", "pattern.toml"]);
}

fn extended(b: &Bench, file: &str, further: &[&str]) {
    let kind = format!("channel:{}", b.name);
    b.done(&[&["extend", "model.toml", "--effect", &kind, "-o", file][..], further].concat());
    let extended = toml(&b.read(file));
    b.is_name(&extended["name"]);
    assert_eq!(extended["effect"][0]["kind"], kind.as_str());
    b.done(&["check", file]);
}

/// As a stream, with the name as a column and in its cells.
fn compensate(b: &Bench) {
    b.done(&["compensate", "model.toml", "--export", "out/embedded", "--interval", "10"]);
    b.is_name(&b.read_json("out/embedded.json")["model"]);
    let text = format!("# {}\ntime_s,temperature_c,rate_deg_per_h,{}\n", b.name, csv_cell(&b.name));
    let row = |i: usize| format!("{},20.{i},0.{i},{}\n", 10 * i, csv_cell(&b.name));
    let rows: String = (0..8).map(row).collect();
    b.write("logged.csv", &(text + &rows + &b.name + "\n80,20,0.1," + &csv_cell(&b.name) + "\n"));
    b.done(&["compensate", "model.toml", "logged.csv", "-o", "out/compensated.csv"]);
    let streamed = b.done(&["compensate", "model.toml", "logged.csv", "-q"]);
    let written = b.read("out/compensated.csv");
    assert_eq!(stdout(&streamed), written);
    let found = table(&written);
    // As it would be read: a formula's apostrophe is no part of it.
    let name = Cell::read(&b.name);
    assert_eq!(found[0][3], name);
    assert!(found.iter().all(|row| row.len() == 6), "{found:?}");
    assert_eq!(found.iter().filter(|row| row[3] == name).count(), 10, "{found:?}");
    assert!(b.read("record.csv").contains(&csv_cell(Cell::text(&b.name).as_str())));
    b.done(&["compensate", "model.toml", "record.csv", "-o", "out/again.csv"]);
    let again = b.json(&["metrics", "out/again.csv"]);
    assert_eq!(again["records"][0]["rows"], ROWS);
}

fn compensate_by_all_methods(b: &Bench) {
    let fitted = ["--fit", "record.csv", "--all-methods", "-o", "out/methods.svg"];
    b.done(&[&["compensate", "model.toml", "record.csv"][..], &fitted].concat());
}

fn metrics(b: &Bench) {
    b.done(&["metrics", "record.csv", "-o", "out/metrics"]);
}

fn new(b: &Bench) {
    // A name with a slash is a path.
    if !b.name.contains('/') && code(&b.run(&["new", &format!("./{}", b.name)])) == 0 {
        let made =
            [b.path.join(&b.name), b.path.join(format!("{}.toml", b.name))].into_iter().find(|path| path.is_file());
        toml(&std::fs::read_to_string(made.unwrap()).unwrap());
    }
}

fn optimise(b: &Bench) {
    let short = ["--rounds", "1", "--moves-per-restart", "50"];
    b.done(&[&["optimise", "model.toml", "--init", "pattern.toml", "-o", "out/run"][..], &short].concat());
    b.is_name(&toml(&b.read("out/run/run.toml"))["model_name"]);
    b.is_name(&b.read_json("out/run/summary.json")["model"]);
    let rows = table(&b.read("out/run/baselines.csv"));
    let column = rows[0].iter().position(|c| c == "worst_profile").unwrap();
    assert!(rows.len() > 2 && rows[1..].iter().all(|row| row[column] == b.name), "{rows:?}");
    b.done(&["schedule", "model.toml", "--pattern", "out/run/best.toml"]);
}

fn report(b: &Bench) {
    b.done(&["report", "out/run"]);
    b.done(&["report", "out/metrics"]);
}

fn pareto(b: &Bench) {
    b.done(&["pareto", "model.toml", "--most-captive", "0", "--rounds", "1", "-o", "out/front"]);
    let rows = table(&b.read("out/front/pareto.csv"));
    let file = rows[0].iter().position(|c| c == "file").unwrap();
    for row in &rows[1..] {
        b.done(&["schedule", "model.toml", "--pattern", &format!("out/front/{}", row[file])]);
    }
}

fn campaign(b: &Bench) {
    let found = b.json(&["campaign", "campaign.toml", "-o", "out/campaign"]);
    b.is_name(&found["campaign"]);
    b.is_name(&found["cells"][0]["model"]);
    let id = found["cells"][0]["id"].as_str().unwrap();
    b.is_name(&b.read_json(&format!("out/campaign/cells/{}/{id}.json", &id[..2]))["model"]);
    b.done(&["campaign", "campaign.toml", "--list"]);
    b.done(&["campaign", "campaign.toml", "--emit", "snakemake", "-o", "out/snakemake"]);
    b.done(&["campaign", "campaign.toml", "--emit", "slurm", "-o", "out/slurm"]);
    let rows = table(&b.read("out/campaign/summary.csv"));
    assert_eq!(rows[1][1], b.name);
}

fn compare(b: &Bench) {
    let found = b.json(&["compare", "model.toml", "record.csv", "-o", "out/compare"]);
    b.is_name(&found["model"]);
    b.is_name(&found["pattern"]);
}

/// The column of that name is what is missing, and gets into the extended model and the next experiment.
fn diagnose(b: &Bench) {
    let found =
        b.json(&["diagnose", "model.toml", "record.csv", "-o", "out/diagnose", "--experiment", "out/next.toml"]);
    b.is_name(&found["model"]);
    let text = found.to_string();
    assert!(text.contains(&serde_json::to_string(&format!("channel:{}", b.name)).unwrap()), "{text:.3000}");
    if b.path.join("out/next.toml").is_file() {
        let next = toml(&b.read("out/next.toml"));
        assert_eq!(next["profiles"]["ramp"].as_array().map(Vec::len), Some(1), "{next}");
        b.done(&["temperatures", "model.toml", "--profiles", "out/next.toml", "--rows", "3"]);
    }
    if b.path.join("out/diagnose/extended.toml").is_file() {
        b.done(&["check", "out/diagnose/extended.toml"]);
    }
}

fn improve(b: &Bench) {
    let found = b.json(&["improve", "model.toml", "record.csv", "-o", "out/improve"]);
    b.is_name(&found["model"]);
    b.is_name(&found["measured_pattern"]);
}
