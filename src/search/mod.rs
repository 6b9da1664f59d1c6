//! What the best pattern is: worst cases, objectives, annealing, proofs.

pub mod anneal;
pub mod builds;
pub mod columns;
pub mod exact;
pub mod guaranteed;
pub mod limits;
pub mod objective;
pub mod optimise;
pub mod pareto;
pub mod robust;
pub mod samples;
pub mod signs;
pub mod tolerance;
pub mod verdict;
pub mod walk;
pub mod worst_case;
