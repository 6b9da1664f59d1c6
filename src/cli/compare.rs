//! `compare`: a model's prediction beside measured records, and where it fails.

use std::path::PathBuf;

use super::pattern_asked::pattern_asked;
use super::records::{GrossErrorChoice, RecordArguments};
use super::screen::{Screen, held, table};
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::io::json::comparison::{CompareJson, NoisePartsJson, PartJson, RecordComparisonJson, SensorJson};
use crate::io::read::model_file::read_model;
use crate::io::write::measurement_folder::{COMPARISON_FILE, check_free, check_kept};
use crate::task::compare::{Request, run as compare};
use crate::task::page::REPORT_FILE;
use crate::task::under_fields::FieldFile;
use crate::text::sink::Line;

/// A model's prediction beside measured records, and where it fails
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright compare coil.toml calibration.csv validation.csv\n  coilwright compare coil.toml day-1.csv --strict --format json\n  coilwright compare coil.toml day-1.csv -o results/day-1\n  coilwright compare coil.toml day-1.csv --field layers.csv"
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// Records (CSV)
    #[arg(required = true)]
    records: Vec<PathBuf>,
    /// A winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Option<String>,
    /// The layers' temperatures under a record that were computed or measured (CSV: time_s, layer_1_c, …, or time_s, layer,
    /// temperature_c), in place of what its sensor implies; one for each record, in their order
    #[arg(long, value_name = "FILE")]
    field: Vec<PathBuf>,
    /// What to do with values that stand alone
    #[arg(long, value_enum, default_value_t = GrossErrorChoice::Keep)]
    gross_errors: GrossErrorChoice,
    /// Exit code 1 when the model is not adequate
    #[arg(long)]
    strict: bool,
    /// Writes comparison.json, a table and pictures for each record, and report.html into this folder
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    reading: RecordArguments,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    if let Some(folder) = &arguments.output {
        check_kept(folder, COMPARISON_FILE, screen.named().chain(file.files()))?;
    }
    let _held = arguments.output.as_deref().map(|folder| held(folder, "compare")).transpose()?;
    if let Some(folder) = &arguments.output {
        check_free(folder)?;
    }
    let pattern = pattern_asked(&file, arguments.pattern.as_deref())?;
    let measurements = arguments.reading.read(&arguments.records, Some(&file))?;
    let fields = arguments.field.iter().map(|path| FieldFile::read(path)).collect::<Result<Vec<_>, _>>()?;
    let request = Request {
        fields: &fields,
        pattern: pattern.as_ref(),
        gross_errors: arguments.gross_errors.into(),
        ..Request::new(&file, &measurements)
    };
    let answer = compare(&request, &Watching::quiet(screen))?;
    let adequate = answer.document.is_adequate();
    if let Some(folder) = &arguments.output {
        answer.write(folder, &file)?;
        screen.note(&format!("wrote {}", folder.join(REPORT_FILE).display()));
    }
    screen.answer(answer.document, text)?;
    Ok(if arguments.strict && !adequate { Ending::No } else { Ending::Done })
}

/// With so many digits; "-" where there is none.
fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |v| format!("{v:.digits$}"))
}

/// The table of a record's measures.
fn measures(record: &RecordComparisonJson) -> String {
    let noise = |of: fn(&NoisePartsJson) -> String| record.noise.as_ref().map_or("-".to_owned(), of);
    let measures = [
        ("RMSE", format!("{:.5}", record.rmse_deg_per_h), "°/h"),
        (
            "noise floor of the record",
            format!("{:.5} ± {:.5}", record.noise_floor_deg_per_h, record.noise_floor_standard_error_deg_per_h),
            "°/h",
        ),
        (
            "white noise",
            noise(|n| match n.white_standard_error_deg_per_h {
                Some(error) => format!("{:.5} ± {error:.5}", n.white_deg_per_h),
                None => format!("{:.5}", n.white_deg_per_h),
            }),
            "°/h",
        ),
        ("wander", noise(|n| format!("{:.5}", n.wander_deg_per_h)), "°/h"),
        ("air that the sensor cannot see", noise(|n| format!("{:.5}", n.unresolved_air_deg_per_h)), "°/h"),
        ("offset", format!("{:.5}", record.offset_deg_per_h), "°/h"),
        ("NRMSE fit", number(record.nrmse_fit_percent, 2), "%"),
        ("R²", number(record.r_squared, 5), ""),
        ("reduced chi-square", format!("{:.4}", record.reduced_chi_square), ""),
        ("expected from what the readings leave open", format!("{:.4}", record.boundary_chi_square), ""),
        ("against noise and that", format!("{:.4}", record.whitened_chi_square), ""),
        ("Ljung-Box p-value", format!("{:.4}", record.ljung_box.p_value), ""),
        (
            "film found",
            match (record.estimated_film_w_per_m2_k, record.estimated_film_standard_error_w_per_m2_k) {
                (Some(film), Some(error)) => format!("{film:.2} ± {error:.2}"),
                (film, _) => number(film, 2),
            },
            "W/(m²K)",
        ),
    ];
    table(&["measure", "value", "unit"], measures.map(|(n, v, u)| vec![n.to_owned(), v, u.to_owned()]))
}

fn text(body: &CompareJson) -> String {
    let lacks = |verdict: &str| {
        if verdict == "missing" { "the model lacks something" } else { "the model lacks nothing that these show" }
    };
    let mut text = format!("{} with {}: {} — {}\n", body.model, body.pattern, body.verdict, lacks(&body.verdict));
    for record in &body.records {
        text += &format!("\n{}: {} rows, {}\n", Line::of(&record.file), record.rows, what_lacks(record));
        for finding in &record.findings {
            text += &format!("  {finding}\n");
        }
        text.push('\n');
        text += &measures(record);
        text.push('\n');
        text += &table(
            &["part of the record", "rows", "share of rows", "share of squared error", "RMSE °/h"],
            record.regimes.iter().chain(&record.temperature_bands).chain(&record.rate_bands).map(part_row),
        );
        if !record.sensors.is_empty() {
            text.push('\n');
            text += &table(
                &["thermometer", "layer", "less the model: mean °C", "rms °C", "largest °C", "at s"],
                record.sensors.iter().map(sensor_row),
            );
        }
        text.push('\n');
        text += &table(
            &["residual against", "correlation"],
            record.correlations.iter().map(|c| vec![c.with.clone(), number(c.correlation, 3)]),
        );
    }
    text
}

/// What goes with less than this share of the residual is not named.
const NAMED_CORRELATION: f64 = 0.3;

/// Whether the model lacks something in a record, and what that goes with most.
fn what_lacks(record: &RecordComparisonJson) -> String {
    if record.verdict == "adequate" {
        return "the model lacks nothing that they show".to_owned();
    }
    let named = record.correlations.iter().filter_map(|c| Some((c.with.as_str(), c.correlation?)));
    let strongest = named.filter(|c| c.1.abs() >= NAMED_CORRELATION).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    match strongest {
        Some((with, correlation)) => {
            format!(
                "the model lacks something that goes with {with} (correlation {correlation:+.2}); `coilwright diagnose` finds what"
            )
        }
        None => "the model lacks something; `coilwright diagnose` finds what".to_owned(),
    }
}

fn sensor_row(sensor: &SensorJson) -> Vec<String> {
    vec![
        sensor.column.clone(),
        sensor.layer.to_string(),
        format!("{:.4}", sensor.mean_difference_c),
        format!("{:.4}", sensor.rms_difference_c),
        format!("{:.4}", sensor.largest_difference_c),
        sensor.largest_difference_time_s.to_string(),
    ]
}

fn part_row(part: &PartJson) -> Vec<String> {
    vec![
        part.name.clone(),
        part.rows.to_string(),
        format!("{:.3}", part.share_of_rows),
        format!("{:.3}", part.share_of_squared_error),
        format!("{:.5}", part.rmse_deg_per_h),
    ]
}
