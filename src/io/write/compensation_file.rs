//! Compensation as text: CSV lines in, CSV lines out.

use std::io::{BufRead, BufReader, Read, Write};

use serde::Serialize;

use crate::compensate::Compensator;
use crate::compensate::formulas::FormulaColumns;
use crate::compensate::stream::{Compensated, Reading, Stream};
use crate::io::fault::Faults;
use crate::io::read::csv_rows::{CsvPiece, CsvRows};
use crate::io::read::record_columns::{COMPENSATED, ColumnQuantity, FLAGS, RecordColumn, RecordFormat};
use crate::io::read::record_head::Head;
use crate::io::read::record_rows::{NO_HEADER, header_columns};
use crate::io::table::PassedRow;
use crate::io::write::leave_one_out::LeaveOneOutJson;
use crate::io::write::measures::MeasuresJson;
use crate::io::write::stream_summary::StreamSummary;
use crate::numeric::statistics::RunningDeviation;
use crate::units::{celsius_from_kelvin, deg_per_h_from_rad_per_s};

/// Why a stream ended before its input did.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "its messages say what each means")]
pub enum StreamError {
    #[error("{0}")]
    Header(#[from] Faults),
    #[error("error: cannot read the input: {0}")]
    Read(std::io::Error),
    #[error("error: cannot write the output: {0}")]
    Write(std::io::Error),
}

/// What is passed on of a place of the input.
struct Passed {
    text: String,
    is_aside: bool,
    time_s: Option<f64>,
    rate_rad_per_s: Option<f64>,
    /// Whether its numbers have decimal commas.
    has_commas: bool,
}

/// The flag of rows that the offset of a start-up is learned from.
const TURN_ON: &str = "turn_on";

/// What a start-up adds to the bias: the mean of what compensation leaves while the gyro stands still at the beginning.
#[derive(Debug)]
struct TurnOn {
    for_s: f64,
    first_s: Option<f64>,
    sum_rad_per_s: f64,
    rows: usize,
}

impl TurnOn {
    /// The rate without the offset as it is known by then, and whether it is still being learned. What is odd about a row teaches nothing.
    fn taken_off(&mut self, time_s: f64, rate_rad_per_s: f64, is_sound: bool) -> (f64, bool) {
        let learns = time_s - *self.first_s.get_or_insert(time_s) < self.for_s;
        if learns && is_sound {
            self.sum_rad_per_s += rate_rad_per_s;
            self.rows += 1;
        }
        (rate_rad_per_s - self.offset_rad_per_s(), learns)
    }

    fn offset_rad_per_s(&self) -> f64 {
        if self.rows == 0 { 0.0 } else { self.sum_rad_per_s / self.rows as f64 }
    }
}

/// Which cells of a row are needed.
struct Places {
    count: usize,
    columns: Vec<(usize, RecordColumn)>,
    /// Of each further column that the compensator reads, its place among `columns`.
    channels: Vec<usize>,
}

/// Compensates row by row; every one comes out, in order, delayed by the compensator's delay.
///
/// What is passed on is what came in, but for what a spreadsheet or a terminal would take for a command.
///
/// # Errors
/// A header that lacks what is needed; an input or output that fails.
pub fn compensate_lines(
    compensator: &Compensator,
    format: &RecordFormat,
    name: &str,
    input: impl Read,
    output: impl Write,
) -> Result<StreamSummary, StreamError> {
    compensate_lines_from_turn_on(compensator, format, name, input, output, None)
}

/// As [`compensate_lines`], without what this start-up added to the bias: the mean of what is left of the first `turn_on_s`
/// seconds, in which the gyro stands still.
///
/// # Errors
/// As [`compensate_lines`].
pub(crate) fn compensate_lines_from_turn_on(
    compensator: &Compensator,
    format: &RecordFormat,
    name: &str,
    input: impl Read,
    output: impl Write,
    turn_on_s: Option<f64>,
) -> Result<StreamSummary, StreamError> {
    let mut rows = CsvRows::new(BufReader::with_capacity(1 << 16, input));
    let mut sink = Sink::new(std::io::BufWriter::with_capacity(1 << 16, output));
    sink.turn_on = turn_on_s.map(|for_s| TurnOn { for_s, first_s: None, sum_rad_per_s: 0.0, rows: 0 });
    let mut asides = Vec::new();
    let is_comment = |line: &str| line.starts_with('#') || line.trim().is_empty();
    // What a logger says above its columns stays, as comments.
    let kept = |line: &str| if is_comment(line) { line.to_owned() } else { format!("# {line}") };
    let Some(head) = rows.record_head(format, |line| asides.push(kept(line))).map_err(StreamError::Read)? else {
        return Err(Faults::of_file(name, NO_HEADER).into());
    };
    let division = head.division;
    let (places, may_hold_words) = places(name, &head, &rows, format, compensator)?;
    let passed_row = PassedRow { separator: division.separator, decimal_comma: division.decimal_comma };
    sink.separator = char::from(division.separator);
    asides.iter().for_each(|line| sink.plain(&passed_row.aside(line)));
    let header = passed_row.cells(rows.text(), rows.names());
    rows.expect(may_hold_words.into_iter());
    let separator = sink.separator;
    sink.plain(&format!("{header}{separator}{COMPENSATED}{separator}{FLAGS}"));
    if rows.units_row(&head).map_err(StreamError::Read)? {
        let units = passed_row.cells(rows.text(), rows.cells());
        sink.plain(&format!("{units}{separator}deg_per_h{separator}"));
    }
    let mut channels = vec![None; places.columns.len()];
    let mut stream: Stream<Passed> = Stream::new(compensator);
    while let Some(piece) = rows.next().map_err(StreamError::Read)? {
        let is_aside = piece == CsvPiece::Aside;
        let reading = if is_aside { None } else { reading(rows.cells(), &places, compensator, &mut channels) };
        let text = match piece {
            CsvPiece::Aside => passed_row.aside(rows.text()),
            CsvPiece::Row if rows.len() == places.count => passed_row.cells(rows.text(), rows.cells()),
            // As one quoted cell, so that the output stays a table and nothing is lost.
            CsvPiece::Row | CsvPiece::Broken(_) => passed_row.one_cell(rows.text(), places.count),
        };
        let time_s = reading.as_ref().map(|r| r.time_s);
        let has_commas = passed_row.has_decimal_comma(rows.cells());
        let rate_rad_per_s = reading.and_then(|r| r.rate_rad_per_s);
        let passed = Passed { text, is_aside, time_s, rate_rad_per_s, has_commas };
        stream.push(passed, reading, |row| sink.row(row));
        if rows.waits() {
            // Whoever feeds line by line waits for what is ready.
            sink.flush();
        }
        sink.check()?;
    }
    sink.summary.delay_rows = stream.delay_rows();
    stream.finish(|row| sink.row(row));
    sink.flush();
    sink.check()?;
    let mut summary = sink.summary;
    summary.judge(&sink.before, &sink.after);
    summary.turn_on_offset_deg_per_h = sink.turn_on.map(|t| deg_per_h_from_rad_per_s(t.offset_rad_per_s()));
    Ok(summary)
}

/// With them, of each column whether it may hold words.
fn places(
    name: &str,
    head: &Head,
    header: &CsvRows<impl BufRead>,
    format: &RecordFormat,
    compensator: &Compensator,
) -> Result<(Places, Vec<bool>), Faults> {
    let columns = header_columns(name, head, header, format)?;
    if let Some(own) = columns.iter().find(|c| [COMPENSATED, FLAGS].contains(&c.name.as_str())) {
        let message = format!(
            "column {} is what compensating adds: expected a record that has not been compensated yet; leave the column out",
            own.name
        );
        return Err(Faults::of_file(name, message));
    }
    let may_hold_words = columns.iter().map(|c| c.quantity == ColumnQuantity::Channel).collect();
    let count = columns.len();
    let names = compensator.channel_names();
    let needed = |c: &RecordColumn| match c.quantity {
        ColumnQuantity::Date
        | ColumnQuantity::Time
        | ColumnQuantity::Temperature
        | ColumnQuantity::Rate
        | ColumnQuantity::InnerTemperature => true,
        ColumnQuantity::Channel | ColumnQuantity::Sensor(_) => {
            c.channel().is_some_and(|name| names.contains(&name.as_str()))
        }
        ColumnQuantity::AmbientTemperature | ColumnQuantity::Table => false,
    };
    let columns: Vec<(usize, RecordColumn)> = columns.into_iter().enumerate().filter(|(_, c)| needed(c)).collect();
    let place = |wanted: &&str| {
        let found = columns.iter().position(|(_, c)| c.channel().as_deref() == Some(*wanted));
        found.ok_or_else(|| Faults::of_file(name, format!("the model reads the column {wanted}, which is not there")))
    };
    let channels = names.iter().map(place).collect::<Result<_, _>>()?;
    Ok((Places { count, columns, channels }, may_hold_words))
}

/// None where the cells are not as many as the header's or the time is no number; `channels` is room for the further columns.
fn reading<'r>(
    cells: impl Iterator<Item = &'r str>,
    places: &Places,
    compensator: &Compensator,
    channels: &mut [Option<f64>],
) -> Option<Reading> {
    let mut found = Reading {
        time_s: f64::NAN,
        temperature_k: None,
        inner_k: None,
        channel_rad_per_s: Some(0.0),
        columns: FormulaColumns::default(),
        rate_rad_per_s: None,
    };
    let mut date_s = 0.0;
    let mut count = 0;
    let mut next = 0;
    for cell in cells {
        if let Some((place, column)) = places.columns.get(next)
            && *place == count
        {
            let value = column.value(cell).ok();
            match column.quantity {
                ColumnQuantity::Date => date_s = value?,
                ColumnQuantity::Time => found.time_s = value?,
                ColumnQuantity::Temperature => found.temperature_k = value,
                ColumnQuantity::Rate => found.rate_rad_per_s = value,
                ColumnQuantity::InnerTemperature => found.inner_k = value,
                ColumnQuantity::Channel | ColumnQuantity::Sensor(_) => {
                    channels[next] = value.map(|v| column.in_channel(v))
                }
                ColumnQuantity::AmbientTemperature | ColumnQuantity::Table => {}
            }
            next += 1;
        }
        count += 1;
    }
    found.time_s += date_s;
    if let Compensator::Physical(physical) = compensator {
        found.channel_rad_per_s = physical.channel_bias_rad_per_s(places.channels.iter().map(|c| channels[*c]));
        // The columns of formulas stand behind those of the channels' own effects.
        let of_formulas = places.channels.iter().skip(physical.channel_names().count());
        found.columns.iter_mut().zip(of_formulas).for_each(|(value, c)| *value = channels[*c]);
    }
    (count == places.count).then_some(found)
}

struct Sink<W: Write> {
    output: W,
    summary: StreamSummary,
    before: RunningDeviation,
    after: RunningDeviation,
    text: String,
    separator: char,
    has_commas: bool,
    turn_on: Option<TurnOn>,
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
            separator: ',',
            has_commas: false,
            turn_on: None,
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

    /// Between two flags of a row: nothing that divides cells.
    fn between_flags(&self) -> char {
        if self.separator == '|' { '+' } else { '|' }
    }

    fn row(&mut self, row: Compensated<Passed>) {
        if row.tag.is_aside {
            self.plain(&row.tag.text);
            return;
        }
        self.summary.rows += 1;
        self.text.clear();
        self.text.push_str(&row.tag.text);
        self.text.push(self.separator);
        let is_sound = row.flags.is_empty();
        let turned_on = match (&mut self.turn_on, row.tag.time_s, row.rate_rad_per_s) {
            (Some(turn_on), Some(time_s), Some(rate)) => Some(turn_on.taken_off(time_s, rate, is_sound)),
            _ => None,
        };
        let rate = turned_on.map(|(rate, _)| rate).or(row.rate_rad_per_s);
        let is_learning = turned_on.is_some_and(|(_, learns)| learns);
        if let Some(rate) = rate {
            // A row of whole numbers says nothing: as the rows before it.
            self.has_commas |= row.tag.has_commas;
            let shown = format!("{:.8}", deg_per_h_from_rad_per_s(rate));
            self.text.push_str(&if self.has_commas { shown.replace('.', ",") } else { shown });
        }
        self.text.push(self.separator);
        for (i, flag) in row.flags.iter().enumerate() {
            if i > 0 {
                self.text.push(self.between_flags());
            }
            self.text.push_str(flag.word());
            self.summary.count(*flag);
        }
        if is_learning {
            if !is_sound {
                self.text.push(self.between_flags());
            }
            self.text.push_str(TURN_ON);
        }
        if let (true, Some(before), Some(after)) = (is_sound && !is_learning, row.tag.rate_rad_per_s, rate) {
            self.before.push(before);
            self.after.push(after);
        }
        self.text.push('\n');
        let done = self.output.write_all(self.text.as_bytes());
        self.keep(done);
    }
}

/// One method on a hold-out.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct MethodJson {
    pub(crate) method: &'static str,
    /// Null where the method cannot be used; `reason` then says why.
    pub(crate) rms_deg_per_h: Option<f64>,
    pub(crate) delay_rows: Option<usize>,
    pub(crate) reason: Option<String>,
    /// What is left, measured as `metrics` measures it.
    pub(crate) measures: Option<MeasuresJson>,
}

/// The answer of `compensate --fit`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct CompensateJson {
    pub(crate) model: String,
    pub(crate) method: &'static str,
    pub(crate) summary: Option<StreamSummary>,
    pub(crate) noise_floor_deg_per_h: Option<f64>,
    /// Of the record as it is, where all methods were asked for.
    pub(crate) before: Option<MeasuresJson>,
    /// All methods on the hold-out, where that was asked for.
    pub(crate) methods: Vec<MethodJson>,
    /// All methods on each fitted record, left out in turn, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) leave_one_out: Option<LeaveOneOutJson>,
    pub(crate) lines: Vec<BiasLineJson>,
}

/// A straight piece of the bias over temperature.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub(crate) struct BiasLineJson {
    /// Null: to the end.
    pub(crate) until_c: Option<f64>,
    /// Where that end may lie, with 95 % confidence.
    pub(crate) until_within_c: Option<[f64; 2]>,
    pub(crate) at_20_c_deg_per_h: f64,
    pub(crate) slope_deg_per_h_per_c: f64,
}

impl BiasLineJson {
    /// Empty for other compensators.
    pub(crate) fn all(compensator: &Compensator) -> Vec<Self> {
        let Compensator::Piecewise(piecewise) = compensator else { return Vec::new() };
        let json = |line: &crate::compensate::empirical::BiasLine| Self {
            until_c: Some(celsius_from_kelvin(line.until_k)).filter(|c| c.is_finite()),
            until_within_c: line.until_within_k.map(|(low, high)| [low, high].map(celsius_from_kelvin)),
            at_20_c_deg_per_h: deg_per_h_from_rad_per_s(line.at_reference_rad_per_s),
            slope_deg_per_h_per_c: deg_per_h_from_rad_per_s(line.slope_rad_per_s_k),
        };
        piecewise.lines.iter().map(json).collect()
    }
}
