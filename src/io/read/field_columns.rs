//! What the columns of a temperature field's file hold: which quantity, of which layer, in which unit.
//!
//! Wide: `time_s, layer_1_c, …, layer_12_c`, one row a time. Long: `time_s, layer, temperature_c`, one row a time and layer,
//! or with `turn` one a turn.

use crate::io::record_format::{Conversion, QuantityKind};
use crate::units::{k_per_s_from_c_per_h, k_per_s_from_c_per_min};

/// What a column of a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Holds {
    Time,
    /// The number of a layer, counted from 1 innermost.
    Layer,
    /// The number of a turn within its layer, counted from 1 at the first flange.
    Turn,
    /// Of a layer and turn that the row names.
    Temperature,
    Rate,
    Ambient,
    AmbientRate,
    /// Of the layer of this index.
    OfLayer(usize),
    RateOfLayer(usize),
    MomentOfLayer(usize),
    MomentRateOfLayer(usize),
}

/// A column that is read.
#[derive(Debug, Clone, Copy)]
pub(super) struct FieldColumn {
    pub(crate) holds: Holds,
    /// Among the file's columns.
    pub(crate) place: usize,
    conversion: Unit,
}

#[derive(Debug, Clone, Copy)]
enum Unit {
    Number,
    Temperature(Conversion),
    Time(Conversion),
    Rate(fn(f64) -> f64),
}

/// As a name ends with it, as it stands in brackets, and how it becomes K/s.
type RateUnit = (&'static [&'static str], fn(f64) -> f64);

const RATE_UNITS: [RateUnit; 3] = [
    (&["k_per_s", "c_per_s", "k/s", "°c/s", "degc/s"], |rate| rate),
    (&["c_per_min", "k_per_min", "°c/min", "k/min", "degc/min"], k_per_s_from_c_per_min),
    (&["c_per_h", "k_per_h", "°c/h", "k/h", "degc/h"], k_per_s_from_c_per_h),
];

/// The largest number of a layer that a file may name.
const MOST_LAYERS: usize = 10_000;

fn rate_unit(unit: &str) -> Option<Unit> {
    RATE_UNITS.iter().find(|(keys, _)| keys.contains(&unit)).map(|(_, to_si)| Unit::Rate(*to_si))
}

fn temperature_unit(unit: &str) -> Option<Unit> {
    QuantityKind::Temperature.unit(unit).map(|u| Unit::Temperature(u.conversion))
}

impl FieldColumn {
    /// None for a column that is no part of a field.
    pub(crate) fn of(name: &str, place: usize) -> Option<Self> {
        let lower = name.trim().to_lowercase();
        let (bare, unit) = match lower.strip_suffix([')', ']']).and_then(|open| open.rsplit_once(['(', '['])) {
            Some((bare, unit)) => (bare.trim().replace(' ', "_"), unit.trim().to_owned()),
            None => (lower.replace(' ', "_"), String::new()),
        };
        // The unit stands in brackets or behind the stem.
        let behind = |stem: &str| -> Option<String> {
            let rest = bare.strip_prefix(stem)?;
            if unit.is_empty() {
                Some(rest.strip_prefix('_')?.to_owned())
            } else {
                rest.is_empty().then(|| unit.clone())
            }
        };
        let (holds, conversion) = match bare.as_str() {
            "layer" => (Holds::Layer, Unit::Number),
            "turn" => (Holds::Turn, Unit::Number),
            _ => numbered(&bare, &unit).or_else(|| {
                let time =
                    behind("time").and_then(|u| QuantityKind::Time.unit(&u)).filter(|u| !u.conversion.is_stamp());
                time.map(|u| (Holds::Time, Unit::Time(u.conversion)))
                    .or_else(|| Some((Holds::Temperature, temperature_unit(&behind("temperature")?)?)))
                    .or_else(|| Some((Holds::Ambient, temperature_unit(&behind("ambient")?)?)))
                    .or_else(|| Some((Holds::Rate, rate_unit(&behind("rate")?)?)))
                    .or_else(|| Some((Holds::AmbientRate, rate_unit(&behind("ambient")?)?)))
            })?,
        };
        Some(Self { holds, place, conversion })
    }

    /// A number as it stands, in SI.
    pub(crate) fn si(&self, value: f64) -> f64 {
        match self.conversion {
            Unit::Number => value,
            Unit::Rate(to_si) => to_si(value),
            Unit::Temperature(Conversion::By(to_si)) | Unit::Time(Conversion::By(to_si)) => to_si(value),
            Unit::Temperature(_) | Unit::Time(_) => value,
        }
    }
}

/// `layer_3_c`, `Mean temperature, layer 3 (K)`, `layer_3_c_per_h`, `moment_3_k`, `moment_3_k_per_s`.
fn numbered(bare: &str, bracketed: &str) -> Option<(Holds, Unit)> {
    let (is_layer, rest) = match bare.rfind("layer_") {
        Some(at) => (true, &bare[at + "layer_".len()..]),
        None => (false, bare.strip_prefix("moment_")?),
    };
    let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    let layer = rest[..digits].parse::<usize>().ok().filter(|layer| (1..=MOST_LAYERS).contains(layer))? - 1;
    let unit = match rest[digits..].strip_prefix('_') {
        Some(unit) if bracketed.is_empty() => unit,
        None if rest.len() == digits => bracketed,
        _ => return None,
    };
    // A moment is a difference of temperatures: kelvins and degrees Celsius are the same.
    let kelvins = matches!(unit, "k" | "c" | "°c" | "degc").then_some(Unit::Number);
    match is_layer {
        true => temperature_unit(unit)
            .map(|u| (Holds::OfLayer(layer), u))
            .or_else(|| rate_unit(unit).map(|u| (Holds::RateOfLayer(layer), u))),
        false => kelvins
            .map(|u| (Holds::MomentOfLayer(layer), u))
            .or_else(|| rate_unit(unit).map(|u| (Holds::MomentRateOfLayer(layer), u))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_quantity_layer_and_unit() {
        let of = |name: &str| FieldColumn::of(name, 0).map(|c| (c.holds, c.si(36.0)));
        assert_eq!(of("time_min"), Some((Holds::Time, 2160.0)));
        assert_eq!(of("Time (s)"), Some((Holds::Time, 36.0)));
        assert_eq!(of("layer_12_k"), Some((Holds::OfLayer(11), 36.0)));
        assert_eq!(of("Average temperature, layer 2 (degC)"), Some((Holds::OfLayer(1), 309.15)));
        assert_eq!(of("layer_1_c_per_h"), Some((Holds::RateOfLayer(0), 0.01)));
        assert_eq!(of("moment_1_k_per_s"), Some((Holds::MomentRateOfLayer(0), 36.0)));
        assert_eq!(of("moment_3_k"), Some((Holds::MomentOfLayer(2), 36.0)));
        assert_eq!(of("Layer"), Some((Holds::Layer, 36.0)));
        assert_eq!(of("temperature [K]"), Some((Holds::Temperature, 36.0)));
        assert_eq!(of("ambient_c"), Some((Holds::Ambient, 309.15)));
        assert_eq!(of("rate_k_per_s"), Some((Holds::Rate, 36.0)));
        for other in ["node", "layer_0_c", "layer_1", "time", "temperature_r", "layer_1_c_per_year", "x [m]"] {
            assert_eq!(of(other), None, "{other}");
        }
    }
}
