//! References: NIST SP 1065 (Riley 2008), section 12.4: the 1000-point test suite and its table of deviations, and the
//! 10-point set of NBS Monograph 140; and allantools (PyPI) on seeded white, flicker and random-walk noise and on
//! Stable32's PHASE.DAT (`tests/data/allan`, written by `benches/peers/allan.py`).
//! Tolerance: the printed digits of the tables; 1e-9 relative against allantools, which sums in another order;
//! coefficients of synthetic noises as far as 16 384 values tell them.

use coilwright::numeric::allan::overlapping;
use coilwright::numeric::coloured::{Interval, NoiseStrengths, noise_strengths};
use coilwright::numeric::pyramid::Pyramid;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

#[test]
fn the_test_suite_of_nist_sp_1065_is_met_to_its_printed_digits() {
    let mut number: u64 = 1_234_567_890;
    let rates: Vec<f64> = (0..1000)
        .map(|_| {
            let rate = number as f64 / 2_147_483_647.0;
            number = 16_807 * number % 2_147_483_647;
            rate
        })
        .collect();
    let found: Vec<String> =
        overlapping(&rates, 1.0, &[1, 10, 100]).iter().map(|p| format!("{:.6e}", p.deviation)).collect();
    println!("overlapping Allan deviation at 1, 10, 100: {found:?}");
    assert_eq!(found, ["2.922319e-1", "9.159953e-2", "3.241343e-2"]);
}

#[test]
fn the_nine_frequencies_of_monograph_140_give_its_printed_deviations() {
    let rates = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0];
    let found: Vec<String> = overlapping(&rates, 1.0, &[1, 2]).iter().map(|p| format!("{:.5}", p.deviation)).collect();
    println!("overlapping Allan deviation at 1, 2: {found:?}");
    assert_eq!(found, ["91.22945", "85.95287"]);
}

#[test]
fn white_flicker_and_random_walk_noise_and_stable32s_phase_agree_with_allantools() {
    for (name, interval_s) in [("white", 0.5), ("flicker", 0.5), ("random_walk", 0.5), ("stable32_phase", 1.0)] {
        let path = format!("{}/tests/data/allan/{name}.csv", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        let rates: Vec<f64> = text.lines().filter_map(|l| l.strip_prefix("rate,")?.parse().ok()).collect();
        let expected: Vec<Vec<f64>> = text
            .lines()
            .filter_map(|l| l.strip_prefix("deviation,"))
            .map(|l| l.split(',').map(|v| v.parse().unwrap()).collect())
            .collect();
        let factors: Vec<usize> = expected.iter().map(|e| (e[0] / interval_s).round() as usize).collect();
        let found = overlapping(&rates, interval_s, &factors);
        assert_eq!(found.len(), expected.len());
        let mut worst: f64 = 0.0;
        for (point, row) in found.iter().zip(&expected) {
            assert_eq!((point.tau_s, point.pairs), (row[0], row[2] as usize), "{name}");
            worst = worst.max((point.deviation / row[1] - 1.0).abs());
        }
        println!("{name}: {} deviations, largest relative difference {worst:.1e}", found.len());
        assert!(worst < 1e-9, "{name}: {worst:e}");
    }
}

const ROWS: usize = 16_384;
const INTERVAL_S: f64 = 0.5;

fn white(seed: u64, rows: usize) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).unwrap();
    (0..rows).map(|_| normal.inverse_cdf(random.random::<f64>())).collect()
}

/// 1/f noise with B = 1: white noise through (1 − z⁻¹)^(−½) (Kasdin, Proc. IEEE 83 (1995) 802).
fn flicker(seed: u64) -> Vec<f64> {
    const MEMORY: usize = 4096;
    let mut weights = vec![1.0];
    for k in 1..MEMORY {
        weights.push(weights[k - 1] * (k as f64 - 0.5) / k as f64);
    }
    let source = white(seed, ROWS + MEMORY);
    (0..ROWS).map(|i| weights.iter().enumerate().map(|(k, w)| w * source[i + MEMORY - k]).sum()).collect()
}

#[test]
fn each_noise_alone_gives_back_its_coefficient() {
    // Of a rate of unit deviation, in its own units: N² = τ0, K² = 1/τ0, B² = 1, Q² = τ0² of the angle's uniform error.
    let mut angle = 0.0;
    let walk: Vec<f64> = white(2, ROWS)
        .iter()
        .map(|w| {
            angle += w;
            angle
        })
        .collect();
    let quantum = 0.01;
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let errors: Vec<f64> = (0..=ROWS).map(|_| quantum * (random.random::<f64>() - 0.5)).collect();
    let quantised: Vec<f64> = errors.windows(2).map(|e| (e[1] - e[0]) / INTERVAL_S).collect();
    let found = |rates: &[f64]| -> NoiseStrengths {
        let mut pyramid = Pyramid::new(2, 0);
        for (i, rate) in rates.iter().enumerate() {
            pyramid.push(i as u64, *rate, |slow| slow[0] = INTERVAL_S * i as f64);
        }
        noise_strengths(&pyramid.finish(), INTERVAL_S, &[]).unwrap()
    };
    let cases: [(&str, Interval, f64, f64); 4] = [
        ("white", found(&white(1, ROWS)).white, INTERVAL_S.sqrt(), 0.03),
        ("random walk", found(&walk).random_walk, 1.0 / INTERVAL_S.sqrt(), 0.05),
        ("flicker", found(&flicker(3)).flicker, 1.0, 0.1),
        // Errors that are uniform over a quantum q have the deviation q/√12 = Q.
        ("quantisation", found(&quantised).quantisation, quantum / 12f64.sqrt(), 0.03),
    ];
    for (name, interval, expected, tolerance) in cases {
        let value = interval.value;
        println!("{name}: {interval:?}");
        assert!(interval.low <= expected && expected <= interval.high, "{name}");
        println!("{name}: {value:.4} of {expected:.4}");
        assert!((value / expected - 1.0).abs() < tolerance, "{name}: {value} of {expected}");
    }
}
