//! What the library promises: its public surface is the listed one, and a body that is long says why.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

use crate::assert_no;
use crate::source::{Source, Token, root, sources};
use crate::surface::{Difference, least_version, surface};

/// Bodies over 60 lines that say why; it only gets smaller.
const MOST_LONG_BODIES: usize = 35;

/// Places where `.ok()` lets the cause of a failure go; it only gets smaller. It may where the question is whether there is such a thing (a number in
/// a word, a classic of so many layers, a state kept on disk that is computed again otherwise, a bound that a model has or has not), or where one
/// candidate of many cannot be computed and is none then. What a user asked for keeps its cause.
const MOST_CAUSES_LET_GO: usize = 123;

/// Errors, and what reads like them: their messages say what each variant means.
const MESSAGES: &str = "its messages say what each means";

fn listed() -> PathBuf {
    root().join("tests/repo/public_surface.txt")
}

fn read(name: &str) -> String {
    fs::read_to_string(root().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn numbers(version: &str) -> [u32; 3] {
    let mut parts = version.trim().split('.').map(|part| part.parse().expect("a version is three numbers"));
    std::array::from_fn(|_| parts.next().expect("a version is three numbers"))
}

/// The version that the package's manifest states.
fn own_version() -> String {
    let manifest = read("Cargo.toml");
    let package = manifest.split("[package]").nth(1).expect("the root is a package");
    let line = package.lines().find(|line| line.starts_with("version = ")).expect("a package has a version");
    line.trim_start_matches("version = ").trim_matches('"').to_owned()
}

#[test]
fn the_public_surface_is_the_listed_one_and_breaks_with_a_version_only() {
    let found = surface(sources("src"));
    assert!(found.len() > 1000, "{}", found.len());
    let own = own_version();
    let text = fs::read_to_string(listed()).unwrap_or_else(|_| format!("coilwright {own}\n"));
    let (head, lines) = text.split_once('\n').expect("a first line names the version");
    let of_list = head.trim_start_matches("coilwright ").to_owned();
    let stored: BTreeSet<String> = lines.lines().map(str::to_owned).collect();
    let difference = Difference::between(&stored, &found);
    let is_released = !read("CHANGELOG.md").contains(&format!("## Unreleased: {of_list}"));
    let least = least_version(numbers(&of_list), &difference);
    let shown = |lines: &[String], mark: &str| lines.iter().map(|l| format!("\n  {mark} {l}")).collect::<String>();
    let differs = shown(&difference.broken, "-") + &shown(&difference.new, "+");
    assert!(
        !is_released || numbers(&own) >= least,
        "{of_list} is released and its surface differs: expected at least version {least:?} in Cargo.toml, found {own}{differs}"
    );
    if std::env::var_os("COILWRIGHT_WRITE_SURFACE").is_some() {
        let lines: Vec<&str> = found.iter().map(String::as_str).collect();
        fs::write(listed(), format!("coilwright {own}\n{}\n", lines.join("\n"))).expect("the list can be written");
        return;
    }
    assert!(
        differs.is_empty() && of_list == own,
        "the public surface is not the listed one; where it is meant, say in CHANGELOG.md what users must change and write the list anew: \
         COILWRIGHT_WRITE_SURFACE=1 cargo test -p repository-rules{differs}"
    );
}

fn lines_of(text: &str) -> BTreeSet<String> {
    surface([Source::new("src/coil.rs".to_owned(), text.to_owned())].iter())
}

#[test]
fn what_others_use_cannot_go_or_change_unseen() {
    let before = "
        #[derive(Debug, Clone)]
        pub struct Coil { pub layers: usize, pub(crate) turns: Vec<f64>, }
        impl Coil { pub fn length_m(&self) -> f64 { 1.0 } pub const LEAST: usize = 2; fn own(&self) {} }
        pub enum End { A, B { at_m: f64 } }
        pub trait Cost { fn cost(&self) -> f64; }
        impl Cost for Coil { fn cost(&self) -> f64 { 0.0 } }
        pub fn wound(coil: &Coil) -> Vec<(usize, f64)> { Vec::new() }
        #[cfg(test)] mod tests { pub fn helper() {} }
        pub(crate) fn inner() {}";
    let stored = lines_of(before);
    let broken_by = |from: &str, to: &str| {
        assert!(before.contains(from), "{from}");
        Difference::between(&stored, &lines_of(&before.replace(from, to)))
    };
    let breaks = [
        ("pub layers: usize,", "pub layers: u32,"),
        ("pub layers: usize,", "pub(crate) layers: usize,"),
        ("pub fn length_m", "pub(crate) fn length_m"),
        ("pub fn length_m(&self) -> f64", "pub fn length_m(&self) -> f32"),
        ("pub const LEAST: usize = 2;", ""),
        ("A, B { at_m: f64 }", "B { at_m: f64 }"),
        ("at_m: f64", "at_m: f64, turns: f64"),
        ("impl Cost for Coil { fn cost(&self) -> f64 { 0.0 } }", ""),
        ("Debug, Clone", "Debug"),
        ("Vec<(usize, f64)>", "Vec<f64>"),
        ("pub fn wound(coil: &Coil)", "pub fn wound(coil: &Coil, layers: usize)"),
    ];
    for (from, to) in breaks {
        let found = broken_by(from, to);
        assert!(!found.broken.is_empty(), "{from} to {to} must be seen");
        assert_eq!(least_version([0, 1, 0], &found), [0, 2, 0], "{from}");
        assert_eq!(least_version([1, 4, 2], &found), [2, 0, 0], "{from}");
    }
    let more = broken_by("pub enum End", "pub fn further() {} pub enum End");
    assert!(more.broken.is_empty() && more.new == ["coilwright::coil: fn further()"], "{:?}", more.new);
    assert_eq!(least_version([0, 1, 0], &more), [0, 1, 1]);
    for (from, to) in
        [("fn own(&self)", "fn other(&self)"), ("pub fn helper", "pub fn h"), ("= 2;", "= 3;"), ("1.0", "2.0")]
    {
        let same = broken_by(from, to);
        assert!(same.broken.is_empty() && same.new.is_empty(), "{from}");
    }
}

#[test]
fn a_long_body_says_why_and_no_documentation_is_left_out_but_where_messages_say_it() {
    let limit = read("clippy.toml");
    assert!(limit.contains("too-many-lines-threshold = 60"), "{limit}");
    let library = read("src/lib.rs");
    for wanted in ["warn(clippy::too_many_lines)", "#![warn(missing_docs)]", "warn(unreachable_pub)"] {
        assert!(library.contains(wanted), "src/lib.rs must hold {wanted}");
    }
    let (mut faults, mut long) = (Vec::new(), 0);
    for source in sources("src").filter(|source| source.name != "src/lib.rs") {
        for (i, token) in source.all_tokens.iter().enumerate() {
            let lint = token.text.as_str();
            if !["too_many_lines", "missing_docs", "unreachable_pub"].contains(&lint) {
                continue;
            }
            // `#[expect(clippy::too_many_lines, reason = "…")]`, `#[allow(missing_docs, reason = "…")]`.
            let before: Vec<&str> = source.all_tokens[i.saturating_sub(5)..i].iter().map(|t| t.text.as_str()).collect();
            let behind: Vec<&str> = source.all_tokens[i + 1..].iter().take(4).map(|t| t.text.as_str()).collect();
            let reason = match behind[..] {
                [",", "reason", "=", words] => words.trim_matches('"'),
                _ => "",
            };
            long += usize::from(lint == "too_many_lines");
            let is_told = match lint {
                "too_many_lines" => before == ["expect", "(", "clippy", ":", ":"] && reason.len() > 15,
                "missing_docs" => before[3..] == ["allow", "("] && reason == MESSAGES,
                _ => false,
            };
            if !is_told {
                faults.push(format!("{}:{}: {lint} without a reason", source.name, token.line));
            }
        }
    }
    println!("{long} bodies over 60 lines");
    if long > MOST_LONG_BODIES {
        faults.push(format!("{long} bodies over 60 lines, {MOST_LONG_BODIES} at most: split the new one"));
    }
    assert_no(faults);
}

/// Names that many modules have one of, read with their module: what a use case is asked and answers, who watches it, a command's arguments.
const ROLES: &[&str] = &["Answer", "Arguments", "Observer", "Request", "Unobserved"];

/// Types that other files can see, by name.
fn types_seen(sources: impl Iterator<Item = &'static Source>) -> BTreeMap<String, BTreeSet<String>> {
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for source in sources {
        for (i, _) in source.tokens.iter().enumerate().filter(|(_, token)| token.text == "pub") {
            let behind = &source.tokens[i + 1..];
            // `pub(in crate::io) struct`: up to its closing bracket.
            let skipped = match behind.first().map(|t| t.text.as_str()) {
                Some("(") => behind.iter().position(|t| t.text == ")").map_or(0, |end| end + 1),
                _ => 0,
            };
            if let [kind, name, ..] = &behind[skipped..]
                && ["struct", "enum", "trait", "union"].contains(&kind.text.as_str())
            {
                found.entry(name.text.clone()).or_default().insert(format!("{}:{}", source.name, name.line));
            }
        }
    }
    found
}

#[test]
fn a_type_that_other_files_see_has_a_name_of_its_own() {
    // `verify` works the physics out a second time and shares nothing, not even names.
    let seen = types_seen(sources("src").filter(|source| source.module() != "verify"));
    assert!(seen.len() > 500, "{}", seen.len());
    let doubled = seen.iter().filter(|(name, at)| at.len() > 1 && !ROLES.contains(&name.as_str()));
    assert_no(doubled.map(|(name, at)| format!("{name}: {at:?}")).collect());
}

#[test]
fn causes_of_failures_are_let_go_in_no_more_places_than_before() {
    let let_go = |source: &Source| {
        let is_one = |w: &[Token]| w.iter().map(|t| t.text.as_str()).eq([".", "ok", "(", ")"]);
        source.tokens.windows(4).filter(|w| is_one(w)).count()
    };
    let found: usize = sources("src").map(let_go).sum();
    println!("{found} causes let go");
    assert!(found <= MOST_CAUSES_LET_GO, "{found} times `.ok()`, at most {MOST_CAUSES_LET_GO}: keep the cause");
}

/// The rules have a program of their own: without a word `cargo run` would not know which one the README means.
#[test]
fn cargo_run_runs_the_program() {
    let manifest = read("Cargo.toml");
    let package = manifest.split("[package]").nth(1).and_then(|rest| rest.split("\n[").next());
    let says = package.expect("the root is a package").lines().any(|line| line == "default-run = \"coilwright\"");
    assert!(says, "Cargo.toml: [package] lacks default-run = \"coilwright\"");
}
