//! The `[boundary]` table of a model file: what records taught of film, offset and chamber.

use crate::chamber::{Estimate, Learned, PRIORS, Quantity};
use crate::units::rad_per_s_from_deg_per_h;

use super::toml_reader::{Limits, TableReader, TomlReader};

/// Key of a number's standard error.
pub(crate) fn error_key(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Film => "surface_film_standard_error_w_per_m2_k",
        _ => "standard_error",
    }
}

const FILM: Limits = Limits::between(0.5, 100_000.0);
const ANY: Limits = Limits::between(-1e6, 1e6);
const POSITIVE: Limits = Limits::between(1e-30, 1e9);

/// The `[boundary]` table, if there is one.
pub(super) fn read_boundary(r: &mut TomlReader, table: &mut TableReader) -> Option<Learned> {
    let present = table.is_present();
    // The only word there is: profiles are courses of the air.
    table.word(r, "location", &["ambient"]);
    let mut estimate = |r: &mut TomlReader, key: &'static str, error: &'static str, limits: Limits| {
        let value = table.number(r, key, limits);
        let standard_error = table.number(r, error, Limits::between(0.0, 1e9));
        value.map(|value| Estimate { value, standard_error: standard_error.unwrap_or(f64::NAN) })
    };
    let film_w_per_m2_k = estimate(r, Quantity::Film.key(), error_key(Quantity::Film), FILM);
    let offset = estimate(r, "offset_deg_per_h", "offset_standard_error_deg_per_h", ANY);
    let records = table.integer(r, "records", 1, i64::MAX).unwrap_or(1) as usize;
    let mut chamber = table.table(r, "chamber");
    let mut numbers = Vec::new();
    for quantity in PRIORS.iter().map(|p| p.quantity).filter(|q| q.is_learned()) {
        let mut own = chamber.table(r, quantity.key());
        let value = if own.is_present() { own.needed_number(r, "value", POSITIVE) } else { None };
        let error = own.number(r, error_key(quantity), Limits::between(0.0, 1e9));
        own.finish(r);
        if let Some(value) = value {
            numbers.push((quantity, in_si(quantity, Estimate { value, standard_error: error.unwrap_or(f64::NAN) })));
        }
    }
    chamber.finish(r);
    let rate = |e: Estimate| in_si(Quantity::RateNoise, e);
    present.then(|| Learned { film_w_per_m2_k, offset_rad_per_s: offset.map(rate), numbers, records })
}

fn in_si(quantity: Quantity, e: Estimate) -> Estimate {
    if !quantity.is_rate() {
        return e;
    }
    let rate = rad_per_s_from_deg_per_h;
    Estimate { value: rate(e.value), standard_error: rate(e.standard_error) }
}
