//! The `[[effect]]` tables of a model file.

use std::ops::Range;

use crate::effect::custom::{Formula, FormulaError};
use crate::effect::{self, CATALOGUE, CHANNEL, CUSTOM, DeclaredEffect};
use crate::io::fault::Fault;

use super::toml_reader::{Limits, TableReader, TomlReader, nearest};
use crate::text;

/// The `[[effect]]` tables; none if one has a fault.
pub(super) fn read_effects(r: &mut TomlReader, tables: Vec<TableReader>) -> Option<Vec<DeclaredEffect>> {
    let mut effects: Vec<DeclaredEffect> = Vec::new();
    let mut clean = true;
    for mut table in tables {
        let effect = read_effect(r, &mut table);
        let kind_span = table.span_of("kind");
        match effect {
            Some(effect) if effects.iter().any(|e| is_the_same(e, &effect)) => {
                let message = format!("the effect {} is declared twice: keep one of them", effect.kind());
                r.fault(Fault::new(message, kind_span));
                clean = false;
            }
            Some(effect) => {
                effects.push(effect);
                table.finish(r);
            }
            None => clean = false,
        }
    }
    clean.then_some(effects)
}

/// Formulas may stand side by side, and effects that act at a place of their choice, each at its own.
fn is_the_same(one: &DeclaredEffect, other: &DeclaredEffect) -> bool {
    one.kind() == other.kind() && one.spec().kind != CUSTOM.kind && one.choices() == other.choices()
}

fn read_effect(r: &mut TomlReader, table: &mut TableReader) -> Option<DeclaredEffect> {
    let kinds: Vec<&str> = CATALOGUE.iter().chain([&CHANNEL, &CUSTOM]).map(|s| s.kind).collect();
    if !table.has("kind") {
        let misspelt = table.keys().into_iter().find(|key| nearest(key, &["kind"]).is_some());
        r.fault(match misspelt {
            Some(key) => Fault::new(format!("unknown key effect.{key}: did you mean kind?"), table.span_of(&key)),
            None => Fault::new(format!("missing key effect.kind: expected one of {}", kinds.join(", ")), table.span()),
        });
        return None;
    }
    let kind = table.text(r, "kind")?;
    if let Some(name) = kind.strip_prefix("channel:") {
        return read_channel(r, table, name);
    }
    if kind == CUSTOM.kind {
        return read_custom(r, table);
    }
    let Some(spec) = effect::find(kind) else {
        let mut fault = Fault::new(format!("effect.kind \"{kind}\" is not in the catalogue"), table.span_of("kind"));
        fault = match nearest(kind, &kinds) {
            Some(near) => fault.with_note(format!("did you mean \"{near}\"?")),
            None => fault.with_note(format!("known effects: {}", kinds.join(", "))),
        };
        r.fault(fault);
        return None;
    };
    let mut values = Vec::new();
    for parameter in spec.parameters {
        let limits = Limits::between(parameter.lower, parameter.upper);
        let stated = match parameter.default {
            Some(default) if !table.has(parameter.key) => Some(default),
            _ => table.needed_number(r, parameter.key, limits),
        };
        // Registers the key as known also where the default stands in for it.
        let _ = parameter.default.and_then(|_| table.number(r, parameter.key, limits));
        values.push(stated.map(|v| parameter.unit.to_si(v)));
    }
    let mut choices = Vec::new();
    for choice in spec.choices {
        choices.push(table.needed_word(r, choice.key, choice.options));
    }
    let values: Option<Vec<f64>> = values.into_iter().collect();
    let choices: Option<Vec<usize>> = choices.into_iter().collect();
    let Some((values, choices)) = values.zip(choices) else {
        // What is missing or unknown is reported here, because the caller drops the table.
        std::mem::replace(table, TableReader::gone()).finish(r);
        return None;
    };
    match DeclaredEffect::new(spec, values, choices) {
        Ok(effect) => Some(effect),
        Err(error) => {
            r.fault(Fault::new(error.to_string(), table.span()));
            None
        }
    }
}

fn read_channel(r: &mut TomlReader, table: &mut TableReader, name: &str) -> Option<DeclaredEffect> {
    let fault = channel_fault(name);
    let is_name = fault.is_none();
    if let Some(fault) = fault {
        r.fault(Fault::new(format!("effect.kind: {fault}"), table.span_of("kind")));
    }
    let parameter = &CHANNEL.parameters[0];
    let gain = table.needed_number(r, parameter.key, Limits::between(parameter.lower, parameter.upper));
    match gain {
        Some(gain) if is_name => Some(DeclaredEffect::channel(name, parameter.unit.to_si(gain))),
        _ => {
            std::mem::replace(table, TableReader::gone()).finish(r);
            None
        }
    }
}

/// Why a further column cannot be called so; none if it can.
pub(crate) fn channel_fault(name: &str) -> Option<String> {
    if name.is_empty() {
        return Some("\"channel:\" lacks the column's name: write channel:NAME".to_owned());
    }
    text::name_fault(name).map(|fault| format!("the column's name {fault}"))
}

fn read_custom(r: &mut TomlReader, table: &mut TableReader) -> Option<DeclaredEffect> {
    let source =
        table.needed_text(r, "formula", "a formula in °/h").filter(|source| match text::unseen_fault(source) {
            Some(fault) => {
                r.fault(Fault::new(format!("effect.formula {fault}"), table.span_of("formula")));
                false
            }
            None => true,
        });
    let formula_span = table.span_of("formula");
    let mut parameters = table.table(r, "parameters");
    let named = parameters.all_numbers(r);
    let effect = source.zip(named).and_then(|(source, named)| {
        let (names, values): (Vec<String>, Vec<f64>) = named.into_iter().unzip();
        match Formula::new(source, names) {
            // The number of values is that of the names.
            Ok(formula) => DeclaredEffect::custom(formula, values).ok(),
            Err(error) => {
                r.fault(Fault::new(format!("effect.formula: {error}"), formula_place(&error, formula_span)));
                None
            }
        }
    });
    if effect.is_none() {
        std::mem::replace(table, TableReader::gone()).finish(r);
    }
    effect
}

/// The character of the source at which a formula goes wrong: its place in the string, behind the opening quote.
fn formula_place(error: &FormulaError, string: Option<Range<usize>>) -> Option<Range<usize>> {
    let string = string?;
    let Some(at) = error.at() else { return Some(string) };
    let start = (string.start + 1 + at.start).min(string.end.saturating_sub(1));
    Some(start..(string.start + 1 + at.end).clamp(start, string.end))
}
