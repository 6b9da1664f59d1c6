//! Thermal stress against finite elements (scikit-fem, tests/data/stress), closed forms, and published thermal
//! sensitivities of coated fibres.

use coilwright::coil::{Coil, Fibre};
use coilwright::effect::{DeclaredEffect, PackState};
use coilwright::pattern::Pattern;
use coilwright::pattern::classic::Classic;
use coilwright::rate::{CoilModel, LayerWeights, RateModel};
use coilwright::stress::material::Material;
use coilwright::stress::{BondedSpool, CoatedFibre, Materials, PackStress, library};
use coilwright::units::{LIGHT_SPEED_M_PER_S, REFERENCE_TEMPERATURE_K, kelvin_from_celsius};
use serde_json::Value;

fn named(name: &str) -> Material {
    library::find(name).unwrap_or_else(|| panic!("{name}")).material()
}

fn fibre(refractive_index: f64, thermo_optic_per_k: f64, outer_um: f64) -> Fibre {
    Fibre {
        refractive_index,
        thermo_optic_per_k,
        group_index: None,
        thermal_expansion_per_k: 0.0,
        wavelength_m: 1.55e-6,
        outer_diameter_m: outer_um * 1e-6,
    }
}

fn coated(glass: Material, glass_um: f64, hole_um: f64, coatings: &[(Material, f64)]) -> CoatedFibre {
    let (p11, p12) = if hole_um > 0.0 { (0.0, 0.0) } else { (0.113, 0.252) };
    CoatedFibre {
        glass,
        glass_radius_m: 0.5e-6 * glass_um,
        hole_radius_m: 0.5e-6 * hole_um,
        coatings: coatings.iter().map(|(m, um)| (m.clone(), 0.5e-6 * um)).collect(),
        p11,
        p12,
    }
}

fn model(layers: usize, materials: &Materials) -> CoilModel {
    let model = CoilModel::builder("coil", layers)
        .fibre(fibre(1.45, 1e-5, 165.0))
        .mean_diameter_m(0.08 + layers as f64 * 165e-6)
        .axial_pitch_m(170e-6)
        .turns_per_layer(50.0);
    model.build().unwrap().with_materials(materials)
}

/// The numbers that tests/data/stress/ring.py was given.
fn potted() -> Materials {
    let soft = named("acrylate-soft-rubbery");
    let hard = Material::constant("hard", 1.5e9, 0.38, 8e-5);
    Materials {
        fibre: coated(Material::constant("glass", 72e9, 0.17, 5.5e-7), 80.0, 0.0, &[(soft, 125.0), (hard, 165.0)]),
        adhesive: Material::constant("epoxy", 4e9, 0.35, 6e-5),
        spool: Some(BondedSpool { material: Material::constant("aluminium", 68.9e9, 0.35, 24e-6), thickness_m: 3e-3 }),
    }
}

#[test]
fn strains_of_a_wound_ring_are_those_of_finite_elements() {
    let text = std::fs::read_to_string("tests/data/stress/skfem.json").unwrap();
    let reference: Value = serde_json::from_str(&text).unwrap();
    let materials = potted();
    let coil = model(24, &materials).coil;
    let stress = PackStress::new(&materials, &coil);
    let temperatures = vec![REFERENCE_TEMPERATURE_K; 24];
    let mut worst = 0.0_f64;
    for (name, case) in reference["cases"].as_object().unwrap() {
        let changes: Vec<f64> = match name.as_str() {
            "uniform" => vec![1.0; 24],
            "gradient" => (0..24).map(|j| j as f64 / 23.0).collect(),
            "outermost" => (0..24).map(|j| f64::from(j == 23)).collect(),
            other => panic!("{other}"),
        };
        let found = stress.changes(&temperatures, &changes);
        let numbers =
            |key: &str| -> Vec<f64> { case[key].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect() };
        let (hoop, radial) = (numbers("hoop"), numbers("radial"));
        let size = |values: &[f64]| values.iter().map(|v| v.abs()).fold(0.0, f64::max);
        for (j, layer) in found.iter().enumerate() {
            let off = ((layer.strain.hoop - hoop[j]) / size(&hoop)).abs();
            worst = worst.max(off).max(((layer.strain.radial - radial[j]) / size(&radial)).abs());
        }
        worst = worst.max((found[0].strain.axial / case["axial"].as_f64().unwrap() - 1.0).abs());
    }
    println!("largest difference from finite elements {worst:.1e}");
    // The transverse shear is from a plane mesh of its own, the rest from radial ones.
    assert!(worst < 2e-3, "{worst}");
}

#[test]
fn glass_alone_is_the_plain_fibre_with_its_expansion() {
    let glass = Material::constant("glass", 72e9, 0.17, 5.5e-7);
    let materials =
        Materials { fibre: coated(glass.clone(), 80.0, 0.0, &[(glass.clone(), 165.0)]), adhesive: glass, spool: None };
    let stressed = model(16, &materials);
    assert!((stressed.coil.fibre().thermal_expansion_per_k / 5.5e-7 - 1.0).abs() < 1e-6);
    // Uniform change only: under a gradient glass holds glass.
    let plain = CoilModel { effects: Vec::new(), ..stressed.clone() };
    let pattern = Classic::Sym.pattern(16).unwrap();
    let error = |model: &CoilModel| rate_error(model, &pattern, &[0.01; 16], REFERENCE_TEMPERATURE_K);
    assert!((error(&stressed) - error(&plain)).abs() < 1e-9 * hard_bound(&plain, 0.01));
}

fn rate_error(model: &CoilModel, pattern: &Pattern, rates: &[f64], temperature_k: f64) -> f64 {
    let rate = RateModel::new(model, pattern, &[]).unwrap();
    rate.rate_error_rad_per_s(&state(rates, &vec![temperature_k; rates.len()]))
}

fn state<'a>(rates: &'a [f64], temperatures: &'a [f64]) -> PackState<'a> {
    PackState {
        time_s: 0.0,
        temperatures_k: temperatures,
        rates_k_per_s: rates,
        axial_moments_k_per_s: &[],
        mean_temperature_k: temperatures[0],
        mean_rate_k_per_s: rates[0],
        ambient_k: temperatures[0],
        ambient_rate_k_per_s: rates[0],
        channels: &[],
        thermal_rate_rad_per_s: 0.0,
    }
}

fn hard_bound(model: &CoilModel, rate_k_per_s: f64) -> f64 {
    let fibre = model.coil.fibre();
    fibre.refractive_index * fibre.path_per_k() * rate_k_per_s * model.coil.length_m()
        / (4.0 * model.coil.mean_diameter_m())
}

#[test]
fn a_steady_ramp_shows_the_weighted_sum_of_the_layers_paths() {
    let materials = potted();
    let model = model(16, &materials);
    let pattern = Classic::Sym.pattern(16).unwrap();
    let coil: &Coil = &model.coil;
    let paths: Vec<f64> = PackStress::new(&materials, coil).per_kelvin(300.0).iter().map(|l| l.path).collect();
    let weights = LayerWeights::new(coil, &pattern).unwrap().total_m2();
    let sum: f64 = weights.iter().zip(&paths).map(|(w, p)| w * p).sum();
    let expected = 1.45 / (coil.length_m() * coil.mean_diameter_m()) * sum * 0.01;
    let found = rate_error(&model, &pattern, &[0.01; 16], 300.0);
    assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    // The fast path's coefficients are the reference's.
    let rate = RateModel::new(&model, &pattern, &[]).unwrap();
    let rates: Vec<f64> = (0..16).map(|j| 0.01 * (0.3 * f64::from(j)).sin()).collect();
    let temperatures = vec![300.0; 16];
    let at = state(&rates, &temperatures);
    let response = rate.weight_response(&at);
    let of_weights = LayerWeights::new(coil, &pattern).unwrap();
    let sum: f64 = (0..16)
        .map(|j| {
            response.half_a_rad_per_s_m2[j] * of_weights.half_a_m2[j]
                + response.half_b_rad_per_s_m2[j] * of_weights.half_b_m2[j]
        })
        .sum();
    assert!((sum - rate.rate_error_rad_per_s(&at)).abs() < 1e-12 * hard_bound(&model, 0.01));
}

#[test]
fn every_layer_follows_all_temperatures_linearly_where_materials_are_constant() {
    let materials = potted();
    let model = model(12, &materials);
    let stress: &DeclaredEffect = model.effects.last().unwrap();
    assert!(stress.bind(&model.coil, &[]).is_linear());
    let pattern = Classic::Dip.pattern(12).unwrap();
    let error = |rates: &[f64]| rate_error(&model, &pattern, rates, 280.0);
    let alone: Vec<f64> = (0..12).map(|k| error(&(0..12).map(|j| f64::from(j == k)).collect::<Vec<_>>())).collect();
    let rates: Vec<f64> = (0..12).map(|j| 1.0 + f64::from(j * j) / 30.0).collect();
    let sum: f64 = alone.iter().zip(&rates).map(|(a, r)| a * r).sum();
    let size: f64 = alone.iter().map(|a| a.abs()).sum();
    assert!((sum - error(&rates)).abs() < 1e-9 * size);
    let own_alone = CoilModel { effects: Vec::new(), ..model.clone() };
    let outermost = rate_error(&own_alone, &pattern, &(0..12).map(|j| f64::from(j == 11)).collect::<Vec<_>>(), 280.0);
    assert!((alone[11] / outermost - 1.0).abs() > 0.02, "{} {outermost}", alone[11]);
}

const SOLID_INDEX: f64 = 1.468;

/// κ at a temperature of coated and bare fibres by themselves, in the library's materials.
fn free_path(index: f64, index_per_k: f64, made: &CoatedFibre, celsius: f64) -> f64 {
    let outer_um = 2e6 * made.coatings.last().map_or(made.glass_radius_m, |(_, r)| *r);
    made.free_fibre(&fibre(index, index_per_k, outer_um), kelvin_from_celsius(celsius)).path_per_k
}

#[test]
fn coated_fibres_have_the_published_thermal_sensitivities() {
    let glass = || named("silica-over-temperature");
    let (soft, hard) = (named("acrylate-soft"), named("acrylate-hard"));
    let bare = coated(glass(), 125.0, 0.0, &[]);
    let standard = coated(glass(), 125.0, 0.0, &[(soft.clone(), 190.0), (hard.clone(), 245.0)]);
    let of_solid = |made: &CoatedFibre, c: f64| free_path(SOLID_INDEX, 1.0e-5, made, c);
    // 39 ps/(km K): Slavík et al., Sci. Rep. 5, 15447 (2015); 40: Proc. SPIE 11355 (2020). Polymers vary by tens of percent.
    let delay = of_solid(&standard, 20.0) / LIGHT_SPEED_M_PER_S * 1e15;
    println!(
        "coated standard fibre {delay:.1} ps/(km K), bare {:.1}",
        of_solid(&bare, 20.0) / LIGHT_SPEED_M_PER_S * 1e15
    );
    assert!((37.0..43.0).contains(&delay), "{delay}");
    // Bradley et al., J. Lightwave Technol. (2020), abstract: a hollow core without coating crosses zero near −70 °C, and a coating
    // counts most where it becomes glassy in the cold.
    let hollow = coated(glass(), 200.0, 80.0, &[]);
    let of_hollow = |made: &CoatedFibre, c: f64| free_path(1.0, 0.0, made, c);
    assert!(of_hollow(&hollow, -95.0) < 0.0 && of_hollow(&hollow, -60.0) > 0.0);
    let by_coating = |c: f64| of_solid(&standard, c) - of_solid(&bare, c);
    assert!(by_coating(-80.0) > 2.0 * by_coating(20.0), "{} {}", by_coating(-80.0), by_coating(20.0));
    // A buffered coating halves what a hard one alone does to a hollow core: 3.3 rad/(m K) at 1550 nm, a twofold improvement
    // (delay interferometry, 2025; abstract).
    let single = coated(glass(), 200.0, 80.0, &[(hard.clone(), 300.0)]);
    let buffered = coated(glass(), 200.0, 80.0, &[(soft, 280.0), (hard, 330.0)]);
    let improvement = of_hollow(&single, 20.0) / of_hollow(&buffered, 20.0);
    let phase = std::f64::consts::TAU * of_hollow(&buffered, 20.0) / 1.55e-6;
    println!("hollow core: {phase:.1} rad/(m K) buffered, {improvement:.2} times as much with a hard coating alone");
    assert!((1.5..2.5).contains(&improvement) && (2.5..6.0).contains(&phase));
}

#[test]
fn the_published_ratios_of_solid_to_hollow_gyros_lie_between_a_hard_coating_and_none() {
    // Nat. Commun. (2025), s41467-025-58381-6, abstract: 9.24, 10.68 and 6.82 over three ranges of temperature, coils of the same
    // size. Ω ∝ n κ; potting and coating of those coils are not stated, so only bounds can be had.
    let glass = || named("silica-over-temperature");
    let (soft, hard) = (named("acrylate-soft"), named("acrylate-hard"));
    let solid = coated(glass(), 125.0, 0.0, &[(soft, 190.0), (hard.clone(), 245.0)]);
    let (bare, held) = (coated(glass(), 200.0, 80.0, &[]), coated(glass(), 200.0, 80.0, &[(hard, 300.0)]));
    let ratio = |hollow: &CoatedFibre, c: f64| {
        SOLID_INDEX * free_path(SOLID_INDEX, 1.0e-5, &solid, c) / free_path(1.0, 0.0, hollow, c)
    };
    for (published, celsius) in [(9.24, -20.0), (10.68, 20.0), (6.82, -40.0)] {
        let (least, most) = (ratio(&held, celsius), ratio(&bare, celsius));
        println!("{published}: {least:.1} to {most:.1} at {celsius} °C");
        assert!(published < most, "{published} {most}");
        assert!(published > 0.7 * least, "{published} {least}");
    }
}
