//! Files in, files out: the only place (with `report`) that knows serde, paths, TOML, CSV and JSON.
//!
//! Inside, `json` (the documents) knows neither of the others, `read` may use `json`, and `write` both.

pub mod fault;
pub mod files;
pub mod folder;
pub mod json;
pub mod model;
pub mod read;
pub(crate) mod record_format;
pub(crate) mod table;
pub mod write;
