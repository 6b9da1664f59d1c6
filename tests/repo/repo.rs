//! The repository's own rules, as ARCHITECTURE.md states them: floors, units, heads of files, names and lengths.
//!
//! Source is read as Rust tokens, so that comments and strings can neither break a rule nor hide a breach.

mod conversions;
mod materials;
mod promises;
mod rooms;
mod source;
mod surface;

use std::collections::BTreeSet;

use conversions::conversions;
use source::{Source, Token, flatten, sources};

/// Every module at the crate's root and its floor; a module that is not here has no place yet.
const FLOORS: &[(&str, u8)] = &[
    ("units", 0),
    ("parallel", 0),
    ("numeric", 0),
    ("text", 0),
    ("coil", 1),
    ("pattern", 1),
    ("profile", 1),
    ("record", 1),
    ("thermal", 2),
    ("stress", 2),
    ("effect", 2),
    ("rate", 3),
    ("chamber", 4),
    ("predict", 4),
    ("search", 4),
    ("diagnose", 4),
    ("compare", 4),
    ("compensate", 4),
    ("schedule", 4),
    ("verify", 4),
    ("reproduce", 4),
    ("metrics", 4),
    ("io", 5),
    ("report", 5),
    ("task", 6),
    ("cli", 7),
    ("main", 8),
];

/// Who may use a sibling on its own floor, in this direction only.
const SIBLING_EDGES: &[(&str, &str)] = &[
    ("numeric", "units"),
    ("effect", "thermal"),
    ("effect", "stress"),
    ("diagnose", "chamber"),
    ("compare", "chamber"),
    ("predict", "chamber"),
    ("compensate", "chamber"),
    ("diagnose", "predict"),
    ("compare", "diagnose"),
    ("compare", "predict"),
    ("compensate", "metrics"),
    ("compensate", "predict"),
    ("reproduce", "compensate"),
    ("reproduce", "metrics"),
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
                faults.push(format!("{}: module {from} has no floor in tests/repo", source.name));
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

/// The folders of a module, lowest first: each may use those before it, never those behind it.
const FOLDER_ORDER: &[(&str, &[&str])] = &[("io", &["json", "read", "write"])];

#[test]
fn a_folder_uses_only_the_folders_of_its_module_that_stand_below_it() {
    let mut faults = Vec::new();
    for (module, order) in FOLDER_ORDER {
        for source in sources(&format!("src/{module}")) {
            // What stands beside the folders is used by all of them and uses none.
            let own = order.iter().position(|folder| source.name.starts_with(&format!("src/{module}/{folder}/")));
            for (i, token) in source.tokens.iter().enumerate().filter(|(_, token)| token.text == *module) {
                let used = source.path_after(i).and_then(|name| order.iter().position(|folder| *folder == name));
                if used.is_some_and(|used| own.is_none_or(|own| used > own)) {
                    faults.push(format!("{}:{}: {module}::{}", source.name, token.line, order[used.unwrap_or(0)]));
                }
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
    for source in sources("src").chain(sources("benches")).chain(sources("examples")) {
        if source.name != "src/units.rs" {
            let found = conversions(&source.tokens);
            faults.extend(found.into_iter().map(|(what, line)| format!("{}:{line}: {what}", source.name)));
        }
    }
    assert_no(faults);
}

#[test]
fn an_effect_is_named_in_its_own_folder_only() {
    // `verify` works the physics out a second time and shares nothing, not even names.
    let may_name = ["effect", "verify"];
    let kinds: BTreeSet<String> = sources("src/effect").flat_map(|source| kinds_in(&source.tokens)).collect();
    assert!(kinds.len() > 20, "{kinds:?}");
    let mut faults = Vec::new();
    for source in sources("src").filter(|source| !may_name.contains(&source.module().as_str())) {
        for token in source.tokens.iter().filter(|token| kinds.contains(&token.text)) {
            faults.push(format!("{}:{}: {}", source.name, token.line, token.text));
        }
    }
    assert_no(faults);
}

/// What `kind: "…"` says of each description of an effect, as a quoted token.
fn kinds_in(tokens: &[Token]) -> Vec<String> {
    tokens
        .windows(3)
        .filter(|three| three[0].text == "kind" && three[1].text == ":" && three[2].text.starts_with('"'))
        .map(|three| three[2].text.clone())
        .collect()
}

#[test]
fn a_new_effect_is_one_file_and_two_lines_beside_it() {
    let catalogue = sources("src/effect").find(|source| source.name == "src/effect/mod.rs").expect("the catalogue");
    let mut faults = Vec::new();
    for source in sources("src/effect").filter(|source| source.name != catalogue.name) {
        let name = source.name.rsplit('/').next().unwrap_or_default().trim_end_matches(".rs");
        let lines: BTreeSet<usize> = catalogue
            .tokens
            .windows(2)
            .filter(|two| two[1].text == name && two[0].text == "mod" || two[0].text == name && two[1].text == ":")
            .map(|two| two[0].line)
            .collect();
        // A third line gives it an address where built coils spread.
        let is_in_catalogue =
            !["channel", "custom", "thermal_stress"].contains(&name) && !kinds_in(&source.tokens).is_empty();
        if is_in_catalogue && !(2..=3).contains(&lines.len()) {
            faults.push(format!("{name} stands on {} lines of {}", lines.len(), catalogue.name));
        }
    }
    assert_no(faults);
}

#[test]
fn files_formats_and_pages_are_known_to_io_report_and_cli_only() {
    // Without serde in scope no domain type can derive Serialize either.
    let outside = ["serde", "serde_json", "toml_edit", "csv", "maud", "plotters", "comfy_table", "PathBuf"];
    let mut faults = Vec::new();
    for source in sources("src").filter(|s| floor_of(&s.module()).is_some_and(|floor| floor < 5)) {
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
        let is_cli = floor_of(&source.module()).is_some_and(|floor| floor >= 7);
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
fn a_test_is_left_out_as_long_only_and_the_gate_runs_it() {
    let mut faults = Vec::new();
    for source in sources("src").chain(sources("tests")).chain(sources("benches")) {
        let ignored = source.all_tokens.windows(3).filter(|w| w[0].text == "#" && w[2].text == "ignore");
        let lines: Vec<&str> = source.text.lines().collect();
        let is_long = |line: usize| lines[line - 1].trim() == "#[ignore = \"long: --include-ignored\"]";
        faults.extend(ignored.filter(|w| !is_long(w[0].line)).map(|w| format!("{}:{}", source.name, w[0].line)));
    }
    let gate = std::fs::read_to_string(source::root().join(".ci/run")).unwrap();
    if !gate.contains("\nstep cargo test -- --include-ignored\n") {
        faults.push(".ci/run".to_owned());
    }
    assert_no(faults);
}

#[test]
fn every_source_file_says_at_its_head_what_it_is_for() {
    let faults = ["src", "tests", "benches", "examples"]
        .into_iter()
        .flat_map(sources)
        .filter(|s| !s.text.starts_with("//! ") || s.text.lines().next().is_some_and(|head| head.len() < 20))
        .map(|s| s.name.clone())
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
        .map(|s| s.name.clone())
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

/// What opens a connection, or has another program do so.
const REACHES_OUT: &[&str] = &[
    "net",
    "TcpStream",
    "UdpSocket",
    "ToSocketAddrs",
    "ureq",
    "reqwest",
    "hyper",
    "curl",
    "attohttpc",
    "minreq",
    "isahc",
    "git2",
    "\"curl\"",
    "\"wget\"",
    "\"git\"",
    "\"ssh\"",
    "\"nc\"",
    "\"pip\"",
    "\"npm\"",
];

/// Looked at, and harmless.
const READ: &[(&str, &str)] = &[
    // Asks a repository on this machine which commit it is at.
    ("wasm-bindgen-shared", "\"git\""),
];

#[test]
fn no_build_script_of_what_the_program_is_built_upon_reaches_out() {
    let mut faults = Vec::new();
    let mut read = 0;
    for material in materials::materials() {
        let Some(script) = &material.build_script else { continue };
        // What other platforms need may not be there.
        let Ok(text) = std::fs::read_to_string(script) else { continue };
        read += 1;
        let tokens = flatten(&text);
        let is_read = |text: &str| READ.contains(&(material.name.as_str(), text));
        let found = tokens.iter().filter(|t| REACHES_OUT.contains(&t.text.as_str()) && !is_read(&t.text));
        faults.extend(
            found.map(|t| {
                format!("{} {}: {}:{}: {}", material.name, material.version, script.display(), t.line, t.text)
            }),
        );
        let fetchers = material.upon.iter().filter(|name| REACHES_OUT.contains(&name.as_str()));
        faults.extend(fetchers.map(|name| format!("{} {} is built upon {name}", material.name, material.version)));
    }
    println!("{read} build scripts read");
    assert!(read > 5);
    assert_no(faults);
}

#[test]
fn the_bill_of_materials_names_everything_with_version_licence_and_checksum() {
    let materials = materials::materials();
    let mut faults = Vec::new();
    for material in materials.iter().filter(|m| m.name != "coilwright") {
        let of_registry = material.source.as_deref() == Some("registry+https://github.com/rust-lang/crates.io-index");
        if !of_registry || material.checksum.is_none() || material.licence.is_empty() {
            faults.push(format!("{} {}: {:?}", material.name, material.version, material.source));
        }
    }
    let bill = materials::bill(&materials);
    let components = bill["components"].as_array().map_or(0, Vec::len);
    println!("{components} packages");
    assert_eq!(components, materials.len() - 1);
    assert!(bill["dependencies"][0]["dependsOn"].is_array() && materials.iter().any(|m| m.name == "nalgebra"));
    assert!(materials.iter().all(|m| m.name != "proptest"), "what only tests use is no part of the program");
    assert_no(faults);
}

fn assert_no(faults: Vec<String>) {
    assert!(faults.is_empty(), "\n  {}", faults.join("\n  "));
}

fn floor_of(module: &str) -> Option<u8> {
    FLOORS.iter().find(|(name, _)| *name == module).map(|(_, floor)| *floor)
}
