//! Reads what the program emits — schedule, traveller or machine program; JSON, CSV, G-code or HTML — as claims to verify.

use std::path::Path;

use serde_json::{Map, Value};

use crate::io::fault::{Fault, Faults};
use crate::io::files::read_text;
use crate::io::json::SCHEMA_VERSION;
use crate::io::json::schedule::{PROGRAM_VERSION, ProductionJson, STEP_COLUMNS, ScheduleJson, StepJson};
use crate::schedule::production::Production;
use crate::text::sink::Cell;
use crate::units::{fraction_from_percent, m_from_mm, rad_per_s_from_deg_per_h};
use crate::verify::{Claim, ClaimedReel, Kind, Row, Shop, Violation};

/// The element of a traveller's page that holds its data.
pub(crate) const DATA_ELEMENT: &str = "<script type=\"application/json\" id=\"coilwright-data\">";

/// Columns that hold whole numbers; the others with a unit in their name hold numbers, the rest words.
const WHOLE: &[&str] = &["step", "layer", "segment", "climb"];
const FLAGS: &[&str] = &["reel_change", "potting"];
const WORDS: &[&str] =
    &["half", "supply_reel", "direction", "crossover", "rotation", "measured_length_m", "checked_by"];
const CLAIMS: &[&str] = &["model", "model_sha256", "pattern", "windability_class", "worst_rate_deg_per_h"];

/// Reads a file that claims to be a winding's schedule.
///
/// # Errors
/// A file that is none, or that has cells that cannot be understood: all of them at once.
pub fn read_claim(path: &Path) -> Result<Claim, Faults> {
    let text = read_text(path)?;
    parse_claim(&path.display().to_string(), &text)
}

/// As [`read_claim`], of a text that was read already.
///
/// # Errors
/// As [`read_claim`].
pub fn parse_claim(file: &str, text: &str) -> Result<Claim, Faults> {
    claim_in(file, text).or_else(|faults| unreadable(&faults, text).ok_or(faults))
}

fn claim_in(file: &str, text: &str) -> Result<Claim, Faults> {
    let start = text.trim_start_matches('\u{feff}').trim_start();
    if start.starts_with('{') {
        parse_json(file, text, text).map(|(document, kind)| claim_of(&document, kind))
    } else if start.starts_with('<') {
        let Some((_, rest)) = text.split_once(DATA_ELEMENT) else {
            return Err(Faults::of_file(file, "the page holds no schedule: expected one that coilwright wrote"));
        };
        let data = rest.split_once("</script>").map_or(rest, |(data, _)| data);
        let (document, kind) = parse_json(file, text, data)?;
        Ok(Claim { page: Some(text.to_owned()), ..claim_of(&document, kind) })
    } else if let Some(head) = text.lines().take(HEAD_LINES).find_map(|line| line.strip_prefix(PROGRAM_HEAD)) {
        let (document, kind) = parse_json(file, text, head)?;
        if kind != Kind::Program || !document.steps.is_empty() {
            let message = "the program's head is not that of a machine program: emit the program again";
            return Err(Faults::one(file, text, Fault::new(message, None)));
        }
        Ok(Claim { code: Some(text.to_owned()), ..claim_of(&document, kind) })
    } else if start.starts_with([';', '%']) {
        let message = format!(
            "the comment that begins with \"{PROGRAM_HEAD}\" is missing: is it a program that coilwright wrote?"
        );
        Err(Faults::of_file(file, message))
    } else {
        parse_csv(file, text)
    }
}

/// What a machine program's head stands behind, and how far from its beginning it is looked for.
const PROGRAM_HEAD: &str = "; head ";
const HEAD_LINES: usize = 20;

/// A document that is one of ours but for what cannot be read in it: that is a violation, and nothing else is claimed.
fn unreadable(faults: &Faults, source: &str) -> Option<Claim> {
    if !OF_EVERY_DOCUMENT.iter().all(|key| source.contains(key)) {
        return None;
    }
    let violation = |fault: &Fault| Violation {
        row: None,
        field: fault.span.as_ref().map_or("the file".to_owned(), |span| {
            format!("line {}", source[..span.start.min(source.len())].matches('\n').count() + 1)
        }),
        expected: "a schedule as coilwright writes it".to_owned(),
        found: fault.message.clone(),
        remedy: "emit the schedule again, do not edit it",
    };
    Some(Claim { unread: faults.faults.iter().map(violation).collect(), ..Claim::default() })
}

/// Keys by which a damaged document is still known for one of ours.
const OF_EVERY_DOCUMENT: [&str; 3] = ["\"document\"", "\"model_sha256\"", "\"windability\""];

fn parse_json(file: &str, source: &str, json: &str) -> Result<(ScheduleJson, Kind), Faults> {
    let document: ScheduleJson = serde_json::from_str(json).map_err(|error| {
        let offset = json.as_ptr() as usize - source.as_ptr() as usize;
        let line_start: usize =
            json.split_inclusive('\n').take(error.line().saturating_sub(1)).map(str::len).sum::<usize>() + offset;
        let mut at = (line_start + error.column().saturating_sub(1)).min(source.len().saturating_sub(1));
        while !source.is_char_boundary(at) {
            at -= 1;
        }
        let message = format!("this is no schedule as coilwright writes it: {error}");
        Faults::one(file, source, Fault::new(message, Some(at..at)))
    })?;
    known_kind(file, source, document)
}

/// Only what this version of the program knows how to read.
fn known_kind(file: &str, source: &str, document: ScheduleJson) -> Result<(ScheduleJson, Kind), Faults> {
    let mut faults = Vec::new();
    if document.schema_version != SCHEMA_VERSION {
        let message = format!(
            "schema_version must be {SCHEMA_VERSION}, found {}: use the program that wrote the file",
            document.schema_version
        );
        faults.push(Fault::new(message, None));
    }
    let program = format!("machine program {PROGRAM_VERSION}");
    let kinds = [("schedule", Kind::Plain), ("traveller", Kind::Traveller), (&program, Kind::Program)];
    let kind = kinds.into_iter().find(|(name, _)| *name == document.document).map(|(_, kind)| kind);
    if kind.is_none() {
        let message = format!("document must be schedule, traveller or {program}, found \"{}\"", document.document);
        faults.push(Fault::new(message, None));
    }
    match kind {
        Some(kind) if faults.is_empty() => Ok((document, kind)),
        _ => Err(Faults { file: file.to_owned(), source: source.to_owned(), faults }),
    }
}

fn parse_csv(file: &str, text: &str) -> Result<Claim, Faults> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
    let fault = |message: String| Faults::one(file, text, Fault::new(message, None));
    let header: Vec<String> = match reader.headers() {
        Ok(header) => header.iter().map(|h| h.trim_start_matches('\u{feff}').to_owned()).collect(),
        Err(error) => return Err(fault(format!("the header cannot be read: {error}"))),
    };
    let missing = STEP_COLUMNS.iter().filter(|n| !header.iter().any(|h| h == *n));
    let faults: Vec<Fault> =
        missing.map(|name| Fault::new(format!("missing column {name}: is it a schedule?"), None)).collect();
    if !faults.is_empty() {
        return Err(Faults { file: file.to_owned(), source: text.to_owned(), faults });
    }
    let mut table = CsvTable { header, claims: Map::new(), steps: Vec::new(), unread: Vec::new() };
    table.check_header();
    for (index, record) in reader.records().enumerate() {
        match record {
            Ok(record) => table.row(index + 1, &record),
            Err(error) => table.refuse(Some(index + 1), "the row", "cells of text", error.to_string()),
        }
    }
    Ok(table.claim())
}

/// A schedule's table as it is read: what does not belong is kept as a violation.
struct CsvTable {
    header: Vec<String>,
    claims: Map<String, Value>,
    steps: Vec<StepJson>,
    unread: Vec<Violation>,
}

impl CsvTable {
    fn refuse(&mut self, row: Option<usize>, field: &str, expected: &str, found: String) {
        let remedy = "emit the schedule again, do not edit it";
        self.unread.push(Violation { row, field: field.to_owned(), expected: expected.to_owned(), found, remedy });
    }

    /// No column twice, and none that no schedule has.
    fn check_header(&mut self) {
        for (i, name) in self.header.clone().iter().enumerate() {
            let known = STEP_COLUMNS.contains(&name.as_str())
                || CLAIMS.contains(&name.as_str())
                || Kind::of_column(name).is_some();
            if !known {
                self.refuse(None, "the header", "columns of a schedule only", format!("\"{name}\""));
            } else if self.header[..i].contains(name) {
                self.refuse(None, "the header", "each column once", format!("{name} twice"));
            }
        }
    }

    fn row(&mut self, number: usize, record: &csv::StringRecord) {
        let here = Some(number);
        if record.len() != self.header.len() {
            let expected = format!("{} cells as in the header", self.header.len());
            return self.refuse(here, "the row", &expected, format!("{} cells", record.len()));
        }
        let mut row = Map::new();
        let before = self.unread.len();
        for (name, cell) in self.header.clone().iter().zip(record.iter()) {
            match cell_value(name, cell) {
                Ok(value) if CLAIMS.contains(&name.as_str()) => {
                    let first = self.claims.entry(name.clone()).or_insert_with(|| value.clone()).clone();
                    if first != value {
                        self.refuse(here, name, &format!("{first} as in the rows above"), value.to_string());
                    }
                }
                Ok(Value::Null) => {}
                Ok(value) if STEP_COLUMNS.contains(&name.as_str()) || Kind::of_column(name).is_some() => {
                    row.insert(name.clone(), value);
                }
                // Named once already, in the header.
                Ok(_) => {}
                Err(expected) => self.refuse(here, name, expected, format!("\"{cell}\"")),
            }
        }
        if self.unread.len() > before {
            return;
        }
        match serde_json::from_value(Value::Object(row)) {
            Ok(step) => self.steps.push(step),
            Err(error) => self.refuse(here, "the row", "a value in every cell", error.to_string()),
        }
    }

    fn claim(self) -> Claim {
        let kinds: Vec<Kind> = self.header.iter().filter_map(|name| Kind::of_column(name)).collect();
        let kind = match kinds.contains(&Kind::Traveller) {
            true => Kind::Traveller,
            false if kinds.is_empty() => Kind::Plain,
            false => Kind::Program,
        };
        let word = |key: &str| self.claims.get(key).and_then(Value::as_str).map(str::to_owned);
        let worst = self.claims.get("worst_rate_deg_per_h").and_then(Value::as_f64);
        Claim {
            kind: Some(kind),
            model: word("model"),
            model_sha256: word("model_sha256"),
            pattern: word("pattern"),
            class: word("windability_class"),
            worst_rate_rad_per_s: worst.map(rad_per_s_from_deg_per_h),
            rows: self.steps.iter().map(row_of).collect(),
            unread: self.unread,
            ..Claim::default()
        }
    }
}

/// A cell by its column's name; an empty optional cell is null.
fn cell_value(name: &str, cell: &str) -> Result<Value, &'static str> {
    if WORDS.contains(&name) || (CLAIMS.contains(&name) && name != "worst_rate_deg_per_h") {
        return Ok(Value::from(Cell::read(cell)));
    }
    if cell.is_empty() {
        return Ok(Value::Null);
    }
    // What one reader takes for a number and another does not is none here.
    let plain = cell.starts_with(|c: char| c.is_ascii_digit() || c == '-');
    if WHOLE.contains(&name) {
        cell.parse::<i64>().ok().filter(|_| plain).map(Value::from).ok_or("a whole number")
    } else if FLAGS.contains(&name) {
        cell.parse::<bool>().map(Value::from).map_err(|_| "true or false")
    } else {
        let number = cell.parse::<f64>().ok().filter(|v| plain && v.is_finite());
        number.map(Value::from).ok_or("a finite number")
    }
}

fn claim_of(document: &ScheduleJson, kind: Kind) -> Claim {
    Claim {
        kind: Some(kind),
        is_document: true,
        program: Some(document.program.clone()),
        pattern_sha256: document.pattern_sha256.clone(),
        model: Some(document.model.clone()),
        model_sha256: Some(document.model_sha256.clone()),
        pattern: Some(document.pattern.clone()),
        segments: Some(document.segments.clone()),
        end_turns: [document.end_a_turns, document.end_b_turns].map(|turns| turns.map(i64::from)),
        class: Some(document.windability.class.clone()),
        reels: Some(document.windability.reels),
        captive: Some(document.windability.captive),
        max_climb: Some(document.windability.max_climb),
        worst_rate_rad_per_s: Some(rad_per_s_from_deg_per_h(document.worst_rate_deg_per_h)),
        worst_profile: Some(document.worst_profile.clone()),
        worst_time_s: Some(document.worst_time_s),
        fibre: document.fibre.clone(),
        length_m: Some(document.length_m),
        midpoint_m: document.midpoint_m,
        midpoint_layer: document.midpoint_layer,
        start_mark_m: Some(document.start_mark_m),
        expected_trim_m: Some(document.expected_trim_m),
        supply: Some(
            document
                .reels
                .iter()
                .map(|reel| ClaimedReel {
                    name: reel.name.clone(),
                    captive: reel.captive,
                    prepared_before_step: reel.prepared_before_step,
                    taken_from: reel.taken_from.clone(),
                    from_m: reel.from_m,
                    to_m: reel.to_m,
                    load_m: reel.load_m,
                })
                .collect(),
        ),
        shop: document.production.as_ref().map(shop_of_json),
        rows: document.steps.iter().map(row_of).collect(),
        page: None,
        code: None,
        unread: Vec::new(),
    }
}

fn row_of(step: &StepJson) -> Row {
    Row {
        step: step.step,
        layer: step.layer,
        half: step.half.clone(),
        segment: step.segment,
        supply_reel: step.supply_reel.clone(),
        direction: step.direction.clone(),
        turns: step.turns,
        free_m: None,
        fibre_from_m: step.fibre_from_m,
        fibre_to_m: step.fibre_to_m,
        length_m: step.length_m,
        radius_m: m_from_mm(step.radius_mm),
        climb: step.climb,
        cumulative_m: step.cumulative_m,
        crossover: step.crossover.clone(),
        balance_m: step.balance_m,
        rotation: step.rotation.clone(),
        axial_pitch_m: step.axial_pitch_mm.map(m_from_mm),
        tension_n: step.tension_n,
        tension_min_n: step.tension_min_n,
        tension_max_n: step.tension_max_n,
        turns_per_min: step.turns_per_min,
        reel_change: step.reel_change,
        potting: step.potting,
        measured_length_m: step.measured_length_m.clone(),
        checked_by: step.checked_by.clone(),
    }
}

fn shop_of_json(stated: &ProductionJson) -> Shop {
    Shop {
        words: vec![
            ("part_number", stated.part_number.clone()),
            ("revision", stated.revision.clone()),
            ("spool", stated.spool.clone()),
            ("adhesive", stated.adhesive.clone()),
            ("cure", stated.cure.clone()),
        ],
        tension_n: stated.tension_n,
        tension_taper_per_layer: fraction_from_percent(stated.tension_taper_percent_per_layer),
        tension_limit: fraction_from_percent(stated.tension_limit_percent),
        allowance_m: stated.allowance_m,
        potting_every_layers: stated.potting_every_layers,
        winding_speed_turns_per_min: stated.winding_speed_turns_per_min,
    }
}

/// The shop's settings as the model file has them, to verify against.
pub fn shop_of(production: &Production) -> Shop {
    shop_of_json(&ProductionJson::new(production))
}
