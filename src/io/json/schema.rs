//! JSON Schemas of the file formats, for editors that complete and check while one types.
//!
//! Effects come from the catalogue; a test holds the keys against what the readers know.

use serde_json::{Map, Value, json};

use crate::effect::{CATALOGUE, CHANNEL, CUSTOM, EffectSpec};
use crate::io::model::LOCATIONS;
use crate::pattern::classic::Classic;
use crate::search::cost::objective::Objective;
use crate::text::{MOST_NAME_CHARACTERS, NAME_PATTERN, NAME_RULE};
use crate::units::Unit;

use super::SCHEMA_VERSION;
use super::further_schemas::record_table;
use super::schedule::STEP_COLUMNS;

const DIALECT: &str = "https://json-schema.org/draft/2020-12/schema";

pub(super) fn table(title: &str, needed: &[&str], properties: Value) -> Value {
    json!({
        "title": title,
        "type": "object",
        "additionalProperties": false,
        "required": needed,
        "properties": properties,
    })
}

pub(super) fn described(kind: &str, description: &str) -> Value {
    json!({ "type": kind, "description": description })
}

/// A name: see [`crate::text`].
pub(super) fn name(description: &str) -> Value {
    json!({ "type": "string", "minLength": 1, "maxLength": MOST_NAME_CHARACTERS, "pattern": NAME_PATTERN,
        "description": format!("{description}; {NAME_RULE}") })
}

/// As [`name`], or empty.
fn words(description: &str) -> Value {
    json!({ "type": "string", "maxLength": MOST_NAME_CHARACTERS, "pattern": format!("^$|{NAME_PATTERN}"),
        "description": format!("{description}; empty, or {NAME_RULE}") })
}

pub(super) fn with_dialect(mut schema: Value) -> Value {
    if let Value::Object(map) = &mut schema {
        map.insert("$schema".to_owned(), DIALECT.into());
    }
    schema
}

/// The schema of a model file.
#[expect(clippy::too_many_lines, reason = "one schema, table by table")]
pub fn model_schema() -> Value {
    let windings: Vec<&str> = Classic::ALL.iter().map(|c| c.key()).collect();
    let winding = table(
        "winding",
        &["layers", "layer_length"],
        json!({
            "layers": { "type": "integer", "minimum": 2, "multipleOf": 2 },
            "turns_per_layer": described("number", "needed for layer_length = \"actual\""),
            "inner_diameter_mm": described("number", "of the spool; or mean_diameter_mm"),
            "mean_diameter_mm": described("number", "of the coil; or inner_diameter_mm"),
            "radial_pitch_um": described("number", "default: the fibre's outer diameter, and at least that"),
            "axial_pitch_um": described("number", "default: the fibre's outer diameter"),
            "layer_length": { "enum": ["actual", "equal"] },
            "length_m": described("number", "of the whole fibre"),
            "crossover_turns": described("number", "fibre that each layer takes to change sides, in turns, whatever the climb; 0 unless stated, and half a turn is a guess"),
            "sagnac_diameter": { "enum": ["mean", "by_length"], "description": "D in the Sagnac scale factor: the mean diameter, or each layer's own weighed by its length" },
            "pattern": {
                "description": "a classic winding or the path of a pattern file",
                "anyOf": [{ "enum": windings }, { "type": "string" }],
            },
        }),
    );
    let thermal = table(
        "thermal",
        &["model"],
        json!({
            "model": { "enum": ["pack", "half_space"] },
            "conductivity_w_per_m_k": described("number", "effective, of the pack"),
            "volumetric_heat_capacity_j_per_m3_k": described("number", "effective, of the pack"),
            "diffusivity_m2_per_s": described("number", "instead of conductivity and heat capacity"),
            "cells_per_layer": { "type": "integer", "minimum": 1, "maximum": 32, "default": 1,
                "description": "how fine the pack's grid is: its elements at a surface are half a layer over this number" },
        }),
    );
    let sensor = table(
        "sensor",
        &[],
        json!({
            "location": { "enum": LOCATIONS,
                "description": "what a record or profile is the temperature of; a housing, the spool or one of its flanges must be declared as effects" },
            "rate_mean_s": described("number", "each rate is the mean over this interval, which ends at its stamp"),
        }),
    );
    let record = record_table();
    let search = table(
        "search",
        &[],
        json!({
            "windability": { "type": "string", "pattern": "^(standard|any|captive:[0-9]+)$" },
            "objective": { "enum": Objective::ALL.map(Objective::key) },
            "seed": { "type": "integer", "minimum": 0 },
        }),
    );
    let effects: Vec<Value> = CATALOGUE.iter().map(|spec| effect_schema(spec)).chain([channel(), custom()]).collect();
    with_dialect(table(
        "coilwright model file",
        &["name", "fibre", "winding", "thermal"],
        json!({
            "name": name("of the coil, on every answer and page"),
            "fibre": super::fibres::schema(),
            "winding": winding,
            "thermal": thermal,
            "sensor": sensor,
            "record": record,
            "effect": { "type": "array", "items": { "oneOf": effects } },
            "profiles": profiles(),
            "search": search,
            "production": production(),
            "tolerance": tolerance(),
            "boundary": super::boundary::schema(),
            "materials": super::stress::schema(),
        }),
    ))
}

fn production() -> Value {
    table(
        "production",
        &[],
        json!({
            "part_number": words("of the coil"),
            "revision": words("of the part"),
            "spool": words("drawing number or name of the spool"),
            "adhesive": words("what the layers are potted with"),
            "cure": words("how it is cured"),
            "tension_n": described("number", "tension set-point of the first layer"),
            "tension_taper_percent_per_layer": described("number", "how much less each further layer gets"),
            "tension_limit_percent": described("number", "how far the tension may be from its set-point"),
            "allowance_m": described("number", "fibre on each reel beyond what is wound"),
            "potting_every_layers": { "type": "integer", "minimum": 0 },
            "winding_speed_turns_per_min": { "type": "number" },
        }),
    )
}

fn tolerance() -> Value {
    table(
        "tolerance",
        &[],
        json!({
            "turns_per_layer_sd": described("number", "standard deviation of each layer's turns; 0.3 to begin with is a guess"),
            "radial_pitch_percent_sd": described("number", "of the radial pitch; 1 to begin with is a guess"),
            "midpoint_offset_mm_sd": described("number", "of the midpoint's place along the fibre; 20 to begin with is a guess"),
            "diffusivity_percent_sd": described("number", "of the conductivity or diffusivity; 10 to begin with is a guess"),
            "film_percent_sd": described("number", "of the surface film's coefficient; 20 to begin with is a guess"),
            "mismatch_sd": described("number", "of the relative difference of the halves; 0.001 to begin with is a guess"),
            "lost_turns_per_layer_mean": described("number", "whole turns that a layer loses, on average (Poisson); 0.1 to begin with is a guess"),
            "layer_pitch_percent_sd": described("number", "of each layer's own radial pitch; acts on the lengths of the layers above; 1 to begin with is a guess"),
            "flange_film_percent_sd": described("number", "of the film at each heated flange, for itself; 20 to begin with is a guess"),
            "trim_residue_mm": described("number", "asymmetric length that trimming leaves at most, evenly to either side; half an outermost turn where whole turns are trimmed"),
            "samples": { "type": "integer", "minimum": 2 },
            "seed": { "type": "integer", "minimum": 0 },
            "limit_deg_per_h": described("number", "a coil with a larger worst case is scrap"),
        }),
    )
}

fn profiles() -> Value {
    let piece = table(
        "piece",
        &["rate_c_per_h", "duration_s"],
        json!({ "rate_c_per_h": { "type": "number" }, "duration_s": { "type": "number", "exclusiveMinimum": 0 } }),
    );
    let ramp = table(
        "ramp",
        &["name", "pieces"],
        json!({ "name": name("of the profile"), "pieces": { "type": "array", "minItems": 1, "items": piece } }),
    );
    table(
        "profiles",
        &["max_rate_c_per_h"],
        json!({
            "max_rate_c_per_h": described("number", "no ramp is steeper; bound of the guaranteed worst case"),
            "count": { "type": "integer", "minimum": 0 },
            "segments": { "type": "integer", "minimum": 1 },
            "duration_s": { "type": "number", "exclusiveMinimum": 0 },
            "seed": { "type": "integer", "minimum": 0 },
            "ramp": { "type": "array", "items": ramp },
        }),
    )
}

fn effect_schema(spec: &EffectSpec) -> Value {
    let mut properties = Map::from_iter([("kind".to_owned(), json!({ "const": spec.kind }))]);
    let mut needed = vec!["kind"];
    for p in spec.parameters {
        let description = format!("{} [{}]", p.meaning, p.unit.symbol());
        let number = if p.unit == Unit::Layer { "integer" } else { "number" };
        let number = json!({ "type": number, "minimum": p.lower, "maximum": p.upper, "description": description });
        properties.insert(p.key.to_owned(), number);
        if p.default.is_none() {
            needed.push(p.key);
        }
    }
    for choice in spec.choices {
        properties.insert(choice.key.to_owned(), json!({ "enum": choice.options, "description": choice.meaning }));
        needed.push(choice.key);
    }
    table(spec.summary, &needed, Value::Object(properties))
}

fn channel() -> Value {
    let gain = CHANNEL.parameters[0].key;
    let mut schema = effect_schema(CHANNEL);
    schema["properties"]["kind"] = json!({ "type": "string", "pattern": "^channel:.+$" });
    schema["required"] = json!(["kind", gain]);
    schema
}

fn custom() -> Value {
    table(
        CUSTOM.summary,
        &["kind", "formula"],
        json!({
            "kind": { "const": CUSTOM.kind },
            "formula": { "type": "string" },
            "parameters": { "type": "object", "additionalProperties": { "type": "number" } },
        }),
    )
}

/// The schema of a pattern file.
pub fn pattern_schema() -> Value {
    with_dialect(table(
        "coilwright pattern file",
        &["name", "layers", "segments"],
        json!({
            "name": name("of the winding"),
            "layers": { "type": "integer", "minimum": 2, "multipleOf": 2 },
            "segments": {
                "type": "array",
                "description": "the segment on each layer, innermost layer first: a permutation of 1 … layers",
                "uniqueItems": true,
                "items": { "type": "integer", "minimum": 1 },
            },
            "end_a_turns": described("integer", "whole turns more or, below zero, fewer than whole layers at end A; 0 unless stated"),
            "end_b_turns": described("integer", "the same at end B; turns added at one end need as many fewer at the other, whose segment is on the outermost layer"),
        }),
    ))
}

/// The schema of a schedule, a traveller or a winder's program as JSON.
#[expect(clippy::too_many_lines, reason = "one schema, key by key")]
pub fn schedule_schema() -> Value {
    let word = |description: &str| described("string", description);
    let number = |description: &str| described("number", description);
    let whole = |description: &str| described("integer", description);
    let flag = |description: &str| described("boolean", description);
    let windability = table(
        "windability",
        &["class", "reels", "captive", "max_climb"],
        json!({
            "class": word("standard or captive:K"),
            "reels": whole("supply reels with fibre on them at the same time, at most"),
            "captive": whole("captive runs at the same time, at most"),
            "max_climb": whole("longest crossover [layers]"),
        }),
    );
    let reel = table(
        "a supply reel",
        &["name", "captive", "prepared_before_step", "taken_from", "from_m", "to_m"],
        json!({
            "name": word("A, B, C1, C2, …"),
            "captive": flag("held by the coil at both its ends"),
            "prepared_before_step": whole("counted from 1"),
            "taken_from": { "type": ["string", "null"], "description": "the reel from which its fibre is spooled over" },
            "from_m": number("arclength from end A"),
            "to_m": number("arclength from end A"),
            "load_m": number("what to load, with the allowance"),
        }),
    );
    let production = table(
        "the winding shop's settings, copied from the model file",
        &[],
        json!({
            "part_number": word(""), "revision": word(""), "spool": word(""), "adhesive": word(""), "cure": word(""),
            "tension_n": number("on the first layer"),
            "tension_taper_percent_per_layer": number("of the first layer's"),
            "tension_limit_percent": number("of the set-point"),
            "allowance_m": number("on each reel with an end of the fibre"),
            "potting_every_layers": whole("0: only after the last layer"),
            "winding_speed_turns_per_min": number(""),
        }),
    );
    let step = table(
        "a step: one layer",
        &STEP_COLUMNS,
        json!({
            "step": whole("counted from 1"),
            "layer": whole("counted from 1, innermost first"),
            "half": { "enum": ["A", "B"] },
            "segment": whole("1 … N from end A"),
            "supply_reel": word("the reel that feeds the layer"),
            "direction": { "enum": ["first-to-second", "second-to-first"] },
            "turns": number("of the layer"),
            "fibre_from_m": number("arclength of the segment's low end"),
            "fibre_to_m": number("arclength of the segment's high end"),
            "length_m": number("of the layer"),
            "radius_mm": number("of the layer's middle"),
            "climb": whole("longest crossover completed here [layers]"),
            "cumulative_m": number("drawn from the reel so far"),
            "crossover": word("flange, layer and climb of each crossover completed here"),
            "balance_m": number("wound of half A less half B"),
            "rotation": { "enum": ["cw", "ccw"] },
            "axial_pitch_mm": number("from turn to turn"),
            "tension_n": number("set-point"),
            "tension_min_n": number("least allowed"),
            "tension_max_n": number("largest allowed"),
            "turns_per_min": number("winding speed"),
            "reel_change": flag("another reel than for the layer before"),
            "potting": flag("adhesive is applied after the layer"),
            "measured_length_m": word("entered by hand"),
            "checked_by": word("entered by hand"),
        }),
    );
    with_dialect(table(
        "coilwright schedule, traveller or winder's program",
        &[
            "schema_version",
            "document",
            "program",
            "model",
            "model_sha256",
            "pattern",
            "segments",
            "windability",
            "worst_rate_deg_per_h",
            "worst_profile",
            "worst_time_s",
            "length_m",
            "start_mark_m",
            "expected_trim_m",
            "reels",
            "steps",
        ],
        json!({
            "schema_version": { "const": SCHEMA_VERSION },
            "document": word("schedule, traveller or machine program 1"),
            "program": word("what wrote the file"),
            "model": word("the model's name"),
            "model_sha256": word("of the model file"),
            "pattern": word("the winding's name"),
            "pattern_sha256": word("of the pattern's name and segments"),
            "segments": { "type": "array", "items": { "type": "integer", "minimum": 1 } },
            "end_a_turns": whole("turns more or, below zero, fewer than whole layers at end A; absent without any at either end"),
            "end_b_turns": whole("the same at end B"),
            "windability": windability,
            "worst_rate_deg_per_h": number("over the model's profiles and all times"),
            "worst_profile": word("under which it occurs"),
            "worst_time_s": number("at which it occurs"),
            "fibre": word("the fibre in words"),
            "length_m": number("of the fibre"),
            "midpoint_m": number("the fibre's middle, arclength from end A"),
            "midpoint_layer": whole("the layer in which it lies"),
            "start_mark_m": number("fixed at the first flange before layer 1"),
            "expected_trim_m": number("from end A; below 0 from end B"),
            "reels": { "type": "array", "items": reel },
            "production": production,
            "steps": { "type": "array", "items": step },
        }),
    ))
}

/// The schema of one row of a record, as a table schema for CSV tools.
pub fn record_schema() -> Value {
    with_dialect(json!({
        "title": "coilwright record: one row of the CSV",
        "description": "names end in their unit, or have it in brackets; --columns or [record] in the model file map other names: time=Zeit:min,temperature=T1,rate=F:counts,scale=12.5",
        "type": "object",
        "required": ["time_s", "temperature_c", "rate_deg_per_h"],
        "properties": {
            "time_s": described("number", "increases from row to row; also time_ms, _us, _ns, _min, _h, _d, and time_iso for ISO 8601 stamps"),
            "temperature_c": described("number", "what the sensor showed; also temperature_k, temperature_f"),
            "rate_deg_per_h": described("number", "what the gyro showed, at rest; also rate_mdeg_per_h, _deg_per_s, _rad_per_s, _arcsec_per_s; mapped with a scale: counts, mv, v"),
            "temperature_inner_c": described("number", "at the bore; also _k, _f"),
            "temperature_ambient_c": described("number", "of the air; also _k, _f"),
            "table_rate_deg_per_s": described("number", "what a rate table turned the gyro by, which is taken off the rate; also _deg_per_h, _mdeg_per_h, _rad_per_s, _arcsec_per_s"),
        },
        "patternProperties": {
            "^time_(ms|us|ns|min|h|d)$": { "type": "number" },
            "^time_iso$": { "type": "string" },
            "^temperature_((inner|ambient)_)?[kf]$": { "type": "number" },
            "^temperature_(layer_[1-9][0-9]*|flange|spool|electronics|source)_[ckf]$": {
                "type": "number", "description": "a further thermometer; layers count from 1, the innermost" },
            "^rate_(mdeg_per_h|deg_per_s|rad_per_s|arcsec_per_s)$": { "type": "number" },
            "^table_rate_(deg_per_h|mdeg_per_h|rad_per_s|arcsec_per_s)$": { "type": "number" },
        },
        "additionalProperties": { "type": "number", "description": "a further channel by its name" },
    }))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::io::read::model_file::parse_model;

    /// The keys that the reader knows in a table, from its own answer to a key that it does not know.
    fn known(table: &str) -> Vec<String> {
        let source = format!("{table}\nzzzzzz = 1\n");
        let faults = parse_model(Path::new("x.toml"), &source).unwrap_err();
        let note = faults.faults.iter().filter(|f| f.message.contains("zzzzzz")).find_map(|f| f.note.clone()).unwrap();
        note.trim_start_matches("known here: ").split(", ").map(str::to_owned).collect()
    }

    /// What a document holds that a schema does not describe, and what it lacks though it must not.
    fn faults(schema: &Value, document: &Value, at: &str, found: &mut Vec<String>) {
        match document {
            Value::Object(map) => {
                let known = schema["properties"].as_object().unwrap();
                found.extend(map.keys().filter(|k| !known.contains_key(*k)).map(|k| format!("{at}.{k} is unknown")));
                let needed = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
                found.extend(needed.filter(|k| !map.contains_key(*k)).map(|k| format!("{at}.{k} is missing")));
                for (key, value) in map.iter().filter(|(key, _)| known.contains_key(*key)) {
                    faults(&known[key], value, &format!("{at}.{key}"), found);
                }
            }
            Value::Array(list) => list.iter().for_each(|item| faults(&schema["items"], item, at, found)),
            _ => {}
        }
    }

    #[test]
    fn schedules_have_exactly_the_keys_of_their_schema() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/schedule");
        let text = std::fs::read_to_string(folder.join("schedule.json")).unwrap();
        let mut found = Vec::new();
        let schema = schedule_schema();
        faults(&schema, &serde_json::from_str(&text).unwrap(), "schedule", &mut found);
        assert_eq!(found, Vec::<String>::new());
        // The traveller's columns are all that a step can have.
        let text = std::fs::read_to_string(folder.join("traveller.csv")).unwrap();
        let columns: Vec<&str> = text.lines().next().unwrap().split(',').collect();
        for key in schema["properties"]["steps"]["items"]["properties"].as_object().unwrap().keys() {
            assert!(columns.contains(&key.as_str()), "{key}");
        }
    }

    #[test]
    fn the_schema_has_exactly_the_keys_that_the_reader_knows() {
        let schema = model_schema();
        let keys = |value: &Value| {
            let mut keys: Vec<String> = value["properties"].as_object().unwrap().keys().cloned().collect();
            keys.sort();
            keys
        };
        assert_eq!(keys(&schema), known(""));
        for name in [
            "fibre",
            "winding",
            "thermal",
            "sensor",
            "record",
            "profiles",
            "search",
            "production",
            "tolerance",
            "boundary",
            "materials",
        ] {
            assert_eq!(keys(&schema["properties"][name]), known(&format!("[{name}]")), "{name}");
        }
        for spec in CATALOGUE {
            let mut expected: Vec<String> =
                effect_schema(spec)["properties"].as_object().unwrap().keys().cloned().collect();
            expected.sort();
            assert_eq!(expected, known(&format!("[[effect]]\nkind = \"{}\"", spec.kind)), "{}", spec.kind);
        }
    }
}
