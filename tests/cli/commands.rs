//! Commands that do what they are asked for.

use super::{code, folder_with, json, run, run_in, stderr, stdout};

#[test]
fn evaluate_answers_with_the_keys_that_scripts_read() {
    let answer = json(&["evaluate", "examples/paper-200m.toml", "--pattern", "zyl", "--pattern", "qua"]);
    assert_eq!(answer["schema_version"], 1);
    let patterns = answer["patterns"].as_array().unwrap();
    let names: Vec<&str> = patterns.iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["zyl", "qua"]);
    for pattern in patterns {
        for key in ["worst_rate_deg_per_h", "worst_phase_rad", "worst_time_s", "guaranteed_worst_rate_deg_per_h"] {
            assert!(pattern.get(key).is_some(), "{key}");
        }
        assert!(pattern["worst_profile"].is_string());
        for key in ["class", "reels", "captive", "max_climb"] {
            assert!(pattern["windability"].get(key).is_some(), "{key}");
        }
        assert_eq!(pattern["segments"].as_array().unwrap().len(), 12);
    }
}

#[test]
fn a_new_model_file_has_no_faults_and_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let written = run_in(folder.path(), &["new", "my coil"]);
    assert_eq!(code(&written), 0, "{}", stderr(&written));
    let checked = run_in(folder.path(), &["check", "my coil.toml"]);
    assert_eq!((code(&checked), stdout(&checked)), (0, "my coil.toml: no faults\n"));
    assert_eq!(code(&run_in(folder.path(), &["new", "my coil"])), 2);
}

#[test]
fn the_symmetric_winding_is_said_to_be_hard_to_make_and_why() {
    let output = run(&["patterns", "--layers", "12"]);
    assert_eq!(code(&output), 0);
    let reason =
        "after layer 7 the fibre of segments 7 to 11 is held at both its ends, by segments 6 and 12 on the coil";
    assert!(stderr(&output).contains(reason), "{}", stderr(&output));
    assert_eq!(stderr(&run(&["patterns", "--layers", "12", "--quiet"])), "");
}

#[test]
fn every_example_has_no_faults_and_can_be_evaluated() {
    let mut files: Vec<_> =
        std::fs::read_dir(super::root().join("examples")).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    assert!(files.len() >= 3);
    for file in files {
        let shown = file.display().to_string();
        let checked = run(&["check", &shown]);
        assert_eq!(code(&checked), 0, "{}", stderr(&checked));
        let answer = json(&["evaluate", &shown, "--pattern", "zyl"]);
        assert!(answer["patterns"][0]["worst_rate_deg_per_h"].as_f64().unwrap() > 0.0);
    }
}

/// The paper's coil with spreads of what is built and, if wanted, further lines in front of them.
fn spread_model(folder: &std::path::Path, spreads: &str) -> String {
    let path = folder.join("spread.toml");
    let source = std::fs::read_to_string(super::root().join("examples/paper-200m.toml")).unwrap();
    std::fs::write(&path, source + spreads).unwrap();
    path.display().to_string()
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_search_for_p95_reports_what_tolerance_reports_and_writes_the_same_bytes_at_any_number_of_threads() {
    let root = tempfile::tempdir().unwrap();
    let spreads = "\n[tolerance]\nturns_per_layer_sd = 0.3\nmismatch_sd = 0.001\nsamples = 20\n";
    let model = spread_model(root.path(), spreads);
    let run_with = |threads: &str| {
        let folder = root.path().join(threads).display().to_string();
        let short = ["--rounds", "1", "--moves-per-restart", "300", "--restarts", "2"];
        let request = [&["optimise", &model, "--objective", "p95", "--threads", threads, "-o", &folder], &short[..]];
        json(&request.concat())
    };
    let (one, two) = (run_with("1"), run_with("2"));
    for file in ["best.toml", "summary.json", "baselines.csv", "history.csv", "checkpoint.json"] {
        let read = |threads: &str| std::fs::read(root.path().join(threads).join(file)).unwrap();
        assert_eq!(read("1"), read("2"), "{file}");
    }
    assert_eq!(one["best"], two["best"]);
    assert!(one["baselines"].as_array().unwrap().iter().any(|b| b["name"] == "qua"));
    let best = root.path().join("1/best.toml").display().to_string();
    let studied = json(&["tolerance", &model, "--pattern", &best]);
    let (found, studied) = (&one["best"]["p95_rate_deg_per_h"], &studied["patterns"][0]["p95_deg_per_h"]);
    assert!(found.is_f64() && found == studied, "{found} {studied}");
}

/// Wherever a search over built coils says what 95 % of them stay below, it says the same.
#[test]
fn p95_is_one_number_in_words_json_pages_and_files() {
    let root = tempfile::tempdir().unwrap();
    let model = spread_model(root.path(), "\n[tolerance]\nturns_per_layer_sd = 0.3\nsamples = 20\n");
    let folder = root.path().join("run");
    let asked =
        ["optimise", &model, "--objective", "p95", "--rounds", "1", "--moves-per-restart", "300", "--restarts", "2"];
    let output = run(&[&asked[..], &["-o", folder.to_str().unwrap(), "-q"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let words = stdout(&output);
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let (summary, page, table) = (read("summary.json"), read("report.html"), read("baselines.csv"));
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let patterns = summary["baselines"].as_array().unwrap().iter().chain([&summary["best"]]);
    let known: Vec<(&str, f64)> =
        patterns.map(|p| (p["name"].as_str().unwrap(), p["p95_rate_deg_per_h"].as_f64().unwrap())).collect();
    assert!(known.len() > 3);
    let column = table.lines().next().unwrap().split(',').position(|head| head == "p95_rate_deg_per_h").unwrap();
    for (name, p95) in &known {
        let shown = format!("{p95:.4}");
        let mut below = words.lines().skip_while(|line| !line.contains("P95 °/h"));
        let row = below.find(|line| line.split_whitespace().next() == Some(name)).unwrap();
        assert!(row.split_whitespace().any(|cell| cell == shown), "{row}: {shown}");
        let row = page.split(&format!("<td class=\"word\">{name}</td>")).nth(1).unwrap().split("</tr>").next().unwrap();
        assert!(row.contains(&format!("<td>{shown}</td>")), "{row}: {shown}");
        let row = table.lines().find(|line| line.starts_with(&format!("{name},"))).unwrap();
        assert_eq!(row.split(',').nth(column).unwrap().parse(), Ok(*p95));
    }
    let (best, p95) = known[known.len() - 1];
    assert!(read("best.toml").contains(&format!("# P95 over built coils: {p95:.6} deg/h")));
    assert!(page.contains(&format!("<dt>95 % of built coils stay below</dt><dd>{p95:.4} °/h</dd>")));
    // What is drawn is captioned and marked with it.
    let caption = format!("{best}: as designed ");
    let caption = page.split(&caption).nth(1).unwrap().split("; of its variance").next().unwrap();
    assert!(caption.ends_with(&format!("95 % below {p95:.4} °/h")), "{caption}");
    // Sentences that weigh patterns name theirs.
    let reasons = summary["recommendation"]["reasons"].as_array().unwrap();
    let mut weighed = 0;
    for reason in reasons.iter().filter_map(|reason| reason.as_str()) {
        let Some((before, _)) = reason.split_once(" for 95 % of built coils") else { continue };
        let (name, said) = (reason.split(':').next().unwrap(), before.rsplit(' ').next().unwrap());
        if let Some((_, p95)) = known.iter().find(|(known, _)| *known == name) {
            assert_eq!(said, format!("{p95:.4}"), "{reason}");
            weighed += 1;
        }
    }
    assert!(weighed > 0, "{reasons:?}");
}

#[test]
fn a_search_for_p95_without_tolerances_is_told_what_is_missing() {
    let output = run(&["optimise", "examples/paper-200m.toml", "--objective", "p95"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("[tolerance]"), "{}", stderr(&output));
    let root = tempfile::tempdir().unwrap();
    let model = spread_model(root.path(), "");
    let source = std::fs::read_to_string(&model).unwrap();
    std::fs::write(&model, source.replace("[search]\n", "[search]\nobjective = \"p95\"\n")).unwrap();
    let output = run(&["check", &model]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("[tolerance]"), "{}", stderr(&output));
}

#[test]
fn optimise_says_what_a_former_pattern_costs_and_whether_the_best_one_changed() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("old").display().to_string();
    let quick = ["optimise", "examples/paper-200m.toml", "--rounds", "1", "--moves-per-restart", "2000", "-q"];
    let first = json(&[&quick[..], &["--compare-with", "zyl", "-o", &out]].concat());
    let former = &first["compared_with"];
    assert_eq!((former["name"].as_str(), former["best_changed"].as_bool()), (Some("zyl"), Some(true)));
    let cost = |value: &serde_json::Value, key: &str| value[key].as_f64().unwrap();
    let factor = cost(former, "cost_deg_per_h") / cost(&first["best"], "worst_rate_deg_per_h");
    assert!((cost(former, "cost_factor") / factor - 1.0).abs() < 1e-9 && factor > 1.0);
    let page = std::fs::read_to_string(folder.path().join("old/report.html")).unwrap();
    assert!(page.contains("The best pattern changed: under this model the former one, zyl, costs 9.6566 °/h"));
    // The folder of a search stands for its best pattern.
    let again = json(&[&quick[..], &["--compare-with", &out]].concat());
    assert_eq!(again["compared_with"]["best_changed"], false);
    assert_eq!(again["compared_with"]["segments"], first["best"]["segments"]);
    let refused = run(&[&quick[..], &["--compare-with", "examples"]].concat());
    assert_eq!((code(&refused), stdout(&refused)), (2, ""));
    assert!(stderr(&refused).contains("holds no best.toml"), "{}", stderr(&refused));
}

#[test]
fn a_group_index_scales_every_rate_error_by_how_much_longer_light_takes() {
    let plain = std::fs::read_to_string(super::root().join("examples/paper-200m.toml")).unwrap();
    let text = plain.replacen("refractive_index = 1.447", "refractive_index = 1.447\ngroup_index = 1.468", 1);
    assert_ne!(text, plain);
    let (folder, path) = super::folder_with("group.toml", text);
    let model = path.display().to_string();
    let worst = |model: &str| super::json(&["evaluate", model, "--pattern", "qua"])["patterns"][0].clone();
    let (with, without) = (worst(&model), worst("examples/paper-200m.toml"));
    for key in ["worst_rate_deg_per_h", "worst_phase_rad"] {
        let ratio = with[key].as_f64().unwrap() / without[key].as_f64().unwrap();
        assert!((ratio * 1.447 / 1.468 - 1.0).abs() < 1e-9, "{key} {ratio}");
    }
    // The second solution knows it too.
    for arguments in
        [["schedule", &model, "--pattern", "qua", "-o", "out"].as_slice(), &["verify", &model, "out/schedule.json"]]
    {
        let done = super::run_in(folder.path(), arguments);
        assert_eq!(super::code(&done), 0, "{}{}", String::from_utf8_lossy(&done.stdout), super::stderr(&done));
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn turns_at_the_ends_and_a_split_layer_are_chosen_scheduled_and_verified() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let shop = folder.path().join("shop");
    let (run, shop) = (run.to_str().unwrap(), shop.to_str().unwrap());
    let model = "examples/paper-200m.toml";
    let quick = ["--rounds", "1", "--moves-per-restart", "200"];
    let chosen = [&["optimise", model, "--trim-turns", "3", "--split-layer", "-o", run], &quick[..]].concat();
    let found = json(&chosen);
    let ends = &found["ends"];
    let (a, b) = (ends["best"]["end_a_turns"].as_i64().unwrap(), ends["best"]["end_b_turns"].as_i64().unwrap());
    // With the outermost layer's temperature prescribed, what both ends share of it cancels.
    assert!(a * b < 0 && (-3..=0).contains(&(a + b)), "{a} {b}");
    let of = |value: &serde_json::Value| value["worst_rate_deg_per_h"].as_f64().unwrap();
    assert!(of(&ends["best"]) < 0.5 * of(&found["best"]), "{ends}");
    assert_eq!(ends["best"]["windability"]["captive"], 0);
    let pattern = format!("{run}/ends.toml");
    let again = json(&["evaluate", model, "--pattern", &pattern]);
    assert_eq!(of(&again["patterns"][0]), of(&ends["best"]));
    json(&["schedule", model, "--pattern", &pattern, "-o", shop]);
    for file in ["schedule.csv", "traveller.html", "traveller.csv", "program.gcode"] {
        let verified = json(&["verify", model, &format!("{shop}/{file}")]);
        assert_eq!(verified["violations"].as_array().unwrap().len(), 0, "{file}");
    }
    json(&["verify", model, &format!("{run}/ends-schedule.json")]);
}

#[test]
#[ignore = "long: --include-ignored"]
fn trim_says_which_cut_leaves_the_smallest_error_and_where_a_cut_makes_it_larger() {
    let arguments = ["trim", "examples/chamber-coil.toml", "examples/chamber-day-1.csv"];
    let found = json(&arguments);
    let of = |key: &str| found[key].as_f64().unwrap();
    let least = &found["least"];
    let smallest = least["rate_deg_per_h"].as_f64().unwrap();
    // The surplus balances a part of what the cylindrical winding makes by itself.
    assert!(of("predicted_rate_deg_per_h") > of("present_rate_deg_per_h"));
    assert!(smallest < 0.95 * of("present_rate_deg_per_h"), "{least}");
    let words = stdout(&run(&arguments)).to_owned();
    assert!(words.contains("it grows, because") && words.contains("smallest error"), "{words}");
}

/// Fourteen unequal layers behind a film, whose pointing error has very many minima: before searches had their end in common, seeds 1
/// and 2 ended two thirds apart.
const MANY_MINIMA: &str = r#"
name = "fourteen"
[fibre]
refractive_index = 1.456
thermo_optic_per_k = 1.0e-5
wavelength_nm = 1550.0
outer_diameter_um = 250.0
[winding]
layers = 14
turns_per_layer = 52
inner_diameter_mm = 90.0
radial_pitch_um = 255.0
axial_pitch_um = 258.0
layer_length = "actual"
pattern = "sym"
[thermal]
model = "pack"
conductivity_w_per_m_k = 0.28
volumetric_heat_capacity_j_per_m3_k = 1.9e6
[sensor]
location = "ambient"
[[effect]]
kind = "surface_film"
film_w_per_m2_k = 40.0
[profiles]
max_rate_c_per_h = 60.0
count = 8
segments = 5
duration_s = 5000.0
seed = 1
"#;

#[test]
#[ignore = "long: --include-ignored"]
fn seeds_end_on_the_same_pattern_in_a_class_whose_minima_are_many() {
    let (_folder, model) = folder_with("coil.toml", MANY_MINIMA);
    let found = ["1", "2"].map(|seed| {
        let asked = ["--windability", "any", "--objective", "pointing", "--seed", seed];
        let body = json(&[&["optimise", model.to_str().unwrap()][..], &asked].concat());
        body["best"]["worst_pointing_error_deg"].as_f64().unwrap().abs()
    });
    assert!((found[0] / found[1] - 1.0).abs() < 0.01, "{found:?}");
}
