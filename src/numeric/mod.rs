//! Mathematics without domain words; what a well-kept library has is called, not written again.

pub mod allan;
pub mod coloured;
pub mod exponential;
pub mod expression;
mod kalman;
pub mod lobatto;
pub mod maximise;
pub mod noise;
pub mod piecewise;
pub mod pyramid;
pub mod quantiles;
pub mod span;
pub mod spectrum;
pub mod state_space;
pub mod statistics;
pub mod tridiagonal;
