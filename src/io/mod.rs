//! Files in, files out: the only place (with `report`) that knows serde, paths, TOML, CSV and JSON.

pub mod checkpoint;
pub mod comparison_json;
pub mod diagnosis_json;
mod effect_tables;
pub mod effects_json;
pub mod fault;
pub mod files;
pub mod json;
pub mod machine_program;
pub mod metrics_json;
pub mod model_edit;
pub mod model_file;
pub mod pattern_file;
mod production_table;
mod profile_tables;
pub mod record_file;
pub mod run_directory;
pub mod run_reader;
pub mod sample_table;
pub mod schedule_file;
pub mod schedule_reader;
pub mod schema;
pub mod temperature_file;
pub mod tolerance_json;
mod tolerance_table;
pub mod toml_reader;
pub mod traveller;
