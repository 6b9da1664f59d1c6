//! Edits of model files that keep the user's comments and layout.

use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, value};

use crate::effect::{DeclaredEffect, Subject};
use crate::io::fault::{Fault, Faults};
use crate::io::read::profile_file::pieces;
use crate::profile::Profile;
use crate::text::sink::TomlComment;

/// A remark written behind a parameter's value, such as its standard error.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Remark {
    pub(crate) key: String,
    pub(crate) text: TomlComment,
}

/// The source with the effect declared: appended, or with its values renewed where it is declared already.
///
/// # Errors
/// A source that is no TOML or whose `effect` is no array of tables.
pub(crate) fn with_effect(
    file: &str,
    source: &str,
    effect: &DeclaredEffect,
    remarks: &[Remark],
) -> Result<String, Faults> {
    let mut document: DocumentMut = source
        .parse()
        .map_err(|e: toml_edit::TomlError| Faults::one(file, source, Fault::new(e.message(), e.span())))?;
    let effects = document.entry("effect").or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
    let Some(tables) = effects.as_array_of_tables_mut() else {
        let message = "effect must be written as [[effect]] tables to be extended";
        return Err(Faults::one(file, source, Fault::new(message, None)));
    };
    let kind = effect.kind();
    let declared = |t: &Table| {
        let same_kind = t.get("kind").and_then(Item::as_str) == Some(kind.as_str());
        let same_formula = match effect.subject() {
            Subject::Formula(f) => t.get("formula").and_then(Item::as_str) == Some(f.expression().source()),
            Subject::None | Subject::Channel(_) | Subject::Materials(_) => true,
        };
        same_kind && same_formula
    };
    let existing = tables.iter().position(declared);
    let index = existing.unwrap_or_else(|| {
        let mut table = Table::new();
        // A blank line in front, as between the tables of a file written by hand.
        table.decor_mut().set_prefix("\n");
        tables.push(table);
        tables.len() - 1
    });
    if let Some(table) = tables.get_mut(index) {
        declare(table, effect, remarks);
    }
    Ok(document.to_string())
}

/// The source with another sensor location, where one is given, and another winding pattern.
///
/// # Errors
/// A source that is no TOML or whose `sensor` or `winding` is no table.
pub(crate) fn with_sensor_and_pattern(
    file: &str,
    source: &str,
    location: Option<&str>,
    pattern: &str,
) -> Result<String, Faults> {
    let mut document: DocumentMut = source
        .parse()
        .map_err(|e: toml_edit::TomlError| Faults::one(file, source, Fault::new(e.message(), e.span())))?;
    let stated = [("sensor", "location", location), ("winding", "pattern", Some(pattern))];
    for (section, key, stated) in stated {
        let Some(stated) = stated else { continue };
        let item = document.entry(section).or_insert_with(|| Item::Table(Table::new()));
        let Some(table) = item.as_table_like_mut() else {
            let message = format!("{section} must be written as a [{section}] table to be changed");
            return Err(Faults::one(file, source, Fault::new(message, None)));
        };
        table.insert(key, value(stated));
    }
    Ok(document.to_string())
}

/// The source with further listed profiles.
///
/// # Errors
/// A source that is no TOML or whose `profiles.ramp` is no array of tables.
pub fn with_ramps(file: &str, source: &str, profiles: &[Profile]) -> Result<String, Faults> {
    let mut document: DocumentMut = source
        .parse()
        .map_err(|e: toml_edit::TomlError| Faults::one(file, source, Fault::new(e.message(), e.span())))?;
    let section = document.entry("profiles").or_insert_with(|| Item::Table(Table::new()));
    let ramps = section
        .as_table_mut()
        .map(|table| table.entry("ramp").or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new())))
        .and_then(Item::as_array_of_tables_mut);
    let Some(ramps) = ramps else {
        let message = "profiles.ramp must be written as [[profiles.ramp]] tables to be extended";
        return Err(Faults::one(file, source, Fault::new(message, None)));
    };
    for profile in profiles {
        let mut table = Table::new();
        table.decor_mut().set_prefix("\n");
        table["name"] = value(profile.name());
        table["pieces"] = value(pieces(profile));
        ramps.push(table);
    }
    Ok(document.to_string())
}

fn declare(table: &mut Table, effect: &DeclaredEffect, remarks: &[Remark]) {
    table["kind"] = value(effect.kind());
    let parameters = effect.parameters();
    let stated: Vec<(String, f64)> =
        parameters.iter().zip(effect.values()).map(|(p, &si)| (p.key.clone(), rounded(p.unit.from_si(si)))).collect();
    if let Subject::Formula(formula) = effect.subject() {
        table["formula"] = value(formula.expression().source());
        let mut named = InlineTable::new();
        for (key, number) in &stated {
            named.insert(key, (*number).into());
        }
        table["parameters"] = value(named);
        let stated: Vec<String> = remarks.iter().map(|r| format!("{} = {}", r.key, r.text)).collect();
        let all = Remark { key: "parameters".to_owned(), text: TomlComment::of(stated.join("; ")) };
        remark(table, "parameters", if stated.is_empty() { &[] } else { std::slice::from_ref(&all) });
        return;
    }
    for (key, number) in &stated {
        // A layer is a number to count by.
        let whole =
            effect.layer().is_some_and(|layer| *number == layer as f64 && effect.spec().parameters[0].key == key);
        table[key] = if whole { value(*number as i64) } else { value(*number) };
        remark(table, key, remarks);
    }
    for (choice, &index) in effect.spec().choices.iter().zip(effect.choices()) {
        table[choice.key] = value(choice.options[index]);
    }
}

/// Seven digits: more than any fit is worth, fewer than rounding shows.
fn rounded(number: f64) -> f64 {
    format!("{number:.6e}").parse().unwrap_or(number)
}

fn remark(table: &mut Table, key: &str, remarks: &[Remark]) {
    let texts: Vec<&str> = remarks.iter().filter(|r| r.key == key).map(|r| r.text.as_str()).collect();
    if let (false, Some(v)) = (texts.is_empty(), table.get_mut(key).and_then(Item::as_value_mut)) {
        v.decor_mut().set_suffix(format!("   # {}", texts.join("; ")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect;

    const SOURCE: &str = "\
# my coil
name = \"x\"   # a remark

[thermal]  # heat
model = \"pack\"

[profiles]
max_rate_c_per_h = 10.0  # steep
";

    fn mismatch(m: f64) -> DeclaredEffect {
        DeclaredEffect::new(effect::find("strain_mismatch").unwrap(), vec![m], vec![]).unwrap()
    }

    #[test]
    fn an_effect_is_added_and_everything_else_stays_as_it_was() {
        let remarks = [Remark { key: "mismatch".into(), text: TomlComment::of("± 0.0001, fitted") }];
        let edited = with_effect("x.toml", SOURCE, &mismatch(0.004), &remarks).unwrap();
        assert_eq!(
            edited,
            SOURCE.to_owned() + "\n[[effect]]\nkind = \"strain_mismatch\"\nmismatch = 0.004   # ± 0.0001, fitted\n"
        );
    }

    #[test]
    fn a_ramp_is_listed_behind_the_others_with_round_rates() {
        let piece = crate::profile::Piece { rate_k_per_s: -10.0 / 3600.0, duration_s: 12.5 };
        let profile = Profile::new("worst", vec![piece]).unwrap();
        let edited = with_ramps("x.toml", SOURCE, &[profile]).unwrap();
        let added = "\n[[profiles.ramp]]\nname = \"worst\"\npieces = [{ rate_c_per_h = -10.0, duration_s = 12.5 }]\n";
        assert_eq!(edited, SOURCE.to_owned() + added);
    }

    #[test]
    fn an_effect_that_is_declared_already_gets_new_values() {
        let first = with_effect("x.toml", SOURCE, &mismatch(0.004), &[]).unwrap();
        let second = with_effect("x.toml", &first, &mismatch(0.005), &[]).unwrap();
        assert_eq!(second, first.replace("0.004", "0.005"));
    }
}
