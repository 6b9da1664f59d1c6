//! `materials`, `stress`, `potting`, and what `[materials]` does to the other commands.

use serde_json::Value;

use super::{code, folder_with, json, root, run, run_in, stderr};

const MODEL: &str = "examples/stress-coil.toml";

fn source() -> String {
    std::fs::read_to_string(root().join(MODEL)).unwrap()
}

/// The example with an adhesive that goes through its glass transition.
fn through_a_transition() -> String {
    source().replace("adhesive = \"epoxy\"", "adhesive = \"epoxy-flexible\"")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn the_library_says_of_every_material_where_its_numbers_are_from() {
    let listed = json(&["materials", "--use", "adhesive", "--at", "-40"]);
    let materials = listed["materials"].as_array().unwrap();
    assert!(materials.len() >= 6 && materials.iter().all(|m| m["used_as"] == "adhesive"));
    for material in materials {
        assert!(material["source"].as_str().unwrap().len() > 20 && material["source_was_read"].is_boolean());
        assert_eq!(number(&material["at"][0]["temperature_c"]), -40.0);
    }
    let refused = run(&["materials", "--at", "400"]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("-200 to 200"), "{}", stderr(&refused));
}

#[test]
fn the_free_effect_with_the_mismatch_that_stress_names_makes_the_same_steady_error() {
    let stress = json(&["stress", MODEL, "--pattern", "sym"]);
    let at = &stress["temperatures"][0];
    assert_eq!(stress["is_linear"], true);
    assert_eq!(at["layers"].as_array().unwrap().len(), 24);
    let mismatch = number(&at["patterns"][0]["equivalent_mismatch"]);
    let steady = number(&at["patterns"][0]["steady_ramp_deg_per_h"]);
    // One ramp until everything is steady, of the coil as it is and of a plain one with the free effect.
    let ramp = "[profiles]\nmax_rate_c_per_h = 60.0\ncount = 0\n[[profiles.ramp]]\nname = \"long\"\n\
        pieces = [{ rate_c_per_h = 60.0, duration_s = 40000.0 }]\n";
    let with_ramp = |text: &str| format!("{}{ramp}", text.split("[profiles]").next().unwrap());
    let (folder, path) = folder_with("stressed.toml", with_ramp(&source()));
    let last_error = |path: &std::path::Path| {
        let field = run_in(folder.path(), &["temperatures", &path.display().to_string(), "--rows", "2"]);
        assert_eq!(code(&field), 0, "{}", stderr(&field));
        let text = String::from_utf8(field.stdout).unwrap();
        // The last row alone, twice: a field in which everything changes at the ramp's rate.
        let mut lines = text.lines();
        let (head, row) = (lines.next().unwrap(), lines.next_back().unwrap());
        (head.to_owned(), row.to_owned())
    };
    let (head, row) = last_error(&path);
    let columns = head.split(',').filter(|c| c.ends_with("_c_per_h")).count();
    assert_eq!(columns, 24);
    let rates: Vec<f64> = row.split(',').skip(2 + 24).map(|v| v.parse().unwrap()).collect();
    assert!(rates.iter().all(|rate| (rate / 60.0 - 1.0).abs() < 1e-6), "{rates:?}");
    // n κ m L Ṫ/(4D) with the mean κ that `stress` states.
    let kappa = number(&at["path_per_k"]);
    let (n, pitch, bore) = (1.45, 165e-6, 0.04);
    let length: f64 = (0..24).map(|j| std::f64::consts::TAU * (bore + (j as f64 + 0.5) * pitch) * 50.0).sum();
    let diameter = 2.0 * (bore + 12.0 * pitch);
    let expected = n * kappa * mismatch * length / (4.0 * diameter) * (60.0 / 3600.0);
    let deg_per_h = expected.to_degrees() * 3600.0;
    assert!((steady / deg_per_h - 1.0).abs() < 1e-9, "{steady} {deg_per_h}");
    assert!(mismatch.abs() > 1e-3, "{mismatch}");
}

#[test]
fn the_worst_rate_carries_the_stress_and_potting_orders_by_it() {
    let worst =
        |path: &str| number(&json(&["evaluate", path, "--pattern", "qua"])["patterns"][0]["worst_rate_deg_per_h"]);
    let (_folder, plain) = folder_with(
        "plain.toml",
        source().replace("[materials]", "[other]").split("[other]").next().unwrap().to_owned()
            + "[profiles]"
            + source().split("[profiles]").nth(1).unwrap(),
    );
    let (with, without) = (worst(MODEL), worst(&plain.display().to_string()));
    assert!((with / without - 1.0).abs() > 0.1, "{with} {without}");
    let potting = json(&["potting", MODEL, "--pattern", "qua", "--spools"]);
    let choices = potting["choices"].as_array().unwrap();
    let rates: Vec<f64> = choices.iter().map(|c| number(&c["worst_rate_deg_per_h"])).collect();
    assert!(choices.len() >= 30 && rates.is_sorted(), "{rates:?}");
    let declared: Vec<&Value> = choices.iter().filter(|c| c["is_declared"] == true).collect();
    assert_eq!(declared.len(), 1);
    assert!((number(&declared[0]["worst_rate_deg_per_h"]) / with - 1.0).abs() < 1e-9);
    assert!(number(&declared[0]["guaranteed_worst_rate_deg_per_h"]) >= with * (1.0 - 1e-9));
    let through = choices.iter().find(|c| c["adhesive"] == "epoxy-flexible").unwrap();
    assert_eq!(through["guaranteed_worst_rate_deg_per_h"], Value::Null);
    // The best choice, written into the model file, is what `evaluate` finds.
    let best = &choices[0];
    let text = source()
        .replace("adhesive = \"epoxy\"", &format!("adhesive = {}", best["adhesive"]))
        .replace("spool = \"aluminium-6061\"", &format!("spool = {}", best["spool"]));
    let (_folder, path) = folder_with("best.toml", text);
    assert!((worst(&path.display().to_string()) / rates[0] - 1.0).abs() < 1e-9);
}

#[test]
fn a_schedule_of_a_stressed_coil_is_verified_by_a_second_solution() {
    for (name, text) in [("constant.toml", source()), ("transition.toml", through_a_transition())] {
        // Few profiles: the second solution has no grid and takes its time.
        let (folder, path) = folder_with(name, text.replace("count = 16", "count = 2"));
        let model = path.display().to_string();
        let done = run_in(folder.path(), &["schedule", &model, "-o", "out"]);
        assert_eq!(code(&done), 0, "{}", stderr(&done));
        let found = run_in(folder.path(), &["verify", &model, "out/schedule.json"]);
        assert_eq!(code(&found), 0, "{name}: {}\n{}", String::from_utf8_lossy(&found.stdout), stderr(&found));
    }
}

#[test]
fn wrong_materials_are_named_with_their_line_and_what_to_do() {
    let cases = [
        ("adhesive = \"epoxy\"", "adhesive = \"epoxi\"", "did you mean \"epoxy\"?"),
        (
            "spool_thickness_mm = 3.0",
            "spool_thickness_mm = 45.0",
            "less than the bore's radius of 40.0000 mm, found 45",
        ),
        ("spool_thickness_mm = 3.0\n", "\n", "missing key materials.spool_thickness_mm"),
        ("spool = \"aluminium-6061\"\n", "\n", "materials.spool, which is missing"),
        (
            "outer_diameter_um = 165.0 },",
            "outer_diameter_um = 160.0 },",
            "must be fibre.outer_diameter_um = 165.000000, found 160.000000",
        ),
        ("outer_diameter_um = 125.0 }", "outer_diameter_um = 75.0 }", "list the coatings from within outwards"),
        ("glass_diameter_um = 80.0", "glass_diameter_um = 80.0\nhole_diameter_um = 90.0", "the hole lies in the glass"),
        (
            "wavelength_nm = 1550.0",
            "wavelength_nm = 1550.0\nthermal_expansion_per_k = 5e-7",
            "must be left out beside [materials]",
        ),
        (
            "[profiles]",
            "[[materials.own]]\nname = \"mine\"\nyoungs_modulus_mpa = 9000.0\nbulk_modulus_mpa = 1000.0\nexpansion_per_k = 1e-5\n[profiles]",
            "expected E below 3 K",
        ),
        (
            "[profiles]",
            "[[materials.own]]\nname = \"mine\"\nyoungs_modulus_mpa = [[20.0, 5.0], [10.0, 6.0]]\npoisson_ratio = 0.3\nexpansion_per_k = 1e-5\n[profiles]",
            "a temperature that does not rise",
        ),
        (
            "[profiles]",
            "[[materials.own]]\nname = \"epoxy\"\nyoungs_modulus_mpa = 5.0\npoisson_ratio = 0.3\nexpansion_per_k = 1e-5\n[profiles]",
            "two materials are called \"epoxy\"",
        ),
    ];
    for (from, to, said) in cases {
        let text = source().replacen(from, to, 1);
        assert_ne!(text, source(), "{from}");
        let (_folder, path) = folder_with("wrong.toml", text);
        let refused = run(&["check", &path.display().to_string()]);
        assert_ne!(code(&refused), 0, "{to}");
        let words = String::from_utf8_lossy(&refused.stdout).into_owned() + stderr(&refused);
        assert!(words.contains(said), "{to}: {words}");
    }
    let refused = run(&["stress", "examples/coil-998m.toml"]);
    assert_eq!(code(&refused), 2);
    assert!(stderr(&refused).contains("has no [materials]"), "{}", stderr(&refused));
}

#[test]
fn own_materials_over_temperature_are_read_and_offered_as_potting() {
    let own = "[[materials.own]]\nname = \"our potting\"\n\
        youngs_modulus_mpa = { glassy = 2100.0, rubbery = 12.0, transition_c = 18.0, width_k = 6.0 }\n\
        bulk_modulus_mpa = 3000.0\nexpansion_per_k = [[-40.0, 7.0e-5], [10.0, 7.5e-5], [30.0, 1.9e-4]]\nsource = \"batch 7\"\n[profiles]";
    let (_folder, path) = folder_with("own.toml", source().replacen("[profiles]", own, 1));
    let potting = json(&["potting", &path.display().to_string(), "--pattern", "qua"]);
    assert!(potting["choices"].as_array().unwrap().iter().any(|c| c["adhesive"] == "our potting"));
    let used = source().replacen("[profiles]", own, 1).replace("adhesive = \"epoxy\"", "adhesive = \"our potting\"");
    let (_folder, path) = folder_with("used.toml", used);
    let stress = json(&["stress", &path.display().to_string(), "--pattern", "sym", "--at", "-20", "--at", "60"]);
    assert_eq!(stress["is_linear"], false);
    let mismatch = |i: usize| number(&stress["temperatures"][i]["patterns"][0]["equivalent_mismatch"]);
    assert!((mismatch(0) / mismatch(1) - 1.0).abs() > 0.05, "{} {}", mismatch(0), mismatch(1));
}

#[test]
fn a_fibre_of_the_library_stands_for_its_optics_and_its_layers() {
    let listed = json(&["fibres"]);
    let fibres = listed["fibres"].as_array().unwrap();
    let kinds: Vec<&str> = fibres.iter().map(|f| f["kind"].as_str().unwrap()).collect();
    for kind in ["solid", "polarisation-maintaining", "thin", "hollow-core"] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
    let text = source();
    let (before, rest) = text.split_once("[fibre]\n").unwrap();
    let rest = rest.split_once("[winding]").unwrap().1;
    let named = |name: &str| format!("{before}[fibre]\nlibrary = \"{name}\"\n[winding]{rest}");
    let fibre_from = text.find("[materials.fibre]").unwrap();
    let profiles_from = text.find("[profiles]").unwrap();
    let without_layers = |text: String| text.replace(&source()[fibre_from..profiles_from], "");
    // The library's fibre, and the same stated key by key.
    let (_a, short) = folder_with("short.toml", without_layers(named("panda-80-165")));
    let stated = text
        .replace("refractive_index = 1.45\n", "refractive_index = 1.445\ngroup_index = 1.467\n")
        .replace("acrylate-soft-rubbery", "acrylate-soft")
        .replace("acrylate-hard-glassy", "acrylate-hard");
    let (_b, long) = folder_with("long.toml", stated);
    let worst = |path: &std::path::Path| {
        json(&["evaluate", &path.display().to_string(), "--pattern", "qua"])["patterns"].clone()
    };
    assert_eq!(worst(&short), worst(&long));
    // Without materials κ is that of the coated fibre by itself: a hollow core is not silent.
    let bare = without_layers(named("hollow-core-200-330")).replace(
        "inner_diameter_mm = 80.0\nradial_pitch_um = 165.0\naxial_pitch_um = 170.0",
        "inner_diameter_mm = 80.0",
    );
    let cut = bare.find("[materials]").unwrap()..bare.find("[profiles]").unwrap();
    let (_c, plain) = folder_with("hollow.toml", bare.replace(&bare[cut], ""));
    let hollow = number(&worst(&plain)[0]["worst_rate_deg_per_h"]);
    assert!(hollow > 1e-4, "{hollow}");
    // What is wrong is said with what there is.
    let (_d, wrong) = folder_with("wrong.toml", named("panda-80-166"));
    let refused = run(&["check", &wrong.display().to_string()]);
    let words = String::from_utf8_lossy(&refused.stdout).into_owned() + stderr(&refused);
    assert!(words.contains("fibre.library must be one of") && words.contains("panda-80-165"), "{words}");
}
