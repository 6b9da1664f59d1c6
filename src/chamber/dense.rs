//! The filter, the smoother and the derivatives against other ways of computing the same: a dense joint Gaussian of all
//! measurements, the conditional mean in it, central differences.

#[cfg(test)]
pub(super) mod tests {
    use std::sync::Arc;

    use nalgebra::{DMatrix, DVector};

    use crate::chamber::abreast;
    use crate::chamber::coil_side::{CoilSide, Observed, smoothed};
    use crate::chamber::doubts::doubts;
    use crate::chamber::filter::{self, Move, System};
    use crate::chamber::kinked_rows::Bend;
    use crate::chamber::layout::{Numbers, Parts};
    use crate::chamber::prior::Quantity;
    use crate::chamber::series::{Origin, Series};
    use crate::chamber::solved::Solved;
    use crate::chamber::system::{decoupled_system, decoupled_system_beside, system};
    use crate::chamber::{Assumption, Chamber, Effort, Free, Input};
    use crate::coil::{Coil, CoilSpec, Fibre, LayerLength};
    use crate::effect::{DeclaredEffect, find};
    use crate::pattern::classic::Classic;
    use crate::rate::CoilModel;
    use crate::record::Record;
    use crate::thermal::{Extent, Location, PackMaterial};

    pub(crate) fn model(effects: Vec<DeclaredEffect>) -> CoilModel {
        let fibre = Fibre {
            refractive_index: 1.45,
            thermo_optic_per_k: 1.0e-5,
            group_index: None,
            thermal_expansion_per_k: 0.0,
            wavelength_m: 1550e-9,
            outer_diameter_m: 330e-6,
        };
        let spec = CoilSpec {
            fibre,
            layers: 8,
            turns_per_layer: Some(50.0),
            bore_radius_m: 0.04,
            radial_pitch_m: 330e-6,
            axial_pitch_m: 340e-6,
            layer_length: LayerLength::Actual,
            length_m: None,
        };
        CoilModel {
            name: "test".into(),
            coil: Coil::new(spec).unwrap(),
            extent: Extent::Pack,
            material: PackMaterial::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 },
            location: Location::OuterLayer,
            rate_mean_s: 10.0,
            cells_per_layer: 2,
            effects,
        }
    }

    pub(crate) fn effect(kind: &str, values: &[f64]) -> DeclaredEffect {
        let spec = find(kind).unwrap();
        DeclaredEffect::new(spec, values.to_vec(), vec![0; spec.choices.len()]).unwrap()
    }

    /// Rows every 10 s with a gap of 47 s, one of them off the grid, and a gross error in a reading.
    pub(in crate::chamber) fn record(rows: usize) -> Record {
        let mut times_s: Vec<f64> = (0..rows).map(|i| 10.0 * i as f64 + if i > 25 { 37.0 } else { 0.0 }).collect();
        times_s[13] += 3.0;
        let wave = |t: f64, k: f64| (0.013 * k * t).sin() + 0.3 * (0.17 * k * t).cos();
        let mut temperature_k: Vec<f64> =
            times_s.iter().map(|t| 293.0 + 2.0 * (t / 300.0).tanh() + 0.004 * wave(*t, 7.0)).collect();
        temperature_k[19] += 60.0;
        let rate = times_s.iter().map(|t| 1e-6 * wave(*t, 1.0) + 2e-7 * wave(*t, 23.0)).collect();
        Record::new("short", times_s, temperature_k, rate).unwrap()
    }

    fn dense(system: &System, sparse: &crate::chamber::sparse::Sparse) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(sparse.rows(), system.size);
        for row in 0..sparse.rows() {
            sparse.row(row).iter().for_each(|&(column, value)| dense[(row, column)] = value);
        }
        dense
    }

    /// Mean and covariance of all measurements, and of each with the states at one row.
    struct Joint {
        mean: DVector<f64>,
        covariance: DMatrix<f64>,
        values: DVector<f64>,
        /// Covariance of the states at the row asked for with the measurements, and their own mean.
        cross: DMatrix<f64>,
        states: DVector<f64>,
        /// What a change of the slope by one where that row's steps begin makes of all measurements.
        kink: DVector<f64>,
    }

    fn joint(system: &System, series: &Series, asked: usize) -> Joint {
        let n = system.size;
        let (rows, kept) = (dense(system, &system.rows), dense(system, &system.kept));
        // Each row's map and noise.
        let mut maps = Vec::new();
        let mut prior =
            vec![(DVector::from_vec(system.mean.clone()), DMatrix::from_row_slice(n, n, &system.covariance))];
        for (k, row) in series.rows.iter().enumerate() {
            let mut map = DMatrix::identity(n, n);
            let mut noise = DMatrix::zeros(n, n);
            let density = system.trend.0 + row.bend * (system.trend.1 - system.trend.0);
            let step = |index: u16, map: &mut DMatrix<f64>, noise: &mut DMatrix<f64>| {
                let s = &system.steps[index as usize];
                let phi = dense(system, &s.phi);
                let own =
                    DMatrix::from_row_slice(n, n, &s.noise) + DMatrix::from_row_slice(n, n, &s.trend_noise) * density;
                *noise = &phi * &*noise * phi.transpose() + own;
                *map = &phi * &*map;
            };
            if !row.is_kinked_within() {
                noise[(system.slope, system.slope)] += row.kink;
            }
            for movement in &row.moves {
                match movement {
                    Move::Step(index) => step(*index, &mut map, &mut noise),
                    Move::Kink(place) => {
                        let change = DVector::from_row_slice(&system.kinks[*place as usize]);
                        noise += row.kink * &change * change.transpose();
                    }
                    Move::Keep(slot) => {
                        let mut keep = DMatrix::identity(n, n);
                        for &(state, place) in &system.keeps[*slot as usize] {
                            keep.set_row(state, &kept.row(place));
                        }
                        map = &keep * map;
                        noise = &keep * noise * keep.transpose();
                    }
                }
            }
            let (mean, covariance) = &prior[k];
            prior.push((&map * mean, &map * covariance * map.transpose() + noise));
            maps.push(map);
        }
        let measured: Vec<(usize, usize, usize)> = series
            .rows
            .iter()
            .enumerate()
            .flat_map(|(k, row)| {
                row.measured.iter().enumerate().filter_map(move |(m, h)| h.map(|h| (k, m, h as usize)))
            })
            .collect();
        let carried = |from: usize, to: usize| {
            let mut map = DMatrix::<f64>::identity(n, n);
            maps[from + 1..=to].iter().for_each(|m| map = m * &map);
            map
        };
        let covariance_of = |a: usize, b: usize| {
            // Of the states at two rows.
            if a >= b { carried(b, a) * &prior[b + 1].1 } else { &prior[a + 1].1 * carried(a, b).transpose() }
        };
        let count = measured.len();
        let mut covariance = DMatrix::zeros(count, count);
        for (i, &(k, m, h)) in measured.iter().enumerate() {
            for (j, &(l, _, g)) in measured.iter().enumerate() {
                covariance[(i, j)] = (rows.row(h) * covariance_of(k, l) * rows.row(g).transpose())[(0, 0)];
            }
            covariance[(i, i)] += system.noise(m, &series.rows[k]);
        }
        let cross = DMatrix::from_columns(
            &measured.iter().map(|&(k, _, h)| covariance_of(asked, k) * rows.row(h).transpose()).collect::<Vec<_>>(),
        );
        let mut shock = DVector::zeros(n);
        shock[system.slope] = 1.0;
        let kink = measured.iter().map(|&(k, _, h)| {
            if k < asked { 0.0 } else { (rows.row(h) * carried(asked, k) * &maps[asked] * &shock)[(0, 0)] }
        });
        Joint {
            kink: DVector::from_iterator(count, kink),
            mean: DVector::from_iterator(
                count,
                measured.iter().map(|&(k, _, h)| (rows.row(h) * &prior[k + 1].0)[(0, 0)]),
            ),
            values: DVector::from_iterator(count, measured.iter().map(|&(k, m, _)| series.values[m][k])),
            covariance,
            cross,
            states: prior[asked + 1].0.clone(),
        }
    }

    fn observed(model: &CoilModel, record: &Record) -> (Series, f64) {
        (Series::new(record, model.rate_mean_s, 30.0, Origin::Measured), 294.0)
    }

    fn check(assumed: &Assumption, averaged: bool) {
        check_on(assumed, &if averaged { one_hertz() } else { record(48) }, averaged);
    }

    /// Systems that go abreast, and those in other coordinates, find what each finds by itself.
    fn abreast_is_one_by_one(parts: &Parts, numbers: &Numbers, series: &Series) {
        let moved = |quantity: Quantity, factor: f64| {
            let mut moved = *numbers;
            moved.set(quantity, factor * numbers.get(quantity));
            moved
        };
        let all =
            [moved(Quantity::RateNoise, 1.0), moved(Quantity::RipplePeriod, 0.7), moved(Quantity::TurbulenceSize, 0.0)];
        let values = filter::Values { of: series.values.clone() };
        let systems = all.each_ref().map(|numbers| system(parts, numbers, series));
        let decoupled = all.each_ref().map(|numbers| decoupled_system(parts, numbers, series));
        let entries = |system: &System| (0..system.size).map(|i| system.steps[0].phi.row(i).len()).sum::<usize>();
        assert!(entries(&decoupled[0]) < entries(&systems[0]), "{} entries", entries(&decoupled[0]));
        let alone = systems.each_ref().map(|s| filter::forward(s, &series.rows, &values, false).innovations);
        let one_by_one = decoupled.each_ref().map(|s| filter::forward(s, &series.rows, &values, false).innovations);
        let pairs = [&systems, &decoupled].map(|s| abreast::forward(s, &series.rows, &[&values; 3]));
        for (own, alone) in one_by_one.iter().chain(pairs.iter().flatten()).zip(alone.iter().cycle()) {
            assert_eq!(own.len(), alone.len());
            for (a, b) in own.iter().zip(alone) {
                let apart = (a.value - b.value).abs() / b.variance.sqrt();
                assert!(apart < 1e-8 && (a.variance / b.variance - 1.0).abs() < 1e-8, "{a:?} for {b:?}");
            }
        }
    }

    /// One beside another takes its steps over where they follow from the same, and only there.
    fn beside_another_is_by_itself(parts: &Parts, numbers: &Numbers, series: &Series) {
        let known = decoupled_system(parts, numbers, series);
        let shares = [
            (Quantity::ReadingNoise, true),
            (Quantity::BendNoise, true),
            (Quantity::TurbulenceSize, false),
            (Quantity::WanderTime, false),
            (Quantity::RipplePeriod, false),
        ];
        for (quantity, shares) in shares {
            let mut moved = *numbers;
            moved.set(quantity, 1.1 * numbers.get(quantity));
            let beside = decoupled_system_beside(&known, parts, &moved, series);
            assert_eq!(Arc::ptr_eq(&known.steps, &beside.steps), shares, "{quantity:?}");
            assert_eq!(format!("{beside:?}"), format!("{:?}", decoupled_system(parts, &moved, series)), "{quantity:?}");
        }
    }

    /// In air that bends by itself, in air that follows a set point, and in air that approaches one, at once or with a delay.
    fn check_on(assumed: &Assumption, record: &Record, averaged: bool) {
        check_in(assumed, record, averaged, |_| {});
        check_in(assumed, record, averaged, |series| series.controlled = true);
        check_in(assumed, record, averaged, |series| series.approaches = true);
        check_in(assumed, record, averaged, |series| (series.approaches, series.delays) = (true, true));
    }

    fn check_in(assumed: &Assumption, record: &Record, averaged: bool, air: impl Fn(&mut Series)) {
        let (mut series, mean_k) = observed(&assumed.model, record);
        air(&mut series);
        series.rows[9].kink = 1e-6;
        let between = 0.7 * series.times_s[14] + 0.3 * series.times_s[13];
        let series = series.with_kinks(&[Bend { time_s: between, slope_change_k_per_s: 2e-3 }]);
        assert!(series.rows[14].is_kinked_within());
        assert_eq!(series.averaged > 1, averaged);
        let numbers = Numbers::medians(&series);
        let seen = Observed::new(record, series, mean_k, Solved::default());
        let side = CoilSide::new(assumed, numbers.get(Quantity::Film), 4, &seen).unwrap();
        let system = system(&side.parts(assumed), &numbers, &seen.series);
        let values = filter::Values { of: seen.series.values.clone() };
        let trace = filter::forward(&system, &seen.series.rows, &values, true);
        let asked = seen.series.rows.len() / 2;
        let dense = joint(&system, &seen.series, asked);
        let factor = dense.covariance.clone().cholesky().unwrap();
        let apart = &dense.values - &dense.mean;
        let solved = factor.solve(&apart);
        let determinant: f64 = factor.l().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
        let exact = -0.5 * (apart.dot(&solved) + determinant + apart.len() as f64 * std::f64::consts::TAU.ln());
        println!("{} measurements, log likelihood {} and {exact}", apart.len(), trace.log_likelihood);
        assert!((trace.log_likelihood - exact).abs() < 1e-8 * exact.abs());
        beside_another_is_by_itself(&side.parts(assumed), &numbers, &seen.series);
        abreast_is_one_by_one(&side.parts(assumed), &numbers, &seen.series);
        let inverse = factor.inverse();
        let doubts = doubts(&system, &seen.series.rows, &trace);
        for (i, found) in doubts.values.iter().enumerate() {
            let exact = solved[i] / inverse[(i, i)].sqrt();
            assert!((found - exact).abs() < 1e-6 * (1.0 + exact.abs()), "measurement {i}: {found} for {exact}");
        }
        let (along, change) = (dense.kink.dot(&solved), (dense.kink.transpose() * &inverse * &dense.kink)[(0, 0)]);
        let (found, exact) = (doubts.kinks[asked], (along / change.sqrt(), along / change));
        assert!((found.0 - exact.0).abs() < 1e-5 * (1.0 + exact.0.abs()), "kink: {found:?} for {exact:?}");
        assert!((found.1 - exact.1).abs() < 1e-5 * exact.1.abs(), "kink: {found:?} for {exact:?}");
        let states = &dense.states + &dense.cross * solved;
        let smoothed = filter::smooth(&system, &seen.series.rows, &trace);
        for (i, exact) in states.iter().enumerate() {
            let found = smoothed[asked * system.size + i];
            let scale = exact.abs().max(dense.cross.row(i).norm());
            assert!((found - exact).abs() < 1e-6 * scale.max(1e-12), "state {i}: {found} for {exact}");
        }
    }

    /// Ten rows become one, with two of them missing.
    fn one_hertz() -> Record {
        let times_s: Vec<f64> = (0..400).filter(|i| ![77, 231].contains(i)).map(f64::from).collect();
        let temperature_k = times_s.iter().map(|t| 293.0 + 1e-2 * t + 2e-3 * (3.0 * t).sin()).collect();
        let rate = times_s.iter().map(|t| 1e-6 * (0.02 * t).sin() + 3e-7 * (5.0 * t).cos()).collect();
        Record::new("fast", times_s, temperature_k, rate).unwrap()
    }

    pub(in crate::chamber) fn dip() -> crate::pattern::Pattern {
        Classic::Dip.pattern(8).unwrap()
    }

    #[test]
    fn likelihood_and_smoothed_states_are_those_of_the_dense_gaussian() {
        check(&Assumption::new(model(Vec::new()), dip()), false);
    }

    #[test]
    fn with_a_lag_a_spool_a_drift_and_a_cycle_they_are_too() {
        let effects = vec![effect("sensor_lag", &[40.0]), effect("spool_mass", &[4000.0, 300.0, 5.0])];
        let assumed = Assumption { drift: true, cycle: true, ..Assumption::new(model(effects), dip()) };
        check(&assumed, false);
    }

    #[test]
    fn what_a_model_is_linearised_about_hangs_on_no_rate() {
        let own = record(48);
        let turned: Vec<f64> = own.rate_rad_per_s().iter().map(|rate| 3e-7 - 2.0 * rate).collect();
        let (times_s, temperature_k) = (own.times_s().to_vec(), own.temperature_k().to_vec());
        let other = Record::new("turned", times_s, temperature_k, turned).unwrap();
        let effects = vec![effect("thermo_optic_temperature", &[0.004]), effect("heating_cooling_asymmetry", &[0.1])];
        let assumed = Assumption::new(model(effects), dip());
        let known = |record: &Record| {
            let (series, mean_k) = observed(&assumed.model, record);
            let numbers = Numbers::medians(&series);
            let seen = Observed::new(record, series, mean_k, Solved::default());
            let side = CoilSide::new(&assumed, numbers.get(Quantity::Film), 4, &seen).unwrap();
            assert!(side.needs_reference());
            let course = smoothed(&side, &assumed, &numbers, &seen, 0, None).unwrap();
            let left = side.values(&assumed, &seen, 0, Some(&course)).unwrap();
            let rates = seen.series.values[filter::RATE].iter().zip(&left.of[filter::RATE]);
            rates.map(|(rate, left)| rate - left).collect::<Vec<f64>>()
        };
        let (own, other) = (known(&own), known(&other));
        let most = own.iter().copied().filter(|v| v.is_finite()).map(f64::abs).fold(0.0, f64::max);
        assert!(most > 1e-9, "{most}");
        for (a, b) in own.iter().zip(&other).filter(|(a, b)| a.is_finite() && b.is_finite()) {
            assert!((a - b).abs() < 1e-6 * most, "{a} and {b} of {most}");
        }
    }

    #[test]
    fn averaged_rows_of_a_sensor_in_the_air_and_of_a_half_space_are_too() {
        let mut fast = model(vec![effect("surface_film", &[30.0])]);
        fast.rate_mean_s = 1.0;
        check(&Assumption::new(fast, dip()), true);
        let mut half_space = model(Vec::new());
        half_space.extent = Extent::HalfSpace;
        half_space.rate_mean_s = 0.0;
        check(&Assumption::new(half_space, dip()), false);
    }

    #[test]
    fn windows_that_begin_before_the_row_before_are_too() {
        let even = record(48);
        let times_s: Vec<f64> = (0..48).map(|i| 10.0 * f64::from(i) + 2.9 * (1.7 * f64::from(i * i)).sin()).collect();
        let uneven =
            Record::new("uneven", times_s, even.temperature_k().to_vec(), even.rate_rad_per_s().to_vec()).unwrap();
        let series = Series::new(&uneven, 10.0, 30.0, Origin::Measured);
        // A mean over ten seconds is one, however soon the next row comes.
        assert!(series.overlaps && series.shapes.iter().any(|s| s.window_s == 10.0 && s.slot == 1));
        check_on(&Assumption::new(model(Vec::new()), dip()), &uneven, false);
    }

    #[test]
    fn on_a_steep_signal_with_spikes_nothing_else_is_left_out() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut noise = |size: f64| size * (0..12).map(|_| random.random::<f64>() - 0.5).sum::<f64>();
        let times_s: Vec<f64> = (0..400).map(|i| 10.0 * f64::from(i)).collect();
        let steep = |t: f64| (t / 90.0).sin();
        let temperature_k = times_s.iter().map(|t| 293.0 + 0.05 * steep(*t) + noise(0.004)).collect();
        let mut rate: Vec<f64> = times_s.iter().map(|t| 4e-6 * steep(*t) + noise(1e-7)).collect();
        let spikes = [61, 140, 233, 322];
        spikes.iter().for_each(|&k| rate[k] += 1.5e-6);
        let record = Record::new("steep", times_s, temperature_k, rate).unwrap();
        assert!(record.gross_errors().is_empty(), "what neighbours say is not enough here");
        let model = model(Vec::new());
        let course = record.times_s().iter().map(|t| steep(*t)).collect();
        let input = Input {
            name: "sine".into(),
            rate_rad_per_s: vec![course],
            amplitude: 3e-6,
            deviation: 1e-5,
            follows: Vec::new(),
        };
        let assumed = Assumption { inputs: vec![input], ..Assumption::new(model.clone(), dip()) };
        let (chamber, _) = Chamber::new(&model, &[&record]).unwrap().with_shocks(&assumed, &[0]).unwrap();
        assert!(chamber.spikes(0) <= spikes.len() + 1, "{}", chamber.spikes(0));
    }

    #[test]
    fn gains_that_are_frozen_cost_less_than_a_fifth_of_log_likelihood() {
        let record = record(1500);
        let assumed = Assumption::new(model(Vec::new()), dip());
        let (series, mean_k) = observed(&assumed.model, &record);
        let numbers = Numbers::medians(&series);
        let mut seen = Observed::new(&record, series, mean_k, Solved::default());
        let side = CoilSide::new(&assumed, 25.0, 5, &seen).unwrap();
        let values = filter::Values { of: seen.series.values.clone() };
        let system = system(&side.parts(&assumed), &numbers, &seen.series);
        let frozen = filter::forward(&system, &seen.series.rows, &values, false);
        // Rows that differ by what makes no difference never freeze.
        for (k, row) in seen.series.rows.iter_mut().enumerate() {
            row.averaged = 1.0 + 1e-15 * (k % 2) as f64;
        }
        let full = filter::forward(&system, &seen.series.rows, &values, false);
        println!("{} of 1500 rows in full; {} and {}", frozen.thawed, frozen.log_likelihood, full.log_likelihood);
        assert!(full.thawed == 1500);
        assert!((frozen.log_likelihood - full.log_likelihood).abs() < 0.2);
    }

    #[test]
    fn score_and_information_are_those_of_differences() {
        let record = record(300);
        let model = model(vec![effect("strain_mismatch", &[0.004])]);
        let chamber = Chamber::new(&model, &[&record]).unwrap();
        let step = (0..300).map(|k| f64::from(k > 150)).collect();
        let input = Input {
            name: "step".into(),
            rate_rad_per_s: vec![step],
            amplitude: 1e-7,
            deviation: 1e-6,
            follows: Vec::new(),
        };
        let assumed = Assumption { inputs: vec![input], ..Assumption::new(model, dip()) };
        let free = [Free { effect: 0, parameter: 0, stated: None, deviation: None }];
        let fit = chamber.fit(&assumed, &free, &[0], None, Effort::NONE).unwrap();
        let point = chamber.model_point(fit.assumed.clone(), fit.numbers.clone(), &[0], &fit.courses).unwrap();
        let base = vec![chamber.innovations(&point, 0).unwrap()];
        let found = chamber.derivatives(&point, &fit.parameters, &fit.coordinates, &[0], &base).unwrap();
        let count = fit.parameters.len();
        let (mut score, mut information) = (DVector::zeros(count), DMatrix::zeros(count, count));
        found[0].add_to(&base[0], &mut score, &mut information);
        for (i, parameter) in fit.parameters.iter().enumerate() {
            let at = |sign: f64| {
                let (mut assumed, mut numbers) = (fit.assumed.clone(), fit.numbers.clone());
                let moved = fit.coordinates[i] + 0.3 * sign * parameter.step();
                assert!(crate::chamber::parameter::write(&[*parameter], &[moved], &mut assumed, &mut numbers));
                let there = chamber.model_point(assumed, numbers, &[0], &fit.courses).unwrap();
                crate::chamber::model_point::log_likelihood(&chamber.innovations(&there, 0).unwrap())
            };
            let slope = (at(1.0) - at(-1.0)) / (0.6 * parameter.step());
            // One-sided differences of the innovations: off by half a step's worth of curvature.
            let allowed = 0.01 * slope.abs() + 2.0 * information[(i, i)] * parameter.step() + 1e-3;
            println!("{:?}: {:.5e} for {slope:.5e}", parameter.place, score[i]);
            assert!((score[i] - slope).abs() < allowed, "{:?}", parameter.place);
            assert!(information[(i, i)] > 0.0);
        }
    }
}
