//! `materials`: what coils are made of, with where the numbers are from.

use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::io::json::stress::{MaterialJson, MaterialsJson};
use crate::stress::library::MATERIALS;
use crate::units::kelvin_from_celsius;

/// Materials that [materials] of a model file can name, with stiffness, expansion and source
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright materials\n  coilwright materials --use adhesive --at -40 --at 20 --at 70"
)]
pub(crate) struct Arguments {
    /// Only those for this use
    #[arg(long = "use", value_name = "USE", value_parser = ["glass", "coating", "adhesive", "spool"])]
    used_as: Option<String>,
    /// Temperature [°C] at which numbers are given; may be repeated
    #[arg(long = "at", value_name = "C", default_values_t = [-55.0, 20.0, 85.0], allow_negative_numbers = true, value_parser = celsius)]
    at_c: Vec<f64>,
}

/// A temperature that a coil may have.
pub(crate) fn celsius(stated: &str) -> Result<f64, String> {
    let value: f64 = stated.parse().map_err(|_| format!("expected a temperature in °C, found \"{stated}\""))?;
    if (-200.0..=200.0).contains(&value) { Ok(value) } else { Err("expected -200 to 200 °C".to_owned()) }
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let temperatures_k: Vec<f64> = arguments.at_c.iter().map(|c| kelvin_from_celsius(*c)).collect();
    let wanted = MATERIALS.iter().filter(|m| arguments.used_as.as_deref().is_none_or(|word| word == m.used_as.word()));
    let body = MaterialsJson { materials: wanted.map(|entry| MaterialJson::of(entry, &temperatures_k)).collect() };
    screen.answer(body, text)?;
    Ok(Ending::Done)
}

fn text(body: &MaterialsJson) -> String {
    let rows = body.materials.iter().flat_map(|material| {
        material.at.iter().enumerate().map(|(index, at)| {
            let (name, used_as) =
                if index == 0 { (material.name.clone(), material.used_as.unwrap_or("-")) } else { Default::default() };
            vec![
                name,
                used_as.to_owned(),
                format!("{}", at.temperature_c),
                format!("{:.4}", at.youngs_modulus_mpa),
                format!("{:.4}", at.poisson_ratio),
                format!("{:.2e}", at.expansion_per_k),
            ]
        })
    });
    let mut text = table(&["material", "use", "°C", "E MPa", "ν", "α 1/K"], rows);
    text += "\nsources:\n";
    for material in &body.materials {
        let read = if material.source_was_read { "" } else { " [no accessible source read for all of it]" };
        text += &format!("  {}: {}{read}\n", material.name, material.source);
    }
    text
}
