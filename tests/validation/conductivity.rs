//! Reference: a pack of 28 layers whose conductivity depends on temperature, by LSODA (scipy) on finite volumes with 8 and 16 cells
//! a layer, extrapolated (`tests/data/conductivity/lsoda.py` wrote the values). Tolerances: what the reference's own
//! extrapolation leaves, from the printed differences.

use coilwright::numeric::piecewise::PiecewiseLinear;
use coilwright::thermal::{Drive, Extent, HeatPath, Instant, Location, PackMaterial, PackShape, solve};

const REFERENCE: &str = include_str!("../data/conductivity/lsoda.csv");

#[test]
fn a_conductivity_that_depends_on_temperature_gives_the_layers_of_an_independent_solver() {
    let shape = PackShape { layers: 28, bore_radius_m: 0.04, radial_pitch_m: 165e-6, height_m: 8e-3 };
    let material = PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
    let air = PiecewiseLinear::new(vec![0.0, 1800.0], vec![293.15, 323.15]).unwrap();
    for (name, location, film_w_per_m2_k) in
        [("ambient", Location::Ambient, Some(20.0)), ("outer_layer", Location::OuterLayer, None)]
    {
        let path = HeatPath {
            film_w_per_m2_k,
            conductivity_slope_per_k: 0.004,
            ..HeatPath::new(shape, Extent::Pack, material, location)
        };
        let field = solve(&path, &Drive::boundary(air.clone())).unwrap();
        let linear = HeatPath { conductivity_slope_per_k: 0.0, ..path.clone() };
        let linear = solve(&linear, &Drive::boundary(air.clone())).unwrap();
        let (mut temperature, mut rate, mut bent, mut rows) = (0.0_f64, 0.0_f64, 0.0_f64, 0);
        for line in REFERENCE.lines().filter(|line| line.starts_with(name)) {
            let cells: Vec<&str> = line.split(',').collect();
            let at = [Instant::after(cells[1].parse().unwrap())];
            let (found, straight) = (field.at(&at), linear.at(&at));
            for (layer, cell) in cells[3..].iter().enumerate().filter(|(_, cell)| !cell.is_empty()) {
                let expected: f64 = cell.parse().unwrap();
                if cells[2] == "temperature_k" {
                    temperature = temperature.max((found.temperatures_k(0)[layer] - expected).abs());
                    bent = bent.max((straight.temperatures_k(0)[layer] - expected).abs());
                } else {
                    rate = rate.max((found.rates_k_per_s(0)[layer] - expected).abs() * 60.0);
                }
            }
            rows += 1;
        }
        println!(
            "{name}: temperatures within {temperature:.1e} K (the slope makes {bent:.1e} K), rates within {rate:.1e} of the drive's"
        );
        assert_eq!(rows, 16);
        assert!(temperature < 1e-5 && rate < 2e-5 && bent > 0.01, "{name}: {temperature} {rate} {bent}");
    }
}
