//! Searches in rounds: what they find, how much they work, and when they end.

use super::*;
use crate::coil::LayerLength;
use crate::pattern::windability::WindabilityClass;
use crate::search::anneal::sample_cost::SampleCost;
use crate::search::cost::columns::Norm;
use crate::search::cost::samples::SampleMatrix;
use crate::search::cost::samples::tests::{model, profiles};
use crate::search::cost::signs::{segments_of_signs, sign_columns, sign_value};
use crate::search::cost::worst_case::SolvedProfiles;

fn plan(seed: u64) -> Plan {
    let rules = Rules { rounds: 8, patience: 2, moves: None, target: None };
    Plan { seed, restarts_per_round: 4, moves_per_restart: 4000, rules, starts: vec![] }
}

#[test]
fn up_to_fourteen_layers_the_search_finds_the_smallest_of_all_standard_patterns() {
    for layers in [2, 4, 6, 8, 10, 12, 14] {
        let model = model(layers, LayerLength::Actual, &[]);
        let solved = SolvedProfiles::new(&model, &profiles()[..1]).unwrap();
        let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
        let columns = sign_columns(&matrix).unwrap();
        for norm in [Norm::Largest, Norm::RootMeanSquare] {
            let smallest = (0..1u32 << (layers - 2))
                .map(|bits| {
                    let high: Vec<f64> = (0..layers - 1).map(|m| sign_value(bits >> m & 1 == 1)).collect();
                    norm.of(&columns.values(&high))
                })
                .fold(f64::INFINITY, f64::min);
            let mut search =
                Optimisation::new(SampleCost::new(matrix.clone(), WindabilityClass::Standard, norm), plan(3));
            while search.advance() {}
            let found = search.best().unwrap();
            assert!((found.cost / smallest - 1.0).abs() < 1e-9, "{layers} layers, {norm:?}");
        }
    }
}

#[test]
fn the_work_of_a_search_is_counted_and_is_that_of_its_plan() {
    let model = model(8, LayerLength::Equal, &[]);
    let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
    let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
    let mut plan = plan(1);
    plan.rules = Rules { rounds: 2, patience: 9, moves: None, target: None };
    let mut search = Optimisation::new(SampleCost::new(matrix, WindabilityClass::Any, Norm::Largest), plan);
    while search.advance() {}
    assert_eq!(search.evaluations(), 2 * 4 * 4000);
    assert_eq!(search.state().stop, Some(Stop::Rounds));
    let samples_a_move = search.state().work.samples as f64 / search.evaluations() as f64;
    assert!(samples_a_move < 200.0, "{samples_a_move}");
}

#[test]
fn a_round_ends_with_the_slice_in_which_a_restart_reaches_the_target() {
    let model = model(8, LayerLength::Equal, &[]);
    let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
    let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
    let search = |target: Option<f64>| {
        let mut plan = plan(1);
        plan.moves_per_restart = 4 * SampleCost::PACE.slice_moves;
        plan.rules = Rules { rounds: 1, patience: 9, moves: None, target };
        let mut search = Optimisation::new(SampleCost::new(matrix.clone(), WindabilityClass::Any, Norm::Largest), plan);
        while search.advance() {}
        search
    };
    let best_cost = search(None).best().unwrap().cost;
    let reached = search(Some(3.0 * best_cost));
    assert_eq!(reached.state().stop, Some(Stop::Target));
    assert_eq!(reached.evaluations(), 4 * SampleCost::PACE.slice_moves);
    assert!(reached.best().unwrap().cost <= 3.0 * best_cost);
    assert_eq!(reached.state().first_with_best().unwrap().evaluations, reached.evaluations());
    assert_eq!(search(Some(0.5 * best_cost)).state().stop, Some(Stop::Rounds));
}

#[test]
fn a_search_never_ends_worse_than_where_it_began() {
    let model = model(8, LayerLength::Equal, &[]);
    let solved = SolvedProfiles::new(&model, &profiles()).unwrap();
    let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).unwrap();
    let start = segments_of_signs(&[true, false, false, true, true, false, true]);
    let sampled = SampleCost::new(matrix.clone(), WindabilityClass::Standard, Norm::Largest);
    let cost = sampled.in_full(&start, &[]).cost;
    let mut plan = plan(1);
    plan.starts = vec![start];
    plan.moves_per_restart = 1;
    plan.restarts_per_round = 1;
    let mut search = Optimisation::new(sampled, plan);
    while search.advance() {}
    assert!(search.best().unwrap().cost <= cost);
}
