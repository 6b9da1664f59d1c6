//! What holds for every coil, every pattern and every file: properties tried on random cases.

mod mutations;

use std::path::Path;

use coilwright::coil::{Coil, CoilSpec, Fibre, LayerLength};
use coilwright::effect::{CATALOGUE, DeclaredEffect, FibrePlace};
use coilwright::io::model::NamedPattern;
use coilwright::io::read::model_file::parse_model;
use coilwright::io::read::pattern_file::{parse_pattern, print_pattern};
use coilwright::pattern::windability::{WindabilityClass, WindingGraph};
use coilwright::pattern::{Half, Pattern};
use coilwright::profile::{Piece, Profile, ProfileSpec};
use coilwright::rate::{CoilModel, RateModel};
use coilwright::reproduce::yan1998::model_of_layers;
use coilwright::search::cost::guaranteed::UnitStep;
use coilwright::search::cost::worst_case::SolvedProfiles;
use coilwright::thermal::{DEFAULT_CELLS_PER_LAYER, Extent, Location, PackMaterial, ThermalHistory};
use proptest::prelude::*;
use proptest::sample::Index;

/// A coil model of 2 … 40 layers, a pattern for it, and a rate for each layer.
#[derive(Debug, Clone)]
struct Case {
    model: CoilModel,
    pattern: Pattern,
    rates_k_per_s: Vec<f64>,
}

impl Case {
    fn rate_error_rad_per_s(&self, pattern: &Pattern, rates_k_per_s: &[f64]) -> f64 {
        let history = ThermalHistory {
            layers: rates_k_per_s.len(),
            times_s: vec![0.0],
            temperature_k: vec![293.15; rates_k_per_s.len()],
            rate_k_per_s: rates_k_per_s.to_vec(),
            axial_moment_k_per_s: vec![],
            axial_moment_k: vec![],
            ambient_k: vec![293.15],
            ambient_rate_k_per_s: vec![0.0],
        };
        RateModel::new(&self.model, pattern, &[]).unwrap().series_rad_per_s(&history)[0]
    }

    /// What rounding is to be measured against: the bound for the largest rate.
    fn scale_rad_per_s(&self) -> f64 {
        let largest = self.rates_k_per_s.iter().map(|r| r.abs()).fold(1e-6, f64::max);
        RateModel::new(&self.model, &self.pattern, &[]).unwrap().hard_bound_rad_per_s(largest)
    }
}

fn patterns(halves: std::ops::RangeInclusive<usize>) -> impl Strategy<Value = Pattern> {
    halves
        .prop_flat_map(|half| Just((1..=2 * half).collect::<Vec<usize>>()).prop_shuffle())
        .prop_map(|segments| Pattern::new(segments).unwrap())
}

fn cases(halves: std::ops::RangeInclusive<usize>) -> impl Strategy<Value = Case> {
    let dimensions = (10e-3..80e-3, 80e-6..300e-6, 5.0..80.0, any::<bool>());
    (patterns(halves), dimensions).prop_flat_map(|(pattern, (bore_radius_m, radial_pitch_m, turns, actual))| {
        let layers = pattern.layers();
        let fibre = Fibre {
            refractive_index: 1.45,
            thermo_optic_per_k: 1.0e-5,
            group_index: None,
            thermal_expansion_per_k: 0.5e-6,
            wavelength_m: 1550e-9,
            outer_diameter_m: radial_pitch_m,
        };
        let spec = CoilSpec {
            fibre,
            layers,
            turns_per_layer: Some(turns),
            bore_radius_m,
            radial_pitch_m,
            axial_pitch_m: radial_pitch_m,
            layer_length: if actual { LayerLength::Actual } else { LayerLength::Equal },
            length_m: None,
        };
        let model = CoilModel {
            name: "random".into(),
            coil: Coil::new(spec).unwrap(),
            extent: Extent::HalfSpace,
            material: PackMaterial::Diffusivity { m2_per_s: 2.7e-7 },
            location: Location::OuterLayer,
            rate_mean_s: 0.0,
            cells_per_layer: DEFAULT_CELLS_PER_LAYER,
            effects: vec![],
        };
        prop::collection::vec(-0.05..0.05, layers).prop_map(move |rates_k_per_s| Case {
            model: model.clone(),
            pattern: pattern.clone(),
            rates_k_per_s,
        })
    })
}

#[test]
fn effects_whose_path_depends_on_temperature_say_so() {
    let model = model_of_layers(200.0, 8).unwrap();
    let mut depending = Vec::new();
    for spec in CATALOGUE {
        let effect = DeclaredEffect::at_start(spec).bind(&model.coil, &[]);
        let at = |temperature_k| effect.path_factor(&FibrePlace { layer: 3, half: Half::A, temperature_k });
        if (0..100).any(|i| at(250.0 + f64::from(i)) != at(250.0)) {
            assert!(effect.path_depends_on_temperature(), "{}", spec.kind);
            depending.push(spec.kind);
        }
    }
    assert_eq!(depending, ["glass_transition", "thermo_optic_temperature"]);
}

proptest! {
    #[test]
    fn the_weights_of_all_layers_add_up_to_zero(case in cases(1..=20)) {
        let rate_model = RateModel::new(&case.model, &case.pattern, &[]).unwrap();
        let weights = rate_model.weights();
        let sum_m2: f64 = weights.total_m2().iter().sum();
        prop_assert!(sum_m2.abs() < 1e-12 * case.model.coil.length_m().powi(2), "{sum_m2}");
        // Half A lies below the middle, half B above it; each weighs a quarter of L².
        let quarter_m2 = 0.25 * case.model.coil.length_m().powi(2);
        prop_assert!((weights.half_a_m2.iter().sum::<f64>() + quarter_m2).abs() < 1e-12 * quarter_m2);
        prop_assert!((weights.half_b_m2.iter().sum::<f64>() - quarter_m2).abs() < 1e-12 * quarter_m2);
    }

    #[test]
    fn uniform_heating_gives_no_rate_error(case in cases(1..=20), rate_k_per_s in -0.05..0.05f64) {
        let uniform = vec![rate_k_per_s; case.pattern.layers()];
        let found = case.rate_error_rad_per_s(&case.pattern, &uniform);
        prop_assert!(found.abs() < 1e-10 * case.scale_rad_per_s(), "{found}");
    }

    #[test]
    fn exchanging_the_ends_flips_the_sign(case in cases(1..=20)) {
        let forward = case.rate_error_rad_per_s(&case.pattern, &case.rates_k_per_s);
        let reversed = case.rate_error_rad_per_s(&case.pattern.reversed(), &case.rates_k_per_s);
        prop_assert!((forward + reversed).abs() < 1e-11 * case.scale_rad_per_s(), "{forward} and {reversed}");
    }

    #[test]
    fn the_errors_of_two_heatings_add_up(case in cases(1..=20), factor in -3.0..3.0f64) {
        let others: Vec<f64> = case.rates_k_per_s.iter().rev().map(|r| factor * r).collect();
        let both: Vec<f64> = case.rates_k_per_s.iter().zip(&others).map(|(a, b)| a + b).collect();
        let apart = case.rate_error_rad_per_s(&case.pattern, &case.rates_k_per_s)
            + case.rate_error_rad_per_s(&case.pattern, &others);
        let together = case.rate_error_rad_per_s(&case.pattern, &both);
        prop_assert!((apart - together).abs() < 1e-10 * case.scale_rad_per_s(), "{apart} and {together}");
    }

    #[test]
    fn no_winding_exceeds_the_hard_bound_while_all_layers_warm(case in cases(1..=20)) {
        let warming: Vec<f64> = case.rates_k_per_s.iter().map(|r| r.abs()).collect();
        let found = case.rate_error_rad_per_s(&case.pattern, &warming).abs();
        prop_assert!(found <= case.scale_rad_per_s() * (1.0 + 1e-12), "{found}");
    }

    #[test]
    fn a_pattern_file_says_what_the_pattern_is(pattern in patterns(1..=40), name in "[!-~]([ -~]{0,18}[!-~])?") {
        let named = NamedPattern { name, pattern };
        let text = print_pattern(&named, &[coilwright::text::sink::TomlComment::of("coil: none")]);
        prop_assert_eq!(parse_pattern("p.toml", &text).unwrap(), named);
    }

    #[test]
    fn a_pattern_and_its_reverse_ask_the_same_of_the_winding_shop(pattern in patterns(1..=20)) {
        let found = WindingGraph::new(&pattern).windability();
        prop_assert_eq!(WindingGraph::new(&pattern.reversed()).windability(), found);
        prop_assert!(found.class().admits(&pattern));
        prop_assert!(WindabilityClass::Any.admits(&pattern));
        prop_assert!(found.reels <= pattern.layers() / 2 + 1 && found.captive <= found.reels);
    }

    #[test]
    fn a_class_is_read_as_it_is_written(captive in 0usize..100) {
        for class in [WindabilityClass::Standard, WindabilityClass::Captive(captive), WindabilityClass::Any] {
            prop_assert_eq!(WindabilityClass::parse(&class.to_string()), Some(class));
        }
    }

    #[test]
    fn sampled_profiles_keep_to_their_bounds(
        seed in any::<u64>(), count in 0usize..20, segments in 1usize..12, duration_s in 1.0..1e5f64, rate in 1e-5..1.0f64
    ) {
        let spec = ProfileSpec { max_rate_k_per_s: rate, count, segments, duration_s, seed, listed: vec![] };
        let profiles = spec.profiles();
        prop_assert_eq!(profiles.len(), count);
        prop_assert_eq!(&profiles, &spec.profiles());
        for profile in &profiles {
            prop_assert_eq!(profile.pieces().len(), segments);
            prop_assert!(profile.max_rate_k_per_s() <= rate);
            prop_assert!((profile.duration_s() / duration_s - 1.0).abs() < 1e-9);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_worst_case_is_no_smaller_than_the_error_at_any_sampled_time(case in cases(1..=8), rate in -0.01..0.01f64) {
        let pieces = vec![
            Piece { rate_k_per_s: rate, duration_s: 300.0 },
            Piece { rate_k_per_s: -0.5 * rate, duration_s: 900.0 },
        ];
        let profile = Profile::new("two ramps", pieces).unwrap();
        let solved = SolvedProfiles::new(&case.model, std::slice::from_ref(&profile)).unwrap();
        let worst = solved.worst_case(&case.model, &case.pattern).unwrap();
        let rate_model = RateModel::new(&case.model, &case.pattern, &[]).unwrap();
        let instants: Vec<_> = (0..=1200).map(|t| coilwright::thermal::Instant::after(f64::from(t))).collect();
        let series = rate_model.series_rad_per_s(&solved.profiles()[0].field.at(&instants));
        let sampled = series.iter().map(|r| r.abs()).fold(0.0, f64::max);
        prop_assert!(sampled <= worst.rate_rad_per_s.abs() * (1.0 + 1e-9), "{sampled} and {worst:?}");
    }

    #[test]
    fn no_sampled_worst_case_exceeds_the_guaranteed_one(case in cases(1..=8), pack in any::<bool>(), seed in any::<u64>()) {
        let extent = if pack { Extent::Pack } else { Extent::HalfSpace };
        let model = CoilModel { extent, ..case.model.clone() };
        let spec = ProfileSpec {
            max_rate_k_per_s: 0.01, count: 6, segments: 4, duration_s: 600.0, seed, listed: vec![],
        };
        let sampled = SolvedProfiles::new(&model, &spec.profiles()).unwrap().worst_case(&model, &case.pattern).unwrap();
        let bound = UnitStep::new(&model, 0.01).unwrap().guaranteed(&model, &case.pattern).unwrap();
        let (sampled, guaranteed) = (sampled.rate_rad_per_s.abs(), bound.rate_rad_per_s);
        prop_assert!(sampled <= guaranteed * (1.0 + 1e-9), "{sampled} and {guaranteed}");
    }

    #[test]
    fn a_worst_case_is_the_same_at_one_and_two_threads(case in cases(1..=8), seed in any::<u64>()) {
        let spec = ProfileSpec {
            max_rate_k_per_s: 0.01, count: 8, segments: 3, duration_s: 3000.0, seed, listed: vec![],
        };
        let worst_with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                SolvedProfiles::new(&case.model, &spec.profiles()).unwrap().worst_case(&case.model, &case.pattern).unwrap()
            })
        };
        prop_assert_eq!(worst_with(1), worst_with(2));
    }
}

/// A change of a few bytes, as an editor, a bad disk or a hurried user makes it.
#[derive(Debug, Clone)]
enum Damage {
    Delete(Index, u8),
    Insert(Index, String),
    SwapLines(Index, Index),
    Truncate(Index),
}

fn damages() -> impl Strategy<Value = Vec<Damage>> {
    let bits = prop::sample::select(vec![
        "nan",
        "-",
        "1e999",
        "\"",
        "[",
        "]]",
        "{",
        "=",
        "\n",
        "\0",
        "é",
        "🧵",
        "[[effect]]\n",
        "kind = \"x\"\n",
        "0x",
        "'''",
    ]);
    let text = prop_oneof![bits.prop_map(str::to_owned), "[ -~\n]{1,6}", any::<char>().prop_map(String::from)];
    let damage = prop_oneof![
        (any::<Index>(), 1u8..20).prop_map(|(at, count)| Damage::Delete(at, count)),
        (any::<Index>(), text).prop_map(|(at, text)| Damage::Insert(at, text)),
        (any::<Index>(), any::<Index>()).prop_map(|(a, b)| Damage::SwapLines(a, b)),
        any::<Index>().prop_map(Damage::Truncate),
    ];
    prop::collection::vec(damage, 1..4)
}

fn damaged(text: &str, damages: &[Damage]) -> String {
    let mut characters: Vec<char> = text.chars().collect();
    for damage in damages {
        match damage {
            Damage::Delete(at, count) => {
                let from = at.index(characters.len() + 1);
                let to = (from + usize::from(*count)).min(characters.len());
                characters.drain(from..to);
            }
            Damage::Insert(at, text) => {
                let from = at.index(characters.len() + 1);
                characters.splice(from..from, text.chars());
            }
            Damage::SwapLines(a, b) => {
                let mut lines: Vec<&[char]> = characters.split_inclusive(|c| *c == '\n').collect();
                if !lines.is_empty() {
                    let (a, b) = (a.index(lines.len()), b.index(lines.len()));
                    lines.swap(a, b);
                }
                characters = lines.concat();
            }
            Damage::Truncate(at) => characters.truncate(at.index(characters.len() + 1)),
        }
    }
    characters.into_iter().collect()
}

/// Every TOML file below a folder of the repository.
fn shipped(folder: &str) -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut paths: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    paths.sort();
    paths.iter().map(|path| std::fs::read_to_string(path).unwrap()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn a_damaged_model_file_is_understood_or_refused_with_reasons(which in any::<Index>(), damages in damages()) {
        let files = shipped("examples");
        let text = damaged(&files[which.index(files.len())], &damages);
        if let Err(faults) = parse_model(Path::new("examples/damaged.toml"), &text) {
            prop_assert!(!faults.faults.is_empty());
            prop_assert!(!faults.to_string().trim().is_empty());
        }
    }

    #[test]
    fn a_damaged_pattern_file_is_understood_or_refused_with_reasons(pattern in patterns(1..=12), damages in damages()) {
        let named = NamedPattern { name: "damaged".into(), pattern };
        let text = damaged(&print_pattern(&named, &[]), &damages);
        if let Err(faults) = parse_pattern("damaged.toml", &text) {
            prop_assert!(!faults.faults.is_empty());
            prop_assert!(!faults.to_string().trim().is_empty());
        }
    }
}
