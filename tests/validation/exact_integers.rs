//! Reference: sums in closed form. With equal layers of unit length and layer rates Ṫ_j = j^p, the phase integral is
//! the integer I = Σ_j (2P(j) − 1 − N) j^p, whose size is known for each winding (design notes of the paper's model;
//! every formula is a sum of powers and can be redone by hand).
//! Tolerance: none in integers; 1e-11 of the hard bound for the rate model's floating-point sum of the same terms.

use coilwright::coil::{Coil, CoilSpec, Fibre, LayerLength};
use coilwright::effect::PackState;
use coilwright::pattern::Pattern;
use coilwright::pattern::classic::Classic;
use coilwright::rate::{CoilModel, RateModel};
use coilwright::thermal::{DEFAULT_CELLS_PER_LAYER, Extent, Location, PackMaterial};

const LAYER_COUNTS: [usize; 3] = [16, 32, 48];

/// Winding, power p, and |I| as a function of N.
type Statement = (Classic, u32, fn(i128) -> i128);

const STATEMENTS: [Statement; 9] = [
    (Classic::Zyl, 1, |n| n * (n * n - 1) / 6),
    (Classic::SymText, 1, |n| n * n * n / 8),
    (Classic::Dip, 1, |n| n * n / 4),
    (Classic::Qua, 1, |n| n / 2),
    (Classic::Oct, 1, |_| 0),
    (Classic::Oct, 2, |n| 4 * n),
    (Classic::Hex, 1, |_| 0),
    (Classic::Hex, 2, |_| 0),
    (Classic::Hex, 3, |n| 72 * n),
];

fn integral(pattern: &Pattern, power: u32) -> i128 {
    let layers = pattern.layers() as i128;
    (1..=layers)
        .zip(pattern.segments())
        .map(|(layer, &segment)| (2 * segment as i128 - 1 - layers) * layer.pow(power))
        .sum()
}

#[test]
fn the_windings_integrals_are_the_exact_integers() {
    for layers in LAYER_COUNTS {
        for (classic, power, expected) in STATEMENTS {
            let found = integral(&classic.pattern(layers).unwrap(), power).abs();
            assert_eq!(found, expected(layers as i128), "{classic:?}, N = {layers}, p = {power}");
        }
    }
}

#[test]
fn the_rate_model_gives_the_same_integers() {
    let mut worst: f64 = 0.0;
    for layers in LAYER_COUNTS {
        let model = unit_model(layers);
        for (classic, power, expected) in STATEMENTS {
            let pattern = classic.pattern(layers).unwrap();
            let rate_model = RateModel::new(&model, &pattern, &[]).unwrap();
            let rates: Vec<f64> = (1..=layers).map(|j| (j as f64).powi(power as i32)).collect();
            let temperatures = vec![293.15; layers];
            let state = state_of(&temperatures, &rates);
            // Ω = n κ/(L D) l0² I with n = κ = 1 and l0 = 1 m.
            let found = rate_model.rate_error_rad_per_s(&state) * layers as f64 * model.coil.mean_diameter_m();
            let scale = rates[layers - 1] * (layers * layers) as f64;
            let error = (found.abs() - expected(layers as i128) as f64).abs() / scale;
            worst = worst.max(error);
            assert!(error < 1e-11, "{classic:?}, N = {layers}, p = {power}: {found}");
        }
    }
    println!("largest error {worst:.1e} of the largest term's size times N");
}

fn unit_model(layers: usize) -> CoilModel {
    let pitch_m = 250e-6;
    let fibre = Fibre {
        refractive_index: 1.0,
        thermo_optic_per_k: 1.0,
        group_index: None,
        thermal_expansion_per_k: 0.0,
        wavelength_m: 1300e-9,
        outer_diameter_m: pitch_m,
    };
    let spec = CoilSpec {
        fibre,
        layers,
        turns_per_layer: None,
        bore_radius_m: 0.03,
        radial_pitch_m: pitch_m,
        axial_pitch_m: pitch_m,
        layer_length: LayerLength::Equal,
        length_m: Some(layers as f64),
    };
    CoilModel {
        name: "layers of one metre".into(),
        coil: Coil::new(spec).unwrap(),
        extent: Extent::HalfSpace,
        material: PackMaterial::Diffusivity { m2_per_s: 2.7e-7 },
        location: Location::OuterLayer,
        rate_mean_s: 0.0,
        cells_per_layer: DEFAULT_CELLS_PER_LAYER,
        effects: vec![],
    }
}

fn state_of<'a>(temperatures_k: &'a [f64], rates_k_per_s: &'a [f64]) -> PackState<'a> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    PackState {
        time_s: 0.0,
        temperatures_k,
        rates_k_per_s,
        axial_moments_k_per_s: &[],
        mean_temperature_k: mean(temperatures_k),
        mean_rate_k_per_s: mean(rates_k_per_s),
        ambient_k: 293.15,
        ambient_rate_k_per_s: 0.0,
        channels: &[],
        thermal_rate_rad_per_s: 0.0,
    }
}
