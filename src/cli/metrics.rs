//! `metrics`: what a gyro's data sheet says, from records.

use std::path::PathBuf;

use super::records::{GrossErrors, read_noticed};
use super::report::{REPORT_FILE, write_report};
use super::screen::{Screen, table};
use super::{CliError, Ending};
use crate::io::files::write_atomically;
use crate::io::json::inputs::{InputsJson, RecordInputJson};
use crate::io::json::metrics::{MetricsJson, RecordMetricsJson};
use crate::io::write::measurement_folder::{METRICS_FILE, check_free, write_document};
use crate::metrics::{Metrics, repeatability_rad_per_s};
use crate::report::allan::allan_chart;

/// Bias, stability, Allan deviation and temperature sensitivity of records
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright metrics day-1.csv day-2.csv --average 100\n  coilwright metrics rest.csv -o results/rest"
)]
pub struct Arguments {
    /// Records (CSV)
    #[arg(required = true)]
    records: Vec<PathBuf>,
    /// Averaging time of the bias stability [s]
    #[arg(long, value_name = "SECONDS", default_value_t = 10.0)]
    average: f64,
    /// What to do with values that stand alone
    #[arg(long, value_enum, default_value_t = GrossErrors::Keep)]
    gross_errors: GrossErrors,
    /// Writes metrics.json, the pictures of the Allan deviation and report.html into this folder
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    if let Some(folder) = &arguments.output {
        check_free(folder)?;
    }
    let mut measured = Vec::with_capacity(arguments.records.len());
    let mut shown = Vec::with_capacity(arguments.records.len());
    let mut inputs = Vec::with_capacity(arguments.records.len());
    for path in &arguments.records {
        let noticed = read_noticed(path, arguments.gross_errors, screen)?;
        let metrics = Metrics::of(&noticed.record, arguments.average)?;
        let file = path.display().to_string();
        shown.push(RecordMetricsJson::new(&file, &metrics, noticed.gross_errors, noticed.gaps));
        inputs.push(RecordInputJson::new(path, "measured")?);
        measured.push(metrics);
    }
    let body = MetricsJson::new(shown, repeatability_rad_per_s(&measured)?, InputsJson::new(None, inputs));
    if let Some(folder) = &arguments.output {
        for (index, record) in body.records.iter().enumerate() {
            let name = format!("allan-{}.svg", index + 1);
            write_atomically(&folder.join(name), allan_chart(record).svg().as_bytes())?;
        }
        write_document(folder, METRICS_FILE, &body)?;
        write_report(folder, &folder.join(REPORT_FILE))?;
        screen.note(&format!("wrote {}", folder.join(REPORT_FILE).display()));
    }
    screen.answer(body, text)?;
    Ok(Ending::Done)
}

fn text(body: &MetricsJson) -> String {
    let mut header = vec!["measure", "unit"];
    header.extend(body.records.iter().map(|r| r.file.as_str()));
    let stability = format!("bias stability, means over {} s", body.bias_stability_average_s);
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.6}"));
    type Show = fn(&RecordMetricsJson) -> Option<f64>;
    let measures: [(&str, &str, Show); 12] = [
        ("bias", "°/h", |r| Some(r.bias_deg_per_h)),
        (&stability, "°/h", |r| r.bias_stability_deg_per_h),
        ("bias instability (Allan minimum)", "°/h", |r| r.bias_instability_deg_per_h),
        ("at averaging time", "s", |r| r.bias_instability_tau_s),
        ("angle random walk", "°/√h", |r| r.angle_random_walk_deg_per_sqrt_h),
        ("rate random walk", "°/h/√h", |r| r.rate_random_walk_deg_per_h_per_sqrt_h),
        ("flicker", "°/h", |r| r.flicker_deg_per_h),
        ("quantisation", "arcsec", |r| r.quantisation_arcsec),
        ("temperature sensitivity", "°/h/°C", |r| r.temperature_sensitivity_deg_per_h_per_c),
        ("peak to peak", "°/h", |r| Some(r.peak_to_peak_deg_per_h)),
        ("peak to peak of the means", "°/h", |r| Some(r.averaged_peak_to_peak_deg_per_h)),
        ("duration", "s", |r| Some(r.duration_s)),
    ];
    let rows = measures.iter().map(|(name, unit, show)| {
        let mut row = vec![(*name).to_owned(), (*unit).to_owned()];
        row.extend(body.records.iter().map(|r| number(show(r))));
        row
    });
    let mut text = table(&header, rows);
    if let Some(repeatability) = body.repeatability_deg_per_h {
        text += &format!("\nrepeatability of the bias over {} records: {repeatability:.6} °/h\n", body.records.len());
    }
    text
}
