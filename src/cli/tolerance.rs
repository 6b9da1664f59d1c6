//! `tolerance`: what windings are worth when they are built imperfectly.

use std::path::PathBuf;

use super::evaluate::own_and_classics;
use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::io::json::tolerance::{DistributionJson, ToleranceJson};
use crate::io::model::NamedPattern;
use crate::io::read::model_file::read_model;
use crate::io::read::pattern_file::resolve_pattern;
use crate::pattern::Pattern;
use crate::pattern::classic::Classic;
use crate::search::cost::tolerance::{ToleranceSpec, measure, study};
use crate::units::rad_per_s_from_deg_per_h;

/// Monte Carlo of the worst case under the spreads of the model's [tolerance]
#[derive(Debug, clap::Args)]
#[command(
    after_help = "QUA is always among the patterns where it fits: a pattern that wins only on paper loses here.\n\n\
    Example:\n  coilwright tolerance my-coil.toml --pattern results/my-coil/best.toml"
)]
pub struct Arguments {
    /// The model file, with a [tolerance] table
    model: PathBuf,
    /// A winding's name (zyl, sym, sym-text, dip, qua, oct, hex) or a pattern file; may be repeated. Without it: the
    /// model's own and all classics that fit
    #[arg(long, short, value_name = "PATTERN")]
    pattern: Vec<String>,
    /// Coils to draw; without it, the model's own number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000))]
    samples: Option<u32>,
    /// Seed of the draws; without it, the model's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// A coil whose worst case is larger is scrap; without it, the model's own
    #[arg(long, value_name = "DEG_PER_H")]
    limit: Option<f64>,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    for advice in &file.advice {
        screen.note(&format!("note: {advice}"));
    }
    let Some(declared) = &file.tolerance else {
        return Err(CliError::NoTolerance { path: arguments.model.display().to_string() });
    };
    let spec = ToleranceSpec {
        samples: arguments.samples.map_or(declared.samples, |n| n as usize),
        seed: arguments.seed.unwrap_or(declared.seed),
        limit_rad_per_s: arguments.limit.map(rad_per_s_from_deg_per_h).or(declared.limit_rad_per_s),
        ..declared.clone()
    };
    let layers = file.model.coil.layers();
    let mut named = if arguments.pattern.is_empty() {
        own_and_classics(&file)
    } else {
        arguments.pattern.iter().map(|stated| resolve_pattern(stated, layers, None)).collect::<Result<_, _>>()?
    };
    if let Ok(pattern) = Classic::Qua.pattern(layers)
        && !named.iter().any(|n| n.pattern == pattern)
    {
        named.push(NamedPattern { name: Classic::Qua.key().to_owned(), pattern });
    }
    let patterns: Vec<Pattern> = named.iter().map(|n| n.pattern.clone()).collect();
    let found = study(&file.model, &file.profiles, &spec, &patterns)?;
    let measure = measure(&file.model, file.profiles.max_rate_k_per_s)?;
    let rows = named.iter().zip(&found).map(|(named, found)| DistributionJson::new(&named.name, found)).collect();
    screen.answer(ToleranceJson::new(&file.model.name, &spec, measure, rows), text)?;
    Ok(Ending::Done)
}

fn text(body: &ToleranceJson) -> String {
    let rows = body.patterns.iter().map(|p| {
        let shares: Vec<String> =
            p.variance_shares.iter().map(|s| format!("{} {:.0} %", s.spread, 100.0 * s.share)).collect();
        vec![
            p.name.clone(),
            format!("{:.4}", p.nominal_deg_per_h),
            format!("{:.4}", p.median_deg_per_h),
            format!("{:.4}", p.p95_deg_per_h),
            format!("{:.4}", p.p99_deg_per_h),
            p.yield_share.map_or("-".to_owned(), |y| format!("{:.1} %", 100.0 * y)),
            shares.join(", "),
        ]
    });
    let head = format!("{} worst case of {} coils in °/h, seed {}\n", body.measure, body.samples, body.seed);
    head + &table(&["pattern", "nominal", "median", "P95", "P99", "yield", "share of the variance"], rows)
}
