//! What records taught of film, offset and chamber, written into a model file as its `[boundary]` table.

use toml_edit::{DocumentMut, InlineTable, Item, Table, value};

use crate::chamber::{Estimate, Learned, Quantity};
use crate::io::fault::{Fault, Faults};
use crate::io::read::boundary_table::error_key;
use crate::units::deg_per_h_from_rad_per_s;

/// The source with a `[boundary]` table in place of any that it had.
///
/// # Errors
/// A source that is no TOML.
pub(crate) fn with_boundary(file: &str, source: &str, learned: &Learned) -> Result<String, Faults> {
    let mut document: DocumentMut = source
        .parse()
        .map_err(|e: toml_edit::TomlError| Faults::one(file, source, Fault::new(e.message(), e.span())))?;
    let mut table = Table::new();
    let records = if learned.records == 1 { "a record".to_owned() } else { format!("{} records", learned.records) };
    let film = match learned.film_w_per_m2_k {
        Some(_) => {
            "evaluate, optimise and the other searches drive the coil by the air, through this film; records keep their sensor."
        }
        None => "The records do not determine the film: searches drive the coil as the rest of this file says.",
    };
    table.decor_mut().set_prefix(format!("\n# Learned from {records}. {film}\n"));
    if let Some(film) = learned.film_w_per_m2_k {
        table["location"] = value("ambient");
        table[Quantity::Film.key()] = value(rounded(film.value));
        state(&mut table, error_key(Quantity::Film), film.standard_error);
    }
    if let Some(offset) = learned.offset_rad_per_s {
        table["offset_deg_per_h"] = value(rounded(deg_per_h_from_rad_per_s(offset.value)));
        state(&mut table, "offset_standard_error_deg_per_h", deg_per_h_from_rad_per_s(offset.standard_error));
    }
    table["records"] = value(learned.records as i64);
    let mut chamber = Table::new();
    for (quantity, estimate) in &learned.numbers {
        let Estimate { value: number, standard_error } = *estimate;
        let unit = |v: f64| if quantity.is_rate() { deg_per_h_from_rad_per_s(v) } else { v };
        let mut own = InlineTable::new();
        own.insert("value", rounded(unit(number)).into());
        if standard_error.is_finite() {
            own.insert(error_key(*quantity), rounded(unit(standard_error)).into());
        }
        chamber[quantity.key()] = value(own);
    }
    if !chamber.is_empty() {
        table["chamber"] = Item::Table(chamber);
    }
    document["boundary"] = Item::Table(table);
    Ok(document.to_string())
}

fn state(table: &mut Table, key: &str, number: f64) {
    if number.is_finite() {
        table[key] = value(rounded(number));
    }
}

/// Five digits: more than any estimate is worth.
fn rounded(number: f64) -> f64 {
    format!("{number:.4e}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::io::read::model_file::{parse_model, read_model};
    use crate::thermal::Location;
    use crate::units::rad_per_s_from_deg_per_h;

    #[test]
    fn what_was_learned_is_read_again_and_drives_searches_but_not_records() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/records/a-control/coil.toml");
        let file = read_model(&path).unwrap();
        let estimate = |value: f64, standard_error: f64| Estimate { value, standard_error };
        let rate = rad_per_s_from_deg_per_h;
        let learned = Learned {
            film_w_per_m2_k: Some(estimate(24.5, 0.5)),
            offset_rad_per_s: Some(estimate(rate(0.25), rate(0.01))),
            numbers: vec![
                (Quantity::ReadingNoise, estimate(0.004, 1e-4)),
                (Quantity::RateNoise, estimate(rate(0.05), rate(0.001))),
            ],
            records: 2,
        };
        let once = with_boundary("coil.toml", &file.source, &learned).unwrap();
        let twice = with_boundary("coil.toml", &once, &learned).unwrap();
        assert_eq!(once, twice);
        let read = parse_model(&path, &once).unwrap();
        let found = read.learned.clone().unwrap();
        assert_eq!((found.film_w_per_m2_k, found.records), (learned.film_w_per_m2_k, 2));
        for ((a, b), (c, d)) in found.numbers.iter().zip(&learned.numbers) {
            assert!(a == c && (b.value / d.value - 1.0).abs() < 1e-9, "{a:?}");
        }
        assert_eq!(read.model.heat_path().unwrap().location, Location::OuterLayer);
        let searched = read.for_search().model.heat_path().unwrap();
        assert_eq!((searched.location, searched.film_w_per_m2_k), (Location::Ambient, Some(24.5)));
        // One film is enough: a declared one stands.
        let declared = once + "\n[[effect]]\nkind = \"surface_film\"\nfilm_w_per_m2_k = 30.0\n";
        let searched = parse_model(&path, &declared).unwrap().for_search().model.heat_path().unwrap();
        assert_eq!(searched.film_w_per_m2_k, Some(30.0));
    }
}
