//! The repository's own rules, as ARCHITECTURE.md states them: floors, units, heads of files, names and lengths.
//!
//! Source is read as Rust tokens, so that comments and strings can neither break a rule nor hide a breach.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// Every module at the crate's root and its floor; a module that is not here has no place yet.
const FLOORS: &[(&str, u8)] = &[
    ("units", 0),
    ("numeric", 0),
    ("coil", 1),
    ("pattern", 1),
    ("profile", 1),
    ("record", 1),
    ("thermal", 2),
    ("effect", 2),
    ("rate", 3),
    ("boundary", 4),
    ("predict", 4),
    ("search", 4),
    ("fit", 4),
    ("diagnose", 4),
    ("compare", 4),
    ("compensate", 4),
    ("schedule", 4),
    ("verify", 4),
    ("reproduce", 4),
    ("metrics", 4),
    ("io", 5),
    ("report", 5),
    ("cli", 6),
    ("main", 7),
];

/// Who may use a sibling on its own floor, in this direction only.
const SIBLING_EDGES: &[(&str, &str)] = &[
    ("numeric", "units"),
    ("effect", "thermal"),
    ("predict", "boundary"),
    ("diagnose", "boundary"),
    ("diagnose", "predict"),
    ("diagnose", "fit"),
    ("compare", "boundary"),
    ("compare", "predict"),
    ("compensate", "boundary"),
    ("compensate", "predict"),
    ("reproduce", "search"),
    ("report", "io"),
];

/// A file that outgrows this holds two ideas.
const LONGEST_FILE: usize = 500;

const FORBIDDEN_NAMES: &[&str] = &["utils", "util", "common", "helpers", "helper", "types", "prelude", "misc"];

#[test]
fn a_module_imports_only_from_the_floors_below_or_along_a_listed_edge() {
    let mut faults = Vec::new();
    for source in sources("src") {
        let from = source.module();
        let Some(from_floor) = floor_of(&from) else {
            if from != "lib" {
                faults.push(format!("{}: module {from} has no floor in tests/repo.rs", source.name));
            }
            continue;
        };
        for (to, line) in source.imported_modules() {
            let allowed = match floor_of(&to) {
                _ if to == from => true,
                Some(to_floor) => {
                    to_floor < from_floor
                        || (to_floor == from_floor && SIBLING_EDGES.contains(&(from.as_str(), to.as_str())))
                }
                None => false,
            };
            if !allowed {
                faults.push(format!("{}:{line}: {from} must not import {to}", source.name));
            }
        }
    }
    assert_no(faults);
}

#[test]
fn listed_edges_between_siblings_make_no_circle() {
    for (from, to) in SIBLING_EDGES {
        let mut reached = BTreeSet::from([*to]);
        while let Some((_, next)) = SIBLING_EDGES.iter().find(|(a, b)| reached.contains(a) && !reached.contains(b)) {
            reached.insert(next);
        }
        assert!(!reached.contains(from), "{from} is reached from {to}, which it uses");
    }
}

#[test]
fn only_units_converts() {
    let mut faults = Vec::new();
    for source in sources("src").into_iter().chain(sources("benches")).chain(sources("examples")) {
        if source.name != "src/units.rs" {
            let found = conversions(&source.tokens);
            faults.extend(found.into_iter().map(|(what, line)| format!("{}:{line}: {what}", source.name)));
        }
    }
    assert_no(faults);
}

#[test]
fn files_formats_and_pages_are_known_to_io_report_and_cli_only() {
    // Without serde in scope no domain type can derive Serialize either.
    let outside = ["serde", "serde_json", "toml_edit", "csv", "maud", "plotters", "comfy_table", "PathBuf"];
    let mut faults = Vec::new();
    for source in sources("src").into_iter().filter(|s| floor_of(&s.module()).is_some_and(|floor| floor < 5)) {
        for (i, token) in source.tokens.iter().enumerate() {
            let path_into_std = token.text == "std" && source.path_after(i).is_some_and(|next| next == "fs");
            if outside.contains(&token.text.as_str()) || path_into_std {
                faults.push(format!("{}:{}: {}", source.name, token.line, token.text));
            }
        }
    }
    assert_no(faults);
}

#[test]
fn the_library_never_prints_exits_or_reads_clock_or_environment() {
    let macros = ["println", "print", "eprintln", "eprint", "dbg", "todo", "unimplemented"];
    let mut faults = Vec::new();
    for source in sources("src") {
        let is_cli = floor_of(&source.module()).is_some_and(|floor| floor >= 6);
        for (i, token) in source.tokens.iter().enumerate() {
            let text = token.text.as_str();
            let next = source.tokens.get(i + 1).map_or("", |t| t.text.as_str());
            let prints = macros.contains(&text) && next == "!";
            let left_over = ["dbg", "todo", "unimplemented"].contains(&text) && prints;
            let into = source.path_after(i).unwrap_or_default();
            let asks = matches!(
                (text, into),
                ("Instant" | "SystemTime", "now") | ("std", "env") | ("env", "var") | ("process", "exit" | "abort")
            ) || text == "SystemTime";
            if left_over || (!is_cli && (prints || asks)) {
                faults.push(format!("{}:{}: {text} {into}", source.name, token.line));
            }
        }
    }
    assert_no(faults);
}

#[test]
fn no_test_is_switched_off() {
    let mut faults = Vec::new();
    for source in sources("src").into_iter().chain(sources("tests")).chain(sources("benches")) {
        let ignored = source.all_tokens.windows(3).filter(|w| w[0].text == "#" && w[2].text == "ignore");
        faults.extend(ignored.map(|w| format!("{}:{}", source.name, w[0].line)));
    }
    assert_no(faults);
}

#[test]
fn every_source_file_says_at_its_head_what_it_is_for() {
    let faults = ["src", "tests", "benches", "examples"]
        .into_iter()
        .flat_map(sources)
        .filter(|s| !s.text.starts_with("//! ") || s.text.lines().next().is_some_and(|head| head.len() < 20))
        .map(|s| s.name)
        .collect();
    assert_no(faults);
}

#[test]
fn no_source_file_holds_two_ideas() {
    let faults = ["src", "tests", "benches", "examples"]
        .into_iter()
        .flat_map(sources)
        .filter(|s| s.text.lines().count() > LONGEST_FILE)
        .map(|s| format!("{}: {} lines", s.name, s.text.lines().count()))
        .collect();
    assert_no(faults);
}

#[test]
fn no_file_or_folder_is_named_after_nothing_in_particular() {
    let faults = ["src", "tests", "benches", "examples"]
        .into_iter()
        .flat_map(sources)
        .map(|s| s.name)
        .filter(|name| name.split(['/', '.']).any(|part| FORBIDDEN_NAMES.contains(&part)))
        .collect();
    assert_no(faults);
}

#[test]
fn the_rules_of_this_file_catch_what_they_are_for() {
    let breaches = [
        "let a = x_s / 3600.0;",
        "let a = 3_600;",
        "let a = t_k - 273.15;",
        "let a = x.to_degrees();",
        "let a = 180.0 / std::f64::consts::PI;",
        "let a = PI / 180.0;",
        "let a = length_mm * 1e-3;",
        "let a = 1e6 * self.radial_pitch_m;",
        "let a = coil.length_m() / 1000.0;",
        "let a = time_min * 60.0;",
        "let a = pitch_um / 1.0e6;",
    ];
    for breach in breaches {
        assert!(!conversions(&flatten(breach)).is_empty(), "{breach}");
    }
    let fine = [
        "// 3600 s\nlet a = x_s * 2.0;",
        "let a = \"3600\";",
        "let tolerance = 1e-9 * (upper - lower).abs();",
        "if (a_m - b_m).abs() < 1e-9 * a_m { }",
        "let a = PI * r_m;",
        "const RELATIVE: f64 = 1e-6;",
        "#[cfg(test)] mod tests { fn f() { let a = 3600.0; } }",
    ];
    for line in fine {
        assert!(conversions(&flatten(line)).is_empty(), "{line}");
    }
    let source =
        Source::new("src/rate.rs".into(), "use crate::{io::table, units}; fn f() { crate::cli::run() }".into());
    let found: Vec<String> = source.imported_modules().into_iter().map(|(module, _)| module).collect();
    assert_eq!(found, ["io", "units", "cli"]);
}

fn assert_no(faults: Vec<String>) {
    assert!(faults.is_empty(), "\n  {}", faults.join("\n  "));
}

fn floor_of(module: &str) -> Option<u8> {
    FLOORS.iter().find(|(name, _)| *name == module).map(|(_, floor)| *floor)
}

struct Token {
    text: String,
    line: usize,
}

/// A source file as text and as tokens.
struct Source {
    /// Its path from the repository's root, with forward slashes.
    name: String,
    text: String,
    /// Without modules that only tests are built from.
    tokens: Vec<Token>,
    all_tokens: Vec<Token>,
}

impl Source {
    fn new(name: String, text: String) -> Self {
        let stream = TokenStream::from_str(&text).unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut all_tokens = Vec::new();
        push_tokens(stream, false, &mut all_tokens);
        // `mod tests;` under `#[cfg(test)]` puts a module of tests into a file of its own.
        let tokens = if name.ends_with("/tests.rs") { Vec::new() } else { flatten(&text) };
        Self { tokens, all_tokens, name, text }
    }

    /// The module at the crate's root that the file belongs to.
    fn module(&self) -> String {
        let inside = self.name.strip_prefix("src/").unwrap_or(&self.name);
        inside.split('/').next().unwrap_or_default().trim_end_matches(".rs").to_owned()
    }

    /// The name behind the `::` behind token `i`.
    fn path_after(&self, i: usize) -> Option<&str> {
        path_after(&self.tokens, i)
    }

    /// The modules that paths from the crate's root lead into, with their lines.
    fn imported_modules(&self) -> Vec<(String, usize)> {
        let mut found = Vec::new();
        for (i, token) in self.tokens.iter().enumerate() {
            if !(token.text == "crate" || token.text == "coilwright") {
                continue;
            }
            match path_after(&self.tokens, i) {
                Some("{") => found.extend(heads_of_group(&self.tokens[i + 4..])),
                Some(name) => found.push((name.to_owned(), token.line)),
                None => {}
            }
        }
        found
    }
}

/// The first names of the paths in `{a::x, b, c::{d, e}}`; `tokens` begins behind the opening brace.
fn heads_of_group(tokens: &[Token]) -> Vec<(String, usize)> {
    let (mut heads, mut depth, mut at_head) = (Vec::new(), 0, true);
    for token in tokens {
        match token.text.as_str() {
            "{" => depth += 1,
            "}" if depth == 0 => break,
            "}" => depth -= 1,
            "," if depth == 0 => at_head = true,
            name if depth == 0 && at_head => {
                heads.push((name.to_owned(), token.line));
                at_head = false;
            }
            _ => {}
        }
    }
    heads
}

fn path_after(tokens: &[Token], i: usize) -> Option<&str> {
    let is_path = tokens.get(i + 1)?.text == ":" && tokens.get(i + 2)?.text == ":";
    if is_path { tokens.get(i + 3).map(|t| t.text.as_str()) } else { None }
}

/// All Rust files below a folder, in the order of their names.
fn sources(folder: &str) -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files: Vec<PathBuf> = Vec::new();
    let mut folders = vec![root.join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten() {
            let path = entry.expect("a folder of the repository can be listed").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
        .into_iter()
        .map(|path| {
            let name = path.strip_prefix(root).expect("found below the root").display().to_string().replace('\\', "/");
            Source::new(name, fs::read_to_string(&path).expect("source files are UTF-8"))
        })
        .collect()
}

/// The tokens of the program proper: no comments, no modules under `#[cfg(test)]`.
fn flatten(text: &str) -> Vec<Token> {
    let stream = TokenStream::from_str(text).unwrap_or_else(|error| panic!("{text}: {error}"));
    let mut tokens = Vec::new();
    push_tokens(stream, true, &mut tokens);
    tokens
}

fn push_tokens(stream: TokenStream, without_tests: bool, tokens: &mut Vec<Token>) {
    let trees: Vec<TokenTree> = stream.into_iter().collect();
    let mut i = 0;
    while i < trees.len() {
        let line = trees[i].span().start().line;
        let is_hash = matches!(&trees[i], TokenTree::Punct(p) if p.as_char() == '#');
        let is_test_only = trees.get(i + 1).is_some_and(|t| t.to_string().replace(' ', "") == "[cfg(test)]");
        if without_tests && is_hash && is_test_only {
            // Skips the item: up to its braces or its semicolon.
            i += 2;
            while i < trees.len() {
                let ends = match &trees[i] {
                    TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
                    TokenTree::Punct(punct) => punct.as_char() == ';',
                    _ => false,
                };
                i += 1;
                if ends {
                    break;
                }
            }
            continue;
        }
        match &trees[i] {
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::None => ("", ""),
                };
                tokens.push(Token { text: open.to_owned(), line });
                push_tokens(group.stream(), without_tests, tokens);
                tokens.push(Token { text: close.to_owned(), line: group.span_close().start().line });
            }
            tree => tokens.push(Token { text: tree.to_string(), line }),
        }
        i += 1;
    }
}

/// Numbers and calls that convert units, with their lines.
fn conversions(tokens: &[Token]) -> Vec<(String, usize)> {
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
