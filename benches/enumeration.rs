//! Every winding of the class `standard`, one after the other, against the proof and the search.
//!
//! `cargo bench --bench enumeration -- MODEL…`. All 2^(N−1) patterns are gone through in the order of a Gray code, so that each
//! differs from the one before by one end; no symmetry is made use of. Each is judged on all samples, nothing left out. From
//! time to time the values are compared with the reference's and computed anew. Then patterns are refined in time, the
//! smallest sampled worst rate first, until no other can be below the smallest refined one.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use coilwright::io::read::model_file::read_model;
use coilwright::pattern::Pattern;
use coilwright::pattern::windability::WindabilityClass;
use coilwright::search::anneal::rounds::{Optimisation, Plan, Rounds, Rules, default_moves_per_restart};
use coilwright::search::anneal::sample_cost::SampleCost;
use coilwright::search::cost::columns::{Columns, Norm};
use coilwright::search::cost::samples::SampleMatrix;
use coilwright::search::cost::signs::{segments_of_signs, sign_columns};
use coilwright::search::cost::worst_case::SolvedProfiles;
use coilwright::search::proof::{Goal, Task, prove, starting_patterns};
use coilwright::units::deg_per_h_from_rad_per_s;

/// Patterns between two comparisons with the reference.
const STRETCH: u64 = 1 << 12;

/// Sampled worst rates that are kept for refinement.
const KEPT: usize = 4096;

fn main() {
    for path in std::env::args().skip(1).filter(|a| !a.starts_with("--")) {
        compare(Path::new(&path));
    }
}

fn compare(path: &Path) {
    let file = read_model(path).expect("the model can be read");
    let (model, class) = (&file.model, WindabilityClass::Standard);
    let layers = model.coil.layers();
    let solved = SolvedProfiles::new(model, &file.profiles.profiles()).expect("the profiles can be solved");
    let (matrix, _) = SampleMatrix::of_profiles(model, &solved).expect("the samples are finite");
    let columns = sign_columns(&matrix).expect("the error is linear in the ends");

    let started = Instant::now();
    let mut high = vec![false; layers - 1];
    let mut values = from_nothing(&columns, &high);
    let mut smallest: Vec<(f64, Vec<bool>)> = Vec::new();
    let count = 1u64 << (layers - 1);
    for index in 0..count {
        if index > 0 {
            let end = index.trailing_zeros() as usize;
            high[end] = !high[end];
            let by = if high[end] { 2.0 } else { -2.0 };
            for (v, d) in values.iter_mut().zip(columns.column(end)) {
                *v += by * d;
            }
        }
        if index % STRETCH == STRETCH - 1 {
            values = checked(model, &matrix, &columns, &high, &values);
        }
        let worst = largest(&values);
        if smallest.len() < KEPT || worst < smallest[KEPT - 1].0 {
            let at = smallest.partition_point(|(cost, _)| *cost <= worst);
            smallest.insert(at, (worst, high.clone()));
            smallest.truncate(KEPT);
        }
    }
    let mut best = (f64::INFINITY, Vec::new());
    let mut refined = 0;
    for (sampled, high) in &smallest {
        if *sampled >= best.0 {
            break;
        }
        let pattern = Pattern::new(segments_of_signs(high)).expect("ends make a permutation");
        let worst = solved.worst_case(model, &pattern).expect("the pattern fits").rate_rad_per_s.abs();
        refined += 1;
        if worst < best.0 {
            best = (worst, pattern.segments().to_vec());
        }
    }
    assert!(refined < KEPT, "more patterns must be kept");
    println!(
        "{} {layers} layers: {count} patterns at {} samples, {refined} refined, {:.1} s: {:.9} deg/h",
        model.name,
        matrix.samples(),
        started.elapsed().as_secs_f64(),
        deg_per_h_from_rad_per_s(best.0)
    );
    println!("  smallest sampled {:.9} deg/h, pattern {:?}", deg_per_h_from_rad_per_s(smallest[0].0), best.1);

    let started = Instant::now();
    let task = Task { model, solved: &solved, class, goal: Goal::WorstRate };
    let starts = starting_patterns(&task, file.search.seed).expect("the search can begin");
    let proof = prove(&task, &starts, &|_| ControlFlow::Continue(())).expect("the proof can begin");
    println!(
        "  exact: {}, {:.9} deg/h, {} nodes, {} judged, {:.3} s; over the enumerated {:+.1e}",
        proof.status,
        deg_per_h_from_rad_per_s(proof.best_rad_per_s),
        proof.nodes,
        proof.judged,
        started.elapsed().as_secs_f64(),
        proof.best_rad_per_s / best.0 - 1.0
    );

    let found = (1..=20).filter(|&seed| {
        let rules = Rules { rounds: u64::MAX, patience: 6, moves: None, target: None };
        let moves_per_restart = default_moves_per_restart(layers);
        let plan = Plan { seed, restarts_per_round: 8, moves_per_restart, rules, starts: Vec::new() };
        let mut search = Optimisation::new(SampleCost::new(matrix.clone(), class, Norm::Largest), plan);
        while search.advance() {}
        search.best().is_some_and(|found| found.cost <= smallest[0].0 * (1.0 + 1e-9))
    });
    println!("  annealing: {} of 20 seeds end on the smallest sampled worst rate", found.count());
}

fn from_nothing(columns: &Columns, high: &[bool]) -> Vec<f64> {
    let signs: Vec<f64> = high.iter().map(|h| if *h { 1.0 } else { -1.0 }).collect();
    columns.values(&signs)
}

/// The values computed anew, having been compared with the reference's.
fn checked(
    model: &coilwright::rate::CoilModel,
    matrix: &SampleMatrix,
    columns: &Columns,
    high: &[bool],
    values: &[f64],
) -> Vec<f64> {
    let pattern = Pattern::new(segments_of_signs(high)).expect("ends make a permutation");
    let expected = matrix.rates_rad_per_s(model, &pattern).expect("the pattern fits");
    let scale = largest(&expected);
    assert!(values.iter().zip(&expected).all(|(v, e)| (v - e).abs() < 1e-10 * scale), "{pattern:?}");
    from_nothing(columns, high)
}

fn largest(values: &[f64]) -> f64 {
    let mut lanes = [0.0_f64; 8];
    let chunks = values.chunks_exact(8);
    let rest = chunks.remainder().iter().map(|v| v.abs()).fold(0.0, f64::max);
    for chunk in chunks {
        for (lane, v) in lanes.iter_mut().zip(chunk) {
            let size = v.abs();
            *lane = if size > *lane { size } else { *lane };
        }
    }
    lanes.into_iter().fold(rest, f64::max)
}
