//! `tolerance`: what windings are worth when they are built imperfectly.

use std::path::PathBuf;

use super::pattern_asked::patterns_asked;
use super::screen::{Screen, table};
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::json::tolerance::ToleranceJson;
use crate::io::read::model_file::read_design;
use crate::task::tolerance::{Request, run as study};
use crate::units::rad_per_s_from_deg_per_h;

/// Monte Carlo of the worst case under the spreads of the model's [tolerance]
#[derive(Debug, clap::Args)]
#[command(
    after_help = "QUA is always among the patterns where it fits: a pattern that wins only on paper loses here.\n\n\
    Example:\n  coilwright tolerance my-coil.toml --pattern results/my-coil/best.toml"
)]
pub(crate) struct Arguments {
    /// The model file, with a [tolerance] table
    model: PathBuf,
    /// A winding's name (zyl, sym, sym-text, dip, qua, oct, hex) or a pattern file; may be repeated. Without it: the
    /// model's own and all classics that fit
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
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

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_design(&arguments.model)?;
    let patterns = patterns_asked(&file, &arguments.pattern)?;
    let request = Request {
        model: &file,
        patterns: &patterns,
        samples: arguments.samples.map(|n| n as usize),
        seed: arguments.seed,
        limit_rad_per_s: arguments.limit.map(rad_per_s_from_deg_per_h),
    };
    screen.answer(study(&request, &Watching::quiet(screen))?, text)?;
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
