//! The `[tolerance]` table of a model file: how much what is built spreads.

use crate::search::cost::tolerance::{AsBuilt, ToleranceSpec};
use crate::units::{fraction_from_percent, m_from_mm, rad_per_s_from_deg_per_h};

use super::toml_reader::{Limits, TableReader, TomlReader};

const DEFAULT_SAMPLES: i64 = 400;

/// The `[tolerance]` table, if there is one; spreads that are not stated are zero.
pub(super) fn read_tolerance(r: &mut TomlReader, table: &mut TableReader) -> Option<ToleranceSpec> {
    let present = table.is_present();
    let mut sd = |r: &mut TomlReader, key: &'static str, most: f64| {
        table.number(r, key, Limits::between(0.0, most)).unwrap_or(0.0)
    };
    let turns_per_layer_sd = sd(r, "turns_per_layer_sd", 1e3);
    let radial_pitch_percent = sd(r, "radial_pitch_percent_sd", 30.0);
    let midpoint_offset_mm = sd(r, "midpoint_offset_mm_sd", 1e4);
    let diffusivity_percent = sd(r, "diffusivity_percent_sd", 100.0);
    let film_percent = sd(r, "film_percent_sd", 100.0);
    let mismatch_sd = sd(r, "mismatch_sd", 0.3);
    let lost_turns_mean = sd(r, "lost_turns_per_layer_mean", 100.0);
    let layer_pitch_percent = sd(r, "layer_pitch_percent_sd", 30.0);
    let flange_film_percent = sd(r, "flange_film_percent_sd", 100.0);
    let trim_residue_mm = sd(r, "trim_residue_mm", 1e4);
    let samples = table.integer(r, "samples", 2, 100_000).unwrap_or(DEFAULT_SAMPLES);
    let seed = table.integer(r, "seed", 0, i64::MAX).unwrap_or(1);
    let limit = table.number(r, "limit_deg_per_h", Limits::between(1e-12, 1e9));
    present.then(|| ToleranceSpec {
        turns_per_layer_sd,
        radial_pitch_sd: fraction_from_percent(radial_pitch_percent),
        midpoint_offset_sd_m: m_from_mm(midpoint_offset_mm),
        diffusivity_sd: fraction_from_percent(diffusivity_percent),
        film_sd: fraction_from_percent(film_percent),
        mismatch_sd,
        as_built: AsBuilt {
            lost_turns_mean,
            layer_pitch_sd: fraction_from_percent(layer_pitch_percent),
            flange_film_sd: fraction_from_percent(flange_film_percent),
            trim_residue_m: m_from_mm(trim_residue_mm),
        },
        samples: samples as usize,
        seed: seed as u64,
        limit_rad_per_s: limit.map(rad_per_s_from_deg_per_h),
    })
}
