//! `patterns`: the windings that have a name.

use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::io::json::{ClassicJson, PatternsJson, WindabilityJson};
use crate::pattern::classic::Classic;
use crate::pattern::windability::WindingGraph;

/// The classic windings for a layer count, and what each asks of the winding shop
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  coilwright patterns --layers 24")]
pub(crate) struct Arguments {
    /// Number of layers
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u16).range(2..=400))]
    layers: u16,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let layers = usize::from(arguments.layers);
    let mut patterns = Vec::new();
    for classic in Classic::ALL {
        match classic.pattern(layers) {
            Ok(pattern) => {
                if let Some(run) = WindingGraph::new(&pattern).first_captive_run() {
                    screen.note(&format!("note: {} is hard to make: {run}", classic.key()));
                }
                patterns.push(ClassicJson {
                    name: classic.key().to_owned(),
                    title: classic.title().to_owned(),
                    layers,
                    segments: pattern.segments().to_vec(),
                    windability: WindabilityJson::of(&pattern),
                });
            }
            Err(error) => screen.note(&format!("note: {error}")),
        }
    }
    screen.answer(PatternsJson { patterns }, |body| {
        let rows = body.patterns.iter().map(|p| {
            vec![
                p.name.clone(),
                p.windability.class.clone(),
                p.windability.reels.to_string(),
                p.windability.captive.to_string(),
                p.windability.max_climb.to_string(),
                p.segments.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "),
            ]
        });
        table(&["pattern", "class", "reels", "captive", "climb", "segments, innermost layer first"], rows)
    })?;
    Ok(Ending::Done)
}
