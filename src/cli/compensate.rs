//! `compensate`: temperature and rate in, compensated rate out, as a file or as a stream.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;

use super::pattern_asked::pattern_asked;
use super::records::RecordArguments;
use super::screen::{Screen, run_of, table};
use super::watching::Watching;
use super::{CliError, Ending, offered};
use crate::compensate::{Compensator, Method};
use crate::io::files::{NewFile, write_atomically};
use crate::io::folder::{HeldFolder, check_file};
use crate::io::read::model_file::read_model;
use crate::io::read::record_columns::RecordFormat;
use crate::io::read::table_file::Source;
use crate::io::write::compensation_file::{CompensateJson, compensate_lines_from_turn_on};
use crate::io::write::leave_one_out::LeaveOneOutJson;
use crate::io::write::measures::MeasuresJson;
use crate::io::write::stream_summary::StreamSummary;
use crate::record::LEAST_INTERVAL_S;
use crate::report::compensation::compensation_chart;
use crate::task::compensate::{
    Answer, LONGEST_S, Request, all_methods as try_all, run as compensator_for, write_exported,
};
use crate::task::measurement::Measurement;
use crate::text::number::usual;

/// Temperature and rate in, compensated rate out, as a file or as a stream
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  coilwright compensate coil.toml day-2.csv --fit day-1.csv > compensated.csv\n  logger | coilwright compensate coil.toml - --fit day-1.csv\n  coilwright compensate coil.toml day-2.csv --fit day-1.csv --all-methods\n  coilwright compensate coil.toml --fit day-1.csv --fit day-2.csv --all-methods -o left-out.svg\n  coilwright compensate coil.toml --fit day-1.csv --export embedded/compensation\n\nEvery line comes out, in order, with rate_compensated_deg_per_h and flags behind it: malformed, clock_back, gap,\ntemperature_held, channel_held, rate_held, rate_rejected, turn_on."
)]
pub(crate) struct Arguments {
    /// The model file
    model: PathBuf,
    /// A record (CSV), or - for standard input
    record: Option<PathBuf>,
    /// The record to fit film, noise, delay and offset (or the lines, or the regression) to; again for each further one of the same gyro
    #[arg(long, value_name = "RECORD")]
    fit: Vec<PathBuf>,
    /// How to compensate
    #[arg(long, value_enum, default_value_t = MethodChoice::Physical)]
    method: MethodChoice,
    /// Fits every method and shows how well each does on the record; with several --fit, also on each of those, fitted to the
    /// others
    #[arg(long, requires = "fit")]
    all_methods: bool,
    /// A winding's name or a pattern file; without it, the model's own
    #[arg(long, short, value_name = "PATTERN", value_parser = offered::patterns(), hide_possible_values = true)]
    pattern: Option<String>,
    /// Writes the lines here instead of to stdout; with --all-methods the picture of all (SVG)
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Writes the compensator as FILE.json and FILE.h
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
    /// Looks so far ahead [s]; without it, as far as the fitted record says is worth it
    #[arg(long, value_name = "SECONDS", value_parser = delay_seconds)]
    delay: Option<f64>,
    /// Takes off what this start-up added to the bias: the mean of what is left of the first seconds, in which the gyro must stand
    /// still; those rows are flagged turn_on
    #[arg(long, value_name = "SECONDS", conflicts_with = "all_methods", value_parser = positive_seconds)]
    turn_on: Option<f64>,
    /// One difference equation of fixed gains, without hypotheses about breaks of the air's slope
    #[arg(long)]
    linear: bool,
    /// Interval of the exported compensator [s]; without it, that of the fitted record
    #[arg(long, value_name = "SECONDS", value_parser = interval_seconds)]
    interval: Option<f64>,
    #[command(flatten)]
    reading: RecordArguments,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MethodChoice {
    /// The model's own physics
    Physical,
    /// Straight lines over temperature
    Piecewise,
    /// Linear in T, dT/dt and d(T_out - T_in)/dt
    Regression,
    /// Ridge regression on lagged temperatures
    Learned,
}

impl From<MethodChoice> for Method {
    fn from(way: MethodChoice) -> Self {
        match way {
            MethodChoice::Physical => Method::Physical,
            MethodChoice::Piecewise => Method::Piecewise,
            MethodChoice::Regression => Method::Regression,
            MethodChoice::Learned => Method::Learned,
        }
    }
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Ending, CliError> {
    let file = read_model(&arguments.model)?;
    let exported = arguments.export.iter().flat_map(|prefix| export_paths(prefix));
    for written in arguments.output.iter().cloned().chain(exported) {
        let records = arguments.record.iter().chain(&arguments.fit).map(PathBuf::as_path);
        check_file(&written, file.files().chain(records).chain(arguments.pattern.iter().map(Path::new)))?;
    }
    let format = arguments.reading.format(Some(&file))?;
    let pattern = pattern_asked(&file, arguments.pattern.as_deref())?;
    let fit = arguments.fit.iter().map(|path| Measurement::read(path, &format)).collect::<Result<Vec<_>, _>>()?;
    let request = Request {
        pattern: pattern.as_ref(),
        method: arguments.method.into(),
        fit: &fit,
        linear: arguments.linear,
        delay_s: arguments.delay,
        ..Request::new(&file)
    };
    if arguments.all_methods {
        return all_methods(arguments, &request, &format, screen);
    }
    let prefix = arguments.export.as_deref();
    let held = prefix.map(|prefix| HeldFolder::take_prefix(prefix, &run_of("compensate"))).transpose()?;
    let answer = compensator_for(&request, &Watching::quiet(screen))?;
    if let Some(prefix) = prefix {
        export(&answer, arguments.interval, prefix, screen)?;
        // A stream may go on for days.
        drop(held);
        if arguments.record.is_none() {
            return Ok(Ending::Done);
        }
    }
    let summary = stream(arguments, &format, &answer.compensator, screen)?;
    screen.note(&format!(
        "compensated {} rows ({}), {} rows behind; standard deviation {} -> {} °/h; malformed {}, clock back {}, gaps {}, temperature held {}, channel held {}, rate held {}, rate rejected {}",
        summary.rows,
        request.method.key(),
        summary.delay_rows,
        shown(summary.rate_deviation_deg_per_h),
        shown(summary.compensated_deviation_deg_per_h),
        summary.malformed,
        summary.clock_back,
        summary.gap,
        summary.temperature_held,
        summary.channel_held,
        summary.rate_held,
        summary.rate_rejected
    ));
    if let Some(caution) = &summary.caution {
        screen.note(&format!("caution: {caution}"));
    }
    if let Some(offset) = summary.turn_on_offset_deg_per_h {
        screen.note(&format!("offset of this start-up, taken off: {offset:.5} °/h"));
    }
    if screen.is_json() {
        screen.answer(answer.document(Some(summary)), |_| String::new())?;
    }
    Ok(Ending::Done)
}

fn delay_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|s| (0.0..=LONGEST_S).contains(s));
    seconds.ok_or_else(|| format!("expected a time in seconds from 0 to {LONGEST_S}, found \"{text}\""))
}

/// A compensator whose rows are closer than those of any record, or a day apart, is none.
fn interval_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|s| (LEAST_INTERVAL_S..=LONGEST_S).contains(s));
    seconds
        .ok_or_else(|| format!("expected a time in seconds from {LEAST_INTERVAL_S} to {LONGEST_S}, found \"{text}\""))
}

fn positive_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|s| s.is_finite() && *s > 0.0);
    seconds.ok_or_else(|| format!("expected a time in seconds above zero, found \"{text}\""))
}

fn shown(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |v| format!("{v:.5}"))
}

fn stream(
    arguments: &Arguments,
    format: &RecordFormat,
    compensator: &Compensator,
    screen: &Screen,
) -> Result<StreamSummary, CliError> {
    let path = arguments.record.as_deref().unwrap_or(Path::new("-"));
    let name = path.display().to_string();
    // With a JSON document on stdout the lines have no place there.
    let to_stdout = arguments.output.is_none() && !screen.is_json();
    let mut file = arguments.output.as_deref().map(NewFile::create).transpose()?;
    let mut stdout = std::io::stdout().lock();
    let output: &mut dyn Write = match &mut file {
        Some(file) => file,
        None if to_stdout => &mut stdout,
        None => &mut std::io::sink(),
    };
    let summary = if name == "-" {
        let input = std::io::stdin().lock();
        compensate_lines_from_turn_on(compensator, format, "standard input", input, output, arguments.turn_on)?
    } else {
        let input = Source::open(path)?;
        for remark in input.remarks() {
            screen.note(&format!("note: {name}: {remark}"));
        }
        compensate_lines_from_turn_on(compensator, format, &name, input, output, arguments.turn_on)?
    };
    if let Some(file) = file {
        file.finish()?;
    }
    Ok(summary)
}

/// Of coefficients and of the program in C.
fn export_paths(prefix: &Path) -> [PathBuf; 2] {
    ["json", "h"].map(|extension| prefix.with_extension(extension))
}

fn export(answer: &Answer, interval_s: Option<f64>, prefix: &Path, screen: &Screen) -> Result<(), CliError> {
    let texts = answer.exported(interval_s)?.ok_or(CliError::NoExport)?;
    let paths = export_paths(prefix);
    write_exported(&paths, texts)?;
    paths.iter().for_each(|path| screen.note(&format!("wrote {}", path.display())));
    Ok(())
}

/// Every measure, a column a method.
fn before_and_after<'m>(
    before: &'m MeasuresJson,
    methods: impl Iterator<Item = (&'static str, Option<&'m MeasuresJson>)>,
) -> String {
    let measured: Vec<(&str, &MeasuresJson)> =
        [("before", before)].into_iter().chain(methods.filter_map(|(name, m)| Some((name, m?)))).collect();
    let mut header = vec!["measure", "unit"];
    header.extend(measured.iter().map(|(name, _)| *name));
    let rows = before.all().into_iter().enumerate().map(|(i, (name, unit, _))| {
        let mut row = vec![name.to_owned(), unit.to_owned()];
        row.extend(measured.iter().map(|(_, m)| m.all()[i].2.map_or_else(|| "-".to_owned(), usual)));
        row
    });
    table(&header, rows)
}

fn all_methods(
    arguments: &Arguments,
    request: &Request,
    format: &RecordFormat,
    screen: &Screen,
) -> Result<Ending, CliError> {
    let holdout = arguments.record.as_ref().map(|path| Measurement::read(path, format)).transpose()?;
    let found = try_all(request, holdout.as_ref(), &Watching::quiet(screen))?;
    if let Some(path) = &arguments.output {
        let title = match found.document.before {
            Some(_) => "Rate before and after compensation",
            None => {
                "Rate of each record, one behind the other, before and after compensation by what was fitted to the others"
            }
        };
        write_atomically(path, compensation_chart(title, &found.times_s, &found.curves).svg().as_bytes())?;
        screen.note(&format!("wrote {}", path.display()));
    }
    let body = found.document;
    screen.answer(body, |body| {
        let parts =
            [body.before.as_ref().map(|before| on_holdout(body, before)), body.leave_one_out.as_ref().map(left_out)];
        parts.into_iter().flatten().collect::<Vec<_>>().join("\n")
    })?;
    Ok(Ending::Done)
}

/// On the record that was not fitted.
fn on_holdout(body: &CompensateJson, before: &MeasuresJson) -> String {
    let rows = body.methods.iter().map(|m| {
        vec![
            m.method.to_owned(),
            shown(m.rms_deg_per_h),
            m.delay_rows.map_or_else(|| "-".to_owned(), |d| d.to_string()),
            m.reason.clone().unwrap_or_default(),
        ]
    });
    let noise = shown(body.noise_floor_deg_per_h);
    table(&["method", "rms °/h", "delay rows", ""], rows)
        + &format!("noise floor of the record: {noise} °/h\n\n")
        + &before_and_after(before, body.methods.iter().map(|m| (m.method, m.measures.as_ref())))
}

/// On each fitted record, by what was fitted to the others.
fn left_out(found: &LeaveOneOutJson) -> String {
    let rows = found.methods.iter().map(|m| {
        vec![
            m.method.to_owned(),
            shown(m.fitted_rms_deg_per_h),
            shown(m.left_out_rms_deg_per_h),
            m.reason.clone().unwrap_or_default(),
        ]
    });
    let mut text = format!("{} records, each compensated by what was fitted to the others\n", found.records.len());
    text += &table(&["method", "rms °/h where fitted", "rms °/h left out", ""], rows);
    text += &format!("with nothing but the others' mean rate taken off: {:.5} °/h\n", found.by_offset_rms_deg_per_h);
    for (place, record) in found.records.iter().enumerate() {
        text += &format!("\n{} left out\n", record.file);
        let of_record = found.methods.iter().map(|m| (m.method, m.records[place].measures.as_ref()));
        text += &before_and_after(&record.before, of_record);
        let failed = found.methods.iter().filter_map(|m| Some((m.method, m.records[place].reason.as_ref()?)));
        text.extend(failed.map(|(method, reason)| format!("{method}: {reason}\n")));
    }
    text
}
