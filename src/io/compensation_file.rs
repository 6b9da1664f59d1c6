//! Compensation as text: CSV lines in, CSV lines out; and the physical compensator for an embedded target.

use std::fmt::Write as _;
use std::io::{BufRead, Read, Write};

use serde::Serialize;

use super::fault::{Fault, Faults};
use super::record_file::{Column, Quantity, read_header};
use crate::compensate::Compensator;
use crate::compensate::physical::{Filter, Physical};
use crate::compensate::stream::{Compensated, Flag, Reading, Stream};
use crate::numeric::statistics::RunningDeviation;
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s};

/// The column that is added, and the one that says what happened to a row.
pub const ADDED_COLUMNS: &str = "rate_compensated_deg_per_h,flags";
/// A longer line is no row of a record; it is cut here and flagged.
const LONGEST_LINE_BYTES: u64 = 64 * 1024;

/// What a stream did.
#[derive(Debug, Clone, Default, Serialize)]
pub struct StreamSummary {
    pub rows: usize,
    pub delay_rows: usize,
    pub malformed: usize,
    pub clock_back: usize,
    pub gap: usize,
    pub temperature_held: usize,
    pub rate_held: usize,
    pub rate_rejected: usize,
    /// Standard deviations over the rows without a flag.
    pub rate_deviation_deg_per_h: Option<f64>,
    pub compensated_deviation_deg_per_h: Option<f64>,
}

/// Why a stream ended before its input did.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    #[error("{0}")]
    Header(#[from] Faults),
    #[error("error: cannot read the input: {0}")]
    Read(std::io::Error),
    #[error("error: cannot write the output: {0}")]
    Write(std::io::Error),
}

/// One line on its way through.
struct Line {
    text: String,
    rate_rad_per_s: Option<f64>,
}

/// Which fields of a line are needed.
struct Places {
    count: usize,
    columns: Vec<(usize, Column)>,
}

/// Compensates line by line; every line comes out, in order, delayed by the compensator's delay.
///
/// # Errors
/// A header that lacks what is needed; an input or output that fails.
pub fn compensate_lines(
    compensator: &Compensator,
    name: &str,
    input: impl Read,
    output: impl Write,
) -> Result<StreamSummary, StreamError> {
    let mut input = std::io::BufReader::with_capacity(1 << 16, input);
    let mut sink = Sink::new(std::io::BufWriter::with_capacity(1 << 16, output));
    let mut bytes = Vec::new();
    let places = loop {
        if !next_line(&mut input, &mut bytes)? {
            let message = "expected a header such as time_s,temperature_c,rate_deg_per_h, found nothing";
            return Err(Faults::of_file(name, message).into());
        }
        let line = String::from_utf8_lossy(&bytes);
        let line = line.trim_start_matches('\u{feff}');
        if is_comment(line) {
            sink.plain(line);
            continue;
        }
        let places = places(name, line)?;
        sink.plain(&format!("{line},{ADDED_COLUMNS}"));
        break places;
    };
    let mut stream: Stream<Line> = Stream::new(compensator);
    while next_line(&mut input, &mut bytes)? {
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let reading = if is_comment(&text) { None } else { reading(&text, &places) };
        let line = Line { rate_rad_per_s: reading.and_then(|r| r.rate_rad_per_s), text };
        stream.push(line, reading, |row| sink.row(row, places.count));
        if input.buffer().is_empty() {
            // Whoever feeds line by line waits for what is ready.
            sink.flush();
        }
        sink.check()?;
    }
    sink.summary.delay_rows = stream.delay_rows();
    stream.finish(|row| sink.row(row, places.count));
    sink.flush();
    sink.check()?;
    let mut summary = sink.summary;
    summary.rate_deviation_deg_per_h = sink.before.deviation().map(deg_per_h_from_rad_per_s);
    summary.compensated_deviation_deg_per_h = sink.after.deviation().map(deg_per_h_from_rad_per_s);
    Ok(summary)
}

fn is_comment(line: &str) -> bool {
    line.is_empty() || line.starts_with('#')
}

fn next_line(input: &mut impl BufRead, bytes: &mut Vec<u8>) -> Result<bool, StreamError> {
    bytes.clear();
    let read = input.take(LONGEST_LINE_BYTES).read_until(b'\n', bytes).map_err(StreamError::Read)?;
    while matches!(bytes.last(), Some(b'\n' | b'\r')) {
        bytes.pop();
    }
    Ok(read > 0)
}

fn places(name: &str, header: &str) -> Result<Places, Faults> {
    let fields: Vec<&str> = header.split(',').map(|f| f.trim().trim_matches('"')).collect();
    let columns = read_header(&fields).map_err(|faults| Faults {
        file: name.to_owned(),
        source: header.to_owned(),
        faults: faults
            .into_iter()
            .map(|(message, note)| Fault { message, span: Some(0..header.len()), note })
            .collect(),
    })?;
    let count = columns.len();
    let needed = |c: &Column| {
        matches!(c.quantity, Quantity::Time | Quantity::Temperature | Quantity::Rate | Quantity::InnerTemperature)
    };
    Ok(Places { count, columns: columns.into_iter().enumerate().filter(|(_, c)| needed(c)).collect() })
}

/// None where the fields are not as many as the header's or the time is no number.
fn reading(line: &str, places: &Places) -> Option<Reading> {
    let mut found = Reading { time_s: f64::NAN, temperature_k: None, inner_k: None, rate_rad_per_s: None };
    let mut count = 0;
    let mut next = 0;
    for field in line.split(',') {
        if let Some((place, column)) = places.columns.get(next)
            && *place == count
        {
            let value = column.value(field.trim().trim_matches('"')).ok();
            match column.quantity {
                Quantity::Time => found.time_s = value?,
                Quantity::Temperature => found.temperature_k = value,
                Quantity::Rate => found.rate_rad_per_s = value,
                Quantity::InnerTemperature => found.inner_k = value,
                Quantity::AmbientTemperature | Quantity::Channel => {}
            }
            next += 1;
        }
        count += 1;
    }
    (count == places.count).then_some(found)
}

struct Sink<W: Write> {
    output: W,
    summary: StreamSummary,
    before: RunningDeviation,
    after: RunningDeviation,
    text: String,
    failed: Option<std::io::Error>,
}

impl<W: Write> Sink<W> {
    fn new(output: W) -> Self {
        Self {
            output,
            summary: StreamSummary::default(),
            before: RunningDeviation::default(),
            after: RunningDeviation::default(),
            text: String::new(),
            failed: None,
        }
    }

    fn plain(&mut self, line: &str) {
        let done = writeln!(self.output, "{line}");
        self.keep(done);
    }

    fn keep(&mut self, done: std::io::Result<()>) {
        if let Err(error) = done {
            self.failed.get_or_insert(error);
        }
    }

    fn flush(&mut self) {
        let done = self.output.flush();
        self.keep(done);
    }

    fn check(&mut self) -> Result<(), StreamError> {
        self.failed.take().map_or(Ok(()), |error| Err(StreamError::Write(error)))
    }

    fn row(&mut self, row: Compensated<Line>, columns: usize) {
        if is_comment(&row.tag.text) {
            let text = row.tag.text;
            self.plain(&text);
            return;
        }
        self.summary.rows += 1;
        self.text.clear();
        if row.flags.contains(&Flag::Malformed) && row.tag.text.split(',').count() != columns {
            // As one quoted field, so that the output stays a table and nothing is lost.
            let _ = write!(self.text, "\"{}\"{}", row.tag.text.replace('"', "\"\""), ",".repeat(columns - 1));
        } else {
            self.text.push_str(&row.tag.text);
        }
        self.text.push(',');
        if let Some(rate) = row.rate_rad_per_s {
            let _ = write!(self.text, "{:.8}", deg_per_h_from_rad_per_s(rate));
        }
        self.text.push(',');
        for (i, flag) in row.flags.iter().enumerate() {
            if i > 0 {
                self.text.push('|');
            }
            self.text.push_str(flag.word());
            let count = match flag {
                Flag::Malformed => &mut self.summary.malformed,
                Flag::ClockBack => &mut self.summary.clock_back,
                Flag::Gap => &mut self.summary.gap,
                Flag::TemperatureHeld => &mut self.summary.temperature_held,
                Flag::RateHeld => &mut self.summary.rate_held,
                Flag::RateRejected => &mut self.summary.rate_rejected,
            };
            *count += 1;
        }
        if let (true, Some(before), Some(after)) = (row.flags.is_empty(), row.tag.rate_rad_per_s, row.rate_rad_per_s) {
            self.before.push(before);
            self.after.push(after);
        }
        self.text.push('\n');
        let done = self.output.write_all(self.text.as_bytes());
        self.keep(done);
    }
}

/// The physical compensator as a difference equation: °C in, °/h out.
#[derive(Debug, Serialize)]
pub struct DifferenceEquation {
    pub model: String,
    pub equations: [&'static str; 4],
    pub interval_s: f64,
    /// The rate error that comes out belongs to the row so many rows ago.
    pub delay_rows: usize,
    pub offset_deg_per_h: f64,
    /// F, row by row.
    pub transition: Vec<Vec<f64>>,
    /// ω [°/h per °C].
    pub rate: Vec<f64>,
    /// h.
    pub reading: Vec<f64>,
    /// k.
    pub gain: Vec<f64>,
    /// κ [°/h per °C].
    pub chain_gain: Vec<f64>,
    /// States that start at the first reading; the others start at 0.
    pub level_states: Vec<usize>,
}

impl DifferenceEquation {
    /// None where the model has a bias over temperature, which is no difference equation.
    pub fn new(model: &str, physical: &Physical, interval_s: f64, delay_rows: usize) -> Option<Self> {
        if !physical.is_linear() {
            return None;
        }
        let filter = Filter::new(physical, interval_s, delay_rows);
        let shown = |values: &[f64]| values.iter().map(|v| deg_per_h_from_rad_per_s(*v)).collect::<Vec<f64>>();
        Some(Self {
            model: model.to_owned(),
            equations: [
                "x = F x_before; o[0] = rate . x_before; o[j] = o_before[j-1]",
                "e = temperature_c - reading . x",
                "x = x + gain e; o[j] = o[j] + chain_gain[j] e (without a reading: e = 0)",
                "rate error of the row delay_rows ago = o[delay_rows] + offset; first reading: level_states = reading",
            ],
            interval_s,
            delay_rows,
            offset_deg_per_h: deg_per_h_from_rad_per_s(physical.offset_rad_per_s),
            transition: filter.transition.chunks(filter.state.len()).map(<[f64]>::to_vec).collect(),
            rate: shown(&filter.rate),
            reading: filter.reading,
            gain: filter.gain,
            chain_gain: shown(&filter.chain_gain),
            level_states: filter.level_states,
        })
    }

    /// The same as a C header that needs nothing else.
    pub fn c_header(&self) -> String {
        let list = |values: &[f64]| values.iter().map(|v| format!("{v:.17e}")).collect::<Vec<_>>().join(", ");
        let rows: Vec<String> = self.transition.iter().map(|row| format!("  {{{}}}", list(row))).collect();
        let starts: Vec<String> = self.level_states.iter().map(|i| format!("    s->x[{i}] = temperature_c;")).collect();
        let name: String = self.model.chars().map(|c| if c.is_ascii_graphic() { c } else { ' ' }).collect();
        format!(
            r"/* Thermal rate error of a fibre-optic gyro's coil from one temperature: {name}.
   Call coilwright_step once every {interval} s. It returns the rate error [deg/h] of the call {delay} calls ago;
   subtract it from the rate of that call. valid = 0: no reading, the model goes on by itself. */
#ifndef COILWRIGHT_COMPENSATION_H
#define COILWRIGHT_COMPENSATION_H

#define COILWRIGHT_STATES {n}
#define COILWRIGHT_DELAY {delay}

typedef struct {{
  double x[COILWRIGHT_STATES];
  double o[COILWRIGHT_DELAY + 1];
  int started;
}} coilwright_state;

static const double coilwright_transition[COILWRIGHT_STATES][COILWRIGHT_STATES] = {{
{transition}
}};
static const double coilwright_rate[COILWRIGHT_STATES] = {{{rate}}};
static const double coilwright_reading[COILWRIGHT_STATES] = {{{reading}}};
static const double coilwright_gain[COILWRIGHT_STATES] = {{{gain}}};
static const double coilwright_chain_gain[COILWRIGHT_DELAY + 1] = {{{chain_gain}}};
static const double coilwright_offset = {offset:.17e};

static void coilwright_start(coilwright_state *s) {{
  int i;
  for (i = 0; i < COILWRIGHT_STATES; ++i) s->x[i] = 0.0;
  for (i = 0; i <= COILWRIGHT_DELAY; ++i) s->o[i] = 0.0;
  s->started = 0;
}}

static double coilwright_step(coilwright_state *s, double temperature_c, int valid) {{
  double next[COILWRIGHT_STATES], newest = 0.0, error = 0.0;
  int i, j;
  if (!s->started) {{
    if (!valid) return coilwright_offset;
{starts}
    s->started = 1;
    return coilwright_offset;
  }}
  for (i = 0; i < COILWRIGHT_STATES; ++i) newest += coilwright_rate[i] * s->x[i];
  for (i = 0; i < COILWRIGHT_STATES; ++i) {{
    next[i] = 0.0;
    for (j = 0; j < COILWRIGHT_STATES; ++j) next[i] += coilwright_transition[i][j] * s->x[j];
  }}
  for (i = 0; i < COILWRIGHT_STATES; ++i) s->x[i] = next[i];
  for (i = COILWRIGHT_DELAY; i > 0; --i) s->o[i] = s->o[i - 1];
  s->o[0] = newest;
  if (valid) {{
    error = temperature_c;
    for (i = 0; i < COILWRIGHT_STATES; ++i) error -= coilwright_reading[i] * s->x[i];
    for (i = 0; i < COILWRIGHT_STATES; ++i) s->x[i] += coilwright_gain[i] * error;
    for (i = 0; i <= COILWRIGHT_DELAY; ++i) s->o[i] += coilwright_chain_gain[i] * error;
  }}
  return s->o[COILWRIGHT_DELAY] + coilwright_offset;
}}

#endif
",
            interval = self.interval_s,
            delay = self.delay_rows,
            n = self.rate.len(),
            transition = rows.join(",\n"),
            rate = list(&self.rate),
            reading = list(&self.reading),
            gain = list(&self.gain),
            chain_gain = list(&self.chain_gain),
            offset = self.offset_deg_per_h,
            starts = starts.join("\n"),
        )
    }
}

/// One method on a hold-out.
#[derive(Debug, Clone, Serialize)]
pub struct MethodJson {
    pub method: &'static str,
    /// Null where the method cannot be used; `reason` then says why.
    pub rms_deg_per_h: Option<f64>,
    pub delay_rows: Option<usize>,
    pub reason: Option<String>,
}

#[derive(Debug, Serialize)]
pub struct CompensateJson {
    pub model: String,
    pub method: &'static str,
    pub summary: Option<StreamSummary>,
    pub noise_floor_deg_per_h: Option<f64>,
    /// All methods on the hold-out, where that was asked for.
    pub methods: Vec<MethodJson>,
    pub lines: Vec<BiasLineJson>,
}

/// A straight piece of the bias over temperature.
#[derive(Debug, Clone, Serialize)]
pub struct BiasLineJson {
    /// Null: to the end.
    pub until_c: Option<f64>,
    pub at_20_c_deg_per_h: f64,
    pub slope_deg_per_h_per_c: f64,
}

impl BiasLineJson {
    /// Empty for other compensators.
    pub fn all(compensator: &Compensator) -> Vec<Self> {
        let Compensator::Piecewise(piecewise) = compensator else { return Vec::new() };
        let json = |line: &crate::compensate::empirical::BiasLine| Self {
            until_c: Some(celsius_from_kelvin(line.until_k)).filter(|c| c.is_finite()),
            at_20_c_deg_per_h: deg_per_h_from_rad_per_s(line.at_reference_rad_per_s),
            slope_deg_per_h_per_c: deg_per_h_from_rad_per_s(line.slope_rad_per_s_k),
        };
        piecewise.lines.iter().map(json).collect()
    }
}
