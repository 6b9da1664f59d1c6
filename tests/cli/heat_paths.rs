//! What stands between chamber and coil, as a user declares it: housings, the spool's metal and flanges, starts that are not
//! steady, sensors on any of them. Their physics is held against closed forms in `tests/validation/heat_paths.rs`.

use serde_json::Value;

use super::{code, folder_with, json, run_in, stderr};

const COIL: &str = r#"
name = "in its housing"
[fibre]
refractive_index = 1.45
thermo_optic_per_k = 1.0e-5
wavelength_nm = 1550.0
outer_diameter_um = 165.0
[winding]
layers = 8
turns_per_layer = 50
inner_diameter_mm = 80.0
layer_length = "actual"
pattern = "qua"
[thermal]
model = "pack"
conductivity_w_per_m_k = 0.35
volumetric_heat_capacity_j_per_m3_k = 1.70e6
[profiles]
max_rate_c_per_h = 60.0
count = 3
segments = 2
duration_s = 3000.0
[[profiles.ramp]]
name = "warm-up"
pieces = [{ rate_c_per_h = 60.0, duration_s = 1500.0 }]
[sensor]
location = "ambient"
"#;

const FILM: &str = "[[effect]]\nkind = 'surface_film'\nfilm_w_per_m2_k = 25.0\n";
const HOUSING: &str =
    "[[effect]]\nkind = 'housing'\nplace = 'first'\nheat_capacity_j_per_m2_k = 4900.0\ngap_mm = 3.0\n";
const SHIELD: &str = "[[effect]]\nkind = 'housing'\nplace = 'second'\nheat_capacity_j_per_m2_k = 2500.0\ngap_mm = 5.0\n\
                      gas_w_per_m_k = 0.0\nemissivity = 0.05\nspacers_w_per_m2_k = 1.0\n";
const SPOOL: &str = "[[effect]]\nkind = 'spool_mass'\nheat_capacity_j_per_m2_k = 4900.0\ncontact_w_per_m2_k = 300.0\n\
                     mount_w_per_m2_k = 20.0\n[[effect]]\nkind = 'spool_conduction'\nconductivity_w_per_m_k = 167.0\n\
                     wall_mm = 2.0\n";
const FLANGES: &str = "[[effect]]\nkind = 'spool_flange'\nflange = 'first'\nheat_capacity_j_per_m2_k = 4900.0\n\
                       contact_w_per_m2_k = 300.0\nfilm_w_per_m2_k = 40.0\n[[effect]]\nkind = 'spool_flange'\n\
                       flange = 'second'\nheat_capacity_j_per_m2_k = 4900.0\ncontact_w_per_m2_k = 300.0\n\
                       film_w_per_m2_k = 5.0\n";
const START: &str = "[[effect]]\nkind = 'unsteady_start'\npack_above_k = 0.4\nrate_c_per_h = 30.0\n";

fn number(body: &Value, key: &str) -> f64 {
    body[key].as_f64().unwrap_or_else(|| panic!("{key} in {body}"))
}

/// QUA's worst and guaranteed rate and their margin.
fn judged(model: &str) -> [f64; 3] {
    let (_folder, file) = folder_with("model.toml", model);
    let body = json(&["evaluate", file.to_str().expect("text"), "-p", "qua"]);
    let qua = &body["patterns"][0];
    ["worst_rate_deg_per_h", "guaranteed_worst_rate_deg_per_h", "grid_margin_deg_per_h"].map(|key| number(qua, key))
}

#[test]
fn every_part_between_chamber_and_coil_is_checked_judged_searched_and_written_out() {
    let model = [COIL, FILM, HOUSING, SHIELD, SPOOL, FLANGES, START].concat();
    let (folder, file) = folder_with("model.toml", &model);
    let path = file.to_str().expect("text");
    let checked = run_in(folder.path(), &["check", path]);
    assert_eq!(code(&checked), 0, "{}", stderr(&checked));
    let [worst, guaranteed, margin] = judged(&model);
    assert!(worst > 0.0 && guaranteed >= worst && margin < 1e-3 * guaranteed, "{worst} {guaranteed} {margin}");
    let searched = json(&["optimise", path, "--seed", "3", "--budget", "1s"]);
    let best = &searched["best"];
    assert!(number(best, "worst_rate_deg_per_h") <= worst * (1.0 + 1e-6), "{best}");
    let layers = folder.path().join("layers");
    let written =
        run_in(folder.path(), &["temperatures", path, "--profile", "warm-up", "-o", layers.to_str().expect("text")]);
    assert_eq!(code(&written), 0, "{}", stderr(&written));
}

#[test]
fn housings_make_the_error_smaller_a_start_in_a_ramp_makes_it_larger_and_unlike_flanges_change_it() {
    let bare = judged(&[COIL, FILM].concat());
    let housed = judged(&[COIL, FILM, HOUSING].concat());
    let shielded = judged(&[COIL, FILM, HOUSING, SHIELD].concat());
    assert!(shielded[1] < housed[1] && housed[1] < bare[1], "{shielded:?} {housed:?} {bare:?}");
    let started = judged(&[COIL, FILM, HOUSING, START].concat());
    assert!(started[1] > housed[1], "{started:?} {housed:?}");
    let flanged = judged(&[COIL, FILM, HOUSING, SPOOL, FLANGES].concat());
    let spooled = judged(&[COIL, FILM, HOUSING, SPOOL].concat());
    assert!((flanged[1] / spooled[1] - 1.0).abs() > 0.01, "{flanged:?} {spooled:?}");
    for [worst, guaranteed, margin] in [bare, housed, shielded, started, flanged, spooled] {
        assert!(guaranteed >= worst && margin < 1e-3 * guaranteed, "{worst} {guaranteed} {margin}");
    }
}

#[test]
fn a_sensor_may_sit_on_every_part_that_is_there_and_is_refused_on_one_that_is_not() {
    let spool = &SPOOL[..SPOOL.rfind("[[effect]]").expect("two effects")];
    for (location, parts) in [
        ("first_housing", [FILM, HOUSING, SHIELD].concat()),
        ("second_housing", [FILM, HOUSING, SHIELD].concat()),
        ("spool", [FILM, spool].concat()),
        ("spool", [FILM, HOUSING, spool].concat()),
        ("first_flange", [FILM, SPOOL, FLANGES].concat()),
        ("second_flange", [FILM, HOUSING, FLANGES].concat()),
    ] {
        let [worst, guaranteed, margin] =
            judged(&[&COIL.replace("\"ambient\"", &format!("\"{location}\"")), &*parts].concat());
        assert!(
            worst > 0.0 && guaranteed >= worst && margin < 1e-3 * guaranteed,
            "{location}: {worst} {guaranteed} {margin}"
        );
    }
    for (location, parts, words) in [
        ("third_housing", [FILM, HOUSING].concat(), "a housing of that place, which is not there"),
        ("spool", FILM.to_owned(), "the spool, which is not there"),
        ("first_flange", FILM.to_owned(), "a flange of the spool, which is not there"),
        ("spool", spool.to_owned(), "through a film"),
        ("spool", [FILM, SPOOL, FLANGES].concat(), "no single temperature"),
        ("lid", FILM.to_owned(), "third_housing"),
    ] {
        let model = [&COIL.replace("\"ambient\"", &format!("\"{location}\"")), &*parts].concat();
        let (folder, file) = folder_with("model.toml", &model);
        let found = run_in(folder.path(), &["check", file.to_str().expect("text")]);
        assert_eq!(code(&found), 2, "{location}");
        assert!(stderr(&found).contains(words), "{location}: {}", stderr(&found));
    }
}

#[test]
fn parts_that_cannot_be_solved_together_are_refused_by_name() {
    let varying = "[[effect]]\nkind = 'conductivity_temperature'\nslope_per_k = 0.002\n";
    for (parts, words) in [
        ([FILM, FLANGES, varying].concat(), "conductivity that depends on temperature"),
        ([FILM, START, varying].concat(), "conductivity that depends on temperature"),
        ([HOUSING, HOUSING].concat(), "declared twice"),
    ] {
        let (folder, file) = folder_with("model.toml", [COIL, &parts].concat());
        let found = run_in(folder.path(), &["check", file.to_str().expect("text")]);
        assert_eq!(code(&found), 2);
        assert!(stderr(&found).contains(words), "{}", stderr(&found));
    }
}
