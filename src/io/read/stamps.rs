//! Dates and times of day as loggers write them.

use crate::units::{s_from_h, s_from_min, s_from_ns};

/// What a stamp may look like.
pub(super) const STAMPS: &str = "expected a stamp such as 2026-03-01T10:00:00.5Z, 2026-03-01 10:00:00, 01.03.2026 10:00:00, 2026/03/01 10:00:00 or a time of day 10:00:00.5";

/// Seconds of a time of day; past midnight they begin again.
fn seconds_of_day(field: &str) -> Option<f64> {
    let mut parts = field.split(':');
    let (hours, minutes, seconds) = (parts.next()?, parts.next()?, parts.next().unwrap_or("0"));
    let is_digits = |part: &str| (1..=2).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
    if parts.next().is_some()
        || !is_digits(hours)
        || !is_digits(minutes)
        || !seconds.starts_with(|c: char| c.is_ascii_digit())
    {
        return None;
    }
    let whole = |part: &str, below: f64| part.parse::<f64>().ok().filter(|v| (0.0..below).contains(v));
    // Hours of a stop watch go beyond a day's.
    Some(s_from_h(whole(hours, 100.0)?) + s_from_min(whole(minutes, 60.0)?) + whole(seconds, 61.0)?)
}

/// With the date as ISO 8601 has it: of day, month and year between dots, and of what slashes divide where the year comes first.
fn with_iso_date(field: &str) -> Option<String> {
    let (date, time) = field.split_once([' ', 'T'])?;
    let parts = |sign: char| -> Option<[&str; 3]> { date.split(sign).collect::<Vec<_>>().try_into().ok() };
    let (year, month, day) = match (parts('.'), parts('/')) {
        (Some([day, month, year]), _) => (year, month, day),
        (None, Some([year, month, day])) => (year, month, day),
        _ => return None,
    };
    (year.len() == 4).then(|| format!("{year}-{month:0>2}-{day:0>2}T{}", time.trim()))
}

/// Seconds since 1970 of a stamp, or since midnight; without a zone it is taken as UTC, which cancels in a record.
pub(super) fn seconds_of_stamp(field: &str) -> Option<f64> {
    if let Some(seconds) = seconds_of_day(field) {
        return Some(seconds);
    }
    let other = with_iso_date(field);
    let field = other.as_deref().unwrap_or(field);
    let stamp = match field.parse::<jiff::Timestamp>() {
        Ok(stamp) => stamp,
        Err(_) => field.parse::<jiff::civil::DateTime>().ok()?.to_zoned(jiff::tz::TimeZone::UTC).ok()?.timestamp(),
    };
    // Whole seconds stay whole.
    Some(stamp.as_second() as f64 + s_from_ns(f64::from(stamp.subsec_nanosecond())))
}

/// What a date beside a time of day may look like.
pub(super) const DATES: &str = "expected a date such as 2026-03-01, 01.03.2026 or 2026/03/01";

/// Seconds since 1970 at a date's midnight.
pub(super) fn seconds_of_date(field: &str) -> Option<f64> {
    let is_date = !field.contains([':', ' ', 'T']);
    is_date.then(|| seconds_of_stamp(&format!("{field} 00:00:00"))).flatten()
}

/// Whether a cell below a column's name is a pattern of stamps (`hh:mm:ss`, `dd.mm.yyyy HH:MM`), as some loggers put it there.
pub(super) fn is_stamp_pattern(cell: &str) -> bool {
    let cell = cell.to_lowercase();
    let is_pattern = cell.chars().all(|c| "ymdthsfz.,:-/ ".contains(c));
    is_pattern && (cell.contains("hh:mm") || cell.contains("yyyy"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_their_midnights_and_nothing_else_is_one() {
        let day = seconds_of_stamp("2026-03-01T00:00:00Z").unwrap();
        for date in ["2026-03-01", "01.03.2026", "1.3.2026", "2026/03/01", "20260301"] {
            assert_eq!(seconds_of_date(date), Some(day), "{date}");
        }
        // Which of the two is the month, nobody knows.
        for other in ["03/01/2026", "2026-03-01 10:00:00", "2026-02-30", "10:00:00", ""] {
            assert_eq!(seconds_of_date(other), None, "{other}");
        }
        assert!(is_stamp_pattern("hh:mm:ss.fff") && is_stamp_pattern("DD.MM.YYYY hh:mm:ss") && !is_stamp_pattern("s"));
    }
}
