//! The private module `coilwright._coilwright`: what the typed package above it calls.
//!
//! Every use case takes plain arguments and answers with the JSON document that the command of its name prints, so that both are the
//! same to the last digit.

mod arrays;
mod arrow;
mod compensation;
mod custom;
mod error;
mod field;
mod further;
mod model;
mod pattern;
mod reads;
mod record;
mod search;
mod tasks;
mod worker;

use pyo3::prelude::*;

/// The command line with the given words; its exit code.
#[pyfunction]
fn command(py: Python, words: Vec<String>) -> u8 {
    py.detach(|| coilwright::cli::run_with(words))
}

#[pymodule(gil_used = false)]
mod _coilwright {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::arrow::{arrow_columns, arrow_stream};
    #[pymodule_export]
    use super::command;
    #[pymodule_export]
    use super::compensation::{CompensatorHandle, StreamHandle, compensate_all, compensate_file, compensator};
    #[pymodule_export]
    use super::custom::{search_field, search_function, search_matrix, time_search_matrix};
    #[pymodule_export]
    use super::field::{FieldHandle, evaluate_field, field_of, sensitivities, temperatures};
    #[pymodule_export]
    use super::further::{bang_bang, campaign, campaign_workflow, explore, report, reproduce, schema, template};
    #[pymodule_export]
    use super::model::{ModelHandle, check_model, effects, read_model};
    #[pymodule_export]
    use super::pattern::{check_pattern, classic, classics, print_pattern, read_pattern, windability, winding_graph};
    #[pymodule_export]
    use super::record::{RecordHandle, read_record, record_of};
    #[pymodule_export]
    use super::search::{exact, optimise, pareto};
    #[pymodule_export]
    use super::tasks::{compare, diagnose, evaluate, extend, improve, metrics, schedule, tolerance, trim, verify};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("threads", rayon_threads())?;
        module.add("optimised", !cfg!(debug_assertions))?;
        Ok(())
    }

    fn rayon_threads() -> usize {
        std::thread::available_parallelism().map_or(1, usize::from)
    }
}
