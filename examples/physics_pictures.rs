//! The pictures of the book's chapter on the physics.
//!
//! `cargo run --example physics_pictures` writes docs/src/physics/*.svg again; another folder can be named. The coil is one of
//! twelve layers whose outermost layer warms at 1 °C/min.

use std::error::Error;
use std::path::{Path, PathBuf};

use coilwright::io::read::model_file::parse_model;
use coilwright::pattern::classic::Classic;
use coilwright::profile::{Piece, Profile};
use coilwright::rate::{CoilModel, RateModel};
use coilwright::report::cross_section::cross_section;
use coilwright::report::plot::{Axis, Chart, ChartSeries};
use coilwright::thermal::{Drive, Extent, Instant, ThermalHistory, solve};
use coilwright::units::{REFERENCE_TEMPERATURE_K, deg_per_h_from_rad_per_s, k_per_s_from_c_per_min, s_from_min};

const MODEL: &str = include_str!("book/twelve-layers.toml");

const LAYERS: usize = 12;
const RAMP_MIN: f64 = 10.0;
const STEP_S: f64 = 0.5;
/// The first seconds, in which one layer after the other begins to warm.
const BEGINNING_S: f64 = 90.0;

fn main() -> Result<(), Box<dyn Error>> {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src/physics");
    write_pictures(&std::env::args().nth(1).map_or(shipped, PathBuf::from))
}

/// All of them.
pub fn write_pictures(folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let model = parse_model(Path::new("model.toml"), MODEL)?.model;
    let qua = Classic::Qua.pattern(LAYERS)?;
    for (name, svg) in [
        ("pack", cross_section("the quadrupole of twelve layers", &qua)),
        ("weights", weights()?),
        ("warming", warming(&model)?),
        ("error", error(&model)?),
    ] {
        std::fs::write(folder.join(name).with_extension("svg"), svg + "\n")?;
    }
    Ok(())
}

/// 2 P(j) − 1 − N: the weight of a layer whose length is one.
fn weights() -> Result<String, Box<dyn Error>> {
    let mut chart = Chart::new("Weight of each layer")
        .size(720, 300)
        .x(Axis::linear("layer, counted from the spool [1]"))
        .y(Axis::linear("weight [squares of a layer's length]"));
    for classic in [Classic::Zyl, Classic::Dip, Classic::Qua] {
        let pattern = classic.pattern(LAYERS)?;
        let weight = |segment: usize| 2.0 * segment as f64 - 1.0 - LAYERS as f64;
        let points = pattern.segments().iter().enumerate().map(|(j, s)| (j as f64 + 1.0, weight(*s))).collect();
        chart = chart.with(ChartSeries::line(classic.key(), points));
    }
    Ok(chart.svg())
}

/// The field of the ramp at even times.
fn field(model: &CoilModel, until_s: f64) -> Result<ThermalHistory, Box<dyn Error>> {
    let ramp = Piece { rate_k_per_s: k_per_s_from_c_per_min(1.0), duration_s: s_from_min(RAMP_MIN) };
    let course = Profile::new("ramp", vec![ramp])?.temperature(REFERENCE_TEMPERATURE_K);
    let steps = (until_s / STEP_S) as usize;
    let instants: Vec<Instant> = (0..=steps).map(|i| Instant::after(i as f64 * STEP_S)).collect();
    Ok(solve(&model.heat_path()?, &Drive::boundary(course))?.at(&instants))
}

fn warming(pack: &CoilModel) -> Result<String, Box<dyn Error>> {
    let half_space = CoilModel { extent: Extent::HalfSpace, ..pack.clone() };
    let (inside, behind) = (field(pack, BEGINNING_S)?, field(&half_space, BEGINNING_S)?);
    let mut chart = Chart::new("A ramp begins: the rate of single layers")
        .size(720, 320)
        .x(Axis::linear("time since the ramp began [s]"))
        .y(Axis::linear("rate over the ramp's [1]").reaching(0.0));
    let ramp = k_per_s_from_c_per_min(1.0);
    let series = |history: &ThermalHistory, layer: usize| -> Vec<(f64, f64)> {
        (0..history.len()).map(|i| (history.times_s[i], history.rates_k_per_s(i)[layer] / ramp)).collect()
    };
    for layer in [LAYERS - 1, LAYERS - 2, LAYERS / 2, 0] {
        chart = chart.with(ChartSeries::line(format!("layer {}", layer + 1), series(&inside, layer)));
    }
    Ok(chart.with(ChartSeries::dashed("layer 1 in a half space", series(&behind, 0))).svg())
}

fn error(model: &CoilModel) -> Result<String, Box<dyn Error>> {
    let history = field(model, BEGINNING_S)?;
    let mut chart = Chart::new("What three windings make of it")
        .size(720, 320)
        .x(Axis::linear("time since the ramp began [s]"))
        .y(Axis::linear("rate error [°/h]"));
    for classic in [Classic::Zyl, Classic::Dip, Classic::Qua] {
        let rates = RateModel::new(model, &classic.pattern(LAYERS)?, &[])?.series_rad_per_s(&history);
        let points = history.times_s.iter().zip(rates).map(|(t, r)| (*t, deg_per_h_from_rad_per_s(r)));
        chart = chart.with(ChartSeries::line(classic.key(), points.collect()));
    }
    Ok(chart.svg())
}
