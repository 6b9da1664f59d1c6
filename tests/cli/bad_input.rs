//! Wrong model and pattern files: one clear error each, exit code 2, nothing on stdout, never a panic.

use std::path::Path;

use super::{code, folder_with, root, run, stderr, stdout};

fn example(name: &str) -> String {
    std::fs::read_to_string(root().join("examples").join(name)).expect("the example ships with the repository")
}

/// The faults that `check --format json` finds: message and line.
fn faults(path: &Path) -> Vec<(String, Option<u64>)> {
    let output = run(&["check", &path.display().to_string(), "--format", "json"]);
    let text = stdout(&output);
    let document: serde_json::Value = serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"));
    let found: Vec<_> = document["faults"]
        .as_array()
        .expect("faults is an array")
        .iter()
        .map(|f| (f["message"].as_str().unwrap_or_default().to_owned(), f["line"].as_u64()))
        .collect();
    assert_eq!(code(&output), if found.is_empty() { 0 } else { 2 }, "{}", stderr(&output));
    found
}

fn assert_refused(path: &Path) -> String {
    let shown = path.display().to_string();
    for command in ["check", "evaluate"] {
        let output = run(&[command, &shown]);
        assert_eq!(code(&output), 2, "{command}: {}", stderr(&output));
        assert_eq!(stdout(&output), "", "{command}");
        assert!(stderr(&output).contains("error"), "{command}: {}", stderr(&output));
        assert!(!stderr(&output).contains("panicked"), "{command}: {}", stderr(&output));
    }
    stderr(&run(&["check", &shown])).to_owned()
}

/// A line `key = value` of a model file.
struct Line<'a> {
    index: usize,
    /// With its table, as errors name it; ramps' pieces are left to tests of their own.
    dotted: String,
    key: &'a str,
    value: &'a str,
}

fn lines(source: &str) -> Vec<Line<'_>> {
    let (mut table, mut found) = (String::new(), Vec::new());
    for (index, line) in source.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if let Some(head) = line.strip_prefix('[') {
            table = head.trim_start_matches('[').trim_end_matches(']').to_owned() + ".";
        } else if let Some((key, value)) = line.split_once('=') {
            let key = key.trim();
            found.push(Line { index, dotted: format!("{table}{key}"), key, value: value.trim() });
        }
    }
    found
}

fn with_line(source: &str, index: usize, replacement: Option<&str>) -> String {
    let changed = source.lines().enumerate().filter_map(|(i, line)| if i == index { replacement } else { Some(line) });
    changed.map(|line| line.to_owned() + "\n").collect()
}

/// Keys that a file may leave out.
const OPTIONAL: &[&str] = &[
    "fibre.thermal_expansion_per_k",
    "winding.radial_pitch_um",
    "winding.axial_pitch_um",
    "winding.pattern",
    "sensor.location",
    "sensor.rate_mean_s",
    "profiles.count",
    "profiles.segments",
    "profiles.duration_s",
    "profiles.seed",
    "search.windability",
    "search.seed",
];

/// Left out, these change which other keys are needed or agree; the error may name those instead.
const OPTIONAL_HERE: &[&str] = &["winding.length_m"];

/// Keys whose values may be negative.
const SIGNED: &[&str] = &["fibre.thermo_optic_per_k", "fibre.thermal_expansion_per_k"];

const EXAMPLES: [&str; 2] = ["paper-200m.toml", "coil-998m.toml"];

/// Checks that a change of one line is found as one fault that names the key and the line.
fn assert_one_fault(example_name: &str, change: &str, line: &Line, replacement: Option<&str>, expected: &str) {
    let source = example(example_name);
    let (_folder, path) = folder_with("coil.toml", with_line(&source, line.index, replacement));
    let found = faults(&path);
    let case = format!("{example_name}: {change} {}: {found:#?}", line.dotted);
    assert_eq!(found.len(), 1, "{case}");
    assert!(found[0].0.contains(expected), "expected \"{expected}\" in {case}");
    match replacement {
        Some(_) => assert_eq!(found[0].1, Some(line.index as u64 + 1), "{case}"),
        None => assert!(found[0].1.is_some() || !line.dotted.contains('.'), "{case}"),
    }
}

#[test]
fn a_needed_key_that_is_missing_is_named() {
    for name in EXAMPLES {
        for line in lines(&example(name)) {
            let dotted = line.dotted.as_str();
            if OPTIONAL.contains(&dotted) || (OPTIONAL_HERE.contains(&dotted) && name == "coil-998m.toml") {
                let (_folder, path) = folder_with("coil.toml", with_line(&example(name), line.index, None));
                assert_eq!(faults(&path), [], "{name} without {dotted}");
            } else if OPTIONAL_HERE.contains(&dotted) {
                assert_one_fault(name, "without", &line, None, "length");
            } else {
                assert_one_fault(name, "without", &line, None, line.key);
            }
        }
    }
}

#[test]
fn a_misspelt_key_is_named_with_the_one_that_was_meant() {
    for name in EXAMPLES {
        for line in lines(&example(name)) {
            let misspelt = format!("{}x = {}", line.key, line.value);
            assert_one_fault(name, "misspelt", &line, Some(&misspelt), &format!("did you mean {}?", line.key));
        }
    }
}

#[test]
fn a_value_of_the_wrong_type_is_named_with_the_type_that_was_expected() {
    for name in EXAMPLES {
        for line in lines(&example(name)) {
            for wrong in ["true", "{ a = 1 }", "1979-05-27"] {
                let replacement = format!("{} = {wrong}", line.key);
                assert_one_fault(name, "wrong type of", &line, Some(&replacement), line.key);
            }
        }
    }
}

#[test]
fn numbers_that_cannot_be_are_named_with_their_limits() {
    for name in EXAMPLES {
        for line in lines(&example(name)).into_iter().filter(|l| l.value.parse::<f64>().is_ok()) {
            let is_integer = line.value.parse::<i64>().is_ok();
            let mut wrong = vec!["nan", "inf", "-inf", "1e300", "9223372036854775807"];
            if line.key == "seed" {
                wrong.retain(|w| *w != "9223372036854775807");
            }
            if !SIGNED.contains(&line.dotted.as_str()) {
                wrong.push(if is_integer { "-1" } else { "-1.0" });
            }
            for value in wrong {
                let replacement = format!("{} = {value}", line.key);
                assert_one_fault(name, value, &line, Some(&replacement), line.key);
            }
        }
    }
}

#[test]
fn all_faults_of_a_file_come_at_once() {
    let source = example("paper-200m.toml")
        .replace("refractive_index = 1.447", "refractive_index = nan")
        .replace("layers = 12", "layers = 11")
        .replace("model = \"half_space\"", "model = \"half_spice\"")
        .replace("wavelength_nm", "wave_length_nm")
        .replace("rate_c_per_h = 0.0", "rate_c_per_hour = 0.0");
    let (_folder, path) = folder_with("coil.toml", source);
    let found = faults(&path);
    for expected in [
        "fibre.refractive_index",
        "winding.layers must be an even number",
        "thermal.model must be one of",
        "did you mean wavelength_nm?",
        "did you mean rate_c_per_h?",
    ] {
        assert!(found.iter().any(|(message, _)| message.contains(expected)), "{expected}: {found:#?}");
    }
    assert_eq!(found.len(), 5, "{found:#?}");
    assert!(assert_refused(&path).ends_with(&format!("5 faults in {}\n", path.display())));
}

#[test]
fn layer_counts_that_no_coil_has_are_refused() {
    for (layers, expected) in [
        ("1", "winding.layers must be an even number of at least 2, found 1"),
        ("11", "winding.layers must be an even number of at least 2, found 11"),
        ("0", "winding.layers"),
        ("22", "winding.layers must be a multiple of 4 for a quadrupole, found 22: use 20 or 24"),
    ] {
        let source = example("paper-200m.toml").replace("layers = 12", &format!("layers = {layers}"));
        let (_folder, path) = folder_with("coil.toml", source);
        let found = faults(&path);
        assert_eq!(found.len(), 1, "{layers}: {found:?}");
        assert!(found[0].0.contains(expected), "{layers}: {found:?}");
        assert_refused(&path);
    }
}

#[test]
fn a_pattern_that_does_not_fit_the_coil_is_refused() {
    let source = example("paper-200m.toml");
    for (pattern, expected) in [
        ("\"qud\"", "qua"),
        ("\"oct\"", "winding.layers must be a multiple of 8 for an octupole, found 12: use 8 or 16"),
        ("\"missing.toml\"", "missing.toml"),
        ("\"\"", "no winding is called"),
    ] {
        let (_folder, path) =
            folder_with("coil.toml", source.replace("pattern = \"qua\"", &format!("pattern = {pattern}")));
        let found = faults(&path);
        assert_eq!(found.len(), 1, "{pattern}: {found:?}");
        assert!(found[0].0.contains(expected), "{pattern}: {found:?}");
    }
}

#[test]
fn lengths_and_turns_that_disagree_are_refused() {
    let source = example("coil-998m.toml").replace("length_m = 998.0", "length_m = 1100.0");
    let (_folder, path) = folder_with("coil.toml", source);
    let found = faults(&path);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].0.starts_with("winding.length_m = 1100 disagrees with turns and radii, which make 986."),
        "{found:?}"
    );
}

#[test]
fn more_profiles_than_fit_into_memory_are_refused() {
    let source = example("coil-998m.toml").replace("count = 64", "count = 100000");
    let (_folder, path) = folder_with("coil.toml", source);
    let found = faults(&path);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].0.starts_with("profiles.count × profiles.segments make 400002 ramps"), "{found:?}");
    assert_refused(&path);
}

#[test]
fn places_that_cannot_be_written_are_named() {
    let (_folder, file) = folder_with("file", "in the way");
    let inside = file.join("results").display().to_string();
    for arguments in [&["reproduce", "yan1998", "-o", &inside][..], &["new", &inside]] {
        let output = run(arguments);
        assert_eq!(code(&output), 2, "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("cannot"), "{arguments:?}: {}", stderr(&output));
        assert_eq!(stdout(&output), "");
    }
}

#[test]
fn effects_that_are_not_known_twice_or_out_of_bounds_are_refused() {
    let source = example("coil-998m.toml");
    let film = "film_w_per_m2_k = 20.0";
    for (from, to, expected) in [
        ("\"surface_film\"", "\"surface_flim\"", "effect.kind \"surface_flim\" is not in the catalogue"),
        (film, "film_w_per_m2_k = -1.0", "effect.film_w_per_m2_k"),
        (film, "film_w_per_m2_k = 20.0\n[[effect]]\nkind = \"surface_film\"\nfilm_w_per_m2_k = 30.0", "declared twice"),
        (film, "film_w_per_m2_k = 20.0\n[[effect]]\nkind = \"custom\"\nformula = \"2 *\"", "effect.formula"),
        (film, "film_w_per_m2_k = 20.0\n[[effect]]\nfilm = 1", "missing key effect.kind"),
    ] {
        let (_folder, path) = folder_with("coil.toml", source.replace(from, to));
        let found = faults(&path);
        assert!(found.len() == 1 && found[0].0.contains(expected), "{expected}: {found:?}");
        assert_refused(&path);
    }
}

#[test]
fn files_that_are_no_model_at_all_are_refused() {
    let cases: [(&str, &[u8], &str); 8] = [
        ("empty", b"", "the file is empty"),
        ("blank", b" \n\t\n", "the file is empty"),
        ("binary", &[0x7f, b'E', b'L', b'F', 0, 1, 2, 3, 0, 0, 0], "NUL byte"),
        ("not UTF-8", &[b'a', b' ', b'=', b' ', b'"', 0xff, 0xfe, b'"'], "UTF-8"),
        ("no TOML", b"layers 12\n", "error"),
        ("a record", b"time_s,temperature_c,rate_deg_per_h\n0,20,0\n", "error"),
        ("a comment only", b"# nothing\n", "missing key name"),
        ("half a string", b"name = \"paper", "error"),
    ];
    for (case, contents, expected) in cases {
        let (_folder, path) = folder_with("coil.toml", contents);
        let shown = assert_refused(&path);
        assert!(shown.contains(expected), "{case}: {shown}");
    }
    assert!(assert_refused(&root().join("examples")).contains("expected a file, found a folder"));
    assert!(assert_refused(&root().join("examples/absent.toml")).contains("cannot be read"));
}

#[test]
fn wrong_pattern_files_are_refused() {
    let good = "name = \"p\"\nlayers = 12\nsegments = [6, 7, 8, 5, 4, 9, 10, 3, 2, 11, 12, 1]\n";
    let cases: [(&str, &str, &str); 10] = [
        ("[6, 7, 8,", "[6, 6, 8,", "segment 6 lies on layer 1 and again on layer 2"),
        ("[6, 7, 8,", "[0, 7, 8,", "segment 0 on layer 1 is outside 1 … 12"),
        ("[6, 7, 8,", "[13, 7, 8,", "segment 13 on layer 1 is outside 1 … 12"),
        ("[6, 7, 8,", "[-6, 7, 8,", "segment -6 on layer 1 is outside 1 … 12"),
        ("[6, 7, 8,", "[6.5, 7, 8,", "segments[0] must be an integer"),
        ("[6, 7, 8,", "[7, 8,", "layers is 12, but segments lists 11"),
        ("segments = [6, 7, 8, 5, 4, 9, 10, 3, 2, 11, 12, 1]", "segments = []", "layers is 12, but segments lists 0"),
        ("layers = 12", "layers = 10", "layers is 10, but segments lists 12"),
        ("segments", "segment", "did you mean segments?"),
        ("name = \"p\"\n", "", "missing key name"),
    ];
    for (from, to, expected) in cases {
        let (_folder, path) = folder_with("p.toml", good.replace(from, to));
        let output = run(&["evaluate", "examples/paper-200m.toml", "--pattern", &path.display().to_string()]);
        assert_eq!(code(&output), 2, "{to}: {}", stderr(&output));
        assert_eq!(stdout(&output), "");
        assert!(stderr(&output).contains(expected), "expected \"{expected}\" in {}", stderr(&output));
    }
    let one = "name = \"p\"\nlayers = 1\nsegments = [1]\n";
    let odd = "name = \"p\"\nlayers = 3\nsegments = [1, 2, 3]\n";
    let ten = "name = \"p\"\nlayers = 2\nsegments = [1, 2]\n";
    for (text, expected) in
        [(one, "layers"), (odd, "even number of at least 2 segments, found 3"), (ten, "has 2 layers")]
    {
        let (_folder, path) = folder_with("p.toml", text);
        let output = run(&["evaluate", "examples/paper-200m.toml", "--pattern", &path.display().to_string()]);
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    }
}

#[test]
fn arguments_that_make_no_sense_are_refused() {
    for arguments in [
        &["evaluat", "examples/paper-200m.toml"][..],
        &["evaluate"],
        &["evaluate", "examples/paper-200m.toml", "--format", "yaml"],
        &["evaluate", "examples/paper-200m.toml", "--pattern", "nonsense"],
        &["patterns", "--layers", "-4"],
        &["patterns", "--layers", "1"],
        &["new", "examples/paper-200m.toml"],
        &["reproduce", "nobody2001"],
        &[],
    ] {
        let output = run(arguments);
        assert_eq!(code(&output), 2, "{arguments:?}: {}", stderr(&output));
        assert_eq!(stdout(&output), "", "{arguments:?}");
        assert!(!stderr(&output).trim().is_empty(), "{arguments:?}");
    }
}
