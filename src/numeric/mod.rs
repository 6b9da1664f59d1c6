//! Mathematics without domain words; what a well-kept library has is called, not written again.

pub mod allan;
pub mod coloured;
pub mod expression;
pub(crate) mod hermite;
pub(crate) mod lobatto;
pub(crate) mod maximise;
pub(crate) mod noise;
pub(crate) mod order;
pub mod piecewise;
pub(crate) mod pursuit;
pub mod pyramid;
pub(crate) mod quantiles;
pub(crate) mod spectrum;
pub mod statistics;
pub mod tridiagonal;
