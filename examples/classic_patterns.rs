//! Writes the pattern files of the classic windings: `cargo run --example classic_patterns -- patterns`
//!
//! Shows how to take a winding by its name, to ask what it demands of the winding shop, to compute its worst rate
//! error, and to write it as a pattern file.

use std::error::Error;
use std::path::Path;

use coilwright::io::files::write_atomically;
use coilwright::io::model::NamedPattern;
use coilwright::io::read::pattern_file::print_pattern;
use coilwright::pattern::classic::Classic;
use coilwright::pattern::windability::WindingGraph;
use coilwright::reproduce::yan1998;
use coilwright::search::cost::worst_case::SolvedProfiles;
use coilwright::text::sink::TomlComment;
use coilwright::units::deg_per_h_from_rad_per_s;

const LAYER_COUNTS: [usize; 11] = [8, 12, 16, 20, 24, 28, 32, 36, 40, 44, 48];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("give the folder to write to")?;
    for layers in LAYER_COUNTS {
        let model = yan1998::model_of_layers(200.0, layers)?;
        let solved = SolvedProfiles::new(&model, &[yan1998::profile()])?;
        for classic in Classic::ALL {
            // A layer count that is no multiple of the winding's word has no such winding.
            let Ok(pattern) = classic.pattern(layers) else { continue };
            let worst = solved.worst_case(&model, &pattern)?;
            let demands = WindingGraph::new(&pattern).windability();
            let comments = [
                format!("{}, {layers} layers: a classic, from its rule; no search, no seed", classic.title()),
                format!("coil: the one of examples/paper-200m.toml with {layers} layers on the same mean diameter"),
                "objective: worst |rate error| during and after 10 degC/h for 1500 s".to_owned(),
                format!("value: {:.4} deg/h", deg_per_h_from_rad_per_s(worst.rate_rad_per_s.abs())),
                format!(
                    "windability: {}; reels {}, longest climb {} layers",
                    demands.class(),
                    demands.reels,
                    demands.max_climb
                ),
            ];
            let named = NamedPattern { name: format!("{}-{layers}", classic.key()), pattern };
            let path = Path::new(&folder).join(format!("{}.toml", named.name));
            write_atomically(&path, print_pattern(&named, &comments.map(TomlComment::of)).as_bytes())?;
        }
    }
    Ok(())
}
