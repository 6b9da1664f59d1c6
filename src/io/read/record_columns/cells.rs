//! What a cell of a record's column says, what it must be, and what helps where it is not.

use std::ops::Range;

use super::{ColumnQuantity, Conversion, RecordColumn};
use crate::io::read::stamps::{DATES, STAMPS, seconds_of_date, seconds_of_stamp};
use crate::units::rad_per_s_from_deg_per_h;

/// No time in seconds is as large as these; the years 1973 to 5138 in milliseconds and microseconds since 1970 are.
const EPOCH_MS: Range<f64> = 1e11..1e14;
const EPOCH_US: Range<f64> = 1e14..1e17;

impl RecordColumn {
    /// A field as a number in SI.
    ///
    /// # Errors
    /// What was found instead, in words.
    pub(crate) fn value(&self, field: &str) -> Result<f64, String> {
        let found = || match field.is_empty() {
            true => "nothing".to_owned(),
            false => format!("\"{}\"", field.chars().take(40).collect::<String>()),
        };
        if self.quantity == ColumnQuantity::Date {
            return seconds_of_date(field).ok_or_else(&found);
        }
        if self.conversion.is_stamp() || (self.quantity == ColumnQuantity::Time && field.contains(':')) {
            let stated = if self.decimal_comma { field.replace(',', ".") } else { field.to_owned() };
            return seconds_of_stamp(&stated).ok_or_else(&found);
        }
        let value = self.number(field).ok_or_else(found)?;
        let si = match self.conversion {
            Conversion::By(to_si) => to_si(value),
            Conversion::Raw => rad_per_s_from_deg_per_h(value / self.scale),
            Conversion::Stamp => value,
        };
        let (most, words) = self.quantity.bounds();
        if si.abs() <= most { Ok(si) } else { Err(format!("{value:e}, beyond {words}")) }
    }

    /// As it is written: with a typographer's minus and an exponent in Fortran's letter, too.
    fn number(&self, field: &str) -> Option<f64> {
        let has_comma = self.decimal_comma && field.matches(',').count() == 1 && !field.contains('.');
        let parsed = if has_comma { field.replace(',', ".").parse::<f64>() } else { field.parse::<f64>() };
        let number = parsed.or_else(|fault| {
            let is_exponent = field.bytes().any(|b| b.is_ascii_digit()) && !field.starts_with(['d', 'D']);
            let usual = field.replace('\u{2212}', "-").replace(',', if has_comma { "." } else { "," });
            let usual = if is_exponent { usual.replace(['d', 'D'], "e") } else { usual };
            if usual == field { Err(fault) } else { usual.parse::<f64>() }
        });
        number.ok().filter(|v| v.is_finite())
    }

    /// What helps where a cell cannot be read.
    pub(crate) fn remedy(&self, field: &str) -> &'static str {
        let is_apart = |c: char| ",' \u{a0}\u{202f}\u{2019}".contains(c);
        let joined: String = field.chars().filter(|c| !is_apart(*c)).collect();
        let is_time = self.quantity == ColumnQuantity::Time;
        match field.parse::<f64>() {
            Ok(since) if is_time && EPOCH_MS.contains(&since) => {
                "stamps in milliseconds since 1970? say so: --columns time=its name:epoch_ms"
            }
            Ok(since) if is_time && EPOCH_US.contains(&since) => {
                "stamps in microseconds since 1970? say so: --columns time=its name:epoch_us"
            }
            Ok(since) if is_time && since >= EPOCH_US.end => {
                "stamps in nanoseconds since 1970? say so: --columns time=its name:epoch_ns"
            }
            Err(_) if joined != field && joined.parse::<f64>().is_ok() => {
                "write numbers without anything between their thousands"
            }
            _ => "leave out rows in which a sensor failed, or skip them: --bad-rows skip",
        }
    }

    /// What its cells must be, in words.
    pub(crate) fn expected(&self) -> &'static str {
        match self.quantity {
            ColumnQuantity::Date => DATES,
            _ if self.conversion.is_stamp() => STAMPS,
            _ => "expected a finite number",
        }
    }
}
