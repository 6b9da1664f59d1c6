//! Numbers in words of a terminal: as many digits as mean something.

/// Digits of a number whose error nobody states.
const USUAL_DIGITS: i32 = 6;
/// Decimals after which a number of any unit in use here is nothing.
const MOST_DECIMALS: i32 = 9;
/// Digits of an error.
const ERROR_DIGITS: i32 = 2;

/// The place of a number's first digit: 0 of ones, 1 of tens, -1 of tenths.
fn magnitude(value: f64) -> i32 {
    value.abs().log10().floor() as i32
}

fn with_decimals(value: f64, decimals: i32) -> String {
    let text = format!("{value:.places$}", places = decimals.clamp(0, MOST_DECIMALS) as usize);
    if text.chars().any(|c| ('1'..='9').contains(&c)) { text } else { text.trim_start_matches('-').to_owned() }
}

/// To six digits, without the zeros behind them; what is less than 1e-9 is 0.
pub(crate) fn usual(value: f64) -> String {
    if value.abs() < 10f64.powi(-MOST_DECIMALS) {
        return "0".to_owned();
    }
    let text = with_decimals(value, USUAL_DIGITS - 1 - magnitude(value));
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// As far as it is known: the error to two digits, and all to its decimals.
pub(crate) fn known<const N: usize>(values: [f64; N], error: f64) -> [String; N] {
    if !(error > 0.0 && error.is_finite()) {
        return values.map(usual);
    }
    values.map(|value| with_decimals(value, ERROR_DIGITS - 1 - magnitude(error)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_mean_something() {
        for (value, expected) in [
            (9.999_999_9, "10"),
            (0.016_666_666, "0.0166667"),
            (-7.520_534_1, "-7.52053"),
            (123_456.78, "123457"),
            (12_345_678.0, "12345678"),
            (1.78e-46, "0"),
            (-1e-12, "0"),
            (0.0, "0"),
            (1e-6, "0.000001"),
        ] {
            assert_eq!(usual(value), expected);
        }
        assert_eq!(known([0.016_667_2, 0.015_8, 0.017_1], 0.000_65), ["0.01667", "0.01580", "0.01710"]);
        assert_eq!(known([1234.5, 1100.0], 120.0), ["1234", "1100"]);
        assert_eq!(known([-0.000_01, 0.2], 0.1), ["0.00", "0.20"]);
        assert_eq!(known([2.0], 0.0), ["2"]);
    }
}
