//! `effects`: the physics that a model file can add.

use super::screen::Screen;
use super::{CliError, Ending, offered};
use crate::effect::{CATALOGUE, CHANNEL, CUSTOM, THERMAL_STRESS};
use crate::io::json::effects::{EffectJson, EffectParameterJson, EffectsJson};
use crate::task::extend::unknown_effect;

/// The effects that a model file can declare, with equations, parameters and sources
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  coilwright effects\n  coilwright effects spool_mass surface_film --format json")]
pub(crate) struct Arguments {
    /// Only these, by the name used in files; all of them without it
    #[arg(value_name = "KIND", value_parser = offered::effects(), hide_possible_values = true)]
    kinds: Vec<String>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let known = || CATALOGUE.iter().copied().chain([CHANNEL, CUSTOM, THERMAL_STRESS]);
    for stated in &arguments.kinds {
        if !known().any(|spec| spec.kind == stated) {
            return Err(unknown_effect(stated).into());
        }
    }
    let chosen = known().filter(|spec| arguments.kinds.is_empty() || arguments.kinds.iter().any(|k| k == spec.kind));
    let body = EffectsJson { effects: chosen.map(EffectJson::of).collect() };
    screen.answer(body, |body| body.effects.iter().map(describe).collect::<Vec<_>>().join("\n"))?;
    Ok(Ending::Done)
}

fn describe(effect: &EffectJson) -> String {
    let mut text = format!("{} — {}\n", effect.kind, effect.summary);
    let mut line = |label: &str, content: &str| text += &format!("  {label:<11} {content}\n");
    line("acts on", effect.acts);
    line("equation", effect.equation);
    for parameter in &effect.parameters {
        line("parameter", &parameter_line(parameter));
    }
    for choice in &effect.choices {
        let options: Vec<String> = choice.options.iter().map(|o| format!("\"{o}\"")).collect();
        line("choice", &format!("{} = {}: {}", choice.key, options.join(" | "), choice.meaning));
    }
    line("in a record", effect.signature);
    line("happens", effect.happens);
    line("to do", effect.remedy);
    line("to isolate", effect.experiment);
    line("source", effect.source);
    text
}

fn parameter_line(parameter: &EffectParameterJson) -> String {
    let default = parameter.default.map_or(String::new(), |value| format!(", default {value}"));
    format!(
        "{} [{}]: {}; {} … {}, a fit starts at {}{default}",
        parameter.key, parameter.unit, parameter.meaning, parameter.lower, parameter.upper, parameter.start
    )
}
