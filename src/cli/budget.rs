//! Durations as people write them: `30s`, `2m`, `1h`, `500ms`, or a plain number of seconds.

use std::time::Duration;

use crate::units::{s_from_h, s_from_min};

/// The longest that a command accepts: a year or so, in seconds. More is a slip of the keyboard.
const LONGEST_S: f64 = 3.2e7;

/// Reads a duration, for clap.
///
/// # Errors
/// In words, what was expected.
pub(crate) fn parse_duration(text: &str) -> Result<Duration, String> {
    let number_end = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let (number, unit) = text.split_at(number_end);
    let expected = || format!("expected a duration such as 30s, 2m, 1h or 500ms, found \"{text}\"");
    let stated: f64 = number.parse().map_err(|_| expected())?;
    let seconds = match unit {
        "s" | "" => stated,
        "m" | "min" => s_from_min(stated),
        "h" => s_from_h(stated),
        "ms" => stated * Duration::from_millis(1).as_secs_f64(),
        _ => return Err(expected()),
    };
    if !(seconds > 0.0 && seconds <= LONGEST_S) {
        return Err(format!("expected a duration above zero and below a year, found \"{text}\""));
    }
    Ok(Duration::from_secs_f64(seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_read_in_every_unit_and_anything_else_is_refused() {
        let seconds = |text| parse_duration(text).map(|d| d.as_secs_f64());
        assert_eq!(seconds("30s"), Ok(30.0));
        assert_eq!(seconds("2m"), Ok(120.0));
        assert_eq!(seconds("1h"), Ok(3600.0));
        assert_eq!(seconds("500ms"), Ok(0.5));
        assert_eq!(seconds("1.5"), Ok(1.5));
        for wrong in ["", "s", "-1s", "0s", "1d", "nan", "inf", "1e9s", "99999999999h"] {
            assert!(parse_duration(wrong).is_err(), "{wrong}");
        }
    }
}
