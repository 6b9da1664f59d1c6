//! JSON Schemas of a campaign file and of an exported compensator; see [`super::schema`].

use serde_json::{Value, json};

use crate::search::cost::objective::Objective;

use super::SCHEMA_VERSION;
use super::campaign::KINDS;
use super::schema::{described, name, table, with_dialect};

/// The schema of a campaign file.
pub fn campaign_schema() -> Value {
    let objectives: Vec<&str> = Objective::ALL.iter().map(|o| o.key()).chain(["guaranteed"]).collect();
    let list = |items: Value, description: &str| json!({ "type": "array", "minItems": 1, "items": items, "description": description });
    let text = || json!({ "type": "string" });
    let gyro = table(
        "a gyro of a fleet",
        &["name", "records"],
        json!({
            "name": name("of the gyro"),
            "records": list(text(), "record files, beside the campaign file"),
            "holdout": list(text(), "diagnose: records that are only judged by"),
            "model": described("string", "diagnose: in place of the fleet's"),
        }),
    );
    let mut schema = table(
        "coilwright campaign file",
        &["name"],
        json!({
            "name": name("of the campaign"),
            "kind": { "enum": KINDS, "description": "without it: search" },
            "models": list(text(), "search, tolerance: model files, beside the campaign file"),
            "layers": list(json!({ "type": "integer", "minimum": 2 }), "search: in place of the models' own"),
            "classes": list(json!({ "type": "string", "pattern": "^(standard|any|captive:[0-9]+)$" }), "search; without it: standard"),
            "objectives": list(json!({ "enum": objectives }), "search; without it: worst-rate"),
            "seeds": list(json!({ "type": "integer", "minimum": 0 }), "search; without it: 1"),
            "rounds": { "type": "integer", "minimum": 1, "description": "search" },
            "moves_per_restart": { "type": "integer", "minimum": 1, "description": "search" },
            "patterns": list(text(), "tolerance: windings or pattern files beside the campaign file; QUA always joins"),
            "samples": { "type": "integer", "minimum": 2, "description": "tolerance: coils of each model; without it: the model's own" },
            "coils_per_cell": { "type": "integer", "minimum": 1, "description": "tolerance; without it: 10000" },
            "seed": { "type": "integer", "minimum": 0, "description": "tolerance: of the draws; without it: the model's own" },
            "limit_deg_per_h": { "type": "number", "exclusiveMinimum": 0, "description": "tolerance: a coil whose worst case is larger is scrap" },
            "model": described("string", "diagnose: of all gyros that state none"),
            "gyro": list(gyro, "metrics, diagnose: the fleet"),
            "average_s": { "type": "number", "exclusiveMinimum": 0, "description": "metrics: averaging time of the bias stability; without it: 10" },
            "columns": described("string", "metrics, diagnose: as --columns"),
            "bad_rows": { "enum": ["refuse", "skip"], "description": "metrics, diagnose; without it: refuse" },
            "terms": list(text(), "diagnose: as --terms, or none"),
        }),
    );
    schema["anyOf"] = json!([{ "required": ["models"] }, { "required": ["gyro"] }]);
    with_dialect(schema)
}

/// The schema of the compensator that `compensate --export` writes.
#[expect(clippy::too_many_lines, reason = "one schema, key by key")]
pub fn compensation_schema() -> Value {
    let numbers =
        |description: &str| json!({ "type": "array", "items": { "type": "number" }, "description": description });
    let whole = |description: &str| json!({ "type": "integer", "minimum": 0, "description": description });
    let gains = table(
        "gains of one age",
        &["gain", "chain_gain", "variance"],
        json!({
            "gain": numbers("of the states"),
            "chain_gain": numbers("of the delayed rate errors [°/h per °C]"),
            "variance": described("number", "of the innovation [°C²]"),
        }),
    );
    let physical = table(
        "coilwright compensator as a difference equation",
        &[
            "schema_version",
            "model",
            "equations",
            "interval_s",
            "delay_rows",
            "offset_deg_per_h",
            "transition",
            "rate",
            "reading",
            "level_states",
            "most_hypotheses",
            "break_probability",
            "least_log_weight",
            "forgotten_rows",
            "gains",
        ],
        json!({
            "schema_version": { "const": SCHEMA_VERSION },
            "model": described("string", "the model's name"),
            "equations": { "type": "array", "items": { "type": "string" } },
            "interval_s": { "type": "number", "exclusiveMinimum": 0 },
            "delay_rows": whole("the rate error that comes out belongs to the row so many rows ago"),
            "offset_deg_per_h": described("number", "bias of the gyro"),
            "transition": { "type": "array", "items": numbers("one row of F") },
            "rate": numbers("rate error per state [°/h per °C]"),
            "reading": numbers("what the sensor shows of each state"),
            "level_states": { "type": "array", "items": whole("a state that starts at the first reading") },
            "most_hypotheses": whole("1: one difference equation"),
            "break_probability": { "type": "number", "minimum": 0, "maximum": 1 },
            "least_log_weight": described("number", "below the best hypothesis' own"),
            "forgotten_rows": whole("without a reading, after which the next one begins anew"),
            "gains": { "type": "array", "minItems": 1, "items": gains },
            "formulas": { "type": "array", "items": { "type": "string" }, "description": "what they say is added [°/h]" },
        }),
    );
    let methods = [
        (
            "piecewise",
            &["lines"][..],
            json!({ "lines": { "type": "array", "minItems": 1, "items": table(
            "a straight piece",
            &["until_c", "at_20_c_deg_per_h", "slope_deg_per_h_per_c"],
            json!({
                "until_c": { "type": ["number", "null"], "description": "null for the last" },
                "at_20_c_deg_per_h": described("number", "of the rate error"),
                "slope_deg_per_h_per_c": described("number", "over the temperature"),
            }),
        ) } }),
        ),
        (
            "regression",
            &["offset_deg_per_h", "per_temperature_deg_per_h_per_k", "per_rate_deg_per_h_s_per_k"],
            json!({
                "offset_deg_per_h": described("number", "at 20 °C"),
                "per_temperature_deg_per_h_per_k": described("number", "of T - 20 °C"),
                "per_rate_deg_per_h_s_per_k": described("number", "of dT/dt"),
                "per_difference_rate_deg_per_h_s_per_k": { "type": ["number", "null"],
                    "description": "of d(T - T_inner)/dt; null where the inner temperature is not read" },
            }),
        ),
        (
            "learned",
            &["offset_deg_per_h", "columns_deg_per_h", "lags_s", "forgotten_s"],
            json!({
                "offset_deg_per_h": described("number", "of the rate error"),
                "columns_deg_per_h": numbers("of the columns that equations lists"),
                "lags_s": numbers("of the lagged temperatures"),
                "forgotten_s": described("number", "without a reading, after which the next one begins anew"),
            }),
        ),
    ];
    let further = methods.into_iter().map(|(method, needed, own)| {
        let mut properties = json!({
            "schema_version": { "const": SCHEMA_VERSION },
            "model": described("string", "the model's name"),
            "method": { "const": method },
            "equations": { "type": "array", "items": { "type": "string" } },
            "interval_s": { "type": "number", "exclusiveMinimum": 0 },
            "delay_rows": whole("the rate error that comes out belongs to the row so many rows ago"),
        });
        if let (Value::Object(all), Value::Object(own)) = (&mut properties, own) {
            all.extend(own);
        }
        let common = ["schema_version", "model", "method", "equations", "interval_s", "delay_rows"];
        table(&format!("coilwright compensator, {method}"), &[&common[..], needed].concat(), properties)
    });
    let all: Vec<Value> = std::iter::once(physical).chain(further).collect();
    with_dialect(json!({ "title": "coilwright compensator as compensate --export writes it", "anyOf": all }))
}

/// How a model file says that the columns of records are named.
pub(super) fn record_table() -> Value {
    let mapped = |description: &str| {
        described("string", &format!("{description}; the file's name of the column, :UNIT behind it"))
    };
    let mut record = table(
        "record: how the columns of the record files are named",
        &[],
        json!({
            "date": described("string", "the day, where the time of day stands in a column of its own; the file's name of the column"),
            "time": mapped("time: s, ms, us, ns, min, h, d, iso, epoch_s, epoch_ms"),
            "temperature": mapped("the sensor: c, k, f"),
            "rate": mapped("deg_per_h, mdeg_per_h, deg_per_s, rad_per_s, arcsec_per_s, counts, mv, v"),
            "inner": mapped("temperature of the bore: c, k, f"),
            "ambient": mapped("temperature of the air: c, k, f"),
            "table": mapped("what a rate table turned the gyro by: deg_per_s, deg_per_h, mdeg_per_h, rad_per_s, arcsec_per_s"),
            "flange": mapped("a further thermometer: c, k, f"),
            "spool": mapped("a further thermometer: c, k, f"),
            "electronics": mapped("a further thermometer: c, k, f"),
            "source": mapped("a thermometer at the light source: c, k, f"),
            "scale": described("number", "raw units (counts, mv, v) that are one degree an hour"),
            "bad_rows": { "enum": ["refuse", "skip"], "default": "refuse",
                "description": "rows that lack a number, or whose stamp repeats or jumps back" },
            "average_rows": { "type": "integer", "minimum": 1, "default": 1, "description": "rows averaged into one" },
        }),
    );
    record["patternProperties"] =
        json!({ "^layer_[1-9][0-9]*$": mapped("a thermometer at that layer, counted from 1 innermost: c, k, f") });
    record
}
