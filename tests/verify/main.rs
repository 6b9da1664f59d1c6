//! Every schedule that the program emits is verified without violations, in every form, for every effect.
//!
//! Reference: src/verify works the winding out again with code of its own. `tampering.rs` alters what is emitted.

use std::path::Path;

use coilwright::io::read::model_file::parse_model;
use coilwright::io::write::machine_program::gcode;
use coilwright::pattern::classic::Classic;
use coilwright::units::deg_per_h_from_rad_per_s;
use coilwright::verify::RateCheck;

mod ends;
mod forms;
mod tampering;

use forms::{LONG, PAPER, classic, forms, judged, model, plan, program, shipped, shuffled};

#[test]
fn schedules_of_classic_and_arbitrary_windings_hold_in_every_form() {
    for text in [PAPER, LONG] {
        let file = model(text);
        let layers = file.model.coil.layers();
        let classics = Classic::ALL.into_iter().filter_map(|c| classic(c, layers));
        for named in classics.chain((0..6).map(|seed| shuffled(layers, seed))) {
            let (schedule, document) = plan(&file, &named);
            let full = program(&file, &named);
            let forms = [
                ("json", serde_json::to_string_pretty(&document).unwrap()),
                ("csv", document.csv().unwrap()),
                ("program json", serde_json::to_string(&full).unwrap()),
                ("program csv", full.csv().unwrap()),
                ("g-code", gcode(&full, &schedule)),
            ];
            for (form, text) in forms {
                let found = judged(&file, &text).unwrap_or_else(|| panic!("{} {form} is not understood", named.name));
                assert_eq!(found.violations, [], "{} {form}", named.name);
                assert!(found.checks > 10 * layers);
            }
        }
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn schedules_of_the_shipped_coils_hold_in_every_form_for_classic_and_searched_windings() {
    for (example, searched) in
        [("paper-200m", &["searched-standard-12", "searched-any-12"][..]), ("coil-998m", &["searched-standard-40"][..])]
    {
        let path = Path::new("examples").join(example).with_extension("toml");
        let file = parse_model(&path, &std::fs::read_to_string(&path).unwrap()).unwrap();
        let layers = file.model.coil.layers();
        let classics = Classic::ALL.into_iter().filter_map(|c| classic(c, layers));
        let searched = searched.iter().map(|name| shipped(name));
        for named in classics.chain(searched) {
            let mut checks = 0;
            for (form, text) in forms(&file, &named) {
                let found = judged(&file, &text).unwrap_or_else(|| panic!("{} {form} is not understood", named.name));
                assert_eq!(found.violations, [], "{example} {} {form}", named.name);
                assert!(matches!(found.rate_check, RateCheck::Independent { .. }));
                checks += found.checks;
            }
            println!("{example} {}: 7 forms, {checks} checks, no violation", named.name);
        }
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn a_schedule_over_profiles_of_a_thousand_ramps_holds_like_any_other() {
    for text in [PAPER, WARM] {
        let text = text.replace("segments = 2", "segments = 1_000").replace("segments = 3", "segments = 1_000");
        let file = model(&text);
        let layers = file.model.coil.layers();
        let (_, mut document) = plan(&file, &classic(Classic::Qua, layers).unwrap());
        let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
        assert_eq!(found.violations, []);
        document.worst_rate_deg_per_h *= 1.001;
        let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
        assert!(!found.violations.is_empty());
    }
}

#[test]
fn all_violations_come_at_once_with_their_rows() {
    let file = model(PAPER);
    let (_, mut document) = plan(&file, &classic(Classic::Qua, 16).unwrap());
    document.steps[2].direction = "first-to-second".to_owned();
    document.steps[5].length_m += 1.0;
    document.steps[9].climb = 7;
    document.windability.class = "any".to_owned();
    document.model_sha256 = "0".repeat(64);
    let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
    let seen: Vec<(Option<usize>, &str)> = found.violations.iter().map(|v| (v.row, v.field.as_str())).collect();
    assert_eq!(
        seen,
        [
            (None, "model_sha256"),
            (Some(3), "direction"),
            (Some(6), "length_m"),
            (Some(10), "climb"),
            (None, "windability.class")
        ]
    );
}

#[test]
fn a_segment_wound_twice_and_a_missing_row_are_named() {
    let file = model(PAPER);
    let (_, mut document) = plan(&file, &classic(Classic::Qua, 16).unwrap());
    document.steps[3].segment = document.steps[0].segment;
    document.steps.pop();
    let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
    let fields: Vec<&str> = found.violations.iter().map(|v| v.field.as_str()).collect();
    assert_eq!(fields, ["rows", "segment"]);
    assert!(found.violations[1].to_string().contains("it is in row 1"));
}

/// What emits schedules: names that no file of the verification may use.
const EMITTERS: &[&str] =
    &["Schedule", "RateModel", "SolvedProfiles", "WindingGraph", "heat_path", "solve(", "history", "crate::search"];

#[test]
fn the_verification_uses_nothing_that_emits_schedules() {
    let files = |folder: &str| -> Vec<_> {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        entries.filter(|path| path.is_file()).collect()
    };
    for entry in files("src/verify").into_iter().chain(files("src/verify/page")) {
        let text = std::fs::read_to_string(&entry).unwrap();
        let code: String = text.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
        for name in EMITTERS {
            assert!(!code.contains(name), "{} uses {name}", entry.display());
        }
    }
}

/// A pack of twelve layers whose profiles heat and cool; `{}` is where effects go.
const WARM: &str = r#"
name = "pack with effects"
[fibre]
refractive_index = 1.45
thermo_optic_per_k = 1.0e-5
thermal_expansion_per_k = 5.0e-7
wavelength_nm = 1550.0
outer_diameter_um = 165.0
[winding]
layers = 12
turns_per_layer = 50
inner_diameter_mm = 80.0
axial_pitch_um = 170.0
layer_length = "actual"
[thermal]
model = "pack"
conductivity_w_per_m_k = 0.35
volumetric_heat_capacity_j_per_m3_k = 1.7e6
[profiles]
max_rate_c_per_h = 60.0
count = 1
segments = 3
duration_s = 1500.0
"#;

/// Every effect that reaches a schedule, by itself and together with others, as a model file states it.
const EFFECTS: &[&str] = &[
    "",
    "kind = 'spool_mass'\nheat_capacity_j_per_m2_k = 4000.0\ncontact_w_per_m2_k = 300.0\nmount_w_per_m2_k = 20.0",
    "kind = 'surface_film'\nfilm_w_per_m2_k = 30.0",
    "kind = 'sensor_lag'\nlag_s = 30.0",
    "kind = 'self_heating'\npower_w_per_m2 = 50.0\ntime_constant_s = 600.0",
    "kind = 'axial_gradient'\nfilm_w_per_m2_k = 20.0\nflange = 'first'",
    "kind = 'axial_gradient'\nfilm_w_per_m2_k = 60.0\nflange = 'second'",
    "kind = 'conductivity_temperature'\nslope_per_k = 0.004",
    "kind = 'housing'\nplace = 'first'\nheat_capacity_j_per_m2_k = 5000.0\ngap_mm = 1.5",
    "kind = 'housing'\nplace = 'second'\nheat_capacity_j_per_m2_k = 9000.0\ngap_mm = 4.0\ngas_w_per_m_k = 0.0\n\
     emissivity = 0.8\nspacers_w_per_m2_k = 3.0\n[[effect]]\nkind = 'housing'\nplace = 'first'\n\
     heat_capacity_j_per_m2_k = 2000.0\ngap_mm = 0.5\n[[effect]]\nkind = 'surface_film'\nfilm_w_per_m2_k = 30.0\n\
     [[effect]]\nkind = 'spool_mass'\nheat_capacity_j_per_m2_k = 3000.0\ncontact_w_per_m2_k = 200.0\n\
     mount_w_per_m2_k = 25.0\n[[effect]]\nkind = 'self_heating'\npower_w_per_m2 = 50.0\ntime_constant_s = 600.0",
    "kind = 'stress_gradient'\nstrength = 0.05",
    "kind = 'unsteady_start'\nrate_c_per_h = 40.0\nlasted_s = 5000.0",
    "kind = 'unsteady_start'\nrate_c_per_h = -50.0\nlasted_s = 900.0\n[[effect]]\nkind = 'surface_film'\nfilm_w_per_m2_k = 30.0\n\
     [[effect]]\nkind = 'thermo_optic_temperature'\nslope_per_k = 0.002\n[[effect]]\nkind = 'axial_gradient'\n\
     film_w_per_m2_k = 20.0\nflange = 'first'",
    "kind = 'unsteady_start'\npack_above_k = 0.5\n[[effect]]\nkind = 'surface_film'\nfilm_w_per_m2_k = 30.0",
    "kind = 'unsteady_start'\npack_above_k = -0.2\nspool_above_k = 0.6\nhousing_above_k = 0.3\nrate_c_per_h = 20.0\n\
     lasted_s = 700.0\n[[effect]]\nkind = 'housing'\nplace = 'first'\nheat_capacity_j_per_m2_k = 3000.0\ngap_mm = 1.5\n\
     [[effect]]\nkind = 'spool_mass'\nheat_capacity_j_per_m2_k = 3000.0\ncontact_w_per_m2_k = 200.0\n\
     mount_w_per_m2_k = 25.0\n[[effect]]\nkind = 'thermo_optic_temperature'\nslope_per_k = 0.002\n[[effect]]\n\
     kind = 'spool_flange'\nflange = 'second'\nheat_capacity_j_per_m2_k = 4900.0\ncontact_w_per_m2_k = 250.0\n\
     film_w_per_m2_k = 12.0\n[[effect]]\nkind = 'spool_conduction'\nconductivity_w_per_m_k = 167.0\nwall_mm = 2.0",
    "kind = 'spool_flange'\nflange = 'first'\nheat_capacity_j_per_m2_k = 4900.0\ncontact_w_per_m2_k = 300.0\n\
     film_w_per_m2_k = 20.0",
    "kind = 'spool_flange'\nflange = 'first'\nheat_capacity_j_per_m2_k = 2000.0\ncontact_w_per_m2_k = 900.0\n\
     film_w_per_m2_k = 60.0\n[[effect]]\nkind = 'spool_flange'\nflange = 'second'\nheat_capacity_j_per_m2_k = 4900.0\n\
     contact_w_per_m2_k = 100.0\nfilm_w_per_m2_k = 20.0\n[[effect]]\nkind = 'spool_mass'\n\
     heat_capacity_j_per_m2_k = 4000.0\ncontact_w_per_m2_k = 300.0\nmount_w_per_m2_k = 20.0\n[[effect]]\n\
     kind = 'spool_conduction'\nconductivity_w_per_m_k = 6.7\nwall_mm = 1.0\n[[effect]]\nkind = 'surface_film'\n\
     film_w_per_m2_k = 30.0\n[[effect]]\nkind = 'self_heating'\npower_w_per_m2 = 50.0\ntime_constant_s = 600.0",
    "kind = 'spool_mass'\nheat_capacity_j_per_m2_k = 4000.0\ncontact_w_per_m2_k = 300.0\n[[effect]]\n\
     kind = 'spool_conduction'\nconductivity_w_per_m_k = 167.0\nwall_mm = 2.0\n[[effect]]\nkind = 'axial_gradient'\n\
     film_w_per_m2_k = 20.0\nflange = 'first'",
    "kind = 'axial_gradient'\nfilm_w_per_m2_k = 20.0\nflange = 'first'\n[[effect]]\nkind = 'housing'\nplace = 'first'\n\
     heat_capacity_j_per_m2_k = 5000.0\ngap_mm = 1.5\n[[effect]]\nkind = 'spool_flange'\nflange = 'first'\n\
     heat_capacity_j_per_m2_k = 900.0\ncontact_w_per_m2_k = 40.0\nfilm_w_per_m2_k = 8.0",
    "kind = 'layer_gain'\nlayer = 9\nchange = -0.08",
    "kind = 'layer_gap'\nabove_layer = 7\nconductance_w_per_m2_k = 250.0",
    "kind = 'layer_gap'\nabove_layer = 11\nconductance_w_per_m2_k = 120.0",
    "kind = 'custom'\nformula = 'a*thermal_rate*(T_layer_3 - 20) + 4*dT_layer_12_dt'\n[effect.parameters]\na = 0.004",
    "kind = 'strain_mismatch'\nmismatch = 0.01",
    "kind = 'glass_transition'\nmismatch = 0.01\ntransition_c = 25.0\nwidth_k = 5.0",
    "kind = 'thermo_optic_temperature'\nslope_per_k = 0.002",
    "kind = 'midpoint_offset'\noffset_m = 0.3\nlead = 'ambient'",
    "kind = 'midpoint_offset'\noffset_m = -0.3\nlead = 'isothermal'",
    "kind = 'turn_mismatch'\nturns = 1.0",
    "kind = 'heating_cooling_asymmetry'\ngain = 0.1",
    "kind = 'bias_temperature'\nlinear_deg_per_h_per_k = 0.05\nquadratic_deg_per_h_per_k2 = 0.001",
    "kind = 'bias_temperature_rate'\ngain_deg_per_h_s_per_k = 20.0",
    "kind = 'bias_gradient_rate'\ngain_deg_per_h_s_per_k = 40.0",
    "kind = 'diffusivity'\nfactor = 1.3",
    "kind = 'scale_factor_error'\nerror_ppm = 100.0",
    "kind = 'scale_factor_temperature'\ncoefficient_ppm_per_k = 5.0\nhysteresis_ppm = 20.0",
    "kind = 'scale_factor_asymmetry'\nasymmetry_ppm = 40.0",
    "kind = 'thermo_optic'\nfactor = 0.9",
    "kind = 'channel:supply_v'\ngain_deg_per_h_per_unit = 0.1",
    "kind = 'custom'\nformula = 'a*mean_rate + 0.01*(T_mean - T_in) + 1e-5*t'\n[effect.parameters]\na = 12.0",
    "kind = 'surface_film'\nfilm_w_per_m2_k = 30.0\n[[effect]]\nkind = 'spool_mass'\nheat_capacity_j_per_m2_k = 3000.0\n\
     contact_w_per_m2_k = 200.0\n[[effect]]\nkind = 'strain_mismatch'\nmismatch = -0.02\n[[effect]]\n\
     kind = 'self_heating'\npower_w_per_m2 = 30.0\ntime_constant_s = 300.0\n[[effect]]\nkind = 'turn_mismatch'\nturns = 2.0",
    "kind = 'surface_film'\nfilm_w_per_m2_k = 30.0\n[[effect]]\nkind = 'conductivity_temperature'\nslope_per_k = -0.003\n\
     [[effect]]\nkind = 'self_heating'\npower_w_per_m2 = 30.0\ntime_constant_s = 300.0",
];

/// What the verification takes as given, and says so.
const GIVEN: &[&str] = &[
    "kind = 'housing'\nplace = 'first'\nheat_capacity_j_per_m2_k = 5000.0\ngap_mm = 1.5\n[[effect]]\n\
     kind = 'surface_film'\nfilm_w_per_m2_k = 30.0\n[[effect]]\nkind = 'conductivity_temperature'\nslope_per_k = 0.004",
    "kind = 'unsteady_start'\nrate_c_per_h = 40.0\nlasted_s = 5000.0\n[[effect]]\n\
     kind = 'conductivity_temperature'\nslope_per_k = 0.004",
];

#[test]
fn a_rate_error_that_is_not_worked_out_again_is_said_to_be_taken_as_given() {
    for effect in GIVEN {
        let file = model(&format!("{WARM}[[effect]]\n{effect}\n"));
        let (_, document) = plan(&file, &classic(Classic::Qua, 12).unwrap());
        let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
        assert_eq!(found.rate_check, RateCheck::None);
        assert!(found.taken_as_given.contains(&"the rate error"), "{:?}", found.taken_as_given);
        assert_eq!(found.violations, [], "{effect}");
    }
}

#[test]
#[ignore = "long: --include-ignored"]
fn the_rate_error_of_every_effect_is_found_again_by_code_of_its_own() {
    let stated = [EFFECTS, GIVEN].concat().concat();
    for spec in coilwright::effect::CATALOGUE.iter().filter(|spec| spec.kind != "finite_pack") {
        assert!(stated.contains(&format!("kind = '{}'", spec.kind)), "{} is not tried here", spec.kind);
    }
    for effect in EFFECTS {
        let stated = if effect.is_empty() { String::new() } else { format!("[[effect]]\n{effect}\n") };
        let file = model(&format!("{WARM}{stated}"));
        let name = effect.split('\'').nth(1).unwrap_or("none");
        for classic_of in [Classic::Zyl, Classic::Qua] {
            let (_, document) = plan(&file, &classic(classic_of, 12).unwrap());
            let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
            let RateCheck::Independent { worst_rad_per_s, tolerance_rad_per_s, finer_rad_per_s, .. } = found.rate_check
            else {
                panic!("{name} is not known to the verification: {:?}", found.rate_check)
            };
            let (own, claimed) = (deg_per_h_from_rad_per_s(worst_rad_per_s), document.worst_rate_deg_per_h);
            println!(
                "{name:26} {:4} claimed {claimed:9.6} °/h, found {own:9.6} °/h, {:+.1e} within {:.1e}, finer {:9.6} °/h",
                classic_of.key(),
                own - claimed,
                deg_per_h_from_rad_per_s(tolerance_rad_per_s),
                finer_rad_per_s.map_or(f64::NAN, deg_per_h_from_rad_per_s),
            );
            assert_eq!(found.violations, [], "{name}");
        }
    }
}

/// A sensor on the spool, or on a flange, makes that part's temperature the profile.
#[test]
#[ignore = "long: --include-ignored"]
fn a_sensor_on_the_spool_or_a_flange_is_worked_out_again() {
    let spool = "[[effect]]\nkind = 'spool_mass'\nheat_capacity_j_per_m2_k = 4000.0\ncontact_w_per_m2_k = 300.0\n\
                 mount_w_per_m2_k = 20.0\n[[effect]]\nkind = 'surface_film'\nfilm_w_per_m2_k = 30.0\n";
    let flange = "[[effect]]\nkind = 'spool_flange'\nflange = 'second'\nheat_capacity_j_per_m2_k = 4900.0\n\
                  contact_w_per_m2_k = 300.0\nfilm_w_per_m2_k = 10.0\n";
    let wall = "[[effect]]\nkind = 'spool_conduction'\nconductivity_w_per_m_k = 167.0\nwall_mm = 2.0\n";
    for (location, effects) in [
        ("spool", spool.to_owned()),
        ("spool", format!("{spool}{flange}")),
        ("second_flange", format!("{spool}{flange}")),
        ("second_flange", format!("{spool}{flange}{wall}")),
    ] {
        let file = model(&format!("{WARM}[sensor]\nlocation = '{location}'\n{effects}"));
        let (_, document) = plan(&file, &classic(Classic::Qua, 12).unwrap());
        let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
        assert!(matches!(found.rate_check, RateCheck::Independent { .. }), "{location}");
        assert_eq!(found.violations, [], "{location} {effects}");
    }
}

/// A heated flange whose material's conductivity depends on temperature is stepped on both sides; what emits schedules
/// takes long, so the pack is small and its profile short.
#[test]
#[ignore = "long: --include-ignored"]
fn a_heated_flange_with_a_conductivity_that_depends_on_temperature_is_worked_out_again() {
    let small = WARM.replace("layers = 12", "layers = 4").replace("turns_per_layer = 50", "turns_per_layer = 10");
    let small = small.replace("duration_s = 1500.0", "duration_s = 30.0").replace("segments = 3", "segments = 1");
    let effects = "[[effect]]\nkind = 'conductivity_temperature'\nslope_per_k = -0.01\n[[effect]]\n\
                   kind = 'axial_gradient'\nfilm_w_per_m2_k = 400.0\nflange = 'second'\n";
    let file = model(&format!("{small}{effects}"));
    for of in [Classic::Zyl, Classic::Qua] {
        let (_, mut document) = plan(&file, &classic(of, 4).unwrap());
        let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
        let RateCheck::Independent { worst_rad_per_s, tolerance_rad_per_s, .. } = found.rate_check else { panic!() };
        let [own, tolerance] = [worst_rad_per_s, tolerance_rad_per_s].map(deg_per_h_from_rad_per_s);
        let claimed = document.worst_rate_deg_per_h;
        println!("{} claimed {claimed:.6} °/h, found {:+.1e} within {tolerance:.1e}", of.key(), own - claimed);
        assert_eq!(found.violations, []);
        // A claim that is as far off as twice the tolerance is caught.
        document.worst_rate_deg_per_h += 2.0 * tolerance;
        assert_eq!(judged(&file, &serde_json::to_string(&document).unwrap()).unwrap().violations.len(), 2);
    }
}

#[test]
fn a_rate_error_off_by_five_per_cent_is_noticed_even_where_it_is_not_said_when_it_occurs() {
    let file = model(&format!("{WARM}[[effect]]\n{}\n", EFFECTS[2]));
    let (_, mut document) = plan(&file, &classic(Classic::Qua, 12).unwrap());
    document.worst_rate_deg_per_h *= 1.05;
    document.worst_time_s = -1.0;
    let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
    let fields: Vec<&str> = found.violations.iter().map(|v| v.field.as_str()).collect();
    assert_eq!(fields, ["worst_time_s", "worst_rate_deg_per_h"]);
}
