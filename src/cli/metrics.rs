//! `metrics`: what a gyro's data sheet says, from records.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::records::{GrossErrorChoice, RecordArguments};
use super::screen::{Screen, held, table};
use super::watching::Watching;
use super::{CliError, Ending};
use crate::io::json::EstimateJson;
use crate::io::json::inputs::RecordInputJson;
use crate::io::json::metrics::{MetricsJson, NoiseJson, RecordMetricsJson};
use crate::io::json::scale_factor::{PositionsJson, ScaleFactorJson};
use crate::io::read::record_columns::RecordFormat;
use crate::io::read::table_file::Source;
use crate::io::write::measurement_folder::{METRICS_FILE, check_free, check_kept};
use crate::metrics::earth::Attitude;
use crate::task::Observer;
use crate::task::metrics::{self, DEFAULT_AVERAGE_S, Measured, Settings, measure_stream};
use crate::task::page::REPORT_FILE;
use crate::text::number::{known, usual};
use crate::units::rad_from_deg;

/// Bias, stability, Allan deviation and temperature sensitivity of records
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright metrics day-1.csv day-2.csv --average 100\n  coilwright metrics rest.csv -o results/rest\n  coilwright metrics table.csv --columns time=t,temperature=T,rate=F:counts,scale=12.5,table=Table:deg_per_s\n  coilwright metrics up.csv down.csv --latitude 48.1 --elevation 90,-90\n  coilwright compensate coil.toml day-2.csv --fit day-1.csv | coilwright metrics -"
)]
pub(crate) struct Arguments {
    /// Records (CSV), or - for standard input; what compensate writes is measured by its compensated rate
    #[arg(required = true)]
    records: Vec<PathBuf>,
    /// Averaging time of the bias stability [s]
    #[arg(long, value_name = "SECONDS", default_value_t = DEFAULT_AVERAGE_S)]
    average: f64,
    /// Where the gyro stood [° north]; with the axis' elevation its bias is given without the earth's rate too
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, requires = "elevation")]
    latitude: Option<f64>,
    /// The sensitive axis' elevation above the horizon [°]: one for all records, or one for each
    #[arg(long, value_name = "DEG,…", allow_hyphen_values = true, value_delimiter = ',', requires = "latitude")]
    elevation: Vec<f64>,
    /// Its azimuth from true north, clockwise [°]; not needed where it is upright
    #[arg(long, value_name = "DEG,…", allow_hyphen_values = true, value_delimiter = ',', requires = "elevation")]
    azimuth: Vec<f64>,
    /// What to do with values that stand alone
    #[arg(long, value_enum, default_value_t = GrossErrorChoice::Keep)]
    gross_errors: GrossErrorChoice,
    /// Writes metrics.json, the pictures of the Allan deviation and report.html into this folder
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    reading: RecordArguments,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    if let Some(folder) = &arguments.output {
        check_kept(folder, METRICS_FILE, screen.named())?;
    }
    let _held = arguments.output.as_deref().map(|folder| held(folder, "metrics")).transpose()?;
    if let Some(folder) = &arguments.output {
        check_free(folder)?;
    }
    let format = arguments.reading.format(None)?;
    let usual = Settings { average_s: arguments.average, gross_errors: arguments.gross_errors.into(), attitude: None };
    let watching = Watching::new(screen, "metrics");
    let measured = arguments
        .records
        .iter()
        .zip(attitudes(arguments)?)
        .map(|(path, attitude)| measure(path, &format, &Settings { attitude, ..usual }, &watching));
    let body = metrics::document(measured.collect::<Result<_, _>>()?)?;
    watching.finish();
    if let Some(folder) = &arguments.output {
        metrics::write(&body, folder)?;
        screen.note(&format!("wrote {}", folder.join(REPORT_FILE).display()));
    }
    screen.answer(body, text)?;
    Ok(Ending::Done)
}

/// Of each record; none where it is not stated.
fn attitudes(arguments: &Arguments) -> Result<Vec<Option<Attitude>>, CliError> {
    let count = arguments.records.len();
    let Some(latitude) = arguments.latitude else { return Ok(vec![None; count]) };
    let fault = |option: &'static str, message: String| Err(CliError::Option { option, message });
    if !(-90.0..=90.0).contains(&latitude) {
        return fault("--latitude", format!("expected -90 to 90 °, found {latitude}"));
    }
    let each = |option: &'static str, stated: &[f64], most: f64| -> Result<Vec<f64>, CliError> {
        if let Some(beyond) = stated.iter().find(|v| !(v.abs() <= most)) {
            return Err(CliError::Option { option, message: format!("expected -{most} to {most} °, found {beyond}") });
        }
        match stated {
            [one] => Ok(vec![*one; count]),
            all if all.len() == count => Ok(all.to_vec()),
            all => {
                let message =
                    format!("expected one for all records or one for each of the {count}, found {}", all.len());
                Err(CliError::Option { option, message })
            }
        }
    };
    let elevations = each("--elevation", &arguments.elevation, 90.0)?;
    let is_upright = elevations.iter().all(|e| e.abs() == 90.0);
    let azimuths = match (arguments.azimuth.as_slice(), is_upright) {
        ([], true) => vec![0.0; count],
        ([], false) => {
            return fault("--azimuth", "is needed where the axis is not upright: 0 is north, 90 east".to_owned());
        }
        (stated, _) => each("--azimuth", stated, 360.0)?,
    };
    let attitude = |(elevation, azimuth): (f64, f64)| {
        Some(Attitude {
            latitude_rad: rad_from_deg(latitude),
            elevation_rad: rad_from_deg(elevation),
            azimuth_rad: rad_from_deg(azimuth),
        })
    };
    Ok(elevations.into_iter().zip(azimuths).map(attitude).collect())
}

/// Says how much of a file has been read.
struct Watched<'w, R> {
    inner: R,
    read: u64,
    size: u64,
    watching: &'w Watching<'w>,
}

impl<R: Read> Read for Watched<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.inner.read(buffer)?;
        let before = self.read;
        self.read += count as u64;
        if before / SAID_EVERY_BYTES != self.read / SAID_EVERY_BYTES && self.size > 0 {
            self.watching.at((self.read as f64 / self.size as f64).min(1.0), "");
        }
        Ok(count)
    }
}

const SAID_EVERY_BYTES: u64 = 1 << 22;

/// Measures a record as it passes by, without holding it.
fn measure(path: &Path, format: &RecordFormat, settings: &Settings, watching: &Watching) -> Result<Measured, CliError> {
    let name = path.display().to_string();
    if path == Path::new("-") {
        let input = RecordInputJson { file: name, sha256: None, role: "measured".to_owned() };
        let source = Source::text(std::io::stdin().lock());
        return Ok(measure_stream(input, "standard input", source, format, settings, watching)?);
    }
    let source = Source::open(path)?;
    // Of a table the size says nothing of how long its text is.
    let size = if source.is_table() { 0 } else { std::fs::metadata(path).map_or(0, |found| found.len()) };
    let source = source.map(|inner| Watched { inner, read: 0, size, watching });
    Ok(measure_stream(RecordInputJson::new(path, "measured")?, &name, source, format, settings, watching)?)
}

fn text(body: &MetricsJson) -> String {
    let mut header = vec!["measure", "unit"];
    header.extend(body.records.iter().map(|r| r.file.as_str()));
    let stability = format!("bias stability, means over {} s", body.bias_stability_average_s);
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), usual);
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
        text +=
            &format!("\nrepeatability of the bias over {} records: {} °/h\n", body.records.len(), usual(repeatability));
    }
    for record in body.records.iter().filter(|r| !r.noise.is_empty()) {
        text += &format!("\nnoise of {}, intervals that hold together with 95 %\n", record.file);
        text += &table(&["kind", "value", "interval", "unit"], record.noise.iter().map(noise_row));
    }
    for record in &body.records {
        if let Some(scale) = &record.scale_factor {
            text += &format!(
                "\nscale factor of {}, {} even stretches of the table in {} runs\n",
                record.file,
                scale.stretches.len(),
                scale.runs
            );
            text += &table(&["measure", "value", "± standard error", "unit"], scale_rows(scale));
        }
    }
    let known = body.records.iter().filter_map(|r| Some((r, r.earth_rate_deg_per_h?, r.bias_without_earth_deg_per_h?)));
    let rows: Vec<Vec<String>> =
        known.map(|(r, earth, bias)| vec![r.file.clone(), usual(earth), usual(bias)]).collect();
    if !rows.is_empty() {
        text.push('\n');
        text += &table(&["record", "earth's rate °/h", "bias without it °/h"], rows);
    }
    text.extend(body.positions.as_ref().map(words_on_positions));
    for record in &body.records {
        text.extend(record.cautions.iter().map(|caution| format!("\ncaution: {}: {caution}\n", record.file)));
    }
    text
}

/// What steps of the offset between attitudes tell.
fn words_on_positions(found: &PositionsJson) -> String {
    let (value, error) = with_error(found.scale_error_ppm.value, found.scale_error_ppm.standard_error);
    let error = error.map_or(String::new(), |e| format!(" ± {e}"));
    format!(
        "\nsteps of the offset between attitudes: scale factor off by {value}{error} ppm, bias of the gyro itself {} °/h\n",
        usual(found.bias_deg_per_h)
    )
}

/// A kind of noise, its value and interval as far as they are known.
fn noise_row(n: &NoiseJson) -> Vec<String> {
    let [value, low, high] = known([n.value, n.low, n.high], 0.5 * (n.high - n.low));
    let (value, within) = match (n.value > 0.0, n.low > 0.0) {
        (true, true) => (value, format!("{low} to {high}")),
        (true, false) => (value, format!("0 to {high}")),
        (false, _) => ("not seen".to_owned(), format!("at most {high}")),
    };
    vec![n.kind.replace('_', " "), value, within, n.unit.clone()]
}

/// A value and its standard error, as far as it is known.
fn with_error(value: f64, error: Option<f64>) -> (String, Option<String>) {
    match error {
        Some(error) if error > 0.0 && error.is_finite() => {
            let [value, error] = known([value, error], error);
            (value, Some(error))
        }
        _ => (usual(value), None),
    }
}

fn scale_rows(scale: &ScaleFactorJson) -> Vec<Vec<String>> {
    let row = |name: String, value: Option<f64>, error: Option<f64>, unit: &str| {
        let none = || "-".to_owned();
        let (value, error) = value.map_or_else(|| (none(), None), |value| with_error(value, error));
        vec![name, value, error.unwrap_or_else(none), unit.to_owned()]
    };
    let estimate = |name: &str, of: Option<&EstimateJson>, unit: &str| {
        row(name.to_owned(), of.map(|e| e.value), of.and_then(|e| e.standard_error), unit)
    };
    let mut rows = vec![
        estimate(&format!("error at {:.1} °C", scale.at_temperature_c), Some(&scale.error_ppm), "ppm"),
        estimate("temperature coefficient", scale.temperature_coefficient_ppm_per_k.as_ref(), "ppm/K"),
        estimate("hysteresis, warming less cooling", scale.hysteresis_ppm.as_ref(), "ppm"),
        row("nonlinearity".to_owned(), Some(scale.nonlinearity_ppm), None, "ppm"),
        estimate("asymmetry, forwards less backwards", scale.asymmetry_ppm.as_ref(), "ppm"),
        row("repeatability over runs".to_owned(), scale.repeatability_ppm, None, "ppm"),
        row("offset".to_owned(), Some(scale.offset_deg_per_h), None, "°/h"),
    ];
    if let Some(raw) = scale.raw_units_per_deg_per_h {
        rows.push(vec!["scale factor".to_owned(), format!("{raw:.9}"), "-".to_owned(), "raw units per °/h".to_owned()]);
    }
    rows
}
