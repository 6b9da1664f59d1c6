//! Finds numbers and calls that convert units: only `units` may hold them.

use crate::source::{Token, path_after};

/// Numbers and calls that convert units, with their lines.
pub fn conversions(tokens: &[Token]) -> Vec<(String, usize)> {
    let mut found = Vec::new();
    for (i, token) in tokens.iter().enumerate() {
        let text = token.text.as_str();
        let near = |offset: isize| {
            i.checked_add_signed(offset).and_then(|at| tokens.get(at)).map_or("", |other| other.text.as_str())
        };
        let converts = match number(text) {
            Some(value) => {
                let always = [3600.0, 86400.0, 273.15, 1.0 / 3600.0].contains(&value);
                let angle = value == 180.0
                    && (path_end(tokens, i + 2) == Some("PI") && near(1) == "/" || near(-1) == "/" && near(-2) == "PI");
                let scale = [1e3, 1e6, 1e9, 1e-3, 1e-6, 1e-9, 60.0].contains(&value);
                always || angle || (scale && scales_a_quantity(tokens, i))
            }
            None => text == "to_degrees" || text == "to_radians",
        };
        if converts {
            found.push((text.to_owned(), token.line));
        }
    }
    found
}

fn number(text: &str) -> Option<f64> {
    if !text.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    text.replace('_', "").trim_end_matches("f64").parse().ok()
}

/// The last name of the path that begins at token `i`.
fn path_end(tokens: &[Token], mut i: usize) -> Option<&str> {
    while path_after(tokens, i).is_some() {
        i += 3;
    }
    tokens.get(i).map(|t| t.text.as_str())
}

/// Whether the number at `i` multiplies or divides something whose name ends in a unit. A number on one side of a
/// comparison, or in the value of a name that says so, is a tolerance.
fn scales_a_quantity(tokens: &[Token], i: usize) -> bool {
    let is_factor = |text: &str| text == "*" || text == "/";
    let text = |at: usize| tokens.get(at).map_or("", |t| t.text.as_str());
    let statement_start = (0..i).rev().find(|&at| matches!(text(at), ";" | "{" | "}")).map_or(0, |at| at + 1);
    let is_tolerance = tokens[statement_start..i]
        .iter()
        .any(|t| matches!(t.text.as_str(), "<" | ">") || t.text.contains("tolerance") || t.text.contains("slack"));
    if is_tolerance {
        return false;
    }
    let before = i >= 2 && is_factor(text(i - 1)) && {
        let mut at = i - 2;
        // Behind a call's empty parentheses stands its name.
        if text(at) == ")" && at >= 2 && text(at - 1) == "(" {
            at -= 2;
        }
        ends_in_a_unit(text(at))
    };
    let after = is_factor(text(i + 1)) && {
        let mut at = i + 2;
        while text(at + 1) == "." {
            at += 2;
        }
        ends_in_a_unit(text(at))
    };
    before || after
}

fn ends_in_a_unit(name: &str) -> bool {
    let units = ["m", "mm", "um", "nm", "km", "s", "ms", "min", "h", "k", "c", "rad", "deg", "w", "j", "hz"];
    name.contains('_') && name.rsplit('_').next().is_some_and(|last| units.contains(&last))
}
