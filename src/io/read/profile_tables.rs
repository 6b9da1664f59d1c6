//! The `[profiles]` table of a model file: listed ramps, and how further ones are sampled.

use crate::io::fault::Fault;
use crate::profile::{Piece, Profile, ProfileSpec};
use crate::units::k_per_s_from_c_per_h;

use super::toml_reader::{Limits, TableReader, TomlReader};

/// The `[profiles]` table, or what stands in for it.
pub(super) fn read_profiles(r: &mut TomlReader, table: &mut TableReader) -> ProfileSpec {
    let rate = Limits::between(1e-6, 1e6);
    let max_rate = if table.is_present() { table.needed_number(r, "max_rate_c_per_h", rate) } else { None };
    let usual = ProfileSpec::default();
    let count = table.integer(r, "count", 0, 100_000).map_or(usual.count, |count| count as usize);
    let segments = table.integer(r, "segments", 1, 1_000).map_or(usual.segments, |segments| segments as usize);
    let duration_s = table.number(r, "duration_s", Limits::between(1e-3, 1e8)).unwrap_or(usual.duration_s);
    let seed = table.integer(r, "seed", 0, i64::MAX).map_or(usual.seed, |seed| seed as u64);
    let mut listed: Vec<Profile> = Vec::new();
    let ramps = table.tables(r, "ramp");
    if count == 0 && ramps.is_empty() {
        let message = "profiles.count is 0 and no profile is listed: list a [[profiles.ramp]] or sample some";
        r.fault(Fault::new(message, table.span_of("count")));
    }
    for mut ramp in ramps {
        if let Some(profile) = read_ramp(r, &mut ramp, max_rate) {
            if listed.iter().any(|p| p.name() == profile.name()) {
                let message = format!("two profiles are called \"{}\": rename one", profile.name());
                r.fault(Fault::new(message, ramp.span_of("name")));
            }
            listed.push(profile);
        }
        ramp.finish(r);
    }
    ProfileSpec {
        max_rate_k_per_s: max_rate.map_or(usual.max_rate_k_per_s, k_per_s_from_c_per_h),
        count,
        segments,
        duration_s,
        seed,
        listed,
    }
}

/// The field is kept at about a hundred instants a ramp in every layer; this many of them take about a gigabyte.
const MOST_RAMPS_TIMES_LAYERS: usize = 500_000;

/// Why profiles cannot all be held at once, if they cannot.
pub(super) fn too_many_ramps(profiles: &ProfileSpec, layers: usize) -> Option<String> {
    let listed: usize = profiles.listed.iter().map(|p| p.pieces().len()).sum();
    let ramps = profiles.count.saturating_mul(profiles.segments).saturating_add(listed);
    let most = MOST_RAMPS_TIMES_LAYERS / layers;
    (ramps > most).then(|| {
        format!(
            "profiles.count × profiles.segments make {ramps} ramps, found with {layers} layers: expected at most {most}, \
             more do not fit into memory"
        )
    })
}

fn read_ramp(r: &mut TomlReader, table: &mut TableReader, max_rate_c_per_h: Option<f64>) -> Option<Profile> {
    let name = table.needed_name(r, "name");
    let pieces_span = table.span_of("pieces").or_else(|| table.span());
    if !table.has("pieces") {
        table.note_missing_one_of(&["pieces"], "an array of { rate_c_per_h, duration_s }".to_owned());
    }
    let mut pieces = Vec::new();
    let faults_before = r.fault_count();
    for mut piece in table.tables(r, "pieces") {
        let rate = piece.needed_number(r, "rate_c_per_h", Limits::between(-1e6, 1e6));
        let duration = piece.needed_number(r, "duration_s", Limits::between(1e-6, 1e8));
        if let (Some(rate), Some(most)) = (rate, max_rate_c_per_h)
            && rate.abs() > most * (1.0 + 1e-12)
        {
            let message = format!(
                "profiles.ramp.pieces.rate_c_per_h must not exceed profiles.max_rate_c_per_h = {most}, found {rate}: \
                 raise the bound, the guaranteed worst case rests on it"
            );
            r.fault(Fault::new(message, piece.span_of("rate_c_per_h")));
        }
        if let Some((rate, duration_s)) = rate.zip(duration) {
            pieces.push(Piece { rate_k_per_s: k_per_s_from_c_per_h(rate), duration_s });
        }
        piece.finish(r);
    }
    let name = name?;
    if r.fault_count() > faults_before || !table.has("pieces") {
        return None;
    }
    match Profile::new(name, pieces) {
        Ok(profile) => Some(profile),
        Err(error) => {
            r.fault(Fault::new(format!("profiles.ramp \"{name}\": {error}"), pieces_span));
            None
        }
    }
}
