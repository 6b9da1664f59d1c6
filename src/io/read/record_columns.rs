//! What the columns of a record hold: which quantity, in which unit, under which name, with which decimal sign.
//!
//! A name's ending says its unit (`temperature_k`), and so does a unit in brackets (`Omega [deg/s]`, `T1 (°F)`) or in a row below the
//! names; a mapping (`time=Zeit:min,rate=Omega`, or `[record]` in a model file) says which column is which and overrides all of them.

mod cells;

use crate::io::fault::Fault;
pub use crate::io::record_format::{ColumnQuantity, RecordFormat, SensorPlace};
use crate::io::record_format::{ColumnUnit, Conversion, QuantityKind, UNITS, accepted_names};
use crate::units::{celsius_from_kelvin, rad_per_s_from_deg_per_h};

use super::stamps::{is_stamp_pattern, seconds_of_date, seconds_of_stamp};
use super::toml_reader::{Limits, TableReader, TomlReader, nearest};

/// The `[record]` table of a model file: roles as keys, `scale`, `bad_rows`, `average_rows`.
pub(super) fn read_format(r: &mut TomlReader, table: &mut TableReader<'_>) -> RecordFormat {
    let mut format = RecordFormat::default();
    let mut stated: Vec<(String, &str)> = Vec::new();
    for role in ColumnQuantity::ROLES.iter().map(|(role, _)| *role).chain(SensorPlace::roles()) {
        stated.extend(table.text(r, role).map(|target| (role.to_owned(), target)));
    }
    for role in table.keys().into_iter().filter(|key| matches!(SensorPlace::named(key), Some(SensorPlace::Layer(_)))) {
        stated.extend(table.numbered_text(r, &role).map(|target| (role, target)));
    }
    for (role, target) in stated {
        if let Err(message) = format.map(&role, target) {
            r.fault(Fault::new(format!("record.{message}"), table.span_of(&role)));
        }
    }
    if let Some(scale) = table.number(r, "scale", Limits::between(-1e300, 1e300)) {
        if scale == 0.0 {
            let message = "record.scale: expected how many raw units are one degree an hour, found 0";
            r.fault(Fault::new(message, table.span_of("scale")));
        }
        format.scale = Some(scale);
    }
    format.skips_bad_rows = table.word(r, "bad_rows", &["refuse", "skip"]) == Some(1);
    format.average_rows = table.integer(r, "average_rows", 1, 1_000_000).map_or(1, |rows| rows as usize);
    format
}

/// One column of a record file.
#[derive(Debug, Clone)]
pub(crate) struct RecordColumn {
    pub(crate) name: String,
    pub(crate) quantity: ColumnQuantity,
    conversion: Conversion,
    scale: f64,
    decimal_comma: bool,
    /// What was assumed about its unit, for a reader.
    assumed: Option<&'static str>,
}

/// The compensated rate's column, and the one that says what happened to a row.
pub(crate) const COMPENSATED: &str = "rate_compensated_deg_per_h";
pub(crate) const FLAGS: &str = "flags";

impl ColumnQuantity {
    /// What can be measured at all, in SI and in words. Gross errors of a logger (-999, 9999999) are within; what is beyond is
    /// a damaged file, and arithmetic on it would end in infinities.
    fn bounds(self) -> (f64, &'static str) {
        match self {
            ColumnQuantity::Time => (1e11, "1e11 s from zero"),
            ColumnQuantity::Temperature
            | ColumnQuantity::InnerTemperature
            | ColumnQuantity::AmbientTemperature
            | ColumnQuantity::Sensor(_) => (1e9, "any temperature"),
            ColumnQuantity::Rate | ColumnQuantity::Table => (1e6, "any rate: 1e6 rad/s, 2e11 °/h"),
            _ => (1e30, "any reading: 1e30"),
        }
    }
}

impl RecordColumn {
    /// Of a name, and of the cell of a units' row below it.
    #[expect(
        clippy::too_many_lines,
        reason = "name, brackets, the row below and what is mapped decide together what a column is"
    )]
    fn new(name: &str, below: Option<&str>, format: &RecordFormat, decimal_comma: bool) -> Result<Self, String> {
        let mapped = format.mapped.iter().find(|m| m.name == name);
        let (bare, bracketed) = unbracketed(name);
        let beside = bracketed.or(below.map(unit_in_cell));
        let of_name = ColumnQuantity::STEMS.iter().find_map(|(stem, quantity)| {
            let ending = bare.strip_prefix(stem)?.strip_prefix('_');
            let kind = QuantityKind::of(*quantity)?;
            match ending {
                Some(ending) => kind.unit(ending).filter(|u| u.key == ending).map(|u| (*quantity, u)),
                None => beside.and_then(|b| unit_beside(kind, b)).map(|u| (*quantity, u)),
            }
        });
        let of_sensor = || {
            let ended = || {
                let (place, unit) = bare.strip_prefix("temperature_")?.rsplit_once('_')?;
                Some((place, QuantityKind::Temperature.unit(unit).filter(|u| u.key == unit)?))
            };
            let stated = |unit| Some((bare.strip_prefix("temperature_")?, QuantityKind::Temperature.unit(unit)?));
            let (place, unit) = match bracketed {
                Some(unit) => stated(unit)?,
                None => ended().or_else(|| stated(beside?))?,
            };
            Some((ColumnQuantity::Sensor(SensorPlace::named(place)?), unit))
        };
        let of_name = of_name.or_else(of_sensor);
        // A quantity that is mapped elsewhere does not come from this name.
        let of_name =
            of_name.filter(|(quantity, _)| mapped.is_some() || format.mapped.iter().all(|m| m.quantity != *quantity));
        let quantity = mapped.map_or_else(|| of_name.map_or(ColumnQuantity::Channel, |(q, _)| q), |m| m.quantity);
        let mut assumed = None;
        let conversion = match QuantityKind::of(quantity) {
            None => Conversion::By(|value| value),
            Some(kind) => {
                let stated = mapped.and_then(|m| m.unit).and_then(|u| kind.unit(u));
                let ending = || {
                    let fits = |u: &&ColumnUnit| u.of == kind && bare.ends_with(&format!("_{}", u.key));
                    UNITS.iter().filter(fits).max_by_key(|u| u.key.len())
                };
                let own = bracketed.and_then(|b| kind.unit(b)).or_else(ending);
                let row = below.and_then(|cell| unit_beside(kind, unit_in_cell(cell)));
                if let (None, Some(own), Some(row)) = (stated, own, row)
                    && own.key != row.key
                {
                    return Err(format!(
                        "column {name} is in {} by its name and in {} by the row below it: leave one out, or say which with a unit in --columns",
                        own.key, row.key
                    ));
                }
                let known = stated.or(own).or(row);
                if let (None, Some(unknown)) = (known, bracketed) {
                    return Err(format!(
                        "column {name} is in {unknown}, which is no unit of it that is known: say which it is with a unit in --columns, as rate=its name:deg_per_h"
                    ));
                }
                if known.is_none() {
                    assumed = Some(quantity.default_unit());
                }
                known
                    .or_else(|| kind.unit(quantity.default_unit()))
                    .map_or(Conversion::By(|value| value), |u| u.conversion)
            }
        };
        if quantity == ColumnQuantity::Table && conversion.is_raw() {
            return Err(format!(
                "column {name} is the table's rate: expected deg_per_s, deg_per_h, rad_per_s or arcsec_per_s"
            ));
        }
        let scale = match (conversion, format.scale) {
            (Conversion::Raw, None) => {
                return Err(format!(
                    "column {name} holds raw output: expected how many of its units are one degree an hour, as scale=12.5 in --columns or [record]"
                ));
            }
            (_, scale) => scale.unwrap_or(1.0),
        };
        Ok(Self { name: name.to_owned(), quantity, conversion, scale, decimal_comma, assumed })
    }

    /// Whether its cells are dates or times.
    pub(crate) fn holds_stamps(&self) -> bool {
        self.conversion.is_stamp() || self.quantity == ColumnQuantity::Date
    }

    pub(crate) fn is_temperature(&self) -> bool {
        self.quantity.is_temperature()
    }

    /// Under which name a record keeps it as a further column, if it does.
    pub(crate) fn channel(&self) -> Option<String> {
        match self.quantity {
            ColumnQuantity::Channel => Some(self.name.clone()),
            ColumnQuantity::Sensor(place) => Some(place.channel()),
            _ => None,
        }
    }

    /// A value in SI as that column holds it.
    pub(crate) fn in_channel(&self, value: f64) -> f64 {
        if self.is_temperature() { celsius_from_kelvin(value) } else { value }
    }

    /// The unit that was taken because nothing stated one.
    pub(crate) fn assumed_unit(&self) -> Option<&'static str> {
        self.assumed
    }
}

/// A unit as a row below the names states it.
fn unit_in_cell(cell: &str) -> &str {
    let cell = cell.trim();
    let inside =
        [('[', ']'), ('(', ')')].into_iter().find_map(|(open, close)| cell.strip_prefix(open)?.strip_suffix(close));
    inside.unwrap_or(cell).trim()
}

/// Of a kind; a pattern of stamps (`hh:mm:ss`) is a unit of times.
fn unit_beside(kind: QuantityKind, text: &str) -> Option<&'static ColumnUnit> {
    kind.unit(text).or_else(|| kind.unit("iso").filter(|_| is_stamp_pattern(text)))
}

/// The unit of a time of day that has its date in a column of its own, both under these names.
fn of_day<'c>(name: &str, fields: &[&str]) -> Option<&'c str> {
    (name == "time" && fields.contains(&"date")).then_some("iso")
}

/// Whether a row below names states the units of the columns, and is none of numbers.
pub(super) fn states_units(names: &[&str], cells: &[&str], format: &RecordFormat, division: Division) -> bool {
    let mut stated = 0;
    let is_one = |(name, cell): (&&str, &&str)| {
        let cell = unit_in_cell(cell);
        let column = RecordColumn::new(name, None, format, division.decimal_comma);
        let column = column.ok().filter(|c| c.quantity != ColumnQuantity::Channel);
        let quantity = column.or_else(|| RecordColumn::new(name, Some(cell), format, division.decimal_comma).ok());
        match quantity.and_then(|c| QuantityKind::of(c.quantity)) {
            Some(kind) if unit_beside(kind, cell).is_some() => {
                stated += 1;
                true
            }
            Some(_) => ["", "-"].contains(&cell),
            None => {
                cell.parse::<f64>().is_err()
                    && (!division.decimal_comma || cell.replace(',', ".").parse::<f64>().is_err())
            }
        }
    };
    names.len() == cells.len() && names.iter().zip(cells).all(is_one) && stated > 0
}

/// Whether cells are a row of numbers and stamps, above which the names must have been.
pub(super) fn are_numbers(cells: &[&str], division: Division) -> bool {
    let is_number = |cell: &str| {
        let pointed = if division.decimal_comma { cell.replace(',', ".") } else { cell.to_owned() };
        pointed.parse::<f64>().is_ok() || seconds_of_stamp(&pointed).is_some() || seconds_of_date(cell).is_some()
    };
    let mut filled = cells.iter().filter(|cell| !cell.is_empty()).peekable();
    filled.peek().is_some() && cells.len() > 1 && filled.all(|cell| is_number(cell))
}

/// A name without a unit in brackets at its end, and that unit.
fn unbracketed(name: &str) -> (&str, Option<&str>) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some(inside) = name.strip_suffix(close)
            && let Some((bare, unit)) = inside.rsplit_once(open)
        {
            return (bare.trim(), Some(unit.trim()));
        }
    }
    (name, None)
}

/// How a file's cells are divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Division {
    /// The byte between two cells.
    pub separator: u8,
    pub(crate) decimal_comma: bool,
}

impl Division {
    /// As the header shows it: semicolons or tabs where there are any outside of quotes, bars where there is nothing else, then
    /// decimals may have commas.
    pub fn of_header(line: &str) -> Self {
        let count =
            |separator: char| -> usize { line.split('"').step_by(2).map(|bare| bare.matches(separator).count()).sum() };
        let separator: u8 = match (count(';'), count('\t'), count('|')) {
            (0, 0, 1..) if count(',') == 0 => b'|',
            (0, 0, _) => b',',
            (0, _, _) => b'\t',
            _ => b';',
        };
        Self { separator, decimal_comma: separator != b',' }
    }
}

/// What the header of a record says, faults included; `units` are the cells of a row below it, where there is one.
///
/// # Errors
/// Every fault of the header, as a message and a remedy.
pub(crate) fn read_header(
    fields: &[&str],
    units: &[String],
    format: &RecordFormat,
    division: Division,
) -> Result<Vec<RecordColumn>, Vec<(String, Option<String>)>> {
    columns_of(fields, units, format, division).map_err(|faults| {
        let instead = if is_toml(fields) {
            MODEL_GIVEN
        } else if are_numbers(fields, division) {
            NO_NAMES
        } else if is_divided_by_spaces(fields) {
            SPACES
        } else {
            return faults;
        };
        vec![(instead.to_owned(), None)]
    })
}

const MODEL_GIVEN: &str = "this is a model file, no record: the model comes first, then the records (CSV)";

const NO_NAMES: &str = "the first line holds numbers where the columns' names are expected: put a line such as time_s,temperature_c,rate_deg_per_h above it";
const SPACES: &str =
    "expected commas, semicolons, tabs or bars between columns, found spaces: write one of them between the columns";

/// Whether a head is one cell of several words, such as those of a table that is set in columns by spaces.
fn is_divided_by_spaces(fields: &[&str]) -> bool {
    // A time, a temperature and a rate.
    matches!(fields, [one] if one.split_whitespace().count() >= 3)
}

/// Whether what stands in a header's place begins a TOML file: a table, or a key with its value.
fn is_toml(fields: &[&str]) -> bool {
    let first = fields.first().map_or("", |field| field.trim());
    first.starts_with('[') || first.split_once('=').is_some_and(|(key, value)| !key.is_empty() && !value.is_empty())
}

fn columns_of(
    fields: &[&str],
    units: &[String],
    format: &RecordFormat,
    division: Division,
) -> Result<Vec<RecordColumn>, Vec<(String, Option<String>)>> {
    let mut faults = Vec::new();
    let mut columns: Vec<RecordColumn> = Vec::with_capacity(fields.len());
    let is_mapped = |quantity| format.mapped.iter().any(|m| m.quantity == quantity);
    let has_date = !is_mapped(ColumnQuantity::Time) && !is_mapped(ColumnQuantity::Date);
    for (place, field) in fields.iter().enumerate() {
        let below = units.get(place).map(String::as_str);
        let of_day = of_day(field, fields).filter(|_| has_date);
        match RecordColumn::new(field, of_day.or(below), format, division.decimal_comma) {
            Ok(column) => columns.push(column),
            Err(message) => faults.push((message, None)),
        }
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    if has_date && let Some(date) = columns.iter_mut().find(|c| c.name == "date" && fields.contains(&"time")) {
        date.quantity = ColumnQuantity::Date;
    }
    if format.compensated && format.mapped.iter().all(|m| m.quantity != ColumnQuantity::Rate) {
        prefer_compensated(&mut columns);
    }
    for mapped in format.mapped.iter().filter(|m| columns.iter().all(|c| c.name != m.name)) {
        let meant = nearest(&mapped.name, fields).map(|near| format!("did you mean {near}?"));
        let found = fields.join(", ");
        faults.push((format!("column {} is mapped, but the header has {found}", mapped.name), meant));
    }
    for (i, column) in columns.iter().enumerate() {
        if column.name.is_empty() {
            faults.push((
                format!(
                    "column {} has no name: expected one such as supply_v, or no separator behind the last column",
                    i + 1
                ),
                None,
            ));
        } else if let Some(fault) = crate::text::name_fault(&column.name) {
            faults.push((format!("column {}: its name {fault}", i + 1), None));
        } else if columns[..i].iter().any(|c| c.name == column.name) {
            faults.push((format!("column {} is there twice: give each column a name of its own", column.name), None));
        } else if column.quantity != ColumnQuantity::Channel
            && let Some(other) = columns[..i].iter().find(|c| c.quantity == column.quantity)
        {
            faults.push((format!("columns {} and {} hold the same: leave one out", other.name, column.name), None));
        }
    }
    faults.extend(missing(&columns));
    if faults.is_empty() { Ok(columns) } else { Err(faults) }
}

/// The compensated rate takes the place of the raw one.
fn prefer_compensated(columns: &mut [RecordColumn]) {
    let Some(place) = columns.iter().position(|c| c.name == COMPENSATED) else { return };
    for column in columns.iter_mut().filter(|c| c.quantity == ColumnQuantity::Rate) {
        column.quantity = ColumnQuantity::Channel;
        column.conversion = Conversion::By(|value| value);
    }
    columns[place].quantity = ColumnQuantity::Rate;
    columns[place].conversion = Conversion::By(rad_per_s_from_deg_per_h);
}

fn missing(columns: &[RecordColumn]) -> Vec<(String, Option<String>)> {
    let mut faults = Vec::new();
    for (quantity, wanted) in [
        (ColumnQuantity::Time, "time_s"),
        (ColumnQuantity::Temperature, "temperature_c"),
        (ColumnQuantity::Rate, "rate_deg_per_h"),
    ] {
        if columns.iter().any(|c| c.quantity == quantity) {
            continue;
        }
        let stem = wanted.split('_').next().unwrap_or(wanted);
        let own: Vec<String> = accepted_names()
            .into_iter()
            .filter(|n| {
                n.starts_with(stem) && !n.starts_with("temperature_inner") && !n.starts_with("temperature_ambient")
            })
            .collect();
        let accepted: Vec<&str> = own.iter().map(String::as_str).collect();
        let others = columns.iter().filter(|c| c.quantity == ColumnQuantity::Channel);
        let meant = others.map(|c| c.name.as_str()).find(|n| n.starts_with(stem) || nearest(n, &accepted).is_some());
        let found = meant.map_or_else(|| "none of them".to_owned(), str::to_owned);
        let message = format!("column {wanted} is missing: expected one of {}, found {found}", accepted.join(", "));
        let remedy = meant.unwrap_or("its name");
        faults.push((message, Some(format!("say which column it is: --columns {stem}={remedy}"))));
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(header: &str, mapping: &str, cell: &str) -> f64 {
        let mut format = RecordFormat::default();
        format.map_all(mapping).unwrap();
        RecordColumn::new(header, None, &format, true).unwrap().value(cell).unwrap()
    }

    #[test]
    fn units_come_from_the_mapping_the_brackets_or_the_ending() {
        assert_eq!(value("Zeit", "time=Zeit:min", "2,5"), 150.0);
        assert_eq!(value("Zeit [h]", "time=Zeit [h]", "2"), 7200.0);
        assert!((value("T1 (°F)", "temperature=T1 (°F)", "68") - 293.15).abs() < 1e-12);
        assert!((value("temperature_f", "", "-40") - 233.15).abs() < 1e-12);
        assert!((value("w", "rate=w:arcsec_per_s", "1") / 1f64.to_radians() * 3600.0 - 1.0).abs() < 1e-12);
        assert!((value("F", "rate=F:counts,scale=12.5", "25") / rad_per_s_from_deg_per_h(2.0) - 1.0).abs() < 1e-12);
        assert_eq!(value("t", "time=t:epoch_ms", "1500"), 1.5);
    }

    #[test]
    fn stamps_with_and_without_a_zone_are_seconds() {
        let at = |text: &str| value("stamp", "time=stamp:iso", text);
        assert_eq!(at("2026-01-02T00:00:00Z") - at("2026-01-01T23:59:58.5Z"), 1.5);
        assert_eq!(at("2026-01-02 01:00:00+01:00"), at("2026-01-02T00:00:00"));
        assert_eq!(at("02.01.2026 00:00:00,5"), at("2026-01-02T00:00:00.5"));
        assert_eq!(at("2026/1/2 00:00:01"), at("2026-01-02T00:00:01Z"));
        assert_eq!((at("10:00:00.5"), at("7:05")), (36_000.5, 25_500.0));
        let format = &mut RecordFormat::default();
        format.map_all("time=stamp:iso").unwrap();
        // Which of the two is the month, nobody knows.
        for unknown in ["03/01/2026 10:00:00", "1:2:3:4", "10:61:00", "yesterday"] {
            assert!(RecordColumn::new("stamp", None, format, false).unwrap().value(unknown).is_err(), "{unknown}");
        }
    }

    #[test]
    fn what_cannot_be_mapped_is_said() {
        let mut format = RecordFormat::default();
        for (list, wanted) in [
            ("tmie=x", "expected one of time"),
            ("time", "expected role=column"),
            ("rate=x:furlongs", "expected a unit of deg_per_h"),
            ("scale=0", "not 0"),
        ] {
            assert!(format.map_all(list).unwrap_err().contains(wanted), "{list}");
        }
        assert!(
            RecordColumn::new(
                "F [mV]",
                None,
                &{
                    let mut f = RecordFormat::default();
                    f.map_all("rate=F [mV]").unwrap();
                    f
                },
                false
            )
            .unwrap_err()
            .contains("scale")
        );
    }
}
