//! What the best pattern is: costs, annealing, proofs, and the use case that puts them together.

pub mod anneal;
pub mod answer;
pub mod aside;
pub mod companions;
pub mod compile;
pub mod cost;
pub mod custom;
pub mod cutting;
pub mod end_turns;
pub mod evaluator;
pub mod outlook;
pub mod pareto;
pub mod proof;
pub mod prospect;
pub mod recommendation;
mod rehearsal;
pub mod run;
pub mod swap;
pub mod validation;
mod weighing;

pub use answer::Answer;
pub use run::{Observer, Request, Unobserved, run};
