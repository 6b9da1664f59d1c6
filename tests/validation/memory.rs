//! Formulas that remember, against LSODA (scipy; `tests/data/memory/lsoda.py` wrote the values) and against closed forms, to 1e-8.

use coilwright::coil::Coil;
use coilwright::effect::DeclaredEffect;
use coilwright::effect::custom::Formula;
use coilwright::io::read::model_file::parse_model;
use coilwright::numeric::expression::{Expression, Memory};
use coilwright::profile::{Piece, Profile};
use coilwright::rate::{CoilModel, RateModel};
use coilwright::search::cost::worst_case::SolvedProfiles;
use coilwright::thermal::ThermalHistory;
use coilwright::units::{deg_per_h_from_rad_per_s, kelvin_from_celsius};

const TOLERANCE: f64 = 1e-8;

#[test]
fn lags_are_those_of_lsoda_whatever_the_rows() {
    let text = include_str!("../data/memory/lsoda.csv");
    let rows: Vec<Vec<f64>> =
        text.lines().skip(2).map(|line| line.split(',').map(|v| v.parse().expect("a number")).collect()).collect();
    assert!(rows.len() > 150);
    for (formula, column) in [("lag(x, 25)", 2), ("lag(x, 900)", 3), ("lag(abs(x), 300)", 4)] {
        let expression = Expression::parse(formula).expect("a formula");
        let mut memory = Memory::default();
        let mut worst: f64 = 0.0;
        for row in &rows {
            let found = expression.evaluate_after(&[row[1]], row[0], &mut memory);
            worst = worst.max((found - row[column]).abs());
        }
        println!("{formula}: {worst:.1e}");
        assert!(worst < TOLERANCE, "{formula}: {worst:e}");
    }
}

fn model() -> CoilModel {
    let text = "name = 'x'\n[fibre]\nrefractive_index = 1.45\nthermo_optic_per_k = 1e-5\nwavelength_nm = 1550\n\
        outer_diameter_um = 165\n[winding]\nlayers = 8\nturns_per_layer = 40\ninner_diameter_mm = 60\nlayer_length = 'actual'\n\
        pattern = 'qua'\n[thermal]\nmodel = 'pack'\nconductivity_w_per_m_k = 0.35\nvolumetric_heat_capacity_j_per_m3_k = 1.7e6\n";
    parse_model(std::path::Path::new("x.toml"), text).expect("a model").model
}

fn with_formula(source: &str, values: &[(&str, f64)]) -> CoilModel {
    let formula = Formula::new(source, values.iter().map(|v| v.0.to_owned()).collect()).expect("a formula");
    let effect = DeclaredEffect::custom(formula, values.iter().map(|v| v.1).collect()).expect("values");
    model().with_effect(effect)
}

/// All layers alike, at these temperatures [°C].
fn history(coil: &Coil, times_s: &[f64], temperature_c: impl Fn(f64) -> f64) -> ThermalHistory {
    let layers = coil.layers();
    let temperatures: Vec<f64> = times_s.iter().map(|t| kelvin_from_celsius(temperature_c(*t))).collect();
    ThermalHistory {
        layers,
        times_s: times_s.to_vec(),
        temperature_k: temperatures.iter().flat_map(|t| vec![*t; layers]).collect(),
        rate_k_per_s: vec![0.0; layers * times_s.len()],
        axial_moment_k_per_s: Vec::new(),
        axial_moment_k: Vec::new(),
        ambient_k: temperatures.clone(),
        ambient_rate_k_per_s: vec![0.0; times_s.len()],
    }
}

#[test]
fn an_effect_that_relaxes_follows_its_closed_form_on_a_ramp() {
    let model =
        with_formula("a*(T_mean - lag(T_mean, tau_s)) + b*T_layer_3", &[("a", 0.012), ("tau_s", 900.0), ("b", 0.5)]);
    let pattern = coilwright::pattern::classic::Classic::Qua.pattern(8).expect("eight layers");
    let rate = RateModel::new(&model, &pattern, &[]).expect("a rate model");
    let times_s = [0.0, 1.0, 60.0, 61.0, 900.0, 5000.0];
    let series = rate.series_rad_per_s(&history(&model.coil, &times_s, |t| 20.0 + 0.01 * t));
    for (t, found) in times_s.iter().zip(series) {
        let exact = 0.012 * 0.01 * 900.0 * (1.0 - (-t / 900.0_f64).exp()) + 0.5 * (20.0 + 0.01 * t);
        assert!((deg_per_h_from_rad_per_s(found) - exact).abs() < TOLERANCE, "{t}");
    }
}

#[test]
fn under_a_profile_the_worst_of_a_relaxation_is_where_its_closed_form_has_it() {
    // Long against the pack's own time and so slow that the coil itself shows nothing beside the formula.
    let model = with_formula("a*(T - lag(T, tau_s))", &[("a", 5.0), ("tau_s", 2000.0)]);
    let (rate, ramp_s) = (1e-3, 6000.0);
    let pieces =
        vec![Piece { rate_k_per_s: rate, duration_s: ramp_s }, Piece { rate_k_per_s: 0.0, duration_s: 8000.0 }];
    let profile = Profile::new("ramp", pieces).expect("a profile");
    let solved = SolvedProfiles::new(&model, std::slice::from_ref(&profile)).expect("a field");
    let pattern = coilwright::pattern::classic::Classic::Qua.pattern(8).expect("eight layers");
    let worst = solved.worst_case(&model, &pattern).expect("a worst case");
    let exact = 5.0 * rate * 2000.0 * (1.0 - (-ramp_s / 2000.0_f64).exp());
    let found = deg_per_h_from_rad_per_s(worst.rate_rad_per_s);
    println!("{found} {exact}");
    // The coil's own error, which the formula comes on top of, is what the formula without its amplitude leaves.
    let still = with_formula("a*(T - lag(T, tau_s))", &[("a", 0.0), ("tau_s", 2000.0)]);
    let own =
        SolvedProfiles::new(&still, &[profile]).expect("a field").worst_case(&still, &pattern).expect("a worst case");
    let own = deg_per_h_from_rad_per_s(own.rate_rad_per_s.abs());
    assert!(own < 0.05 * exact && (found - exact).abs() <= own + 1e-3 * exact, "{found} {exact} {own}");
    assert!((worst.time_s - ramp_s).abs() < 10.0);
}

#[test]
fn the_gain_of_one_layer_is_its_share_and_a_gap_is_a_resistance_in_series() {
    let file = |effect: &str| {
        let text = format!(
            "name = 'x'\n[fibre]\nrefractive_index = 1.45\nthermo_optic_per_k = 1e-5\nwavelength_nm = 1550\n\
             outer_diameter_um = 165\n[winding]\nlayers = 8\nturns_per_layer = 40\ninner_diameter_mm = 60\n\
             layer_length = 'actual'\npattern = 'zyl'\n[thermal]\nmodel = 'pack'\nconductivity_w_per_m_k = 0.35\n\
             volumetric_heat_capacity_j_per_m3_k = 1.7e6\n{effect}"
        );
        parse_model(std::path::Path::new("x.toml"), &text)
    };
    let pattern = coilwright::pattern::classic::Classic::Zyl.pattern(8).expect("eight layers");
    let gains = |effect: &str| {
        let model = file(effect).expect("a model").model;
        coilwright::predict::layer_gains_rad_per_k(&model, &pattern).expect("gains")
    };
    let rates = |model: &CoilModel| {
        let rate = RateModel::new(model, &pattern, &[]).expect("a rate model");
        (0..8)
            .map(|layer| {
                let mut one = history(&model.coil, &[0.0], |_| 20.0);
                one.rate_k_per_s[layer] = 1.0;
                rate.series_rad_per_s(&one)[0]
            })
            .collect::<Vec<f64>>()
    };
    let plain = gains("");
    let changed = rates(&file("[[effect]]\nkind = 'layer_gain'\nlayer = 6\nchange = 0.08\n").expect("a model").model);
    for (layer, (a, b)) in plain.iter().zip(&changed).enumerate() {
        let factor = if layer == 5 { 1.08 } else { 1.0 };
        assert!((b / a / factor - 1.0).abs() < 1e-12, "layer {layer}");
    }
    // Steady ramp: the gap's drop is the heat that the layers below it take up over h per area.
    let model =
        file("[[effect]]\nkind = 'layer_gap'\nabove_layer = 5\nconductance_w_per_m2_k = 200\n").expect("a model").model;
    let shape_of = |model: &CoilModel| {
        let path = model.heat_path().expect("a path");
        let ramp =
            coilwright::numeric::piecewise::PiecewiseLinear::new(vec![0.0, 2e5], vec![300.0, 300.0 + 0.001 * 2e5]);
        let field = coilwright::thermal::solve(&path, &coilwright::thermal::Drive::boundary(ramp.expect("a ramp")));
        field.expect("a field").at(&[coilwright::thermal::Instant::after(1.9e5)]).temperature_k
    };
    let (with, without) = (shape_of(&model), shape_of(&file("").expect("a model").model));
    let (bore_m, pitch_m) = (model.coil.bore_radius_m(), model.coil.radial_pitch_m());
    let gap_m = bore_m + 5.0 * pitch_m;
    let exact_k = 1.7e6 * 0.001 * 0.5 * (gap_m * gap_m - bore_m * bore_m) / (200.0 * gap_m);
    for layer in 0..8 {
        let lower = without[layer] - with[layer];
        let expected = if layer < 5 { exact_k } else { 0.0 };
        assert!((lower - expected).abs() < 1e-9 + 1e-5 * exact_k, "layer {layer}: {lower} {expected}");
    }
    for (effect, key) in [
        ("kind = 'layer_gain'\nlayer = 9\nchange = 0.1\n", "effect.layer"),
        ("kind = 'layer_gain'\nlayer = 2.5\nchange = 0.1\n", "effect.layer"),
        ("kind = 'layer_gap'\nabove_layer = 8\nconductance_w_per_m2_k = 9\n", "effect.above_layer"),
        ("kind = 'custom'\nformula = 'T_layer_9'\n", "T_layer_9"),
    ] {
        let fault = file(&format!("[[effect]]\n{effect}")).expect_err("a fault").to_string();
        assert!(fault.contains(key), "{fault}");
    }
}
