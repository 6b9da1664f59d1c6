//! Numbers checked against something outside the program; each file's head names its reference.

mod allan;
mod compensation;
mod conductivity;
mod controls;
mod diagnosis;
mod effects;
mod every_pattern;
mod exact_integers;
mod exhaustive;
mod flange;
mod fog_v7;
mod grid;
mod heat_paths;
mod memory;
mod pack;
mod paper;
mod records;
mod stress;
mod truth;
mod unlisted;
