//! Reference: the five records of an independent simulator in `tests/data/records` in which something is hidden, and what
//! it is (the two that hide nothing are in `records.rs`). Here the hidden effect is *declared* at its true size and nothing
//! but the constant offset is fitted: the prediction must miss the record by its own noise only.
//! Tolerance: the residual's rms within four standard errors of that of the noise, the boundary's uncertainty included; the
//! offset within four of its standard errors. One record has a gross error, which is left out.

use coilwright::effect::{self, DeclaredEffect};
use coilwright::predict::predict;
use coilwright::record::Record;
use coilwright::units::{deg_per_h_from_rad_per_s, rad_per_s_from_deg_per_h};

use crate::records::{model, record};

/// Folder, hidden effects with their parameters as a user states them, noise and offset in °/h.
type Case = (&'static str, &'static [(&'static str, &'static [f64])], f64, f64);

const CASES: [Case; 5] = [
    ("b-half-space", &[("finite_pack", &[])], 0.18973665961010275, -0.15),
    ("c-spool", &[("spool_mass", &[5500.0, 400.0, 0.0])], 0.03794733192202055, 0.219),
    ("d-mismatch", &[("strain_mismatch", &[0.004])], 0.03794733192202055, 0.199),
    ("e-sensor", &[("sensor_lag", &[45.0])], 0.0758946638440411, 0.116),
    ("f-two", &[("stress_gradient", &[0.06]), ("bias_temperature", &[0.004, 0.0])], 0.03794733192202055, 0.04),
];

/// Enough rows for every hidden effect to act, few enough to be quick.
const ROWS: usize = 600;

fn beginning(whole: &Record) -> Record {
    let of = |values: &[f64]| values[..ROWS].to_vec();
    Record::new(whole.name(), of(whole.times_s()), of(whole.temperature_k()), of(whole.rate_rad_per_s())).unwrap()
}

/// In standard deviations: no noise of some thousand rows gets there.
const GROSS: f64 = 6.0;

#[test]
#[ignore = "long: --include-ignored"]
fn with_the_hidden_effect_declared_at_its_true_size_only_the_noise_is_left() {
    for (name, hidden, noise_deg_per_h, offset_deg_per_h) in CASES {
        let file = model(name);
        let mut declared = file.model;
        for (kind, stated) in hidden {
            let spec = effect::find(kind).unwrap();
            let values = spec.parameters.iter().zip(*stated).map(|(p, v)| p.unit.to_si(*v)).collect();
            declared.effects.push(DeclaredEffect::new(spec, values, vec![0; spec.choices.len()]).unwrap());
        }
        let pattern = file.pattern.unwrap().pattern;
        let part = "validation.csv";
        let record = beginning(&record(name, part));
        let found = predict(&declared, &pattern, &record).unwrap();
        let (noise, rows) = (rad_per_s_from_deg_per_h(noise_deg_per_h), record.times_s().len() as f64);
        let boundary = found.boundary_variance_rad2_per_s2.iter().sum::<f64>() / rows;
        let expected = (noise * noise + boundary).sqrt();
        for (k, ((t, m), (p, v))) in record
            .times_s()
            .iter()
            .zip(record.rate_rad_per_s())
            .zip(found.rate_rad_per_s.iter().zip(&found.boundary_variance_rad2_per_s2))
            .enumerate()
        {
            if (m - p).abs() > 6.0 * (v + noise * noise).sqrt() {
                println!(
                    "row {k} {t} {:.3} of {:.3}",
                    deg_per_h_from_rad_per_s(m - p),
                    deg_per_h_from_rad_per_s((v + noise * noise).sqrt())
                );
            }
        }
        let residuals = record.rate_rad_per_s().iter().zip(&found.rate_rad_per_s).map(|(m, p)| m - p);
        let (kept, gross): (Vec<f64>, Vec<f64>) = residuals.partition(|r| r.abs() < GROSS * expected);
        let rms = (kept.iter().map(|r| r * r).sum::<f64>() / kept.len() as f64).sqrt();
        let offset = deg_per_h_from_rad_per_s(found.offset_rad_per_s) - offset_deg_per_h;
        let offset_error = deg_per_h_from_rad_per_s(expected) / rows.sqrt();
        let standard_errors = (rms / expected - 1.0) * (2.0 * rows).sqrt();
        println!(
            "{name} {part}: rms {:.5} °/h, noise {noise_deg_per_h:.5}, with the boundary {:.5}: {standard_errors:.1} \
             standard errors; offset off by {:.1}; {} gross errors",
            deg_per_h_from_rad_per_s(rms),
            deg_per_h_from_rad_per_s(expected),
            offset / offset_error,
            gross.len()
        );
        assert!(gross.len() <= 1, "{name} {part}: {gross:?}");
        assert!(standard_errors.abs() < 4.0, "{name} {part}: {standard_errors}");
        assert!(offset.abs() < 4.0 * offset_error, "{name} {part}: {offset}");
    }
}
