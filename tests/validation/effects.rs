//! Reference: closed forms and limits, one for each effect; Carslaw and Jaeger (1959) for the thermal ones. Tolerances
//! are rounding (1e-9 and less) where the closed form is exact for the model, and stated beside the rest.

use std::f64::consts::PI;

use coilwright::coil::{Coil, CoilSpec, Fibre, LayerLength};
use coilwright::effect::{self, CATALOGUE, DeclaredEffect};
use coilwright::numeric::piecewise::PiecewiseLinear;
use coilwright::pattern::Pattern;
use coilwright::pattern::classic::Classic;
use coilwright::rate::{CoilModel, Past, RateModel};
use coilwright::record::TABLE_RATE;
use coilwright::thermal::{
    DEFAULT_CELLS_PER_LAYER, Drive, Extent, Field, Instant, Location, PackMaterial, ThermalHistory, solve,
};
use coilwright::units::{REFERENCE_TEMPERATURE_K, kelvin_from_celsius, rad_per_s_from_deg_per_h};

const LAYERS: usize = 16;
const CONDUCTIVITY: f64 = 0.35;
const HEAT_CAPACITY: f64 = 1.7e6;
const RAMP_K_PER_S: f64 = 0.01;

fn model(effects: Vec<DeclaredEffect>) -> CoilModel {
    let fibre = Fibre {
        refractive_index: 1.45,
        thermo_optic_per_k: 1.0e-5,
        group_index: None,
        thermal_expansion_per_k: 0.0,
        wavelength_m: 1550e-9,
        outer_diameter_m: 165e-6,
    };
    let spec = CoilSpec {
        fibre,
        layers: LAYERS,
        turns_per_layer: Some(50.0),
        bore_radius_m: 0.04,
        radial_pitch_m: 165e-6,
        axial_pitch_m: 170e-6,
        layer_length: LayerLength::Actual,
        length_m: None,
    };
    CoilModel {
        name: "tactical".into(),
        coil: Coil::new(spec).unwrap(),
        extent: Extent::Pack,
        material: PackMaterial::Conductivity { w_per_m_k: CONDUCTIVITY, heat_capacity_j_per_m3_k: HEAT_CAPACITY },
        location: Location::OuterLayer,
        rate_mean_s: 0.0,
        cells_per_layer: DEFAULT_CELLS_PER_LAYER,
        effects,
    }
}

/// An effect with its values as a user states them.
fn declared(kind: &str, stated: &[f64], choices: &[usize]) -> DeclaredEffect {
    let spec = effect::find(kind).unwrap();
    let values = spec.parameters.iter().zip(stated).map(|(p, v)| p.unit.to_si(*v)).collect();
    DeclaredEffect::new(spec, values, choices.to_vec()).unwrap()
}

fn with(kind: &str, stated: &[f64]) -> CoilModel {
    model(vec![declared(kind, stated, &[])])
}

fn ramp(start_k: f64, rate_k_per_s: f64, duration_s: f64) -> Drive {
    Drive::boundary(
        PiecewiseLinear::new(vec![0.0, duration_s], vec![start_k, start_k + rate_k_per_s * duration_s]).unwrap(),
    )
}

fn field(model: &CoilModel, drive: &Drive) -> Field {
    solve(&model.heat_path().unwrap(), drive).unwrap()
}

/// Just before the end of a ramp that lasts `duration_s`, from `start_k`.
fn at_end(model: &CoilModel, start_k: f64, rate_k_per_s: f64, duration_s: f64) -> ThermalHistory {
    field(model, &ramp(start_k, rate_k_per_s, duration_s)).at(&[Instant::before(duration_s)])
}

fn qua() -> Pattern {
    Classic::Qua.pattern(LAYERS).unwrap()
}

fn omega(model: &CoilModel, pattern: &Pattern, history: &ThermalHistory) -> f64 {
    RateModel::new(model, pattern, &[]).unwrap().series_rad_per_s(history)[0]
}

/// n κ/D, and L.
fn scale(model: &CoilModel) -> (f64, f64) {
    let fibre = model.coil.fibre();
    (fibre.refractive_index * fibre.path_per_k() / model.coil.mean_diameter_m(), model.coil.length_m())
}

fn compare(name: &str, found: f64, expected: f64, tolerance: f64) {
    let error = (found / expected - 1.0).abs();
    println!("{name}: {found:.9e}, closed form {expected:.9e}, relative difference {error:.1e}");
    assert!(error < tolerance, "{name}: {found} {expected}");
}

#[test]
fn strain_mismatch_in_a_steady_ramp_is_n_kappa_m_l_rate_over_4d() {
    let model = with("strain_mismatch", &[0.004]);
    let (per_length, length_m) = scale(&model);
    let found = omega(&model, &qua(), &at_end(&model, 293.15, RAMP_K_PER_S, 3000.0));
    compare("strain_mismatch", found, per_length * 0.004 * length_m * RAMP_K_PER_S / 4.0, 1e-9);
}

#[test]
fn glass_transition_is_a_strain_mismatch_in_the_cold_half_of_it_at_the_transition_and_none_in_the_warm() {
    let model = with("glass_transition", &[0.004, 10.0, 2.0]);
    let (per_length, length_m) = scale(&model);
    let full = per_length * 0.004 * length_m * RAMP_K_PER_S / 4.0;
    // A slow ramp's layers differ by less than a millikelvin, so the logistic is that of one temperature.
    let slow = 1e-5;
    let at = |end_c: f64| {
        let start_k = kelvin_from_celsius(end_c) - slow * 3000.0;
        omega(&model, &qua(), &at_end(&model, start_k, slow, 3000.0)) * RAMP_K_PER_S / slow
    };
    compare("far below T_g", at(-40.0), full, 1e-9);
    compare("at T_g", at(10.0), full / 2.0, 2e-5);
    compare("2 w above T_g", at(14.0), full / (1.0 + 2.0_f64.exp()), 5e-5);
    assert!(at(100.0).abs() < 1e-10 * full);
}

#[test]
fn midpoint_offset_is_n_kappa_2_delta_times_the_difference_of_rates_over_d() {
    for delta_m in [0.5, -0.25] {
        let steady = |lead: usize| {
            let model = model(vec![declared("midpoint_offset", &[delta_m], &[lead])]);
            omega(&model, &qua(), &at_end(&model, 293.15, RAMP_K_PER_S, 3000.0))
        };
        let (per_length, _) = scale(&model(vec![]));
        compare("isothermal lead", steady(1), per_length * 2.0 * delta_m * RAMP_K_PER_S, 1e-9);
        // The ambient lead warms with the pack: both cancel.
        assert!(steady(0).abs() < 1e-9 * steady(1).abs());
        // Right after the ramp's start only the lead warms (and the outermost layer, which the plain coil has too).
        let started = |model: &CoilModel| {
            let history = field(model, &ramp(293.15, RAMP_K_PER_S, 100.0)).at(&[Instant::after(0.0)]);
            omega(model, &qua(), &history)
        };
        let ambient = model(vec![declared("midpoint_offset", &[delta_m], &[0])]);
        let outer_share = ambient.coil.layer_lengths_m()[LAYERS - 1] / ambient.coil.length_m();
        let expected = -per_length * 2.0 * delta_m * RAMP_K_PER_S * (1.0 - outer_share);
        compare("ambient lead at once", started(&ambient) - started(&model(vec![])), expected, 1e-9);
    }
}

#[test]
fn stress_gradient_has_no_mean_and_a_unit_peak_and_adds_its_profile_to_the_weights() {
    let strength = 0.06;
    let model = with("stress_gradient", &[strength]);
    let coil = &model.coil;
    let inverse_square: Vec<f64> = (0..LAYERS).map(|j| coil.layer_radius_m(j).powi(-2)).collect();
    let lengths_m = coil.layer_lengths_m();
    let mean = inverse_square.iter().zip(lengths_m).map(|(f, l)| f * l).sum::<f64>() / coil.length_m();
    let peak = inverse_square.iter().map(|f| (f - mean).abs()).fold(0.0, f64::max);
    let zyl = Classic::Zyl.pattern(LAYERS).unwrap();
    let weights = RateModel::new(&model, &zyl, &[]).unwrap().weights().total_m2();
    let expected: f64 = inverse_square.iter().zip(&weights).map(|(f, w)| strength * (f - mean) / peak * w).sum();
    let (per_length, length_m) = scale(&model);
    let found = omega(&model, &zyl, &at_end(&model, 293.15, RAMP_K_PER_S, 3000.0));
    compare("stress_gradient", found, per_length / length_m * expected * RAMP_K_PER_S, 1e-8);
}

#[test]
fn factors_on_kappa_and_gain_scale_the_whole_error() {
    let plain = model(vec![]);
    let history = field(&plain, &ramp(293.15, RAMP_K_PER_S, 600.0)).at(&[Instant::after(20.0)]);
    let reference = omega(&plain, &qua(), &history);
    compare("thermo_optic", omega(&with("thermo_optic", &[1.3]), &qua(), &history), 1.3 * reference, 1e-12);
    let asymmetric = with("heating_cooling_asymmetry", &[0.05]);
    compare("asymmetry, heating", omega(&asymmetric, &qua(), &history), 1.05 * reference, 1e-12);
    let cooling = field(&plain, &ramp(293.15, -RAMP_K_PER_S, 600.0)).at(&[Instant::after(20.0)]);
    compare("asymmetry, cooling", omega(&asymmetric, &qua(), &cooling), -0.95 * reference, 1e-9);
    // At one uniform temperature κ(T) is a factor.
    let sloped = with("thermo_optic_temperature", &[0.002]);
    let mut warm = history.clone();
    warm.temperature_k = vec![REFERENCE_TEMPERATURE_K + 40.0; LAYERS];
    compare("thermo_optic_temperature", omega(&sloped, &qua(), &warm), 1.08 * reference, 1e-12);
}

#[test]
fn biases_follow_mean_temperature_its_rate_and_the_gradients_rate() {
    let history = at_end(&model(vec![]), REFERENCE_TEMPERATURE_K, RAMP_K_PER_S, 3000.0);
    let plain = omega(&model(vec![]), &qua(), &history);
    let excess = |kind: &str, stated: &[f64]| omega(&with(kind, stated), &qua(), &history) - plain;
    compare(
        "bias_temperature_rate",
        excess("bias_temperature_rate", &[12.0]),
        rad_per_s_from_deg_per_h(12.0 * RAMP_K_PER_S),
        1e-9,
    );
    let lengths_m = model(vec![]).coil.layer_lengths_m().to_vec();
    let mean_k = history.temperatures_k(0).iter().zip(&lengths_m).map(|(t, l)| t * l).sum::<f64>()
        / lengths_m.iter().sum::<f64>();
    let above = mean_k - REFERENCE_TEMPERATURE_K;
    compare(
        "bias_temperature",
        excess("bias_temperature", &[0.004, 1e-4]),
        rad_per_s_from_deg_per_h(0.004 * above + 1e-4 * above * above),
        1e-9,
    );
    let young = field(&model(vec![]), &ramp(293.15, RAMP_K_PER_S, 600.0)).at(&[Instant::after(5.0)]);
    let gradient = young.rates_k_per_s(0)[LAYERS - 1] - young.rates_k_per_s(0)[0];
    let found = omega(&with("bias_gradient_rate", &[100.0]), &qua(), &young) - omega(&model(vec![]), &qua(), &young);
    compare("bias_gradient_rate", found, rad_per_s_from_deg_per_h(100.0 * gradient), 1e-9);
}

/// F/S0 = (1 + ε)(I + E + D): what the gyro shows beside the table's rate is ε I, by hand.
#[test]
fn the_scale_factor_follows_table_temperature_and_direction_and_is_nothing_without_a_table() {
    let pattern = qua();
    let table = [TABLE_RATE.to_owned()];
    let at = |effects: Vec<DeclaredEffect>, courses_c: &[f64], table_deg_per_h: f64| {
        let rate = RateModel::new(&model(effects), &pattern, &table).unwrap();
        let mut past = Past::default();
        let mut last = f64::NAN;
        for (i, temperature_c) in courses_c.iter().enumerate() {
            let still = ThermalHistory {
                layers: LAYERS,
                times_s: vec![10.0 * i as f64],
                temperature_k: vec![kelvin_from_celsius(*temperature_c); LAYERS],
                rate_k_per_s: vec![0.0; LAYERS],
                axial_moment_k_per_s: vec![0.0; LAYERS],
                axial_moment_k: vec![0.0; LAYERS],
                ambient_k: vec![kelvin_from_celsius(*temperature_c)],
                ambient_rate_k_per_s: vec![0.0],
            };
            last = rate.rate_error_after(&rate.state(&still, 0, &[table_deg_per_h]), &mut past);
        }
        last
    };
    let deg_per_h = rad_per_s_from_deg_per_h;
    let error = || vec![declared("scale_factor_error", &[250.0], &[])];
    let slope = || vec![declared("scale_factor_temperature", &[10.0, 0.0], &[])];
    let branches = || vec![declared("scale_factor_temperature", &[10.0, 80.0], &[])];
    let lopsided = || vec![declared("scale_factor_asymmetry", &[60.0], &[])];
    compare("error", at(error(), &[55.0], -36_000.0), deg_per_h(-9.0), 1e-12);
    compare("coefficient", at(slope(), &[20.0, 55.0], -36_000.0), deg_per_h(-36_000.0 * 350e-6), 1e-9);
    compare("after warming", at(branches(), &[20.0, 40.0, 55.0], 36_000.0), deg_per_h(36_000.0 * 390e-6), 1e-9);
    // A degree back is the other branch, half of it none.
    compare("after cooling", at(branches(), &[20.0, 70.0, 55.0], 36_000.0), deg_per_h(36_000.0 * 310e-6), 1e-9);
    compare("in between", at(branches(), &[20.0, 55.5, 55.0], 36_000.0), deg_per_h(36_000.0 * 350e-6), 1e-9);
    for sign in [-1.0, 1.0] {
        compare("asymmetry", at(lopsided(), &[55.0], sign * 36_000.0), deg_per_h(36_000.0 * 30e-6), 1e-12);
    }
    let history = at_end(&model(vec![]), REFERENCE_TEMPERATURE_K, RAMP_K_PER_S, 3000.0);
    let plain = omega(&model(vec![]), &pattern, &history);
    for effects in [error(), branches(), lopsided()] {
        assert_eq!(omega(&model(effects), &pattern, &history), plain);
    }
}

#[test]
fn turn_mismatch_shortens_every_second_layer() {
    let changed = with("turn_mismatch", &[1.0]).wound_coil().unwrap();
    for (j, length_m) in changed.layer_lengths_m().iter().enumerate() {
        let turns = if j % 2 == 1 { 49.0 } else { 50.0 };
        compare("turn_mismatch", *length_m, 2.0 * PI * changed.layer_radius_m(j) * turns, 1e-12);
    }
}

#[test]
fn finite_pack_makes_a_half_space_the_pack_and_diffusivity_scales_time() {
    let mut half_space = model(vec![declared("finite_pack", &[], &[])]);
    half_space.extent = Extent::HalfSpace;
    assert_eq!(half_space.heat_path().unwrap(), model(vec![]).heat_path().unwrap());
    let rates = |model: &CoilModel, time_s: f64| {
        field(model, &ramp(293.15, RAMP_K_PER_S, 900.0)).at(&[Instant::after(time_s)]).rate_k_per_s
    };
    for (a, b) in rates(&with("diffusivity", &[2.0]), 10.0).iter().zip(rates(&model(vec![]), 20.0)) {
        assert!((a - b).abs() < 1e-12 * RAMP_K_PER_S, "{a} {b}");
    }
}

#[test]
fn surface_film_delays_a_thin_pack_by_its_heat_capacity_over_the_film() {
    // Biot number 0.5 %: the pack is one lump with the time constant ρc (r_out² − r_in²)/(2 h r_out).
    let model = with("surface_film", &[0.5]);
    let (inner_m, outer_m) = (0.04, model.coil.outer_radius_m());
    let lag_s = HEAT_CAPACITY * (outer_m * outer_m - inner_m * inner_m) / (2.0 * 0.5 * outer_m);
    let history = at_end(&model, 293.15, RAMP_K_PER_S, 30.0 * lag_s);
    let mean_k = history.temperatures_k(0).iter().sum::<f64>() / LAYERS as f64;
    let found_s = (293.15 + RAMP_K_PER_S * 30.0 * lag_s - mean_k) / RAMP_K_PER_S;
    compare("surface_film, delay in s", found_s, lag_s, 5e-3);
}

#[test]
fn spool_mass_adds_its_heat_to_what_flows_through_the_innermost_layer_in_a_steady_ramp() {
    let (capacity, contact) = (5500.0, 400.0);
    let model = with("spool_mass", &[capacity, contact, 0.0]);
    let history = at_end(&model, 293.15, RAMP_K_PER_S, 1e5);
    assert!(history.rates_k_per_s(0).iter().all(|r| (r - RAMP_K_PER_S).abs() < 1e-9 * RAMP_K_PER_S));
    // Steady ramp: r k dT/dr = Ṫ (C r_in + ρc (r² − r_in²)/2), integrated from the drive inwards.
    let inner_m: f64 = 0.04;
    let drive_m = model.coil.layer_radius_m(LAYERS - 1);
    let drop_k = |r_m: f64| {
        let ratio = (drive_m / r_m).ln();
        let spool = capacity * inner_m * ratio;
        let pack = HEAT_CAPACITY * (0.25 * (drive_m * drive_m - r_m * r_m) - 0.5 * inner_m * inner_m * ratio);
        RAMP_K_PER_S / CONDUCTIVITY * (spool + pack)
    };
    let temperatures_k = history.temperatures_k(0);
    for j in 0..LAYERS - 1 {
        let found = temperatures_k[LAYERS - 1] - temperatures_k[j];
        compare("spool_mass, drop in K", found, drop_k(model.coil.layer_radius_m(j)), 2e-3);
    }
}

#[test]
fn a_mount_holds_the_bore_between_the_drive_and_the_ambient() {
    let (contact, mount) = (400.0, 100.0);
    let model = with("spool_mass", &[5500.0, contact, mount]);
    let drive =
        Drive { boundary_k: PiecewiseLinear::constant(300.0), ambient_k: Some(PiecewiseLinear::constant(290.0)) };
    let history = field(&model, &drive).at(&[Instant::after(10.0)]);
    // Conductances in series, per radian and height: ln(r_d/r_1)/k, ln(r_1/r_in)/k + 1/(h r_in), 1/(h_m r_in).
    let (inner_m, first_m, drive_m) = (0.04_f64, model.coil.layer_radius_m(0), model.coil.layer_radius_m(LAYERS - 1));
    let outside = (drive_m / first_m).ln() / CONDUCTIVITY;
    let inside = (first_m / inner_m).ln() / CONDUCTIVITY + 1.0 / (contact * inner_m) + 1.0 / (mount * inner_m);
    let expected_k = 300.0 - 10.0 * outside / (outside + inside);
    let found_k = history.temperatures_k(0)[0];
    // The layer's mean lies off its middle by the curvature of ln r.
    compare("mount, innermost layer's drop in K", 300.0 - found_k, 300.0 - expected_k, 1e-4);
}

#[test]
fn self_heating_ends_in_the_steady_flow_of_a_hollow_cylinder() {
    let model = with("self_heating", &[80.0, 600.0]);
    let still = Drive::boundary(PiecewiseLinear::constant(300.0));
    let field = field(&model, &still);
    let early = field.at(&[Instant::after(0.0)]);
    // The modes of the heat cancel at the start to rounding.
    assert!(early.temperatures_k(0).iter().all(|t| (t - 300.0).abs() < 1e-6));
    let settled = field.at(&[Instant::after(5e4)]);
    let drive_m = model.coil.layer_radius_m(LAYERS - 1);
    // A layer's mean over its two cells differs from the value at its middle by (pitch/4r)²/2 of the profile's slope,
    // which weighs most where the rise is least: 1.2e-4 beside the outermost layer.
    for j in 0..LAYERS - 1 {
        let expected_k = 80.0 * 0.04 / CONDUCTIVITY * (drive_m / model.coil.layer_radius_m(j)).ln();
        compare("self_heating, rise in K", settled.temperatures_k(0)[j] - 300.0, expected_k, 2e-4);
    }
    // While the pack follows the heat at once, its rate is that of q∞/τ e^{−t/τ}.
    let late_s = 1800.0;
    let expected =
        80.0 * 0.04 / CONDUCTIVITY * (drive_m / model.coil.layer_radius_m(0)).ln() / 600.0 * (-3.0_f64).exp();
    let found = field.at(&[Instant::after(late_s)]).rates_k_per_s(0)[0];
    compare("self_heating, rate in K/s", found, expected, 0.05);
}

#[test]
fn sensor_lag_is_the_sensors_and_leaves_the_field_alone() {
    let model = model(vec![declared("sensor_lag", &[45.0], &[]), declared("sensor_lag", &[5.0], &[])]);
    assert_eq!(model.sensor_lag_s(), 50.0);
    assert_eq!(model.heat_path().unwrap(), self::model(vec![]).heat_path().unwrap());
}

#[test]
fn either_flange_gives_the_same_means_and_the_opposite_moments_in_proportion_to_a_small_film() {
    let of = |flange: usize, film: f64| {
        let model = model(vec![declared("axial_gradient", &[film], &[flange])]);
        let history = field(&model, &ramp(293.15, RAMP_K_PER_S, 900.0)).at(&[Instant::after(8.0)]);
        (history.rate_k_per_s.clone(), history.axial_moment_k_per_s.clone())
    };
    let (first, second, none) = (of(0, 50.0), of(1, 50.0), of(0, 0.1));
    for j in 0..LAYERS {
        assert!((first.0[j] - second.0[j]).abs() < 1e-12 * RAMP_K_PER_S);
        assert!((first.1[j] + second.1[j]).abs() < 1e-12 * RAMP_K_PER_S);
    }
    let largest = |m: &[f64]| m.iter().map(|v| v.abs()).fold(0.0, f64::max);
    // The heated end warms earlier: with the first flange the moment (towards the second) is negative.
    assert!(first.1[0] < 0.0 && largest(&first.1) > 1e-3 * RAMP_K_PER_S);
    // Small films act in proportion.
    let ratio = largest(&of(0, 0.2).1) / largest(&none.1);
    compare("axial_gradient, twice the film", ratio, 2.0, 2e-3);
}

#[test]
fn the_conductivitys_slope_makes_a_ramp_in_the_warm_what_a_larger_diffusivity_makes_of_it() {
    // At 60 °C with 0.5 %/K the pack conducts 1.2 times as well; a small ramp there changes nothing further.
    let small = 1e-4;
    let sloped = field(&with("conductivity_temperature", &[0.005]), &ramp(kelvin_from_celsius(60.0), small, 300.0));
    let scaled = field(&with("diffusivity", &[1.2]), &ramp(kelvin_from_celsius(60.0), small, 300.0));
    let instants: Vec<Instant> = (1..60).map(|i| Instant::after(2.0 * i as f64)).collect();
    let (a, b) = (sloped.at(&instants), scaled.at(&instants));
    let worst = a.rate_k_per_s.iter().zip(&b.rate_k_per_s).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("conductivity_temperature: rates differ by {:.1e} of the ramp", worst / small);
    assert!(worst < 2e-3 * small);
}

#[test]
fn what_an_effect_says_of_its_linearity_is_what_it_does() {
    let zyl = Classic::Zyl.pattern(LAYERS).unwrap();
    let state = |scale: f64, temperature_k: f64| ThermalHistory {
        layers: LAYERS,
        times_s: vec![100.0],
        temperature_k: vec![temperature_k; LAYERS],
        rate_k_per_s: (0..LAYERS).map(|j| scale * 1e-3 * ((j * j) as f64 - 30.0)).collect(),
        axial_moment_k_per_s: (0..LAYERS).map(|j| scale * 1e-4 * j as f64).collect(),
        axial_moment_k: vec![0.0; LAYERS],
        ambient_k: vec![temperature_k],
        ambient_rate_k_per_s: vec![scale * 5e-3],
    };
    for spec in CATALOGUE {
        let declared = DeclaredEffect::at_start(spec);
        let model = model(vec![declared.clone()]);
        let of =
            |scale: f64, temperature_c: f64| omega(&model, &zyl, &state(scale, kelvin_from_celsius(temperature_c)));
        let reference = of(1.0, 20.0);
        let homogeneous = (of(-2.0, 20.0) + 2.0 * reference).abs() < 1e-9 * reference.abs();
        let constant =
            [-60.0, 0.0, 45.0, 90.0].iter().all(|t| (of(1.0, *t) - reference).abs() < 1e-9 * reference.abs());
        let says = declared.bind(&model.coil, &[]).is_linear();
        // This one acts through the field alone.
        let by_field = spec.kind == "conductivity_temperature";
        assert_eq!(says, homogeneous && constant && !by_field, "{}", spec.kind);
    }
}

#[test]
fn effects_compose_as_the_sum_of_what_each_adds_where_they_do_not_meet() {
    let film = || declared("surface_film", &[20.0], &[]);
    let spool = || declared("spool_mass", &[4000.0, 300.0, 5.0], &[]);
    let mismatch = || declared("strain_mismatch", &[0.004], &[]);
    let bias = || declared("bias_temperature_rate", &[10.0], &[]);
    let heated = || declared("self_heating", &[50.0, 300.0], &[]);
    let flange = || declared("axial_gradient", &[30.0], &[1]);
    let of = |effects: Vec<DeclaredEffect>| {
        let model = model(effects);
        omega(&model, &qua(), &field(&model, &ramp(293.15, RAMP_K_PER_S, 900.0)).at(&[Instant::after(120.0)]))
    };
    let base = of(vec![film(), spool()]);
    let sum = of(vec![film(), spool(), mismatch()]) + of(vec![film(), spool(), bias()]) - base;
    compare("mismatch and bias on film and spool", of(vec![bias(), spool(), mismatch(), film()]), sum, 1e-9);
    // Heat adds its own field to that of the drive.
    let still = {
        let model = model(vec![film(), spool(), heated()]);
        let still = Drive::boundary(PiecewiseLinear::constant(293.15));
        omega(&model, &qua(), &field(&model, &still).at(&[Instant::after(120.0)]))
    };
    compare("heat on film and spool", of(vec![film(), heated(), spool()]), base + still, 1e-9);
    // Everything at once, in any order, is one model.
    let all = || vec![film(), spool(), mismatch(), bias(), heated(), flange()];
    let reversed: Vec<DeclaredEffect> = all().into_iter().rev().collect();
    compare("all in either order", of(reversed), of(all()), 1e-12);
}
