//! The check on a finer grid, and what bounds and many moves at once make of a search.

use super::*;
use crate::coil::LayerLength;
use crate::search::aside::{GridChecked, Resolution};
use crate::search::cost::samples::tests::{model, profiles};
use crate::search::cost::tolerance::with_middle_moved;

#[test]
fn a_search_is_checked_on_a_grid_twice_as_fine_and_cautioned_where_that_changes_much() {
    let declared = CoilModel { cells_per_layer: 1, ..model(8, LayerLength::Actual, &[]) };
    let profiles = profiles();
    let spec = ProfileSpec {
        max_rate_k_per_s: 0.003,
        count: 0,
        segments: 1,
        duration_s: 1.0,
        seed: 1,
        listed: profiles.clone(),
    };
    let solved = SolvedProfiles::new(&declared, &profiles).unwrap();
    let objective = Objective::WorstRate;
    let evaluator =
        Evaluator { model: &declared, solved: &solved, objective, unit_step: None, profiles: &spec, tolerance: None };
    let baselines = evaluator.baselines().unwrap();
    let of = |name: &str| baselines.iter().find(|b| b.name == name).unwrap();
    let check = evaluator.grid_check(of("dip"), &baselines).unwrap().unwrap();
    assert_eq!((check.cells_per_layer, check.finer_cells_per_layer), (1, 2));
    let finer = CoilModel { cells_per_layer: 2, ..declared.clone() };
    let finer_solved = SolvedProfiles::new(&finer, &profiles).unwrap();
    for (checked, name) in check.patterns.iter().zip(["dip", "qua"]) {
        let expected = finer_solved.worst_case(&finer, &of(name).pattern).unwrap().rate_rad_per_s.abs();
        assert_eq!((checked.name.as_str(), checked.finer_rad_per_s), (name, expected));
        assert_eq!(checked.rate_rad_per_s, of(name).worst.rate_rad_per_s.abs());
    }
    assert_eq!(check.patterns.len(), 2);
    let cautioned = |change: f64| {
        let finer_rad_per_s = 1.0 + change;
        let best = GridChecked { name: "searched-8".into(), rate_rad_per_s: 1.0, finer_rad_per_s };
        GridCheck { patterns: vec![best], ..check.clone() }.caution().is_some()
    };
    assert_eq!([-0.006, -0.004, 0.004, 0.006].map(cautioned), [true, false, false, true]);

    let half_space = CoilModel { extent: Extent::HalfSpace, ..declared.clone() };
    let evaluator = Evaluator { model: &half_space, ..evaluator };
    assert_eq!(evaluator.grid_check(of("dip"), &baselines).unwrap(), None);
}

#[test]
fn a_search_for_a_small_pointing_error_is_checked_by_it_on_the_finer_grid() {
    let declared = CoilModel { cells_per_layer: 1, ..model(8, LayerLength::Actual, &["surface_film"]) };
    let profiles = profiles();
    let spec = ProfileSpec { listed: profiles.clone(), count: 0, ..ProfileSpec::default() };
    let solved = SolvedProfiles::new(&declared, &profiles).unwrap();
    let objective = Objective::Pointing;
    let evaluator =
        Evaluator { model: &declared, solved: &solved, objective, unit_step: None, profiles: &spec, tolerance: None };
    let baselines = evaluator.baselines().unwrap();
    let dip = baselines.iter().find(|b| b.name == "dip").unwrap();
    let check = evaluator.grid_check(dip, &baselines).unwrap().unwrap();
    let finer = CoilModel { cells_per_layer: 2, ..declared.clone() };
    let finer_solved = SolvedProfiles::new(&finer, &profiles).unwrap();
    assert_eq!(check.patterns.len(), 2);
    for checked in &check.patterns {
        let judged = baselines.iter().find(|b| b.name == checked.name).unwrap();
        let expected = pointing_as_rate(&finer, &finer_solved, &judged.pattern).unwrap().rate_rad_per_s.abs();
        assert_eq!((checked.rate_rad_per_s, checked.finer_rad_per_s), (judged.objective_rad_per_s, expected));
        // It is another figure than the worst rate.
        assert!((checked.rate_rad_per_s / judged.worst.rate_rad_per_s.abs() - 1.0).abs() > 0.1);
    }
    let best = GridChecked { name: "x".into(), rate_rad_per_s: 1.0, finer_rad_per_s: 1.01 };
    let words = GridCheck { patterns: vec![best], ..check }.caution().unwrap();
    assert!(words.contains("its worst pointing error is") && words.contains(" °, 1.0 % more"), "{words}");
}

#[test]
fn what_tells_pointing_errors_apart_is_the_middle_of_the_fibre_off_by_its_diameter_as_the_lag_of_the_pack_gives_it() {
    let model = model(8, LayerLength::Equal, &["surface_film"]);
    let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
    let pattern = Classic::Qua.pattern(8).unwrap();
    let found = Resolution::of(Objective::Pointing, &model, &solved, &pattern).unwrap();
    let fibre = model.coil.fibre();
    // ψ = n κ 2δ/D · (change of the lead − mean change of the layers), all layers of one length.
    let lag_k = |history: &crate::thermal::ThermalHistory, row: usize| {
        let mean = |row: usize| history.temperatures_k(row).iter().sum::<f64>() / 8.0;
        (history.ambient_k[row] - history.ambient_k[0]) - (mean(row) - mean(0))
    };
    let largest_k = solved.profiles().iter().flat_map(|p| (0..p.history.len()).map(|row| lag_k(&p.history, row).abs()));
    let largest_k = largest_k.fold(0.0, f64::max);
    let expected = fibre.refractive_index * fibre.path_per_k() * 2.0 * fibre.outer_diameter_m
        / model.coil.mean_diameter_m()
        * largest_k;
    assert!(expected > 0.0 && found.offset_m == 165e-6);
    assert!(
        (found.change_rad_per_s * POINTING_S / expected - 1.0).abs() < 1e-9,
        "{} {expected}",
        found.change_rad_per_s
    );
}

#[test]
fn no_objective_of_a_rate_changes_by_more_than_its_resolution_if_the_middle_is_off_by_the_fibre_s_diameter() {
    let model = model(8, LayerLength::Actual, &["surface_film"]);
    let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
    for classic in [Classic::Qua, Classic::Zyl] {
        let pattern = classic.pattern(8).unwrap();
        for objective in [Objective::WorstRate, Objective::RootMeanSquare] {
            let found = Resolution::of(objective, &model, &solved, &pattern).unwrap();
            for by_m in [found.offset_m, -found.offset_m] {
                let value = |model: &CoilModel| {
                    let rate_model = RateModel::new(model, &pattern, &[]).unwrap();
                    match objective {
                        Objective::WorstRate => solved.worst_case(model, &pattern).unwrap().rate_rad_per_s.abs(),
                        _ => crate::search::cost::objective::rms_rad_per_s(&rate_model, &solved),
                    }
                };
                let change = (value(&with_middle_moved(&model, by_m)) - value(&model)).abs();
                assert!(change <= found.change_rad_per_s * (1.0 + 1e-9), "{classic:?} {objective:?}");
                assert!(change > 1e-3 * found.change_rad_per_s, "{classic:?} {objective:?}: {change}");
            }
        }
    }
}
