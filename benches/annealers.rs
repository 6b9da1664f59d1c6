//! Moves a second of the annealer against argmin's, on the same objective, samples, temperatures and machine.
//!
//! `cargo bench --bench annealers -- [--export FILE] [--moves N]`. The instance is the paper's coil with 24 layers and
//! 8192 samples of 85 profiles; `--export` writes it for `benches/peers/annealer_simanneal.py`. Every annealer makes swaps of two
//! layers and cools geometrically between the same temperatures; the cost is the largest |Ω| over all samples.

use std::cell::RefCell;
use std::io::Write;
use std::time::Instant;

use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::simulatedannealing::{Anneal, SATempFunc, SimulatedAnnealing};
use coilwright::coil::{Coil, CoilSpec, Fibre, LayerLength};
use coilwright::pattern::windability::WindabilityClass;
use coilwright::profile::ProfileSpec;
use coilwright::rate::CoilModel;
use coilwright::search::anneal::restart::{Restart, cooling_for, generator};
use coilwright::search::anneal::rounds::{Optimisation, Plan, Rounds, Rules};
use coilwright::search::anneal::sample_cost::SampleCost;
use coilwright::search::anneal::walk::Space;
use coilwright::search::cost::columns::{Norm, Work};
use coilwright::search::cost::samples::SampleMatrix;
use coilwright::search::cost::worst_case::SolvedProfiles;
use coilwright::thermal::{DEFAULT_CELLS_PER_LAYER, Extent, Location, PackMaterial};
use coilwright::units::{deg_per_h_from_rad_per_s, k_per_s_from_c_per_h, percent_from_fraction};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

const LAYERS: usize = 24;
const SAMPLES: usize = 8192;
const PROFILES: usize = 85;
const SEED: u64 = 1;

fn instance() -> SampleMatrix {
    let fibre = Fibre {
        refractive_index: 1.447,
        thermo_optic_per_k: 1.35e-5,
        group_index: None,
        thermal_expansion_per_k: 0.0,
        wavelength_m: 1300e-9,
        outer_diameter_m: 250e-6,
    };
    let spec = CoilSpec {
        fibre,
        layers: LAYERS,
        turns_per_layer: None,
        bore_radius_m: 0.036,
        radial_pitch_m: 250e-6,
        axial_pitch_m: 250e-6,
        layer_length: LayerLength::Equal,
        length_m: Some(400.0),
    };
    let model = CoilModel {
        name: "paper, 24 layers".into(),
        coil: Coil::new(spec).expect("the coil is sound"),
        extent: Extent::HalfSpace,
        material: PackMaterial::Diffusivity { m2_per_s: 2.7e-7 },
        location: Location::OuterLayer,
        rate_mean_s: 0.0,
        cells_per_layer: DEFAULT_CELLS_PER_LAYER,
        effects: vec![],
    };
    let profiles = ProfileSpec {
        max_rate_k_per_s: k_per_s_from_c_per_h(10.0),
        count: PROFILES,
        segments: 4,
        duration_s: 6000.0,
        seed: SEED,
        listed: vec![],
    };
    let solved = SolvedProfiles::new(&model, &profiles.profiles()).expect("a half space can be solved");
    let (matrix, _) = SampleMatrix::of_profiles(&model, &solved).expect("the samples are finite");
    // Evenly spread over the whole grid.
    let kept: Vec<usize> = (0..SAMPLES).map(|i| i * matrix.samples() / SAMPLES).collect();
    matrix.select(&kept)
}

/// The response of each layer to a weight of one half-segment, so that weights are the odd numbers 2P − 1 − N.
fn responses(matrix: &SampleMatrix) -> Vec<Vec<f64>> {
    let square_m2 = matrix.lengths_m()[0].powi(2);
    (0..LAYERS).map(|j| matrix.columns.column(j).iter().map(|a| a * square_m2).collect()).collect()
}

fn weight(segment: usize) -> f64 {
    (2 * segment) as f64 - 1.0 - LAYERS as f64
}

/// The cost from nothing, in the form that a user of a general annealer would write.
fn full_cost(responses: &[Vec<f64>], segments: &[usize], values: &mut Vec<f64>) -> f64 {
    values.clear();
    values.resize(SAMPLES, 0.0);
    for (column, &segment) in responses.iter().zip(segments) {
        let weight = weight(segment);
        for (v, a) in values.iter_mut().zip(column) {
            *v += weight * a;
        }
    }
    let mut lanes = [0.0_f64; 8];
    for chunk in values.chunks_exact(8) {
        for (lane, v) in lanes.iter_mut().zip(chunk) {
            *lane = lane.max(v.abs());
        }
    }
    lanes.into_iter().fold(0.0, f64::max)
}

fn swap(segments: &mut [usize], random: &mut ChaCha8Rng) {
    let mut pick = |count: usize| (random.next_u32() as usize * count) >> 32;
    let (from, other) = (pick(LAYERS), pick(LAYERS - 1));
    segments.swap(from, if other >= from { other + 1 } else { other });
}

struct Argmin {
    responses: Vec<Vec<f64>>,
    values: RefCell<Vec<f64>>,
    random: RefCell<ChaCha8Rng>,
}

impl CostFunction for Argmin {
    type Param = Vec<usize>;
    type Output = f64;

    fn cost(&self, segments: &Vec<usize>) -> Result<f64, Error> {
        Ok(full_cost(&self.responses, segments, &mut self.values.borrow_mut()))
    }
}

impl Anneal for Argmin {
    type Param = Vec<usize>;
    type Output = Vec<usize>;
    type Float = f64;

    fn anneal(&self, segments: &Vec<usize>, _temperature: f64) -> Result<Vec<usize>, Error> {
        let mut next = segments.clone();
        swap(&mut next, &mut self.random.borrow_mut());
        Ok(next)
    }
}

/// Processor time of this process: the machine may be busy with other things. Wall time where there is no /proc.
fn processor_s() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let wall_s = START.get_or_init(Instant::now).elapsed().as_secs_f64();
    let Ok(stat) = std::fs::read_to_string("/proc/self/schedstat") else { return wall_s };
    let nanoseconds = stat.split_whitespace().next().and_then(|n| n.parse::<u64>().ok());
    nanoseconds.map_or(wall_s, |n| std::time::Duration::from_nanos(n).as_secs_f64())
}

fn say(name: &str, moves: u64, seconds: f64, best_rad_per_s: f64) {
    println!(
        "{name:<34} {moves:>10} moves {seconds:>8.3} s {:>12.0} moves/s  best {:.5} deg/h",
        moves as f64 / seconds,
        deg_per_h_from_rad_per_s(best_rad_per_s)
    );
}

fn main() {
    // One thread, as the peers have: this one, whose processor time is measured.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global().expect("no pool has been used yet");
    let arguments: Vec<String> = std::env::args().collect();
    let after = |flag: &str| arguments.iter().position(|a| a == flag).and_then(|i| arguments.get(i + 1));
    let moves: u64 = after("--moves").and_then(|m| m.parse().ok()).unwrap_or(2_000_000);
    let matrix = instance();
    let responses = responses(&matrix);
    let cost = SampleCost::new(matrix.clone(), WindabilityClass::Any, Norm::Largest);
    let space = Space::new(matrix, WindabilityClass::Any);
    let cooling = cooling_for(&cost, SEED, moves);
    println!("{LAYERS} layers, {} samples, class any, seed {SEED}", space.matrix().samples());
    if let Some(path) = after("--export") {
        let mut bytes = Vec::new();
        for number in [LAYERS as f64, SAMPLES as f64, cooling.hot, cooling.cold] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(responses.iter().flatten().flat_map(|v| v.to_le_bytes()));
        std::fs::File::create(path).and_then(|mut f| f.write_all(&bytes)).expect("the export can be written");
    }

    say_limits();
    let (rate_as_shipped, best) = as_shipped(&space, moves);
    say("coilwright as shipped, one thread", moves, moves as f64 / rate_as_shipped, best);

    let mut restart = Restart::new(&cost, SEED, 0, None);
    let started = processor_s();
    while !restart.is_done(&cooling) {
        restart.advance(&cost, &cooling);
    }
    let seconds = processor_s() - started;
    say("coilwright, every sample judged", moves, seconds, restart.best_cost);
    say_work(restart.work, seconds);

    let recomputed_moves = moves / 100;
    let mut random = generator(SEED, 77);
    let mut segments = space.draw(&mut random);
    let mut values = Vec::new();
    let mut smallest = f64::INFINITY;
    let started = processor_s();
    for _ in 0..recomputed_moves {
        swap(&mut segments, &mut random);
        smallest = smallest.min(full_cost(&responses, &segments, &mut values));
    }
    say("coilwright, every sample recomputed", recomputed_moves, processor_s() - started, smallest);

    let argmin_moves = moves / 100;
    let start = space.draw(&mut generator(SEED, 1));
    let factor = (cooling.cold / cooling.hot).powf(1.0 / argmin_moves as f64);
    let problem = Argmin { responses, values: RefCell::new(Vec::new()), random: RefCell::new(generator(SEED, 78)) };
    let solver = SimulatedAnnealing::new(cooling.hot)
        .expect("the temperature is positive")
        .with_temp_func(SATempFunc::Exponential(factor));
    let started = processor_s();
    let result = Executor::new(problem, solver)
        .configure(|state| state.param(start).max_iters(argmin_moves))
        .run()
        .expect("the cost is always defined");
    say("argmin 0.11", argmin_moves, processor_s() - started, result.state.best_cost);

    // The same time for both: what is found in it.
    let equal_moves = (rate_as_shipped * (processor_s() - started)) as u64;
    let (rate, best) = as_shipped(&space, equal_moves);
    say("coilwright, in argmin's time", equal_moves, equal_moves as f64 / rate, best);
}

/// Rounds of restarts on a working set of samples, what they find judged on all samples; moves a second and the best.
fn as_shipped(space: &Space, moves: u64) -> (f64, f64) {
    const ROUNDS: u64 = 4;
    const RESTARTS: usize = 4;
    let plan = Plan {
        seed: SEED,
        restarts_per_round: RESTARTS,
        moves_per_restart: moves / ROUNDS / RESTARTS as u64,
        rules: Rules { rounds: ROUNDS, patience: ROUNDS, moves: None, target: None },
        starts: vec![],
    };
    let started = processor_s();
    let mut search = Optimisation::new(SampleCost::new(space.matrix().clone(), space.class(), Norm::Largest), plan);
    while search.advance() {}
    let seconds = processor_s() - started;
    say_work(search.state().work, seconds);
    let best = search.best().expect("rounds have ended").cost;
    (search.evaluations() as f64 / seconds, best)
}

/// What this machine can do of the arithmetic of a two-column move, as this program is compiled: over one block, which is in
/// the first-level cache as the samples of a refused move are; over all columns and samples in turn; and without memory.
fn say_limits() {
    const BLOCK: usize = 64;
    let stream = |samples: usize, columns: usize| {
        let column = |k: usize| (0..samples).map(|s| ((s + k) as f64 * 0.37).sin()).collect::<Vec<f64>>();
        let data: Vec<Vec<f64>> = (0..columns).map(column).collect();
        let (mut now, mut next) = (column(columns), vec![0.0; samples]);
        let passes = (1 << 28) / samples;
        let (mut largest, started) = (0.0, processor_s());
        for pass in 0..passes {
            let (d, e) = (&data[pass % columns], &data[(pass * 7 + 1) % columns]);
            let by = std::hint::black_box(0.01);
            for from in (0..samples).step_by(BLOCK) {
                let (now, next) = (&now[from..from + BLOCK], &mut next[from..from + BLOCK]);
                let (d, e) = (&d[from..from + BLOCK], &e[from..from + BLOCK]);
                for i in 0..BLOCK {
                    next[i] = now[i] + (by * d[i] - by * e[i]);
                }
                largest = gather(largest, next);
            }
            std::mem::swap(&mut now, &mut next);
        }
        std::hint::black_box(largest);
        (passes * samples) as f64 / (processor_s() - started)
    };
    for (name, samples, columns) in [
        ("one block of 64 samples", BLOCK, 2),
        ("8192 samples of two columns", SAMPLES, 2),
        ("8192 samples of 24 columns", SAMPLES, LAYERS),
    ] {
        let rate = stream(samples, columns);
        println!("  limit, {name:<28} {:>8.2} GB/s {:>8.2} Gflop/s", rate * 32.0 / 1e9, rate * 5.0 / 1e9);
    }
    // Sixteen chains of a product and a sum each, all in registers.
    let mut chains = [[1.0_f64; 2]; 8];
    let (factor, term) = (std::hint::black_box(0.999_999), std::hint::black_box(1e-6));
    let (count, started) = (1u64 << 27, processor_s());
    for _ in 0..count {
        for chain in &mut chains {
            for v in chain {
                *v = *v * factor + term;
            }
        }
    }
    std::hint::black_box(chains);
    println!("  limit, without memory {:>32.2} Gflop/s", count as f64 * 32.0 / (processor_s() - started) / 1e9);
}

fn gather(largest: f64, block: &[f64]) -> f64 {
    let mut lanes = [0.0_f64; 8];
    for chunk in block.chunks_exact(8) {
        for (lane, v) in lanes.iter_mut().zip(chunk) {
            let size = v.abs();
            *lane = if size > *lane { size } else { *lane };
        }
    }
    lanes.iter().fold(largest, |a, &b| if b > a { b } else { a })
}

fn say_work(work: Work, seconds: f64) {
    let (count, samples) = (work.moves as f64, work.samples as f64);
    println!(
        "  accepted {:.1} %, samples a move {:.0}, {:.2} GB/s read and written, {:.2} Gflop/s",
        percent_from_fraction(work.accepted as f64 / count),
        samples / count,
        // Values in and out and two columns; two multiplications, two additions, one comparison.
        samples * 4.0 * 8.0 / seconds / 1e9,
        samples * 5.0 / seconds / 1e9
    );
}
