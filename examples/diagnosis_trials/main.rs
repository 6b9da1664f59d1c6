//! Hides one effect in each of many simulated measurements and asks the diagnosis for it:
//! `cargo run --release --example diagnosis_trials -- results/diagnosis-trials 3 90`
//!
//! Every effect of the catalogue, a further column, nothing at all, and three things outside the catalogue, at three
//! noise levels and three sizes (one a round; the second argument says how many rounds), then as many controls as the
//! third argument says. The field comes from the program's own models, driven by a chamber's air. Writes every trial,
//! the confusion matrix as table and picture, and a summary; everything is seeded, and trials that the folder holds
//! already are not run again.

mod chamber;

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use statrs::distribution::{Beta, ContinuousCDF};

use chamber::{declared, simulate};
use coilwright::diagnose::{Request, Terms, Verdict, diagnose};
use coilwright::effect::{CATALOGUE, DeclaredEffect};
use coilwright::io::files::write_atomically;
use coilwright::rate::CoilModel;
use coilwright::thermal::Extent;

const NOISE_LEVELS_DEG_PER_H: [f64; 3] = [0.01, 0.04, 0.16];
/// Sizes of what is hidden, by round.
const SIZES: [f64; 3] = [1.0, 0.35, 0.12];
/// Kinds whose first value is a factor on a declared number: its difference from one is what has a size.
const FACTORS: [&str; 2] = ["diffusivity", "thermo_optic"];
/// Kinds without a size, or whose size is no amplitude.
const UNSIZED: [&str; 2] = ["finite_pack", "surface_film"];
/// Calibration and hold-out.
const ROWS: [usize; 2] = [720, 540];
const COLUMNS: [&str; 5] = ["adequate", "named", "in a set", "unexplained", "wrong"];

/// What is hidden.
#[derive(Clone)]
enum Hidden {
    Nothing,
    /// Kind, values in the units of model files, choices.
    Effect(&'static str, Vec<f64>, Vec<usize>),
    /// A column whose gain is in °/h per unit.
    Column(f64),
    /// Name, and amplitude in °/h: no effect of the catalogue.
    Outside(&'static str, f64),
}

impl Hidden {
    /// The same, `size` times as large.
    fn sized(&self, size: f64) -> Self {
        match self {
            Hidden::Nothing => Hidden::Nothing,
            Hidden::Effect(kind, values, choices) => {
                let mut values = values.clone();
                match values.first_mut() {
                    Some(first) if FACTORS.contains(kind) => *first = 1.0 + size * (*first - 1.0),
                    Some(first) if !UNSIZED.contains(kind) => *first *= size,
                    _ => {}
                }
                Hidden::Effect(kind, values, choices.clone())
            }
            Hidden::Column(gain) => Hidden::Column(size * gain),
            Hidden::Outside(name, amplitude) => Hidden::Outside(name, size * amplitude),
        }
    }

    fn name(&self) -> String {
        match self {
            Hidden::Nothing => "nothing".to_owned(),
            Hidden::Effect(kind, ..) => (*kind).to_owned(),
            Hidden::Column(_) => "channel:supply_v".to_owned(),
            Hidden::Outside(name, _) => format!("outside: {name}"),
        }
    }
}

fn all_hidden() -> Vec<Hidden> {
    let effect = |kind, values: &[f64]| Hidden::Effect(kind, values.to_vec(), Vec::new());
    let chosen = |kind, value: f64, choice: usize| Hidden::Effect(kind, vec![value], vec![choice]);
    vec![
        Hidden::Nothing,
        effect("finite_pack", &[]),
        effect("spool_mass", &[4000.0, 300.0, 0.0]),
        effect("surface_film", &[chamber::FILM_W_PER_M2_K]),
        effect("sensor_lag", &[40.0]),
        effect("self_heating", &[120.0, 900.0]),
        chosen("axial_gradient", 40.0, 0),
        effect("conductivity_temperature", &[0.003]),
        effect("stress_gradient", &[0.05]),
        effect("strain_mismatch", &[0.004]),
        effect("glass_transition", &[0.006, 25.0, 4.0]),
        effect("thermo_optic_temperature", &[0.004]),
        chosen("midpoint_offset", 0.4, 0),
        chosen("midpoint_offset", 0.3, 1),
        effect("turn_mismatch", &[1.0]),
        effect("heating_cooling_asymmetry", &[0.05]),
        effect("bias_temperature", &[0.004, 0.0]),
        effect("bias_temperature_rate", &[12.0]),
        effect("bias_gradient_rate", &[40.0]),
        effect("diffusivity", &[1.3]),
        effect("thermo_optic", &[1.1]),
        Hidden::Column(0.4),
        Hidden::Nothing,
        Hidden::Outside("sinusoid", 0.12),
        Hidden::Outside("ageing", 0.25),
        Hidden::Outside("square wave", 0.1),
    ]
}

/// One line of the table of all trials.
#[derive(Clone)]
struct Outcome {
    seed: u64,
    hidden: String,
    noise_deg_per_h: f64,
    coil: String,
    size_in_noises: f64,
    verdict: String,
    answer: Vec<String>,
    column: usize,
}

impl Outcome {
    fn line(&self) -> String {
        let (noise, judged, answer) = (self.noise_deg_per_h, COLUMNS[self.column], self.answer.join(" "));
        let (seed, hidden, coil, verdict) = (self.seed, &self.hidden, &self.coil, &self.verdict);
        format!("{seed},{hidden},{noise},{coil},{:.3},{verdict},{answer},{judged}", self.size_in_noises)
    }

    fn from_line(line: &str) -> Option<Self> {
        let fields: Vec<&str> = line.split(',').collect();
        let &[seed, hidden, noise, coil, size, verdict, answer, judged] = &fields[..] else { return None };
        Some(Self {
            seed: seed.parse().ok()?,
            hidden: hidden.to_owned(),
            noise_deg_per_h: noise.parse().ok()?,
            coil: coil.to_owned(),
            size_in_noises: size.parse().ok()?,
            verdict: verdict.to_owned(),
            answer: answer.split_whitespace().map(str::to_owned).collect(),
            column: COLUMNS.iter().position(|c| *c == judged)?,
        })
    }

    fn is_control(&self) -> bool {
        self.hidden == "nothing"
    }

    fn is_outside(&self) -> bool {
        self.hidden.starts_with("outside")
    }
}

/// What is to be tried.
struct Plan {
    seed: u64,
    hidden: Hidden,
    noise_deg_per_h: f64,
}

fn plans(rounds: u64, controls: u64) -> Vec<Plan> {
    let mut plans = Vec::new();
    for round in 0..rounds {
        let size = SIZES[round as usize % SIZES.len()];
        for (level, &noise_deg_per_h) in NOISE_LEVELS_DEG_PER_H.iter().enumerate() {
            for (place, hidden) in all_hidden().iter().enumerate() {
                let seed = 1000 * round + 100 * level as u64 + place as u64;
                plans.push(Plan { seed, hidden: hidden.sized(size), noise_deg_per_h });
            }
        }
    }
    for control in 0..controls {
        let noise_deg_per_h = NOISE_LEVELS_DEG_PER_H[control as usize % NOISE_LEVELS_DEG_PER_H.len()];
        plans.push(Plan { seed: 1_000_000 + control, hidden: Hidden::Nothing, noise_deg_per_h });
    }
    plans
}

fn try_one(plan: &Plan) -> Result<Outcome, Box<dyn Error>> {
    let Plan { seed, hidden, noise_deg_per_h } = plan;
    let mut random = ChaCha8Rng::seed_from_u64(*seed);
    let claims_half_space = matches!(hidden, Hidden::Effect("finite_pack", ..));
    let extent = if claims_half_space { Extent::HalfSpace } else { Extent::Pack };
    let index = (random.random::<f64>() * 4.0) as usize;
    let (model, pattern) = declared(index, extent)?;
    let mut truth = CoilModel { extent: Extent::Pack, ..model.clone() };
    let plain = truth.clone();
    if let Hidden::Effect(kind, values, choices) = hidden
        && !matches!(*kind, "finite_pack" | "surface_film" | "sensor_lag")
    {
        let spec = CATALOGUE.iter().copied().find(|s| s.kind == *kind).ok_or("an unknown effect")?;
        let si = values.iter().zip(spec.parameters).map(|(v, p)| p.unit.to_si(*v)).collect();
        truth = truth.with_effect(DeclaredEffect::new(spec, si, choices.clone())?);
    }
    let mut record = |name: &str, rows: usize| {
        simulate(name, (&truth, &plain), &pattern, hidden, *noise_deg_per_h, rows, &mut random)
    };
    let (calibration, size_in_noises) = record("calibration", ROWS[0])?;
    let (holdout, _) = record("hold-out", ROWS[1])?;
    let terms = Terms::default();
    let request = Request { model: &model, pattern: &pattern, records: &[calibration], holdout: &[holdout], terms };
    let found = diagnose(&request, &|_| ())?;
    let mut answer: Vec<String> = Vec::new();
    for finding in &found.effects {
        answer.push(finding.effect.kind());
        answer.extend(finding.equivalents.iter().map(|e| e.effect.kind()));
    }
    let right = answer.contains(&hidden.name());
    let (verdict, column) = match found.verdict {
        Verdict::Adequate => ("adequate", 0),
        Verdict::Unexplained => ("unexplained", 3),
        Verdict::Missing => ("missing", if right && answer.len() == 1 { 1 } else { 4 }),
        Verdict::Indistinguishable => {
            ("indistinguishable", if right && found.effects.len() == 1 && answer.len() <= 3 { 2 } else { 4 })
        }
    };
    let (coil, verdict) = (model.name.clone(), verdict.to_owned());
    let (seed, hidden, noise_deg_per_h) = (*seed, hidden.name(), *noise_deg_per_h);
    Ok(Outcome { seed, hidden, noise_deg_per_h, coil, size_in_noises, verdict, answer, column })
}

/// Largest rate that `hits` of `count` leave possible, at 95 % (Clopper and Pearson, Biometrika 26 (1934) 404).
fn upper_bound(hits: usize, count: usize) -> f64 {
    if hits >= count {
        return 1.0;
    }
    Beta::new(hits as f64 + 1.0, (count - hits) as f64).map_or(1.0, |beta| beta.inverse_cdf(0.95))
}

type Matrix = BTreeMap<String, [[usize; COLUMNS.len()]; NOISE_LEVELS_DEG_PER_H.len()]>;

fn matrix_of(outcomes: &[Outcome]) -> Matrix {
    let mut matrix = Matrix::new();
    for o in outcomes {
        let level = NOISE_LEVELS_DEG_PER_H.iter().position(|n| *n == o.noise_deg_per_h).unwrap_or(0);
        matrix.entry(o.hidden.clone()).or_default()[level][o.column] += 1;
    }
    matrix
}

/// One row an effect, one block of columns a noise level; the darker, the more of the trials.
fn picture(matrix: &Matrix) -> String {
    let (left, top, cell, gap) = (210.0, 74.0, 34.0, 16.0);
    let block = COLUMNS.len() as f64 * cell + gap;
    let (width, height) = (left + block * NOISE_LEVELS_DEG_PER_H.len() as f64, top + cell * matrix.len() as f64 + 10.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (level, noise) in NOISE_LEVELS_DEG_PER_H.iter().enumerate() {
        let x = left + block * level as f64;
        let _ = writeln!(svg, "<text x=\"{x}\" y=\"16\" font-weight=\"bold\">noise {noise} °/h</text>");
        for (column, name) in COLUMNS.iter().enumerate() {
            let x = x + cell * (column as f64 + 0.6);
            let y = top - 6.0;
            let _ = writeln!(
                svg,
                "<text x=\"{x}\" y=\"{y}\" font-size=\"10\" transform=\"rotate(-45 {x} {y})\">{name}</text>"
            );
        }
    }
    for (row, (hidden, levels)) in matrix.iter().enumerate() {
        let y = top + cell * row as f64;
        let _ =
            writeln!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{hidden}</text>", left - 8.0, y + 0.62 * cell);
        for (level, counts) in levels.iter().enumerate() {
            let total = counts.iter().sum::<usize>().max(1);
            for (column, &count) in counts.iter().enumerate() {
                let share = count as f64 / total as f64;
                // Right answers blue, silence grey, wrong names red.
                let right = match column {
                    0 => hidden == "nothing",
                    3 => hidden.starts_with("outside"),
                    column => matches!(column, 1 | 2),
                };
                let hue = if right {
                    "33,102,172"
                } else if column == 4 {
                    "178,24,43"
                } else {
                    "110,110,110"
                };
                let ink = if share > 0.55 { "white" } else { "black" };
                let x = left + block * level as f64 + cell * column as f64;
                let _ = writeln!(
                    svg,
                    "<rect x=\"{x}\" y=\"{y}\" width=\"{cell}\" height=\"{cell}\" fill=\"rgba({hue},{share:.2})\" stroke=\"#ccc\"/>"
                );
                if count > 0 {
                    let (x, y) = (x + 0.5 * cell, y + 0.62 * cell);
                    let _ =
                        writeln!(svg, "<text x=\"{x}\" y=\"{y}\" text-anchor=\"middle\" fill=\"{ink}\">{count}</text>");
                }
            }
        }
    }
    svg + "</svg>\n"
}

/// Every trial, the confusion matrix, and both in words.
fn report(outcomes: &[Outcome], command: &str) -> (String, String, String) {
    let mut trials = "seed,hidden,noise_deg_per_h,coil,size_in_noises,verdict,answer,judged\n".to_owned();
    outcomes.iter().for_each(|o| trials += &(o.line() + "\n"));
    let mut confusion = format!("hidden,noise_deg_per_h,{}\n", COLUMNS.join(","));
    let mut words = format!(
        "# Diagnosis trials\n\n`{command}`: records of {} and {} rows, coils zyl 12, dip 24, sym 20, qua 16 layers, sizes {SIZES:?} by \
         round. `trials.csv` holds every trial, `confusion.csv` and `confusion.svg` the table. \"wrong\" is a name, or a set, that \
         does not hold what was hidden or holds more.\n\n| hidden | noise °/h | {} |\n|---|---|---|---|---|---|---|\n",
        ROWS[0],
        ROWS[1],
        COLUMNS.join(" | ")
    );
    for (hidden, levels) in &matrix_of(outcomes) {
        for (counts, noise) in levels.iter().zip(NOISE_LEVELS_DEG_PER_H) {
            let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
            let _ = writeln!(confusion, "{hidden},{noise},{}", counts.join(","));
            let _ = writeln!(words, "| {hidden} | {noise} | {} |", counts.join(" | "));
        }
    }
    let count = |which: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| which(o)).count();
    let controls = count(&|o| o.is_control());
    let named = count(&|o| o.is_control() && !o.answer.is_empty());
    let outside = count(&|o| o.is_outside());
    let misnamed = count(&|o| o.is_outside() && matches!(o.column, 1 | 2 | 4));
    let known = |o: &Outcome| !o.is_control() && !o.is_outside();
    let _ = write!(
        words,
        "\n{} trials. Controls: {named} of {controls} were given an effect (at 95 % confidence the rate is below {:.1} %), {} were \
         not called adequate. Outside the catalogue: {misnamed} of {outside} were given a name, {} were called unexplained. Of {} \
         trials with an effect of the catalogue: {} named, {} in a set of at most three, {} adequate (too small), {} unexplained, {} \
         wrong.\n\nSmallest effect that was found, its root mean square in multiples of the noise of one rate, and the largest that \
         was called adequate (sensor_lag and surface_film act through the sensor and have no size of their own, finite_pack \
         through the model):\n\n| effect | found from | missed up to |\n|---|---|---|\n",
        outcomes.len(),
        100.0 * upper_bound(named, controls),
        count(&|o| o.is_control() && o.column != 0),
        count(&|o| o.is_outside() && o.column == 3),
        count(&known),
        count(&|o| known(o) && o.column == 1),
        count(&|o| known(o) && o.column == 2),
        count(&|o| known(o) && o.column == 0),
        count(&|o| known(o) && o.column == 3),
        count(&|o| known(o) && o.column == 4),
    );
    let mut limits: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for o in outcomes.iter().filter(|o| known(o)) {
        let limit = limits.entry(&o.hidden).or_insert((f64::INFINITY, 0.0));
        match o.column {
            1 | 2 => limit.0 = limit.0.min(o.size_in_noises),
            0 => limit.1 = limit.1.max(o.size_in_noises),
            _ => {}
        }
    }
    for (hidden, (found, missed)) in &limits {
        let number = |v: f64| if v.is_finite() && v > 0.0 { format!("{v:.2}") } else { "–".to_owned() };
        let _ = writeln!(words, "| {hidden} | {} | {} |", number(*found), number(*missed));
    }
    (trials, confusion, words)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("give the folder to write to")?;
    let rounds: u64 = arguments.next().map_or(Ok(3), |r| r.parse())?;
    let controls: u64 = arguments.next().map_or(Ok(90), |c| c.parse())?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let known = std::fs::read_to_string(folder.join("trials.csv")).unwrap_or_default();
    let mut outcomes: Vec<Outcome> = known.lines().filter_map(Outcome::from_line).collect();
    let plans: Vec<Plan> =
        plans(rounds, controls).into_iter().filter(|p| outcomes.iter().all(|o| o.seed != p.seed)).collect();
    let command =
        format!("cargo run --release --example diagnosis_trials -- results/diagnosis-trials {rounds} {controls}");
    for some in plans.chunks(rayon::current_num_threads()) {
        let tried: Vec<Result<Outcome, String>> =
            some.par_iter().map(|plan| try_one(plan).map_err(|e| e.to_string())).collect();
        for outcome in tried {
            outcomes.push(outcome?);
        }
        let (trials, confusion, words) = report(&outcomes, &command);
        write_atomically(&folder.join("trials.csv"), trials.as_bytes())?;
        write_atomically(&folder.join("confusion.csv"), confusion.as_bytes())?;
        write_atomically(&folder.join("confusion.svg"), picture(&matrix_of(&outcomes)).as_bytes())?;
        write_atomically(&folder.join("README.md"), words.as_bytes())?;
    }
    Ok(())
}
