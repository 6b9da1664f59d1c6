//! Reference: the paper's model worked through independently (not the paper's Table 2, whose ZYL and SYM exceed the
//! hard bound). Coil: N = 12, L = 200 m, D = 75 mm, n = 1.447, dn/dT = 1.35e-5, 10 °C/h for 1500 s, half space.
//! Tolerance: all printed digits, 5e-5 °/h.

use coilwright::coil::{Coil, CoilSpec, Fibre, LayerLength};
use coilwright::pattern::classic::Classic;
use coilwright::profile::{Piece, Profile};
use coilwright::rate::CoilModel;
use coilwright::search::worst_case::SolvedProfiles;
use coilwright::thermal::{Extent, Location, Material};
use coilwright::units::{deg_per_h_from_rad_per_s, k_per_s_from_c_per_h};

pub fn paper_model(length_m: f64, diffusivity_m2_per_s: f64) -> CoilModel {
    let fibre = Fibre {
        refractive_index: 1.447,
        thermo_optic_per_k: 1.35e-5,
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
        material: Material::Diffusivity { m2_per_s: diffusivity_m2_per_s },
        location: Location::OuterLayer,
        rate_mean_s: 0.0,
        effects: vec![],
    }
}

pub fn paper_ramp() -> Profile {
    let rate_k_per_s = k_per_s_from_c_per_h(10.0);
    let pieces = vec![Piece { rate_k_per_s, duration_s: 1500.0 }, Piece { rate_k_per_s: 0.0, duration_s: 4500.0 }];
    Profile::new("paper", pieces).unwrap()
}

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
