//! Readings of a chamber of which everything is known lead back to its air.

use super::air::Scene;
use super::{Air, Boundary, Kink, Observation};
use crate::numeric::piecewise::PiecewiseLinear;
use crate::thermal::exposure::expose;
use crate::thermal::{self, Drive, Extent, Flange, FlangeFilm, HeatPath, Location, Material, PackShape};

/// The boundary of readings where only what they say is not known: no search.
fn in_known_chamber(observation: &Observation, air: &Air) -> Boundary {
    let boundary = Boundary::new(Scene::new(observation).unwrap(), air.clone()).unwrap();
    boundary.unbent(observation, |_, air| Ok(air)).unwrap()
}

const FILM_W_PER_M2_K: f64 = 25.0;
const RATE_K_PER_S: f64 = 1.0 / 60.0;

#[test]
fn what_a_sensor_shows_of_known_air_leads_back_to_that_air() {
    let shape = PackShape { layers: 12, bore_radius_m: 0.04, radial_pitch_m: 165e-6, height_m: 8.5e-3 };
    let material = Material::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
    let plain = HeatPath::new(shape, Extent::Pack, material, Location::OuterLayer);
    let air_k = PiecewiseLinear::new(vec![0.0, 600.0, 2400.0, 4000.0], vec![293.0, 293.0, 323.0, 323.0]).unwrap();
    let times_s: Vec<f64> = (0..=400).map(|i| 10.0 * f64::from(i)).collect();
    let kink = |time_s: f64, slope_change_k_per_s: f64| Kink { time_s, slope_change_k_per_s };
    let flange = Some(FlangeFilm { flange: Flange::First, film_w_per_m2_k: 40.0 });
    let paths = [
        ("plain", plain.clone(), 0.0),
        ("lagging", plain.clone(), 40.0),
        ("bent", HeatPath { conductivity_slope_per_k: 0.003, ..plain.clone() }, 0.0),
        ("half space", HeatPath { extent: Extent::HalfSpace, ..plain.clone() }, 0.0),
        ("flange", HeatPath { flange, ..plain.clone() }, 0.0),
        ("in the air", HeatPath { location: Location::Ambient, film_w_per_m2_k: Some(25.0), ..plain }, 20.0),
    ];
    for (name, path, lag_s) in paths {
        let film_w_per_m2_k = (path.location == Location::OuterLayer).then_some(FILM_W_PER_M2_K);
        let exposed = expose(&path, film_w_per_m2_k, lag_s, &air_k, &times_s).unwrap();
        assert!(exposed.shown_k[240] < air_k.value(2400.0) - 0.1 * lag_s * RATE_K_PER_S);
        let air = Air {
            film_w_per_m2_k,
            jerk_noise_k2_per_s7: 1e-22,
            kinks: vec![kink(600.0, RATE_K_PER_S), kink(2400.0, -RATE_K_PER_S)],
            noise_k: 0.004,
        };
        let observation = Observation {
            times_s: &times_s,
            temperature_k: &exposed.shown_k,
            path: &path,
            lag_s,
            layer_gain_rad_per_k: &[1e-6; 12],
            rate_mean_s: 10.0,
        };
        let found = in_known_chamber(&observation, &air);
        if lag_s == 0.0 && path.location == Location::OuterLayer {
            let error_k = times_s.iter().zip(&exposed.shown_k).map(|(&t, shown)| found.outer_k().value(t) - shown);
            let error_k = error_k.fold(0.0, |most: f64, e| most.max(e.abs()));
            assert!(error_k < 5e-5, "{name}");
        }
        if path.conductivity_slope_per_k != 0.0 {
            continue;
        }
        let (driven, drive) = found.driving(&path, 0.0);
        let rates =
            |path: &HeatPath, drive: &Drive| thermal::solve(path, drive).unwrap().means(&times_s, 10.0).rate_k_per_s;
        let (again, truth) = (rates(&driven, &drive), rates(&exposed.path, &exposed.drive));
        let error = again.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / RATE_K_PER_S;
        assert!(error < 3e-4, "{name}");
    }
}
