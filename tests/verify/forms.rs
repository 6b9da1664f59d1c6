//! Coils, windings and every form of their schedules, for the tests of the verification.

use std::path::Path;

use coilwright::io::files::sha256_hex;
use coilwright::io::json::schedule::ScheduleJson;
use coilwright::io::model::{ModelFile, NamedPattern};
use coilwright::io::read::model_file::parse_model;
use coilwright::io::read::pattern_file::parse_pattern;
use coilwright::io::read::schedule_reader::{parse_claim, shop_of};
use coilwright::io::write::machine_program::{gcode, machine_program};
use coilwright::io::write::traveller::traveller;
use coilwright::pattern::Pattern;
use coilwright::pattern::classic::Classic;
use coilwright::report::page::assets;
use coilwright::report::traveller::traveller_page;
use coilwright::schedule::Schedule;
use coilwright::search::cost::worst_case::SolvedProfiles;
use coilwright::verify::{Truth, Verification, verify};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub const PAPER: &str = r#"
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

pub const LONG: &str = r#"
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

pub fn model(text: &str) -> ModelFile {
    parse_model(Path::new("model.toml"), text).unwrap()
}

pub fn plan(file: &ModelFile, named: &NamedPattern) -> (Schedule, ScheduleJson) {
    let schedule = Schedule::new(&file.model.wound_coil().unwrap(), &named.pattern).unwrap();
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles()).unwrap();
    let worst = solved.worst_case(&file.model, &named.pattern).unwrap();
    let document = ScheduleJson::new(file, named, &schedule, &worst);
    (schedule, document)
}

pub fn program(file: &ModelFile, named: &NamedPattern) -> ScheduleJson {
    let (schedule, document) = plan(file, named);
    machine_program(&document, &schedule, &file.production, file.model.coil.axial_pitch_m())
}

/// None where the text is refused before it can be verified.
pub fn judged(file: &ModelFile, text: &str) -> Option<Verification> {
    let claim = parse_claim("file", text).ok()?;
    let (sha, shop) = (sha256_hex(&file.source), shop_of(&file.production));
    Some(verify(
        &Truth { model: &file.model, profiles: &file.profiles, model_sha256: &sha, shop: &shop, assets: &assets() },
        &claim,
    ))
}

pub fn classic(classic: Classic, layers: usize) -> Option<NamedPattern> {
    Some(NamedPattern { name: classic.key().to_owned(), pattern: classic.pattern(layers).ok()? })
}

pub fn shuffled(layers: usize, seed: u64) -> NamedPattern {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut segments: Vec<usize> = (1..=layers).collect();
    for i in (1..layers).rev() {
        segments.swap(i, random.random_range(0..=i));
    }
    NamedPattern { name: format!("shuffled-{seed}"), pattern: Pattern::new(segments).unwrap() }
}

/// A pattern of patterns/.
pub fn shipped(name: &str) -> NamedPattern {
    let text = std::fs::read_to_string(Path::new("patterns").join(name).with_extension("toml")).unwrap();
    parse_pattern(name, &text).unwrap()
}

/// Every form in which a schedule leaves the program, by name.
pub fn forms(file: &ModelFile, named: &NamedPattern) -> Vec<(&'static str, String)> {
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
        ("program.gcode", gcode(&program, &schedule)),
    ]
}
