//! Reference: closed solutions of the heat equation — the slab series (Carslaw and Jaeger, Conduction of Heat in Solids,
//! 1959, section 3.3) and the Bessel series of a hollow cylinder (section 7.10 and 9.11) with an adiabatic bore — and the
//! balance of energy. Tolerances: what the grid leaves of the continuum, from the printed achieved errors; a finer grid must
//! come closer.

use std::f64::consts::PI;

use coilwright::numeric::piecewise::PiecewiseLinear;
use coilwright::thermal::{
    Drive, Extent, HeatPath, Instant, Location, PackMaterial, PackShape, Spool, StepResponse, solve,
};
use libm::{j0, j1, y0, y1};

pub const DIFFUSIVITY_M2_PER_S: f64 = 2.7e-7;

pub fn path(shape: PackShape, location: Location, cells_per_layer: usize) -> HeatPath {
    let material =
        PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 0.35 / DIFFUSIVITY_M2_PER_S };
    HeatPath { cells_per_layer, ..HeatPath::new(shape, Extent::Pack, material, location) }
}

fn shape(layers: usize, bore_radius_m: f64, radial_pitch_m: f64) -> PackShape {
    PackShape { layers, bore_radius_m, radial_pitch_m, height_m: 0.0085 }
}

fn step_rates(path: &HeatPath, time_s: f64) -> Vec<f64> {
    let mut layers = vec![0.0; path.shape.layers];
    StepResponse::of(path).unwrap().rates(time_s, &mut layers);
    layers
}

/// Ṫ/k0 at `height_m` above the adiabatic face of a slab whose other face ramps.
fn slab_rate(height_m: f64, thickness_m: f64, time_s: f64) -> f64 {
    1.0 - (0..2000)
        .map(|n| {
            let odd = (2 * n + 1) as f64;
            let wave = odd * PI / (2.0 * thickness_m);
            let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
            4.0 / PI * sign / odd * (-DIFFUSIVITY_M2_PER_S * wave * wave * time_s).exp() * (wave * height_m).cos()
        })
        .sum::<f64>()
}

#[test]
fn a_thin_pack_has_the_rates_of_the_slab_series() {
    // The drive sits in the middle of the outermost layer: 3 mm above the bore.
    let pitch_m = 3e-3 / 19.5;
    let path = path(shape(20, 1e4, pitch_m), Location::OuterLayer, 8);
    let mut worst = 0.0_f64;
    for time_s in [3.0, 10.0, 30.0, 60.0, 120.0, 600.0] {
        let rates = step_rates(&path, time_s);
        for (j, rate) in rates.iter().enumerate().take(19) {
            worst = worst.max((rate - slab_rate((j as f64 + 0.5) * pitch_m, 3e-3, time_s)).abs());
        }
    }
    println!("largest difference to the slab series {worst:.2e} (layer mean against layer middle)");
    assert!(worst < 4e-4);
}

#[test]
fn the_inner_face_of_a_3_mm_slab_follows_as_stated_and_the_half_space_lags_behind_it() {
    let layers = 60;
    let path = path(shape(layers, 1e4, 3e-3 / (layers as f64 - 0.5)), Location::OuterLayer, 4);
    for (time_s, expected, half_space) in
        [(10.0, 0.393, 0.197), (60.0, 0.985, 0.598), (120.0, 0.9998, 0.709), (600.0, 1.0000, 0.868)]
    {
        let found = step_rates(&path, time_s)[0];
        let behind = libm::erfc(3e-3 / (4.0 * DIFFUSIVITY_M2_PER_S * time_s).sqrt());
        println!("{time_s:5} s: pack {found:.5}, reference {expected}; half space {behind:.4}, reference {half_space}");
        let digits = if expected > 0.99 { 6e-5 } else { 6e-4 };
        assert!((found - expected).abs() < digits, "{time_s} s: {found}");
        assert!((behind - half_space).abs() < 6e-4, "{time_s} s: {behind}");
    }
}

/// A hollow cylinder a < r < b with an adiabatic bore; `biot_per_m` = h/k at r = b, or an imposed temperature there.
pub struct Cylinder {
    bore_m: f64,
    outer_m: f64,
    roots_per_m: Vec<f64>,
}

impl Cylinder {
    fn u0(&self, beta: f64, r: f64) -> f64 {
        j0(beta * r) * y1(beta * self.bore_m) - y0(beta * r) * j1(beta * self.bore_m)
    }

    fn u1(&self, beta: f64, r: f64) -> f64 {
        j1(beta * r) * y1(beta * self.bore_m) - y1(beta * r) * j1(beta * self.bore_m)
    }

    pub fn new(bore_m: f64, outer_m: f64, biot_per_m: Option<f64>) -> Self {
        let mut cylinder = Self { bore_m, outer_m, roots_per_m: Vec::new() };
        let condition = |c: &Self, beta: f64| match biot_per_m {
            None => c.u0(beta, outer_m),
            Some(biot) => beta * c.u1(beta, outer_m) - biot * c.u0(beta, outer_m),
        };
        let spacing = PI / (outer_m - bore_m) / 64.0;
        let mut low = spacing * 1e-2;
        while cylinder.roots_per_m.len() < 150 {
            let high = low + spacing;
            if condition(&cylinder, low) * condition(&cylinder, high) < 0.0 {
                let (mut a, mut b) = (low, high);
                for _ in 0..80 {
                    let middle = 0.5 * (a + b);
                    if condition(&cylinder, a) * condition(&cylinder, middle) <= 0.0 { b = middle } else { a = middle }
                }
                cylinder.roots_per_m.push(0.5 * (a + b));
            }
            low = high;
        }
        cylinder
    }

    /// Mean of Ṫ/k0 over the ring r1 … r2 after a step of the outer rate.
    pub fn ring_rate(&self, r1: f64, r2: f64, time_s: f64) -> f64 {
        let (a, b) = (self.bore_m, self.outer_m);
        1.0 - self
            .roots_per_m
            .iter()
            .map(|&beta| {
                let norm = 0.5
                    * (b * b * (self.u0(beta, b).powi(2) + self.u1(beta, b).powi(2)) - (a * self.u0(beta, a)).powi(2));
                let content = b * self.u1(beta, b) / beta / norm;
                let mean = 2.0 * (r2 * self.u1(beta, r2) - r1 * self.u1(beta, r1)) / beta / (r2 * r2 - r1 * r1);
                content * mean * (-DIFFUSIVITY_M2_PER_S * beta * beta * time_s).exp()
            })
            .sum::<f64>()
    }
}

/// The largest difference of any layer's rate to the Bessel series over some times.
fn cylinder_error(location: Location, film_w_per_m2_k: Option<f64>, cells: usize) -> f64 {
    let shape = shape(12, 0.004, 250e-6);
    let mut path = path(shape, location, cells);
    path.film_w_per_m2_k = film_w_per_m2_k;
    let layers = shape.layers as f64;
    let outer_m = shape.bore_radius_m
        + shape.radial_pitch_m * if location == Location::OuterLayer { layers - 0.5 } else { layers };
    let cylinder = Cylinder::new(shape.bore_radius_m, outer_m, film_w_per_m2_k.map(|h| h / 0.35));
    let edge_m = |j: usize| shape.bore_radius_m + j as f64 * shape.radial_pitch_m;
    let solved = shape.layers - usize::from(location == Location::OuterLayer);
    let mut worst = 0.0_f64;
    for time_s in [2.0, 5.0, 10.0, 20.0, 40.0, 80.0] {
        let rates = step_rates(&path, time_s);
        for (j, rate) in rates.iter().enumerate().take(solved) {
            worst = worst.max((rate - cylinder.ring_rate(edge_m(j), edge_m(j + 1), time_s)).abs());
        }
    }
    worst
}

#[test]
fn a_thick_pack_has_the_rates_of_the_bessel_series_and_a_finer_grid_comes_closer() {
    for (name, location, film) in
        [("imposed outer layer", Location::OuterLayer, None), ("ambient through a film", Location::Ambient, Some(40.0))]
    {
        let errors: Vec<f64> = [1, 2].iter().map(|&cells| cylinder_error(location, film, cells)).collect();
        println!("{name}: errors with 1 and 2 cells a layer {errors:?}");
        assert!(errors[0] < 1e-8 && errors[1] < 0.3 * errors[0] + 1e-9, "{name}: {errors:?}");
    }
}

#[test]
fn the_default_grid_puts_the_layer_rates_of_a_tactical_pack_within_a_hundred_thousandth_of_the_continuum() {
    let shape = shape(24, 0.04, 165e-6);
    let coarse =
        HeatPath::new(shape, Extent::Pack, PackMaterial::Diffusivity { m2_per_s: 2.06e-7 }, Location::OuterLayer);
    let fine = HeatPath { cells_per_layer: 16, ..coarse.clone() };
    let mut worst = 0.0_f64;
    for time_s in [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 60.0, 100.0] {
        for (a, b) in step_rates(&coarse, time_s).iter().zip(step_rates(&fine, time_s)) {
            worst = worst.max((a - b).abs());
        }
    }
    println!("default grid against 16 cells a layer, from 10 ms on: {worst:.2e} of the step");
    assert!(worst < 1e-5);
}

/// Heat in pack and spool per radian and height, in excess of 300 K.
fn stored_j_per_m(path: &HeatPath, temperatures_k: &[f64]) -> f64 {
    let PackMaterial::Conductivity { heat_capacity_j_per_m3_k, .. } = path.material else { unreachable!() };
    temperatures_k
        .iter()
        .enumerate()
        .map(|(j, t)| {
            let inner = path.shape.bore_radius_m + j as f64 * path.shape.radial_pitch_m;
            let outer = inner + path.shape.radial_pitch_m;
            heat_capacity_j_per_m3_k * 0.5 * (outer * outer - inner * inner) * (t - 300.0)
        })
        .sum()
}

#[test]
fn what_flows_through_the_film_is_stored_in_the_pack() {
    let mut path = path(shape(24, 0.04, 165e-6), Location::Ambient, 2);
    path.film_w_per_m2_k = Some(20.0);
    let air = PiecewiseLinear::new(vec![0.0, 600.0, 900.0], vec![300.0, 310.0, 305.0]).unwrap();
    let field = solve(&path, &Drive::boundary(air.clone())).unwrap();
    let steps = 6000;
    let end_s = 1500.0;
    let instants: Vec<Instant> = (0..=steps).map(|i| Instant::after(end_s * i as f64 / steps as f64)).collect();
    let history = field.at(&instants);
    let outer_m = 0.04 + 24.0 * 165e-6;
    let inflow = |row: usize| -> f64 {
        let rates = history.rates_k_per_s(row);
        let offset: Vec<f64> = rates.iter().map(|r| r + 300.0).collect();
        stored_j_per_m(&path, &offset)
    };
    let integral: f64 = (0..steps).map(|i| 0.5 * (inflow(i) + inflow(i + 1)) * end_s / steps as f64).sum();
    let stored = stored_j_per_m(&path, history.temperatures_k(steps));
    println!("stored {stored:.6} J/m per radian, integral of the rates {integral:.6}");
    assert!((stored - integral).abs() < 1e-5 * stored.abs());
    // In a steady ramp all heat passes the film: the air leads the surface by (heat a second)/(h r_out).
    let ramp = PiecewiseLinear::new(vec![0.0, 1e5], vec![300.0, 400.0]).unwrap();
    let state = solve(&path, &Drive::boundary(ramp.clone())).unwrap().at(&[Instant::before(9e4)]);
    let rate_k_per_s = 1e-3;
    assert!(state.rates_k_per_s(0).iter().all(|r| (r - rate_k_per_s).abs() < 1e-11));
    let flow = stored_j_per_m(&path, &[300.0 + rate_k_per_s; 24]);
    let surface_k = ramp.value(9e4) - flow / (20.0 * outer_m);
    // From the surface inwards the steady ramp's profile is quadratic: the outermost layer's mean lies below it by
    // the flux times half the pitch over k, to first order.
    let expected_k = surface_k - flow / outer_m * 0.5 * 165e-6 / 0.35;
    let outermost_k = state.temperatures_k(0)[23];
    println!("outermost layer {outermost_k:.6} K, by balance {expected_k:.6} K");
    assert!((outermost_k - expected_k).abs() < 1e-2 * (ramp.value(9e4) - outermost_k));
}

#[test]
fn a_spool_behind_a_well_conducting_pack_follows_with_its_heat_capacity_over_its_conductances() {
    // With a pack of no resistance and an imposed outer layer the spool is one capacity behind one contact.
    let mut path = path(shape(4, 0.04, 165e-6), Location::OuterLayer, 2);
    path.material = PackMaterial::Conductivity { w_per_m_k: 1e4, heat_capacity_j_per_m3_k: 1.7e6 };
    path.spool = Some(Spool { heat_capacity_j_per_m2_k: 5000.0, contact_w_per_m2_k: 100.0, mount_w_per_m2_k: 0.0 });
    let response = StepResponse::of(&path).unwrap();
    // The slowest mode decays with h/C.
    let slowest_s = response.settling_s() / 50.0;
    println!("slowest time constant {slowest_s:.4} s, C/h = 50 s");
    assert!((slowest_s - 50.0).abs() < 0.05);
    path.spool = Some(Spool { heat_capacity_j_per_m2_k: 5000.0, contact_w_per_m2_k: 100.0, mount_w_per_m2_k: 150.0 });
    let slowest_s = StepResponse::of(&path).unwrap().settling_s() / 50.0;
    println!("with a mount {slowest_s:.4} s, C/(h + h_m) = 20 s");
    assert!((slowest_s - 20.0).abs() < 0.02);
}
