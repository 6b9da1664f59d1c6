//! The annealer: one restart, rounds of restarts, and the steps that stay within what the winding shop puts up with.

pub(crate) mod limits;
pub(crate) mod quantile;
pub mod restart;
pub mod rounds;
pub mod sample_cost;
pub mod walk;
mod windows;
