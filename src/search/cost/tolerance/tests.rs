//! Seeds, closed forms and what cannot be studied.

use super::*;
use crate::coil::LayerLength;
use crate::pattern::classic::Classic;
use crate::search::cost::samples::tests::{model, profiles};

fn profile_spec() -> ProfileSpec {
    let listed = profiles();
    ProfileSpec { max_rate_k_per_s: 0.003, count: 0, segments: 1, duration_s: 100.0, seed: 1, listed }
}

fn exact() -> ToleranceSpec {
    ToleranceSpec {
        turns_per_layer_sd: 0.0,
        radial_pitch_sd: 0.0,
        midpoint_offset_sd_m: 0.0,
        diffusivity_sd: 0.0,
        film_sd: 0.0,
        mismatch_sd: 0.0,
        samples: 200,
        seed: 3,
        limit_rad_per_s: None,
    }
}

#[test]
fn a_spread_of_the_mismatch_alone_has_the_quantiles_of_its_closed_form() {
    // A pattern without any error of its own: the worst case of coil and mismatch is linear in |m| once m is large.
    let model = model(8, LayerLength::Equal, &[]);
    let spec = ToleranceSpec { mismatch_sd: 0.05, limit_rad_per_s: Some(1.0), ..exact() };
    let qua = Classic::Qua.pattern(8).unwrap();
    let found = &study(&model, &profile_spec(), &spec, &[qua]).unwrap()[0];
    assert_eq!(found.variance_shares, vec![(Spread::Mismatch, 1.0)]);
    assert_eq!(found.yield_share, Some(1.0));
    assert!(found.median_rad_per_s() <= found.p95_rad_per_s() && found.p95_rad_per_s() <= found.p99_rad_per_s());
    let fibre = model.coil.fibre();
    let per_mismatch = fibre.refractive_index * fibre.path_per_k() * model.coil.length_m() * 0.003
        / (4.0 * model.coil.mean_diameter_m());
    // The settled part n κ m L Ṫ/4D is a lower bound of what a mismatch adds to |G(∞)|.
    assert!(found.p95_rad_per_s() >= 1.5 * 0.05 * per_mismatch);
}

#[test]
fn the_same_seed_gives_the_same_coils_and_another_seed_others() {
    let model = model(8, LayerLength::Actual, &["surface_film"]);
    let spec = ToleranceSpec {
        turns_per_layer_sd: 0.3,
        radial_pitch_sd: 0.01,
        diffusivity_sd: 0.1,
        film_sd: 0.2,
        midpoint_offset_sd_m: 0.02,
        samples: 12,
        ..exact()
    };
    let patterns = [Classic::Dip.pattern(8).unwrap(), Classic::Qua.pattern(8).unwrap()];
    let of = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| study(&model, &profile_spec(), &ToleranceSpec { seed, ..spec.clone() }, &patterns).unwrap())
    };
    assert_eq!(of(1, 3), of(2, 3));
    assert_ne!(of(1, 3), of(1, 4));
    let shares: f64 = of(1, 3)[0].variance_shares.iter().map(|s| s.1).sum();
    assert!((shares - 1.0).abs() < 1e-12);
}

#[test]
fn a_film_that_is_not_there_cannot_spread_and_no_spread_is_no_study() {
    let model = model(8, LayerLength::Equal, &[]);
    let qua = [Classic::Qua.pattern(8).unwrap()];
    let error = study(&model, &profile_spec(), &ToleranceSpec { film_sd: 0.1, ..exact() }, &qua).unwrap_err();
    assert_eq!(error, ToleranceError::NoFilm);
    assert_eq!(study(&model, &profile_spec(), &exact(), &qua).unwrap_err(), ToleranceError::NoSpread);
}
