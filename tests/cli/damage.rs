//! Damage to files with an eye for what they are: tables, TOML, JSON, and any text.

use rand::{Rng, RngExt};
use serde_json::Value;

const NUMBERS: &[&str] = &[
    "nan",
    "inf",
    "-1.513e+299",
    "1e308",
    "-1e308",
    "1e-308",
    "0",
    "-0.0",
    "-1",
    "4e-11",
    "1e-9",
    "9223372036854775808",
    "1e18",
    "99999999",
    "1_000",
    "1000",
    "999",
    "200",
    "1e6",
    "-1e6",
    "1e9",
    "1e-6",
    "3",
    "17",
    "0.5",
];
const SIGNS: &[&str] = &[
    "\"",
    "'",
    "[",
    "]",
    "{",
    "}",
    "=",
    ",",
    "\n",
    "\r",
    "#",
    ";",
    "\u{1b}[2J",
    "\u{202e}",
    "\u{feff}",
    "\0",
    "<",
    "\\",
    "\"\n",
    "\u{85}",
    "\u{2028}",
    "\u{9b}31m",
    "''",
    "\"\"",
    "%",
    "M30\n",
    "\t",
];
const VALUES: &[&str] =
    &["true", "\"x\"", "\"\"", "[]", "{}", "[1, 2, 3]", "[[1]]", "\"any\"", "\"pack\"", "\"../x\"", "1979-05-27"];

/// The file, damaged in one to three places.
pub fn damaged(file: &str, whole: &[u8], random: &mut impl Rng) -> Vec<u8> {
    let Ok(text) = std::str::from_utf8(whole) else { return octets(whole, random) };
    let mut text = text.to_owned();
    for _ in 0..random.random_range(1..4) {
        text = match (file.rsplit('.').next().unwrap_or_default(), random.random_range(0..10)) {
            ("csv", 0..6) => table(&text, random),
            ("toml", 0..6) => keys(&text, random),
            ("json", 0..6) => document(&text, random),
            _ => lines(&text, random),
        };
    }
    let mut bytes = text.into_bytes();
    // Now and then what is no text at all.
    if !bytes.is_empty() && random.random_range(0..40) == 0 {
        let at = random.random_range(0..bytes.len());
        bytes[at] = random.random_range(128..=255);
    }
    bytes
}

/// A file that is no text: bits, sizes and offsets, most of them near its head, parts lost, put in or moved.
fn octets(whole: &[u8], random: &mut impl Rng) -> Vec<u8> {
    const HEAD: usize = 700;
    let mut bytes = whole.to_vec();
    for _ in 0..random.random_range(1..6) {
        let most = if random.random_range(0..2) == 0 { bytes.len() } else { bytes.len().min(HEAD) };
        let at = random.random_range(0..most);
        let length = random.random_range(1..64).min(bytes.len() - at);
        match random.random_range(0..7) {
            0 => bytes[at] ^= 1 << random.random_range(0..8),
            1 => bytes[at] = [0, 127, 128, 255][random.random_range(0..4)],
            2 | 3 => {
                let size = [0_u32, 1, 0x7fff_ffff, 0x8000_0000, u32::MAX][random.random_range(0..5)].to_le_bytes();
                bytes[at..].iter_mut().zip(size).for_each(|(byte, of)| *byte = of);
            }
            4 => bytes.truncate(at.max(1)),
            5 => drop(bytes.splice(at..at, (0..length).map(|_| random.random_range(0..=255)).collect::<Vec<u8>>())),
            _ => {
                let from = random.random_range(0..=bytes.len() - length);
                bytes.copy_within(from..from + length, at);
            }
        }
    }
    bytes
}

fn one_of<'a>(list: &[&'a str], random: &mut impl Rng) -> &'a str {
    list[random.random_range(0..list.len())]
}

fn any_number(random: &mut impl Rng) -> String {
    match random.random_range(0..4) {
        0 => random.random_range(-1e6..1e6).to_string(),
        1 => format!("{:e}", 10f64.powf(random.random_range(-20.0..40.0))),
        _ => one_of(NUMBERS, random).to_owned(),
    }
}

/// Any text, line by line.
fn lines(text: &str, random: &mut impl Rng) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    if lines.is_empty() {
        return text.to_owned();
    }
    let (at, other) = (random.random_range(0..lines.len()), random.random_range(0..lines.len()));
    match random.random_range(0..9) {
        0 => drop(lines.remove(at)),
        1 => lines.insert(other, lines[at].clone()),
        2 => lines.swap(at, other),
        3 | 4 => lines[at] = with_number(&lines[at], &any_number(random), random),
        5 | 6 => {
            let mut line: Vec<char> = lines[at].chars().collect();
            let place = random.random_range(0..=line.len());
            line.splice(place..place, one_of(SIGNS, random).chars());
            lines[at] = line.into_iter().collect();
        }
        7 => lines.truncate(at),
        _ => {
            let many = lines[at..].iter().take(random.random_range(1..40)).cloned().collect::<Vec<_>>();
            lines.splice(other..other, many);
        }
    }
    lines.join("\n") + "\n"
}

/// The line with one of its numbers replaced.
fn with_number(line: &str, new: &str, random: &mut impl Rng) -> String {
    let mut spans: Vec<std::ops::Range<usize>> = Vec::new();
    for (i, c) in line.char_indices().filter(|(_, c)| c.is_ascii_digit() || ".-+e_".contains(*c)) {
        match spans.last_mut() {
            Some(last) if last.end == i => last.end = i + c.len_utf8(),
            _ => spans.push(i..i + c.len_utf8()),
        }
    }
    spans.retain(|span| line[span.clone()].contains(|c: char| c.is_ascii_digit()));
    if spans.is_empty() {
        return line.to_owned();
    }
    let span = spans[random.random_range(0..spans.len())].clone();
    format!("{}{new}{}", &line[..span.start], &line[span.end..])
}

/// A table: its cells, columns, header and the order of its rows.
fn table(text: &str, random: &mut impl Rng) -> String {
    let separator = if text.contains(';') { ';' } else { ',' };
    let (head, body): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with('#'));
    let mut rows: Vec<Vec<String>> = body.iter().map(|r| r.split(separator).map(str::to_owned).collect()).collect();
    if rows.len() < 3 {
        return lines(text, random);
    }
    let at = random.random_range(1..rows.len());
    let column = random.random_range(0..rows[at].len());
    let number = |cell: &str| cell.replace(',', ".").parse::<f64>().ok();
    // Every row from the given one on is later by that.
    let later = |rows: &mut [Vec<String>], by_s: f64| {
        for row in rows {
            if let Some(time) = row.first().and_then(|c| number(c)) {
                row[0] = format!("{:?}", time + by_s);
            }
        }
    };
    match random.random_range(0..16) {
        0..3 => rows[at][column] = any_number(random),
        3 => rows[at][column] = String::new(),
        // A stamp right behind the one before, or far ahead; what follows goes on from there.
        4 | 5 => {
            let step = [4e-11, 1e-7, 1e-3, 1e4, 1e9][random.random_range(0..5)];
            let before = rows[at - 1].first().and_then(|c| number(c)).unwrap_or(0.0);
            let shift = before + step - rows[at].first().and_then(|c| number(c)).unwrap_or(0.0);
            later(&mut rows[at..], shift);
        }
        // Two rows that are one instant, at the beginning, where the usual interval is learned.
        6 => {
            rows.truncate(3);
            let first = rows[1].first().and_then(|c| number(c)).unwrap_or(0.0);
            rows[2][0] = format!("{:?}", first + 4e-11);
            let last = rows[2].clone();
            rows.extend((1..30).map(|i| {
                let mut row = last.clone();
                row[0] = format!("{}", first + 7.0 * f64::from(i));
                row
            }));
        }
        7 => {
            let place = column.min(rows[0].len() - 1);
            rows[0][place] = [
                "time_h",
                "temperature_k",
                "rate_rad_per_s",
                "rate_mv",
                "x",
                "=1+1",
                "\"a\nb\"",
                "temperature_inner_c",
                "flags",
            ][random.random_range(0..9)]
            .to_owned();
        }
        8 => rows.iter_mut().for_each(|row| drop((column < row.len()).then(|| row.remove(column)))),
        9 => {
            let value = any_number(random);
            rows[1..].iter_mut().filter(|row| column < row.len()).for_each(|row| row[column].clone_from(&value));
        }
        10 => rows[at][column] = format!("\"{}", rows[at][column]),
        11 => rows[1..].reverse(),
        12 => rows.truncate(at.min(5)),
        // What does not vary, or by one step only, in a record with a gap: slow noise has no end there.
        14 => {
            let value = rows[at][column].clone();
            let from = if random.random_range(0..2) == 0 { 1 } else { at };
            rows[from..].iter_mut().filter(|row| column < row.len()).for_each(|row| row[column].clone_from(&value));
            rows[1..from].iter_mut().filter(|row| column < row.len()).for_each(|row| row[column] = "1.5".to_owned());
            later(&mut rows[at..], [1e3, 1e6, 1e9][random.random_range(0..3)]);
        }
        // All rows as close as no clock has them, or those from one on.
        15 => {
            let step_s = [4e-11, 1e-9, 2e-6][random.random_range(0..3)];
            let from = if random.random_range(0..2) == 0 { 1 } else { at };
            rows[from..].iter_mut().enumerate().for_each(|(i, row)| row[0] = format!("{:?}", 1e-3 + step_s * i as f64));
        }
        _ => {
            let scale = [1e-12, 1e6, 1e30, -1.0][random.random_range(0..4)];
            for row in rows[1..].iter_mut().filter(|row| column < row.len()) {
                if let Some(value) = number(&row[column]) {
                    row[column] = format!("{:?}", value * scale);
                }
            }
        }
    }
    let rows = rows.iter().map(|row| row.join(&separator.to_string()));
    head.into_iter().map(str::to_owned).chain(rows).map(|line| line + "\n").collect()
}

/// TOML: a key's value, a key's name, a table.
fn keys(text: &str, random: &mut impl Rng) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let stated: Vec<usize> = (0..lines.len()).filter(|i| lines[*i].contains(" = ")).collect();
    if stated.is_empty() {
        return self::lines(text, random);
    }
    let at = stated[random.random_range(0..stated.len())];
    let (key, value) = lines[at].split_once(" = ").map(|(k, v)| (k.to_owned(), v.to_owned())).unwrap_or_default();
    match random.random_range(0..8) {
        0..4 => lines[at] = format!("{key} = {}", any_number(random)),
        4 => lines[at] = format!("{key} = {}", one_of(VALUES, random)),
        5 => lines[at] = format!("{key}x = {value}"),
        6 => {
            let from = stated[random.random_range(0..stated.len())];
            let other = lines[from].split_once(" = ").map(|(_, v)| v.to_owned()).unwrap_or_default();
            lines[at] = format!("{key} = {other}");
        }
        _ => lines[at] = with_number(&lines[at], &any_number(random), random),
    }
    lines.join("\n") + "\n"
}

/// JSON: a value anywhere in the tree becomes another one, goes, or is repeated.
fn document(text: &str, random: &mut impl Rng) -> String {
    let Ok(mut whole) = serde_json::from_str::<Value>(text) else { return lines(text, random) };
    let mut place = &mut whole;
    loop {
        let deeper = match place {
            Value::Object(map) => !map.is_empty(),
            Value::Array(list) => !list.is_empty(),
            _ => false,
        };
        if !deeper || random.random_range(0..12) == 0 {
            break;
        }
        match place {
            Value::Object(map) => {
                let at = random.random_range(0..map.len());
                if random.random_range(0..20) == 0 {
                    let key = map.keys().nth(at).cloned().unwrap_or_default();
                    map.remove(&key);
                    return whole.to_string();
                }
                place = map.values_mut().nth(at).expect("the map has so many");
            }
            Value::Array(list) => {
                let at = random.random_range(0..list.len());
                if random.random_range(0..20) == 0 {
                    let again = list[at].clone();
                    list.push(again);
                    return whole.to_string();
                }
                place = &mut list[at];
            }
            _ => break,
        }
    }
    // A number that could as well stand there is the damage that is hardest to see.
    if place.is_u64() && random.random_range(0..2) == 0 {
        *place = (place.as_u64().unwrap_or(0) ^ 1).into();
        return whole.to_string();
    }
    *place = match random.random_range(0..8) {
        0 => Value::Null,
        1 => Value::from(random.random_range(-1e6..1e6)),
        2 => Value::from(one_of(&["", "x", "nothing", "</script>", "\u{1b}[2J"], random)),
        3 => Value::from(u64::MAX),
        4 => Value::from(-1),
        5 => Value::Array(Vec::new()),
        6 => Value::from(1e300),
        _ => Value::from(random.random_range(0..1000)),
    };
    whole.to_string()
}
