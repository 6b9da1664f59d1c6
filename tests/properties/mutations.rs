//! No text, however damaged, makes a parser panic: every example file, mutated thousands of times with a fixed seed.
//!
//! `fuzz/` does the same guided by coverage; this runs everywhere, from the same corpus.

use std::path::{Path, PathBuf};

use coilwright::compensate::{Compensator, Method};
use coilwright::io::read::campaign_file::parse_campaign;
use coilwright::io::read::model_file::parse_model;
use coilwright::io::read::pattern_file::parse_pattern;
use coilwright::io::read::profile_file::parse_profiles;
use coilwright::io::read::record_columns::{Division, RecordFormat};
use coilwright::io::read::record_file::{parse_record, parse_record_as};
use coilwright::io::read::record_rows::stream_rows;
use coilwright::io::read::schedule_reader::parse_claim;
use coilwright::io::write::compensation_file::compensate_lines;
use coilwright::numeric::expression::Expression;
use coilwright::pattern::classic::Classic;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Things that parsers stumble over.
const TOKENS: &[&str] = &[
    "nan",
    "inf",
    "-inf",
    "1e999",
    "-1",
    "0",
    "1e-320",
    "9223372036854775808",
    "\"",
    "\"\"\"",
    "[",
    "]",
    "[[",
    "{",
    "}",
    "=",
    ",",
    "\n",
    "\r\n",
    "\u{0}",
    "\u{feff}",
    "\u{1f980}",
    "#",
    ";",
    "'",
    "..",
    "true",
    "1979-05-27",
    "[effect]",
    "()",
    "^^",
];

fn mutate(seed: &str, random: &mut ChaCha8Rng) -> String {
    let mut text: Vec<char> = seed.chars().collect();
    for _ in 0..random.random_range(1..6) {
        if text.is_empty() {
            break;
        }
        let at = random.random_range(0..text.len());
        let to = (at + random.random_range(1..40usize)).min(text.len());
        match random.random_range(0..6) {
            0 => drop(text.drain(at..to)),
            1 => {
                let token = TOKENS[random.random_range(0..TOKENS.len())];
                text.splice(at..at, token.chars());
            }
            2 => {
                let token = TOKENS[random.random_range(0..TOKENS.len())];
                text.splice(at..to, token.chars());
            }
            3 => {
                let copy: Vec<char> = text[at..to].to_vec();
                text.splice(at..at, copy);
            }
            4 => text[at] = char::from(random.random_range(32..127u8)),
            _ => text.truncate(at),
        }
    }
    text.into_iter().collect()
}

fn corpus(target: &str) -> Vec<(PathBuf, String)> {
    let folder = Path::new("fuzz/corpus").join(target);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
        .into_iter()
        .map(|p| {
            let text = std::fs::read_to_string(&p).unwrap();
            (p, text)
        })
        .collect()
}

/// Whether the parser accepts; whatever it says can be shown.
type Parse = fn(&str) -> bool;

fn survives(target: &str, changes: usize, parse: Parse) {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for (path, seed) in corpus(target) {
        assert!(parse(&seed), "{} is refused as it is", path.display());
        let refused = (0..changes).filter(|_| !parse(&mutate(&seed, &mut random))).count();
        println!("{}: {refused} of {changes} mutations refused", path.display());
        assert!(refused > 0, "{}", path.display());
    }
}

fn shown<T, E: std::fmt::Display>(result: Result<T, E>) -> bool {
    result.map_err(|error| error.to_string()).is_ok()
}

/// What coverage-guided fuzzing found to lead somewhere new: one text a line, as JSON strings.
fn found_by_fuzzing(target: &str, parse: Parse) {
    let path = Path::new("fuzz/found").join(target).with_extension("jsonl");
    let lines = std::fs::read_to_string(path).unwrap();
    let texts: Vec<String> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let accepted = texts.iter().filter(|text| parse(text)).count();
    println!("{target}: {accepted} of {} texts found by fuzzing accepted", texts.len());
    assert!(texts.len() > 100 && accepted < texts.len());
}

#[test]
fn what_fuzzing_found_is_refused_or_understood() {
    found_by_fuzzing("model", |text| shown(parse_model(Path::new("model.toml"), text)));
    found_by_fuzzing("pattern", |text| shown(parse_pattern("pattern.toml", text)));
    found_by_fuzzing("record", |text| shown(parse_record("record.csv", text)));
    found_by_fuzzing("schedule", |text| shown(parse_claim("schedule", text)));
    found_by_fuzzing("expression", |text| shown(Expression::parse(text)));
}

#[test]
fn a_damaged_model_file_is_refused_or_understood() {
    survives("model", 1500, |text| shown(parse_model(Path::new("examples/model.toml"), text)));
}

#[test]
fn a_damaged_pattern_file_is_refused_or_understood() {
    survives("pattern", 3000, |text| shown(parse_pattern("pattern.toml", text)));
}

#[test]
fn a_damaged_record_is_refused_or_understood() {
    survives("record", 3000, |text| shown(parse_record("record.csv", text)));
}

#[test]
fn a_damaged_record_with_a_mapping_is_the_same_as_a_whole_and_as_a_stream() {
    survives("mapping", 3000, |text| {
        let Some((mapping, record)) = text.split_once('\n') else { return false };
        let mut format = RecordFormat::default();
        if !shown(format.map_all(mapping)) {
            return false;
        }
        let mut rows = 0;
        let streamed = stream_rows("record.csv", record.as_bytes(), &format, |chunk| rows += chunk.len());
        let whole = parse_record_as("record.csv", record, &format);
        if let Ok(read) = &whole {
            assert_eq!(read.record.rows(), rows);
            assert_eq!(read.skipped_rows, streamed.as_ref().unwrap().skipped_rows);
        }
        shown(streamed);
        shown(whole)
    });
}

#[test]
fn a_damaged_campaign_or_experiment_is_refused_or_understood() {
    survives("campaign", 2000, |text| shown(parse_campaign(Path::new("c.toml"), text)));
    survives("experiment", 2000, |text| shown(parse_profiles("next.toml", text)));
}

#[test]
fn a_damaged_stream_is_compensated_to_a_table_or_its_header_is_refused() {
    let file = parse_model(
        Path::new("examples/paper-200m.toml"),
        &std::fs::read_to_string("examples/paper-200m.toml").unwrap(),
    );
    let model = file.unwrap().model;
    let pattern = Classic::Qua.pattern(model.coil.layers()).unwrap();
    let compensator = Compensator::declared(Method::Physical, &model, &pattern).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(13);
    let mut rows = 0;
    for (_, seed) in corpus("compensation") {
        for change in 0..400 {
            let text = if change == 0 { seed.clone() } else { mutate(&seed, &mut random) };
            let mut out = Vec::new();
            let format = RecordFormat::default();
            if !shown(compensate_lines(&compensator, &format, "record", text.as_bytes(), &mut out)) {
                assert!(change > 0);
                continue;
            }
            let out = String::from_utf8(out).unwrap();
            let table: Vec<&str> = out.lines().skip_while(|line| line.starts_with('#') || line.is_empty()).collect();
            let separator = Division::of_header(table[0]).separator;
            let mut reader = csv::ReaderBuilder::new();
            let mut reader = reader.delimiter(separator).comment(Some(b'#')).from_reader(out.as_bytes());
            for row in reader.records() {
                let row = row.unwrap_or_else(|e| panic!("{e}\n{text:?}\n{out:?}"));
                let bias = &row[row.len() - 2];
                // Where no comma divides, one may stand in a number.
                let bias = if separator == b',' { bias.to_owned() } else { bias.replace(',', ".") };
                assert!(bias.is_empty() || bias.parse::<f64>().is_ok_and(f64::is_finite), "{bias} {out}");
                rows += 1;
            }
        }
    }
    assert!(rows > 1000, "{rows}");
}

#[test]
fn a_damaged_schedule_is_refused_or_understood() {
    survives("schedule", 1500, |text| shown(parse_claim("schedule", text)));
}

/// The start of a text: whole lines, so many at most.
fn head(text: &str, lines: usize) -> String {
    text.lines().take(lines).map(|line| format!("{line}\n")).collect()
}

#[test]
fn every_damaged_example_file_is_refused_or_understood() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut files: Vec<PathBuf> = ["examples", "patterns"]
        .iter()
        .flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()))
        .collect();
    files.sort();
    let (mut seen, mut refused) = (0, 0);
    for path in files {
        let text = || std::fs::read_to_string(&path).unwrap();
        let (seed, changes, parse): (String, usize, Parse) = match path.extension().and_then(|e| e.to_str()) {
            Some("csv") => (head(&text(), 60), 300, |text| shown(parse_record("record.csv", text))),
            Some("toml") if path.starts_with("patterns") => (text(), 30, |text| shown(parse_pattern("p.toml", text))),
            Some("toml") => (text(), 300, |text| shown(parse_model(Path::new("examples/model.toml"), text))),
            _ => continue,
        };
        assert!(parse(&seed), "{} is refused as it is", path.display());
        refused += (0..changes).filter(|_| !parse(&mutate(&seed, &mut random))).count();
        seen += 1;
    }
    println!("{seen} files, {refused} mutations refused");
    assert!(seen > 60 && refused > 0);
}

#[test]
fn a_damaged_formula_is_refused_or_can_be_evaluated() {
    survives("expression", 5000, |text| {
        let parsed = Expression::parse(text);
        if let Ok(expression) = &parsed {
            let _ = expression.evaluate(&vec![1.5; expression.variables().len()]);
        }
        shown(parsed)
    });
}
