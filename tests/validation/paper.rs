//! Reference: the paper's model worked through independently (not the paper's Table 2, whose ZYL and SYM exceed the
//! hard bound). Coil: N = 12, L = 200 m, D = 75 mm, n = 1.447, dn/dT = 1.35e-5, 10 °C/h for 1500 s, half space.
//! Tolerance: all printed digits, 5e-5 °/h. Scaling laws (K only rescales time; Ω ∝ L; the hard bound) follow from the
//! equations alone and hold to rounding or, where a maximum over time is refined, to its square.

use coilwright::coil::{Coil, CoilSpec, Fibre, LayerLength};
use coilwright::pattern::classic::Classic;
use coilwright::profile::{Piece, Profile};
use coilwright::rate::{CoilModel, RateModel};
use coilwright::search::cost::worst_case::SolvedProfiles;
use coilwright::thermal::{
    DEFAULT_CELLS_PER_LAYER, Drive, Extent, Instant, Location, PackMaterial, StepResponse, ThermalHistory, solve,
};
use coilwright::units::{deg_per_h_from_rad_per_s, k_per_s_from_c_per_h};

pub fn paper_model(length_m: f64, diffusivity_m2_per_s: f64) -> CoilModel {
    let fibre = Fibre {
        refractive_index: 1.447,
        thermo_optic_per_k: 1.35e-5,
        group_index: None,
        thermal_expansion_per_k: 0.0,
        wavelength_m: 1300e-9,
        outer_diameter_m: 250e-6,
    };
    let spec = CoilSpec {
        fibre,
        layers: 12,
        turns_per_layer: None,
        bore_radius_m: 0.0375 - 6.0 * 250e-6,
        radial_pitch_m: 250e-6,
        axial_pitch_m: 250e-6,
        layer_length: LayerLength::Equal,
        length_m: Some(length_m),
    };
    CoilModel {
        name: "paper".into(),
        coil: Coil::new(spec).unwrap(),
        extent: Extent::HalfSpace,
        material: PackMaterial::Diffusivity { m2_per_s: diffusivity_m2_per_s },
        location: Location::OuterLayer,
        rate_mean_s: 0.0,
        cells_per_layer: DEFAULT_CELLS_PER_LAYER,
        effects: vec![],
    }
}

pub fn paper_ramp() -> Profile {
    let rate_k_per_s = k_per_s_from_c_per_h(10.0);
    let pieces = vec![Piece { rate_k_per_s, duration_s: 1500.0 }, Piece { rate_k_per_s: 0.0, duration_s: 4500.0 }];
    Profile::new("paper", pieces).unwrap()
}

const WINDINGS: [Classic; 4] = [Classic::Zyl, Classic::Sym, Classic::Dip, Classic::Qua];

fn worst_deg_per_h(model: &CoilModel, classic: Classic) -> f64 {
    let solved = SolvedProfiles::new(model, &[paper_ramp()]).unwrap();
    let pattern = classic.pattern(12).unwrap();
    deg_per_h_from_rad_per_s(solved.worst_case(model, &pattern).unwrap().rate_rad_per_s.abs())
}

#[test]
fn the_four_windings_have_the_independently_computed_peaks() {
    let model = paper_model(200.0, 2.7e-7);
    for (classic, expected) in
        [(Classic::Zyl, 5.2460), (Classic::Sym, 2.6628), (Classic::Dip, 2.2799), (Classic::Qua, 2.2799)]
    {
        let found = worst_deg_per_h(&model, classic);
        println!("{}: {found:.6} °/h, reference {expected}", classic.key());
        assert!((found - expected).abs() < 5e-5, "{classic:?}: {found}");
    }
}

#[test]
fn the_peaks_do_not_depend_on_the_diffusivity_as_long_as_the_ramp_lasts() {
    for classic in WINDINGS {
        let reference = worst_deg_per_h(&paper_model(200.0, 2.7e-7), classic);
        for diffusivity_m2_per_s in [1e-7, 2.2e-7, 3.4e-7, 1e-6] {
            let found = worst_deg_per_h(&paper_model(200.0, diffusivity_m2_per_s), classic);
            let error = (found / reference - 1.0).abs();
            println!("{} at K = {diffusivity_m2_per_s:e}: {found:.9} °/h, off by {error:.1e}", classic.key());
            assert!(error < 1e-9, "{classic:?}: {found} and {reference}");
        }
    }
}

#[test]
fn the_error_scales_exactly_as_the_fibre_length() {
    for classic in WINDINGS {
        let short = worst_deg_per_h(&paper_model(200.0, 2.7e-7), classic);
        let long = worst_deg_per_h(&paper_model(800.0, 2.7e-7), classic);
        println!("{}: {long:.4} / {short:.4} = {}", classic.key(), long / short);
        assert!((long / short - 4.0).abs() < 1e-12, "{classic:?}");
    }
}

#[test]
fn the_hard_bound_is_that_of_the_closed_form_and_no_winding_exceeds_it() {
    for (length_m, expected) in [(200.0, 7.4616), (800.0, 29.8465)] {
        let model = paper_model(length_m, 2.7e-7);
        let any = RateModel::new(&model, &Classic::Zyl.pattern(12).unwrap(), &[]).unwrap();
        let bound = deg_per_h_from_rad_per_s(any.hard_bound_rad_per_s(k_per_s_from_c_per_h(10.0)));
        println!("hard bound of {length_m} m: {bound:.6} °/h, reference {expected}");
        assert!((bound - expected).abs() < 5e-5);
        for classic in WINDINGS.into_iter().chain([Classic::SymText]) {
            assert!(worst_deg_per_h(&model, classic) <= bound, "{classic:?}");
        }
    }
}

#[test]
fn the_hard_bound_is_attained_when_one_half_warms_and_the_other_does_not() {
    let model = paper_model(200.0, 2.7e-7);
    let zyl = RateModel::new(&model, &Classic::Zyl.pattern(12).unwrap(), &[]).unwrap();
    let rate_k_per_s = k_per_s_from_c_per_h(10.0);
    let rates: Vec<f64> = (0..12).map(|layer| if layer < 6 { 0.0 } else { rate_k_per_s }).collect();
    let history = ThermalHistory {
        layers: 12,
        times_s: vec![0.0],
        temperature_k: vec![293.15; 12],
        rate_k_per_s: rates,
        axial_moment_k_per_s: vec![],
        axial_moment_k: vec![],
        ambient_k: vec![293.15],
        ambient_rate_k_per_s: vec![0.0],
    };
    let found = zyl.series_rad_per_s(&history)[0];
    assert!((found / zyl.hard_bound_rad_per_s(rate_k_per_s) - 1.0).abs() < 1e-12);
}

#[test]
fn the_phase_of_equation_four_and_the_rate_of_the_sagnac_relation_belong_together() {
    let model = paper_model(200.0, 2.7e-7);
    let pattern = Classic::Qua.pattern(12).unwrap();
    let rate_model = RateModel::new(&model, &pattern, &[]).unwrap();
    let field = solve(&model.heat_path().unwrap(), &Drive::boundary(paper_ramp().temperature(293.15))).unwrap();
    let history = field.at(&[Instant::after(30.0)]);
    let rate_rad_per_s = rate_model.series_rad_per_s(&history)[0];
    // Eq. (4) with its lost dots, written out: (2π/λ)(n/c0) dn/dT Σ_j Ṫ_j ∫_segment (2z − L) dz.
    let layer_m = 200.0 / 12.0;
    let integral_m2_k_per_s: f64 = history
        .rates_k_per_s(0)
        .iter()
        .zip(pattern.segments())
        .map(|(rate, &segment)| {
            let (from_m, to_m) = ((segment - 1) as f64 * layer_m, segment as f64 * layer_m);
            rate * ((to_m * to_m - from_m * from_m) - 200.0 * (to_m - from_m))
        })
        .sum();
    let phase_rad = std::f64::consts::TAU / 1300e-9 * 1.447 / 299_792_458.0 * 1.35e-5 * integral_m2_k_per_s;
    let error = (rate_model.phase_rad(rate_rad_per_s) / phase_rad - 1.0).abs();
    println!("phase {phase_rad:.6e} rad, off by {error:.1e}");
    assert!(error < 1e-12);
}

#[test]
fn the_half_space_at_three_millimetres_has_the_independently_computed_rates() {
    let mut model = paper_model(200.0, 2.7e-7);
    model.coil = model.coil.with_radial_pitch(3e-3 / 11.0).unwrap();
    let response = StepResponse::of(&model.heat_path().unwrap()).unwrap();
    let mut layers = vec![0.0; 12];
    for (time_s, expected) in [(10.0, 0.197), (60.0, 0.598), (120.0, 0.709), (600.0, 0.868)] {
        response.rates(time_s, &mut layers);
        println!("{time_s} s: {:.6}, reference {expected}", layers[0]);
        assert!((layers[0] - expected).abs() < 5e-4);
    }
}
