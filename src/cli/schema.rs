//! `schema`: the JSON Schema of a file format.

use clap::ValueEnum;

use super::screen::Screen;
use super::{CliError, Ending};
use crate::io::json::SchemaJson;
use crate::io::json::further_schemas::{campaign_schema, compensation_schema};
use crate::io::json::schema::{model_schema, pattern_schema, record_schema, schedule_schema};

/// The JSON Schema of a file format, for editors
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright schema model > coilwright-model.schema.json\n  coilwright schema campaign"
)]
pub(crate) struct Arguments {
    /// Which files it is about
    #[arg(value_enum)]
    kind: Kind,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Kind {
    Model,
    Pattern,
    Record,
    /// Schedule, traveller and winder's program as JSON
    Schedule,
    Campaign,
    /// The compensator that `compensate --export` writes
    Compensation,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let schema = match arguments.kind {
        Kind::Model => model_schema(),
        Kind::Pattern => pattern_schema(),
        Kind::Record => record_schema(),
        Kind::Schedule => schedule_schema(),
        Kind::Campaign => campaign_schema(),
        Kind::Compensation => compensation_schema(),
    };
    let kind = arguments.kind.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
    screen.answer(SchemaJson { kind, schema }, |body| format!("{:#}\n", body.schema))?;
    Ok(Ending::Done)
}
