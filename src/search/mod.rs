//! What the best pattern is: worst cases, objectives, annealing, proofs.

pub mod columns;
pub mod samples;
pub mod worst_case;
