//! Numbers checked against something outside the program; each file's head names its reference.

mod exact_integers;
mod paper;
