//! Files out: the folders and files that commands leave behind, each written whole or not at all.
//!
//! What only this program writes and reads again (a checkpoint, the parts of a front, the cells of a campaign) is read here too.

pub(crate) mod boundary_edit;
pub(crate) mod campaign_cells;
pub(crate) mod campaign_tables;
pub mod checkpoint;
pub(crate) mod comparison_rows;
pub mod compensation_file;
pub mod difference_equation;
pub mod empirical_export;
pub(crate) mod field_rates;
pub(crate) mod field_table;
mod formulas_in_c;
mod header_template;
pub(crate) mod leave_one_out;
pub mod machine_program;
pub mod measurement_folder;
pub(crate) mod measures;
pub mod model_edit;
pub mod model_template;
pub(crate) mod model_tuning;
pub mod pareto_parts;
pub mod run_directory;
pub(crate) mod sample_table;
pub mod stream_summary;
pub mod traveller;
pub mod workflow;
