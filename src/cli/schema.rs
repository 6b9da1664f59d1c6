//! `schema`: the JSON Schema of a file format, or of a command's answer.

use clap::ValueEnum;
use clap::builder::PossibleValue;
use schemars::JsonSchema;
use schemars::generate::{SchemaGenerator, SchemaSettings};
use serde::Serialize;
use serde_json::{Value, json};

use super::screen::Screen;
use super::{CliError, Ending};
use crate::io::json::further_schemas::{campaign_schema, compensation_schema};
use crate::io::json::schema::{model_schema, pattern_schema, record_schema, schedule_schema};
use crate::io::json::{
    CheckJson, CompletionsJson, Document, EvaluateJson, ExactJson, PatternsJson, ReportJson, SchemaJson, VerifyJson,
    WrittenJson,
};
use crate::io::json::{
    campaign, comparison, diagnosis, effects, explore, extend, fibres, field, improve, metrics, pareto,
};
use crate::io::json::{proposals, schedule, search, stress, temperatures, tolerance, trim};
use crate::io::write::compensation_file::CompensateJson;
use crate::report::{thesis2021, yan1998};

/// The JSON Schema of a file format, or of what a command answers
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright schema model > coilwright-model.schema.json\n  coilwright schema campaign\n  coilwright schema --answer evaluate"
)]
pub(crate) struct Arguments {
    /// Which files it is about
    #[arg(value_enum, required_unless_present = "answer", conflicts_with = "answer")]
    kind: Option<Kind>,
    /// What this command answers with --format json
    #[arg(long, value_enum, value_name = "COMMAND")]
    answer: Option<Answer>,
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

/// Commands that answer with a document; a test holds them against the program's own list.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Answer {
    Campaign,
    Check,
    Compare,
    Compensate,
    Completions,
    Diagnose,
    Effects,
    Evaluate,
    Exact,
    Explore,
    Extend,
    Fibres,
    Improve,
    Man,
    Materials,
    Metrics,
    New,
    Optimise,
    Pareto,
    Patterns,
    Potting,
    Report,
    Reproduce,
    Schedule,
    Schema,
    Stress,
    Temperatures,
    Tolerance,
    Trim,
    Verify,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let named = |value: Option<PossibleValue>| value.map_or_else(String::new, |value| value.get_name().to_owned());
    let (kind, mut schema) = match (arguments.kind, arguments.answer) {
        (Some(kind), _) => (named(kind.to_possible_value()), schema_of_file(kind)),
        (None, Some(command)) => {
            (format!("answer of {}", named(command.to_possible_value())), schema_of_answer(command))
        }
        (None, None) => {
            let message = "name a kind of file, or a command by --answer".to_owned();
            return Err(CliError::Option { option: "schema", message });
        }
    };
    if let (Some(command), Value::Object(map)) = (arguments.answer, &mut schema) {
        map.insert("title".to_owned(), format!("Answer of coilwright {}", named(command.to_possible_value())).into());
    }
    screen.answer(SchemaJson { kind, schema }, |body| format!("{:#}\n", body.schema))?;
    Ok(Ending::Done)
}

fn schema_of_file(kind: Kind) -> Value {
    match kind {
        Kind::Model => model_schema(),
        Kind::Pattern => pattern_schema(),
        Kind::Record => record_schema(),
        Kind::Schedule => schedule_schema(),
        Kind::Campaign => campaign_schema(),
        Kind::Compensation => compensation_schema(),
    }
}

/// Derived from the types that the commands answer with, so it holds the keys that are written, and their descriptions.
fn schema_of_answer(command: Answer) -> Value {
    match command {
        Answer::Campaign => either::<campaign::CampaignJson, campaign::WorkflowJson>(),
        Answer::Check => only::<CheckJson>(),
        Answer::Compare => only::<comparison::CompareJson>(),
        Answer::Compensate => only::<CompensateJson>(),
        Answer::Completions => only::<CompletionsJson>(),
        Answer::Diagnose => only::<diagnosis::DiagnosisJson>(),
        Answer::Effects => only::<effects::EffectsJson>(),
        Answer::Evaluate => only::<EvaluateJson>(),
        Answer::Exact => only::<ExactJson>(),
        Answer::Explore => only::<explore::ExploreJson>(),
        Answer::Extend => either::<extend::ExtendJson, proposals::ProposalExtendJson>(),
        Answer::Fibres => only::<fibres::FibresJson>(),
        Answer::Improve => only::<improve::ImproveJson>(),
        Answer::Man | Answer::New => only::<WrittenJson>(),
        Answer::Materials => only::<stress::MaterialsJson>(),
        Answer::Metrics => only::<metrics::MetricsJson>(),
        Answer::Optimise => either::<search::OptimiseJson, field::FieldSearchJson>(),
        Answer::Pareto => only::<pareto::ParetoJson>(),
        Answer::Patterns => only::<PatternsJson>(),
        Answer::Potting => only::<stress::PottingJson>(),
        Answer::Report => only::<ReportJson>(),
        Answer::Reproduce => either::<yan1998::PaperReproductionJson, thesis2021::ThesisReproductionJson>(),
        Answer::Schedule => generator().into_root_schema_for::<schedule::ScheduleJson>().to_value(),
        Answer::Schema => only::<SchemaJson>(),
        Answer::Stress => only::<stress::StressJson>(),
        Answer::Temperatures => only::<temperatures::TemperaturesJson>(),
        Answer::Tolerance => only::<tolerance::ToleranceJson>(),
        Answer::Trim => only::<trim::TrimJson>(),
        Answer::Verify => only::<VerifyJson>(),
    }
}

/// Of what is written, not of what could be read: a key that is always there is required.
fn generator() -> SchemaGenerator {
    SchemaSettings::draft2020_12().for_serialize().into_generator()
}

fn only<T: Serialize + JsonSchema>() -> Value {
    generator().into_root_schema_for::<Document<T>>().to_value()
}

/// Of a command that answers one of two questions.
fn either<T: Serialize + JsonSchema, U: Serialize + JsonSchema>() -> Value {
    let mut generator = generator();
    let both = [generator.subschema_for::<Document<T>>(), generator.subschema_for::<Document<U>>()];
    let dialect = generator.settings().meta_schema.clone();
    json!({ "$schema": dialect, "anyOf": both, "$defs": generator.take_definitions(true) })
}
