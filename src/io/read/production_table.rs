//! The `[production]` table of a model file: what the winding shop adds to the design.

use crate::schedule::production::Production;
use crate::units::{fraction_from_percent, percent_from_fraction};

use super::toml_reader::{Limits, TableReader, TomlReader};

/// The `[production]` table; every key may be absent.
pub(super) fn read_production(r: &mut TomlReader, table: &mut TableReader) -> Production {
    let default = Production::default();
    let mut text = |r: &mut TomlReader, key: &'static str| table.words(r, key).unwrap_or_default().to_owned();
    let (part_number, revision, spool) = (text(r, "part_number"), text(r, "revision"), text(r, "spool"));
    let (adhesive, cure) = (text(r, "adhesive"), text(r, "cure"));
    let tension_n = table.number(r, "tension_n", Limits::between(1e-4, 100.0));
    let taper_percent = table.number(r, "tension_taper_percent_per_layer", Limits::between(0.0, 50.0));
    let limit_percent = table.number(r, "tension_limit_percent", Limits::between(0.0, 100.0));
    let allowance_m = table.number(r, "allowance_m", Limits::between(0.0, 1e4));
    let potting_every_layers = table.integer(r, "potting_every_layers", 0, 10_000);
    let speed = table.number(r, "winding_speed_turns_per_min", Limits::between(1e-2, 1e5));
    Production {
        part_number,
        revision,
        spool,
        tension_n: tension_n.unwrap_or(default.tension_n),
        tension_taper_per_layer: fraction_from_percent(
            taper_percent.unwrap_or(percent_from_fraction(default.tension_taper_per_layer)),
        ),
        tension_limit: limit_percent.map_or(default.tension_limit, fraction_from_percent),
        allowance_m: allowance_m.unwrap_or(default.allowance_m),
        adhesive,
        potting_every_layers: potting_every_layers.map_or(default.potting_every_layers, |n| n as usize),
        cure,
        winding_speed_turns_per_min: speed.unwrap_or(default.winding_speed_turns_per_min),
    }
}
