//! Numbers of a model file that a reader moves while looking at the answer: film, diffusivity, steepest ramp, spool.
//!
//! Each change is an edit of the file, so that what is shown is what the commands say of the edited file.

use toml_edit::{Array, DocumentMut, Item, Table, Value, value};

use super::model_edit::with_effect;
use crate::effect::{Address, DeclaredEffect, FILM, SPOOL};
use crate::io::fault::{Fault, Faults};
use crate::io::json::explore::SettingsJson;
use crate::io::model::ModelFile;
use crate::thermal::{Extent, PackMaterial};
use crate::units::c_per_h_from_k_per_s;

/// The numbers as the model has them; none where it lacks what they are of.
pub(crate) fn settings(file: &ModelFile) -> SettingsJson {
    let of = |address: Address| {
        let effect = file.model.effects.iter().find(|e| e.is_at(address))?;
        Some(address.spec.parameters[address.parameter].unit.from_si(effect.values()[address.parameter]))
    };
    SettingsJson {
        film_w_per_m2_k: of(FILM),
        diffusivity_m2_per_s: Some(file.model.material.diffusivity_m2_per_s()),
        max_rate_c_per_h: Some(shortest(c_per_h_from_k_per_s(file.profiles.max_rate_k_per_s))),
        spool_j_per_m2_k: of(SPOOL),
    }
}

/// Whether heat can pass through a film or into a spool: a half space has neither.
pub(crate) fn has_surfaces(file: &ModelFile) -> bool {
    file.model.heat_path().is_ok_and(|path| path.extent == Extent::Pack)
}

/// The model's source with other numbers; what is not set stays as it is.
///
/// # Errors
/// A source that cannot be edited, numbers that no effect takes.
pub(crate) fn tuned(file: &ModelFile, set: &SettingsJson) -> Result<String, Faults> {
    let path = file.path.display().to_string();
    let mut source = file.source.clone();
    for (address, stated) in [(FILM, set.film_w_per_m2_k), (SPOOL, set.spool_j_per_m2_k)] {
        let Some(stated) = stated else { continue };
        let declared = file.model.effects.iter().find(|e| e.is_at(address));
        let effect = declared.cloned().unwrap_or_else(|| DeclaredEffect::at_start(address.spec));
        let mut values = effect.values().to_vec();
        values[address.parameter] = address.spec.parameters[address.parameter].unit.to_si(stated);
        let effect = effect.with_values(values).map_err(|error| fault(&path, &source, &error.to_string()))?;
        source = with_effect(&path, &source, &effect, &[])?;
    }
    if set.diffusivity_m2_per_s.is_none() && set.max_rate_c_per_h.is_none() {
        return Ok(source);
    }
    let mut document: DocumentMut = source
        .parse()
        .map_err(|e: toml_edit::TomlError| Faults::one(&path, &source, Fault::new(e.message(), e.span())))?;
    if let Some(m2_per_s) = set.diffusivity_m2_per_s {
        let (key, number) = match file.model.material {
            PackMaterial::Diffusivity { .. } => ("diffusivity_m2_per_s", m2_per_s),
            PackMaterial::Conductivity { heat_capacity_j_per_m3_k, .. } => {
                ("conductivity_w_per_m_k", shortest(m2_per_s * heat_capacity_j_per_m3_k))
            }
        };
        insert(&mut document, "thermal", key, number).ok_or_else(|| fault(&path, &source, "thermal is no table"))?;
    }
    if let Some(c_per_h) = set.max_rate_c_per_h {
        let factor = c_per_h / c_per_h_from_k_per_s(file.profiles.max_rate_k_per_s);
        insert(&mut document, "profiles", "max_rate_c_per_h", c_per_h)
            .ok_or_else(|| fault(&path, &source, "profiles is no table"))?;
        scale_ramps(&mut document, factor);
    }
    Ok(document.to_string())
}

fn fault(path: &str, source: &str, message: &str) -> Faults {
    Faults::one(path, source, Fault::new(message, None))
}

/// Without the last digits, which arithmetic leaves.
fn shortest(number: f64) -> f64 {
    format!("{number:.13e}").parse().unwrap_or(number)
}

/// Sets a key, with the remark behind it kept.
fn insert(document: &mut DocumentMut, table: &str, key: &str, number: f64) -> Option<()> {
    let table = document.entry(table).or_insert_with(|| Item::Table(Table::new())).as_table_like_mut()?;
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(there) => {
            let decor = there.decor().clone();
            *there = number.into();
            *there.decor_mut() = decor;
        }
        None => drop(table.insert(key, value(number))),
    }
    Some(())
}

/// Listed profiles keep their shape: all rates grow with the steepest.
fn scale_ramps(document: &mut DocumentMut, factor: f64) {
    let Some(ramps) = document.get_mut("profiles").and_then(|p| p.get_mut("ramp")) else { return };
    let scale = |piece: &mut dyn toml_edit::TableLike| {
        let Some(rate) = piece.get_mut("rate_c_per_h").and_then(Item::as_value_mut) else { return };
        let stated = rate.as_float().or_else(|| rate.as_integer().map(|i| i as f64));
        if let Some(stated) = stated {
            *rate = shortest(stated * factor).into();
        }
    };
    let scale_array = |pieces: &mut Array| {
        for piece in pieces.iter_mut().filter_map(Value::as_inline_table_mut) {
            scale(piece);
        }
    };
    let each = |ramp: &mut dyn toml_edit::TableLike| match ramp.get_mut("pieces") {
        Some(Item::Value(Value::Array(pieces))) => scale_array(pieces),
        Some(Item::ArrayOfTables(pieces)) => pieces.iter_mut().for_each(|piece| scale(piece)),
        _ => {}
    };
    match ramps {
        Item::ArrayOfTables(ramps) => ramps.iter_mut().for_each(|ramp| each(ramp)),
        Item::Value(Value::Array(ramps)) => {
            ramps.iter_mut().filter_map(Value::as_inline_table_mut).for_each(|ramp| each(ramp));
        }
        _ => {}
    }
}

/// The source without its `winding.pattern`, which may name a file that is not at hand.
///
/// # Errors
/// A source that is no TOML.
pub(crate) fn without_pattern(file: &str, source: &str) -> Result<String, Faults> {
    let mut document: DocumentMut = source
        .parse()
        .map_err(|e: toml_edit::TomlError| Faults::one(file, source, Fault::new(e.message(), e.span())))?;
    if let Some(winding) = document.get_mut("winding").and_then(Item::as_table_like_mut) {
        winding.remove("pattern");
    }
    Ok(document.to_string())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::io::read::model_file::parse_model;

    const SOURCE: &str = "\
name = \"x\"
[fibre]
refractive_index = 1.45
thermo_optic_per_k = 1e-5
wavelength_nm = 1550.0
outer_diameter_um = 165.0
[winding]
layers = 4
turns_per_layer = 20
inner_diameter_mm = 60.0
layer_length = \"actual\"
pattern = \"mine.toml\"   # of last year
[thermal]
model = \"pack\"
conductivity_w_per_m_k = 0.35   # measured
volumetric_heat_capacity_j_per_m3_k = 1.75e6
[profiles]
max_rate_c_per_h = 60.0
count = 2
[[profiles.ramp]]
name = \"steep\"
pieces = [{ rate_c_per_h = 60.0, duration_s = 600.0 }, { rate_c_per_h = -30, duration_s = 60.0 }]
";

    #[test]
    fn what_is_set_is_what_the_edited_file_says_and_remarks_stay() {
        let path = Path::new("x.toml");
        let file = parse_model(path, &without_pattern("x.toml", SOURCE).unwrap()).unwrap();
        let stated = settings(&file);
        assert_eq!((stated.film_w_per_m2_k, stated.max_rate_c_per_h), (None, Some(60.0)));
        assert!((stated.diffusivity_m2_per_s.unwrap() / 2e-7 - 1.0).abs() < 1e-12);
        let set = SettingsJson {
            film_w_per_m2_k: Some(25.0),
            diffusivity_m2_per_s: Some(4e-7),
            max_rate_c_per_h: Some(90.0),
            spool_j_per_m2_k: Some(5000.0),
        };
        let source = tuned(&file, &set).unwrap();
        assert!(source.contains("conductivity_w_per_m_k = 0.7   # measured"), "{source}");
        assert!(source.contains("{ rate_c_per_h = 90.0, duration_s = 600.0 }"), "{source}");
        let again = parse_model(path, &source).unwrap();
        assert_eq!(settings(&again), set);
        assert_eq!(tuned(&again, &set).unwrap(), source);
        assert_eq!(tuned(&file, &SettingsJson::default()).unwrap(), file.source);
        assert!(tuned(&file, &SettingsJson { film_w_per_m2_k: Some(-1.0), ..set }).is_err());
    }
}
