//! Mathematics without domain words; what a well-kept library has is called, not written again.

pub mod allan;
pub mod coloured;
pub mod expression;
pub mod lobatto;
pub mod maximise;
pub mod noise;
pub mod piecewise;
pub mod pyramid;
pub mod quantiles;
pub mod spectrum;
pub mod statistics;
pub mod tridiagonal;
