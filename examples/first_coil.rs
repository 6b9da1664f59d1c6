//! The library in one page: from a model file to a winding's worst rate error.
//!
//! Run it with `cargo run --example first_coil`.

use std::error::Error;
use std::path::Path;

use coilwright::io::read::model_file::read_model;
use coilwright::pattern::classic::Classic;
use coilwright::pattern::windability::WindingGraph;
use coilwright::search::cost::worst_case::SolvedProfiles;
use coilwright::units::deg_per_h_from_rad_per_s;

fn main() -> Result<(), Box<dyn Error>> {
    let file = read_model(&Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/paper-200m.toml"))?;
    println!("{}: {:.0} m in {} layers", file.model.name, file.model.coil.length_m(), file.model.coil.layers());

    // The temperature field does not depend on the winding: it is solved once for all of them.
    let solved = SolvedProfiles::new(&file.model, &file.profiles.profiles())?;
    for classic in [Classic::Zyl, Classic::Sym, Classic::Dip, Classic::Qua] {
        let pattern = classic.pattern(file.model.coil.layers())?;
        let worst = solved.worst_case(&file.model, &pattern)?;
        println!(
            "{:<4} {:7.4} °/h after {:.1} s of {}; {}",
            classic.key(),
            deg_per_h_from_rad_per_s(worst.rate_rad_per_s.abs()),
            worst.time_s,
            worst.profile,
            WindingGraph::new(&pattern).windability().class(),
        );
    }
    Ok(())
}
