//! What a reader sees: charts, drawings and pages.

pub mod allan;
pub mod built_coils;
pub mod campaign;
pub mod comparison;
pub mod compensation;
pub mod cross_section;
pub mod diagnosis;
pub mod explorer;
pub mod fleet;
pub mod improvement;
pub mod ladder;
pub mod measurement;
pub mod noise;
pub mod page;
pub mod plot;
pub mod proposal;
pub mod search_run;
pub mod temperatures;
pub mod thesis2021;
pub mod traveller;
mod words;
pub mod yan1998;
