//! Every schedule that the program emits is verified without violations, and every field of it matters.
//!
//! Reference: src/verify works the winding out again with code of its own. A changed field counts as harmless only if
//! what is claimed stays the same but for free text that the file itself introduces (the program's name, a pattern's
//! own name) and the time at which one of several equal maxima was read.

use std::path::Path;

use coilwright::io::model::{ModelFile, NamedPattern};
use coilwright::io::read::model_file::parse_model;
use coilwright::io::read::pattern_file::parse_pattern;
use coilwright::io::read::schedule_reader::{parse_claim, shop_of};
use coilwright::io::write::machine_program::{gcode, machine_program};
use coilwright::io::write::traveller::traveller;
use coilwright::io::{files::sha256_hex, json::schedule::ScheduleJson};
use coilwright::pattern::Pattern;
use coilwright::pattern::classic::Classic;
use coilwright::report::traveller::traveller_page;
use coilwright::schedule::Schedule;
use coilwright::search::cost::worst_case::SolvedProfiles;
use coilwright::units::deg_per_h_from_rad_per_s;
use coilwright::verify::{Claim, RateCheck, Truth, Verification, verify};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

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

/// A pattern of patterns/.
fn shipped(name: &str) -> NamedPattern {
    let text = std::fs::read_to_string(Path::new("patterns").join(name).with_extension("toml")).unwrap();
    parse_pattern(name, &text).unwrap()
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

/// Every form in which a schedule leaves the program, by name.
fn forms(file: &ModelFile, named: &NamedPattern) -> Vec<(&'static str, String)> {
    let (schedule, document) = plan(file, named);
    let pitch_m = file.model.coil.axial_pitch_m();
    let traveller = traveller(&document, &schedule, &file.production, pitch_m);
    let program = machine_program(&document, &schedule, &file.production, pitch_m);
    vec![
        ("schedule.csv", document.csv().unwrap()),
        ("schedule.json", serde_json::to_string_pretty(&document).unwrap()),
        ("traveller.csv", traveller.csv().unwrap()),
        ("traveller.json", serde_json::to_string_pretty(&traveller).unwrap()),
        ("traveller.html", traveller_page(&traveller, &named.pattern)),
        ("program.csv", program.csv().unwrap()),
        ("program.gcode", gcode(&program)),
    ]
}

/// The fields of a text: words and numbers; of a page those that are seen or that are its data.
fn fields(form: &str, text: &str) -> Vec<std::ops::Range<usize>> {
    let mut found: Vec<std::ops::Range<usize>> = Vec::new();
    let (mut in_tag, mut hidden) = (false, false);
    for (i, c) in text.char_indices() {
        if form.ends_with("html") {
            if c == '<' {
                in_tag = true;
                let is_data = text[i..].starts_with("<script type=\"application/json\"");
                let hides = ["<style", "<script"].iter().any(|tag| text[i..].starts_with(tag)) && !is_data;
                hidden = hides || (hidden && !text[i..].starts_with("</"));
            }
            let inside = in_tag || hidden;
            in_tag &= c != '>';
            if inside {
                continue;
            }
        }
        if c.is_alphanumeric() || "._+-".contains(c) {
            match found.last_mut() {
                Some(last) if last.end == i => last.end = i + c.len_utf8(),
                _ => found.push(i..i + c.len_utf8()),
            }
        }
    }
    found
}

/// One character of a field becomes another one, goes, or is doubled.
fn mutate(field: &str, random: &mut ChaCha8Rng) -> String {
    let mut characters: Vec<char> = field.chars().collect();
    let at = random.random_range(0..characters.len());
    let old = characters[at];
    match random.random_range(0..4) {
        0 => drop(characters.remove(at)),
        1 => characters.insert(at, old),
        _ if old.is_ascii_digit() => {
            let digit = old.to_digit(10).unwrap();
            characters[at] = char::from_digit((digit + random.random_range(1..10)) % 10, 10).unwrap();
        }
        _ => characters[at] = if old == 'x' { 'y' } else { 'x' },
    }
    characters.into_iter().collect()
}

/// What a file claims, without what it may say as it likes: the name of its pattern and of the program that wrote it,
/// and at which of several equal maxima the worst rate error was read.
fn substance(text: &str) -> Option<Claim> {
    let mut claim = parse_claim("file", text).ok()?;
    claim.pattern = None;
    claim.worst_time_s = None;
    if let Some(page) = &mut claim.page
        && let Some(i) = page.iter().position(|p| p.text == "Made by")
        && i + 1 < page.len()
    {
        page.remove(i + 1);
    }
    Some(claim)
}

/// A number that moves by one unit of its last printed digit at most and is still within half of one of the true value
/// (or the verification would have said so).
fn same_to_the_last_digit(old: &str, new: &str) -> bool {
    let decimals = old.split_once('.').map_or(0, |(_, digits)| digits.len() as i32);
    match (old.parse::<f64>(), new.parse::<f64>()) {
        (Ok(old), Ok(new)) => decimals > 0 && (old - new).abs() <= 1.001 * 10f64.powi(-decimals),
        _ => false,
    }
}

#[test]
fn of_a_thousand_changes_of_one_field_in_any_form_each_is_noticed_or_changes_nothing_that_is_claimed() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut counts: std::collections::BTreeMap<&str, [usize; 4]> = std::collections::BTreeMap::new();
    let mut unnoticed = Vec::new();
    for (text, named, changes) in [
        (PAPER, classic(Classic::Qua, 16).unwrap(), 75),
        (PAPER, shuffled(16, 3), 75),
        (LONG, classic(Classic::Oct, 40).unwrap(), 12),
        (LONG, shipped("searched-standard-40"), 12),
    ] {
        let file = model(text);
        for (form, whole) in forms(&file, &named) {
            let clean = judged(&file, &whole).unwrap();
            assert_eq!(clean.violations, [], "{form}");
            let original = substance(&whole);
            let fields = fields(form, &whole);
            for _ in 0..changes {
                let span = fields[random.random_range(0..fields.len())].clone();
                let new = mutate(&whole[span.clone()], &mut random);
                let changed = format!("{}{new}{}", &whole[..span.start], &whole[span.end..]);
                let count: &mut [usize; 4] = counts.entry(form).or_default();
                match judged(&file, &changed) {
                    None => count[0] += 1,
                    Some(found) if !found.violations.is_empty() => count[1] += 1,
                    Some(_) if substance(&changed) == original => count[2] += 1,
                    Some(_) if same_to_the_last_digit(&whole[span.clone()], &new) => count[3] += 1,
                    Some(_) => unnoticed.push(format!("{form}: \"{}\" became \"{new}\"", &whole[span])),
                }
            }
        }
    }
    let mut total = 0;
    for (form, [refused, violations, harmless, close]) in &counts {
        println!(
            "{form:15} {refused:4} refused as no schedule, {violations:4} violations, {harmless:4} change nothing claimed, {close:4} are as close to the truth"
        );
        total += refused + violations + harmless + close;
    }
    println!("{total} changes of one field, {} unnoticed", unnoticed.len());
    assert_eq!(unnoticed, Vec::<String>::new());
    assert!(total >= 1000, "{total}");
}

#[test]
fn a_page_whose_visible_table_was_altered_is_caught_though_its_data_are_right() {
    let file = model(PAPER);
    let (_, page) = forms(&file, &classic(Classic::Qua, 16).unwrap()).swap_remove(4);
    for (seen, altered, field) in [
        ("<td>12.500</td>", "<td>12.600</td>", "length_m on the page"),
        ("first → second", "second → first", "direction on the page"),
        ("UV acrylate", "epoxy", "Adhesive on the page"),
        ("0.120 (", "0.150 (", "tension_n on the page"),
        ("half A</text>", "half B</text>", "a heading on the page"),
    ] {
        assert!(page.contains(seen), "{seen}");
        let found = judged(&file, &page.replacen(seen, altered, 1)).unwrap();
        let fields: Vec<&str> = found.violations.iter().map(|v| v.field.as_str()).collect();
        assert_eq!(fields, [field], "{seen}");
    }
    let found = judged(&file, &page.replacen("<h2>Release", "<p>Skip step 3.</p><h2>Release", 1)).unwrap();
    assert!(found.violations.iter().any(|v| v.field == "the page"), "{:?}", found.violations);
}

#[test]
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
    for entry in std::fs::read_dir("src/verify").unwrap().map(|entry| entry.unwrap().path()) {
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
    let stated = EFFECTS.concat();
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

/// A heated flange whose material's conductivity depends on temperature is stepped on both sides; what emits schedules
/// takes long, so the pack is small and its profile short.
#[test]
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
