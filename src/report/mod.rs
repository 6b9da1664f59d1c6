//! What a reader sees: charts, drawings and pages.

pub(crate) mod allan;
pub(crate) mod built_coils;
pub(crate) mod campaign;
pub(crate) mod comparison;
pub(crate) mod compensation;
pub mod cross_section;
pub(crate) mod diagnosis;
pub(crate) mod explorer;
pub(crate) mod field_search;
pub(crate) mod fleet;
pub(crate) mod improvement;
pub(crate) mod ladder;
pub(crate) mod measurement;
pub(crate) mod noise;
pub mod page;
pub mod plot;
pub(crate) mod proposal;
pub(crate) mod search_run;
pub(crate) mod temperatures;
pub mod thesis2021;
pub mod traveller;
mod words;
pub mod yan1998;
