//! The explorer's page in a real browser, from disk and without network: what it shows is what `evaluate` says of what it saves.
//!
//! Skips with a clear line where no Chromium is installed.

use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};

use super::browser::browser;
use super::remote::Page;
use crate::{code, run_in, stderr, stdout};

/// A pack behind a film, on a spool, with what no closed form has; few profiles, so that the program is quick in a debug build.
const MODEL: &str = "\
name = \"<b>hand & coil</b>\"
[fibre]
refractive_index = 1.45
thermo_optic_per_k = 1e-5
wavelength_nm = 1550.0
outer_diameter_um = 165.0
[winding]
layers = 16
turns_per_layer = 40
inner_diameter_mm = 60.0
layer_length = \"actual\"
pattern = \"own.toml\"
[thermal]
model = \"pack\"
conductivity_w_per_m_k = 0.35
volumetric_heat_capacity_j_per_m3_k = 1.7e6
[sensor]
location = \"ambient\"
[[effect]]
kind = \"surface_film\"
film_w_per_m2_k = 30.0
[profiles]
max_rate_c_per_h = 60.0
count = 6
";
const LAYERS: usize = 16;
const PATTERNS: usize = 10;

/// Permutations that no two runs differ in (Fisher and Yates, with a multiplicative generator).
fn shuffled(seed: u64) -> Vec<usize> {
    let mut state = seed.wrapping_mul(2_862_933_555_777_941_757).wrapping_add(3_037_000_493);
    let mut segments: Vec<usize> = (1..=LAYERS).collect();
    for i in (1..LAYERS).rev() {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        segments.swap(i, (state >> 33) as usize % (i + 1));
    }
    segments
}

fn words(segments: &[usize]) -> String {
    segments.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
}

/// Waits until the page shows a pattern; the cells of its row.
fn shown(page: &mut Page, segments: &[usize]) -> Vec<String> {
    let wanted = words(segments);
    page.until(&format!("!document.body.dataset.busy && document.body.dataset.shown === '{wanted}'"));
    let cells = page.value("[...document.querySelectorAll('[data-cell]')].map((cell) => cell.textContent)");
    cells.as_array().unwrap().iter().map(|cell| cell.as_str().unwrap().to_owned()).collect()
}

/// The rows of the program's table, split where two spaces stand.
fn rows(text: &str) -> Vec<Vec<String>> {
    let cells = |line: &str| line.split("  ").map(str::trim).filter(|c| !c.is_empty()).map(str::to_owned).collect();
    text.lines().skip(1).map(cells).collect()
}

#[test]
fn what_the_page_shows_of_ten_patterns_is_what_evaluate_says_of_the_files_it_saves() {
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().unwrap();
    let own = (1..=LAYERS).rev().collect::<Vec<_>>();
    std::fs::write(folder.path().join("hand.toml"), MODEL).unwrap();
    let own_file = format!("name = \"own\"\nlayers = {LAYERS}\nsegments = {own:?}\n");
    std::fs::write(folder.path().join("own.toml"), own_file).unwrap();
    let made = run_in(folder.path(), &["explore", "hand.toml", "--format", "json"]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    let answer: Value = serde_json::from_str(stdout(&made)).unwrap();
    assert!(answer["bytes"].as_u64().is_some_and(|bytes| bytes < 2_000_000), "{answer}");

    let saved = folder.path().join("saved");
    std::fs::create_dir(&saved).unwrap();
    let mut page = Page::open(browser, folder.path(), &folder.path().join("explorer.html"), &saved);
    shown(&mut page, &own);
    let mut expected = Vec::new();
    for i in 0..PATTERNS {
        let (name, segments) = (format!("random-{i}"), shuffled(i as u64 + 1));
        // Typed, as a hand types it; the last by dragging a layer of the one before.
        let segments = if i + 1 < PATTERNS {
            let wanted = words(&segments);
            page.value(&format!("{SETTING}; set('name', '{name}'); set('typed', '{wanted}')"));
            segments
        } else {
            let mut segments = shuffled(i as u64);
            shown(&mut page, &segments);
            page.drag(".layer[data-layer='3']", ".layer[data-layer='7']");
            let taken = segments.remove(2);
            segments.insert(6, taken);
            shown(&mut page, &segments);
            page.value(&format!("{SETTING}; set('name', '{name}')"));
            segments
        };
        page.until(&format!("document.querySelector('[data-cell=\"0\"]').textContent === 'this: {name}'"));
        let cells = shown(&mut page, &segments);
        page.value("document.getElementById('keep-pattern').click()");
        page.wait_for(&saved.join(format!("{name}.toml")));
        expected.push(cells);
    }
    let title = page.value("document.title");
    assert_eq!(title, json!("Explorer: <b>hand & coil</b>"));
    assert_eq!(page.complaints(), Vec::<String>::new());
    page.close();

    let files: Vec<String> = (0..PATTERNS).map(|i| format!("saved/random-{i}.toml")).collect();
    let mut arguments = vec!["evaluate", "hand.toml", "-q"];
    for file in &files {
        arguments.extend(["--pattern", file]);
    }
    let evaluated = run_in(folder.path(), &arguments);
    assert_eq!(code(&evaluated), 0, "{}", stderr(&evaluated));
    for (mut found, wanted) in expected.into_iter().zip(rows(stdout(&evaluated))) {
        found[0] = found[0].replace("this: ", "");
        assert_eq!(found, wanted);
    }
}

const SETTING: &str = "var set = (id, value) => { const it = document.getElementById(id); it.value = value; \
                       it.dispatchEvent(new Event('change')); }";

/// A script that ran would be seen by the page's title.
#[test]
fn a_page_with_hostile_names_runs_no_script_but_its_own() {
    let Some(browser) = browser() else { return };
    let hostile = "</script><script>document.title='ran'</script><img src=x onerror=document.title='ran'>";
    let folder = tempfile::tempdir().unwrap();
    let name = serde_json::to_string(hostile).unwrap();
    let model = super::ways::model(hostile);
    std::fs::write(folder.path().join("model.toml"), model).unwrap();
    std::fs::write(folder.path().join("pattern.toml"), super::ways::pattern(hostile)).unwrap();
    let made = run_in(folder.path(), &["explore", "model.toml", "pattern.toml", "-o", "page.html"]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    let mut page = Page::open(browser, folder.path(), &folder.path().join("page.html"), folder.path());
    shown(&mut page, &[2, 3, 4, 1]);
    assert_eq!(page.value("document.title"), json!(format!("Explorer: {hostile}")));
    assert_eq!(page.value("document.querySelectorAll('img, iframe, script').length"), json!(3));
    let first = page.value("document.querySelector('[data-cell=\"0\"]').textContent");
    assert_eq!(first, json!(format!("this: {}", serde_json::from_str::<String>(&name).unwrap())));
    assert_eq!(page.complaints(), Vec::<String>::new());
    page.close();
}

/// What the program carries was built from an older model, if this fails: run `explorer/build`.
#[test]
fn the_module_that_the_program_carries_answers_as_the_library_does() {
    if !std::process::Command::new("node").arg("--version").output().is_ok_and(|out| out.status.success()) {
        println!("skipped: node is not installed");
        return;
    }
    let paper = std::fs::read_to_string("examples/paper-200m.toml").unwrap().replace("count = 64", "count = 4");
    let pack = MODEL.replace("pattern = \"own.toml\"\n", "")
        + "[[effect]]\nkind = \"bias_temperature\"\n\
        linear_deg_per_h_per_k = 0.01\n[tolerance]\nturns_per_layer_sd = 0.1\n";
    let mut requests = Vec::new();
    for (source, layers) in [(paper, 12), (pack, LAYERS)] {
        let segments: Vec<usize> = shuffled(layers as u64).into_iter().filter(|s| *s <= layers).collect();
        requests.push(
            json!({ "ask": "open", "file": "m.toml", "source": source, "settings": { "max_rate_c_per_h": 33.0 } }),
        );
        for (ask, more) in [
            ("worst", json!({})),
            ("judge", json!({ "name": "x" })),
            ("swap", json!({ "as_easy": false })),
            ("moment", json!({ "profile": "sampled-2", "time_s": 1234.5 })),
            ("save", json!({ "name": "x" })),
            ("series", json!({ "profile": "sampled-1", "patterns": [segments] })),
        ] {
            let mut request = json!({ "ask": ask, "segments": segments });
            request.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
            requests.push(request);
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let asked = folder.path().join("requests.json");
    std::fs::write(&asked, json!(requests).to_string()).unwrap();
    let node = std::process::Command::new("node")
        .args(["tests/cli/ask_module.mjs", "src/report/explorer/model.wasm.gz"])
        .arg(&asked)
        .output()
        .unwrap();
    assert!(node.status.success(), "{}", String::from_utf8_lossy(&node.stderr));
    let answers: Vec<Value> = serde_json::from_slice(&node.stdout).unwrap();
    let mut session = coilwright::task::explore::Session::default();
    for (request, answer) in requests.iter().zip(&answers) {
        let wanted: Value = serde_json::from_str(&session.answer(&request.to_string())).unwrap();
        assert!(wanted.get("error").is_none(), "{request}: {wanted}");
        alike(&wanted, answer, &request["ask"].to_string());
    }
}

/// Words alike, numbers but for rounding: the two are compiled with other mathematical functions.
fn alike(a: &Value, b: &Value, at: &str) {
    match (a, b) {
        (Value::Object(one), Value::Object(other)) => {
            assert!(one.keys().eq(other.keys()), "{at}: {a} {b}");
            one.iter().for_each(|(key, value)| alike(value, &other[key], &format!("{at}.{key}")));
        }
        (Value::Array(one), Value::Array(other)) => {
            assert_eq!(one.len(), other.len(), "{at}");
            let largest = one.iter().filter_map(Value::as_f64).fold(0.0, |most: f64, v| most.max(v.abs()));
            for (i, (x, y)) in one.iter().zip(other).enumerate() {
                match (x.as_f64(), y.as_f64()) {
                    (Some(x), Some(y)) => assert!((x - y).abs() <= 1e-6 * largest, "{at}[{i}]: {x} {y}"),
                    _ => alike(x, y, &format!("{at}[{i}]")),
                }
            }
        }
        (Value::Number(x), Value::Number(y)) => {
            let (x, y) = (x.as_f64().unwrap(), y.as_f64().unwrap());
            // At a maximum the curve is flat: a search for it that takes another turn in the last bits ends elsewhere. The
            // grid's margin is a difference that may be all rounding: it is held against what a reader can see of a rate. What
            // is outside the coil follows a temperature that here is close to where it began.
            let coarse = ["margin", "time", "rest"].iter().any(|part| at.contains(part));
            let allowed = if coarse { 1e-3 } else { 1e-6 };
            let least = if at.contains("margin") { 1e-3 } else { 1e-12 };
            assert!((x - y).abs() <= allowed * x.abs().max(least), "{at}: {x} {y}");
        }
        // Numbers in words, as the table prints them.
        (Value::String(x), Value::String(y)) if at.contains("cells") && x.parse::<f64>().is_ok() => {
            let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
            assert!((x - y).abs() <= 1e-3 * x.abs().max(0.1), "{at}: {x} {y}");
        }
        _ => assert_eq!(a, b, "{at}"),
    }
}

/// How long a hand waits at most in these tests; a machine under load computes for seconds.
pub(super) const PATIENCE: Duration = Duration::from_secs(90);

#[test]
fn the_command_writes_one_file_that_asks_for_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/paper-200m.toml");
    let made = run_in(folder.path(), &["explore", model.to_str().unwrap()]);
    assert_eq!((code(&made), stdout(&made)), (0, "explorer.html\n"));
    let page = std::fs::read_to_string(folder.path().join("explorer.html")).unwrap();
    for outside in ["src=", "href=\"http", "url(", "@import", "<img", "fetch("] {
        assert!(!page.contains(outside), "asks for {outside}");
    }
    let unknown = run_in(folder.path(), &["explore", model.to_str().unwrap(), "quo"]);
    assert_eq!(code(&unknown), 2);
}
