//! The thermal field: what a search, a diagnosis and a guaranteed worst case pay for it.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{DMatrix, SymmetricEigen};

use coilwright::numeric::piecewise::PiecewiseLinear;
use coilwright::numeric::tridiagonal::diagonalise;
use coilwright::profile::ProfileSpec;
use coilwright::thermal::pack::Pack;
use coilwright::thermal::{
    Drive, Extent, Flange, FlangeFilm, HeatPath, Instant, Location, PackMaterial, PackShape, Spool, solve,
};

fn path(layers: usize) -> HeatPath {
    let shape = PackShape { layers, bore_radius_m: 0.04, radial_pitch_m: 165e-6, height_m: 0.0085 };
    let material = PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 };
    HeatPath {
        film_w_per_m2_k: Some(20.0),
        spool: Some(Spool { heat_capacity_j_per_m2_k: 4000.0, contact_w_per_m2_k: 300.0, mount_w_per_m2_k: 0.0 }),
        ..HeatPath::new(shape, Extent::Pack, material, Location::Ambient)
    }
}

/// 2000 knots, 10 s apart.
fn record_drive() -> Drive {
    let knots: Vec<f64> = (0..2000).map(|i| 10.0 * i as f64).collect();
    let values = knots.iter().map(|t| 300.0 + 20.0 * (t / 3000.0).sin() + 0.004 * (t * 12.9898).sin()).collect();
    Drive::boundary(PiecewiseLinear::new(knots, values).unwrap())
}

fn eigen(c: &mut Criterion) {
    let n = 80;
    let diagonal: Vec<f64> = (0..n).map(|i| 2.0 + 0.01 * i as f64).collect();
    let off = vec![-1.0; n - 1];
    c.bench_function("eigenvalues of 80 nodes, 42 rows: implicit QL on the rows", |b| {
        b.iter(|| {
            let mut rows = DMatrix::<f64>::identity(42, n);
            let mut values = diagonal.clone();
            diagonalise(&mut values, &off, &mut rows).unwrap();
            values[0]
        })
    });
    c.bench_function("eigenvalues of 80 nodes: nalgebra's general solver", |b| {
        b.iter(|| {
            let matrix = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
                0 => diagonal[i],
                1 => -1.0,
                _ => 0.0,
            });
            SymmetricEigen::new(matrix).eigenvalues[0]
        })
    });
}

fn packs(c: &mut Criterion) {
    for layers in [24, 40] {
        let path = path(layers);
        c.bench_function(&format!("set-up of a pack of {layers} layers with film and spool"), |b| {
            b.iter(|| Pack::new(&path).unwrap())
        });
    }
    let flange = FlangeFilm { flange: Flange::First, film_w_per_m2_k: 20.0 };
    let flanged = HeatPath { flange: Some(flange), ..path(24) };
    c.bench_function("set-up of a pack of 24 layers with a flange", |b| b.iter(|| Pack::new(&flanged).unwrap()));
}

fn profiles(c: &mut Criterion) {
    let path = path(40);
    let spec =
        ProfileSpec { max_rate_k_per_s: 0.0028, count: 65, segments: 4, duration_s: 6000.0, seed: 1, listed: vec![] };
    let fields: Vec<_> = spec
        .profiles()
        .iter()
        .map(|profile| solve(&path, &Drive::boundary(profile.temperature(293.15))).unwrap())
        .collect();
    let instants: Vec<Instant> = (0..200).map(|i| Instant::after(30.0 * i as f64 + 1.0)).collect();
    c.bench_function("40 layers, 65 profiles, 200 instants: rates, one thread", |b| {
        b.iter(|| fields.iter().map(|field| field.rates_at(&instants).rate_k_per_s[0]).sum::<f64>())
    });
    c.bench_function("40 layers, 65 profiles, 200 instants: rates and temperatures, one thread", |b| {
        b.iter(|| fields.iter().map(|field| field.at(&instants).rate_k_per_s[0]).sum::<f64>())
    });
}

fn records(c: &mut Criterion) {
    let drive = record_drive();
    let ends_s: Vec<f64> = drive.boundary_k.knots().to_vec();
    let linear = path(24);
    c.bench_function("a record of 2000 rows, 24 layers: set-up, field and means", |b| {
        b.iter(|| solve(&linear, &drive).unwrap().means(&ends_s, 10.0).rate_k_per_s[0])
    });
    let sloped = HeatPath { conductivity_slope_per_k: 0.002, ..path(24) };
    let half_space = HeatPath::new(
        linear.shape,
        Extent::HalfSpace,
        PackMaterial::Diffusivity { m2_per_s: 2.06e-7 },
        Location::OuterLayer,
    );
    let mut group = c.benchmark_group("slow");
    group.sample_size(10);
    group.bench_function("a record of 2000 rows, 24 layers, conductivity with a slope: stepped", |b| {
        b.iter(|| solve(&sloped, &drive).unwrap().means(&ends_s, 10.0).rate_k_per_s[0])
    });
    group.bench_function("a record of 2000 rows, 24 layers: half space", |b| {
        b.iter(|| solve(&half_space, &drive).unwrap().means(&ends_s, 10.0).rate_k_per_s[0])
    });
    group.finish();
}

criterion_group!(benches, eigen, packs, profiles, records);
criterion_main!(benches);
