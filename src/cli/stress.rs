//! `stress`: what a coil's materials do to its layers.

use std::path::PathBuf;

use super::materials::celsius;
use super::pattern_asked::patterns_asked;
use super::screen::{Screen, table};
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::json::stress::{StressAtJson, StressJson};
use crate::io::read::model_file::read_model;
use crate::task::stress::{Request, run as stress};
use crate::units::kelvin_from_celsius;

/// Thermal strain of every layer from the model's materials, and what it makes of windings
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright stress potted.toml\n  coilwright stress potted.toml --at -40 --at 20 --at 70 --pattern qua"
)]
pub(crate) struct Arguments {
    /// The model file, with [materials]
    model: PathBuf,
    /// A winding's name or a pattern file; may be repeated. Without it: the model's own and all classics that fit
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Vec<String>,
    /// Temperature of the coil [°C]; may be repeated
    #[arg(long = "at", value_name = "C", default_values_t = [20.0], allow_negative_numbers = true, value_parser = celsius)]
    at_c: Vec<f64>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let patterns = patterns_asked(&file, &arguments.pattern)?;
    let temperatures_k: Vec<f64> = arguments.at_c.iter().map(|c| kelvin_from_celsius(*c)).collect();
    let request = Request { model: &file, patterns: &patterns, temperatures_k: &temperatures_k };
    let body = stress(&request, &Watching::quiet(screen))?;
    screen.answer(body, text)?;
    Ok(Ending::Done)
}

fn text(body: &StressJson) -> String {
    let mut text = format!("{}: change per kelvin where the whole coil changes its temperature\n", body.model);
    for at in &body.temperatures {
        text += &shown(at);
    }
    text
}

fn shown(at: &StressAtJson) -> String {
    let small = |v: f64| format!("{v:.3e}");
    let rows = at.layers.iter().map(|layer| {
        vec![
            layer.layer.to_string(),
            small(layer.hoop_strain_per_k),
            small(layer.radial_strain_per_k),
            small(layer.axial_strain_per_k),
            small(layer.glass_transverse_strain_per_k),
            format!("{:.5e}", layer.path_per_k),
        ]
    });
    let layers = table(&["layer", "hoop", "radial", "axial", "across the glass", "κ 1/K"], rows);
    let rows = at.patterns.iter().map(|p| {
        vec![p.name.clone(), format!("{:.6}", p.equivalent_mismatch), format!("{:.4}", p.steady_ramp_deg_per_h)]
    });
    let patterns = table(&["pattern", "mismatch", "steady ramp °/h"], rows);
    let strength = at.stress_gradient_strength.map_or("-".to_owned(), |s| format!("{s:.6}"));
    format!(
        "\nat {} °C\n{layers}κ of the coil {:.5e} 1/K, of the free fibre {:.5e} 1/K, which expands by {:.3e} 1/K; stress_gradient's strength {strength}\n{patterns}",
        at.temperature_c, at.path_per_k, at.free_fibre.path_per_k, at.free_fibre.expansion_per_k
    )
}
