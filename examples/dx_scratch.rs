use coilwright::diagnose::{self, Request};
use coilwright::io::model_file::read_model;
use coilwright::record::*;
use coilwright::units::*;
fn load(path: &str) -> Record {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|v| v.parse().unwrap_or(f64::NAN)).collect()).collect();
    let col =
        |name: &str| header.iter().position(|h| *h == name).map(|i| rows.iter().map(|r| r[i]).collect::<Vec<f64>>());
    let mut r = Record::new(
        path,
        col("time_s").unwrap(),
        col("temperature_c").unwrap().into_iter().map(kelvin_from_celsius).collect(),
        col("rate_deg_per_h").unwrap().into_iter().map(rad_per_s_from_deg_per_h).collect(),
    )
    .unwrap();
    for h in header.iter().filter(|h| {
        !["time_s", "temperature_c", "rate_deg_per_h", "temperature_inner_c", "temperature_ambient_c"].contains(h)
    }) {
        r = r.with_channel(Channel { name: h.to_string(), values: col(h).unwrap() }).unwrap();
    }
    r
}
fn main() {
    for dir in std::env::args().skip(1) {
        let file = read_model(std::path::Path::new(&format!("{dir}/coil.toml"))).unwrap();
        let pattern = file.pattern.unwrap().pattern;
        let cal = [load(&format!("{dir}/calibration.csv"))];
        let val = if std::env::var("NOHOLD").is_ok() { vec![] } else { vec![load(&format!("{dir}/validation.csv"))] };
        let start = std::time::Instant::now();
        let d = diagnose::diagnose(
            &Request { model: &file.model, pattern: &pattern, records: &cal, holdout: &val },
            &|s| {
                if std::env::var("PROG").is_ok() {
                    eprintln!("{s:.2} {:?}", start.elapsed())
                }
            },
        );
        let t = start.elapsed();
        match d {
            Err(e) => println!("{dir}: ERROR {e} {t:?}"),
            Ok(d) => {
                println!(
                    "=== {dir}: {:?} {t:?} floor {:.4}",
                    d.verdict,
                    deg_per_h_from_rad_per_s(d.noise_floor_rad_per_s)
                );
                for f in &d.effects {
                    println!(
                        "  {} dchi {:.1} confirmed {:.1} {:?}",
                        f.effect.kind(),
                        f.chi_square_less,
                        f.confirmed_by,
                        f.parameters
                            .iter()
                            .map(|p| format!(
                                "{}={:.5}±{:?}{}",
                                p.key,
                                p.unit.from_si(p.value),
                                p.standard_error.map(|e| p.unit.difference_from_si(e)),
                                if p.at_bound { " AT BOUND" } else { "" }
                            ))
                            .collect::<Vec<_>>()
                    );
                    for e in &f.equivalents {
                        println!(
                            "     ~ {} {:?} +{:.1} corr {:.4}",
                            e.effect.kind(),
                            e.effect.choices(),
                            e.chi_square_more,
                            e.correlation
                        );
                    }
                }
                for r in &d.ladder {
                    println!(
                        "  rung {:?} rmse {:.4} hold {:?} red {:.3} bic {:.1}",
                        r.effects,
                        deg_per_h_from_rad_per_s(r.rmse_rad_per_s),
                        r.holdout_rmse_rad_per_s.map(deg_per_h_from_rad_per_s),
                        r.reduced_chi_square,
                        r.bic
                    );
                }
                for c in d.candidates.iter().take(8) {
                    println!(
                        "  cand {} {:?} red {:.3} less {:.1}",
                        c.effect.kind(),
                        c.effect.choices(),
                        c.reduced_chi_square,
                        c.chi_square_less
                    );
                }
                if let Some(u) = &d.unexplained {
                    println!(
                        "  unexplained excess {:.4} share {:.3} corr {:?} plain {:?}",
                        deg_per_h_from_rad_per_s(u.excess_rad_per_s),
                        u.share_of_excess,
                        &u.correlations[..u.correlations.len().min(3)],
                        u.plain
                    );
                }
                for c in &d.cautions {
                    println!("  caution {c}");
                }
            }
        }
    }
}
