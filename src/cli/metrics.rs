//! `metrics`: what a gyro's data sheet says, from records.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::records::{GrossErrors, RecordArguments, remark, remark_gross};
use super::report::{REPORT_FILE, write_report};
use super::screen::{Screen, held, table};
use super::{CliError, Ending};
use crate::io::fault::Faults;
use crate::io::files::write_atomically;
use crate::io::json::inputs::{InputsJson, RecordInputJson};
use crate::io::json::metrics::{GrossErrorJson, MetricsJson, NoiseJson, RecordMetricsJson};
use crate::io::read::record_columns::RecordFormat;
use crate::io::read::record_rows::stream_rows;
use crate::io::write::measurement_folder::{METRICS_FILE, check_free, write_document};
use crate::metrics::{Meter, Metrics, repeatability_rad_per_s};
use crate::record::{Row, gross_errors_of};
use crate::report::allan::allan_chart;

/// Bias, stability, Allan deviation and temperature sensitivity of records
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright metrics day-1.csv day-2.csv --average 100\n  coilwright metrics rest.csv -o results/rest\n  coilwright compensate coil.toml day-2.csv --fit day-1.csv | coilwright metrics -"
)]
pub struct Arguments {
    /// Records (CSV), or - for standard input; what compensate writes is measured by its compensated rate
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
    #[command(flatten)]
    reading: RecordArguments,
}

pub fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let _held = arguments.output.as_deref().map(|folder| held(folder, "metrics")).transpose()?;
    if let Some(folder) = &arguments.output {
        check_free(folder)?;
    }
    let mut format = arguments.reading.format(None)?;
    format.compensated = true;
    let mut measured = Vec::with_capacity(arguments.records.len());
    let mut shown = Vec::with_capacity(arguments.records.len());
    let mut inputs = Vec::with_capacity(arguments.records.len());
    for path in &arguments.records {
        let (metrics, gross_errors) = measure(path, arguments, &format, screen)?;
        let file = path.display().to_string();
        let gaps = metrics.gaps;
        shown.push(RecordMetricsJson::new(&file, &metrics, gross_errors, gaps));
        inputs.push(match is_stdin(path) {
            true => RecordInputJson { file, sha256: None, role: "measured".to_owned() },
            false => RecordInputJson::new(path, "measured")?,
        });
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

fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// Measures a record as it passes by, without holding it.
fn measure(
    path: &Path,
    arguments: &Arguments,
    format: &RecordFormat,
    screen: &Screen,
) -> Result<(Metrics, Vec<GrossErrorJson>), CliError> {
    let name = if is_stdin(path) { "standard input".to_owned() } else { path.display().to_string() };
    let mut meter = Meter::new(arguments.average)?;
    let dropped = arguments.gross_errors == GrossErrors::Drop;
    let mut found = Vec::new();
    let sink = |rows: &[Row]| {
        let temperature_k: Vec<f64> = rows.iter().map(|r| r.temperature_k).collect();
        let rates: Vec<f64> = rows.iter().map(|r| r.rate_rad_per_s).collect();
        let mut gross = gross_errors_of(&temperature_k, &rates).into_iter().peekable();
        for (i, row) in rows.iter().enumerate() {
            let mut alone = false;
            while let Some(error) = gross.next_if(|e| e.row == i) {
                alone = true;
                found.push(GrossErrorJson { time_s: row.time_s, column: error.column.to_owned(), dropped });
            }
            if !(alone && dropped) {
                meter.push(*row);
            }
        }
    };
    let noticed = if is_stdin(path) {
        stream_rows(&name, std::io::stdin().lock(), format, sink)?
    } else {
        let unreadable = |e| Faults::of_file(&name, format!("cannot be read: {e}"));
        if path.is_dir() {
            return Err(Faults::of_file(&name, "expected a file, found a folder").into());
        }
        stream_rows(&name, File::open(path).map_err(unreadable)?, format, sink)?
    };
    remark(path, noticed.skipped_rows, &noticed.remarks, screen);
    remark_gross(path, &found, dropped, screen);
    Ok((meter.finish()?, found))
}

fn text(body: &MetricsJson) -> String {
    let mut header = vec!["measure", "unit"];
    header.extend(body.records.iter().map(|r| r.file.as_str()));
    let stability = format!("bias stability, means over {} s", body.bias_stability_average_s);
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.6}"));
    type Show = fn(&RecordMetricsJson) -> Option<f64>;
    let measures: [(&str, &str, Show); 13] = [
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
        ("drift angle", "°", |r| Some(r.drift_angle_deg)),
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
    for record in body.records.iter().filter(|r| !r.noise.is_empty()) {
        text += &format!("\nnoise of {}, intervals that hold together with 95 %\n", record.file);
        let row = |n: &NoiseJson| {
            vec![
                n.kind.replace('_', " "),
                format!("{:.6}", n.value),
                format!("{:.6} to {:.6}", n.low, n.high),
                n.unit.clone(),
            ]
        };
        text += &table(&["kind", "value", "interval", "unit"], record.noise.iter().map(row));
    }
    for record in &body.records {
        text.extend(record.cautions.iter().map(|caution| format!("\ncaution: {}: {caution}\n", record.file)));
    }
    text
}
