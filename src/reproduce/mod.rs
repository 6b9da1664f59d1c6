//! Published results worked through again: what was printed beside what the equations give, every difference named.

pub mod thesis2021;
pub mod yan1998;
