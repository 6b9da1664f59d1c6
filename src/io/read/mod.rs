//! Files in: models, patterns, profiles, records, campaigns, and what the program itself wrote, to be shown or verified.
//!
//! A reader collects every fault of its file with the source line; a format that people write too is printed beside its
//! reader, so that what is printed can be read.

mod averaging;
pub(crate) mod boundary_table;
pub mod campaign_file;
pub(crate) mod csv_rows;
pub(crate) mod effect_tables;
mod fibre_table;
mod field_columns;
pub mod field_file;
mod kind_of_file;
mod limits;
pub(crate) mod materials_table;
pub mod model_file;
mod nearest;
pub mod pattern_file;
pub mod plausibility;
pub mod posterior;
mod production_table;
pub mod profile_file;
mod profile_tables;
pub(crate) mod proposal_file;
pub mod record_columns;
pub mod record_file;
pub(crate) mod record_head;
pub mod record_rows;
pub(crate) mod run_reader;
pub mod schedule_reader;
mod stamps;
pub mod table_file;
mod tolerance_table;
pub(crate) mod toml_reader;
