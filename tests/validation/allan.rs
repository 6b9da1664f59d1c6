//! References: NIST SP 1065 (Riley 2008), section 12.4: the 1000-point test suite and its table of deviations, and the
//! 10-point set of NBS Monograph 140; and allantools (PyPI) on seeded white, flicker and random-walk noise and on
//! Stable32's PHASE.DAT (`tests/data/allan`, written by `benches/peers/allan.py`).
//! Tolerance: the printed digits of the tables; 1e-9 relative against allantools, which sums in another order.

use coilwright::numeric::allan::overlapping;

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
