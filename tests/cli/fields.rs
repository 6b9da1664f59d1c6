//! `--field`: temperatures from elsewhere drive `evaluate`, `optimise` and `compare`.

use std::fmt::Write;

use coilwright::io::model::NamedPattern;
use coilwright::io::read::field_file::read_field;
use coilwright::io::read::model_file::read_model;
use coilwright::pattern::Pattern;
use coilwright::pattern::windability::WindabilityClass;
use coilwright::task::{Unobserved, field};
use coilwright::units::deg_per_h_from_rad_per_s;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::{code, folder_with, json, run, run_in, stderr, stdout};

const PAPER: &str = "examples/paper-200m.toml";

/// Windings by name: worst rate, when, and phase, as `evaluate` says.
fn worst_cases(answer: &Value) -> Vec<(String, Value, Value, Value)> {
    let of = |p: &Value| {
        let name = p["name"].as_str().unwrap().to_owned();
        (name, p["worst_rate_deg_per_h"].clone(), p["worst_time_s"].clone(), p["worst_phase_rad"].clone())
    };
    answer["patterns"].as_array().unwrap().iter().map(of).collect()
}

/// A model that the worst case of depends on kinks, on peaks between them, on moments and on the ambient.
const FLANGED: &str = "name = \"flanged\"\n[fibre]\nrefractive_index = 1.45\nthermo_optic_per_k = 1e-5\nwavelength_nm = 1550.0\n\
    outer_diameter_um = 165.0\n[winding]\nlayers = 8\nturns_per_layer = 50\ninner_diameter_mm = 80.0\nlayer_length = \"actual\"\n\
    pattern = \"sym\"\n[thermal]\nmodel = \"pack\"\nconductivity_w_per_m_k = 0.35\nvolumetric_heat_capacity_j_per_m3_k = 1.7e6\n\
    [sensor]\nlocation = \"ambient\"\nrate_mean_s = 0.0\n[[effect]]\nkind = \"surface_film\"\nfilm_w_per_m2_k = 20.0\n\
    [[effect]]\nkind = \"axial_gradient\"\nfilm_w_per_m2_k = 30.0\nflange = \"first\"\n\
    [[effect]]\nkind = \"midpoint_offset\"\noffset_m = 0.02\nlead = \"ambient\"\n\
    [profiles]\nmax_rate_c_per_h = 60.0\ncount = 0\n[[profiles.ramp]]\nname = \"there and back\"\n\
    pieces = [{ rate_c_per_h = 60.0, duration_s = 700.0 }, { rate_c_per_h = -40.0, duration_s = 900.0 }, { rate_c_per_h = 0.0, duration_s = 500.0 }]\n\
    [search]\nwindability = \"standard\"\nseed = 1\n";

#[test]
fn a_field_that_was_written_and_read_again_has_the_same_worst_cases_to_the_last_digit() {
    for (name, source) in [
        ("paper.toml", std::fs::read_to_string(super::root().join(PAPER)).unwrap()),
        ("flanged.toml", FLANGED.to_owned()),
    ] {
        // One profile: a field is one case.
        let source = match name {
            "paper.toml" => source.replace("count = 64", "count = 0"),
            _ => source,
        };
        let (folder, path) = folder_with(name, source);
        let model = path.display().to_string();
        let written = run_in(folder.path(), &["temperatures", &model, "--as-judged"]);
        assert_eq!(code(&written), 0, "{}", stderr(&written));
        let field = folder.path().join("field.csv");
        std::fs::write(&field, stdout(&written)).unwrap();
        let under_profile = json(&["evaluate", &model]);
        let under_field = json(&["evaluate", &model, "--field", &field.display().to_string()]);
        assert_eq!(worst_cases(&under_field), worst_cases(&under_profile), "{name}");
        assert_eq!(under_field["fields"][0]["rates"], "given");
        assert_eq!(under_field["patterns"][0]["worst_profile"], "field");
        assert_eq!(under_field["patterns"][0]["guaranteed_worst_rate_deg_per_h"], Value::Null);
        // What is written for people has fewer digits, and is read too.
        let plain = folder.path().join("plain.csv");
        let text = run_in(folder.path(), &["temperatures", &model, "--rows", "2001"]);
        std::fs::write(&plain, stdout(&text)).unwrap();
        let roughly = json(&["evaluate", &model, "--field", &plain.display().to_string(), "--pattern", "zyl"]);
        let of = |answer: &Value, name: &str| {
            let all = answer["patterns"].as_array().unwrap();
            all.iter().find(|p| p["name"] == name).unwrap()["worst_rate_deg_per_h"].as_f64().unwrap()
        };
        let (rough, exact) = (of(&roughly, "zyl"), of(&under_profile, "zyl"));
        assert!((rough / exact - 1.0).abs() < 0.01, "{name}: {rough} {exact}");
    }
}

/// Twelve layers that warm by their own speeds, in a finite-element program's layouts.
fn temperature_c(layer: usize, time_s: f64) -> f64 {
    20.0 + time_s / 60.0 * (1.0 + 0.02 * layer as f64) + 0.3 * (time_s / 200.0 + layer as f64).sin()
}

#[test]
fn a_search_under_fields_finds_the_best_of_all_standard_patterns_under_them() {
    let mut wide =
        "time_min;".to_owned() + &(1..=12).map(|j| format!("layer_{j}_k")).collect::<Vec<_>>().join(";") + "\n";
    let mut long = "layer,time_s,temperature_c,node\n".to_owned();
    for i in 0..40 {
        let time_s = 15.0 * f64::from(i);
        let cells = (1..=12).map(|j| (temperature_c(j, time_s) + 273.15).to_string().replace('.', ","));
        writeln!(wide, "{};{}", (time_s / 60.0).to_string().replace('.', ","), cells.collect::<Vec<_>>().join(";"))
            .unwrap();
    }
    for layer in 1..=12 {
        for i in 0..40 {
            let time_s = 15.0 * f64::from(i);
            writeln!(long, "{layer},{time_s},{},7", temperature_c(layer, time_s)).unwrap();
        }
    }
    let (folder, wide_path) = folder_with("wide.csv", wide);
    let long_path = folder.path().join("long.csv");
    std::fs::write(&long_path, long).unwrap();
    let (wide, long) = (wide_path.display().to_string(), long_path.display().to_string());
    let out = folder.path().join("found").display().to_string();
    let found = json(&["optimise", PAPER, "--field", &wide, "--patience", "2", "-o", &out]);
    let again = json(&["optimise", PAPER, "--field", &long, "--patience", "2"]);
    assert_eq!(found["best"]["segments"], again["best"]["segments"]);
    let rate = |p: &Value| p["worst_rate_deg_per_h"].as_f64().unwrap();
    assert!((rate(&found["best"]) / rate(&again["best"]) - 1.0).abs() < 1e-9);
    assert!(found["improvement_over_qua"].as_f64().unwrap() >= 1.0 && found["proof"]["status"] == "none");
    // The pattern that it wrote costs what it says.
    let best = folder.path().join("found/best.toml").display().to_string();
    let judged = json(&["evaluate", PAPER, "--field", &long, "--field", &wide, "--pattern", &best]);
    assert!((rate(&judged["patterns"][0]) / rate(&found["best"]) - 1.0).abs() < 1e-9);
    assert!(folder.path().join("found/schedule.csv").exists() && folder.path().join("found/summary.json").exists());
    let refused = run(&["optimise", PAPER, "--field", &wide, "--objective", "guaranteed-rate"]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("expected worst-rate, worst-phase or rms"), "{}", stderr(&refused));
}

fn permutations(left: Vec<usize>) -> Vec<Vec<usize>> {
    if left.is_empty() {
        return vec![Vec::new()];
    }
    let with = |i: usize| {
        let mut rest = left.clone();
        let first = rest.remove(i);
        permutations(rest).into_iter().map(move |tail| [vec![first], tail].concat())
    };
    (0..left.len()).flat_map(with).collect()
}

#[test]
fn a_proof_under_a_field_is_of_the_best_of_every_pattern_of_its_class() {
    let (folder, path) = folder_with("six.toml", FLANGED.replace("layers = 8", "layers = 6"));
    let model = path.display().to_string();
    let field = folder.path().join("field.csv");
    std::fs::write(&field, stdout(&run(&["temperatures", &model, "--rows", "61"]))).unwrap();
    let (file, given) = (read_model(&path).unwrap(), read_field(&field).unwrap().field);
    let named = |segments: Vec<usize>| NamedPattern { name: "p".into(), pattern: Pattern::new(segments).unwrap() };
    let all: Vec<NamedPattern> = permutations((1..=6).collect()).into_iter().map(named).collect();
    let request = field::Request { model: &file, field: &given.states(), patterns: &all };
    let judged = field::run(&request, &Unobserved).unwrap();
    let field = field.display().to_string();
    for class in [WindabilityClass::Standard, WindabilityClass::Captive(1), WindabilityClass::Any] {
        for objective in ["worst-rate", "rms"] {
            let cost = |rates: &[f64]| match objective {
                "rms" => (rates.iter().map(|r| r * r).sum::<f64>() / rates.len() as f64).sqrt(),
                _ => rates.iter().fold(0.0, |most: f64, r| most.max(r.abs())),
            };
            let of_class = judged.iter().filter(|p| class.admits(&p.named.pattern));
            let least = of_class.map(|p| cost(&p.rate_rad_per_s)).fold(f64::INFINITY, f64::min);
            let (least, class) = (deg_per_h_from_rad_per_s(least), class.to_string());
            let under = [&model, "--field", &field, "--windability", &class, "--objective", objective];
            let found = json(&[&["optimise"], &under[..], &["--patience", "1", "--prove", "60s"]].concat());
            let exact = json(&[&["exact"], &under[..]].concat());
            for answer in [&found, &exact] {
                assert_eq!(answer["proof"]["status"], "optimal", "{class} {objective}");
                let bound = answer["proof"]["lower_bound_deg_per_h"].as_f64().unwrap();
                assert!((bound / least - 1.0).abs() < 1e-8, "{class} {objective}: {bound} {least}");
            }
            let best = found["best"]["segments"].as_array().unwrap();
            let best: Vec<usize> = best.iter().map(|s| s.as_u64().unwrap() as usize).collect();
            let own = judged.iter().find(|p| p.named.pattern.segments() == best).unwrap();
            let own = deg_per_h_from_rad_per_s(cost(&own.rate_rad_per_s));
            assert!((own / least - 1.0).abs() < 1e-9, "{class} {objective}: {own} {least}");
            assert!(found["statement"].as_str().unwrap().contains("Proved"), "{}", found["statement"]);
        }
    }
}

#[test]
fn a_search_under_a_field_that_was_interrupted_ends_as_if_it_had_not_been() {
    let rows = |shift_c: f64| {
        let head =
            "time_s,".to_owned() + &(1..=12).map(|j| format!("layer_{j}_c")).collect::<Vec<_>>().join(",") + "\n";
        (0..40).map(|i| 15.0 * f64::from(i)).fold(head, |mut text, time_s| {
            let cells = (1..=12).map(|j| (temperature_c(j, time_s) + shift_c * time_s * j as f64).to_string());
            writeln!(text, "{time_s},{}", cells.collect::<Vec<_>>().join(",")).unwrap();
            text
        })
    };
    let (folder, field) = folder_with("field.csv", rows(0.0));
    let field = field.display().to_string();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let search = |out: &str, more: &[&str]| {
        let usual = ["optimise", PAPER, "--field", &field, "--patience", "3", "-o", out];
        run(&[&usual, more].concat())
    };
    let (whole, broken) = (at("whole"), at("broken"));
    assert_eq!(code(&search(&whole, &[])), 0);
    // Ended by the clock after its first slice.
    assert_eq!(code(&search(&broken, &["--budget", "1ms"])), 0);
    let read = |folder: &str, name: &str| std::fs::read_to_string(format!("{folder}/{name}")).unwrap();
    assert!(
        read(&broken, "summary.json").contains("\"clock\"")
            && read(&broken, "checkpoint.json").contains("\"stop\":null")
    );
    let again = search(&broken, &[]);
    assert!(code(&again) == 2 && stderr(&again).contains("--resume"), "{}", stderr(&again));
    // Temperatures of another day are another search, and so is none.
    let other = folder.path().join("other.csv");
    std::fs::write(&other, rows(1e-4)).unwrap();
    let other = other.display().to_string();
    let mixed = run(&["optimise", PAPER, "--field", &other, "--patience", "3", "-o", &broken, "--resume"]);
    assert!(code(&mixed) == 2 && stderr(&mixed).contains("fields_sha256 was"), "{}", stderr(&mixed));
    let profiles = run(&["optimise", PAPER, "--patience", "3", "-o", &broken, "--resume"]);
    assert!(code(&profiles) == 2 && stderr(&profiles).contains("fields_sha256 was"), "{}", stderr(&profiles));
    let resumed = search(&broken, &["--resume"]);
    assert!(code(&resumed) == 0 && stderr(&resumed).contains("resuming"), "{}", stderr(&resumed));
    let tables = ["baselines.csv", "history.csv", "rates.csv", "schedule.csv", "schedule.json"];
    for name in ["summary.json", "best.toml", "checkpoint.json", "model.toml", "report.html"].iter().chain(&tables) {
        // The page shows run.toml, which says that there was a clock.
        let of = |folder: &str| read(folder, name).replace("budget = &quot;1ms&quot;\n", "");
        assert!(of(&whole) == of(&broken), "{name}");
    }
    // The page is made of what the folder holds, and shows what only a search under temperatures has.
    let page = read(&whole, "report.html");
    assert_eq!(code(&run(&["report", &whole])), 0);
    assert!(read(&whole, "report.html") == page);
    for shown in ["under given temperatures", "Layer temperatures of field.csv", "Convergence of the search"] {
        assert!(page.contains(shown), "{shown}");
    }
}

#[test]
fn compare_takes_the_layers_temperatures_from_a_file_and_finds_only_noise_where_they_are_the_true_ones() {
    const NOISE_DEG_PER_H: f64 = 0.002;
    let (folder, path) = folder_with("coil.toml", FLANGED);
    let coil = path.display().to_string();
    // A row every ten seconds.
    let written = run(&["temperatures", &coil, "--rows", "211"]);
    let field = folder.path().join("layers.csv");
    std::fs::write(&field, stdout(&written)).unwrap();
    let model = read_model(&path).unwrap();
    let given = read_field(&field).unwrap().field;
    let own = [model.pattern.clone().unwrap()];
    let request = field::Request { model: &model, field: &given.history, patterns: &own };
    let rates = &field::run(&request, &Unobserved).unwrap()[0].rate_rad_per_s;
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut record = "time_s,temperature_c,rate_deg_per_h\n".to_owned();
    for (row, rate) in rates.iter().enumerate() {
        // Twelve uniform numbers are nearly normal, with a deviation of one.
        let noise = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let shown = deg_per_h_from_rad_per_s(*rate) + 9.5 + NOISE_DEG_PER_H * noise;
        writeln!(record, "{},{},{shown}", 10 * row, 20.0 + 0.001 * row as f64).unwrap();
    }
    let record_path = folder.path().join("record.csv");
    std::fs::write(&record_path, &record).unwrap();
    let (field, record_path) = (field.display().to_string(), record_path.display().to_string());
    let under = json(&["compare", &coil, &record_path, "--field", &field]);
    let found = &under["records"][0];
    let number = |key: &str| found[key].as_f64().unwrap();
    assert_eq!(
        (&found["field"], &under["verdict"]),
        (&Value::from(field.as_str()), &Value::from("adequate")),
        "{found}"
    );
    assert!((number("rmse_deg_per_h") / NOISE_DEG_PER_H - 1.0).abs() < 0.1, "{found}");
    assert!((number("offset_deg_per_h") - 9.5).abs() < 0.001, "{found}");
    assert_eq!(under["inputs"]["records"][1]["role"], "temperatures");
    // Another winding is told by the same file.
    let other = json(&["compare", &coil, &record_path, "--field", &field, "--pattern", "zyl"]);
    assert_eq!(other["verdict"], "missing");
    let refused = run(&["compare", &coil, &record_path, "--field", &field, "--field", &field]);
    assert!(stderr(&refused).contains("--field: expected one for each of the 1 records"), "{}", stderr(&refused));
    std::fs::write(&record_path, record + "5000,20,1\n").unwrap();
    let refused = run(&["compare", &coil, &record_path, "--field", &field]);
    assert!(stderr(&refused).contains("it must span them"), "{}", stderr(&refused));
}

/// The scale factor and the earth as the book states them, on a table that turns while the pack keeps its temperature.
#[test]
fn a_formula_of_the_tables_rate_explains_what_the_scale_factor_does_to_a_record() {
    let formula = "[[effect]]\nkind = \"custom\"\nformula = \"(e0 + e1 * (T - 20)) * (earth + table_rate_deg_per_h)\"\n\
        [effect.parameters]\ne0 = 500e-6\ne1 = 10e-6\nearth = 7.52\n";
    let (folder, path) = folder_with("coil.toml", FLANGED);
    let with = folder.path().join("with.toml");
    std::fs::write(&with, FLANGED.to_owned() + formula).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut field =
        "time_s,".to_owned() + &(1..=8).map(|j| format!("layer_{j}_c")).collect::<Vec<_>>().join(",") + "\n";
    let mut record = "time_s,temperature_c,rate_deg_per_h,table_rate_deg_per_s\n".to_owned();
    for row in 0..600 {
        let temperature_c = if row < 300 { 20.0 } else { 50.0 };
        writeln!(field, "{row}{}", format!(",{temperature_c}").repeat(8)).unwrap();
        let table = [0.0, 20.0, -20.0][row / 50 % 3];
        let error = 500e-6 + 10e-6 * (temperature_c - 20.0);
        let noise = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let rate = table * 3600.0 * (1.0 + error) + error * 7.52 + 7.82 + 0.5 * noise;
        // The step between the two temperatures is in no record: the table is warmed up in between.
        if row != 300 {
            writeln!(record, "{row},{temperature_c},{rate},{table}").unwrap();
        }
    }
    let (field_path, record_path) = (folder.path().join("layers.csv"), folder.path().join("record.csv"));
    std::fs::write(&field_path, field).unwrap();
    std::fs::write(&record_path, record).unwrap();
    let [plain, with, field, record] = [path, with, field_path, record_path].map(|p| p.display().to_string());
    let rmse = |model: &str| {
        let found = json(&["compare", model, &record, "--field", &field]);
        found["records"][0]["rmse_deg_per_h"].as_f64().unwrap()
    };
    assert!(rmse(&plain) > 20.0, "{}", rmse(&plain));
    assert!((rmse(&with) / 0.5 - 1.0).abs() < 0.1, "{}", rmse(&with));
}

#[test]
fn a_field_that_does_not_fit_says_what_was_expected_and_found() {
    let (_folder, path) = folder_with("field.csv", "time_s,layer_1_c,layer_2_c\n0,20,20\n10,21,22\n");
    let field = path.display().to_string();
    let output = run(&["evaluate", PAPER, "--field", &field]);
    assert_eq!(code(&output), 2);
    let said = stderr(&output);
    assert!(said.contains("field.csv: expected a column for each of the coil's 12 layers, found 2"), "{said}");
    let output = run(&["evaluate", PAPER, "--field", PAPER]);
    assert!(code(&output) == 2 && stderr(&output).contains("column time_s is missing"), "{}", stderr(&output));
}
