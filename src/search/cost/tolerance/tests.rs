//! Seeds, closed forms and what cannot be studied.

use super::*;
use crate::coil::LayerLength;
use crate::effect::DeclaredEffect;
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
        as_built: AsBuilt::default(),
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

#[test]
fn lost_turns_are_whole_and_as_many_on_average_as_stated() {
    let model = model(8, LayerLength::Actual, &[]);
    let (mean, coils) = (0.7, 2000);
    let spec = ToleranceSpec { as_built: AsBuilt { lost_turns_mean: mean, ..AsBuilt::default() }, ..exact() };
    let drawn = Deviates::of(4, 8, 0..coils, true);
    let lost: Vec<f64> = drawn
        .iter()
        .flat_map(|coil| built(&model, &spec, &[Spread::LostTurns], coil).unwrap().coil.turns().to_vec())
        .map(|turns| 50.0 - turns)
        .collect();
    assert!(lost.iter().all(|turns| turns.fract() == 0.0 && *turns >= 0.0));
    // Mean and variance of a Poisson variable are the same; four standard errors.
    let count = lost.len() as f64;
    assert!((lost.iter().mean() - mean).abs() < 4.0 * (mean / count).sqrt());
    assert!((lost.iter().variance() - mean).abs() < 4.0 * ((mean + 2.0 * mean * mean) / count).sqrt());
}

#[test]
fn a_layer_s_own_pitch_moves_the_radii_of_the_layers_above_as_a_sum_of_what_is_below() {
    let model = model(24, LayerLength::Actual, &[]);
    let as_built = AsBuilt { layer_pitch_sd: 0.02, ..AsBuilt::default() };
    let spec = ToleranceSpec { as_built, ..exact() };
    let drawn = Deviates::of(4, 24, 0..4000, true);
    let outermost: Vec<f64> = drawn
        .iter()
        .map(|coil| {
            let coil = built(&model, &spec, &[Spread::LayerPitch], coil).unwrap().coil;
            assert_eq!(coil.turns(), model.coil.turns());
            coil.layer_lengths_m()[23] / (50.0 * std::f64::consts::TAU) - coil.layer_radius_m(23)
        })
        .collect();
    // 23 pitches below and half of its own.
    let expected_m = 0.02 * model.coil.radial_pitch_m() * 23.25_f64.sqrt();
    assert!((outermost.iter().std_dev() / expected_m - 1.0).abs() < 4.0 / 8000.0_f64.sqrt());
}

#[test]
fn what_trimming_leaves_is_even_and_adds_what_surplus_fibre_does() {
    let model = model(8, LayerLength::Equal, &[]);
    let as_built = AsBuilt { trim_residue_m: 8.0, ..AsBuilt::default() };
    let spec = ToleranceSpec { as_built, samples: 2000, ..exact() };
    let qua = Classic::Qua.pattern(8).unwrap();
    let found = &study(&model, &profile_spec(), &spec, &[qua]).unwrap()[0];
    assert_eq!(found.variance_shares, vec![(Spread::TrimResidue, 1.0)]);
    // Where the residue makes most of the error, that is linear in its size: quantiles lie as those of an even spread.
    let (p60, p90) = (found.quantile_rad_per_s(0.6), found.quantile_rad_per_s(0.9));
    let (p75, slope) = (found.quantile_rad_per_s(0.75), (p90 - p60) / 0.3);
    assert!(slope > 0.0 && (p75 - 0.5 * (p60 + p90)).abs() < 0.05 * (p90 - p60), "{p60} {p75} {p90}");
    // The largest is that of t/2 of surplus at one end.
    let most = model.with_effect(DeclaredEffect::new(effect::OFFSET_OF_MIDDLE.spec, vec![4.0], vec![0]).unwrap());
    let least = model.with_effect(DeclaredEffect::new(effect::OFFSET_OF_MIDDLE.spec, vec![-4.0], vec![0]).unwrap());
    let of = |model: &CoilModel| {
        let step = UnitStep::new(model, 0.003).unwrap();
        step.guaranteed(model, &Classic::Qua.pattern(8).unwrap()).unwrap().rate_rad_per_s
    };
    let largest = of(&most).max(of(&least));
    let drawn = found.worst_rad_per_s[1999];
    assert!(drawn <= largest * (1.0 + 1e-9) && drawn > 0.995 * largest, "{drawn} {largest}");
}

#[test]
fn films_at_two_flanges_that_differ_heat_a_coil_that_equal_ones_heat_evenly() {
    let flange = |second: usize| {
        let spec = effect::FLANGE_FILM.spec;
        let start = DeclaredEffect::at_start(spec);
        DeclaredEffect::new(spec, start.values().to_vec(), vec![second]).unwrap()
    };
    let model = model(8, LayerLength::Actual, &["surface_film"]).with_effect(flange(0)).with_effect(flange(1));
    let as_built = AsBuilt { flange_film_sd: 0.2, ..AsBuilt::default() };
    let spec = ToleranceSpec { as_built, samples: 40, ..exact() };
    let dip = Classic::Dip.pattern(8).unwrap();
    let found = &study(&model, &profile_spec(), &spec, std::slice::from_ref(&dip)).unwrap()[0];
    assert_eq!(found.variance_shares, vec![(Spread::FlangeFilm, 1.0)]);
    let spread = found.worst_rad_per_s[39] - found.worst_rad_per_s[0];
    assert!(spread > 1e-5 * found.nominal_rad_per_s, "{spread} {}", found.nominal_rad_per_s);
    for coil in Deviates::of(spec.seed, 8, 0..40, true) {
        let films = |model: &CoilModel| -> Vec<f64> {
            model.effects.iter().filter(|e| e.is_at(effect::FLANGE_FILM)).map(|e| e.values()[0]).collect()
        };
        let (as_declared, as_built) =
            (films(&model), films(&built(&model, &spec, &[Spread::FlangeFilm], &coil).unwrap()));
        for (i, z) in coil.flanges.into_iter().enumerate() {
            assert!((as_built[i] / as_declared[i] - (1.0 + 0.2 * z)).abs() < 1e-12);
        }
    }
    let without = super::super::samples::tests::model(8, LayerLength::Equal, &[]);
    let error = study(&without, &profile_spec(), &spec, &[dip]).unwrap_err();
    assert_eq!(error, ToleranceError::NoFlange);
}
