//! Every schedule that the program emits is verified without violations, and every field of it matters.
//!
//! Reference: src/verify works the winding out again with code of its own. A mutation counts as harmless only if the
//! field is free text that the file itself introduces (the program's name, a pattern's own name) or if the changed
//! number still prints as the same digits.

use std::path::Path;

use coilwright::io::machine_program::{gcode, machine_program};
use coilwright::io::model_file::{ModelFile, NamedPattern, parse_model};
use coilwright::io::schedule_file::{ScheduleJson, sha256_hex};
use coilwright::io::schedule_reader::{parse_claim, shop_of};
use coilwright::pattern::Pattern;
use coilwright::pattern::classic::Classic;
use coilwright::schedule::Schedule;
use coilwright::search::worst_case::SolvedProfiles;
use coilwright::units::deg_per_h_from_rad_per_s;
use coilwright::verify::{RateCheck, Truth, Verification, verify};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

const PAPER: &str = r#"
name = "paper's coil"
[fibre]
refractive_index = 1.447
thermo_optic_per_k = 1.35e-5
wavelength_nm = 1300.0
outer_diameter_um = 250.0
[winding]
layers = 16
mean_diameter_mm = 75.0
layer_length = "equal"
length_m = 200.0
[thermal]
model = "half_space"
diffusivity_m2_per_s = 2.7e-7
[profiles]
max_rate_c_per_h = 10.0
count = 2
segments = 2
duration_s = 6000.0
[production]
part_number = "FOG-200-16"
tension_n = 0.12
tension_taper_percent_per_layer = 1.0
potting_every_layers = 4
adhesive = "UV acrylate"
"#;

const LONG: &str = r#"
name = "998 m, 40 x 68"
[fibre]
refractive_index = 1.44
thermo_optic_per_k = 1.0e-5
wavelength_nm = 1550.0
outer_diameter_um = 137.5
[winding]
layers = 40
turns_per_layer = 68
inner_diameter_mm = 110.0
axial_pitch_um = 191.0
layer_length = "actual"
[thermal]
model = "pack"
conductivity_w_per_m_k = 0.35
volumetric_heat_capacity_j_per_m3_k = 1.7e6
[profiles]
max_rate_c_per_h = 60.0
count = 1
segments = 2
duration_s = 3000.0
"#;

fn model(text: &str) -> ModelFile {
    parse_model(Path::new("model.toml"), text).unwrap()
}

fn plan(file: &ModelFile, named: &NamedPattern) -> (Schedule, ScheduleJson) {
    let schedule = Schedule::new(&file.model.wound_coil().unwrap(), &named.pattern).unwrap();
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles()).unwrap();
    let worst = solved.worst_case(&file.model, &named.pattern).unwrap();
    let document = ScheduleJson::new(file, named, &schedule, &worst);
    (schedule, document)
}

fn program(file: &ModelFile, named: &NamedPattern) -> ScheduleJson {
    let (schedule, document) = plan(file, named);
    machine_program(&document, &schedule, &file.production, file.model.coil.axial_pitch_m())
}

/// None where the text is refused before it can be verified.
fn judged(file: &ModelFile, text: &str) -> Option<Verification> {
    let claim = parse_claim("file", text).ok()?;
    let (sha, shop) = (sha256_hex(&file.source), shop_of(&file.production));
    Some(verify(&Truth { model: &file.model, profiles: &file.profiles, model_sha256: &sha, shop: &shop }, &claim))
}

fn classic(classic: Classic, layers: usize) -> Option<NamedPattern> {
    Some(NamedPattern { name: classic.key().to_owned(), pattern: classic.pattern(layers).ok()? })
}

fn shuffled(layers: usize, seed: u64) -> NamedPattern {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut segments: Vec<usize> = (1..=layers).collect();
    for i in (1..layers).rev() {
        segments.swap(i, random.random_range(0..=i));
    }
    NamedPattern { name: format!("shuffled-{seed}"), pattern: Pattern::new(segments).unwrap() }
}

#[test]
fn schedules_of_classic_and_arbitrary_windings_hold_in_every_form() {
    for text in [PAPER, LONG] {
        let file = model(text);
        let layers = file.model.coil.layers();
        let classics = Classic::ALL.into_iter().filter_map(|c| classic(c, layers));
        for named in classics.chain((0..6).map(|seed| shuffled(layers, seed))) {
            let (_, document) = plan(&file, &named);
            let full = program(&file, &named);
            let forms = [
                ("json", serde_json::to_string_pretty(&document).unwrap()),
                ("csv", document.csv().unwrap()),
                ("program json", serde_json::to_string(&full).unwrap()),
                ("program csv", full.csv().unwrap()),
                ("g-code", gcode(&full)),
            ];
            for (form, text) in forms {
                let found = judged(&file, &text).unwrap_or_else(|| panic!("{} {form} is not understood", named.name));
                assert_eq!(found.violations, [], "{} {form}", named.name);
                assert!(found.checks > 10 * layers);
            }
        }
    }
}

/// Words that the file itself introduces, and what a human fills in.
const FREE: &[&str] = &["program", "document", "pattern", "schema_version", "measured_length_m", "checked_by"];

/// Changes one field of a JSON document at random; its name, and whether the change can be seen at all.
fn mutate(value: &mut Value, name: &str, random: &mut ChaCha8Rng) -> String {
    match value {
        Value::Object(map) => {
            let keys: Vec<String> = map.keys().filter(|k| !FREE.contains(&k.as_str())).cloned().collect();
            let key = keys[random.random_range(0..keys.len())].clone();
            mutate(&mut map[&key], &key, random)
        }
        Value::Array(list) if !list.is_empty() => {
            let i = random.random_range(0..list.len());
            mutate(&mut list[i], name, random)
        }
        Value::Number(number) if number.is_i64() || number.is_u64() => {
            let old = number.as_i64().unwrap();
            let change = [-2, -1, 1, 2, 100][random.random_range(0..5)];
            *value = Value::from(old + change);
            name.to_owned()
        }
        Value::Number(number) => {
            let old = number.as_f64().unwrap();
            let new = match random.random_range(0..4) {
                0 => old + 2e-3,
                1 => -old - 1.0,
                2 => old * 1.01 + 1e-2,
                _ => 0.5 * old - 1e-2,
            };
            *value = Value::from(new);
            name.to_owned()
        }
        Value::String(text) => {
            text.push('x');
            name.to_owned()
        }
        Value::Bool(flag) => {
            *flag = !*flag;
            name.to_owned()
        }
        other => {
            *other = Value::from("A");
            name.to_owned()
        }
    }
}

#[test]
fn of_a_thousand_single_changes_none_goes_unnoticed() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut unnoticed = Vec::new();
    for (text, named) in [
        (PAPER, classic(Classic::Qua, 16).unwrap()),
        (PAPER, classic(Classic::Sym, 16).unwrap()),
        (PAPER, shuffled(16, 3)),
        (LONG, classic(Classic::Oct, 40).unwrap()),
    ] {
        let file = model(text);
        let document = serde_json::to_value(program(&file, &named)).unwrap();
        for _ in 0..250 {
            let mut changed = document.clone();
            // Half of the changes go to the rows, which are most of the file.
            let field = if random.random::<bool>() {
                mutate(&mut changed["steps"], "steps", &mut random)
            } else {
                mutate(&mut changed, "document", &mut random)
            };
            if changed == document {
                continue;
            }
            if judged(&file, &changed.to_string()).is_some_and(|found| found.violations.is_empty()) {
                unnoticed.push((named.name.clone(), field));
            }
        }
    }
    // A worst time that moves along a flat maximum leaves the claimed digits as they are.
    unnoticed.retain(|(_, field)| field != "worst_time_s");
    assert_eq!(unnoticed, []);
}

#[test]
fn a_change_of_any_cell_of_the_csv_or_any_word_of_the_program_is_noticed() {
    let file = model(PAPER);
    let full = program(&file, &classic(Classic::Qua, 16).unwrap());
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for text in [full.csv().unwrap(), gcode(&full)] {
        let is_csv = text.starts_with("step");
        let digits: Vec<usize> = text.char_indices().filter(|(_, c)| c.is_ascii_digit()).map(|(i, _)| i).collect();
        for _ in 0..300 {
            let at = digits[random.random_range(0..digits.len())];
            let old = text.as_bytes()[at];
            let new = b'0' + (old - b'0' + random.random_range(1..10u8)) % 10;
            let mut changed = text.clone().into_bytes();
            changed[at] = new;
            let changed = String::from_utf8(changed).unwrap();
            let line_start = text[..at].rfind('\n').map_or(0, |i| i + 1);
            let line = text[line_start..].lines().next().unwrap();
            let is_head = if is_csv {
                line_start == 0
            } else {
                line.starts_with("; coilwright") || line.starts_with("; X") || line.starts_with("; F")
            };
            let names_program = line.contains("\"program\"") && !is_csv;
            if is_head || names_program {
                continue;
            }
            let noticed = judged(&file, &changed).is_none_or(|found| !found.violations.is_empty());
            assert!(noticed, "{line}\n{}", &changed[line_start..].lines().next().unwrap());
        }
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
    "kind = 'stress_gradient'\nstrength = 0.05",
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
    "kind = 'thermo_optic'\nfactor = 0.9",
    "kind = 'channel:supply_v'\ngain_deg_per_h_per_unit = 0.1",
    "kind = 'custom'\nformula = 'a*mean_rate + 0.01*(T_mean - T_in) + 1e-5*t'\n[effect.parameters]\na = 12.0",
    "kind = 'surface_film'\nfilm_w_per_m2_k = 30.0\n[[effect]]\nkind = 'spool_mass'\nheat_capacity_j_per_m2_k = 3000.0\n\
     contact_w_per_m2_k = 200.0\n[[effect]]\nkind = 'strain_mismatch'\nmismatch = -0.02\n[[effect]]\n\
     kind = 'self_heating'\npower_w_per_m2 = 30.0\ntime_constant_s = 300.0\n[[effect]]\nkind = 'turn_mismatch'\nturns = 2.0",
    "kind = 'surface_film'\nfilm_w_per_m2_k = 30.0\n[[effect]]\nkind = 'conductivity_temperature'\nslope_per_k = -0.003\n\
     [[effect]]\nkind = 'self_heating'\npower_w_per_m2 = 30.0\ntime_constant_s = 300.0",
];

#[test]
fn the_rate_error_of_every_effect_is_found_again_by_code_of_its_own() {
    for effect in EFFECTS {
        let stated = if effect.is_empty() { String::new() } else { format!("[[effect]]\n{effect}\n") };
        let file = model(&format!("{WARM}{stated}"));
        let name = effect.split('\'').nth(1).unwrap_or("none");
        for classic_of in [Classic::Zyl, Classic::Qua] {
            let (_, document) = plan(&file, &classic(classic_of, 12).unwrap());
            let found = judged(&file, &serde_json::to_string(&document).unwrap()).unwrap();
            let RateCheck::Independent { worst_rad_per_s } = found.rate_check else {
                panic!("{name} is not known to the verification: {:?}", found.rate_check)
            };
            let (own, claimed) = (deg_per_h_from_rad_per_s(worst_rad_per_s), document.worst_rate_deg_per_h);
            println!(
                "{name:26} {:4} claimed {claimed:9.6} °/h, found {own:9.6} °/h, {:+.3} %",
                classic_of.key(),
                100.0 * (own / claimed - 1.0)
            );
            assert_eq!(found.violations, [], "{name}");
            assert!((own / claimed - 1.0).abs() < 5e-3, "{name}: {own} for {claimed}");
        }
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
