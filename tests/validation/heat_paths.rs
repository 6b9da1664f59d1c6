//! Reference: what stands beside the pack — housings, the spool's metal and flanges, starts that are not steady, sensors on any of
//! them — against closed forms: chains of lumps by their matrix exponential, a fin, the solution that other tests hold against
//! Bessel's and Fourier's series, and finite volumes of the second order that share nothing with the program. Tolerances
//! stand beside each, with why.

use coilwright::numeric::piecewise::PiecewiseLinear;
use coilwright::thermal::{
    Drive, Extent, Flange, FlangeFilm, HeatPath, Housing, Instant, Location, PackMaterial, PackShape, Spool,
    SpoolFlange, SpoolWall, Start, ThermalHistory, solve,
};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

const CAPACITY: f64 = 1.7e6;
const BORE_M: f64 = 0.04;

fn path(layers: usize, pitch_m: f64, conductivity: f64) -> HeatPath {
    let shape = PackShape { layers, bore_radius_m: BORE_M, radial_pitch_m: pitch_m, height_m: 0.0085 };
    let material = PackMaterial::Conductivity { w_per_m_k: conductivity, heat_capacity_j_per_m3_k: CAPACITY };
    let path = HeatPath::new(shape, Extent::Pack, material, Location::Ambient);
    HeatPath { film_w_per_m2_k: Some(20.0), ..path }
}

fn usual() -> HeatPath {
    path(8, 165e-6, 0.35)
}

fn outer_m(path: &HeatPath) -> f64 {
    BORE_M + path.shape.layers as f64 * path.shape.radial_pitch_m
}

/// Per radian and height.
fn pack_capacity(path: &HeatPath) -> f64 {
    0.5 * CAPACITY * (outer_m(path).powi(2) - BORE_M.powi(2))
}

const HOUSINGS: [Housing; 2] = [
    Housing { place: 0, heat_capacity_j_per_m2_k: 5000.0, gap_w_per_m2_k: 13.0 },
    Housing { place: 1, heat_capacity_j_per_m2_k: 9000.0, gap_w_per_m2_k: 2.0 },
];
const SPOOL: Spool = Spool { heat_capacity_j_per_m2_k: 4000.0, contact_w_per_m2_k: 200.0, mount_w_per_m2_k: 6.0 };

fn flange(flange: Flange, film_w_per_m2_k: f64) -> SpoolFlange {
    SpoolFlange { flange, heat_capacity_j_per_m2_k: 4900.0, contact_w_per_m2_k: 300.0, film_w_per_m2_k }
}

fn ramp(duration_s: f64) -> Drive {
    Drive::boundary(PiecewiseLinear::new(vec![0.0, duration_s], vec![293.0, 293.0 + 0.01 * duration_s]).unwrap())
}

/// Lumps joined by conductances, under a ramp of one of them or of what is outside: exact by modes.
struct Lumps {
    capacity: Vec<f64>,
    joints: Vec<(usize, usize, f64)>,
    outside: Vec<f64>,
}

impl Lumps {
    fn modes(&self) -> (Vec<f64>, DMatrix<f64>) {
        let n = self.capacity.len();
        let mut g = DMatrix::from_diagonal(&DVector::from_vec(self.outside.clone()));
        for &(a, b, joint) in &self.joints {
            g[(a, a)] += joint;
            g[(b, b)] += joint;
            g[(a, b)] -= joint;
            g[(b, a)] -= joint;
        }
        let scaled = DMatrix::from_fn(n, n, |i, j| g[(i, j)] / (self.capacity[i] * self.capacity[j]).sqrt());
        let found = SymmetricEigen::new(scaled);
        let mut vectors = found.eigenvectors;
        for (i, mut row) in vectors.row_iter_mut().enumerate() {
            row /= self.capacity[i].sqrt();
        }
        (found.eigenvalues.as_slice().to_vec(), vectors)
    }

    /// Rises after a ramp of a rate has lasted so long, with initial rises.
    fn rises(&self, rate_k_per_s: f64, time_s: f64, first_k: &[f64]) -> Vec<f64> {
        let (decays, vectors) = self.modes();
        let outside = DVector::from_vec(self.outside.clone());
        let first = DVector::from_iterator(first_k.len(), first_k.iter().zip(&self.capacity).map(|(t, c)| t * c));
        let (driven, begun) = (vectors.transpose() * outside, vectors.transpose() * first);
        let contents = decays.iter().enumerate().map(|(i, l)| {
            let left = (-l * time_s).exp();
            driven[i] * rate_k_per_s * (time_s - (1.0 - left) / l) / l + begun[i] * left
        });
        (&vectors * DVector::from_iterator(decays.len(), contents)).as_slice().to_vec()
    }
}

/// Spool, pack (so conducting that it is one lump), and the housings, under the chamber's air.
fn chain(path: &HeatPath) -> Lumps {
    let r = outer_m(path);
    Lumps {
        capacity: vec![4000.0 * BORE_M, pack_capacity(path), 5000.0 * r, 9000.0 * r],
        joints: vec![(0, 1, 200.0 * BORE_M), (1, 2, 13.0 * r), (2, 3, 2.0 * r), (0, 2, 6.0 * BORE_M)],
        outside: vec![0.0, 0.0, 0.0, 20.0 * r],
    }
}

/// Layers' rises above 293 K.
fn rises(history: &ThermalHistory, row: usize) -> Vec<f64> {
    history.temperatures_k(row).iter().map(|t| t - 293.0).collect()
}

#[test]
fn spool_pack_and_two_housings_are_a_chain_of_four_lumps_the_closer_the_better_the_pack_conducts() {
    let mut errors = Vec::new();
    for conductivity in [4.0, 8.0, 16.0] {
        let mut path = path(4, 165e-6, conductivity);
        (path.housings, path.spool) = (HOUSINGS.to_vec(), Some(SPOOL));
        path.start = Some(Start {
            pack_above_k: 1.5,
            spool_above_k: -2.0,
            housing_above_k: 0.7,
            rate_k_per_s: 0.0,
            lasted_s: 1.0,
        });
        let field = solve(&path, &ramp(20_000.0)).unwrap();
        let mut worst = 0.0_f64;
        for time_s in [30.0, 300.0, 2000.0, 9000.0, 20_000.0] {
            let expected = chain(&path).rises(0.01, time_s, &[-2.0, 1.5, 0.7, 0.7])[1];
            let history = field.at(&[Instant::before(time_s)]);
            worst = rises(&history, 0).iter().fold(worst, |w, r| w.max((r - expected).abs()));
        }
        errors.push(worst);
    }
    let orders: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
    println!("off by {errors:?} K after ramps of up to 200 K; orders in 1/k {orders:.3?}");
    // Of 200 K; what remains beside the order is the modes' rounding, half a thousandth of a kelvin.
    assert!(errors[2] < 2e-3 && orders.iter().all(|o| (0.85..1.15).contains(o)));
}

#[test]
fn a_sensor_on_a_housing_or_on_the_spool_drives_the_pack_as_what_it_shows_did() {
    // What the parts do under the chamber's air, finely sampled, drives the pack from where the sensor is.
    let mut path = path(4, 165e-6, 200.0);
    path.housings = HOUSINGS.to_vec();
    let whole = solve(&HeatPath { spool: Some(SPOOL), ..path.clone() }, &ramp(9000.0)).unwrap();
    let shown = |part: usize| {
        let times: Vec<f64> = (0..=3000).map(|i| 3.0 * f64::from(i)).collect();
        let values = times.iter().map(|t| 293.0 + chain(&path).rises(0.01, *t, &[0.0; 4])[part]).collect();
        PiecewiseLinear::new(times, values).unwrap()
    };
    let air = ramp(9000.0).boundary_k;
    for (location, part) in [(Location::Housing(0), 2), (Location::Housing(1), 3), (Location::Spool, 0)] {
        let seen = HeatPath { location, spool: Some(SPOOL), ..path.clone() };
        let field = solve(&seen, &Drive { boundary_k: shown(part), ambient_k: Some(air.clone()) }).unwrap();
        let mut worst = 0.0_f64;
        for time_s in [50.0, 600.0, 3000.0, 8999.0] {
            let (a, b) = (field.at(&[Instant::before(time_s)]), whole.at(&[Instant::before(time_s)]));
            for (a, b) in a.temperatures_k(0).iter().zip(b.temperatures_k(0)) {
                worst = worst.max((a - b).abs());
            }
        }
        println!("{location:?}: within {worst:.1e} K");
        // The lumps that stand for the parts know the pack as one lump, and the course is straight between samples.
        assert!(worst < 3e-4, "{location:?}");
    }
}

/// A spool whose wall is a fin: from a flange at one kelvin, through a pack so thin that it only passes heat outwards. The first layer's mean and moment: closed form, and found.
fn fin(pitch_m: f64) -> [[f64; 2]; 2] {
    // As much resistance whatever the thickness.
    let conductivity = 0.02 * pitch_m / 160e-6;
    let (film, wall) = (2000.0, SpoolWall { conductivity_w_per_m_k: 167.0, thickness_m: 2e-4 });
    let contact = 1e6;
    let mut path = path(2, pitch_m, conductivity);
    path.film_w_per_m2_k = Some(film);
    path.spool = Some(Spool { heat_capacity_j_per_m2_k: 500.0, contact_w_per_m2_k: contact, mount_w_per_m2_k: 0.0 });
    path.spool_wall = Some(wall);
    path.location = Location::Flange(Flange::First);
    path.spool_flanges = vec![SpoolFlange { contact_w_per_m2_k: 1e-9, ..flange(Flange::First, 10.0) }];
    let drive = Drive {
        boundary_k: PiecewiseLinear::new(vec![0.0, 1.0], vec![293.0, 294.0]).unwrap(),
        ambient_k: Some(PiecewiseLinear::constant(293.0)),
    };
    let history = solve(&path, &drive).unwrap().at(&[Instant::after(1e6)]);
    // Per radian: κ T'' = T/R, T'(H) = 0, and at the flange the wall's joint.
    let outer_m = outer_m(&path);
    let resistance = 1.0 / (contact * BORE_M) + (outer_m / BORE_M).ln() / conductivity + 1.0 / (film * outer_m);
    let along = 167.0 * 2e-4 * BORE_M;
    let joint = along / (0.5 * (outer_m - BORE_M));
    let m = (1.0 / (resistance * along)).sqrt();
    let mh = m * path.shape.height_m;
    let at_flange = joint / (joint + along * m * mh.tanh());
    // The layer's mean of 1 − (share of the resistance inside r), over the volume.
    let edge_m = BORE_M + path.shape.radial_pitch_m;
    let (a, b) = (BORE_M, edge_m);
    let log_mean = (b * b * (b / a).ln() / (b * b - a * a)) - 0.5;
    let layer = 1.0 - (1.0 / (contact * BORE_M) + log_mean / conductivity) / resistance;
    let mean = at_flange * mh.tanh() / mh;
    // ∫ cosh(mh(1−s)) (s − ½) ds over cosh(mh).
    let moment = at_flange * ((1.0 - mh.cosh().recip()) / (mh * mh) - 0.5 * mh.tanh() / mh);
    [[mean * layer, moment * layer], [rises(&history, 0)[0], history.axial_moment_k[0]]]
}

#[test]
fn a_spools_wall_is_a_fin_the_closer_the_thinner_the_pack_on_it() {
    let errors: Vec<[f64; 2]> = [160e-6, 80e-6, 40e-6]
        .into_iter()
        .map(|pitch_m| {
            let [expected, found] = fin(pitch_m);
            println!("mean {:.6} for {:.6}, moment {:.6} for {:.6}", found[0], expected[0], found[1], expected[1]);
            [0, 1].map(|i| (found[i] / expected[i] - 1.0).abs())
        })
        .collect();
    let orders: Vec<[f64; 2]> = errors.windows(2).map(|e| [0, 1].map(|i| (e[0][i] / e[1][i]).log2())).collect();
    println!("off by {errors:?}, orders in the pack's thickness {orders:.2?}");
    assert!(errors[2].iter().all(|e| *e < 2e-3));
    assert!(orders.iter().flatten().all(|o| *o > 0.8));
}

/// The largest difference of layers' rates and moments between two paths, of those of the first.
fn apart(a: &HeatPath, b: &HeatPath) -> f64 {
    let drive = Drive {
        boundary_k: PiecewiseLinear::new(vec![0.0, 400.0, 900.0], vec![293.0, 299.0, 295.0]).unwrap(),
        ambient_k: None,
    };
    let times: Vec<Instant> = [0.5, 5.0, 60.0, 399.0, 401.0, 700.0, 3000.0].map(Instant::after).to_vec();
    let [a, b] = [a, b].map(|path| solve(path, &drive).unwrap().at(&times));
    let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    off(&a.rate_k_per_s, &b.rate_k_per_s).max(off(&a.axial_moment_k_per_s, &b.axial_moment_k_per_s)) / 0.015
}

#[test]
fn a_flange_without_heat_capacity_in_a_strong_wind_is_a_film_at_the_pack_and_so_are_two() {
    let still = |which: Flange, contact: f64| SpoolFlange {
        flange: which,
        heat_capacity_j_per_m2_k: 1e-3,
        contact_w_per_m2_k: contact,
        film_w_per_m2_k: 1e9,
    };
    let film = |which: Flange, film_w_per_m2_k: f64| FlangeFilm { flange: which, film_w_per_m2_k };
    for location in [Location::Ambient, Location::OuterLayer] {
        let base = HeatPath { location, ..usual() };
        let joined =
            HeatPath { spool_flanges: vec![still(Flange::First, 120.0), still(Flange::Second, 30.0)], ..base.clone() };
        let plain = HeatPath {
            flange: Some(film(Flange::First, 120.0)),
            opposite_flange: Some(film(Flange::Second, 30.0)),
            ..base
        };
        let off = apart(&joined, &plain);
        println!("{location:?}: {off:.1e}");
        // Thousands of modes on the one side, a few dozen directions on the other.
        assert!(off < 1e-6, "{location:?}: {off}");
    }
}

#[test]
fn flanges_that_are_alike_make_no_moment_and_ones_that_touch_nothing_leave_the_pack_alone() {
    let alike = HeatPath {
        spool: Some(SPOOL),
        spool_wall: Some(SpoolWall { conductivity_w_per_m_k: 167.0, thickness_m: 2e-3 }),
        spool_flanges: vec![flange(Flange::First, 25.0), flange(Flange::Second, 25.0)],
        housings: HOUSINGS.to_vec(),
        ..usual()
    };
    let history = solve(&alike, &ramp(600.0)).unwrap().at(&[Instant::after(50.0), Instant::before(600.0)]);
    assert!(history.axial_moment_k_per_s.iter().all(|m| m.abs() < 1e-12), "{:?}", history.axial_moment_k_per_s);
    let mut apart_from_all = alike.clone();
    for flange in &mut apart_from_all.spool_flanges {
        (flange.contact_w_per_m2_k, flange.film_w_per_m2_k, flange.heat_capacity_j_per_m2_k) = (1e-9, 0.0, 1e-6);
    }
    let without = HeatPath { spool_wall: None, spool_flanges: vec![], ..alike };
    let off = apart(&apart_from_all, &without);
    println!("{off:.1e}");
    assert!(off < 1e-7, "{off}");
}

/// Finite volumes of a section through pack, spool, two flanges and a housing, exact in time by their modes.
fn finite_volumes(path: &HeatPath, cells: usize, times_s: &[f64]) -> Vec<(f64, f64)> {
    let (nr, nz) = (cells, cells);
    let height_m = path.shape.height_m;
    let (dr, dz) = ((outer_m(path) - BORE_M) / nr as f64, height_m / nz as f64);
    let k = 0.35;
    let node = |i: usize, j: usize| j * nr + i;
    let (spool_first, flange_first) = (nr * nz, nr * nz + nz);
    let housing = flange_first + 2;
    let n = housing + 1;
    let spool = path.spool.unwrap();
    let wall = path.spool_wall.unwrap();
    let mut lumps = Lumps { capacity: vec![0.0; n], joints: vec![], outside: vec![0.0; n] };
    // Per radian.
    for j in 0..nz {
        for i in 0..nr {
            let (inner, outer) = (BORE_M + i as f64 * dr, BORE_M + (i + 1) as f64 * dr);
            let face = 0.5 * (outer * outer - inner * inner);
            lumps.capacity[node(i, j)] = CAPACITY * face * dz;
            if i + 1 < nr {
                let middle = (0.5 * (inner + outer), 0.5 * (inner + outer) + dr);
                lumps.joints.push((node(i, j), node(i + 1, j), k * dz / (middle.1 / middle.0).ln()));
            }
            if j + 1 < nz {
                lumps.joints.push((node(i, j), node(i, j + 1), k * face / dz));
            }
            for (at, flange) in path.spool_flanges.iter().enumerate() {
                let end = if flange.flange == Flange::First { 0 } else { nz - 1 };
                if j == end {
                    let contact = face / (0.5 * dz / k + 1.0 / flange.contact_w_per_m2_k);
                    lumps.joints.push((node(i, j), flange_first + at, contact));
                }
            }
        }
        let to_spool = dz * BORE_M / (0.5 * dr / k + 1.0 / spool.contact_w_per_m2_k);
        lumps.joints.push((node(0, j), spool_first + j, to_spool));
        lumps.capacity[spool_first + j] = spool.heat_capacity_j_per_m2_k * BORE_M * dz;
        lumps.joints.push((spool_first + j, housing, spool.mount_w_per_m2_k * BORE_M * dz));
        let metal = wall.conductivity_w_per_m_k * wall.thickness_m * BORE_M;
        if j + 1 < nz {
            lumps.joints.push((spool_first + j, spool_first + j + 1, metal / dz));
        }
        let gap = path.housings[0].gap_w_per_m2_k;
        let to_housing = dz * outer_m(path) / (0.5 * dr / k + 1.0 / gap);
        lumps.joints.push((node(nr - 1, j), housing, to_housing));
    }
    let face = 0.5 * (outer_m(path).powi(2) - BORE_M.powi(2));
    for (at, flange) in path.spool_flanges.iter().enumerate() {
        lumps.capacity[flange_first + at] = flange.heat_capacity_j_per_m2_k * face;
        lumps.joints.push((flange_first + at, housing, flange.film_w_per_m2_k * face));
        let depth_m = 0.5 * (outer_m(path) - BORE_M);
        let metal = wall.conductivity_w_per_m_k * wall.thickness_m * BORE_M;
        let end = spool_first + if flange.flange == Flange::First { 0 } else { nz - 1 };
        lumps.joints.push((end, flange_first + at, metal / (depth_m + 0.5 * dz)));
    }
    lumps.capacity[housing] = path.housings[0].heat_capacity_j_per_m2_k * outer_m(path) * height_m;
    lumps.outside[housing] = path.film_w_per_m2_k.unwrap() * outer_m(path) * height_m;
    // The whole pack's mean and first moment.
    times_s
        .iter()
        .map(|&t| {
            let rises = lumps.rises(0.01, t, &vec![0.0; n]);
            let whole: f64 = lumps.capacity[..spool_first].iter().sum();
            let over = |f: &dyn Fn(usize) -> f64| -> f64 {
                (0..spool_first).map(|i| lumps.capacity[i] * rises[i] * f(i / nr)).sum::<f64>() / whole
            };
            (over(&|_| 1.0), over(&|j| (j as f64 + 0.5) / nz as f64 - 0.5))
        })
        .collect()
}

#[test]
fn spool_flanges_and_housing_together_are_what_finite_volumes_of_the_second_order_tend_to() {
    let joined = HeatPath {
        spool: Some(SPOOL),
        spool_wall: Some(SpoolWall { conductivity_w_per_m_k: 20.0, thickness_m: 1e-3 }),
        spool_flanges: vec![
            flange(Flange::First, 25.0),
            SpoolFlange { contact_w_per_m2_k: 2000.0, ..flange(Flange::Second, 5.0) },
        ],
        housings: HOUSINGS[..1].to_vec(),
        ..usual()
    };
    let times_s = [40.0, 400.0, 3000.0];
    let history = solve(&joined, &ramp(4000.0)).unwrap().at(&times_s.map(Instant::after));
    let layers = joined.shape.layers;
    let share = |j: usize| BORE_M + (j as f64 + 0.5) * joined.shape.radial_pitch_m;
    let total: f64 = (0..layers).map(share).sum();
    let over = |values: &[f64]| values.iter().enumerate().map(|(j, v)| share(j) * v).sum::<f64>() / total;
    let errors: Vec<[f64; 2]> = [5, 10, 20]
        .into_iter()
        .map(|cells| {
            let found = finite_volumes(&joined, cells, &times_s);
            let mut worst = [0.0_f64; 2];
            for (row, (mean, moment)) in found.into_iter().enumerate() {
                let moments = &history.axial_moment_k[row * layers..(row + 1) * layers];
                worst[0] = worst[0].max((mean / over(&rises(&history, row)) - 1.0).abs());
                worst[1] = worst[1].max((moment / over(moments) - 1.0).abs());
            }
            worst
        })
        .collect();
    let orders: Vec<[f64; 2]> = errors.windows(2).map(|e| [0, 1].map(|i| (e[0][i] / e[1][i]).log2())).collect();
    println!("finite volumes off by {errors:?}; observed orders {orders:.2?}");
    assert!(orders[0].iter().all(|o| *o > 1.6) && orders[1].iter().all(|o| (1.8..2.2).contains(o)));
    // What Richardson's extrapolation leaves of them.
    let left = [0, 1].map(|i| (4.0 * errors[2][i] - errors[1][i]) / 3.0);
    println!("extrapolated: {left:?}");
    assert!(left[0].abs() < 2e-4 && left[1].abs() < 3e-3);
}

#[test]
fn a_ramp_before_the_start_is_the_same_as_a_longer_drive() {
    let start =
        Start { pack_above_k: 0.0, spool_above_k: 0.0, housing_above_k: 0.0, rate_k_per_s: 0.02, lasted_s: 700.0 };
    let course = PiecewiseLinear::new(vec![0.0, 500.0, 900.0], vec![300.0, 305.0, 303.0]).unwrap();
    let longer = PiecewiseLinear::new(vec![-700.0, 0.0, 500.0, 900.0], vec![286.0, 300.0, 305.0, 303.0]).unwrap();
    let half_space =
        HeatPath { extent: Extent::HalfSpace, location: Location::OuterLayer, film_w_per_m2_k: None, ..usual() };
    let varying = HeatPath { conductivity_slope_per_k: 0.003, ..usual() };
    let housed = HeatPath { housings: HOUSINGS.to_vec(), spool: Some(SPOOL), ..usual() };
    let joined = HeatPath { spool_flanges: vec![flange(Flange::First, 25.0)], ..housed.clone() };
    for (name, path) in
        [("film", usual()), ("half space", half_space), ("k(T)", varying), ("housings", housed), ("flange", joined)]
    {
        let times = [0.0, 3.0, 80.0, 499.0, 501.0, 2000.0].map(Instant::after);
        let short = solve(&HeatPath { start: Some(start), ..path.clone() }, &Drive::boundary(course.clone())).unwrap();
        let long = solve(&path, &Drive::boundary(longer.clone())).unwrap();
        let (a, b) = (short.at(&times), long.at(&times));
        let off = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let (rate, rise) = (off(&a.rate_k_per_s, &b.rate_k_per_s), off(&a.temperature_k, &b.temperature_k));
        println!("{name}: rates within {rate:.1e} K/s, temperatures within {rise:.1e} K");
        assert!(rate < 1e-9 && rise < 1e-7, "{name}: {rate} {rise}");
        let (a, b) = (short.means(&[10.0, 20.0, 1000.0], 10.0), long.means(&[10.0, 20.0, 1000.0], 10.0));
        assert!(off(&a.rate_k_per_s, &b.rate_k_per_s) < 1e-9, "{name}");
    }
}

#[test]
fn a_pack_that_starts_warm_cools_by_its_bessel_series() {
    // The hollow cylinder of `pack`, from a uniform excess of one kelvin: what is left of it is one minus the response to a step.
    let base = HeatPath { film_w_per_m2_k: Some(200.0), ..usual() };
    let start = Start { pack_above_k: 1.0, spool_above_k: 0.0, housing_above_k: 0.0, rate_k_per_s: 0.0, lasted_s: 1.0 };
    let warm = HeatPath { start: Some(start), ..base.clone() };
    let cylinder = crate::pack::Cylinder::new(BORE_M, outer_m(&base), Some(200.0 / 0.35));
    let still = Drive::boundary(PiecewiseLinear::constant(293.0));
    let field = solve(&warm, &still).unwrap();
    let mut worst = 0.0_f64;
    for time_s in [1.0, 5.0, 20.0, 60.0] {
        let history = field.at(&[Instant::after(time_s)]);
        for (j, left) in rises(&history, 0).into_iter().enumerate() {
            let edge = |j: usize| BORE_M + j as f64 * base.shape.radial_pitch_m;
            // The series has the diffusivity of `pack`; times are scaled to it.
            let scaled_s = time_s * (0.35 / CAPACITY) / crate::pack::DIFFUSIVITY_M2_PER_S;
            worst = worst.max((left - 1.0 + cylinder.ring_rate(edge(j), edge(j + 1), scaled_s)).abs());
        }
    }
    println!("within {worst:.1e} K of the series");
    assert!(worst < 1e-6);
}

#[test]
fn vacuum_and_gas_gaps_have_the_conductances_of_their_closed_forms() {
    let spec = coilwright::effect::find("housing").unwrap();
    let gap = |stated: [f64; 6]| {
        let values = spec.parameters.iter().zip(stated).map(|(p, v)| p.unit.to_si(v)).collect();
        let effect = coilwright::effect::DeclaredEffect::new(spec, values, vec![0]).unwrap();
        let coil = coilwright::coil::Coil::new(coilwright::coil::CoilSpec {
            fibre: coilwright::coil::Fibre {
                refractive_index: 1.45,
                group_index: None,
                thermo_optic_per_k: 1e-5,
                thermal_expansion_per_k: 0.0,
                wavelength_m: 1.55e-6,
                outer_diameter_m: 165e-6,
            },
            layers: 4,
            turns_per_layer: Some(50.0),
            bore_radius_m: BORE_M,
            radial_pitch_m: 165e-6,
            axial_pitch_m: 170e-6,
            layer_length: coilwright::coil::LayerLength::Actual,
            length_m: None,
        })
        .unwrap();
        let mut path = usual();
        effect.bind(&coil, &[]).change_heat_path(&mut path);
        path.housings[0].gap_w_per_m2_k
    };
    // A black gap at 300 K radiates 6.1236 W/(m²K) (Incropera et al., 4σT³), 2 mm of air conduct 13.
    assert!((gap([5000.0, 2.0, 0.0, 1.0, 26.85, 0.0]) - 6.1240).abs() < 2e-4);
    assert!((gap([5000.0, 2.0, 0.026, 0.001, -200.0, 5.0]) - 18.0).abs() < 1e-3);
}
