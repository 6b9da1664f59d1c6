//! Hides one effect in each of many simulated measurements and asks the diagnosis for it:
//! `cargo run --release --example diagnosis_trials -- results/diagnosis-trials 3`
//!
//! Every effect of the catalogue, a further column, nothing at all, and three things outside the catalogue, at three
//! noise levels, as many rounds as the second argument says; the field comes from the program's own models, driven by a
//! chamber's air. Writes every trial, the confusion matrix and a summary; everything is seeded.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

use coilwright::coil::{Coil, CoilSpec, Fibre, LayerLength};
use coilwright::diagnose::{Request, Verdict, diagnose};
use coilwright::effect::{CATALOGUE, DeclaredEffect};
use coilwright::io::files::write_atomically;
use coilwright::numeric::piecewise::PiecewiseLinear;
use coilwright::pattern::Pattern;
use coilwright::pattern::classic::Classic;
use coilwright::predict::rates_rad_per_s;
use coilwright::rate::CoilModel;
use coilwright::record::{Channel, Record};
use coilwright::thermal::{self, Drive, Extent, Instant, Location, Material};
use coilwright::units::{kelvin_from_celsius, rad_per_s_from_deg_per_h};

const INTERVAL_S: f64 = 10.0;
const CHAMBER_FILM_W_PER_M2_K: f64 = 25.0;
const READING_NOISE_K: f64 = 0.004;
const NOISE_LEVELS_DEG_PER_H: [f64; 3] = [0.01, 0.04, 0.16];
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
        effect("surface_film", &[CHAMBER_FILM_W_PER_M2_K]),
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

/// A coil with its winding; `extent` is what the model file claims.
fn declared(index: usize, extent: Extent) -> Result<(CoilModel, Pattern), Box<dyn Error>> {
    let coils = [
        (12, 71.0, 36e-3, 250e-6, Classic::Zyl),
        (24, 50.0, 40e-3, 165e-6, Classic::Dip),
        (20, 45.0, 30e-3, 200e-6, Classic::Sym),
        (16, 60.0, 40e-3, 165e-6, Classic::Qua),
    ];
    let (layers, turns, bore_radius_m, pitch_m, classic) = coils[index % coils.len()];
    let coil = Coil::new(CoilSpec {
        fibre: Fibre {
            refractive_index: 1.45,
            thermo_optic_per_k: 1e-5,
            thermal_expansion_per_k: 0.0,
            wavelength_m: 1.55e-6,
            outer_diameter_m: pitch_m,
        },
        layers,
        turns_per_layer: Some(turns),
        bore_radius_m,
        radial_pitch_m: pitch_m,
        axial_pitch_m: 1.02 * pitch_m,
        layer_length: LayerLength::Actual,
        length_m: None,
    })?;
    let model = CoilModel {
        name: classic.key().to_owned(),
        coil,
        extent,
        material: Material::Conductivity { w_per_m_k: 0.35, heat_capacity_j_per_m3_k: 1.7e6 },
        location: Location::OuterLayer,
        rate_mean_s: INTERVAL_S,
        effects: Vec::new(),
    };
    Ok((model, classic.pattern(layers)?))
}

/// The chamber: soaks and ramps of 0.5 … 2.5 K/min.
fn chamber(random: &mut ChaCha8Rng, end_s: f64) -> Result<PiecewiseLinear, Box<dyn Error>> {
    let (mut times_s, mut values_k) = (vec![0.0, 600.0], vec![kelvin_from_celsius(20.0); 2]);
    let mut upwards = random.random::<f64>() < 0.5;
    while times_s[times_s.len() - 1] < end_s {
        let (time_s, value_k) = (times_s[times_s.len() - 1], values_k[values_k.len() - 1]);
        let rate_k_per_s = (0.5 + 2.0 * random.random::<f64>()) / 60.0;
        let change_k = 12.0 + 28.0 * random.random::<f64>();
        let target_k = if upwards { value_k + change_k } else { value_k - change_k };
        upwards = !upwards;
        times_s.push(time_s + change_k / rate_k_per_s);
        values_k.push(target_k);
        times_s.push(time_s + change_k / rate_k_per_s + 400.0 + 800.0 * random.random::<f64>());
        values_k.push(target_k);
    }
    Ok(PiecewiseLinear::new(times_s, values_k)?)
}

/// One simulated record and the root mean square of what is hidden, in noises.
fn simulate(
    name: &str,
    (truth, plain): (&CoilModel, &CoilModel),
    pattern: &Pattern,
    hidden: &Hidden,
    noise_deg_per_h: f64,
    rows: usize,
    random: &mut ChaCha8Rng,
) -> Result<(Record, f64), Box<dyn Error>> {
    let air_k = chamber(random, rows as f64 * INTERVAL_S)?;
    let times_s: Vec<f64> = (0..rows).map(|i| INTERVAL_S * i as f64).collect();
    let instants: Vec<Instant> = times_s.iter().map(|&t| Instant::before(t)).collect();
    let drive = Drive::boundary(air_k.clone());
    let rates_of = |model: &CoilModel, record: &Record| -> Result<(Vec<f64>, Vec<f64>), Box<dyn Error>> {
        let mut path = model.heat_path()?;
        path.extent = Extent::Pack;
        path.location = Location::Ambient;
        path.film_w_per_m2_k = Some(CHAMBER_FILM_W_PER_M2_K);
        let field = thermal::solve(&path, &drive)?;
        let rates = rates_rad_per_s(model, pattern, record, &field.means(&times_s, INTERVAL_S))?;
        let history = field.at(&instants);
        Ok((rates, (0..rows).map(|row| history.temperatures_k(row)[history.layers - 1]).collect()))
    };
    let normal = Normal::new(0.0, 1.0)?;
    let mut gauss = || normal.inverse_cdf(random.random::<f64>().clamp(1e-12, 1.0 - 1e-12));
    let column: Vec<f64> = times_s.iter().map(|t| 0.2 * (t / 180.0).sin() + 0.1 * (t / 1100.0).cos()).collect();
    let blank = Record::new(name, times_s.clone(), vec![293.0; rows], vec![0.0; rows])?
        .with_channel(Channel { name: "supply_v".to_owned(), values: column.clone() })?;
    let (mut rates, outer_k) = rates_of(truth, &blank)?;
    let (without, _) = rates_of(plain, &blank)?;
    let mut seen_k = outer_k;
    match hidden {
        Hidden::Effect("surface_film", ..) => seen_k = times_s.iter().map(|&t| air_k.value(t)).collect(),
        Hidden::Effect("sensor_lag", values, _) => {
            // Exact for a temperature that is linear between the stamps.
            let (lag_s, mut state_k) = (values[0], seen_k[0]);
            let decay = (-INTERVAL_S / lag_s).exp();
            for row in 1..rows {
                let slope = (seen_k[row] - seen_k[row - 1]) / INTERVAL_S;
                let next_k = seen_k[row];
                let start_k = next_k - slope * INTERVAL_S;
                let settled_k = start_k - slope * lag_s;
                let lagging_k = next_k - slope * lag_s + (state_k - settled_k) * decay;
                seen_k[row - 1] = state_k;
                state_k = lagging_k;
            }
            seen_k[rows - 1] = state_k;
        }
        Hidden::Column(gain_deg_per_h) => {
            let gain = rad_per_s_from_deg_per_h(*gain_deg_per_h);
            rates.iter_mut().zip(&column).for_each(|(r, c)| *r += gain * c);
        }
        Hidden::Outside(shape, amplitude_deg_per_h) => {
            let amplitude = rad_per_s_from_deg_per_h(*amplitude_deg_per_h);
            for (rate, t) in rates.iter_mut().zip(&times_s) {
                *rate += amplitude
                    * match *shape {
                        "sinusoid" => (t / 170.0).sin(),
                        "ageing" => -(-t / 1500.0).exp_m1(),
                        _ => (t / 260.0).sin().signum(),
                    };
            }
        }
        Hidden::Nothing | Hidden::Effect(..) => {}
    }
    let noise = rad_per_s_from_deg_per_h(noise_deg_per_h);
    let difference: Vec<f64> = rates.iter().zip(&without).map(|(a, b)| a - b).collect();
    let mean = difference.iter().sum::<f64>() / rows as f64;
    let size = (difference.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / rows as f64).sqrt() / noise;
    let offset = rad_per_s_from_deg_per_h(0.1);
    let measured: Vec<f64> = rates.iter().map(|r| r + offset + noise * gauss()).collect();
    let resolution_k = 1e-3;
    let read_k: Vec<f64> =
        seen_k.iter().map(|t| ((t + READING_NOISE_K * gauss()) / resolution_k).round() * resolution_k).collect();
    let record = Record::new(name, times_s, read_k, measured)?
        .with_channel(Channel { name: "supply_v".to_owned(), values: column })?;
    Ok((record, size))
}

/// One line of the table of all trials.
struct Outcome {
    hidden: String,
    noise_deg_per_h: f64,
    coil: String,
    size_in_noises: f64,
    verdict: &'static str,
    answer: Vec<String>,
    column: usize,
}

fn try_one(hidden: &Hidden, noise_deg_per_h: f64, number: u64) -> Result<Outcome, Box<dyn Error>> {
    let mut random = ChaCha8Rng::seed_from_u64(number);
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
        simulate(name, (&truth, &plain), &pattern, hidden, noise_deg_per_h, rows, &mut random)
    };
    let (calibration, size_in_noises) = record("calibration", ROWS[0])?;
    let (holdout, _) = record("hold-out", ROWS[1])?;
    let request = Request { model: &model, pattern: &pattern, records: &[calibration], holdout: &[holdout] };
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
    let coil = model.name.clone();
    Ok(Outcome { hidden: hidden.name(), noise_deg_per_h, coil, size_in_noises, verdict, answer, column })
}

fn report(outcomes: &[Outcome], seconds_note: &str) -> (String, String, String) {
    let mut trials = "hidden,noise_deg_per_h,coil,size_in_noises,verdict,answer,judged\n".to_owned();
    let mut matrix: BTreeMap<(String, String), [usize; 5]> = BTreeMap::new();
    let mut smallest: BTreeMap<String, f64> = BTreeMap::new();
    for o in outcomes {
        let (noise, judged) = (o.noise_deg_per_h, COLUMNS[o.column]);
        let answer = o.answer.join(" ");
        let _ =
            writeln!(trials, "{},{noise},{},{:.3},{},{answer},{judged}", o.hidden, o.coil, o.size_in_noises, o.verdict);
        matrix.entry((o.hidden.clone(), format!("{noise}"))).or_default()[o.column] += 1;
        if matches!(o.column, 1 | 2) {
            let least = smallest.entry(o.hidden.clone()).or_insert(f64::INFINITY);
            *least = least.min(o.size_in_noises);
        }
    }
    let mut confusion = format!("hidden,noise_deg_per_h,{}\n", COLUMNS.join(","));
    let mut words =
        format!("# Diagnosis trials\n\n{seconds_note}\n\n| hidden | noise °/h | {} |\n", COLUMNS.join(" | "));
    words += "|---|---|---|---|---|---|---|\n";
    for ((hidden, noise), counts) in &matrix {
        let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
        let _ = writeln!(confusion, "{hidden},{noise},{}", counts.join(","));
        let _ = writeln!(words, "| {hidden} | {noise} | {} |", counts.join(" | "));
    }
    let controls: Vec<&Outcome> = outcomes.iter().filter(|o| o.hidden == "nothing").collect();
    let named = controls.iter().filter(|o| !o.answer.is_empty()).count();
    let alarmed = controls.iter().filter(|o| o.column != 0).count();
    let outside: Vec<&Outcome> = outcomes.iter().filter(|o| o.hidden.starts_with("outside")).collect();
    let misnamed = outside.iter().filter(|o| matches!(o.column, 1 | 2 | 4)).count();
    let wrong = outcomes.iter().filter(|o| o.column == 4 && !o.hidden.starts_with("outside") && o.hidden != "nothing");
    let _ = write!(
        words,
        "\n{} trials. Controls: {} of {} were given an effect, {alarmed} were not called adequate. Outside the catalogue: \
         {misnamed} of {} were given a name. A wrong name for an effect of the catalogue: {}.\n\n\
         Smallest effect that was found, its root mean square in multiples of the noise of one rate (surface_film and \
         sensor_lag act through the sensor and have none, finite_pack through the model):\n\n| effect | found at |\n|---|---|\n",
        outcomes.len(),
        named,
        controls.len(),
        outside.len(),
        wrong.count(),
    );
    for (hidden, size) in &smallest {
        let _ = writeln!(words, "| {hidden} | {size:.2} |");
    }
    (trials, confusion, words)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("give the folder to write to")?;
    let rounds: u64 = arguments.next().map_or(Ok(3), |r| r.parse())?;
    std::fs::create_dir_all(&folder)?;
    let all = all_hidden();
    let mut outcomes = Vec::new();
    for round in 0..rounds {
        for (level, &noise_deg_per_h) in NOISE_LEVELS_DEG_PER_H.iter().enumerate() {
            for (place, hidden) in all.iter().enumerate() {
                let number = 1000 * round + 100 * level as u64 + place as u64;
                outcomes.push(try_one(hidden, noise_deg_per_h, number)?);
                let note = format!(
                    "`cargo run --release --example diagnosis_trials -- results/diagnosis-trials {rounds}`, records of {} and {} \
                     rows, coils zyl 12, dip 24, sym 20, qua 16 layers; seeds in the source.",
                    ROWS[0], ROWS[1]
                );
                let (trials, confusion, words) = report(&outcomes, &note);
                let folder = Path::new(&folder);
                write_atomically(&folder.join("trials.csv"), trials.as_bytes())?;
                write_atomically(&folder.join("confusion.csv"), confusion.as_bytes())?;
                write_atomically(&folder.join("README.md"), words.as_bytes())?;
            }
        }
    }
    Ok(())
}
