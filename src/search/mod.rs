//! What the best pattern is: costs, annealing, proofs, and the use case that puts them together.

pub mod anneal;
pub mod answer;
pub mod companions;
pub mod compile;
pub mod cost;
pub mod custom;
pub mod evaluator;
pub mod gain;
mod outlook;
pub mod pareto;
pub mod proof;
pub mod recommendation;
pub mod run;
pub mod validation;

pub use answer::Answer;
pub use run::{Observer, Request, Unobserved, run};
