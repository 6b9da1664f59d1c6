//! What the best pattern is: worst cases, objectives, annealing, proofs.

pub mod worst_case;
