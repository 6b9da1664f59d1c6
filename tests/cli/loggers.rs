//! One record in the files of many loggers: whatever its units, stamps and separators, it is the same record.

use std::f64::consts::PI;

use serde_json::Value;

use super::{code, folder_with, root, run, stderr, stdout};

/// Twenty rows to a wave of temperature, ten seconds apart; the rate follows it and has noise of its own.
fn rows() -> Vec<[f64; 3]> {
    let mut state = 17_u64;
    let mut noise = move || {
        // A multiplicative congruential generator: twelve uniform numbers are nearly normal.
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    };
    (0..600)
        .map(|i| {
            let temperature_c = 20.0 + 8.0 * (f64::from(i) / 90.0).sin() + 0.01 * noise();
            let rate = 0.3 + 0.05 * (temperature_c - 20.0) + 0.4 * noise();
            [10.0 * f64::from(i), (temperature_c * 1e4).round() / 1e4, (rate * 1e6).round() / 1e6]
        })
        .collect()
}

fn text(head: &str, separator: &str, cells: impl Fn([f64; 3]) -> Vec<String>) -> String {
    rows().into_iter().fold(head.to_owned() + "\n", |text, row| text + &cells(row).join(separator) + "\n")
}

/// Columns of numbers behind a head, by what is said of each row's.
fn numbers(head: &str, cells: impl Fn(f64, f64, f64) -> [f64; 3]) -> String {
    text(head, ",", |[t, c, r]| cells(t, c, r).iter().map(f64::to_string).collect())
}

fn commas(text: &str) -> String {
    text.replace('.', ",")
}

/// From half an hour before midnight of a leap day.
fn stamp(time_s: f64) -> String {
    let second = 84_600 + time_s as u32;
    let (day, of_day) = (28 + second / 86_400, second % 86_400);
    format!("2028-02-{day:02}T{:02}:{:02}:{:02}", of_day / 3600, of_day % 3600 / 60, of_day % 60)
}

fn stamped(head: &str, separator: char, zone: &str) -> String {
    text(head, ",", |[t, c, r]| {
        vec![stamp(t).replace('T', &separator.to_string()) + zone, c.to_string(), r.to_string()]
    })
}

/// Rows that say nothing, between those that do: cells that are missing or no number, stamps that jump back or repeat.
fn with_bad_rows(plain: &str) -> String {
    let mut lines: Vec<&str> = plain.lines().collect();
    for (at, bad) in [
        (30, "285,,0.3"),
        (60, "555,20.1,"),
        (90, "845,NaN,0.2"),
        (120, "100,20,9"),
        (150, lines[145]),
        (200, "n/a,20,3"),
        (300, "--,--,--"),
    ] {
        lines.insert(at, bad);
    }
    lines.join("\n") + "\n"
}

/// Name, file, and what has to be said about it.
fn variants() -> Vec<(&'static str, String, &'static [&'static str])> {
    let plain = numbers("time_s,temperature_c,rate_deg_per_h", |t, c, r| [t, c, r]);
    let semicolons = commas(&plain.replace(',', ";"));
    let map = |time: &'static str| -> &'static [&'static str] { Box::leak(Box::new(["--columns", time])) };
    vec![
        ("semicolons and decimal commas", semicolons.clone(), &[]),
        ("tabs and decimal commas", semicolons.replace(';', "\t"), &[]),
        ("bars", plain.replace(',', "|"), &[]),
        (
            "bars and quotes",
            text("\"time_s\"|\"temperature_c\"|\"rate_deg_per_h\"", "|", |row| {
                row.map(|v| format!("\"{v}\"")).to_vec()
            }),
            &[],
        ),
        ("a typographer's minus", plain.replace('-', "\u{2212}"), &[]),
        (
            "exponents in Fortran's letter",
            text("time_s,temperature_c,rate_deg_per_h", ",", |row| {
                row.map(|v| format!("{v:e}").replace('e', "D")).to_vec()
            }),
            &[],
        ),
        ("a negative zero", plain.replacen("\n0,", "\n-0.0,", 1), &[]),
        ("carriage returns", plain.replace('\n', "\r\n"), &[]),
        ("a mark of the byte order", "\u{feff}".to_owned() + &plain, &[]),
        ("stamps with a zone", stamped("time_iso,temperature_c,rate_deg_per_h", 'T', "Z"), &[]),
        ("stamps with another zone", stamped("when,temperature_c,rate_deg_per_h", 'T', "+02:00"), map("time=when")),
        ("stamps without a zone", stamped("when,temperature_c,rate_deg_per_h", ' ', ""), map("time=when")),
        ("seconds since 1970", numbers("time_s,temperature_c,rate_deg_per_h", |t, c, r| [1.7e9 + t, c, r]), &[]),
        (
            "milliseconds since 1970",
            numbers("ts,temperature_c,rate_deg_per_h", |t, c, r| [1.7e12 + 1e3 * t, c, r]),
            map("time=ts:ms"),
        ),
        ("microseconds", numbers("time_us,temperature_c,rate_deg_per_h", |t, c, r| [1e6 * t, c, r]), &[]),
        ("minutes", numbers("time_min,temperature_c,rate_deg_per_h", |t, c, r| [t / 60.0, c, r]), &[]),
        ("hours", numbers("Zeit,temperature_c,rate_deg_per_h", |t, c, r| [t / 3600.0, c, r]), map("time=Zeit:h")),
        ("days", numbers("time_d,temperature_c,rate_deg_per_h", |t, c, r| [t / 86_400.0, c, r]), &[]),
        ("counts", numbers("time_s,temperature_c,F", |t, c, r| [t, c, 12.5 * r]), map("rate=F:counts,scale=12.5")),
        (
            "counts of a gyro that is mounted upside down",
            numbers("time_s,temperature_c,F", |t, c, r| [t, c, -12.5 * r]),
            map("rate=F:counts,scale=-12.5"),
        ),
        ("mV", numbers("time_s,temperature_c,U", |t, c, r| [t, c, 4.0 * r]), map("rate=U:mV,scale=4")),
        ("V", numbers("time_s,temperature_c,U", |t, c, r| [t, c, 0.004 * r]), map("rate=U:V,scale=0.004")),
        ("°/s", numbers("time [s],temperature [°C],rate [°/s]", |t, c, r| [t, c, r / 3600.0]), &[]),
        ("arcsec/s", numbers("time_s,temperature_c,rate_arcsec_per_s", |t, c, r| [t, c, r]), &[]),
        ("rad/s", numbers("time_s,temperature_c,W", |t, c, r| [t, c, r * PI / 648_000.0]), map("rate=W:rad/s")),
        ("K", numbers("time_s,temperature_k,rate_deg_per_h", |t, c, r| [t, c + 273.15, r]), &[]),
        ("°F", numbers("time_s,T,rate_deg_per_h", |t, c, r| [t, 1.8 * c + 32.0, r]), map("temperature=T:degF")),
        (
            "thermometers in other places, columns in another order",
            text("T3,rate_deg_per_h,flange_1,temperature_c,time_s", ",", |[t, c, r]| {
                [c + 1.0, r, c - 1.0, c, t].iter().map(f64::to_string).collect()
            }),
            map("layer_7=T3:c,flange=flange_1:c"),
        ),
        ("bad rows", with_bad_rows(&plain), &["--bad-rows", "skip"]),
        ("bad rows with semicolons", commas(&with_bad_rows(&plain).replace(',', ";")), &["--bad-rows", "skip"]),
    ]
}

/// What keys of noises hold, in their list and where a document repeats them.
const NOISES: [&str; 6] = ["/noise/", "/allan_noises/", "random_walk", "flicker", "quantisation", "thermal_deg_per_h"];

/// Every number within rounding of units, every word the same.
fn same(a: &Value, b: &Value, place: &str) {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            a.iter()
                .filter(|(key, _)| *key != "file" && *key != "inputs")
                .for_each(|(k, v)| same(v, &b[k], &format!("{place}/{k}")));
        }
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            a.iter().zip(b).enumerate().for_each(|(i, (x, y))| same(x, y, &format!("{place}/{i}")));
        }
        _ => match (a.as_f64(), b.as_f64()) {
            // Strengths and ends of noises are sought to a part in five hundred: rounding may decide a last step.
            (Some(x), Some(y)) if NOISES.iter().any(|noise| place.contains(noise)) => {
                assert!((x - y).abs() <= 1e-2 * x.abs(), "{place}: {x} {y}")
            }
            (Some(x), Some(y)) => assert!((x - y).abs() <= 2e-6 * x.abs() + 1e-9, "{place}: {x} {y}"),
            _ => assert_eq!(a, b, "{place}"),
        },
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn every_way_to_write_a_record_gives_the_plain_files_answer() {
    let (folder, plain) = folder_with("plain.csv", numbers("time_s,temperature_c,rate_deg_per_h", |t, c, r| [t, c, r]));
    let other = folder.path().join("other.csv");
    let (plain, other_path) = (plain.display().to_string(), other.display().to_string());
    let model = root().join("examples/chamber-coil.toml").display().to_string();
    let measured = |path: &str, more: &[&str]| -> Value {
        let out = run(&[&["metrics", path, "--format", "json"], more].concat());
        assert_eq!(code(&out), 0, "{more:?}: {}", stderr(&out));
        serde_json::from_str(stdout(&out)).unwrap()
    };
    // One command holds the record that is fitted and passes rows on.
    let compensated = |path: &str, fit: &str, more: &[&str]| -> (Vec<f64>, bool) {
        let out = run(&[&["compensate", &model, path, "--fit", fit, "--method", "piecewise"], more].concat());
        assert_eq!(code(&out), 0, "{more:?}: {}", stderr(&out));
        let (before, _) = stdout(&out).split_once("rate_compensated_deg_per_h").unwrap();
        let separator = before.chars().last().unwrap();
        let cells = || stdout(&out).lines().skip(1).filter_map(|line| line.split(separator).rev().nth(1));
        let has_comma = separator != ',' && cells().any(|cell| cell.contains(','));
        (cells().filter_map(|cell| cell.replace(',', ".").parse().ok()).collect(), has_comma)
    };
    let (expected, (expected_left, _)) = (measured(&plain, &[]), compensated(&plain, &plain, &[]));
    assert_eq!(expected_left.len(), 600);
    for (name, text, more) in variants() {
        std::fs::write(&other, text).unwrap();
        println!("{name}");
        same(&expected, &measured(&other_path, more), "");
        // A stream passes bad rows on, flagged; a fit leaves them out.
        let passed_on = if more.contains(&"--bad-rows") { &plain } else { &other_path };
        let (left, has_comma) = compensated(passed_on, &other_path, more);
        // What is added is written as the file's own numbers.
        assert!(has_comma || passed_on == &plain || !name.contains("decimal comma"), "{name}");
        assert_eq!(left.len(), 600, "{name}");
        for (a, b) in expected_left.iter().zip(&left) {
            assert!((a - b).abs() < 2e-6, "{name}: {a} {b}");
        }
    }
}

#[test]
fn what_cannot_be_read_is_refused_with_what_helps() {
    let plain = numbers("time_s,temperature_c,rate_deg_per_h", |t, c, r| [t, c, r]);
    let since = |factor: f64| {
        text("time_s,temperature_c,rate_deg_per_h", ",", |[t, c, r]| {
            vec![((1.7e9 + t) * factor).to_string(), c.to_string(), r.to_string()]
        })
    };
    let apart = text("time_s,temperature_c,rate_deg_per_h", ",", |[t, c, r]| {
        vec![format!("\"1,{:03}.0\"", t as u32 % 1000), c.to_string(), r.to_string()]
    });
    let unknown = plain.replacen("rate_deg_per_h", "rate [furlongs]", 1);
    let spaces = plain.replace(',', "   ");
    let (_, headless) = plain.split_once('\n').unwrap();
    let trailing = plain.replace('\n', ",\n");
    let cases: [(&str, &str, &[&str]); 8] = [
        (&since(1e3), "time=its name:epoch_ms", &[]),
        (&since(1e6), "time=its name:epoch_us", &[]),
        (&since(1e9), "time=its name:epoch_ns", &[]),
        (&apart, "without anything between their thousands", &[]),
        (&unknown, "furlongs, which is no unit", &["--columns", "rate=rate [furlongs]"]),
        (&spaces, "found spaces", &[]),
        (headless, "put a line such as", &[]),
        (&trailing, "no separator behind the last column", &[]),
    ];
    for (text, expected, options) in cases {
        let (_folder, path) = folder_with("log.csv", text);
        let output = run(&[&["metrics", &path.display().to_string()], options].concat());
        assert!(code(&output) == 2 && stderr(&output).contains(expected), "{expected}: {}", stderr(&output));
    }
}

#[test]
fn averaged_rows_have_the_noise_of_means_and_what_was_averaged_is_said() {
    let (_folder, path) = folder_with("plain.csv", numbers("time_s,temperature_c,rate_deg_per_h", |t, c, r| [t, c, r]));
    let path = path.display().to_string();
    let of = |more: &[&str]| -> (Value, String) {
        let out = run(&[&["metrics", &path, "--format", "json"], more].concat());
        assert_eq!(code(&out), 0, "{}", stderr(&out));
        (serde_json::from_str(stdout(&out)).unwrap(), stderr(&out).to_owned())
    };
    let ((fine, _), (coarse, said)) = (of(&[]), of(&["--average-rows", "5"]));
    assert!(said.contains("600 rows averaged into 120, 5 each"), "{said}");
    // The same as of a file that holds the means.
    let means = rows().chunks(5).fold("time_s,temperature_c,rate_deg_per_h\n".to_owned(), |text, rows| {
        let mean = |place: usize| rows.iter().map(|row| row[place]).sum::<f64>() / 5.0;
        text + &format!("{},{},{}\n", rows[4][0], mean(1), mean(2))
    });
    let (_other, averaged) = folder_with("means.csv", means);
    let out = run(&["metrics", &averaged.display().to_string(), "--format", "json"]);
    same(&serde_json::from_str(stdout(&out)).unwrap(), &coarse, "");
    // A mean across a gap is none; the last four rows are too few.
    let gap: String =
        numbers("time_s,temperature_c,rate_deg_per_h", |t, c, r| [if t < 3020.0 { t } else { t + 900.0 }, c, r])
            .lines()
            .take(600)
            .map(|line| line.to_owned() + "\n")
            .collect();
    let (_gap, path) = folder_with("gap.csv", gap);
    let out = run(&["metrics", &path.display().to_string(), "--average-rows", "5"]);
    assert!(stderr(&out).contains("599 rows averaged into 118, 5 each, 9 left out"), "{}", stderr(&out));
    let white = |document: &Value| {
        let noise =
            document["records"][0]["noise"].as_array().unwrap().iter().find(|n| n["kind"] == "white").unwrap().clone();
        ["low", "value", "high"].map(|key| noise[key].as_f64().unwrap())
    };
    // 0.4 °/h every 10 s is 0.4/60 √10 °/√h whichever rows it is told by.
    let truth = 0.4 / 60.0 * 10f64.sqrt();
    for [low, value, high] in [white(&fine), white(&coarse)] {
        assert!(low <= value && value <= high, "{low} {value} {high}");
        assert!(low <= truth && truth <= high, "{low} {high} {truth}");
    }
    let bias = |document: &Value| document["bias_deg_per_h"].as_f64().unwrap();
    assert!((bias(&fine) - bias(&coarse)).abs() < 1e-9);
}
