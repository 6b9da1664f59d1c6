//! `fibres`: what coils are wound of, with where the numbers are from.

use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::io::json::fibres::FibresJson;

/// Fibres that fibre.library of a model file can name, with optics, layers and source
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  coilwright fibres")]
pub(crate) struct Arguments {}

pub(crate) fn run(_arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    screen.answer(FibresJson::all(), text)?;
    Ok(Ending::Done)
}

fn text(body: &FibresJson) -> String {
    let rows = body.fibres.iter().map(|fibre| {
        let mut layers = match fibre.hole_diameter_um > 0.0 {
            true => format!("{} to {}", fibre.hole_diameter_um, fibre.glass_diameter_um),
            false => fibre.glass_diameter_um.to_string(),
        };
        for coating in &fibre.coatings {
            layers += &format!(", {} {}", coating.material, coating.outer_diameter_um);
        }
        vec![
            fibre.name.to_owned(),
            fibre.kind.to_owned(),
            fibre.refractive_index.to_string(),
            fibre.group_index.to_string(),
            format!("{:.3e}", fibre.thermo_optic_per_k),
            format!("{:.3e}", fibre.path_per_k),
            layers,
        ]
    });
    let heads = ["fibre", "kind", "n", "group n", "dn/dT 1/K", "κ 1/K", "glass and coatings, outer µm"];
    let mut text = table(&heads, rows) + "\nsources:\n";
    for fibre in &body.fibres {
        let read = if fibre.source_was_read { "" } else { " [no accessible source read for all of it]" };
        text += &format!("  {}: {}{read}\n", fibre.name, fibre.source);
    }
    text
}
