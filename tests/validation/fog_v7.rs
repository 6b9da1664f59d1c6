//! Reference: the public MATLAB simulation MALIKM987/FOG, version 7 (facts only): 18 layers wound cylindrically, lengths
//! rising from layer to layer, each layer following the ambient's ramp with a first-order lag of its own, explicit Euler
//! steps of 0.1 s over 900 s, centred differences. Its six largest |Ω| must be matched to nine digits by the rate
//! model fed with the same layer rates: tolerance 1e-9 relative.

use coilwright::coil::{Coil, CoilSpec, Fibre, LayerLength};
use coilwright::pattern::classic::Classic;
use coilwright::rate::{CoilModel, RateModel};
use coilwright::thermal::{DEFAULT_CELLS_PER_LAYER, Extent, Location, PackMaterial, ThermalHistory};
use coilwright::units::{deg_per_h_from_rad_per_s, k_per_s_from_c_per_min, kelvin_from_celsius};

const LAYERS: usize = 18;
const FIRST_LENGTH_M: f64 = 54.135_491_066_873_1;
const LENGTH_STEP_M: f64 = 0.168_778_923_721_5;
const LAST_LENGTH_M: f64 = 56.742_718_237_038_7;
const MEAN_DIAMETER_M: f64 = 0.159_394_500_392_266;
const STEP_S: f64 = 0.1;
const STEPS: usize = 9000;

fn model() -> CoilModel {
    let fibre = Fibre {
        refractive_index: 1.4445,
        thermo_optic_per_k: 8.4e-6,
        group_index: None,
        thermal_expansion_per_k: 0.55e-6,
        wavelength_m: 1550e-9,
        outer_diameter_m: 165e-6,
    };
    let pitch_m = 1e-4;
    let spec = CoilSpec {
        fibre,
        layers: LAYERS,
        turns_per_layer: None,
        bore_radius_m: 0.5 * MEAN_DIAMETER_M - 0.5 * LAYERS as f64 * pitch_m,
        radial_pitch_m: pitch_m,
        axial_pitch_m: pitch_m,
        layer_length: LayerLength::Equal,
        length_m: Some(1000.0),
    };
    let equal = Coil::new(spec).unwrap();
    // A layer's length scales with its turns: turns that give the stated lengths.
    let lengths_m =
        (0..LAYERS).map(|i| if i == 17 { LAST_LENGTH_M } else { FIRST_LENGTH_M + LENGTH_STEP_M * i as f64 });
    let turns = lengths_m.zip(equal.turns()).map(|(length_m, turns)| turns * length_m / (1000.0 / 18.0)).collect();
    CoilModel {
        name: "FOG v7".into(),
        coil: equal.with_turns(turns).unwrap(),
        extent: Extent::HalfSpace,
        material: PackMaterial::Diffusivity { m2_per_s: 1e-7 },
        location: Location::OuterLayer,
        rate_mean_s: 0.0,
        cells_per_layer: DEFAULT_CELLS_PER_LAYER,
        effects: vec![],
    }
}

/// Layer temperatures above 25 °C at every step, one row a time: near zero rounding is least.
fn layer_excess_k(lag_s: f64, diffusivity_m2_per_s: f64) -> Vec<[f64; LAYERS]> {
    let ramp_k_per_s = k_per_s_from_c_per_min(1.0);
    let ambient_k = |time_s: f64| (ramp_k_per_s * time_s).min(10.0);
    let mut rows = vec![[0.0; LAYERS]];
    for step in 0..STEPS {
        let mut next = rows[step];
        for (i, layer_k) in next.iter_mut().enumerate() {
            let lag_s = lag_s + i as f64 / 17.0 * 0.005_f64.powi(2) / diffusivity_m2_per_s;
            *layer_k += STEP_S * (ambient_k(STEP_S * step as f64) - *layer_k) / lag_s;
        }
        rows.push(next);
    }
    rows
}

fn largest_deg_per_h(lag_s: f64, conductivity: f64, density: f64, heat_capacity: f64) -> f64 {
    let rows = layer_excess_k(lag_s, conductivity / (density * heat_capacity));
    let mut history = ThermalHistory::with_capacity(LAYERS, STEPS + 1);
    for step in 0..=STEPS {
        // Centred differences inside, one-sided at both ends.
        let (before, after) = (step.saturating_sub(1), (step + 1).min(STEPS));
        let apart_s = STEP_S * (after - before) as f64;
        history.times_s.push(STEP_S * step as f64);
        history.temperature_k.extend(rows[step].map(|excess_k| kelvin_from_celsius(25.0) + excess_k));
        history.rate_k_per_s.extend(rows[after].iter().zip(rows[before]).map(|(a, b)| (a - b) / apart_s));
        history.ambient_k.push(rows[step][0]);
        history.ambient_rate_k_per_s.push(0.0);
    }
    let model = model();
    let rate_model = RateModel::new(&model, &Classic::Zyl.pattern(LAYERS).unwrap(), &[]).unwrap();
    let series = rate_model.series_rad_per_s(&history);
    deg_per_h_from_rad_per_s(series.iter().map(|r| r.abs()).fold(0.0, f64::max))
}

#[test]
fn the_six_largest_errors_of_the_matlab_simulation_are_matched_to_nine_digits() {
    let formers =
        [("Al 6061", 167.0, 2700.0, 896.0), ("Invar", 10.5, 8055.0, 515.0), ("fused silica", 1.38, 2203.0, 703.0)];
    let expected = [
        (15.0, [0.443533839407, 9.254158806135, 18.370860388261]),
        (120.0, [0.055867459887, 1.465564180547, 3.883283853626]),
    ];
    let length_m = model().coil.length_m();
    assert!((length_m - 1000.0).abs() < 1e-9, "{length_m}");
    for (lag_s, expected) in expected {
        for ((name, conductivity, density, heat_capacity), reference) in formers.into_iter().zip(expected) {
            let found = largest_deg_per_h(lag_s, conductivity, density, heat_capacity);
            println!("{name}, lag {lag_s} s: {found:.12} °/h, reference {reference:.12}");
            assert!((found / reference - 1.0).abs() < 1e-9, "{name} {lag_s}: {found}");
        }
    }
}
