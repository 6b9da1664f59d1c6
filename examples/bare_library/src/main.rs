//! The library alone, without files, command line or pictures: a coil built in code, and its worst rate error.
//!
//! `cargo run --package bare-library`; the gate also runs it as WebAssembly.

use std::error::Error;

use coilwright::thermal::Extent;
use coilwright::units::k_per_s_from_c_per_h;
use coilwright::{Classic, CoilModel, Piece, Profile, ProfileSpec, SolvedProfiles};

fn main() -> Result<(), Box<dyn Error>> {
    // The 200 m coil of Yan, Lan, Jian (1998), as in examples/paper-200m.toml.
    let model = CoilModel::builder("paper 200 m", 12)
        .mean_diameter_m(0.075)
        .length_m(200.0)
        .extent(Extent::HalfSpace)
        .build()?;
    let steepest_k_per_s = k_per_s_from_c_per_h(10.0);
    let ramp = Piece { rate_k_per_s: steepest_k_per_s, duration_s: 1500.0 };
    let soak = Piece { rate_k_per_s: 0.0, duration_s: 4500.0 };
    let profiles = ProfileSpec {
        max_rate_k_per_s: steepest_k_per_s,
        listed: vec![Profile::new("paper", vec![ramp, soak])?],
        ..ProfileSpec::default()
    };
    let solved = SolvedProfiles::new(&model, &profiles.profiles())?;
    let worst = solved.worst_case(&model, &Classic::Qua.pattern(model.coil.layers())?)?;
    println!("{}, qua: {worst}", model.name);
    // As `coilwright evaluate examples/paper-200m.toml` prints it.
    assert_eq!(worst.to_string(), "4.3366 °/h at 5122.0 s of sampled-49");
    Ok(())
}
