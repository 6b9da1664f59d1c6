//! What the best pattern is: costs, annealing, proofs, and the use case that puts them together.

pub mod anneal;
pub(crate) mod answer;
pub(crate) mod aside;
pub(crate) mod companions;
pub mod compile;
pub mod cost;
pub mod custom;
pub(crate) mod cutting;
pub mod end_turns;
pub mod evaluator;
pub(crate) mod optimality;
pub(crate) mod outlook;
pub(crate) mod pareto;
pub mod proof;
pub(crate) mod prospect;
mod provoked;
pub(crate) mod recommendation;
mod rehearsal;
pub(crate) mod request;
pub mod run;
pub(crate) mod swap;
pub(crate) mod validation;
mod weighed_pointing;
mod weighing;

pub use answer::{Answer, Ended};
pub use cost::objective::Objective;
pub use request::{Observer, Request, Unobserved};
pub use run::run;
