//! Reference: a finite hollow cylinder whose one flange and outer surface exchange heat with the same air, the bore and the
//! other flange being adiabatic. The excess of temperature after a step is the product of the hollow cylinder's Bessel
//! series and the slab's Fourier series (Carslaw and Jaeger, Conduction of Heat in Solids, 1959, sections 1.15 and 3.11);
//! after a step of the drive's *rate* the rates are one minus that product.
//! Tolerance: what the grid leaves of the continuum, from the printed errors; a finer grid must come closer.

use std::f64::consts::PI;

use coilwright::numeric::piecewise::PiecewiseLinear;
use coilwright::thermal::{Drive, Flange, FlangeFilm, HeatPath, Instant, Location, PackShape, solve};

use crate::pack::{Cylinder, DIFFUSIVITY_M2_PER_S, path};

const CONDUCTIVITY_W_PER_M_K: f64 = 0.35;

/// A slab with an adiabatic face and h/k at the other, cooling from one.
struct Slab {
    height_m: f64,
    /// μ H of each term, from μ H tan μ H = h H/k.
    roots: Vec<f64>,
}

impl Slab {
    fn new(height_m: f64, biot_per_m: f64) -> Self {
        let biot = biot_per_m * height_m;
        let roots = (0..60)
            .map(|n| {
                // One root in each (nπ, nπ + π/2).
                let (mut low, mut high) = (f64::from(n) * PI, f64::from(n) * PI + 0.5 * PI);
                for _ in 0..200 {
                    let middle = 0.5 * (low + high);
                    if middle * middle.sin() * (n_sign(n)) < biot * middle.cos() * n_sign(n) {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                0.5 * (low + high)
            })
            .collect();
        Self { height_m, roots }
    }

    /// ∫ Z dζ and ∫ Z ζ dζ over −½ ≤ ζ ≤ ½, ζ growing away from the face with the film.
    fn mean_and_moment(&self, time_s: f64) -> (f64, f64) {
        self.roots.iter().fold((0.0, 0.0), |(mean, moment), &m| {
            let amplitude = 2.0 * m.sin() / (m + m.sin() * m.cos());
            let left = amplitude * (-DIFFUSIVITY_M2_PER_S * (m / self.height_m).powi(2) * time_s).exp();
            (mean + left * m.sin() / m, moment + left * ((1.0 - m.cos()) / (m * m) - 0.5 * m.sin() / m))
        })
    }
}

/// Of the sine and cosine between nπ and nπ + π/2.
fn n_sign(n: i32) -> f64 {
    if n % 2 == 0 { 1.0 } else { -1.0 }
}

const TIMES_S: [f64; 7] = [2.0, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0];

/// The largest difference of any layer's mean rate and moment to the product of the series; the moment's in shares of the
/// largest moment.
fn errors(path: &HeatPath) -> (f64, f64) {
    let PackShape { layers, bore_radius_m, radial_pitch_m, height_m } = path.shape;
    let is_ambient = path.location == Location::Ambient;
    let outer_m = bore_radius_m + radial_pitch_m * (layers as f64 - if is_ambient { 0.0 } else { 0.5 });
    let biot_per_m = path.film_w_per_m2_k.map(|film| film / CONDUCTIVITY_W_PER_M_K);
    let cylinder = Cylinder::new(bore_radius_m, outer_m, biot_per_m);
    let flange = path.flange.unwrap();
    let slab = Slab::new(height_m, flange.film_w_per_m2_k / CONDUCTIVITY_W_PER_M_K);
    let away = if flange.flange == Flange::First { 1.0 } else { -1.0 };
    let ramp = PiecewiseLinear::new(vec![0.0, 1e4], vec![300.0, 300.0 + 1e4]).unwrap();
    let instants = TIMES_S.map(Instant::after);
    let history = solve(path, &Drive::boundary(ramp)).unwrap().at(&instants);
    let solved = layers - usize::from(!is_ambient);
    let (mut mean_error, mut moment_error, mut largest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (row, time_s) in TIMES_S.into_iter().enumerate() {
        let (mean, moment) = slab.mean_and_moment(time_s);
        for j in 0..solved {
            let edge_m = |j: usize| bore_radius_m + j as f64 * radial_pitch_m;
            let radial = 1.0 - cylinder.ring_rate(edge_m(j), edge_m(j + 1), time_s);
            let expected = -away * radial * moment;
            largest = largest.max(expected.abs());
            mean_error = mean_error.max((history.rates_k_per_s(row)[j] - (1.0 - radial * mean)).abs());
            moment_error = moment_error.max((history.axial_moments_k_per_s(row)[j] - expected).abs());
        }
    }
    (mean_error, moment_error / largest)
}

fn flanged(location: Location, outer_film: Option<f64>, flange: Flange, flange_film: f64, height_m: f64) -> HeatPath {
    let shape = PackShape { layers: 12, bore_radius_m: 0.004, radial_pitch_m: 250e-6, height_m };
    HeatPath {
        film_w_per_m2_k: outer_film,
        flange: Some(FlangeFilm { flange, film_w_per_m2_k: flange_film }),
        ..path(shape, location, 2)
    }
}

#[test]
fn a_heated_flange_gives_the_means_and_moments_of_the_product_of_both_series_and_a_finer_grid_comes_closer() {
    for (name, location, outer_film, flange) in [
        ("imposed outer layer, first flange", Location::OuterLayer, None, Flange::First),
        ("ambient through a film, second flange", Location::Ambient, Some(40.0), Flange::Second),
    ] {
        let path = flanged(location, outer_film, flange, 200.0, 8.5e-3);
        let coarse = errors(&path);
        let fine = errors(&HeatPath { cells_per_layer: 2, ..path });
        println!("{name}: errors of mean and moment with 1 and 2 cells a layer {coarse:?} {fine:?}");
        assert!(coarse.0 < 1e-8 && coarse.1 < 1e-8, "{name}: {coarse:?}");
        assert!(fine.0 < coarse.0 + 1e-9 && fine.1 < coarse.1 + 1e-9, "{name}: {fine:?}");
    }
}

#[test]
fn the_default_grid_leaves_little_of_the_moment() {
    for film in [20.0, 200.0, 2000.0] {
        for height_m in [8.0e-3, 17.0e-3] {
            let path = flanged(Location::Ambient, Some(20.0), Flange::First, film, height_m);
            let (mean, moment) = errors(&path);
            println!("{height_m} m, {film} W/(m²K): mean {mean:.1e}, moment {moment:.1e} of the largest");
            assert!(moment < 1e-8, "{height_m} m, {film} W/(m²K): {moment}");
        }
    }
}

#[test]
fn two_flanges_of_one_film_are_two_half_coils_and_unequal_ones_turn_the_moment_with_them() {
    let (film, height_m) = (200.0, 8.5e-3);
    let both = |first: f64, second: f64| HeatPath {
        opposite_flange: Some(FlangeFilm { flange: Flange::Second, film_w_per_m2_k: second }),
        ..flanged(Location::Ambient, Some(40.0), Flange::First, first, height_m)
    };
    let ramp = PiecewiseLinear::new(vec![0.0, 1e4], vec![300.0, 300.0 + 1e4]).unwrap();
    let instants = TIMES_S.map(Instant::after);
    let solved = |path: &HeatPath| solve(path, &Drive::boundary(ramp.clone())).unwrap().at(&instants);
    let path = both(film, film);
    let PackShape { layers, bore_radius_m, radial_pitch_m, .. } = path.shape;
    let cylinder = Cylinder::new(
        bore_radius_m,
        bore_radius_m + radial_pitch_m * layers as f64,
        Some(40.0 / CONDUCTIVITY_W_PER_M_K),
    );
    let half = Slab::new(0.5 * height_m, film / CONDUCTIVITY_W_PER_M_K);
    let history = solved(&path);
    let (mut mean_error, mut moment) = (0.0_f64, 0.0_f64);
    for (row, time_s) in TIMES_S.into_iter().enumerate() {
        let mean = half.mean_and_moment(time_s).0;
        for j in 0..layers {
            let edge_m = |j: usize| bore_radius_m + j as f64 * radial_pitch_m;
            let radial = 1.0 - cylinder.ring_rate(edge_m(j), edge_m(j + 1), time_s);
            mean_error = mean_error.max((history.rates_k_per_s(row)[j] - (1.0 - radial * mean)).abs());
            moment = moment.max(history.axial_moments_k_per_s(row)[j].abs());
        }
    }
    println!("means within {mean_error:.1e}, moments below {moment:.1e}");
    assert!(mean_error < 1e-8 && moment < 1e-8);
    let (one, other) = (solved(&both(50.0, 400.0)), solved(&both(400.0, 50.0)));
    for (a, b) in one.axial_moment_k_per_s.iter().zip(&other.axial_moment_k_per_s) {
        assert!((a + b).abs() < 1e-8, "{a} {b}");
    }
    assert!(one.axial_moment_k_per_s.iter().any(|m| m.abs() > 1e-3));
}
