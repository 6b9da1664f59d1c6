//! Reads what the program emits — schedule, traveller or machine program; JSON, CSV, G-code or HTML — as claims to verify.

use std::path::Path;

use serde_json::{Map, Value};

use crate::io::fault::{Fault, Faults};
use crate::io::files::read_text;
use crate::io::json::SCHEMA_VERSION;
use crate::io::json::schedule::{ProductionJson, STEP_COLUMNS, ScheduleJson, StepJson};
use crate::schedule::production::Production;
use crate::units::{fraction_from_percent, m_from_mm, rad_per_s_from_deg_per_h};
use crate::verify::{Claim, ClaimedReel, Row, Shop};

use super::machine_program::{PROGRAM_VERSION, parse_gcode};
use super::page_reader::shown;

/// The element of a traveller's page that holds its data.
pub const DATA_ELEMENT: &str = "<script type=\"application/json\" id=\"coilwright-data\">";

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
    let start = text.trim_start_matches('\u{feff}').trim_start();
    if start.starts_with('{') {
        parse_json(file, text, text).map(|document| claim_of(&document))
    } else if start.starts_with('<') {
        let Some((_, rest)) = text.split_once(DATA_ELEMENT) else {
            return Err(Faults::of_file(file, "the page holds no schedule: expected one that coilwright wrote"));
        };
        let data = rest.split_once("</script>").map_or(rest, |(data, _)| data);
        let claim = parse_json(file, text, data).map(|document| claim_of(&document))?;
        Ok(Claim { page: Some(shown(text)), ..claim })
    } else if start.starts_with('%') || start.starts_with(';') {
        parse_gcode(file, text)
            .and_then(|document| known_kind(file, text, document))
            .map(|document| claim_of(&document))
    } else {
        parse_csv(file, text)
    }
}

fn parse_json(file: &str, source: &str, json: &str) -> Result<ScheduleJson, Faults> {
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
fn known_kind(file: &str, source: &str, document: ScheduleJson) -> Result<ScheduleJson, Faults> {
    let mut faults = Vec::new();
    if document.schema_version != SCHEMA_VERSION {
        let message = format!(
            "schema_version must be {SCHEMA_VERSION}, found {}: use the program that wrote the file",
            document.schema_version
        );
        faults.push(Fault::new(message, None));
    }
    let program = format!("machine program {PROGRAM_VERSION}");
    if !["schedule", "traveller", &program].contains(&document.document.as_str()) {
        let message = format!("document must be schedule, traveller or {program}, found \"{}\"", document.document);
        faults.push(Fault::new(message, None));
    }
    if faults.is_empty() {
        Ok(document)
    } else {
        Err(Faults { file: file.to_owned(), source: source.to_owned(), faults })
    }
}

fn parse_csv(file: &str, text: &str) -> Result<Claim, Faults> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).comment(Some(b'#')).from_reader(text.as_bytes());
    let fault = |message: String| Faults::one(file, text, Fault::new(message, None));
    let header: Vec<String> = match reader.headers() {
        Ok(header) => header.iter().map(|h| h.trim().trim_start_matches('\u{feff}').to_owned()).collect(),
        Err(error) => return Err(fault(format!("the header cannot be read: {error}"))),
    };
    let mut faults: Vec<Fault> = Vec::new();
    for missing in STEP_COLUMNS.iter().filter(|n| !header.iter().any(|h| h == *n)) {
        faults.push(Fault::new(format!("missing column {missing}: is it a schedule?"), None));
    }
    for (i, name) in header.iter().enumerate() {
        if header[..i].contains(name) {
            faults.push(Fault::new(format!("column {name} occurs twice: keep one of them"), None));
        }
    }
    if !faults.is_empty() {
        return Err(Faults { file: file.to_owned(), source: text.to_owned(), faults });
    }
    let mut steps: Vec<StepJson> = Vec::new();
    let mut claims: Map<String, Value> = Map::new();
    for (index, record) in reader.records().enumerate() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                faults.push(Fault::new(format!("row {}: {error}", index + 1), None));
                continue;
            }
        };
        if record.len() != header.len() {
            let message = format!("row {} has {} cells where the header has {}", index + 1, record.len(), header.len());
            faults.push(Fault::new(message, None));
            continue;
        }
        let mut row = Map::new();
        for (name, cell) in header.iter().zip(record.iter()) {
            match cell_value(name, cell) {
                Ok(value) if CLAIMS.contains(&name.as_str()) => {
                    let first = claims.entry(name.clone()).or_insert_with(|| value.clone());
                    if *first != value {
                        let message = format!("row {}: {name} is {value}, and {first} in the rows above", index + 1);
                        faults.push(Fault::new(message, None));
                    }
                }
                Ok(Value::Null) => {}
                Ok(value) => {
                    row.insert(name.clone(), value);
                }
                Err(expected) => {
                    let message = format!("row {}: {name} must be {expected}, found \"{cell}\"", index + 1);
                    faults.push(Fault::new(message, None));
                }
            }
        }
        if faults.is_empty() {
            match serde_json::from_value(Value::Object(row)) {
                Ok(step) => steps.push(step),
                Err(error) => faults.push(Fault::new(format!("row {}: {error}", index + 1), None)),
            }
        }
    }
    if !faults.is_empty() {
        return Err(Faults { file: file.to_owned(), source: text.to_owned(), faults });
    }
    let word = |key: &str| claims.get(key).and_then(Value::as_str).map(str::to_owned);
    Ok(Claim {
        model: word("model"),
        model_sha256: word("model_sha256"),
        pattern: word("pattern"),
        class: word("windability_class"),
        worst_rate_rad_per_s: claims.get("worst_rate_deg_per_h").and_then(Value::as_f64).map(rad_per_s_from_deg_per_h),
        rows: steps.iter().map(row_of).collect(),
        ..Claim::default()
    })
}

/// A cell by its column's name; an empty optional cell is null.
fn cell_value(name: &str, cell: &str) -> Result<Value, &'static str> {
    let cell = cell.trim();
    if WORDS.contains(&name) || (CLAIMS.contains(&name) && name != "worst_rate_deg_per_h") {
        return Ok(Value::from(cell));
    }
    if cell.is_empty() {
        return Ok(Value::Null);
    }
    if WHOLE.contains(&name) {
        cell.parse::<i64>().map(Value::from).map_err(|_| "a whole number")
    } else if FLAGS.contains(&name) {
        cell.parse::<bool>().map(Value::from).map_err(|_| "true or false")
    } else {
        let number = cell.parse::<f64>().ok().filter(|v| v.is_finite());
        number.map(Value::from).ok_or("a finite number")
    }
}

fn claim_of(document: &ScheduleJson) -> Claim {
    Claim {
        model: Some(document.model.clone()),
        model_sha256: Some(document.model_sha256.clone()),
        pattern: Some(document.pattern.clone()),
        segments: Some(document.segments.clone()),
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
