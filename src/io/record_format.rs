//! Which column of a record file is which, in which unit, and what to do with rows that are none.

use crate::record::layer_channel;
use crate::units::{
    celsius_from_fahrenheit, kelvin_from_celsius, rad_per_s_from_arcsec_per_s, rad_per_s_from_deg_per_h,
    rad_per_s_from_deg_per_s, s_from_days, s_from_h, s_from_min, s_from_ms, s_from_ns, s_from_us,
};

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnQuantity {
    /// The day of a time of day that stands in a column of its own.
    Date,
    /// When a row was written.
    Time,
    /// Of the thermometer that drives the model.
    Temperature,
    /// The gyro's rate error.
    Rate,
    /// Of a thermometer at the bore.
    InnerTemperature,
    /// Of the air outside the film.
    AmbientTemperature,
    /// What a table turned the gyro by, about its sensitive axis.
    Table,
    /// A further thermometer.
    Sensor(SensorPlace),
    /// Anything else, by its name.
    Channel,
}

/// Where a further thermometer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SensorPlace {
    /// Counted from 1 innermost.
    Layer(usize),
    /// A flange of the spool.
    Flange,
    /// The spool at the bore.
    Spool,
    /// The gyro's electronics.
    Electronics,
    /// The light source.
    Source,
}

impl SensorPlace {
    const NAMED: [(&'static str, SensorPlace); 4] = [
        ("flange", SensorPlace::Flange),
        ("spool", SensorPlace::Spool),
        ("electronics", SensorPlace::Electronics),
        ("source", SensorPlace::Source),
    ];

    /// As a mapping names it: `layer_7`, `spool`.
    pub(crate) fn named(role: &str) -> Option<Self> {
        let of_layer = role.strip_prefix("layer_").filter(|digits| !digits.starts_with(['0', '+']));
        match of_layer.and_then(|digits| digits.parse::<usize>().ok()) {
            Some(layer) => Some(SensorPlace::Layer(layer)),
            None => Self::NAMED.iter().find(|(name, _)| *name == role).map(|(_, place)| *place),
        }
    }

    /// The record's further column that holds it, in °C.
    pub(crate) fn channel(self) -> String {
        match self {
            SensorPlace::Layer(layer) => layer_channel(layer),
            other => {
                let named = Self::NAMED.iter().find(|(_, place)| *place == other).map_or("", |(name, _)| name);
                format!("temperature_{named}_c")
            }
        }
    }

    /// The roles that a mapping may name.
    pub(in crate::io) fn roles() -> impl Iterator<Item = &'static str> {
        Self::NAMED.iter().map(|(name, _)| *name)
    }
}

impl ColumnQuantity {
    /// Of a mapping's role.
    pub(in crate::io) fn of_role(role: &str) -> Option<Self> {
        let known = Self::ROLES.iter().find(|(name, _)| *name == role).map(|(_, quantity)| *quantity);
        known.or_else(|| SensorPlace::named(role).map(ColumnQuantity::Sensor))
    }

    /// As a mapping names it.
    pub(in crate::io) const ROLES: [(&'static str, ColumnQuantity); 7] = [
        ("time", ColumnQuantity::Time),
        ("temperature", ColumnQuantity::Temperature),
        ("rate", ColumnQuantity::Rate),
        ("inner", ColumnQuantity::InnerTemperature),
        ("ambient", ColumnQuantity::AmbientTemperature),
        ("table", ColumnQuantity::Table),
        ("date", ColumnQuantity::Date),
    ];

    /// The names before the unit that a header may have without a mapping.
    pub(in crate::io) const STEMS: [(&'static str, ColumnQuantity); 6] = [
        ("time", ColumnQuantity::Time),
        ("temperature", ColumnQuantity::Temperature),
        ("rate", ColumnQuantity::Rate),
        ("temperature_inner", ColumnQuantity::InnerTemperature),
        ("temperature_ambient", ColumnQuantity::AmbientTemperature),
        ("table_rate", ColumnQuantity::Table),
    ];

    pub(in crate::io) fn is_temperature(self) -> bool {
        matches!(
            self,
            ColumnQuantity::Temperature
                | ColumnQuantity::InnerTemperature
                | ColumnQuantity::AmbientTemperature
                | ColumnQuantity::Sensor(_)
        )
    }

    pub(in crate::io) fn default_unit(self) -> &'static str {
        match self {
            ColumnQuantity::Time => "s",
            ColumnQuantity::Rate => "deg_per_h",
            ColumnQuantity::Table => "deg_per_s",
            ColumnQuantity::Date | ColumnQuantity::Channel => "",
            _ => "c",
        }
    }
}

/// How a cell's number becomes SI.
#[derive(Debug, Clone, Copy)]
pub(in crate::io) enum Conversion {
    By(fn(f64) -> f64),
    /// A date and time of day.
    Stamp,
    /// Raw output, so many of them a degree an hour.
    Raw,
}

impl Conversion {
    pub(in crate::io) fn is_stamp(self) -> bool {
        matches!(self, Conversion::Stamp)
    }

    pub(in crate::io) fn is_raw(self) -> bool {
        matches!(self, Conversion::Raw)
    }
}

/// A unit that a column may be in.
pub(in crate::io) struct ColumnUnit {
    /// As a name ends with it.
    pub(in crate::io) key: &'static str,
    /// As it may stand in brackets.
    written: &'static [&'static str],
    pub(in crate::io) of: QuantityKind,
    pub(in crate::io) conversion: Conversion,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::io) enum QuantityKind {
    Time,
    Temperature,
    Rate,
}

const fn unit(
    key: &'static str,
    written: &'static [&'static str],
    of: QuantityKind,
    conversion: Conversion,
) -> ColumnUnit {
    ColumnUnit { key, written, of, conversion }
}

fn as_it_is(value: f64) -> f64 {
    value
}

fn kelvin_from_fahrenheit(value: f64) -> f64 {
    kelvin_from_celsius(celsius_from_fahrenheit(value))
}

fn rad_per_s_from_mdeg_per_h(value: f64) -> f64 {
    rad_per_s_from_deg_per_h(value / 1000.0)
}

pub(in crate::io) const UNITS: &[ColumnUnit] = &[
    unit("s", &["sec", "seconds", "epoch_s"], QuantityKind::Time, Conversion::By(as_it_is)),
    unit("ms", &["msec", "epoch_ms"], QuantityKind::Time, Conversion::By(s_from_ms)),
    unit("us", &["µs", "μs", "epoch_us"], QuantityKind::Time, Conversion::By(s_from_us)),
    unit("ns", &["epoch_ns"], QuantityKind::Time, Conversion::By(s_from_ns)),
    unit("min", &["minutes"], QuantityKind::Time, Conversion::By(s_from_min)),
    unit("h", &["hr", "hours"], QuantityKind::Time, Conversion::By(s_from_h)),
    unit("d", &["days"], QuantityKind::Time, Conversion::By(s_from_days)),
    unit("iso", &["iso8601", "utc"], QuantityKind::Time, Conversion::Stamp),
    unit("c", &["°c", "degc", "celsius"], QuantityKind::Temperature, Conversion::By(kelvin_from_celsius)),
    unit("k", &["kelvin"], QuantityKind::Temperature, Conversion::By(as_it_is)),
    unit("f", &["°f", "degf", "fahrenheit"], QuantityKind::Temperature, Conversion::By(kelvin_from_fahrenheit)),
    unit(
        "deg_per_h",
        &["°/h", "deg/h", "deg/hr", "°/hr"],
        QuantityKind::Rate,
        Conversion::By(rad_per_s_from_deg_per_h),
    ),
    unit("mdeg_per_h", &["m°/h", "mdeg/h"], QuantityKind::Rate, Conversion::By(rad_per_s_from_mdeg_per_h)),
    unit("deg_per_s", &["°/s", "deg/s", "dps"], QuantityKind::Rate, Conversion::By(rad_per_s_from_deg_per_s)),
    unit("rad_per_s", &["rad/s"], QuantityKind::Rate, Conversion::By(as_it_is)),
    unit("arcsec_per_s", &["arcsec/s", "\"/s", "″/s"], QuantityKind::Rate, Conversion::By(rad_per_s_from_arcsec_per_s)),
    unit("counts", &["bit", "bits", "lsb"], QuantityKind::Rate, Conversion::Raw),
    unit("mv", &[], QuantityKind::Rate, Conversion::Raw),
    unit("v", &["volt", "volts"], QuantityKind::Rate, Conversion::Raw),
];

impl QuantityKind {
    pub(in crate::io) fn of(quantity: ColumnQuantity) -> Option<Self> {
        match quantity {
            ColumnQuantity::Time => Some(QuantityKind::Time),
            ColumnQuantity::Rate | ColumnQuantity::Table => Some(QuantityKind::Rate),
            ColumnQuantity::Date | ColumnQuantity::Channel => None,
            _ => Some(QuantityKind::Temperature),
        }
    }

    pub(in crate::io) fn unit(self, text: &str) -> Option<&'static ColumnUnit> {
        let text = text.trim().to_lowercase();
        UNITS.iter().find(|u| u.of == self && (u.key == text || u.written.contains(&text.as_str())))
    }

    pub(in crate::io) fn accepted(self) -> String {
        UNITS.iter().filter(|u| u.of == self).map(|u| u.key).collect::<Vec<_>>().join(", ")
    }
}

/// Every name that a header may have without a mapping, quantity by quantity.
pub(crate) fn accepted_names() -> Vec<String> {
    let names = ColumnQuantity::STEMS.iter().flat_map(|(stem, quantity)| {
        let of = QuantityKind::of(*quantity);
        UNITS
            .iter()
            .filter(move |u| Some(u.of) == of && !u.conversion.is_raw())
            .map(move |u| format!("{stem}_{}", u.key))
    });
    names.collect()
}

/// One column that a mapping names.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::io) struct Mapped {
    pub(in crate::io) quantity: ColumnQuantity,
    pub(in crate::io) name: String,
    pub(in crate::io) unit: Option<&'static str>,
}

/// Which column is which, and what to do with rows that are none.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordFormat {
    pub(in crate::io) mapped: Vec<Mapped>,
    /// Raw outputs a degree an hour.
    pub(in crate::io) scale: Option<f64>,
    /// Rows with a missing cell, or with a stamp that repeats or jumps back, are skipped and counted instead of refused.
    pub skips_bad_rows: bool,
    /// So many rows are averaged into one.
    pub average_rows: usize,
    /// A compensated rate, where there is one, is the rate.
    pub compensated: bool,
}

impl Default for RecordFormat {
    fn default() -> Self {
        Self { mapped: Vec::new(), scale: None, skips_bad_rows: false, average_rows: 1, compensated: false }
    }
}

impl RecordFormat {
    /// Adds `role=column[:unit]` or `scale=number`; a role that is there already is replaced.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub(crate) fn map(&mut self, role: &str, target: &str) -> Result<(), String> {
        let (role, target) = (role.trim(), target.trim());
        if role == "scale" {
            let scale = target.replace(',', ".").parse::<f64>().ok().filter(|s| s.is_finite() && *s != 0.0);
            self.scale = Some(scale.ok_or_else(|| {
                format!("scale: expected how many raw units are one degree an hour, not 0, found \"{target}\"")
            })?);
            return Ok(());
        }
        let Some(quantity) = &ColumnQuantity::of_role(role) else {
            let sensors = ["layer_1, layer_2 and so on"].into_iter().chain(SensorPlace::roles());
            let known: Vec<&str> =
                ColumnQuantity::ROLES.iter().map(|(name, _)| *name).chain(sensors).chain(["scale"]).collect();
            return Err(format!("expected one of {}, found \"{role}\"", known.join(", ")));
        };
        let (name, unit) = match target.rsplit_once(':') {
            Some((name, unit)) if QuantityKind::of(*quantity).is_some_and(|k| k.unit(unit).is_some()) => {
                (name, Some(unit))
            }
            Some(_) if *quantity == ColumnQuantity::Date => {
                return Err(format!("{role}: expected a column's name without a unit, found \"{target}\""));
            }
            Some((_, unit)) => {
                let accepted = QuantityKind::of(*quantity).map(QuantityKind::accepted).unwrap_or_default();
                return Err(format!("{role}: expected a unit of {accepted} behind the colon, found \"{unit}\""));
            }
            None => (target, None),
        };
        if name.trim().is_empty() {
            return Err(format!("{role}: expected a column's name, found nothing"));
        }
        let unit = unit.and_then(|u| QuantityKind::of(*quantity)?.unit(u)).map(|u| u.key);
        self.mapped.retain(|m| m.quantity != *quantity);
        self.mapped.push(Mapped { quantity: *quantity, name: name.trim().to_owned(), unit });
        Ok(())
    }

    /// As [`RecordFormat::map`], of a whole list.
    ///
    /// # Errors
    /// What is wrong with the first part that is none.
    pub fn map_all(&mut self, list: &str) -> Result<(), String> {
        for part in list.split(',').filter(|p| !p.trim().is_empty()) {
            let Some((role, target)) = part.split_once('=') else {
                return Err(format!("expected role=column, such as time=Zeit, found \"{part}\""));
            };
            self.map(role, target)?;
        }
        Ok(())
    }

    /// Raw outputs that are a degree an hour, where the rate is raw.
    pub(crate) fn scale(&self) -> Option<f64> {
        self.scale
    }

    /// Whether columns that are not mapped may hold words.
    pub(crate) fn has_mapping(&self) -> bool {
        !self.mapped.is_empty()
    }
}
