//! coilwright designs winding patterns of fibre-optic-gyroscope coils.
//!
//! When the temperature changes, points that mirror each other about the fibre's middle warm at different rates and
//! the gyro reports a rotation that is not there (the Shupe effect). Which piece of fibre lies in which layer decides
//! how much. `ARCHITECTURE.md` shows the floors; each module imports only from the floors below its own.
//!
//! Quantities are in SI and their names end in the unit; [`RotationRate`](units::RotationRate) shows a rate in °/h.
//!
//! # Example
//! The winding whose worst rate error over random ramps of temperature is the smallest, beside the classic ones:
//! ```
//! use coilwright::{CoilModel, ProfileSpec, search};
//!
//! let model = CoilModel::builder("a coil of 200 m", 12).mean_diameter_m(0.075).length_m(200.0).build()?;
//! let ramps = ProfileSpec { count: 4, ..ProfileSpec::default() };
//! let request = search::Request::new(&model, &ramps);
//! let answer = search::run(&request, &mut search::Unobserved)?.expect("nobody ends it");
//! println!("wind {:?}: {}", answer.best.pattern.segments(), answer.best.worst); // "… °/h at … s of …"
//! for classic in &answer.baselines {
//!     // But for rounding: windings may tie.
//!     assert!(answer.best.objective_rad_per_s <= classic.objective_rad_per_s * (1.0 + 1e-9), "{}", classic.name);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! How large the rate error of a quadrupole winding becomes while a coil's surface warms at 10 °C/h:
//! ```
//! use coilwright::{Classic, CoilModel, Piece, Profile, SolvedProfiles, units::k_per_s_from_c_per_h};
//!
//! let model = CoilModel::builder("a coil of 200 m", 12).mean_diameter_m(0.075).length_m(200.0).build()?;
//! let ramp = Piece { rate_k_per_s: k_per_s_from_c_per_h(10.0), duration_s: 1500.0 };
//! let solved = SolvedProfiles::new(&model, &[Profile::new("ramp", vec![ramp])?])?;
//! let [zyl, qua] = [Classic::Zyl, Classic::Qua].map(|classic| classic.pattern(12));
//! let (zyl, qua) = (solved.worst_case(&model, &zyl?)?, solved.worst_case(&model, &qua?)?);
//! println!("ZYL {zyl}, QUA {qua}"); // each as "… °/h at … s of ramp"
//! // What a quadrupole is for.
//! assert!(qua.rate_rad_per_s.abs() < zyl.rate_rad_per_s.abs());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Features
//! `cli` (the command line) and `report` (pages and pictures) are on by default. Without them the library also builds for
//! `wasm32-unknown-unknown`.

// What is not meant for others is `pub(crate)`, and what nobody uses goes. The build with all default features is the one that
// tells: without them, what only the command line, pages or tables use counts as unused or out of reach.
#![cfg_attr(all(feature = "cli", feature = "mat"), warn(unreachable_pub))]
// What others can use says what it is; a variant of an error says it by its message.
#![warn(missing_docs)]
// A body that outgrows 60 lines (clippy.toml) holds two steps, or says why it does not.
#![cfg_attr(not(test), warn(clippy::too_many_lines))]
#![cfg_attr(not(all(feature = "cli", feature = "mat")), allow(dead_code, unused_imports))]
// The heads of modules speak to those who read the source.
#![allow(rustdoc::private_intra_doc_links)]

// Floor 0: units, mathematics and text without domain words, and what runs on all processors.
pub mod numeric;
pub(crate) mod parallel;
pub mod text;
pub mod units;
// Floor 1: what a coil, a pattern, a profile and a record are.
pub mod coil;
pub mod pattern;
pub mod profile;
pub mod record;
// Floor 2: heat and effects.
pub mod effect;
pub mod stress;
pub mod thermal;
// Floor 3: the readable reference of the rate error.
pub mod rate;
// Floor 4: what is done with it.
pub(crate) mod chamber;
pub mod compare;
pub mod compensate;
pub mod diagnose;
pub(crate) mod metrics;
pub mod predict;
pub mod reproduce;
pub mod schedule;
pub mod search;
pub mod verify;
// Floor 5: files and pages.
pub mod io;
#[cfg(feature = "report")]
pub mod report;
// Floor 6: what the program is asked for.
pub mod task;
// Floor 7: the command line.
#[cfg(feature = "cli")]
pub mod cli;

// What most users begin with.
pub use effect::DeclaredEffect;
pub use pattern::{Pattern, classic::Classic};
pub use profile::{Piece, Profile, ProfileSpec};
pub use rate::{CoilModel, CoilModelBuilder, RateModel};
pub use record::Record;
pub use search::cost::worst_case::{SolvedProfiles, WorstCase};
