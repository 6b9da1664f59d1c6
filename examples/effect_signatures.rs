//! The book's chapter of effects: what each is, and what it adds to one coil's rate error, as text and pictures.
//!
//! `cargo run --example effect_signatures` writes docs/src/effects.md and docs/src/effects/*.svg again; another folder can
//! be named. The coil is a quadrupole of twelve layers whose outermost layer is heated and cooled; every effect has the
//! parameters from which a fit would start.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use coilwright::effect::{CATALOGUE, DeclaredEffect, EffectSpec};
use coilwright::io::read::model_file::parse_model;
use coilwright::numeric::piecewise::PiecewiseLinear;
use coilwright::pattern::classic::Classic;
use coilwright::profile::{Piece, Profile};
use coilwright::rate::{CoilModel, Past, RateModel};
use coilwright::record::TABLE_RATE;
use coilwright::report::plot::{Axis, Band, Chart, ChartSeries};
use coilwright::thermal::{Drive, Extent, Instant, solve};
use coilwright::units::{
    REFERENCE_TEMPERATURE_K, deg_per_h_from_rad_per_s, k_per_s_from_c_per_min, min_from_s, rad_per_s_from_deg_per_s,
    s_from_min,
};

const MODEL: &str = include_str!("book/twelve-layers.toml");

/// Rate and duration of each piece.
const PIECES: [(f64, f64); 4] = [(1.0, 10.0), (0.0, 10.0), (-1.0, 10.0), (0.0, 10.0)];
const STEP_S: f64 = 2.0;
/// So that some ppm are of the size of the other effects.
const TABLE_DEG_PER_S: f64 = 0.1;

fn main() -> Result<(), Box<dyn Error>> {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src");
    write_chapter(&std::env::args().nth(1).map_or(shipped, PathBuf::from))
}

/// The chapter and its pictures.
pub fn write_chapter(folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder.join("effects"))?;
    let model = parse_model(Path::new("model.toml"), MODEL)?.model;
    let mut page = String::from(HEAD);
    for spec in CATALOGUE {
        let name = format!("effects/{}.svg", spec.kind);
        std::fs::write(folder.join(&name), signature(&model, spec)? + "\n")?;
        describe(&mut page, spec, &name)?;
    }
    std::fs::write(folder.join("effects.md"), page)?;
    Ok(())
}

const HEAD: &str = "# Effects

One piece of physics each. A model file names the ones that it includes; `diagnose` tries the others against a record, but for
housings, a spool's flanges and conduction, and an unsteady start, which are fitted where they are declared or asked for. Each picture
shows what the effect adds to the rate error of one coil, a quadrupole of twelve layers (24 m of fibre between radii of 40 mm and
42 mm), whose outermost layer warms for ten minutes at 1 °C/min, rests, cools as fast, and rests: the error with the effect less the
error without it, with the parameters from which a fit starts. Where an effect is the scale factor's, a table turns the gyro at 0.1 °/s. This chapter and its pictures are written by
`cargo run --release --example effect_signatures`; a test compares them.

Two more effects have no picture, because a profile does not have what they read: `channel:NAME` is linear in any further column
of a record, `custom` is a formula of your own (`coilwright effects` describes both). `thermal_stress` is computed from
the model's materials: [Thermal stress from materials](stress.md).
";

fn describe(page: &mut String, spec: &EffectSpec, picture: &str) -> Result<(), std::fmt::Error> {
    writeln!(page, "\n## {}\n\n{}.\n\n```text\n{}\n```\n", spec.kind, spec.summary, spec.equation)?;
    writeln!(page, "![What {} adds to the rate error]({picture})\n", spec.kind)?;
    if !spec.parameters.is_empty() {
        writeln!(page, "| key | meaning | from | to | here |\n|---|---|---|---|---|")?;
        for p in spec.parameters {
            writeln!(page, "| `{}` | {} | {} | {} | {} |", p.key, p.meaning, p.lower, p.upper, p.start)?;
        }
        writeln!(page)?;
    }
    for choice in spec.choices {
        writeln!(
            page,
            "`{}` ({}): {}; here {}.\n",
            choice.key,
            choice.options.join(" or "),
            choice.meaning,
            choice.options[0]
        )?;
    }
    writeln!(page, "In a record: {}. To isolate it: {}. Source: {}.", spec.signature, spec.experiment, spec.source)
}

/// The error with the effect less the error without it.
fn signature(model: &CoilModel, spec: &'static EffectSpec) -> Result<String, Box<dyn Error>> {
    let effect = DeclaredEffect::at_start(spec);
    let mut without = model.clone();
    if spec.kind == "finite_pack" {
        without.extent = Extent::HalfSpace;
    }
    let with = without.with_effect(effect);
    let lag_s = with.sensor_lag_s();
    let profile = profile()?;
    let course = profile.temperature(REFERENCE_TEMPERATURE_K);
    let reading = if lag_s > 0.0 { lagging(&course, profile.duration_s(), lag_s)? } else { course.clone() };
    let (after, before) = (rates(&with, &course, &profile)?, rates(&without, &reading, &profile)?);
    let points = after.iter().zip(&before).map(|((t, a), (_, b))| (min_from_s(*t), deg_per_h_from_rad_per_s(a - b)));
    let mut chart = Chart::new(format!("What {} adds", spec.kind))
        .size(720, 300)
        .x(Axis::linear("time [min]").reaching(0.0))
        .y(Axis::linear("added rate error [°/h]").reaching(0.0))
        .with(ChartSeries::line("", points.collect()));
    let mut start_min = 0.0;
    for (rate, duration_min) in PIECES {
        let end_min = start_min + duration_min;
        if rate != 0.0 {
            let (words, hue) = if rate > 0.0 { ("+1 °C/min", 1) } else { ("−1 °C/min", 0) };
            chart = chart.band(Band::vertical(words, start_min, end_min).hue(hue));
        }
        start_min = end_min;
    }
    Ok(chart.svg())
}

fn profile() -> Result<Profile, Box<dyn Error>> {
    let pieces = PIECES.iter().map(|(rate, duration_min)| Piece {
        rate_k_per_s: k_per_s_from_c_per_min(*rate),
        duration_s: s_from_min(*duration_min),
    });
    Ok(Profile::new("up and down", pieces.collect())?)
}

fn rates(model: &CoilModel, course: &PiecewiseLinear, profile: &Profile) -> Result<Vec<(f64, f64)>, Box<dyn Error>> {
    let pattern = Classic::Qua.pattern(model.coil.layers())?;
    let field = solve(&model.heat_path()?, &Drive::boundary(course.clone()))?;
    let mut instants = Vec::new();
    let mut start_s = 0.0;
    for piece in profile.pieces() {
        let steps = (piece.duration_s / STEP_S) as usize;
        instants.extend((0..steps).map(|i| Instant::after(start_s + i as f64 * STEP_S)));
        start_s += piece.duration_s;
        instants.push(Instant::before(start_s));
    }
    let history = field.at(&instants);
    let rate = RateModel::new(model, &pattern, &[TABLE_RATE.to_owned()])?;
    let (turning, mut past) = ([deg_per_h_from_rad_per_s(rad_per_s_from_deg_per_s(TABLE_DEG_PER_S))], Past::default());
    let found = (0..history.len()).map(|row| rate.rate_error_after(&rate.state(&history, row, &turning), &mut past));
    Ok(history.times_s.iter().copied().zip(found).collect())
}

/// What a sensor shows that follows with a first-order lag.
fn lagging(course: &PiecewiseLinear, duration_s: f64, lag_s: f64) -> Result<PiecewiseLinear, Box<dyn Error>> {
    let (mut times, mut values) = (vec![0.0], vec![course.value(0.0)]);
    while times[times.len() - 1] < duration_s {
        let (time_s, shown_k) = (times[times.len() - 1], values[values.len() - 1]);
        let middle_k = course.value(time_s + 0.5 * STEP_S);
        times.push(time_s + STEP_S);
        values.push(middle_k + (shown_k - middle_k) * (-STEP_S / lag_s).exp());
    }
    Ok(PiecewiseLinear::new(times, values)?)
}
