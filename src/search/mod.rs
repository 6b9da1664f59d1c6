//! What the best pattern is: costs, annealing, proofs.

pub mod anneal;
pub mod compile;
pub mod cost;
pub mod evaluator;
pub mod pareto;
pub mod proof;
